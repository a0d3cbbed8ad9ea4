//! What a picture shows: light as it is, one part of it, or a map of the bake.

/// What a picture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewKind {
    /// Surfaces in their colors under all light.
    #[default]
    Final,
    /// All light on surfaces of albedo 0.5.
    Lighting,
    /// Direct light alone on surfaces of albedo 0.5.
    Direct,
    /// Indirect light alone on surfaces of albedo 0.5.
    Indirect,
    /// Share of the hemisphere whose surfaces no supporting probe sees.
    Unseen,
    /// Clusters of receivers.
    Clusters,
    /// Singular values that the cluster keeps.
    Coefficients,
    /// Texels of the receiver map.
    Texels,
    /// Relative error against path tracing.
    Error,
}

/// Albedo of surfaces that show light alone.
pub const GRAY_ALBEDO: f32 = 0.5;

impl ViewKind {
    /// All, in the order of menus.
    pub const ALL: [Self; 9] = [
        Self::Final,
        Self::Lighting,
        Self::Direct,
        Self::Indirect,
        Self::Unseen,
        Self::Clusters,
        Self::Coefficients,
        Self::Texels,
        Self::Error,
    ];

    /// One word, as command lines have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Final => "final",
            Self::Lighting => "lighting",
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Unseen => "unseen",
            Self::Clusters => "clusters",
            Self::Coefficients => "coefficients",
            Self::Texels => "texels",
            Self::Error => "error",
        }
    }

    /// The view of a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|view| view.name() == name)
    }

    /// What it shows, in one line.
    pub fn about(self) -> &'static str {
        match self {
            Self::Final => "surfaces in their colors under all light",
            Self::Lighting => "all light on gray surfaces, emission included",
            Self::Direct => "direct light alone on gray surfaces",
            Self::Indirect => "indirect light alone on gray surfaces",
            Self::Unseen => "share of the light around a receiver that no supporting probe sees",
            Self::Clusters => "clusters of receivers, in colors without meaning",
            Self::Coefficients => "singular values kept per cluster: what the receiver costs",
            Self::Texels => "texels of the receiver map, tinted by cluster; gutters and empty texels marked",
            Self::Error => "relative error against path tracing, as precompute validate measured it",
        }
    }

    /// Whether surfaces show a [`ReceiverMap`](crate::ReceiverMap), which is not light: tone mapped with
    /// [`ToneMap::Clamp`](crate::ToneMap::Clamp) and scale 1 its colors arrive as they are.
    pub fn is_map(self) -> bool {
        matches!(self, Self::Unseen | Self::Clusters | Self::Coefficients | Self::Texels | Self::Error)
    }

    /// `VIEW_` of the shader.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Final => 0,
            Self::Lighting => 1,
            Self::Direct => 2,
            Self::Indirect => 3,
            Self::Unseen | Self::Clusters | Self::Coefficients | Self::Texels | Self::Error => 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_views() {
        for view in ViewKind::ALL {
            assert_eq!(ViewKind::of_name(view.name()), Some(view));
            assert!(!view.about().is_empty() && view.is_map() == (view.code() == 4));
        }
        assert_eq!(ViewKind::ALL[0], ViewKind::default());
        assert_eq!((ViewKind::of_name("Final"), ViewKind::of_name("")), (None, None));
    }
}
