//! A system that is asked for a frame at a time.

use super::moving_scene::MovingScene;
use crate::other_light::{OtherLight, OtherRecord};
use crate::other_system::{Found, Moment, OtherFigures};
use glam::Vec3;
use half::f16;
use localprt_formats::Checked;
use localprt_scenes::{Lighting, SurfacePoint};
use localprt_surfaces::rays::RayCaster;
use localprt_systems::hybrid::{self, Hybrid};
use localprt_systems::{
    Event, Feedback, Frame, KINDS, Kind, Object, Query, Setup, Shaded, ShaderHarmonics, ShaderLight, ShaderProbes,
    System, Weighting, World, moved,
};
use web_time::Instant;

/// Seed of what is random, so that pictures can be made again.
const SEED: u64 = 1;

/// Bytes that a shader may read of one buffer on every device: WebGPU's least `maxStorageBufferBindingSize`, less the record.
const LARGEST_BUFFER: usize = (128 << 20) - size_of::<OtherRecord>();

/// Names of all systems.
pub fn names() -> impl Iterator<Item = &'static str> {
    std::iter::once(hybrid::NAME).chain(KINDS.iter().map(|kind| kind.name))
}

/// A system before it has probes.
pub(super) enum Chosen<'a> {
    /// Of another paper.
    Other(&'static Kind),
    /// This file with probes around what moves.
    Hybrid(Box<Checked<'a>>),
}

impl<'a> Chosen<'a> {
    /// The system of a name; `None` if there is no such name.
    pub(super) fn of_name(name: &str, baked: &Checked<'a>) -> Option<Self> {
        if name == hybrid::NAME {
            return Some(Self::Hybrid(Box::new(baked.clone())));
        }
        KINDS.iter().find(|kind| kind.name == name).map(|kind| Self::Other(kind))
    }

    fn title(&self) -> &'static str {
        match self {
            Self::Other(kind) => kind.title,
            Self::Hybrid(_) => hybrid::TITLE,
        }
    }

    /// Among what stands still.
    fn prepare(&self, caster: &'a RayCaster<'a>, lighting: &Lighting, setup: &Setup<'_>) -> Box<dyn System + 'a> {
        match self {
            Self::Other(kind) => (kind.prepare)(&World::new(caster, lighting), setup),
            Self::Hybrid(baked) => {
                Box::new(Hybrid::new((**baked).clone(), caster, hybrid::Settings::default(), setup.seed))
            }
        }
    }
}

/// The file's receivers, for systems that are asked at points.
#[derive(Clone)]
pub(super) struct Receivers {
    points: Vec<Shaded>,
    texels: Vec<u32>,
    /// Texel, receiver.
    gutters: Vec<[u32; 2]>,
    /// Texels per side.
    size: u32,
    probes: usize,
}

impl Receivers {
    pub(super) fn of(baked: &Checked<'_>) -> Self {
        let view = baked.view();
        let point = |(&position, &normal): (&[f32; 3], &[f32; 3])| {
            let normal = normal.into();
            Shaded::from_above(SurfacePoint { position: position.into(), normal, geometric_normal: normal })
        };
        Self {
            points: view.receiver_position.iter().zip(view.receiver_normal).map(point).collect(),
            texels: view.receiver_texel.to_vec(),
            gutters: view.gutters.to_vec(),
            size: view.metadata.lightmap_size,
            probes: view.probes.len(),
        }
    }

    /// What the system says at the receivers, in their texels and in the gutters that take their light.
    fn map(&self, system: &dyn System, world: &World<'_>) -> OtherLight {
        let light = system.irradiance(world, &Query::of(&self.points));
        let mut rgba = vec![[f16::ZERO; 4]; (self.size * self.size) as usize];
        let own = self.texels.iter().copied().zip(0u32..);
        for (texel, receiver) in own.chain(self.gutters.iter().map(|&[texel, receiver]| (texel, receiver))) {
            let Some(light) = light.get(receiver as usize) else { continue };
            if let Some(place) = rgba.get_mut(texel as usize) {
                *place = light.min(Vec3::splat(f16::MAX.to_f32())).extend(1.0).to_array().map(f16::from_f32);
            }
        }
        OtherLight::Map { size: self.size, rgba }
    }
}

/// What a system was told of last.
#[derive(Clone, Debug, Default)]
struct Told {
    lighting: Lighting,
    objects: Vec<Object>,
}

impl Told {
    /// What an application would tell its system of a change to this.
    fn events(&self, lighting: &Lighting, objects: &[Object]) -> Vec<Event> {
        let before = &self.lighting;
        let is_large = before.sky != lighting.sky
            || before.materials != lighting.materials
            || before.albedo_override != lighting.albedo_override;
        // What goes its way step by step is where its box was.
        let is_elsewhere = self.objects.len() != objects.len()
            || self.objects.iter().zip(objects).any(|(before, now)| !before.meets(now));
        let large = is_large.then_some(Event::LargeLight);
        let small = (before.lights != lighting.lights).then_some(Event::SmallLight);
        let object = is_elsewhere.then_some(Event::LargeObject);
        large.into_iter().chain(small).chain(object).collect()
    }
}

/// A system on the file's scene, with as many probes as the file has.
pub struct Engine<'a> {
    caster: &'a RayCaster<'a>,
    receivers: Receivers,
    chosen: Chosen<'a>,
    /// Made for the first view.
    system: Option<Box<dyn System + 'a>>,
    /// Made for the first object.
    moving: Option<MovingScene>,
    last: Option<Told>,
    updates: u64,
}

