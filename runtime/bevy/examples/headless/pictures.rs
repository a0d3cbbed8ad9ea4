//! Pictures in several lights, and the same lights for the viewer.

use crate::stage::{EXPOSURE, Stage, save};
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy_localprt::{Relit, SkyRadiance};
use std::f32::consts::PI;
use std::path::Path;

/// Gathers of a picture.
const GATHERS: u32 = 8;
/// Where Burley's diffuse reflection, which Bevy has, comes close to Lambert's, which bakes have.
const ROUGHNESS: f32 = 0.7;
const LUMENS_PER_CANDELA: f32 = 4.0 * PI;
/// From where the lamp's node is, (0, 1.5, 0), to (0.5, 0.6, 0.4).
const MOVED: Vec3 = Vec3::new(0.5, -0.9, 0.4);

/// Name, what is changed, and what the viewer is told.
type Light = (&'static str, fn(&mut Stage), &'static str);

const LIGHTS: [Light; 7] = [
    ("lamp", |_| {}, "{}"),
    (
        "moved",
        |stage| stage.change::<Transform>(stage.lamp, |place| place.translation = MOVED),
        r#"{"lights": [{"type": "point", "position": [0.5, 0.6, 0.4], "intensity": 2.25}]}"#,
    ),
    (
        "spot",
        |stage| {
            let light = SpotLight {
                color: Color::linear_rgb(1.0, 0.246201, 0.057805),
                intensity: 6.0 * LUMENS_PER_CANDELA,
                inner_angle: 0.45,
                outer_angle: 0.5,
                shadow_maps_enabled: true,
                ..default()
            };
            let place = Transform::from_xyz(-0.6, 1.6, 0.6).looking_to(Vec3::new(1.1, -1.6, -1.1), Vec3::Y);
            replace_lamp(stage, (light, place));
        },
        r#"{"lights": [{"type": "spot", "position": [-0.6, 1.6, 0.6], "direction": [1.1, -1.6, -1.1],
            "color": [1, 0.246201, 0.057805], "intensity": 6, "inner_cone": 0.45, "outer_cone": 0.5}]}"#,
    ),
    (
        "sun",
        |stage| {
            let light = DirectionalLight { illuminance: 2.0, shadow_maps_enabled: true, ..default() };
            let place = Transform::IDENTITY.looking_to(Vec3::new(-0.5, -1.0, -2.0), Vec3::Y);
            let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 7.0, ..default() }.build();
            replace_lamp(stage, (light, place, cascades));
            // Walls of one side cast shadows from behind too.
            stage.change_materials("", |material| material.cull_mode = None);
        },
        r#"{"lights": [{"type": "directional", "direction": [-0.5, -1, -2], "intensity": 2}]}"#,
    ),
    (
        "emission",
        |stage| {
            stage.change_materials("red", |material| {
                material.emissive = LinearRgba::rgb(0.4, 0.1, 0.1);
                material.emissive_exposure_weight = 1.0;
            });
        },
        r#"{"materials": {"red": {"emission": [0.4, 0.1, 0.1]}}}"#,
    ),
    (
        "sky",
        |stage| {
            let radiance = Vec3::new(0.1, 0.2, 0.4);
            stage.change::<Relit>(stage.root, |relit| relit.sky = SkyRadiance::constant(radiance));
            stage.app.insert_resource(ClearColor(Color::LinearRgba(LinearRgba::from_vec3(EXPOSURE * radiance))));
            hide_lamp(stage);
        },
        r#"{"lights": [], "sky": {"type": "constant", "radiance": [0.1, 0.2, 0.4]}}"#,
    ),
    // Lamp and camera go with the scene: the picture stays.
    (
        "turned",
        |stage| {
            stage.change::<Transform>(stage.root, |place| {
                *place = Transform::from_xyz(3.0, -1.0, 2.0).with_rotation(Quat::from_rotation_y(1.0));
            });
        },
        "{}",
    ),
];

