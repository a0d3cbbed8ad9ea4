//! Small valid and broken files from other projects, and real scenes: each loads as its README says, or is refused.
//!
//! The files are not part of this repository: they are read from the folder `shared` beside it, or from the folder that
//! LOCALPRT_SHARED names. Without them the tests say so and pass.

use LoadErrorKind::{Invalid, Unsupported};
use localprt_scenes::{LoadErrorKind, export_glb, load};
use std::path::{Path, PathBuf};

/// What loading a file must give.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Outcome {
    /// So many triangles, of which so many are dropped.
    Triangles(usize, usize),
    Refused(LoadErrorKind),
}

use Outcome::{Refused, Triangles};

const TORTURE: &[(&str, Outcome)] = &[
    ("assimp/BoxBadNormals-glTF-Binary/BoxBadNormals.glb", Triangles(12, 0)),
    ("assimp/BoxTexcoords-glTF/boxTexcoords.gltf", Triangles(12, 0)),
    ("assimp/BoxTextured-glTF-Binary/BoxTextured.glb", Triangles(12, 0)),
    ("assimp/BoxTextured-glTF-Embedded/BoxTextured.gltf", Triangles(12, 0)),
    ("assimp/BoxTextured-glTF-pbrSpecularGlossiness/BoxTextured.gltf", Triangles(12, 0)),
    ("assimp/BoxTextured-glTF-techniqueWebGL/BoxTextured.gltf", Refused(Unsupported)),
    ("assimp/BoxWithInfinites-glTF-Binary/BoxWithInfinites.glb", Refused(Invalid)),
    ("assimp/IncorrectVertexArrays/Cube.gltf", Refused(Invalid)),
    ("assimp/IndexOutOfRange/AllIndicesOutOfRange.gltf", Refused(Invalid)),
    ("assimp/IndexOutOfRange/IndexOutOfRange.gltf", Refused(Invalid)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_00.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_01.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_02.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_03.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_04.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_05.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_06.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_07.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_08.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_09.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_10.gltf", Triangles(0, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_11.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_12.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_13.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_14.gltf", Triangles(2, 0)),
    ("assimp/Mesh_PrimitiveMode/Mesh_PrimitiveMode_15.gltf", Triangles(2, 0)),
    ("assimp/MissingBin/BoxTextured.gltf", Refused(Invalid)),
    ("assimp/RecursiveNodes/RecursiveNodes.gltf", Refused(Invalid)),
    ("assimp/SchemaFailures/sceneWrongType.gltf", Refused(Invalid)),
    ("assimp/TestNoRootNode/NoScene.gltf", Refused(Invalid)),
    ("assimp/TestNoRootNode/SceneWithoutNodes.gltf", Triangles(0, 0)),
    ("assimp/textureTransform/TextureTransformTest.gltf", Triangles(24, 0)),
    ("bevy/Cubes.glb", Triangles(36, 0)),
    ("bevy/IrradianceVolumeExample.glb", Triangles(32, 0)),
    ("bevy/gltf_primitives.glb", Triangles(12, 0)),
    ("gltf-rs/box_sparse.glb", Triangles(12, 0)),
    // All positions are zero because they are stored nowhere.
    ("gltf-rs/non_sparse_accessor_without_buffer_view.gltf", Refused(Invalid)),
    ("gltf-transform/BoxDraco.gltf", Triangles(12, 0)),
    ("gltf-transform/BoxMeshopt.glb", Triangles(12, 0)),
    ("gltf-transform/ShapeCollection.glb", Triangles(3542, 0)),
    ("gltf-transform/TwoCubes.glb", Triangles(24, 0)),
    ("khronos/BoxInterleaved.glb", Triangles(12, 0)),
    ("khronos/BoxVertexColors.glb", Triangles(12, 0)),
    ("khronos/SimpleMeshes/SimpleMeshes.gltf", Triangles(2, 0)),
    ("khronos/SimpleSparseAccessor/SimpleSparseAccessor.gltf", Triangles(12, 0)),
    ("khronos/TextureSettingsTest/TextureSettingsTest.gltf", Triangles(72, 0)),
    ("khronos/TriangleWithoutIndices/TriangleWithoutIndices.gltf", Triangles(1, 0)),
];

/// File, triangles in the file, and the fewest degenerate and duplicate ones among them. Duplicates were counted with a
/// script of another language. The 70 duplicates of Sponza and the 66 of zdm2 have opposite windings and single-sided
/// materials: each is the other side of its twin, so they stay.
const REAL: &[(&str, usize, usize, usize)] = &[
    ("cornell-box/CornellBox.glb", 36, 0, 0),
    ("game-level-zdm2/zdm2.glb", 58_772, 1000, 0),
    ("many-lights-oacmpdm10/oacmpdm10.glb", 26_613, 0, 0),
    ("sponza/sponza.gltf", 262_267, 0, 0),
    ("wooden-staircase/wooden-staircase.glb", 262_663, 155, 15),
];

