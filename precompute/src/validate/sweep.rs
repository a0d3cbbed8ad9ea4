//! Sweeps: the scene is baked again with other values of one option, and the error plotted over it (figures 10 and 11).

use super::{
    MeasureSettings, StateFindings, lit::light, operator_norm::operator_norm, selection::thin, state::irradiance_map,
    subject::Subject,
};
use crate::metrics::{MethodError, percentile};
use crate::{
    error::BakeError,
    pipeline::bake,
    progress::Progress,
    settings::{BakeSettings, Preset, SettingsError},
};
use glam::Vec3;
use localprt_runtime::{CoverageMap, LightMaps};
use serde::Serialize;

/// Receivers at which a sweep measures the operator norm.
const NORM_RECEIVERS: usize = 1024;
/// Options that would move the receivers, so that nothing could be compared.
const OF_THE_LAYOUT: [&str; 5] = ["receivers", "lightmap", "texel", "unwrap", "receiver_degree"];

/// One option and the values to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Key of the option; `degree` stands for `probe_degree`.
    pub option: String,
    /// Settings of each bake, by the value as given.
    pub settings: Vec<(String, BakeSettings)>,
}

/// One bake of a sweep, under the first lighting state.
#[derive(Clone, Debug, Serialize)]
pub struct SweepPoint {
    /// The option's value as given.
    pub value: String,
    /// Errors of the compressed light.
    pub error: MethodError,
    /// Mean of the operator norm over some receivers.
    pub operator_norm: f64,
    /// 95th percentile of the same.
    pub operator_norm_p95: f64,
    /// Probes of the bake.
    pub probes: u64,
    /// Projection and reconstruction.
    pub bytes: u64,
    /// Wall time of the bake.
    pub seconds: f64,
    /// Mean unseen share.
    pub unseen: f64,
    /// What a picture is lit by.
    #[serde(skip)]
    pub maps: LightMaps,
    /// Receivers at which the norm was measured, in file order of the validated file, and their norms.
    #[serde(skip)]
    pub norms: (Vec<u32>, Vec<f32>),
}

/// A sweep's results.
#[derive(Clone, Debug, Serialize)]
pub struct SweepFindings {
    /// Key of the option.
    pub option: String,
    /// In the order given.
    pub points: Vec<SweepPoint>,
}

impl Sweep {
    /// Checks an option and its values against the options that a file was baked with.
    ///
    /// # Errors
    /// [`BakeError::Settings`] for an unknown option or a value out of range, [`BakeError::Option`] for one that would
    /// move the receivers.
    pub fn new(option: &str, values: &[String], baked: &BakeSettings, lightmap: u32) -> Result<Self, BakeError> {
        let key = if option == "degree" { "probe_degree" } else { option };
        if OF_THE_LAYOUT.contains(&key) {
            return Err(BakeError::Option {
                what: format!("`{key}` cannot be swept: it changes the receivers, and nothing could be compared"),
                remedy: "sweep another option, such as probes, degree, overlap, gather_rays or threshold".into(),
            });
        }
        // The scene carries its layout now, and it is used at the size of the file's map.
        let base = BakeSettings { lightmap: Some(lightmap), texel: None, max_unseen: None, ..baked.clone() };
        let settings = values
            .iter()
            .map(|value| {
                // Words are strings in TOML.
                let is_word = value.parse::<f64>().is_err() && value.chars().all(|letter| letter.is_ascii_lowercase());
                let line = if is_word { format!("{key} = \"{value}\"") } else { format!("{key} = {value}") };
                let flags = line.parse::<toml::Table>().map_err(|error| SettingsError::WrongType {
                    layer: "--sweep".into(),
                    key: key.into(),
                    what: format!("`{value}`: {}", error.message()),
                })?;
                let settings =
                    BakeSettings::resolve(Preset::Production, Some(("options of the bake", &base.to_toml())), &flags)?;
                Ok((value.clone(), settings))
            })
            .collect::<Result<_, BakeError>>()?;
        Ok(Self { option: option.to_owned(), settings })
    }
}

