//! Digests of a scene: of all that a bake reads of it, and of its materials one by one.

use crate::digest::{Digest, Digester};
use glam::Vec3;
use localprt_scenes::{AlphaMode, Material, Mesh, Scene, TextureRef, Wrap};
use rayon::prelude::*;

/// Of all that a bake reads of a scene, and of what it hands on with its meshes: not its lights, nor what its materials look like
/// beyond what rays read.
pub fn digest_of_scene(scene: &Scene) -> Digest {
    let materials = digests_of_materials(scene);
    let of_mesh = |mesh: &Mesh| {
        let mut digester = Digester::new("mesh");
        let Mesh {
            name,
            source,
            material,
            positions,
            normals,
            tangents,
            uv_sets,
            colors,
            triangles,
            variants,
            lightmap,
        } = mesh;
        digester.all(name.as_bytes()).all(source.as_bytes()).one(*material as u64);
        digester
            .all(&tangents.iter().map(|tangent| tangent.to_array()).collect::<Vec<_>>())
            .all(positions)
            .all(normals)
            .one(uv_sets.len() as u64);
        uv_sets.iter().for_each(|set| {
            digester.all(set);
        });
        digester.all(&colors.iter().map(|color| color.to_array()).collect::<Vec<_>>()).all(triangles);
        variants.iter().flatten().for_each(|&index| {
            digester.one(index as u64);
        });
        digester.one(lightmap.texel_scale).one(u8::from(lightmap.bake)).finish()
    };
    let mut digester = Digester::new("scene");
    let set = scene.light_map_set.map_or(u64::MAX, |set| set as u64);
    digester.one(set).all(&materials).all(&scene.meshes.par_iter().map(of_mesh).collect::<Vec<_>>());
    for camera in &scene.cameras {
        digester.one(camera.to_world.to_cols_array());
    }
    digester.finish()
}

/// Of all of a mesh that its charts depend on, but for where it is: not its name.
pub fn digest_of_shape(scene: &Scene, mesh: &Mesh) -> Digest {
    let Mesh {
        name: _,
        source: _,
        variants: _,
        material,
        positions,
        normals,
        tangents,
        uv_sets,
        colors,
        triangles,
        lightmap,
    } = mesh;
    let mut digester = Digester::new("shape");
    digester.one(positions.len() as u64).all(normals).one(uv_sets.len() as u64);
    uv_sets.iter().for_each(|set| {
        digester.all(set);
    });
    digester
        .all(&tangents.iter().map(|tangent| tangent.to_array()).collect::<Vec<_>>())
        .all(&colors.iter().map(|color| color.to_array()).collect::<Vec<_>>())
        .all(triangles)
        .one(u8::from(scene.materials[*material].double_sided))
        .one(lightmap.texel_scale)
        .one(u8::from(lightmap.bake))
        .finish()
}

/// `[n_materials]` of what rays read of each: nothing that only a camera sees.
pub fn digests_of_materials(scene: &Scene) -> Vec<Digest> {
    let images: Vec<Digest> = scene
        .images
        .par_iter()
        .map(|image| Digester::new("image").one([image.width, image.height]).all(&image.rgba).finish())
        .collect();
    let texture = |reference: &Option<TextureRef>, digester: &mut Digester| {
        let Some(TextureRef { texture, uv_set, transform }) = reference else {
            digester.one(0u8);
            return;
        };
        let texture = &scene.textures[*texture];
        let wrap = |wrap: Wrap| wrap as u8;
        digester
            .one(1u8)
            .one(*uv_set as u64)
            .one(images[texture.image])
            .one([wrap(texture.wrap_u), wrap(texture.wrap_v), u8::from(texture.nearest)])
            .one(transform.to_cols_array());
    };
    let of_material = |material: &Material| {
        let mut digester = Digester::new("material");
        let alpha = match material.alpha {
            AlphaMode::Opaque => [0.0, 0.0],
            AlphaMode::Mask { cutoff } => [1.0, cutoff],
            AlphaMode::Blend => [2.0, 0.0],
        };
        let flags = [u8::from(material.double_sided), u8::from(material.emission != Vec3::ZERO)];
        digester.one(material.base_color.to_array()).one(alpha).one(flags);
        texture(&material.base_color_texture, &mut digester);
        digester.finish()
    };
    scene.materials.iter().map(of_material).collect()
}
