//! A lamp that goes around in a baked scene:
//!
//!     lamp FILE.lprt
//!
//! FILE.glb, the scene that the bake wrote, lies beside it. The arrow keys change the height of the lamp, space lets the first material glow.

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_localprt::{LocalprtPlugin, Relit};
use std::path::{Path, PathBuf};

/// Files by name, in the folder of assets.
#[derive(Resource)]
struct Baked {
    file: String,
    scene: String,
}

fn main() {
    let Some(path) = std::env::args().nth(1).map(PathBuf::from) else {
        eprintln!("lamp FILE.lprt");
        std::process::exit(2);
    };
    let path = std::path::absolute(&path).unwrap_or(path);
    let folder = path.parent().unwrap_or(Path::new("/")).to_string_lossy().into_owned();
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let baked = Baked { file: name(&path), scene: name(&path.with_extension("glb")) };
    App::new()
        .add_plugins((DefaultPlugins.set(AssetPlugin { file_path: folder, ..default() }), LocalprtPlugin))
        // What the bake replaces.
        .insert_resource(GlobalAmbientLight::NONE)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(baked)
        .add_systems(Startup, load)
        .add_systems(Update, (set_up, move_lamp, glow))
        .run();
}

fn load(mut commands: Commands, assets: Res<AssetServer>, baked: Res<Baked>) {
    let scene = assets.load(GltfAssetLabel::Scene(0).from_asset(baked.scene.clone()));
    commands.spawn((WorldAssetRoot(scene), Relit::new(assets.load(&baked.file))));
}

/// The scene's own camera and lamps, as they come.
fn set_up(
    mut commands: Commands,
    cameras: Query<Entity, Added<Camera3d>>,
    mut lamps: Query<&mut PointLight, Added<PointLight>>,
) {
    for camera in &cameras {
        // Scenes of this project shine with a few candela, not with thousands of lumens.
        commands.entity(camera).insert(Exposure { ev100: -2.0 });
    }
    for mut lamp in &mut lamps {
        lamp.shadow_maps_enabled = true;
        lamp.shadow_depth_bias = 0.01;
    }
}

fn move_lamp(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    mut lamps: Query<&mut Transform, With<PointLight>>,
    mut height: Local<f32>,
) {
    let steps = f32::from(keys.pressed(KeyCode::ArrowUp)) - f32::from(keys.pressed(KeyCode::ArrowDown));
    *height += 0.5 * steps * time.delta_secs();
    let turn = time.elapsed_secs();
    for mut place in &mut lamps {
        // Around the node that it hangs on.
        place.translation = Vec3::new(0.5 * turn.sin(), *height - 0.2, 0.5 * turn.cos());
    }
}

fn glow(
    keys: Res<ButtonInput<KeyCode>>,
    worn: Query<&MeshMaterial3d<StandardMaterial>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut is_on: Local<bool>,
) {
    if !keys.just_pressed(KeyCode::Space) {
        return;
    }
    *is_on = !*is_on;
    let Some(mut material) = worn.iter().next().and_then(|material| materials.get_mut(material)) else { return };
    material.emissive = if *is_on { LinearRgba::rgb(0.4, 0.3, 0.1) } else { LinearRgba::BLACK };
    material.emissive_exposure_weight = 1.0;
}
