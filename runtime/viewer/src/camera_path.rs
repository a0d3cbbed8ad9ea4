//! A flight for recordings.

use crate::open_bake::OpenBake;
use crate::viewpoint::Viewpoint;

/// Where the camera is at a share, 0..1, of a flight: through the scene's cameras and back to the first, or once around
/// what the only one looks at, swaying from side to side so that it stays where it can see.
pub fn camera_path(bake: &OpenBake<'_>, start: &Viewpoint, share: f32) -> Viewpoint {
    if bake.scene().cameras.len() < 2 {
        return sway(start, share);
    }
    let stations: Vec<Viewpoint> =
        bake.cameras.iter().map(|camera| Viewpoint::of_camera(camera, start.focus_m)).collect();
    let at = share.rem_euclid(1.0) * stations.len() as f32;
    let from = at as usize % stations.len();
    // Starts and stops gently at every station.
    let eased = |share: f32| share * share * (3.0 - 2.0 * share);
    stations[from].mix(&stations[(from + 1) % stations.len()], eased(at.fract()))
}

/// Widest turn of a swaying camera to either side, radians.
const SWAY: f32 = 0.3;

fn sway(start: &Viewpoint, share: f32) -> Viewpoint {
    let angle = share * std::f32::consts::TAU;
    let mut at = *start;
    at.orbit(SWAY * angle.sin(), 0.25 * SWAY * (1.0 - angle.cos()));
    at
}
