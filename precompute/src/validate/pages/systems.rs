//! The section of systems: a table, and the light of each beside the reference.

use super::{Context, Folder, percent, signed_percent};
use crate::{
    figures::{Block, NamedImage, Ramp, Rgb8Image, Section},
    output::OutputError,
    picture::{Exposure, Picture},
    validate::{
        methods::COMPRESSED,
        path_tracer::{GRAY, PixelLight},
        state::{View, sampled},
        systems::SystemFindings,
    },
};
use glam::Vec3;
use localprt_scenes::luminance;
use std::f32::consts::PI;

/// Pictures in a row.
const COLUMNS: u32 = 4;
/// Share of the mean light at which the color of an error is full.
const FULL: f64 = 0.5;

/// `None` if no systems were asked for.
pub(super) fn section(context: &Context<'_>, folder: &Folder) -> Result<Option<Section>, OutputError> {
    let found = &context.findings.systems.0;
    let Some(state) = context.findings.states.first().filter(|_| !found.is_empty()) else { return Ok(None) };
    let mut blocks = vec![table(found, state.mean)];
    for (number, view) in state.views.iter().enumerate() {
        let reference: Vec<Vec3> = view.smooth.rays.iter().map(PixelLight::reference).collect();
        let ev = Exposure::Auto.ev(&gray(view, &reference).pixels);
        let mut lights =
            vec![picture(folder, &format!("systems-{number}-reference"), "reference", &gray(view, &reference), ev)?];
        let mut errors = Vec::new();
        for system in found {
            let light = light(context, system, view, number);
            let name = format!("systems-{number}-{}", system.name);
            lights.push(picture(folder, &name, system.name, &gray(view, &light), ev)?);
            errors.push(error_map(folder, &name, system.name, view, [&light, &reference], state.mean_luminance)?);
        }
        let title = |what: &str| format!("Camera {}: {what}", view.camera);
        blocks.push(Block::Gallery {
            title: title("indirect light, all surfaces of albedo 0.5"),
            images: lights,
            columns: COLUMNS,
        });
        blocks.push(Block::Gallery {
            title: title("error, red too bright and blue too dark, full color at half of the mean light"),
            images: errors,
            columns: COLUMNS,
        });
    }
    Ok(Some(Section { id: "systems".into(), title: "Systems".into(), blocks }))
}

fn table(found: &[SystemFindings], mean: f64) -> Block {
    let row = |SystemFindings { title, figures, .. }: &SystemFindings| {
        vec![
            (*title).to_owned(),
            percent(figures.view_nrmse),
            percent(figures.area_nrmse),
            percent(figures.nrmse),
            percent(figures.median_relative),
            percent(figures.p95_relative),
            signed_percent(figures.bias),
            format!("{:.4}", figures.flip),
            percent(figures.leak),
            format!("{:.2}", figures.bytes as f64 / 1e6),
            figures.probes.to_string(),
            format!("{:.0}", figures.rays_per_update),
            format!("{:.0}", figures.texels_per_update),
            figures.frames_to_90_percent.to_string(),
            figures.following.map_or("–".into(), |found| percent(found.nrmse)),
            figures.following.map_or("–".into(), |found| format!("{:.1}", found.lag_frames)),
            figures.following.map_or("–".into(), |found| percent(found.flicker)),
        ]
    };
    let head = [
        "system",
        "nrmse, as seen",
        "by area",
        "of receivers",
        "median",
        "95 %",
        "bias",
        "FLIP",
        "leak",
        "MB",
        "probes",
        "rays an update",
        "texels an update",
        "frames to 90 %",
        "nrmse, lamp moving",
        "frames behind",
        "flicker",
    ];
    Block::Table {
        title: "The same scene and light by other systems".into(),
        head: head.map(String::from).to_vec(),
        rows: found.iter().map(row).collect(),
        note: format!(
            "Each at rest, against path tracing; the mean is {mean:.4} W/m². Rays are traced rays, those to lights among them: ours are \
             traced by the bake. Frames: after the lights were switched on, until the mean light is nine tenths of what it comes to."
        ),
        highlight_row: found.iter().position(|system| system.method == Some(COMPRESSED.name)),
    }
}

/// Irradiance at every primary ray of a view's smooth picture.
fn light(context: &Context<'_>, system: &SystemFindings, view: &View, number: usize) -> Vec<Vec3> {
    match system.pictures.get(number) {
        Some(picture) => picture.clone(),
        None => {
            let methods = context.findings.states[0].methods.iter();
            let maps =
                methods.filter(|(method, _)| Some(method.name) == system.method).map(|(_, found)| &found.maps).next();
            view.smooth.rays.iter().map(|ray| maps.map_or(Vec3::ZERO, |maps| sampled(maps, ray))).collect()
        }
    }
}

fn gray(view: &View, light: &[Vec3]) -> Picture {
    view.smooth.lit_by(light).picture(|ray| ray.gray(ray.reference()))
}

fn picture(folder: &Folder, file: &str, name: &str, picture: &Picture, ev: f32) -> Result<NamedImage, OutputError> {
    let pixels = picture.develop(Exposure::Ev(ev));
    let image = Rgb8Image { width: picture.width, height: picture.height, pixels };
    Ok(NamedImage { name: name.into(), file: folder.picture(file, &image)?, caption: String::new() })
}

fn error_map(
    folder: &Folder,
    file: &str,
    name: &str,
    view: &View,
    [light, reference]: [&[Vec3]; 2],
    mean: f64,
) -> Result<NamedImage, OutputError> {
    let of = |pixels: &[Vec3]| gray(view, pixels).pixels;
    let scale = f64::from(GRAY / PI) * mean * FULL;
    let pixels = of(light)
        .iter()
        .zip(of(reference))
        .flat_map(|(&light, reference)| {
            let error = (luminance(light) - luminance(reference)) / scale;
            Ramp::Diverging.color((0.5 + 0.5 * error.clamp(-1.0, 1.0)) as f32)
        })
        .collect();
    let image = Rgb8Image { width: view.smooth.width, height: view.smooth.height, pixels };
    Ok(NamedImage {
        name: name.into(),
        file: folder.picture(&format!("{file}-error"), &image)?,
        caption: String::new(),
    })
}
