//! Named sets of options.

use super::BakeSettings;
use std::fmt;

/// How much work a bake does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// About an eighth of the cost, for a first look: a quarter of the receivers, half of the rays of each.
    Preview,
    /// About a quarter of the cost, for daily builds.
    Medium,
    /// The defaults, which are the paper's numbers where it gives them.
    #[default]
    Production,
}

impl Preset {
    /// All presets, cheapest first.
    pub const ALL: [Self; 3] = [Self::Preview, Self::Medium, Self::Production];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Preview => "preview",
            Self::Medium => "medium",
            Self::Production => "production",
        }
    }

    /// The settings this preset stands for.
    pub fn settings(self) -> BakeSettings {
        let production = BakeSettings::default();
        match self {
            Self::Preview => {
                BakeSettings { receivers: 60_000, direct_map: 1024, gather_rays: 512, relight_rays: 2000, ..production }
            }
            Self::Medium => BakeSettings { receivers: 120_000, gather_rays: 768, relight_rays: 4000, ..production },
            Self::Production => production,
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gather_cost_rises_from_preset_to_preset() {
        let cost = |preset: Preset| {
            let settings = preset.settings();
            u64::from(settings.receivers) * u64::from(settings.gather_rays)
        };
        let costs = Preset::ALL.map(cost);
        assert!(costs[0] * 8 <= costs[2], "preview is to cost an eighth or less");
        assert!(costs[0] < costs[1] && costs[1] < costs[2]);
        assert_eq!(Preset::Production.settings(), BakeSettings::default());
    }
}
