//! Heat maps without lighting, on the scene and on the atlas; and the sections of the sweeps.

use super::{Context, Folder, percent, pictures::NOTHING, signed_percent};
use crate::{
    figures::{
        Block, Chart, HeatMap, NamedImage, Ramp, Rgb8Image, Section, Series, draw_labels, nice_range, nice_signed_range,
    },
    output::OutputError,
    picture::Exposure,
    validate::{
        NormFigures,
        path_tracer::PixelLight,
        report::Metrics,
        selection::spread,
        state::{View, irradiance_map, sampled},
        sweep::{SweepFindings, SweepPoint},
    },
};
use glam::Vec3;

/// A quantity of every receiver.
struct Quantity {
    name: &'static str,
    title: &'static str,
    unit: &'static str,
    caption: &'static str,
    ramp: Ramp,
    /// `[n_receivers]`
    values: Vec<f32>,
    range: [f32; 2],
}

pub(super) fn section(context: &Context<'_>, metrics: &Metrics, folder: &Folder) -> Result<Section, OutputError> {
    let mut gallery = Vec::new();
    for quantity in quantities(context) {
        let Quantity { name, title, unit, ramp, range, .. } = quantity;
        let map = |width, height, values: &[f32]| {
            HeatMap { width, height, values, background: NOTHING, title, unit, ramp, range }.draw()
        };
        for (number, view) in views(context).iter().enumerate() {
            let values = on_view(context, view, &quantity.values);
            let picture = map(view.light.width, view.light.height, &values);
            gallery.push(NamedImage {
                name: title.into(),
                file: folder.picture(&format!("{name}-view{number}"), &picture)?,
                caption: quantity.caption.into(),
            });
        }
        let [width, height] = used(context);
        let picture = map(width, height, &on_atlas(context, &quantity.values));
        gallery.push(NamedImage {
            name: format!("{title}, atlas"),
            file: folder.picture(&format!("{name}-atlas"), &picture)?,
            caption: String::new(),
        });
    }
    gallery.extend(clusters(context, folder)?);

    let norm = &metrics.operator_norm;
    let coverage = &metrics.coverage;
    let correlation = |value: Option<f64>| value.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let ranks = |figures: &NormFigures| {
        vec![
            fact("rank correlation with the relative error of the last leg", correlation(figures.rank_correlation)),
            fact(
                "with the relative error, earlier bounces and noise included",
                correlation(figures.rank_correlation_relative),
            ),
            fact("with the absolute error", correlation(figures.rank_correlation_absolute)),
            fact("mean error of the last leg, tenth of highest value", percent(figures.error_where_high)),
            fact("the same, elsewhere", percent(figures.error_elsewhere)),
        ]
    };
    let mut blocks = vec![
        Block::Text(
            "The operator norm (Eq. 12) sends light of unit strength from a receiver to the probes and back, and tells the \
             irradiance error of the worst such light. It knows no lamp. The mean over random lights is a tenth of it. Of \
             fitted rows the fit itself predicts the error, for light that varies smoothly over the surfaces."
                .into(),
        ),
        Block::Facts {
            title: "Operator norm".into(),
            rows: [
                fact("mean, worst light", format!("{:.4}", norm.mean)),
                fact("95 % of the receivers are below", format!("{:.4}", norm.p95)),
                fact("largest", format!("{:.4}", norm.max)),
                fact("mean, random light (RMS)", format!("{:.4}", norm.mean_rms)),
            ]
            .into_iter()
            .chain(ranks(norm))
            .collect(),
        },
    ];
    if let Some(predicted) = &metrics.predicted_error {
        let rows = [
            fact("mean", format!("{:.4}", predicted.mean)),
            fact("95 % of the receivers are below", format!("{:.4}", predicted.p95)),
            fact("largest", format!("{:.4}", predicted.max)),
        ];
        blocks.push(Block::Facts {
            title: "Predicted error".into(),
            rows: rows.into_iter().chain(ranks(predicted)).collect(),
        });
    }
    blocks.extend([
        Block::Facts {
            title: "Coverage".into(),
            rows: vec![
                fact("unseen light, mean", percent(coverage.unseen.mean)),
                fact("unseen light, 95 % of the receivers are below", percent(coverage.unseen.p95)),
                fact("unseen light, most", percent(coverage.unseen.max)),
                fact("probes per receiver", counted(&coverage.probes_per_receiver)),
                fact("clusters", coverage.clusters.to_string()),
                fact("receivers per cluster", counted(&coverage.receivers_per_cluster)),
                fact("coefficients per cluster", counted(&coverage.coefficients_per_cluster)),
            ],
        },
        Block::Gallery { title: "Heat maps".into(), images: gallery, columns: 2 },
    ]);
    Ok(Section { id: "maps".into(), title: "Without lighting".into(), blocks })
}

