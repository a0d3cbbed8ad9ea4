//! What can be set, with the paper's numbers.

use crate::irradiance_probes::{MapSizes, Weights};

/// Settings of the scaled system. Switches are for comparisons: the paper has all of them on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Rays of a probe in a frame. The paper gives none; as in DDGI.
    pub rays: u32,
    /// Rays of a newly awake or newly vigilant probe, for its first values: "a large number" (sec. 6.3, optional there).
    pub first_rays: u32,
    /// The `alpha` of Eq. (1), for irradiance and distance. The paper gives none; Majercik et al. 2019: 0.97.
    pub hysteresis: f32,
    /// Power of the cosine in the mean of distances. Majercik et al. 2019: 50.
    pub distance_power: i32,
    /// Sides of the maps (sec. 7.1).
    pub sizes: MapSizes,
    /// Weights of a query.
    pub weights: Weights,
    /// The self-shadow bias `B` of Eq. (2).
    pub self_shadow_bias: f32,
    /// The cage and its trilinear weights are those of the biased point, too.
    ///
    /// Differs from the paper, which takes the biased point "for the visibility test"; its authors' RTXGI takes it for both. Otherwise a
    /// probe that was moved through a thin wall has nearly all the weight of points on its other side: see
    /// `a_moved_probe_does_not_light_the_room_that_it_left`.
    pub biased_cage: bool,
    /// Distances to black backs are shortened (sec. 4.1).
    pub shortens_backs: bool,
    /// Exponent of the perceptual encoding (Fig. 4); 1 stores light as it is.
    pub exponent: f32,
    /// Mean radiance that is the greatest of the paper's textures, W sr^-1 m^-2: thresholds of change are shares of it.
    pub white: f32,
    /// Large changes of a texel lower its hysteresis (Fig. 5).
    pub thresholds: bool,
    /// Events lower the hysteresis of all probes (sec. 4.3).
    pub events: bool,
    /// Moves of a probe before it is classified (sec. 5); 0 leaves all on the grid.
    pub moves: u32,
    /// Probes that light no surface sleep, and those that are inside of something are off (sec. 6).
    pub sleeps: bool,
    /// Volumes that follow the camera are blended around it, not around their own middle (sec. 7.3).
    pub blends_at_camera: bool,
    /// How far the outermost probes of a volume over the whole scene stand within its bounds, in spacings.
    pub inset: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rays: 128,
            first_rays: 1024,
            hysteresis: 0.97,
            distance_power: 50,
            sizes: MapSizes::PAPER,
            weights: Weights::default(),
            self_shadow_bias: 0.3,
            biased_cage: true,
            shortens_backs: true,
            exponent: 5.0,
            white: 1.0,
            thresholds: true,
            events: true,
            moves: 5,
            sleeps: true,
            blends_at_camera: true,
            inset: 0.5,
        }
    }
}
