//! The verdict, the bake's own report, and how things were measured.

use super::{Context, percent};
use crate::{
    figures::{Block, Number, Section, Verdict},
    validate::{
        methods::{COMPRESSED, METHODS, SPATIAL},
        report::{Metrics, StateFigures, ViewFigures},
        state::{FLIP_NOISE, FLIP_WIDTH},
    },
};
use serde_json::Value;

/// What every view shows, then all receivers; and the four numbers that matter.
pub(super) fn verdict(context: &Context<'_>, metrics: &Metrics) -> Verdict {
    let counted: Vec<&StateFigures> = context
        .findings
        .states
        .iter()
        .zip(&metrics.states)
        .filter_map(|(state, figures)| state.state.counts.then_some(figures))
        .collect();
    let nrmse = |figures: &StateFigures| figures.methods.of(&COMPRESSED).nrmse;
    let worst = *counted.iter().max_by(|a, b| nrmse(a).total_cmp(&nrmse(b))).unwrap_or(&&metrics.states[0]);
    let views: Vec<(&StateFigures, &ViewFigures)> =
        counted.iter().flat_map(|&state| state.views.iter().map(move |view| (state, view))).collect();
    let shown: Vec<_> = views.iter().filter(|(_, view)| view.pixels > 0).collect();
    let by_view = shown.iter().map(|(state, view)| view_sentence(view, under(context, state)));
    let of_receivers = format!(
        "Over all receivers indirect light is off by {} of its mean{}; most of it is {}. Interpolating the same probes is \
         off by {}.",
        percent(nrmse(worst)),
        under(context, worst),
        largest_part(worst),
        percent(worst.methods.of(&SPATIAL).nrmse)
    );
    // Nothing to compare is no success.
    let dark = counted.iter().any(|state| state.views.iter().all(|view| view.pixels == 0));
    let of_views = shown.iter().map(|(_, view)| view.nrmse).reduce(f64::max).filter(|_| !dark);
    let (leak, mottling) = (|view: &ViewFigures| view.leak, |view: &ViewFigures| view.mottling);
    let of_edges = worst_of_views(&counted, |view| view.edge_pixels, leak);
    let of_walls = worst_of_views(&counted, |view| view.smooth_pixels, mottling);
    let limits: Vec<(bool, String)> = [
        (context.limits.view_nrmse, of_views, "views"),
        (context.limits.nrmse, Some(nrmse(worst)), "receivers"),
        (context.limits.leak, of_edges, "edges"),
        (context.limits.mottling, of_walls, "smooth surfaces"),
    ]
    .into_iter()
    .filter_map(|(allowed, found, what)| {
        let allowed = allowed?;
        let holds = found.is_some_and(|found| found <= allowed);
        let place = match found {
            None => "no measure for",
            Some(_) if holds => "within",
            Some(_) => "above",
        };
        Some((holds, format!("The {what} are {place} the limit of {}.", percent(allowed))))
    })
    .collect();
    let passed = (!limits.is_empty()).then(|| limits.iter().all(|(holds, _)| *holds));
    let sentences = by_view.chain([of_receivers]).chain(limits.into_iter().map(|(_, sentence)| sentence));
    Verdict { passed, sentence: sentences.collect::<Vec<_>>().join(" "), numbers: numbers(&shown, worst, metrics) }
}

/// The largest figure of the views that have pixels for it; `None` where a state has no such view.
fn worst_of_views(
    states: &[&StateFigures],
    pixels: impl Fn(&ViewFigures) -> usize,
    figure: impl Fn(&ViewFigures) -> f64,
) -> Option<f64> {
    let of_state =
        |state: &&StateFigures| state.views.iter().filter(|view| pixels(view) > 0).map(&figure).reduce(f64::max);
    states.iter().map(of_state).collect::<Option<Vec<f64>>>()?.into_iter().reduce(f64::max)
}

/// The state's name, where there is more than one.
fn under(context: &Context<'_>, state: &StateFigures) -> String {
    if context.findings.states.len() > 1 { format!(" under {}", state.name) } else { String::new() }
}

fn view_sentence(view: &ViewFigures, under: String) -> String {
    format!(
        "What {} sees{under} is off by {} of its mean (nrmse), {} without the worst 1 % of the pixels; half of them by less \
         than {} of their own light, 95 % by less than {}; FLIP {:.4}, of which noise may be {:.4}.",
        view.name,
        percent(view.nrmse),
        percent(view.nrmse_99),
        percent(view.median_relative),
        percent(view.p95_relative),
        view.flip,
        view.flip_noise
    )
}

fn numbers(shown: &[&(&StateFigures, &ViewFigures)], worst: &StateFigures, metrics: &Metrics) -> Vec<Number> {
    let mut numbers = Vec::new();
    // The worst view stands for all.
    if let Some((_, view)) = shown.iter().max_by(|a, b| a.1.nrmse.total_cmp(&b.1.nrmse)) {
        numbers.extend([
            Number {
                label: "nrmse, as seen".into(),
                value: percent(view.nrmse),
                note: format!("{}; {} without the worst 1 %", view.name, percent(view.nrmse_99)),
            },
            Number {
                label: "median, as seen".into(),
                value: percent(view.median_relative),
                note: format!("of a pixel's own light; 95 % are below {}", percent(view.p95_relative)),
            },
            Number {
                label: "FLIP".into(),
                value: format!("{:.4}", view.flip),
                note: format!("{:.4} between two halves of the reference", view.flip_noise),
            },
        ]);
    }
    let ours = worst.methods.of(&COMPRESSED);
    let share = ours.nrmse / worst.methods.of(&SPATIAL).nrmse.max(f64::MIN_POSITIVE);
    numbers.push(Number {
        label: "nrmse of receivers".into(),
        value: percent(ours.nrmse),
        note: format!("{share:.2} × that of spatial interpolation"),
    });
    if shown.is_empty() {
        numbers.push(Number {
            label: "unseen light".into(),
            value: percent(metrics.coverage.unseen.mean),
            note: format!("of the hemisphere, mean; at most {}", percent(metrics.coverage.unseen.max)),
        });
    }
    numbers
}

