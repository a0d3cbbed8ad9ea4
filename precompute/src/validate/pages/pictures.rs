//! The section of one lighting state: table of methods, pictures, reasons.

use super::{Context, Folder, percent, signed_percent};
use crate::{
    figures::{Block, HeatMap, NamedImage, Ramp, Rgb8Image, Section, nice_signed_range},
    metrics::MethodError,
    output::OutputError,
    picture::{Exposure, Picture},
    validate::{
        StateFindings,
        flip::flip,
        methods::{COMPRESSED, Method},
        path_tracer::PixelLight,
        report::{Metrics, StateFigures, ViewFigures},
        state::{View, sampled},
    },
};
use glam::Vec3;
use localprt_runtime::LightMaps;
use localprt_scenes::luminance;

/// What stands for no value in heat maps.
pub(super) const NOTHING: [u8; 3] = [96, 96, 96];

pub(super) fn section(
    context: &Context<'_>,
    metrics: &Metrics,
    index: usize,
    folder: &Folder,
) -> Result<Section, OutputError> {
    let state = &context.findings.states[index];
    let figures = &metrics.states[index];
    let mut blocks = vec![seen(figures), surfaces(figures), methods(figures)];
    for (number, view) in state.views.iter().enumerate() {
        blocks.extend(view_blocks(state, view, &format!("state{index}-view{number}"), folder)?);
    }
    blocks.extend(reasons(figures));
    Ok(Section { id: format!("state{index}"), title: format!("Under {}", state.state.name), blocks })
}

/// What the views show, and all surfaces by area.
fn seen(figures: &StateFigures) -> Block {
    let view = |view: &ViewFigures| {
        let error = [view.nrmse, view.nrmse_99, view.median_relative, view.p95_relative, view.p99_relative];
        let shares = [view.off_10, view.off_50, view.unseen, view.standard_error];
        row(&view.name, error, view.bias, shares, view.pixels, {
            format!("{:.4} ± {:.4}", view.flip, view.flip_noise)
        })
    };
    fn row(name: &str, errors: [f64; 5], bias: f64, shares: [f64; 4], points: usize, flip: String) -> Vec<String> {
        if points == 0 {
            let nothing = ["0"].into_iter().chain(["–"; 11]).map(String::from);
            return [name.to_owned()].into_iter().chain(nothing).collect();
        }
        let [off_10, off_50, unseen, noise] = shares.map(percent);
        [name.to_owned(), points.to_string()]
            .into_iter()
            .chain(errors.map(percent))
            .chain([off_10, off_50, signed_percent(bias), flip, unseen, noise])
            .collect()
    }
    let area = &figures.area;
    let errors = [area.nrmse, area.nrmse_99, area.median_relative, area.p95_relative, area.p99_relative];
    let shares = [area.off_10, area.off_50, area.unseen, area.standard_error];
    let by_area = row("by area", errors, area.bias, shares, area.points, "–".into());
    let head = [
        "seen by",
        "points",
        "nrmse",
        "without worst 1 %",
        "median",
        "95 %",
        "99 %",
        "off by 10 %",
        "off by 50 %",
        "bias",
        "FLIP",
        "unseen",
        "reference ±",
    ];
    Block::Table {
        title: "The light as it is seen".into(),
        head: head.map(String::from).to_vec(),
        rows: figures.views.iter().map(view).chain([by_area]).collect(),
        note: "The lightmap, read as an engine reads it, against path tracing at the same points. The figure beside FLIP is \
               FLIP between two halves of the reference. Off by 10 % and 50 %: share of the points, of the mean of the reference. \
               Where there is no indirect light nothing is compared."
            .into(),
        highlight_row: None,
    }
}

/// What views show beside edges and on smooth surfaces.
fn surfaces(figures: &StateFigures) -> Block {
    let row = |view: &ViewFigures| {
        let measured = |pixels: usize, figure: String| if pixels > 0 { figure } else { "–".into() };
        vec![
            view.name.clone(),
            view.edge_pixels.to_string(),
            measured(view.edge_pixels, percent(view.leak)),
            measured(view.edge_pixels, format!("{:.2}", view.edge_ratio)),
            view.smooth_pixels.to_string(),
            measured(view.smooth_pixels, percent(view.mottling)),
        ]
    };
    let head = ["seen by", "pixels at edges", "leak", "edge ratio", "pixels on smooth surfaces", "mottling"];
    Block::Table {
        title: "Edges and smooth surfaces".into(),
        head: head.map(String::from).to_vec(),
        rows: figures.views.iter().map(row).collect(),
        note: "Leak: light above the reference beside edges, over its mean in the view. Edge ratio: how many times brighter an edge \
               is than the reference anywhere around it on the same surface; 99.9 % of the edge pixels are below. Mottling: RMS \
               of the error less its local mean, over the light there."
            .into(),
        highlight_row: None,
    }
}

