//! What can be set. Switches are for comparisons.

use crate::ddgi_scaled;

/// Settings of the hybrid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Probes of each of the two fields, at most.
    pub probes: usize,
    /// How far around what moves the window goes, metres.
    pub reach_m: f32,
    /// How the change joins the file's light.
    pub joining: Joining,
    /// What moves casts shadows in the light map that the file is relit by.
    pub shadows: bool,
    /// The change enters the file's next gather: bounces that start where something moved go on by the file, outside of the window too.
    pub passes_on: bool,
    /// The change falls to nothing over the last cell of the window.
    pub fades: bool,
    /// The field without what moves is taken off. Otherwise light is counted twice.
    pub takes_off: bool,
    /// Settings of the two fields.
    pub field: ddgi_scaled::Settings,
}

/// How the change joins the file's light. Both leave it to the last bit where nothing changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joining {
    /// `max(file + with - without, 0)`.
    Sum,
    /// `file min(with / without, 1) + max(with - without, 0)`, band by band: less light is a share of the file's, more light is added.
    Share,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            probes: 512,
            reach_m: 4.0,
            joining: Joining::Share,
            shadows: false,
            passes_on: false,
            fades: true,
            takes_off: true,
            field: ddgi_scaled::Settings { exponent: 1.0, ..ddgi_scaled::Settings::default() },
        }
    }
}
