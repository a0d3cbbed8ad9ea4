//! Allowed values of the options.

use super::BakeSettings;

/// Most probes of a bake. A probe costs 8000 relight rays, so this is far above what a scene can use; it stops a
/// spacing in the wrong unit.
pub const MAX_PROBES: u32 = 1 << 18;

/// An option whose value is not allowed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key} = {value} is out of range; allowed: {allowed}")]
pub struct OutOfRange {
    /// Key of the option, with underscores.
    pub key: &'static str,
    /// The value as given.
    pub value: String,
    /// What is allowed, in words.
    pub allowed: String,
}

impl BakeSettings {
    /// Every value within its range.
    ///
    /// # Errors
    /// The first option that is not, in the order of the fields.
    pub fn check(&self) -> Result<(), OutOfRange> {
        let length = "a finite length above 0 m";
        positive("spacing", self.spacing, length)?;
        whole("probes", self.probes.map_or(1, u64::from), 1, MAX_PROBES.into())?;
        positive("voxel", self.voxel, length)?;
        for point in &self.interior {
            if !point.iter().all(|value| value.is_finite()) {
                return Err(out_of_range("interior", &format!("{point:?}"), "finite coordinates in metres"));
            }
        }
        real("standoff", self.standoff, 0.0, 10.0)?;
        real("overlap", self.overlap, 1.0, 1000.0)?;
        whole("min_overlap", self.min_overlap.into(), 0, 1000)?;
        real("repair", self.repair, 0.0, 1.0)?;
        whole("probe_degree", self.probe_degree.into(), 0, 10)?;
        whole("receiver_degree", self.receiver_degree.into(), 0, 1)?;
        whole("sky_degree", self.sky_degree.into(), 0, 10)?;
        whole("receivers", self.receivers.into(), 1, 1 << 26)?;
        for focus in &self.focus {
            if !(focus.iter().all(|value| value.is_finite()) && focus[3] > 0.0) {
                let allowed = "finite coordinates in metres and a radius above 0 m";
                return Err(out_of_range("focus", &format!("{focus:?}"), allowed));
            }
        }
        whole("lightmap", self.lightmap.map_or(16, u64::from), 16, 8192)?;
        positive("texel", self.texel, length)?;
        if !(8..=16_384).contains(&self.direct_map) || !self.direct_map.is_power_of_two() {
            return Err(out_of_range("direct_map", &self.direct_map.to_string(), "a power of two from 8 to 16384"));
        }
        whole("gather_rays", self.gather_rays.into(), 1, 1 << 20)?;
        whole("relight_rays", self.relight_rays.into(), 1, 1 << 20)?;
        whole("near_bytes", self.near_bytes.into(), 0, 1000)?;
        positive("volume", self.volume, length)?;
        whole("volume_degree", self.volume_degree.into(), 1, 2)?;
        whole("leaf", self.leaf.into(), 2, 8192)?;
        // Below, rounding to f16 alone is more.
        real("threshold", self.threshold, 0.001, 1.0)?;
        // A cluster of one receiver must be able to keep all its rows.
        let degree = self.volume.map_or(0, |_| self.volume_degree).max(self.receiver_degree);
        let least = (u64::from(degree) + 1).pow(2);
        whole("coefficients", self.coefficients.into(), least, 255)?;
        // A TOML integer is an i64.
        whole("seed", self.seed, 0, i64::MAX as u64)?;
        real("max_unseen", self.max_unseen.unwrap_or(0.0), 0.0, 1.0)
    }
}

fn out_of_range(key: &'static str, value: &str, allowed: &str) -> OutOfRange {
    OutOfRange { key, value: value.to_owned(), allowed: allowed.to_owned() }
}

fn positive(key: &'static str, value: Option<f32>, allowed: &str) -> Result<(), OutOfRange> {
    match value {
        Some(value) if !(value > 0.0 && value.is_finite()) => Err(out_of_range(key, &value.to_string(), allowed)),
        _ => Ok(()),
    }
}

fn whole(key: &'static str, value: u64, least: u64, most: u64) -> Result<(), OutOfRange> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(out_of_range(key, &value.to_string(), &format!("{least} to {most}")))
}

/// NaN is in no range.
fn real(key: &'static str, value: f32, least: f32, most: f32) -> Result<(), OutOfRange> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(out_of_range(key, &value.to_string(), &format!("{least} to {most}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_within_their_ranges() {
        assert_eq!(BakeSettings::default().check(), Ok(()));
    }

    #[test]
    fn values_outside_are_refused_by_name() {
        let refused = |settings: BakeSettings| settings.check().expect_err("to be refused").key;
        let settings = BakeSettings::default;
        assert_eq!(refused(BakeSettings { gather_rays: 0, ..settings() }), "gather_rays");
        assert_eq!(refused(BakeSettings { near_bytes: 1001, ..settings() }), "near_bytes");
        assert_eq!(refused(BakeSettings { spacing: Some(0.0), ..settings() }), "spacing");
        assert_eq!(refused(BakeSettings { texel: Some(f32::INFINITY), ..settings() }), "texel");
        assert_eq!(refused(BakeSettings { overlap: f32::NAN, ..settings() }), "overlap");
        assert_eq!(refused(BakeSettings { probe_degree: 11, ..settings() }), "probe_degree");
        assert_eq!(refused(BakeSettings { interior: vec![[0.0, f32::NAN, 0.0]], ..settings() }), "interior");
        assert_eq!(refused(BakeSettings { focus: vec![[0.0, 0.0, 0.0, 0.0]], ..settings() }), "focus");
        assert_eq!(refused(BakeSettings { lightmap: Some(8), ..settings() }), "lightmap");
        assert_eq!(refused(BakeSettings { receivers: 0, ..settings() }), "receivers");
        assert_eq!(refused(BakeSettings { seed: u64::MAX, ..settings() }), "seed");
        assert_eq!(refused(BakeSettings { volume: Some(-1.0), ..settings() }), "volume");
        assert_eq!(refused(BakeSettings { volume_degree: 3, ..settings() }), "volume_degree");
        let small = BakeSettings { coefficients: 8, volume_degree: 2, ..settings() };
        assert_eq!(small.check(), Ok(()), "no volume, no need for its rows");
        assert_eq!(refused(BakeSettings { volume: Some(1.0), ..small }), "coefficients");
        assert_eq!(refused(BakeSettings { max_unseen: Some(1.5), ..settings() }), "max_unseen");
    }
}