fn shared_scenes() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let folder = std::env::var_os("LOCALPRT_SHARED").map_or(beside, PathBuf::from).join("scenes");
    if folder.is_dir() {
        return Some(folder);
    }
    println!("no test scenes at {}: nothing checked (set LOCALPRT_SHARED)", folder.display());
    None
}

#[test]
fn torture_files_load_as_their_readme_says_or_are_refused() {
    let Some(folder) = shared_scenes() else { return };
    let mut failures = Vec::new();
    for (file, expected) in TORTURE {
        let path = folder.join("loader-torture").join(file);
        let result = load(&path);
        let found = match &result {
            Ok(scene) => {
                let dropped = scene.dropped.degenerate + scene.dropped.duplicate;
                Triangles(scene.face_count() + dropped, dropped)
            }
            Err(error) => {
                println!("{error}");
                Refused(error.kind)
            }
        };
        if found != *expected {
            failures.push(format!("{file}: {found:?}, expected {expected:?} ({:?})", result.err()));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_torture_file_has_an_expectation() {
    fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("readable folder") {
            let path = entry.expect("readable entry").path();
            match path.extension().and_then(|extension| extension.to_str()) {
                _ if path.is_dir() => collect(&path, found),
                Some("gltf" | "glb") => found.push(path),
                _ => {}
            }
        }
    }
    let Some(folder) = shared_scenes() else { return };
    let folder = folder.join("loader-torture");
    let mut found = Vec::new();
    collect(&folder, &mut found);
    assert_eq!(found.len(), 47);
    for path in found {
        let name = path.strip_prefix(&folder).expect("below the folder").to_string_lossy().into_owned();
        assert!(TORTURE.iter().any(|(file, _)| *file == name), "{name} has no expectation");
    }
}

#[test]
fn real_scenes_load_whole_and_survive_a_round_trip() {
    let Some(folder) = shared_scenes() else { return };
    let out = tempfile::tempdir().expect("temporary folder");
    for &(file, triangles, degenerate, duplicate) in REAL {
        let path = folder.join(file);
        let started = std::time::Instant::now();
        let scene = load(&path).unwrap_or_else(|error| panic!("{error}"));
        let (dropped, seconds) = (scene.dropped, started.elapsed().as_secs_f64());
        println!("{file}: {} triangles, {dropped:?}, {seconds:.3} s", scene.face_count());
        assert_eq!(scene.face_count() + dropped.degenerate + dropped.duplicate, triangles, "{file}");
        assert!(dropped.degenerate >= degenerate, "{file}: {dropped:?}");
        assert!(dropped.duplicate >= duplicate, "{file}: {dropped:?}");

        let copy = out.path().join("copy.glb");
        export_glb(&scene, &copy).unwrap_or_else(|error| panic!("{error}"));
        let again = load(&copy).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(again.dropped, Default::default(), "{file}");
        common::assert_same(&scene, &again);
    }
}

#[test]
fn texture_transforms_point_the_arrows_at_the_green_markers() {
    // The test model shows an image of an arrow; where the transform is right, its tip appears beside the quad's marker
    // child named "Correct".
    let Some(folder) = shared_scenes() else { return };
    let file = folder.join("loader-torture/assimp/textureTransform/TextureTransformTest.gltf");
    let scene = load(file).unwrap_or_else(|error| panic!("{error}"));
    for quad in ["Rotation", "Scale", "All"] {
        let of = |name: &str| scene.meshes.iter().find(|mesh| mesh.name == name).expect("a mesh of the test model");
        let (shown, marker) = (of(quad), of(&format!("{quad} - Correct")));
        let center = marker.positions.iter().sum::<glam::Vec3>() / marker.positions.len() as f32;
        // The quad has side 1, and its texture coordinates grow to the right and down from its upper left corner.
        let corner = shown.positions.iter().copied().reduce(|a, b| glam::vec3(a.x.min(b.x), a.y.max(b.y), a.z));
        let corner = corner.expect("a quad has corners");
        let uv = glam::vec2(center.x - corner.x, corner.y - center.y);
        let texture = scene.materials[shown.material].base_color_texture.expect("a textured quad");
        let on_image = texture.transform.transform_point2(uv);
        // The arrow lies on the image's diagonal and its tip at 0.69 of it; the marker is placed a little beyond.
        assert!((on_image.x - on_image.y).abs() < 0.05, "{quad}: {on_image}");
        assert!((0.65..0.85).contains(&on_image.x), "{quad}: {on_image}");
    }
}

mod common;
