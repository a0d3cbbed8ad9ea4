//! Errors of the transport rows of a baked file before compression, by the paper, fitted without near light and as they are,
//! and of the file, under any number of lightings: the tables of `docs/fitted-transport-trials.md`.
//!
//! Usage: `cargo run --release --example transport_error -- FILE.lprt RECEIVERS BOUNCES [LIGHTS.json ..]`, `-` for the scene's
//! own lights. With `REFERENCES=folder` the path-traced references are kept there and found again, for any file that was
//! baked from the same scene at the same lightmap size; with `WORST=n` the n receivers with the largest errors are listed;
//! with `STEPS=n` steps of light between n pairs of neighbors are compared with the true ones, at cluster borders and within
//! clusters; with `FRAMES=1` the lightings are taken as successive frames, and what changes from one to the next is
//! compared with what truly does.

use glam::Vec3;
use localprt_precompute::metrics::{MethodError, mean, nrmse_without_worst};
use localprt_precompute::{
    Progress, inputs,
    validate::{
        Subject, lit,
        methods::{self, COMPRESSED, Method, PAPER, UNCOMPRESSED, WITHOUT_LINKS},
        path_tracer::{PathBudget, PathTracer},
        selection::Pairs,
    },
};
use localprt_scenes::{Lighting, luminance};
use std::{
    error::Error,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    path::Path,
};

const SEED: u64 = 1;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, receivers, bounces, lights @ ..] = arguments.as_slice() else {
        return Err("usage: transport_error FILE.lprt RECEIVERS BOUNCES [LIGHTS.json ..]".into());
    };
    let (receivers, bounces): (usize, u32) = (receivers.parse()?, bounces.parse()?);
    let progress = Progress::silent();
    let baked = inputs::baked(Path::new(file))?;
    let scene = inputs::baked_scene(Path::new(file), baked.view().metadata, None)?;
    let caster = inputs::caster(&scene)?;
    let subject = Subject::new(baked.checked()?, &caster, &progress)?;

    // By texel, so that all files of a scene are measured at the same receivers; in file order, where neighbors are near.
    let mut by_texel: Vec<u32> = (0..subject.len() as u32).collect();
    by_texel.sort_unstable_by_key(|&receiver| subject.view.receiver_texel[receiver as usize]);
    let count = receivers.min(by_texel.len());
    let mut sample: Vec<u32> = (0..count).map(|index| by_texel[index * by_texel.len() / count]).collect();
    sample.sort_unstable();
    let points: Vec<_> = sample.iter().map(|&receiver| subject.sites(receiver)).collect();

    let mut frames = Vec::new();
    for lights in lights {
        let path = (lights != "-").then(|| Path::new(lights));
        let lighting = inputs::lighting(path, &scene)?;
        let texels: Vec<u32> = sample.iter().map(|&receiver| subject.view.receiver_texel[receiver as usize]).collect();
        let kept = kept_at(&(scene.hash, bounces, lighting.to_json().to_string(), sorted(&texels)));
        let reference = match kept.as_deref().and_then(|kept| read(kept, &texels)) {
            Some(reference) => reference,
            None => {
                let tracer = PathTracer::new(&caster, &lighting, bounces, SEED);
                let reference = tracer.estimate_means(&points, PathBudget::default(), &progress)?.irradiance;
                if let Some(kept) = kept {
                    write(&kept, &texels, &reference)?;
                }
                reference
            }
        };
        frames.push(report(&subject, &lighting, lights, bounces, &sample, reference)?);
        let pairs: usize = std::env::var("STEPS").ok().and_then(|count| count.parse().ok()).unwrap_or(0);
        if pairs > 0 {
            report_steps(&subject, &lighting, bounces, &Pairs::of(&subject, pairs))?;
        }
    }
    if std::env::var_os("FRAMES").is_some() {
        report_frames(&frames);
    }
    Ok(())
}

