//! Two fields over one window: the same probes, rays and random numbers, with what moves and without.

use super::Settings;
use super::region::Region;
use crate::ddgi_scaled::{ScaledDdgi, Volume, Window};
use crate::{Object, Query, Shaded, System, Work, World};
use glam::Vec3;

/// The fields, and where they act.
pub struct Pair {
    /// Traces what moves, too.
    pub with: ScaledDdgi,
    /// Traces what stands still alone.
    pub without: ScaledDdgi,
    /// Where the change is found.
    pub region: Region,
    /// From a probe to the next, metres.
    pub cell: Vec3,
    /// Size that the window was made for.
    extent: Vec3,
}

impl Pair {
    /// Around objects. Probes find their places among what stands still, so that both have the same.
    pub fn new(still: &World<'_>, region: Region, objects: &[Object], settings: &Settings, seed: u64) -> Self {
        let grid = region.grid(settings.probes);
        let field = || {
            let volume = Volume::following(Window::new(grid), &settings.field);
            ScaledDdgi::new(still, vec![volume], objects.to_vec(), settings.field, seed)
        };
        Self { with: field(), without: field(), region, cell: grid.spacing, extent: region.extent }
    }

    /// Whether the window is of the size for a region, to a cell.
    pub fn fits(&self, region: &Region) -> bool {
        (self.extent - region.extent).abs().cmple(self.cell).all()
    }

    /// Follows objects to a region.
    pub fn follow(&mut self, still: &World<'_>, region: Region, objects: &[Object], number: u64) -> Work {
        self.region = region;
        let mut work = Work::default();
        for field in [&mut self.with, &mut self.without] {
            field.set_moving(objects);
            work += field.arrange(still, Some(region.center()), number);
        }
        work
    }

    /// What both fields say at points.
    pub fn lights(&self, world: &World<'_>, points: &[Shaded]) -> (Vec<Vec3>, Vec<Vec3>) {
        let query = Query::of(points);
        (self.with.irradiance(world, &query), self.without.irradiance(world, &query))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{furnace, furnace_points, in_world};
    use crate::{Feedback, Frame};
    use localprt_scenes::{Lighting, Mesh, Scene};

    const OBJECT: Object = Object { low: Vec3::new(1.5, 1.0, 2.0), high: Vec3::new(2.5, 1.5, 3.0) };

    /// The furnace with a level sheet in it, black and seen from below.
    fn with_sheet() -> Scene {
        let mut scene = furnace(0.5, 1.0);
        let Object { low, high } = OBJECT;
        let corners = [(low.x, low.z), (high.x, low.z), (high.x, high.z), (low.x, high.z)];
        scene.materials.push(localprt_scenes::Material::default());
        scene.meshes.push(Mesh {
            name: "sheet".into(),
            material: 1,
            positions: corners.map(|(x, z)| Vec3::new(x, low.y, z)).to_vec(),
            normals: vec![Vec3::NEG_Y; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        });
        scene
    }

    /// Both fields after some frames.
    fn pair(changed: &Scene, frames: u64) -> (Vec<Vec3>, Vec<Vec3>) {
        let (scene, lighting) = (furnace(0.5, 1.0), Lighting::default());
        in_world(&scene, &lighting, |still| {
            let settings = Settings { probes: 32, ..Settings::default() };
            let region = Region::around(&[OBJECT], still.bounds(), 1.0).expect("an object");
            let mut pair = Pair::new(still, region, &[OBJECT], &settings, 3);
            in_world(changed, &lighting, |world| {
                for number in 0..frames {
                    let feedback = Feedback::Nothing;
                    let frame = Frame { world, number, camera: None, feedback, events: &[], still: false };
                    pair.follow(still, region, &[OBJECT], number);
                    let found = [pair.with.trace(&frame), pair.without.trace(&Frame { world: still, ..frame })];
                    let [with, without] = found;
                    assert_eq!(pair.with.take(&frame, with), pair.without.take(&frame, without));
                    assert!(pair.with.states().eq(pair.without.states()));
                }
            });
            let points: Vec<Shaded> = furnace_points().into_iter().map(Shaded::from_above).collect();
            pair.lights(still, &points)
        })
    }

    #[test]
    fn fields_of_equal_scenes_are_equal_to_the_last_bit() {
        let (with, without) = pair(&furnace(0.5, 1.0), 3);
        assert!(with.iter().all(|light| light.x > 3.0));
        assert_eq!(with, without);
    }

    #[test]
    fn what_moves_is_in_one_field_alone_and_no_probe_stands_elsewhere_for_it() {
        let (with, without) = pair(&with_sheet(), 3);
        // The sheet sends no light: it takes some away from the floor below it.
        assert!(with[0].x < 0.97 * without[0].x, "{with:?} {without:?}");
    }

    #[test]
    fn a_window_is_renewed_if_what_moves_grows() {
        in_world(&furnace(0.5, 1.0), &Lighting::default(), |still| {
            let region = |objects: &[Object]| Region::around(objects, still.bounds(), 0.5).expect("an object");
            let settings = Settings { probes: 64, ..Settings::default() };
            let pair = Pair::new(still, region(&[OBJECT]), &[OBJECT], &settings, 3);
            let moved = Object { low: OBJECT.low - 0.4, high: OBJECT.high - 0.4 };
            assert!(pair.fits(&region(&[moved])));
            let grown = Object { low: Vec3::ZERO, ..OBJECT };
            assert!(!pair.fits(&region(&[grown])));
        });
    }
}
