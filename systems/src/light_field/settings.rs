//! Resolutions, thresholds and filters.

/// How fine the maps are, how rays are judged and how noise is filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Texels per side of radiance, normal and distance; a multiple of `coarse`.
    pub side: usize,
    /// Texels per side that a texel of the second level of the min-mip stands for; 1 for no second level.
    pub coarse: usize,
    /// Texels per side of irradiance and moments of distance.
    pub prefiltered: usize,
    /// Power of the cosine that filters the moments of distance.
    pub lobe_power: f32,
    /// Thickness of a surface that is met across, metres.
    pub least_thickness_m: f32,
    /// Thickness of a surface that is met far away and along the view of the probe, metres; at grazing incidence nearly twice that.
    pub most_thickness_m: f32,
    /// A ray that goes all around a cage and gets on by less than this gives up, metres.
    pub least_progress_m: f32,
    /// Rays per point where irradiance is by brute force.
    pub rays: u32,
    /// What filters the Lambertian rays of a picture.
    pub lambertian: Filter,
    /// What filters the glossy rays of a picture.
    pub glossy: Filter,
}

/// A bilateral filter and a moving average over frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// Pixels to each side.
    pub radius: usize,
    /// Pixels from one tap to the next.
    pub stride: usize,
    /// Share of what the last frame left, 0 to 1.
    pub hysteresis: f32,
}

impl Settings {
    /// The paper's: 1024^2 (sec. 3), 128^2 (sec. 3), 1/16 per axis (sec. 4.2), filters of sec. 5.1, "hundreds of samples per pixel"
    /// (sec. 5.1). Thicknesses and progress are of its supplement. The power of the lobe is not in the paper; 50 is what its authors
    /// took in DDGI (Majercik et al. 2019), its successor.
    pub const PAPER: Self = Self {
        side: 1024,
        coarse: 16,
        prefiltered: 128,
        lobe_power: 50.0,
        least_thickness_m: 0.03,
        most_thickness_m: 0.5,
        least_progress_m: 0.01,
        rays: 256,
        lambertian: Filter { radius: 12, stride: 2, hysteresis: 0.98 },
        glossy: Filter { radius: 3, stride: 1, hysteresis: 0.75 },
    };

    /// For comparisons of irradiance on the CPU: 128^2 and 32^2, a 64th and a 16th of the paper's texels.
    ///
    /// Paper's Figs. 18 and 19: resolution is for glossy reflections, diffuse light by prefiltered maps wants more probes; and sec. 3:
    /// prefiltered maps of 32^2 give good results. What it costs those who trace: rays resolve things of a 36th of their distance, not of
    /// a 290th, and have to start that much above a surface; of 100,000 in the Cornell box with 64 probes 1.8 % are wrong, with 256^2
    /// 1.1 % (`examples/light_field_figures.rs`).
    pub const COMPARED: Self = Self { side: 128, prefiltered: 32, ..Self::PAPER };

    /// Bytes of a probe in the paper's formats: R11G11B10F, RG8 and R16F of radiance, normal and distance, 8 B a texel, and R16F of the
    /// second level; R11G11B10F and two of R16F of irradiance and moments, 8 B a texel.
    ///
    /// Not counted is which surface a texel sees, 8 B a texel as the color of a G-buffer (albedo RGBA8, emission R11G11B10F): the paper
    /// renders its probes anew for another light.
    pub const fn probe_bytes(&self) -> u64 {
        let fine = self.side * self.side * 8;
        let coarse = if self.coarse > 1 { (self.side / self.coarse) * (self.side / self.coarse) * 2 } else { 0 };
        (fine + coarse + self.prefiltered * self.prefiltered * 8) as u64
    }

    /// Angle that a texel covers, radians: root of its mean solid angle.
    pub fn texel_angle(&self) -> f32 {
        (4.0 * std::f32::consts::PI).sqrt() / self.side as f32
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self::PAPER
    }
}