/// Each light in a picture of its own, and once more with bounced light alone on gray surfaces, as the viewer's view `indirect` is.
pub fn pictures(mut stage: Stage, out: &Path) -> Result<(), String> {
    stage.change_materials("", |material| {
        material.reflectance = 0.0;
        material.perceptual_roughness = ROUGHNESS;
    });
    for (name, change, lighting) in LIGHTS {
        let before = Before::of(&mut stage);
        change(&mut stage);
        take(&mut stage, out, name, lighting)?;
        if name != "emission" {
            show_indirect(&mut stage);
            take(&mut stage, out, &format!("{name}.indirect"), lighting)?;
        }
        before.restore(&mut stage);
    }
    Ok(())
}

fn take(stage: &mut Stage, out: &Path, name: &str, lighting: &str) -> Result<(), String> {
    stage.draw_anew(GATHERS)?;
    save(&stage.picture(), out, name)?;
    let path = out.join(format!("{name}.json"));
    std::fs::write(&path, lighting).map_err(|error| format!("{}: {error}", path.display()))?;
    println!("{name}: a picture of Bevy's");
    Ok(())
}

/// What pictures change.
struct Before {
    materials: Vec<(AssetId<StandardMaterial>, StandardMaterial)>,
    lamp: (Transform, Visibility, PointLight),
    root: Transform,
}

impl Before {
    fn of(stage: &mut Stage) -> Self {
        let world = stage.app.world();
        let of_lamp = world.entity(stage.lamp);
        let lamp = (
            *of_lamp.get::<Transform>().expect("a lamp is somewhere"),
            *of_lamp.get::<Visibility>().expect("a lamp is visible or not"),
            *of_lamp.get::<PointLight>().expect("the lamp is a point light"),
        );
        let root = *world.get::<Transform>(stage.root).expect("the scene is somewhere");
        let materials = world.resource::<Assets<StandardMaterial>>();
        let materials = materials.iter().map(|(id, material)| (id, material.clone())).collect();
        Self { materials, lamp, root }
    }

    fn restore(self, stage: &mut Stage) {
        let world = stage.app.world_mut();
        let mut others = world.query_filtered::<Entity, Or<(With<SpotLight>, With<DirectionalLight>)>>();
        for other in others.iter(world).collect::<Vec<_>>() {
            world.despawn(other);
        }
        world.entity_mut(stage.lamp).insert(self.lamp);
        world.entity_mut(stage.root).insert(self.root);
        world.insert_resource(ClearColor(Color::BLACK));
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        for (id, before) in self.materials {
            if let Some(mut material) = materials.get_mut(id) {
                *material = before;
            }
        }
        stage.change::<Relit>(stage.root, |relit| relit.sky = SkyRadiance::default());
    }
}

fn hide_lamp(stage: &mut Stage) {
    stage.change::<Visibility>(stage.lamp, |visibility| *visibility = Visibility::Hidden);
}

fn replace_lamp(stage: &mut Stage, light: impl Bundle) {
    hide_lamp(stage);
    stage.app.world_mut().spawn(light);
}

/// Lights shine on, but for the eye; as does the sky.
fn show_indirect(stage: &mut Stage) {
    stage.app.insert_resource(ClearColor(Color::BLACK));
    let world = stage.app.world_mut();
    world
        .query::<&mut PointLight>()
        .iter_mut(world)
        .for_each(|mut light| light.affects_lightmapped_mesh_diffuse = false);
    world
        .query::<&mut SpotLight>()
        .iter_mut(world)
        .for_each(|mut light| light.affects_lightmapped_mesh_diffuse = false);
    let mut suns = world.query::<&mut DirectionalLight>();
    suns.iter_mut(world).for_each(|mut light| light.affects_lightmapped_mesh_diffuse = false);
    stage.change_materials("", |material| material.base_color = Color::linear_rgb(0.5, 0.5, 0.5));
}
