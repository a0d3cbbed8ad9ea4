//! Allowed values of the options: the rules that the table names. Each looks at a value and at the settings it stands in.

use super::BakeSettings;
use std::fmt::Display;
use std::ops::RangeInclusive;

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

/// What a rule says: nothing, or the value and what is allowed, as in [`OutOfRange`].
type Checked = Result<(), [String; 2]>;

pub(super) fn any<T>(_: &T, _: &BakeSettings) -> Checked {
    Ok(())
}

/// NaN is in no range.
pub(super) fn within<T: Display + PartialOrd>(range: RangeInclusive<T>) -> impl Fn(&T, &BakeSettings) -> Checked {
    move |value, _| check(range.contains(value), value.to_string(), format!("{} to {}", range.start(), range.end()))
}

pub(super) fn power_of_two(range: RangeInclusive<u32>) -> impl Fn(&u32, &BakeSettings) -> Checked {
    move |value, _| {
        let allowed = format!("a power of two from {} to {}", range.start(), range.end());
        check(range.contains(value) && value.is_power_of_two(), value.to_string(), allowed)
    }
}

pub(super) fn length(value: &f32, _: &BakeSettings) -> Checked {
    check(*value > 0.0 && value.is_finite(), value.to_string(), "a finite length above 0 m")
}

pub(super) fn place(place: &[f32; 3], _: &BakeSettings) -> Checked {
    check(place.iter().all(|value| value.is_finite()), format!("{place:?}"), "finite coordinates in metres")
}

pub(super) fn ball(ball: &[f32; 4], _: &BakeSettings) -> Checked {
    let is_ball = ball.iter().all(|value| value.is_finite()) && ball[3] > 0.0;
    check(is_ball, format!("{ball:?}"), "finite coordinates in metres and a radius above 0 m")
}

/// A cluster of one receiver must be able to keep all its rows.
pub(super) fn rows_of_a_receiver_to(most: u32) -> impl Fn(&u32, &BakeSettings) -> Checked {
    move |value, settings| {
        let degree = settings.volume.map_or(0, |_| settings.volume_degree).max(settings.receiver_degree);
        within((degree + 1).pow(2)..=most)(value, settings)
    }
}

pub(super) fn given<T>(rule: impl Fn(&T, &BakeSettings) -> Checked) -> impl Fn(&Option<T>, &BakeSettings) -> Checked {
    move |value, settings| value.iter().try_for_each(|value| rule(value, settings))
}

pub(super) fn each<T>(rule: impl Fn(&T, &BakeSettings) -> Checked) -> impl Fn(&Vec<T>, &BakeSettings) -> Checked {
    move |values, settings| values.iter().try_for_each(|value| rule(value, settings))
}

fn check(is_allowed: bool, value: String, allowed: impl Into<String>) -> Checked {
    if is_allowed { Ok(()) } else { Err([value, allowed.into()]) }
}
