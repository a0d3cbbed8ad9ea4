//! Options of a bake: unit, range, default and source of each.
//!
//! Each is one entry of `settings/table.rs`, from which its field, default, presets, range, key and flag come.
//! [`BakeSettings::resolve`] puts the layers together: flags over a configuration file over a [`Preset`] over the
//! defaults; [`BakeSettings::check`] holds the ranges.

mod bake_option;
mod layers;
mod ranges;
mod table;
mod values;

pub use bake_option::BakeOption;
pub use layers::{FILL_IS_GONE, FLAG_LAYER, SettingsError, nearest, parse};
pub use ranges::{MAX_PROBES, OutOfRange};
pub use table::{BakeSettings, Density, Glass, OPTIONS, Preset, Transport, UnwrapBackend};
pub use values::{Values, Word};

impl BakeSettings {
    /// Every value within its range.
    ///
    /// # Errors
    /// The first option that is not, in the order of the fields.
    pub fn check(&self) -> Result<(), OutOfRange> {
        OPTIONS.iter().try_for_each(|option| (option.check)(self))
    }

    /// Bytes of near light a receiver; `None` where it is off.
    pub fn near_bytes_in_force(&self) -> Option<f32> {
        (self.near_bytes > 0 && self.transport == Transport::Fitted).then_some(self.near_bytes as f32)
    }
}