fn counted(count: &crate::validate::coverage::Count) -> String {
    format!("{:.1} ({} to {})", count.mean, count.min, count.max)
}

fn views<'a>(context: &'a Context<'_>) -> &'a [View] {
    context.findings.states.first().map_or(&[], |state| &state.views)
}

fn quantities(context: &Context<'_>) -> Vec<Quantity> {
    let (subject, findings) = (context.subject, context.findings);
    let everywhere = |values: &[f32]| -> Vec<f32> {
        let values: Vec<Vec3> = values.iter().map(|&value| Vec3::splat(value)).collect();
        spread(subject, &findings.sample, &values).into_iter().map(|value| value.x).collect()
    };
    let mut all = Vec::new();
    if let Some(state) = findings.states.first() {
        let errors: Vec<f32> = state.luminance_errors().map(|error| (error / state.mean_luminance) as f32).collect();
        let range = nice_signed_range(&errors, 99.0);
        all.push(Quantity {
            name: "error",
            title: "Error at the measured receivers",
            unit: "share of the mean",
            caption: "Under the first lighting, interpolated between measured receivers: blue is too dark, red too bright.",
            ramp: Ramp::Diverging,
            values: everywhere(&errors),
            range,
        });
    }
    let mut sequential = |name, title, unit, caption, values: Vec<f32>, range: [f32; 2]| {
        all.push(Quantity { name, title, unit, caption, ramp: Ramp::Sequential, values, range });
    };
    let norm = everywhere(&findings.operator_norm);
    let range = nice_range(&findings.operator_norm, 99.0);
    let caption = "Without lighting; interpolated between measured receivers.";
    sequential("operator-norm", "Operator norm", "worst irradiance error of unit light", caption, norm, range);
    if findings.predicted.iter().any(|&predicted| predicted > 0.0) {
        let predicted = everywhere(&findings.predicted);
        let range = nice_range(&findings.predicted, 99.0);
        let unit = "deviation of irradiance, surfaces of deviation 1";
        sequential("predicted", "Predicted error", unit, caption, predicted, range);
    }
    let unseen = subject.view.receiver_unseen;
    let range = nice_range(unseen, 99.0);
    let caption = "Cosine-weighted directions whose surface no supporting probe sees: their light is lost.";
    sequential("unseen", "Unseen light", "share of the hemisphere", caption, unseen.to_vec(), range);
    let probes: Vec<f32> =
        (0..subject.len() as u32).map(|receiver| subject.supporting(receiver).len() as f32).collect();
    let range = nice_range(&probes, 100.0);
    sequential("probes", "Probes per receiver", "supporting probes", "", probes, range);
    let clusters = &subject.checked.transport().clusters;
    let coefficients: Vec<f32> =
        subject.cluster.iter().map(|&cluster| clusters[cluster as usize].lights.len() as f32).collect();
    let range = nice_range(&coefficients, 100.0);
    let caption = "Singular values kept: high where neighbors see different things.";
    sequential("coefficients", "Coefficients per cluster", "singular values", caption, coefficients, range);
    all
}

/// A quantity as a camera sees it.
fn on_view(context: &Context<'_>, view: &View, values: &[f32]) -> Vec<f32> {
    let values: Vec<Vec3> = values.iter().map(|&value| Vec3::splat(value)).collect();
    let map = irradiance_map(context.subject, &values);
    view.light.values(|light| Some(map.sample(light.uv?)?.x))
}

