//! Inputs from which mutations start: what this program writes, small.

use super::{BAKE, CELLS, LAYOUT, LEAF, PROGRAM, mutate::arrays};
use glam::Affine2;
use localprt_formats::to_bytes;
use localprt_precompute::{
    BakeOutput, BakeSettings, Progress,
    cache::{Cache, CacheOptions},
    pipeline::{Reuse, bake_with},
    shards::ShardPlan,
};
use localprt_scenes::{AlphaMode, Image, Scene, Texture, TextureRef, Wrap, builtin, export_glb};
use std::{fs, sync::OnceLock};

/// A small bake, and what it left in a cache.
pub struct Bake {
    output: BakeOutput,
    cache: tempfile::TempDir,
}

/// The scene of all seeds.
pub fn scene() -> &'static Scene {
    static SCENE: OnceLock<Scene> = OnceLock::new();
    SCENE.get_or_init(|| builtin::scene("furnace").expect("a scene"))
}

/// Options of the bake.
fn small() -> BakeSettings {
    BakeSettings {
        probes: Some(3),
        receivers: 40,
        lightmap: Some(16),
        direct_map: 16,
        gather_rays: 16,
        relight_rays: 8,
        probe_degree: 1,
        sky_degree: 1,
        leaf: 16,
        ..BakeSettings::default()
    }
}

/// Bakes.
pub fn bake() -> Bake {
    let cache = tempfile::tempdir().expect("a folder");
    let kept = Cache::open(cache.path(), CacheOptions::default()).expect("opens");
    let reuse = Reuse { cache: Some(&kept), ..Reuse::default() };
    let output = bake_with(scene().clone(), &small(), reuse, &Progress::silent()).expect("bakes");
    Bake { output, cache }
}

/// Baked files: of all optional sections, and that of the bake.
pub fn files(bake: &Bake) -> Vec<Vec<u8>> {
    let golden = include_bytes!("../../formats/tests/data/minimal_v2_1.lprt");
    vec![golden.to_vec(), to_bytes(&bake.output.arrays).expect("sound")]
}

/// Records of the cache, behind their heads.
pub fn records(bake: &Bake) -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for folder in fs::read_dir(bake.cache.path()).expect("a folder").flatten().filter(|entry| entry.path().is_dir()) {
        for record in fs::read_dir(folder.path()).expect("a folder").flatten() {
            let kind = record.path().extension().and_then(|kind| kind.to_str().map(str::to_owned));
            let Some(kind) = ["cells", "leaf", "layout"].iter().position(|name| kind.as_deref() == Some(name)) else {
                continue;
            };
            let content = fs::read(record.path()).expect("a record").split_off(40);
            let mut seed = vec![[CELLS, LEAF, LAYOUT][kind], 0, 3];
            seed.extend(content);
            let (_, arrays) = arrays(&seed).expect("a record");
            match seed[0] {
                // Places of its receivers.
                LEAF => seed[1] = (arrays[9].1.len() / 4) as u8,
                // All cells of a room are crossed; a set of few is smaller.
                CELLS => {
                    let counts =
                        arrays[0].1.chunks_exact(4).map(|run| u32::from_le_bytes(run.try_into().expect("four bytes")));
                    let runs = [counts.sum::<u32>() - 2, 2].map(u32::to_le_bytes).concat();
                    // The last word has few cells: its first is one of them.
                    let words = [1u64; 2].map(u64::to_le_bytes).concat();
                    seed = [&[CELLS, 0, 0], &1u64.to_le_bytes()[..], &runs, &2u64.to_le_bytes(), &words].concat();
                }
                _ => {}
            }
            seeds.push(seed);
        }
    }
    seeds.sort();
    seeds.dedup();
    let report = bake.output.report.to_json();
    let mut kept = vec![BAKE, 0, 0];
    for (count, bytes) in [(2u64, &[5; 64][..]), (report.len() as u64, report.as_bytes())] {
        kept.extend(count.to_le_bytes());
        kept.extend(bytes);
    }
    seeds.push(kept);
    seeds
}

/// Plans: of the bake, and of shards.
pub fn plans(bake: &Bake) -> Vec<Vec<u8>> {
    let options = small().to_toml();
    let mut plan = ShardPlan::new("builtin:furnace".into(), "00".into(), options, &[3.0, 1.0, 0.1, 0.7, 2.0], 2);
    plan.cache = Some("s3://bakes/hall".into());
    plan.layout = Some(["hall.glb".into(), "00".into()]);
    let shards = plan.to_json().replacen(super::program(), PROGRAM, 1);
    vec![bake.output.arrays.plan.clone().into_bytes(), shards.into_bytes()]
}

