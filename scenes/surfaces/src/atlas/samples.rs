//! Sample points of texels: what is averaged over a texel, of the light map or of the receiver map, is averaged over them.

use super::raster::Footprint;
use super::texels::{BAND, NOBODY, bands, for_each_touch, weights};
use super::{Atlas, Texel, TexelMap, pieces, shared::SharedTexels};
use crate::rays::{FacePoint, RayCaster};
use glam::{DVec2, Vec3};
use localprt_scenes::{FaceId, Scene, SurfacePoint};
use rayon::prelude::*;

/// Sample points of a texel, at most.
pub const SAMPLES: usize = 4;

/// Places in the texel that are tried, in this order, until there are enough. The first four are a grid turned by arctan(1 / 2), no
/// two in one of four rows or columns, the second two the first two seen through the center. The others are for texels that are
/// covered in part: strips down to an eighth of a texel hold some.
const PLACES: [[f64; 2]; 12] = [
    [0.375, 0.125],
    [0.875, 0.375],
    [0.625, 0.875],
    [0.125, 0.625],
    [0.4375, 0.5625],
    [0.9375, 0.8125],
    [0.0625, 0.1875],
    [0.5625, 0.4375],
    [0.1875, 0.9375],
    [0.8125, 0.0625],
    [0.6875, 0.6875],
    [0.3125, 0.3125],
];

/// A map whose texels are sampled.
pub struct SampledMap<'a> {
    /// Ray queries.
    pub caster: &'a RayCaster<'a>,
    /// Its layout.
    pub atlas: &'a Atlas,
    /// Its covered texels.
    pub map: &'a TexelMap,
    /// Which points may be samples.
    pub is_wanted: &'a (dyn Fn(&FacePoint) -> bool + Sync),
}

impl SampledMap<'_> {
    /// Visits every texel with those of its sample points that a face of its chart covers and that stand in the open, on the same
    /// side of what stands on the surface as the texel's own point; where that point is inside of something, with those outside.
    /// They may be none; and are none where `own` has no such point.
    ///
    /// Texels are visited by rising index, a band of rows after another, each band with a value of its own, made by `start` for so
    /// many texels; the values are returned in that order.
    pub fn visit<T: Send>(
        &self,
        start: impl Fn(usize) -> T + Sync,
        own: impl Fn(&Texel) -> Option<SurfacePoint> + Sync,
        visit: impl Fn(&mut T, &Texel, &TexelSamples) + Sync,
    ) -> Vec<T> {
        let scene = self.caster.scene();
        let sampler = Sampler { of: self, scene, size: self.map.size };
        let shared = SharedTexels::of(scene, self.atlas, self.map.size);
        let of_band = |(band, faces): (usize, &Vec<u32>)| {
            let first_row = band as u32 * BAND;
            let above = |row: u32| self.map.texels.partition_point(|texel| texel.index / self.map.size < row);
            let texels = &self.map.texels[above(first_row)..above(first_row + BAND)];
            let mut value = start(texels.len());
            let mut samples = TexelSamples::default();
            for (texel, faces) in texels.iter().zip(sampler.faces(texels, first_row, faces)) {
                samples.points.clear();
                samples.is_whole = false;
                if let Some(own) = own(texel) {
                    let of_parts = shared.points(scene, self.atlas, texel, SAMPLES);
                    match of_parts.as_slice() {
                        [] => samples.is_whole = sampler.find(texel, &own, &faces, &mut samples.points),
                        points => sampler.find_shared(&own, points, &mut samples.points),
                    }
                }
                visit(&mut value, texel, &samples);
            }
            value
        };
        bands(self.atlas, self.map.size).par_iter().enumerate().map(of_band).collect()
    }
}

/// Sample points of a texel.
#[derive(Clone, Debug, Default)]
pub struct TexelSamples {
    /// The points, [`SAMPLES`] at most.
    pub points: Vec<FacePoint>,
    /// They are spread over the whole texel, in the open: their mean is its center.
    pub is_whole: bool,
}

/// Face at each place of a texel, or [`NOBODY`].
type Faces = [u32; PLACES.len()];

struct Sampler<'a> {
    of: &'a SampledMap<'a>,
    scene: &'a Scene,
    size: u32,
}

