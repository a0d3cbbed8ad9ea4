//! The verdict, the bake's own report, and how things were measured.

use super::{Context, percent, signed_percent};
use crate::{
    figures::{Block, Number, Section, Verdict},
    validate::report::Metrics,
};
use serde_json::Value;

/// One sentence and the four numbers that matter.
pub(super) fn verdict(context: &Context<'_>, metrics: &Metrics) -> Verdict {
    let counted: Vec<_> =
        context.findings.states.iter().zip(&metrics.states).filter(|(state, _)| state.state.counts).collect();
    let worst = counted
        .iter()
        .map(|(_, figures)| *figures)
        .max_by(|a, b| a.methods.compressed.nrmse.total_cmp(&b.methods.compressed.nrmse))
        .unwrap_or(&metrics.states[0]);
    let ours = &worst.methods.compressed;
    let passed = context.max_nrmse.map(|allowed| ours.nrmse <= allowed);
    let share = ours.nrmse / worst.methods.spatial.nrmse.max(f64::MIN_POSITIVE);
    let reason = largest_part(worst);
    let limit = match (context.max_nrmse, passed) {
        (Some(allowed), Some(true)) => format!(", within the limit of {}", percent(allowed)),
        (Some(allowed), _) => format!(", above the limit of {}", percent(allowed)),
        _ => String::new(),
    };
    let state = if context.findings.states.len() > 1 { format!(" under {}", worst.name) } else { String::new() };
    Verdict {
        passed,
        sentence: format!(
            "Indirect light is off by {} of its mean (nrmse){state}{limit}; most of it is {reason}. Interpolating the same \
             probes is off by {}.",
            percent(ours.nrmse),
            percent(worst.methods.spatial.nrmse)
        ),
        numbers: vec![
            Number {
                label: "nrmse".into(),
                value: percent(ours.nrmse),
                note: format!("{share:.2} × that of spatial interpolation"),
            },
            Number {
                label: "median error".into(),
                value: percent(ours.median_relative),
                note: format!("of a receiver's own light; 95 % are below {}", percent(ours.p95_relative)),
            },
            Number {
                label: "bias".into(),
                value: signed_percent(ours.bias),
                note: "of all indirect light together".into(),
            },
            Number {
                label: "unseen light".into(),
                value: percent(metrics.coverage.unseen.mean),
                note: format!("of the hemisphere, mean; at most {}", percent(metrics.coverage.unseen.max)),
            },
        ],
    }
}

fn largest_part(figures: &crate::validate::report::StateFigures) -> &'static str {
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
                megabytes(2 * view.projection.len() as u64),
                megabytes(2 * view.reconstruction.len() as u64)
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

/// How the figures came about.
pub(super) fn method_section(context: &Context<'_>) -> Section {
    let settings = &context.settings;
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let rows = vec![
        fact("measured", format!("{} of {} receivers, one from each run of the file", context.findings.sample.len(), context.subject.len())),
        fact("bounces", format!("{} (gathers of direct-to-indirect transport; 1 is the first indirect bounce)", settings.bounces)),
        fact("reference", format!("path tracing with multiple importance sampling until the standard error is {} of the mean, at most {} paths", percent(settings.budget.error), settings.budget.most_paths)),
        fact("nrmse", "√mean((E − E_ref)²) / mean(E_ref) over receivers and color bands".into()),
        fact("median, 95 %, 99 %", "of |E − E_ref| / max(E_ref, 0.05 mean E_ref), luminance".into()),
        fact("bias", "mean(E − E_ref) / mean(E_ref)".into()),
        fact("FLIP", "mean over the pixels of the views, 67 pixels per degree (Andersson et al. 2020)".into()),
        fact("all methods", "read the same probe radiance, that of the last gather of the compressed relight".into()),
        fact("paper", "transport rows of Eq. 4, whatever the file's are".into()),
        fact("spatial", "E = ∫ L̄ cos, L̄ = Σ wᵢ Lᵢ / Σ wᵢ (Eq. 1): probes blended by distance".into()),
        fact("arikan", "E = Σ w (L(Γ) where |Γ − x| < r, L̄ elsewhere), r half the radius of support: the irradiance decomposition of Arikan et al. 2005 with sampled visibility and exact near light, its best case".into()),
        fact("operator norm", "Eq. 12 with receiver fields of degree 9; sky and black backs left out".into()),
    ];
    Section {
        id: "method".into(),
        title: "How it was measured".into(),
        blocks: vec![Block::Facts { title: String::new(), rows }],
    }
}