/// Scenes: as this program writes them, and by hand.
pub fn scenes(bake: &Bake) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let written = |scene: &Scene| {
        let path = folder.path().join("scene.glb");
        export_glb(scene, &path).expect("writes");
        fs::read(path).expect("is there")
    };
    let mut textured = bake.output.scene.clone();
    textured.images.push(Image {
        name: "dots".into(),
        width: 2,
        height: 2,
        rgba: (0..16).map(|i| 16 * i).collect(),
        encoded: None,
    });
    textured.textures.push(Texture {
        image: 0,
        wrap_u: Wrap::MirroredRepeat,
        wrap_v: Wrap::ClampToEdge,
        nearest: true,
    });
    for material in &mut textured.materials {
        material.base_color_texture = Some(TextureRef { texture: 0, uv_set: 1, transform: Affine2::IDENTITY });
        material.alpha = AlphaMode::Mask { cutoff: 0.25 };
        material.double_sided = true;
    }
    textured.lights = builtin::scene("cornell").expect("a scene").lights;
    let plain = [written(&bake.output.scene), written(&textured), GLTF.as_bytes().to_vec()];
    plain.into_iter().chain(COMPRESSED.map(<[u8]>::to_vec)).collect()
}

/// Packed as the web packs them.
const COMPRESSED: [&[u8]; 5] = [
    include_bytes!("../../scenes/tests/compressed/cornell-draco.glb"),
    include_bytes!("../../scenes/tests/compressed/cornell-meshopt.glb"),
    include_bytes!("../../scenes/tests/compressed/picture-webp.glb"),
    include_bytes!("../../scenes/tests/compressed/picture-etc1s.glb"),
    include_bytes!("../../scenes/tests/compressed/picture-uastc.glb"),
];

/// A triangle twice, once by sparse values and once as a strip, under nodes with cameras and lights.
const GLTF: &str = r#"{"asset":{"version":"2.0"},"extensionsRequired":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[
{"type":"spot","spot":{"innerConeAngle":0.1,"outerConeAngle":0.5},"color":[1,0.5,0.25],"intensity":3,"range":9}]}},
"scene":0,"scenes":[{"nodes":[0]}],
"nodes":[{"children":[1,2],"scale":[1,-1,1]},{"mesh":0,"translation":[0,0,1],"rotation":[0,0,0.6,0.8],
"extras":{"localprt":{"texel_scale":2.0,"bake":false}}},
{"mesh":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,4,0,0,1],"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1,"aspectRatio":1.5}}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":2},"indices":1,"material":0}]},
{"primitives":[{"attributes":{"POSITION":3,"TEXCOORD_0":4},"mode":5,"material":0}]}],
"materials":[{"name":"paint","emissiveFactor":[1,1,1],"alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,0.125,1],
"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0,1],"rotation":1,"scale":[2,2]}}}},
"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4}}}],
"textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071,"wrapT":33648,"magFilter":9728}],
"images":[{"uri":"data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,
"indices":{"bufferView":1,"byteOffset":4,"componentType":5123},"values":{"bufferView":0}}},
{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"},{"bufferView":2,"componentType":5121,"count":3,"type":"VEC4","normalized":true},
{"bufferView":3,"componentType":5122,"count":4,"type":"VEC3"},{"bufferView":3,"componentType":5123,"count":4,"type":"VEC2","normalized":true}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},{"buffer":0,"byteOffset":24,"byteLength":12,"byteStride":4},
{"buffer":0,"byteLength":32,"byteStride":8}],
"buffers":[{"byteLength":44,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAECAAEAAAA="}]}"#;

/// Lighting files: of every key.
pub fn lightings() -> Vec<Vec<u8>> {
    let all = r#"{"lights":[{"type":"spot","position":[1,2.1,3],"direction":[0,-2,0.3],"color":[1,0.5,0.25],"intensity":20.3,"range":9,
"inner_cone":0.1,"outer_cone":0.6},{"type":"point","position":[0.3,0,0]},{"type":"directional","direction":[3,0,4],"intensity":2}],
"sky":{"type":"gradient","zenith":[1,2,3],"horizon":[4,5,6],"ground":[7,8,9]},
"materials":{"glow":{"albedo":[0.1,0.2,0.3],"emission":[1,2,3]}},"albedo_override":0.25}"#;
    let few = r#"{"sky":{"type":"constant","radiance":[0.1,1,1]},"materials":{"glow":{"albedo":0.5}}}"#;
    vec![all.into(), few.into()]
}

/// Options: all that there are, and none.
pub fn settings() -> Vec<Vec<u8>> {
    let all = BakeSettings {
        spacing: Some(0.1),
        voxel: Some(0.01),
        interior: vec![[0.1, 1.0, -2.5], [0.0, 0.0, 0.0]],
        focus: vec![[0.0, 1.0, 2.0, 3.0]],
        texel: Some(0.05),
        volume: Some(0.5),
        max_unseen: Some(0.25),
        ..small()
    };
    vec![all.to_toml().into_bytes(), b"fill = 0.1\nlightmap = 256\n".to_vec()]
}
