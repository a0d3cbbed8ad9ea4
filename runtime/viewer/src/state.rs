//! Everything that a user can change, as plain data: the same state gives the same picture, with a window or without.

use crate::open_bake::OpenBake;
use crate::options::Specular;
use crate::other_light::Beside;
use crate::tone::ToneMap;
use crate::viewpoint::Viewpoint;
use crate::views::ViewKind;
use glam::Vec3;
use localprt_scenes::{Light, LightKind, Lighting, MaterialOverride, Sky};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is shown, under which light, and how.
#[derive(Clone, Debug)]
pub struct ViewState {
    /// Where the picture is taken from.
    pub viewpoint: Viewpoint,
    /// Lights, shining or not.
    pub lights: Vec<SceneLight>,
    /// The sky; another `Arc` is another sky.
    pub sky: Arc<Sky>,
    /// Overrides by material name.
    pub materials: BTreeMap<String, MaterialOverride>,
    /// One albedo for all surfaces, in the light and in the picture.
    pub albedo_override: Option<f32>,
    /// Black balls that block light, also on its way to the probes.
    pub balls: Vec<Ball>,
    /// A door, likewise.
    pub door: Option<Door>,
    /// A ball that the light of the place falls on.
    pub object: Option<LitObject>,
    /// Gathers.
    pub bounces: Bounces,
    /// Picture.
    pub look: Look,
    /// Another system's light in a part of the picture.
    pub beside: Option<Beside>,
    /// Things drawn over the scene.
    pub overlays: OverlayState,
    /// Whether lights and things that can move do.
    pub animate: bool,
}

/// A light and what the viewer does with it.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneLight {
    /// The light at rest.
    pub light: Light,
    /// Shines.
    pub on: bool,
    /// Is held by the camera: shines from the eye to where it looks.
    pub held: bool,
    /// Goes around its place while things move.
    pub circles: bool,
}

impl SceneLight {
    /// A light that shines and stays.
    pub fn new(light: Light) -> Self {
        Self { light, on: true, held: false, circles: false }
    }
}

/// A black ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Middle, metres.
    pub center: Vec3,
    /// Radius, metres.
    pub radius_m: f32,
    /// Goes around its place while things move.
    pub circles: bool,
}

/// A door: a slab that turns about one upright edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Door {
    /// Lower end of the edge that it turns about, metres.
    pub hinge: Vec3,
    /// Width, height and thickness, metres.
    pub size_m: Vec3,
    /// Direction of the closed door from its hinge, degrees about +Y from +X.
    pub direction: f32,
    /// How far it is open, degrees.
    pub open: f32,
    /// Albedo, 0..=1.
    pub albedo: Vec3,
    /// Swings while things move.
    pub swings: bool,
}

/// A ball lit by what arrives where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LitObject {
    /// Middle, metres.
    pub center: Vec3,
    /// Radius, metres.
    pub radius_m: f32,
    /// Albedo, 0..=1.
    pub albedo: Vec3,
    /// Emitted radiance, W sr^-1 m^-2. It is seen, and lights nothing.
    pub emission: Vec3,
    /// Goes around its place while things move.
    pub circles: bool,
}

/// How often light is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounces {
    /// One gather per frame on top of all earlier ones: after a while, all bounces.
    All,
    /// So many gathers from darkness, every frame.
    Exactly(u32),
}

/// How the picture is made of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// What surfaces show.
    pub view: ViewKind,
    /// Radiance times 2^EV; `None` is measured from the picture.
    pub exposure: Option<f32>,
    /// From exposed radiance to the screen.
    pub tone_map: ToneMap,
    /// Normal maps bend normals.
    pub normal_maps: bool,
    /// Mirror reflection.
    pub specular: Option<Specular>,
    /// Leaves backs of one-sided surfaces out, so that one can look into a room from outside.
    pub cull_backs: bool,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            view: ViewKind::Final,
            exposure: None,
            tone_map: ToneMap::default(),
            normal_maps: true,
            specular: None,
            cull_backs: false,
        }
    }
}

