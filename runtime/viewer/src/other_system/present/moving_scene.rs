//! What rays of a system meet while things move: the file's scene, and after its meshes those of the objects.

use crate::objects::{MovingObject, geometry};
use glam::{Mat3, Vec3};
use localprt_scenes::{Material, Mesh, Scene};

/// A copy of the scene that takes objects in and gives them up again.
pub(super) struct MovingScene {
    scene: Scene,
    /// Of what stands still.
    n_meshes: usize,
    n_materials: usize,
}

impl MovingScene {
    pub(super) fn of(still: &Scene) -> Self {
        Self { n_meshes: still.meshes.len(), n_materials: still.materials.len(), scene: still.clone() }
    }

    /// The scene with these objects and no others.
    pub(super) fn with(&mut self, objects: &[MovingObject]) -> &Scene {
        let Self { scene, n_meshes, n_materials } = self;
        scene.meshes.truncate(*n_meshes);
        scene.materials.truncate(*n_materials);
        for object in objects {
            scene.meshes.push(mesh(object, scene.materials.len()));
            scene.materials.push(Material {
                name: "moving object".into(),
                base_color: object.albedo.extend(1.0),
                emission: object.emission,
                metallic: 0.0,
                ..Material::default()
            });
        }
        scene
    }
}

fn mesh(object: &MovingObject, material: usize) -> Mesh {
    let shape = geometry(object.shape);
    let to_world = object.to_world;
    let of_normals = Mat3::from_mat4(to_world).inverse().transpose();
    Mesh {
        name: "moving object".into(),
        material,
        positions: shape.positions.iter().map(|&position| to_world.transform_point3(position)).collect(),
        normals: shape.normals.iter().map(|&normal| (of_normals * normal).normalize_or(Vec3::Y)).collect(),
        triangles: shape.triangles,
        ..Mesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::ObjectShape;
    use glam::{Mat4, Quat};
    use localprt_scenes::builtin;

    #[test]
    fn objects_come_after_what_stands_still_and_go_again() {
        let cornell = builtin::scene("cornell").expect("a built-in scene");
        let mut moving = MovingScene::of(&cornell);
        let turned = Quat::from_rotation_y(0.3);
        let object = MovingObject {
            shape: ObjectShape::Box,
            to_world: Mat4::from_scale_rotation_translation(Vec3::new(0.5, 0.1, 0.2), turned, Vec3::ONE),
            albedo: Vec3::new(0.1, 0.2, 0.3),
            emission: Vec3::X,
        };
        let scene = moving.with(&[object, object]);
        assert_eq!(scene.meshes.len(), cornell.meshes.len() + 2);
        let mesh = &scene.meshes[cornell.meshes.len()];
        let material = &scene.materials[mesh.material];
        assert_eq!((material.base_color.truncate(), material.emission), (object.albedo, Vec3::X));
        // Normals stand on the sides of the turned box, which is no cube.
        for (triangle, corners) in
            mesh.triangles.iter().map(|triangle| (triangle, triangle.map(|at| mesh.positions[at as usize])))
        {
            let [a, b, c] = corners;
            let side = (b - a).cross(c - a).normalize();
            assert!(triangle.iter().all(|&at| mesh.normals[at as usize].dot(side) > 0.9999));
        }
        let scene = moving.with(&[]);
        assert_eq!((scene.meshes.len(), scene.materials.len()), (cornell.meshes.len(), cornell.materials.len()));
    }
}
