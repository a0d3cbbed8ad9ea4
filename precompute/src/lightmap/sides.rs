//! A face for each side of a double-sided surface that light can reach.
//!
//! In a layout of our own each live side gets its own texels. A scene kept on its authored TEXCOORD_1 is not split:
//! front and back then share a texel.

use crate::rays::{RayCaster, frame};
use crate::voxels::{Voxel, VoxelGrid};
use glam::Vec3;
use localprt_formats::directions::{cosine_hemisphere, fibonacci_square};
use localprt_scenes::{Mesh, Scene};
use rayon::prelude::*;

/// Rays from each point of a side.
const RAYS: u32 = 5;
/// Points of a triangle that rays start from, as corner weights: the middle, and near each corner.
const STARTS: [[f32; 3]; 4] = [[1.0 / 3.0; 3], [0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]];

/// What is added to the name of a mesh of back faces.
pub const BACK: &str = " (back)";

/// Tells whether a side of a triangle is worth having: scene, mesh, triangle, front.
pub type SideTest<'a> = &'a (dyn Fn(&Scene, usize, usize, bool) -> bool + Sync);

/// A scene of one-sided meshes.
#[derive(Debug)]
pub struct Sides {
    /// The scene.
    pub scene: Scene,
    /// Its meshes that each mesh became, in order: whether they are backs.
    pub parts: Vec<Vec<bool>>,
    /// Number of back faces.
    pub back_faces: usize,
}

/// Replaces every double-sided mesh by one-sided ones: the triangles whose front passes `open_side`, and behind it, as
/// `NAME (back)`, a flipped copy of those whose back does. A triangle of which neither side passes keeps its front.
/// Materials of such meshes become one-sided; names, which lighting files refer to, stay.
pub fn split(mut scene: Scene, open_side: SideTest) -> Sides {
    let live: Vec<Option<Vec<[bool; 2]>>> = scene
        .meshes
        .par_iter()
        .enumerate()
        .map(|(index, mesh)| {
            let sides = |triangle| [true, false].map(|front| open_side(&scene, index, triangle, front));
            let double_sided = scene.materials[mesh.material].double_sided;
            double_sided.then(|| (0..mesh.triangles.len()).into_par_iter().map(sides).collect())
        })
        .collect();
    let mut back_faces = 0;
    let mut parts = Vec::with_capacity(scene.meshes.len());
    let mut meshes = Vec::with_capacity(scene.meshes.len());
    for (mesh, live) in std::mem::take(&mut scene.meshes).into_iter().zip(live) {
        let Some(live) = live else {
            meshes.push(mesh);
            parts.push(vec![false]);
            continue;
        };
        // Each mesh that uses the material comes by here, so nobody is left who wants it double-sided.
        scene.materials[mesh.material].double_sided = false;
        mesh.variants.iter().for_each(|&[_, material]| scene.materials[material].double_sided = false);
        let back = part(&mesh, |triangle| live[triangle][1]);
        let front = part(&mesh, |triangle| live[triangle][0] || !live[triangle][1]);
        back_faces += back.triangles.len();
        let sides = [(front, false), (flipped(back), true)];
        let (own, backs): (Vec<Mesh>, _) = sides.into_iter().filter(|(mesh, _)| !mesh.triangles.is_empty()).unzip();
        meshes.extend(own);
        parts.push(backs);
    }
    scene.meshes = meshes;
    Sides { scene, parts, back_faces }
}

/// Whether light from the space to light can reach a side of a triangle: whether any of a few rays from it leaves the
/// scene, or passes through an open voxel before it meets a surface.
pub fn is_live(caster: &RayCaster, grid: &VoxelGrid, mesh: usize, triangle: usize, front: bool) -> bool {
    let scene = caster.scene();
    let normal = scene.geometric_normal(mesh, triangle) * if front { 1.0 } else { -1.0 };
    if normal == Vec3::ZERO {
        return false;
    }
    let [a, b, c] = scene.corners(mesh, triangle);
    let (tangent, bitangent) = frame(normal);
    // Points inside, rays outside: most sides are decided by the first rays of the middle.
    STARTS.iter().zip(0u32..).any(|(weights, start)| {
        let origin = a * weights[0] + b * weights[1] + c * weights[2] + normal * caster.offset_m();
        (0..RAYS).any(|ray| {
            let shift = f64::from(start) / STARTS.len() as f64;
            let [x, y, z] = cosine_hemisphere(fibonacci_square(ray, RAYS, [0.0, shift]));
            reaches_open_space(caster, grid, origin, tangent * x + bitangent * y + normal * z)
        })
    })
}

fn reaches_open_space(caster: &RayCaster, grid: &VoxelGrid, origin: Vec3, dir: Vec3) -> bool {
    let Some(hit) = caster.closest_hit(origin, dir) else { return true };
    let step_m = 0.5 * grid.voxel_m;
    if step_m.is_nan() || step_m <= 0.0 {
        return false;
    }
    // The grid's own extent bounds the march, however far the hit is.
    let most = grid.size.as_vec3().length() * 2.0 + 2.0;
    let steps = (hit.t / step_m).min(most) as u32;
    (0..=steps).any(|step| grid.at(origin + dir * (step as f32 * step_m)) == Some(Voxel::Open))
}