impl Look {
    /// Mirror reflection on, as of polished stone, or off.
    pub fn toggle_specular(&mut self) {
        self.specular = if self.specular.is_some() { None } else { Some(Specular { f0: 0.04, roughness: None }) };
    }
}

/// What is drawn over the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OverlayState {
    /// All probes as balls that show their radiance.
    pub probes: bool,
    /// Radius of these balls, as a share of the median support radius.
    pub probe_size: f32,
    /// A probe and the ball of its support.
    pub probe: Option<u32>,
    /// Relight rays of that probe.
    pub rays: bool,
    /// A receiver with its supporting probes.
    pub receiver: Option<u32>,
    /// Lights as wire shapes.
    pub lights: bool,
    /// Light with handles to drag it by.
    pub selected_light: Option<usize>,
}

/// Radius of probe balls unless changed, as a share of the median support radius.
pub const PROBE_SIZE: f32 = 0.06;

impl ViewState {
    /// The first picture: one of the scene's cameras, under a lighting.
    pub fn new(bake: &OpenBake<'_>, camera: usize, lighting: &Lighting) -> Self {
        let camera = &bake.cameras[camera.min(bake.cameras.len() - 1)];
        Self {
            viewpoint: Viewpoint::of_camera(camera, focus_m(bake, camera)),
            lights: lighting.lights.iter().cloned().map(SceneLight::new).collect(),
            sky: Arc::new(lighting.sky.clone()),
            materials: lighting.materials.clone(),
            albedo_override: lighting.albedo_override,
            balls: Vec::new(),
            door: None,
            object: None,
            bounces: Bounces::All,
            look: Look::default(),
            beside: None,
            overlays: OverlayState { probe_size: PROBE_SIZE, ..OverlayState::default() },
            animate: false,
        }
    }

    /// Takes another lighting, and leaves the rest.
    pub fn set_lighting(&mut self, lighting: &Lighting) {
        self.lights = lighting.lights.iter().cloned().map(SceneLight::new).collect();
        self.sky = Arc::new(lighting.sky.clone());
        self.materials.clone_from(&lighting.materials);
        self.albedo_override = lighting.albedo_override;
        self.overlays.selected_light = None;
    }

    /// Goes to a camera of the scene, or to the one that shows all of it.
    pub fn go_to(&mut self, bake: &OpenBake<'_>, camera: usize) {
        if let Some(camera) = bake.cameras.get(camera) {
            self.viewpoint = Viewpoint::of_camera(camera, focus_m(bake, camera));
        }
    }

    /// Whether it gives the same picture as another, for as far as that is cheap to tell.
    pub fn is_same_as(&self, other: &Self) -> bool {
        self.viewpoint == other.viewpoint
            && self.lights == other.lights
            && Arc::ptr_eq(&self.sky, &other.sky)
            && self.materials == other.materials
            && self.albedo_override == other.albedo_override
            && self.bounces == other.bounces
            && self.look == other.look
            && self.beside == other.beside
            && self.overlays == other.overlays
    }

    /// The lighting as a file for `--lights` says it: the lights that shine now, sky, materials.
    pub fn lighting(&self, lights: Vec<Light>) -> Lighting {
        Lighting {
            lights,
            sky: (*self.sky).clone(),
            materials: self.materials.clone(),
            albedo_override: self.albedo_override,
        }
    }
}

/// Distance of what is in the middle of a camera's picture.
fn focus_m(bake: &OpenBake<'_>, camera: &localprt_scenes::Camera) -> f32 {
    let at = Viewpoint::of_camera(camera, 1.0);
    bake.caster.closest_hit(at.eye(), at.ahead()).map_or(0.5 * bake.extent_m(), |hit| hit.t)
}

/// Of new lights.
const LUX: f32 = 10.0;

