//! Probe views: what the fixed directions of every probe meet. They are traced once; what is kept of them is for the stages to say.

use crate::rays::{RayCaster, SurfaceHit};
use glam::Vec3;
use localprt_formats::{directions::spherical_fibonacci, sh};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Directions that all probes share: a spherical Fibonacci set, with their SH.
#[derive(Clone, Debug, Default)]
pub struct ProbeDirections {
    /// `[n_rays]` unit.
    pub dirs: Vec<Vec3>,
    /// `[n_rays][n_sh]` SH values times `4 pi / n_rays`.
    pub sh: Vec<f32>,
}

impl ProbeDirections {
    /// So many, in a basis.
    pub fn new(n_rays: u32, basis: &sh::Basis) -> Self {
        let dirs: Vec<Vec3> = (0..n_rays).map(|ray| Vec3::from(spherical_fibonacci(ray, n_rays))).collect();
        let mut sh = vec![0.0; dirs.len() * basis.len()];
        for (dir, values) in dirs.iter().zip(sh.chunks_exact_mut(basis.len())) {
            basis.evaluate(dir.to_array(), values);
            values.iter_mut().for_each(|value| *value *= 4.0 * PI / n_rays as f32);
        }
        Self { dirs, sh }
    }

    /// Solid angle of each.
    pub fn steradians(&self) -> f32 {
        4.0 * PI / self.dirs.len() as f32
    }

    /// `[n_probes]` what `look` makes of what each probe sees, `[n_rays]`; `None` where a ray leaves the scene.
    pub fn views<T: Send>(
        &self,
        caster: &RayCaster<'_>,
        probes: &[Vec3],
        look: impl Fn(&[Option<SurfaceHit>]) -> T + Sync,
    ) -> Vec<T> {
        let view = |&probe: &Vec3| {
            let hits: Vec<_> = self.dirs.iter().map(|&dir| caster.closest_hit(probe, dir)).collect();
            look(&hits)
        };
        probes.par_iter().map(view).collect()
    }
}