impl Sampler<'_> {
    /// The face at each place of each of a band's texels: the texel's own, or the lowest of its chart; or nobody. Only the first
    /// places where these will do.
    fn faces(&self, texels: &[Texel], first_row: u32, members: &[u32]) -> Vec<Faces> {
        let atlas = self.of.atlas;
        let first = first_row * self.size;
        let mut at = vec![NOBODY; (BAND * self.size) as usize];
        let mut faces = vec![[NOBODY; PLACES.len()]; texels.len()];
        let take = |faces: &mut [u32], face: u32, footprint: &Footprint, corner: DVec2| {
            for (held, place) in faces.iter_mut().zip(PLACES) {
                if *held == NOBODY && footprint.contains(corner + DVec2::from(place)) {
                    *held = face;
                }
            }
            faces.contains(&NOBODY)
        };
        let mut is_any_open = false;
        for (number, texel) in texels.iter().enumerate() {
            let Some(footprint) = self.footprint(texel.face.0) else { continue };
            let corner = self.corner(texel);
            if take(&mut faces[number][..SAMPLES], texel.face.0, &footprint, corner) {
                take(&mut faces[number], texel.face.0, &footprint, corner);
                at[(texel.index - first) as usize] = number as u32;
                is_any_open = true;
            }
        }
        if is_any_open {
            for_each_touch(atlas, self.size, first_row, members, |face, footprint, x, y| {
                let number = at[(y * self.size + x - first) as usize] as usize;
                if texels.get(number).is_some_and(|texel| texel.chart == atlas.chart[face as usize]) {
                    take(&mut faces[number], face, footprint, self.corner(&texels[number]));
                }
            });
        }
        faces
    }

    /// Adds to `points` those of a texel's sample points that light reaches as it reaches `own`. Returns whether they are spread
    /// over the whole texel.
    fn find(&self, texel: &Texel, own: &SurfacePoint, faces: &Faces, points: &mut Vec<FacePoint>) -> bool {
        let at_place = |(&face, place): (&u32, [f64; 2])| {
            let place = self.corner(texel) + DVec2::from(place);
            let (face, footprint) = match face {
                // Beyond the first places, of a texel of one face.
                NOBODY => {
                    let own = self.footprint(texel.face.0)?;
                    own.contains(place).then_some((texel.face.0, own))?
                }
                face => (face, self.footprint(face)?),
            };
            let point = FacePoint {
                face: FaceId(face),
                mesh: texel.mesh as usize,
                // Charts lie within one mesh.
                triangle: (texel.triangle + face - texel.face.0) as usize,
                barycentrics: weights(&footprint, place),
            };
            (self.of.is_wanted)(&point).then_some(point)
        };
        let mut wanted = faces.iter().zip(PLACES).filter_map(at_place);
        points.extend(wanted.by_ref().take(SAMPLES));
        if points.len() == SAMPLES && faces[..SAMPLES] == [texel.face.0; SAMPLES] && self.is_open(points) {
            return true;
        }
        let own = (own.position, own.geometric_normal);
        let is_seen = |point: &FacePoint| pieces::see_each_other(self.of.caster, own, self.place(point));
        if points.iter().all(is_seen) {
            return points.len() == SAMPLES && !faces[..SAMPLES].contains(&NOBODY);
        }
        points.extend(wanted);
        if points.iter().any(|point| self.is_outside(own, point)) {
            points.retain(|point| self.is_outside(own, point));
        } else {
            points.retain(is_seen);
        }
        points.truncate(SAMPLES);
        false
    }

    /// Adds to `points` those on the parts that share a texel that `own` sees: all of them together are what the texel stands for.
    fn find_shared(&self, own: &SurfacePoint, of_parts: &[FacePoint], points: &mut Vec<FacePoint>) {
        let own = (own.position, own.geometric_normal);
        let is_good = |point: &&FacePoint| {
            (self.of.is_wanted)(point) && pieces::see_each_other(self.of.caster, own, self.place(point))
        };
        points.extend(of_parts.iter().filter(is_good).take(SAMPLES).copied());
    }

    /// Whether nothing stands between the opposite samples of a texel of one face, and so between them and its center.
    fn is_open(&self, points: &[FacePoint]) -> bool {
        let normal = self.scene.geometric_normal(points[0].mesh, points[0].triangle);
        let place = |point: &FacePoint| (self.scene.position(point.mesh, point.triangle, point.barycentrics), normal);
        let (first, second) = points.split_at(SAMPLES / 2);
        first.iter().zip(second).all(|(a, b)| pieces::see_straight(self.of.caster, place(a), place(b)))
    }

    /// Whether `own` is inside of something that a point is outside of: first of all it sees a back face in the direction of the
    /// point, which sees a front.
    fn is_outside(&self, own: (Vec3, Vec3), point: &FacePoint) -> bool {
        let (from, to) = pieces::lifted(self.of.caster, own, self.place(point));
        let meets = |from: Vec3, to: Vec3| {
            let hit = self.of.caster.closest_hit(from, (to - from).normalize_or_zero())?;
            (hit.t < from.distance(to)).then_some(hit.point.is_some())
        };
        meets(from, to) == Some(false) && meets(to, from) == Some(true)
    }

    /// Position and geometric normal.
    fn place(&self, point: &FacePoint) -> (Vec3, Vec3) {
        let position = self.scene.position(point.mesh, point.triangle, point.barycentrics);
        (position, self.scene.geometric_normal(point.mesh, point.triangle))
    }

    fn footprint(&self, face: u32) -> Option<Footprint> {
        Footprint::new(*self.of.atlas.corners.get(face as usize)?, self.size)
    }

    /// Corner of a texel, in texels.
    fn corner(&self, texel: &Texel) -> DVec2 {
        DVec2::new(f64::from(texel.index % self.size), f64::from(texel.index / self.size))
    }
}

#[cfg(test)]
mod tests {
    use super::super::texels::{self, ReceiverMap};
    use super::*;
    use crate::test_scenes::{cuboid, plane, scene, with_uv};
    use glam::Vec2;
    use localprt_scenes::Mesh;

