//! Surfaces and lights to test with, and shadows traced by brute force.

use glam::{DVec3, Vec2, Vec3};
use localprt_runtime::passes::shadow_map::NO_MASK;
use localprt_runtime::{AlphaImage, AlphaMask, CasterMasks, SceneTexels, ShadowCasters, SurfacePoint, TexelSample};
use localprt_scenes::{Light, LightKind, Wrap};

/// Casters, and texels on some of them.
#[derive(Default)]
pub struct TestScene {
    pub texels: SceneTexels,
    pub casters: ShadowCasters,
}

impl TestScene {
    /// A quad that casts, seen counter-clockwise from the front, which holds `n * n` texels. Shading normals lean by up to
    /// 17 degrees.
    pub fn quad(&mut self, corners: [Vec3; 4], n: u32) {
        let [a, b, c, d] = corners;
        let first = self.casters.positions.len() as u32;
        self.casters.positions.extend(corners);
        self.casters.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let normal = (b - a).cross(d - a).normalize();
        assert!((c - (b + d - a)).length() < 1e-5, "not a parallelogram");
        for texel in 0..n * n {
            let (u, v) = ((texel % n) as f32 + 0.5, (texel / n) as f32 + 0.5);
            self.texels.index.push(self.texels.index.len() as u32);
            self.texels.position.push(a + (b - a) * (u / n as f32) + (d - a) * (v / n as f32));
            let lean = 0.3 * Vec3::new((texel as f32).sin(), (0.7 * texel as f32).sin(), (1.3 * texel as f32).sin());
            self.texels.normal.push((normal + lean - normal * normal.dot(lean)).normalize());
            self.texels.geometric_normal.push(normal);
            self.texels.albedo.push(Vec3::splat(0.5));
            self.texels.emission.push(Vec3::ZERO);
            self.texels.material.push(0);
        }
        self.texels.size = (self.texels.index.len() as f64).sqrt().ceil() as u32;
    }

    /// A box with six sides of texels, facing outwards or, for a room, inwards.
    pub fn block(&mut self, low: Vec3, high: Vec3, n: u32, inward: bool) {
        let corner = |x: usize, y: usize, z: usize| {
            let ends = [low, high];
            Vec3::new(ends[x].x, ends[y].y, ends[z].z)
        };
        for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            let at = |u: usize, v: usize| match axis {
                0 => corner(side, u, v),
                1 => corner(v, side, u),
                _ => corner(u, v, side),
            };
            let mut corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            if (side == 1) == inward {
                corners.reverse();
            }
            self.quad(corners, n);
        }
    }

    /// Gives the two triangles of a quad (counted from 0) a mask of `4 x 4` texels, every other one a hole.
    pub fn punch(&mut self, quad: usize) {
        let n_triangles = self.casters.triangles.len();
        let mut masks = CasterMasks {
            uv: vec![Vec2::ZERO; self.casters.positions.len()],
            alpha: vec![1.0; self.casters.positions.len()],
            mask: vec![NO_MASK; n_triangles],
            masks: vec![AlphaMask {
                image: 0,
                wrap_u: Wrap::Repeat,
                wrap_v: Wrap::MirroredRepeat,
                nearest: false,
                cutoff: 0.5,
            }],
            images: vec![AlphaImage {
                width: 4,
                height: 4,
                alpha: (0..16).map(|texel| if (texel + texel / 4) % 2 == 0 { 255 } else { 0 }).collect(),
            }],
        };
        masks.uv[4 * quad..][..4].copy_from_slice(&[Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        masks.mask[2 * quad..][..2].fill(0);
        self.casters.masks = Some(masks);
        assert_eq!(self.casters.check(), Ok(()));
    }

    /// Gives the texels 0, 1, 2, 3 or 4 samples in turn, up to 0.05 m from them in the planes of their surfaces.
    pub fn scatter_samples(&mut self) {
        for texel in 0..self.texels.len() {
            let position = self.texels.position[texel];
            let (normal, geometric_normal) = (self.texels.normal[texel], self.texels.geometric_normal[texel]);
            let (x, y) = geometric_normal.any_orthonormal_pair();
            for sample in 0..texel % 5 {
                let (sin, cos) = (0.7 * texel as f32 + 2.0 * sample as f32).sin_cos();
                let position = position + 0.05 * (cos * x + sin * y);
                let normal = (normal + 0.1 * sin * x).normalize();
                let point = SurfacePoint { position, normal, geometric_normal };
                self.texels.samples.push(TexelSample::new(&point, self.texels.position[texel]));
            }
            self.texels.sample_end.push(self.texels.samples.len() as u32);
        }
        assert_eq!(self.texels.check(self.texels.size), Ok(()));
    }

    /// Whether the line from a point just off a surface to a light is free; masks are not asked.
    pub fn traced(&self, light: &Light, point: Vec3, normal: Vec3) -> bool {
        let start = point.as_dvec3() + normal.as_dvec3() * 1e-5;
        let way = match light.kind {
            LightKind::Directional => -1e3 * light.direction.as_dvec3(),
            _ => light.position.as_dvec3() - start,
        };
        !self.casters.triangles.iter().any(|triangle| {
            let [a, b, c] = triangle.map(|vertex| self.casters.positions[vertex as usize].as_dvec3());
            intersects(start, way, [a, b, c])
        })
    }
}

fn intersects(start: DVec3, way: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let (ab, ac, to_start) = (b - a, c - a, start - a);
    let determinant = way.cross(ac).dot(ab);
    let u = way.cross(ac).dot(to_start) / determinant;
    let v = to_start.cross(ab).dot(way) / determinant;
    let t = to_start.cross(ab).dot(ac) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..1.0).contains(&t)
}