fn methods(figures: &StateFigures) -> Block {
    let row = |(method, error): (&Method, &MethodError)| {
        vec![
            method.title.to_owned(),
            percent(error.nrmse),
            percent(error.median_relative),
            percent(error.p95_relative),
            percent(error.p99_relative),
            signed_percent(error.bias),
            format!("{:.4}", error.flip),
        ]
    };
    Block::Table {
        title: "Errors over receivers against path tracing".into(),
        head: ["method", "nrmse", "median", "95 %", "99 %", "bias", "FLIP"].map(String::from).to_vec(),
        rows: figures.methods.iter().map(row).collect(),
        note: format!(
            "The reference itself has a standard error of {} of the mean ({:.0} paths per receiver); FLIP between two \
             halves of its pictures is {:.4}; pictures of other methods than ours are interpolated between some \
             thousand receivers. Mean indirect irradiance {:.4} W/m².",
            percent(figures.reference.standard_error),
            figures.reference.paths,
            figures.flip_noise,
            figures.mean_irradiance
        ),
        highlight_row: Some(0),
    }
}

fn view_blocks(state: &StateFindings, view: &View, name: &str, folder: &Folder) -> Result<Vec<Block>, OutputError> {
    let taken = |maps: &LightMaps| view.light.picture(|light| light.radiance(sampled(maps, light)));
    let reference = view.light.picture(|light| light.radiance(light.reference()));
    let smooth = |indirect: &dyn Fn(&PixelLight) -> Vec3| view.smooth.picture(|light| light.radiance(indirect(light)));
    let ours = &state.methods.of(&COMPRESSED).maps;
    let difference =
        flip(&smooth(&|light| sampled(ours, light)), &smooth(&|light: &PixelLight| light.reference()), view.ev);
    let develop = |picture: &Picture, ev: f32| Rgb8Image {
        width: picture.width,
        height: picture.height,
        pixels: picture.develop(Exposure::Ev(ev)),
    };

    // Everything, as it is shown.
    let mut images = vec![NamedImage {
        name: "reference".into(),
        file: folder.picture(&format!("{name}-reference"), &develop(&reference, view.ev))?,
        caption: "path traced at every pixel".into(),
    }];
    for (method, found) in state.methods.iter() {
        let file = folder.picture(&format!("{name}-{}", method.label), &develop(&taken(&found.maps), view.ev))?;
        images.push(NamedImage { name: method.label.into(), file, caption: method.caption.into() });
    }
    images.swap(0, 1);
    let flips = Rgb8Image {
        width: reference.width,
        height: reference.height,
        pixels: enlarged(view, &difference).iter().flat_map(|&value| Ramp::Sequential.color(value / 0.5)).collect(),
    };
    images.push(NamedImage {
        name: "difference".into(),
        file: folder.picture(&format!("{name}-difference"), &flips)?,
        caption: "FLIP of ours at fewer pixels, yellow is 0.5 and above".into(),
    });

    // Indirect light alone.
    let reference_light = view.light.picture(|light| light.gray(light.reference()));
    let ev = Exposure::Auto.ev(&reference_light.pixels);
    let mut lights = Vec::new();
    for (method, found) in state.methods.iter() {
        let picture = view.light.picture(|light| light.gray(sampled(&found.maps, light)));
        let file = folder.picture(&format!("{name}-light-{}", method.label), &develop(&picture, ev))?;
        lights.push(NamedImage { name: method.label.into(), file, caption: method.caption.into() });
    }
    let file = folder.picture(&format!("{name}-light-reference"), &develop(&reference_light, ev))?;
    lights.insert(1, NamedImage { name: "reference".into(), file, caption: "path traced at every pixel".into() });

    let heat = |kind: &str, title: &str, unit: &str, values: &[f32], range: [f32; 2], caption: &str| {
        let map = HeatMap {
            width: view.light.width,
            height: view.light.height,
            values: &enlarged(view, values),
            background: NOTHING,
            title,
            unit,
            ramp: Ramp::Diverging,
            range,
        };
        let file = folder.picture(&format!("{name}-{kind}"), &map.draw())?;
        Ok::<_, OutputError>(NamedImage { name: kind.into(), file, caption: caption.into() })
    };
    let errors = relative_error(state, view);
    let range = nice_signed_range(&errors, 99.0);
    let at_edge = |(&error, &at_edge): (&f32, &bool)| if at_edge { error } else { f32::NAN };
    let edges: Vec<f32> = errors.iter().zip(&view.shown.at_edge).map(at_edge).collect();
    let deviation = &view.shown.deviation;
    let maps = vec![
        heat(
            "error",
            "Error of the indirect irradiance",
            "share of the mean",
            &errors,
            range,
            "(ours − reference) / mean reference, luminance: blue is too dark, red too bright. Grain is noise of the reference. Fewer pixels than above.",
        )?,
        heat(
            "edges",
            "The same at edges",
            "share of the mean",
            &edges,
            range,
            "Pixels within two texels of a surface that stands on theirs or crosses it: red is leak.",
        )?,
        heat(
            "mottling",
            "Mottling",
            "share of the light around",
            deviation,
            nice_signed_range(deviation, 99.0),
            "Error less its local mean, over the local mean of the reference, on smooth surfaces.",
        )?,
    ];
    Ok(vec![
        Block::Compare {
            title: format!("Camera {}", view.camera),
            caption: "Everything: direct and indirect light, textures. Drag, or flip with F.".into(),
            images,
        },
        Block::Compare {
            title: "Indirect light alone".into(),
            caption: "All surfaces of albedo 0.5, no direct light: textures hide errors.".into(),
            images: lights,
        },
        Block::Gallery { title: String::new(), images: maps, columns: 1 },
    ])
}

