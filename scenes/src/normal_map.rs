//! Normals of surfaces with normal maps, as the viewer's shader has them.

use crate::scene::{Mesh, Scene, TextureRef, interpolate};
use glam::{Mat3, Vec3};

impl Scene {
    /// Unit normal at a point of a triangle as its material's normal map bends it; `normal` itself where there is no map. `normal` is the
    /// shading normal on the side that is lit; from behind, bumps are dents: the normal there is the other one, reversed.
    ///
    /// Source: glTF 2.0, 3.9.3: green points up in the image; bitangents are the normal times the tangent, with its handedness.
    pub fn mapped_normal(&self, mesh: usize, triangle: usize, barycentrics: Vec3, normal: Vec3) -> Vec3 {
        let data = &self.meshes[mesh];
        let material = &self.materials[data.material];
        let Some(reference) = &material.normal_texture else { return normal };
        let uv = reference.coordinate(data, triangle, barycentrics);
        let texel = self.textures[reference.texture].sample_linear(&self.images, uv).truncate() * 2.0 - 1.0;
        let bent = Vec3::new(texel.x * material.normal_scale, texel.y * material.normal_scale, texel.z);
        let side = if normal.dot(self.geometric_normal(mesh, triangle)) < 0.0 { -1.0 } else { 1.0 };
        let frame = stored_frame(data, triangle, barycentrics, normal * side)
            .unwrap_or_else(|| self.frame_of_coordinates(reference, mesh, triangle, normal * side));
        (frame * bent * side).try_normalize().unwrap_or(normal)
    }

    /// From the change of the coordinates over the triangle. Axes keep their lengths relative to each other.
    ///
    /// Source: Mikkelsen, Followup: Normal Mapping Without Precomputed Tangents (Schueler 2013).
    fn frame_of_coordinates(&self, reference: &TextureRef, mesh: usize, triangle: usize, normal: Vec3) -> Mat3 {
        let data = &self.meshes[mesh];
        let [a, b, c] = self.corners(mesh, triangle);
        let [at_a, at_b, at_c] = Vec3::AXES.map(|corner| reference.coordinate(data, triangle, corner));
        let (along_b, along_c) = (at_b - at_a, at_c - at_a);
        let (x_axis, y_axis) = ((c - a).cross(normal), normal.cross(b - a));
        let tangent = x_axis * along_b.x + y_axis * along_c.x;
        // Images have v down.
        let bitangent = -(x_axis * along_b.y + y_axis * along_c.y);
        let size = tangent.length_squared().max(bitangent.length_squared()).sqrt();
        if size <= 0.0 {
            return Mat3::from_cols(Vec3::ZERO, Vec3::ZERO, normal);
        }
        Mat3::from_cols(tangent / size, bitangent / size, normal)
    }
}

/// From the tangents that the file has, where they are of use.
fn stored_frame(mesh: &Mesh, triangle: usize, barycentrics: Vec3, normal: Vec3) -> Option<Mat3> {
    if mesh.tangents.is_empty() {
        return None;
    }
    let stored = interpolate(&mesh.triangles[triangle], barycentrics, |vertex| mesh.tangents[vertex]);
    let along = stored.truncate();
    let tangent = (along - normal * along.dot(normal)).try_normalize()?;
    Some(Mat3::from_cols(tangent, normal.cross(tangent) * stored.w.signum(), normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Image, Material, Texture, Wrap};
    use glam::{Affine2, Vec2, Vec4};

    /// A square in the xz plane that looks up, its coordinates as given by `uv` of x and z; every texel of its map is `texel`.
    fn floor(texel: [u8; 3], uv: impl Fn(f32, f32) -> Vec2) -> Scene {
        let corners = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let mesh = Mesh {
            positions: corners.map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec(),
            normals: vec![Vec3::Y; 4],
            uv_sets: vec![corners.map(|[x, z]| uv(x, z)).to_vec()],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let [r, g, b] = texel;
        let reference = TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY };
        Scene {
            meshes: vec![mesh],
            materials: vec![Material { normal_texture: Some(reference), ..Material::default() }],
            textures: vec![Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false }],
            images: vec![Image { name: String::new(), width: 1, height: 1, rgba: vec![r, g, b, 255], encoded: None }],
            ..Scene::default()
        }
    }

    fn bent(scene: &Scene, side: f32) -> [Vec3; 2] {
        [0, 1].map(|triangle| scene.mapped_normal(0, triangle, Vec3::splat(1.0 / 3.0), Vec3::Y * side))
    }

    fn assert_close(found: [Vec3; 2], expected: Vec3) {
        for normal in found {
            assert!(normal.distance(expected.normalize()) < 0.01, "{normal}, not {expected}");
        }
    }

    /// Red is along the growing u and green against the growing v, with tangents or without, mirrored or not.
    #[test]
    fn red_is_right_and_green_is_up_in_the_image() {
        let (right, up) = ([255, 128, 128], [128, 255, 128]);
        for with_tangents in [false, true] {
            for mirrored in [false, true] {
                let sign = if mirrored { -1.0 } else { 1.0 };
                let scene = |texel| {
                    let mut scene = floor(texel, |x, z| Vec2::new(sign * x, z));
                    if with_tangents {
                        // v grows along +z, so the bitangent is -z: x times y is z, and handedness turns it.
                        scene.meshes[0].tangents = vec![Vec4::new(sign, 0.0, 0.0, sign); 4];
                    }
                    scene
                };
                assert_close(bent(&scene(right), 1.0), Vec3::X * sign);
                assert_close(bent(&scene(up), 1.0), Vec3::NEG_Z);
                // From below it is the same surface.
                assert_close(bent(&scene(right), -1.0), Vec3::NEG_X * sign);
                assert_close(bent(&scene(up), -1.0), Vec3::Z);
            }
        }
    }

    #[test]
    fn maps_that_say_nothing_leave_the_normal() {
        let coordinates = |x: f32, z: f32| Vec2::new(x, z);
        let mut scene = floor([128, 128, 255], coordinates);
        assert_close(bent(&scene, 1.0), Vec3::Y);
        // No coordinate changes, so there are no axes.
        scene.meshes[0].uv_sets.clear();
        scene.images[0].rgba = vec![200, 60, 255, 255];
        assert_close(bent(&scene, 1.0), Vec3::Y);
        scene.materials[0].normal_texture = None;
        assert_eq!(bent(&scene, -1.0), [Vec3::NEG_Y; 2]);
    }

    #[test]
    fn the_scale_bends_more() {
        let mut scene = floor([200, 128, 228], Vec2::new);
        let [once, _] = bent(&scene, 1.0);
        scene.materials[0].normal_scale = 2.0;
        let [twice, _] = bent(&scene, 1.0);
        assert!((twice.x / twice.y - 2.0 * once.x / once.y).abs() < 1e-4, "{once} {twice}");
    }
}
