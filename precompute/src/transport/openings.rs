//! Openings to the sky as the receivers of a leaf see them: where a single receiver's rays are too few.
//!
//! A window that fills a hundredth of the view gets 5 rays of 512, and under a gray sky that is most of the noise. So the sky columns are
//! sums over a lattice [`SKY_TIMES`](super::gather::SKY_TIMES) times as fine, whose rays need to know no more than whether they escape, and which are
//! traced only in directions in which receivers of the leaf, or gather rays of the receiver itself, see the sky. Where nothing stands
//! before the sky, gather rays are enough.

use super::{TransportScene, traced::Traced};
use crate::rays::OccluderHint;
use glam::Vec3;

/// Cells per side of an octahedron unfolded to a square.
const SIDE: usize = 32;
/// Receivers that look, at most.
const LOOKING: usize = 128;
/// Receivers that look in each direction of the finer lattice, at least: of many each looks in a part of them, others in others.
const LOOKS: usize = 16;
/// Sky is no opening any more if there is some in more than this share of the directions that were looked in.
const MOST_SKY: f32 = 0.9;

/// Directions in which receivers of a leaf see the sky through openings.
#[derive(Clone, Debug)]
pub(super) struct Openings {
    /// `[SIDE * SIDE]`.
    has_sky: Vec<bool>,
}

impl Openings {
    /// Of a leaf's receivers; `None` where there are none, or the sky is wide open.
    pub fn of(scene: &TransportScene<'_>, members: &[u32], traced: &mut Traced) -> Option<Self> {
        let (mut is_seen, mut has_sky) = (vec![false; SIDE * SIDE], vec![false; SIDE * SIDE]);
        let looking = members.len().min(LOOKING);
        let one_in = (looking / LOOKS).max(1);
        for index in 0..looking {
            let member = members[index * members.len() / looking] as usize;
            let mut hint = OccluderHint::default();
            for ray in scene
                .gather
                .rays_to_sky(scene.receivers.sites(member), scene.caster.offset_m())
                .skip(index % one_in)
                .step_by(one_in)
            {
                let cell = cell(ray.dir);
                is_seen[cell] = true;
                has_sky[cell] |= traced.escapes(scene.caster, ray.origin, ray.dir, &mut hint);
            }
        }
        let count = |of: &[bool]| of.iter().filter(|&&is| is).count() as f32;
        let (sky, all) = (count(&has_sky), count(&is_seen));
        // Where nobody has looked there may be some.
        let has_sky = has_sky.into_iter().zip(is_seen).map(|(sky, is_seen)| sky || !is_seen).collect();
        (sky > 0.0 && sky <= MOST_SKY * all).then_some(Self { has_sky })
    }

    /// Whether there may be sky in about this direction.
    pub fn may_show(&self, dir: Vec3) -> bool {
        self.has_sky[cell(dir)]
    }

    /// Takes in that there is sky in this direction.
    pub fn show(&mut self, dir: Vec3) {
        self.has_sky[cell(dir)] = true;
    }
}

fn cell(dir: Vec3) -> usize {
    let flat = dir / (dir.x.abs() + dir.y.abs() + dir.z.abs());
    let (x, z) = match flat.y >= 0.0 {
        true => (flat.x, flat.z),
        false => ((1.0 - flat.z.abs()).copysign(flat.x), (1.0 - flat.x.abs()).copysign(flat.z)),
    };
    let within = |place: f32| (((0.5 * place + 0.5) * SIDE as f32) as usize).min(SIDE - 1);
    within(z) * SIDE + within(x)
}