/// Values per pixel of a view's smooth picture at the pixels of its large one.
fn enlarged(view: &View, values: &[f32]) -> Vec<f32> {
    let (large, small) = (&view.light, &view.smooth);
    let at = |index: u32| {
        let (x, y) = (index % large.width, index / large.width);
        values[(y * small.height / large.height * small.width + x * small.width / large.width) as usize]
    };
    (0..large.width * large.height).map(at).collect()
}

/// `(E - E_ref) / mean E_ref` of luminance per pixel of the smooth picture.
fn relative_error(state: &StateFindings, view: &View) -> Vec<f32> {
    let ours = &state.methods.of(&COMPRESSED).maps;
    view.smooth.values(|light| {
        // A black surface reflects nothing, and its light is not traced.
        light.uv.and(light.point)?;
        Some(((luminance(sampled(ours, light)) - luminance(light.reference())) / state.mean_luminance) as f32)
    })
}

fn reasons(figures: &StateFigures) -> Vec<Block> {
    let (errors, worst, steps, leak) = (&figures.errors, &figures.worst, &figures.seams, &figures.leak);
    let part = |name: &str, rms: f64, share: String, what: &str| vec![name.into(), percent(rms), share, what.into()];
    let parts = Block::Table {
        title: "What the error is made of".into(),
        head: ["part", "RMS / mean", "largest in the worst 1 %", "what it is"].map(String::from).to_vec(),
        rows: vec![
            part(
                "band limit",
                errors.band_limit,
                percent(worst.band_limit),
                "probes hold few SH functions; with relight rays and light map",
            ),
            part("unseen light", errors.unseen, percent(worst.unseen), "from surfaces that no supporting probe sees"),
            part(
                "gather rays",
                errors.gather_rays,
                percent(worst.gather_rays),
                "the bake traces a finite number of them",
            ),
            part("compression", errors.compression, percent(worst.compression), "SVD and 16-bit storage"),
            part("input", errors.input, percent(worst.input), "earlier bounces, with noise of the reference"),
            part("reference", errors.reference_noise, "–".into(), "its standard error, part of every figure above"),
        ],
        note: format!(
            "The worst 1 % of the receivers ({}) hold {} of the squared error; {} of them stand in corners, of all \
             receivers {} do.",
            worst.receivers,
            percent(worst.of_squared_error),
            percent(worst.in_corners),
            percent(worst.corners_of_all)
        ),
        highlight_row: None,
    };
    let border = |name: &str, step: &crate::validate::steps::Step| {
        vec![
            name.into(),
            step.pairs.to_string(),
            percent(step.compressed),
            percent(step.uncompressed),
            percent(step.paper),
            percent(step.added),
        ]
    };
    let mut blocks = vec![
        parts,
        Block::Table {
            title: "Steps between neighbors".into(),
            head: ["border", "pairs", "compressed", "uncompressed", "paper", "added"].map(String::from).to_vec(),
            rows: vec![
                border("chart seams", &steps.charts),
                border("cluster borders", &steps.clusters),
                border("within clusters", &steps.within),
            ],
            note:
                "RMS of the step in luminance over the mean, by the file, by its rows uncompressed and by the paper's; \
                   what compression adds to a step that is there anyway."
                    .into(),
            highlight_row: None,
        },
    ];
    if leak.receivers > 0 {
        blocks.push(Block::Facts {
            title: "Leak".into(),
            rows: vec![
                ("receivers that no light reaches".into(), leak.receivers.to_string()),
                ("light they get, mean over the mean of all".into(), percent(leak.mean)),
                ("most".into(), percent(leak.max)),
            ],
        });
    }
    blocks
}
