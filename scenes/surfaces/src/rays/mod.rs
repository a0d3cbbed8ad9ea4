//! Ray queries against a scene: the ray-cast operator Γ ([`RayCaster::closest_hit`]) and visibility V
//! ([`RayCaster::visible`]) of the paper's section 3.2, with alpha masks honored in both.
//!
//! A geometric triangle has two sides. Each side is a face of the scene that receives and sends light, or nothing: the
//! back of a one-sided surface still blocks, and is black. A double-sided face without a twin of opposite winding
//! serves both sides.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod bvh;
#[cfg(test)]
mod tests;
mod triangles;
mod wide;

pub use bvh::{BoxTree, TreeError, TriangleHit};

use glam::Vec3;
use localprt_scenes::{AlphaMode, FaceId, Scene, SurfacePoint};
use std::collections::BTreeMap;

/// Ray offsets are this times (largest absolute coordinate + box diagonal): about a hundred f32 roundings of a position.
const OFFSET: f32 = 2e-6;

/// Ray queries against one scene.
pub struct RayCaster<'a> {
    scene: &'a Scene,
    tree: bvh::Tree,
    /// Corner positions of each geometric triangle.
    corners: Vec<[Vec3; 3]>,
    /// `[front, back]` of each geometric triangle.
    sides: Vec<[Option<Side>; 2]>,
    offset_m: f32,
}

#[derive(Clone, Copy, Debug)]
struct Side {
    face: FaceId,
    mesh: u32,
    triangle: u32,
    /// Corner k of the face is corner `order[k]` of the geometric triangle.
    order: [u8; 3],
    /// The face's front looks the other way: a double-sided face seen from behind.
    shared: bool,
}

/// A point of a face of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePoint {
    /// The face.
    pub face: FaceId,
    /// Its mesh.
    pub mesh: usize,
    /// Its triangle within the mesh.
    pub triangle: usize,
    /// Weights of the face's corners.
    pub barycentrics: Vec3,
}

/// The triangle that stopped a visibility ray last.
#[derive(Clone, Copy, Debug)]
pub struct OccluderHint(u32);

impl Default for OccluderHint {
    fn default() -> Self {
        Self(u32::MAX)
    }
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceHit {
    /// Distance along the unit direction.
    pub t: f32,
    /// World position, from the barycentrics.
    pub position: Vec3,
    /// Unit geometric normal on the side the ray came from.
    pub normal: Vec3,
    /// The face on that side; `None` for the black back of a one-sided surface.
    pub point: Option<FacePoint>,
}

impl SurfaceHit {
    /// The point on the side that the ray came from.
    pub fn surface_point(&self, scene: &Scene) -> SurfacePoint {
        let normal =
            self.point.map_or(self.normal, |face| scene.shading_normal(face.mesh, face.triangle, face.barycentrics));
        // The other side of a double-sided face.
        let normal = if normal.dot(self.normal) < 0.0 { -normal } else { normal };
        SurfacePoint { position: self.position, normal, geometric_normal: self.normal }
    }

    /// The same with the normal that the material's normal map gives: as a camera sees it.
    pub fn mapped_point(&self, scene: &Scene) -> SurfacePoint {
        let point = self.surface_point(scene);
        let Some(face) = self.point else { return point };
        SurfacePoint { normal: scene.mapped_normal(face.mesh, face.triangle, face.barycentrics, point.normal), ..point }
    }
}

impl FacePoint {
    /// The same as a point of the scene's surface.
    pub fn surface_point(&self, scene: &Scene) -> SurfacePoint {
        scene.surface_point(self.mesh, self.triangle, self.barycentrics)
    }
}

impl<'a> RayCaster<'a> {
    /// Builds the tree. Exact duplicates (same three corners in any order) become one geometric triangle.
    pub fn new(scene: &'a Scene) -> Result<Self, TreeError> {
        let mut corners: Vec<[Vec3; 3]> = Vec::new();
        let mut sides: Vec<[Option<Side>; 2]> = Vec::new();
        let mut masked: Vec<bool> = Vec::new();
        let mut known: BTreeMap<[[u32; 3]; 3], usize> = BTreeMap::new();
        for (face, (mesh, triangle)) in scene.faces().enumerate() {
            let positions = scene.corners(mesh, triangle);
            let bits = positions.map(|corner| corner.to_array().map(|value| (value + 0.0).to_bits()));
            let mut key = bits;
            key.sort_unstable();
            let index = *known.entry(key).or_insert_with(|| {
                corners.push(positions);
                sides.push([None, None]);
                masked.push(false);
                corners.len() - 1
            });
            let held = corners[index].map(|corner| corner.to_array().map(|value| (value + 0.0).to_bits()));
            let order = bits.map(|bits| held.iter().position(|&held| held == bits).unwrap_or(0) as u8);
            let opposite = (order[1] + 3 - order[0]) % 3 != 1;
            let material = &scene.materials[scene.meshes[mesh].material];
            masked[index] |= material.alpha != AlphaMode::Opaque;
            let side =
                Side { face: FaceId(face as u32), mesh: mesh as u32, triangle: triangle as u32, order, shared: false };
            let own = &mut sides[index][usize::from(opposite)];
            if own.is_none_or(|held| held.shared) {
                *own = Some(side);
            }
            if material.double_sided {
                sides[index][usize::from(!opposite)].get_or_insert(Side { shared: true, ..side });
            }
        }
        let tree = bvh::Tree::build(&corners, &masked)?;
        let largest = scene.bounds().map_or(0.0, |(low, high)| low.abs().max(high.abs()).max_element());
        let offset_m = OFFSET * (largest + scene.extent());
        Ok(Self { scene, tree, corners, sides, offset_m })
    }