/// A new light of a kind: white, before the eye, bright enough to be seen in a scene of this size.
pub fn new_light(kind: LightKind, viewpoint: &Viewpoint, extent_m: f32) -> Light {
    let distance_m = 0.4 * viewpoint.focus_m;
    Light {
        name: match kind {
            LightKind::Point => "new point light".into(),
            LightKind::Spot { .. } => "new spot light".into(),
            LightKind::Directional => "new sun".into(),
        },
        kind,
        position: viewpoint.eye() + distance_m * viewpoint.ahead(),
        direction: match kind {
            LightKind::Directional => Vec3::new(-0.4, -1.0, -0.3).normalize(),
            _ => viewpoint.ahead(),
        },
        color: Vec3::ONE,
        // So many lux a quarter of the scene away.
        intensity: if kind == LightKind::Directional { LUX } else { LUX * (0.25 * extent_m).powi(2) },
        range: None,
    }
}

/// A clear sky, dimmed like [`LUX`].
pub const BLUE_SKY: Sky = Sky::Gradient {
    zenith: Vec3::new(1.0, 2.0, 4.0),
    horizon: Vec3::new(3.6, 3.8, 4.0),
    ground: Vec3::new(0.4, 0.36, 0.32),
};

/// How far toward what the eye looks at new things are put.
const NEW_AHEAD: f32 = 0.7;
/// How far beside the middle of the picture, as a share of that distance.
const NEW_BESIDE: f32 = 0.12;

/// A place before the eye, so many [`NEW_BESIDE`] to the right, and the radius of a ball there; metres.
fn place(bake: &OpenBake<'_>, viewpoint: &Viewpoint, steps_right: f32) -> (Vec3, f32) {
    let (low, high) = bake.bounds;
    let ahead_m = NEW_AHEAD * viewpoint.focus_m;
    let beside_m = steps_right * NEW_BESIDE * ahead_m;
    let at = viewpoint.eye() + ahead_m * viewpoint.ahead() + beside_m * viewpoint.right();
    (at, 0.08 * (high - low).min_element())
}

impl Ball {
    /// One that moves, left of the middle.
    pub fn new(bake: &OpenBake<'_>, viewpoint: &Viewpoint) -> Self {
        let (center, radius_m) = place(bake, viewpoint, -1.0);
        Self { center, radius_m, circles: true }
    }
}

impl LitObject {
    /// A white one that moves, right of the middle.
    pub fn new(bake: &OpenBake<'_>, viewpoint: &Viewpoint) -> Self {
        let (center, radius_m) = place(bake, viewpoint, 1.0);
        Self { center, radius_m, albedo: Vec3::splat(0.8), emission: Vec3::ZERO, circles: true }
    }
}

impl Door {
    /// Two thirds as high as the scene, standing on its floor far to the right, swinging.
    pub fn new(bake: &OpenBake<'_>, viewpoint: &Viewpoint) -> Self {
        let (at, _) = place(bake, viewpoint, 2.0);
        let (low, high) = bake.bounds;
        let height = 0.67 * (high.y - low.y);
        Self {
            hinge: Vec3::new(at.x, low.y, at.z),
            size_m: Vec3::new(0.5 * height, height, 0.03 * height),
            direction: 0.0,
            open: 0.0,
            albedo: Vec3::splat(0.5),
            swings: true,
        }
    }
}

/// A spot as torches are: for [`SceneLight::held`].
pub fn torch(viewpoint: &Viewpoint, extent_m: f32) -> SceneLight {
    let light = Light {
        name: "torch".into(),
        // As bright where it is pointed at as other new lights are around them.
        intensity: LUX * viewpoint.focus_m.powi(2),
        ..new_light(LightKind::Spot { inner_cone: 0.2, outer_cone: 0.4 }, viewpoint, extent_m)
    };
    SceneLight { held: true, ..SceneLight::new(light) }
}