impl<'a> Engine<'a> {
    /// The system of a name, on the scene of a file; `None` if there is no such name.
    pub fn new(name: &str, caster: &'a RayCaster<'a>, baked: &Checked<'a>) -> Option<Self> {
        Some(Self::on(Chosen::of_name(name, baked)?, caster, Receivers::of(baked)))
    }

    fn on(chosen: Chosen<'a>, caster: &'a RayCaster<'a>, receivers: Receivers) -> Self {
        Self { caster, receivers, chosen, system: None, moving: None, last: None, updates: 0 }
    }

    /// One update, and the light after it.
    pub fn update(&mut self, moment: &Moment) -> Found {
        let began = Instant::now();
        let Self { caster, receivers, chosen, system, moving, last, updates } = self;
        let still = caster.scene();
        let with_objects = (!moment.objects.is_empty())
            .then(|| moving.get_or_insert_with(|| MovingScene::of(still)).with(&moment.objects));
        // Without a tree of so many triangles things are drawn and not met.
        let tree = with_objects.and_then(|scene| RayCaster::new(scene).ok());
        let world = World::new(tree.as_ref().unwrap_or(caster), &moment.lighting);
        let cameras = std::slice::from_ref(&moment.camera);
        let setup = Setup { probes: receivers.probes, cameras, seed: SEED };
        let system = system.get_or_insert_with(|| chosen.prepare(caster, &moment.lighting, &setup));
        let objects = moved(world.caster().scene(), still.meshes.len());
        system.set_moving(&objects);
        let events = last.as_ref().map_or(Vec::new(), |last| last.events(&moment.lighting, &objects));
        // Lightings may have large skies: they are copied as they change.
        let lighting = match last.take() {
            Some(last) if events.iter().all(|&event| event == Event::LargeObject) => last.lighting,
            _ => moment.lighting.clone(),
        };
        *last = Some(Told { lighting, objects });
        let feedback = if moment.is_first_bounce { Feedback::Nothing } else { Feedback::Own };
        let camera = Some(&moment.camera);
        let frame = Frame { world: &world, number: *updates, camera, feedback, events: &events, still: false };
        let work = system.update(&frame);
        *updates += 1;
        let light = match system.shader_light().filter(fits) {
            Some(light) => shaded_by(&light),
            None => receivers.map(&**system, &world),
        };
        let figures = OtherFigures {
            title: chosen.title(),
            probes: system.probes(),
            bytes: system.bytes(),
            rays: work.rays + work.shadow_rays,
            updates: *updates,
            seconds: began.elapsed().as_secs_f64(),
        };
        Found { light, figures }
    }
}

/// Whether probes fit into a buffer of every device.
fn fits(light: &ShaderLight) -> bool {
    light.len() * size_of::<[f32; 4]>() <= LARGEST_BUFFER
}

fn shaded_by(light: &ShaderLight) -> OtherLight {
    match light {
        ShaderLight::Octahedral(probes) => octahedral(probes),
        ShaderLight::Harmonics(probes) => harmonics(probes),
    }
}