    const SIZE: u32 = 32;
    /// Edge of a texel, metres.
    const TEXEL_M: f32 = 4.0 / SIZE as f32;

    /// Points of the samples of each texel of a floor of 4 x 4 m, which fills the map to 4 m, and something on it.
    fn samples(floor: Mesh, others: Vec<Mesh>) -> Vec<(u32, Vec<Vec3>)> {
        let mut meshes = vec![with_uv(floor, |at| Vec2::new(at.x, at.z) / 4.0)];
        meshes.extend(others);
        let scene = scene(meshes);
        let atlas = Atlas::of(&scene);
        let receivers = ReceiverMap { atlas: &atlas, size: 1, has_receiver: &[true] };
        let (map, _) = texels::cover_visible(&scene, &atlas, SIZE, &receivers);
        let caster = RayCaster::new(&scene).expect("tree");
        let sampled = SampledMap {
            caster: &caster,
            atlas: &atlas,
            map: &map,
            is_wanted: &|point| receivers.sends_light(&scene, point),
        };
        let own = |texel: &Texel| Some(texel.point().surface_point(&scene));
        let bands = sampled.visit(Vec::with_capacity, own, |band, texel, samples| {
            band.push((texel.index, samples.points.iter().map(|point| point.surface_point(&scene).position).collect()));
        });
        bands.into_iter().flatten().collect()
    }

    fn floor(side_m: f32) -> Mesh {
        plane("floor", Vec3::ZERO, side_m * Vec3::X, side_m * Vec3::Z, 1, 1)
    }

    fn within_its_texel(index: u32, point: Vec3) -> bool {
        [point.x, point.z].map(|at| (at / TEXEL_M) as u32) == [index % SIZE, index / SIZE]
    }

    #[test]
    fn an_open_floor_has_all_samples_around_the_centers() {
        let samples = samples(floor(4.0), Vec::new());
        assert_eq!(samples.len(), (SIZE * SIZE) as usize);
        for (index, points) in samples {
            assert_eq!(points.len(), SAMPLES);
            assert!(points.iter().all(|&point| within_its_texel(index, point)));
            let center = Vec3::new((index % SIZE) as f32 + 0.5, 0.0, (index / SIZE) as f32 + 0.5) * TEXEL_M;
            assert!((points.iter().sum::<Vec3>() / SAMPLES as f32).distance(center) < 1e-5);
        }
    }

    #[test]
    fn beyond_the_edge_of_a_floor_there_are_none() {
        // A third of column 12 is covered: the three places left of it. Below the same, and one in the corner.
        let side_m = 12.3 * TEXEL_M;
        for (index, points) in samples(floor(side_m), Vec::new()) {
            assert!(points.iter().all(|point| point.x <= side_m && point.z <= side_m));
            let expected = match (index % SIZE == 12, index / SIZE == 12) {
                (false, false) => SAMPLES,
                (true, true) => 1,
                _ => 3,
            };
            assert_eq!(points.len(), expected, "texel {} {}", index % SIZE, index / SIZE);
        }
    }

    #[test]
    fn a_wall_across_a_texel_keeps_its_sides_apart() {
        // Three quarters into column 12: the center is on its near side.
        let wall_x = 12.75 * TEXEL_M;
        let wall = cuboid("wall", Vec3::new(wall_x - 0.001, -0.1, -0.1), Vec3::new(wall_x + 0.001, 1.0, 4.1));
        for (index, points) in samples(floor(4.0), vec![wall]) {
            let column = index % SIZE;
            assert_eq!(points.len(), SAMPLES, "column {column}");
            assert!(points.iter().all(|point| (point.x < wall_x) == (column <= 12)), "column {column}");
        }
    }

    #[test]
    fn of_a_texel_whose_center_is_in_a_crate_the_part_outside_counts() {
        // The crate covers three quarters of columns 8 and 20, on the sides where their centers are, and of rows.
        let (low, high) = (8.25 * TEXEL_M, 20.75 * TEXEL_M);
        let is_inside = |point: &Vec3| point.x > low && point.x < high && point.z > low && point.z < high;
        let the_crate = cuboid("crate", Vec3::new(low, -0.5, low), Vec3::new(high, 1.0, high));
        for (index, points) in samples(floor(4.0), vec![the_crate]) {
            let at_edge = |at: u32| at == 8 || at == 20;
            let within = |at: u32| (8..=20).contains(&at);
            let (x, y) = (index % SIZE, index / SIZE);
            let n_inside = points.iter().filter(|point| is_inside(point)).count();
            match (within(x) && within(y), at_edge(x), at_edge(y)) {
                (false, ..) => assert!(points.len() == SAMPLES && n_inside == 0, "{x} {y}"),
                (true, false, false) => assert_eq!(n_inside, points.len(), "{x} {y}"),
                (true, true, true) => assert!(points.len() == SAMPLES && n_inside == 0, "{x} {y}"),
                _ => assert!(points.len() == 3 && n_inside == 0, "{x} {y}"),
            }
        }
    }
}