/// The mesh with some of its triangles, and the vertices they use, in order of first use.
fn part(mesh: &Mesh, keep: impl Fn(usize) -> bool) -> Mesh {
    const UNUSED: u32 = u32::MAX;
    let mut place = vec![UNUSED; mesh.positions.len()];
    let mut from: Vec<u32> = Vec::new();
    let mut triangles = Vec::new();
    for (_, triangle) in mesh.triangles.iter().enumerate().filter(|(index, _)| keep(*index)) {
        triangles.push(triangle.map(|vertex| {
            let place = &mut place[vertex as usize];
            if *place == UNUSED {
                *place = from.len() as u32;
                from.push(vertex);
            }
            *place
        }));
    }
    fn taken<T: Copy>(values: &[T], from: &[u32]) -> Vec<T> {
        if values.is_empty() { Vec::new() } else { from.iter().map(|&vertex| values[vertex as usize]).collect() }
    }
    Mesh {
        name: mesh.name.clone(),
        source: mesh.source.clone(),
        material: mesh.material,
        positions: taken(&mesh.positions, &from),
        normals: taken(&mesh.normals, &from),
        tangents: taken(&mesh.tangents, &from),
        uv_sets: mesh.uv_sets.iter().map(|set| taken(set, &from)).collect(),
        colors: taken(&mesh.colors, &from),
        triangles,
        variants: mesh.variants.clone(),
        lightmap: mesh.lightmap,
    }
}

/// The other side of a mesh.
fn flipped(mut mesh: Mesh) -> Mesh {
    mesh.name.push_str(BACK);
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    for normal in &mut mesh.normals {
        *normal = -*normal;
    }
    for tangent in &mut mesh.tangents {
        // The bitangent is normal x tangent x w: with the normal turned, w keeps it where texture coordinates put it.
        tangent.w = -tangent.w;
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::super::test_scenes::{cuboid, inward, plane, scene};
    use super::*;
    use glam::{UVec3, Vec2, Vec3Swizzles, Vec4};
    use localprt_scenes::Material;

    /// A grid over the box from -3 to 3 where `open` says what is open and everything else is enclosed.
    fn grid(open: impl Fn(Vec3) -> bool) -> VoxelGrid {
        let mut grid =
            VoxelGrid { origin: Vec3::splat(-3.0), voxel_m: 0.25, size: UVec3::splat(24), voxels: Vec::new() };
        for index in 0..24u32.pow(3) {
            let cell = UVec3::new(index % 24, index / 24 % 24, index / 576);
            grid.voxels.push(if open(grid.center(cell)) { Voxel::Open } else { Voxel::Enclosed });
        }
        grid
    }

    #[test]
    fn only_sides_that_see_open_space_are_live() {
        // A closed box in a closed room, both double-sided: the space to light is between them.
        let room = inward(cuboid("room", Vec3::splat(-2.0), Vec3::splat(2.0)));
        let block = cuboid("block", Vec3::splat(-0.5), Vec3::splat(0.5));
        let scene = scene(vec![room, block]);
        let caster = RayCaster::new(&scene).unwrap();
        // Voxels that touch a surface are solid, never open.
        let grid = grid(|p| p.abs().max_element() < 1.8 && p.abs().max_element() > 0.7);
        for triangle in 0..12 {
            assert!(is_live(&caster, &grid, 0, triangle, true));
            // The outside of the room sees the world outside.
            assert!(is_live(&caster, &grid, 0, triangle, false));
            assert!(is_live(&caster, &grid, 1, triangle, true));
            assert!(!is_live(&caster, &grid, 1, triangle, false), "inside of triangle {triangle}");
        }
    }

    #[test]
    fn double_sided_meshes_become_live_fronts_and_live_backs() {
        let mut sheet = plane("sheet", Vec3::ZERO, Vec3::X, Vec3::Z, 2, 1);
        sheet.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); sheet.positions.len()];
        sheet.uv_sets = vec![sheet.positions.iter().map(|p| Vec2::new(p.x, p.z)).collect()];
        let solid = plane("solid", Vec3::Y, Vec3::X, Vec3::Z, 1, 1);
        let mut before = scene(vec![sheet, Mesh { material: 1, ..solid }]);
        before.materials[0] = Material { name: "cloth".into(), double_sided: true, ..Material::default() };
        before.materials.push(Material::default());
        // Triangle 0: front; 1: both; 2: back; 3: neither.
        let open = |_: &Scene, _: usize, triangle: usize, front: bool| match triangle {
            0 => front,
            1 => true,
            2 => !front,
            _ => false,
        };
        let Sides { scene: after, parts, back_faces } = split(before.clone(), &open);
        assert_eq!(parts, [vec![false, true], vec![false]]);
        let names: Vec<&str> = after.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
        assert_eq!(names, ["sheet", "sheet (back)", "solid"]);
        assert_eq!(after.meshes.iter().map(|mesh| mesh.triangles.len()).collect::<Vec<_>>(), [3, 2, 2]);
        assert_eq!(back_faces, 2);
        assert!(after.materials.iter().all(|material| !material.double_sided));
        assert_eq!(after.materials[after.meshes[1].material].name, "cloth");
        // Fronts are triangles 0, 1 and 3, backs 1 and 2 from the other side.
        assert_eq!(after.corners(0, 2), before.corners(0, 3));
        let [a, b, c] = before.corners(0, 2);
        assert_eq!(after.corners(1, 1), [a, c, b]);
        assert_eq!(after.geometric_normal(1, 1), Vec3::NEG_Y);
        assert!(after.meshes[1].normals.iter().all(|&normal| normal == Vec3::NEG_Y));
        assert_eq!(after.meshes[1].tangents[0], Vec4::new(1.0, 0.0, 0.0, -1.0));
        let [uv, position] = [after.meshes[1].uv_sets[0][0], after.meshes[1].positions[0].xz()];
        assert_eq!(uv, position);
    }
}