    /// The scene the rays meet.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Distance by which ray origins leave a surface, metres.
    pub fn offset_m(&self) -> f32 {
        self.offset_m
    }

    /// Number of geometric triangles after merging duplicates.
    pub fn triangle_count(&self) -> usize {
        self.corners.len()
    }

    /// The surface point Γ(origin, dir); `dir` is unit length. `None` where the ray leaves the scene.
    pub fn closest_hit(&self, origin: Vec3, dir: Vec3) -> Option<SurfaceHit> {
        let hit = self.tree.closest_hit(origin, dir, f32::INFINITY, |hit| self.is_present(hit))?;
        Some(self.surface(&hit))
    }

    /// Free space above a surface point along its normal, metres; infinite where nothing is above.
    pub fn free_above(&self, position: Vec3, normal: Vec3) -> f32 {
        self.closest_hit(position + normal * self.offset_m, normal).map_or(f32::INFINITY, |hit| hit.t)
    }

    /// Whether the straight line between two points is free. Both should be off the surfaces they belong to by
    /// [`RayCaster::offset_m`] along the normal.
    pub fn visible(&self, from: Vec3, to: Vec3) -> bool {
        self.visible_hinted(from, to, &mut OccluderHint::default())
    }

    /// The same; faster for lines like the one that `hint` was last used for. The answer does not depend on the hint.
    pub fn visible_hinted(&self, from: Vec3, to: Vec3, hint: &mut OccluderHint) -> bool {
        let way = to - from;
        let distance = way.length();
        if distance <= 0.0 {
            return true;
        }
        self.is_free(from, way / distance, distance, hint)
    }

    /// Whether a ray to infinity is free.
    pub fn escapes(&self, origin: Vec3, dir: Vec3) -> bool {
        self.escapes_hinted(origin, dir, &mut OccluderHint::default())
    }

    /// The same, with a hint as in [`RayCaster::visible_hinted`].
    pub fn escapes_hinted(&self, origin: Vec3, dir: Vec3, hint: &mut OccluderHint) -> bool {
        self.is_free(origin, dir, f32::INFINITY, hint)
    }

    fn is_free(&self, origin: Vec3, dir: Vec3, t_max: f32, hint: &mut OccluderHint) -> bool {
        let occluder = self.tree.occluder(origin, dir, t_max, hint.0, |hit| self.is_present(hit));
        if let Some(occluder) = occluder {
            hint.0 = occluder;
        }
        occluder.is_none()
    }

    fn surface(&self, hit: &TriangleHit) -> SurfaceHit {
        let [a, b, c] = self.corners[hit.triangle as usize];
        let weights = hit.barycentrics;
        let (a64, b64, c64) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
        let normal = (b64 - a64).cross(c64 - a64).normalize_or_zero().as_vec3();
        SurfaceHit {
            t: hit.t,
            position: a * weights.x + b * weights.y + c * weights.z,
            normal: if hit.front { normal } else { -normal },
            point: self.sides[hit.triangle as usize][usize::from(!hit.front)].map(|side| side.point(weights)),
        }
    }

    fn is_present(&self, hit: &TriangleHit) -> bool {
        let [front, back] = self.sides[hit.triangle as usize];
        let side = if hit.front { front.or(back) } else { back.or(front) };
        side.is_none_or(|side| {
            let point = side.point(hit.barycentrics);
            self.scene.is_present(point.mesh, point.triangle, point.barycentrics)
        })
    }
}

impl Side {
    fn point(&self, weights: Vec3) -> FacePoint {
        let barycentrics = Vec3::from(self.order.map(|corner| weights[usize::from(corner)]));
        FacePoint { face: self.face, mesh: self.mesh as usize, triangle: self.triangle as usize, barycentrics }
    }
}

/// An orthonormal frame about a unit normal: `(tangent, bitangent)`.
///
/// Jumps only at z = -0.5, where no axis-aligned surface lies: normals that differ by rounding get the same frame.
///
/// Source: Duff et al. 2017, Building an Orthonormal Basis, Revisited, which jumps at z = 0.
pub fn frame(normal: Vec3) -> (Vec3, Vec3) {
    let sign = if normal.z < -0.5 { -1.0 } else { 1.0f32 };
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}
