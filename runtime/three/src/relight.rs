//! One baked scene on a device, relit frame by frame.

use crate::device::Device;
use crate::lights::{self, LIGHT, MATERIAL, SKY};
use localprt_formats::Baked;
use localprt_runtime::{DirectLight, DirectOptions, Relighter, RelighterOptions, sky_sh};
use localprt_scenes::Scene;
use wasm_bindgen::prelude::*;

/// A relighter with the scene that its file was baked from.
#[wasm_bindgen]
pub struct Relight {
    device: wgpu::Device,
    queue: wgpu::Queue,
    relighter: Relighter,
    sky_degree: u32,
    materials: Vec<String>,
}

#[wasm_bindgen]
impl Relight {
    /// Takes a baked file and the .glb that the bake wrote beside it. Shadow maps are `shadow_map_size` texels wide; `bounces` gathers
    /// are made in a frame.
    ///
    /// # Errors
    /// A file or scene that is broken, a scene that is another one, a device that is too small.
    #[wasm_bindgen(constructor)]
    pub fn new(
        device: &Device,
        file: Vec<u8>,
        scene_name: &str,
        scene: &[u8],
        bounces: u32,
        shadow_map_size: u32,
    ) -> Result<Self, JsError> {
        let baked = Baked::from_bytes(file)?;
        let scene: Scene = localprt_scenes::load_bytes(scene_name, scene)?;
        if scene.hash != baked.metadata().scene_hash {
            return Err(JsError::new(&format!(
                "{scene_name} is not the scene that the file was baked from: load the .glb that the bake wrote beside it, unchanged"
            )));
        }
        let checked = baked.checked()?;
        let options = RelighterOptions {
            bounces: bounces.max(1),
            direct: DirectOptions { shadow_map_size, ..DirectOptions::default() },
            ..RelighterOptions::default()
        };
        let mut relighter = Relighter::new(&device.device, &device.queue, &checked, options)?;
        relighter.set_scene(&scene, &checked)?;
        Ok(Self {
            device: device.device.clone(),
            queue: device.queue.clone(),
            relighter,
            sky_degree: baked.metadata().sky_degree,
            materials: scene.materials.iter().map(|material| material.name.clone()).collect(),
        })
    }

    /// Names of the scene's materials, in the order of [`Relight::set_materials`].
    #[wasm_bindgen(getter)]
    pub fn materials(&self) -> Vec<String> {
        self.materials.clone()
    }

    /// Lights of fourteen numbers each: kind (0 point, 1 spot, 2 directional), position, direction in which light travels, color,
    /// intensity, range (0: none), inner and outer cone.
    ///
    /// # Errors
    /// Another number of numbers, one that is not finite, a kind that there is not.
    #[wasm_bindgen(js_name = setLights)]
    pub fn set_lights(&mut self, rows: &[f32]) -> Result<(), JsError> {
        check("lights", rows, LIGHT)?;
        let lights = lights::lights(rows).ok_or_else(|| JsError::new("lights: a kind is not 0, 1 or 2"))?;
        self.relighter.set_lights(&lights);
        Ok(())
    }

    /// Emission of each material, four numbers each: 1 and radiance, or 0 for that of the scene.
    ///
    /// # Errors
    /// Another number of numbers, one that is not finite.
    #[wasm_bindgen(js_name = setMaterials)]
    pub fn set_materials(&mut self, rows: &[f32]) -> Result<(), JsError> {
        check("materials", rows, MATERIAL)?;
        Ok(self.relighter.set_materials(&lights::materials(rows), None)?)
    }

    /// Radiance of the sky at the zenith, the horizon and the nadir.
    ///
    /// # Errors
    /// Other than nine numbers, one that is not finite.
    #[wasm_bindgen(js_name = setSky)]
    pub fn set_sky(&mut self, radiance: &[f32]) -> Result<(), JsError> {
        check("sky", radiance, SKY)?;
        if radiance.len() != SKY {
            return Err(JsError::new(&lights::wrong_length("sky", radiance.len(), SKY)));
        }
        Ok(self.relighter.set_sky(&sky_sh(&lights::sky(radiance), self.sky_degree), &[])?)
    }

    /// Gathers in each frame.
    #[wasm_bindgen(js_name = setBounces)]
    pub fn set_bounces(&mut self, bounces: u32) {
        self.relighter.set_bounces(bounces);
    }

    /// Forgets all light.
    pub fn reset(&mut self) {
        self.relighter.reset();
    }

    /// Relights: records and submits one frame. What samples the texture is to be submitted after it.
    ///
    /// # Errors
    /// None while the relighter has its scene.
    pub fn frame(&mut self) -> Result<(), JsError> {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        self.relighter.encode(&mut encoder, &DirectLight::Lights)?;
        self.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Gathers since the start or the last reset.
    #[wasm_bindgen(getter)]
    pub fn gathers(&self) -> f64 {
        self.relighter.gathers() as f64
    }

    /// The GPUTexture of the irradiance map, `rgba16float`, W m^-2.
    #[wasm_bindgen(getter)]
    pub fn texture(&self) -> JsValue {
        lights::irradiance_texture(&self.relighter).unwrap_or_default()
    }

    /// Device memory by purpose: names of [`Relight::memory`].
    #[wasm_bindgen(getter, js_name = memoryNames)]
    pub fn memory_names(&self) -> Vec<String> {
        self.relighter.memory().into_iter().map(|(name, _)| name.to_owned()).collect()
    }

    /// Device memory by purpose, bytes.
    #[wasm_bindgen(getter)]
    pub fn memory(&self) -> Vec<f64> {
        self.relighter.memory().into_iter().map(|(_, bytes)| bytes as f64).collect()
    }
}

/// # Errors
/// Numbers that are no whole rows, or are not finite.
fn check(what: &str, numbers: &[f32], row: usize) -> Result<(), JsError> {
    if !numbers.len().is_multiple_of(row) {
        return Err(JsError::new(&lights::wrong_length(what, numbers.len(), row)));
    }
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(at) => Err(JsError::new(&format!("{what}: number {} of row {} is not finite", at % row, at / row))),
        None => Ok(()),
    }
}