/// A quantity in lightmap coordinates, row 0 at v = 0, over the part of the map that is used.
fn on_atlas(context: &Context<'_>, values: &[f32]) -> Vec<f32> {
    let at = |receiver: u32| values.get(receiver as usize).copied().unwrap_or(f32::NAN);
    atlas_receivers(context).map(at).collect()
}

/// Receivers of the used part of the map, row by row; `u32::MAX` where there is none.
fn atlas_receivers<'a>(context: &'a Context<'_>) -> impl Iterator<Item = u32> + 'a {
    let size = context.subject.view.metadata.lightmap_size;
    let [width, height] = used(context);
    let texels = (0..height).flat_map(move |y| (0..width).map(move |x| y * size + x));
    texels.map(|texel| context.subject.at_texel[texel as usize])
}

/// Width and height of the part of the receiver map, from its corner, that holds receivers.
fn used(context: &Context<'_>) -> [u32; 2] {
    let size = context.subject.view.metadata.lightmap_size;
    let texels = context.subject.view.receiver_texel.iter();
    texels.fold([1, 1], |[width, height], texel| [width.max(texel % size + 1), height.max(texel / size + 1)])
}

/// Clusters in colors that tell neighbors apart.
fn clusters(context: &Context<'_>, folder: &Folder) -> Result<Vec<NamedImage>, OutputError> {
    let subject = context.subject;
    let color = |receiver: u32| {
        let hash = localprt_formats::directions::counter_hash(9, subject.cluster[receiver as usize].into(), 0);
        [0, 8, 16].map(|shift| 56 + ((hash >> shift & 0xff) * 3 / 4) as u8)
    };
    let note = format!("{} clusters in colors without meaning", subject.checked.transport().clusters.len());
    let mut images = Vec::new();
    for (number, view) in views(context).iter().enumerate() {
        let first = |rays: &[PixelLight]| rays[0].uv.and_then(|uv| subject.receiver_at(uv)).map_or(NOTHING, color);
        let colors: Vec<[u8; 3]> = view.light.rays.chunks_exact(view.light.per_pixel).map(first).collect();
        let picture = draw_labels(view.light.width, view.light.height, &colors, "Clusters", &note);
        let file = folder.picture(&format!("clusters-view{number}"), &picture)?;
        images.push(NamedImage { name: "Clusters".into(), file, caption: String::new() });
    }
    let [width, height] = used(context);
    let colors: Vec<[u8; 3]> =
        atlas_receivers(context).map(|receiver| if receiver == u32::MAX { NOTHING } else { color(receiver) }).collect();
    let file = folder.picture("clusters-atlas", &draw_labels(width, height, &colors, "Clusters, atlas", &note))?;
    images.push(NamedImage { name: "Clusters, atlas".into(), file, caption: String::new() });
    Ok(images)
}

pub(super) fn sweep_section(context: &Context<'_>, index: usize, folder: &Folder) -> Result<Section, OutputError> {
    let sweep = &context.findings.sweeps[index];
    let option = sweep.option.replace('_', " ");
    let row = |point: &SweepPoint| {
        vec![
            point.value.clone(),
            percent(point.error.nrmse),
            percent(point.error.median_relative),
            percent(point.error.p95_relative),
            signed_percent(point.error.bias),
            format!("{:.4}", point.operator_norm),
            percent(point.unseen),
            format!("{:.1} MB", point.bytes as f64 / 1e6),
            format!("{:.1} s", point.seconds),
        ]
    };
    let mut blocks = vec![Block::Table {
        title: String::new(),
        head: [option.as_str(), "nrmse", "median", "95 %", "bias", "operator norm", "unseen", "matrices", "bake"]
            .map(String::from)
            .to_vec(),
        rows: sweep.points.iter().map(row).collect(),
        note: "Each row is a bake of its own, measured at the same receivers under the first lighting.".into(),
        highlight_row: None,
    }];
    for (name, chart) in charts(sweep, &option) {
        let name = format!("sweep{index}-{name}");
        let svg = chart.to_svg(640, 400);
        folder.text(&format!("{name}.svg"), &svg)?;
        let png = folder.picture(&name, &chart.to_image(640, 400))?;
        blocks.push(Block::Svg { title: String::new(), svg, png: Some(png) });
    }
    if let Some(view) = views(context).first() {
        blocks.push(Block::Gallery {
            title: "Indirect light, 16 times its difference, operator norm".into(),
            images: sweep_pictures(context, sweep, view, index, folder)?,
            columns: 3,
        });
    }
    Ok(Section { id: format!("sweep{index}"), title: format!("Sweep of {option}"), blocks })
}