/// Irradiance at the sampled receivers, by way.
struct Frame {
    truth: Vec<Vec3>,
    paper: Vec<Vec3>,
    rows: Vec<Vec3>,
    file: Vec<Vec3>,
}

fn report(
    subject: &Subject<'_>,
    lighting: &Lighting,
    name: &str,
    bounces: u32,
    sample: &[u32],
    reference: Vec<Vec3>,
) -> Result<Frame, Box<dyn Error>> {
    let progress = Progress::silent();
    let lit = lit::light(subject, lighting, bounces, &progress)?;
    let compared = methods::compare(&lit, sample, &progress)?;
    let of = |method: &Method| compared.light.of(method).irradiance.clone();
    let (paper, without_links) = (of(&PAPER), of(&WITHOUT_LINKS));
    let (rows, compressed) = (of(&UNCOMPRESSED), of(&COMPRESSED));
    let name = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    for (way, values) in [("paper", &paper), ("without links", &without_links), ("rows", &rows), ("file", &compressed)]
    {
        let of = MethodError::of(values, &reference).ok_or("no light reaches any receiver")?;
        println!(
            "{name}, {way}: nrmse {:.4}, without the worst 1 % {:.4}, median {:.4}, 95 % {:.3}, 99 % {:.2}, bias {:+.1} %",
            of.nrmse,
            nrmse_without_worst(values, &reference, 0.01),
            of.median_relative,
            of.p95_relative,
            of.p99_relative,
            100.0 * of.bias,
        );
    }
    let worst: usize = std::env::var("WORST").ok().and_then(|count| count.parse().ok()).unwrap_or(0);
    let mean = mean(&reference) as f32;
    let error = |values: &[Vec3], index: usize| (values[index] - reference[index]).length() / mean;
    let mut order: Vec<usize> = (0..sample.len()).collect();
    order.sort_by(|&a, &b| {
        let largest = |index| error(&rows, index).max(error(&paper, index));
        largest(b).total_cmp(&largest(a))
    });
    for &index in order.iter().take(worst) {
        let point = subject.point(sample[index]);
        println!(
            "  {} at {:.2} facing {:.1}: reference {:.3}, paper {:.3}, rows {:.3}, compressed {:.3} of the mean; near {:.2}, probes {}",
            sample[index],
            point.position,
            point.normal,
            reference[index].element_sum() / 3.0 / mean,
            paper[index].element_sum() / 3.0 / mean,
            rows[index].element_sum() / 3.0 / mean,
            compressed[index].element_sum() / 3.0 / mean,
            compared.near[index],
            subject.supporting(sample[index]).len(),
        );
    }
    Ok(Frame { truth: reference, paper, rows, file: compressed })
}

/// RMS over receivers and frames of the change in luminance from frame to frame, and of its difference from the true
/// change, over the mean of all.
fn report_frames(frames: &[Frame]) {
    let light = |values: &[Vec3]| -> Vec<f64> { values.iter().map(|value| luminance(*value)).collect() };
    let changes = |way: fn(&Frame) -> &[Vec3]| -> Vec<f64> {
        let of_pair = |pair: &[Frame]| -> Vec<f64> {
            light(way(&pair[1])).into_iter().zip(light(way(&pair[0]))).map(|(after, before)| after - before).collect()
        };
        frames.windows(2).flat_map(of_pair).collect()
    };
    let rms = |values: &mut dyn ExactSizeIterator<Item = f64>| {
        let count = values.len().max(1) as f64;
        (values.map(|value| value * value).sum::<f64>() / count).sqrt()
    };
    let all: Vec<f64> = frames.iter().flat_map(|frame| light(&frame.truth)).collect();
    let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
    let truth = changes(|frame| &frame.truth);
    print!("  changes over {} frames: truth {:.4}", frames.len(), rms(&mut truth.iter().copied()) / mean);
    let found = [
        ("paper", changes(|frame| &frame.paper)),
        ("rows", changes(|frame| &frame.rows)),
        ("file", changes(|frame| &frame.file)),
    ];
    for (name, found) in found {
        let size = rms(&mut found.iter().copied()) / mean;
        let wrong = rms(&mut found.iter().zip(&truth).map(|(found, truth)| found - truth)) / mean;
        print!(", {name} {size:.4} (off by {wrong:.4})");
    }
    println!();
}