fn largest_part(figures: &StateFigures) -> &'static str {
    let errors = &figures.errors;
    // The reference and the first bounce are two estimates of the same noise.
    let noise = 2.0 * errors.reference_noise.powi(2);
    let parts = [
        (errors.band_limit, "the band limit of the probes"),
        (errors.unseen, "light that no probe sees"),
        (errors.compression, "compression"),
        (errors.gather_rays, "the number of gather rays"),
        ((errors.input.powi(2) - noise).max(0.0).sqrt(), "earlier bounces"),
        (errors.reference_noise, "noise of the reference"),
    ];
    parts.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("nothing", |(_, name)| name)
}

/// What the bake says of itself.
pub(super) fn bake_section(context: &Context<'_>) -> Section {
    let view = context.subject.view;
    let metadata = view.metadata;
    let report: Value = serde_json::from_str(view.report).unwrap_or(Value::Null);
    let number = |path: &str| report.pointer(path).map_or_else(|| "–".into(), Value::to_string);
    let megabytes = |bytes: u64| format!("{:.1} MB", bytes as f64 / 1e6);
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let rows = vec![
        fact("file", context.file.clone()),
        fact("size", megabytes(context.file_bytes)),
        fact("projection, reconstruction", {
            format!(
                "{}, {}",
                megabytes(4 * view.blocks.total(|block| block.projection_pairs)),
                megabytes(4 * view.blocks.total(|block| block.reconstruction_pairs))
            )
        }),
        fact("triangles", number("/scene/triangles")),
        fact("receivers", format!("{} in {}²", view.receiver_texel.len(), metadata.lightmap_size)),
        fact("invalid receivers", number("/invalid_receivers")),
        fact("probes", format!("{} of degree {}", view.probes.len(), metadata.probe_degree)),
        fact("support radius", format!("{} m", number("/radius"))),
        fact("coefficients per receiver", number("/coefficients_per_receiver")),
        fact("compression, RMS per transport row", number("/compression/rms_error")),
        fact("rays of the bake", number("/rays")),
        fact("made by", format!("precompute {}", metadata.tool_version)),
    ];
    let options = metadata.options.lines().filter_map(|line| {
        let (key, value) = line.split_once(" = ")?;
        Some((key.to_owned(), value.to_owned()))
    });
    Section {
        id: "bake".into(),
        title: "The bake".into(),
        blocks: vec![
            Block::Facts { title: String::new(), rows },
            Block::Details {
                title: "Options".into(),
                blocks: vec![Block::Facts { title: String::new(), rows: options.collect() }],
            },
            Block::Details {
                title: "Report".into(),
                blocks: vec![Block::Text(serde_json::to_string_pretty(&report).unwrap_or_default())],
            },
        ],
    }
}

/// How the figures came method.
pub(super) fn method_section(context: &Context<'_>) -> Section {
    let settings = &context.settings;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let mut rows = vec![
        fact("measured", format!("{} of {} receivers, one from each run of the file", context.findings.sample.len(), context.subject.len())),
        fact("bounces", format!("{} (gathers of direct-to-indirect transport; 1 is the first indirect bounce)", settings.bounces)),
        fact("reference", format!("path tracing with multiple importance sampling until the standard error is {} of the mean, at most {} paths", percent(settings.budget.error), settings.budget.most_paths)),
        fact("nrmse", "√mean((E − E_ref)²) / mean(E_ref) over receivers and color bands".into()),
        fact("median, 95 %, 99 %", "of |E − E_ref| / max(E_ref, 0.05 mean E_ref), luminance".into()),
        fact("bias", "mean(E − E_ref) / mean(E_ref)".into()),
        fact("seen", format!("the lightmap read bilinearly at {} points, each against path tracing at that very point: pixels of a view, or by area of the surfaces in the open. What texels do to the light is part of it", settings.points)),
        fact("off by 10 %, 50 %", "share of the points where |E − E_ref| is more than that share of mean(E_ref), luminance".into()),
        fact("leak", "mean of max(0, E − E_ref) over mean(E_ref), at pixels within two texels of a surface that stands on theirs or crosses it".into()),
        fact("edge ratio", "99.9th percentile, at the same pixels, of E over the largest E_ref within three texels on the same surface in sight, or over 0.05 mean(E_ref)".into()),
        fact("mottling", "RMS, at pixels without an edge within three texels, of the error less its mean within a quarter of the support radius on the same surface, over the mean of E_ref there. Noise of the reference cancels between its halves, here and in the leak".into()),
        fact("FLIP", format!("mean over the pixels of the views at {} pixels per row, 67 pixels per degree (Andersson et al. 2020), with paths until FLIP between two halves of the reference is {FLIP_NOISE}, at most {} a pixel. The larger pictures on this page have {} and show grain", settings.picture_width.min(FLIP_WIDTH), settings.flip_paths, settings.picture_paths)),
        fact("all methods", "read the same probe radiance, that of the last gather of the compressed relight".into()),
    ];
    rows.extend(METHODS.iter().filter_map(|method| Some(fact(method.name, method.comparator?.into()))));
    rows.push(fact("operator norm", "Eq. 12 with receiver fields of degree 9; sky and black backs left out".into()));
    Section {
        id: "method".into(),
        title: "How it was measured".into(),
        blocks: vec![Block::Facts { title: String::new(), rows }],
    }
}