fn charts(sweep: &SweepFindings, option: &str) -> Vec<(&'static str, Chart)> {
    // Values that are no numbers are drawn by their place.
    let numbers: Option<Vec<f64>> = sweep.points.iter().map(|point| point.value.parse().ok()).collect();
    let x = numbers.unwrap_or_else(|| (1..=sweep.points.len()).map(|place| place as f64).collect());
    let least = x.iter().copied().fold(f64::INFINITY, f64::min);
    let wide = least > 0.0 && x.iter().copied().fold(0.0, f64::max) > 8.0 * least;
    let series = |name: &str, value: &dyn Fn(&SweepPoint) -> f64| Series {
        name: name.into(),
        points: x.iter().zip(&sweep.points).map(|(&x, point)| [x, value(point)]).collect(),
    };
    let chart = |y_label: &str, series: Vec<Series>| Chart {
        title: format!("{y_label} over {option}"),
        x_label: option.into(),
        y_label: y_label.into(),
        x_log: wide,
        y_log: true,
        series,
    };
    vec![
        (
            "error",
            chart(
                "error",
                vec![
                    series("nrmse", &|point| point.error.nrmse),
                    series("median relative", &|point| point.error.median_relative),
                    series("p95 relative", &|point| point.error.p95_relative),
                    series("operator norm, RMS", &|point| point.operator_norm / 10.0),
                ],
            ),
        ),
        ("bytes", chart("megabytes", vec![series("projection and reconstruction", &|point| point.bytes as f64 / 1e6)])),
        ("seconds", chart("seconds", vec![series("bake", &|point| point.seconds)])),
    ]
}

fn sweep_pictures(
    context: &Context<'_>,
    sweep: &SweepFindings,
    view: &View,
    index: usize,
    folder: &Folder,
) -> Result<Vec<NamedImage>, OutputError> {
    let reference = view.light.picture(|light| light.gray(light.reference()));
    let ev = Exposure::Auto.ev(&reference.pixels);
    let all: Vec<f32> = sweep.points.iter().flat_map(|point| point.norms.1.iter().copied()).collect();
    let range = nice_range(&all, 99.0);
    let mut images = Vec::new();
    for (number, point) in sweep.points.iter().enumerate() {
        let mut add = |name: &str, image: &Rgb8Image, caption: String| -> Result<(), OutputError> {
            let file = folder.picture(&format!("sweep{index}-{number}-{name}"), image)?;
            images.push(NamedImage { name: format!("{} = {}", sweep.option, point.value), file, caption });
            Ok(())
        };
        let mut light = view.light.picture(|light| light.gray(sampled(&point.maps, light)));
        let developed = Rgb8Image { width: light.width, height: light.height, pixels: light.develop(Exposure::Ev(ev)) };
        add("light", &developed, format!("nrmse {}", percent(point.error.nrmse)))?;
        for (pixel, reference) in light.pixels.iter_mut().zip(&reference.pixels) {
            *pixel = (*pixel - *reference).abs() * 16.0;
        }
        let difference =
            Rgb8Image { width: light.width, height: light.height, pixels: light.develop(Exposure::Ev(ev)) };
        add("difference", &difference, "difference × 16, with the reference's noise".into())?;
        let map = point.norm_map(context.subject);
        let values = view.light.values(|light| Some(map.sample(light.uv?)?.x));
        let heat = HeatMap {
            width: view.light.width,
            height: view.light.height,
            values: &values,
            background: NOTHING,
            title: "Operator norm",
            unit: "worst irradiance error of unit light",
            ramp: Ramp::Sequential,
            range,
        };
        add("norm", &heat.draw(), format!("mean {:.3}", point.operator_norm))?;
    }
    Ok(images)
}