/// RMS of the steps in luminance by the truth, the file, its rows uncompressed and the paper's, over the mean of these
/// receivers, and of their difference from the true step.
fn report_steps(subject: &Subject<'_>, lighting: &Lighting, bounces: u32, pairs: &Pairs) -> Result<(), Box<dyn Error>> {
    let progress = Progress::silent();
    let mut all: Vec<u32> = pairs.clusters.iter().chain(&pairs.within).flatten().copied().collect();
    all.sort_unstable();
    all.dedup();
    let points: Vec<_> = all.iter().map(|&receiver| subject.sites(receiver)).collect();
    let reference = PathTracer::new(subject.caster, lighting, bounces, SEED).estimate_means(
        &points,
        PathBudget::default(),
        &progress,
    )?;
    let lit = lit::light(subject, lighting, bounces, &progress)?;
    let compared = methods::compare(&lit, &all, &progress)?;
    let brightness = |light: &[Vec3]| -> Vec<f64> { light.iter().map(|&light| luminance(light)).collect() };
    let of = |method: &Method| brightness(&compared.light.of(method).irradiance);
    let truth = brightness(&reference.irradiance);
    let mean = truth.iter().sum::<f64>() / all.len() as f64;
    let ways =
        [("truth", truth.clone()), ("file", of(&COMPRESSED)), ("rows", of(&UNCOMPRESSED)), ("paper", of(&PAPER))];
    for (border, pairs) in [("cluster borders", &pairs.clusters), ("within clusters", &pairs.within)] {
        let step = |values: &[f64], pair: &[u32; 2]| {
            let at = |receiver: u32| values[all.partition_point(|&other| other < receiver)];
            at(pair[1]) - at(pair[0])
        };
        let rms = |of: &dyn Fn(&[u32; 2]) -> f64| {
            (pairs.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / pairs.len().max(1) as f64).sqrt() / mean
        };
        print!("  steps, {} {border}:", pairs.len());
        for (name, values) in &ways {
            let size = rms(&|pair| step(values, pair));
            let wrong = rms(&|pair| step(values, pair) - step(&truth, pair));
            print!(" {name} {size:.4} (off by {wrong:.4})");
        }
        println!();
    }
    Ok(())
}

fn sorted(texels: &[u32]) -> Vec<u32> {
    let mut sorted = texels.to_vec();
    sorted.sort_unstable();
    sorted
}

/// Where the references of something are kept, if they are.
fn kept_at(what: &impl Hash) -> Option<std::path::PathBuf> {
    let mut hasher = DefaultHasher::new();
    what.hash(&mut hasher);
    Some(Path::new(&std::env::var_os("REFERENCES")?).join(format!("{:016x}", hasher.finish())))
}

/// Kept as texel and irradiance, a line each.
fn read(path: &Path, texels: &[u32]) -> Option<Vec<Vec3>> {
    let text = fs::read_to_string(path).ok()?;
    let values: std::collections::HashMap<u32, Vec3> = text
        .lines()
        .filter_map(|line| {
            let numbers: Vec<f32> = line.split(' ').skip(1).filter_map(|number| number.parse().ok()).collect();
            Some((line.split(' ').next()?.parse().ok()?, Vec3::from_slice(numbers.get(..3)?)))
        })
        .collect();
    texels.iter().map(|texel| values.get(texel).copied()).collect()
}

fn write(path: &Path, texels: &[u32], reference: &[Vec3]) -> std::io::Result<()> {
    let lines =
        texels.iter().zip(reference).map(|(texel, light)| format!("{texel} {} {} {}\n", light.x, light.y, light.z));
    fs::write(path, lines.collect::<String>())
}