fn octahedral(probes: &ShaderProbes) -> OtherLight {
    let record = OtherRecord {
        low: probes.grid.low.to_array(),
        kind: match probes.weighting {
            Weighting::Wrapped => OtherRecord::WRAPPED,
            Weighting::Facing => OtherRecord::FACING,
        },
        spacing: probes.grid.spacing.to_array(),
        irradiance_side: probes.sizes.irradiance.side as u32,
        size: probes.grid.size.to_array(),
        distance_side: probes.sizes.distance.side as u32,
        normal_bias_m: probes.normal_bias_m,
        eye_bias_m: probes.eye_bias_m,
        is_cage_biased: u32::from(probes.is_cage_biased),
        stored_power: probes.stored_power,
        mean_power: probes.mean_power,
        ..OtherRecord::default()
    };
    let position = |(position, &is_lit): (&Vec3, &bool)| position.extend(f32::from(u8::from(is_lit))).to_array();
    let positions = probes.positions.iter().zip(&probes.is_lit).map(position);
    let irradiance = probes.irradiance.iter().map(|light| light.extend(0.0).to_array());
    let moments = probes.moments.iter().map(|moments| [moments.x, moments.y, 0.0, 0.0]);
    OtherLight::Probes { record, texels: positions.chain(irradiance).chain(moments).collect() }
}

fn harmonics(probes: &ShaderHarmonics) -> OtherLight {
    let record = OtherRecord {
        kind: OtherRecord::HARMONICS,
        size: probes.grids.first().map_or([0; 3], |grid| grid.size.to_array()),
        n_grids: probes.grids.len() as u32,
        ..OtherRecord::default()
    };
    let grids = probes.grids.iter().flat_map(|grid| [grid.low, grid.spacing]);
    let numbers = grids.chain(probes.coefficients.iter().flatten().copied());
    OtherLight::Probes { record, texels: numbers.map(|number| number.extend(0.0).to_array()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_scenes::{Light, LightKind, Sky};
    use localprt_systems::ProbeGrid;

    #[test]
    fn a_system_is_told_of_what_changed_as_an_application_would() {
        let told = |lighting: Lighting, objects: &[Object]| Told { lighting, objects: objects.to_vec() };
        let events = |before: &Told, now: &Told| before.events(&now.lighting, &now.objects);
        let lamp = Light {
            name: String::new(),
            kind: LightKind::Point,
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            color: Vec3::ONE,
            intensity: 1.0,
            range: None,
        };
        let dark = told(Lighting::default(), &[]);
        let lit = told(Lighting { lights: vec![lamp], ..Lighting::default() }, &[]);
        let day = told(Lighting { sky: Sky::Constant(Vec3::ONE), ..lit.lighting.clone() }, &[]);
        assert_eq!(events(&dark, &dark), []);
        assert_eq!(events(&dark, &lit), [Event::SmallLight]);
        assert_eq!(events(&lit, &day), [Event::LargeLight]);
        assert_eq!(events(&dark, &day), [Event::LargeLight, Event::SmallLight]);
        let at =
            |low: f32| told(day.lighting.clone(), &[Object { low: Vec3::splat(low), high: Vec3::splat(low + 1.0) }]);
        assert_eq!(events(&day, &at(0.0)), [Event::LargeObject]);
        assert_eq!(events(&at(0.0), &at(0.9)), [], "it goes its way");
        assert_eq!(events(&at(0.0), &at(1.1)), [Event::LargeObject], "it is elsewhere at once");
        assert_eq!(events(&at(0.0), &day), [Event::LargeObject]);
    }

    #[test]
    fn probes_that_are_too_many_for_a_buffer_are_left_to_the_receivers() {
        let grid = ProbeGrid::over((Vec3::ZERO, Vec3::ONE), 8);
        let probes = |count: usize| {
            ShaderLight::Harmonics(ShaderHarmonics { grids: vec![grid], coefficients: vec![[Vec3::ZERO; 9]; count] })
        };
        // 9 numbers of 16 B are 144 B: 932,066 times that, the grid and the record are below 2^27 B.
        assert!(fits(&probes(932_066)) && !fits(&probes(932_067)));
    }
}