/// A floor, a box on it and a thin wall that stands free; 40 % of the texels lie on the floor.
pub fn box_on_a_floor(n: u32) -> TestScene {
    let mut scene = TestScene::default();
    let p = Vec3::new;
    scene.quad([p(-2.0, 0.0, 2.0), p(2.0, 0.0, 2.0), p(2.0, 0.0, -2.0), p(-2.0, 0.0, -2.0)], 2 * n);
    scene.block(p(-0.5, 0.0, -0.4), p(0.3, 0.9, 0.4), n / 2, false);
    scene.quad([p(0.9, 0.0, -1.0), p(1.3, 0.0, 0.5), p(1.3, 1.1, 0.5), p(0.9, 1.1, -1.0)], n);
    scene
}

/// Eight upright sheets side by side, each with another mask over two images of noise, before a light at the origin. The
/// images have 40 000 texels each.
#[cfg(feature = "gpu")]
pub fn masked_sheets() -> TestScene {
    use localprt_formats::directions::counter_uniform;

    let mut scene = TestScene::default();
    let mut masks = CasterMasks {
        images: (0..2)
            .map(|image| {
                // Blots of 25 x 20 texels, so that holes are much larger than texels of a shadow map.
                let blot = |x: u32, y: u32| counter_uniform(11, u64::from(x / 25 + 8 * (y / 20)), image) as f32;
                let alpha = (0..200 * 200).map(|texel| (255.0 * blot(texel % 200, texel / 200)) as u8).collect();
                AlphaImage { width: 200, height: 200, alpha }
            })
            .collect(),
        ..CasterMasks::default()
    };
    let wraps = [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge];
    for sheet in 0..8u32 {
        let (x, y) = ((sheet % 4) as f32 - 2.0, (sheet / 4) as f32 - 1.0);
        let z = -2.0 - 0.2 * sheet as f32;
        let corner = |dx: f32, dy: f32| Vec3::new(x + 0.95 * dx, y + 0.95 * dy, z - 0.4 * dx);
        scene.quad([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)], 0);
        // Within, and far outside of, the image.
        let far = if sheet % 2 == 0 { 1.3 } else { 0.4 };
        masks.uv.extend([(-far, far), (far, far), (far, -far), (-far, -far)].map(|(u, v)| Vec2::new(u + 0.3, v + 0.2)));
        masks.alpha.extend([1.0, 0.8, 0.9, 1.2]);
        masks.mask.extend([sheet; 2]);
        masks.masks.push(AlphaMask {
            image: sheet % 2,
            wrap_u: wraps[sheet as usize % 3],
            wrap_v: wraps[(sheet as usize / 2 + 1) % 3],
            nearest: sheet >= 5,
            cutoff: 0.4 + 0.02 * sheet as f32,
        });
    }
    // A small image as well, with gradients between its texels.
    masks.images.push(AlphaImage { width: 3, height: 2, alpha: vec![20, 230, 120, 180, 60, 255] });
    masks.masks[0].image = 2;
    masks.masks[3].image = 2;
    scene.casters.masks = Some(masks);
    assert_eq!(scene.casters.check(), Ok(()));
    scene
}

/// [`box_on_a_floor`] below a horizontal screen with holes.
pub fn box_below_a_screen(n: u32) -> TestScene {
    let mut scene = box_on_a_floor(n);
    let p = Vec3::new;
    scene.quad([p(-1.4, 1.2, 1.5), p(-0.2, 1.2, 1.5), p(-0.2, 1.3, 0.3), p(-1.4, 1.3, 0.3)], 0);
    let quad = scene.casters.triangles.len() / 2 - 1;
    scene.punch(quad);
    scene
}

pub fn light(kind: LightKind) -> Light {
    Light {
        name: String::new(),
        kind,
        position: Vec3::new(-1.3, 1.9, 0.9),
        direction: Vec3::new(0.55, -1.0, -0.35).normalize(),
        color: Vec3::new(1.0, 0.8, 0.5),
        intensity: 10.0,
        range: None,
    }
}

/// One light of every kind: parallel, narrow and wide spot, point.
pub fn lights() -> [Light; 4] {
    let spot = |inner_cone, outer_cone| LightKind::Spot { inner_cone, outer_cone };
    [
        light(LightKind::Directional),
        Light { range: Some(9.0), ..light(spot(0.5, 0.8)) },
        light(spot(1.0, 1.5)),
        light(LightKind::Point),
    ]
}
