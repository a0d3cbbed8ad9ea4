//! The methods under comparison: each takes the light of one gather to the receivers, or light of its own.
//!
//! A method is a [`Method`] in a file here and an entry in [`METHODS`]; metrics and page show all of them, by name, in that
//! order. [`COMPRESSED`] is the file itself, rows are what it was made from; the others are comparators, those of figure 8 on
//! the file's own probes. A method that has probes or bounces of its own makes them when it gets ready for a lighting.

mod arikan;
mod by_method;
mod compressed;
mod receiver;
mod rows;
mod spatial;

pub use arikan::ARIKAN;
pub use by_method::ByMethod;
pub use compressed::COMPRESSED;
pub use receiver::Receiver;
pub use rows::{PAPER, UNCOMPRESSED, WITHOUT_LINKS};
pub use spatial::SPATIAL;

use super::lit::Lit;
use crate::{error::BakeError, progress::Progress, transport::GatherSet};
use glam::Vec3;
use localprt_runtime::LightMaps;

/// All methods; ours is the first.
pub static METHODS: &[&Method] = &[&COMPRESSED, &UNCOMPRESSED, &WITHOUT_LINKS, &SPATIAL, &ARIKAN, &PAPER];

/// Rays of a receiver, at least, whatever the bake has.
const LEAST_RAYS: u32 = 1024;

/// A way to the irradiance of receivers.
#[derive(Debug)]
pub struct Method {
    /// Its key in `metrics.json`.
    pub name: &'static str,
    /// Its row of the table.
    pub title: &'static str,
    /// Name of its pictures.
    pub label: &'static str,
    /// What stands below them.
    pub caption: &'static str,
    /// How a comparator is defined; `None` for the file and what it was made from.
    pub comparator: Option<&'static str>,
    /// Gets ready for one lighting, once for all receivers.
    pub prepare: for<'a> fn(&'a Lit<'a>, &Progress) -> Result<Prepared<'a>, BakeError>,
}

/// A method under one lighting.
pub struct Prepared<'a> {
    /// Irradiance of a receiver, W m^-2, not negative.
    pub irradiance: Box<dyn Fn(&Receiver<'_>) -> Vec3 + Sync + 'a>,
    /// Maps, of a method that has them. Pictures of others are interpolated between receivers.
    pub maps: Option<LightMaps>,
}

/// Light of one method.
#[derive(Clone, Debug)]
pub struct MethodLight {
    /// `[n_receivers]` irradiance.
    pub irradiance: Vec<Vec3>,
    /// As in [`Prepared`].
    pub maps: Option<LightMaps>,
}

/// Light of all methods at the same receivers.
#[derive(Debug)]
pub struct Compared {
    /// By method.
    pub light: ByMethod<MethodLight>,
    /// `[n_receivers]` [`Receiver::near`].
    pub near: Vec<f32>,
}

/// Evaluates every method at some receivers, given in file order.
///
/// # Errors
/// Those of the methods; [`BakeError::Cancelled`].
pub fn compare(lit: &Lit<'_>, receivers: &[u32], progress: &Progress) -> Result<Compared, BakeError> {
    let prepared = METHODS.iter().map(|method| (method.prepare)(lit, progress)).collect::<Result<Vec<_>, _>>()?;
    let settings = &lit.subject.settings;
    let gather = GatherSet::new(settings.gather_rays.max(LEAST_RAYS), 0, settings.seed);
    let found = lit.subject.each("uncompressed and comparators", receivers, progress, |index, leaf| {
        let receiver = Receiver::new(lit, receivers[index], leaf, &gather);
        let light: Vec<Vec3> = prepared.iter().map(|method| (method.irradiance)(&receiver)).collect();
        (light, receiver.near())
    })?;
    let light = prepared.into_iter().enumerate().map(|(method, prepared)| {
        let irradiance = found.iter().map(|(light, _)| light[method]).collect();
        MethodLight { irradiance, maps: prepared.maps }
    });
    Ok(Compared { light: ByMethod::new(light.collect()), near: found.iter().map(|&(_, near)| near).collect() })
}

impl<'a> Prepared<'a> {
    /// A method that knows receivers alone.
    fn at_receivers(irradiance: impl Fn(&Receiver<'_>) -> Vec3 + Sync + 'a) -> Self {
        Self { irradiance: Box::new(irradiance), maps: None }
    }
}