/// Bakes and measures every value of a sweep at the receivers `sample`, against the reference of `state`.
///
/// # Errors
/// Those of the bake; [`BakeError::Scene`] if the scene's layout was not kept.
pub fn run(
    subject: &Subject<'_>,
    sweep: &Sweep,
    state: &StateFindings,
    sample: &[u32],
    settings: &MeasureSettings,
    progress: &Progress,
) -> Result<SweepFindings, BakeError> {
    let points = sweep
        .settings
        .iter()
        .map(|(value, options)| {
            progress.note(&format!("sweep: {} = {value}", sweep.option));
            let output = bake(subject.caster.scene().clone(), options, progress)?;
            if output.unwrapped {
                return Err(BakeError::Scene {
                    what: "the scene's lightmap layout was not kept by a bake of the sweep".into(),
                    place: None,
                    remedy: "validate with the scene that was written beside the baked file".into(),
                });
            }
            let checked = output.arrays.checked().map_err(|broken| BakeError::Internal { what: broken.to_string() })?;
            let again = Subject::new(checked, subject.caster, progress)?;
            // Clusters, and so the order of the receivers, differ from bake to bake; their texels do not.
            let in_bake = |receiver: u32| again.at_texel[subject.view.receiver_texel[receiver as usize] as usize];
            let lit = light(&again, &state.state.lighting, settings.bounces, progress)?;
            let found: Vec<Vec3> =
                sample.iter().map(|&receiver| lit.relit.irradiance[in_bake(receiver) as usize]).collect();
            let views = state.views.iter().map(|view| view.flip(&lit.relit.maps));
            let flip = views.sum::<f64>() / state.views.len().max(1) as f64;
            let error = MethodError::of(&found, &state.reference.irradiance).unwrap_or_default();

            let some = thin(sample, NORM_RECEIVERS);
            let places: Vec<u32> = some.iter().map(|&receiver| in_bake(receiver)).collect();
            let norms: Vec<f32> = operator_norm(&again, &places, progress)?.iter().map(|unlit| unlit.norm).collect();
            let wide: Vec<f64> = norms.iter().map(|&norm| f64::from(norm)).collect();
            Ok(SweepPoint {
                value: value.clone(),
                error: MethodError { flip, ..error },
                operator_norm: wide.iter().sum::<f64>() / wide.len().max(1) as f64,
                operator_norm_p95: percentile(&wide, 0.95),
                probes: output.report.probes,
                bytes: output.report.bytes.projection + output.report.bytes.reconstruction,
                seconds: output.report.seconds,
                unseen: output.report.unseen.mean,
                maps: lit.relit.maps.clone(),
                norms: (some, norms),
            })
        })
        .collect::<Result<_, BakeError>>()?;
    Ok(SweepFindings { option: sweep.option.clone(), points })
}

impl SweepPoint {
    /// The operator norm at all receivers of the validated file, as a map.
    pub fn norm_map(&self, subject: &Subject<'_>) -> CoverageMap {
        let (receivers, norms) = &self.norms;
        let values: Vec<Vec3> = norms.iter().map(|&norm| Vec3::splat(norm)).collect();
        irradiance_map(subject, &super::selection::spread(subject, receivers, &values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_checked_before_anything_is_baked() {
        let baked = BakeSettings { texel: Some(0.1), ..BakeSettings::default() };
        let sweep = |option: &str, values: &[&str]| {
            let values: Vec<String> = values.iter().map(|&value| value.to_owned()).collect();
            Sweep::new(option, &values, &baked, 256)
        };
        let degrees = sweep("degree", &["2", "7"]).expect("valid");
        assert_eq!(degrees.settings[0].1.probe_degree, 2);
        assert_eq!((degrees.settings[1].1.lightmap, degrees.settings[1].1.texel), (Some(256), None));
        assert_eq!(sweep("probes", &["8"]).expect("valid").settings[0].1.probes, Some(8));
        let transports = sweep("transport", &["paper", "fitted"]).expect("valid");
        assert_eq!(transports.settings[0].1.transport, crate::settings::Transport::Paper);
        assert!(matches!(sweep("transport", &["best"]), Err(BakeError::Settings(_))));
        assert!(matches!(sweep("degree", &["99"]), Err(BakeError::Settings(_))));
        assert!(matches!(sweep("probes", &["many"]), Err(BakeError::Settings(_))));
        assert!(matches!(sweep("color", &["1"]), Err(BakeError::Settings(_))));
        assert!(matches!(sweep("lightmap", &["64"]), Err(BakeError::Option { .. })));
    }
}
