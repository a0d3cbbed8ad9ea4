//! Axes: round ends, ticks and their numbers, on a linear or a logarithmic scale.

use localprt_tools::range::round_up;

/// One axis of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// Value at the start.
    pub low: f64,
    /// Value at the end, above `low`.
    pub high: f64,
    /// Equal factors, not equal differences, take equal lengths.
    pub log: bool,
}

/// Magnitudes beyond this (and, on a logarithmic axis, below its inverse) are left out, so that no sum overflows.
const LARGEST: f64 = 1e100;

impl Axis {
    /// Whether a value has a place on such an axis.
    pub fn holds(log: bool, value: f64) -> bool {
        value.abs() <= LARGEST && (!log || value >= 1.0 / LARGEST)
    }

    /// An axis around values, its ends rounded outwards to ticks; 0 to 1, or 0.1 to 1, around nothing.
    pub fn around(values: impl IntoIterator<Item = f64>, log: bool) -> Self {
        let held = values.into_iter().filter(|&value| Self::holds(log, value));
        let (low, high) = held.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), value| (l.min(value), h.max(value)));
        if low > high {
            return Self { low: if log { 0.1 } else { 0.0 }, high: 1.0, log };
        }
        if log {
            // A whole step to either side, so that equal values get an axis too.
            let (low, high) = if low == high { (low / 2.0, high * 2.0) } else { (low, high) };
            return Self { low: 1.0 / round_up(1.0 / low), high: round_up(high), log };
        }
        // Zero belongs on the axis where that costs less than half of it.
        let (low, high) = if low > 0.0 && low < 0.5 * high {
            (0.0, high)
        } else if high < 0.0 && high > 0.5 * low {
            (low, 0.0)
        } else {
            (low, high)
        };
        let size = low.abs().max(high.abs());
        let pad = if high - low > 1e-9 * size {
            0.0
        } else if size > 1.0 / LARGEST {
            0.1 * size
        } else {
            1.0
        };
        let (low, high) = (low - pad, high + pad);
        let step = round_up((high - low) / 5.0);
        Self { low: (low / step + 1e-9).floor() * step, high: (high / step - 1e-9).ceil() * step, log }
    }

    /// Where a value lies: 0 at `low`, 1 at `high`.
    pub fn position(&self, value: f64) -> f64 {
        if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Round values along the axis, rising, usually no more than `at_most`.
    pub fn ticks(&self, at_most: usize) -> Vec<f64> {
        if self.high <= self.low {
            return vec![self.low];
        }
        if self.log {
            return self.log_ticks(at_most.max(2));
        }
        let step = round_up((self.high - self.low) / at_most.max(1) as f64);
        let first = (self.low / step - 1e-6).ceil() as i64;
        let last = (self.high / step + 1e-6).floor() as i64;
        (first..=last).map(|index| index as f64 * step).collect()
    }

    fn log_ticks(&self, at_most: usize) -> Vec<f64> {
        let inside = |value: &f64| *value >= self.low * (1.0 - 1e-9) && *value <= self.high * (1.0 + 1e-9);
        let (first, last) = (self.low.log10().floor() as i32, self.high.log10().ceil() as i32);
        let powers = |step: usize| (first..=last).step_by(step).map(|power| 10.0_f64.powi(power)).filter(inside);
        let fine: Vec<f64> = (first..=last)
            .flat_map(|power| [1.0, 2.0, 5.0].map(|factor| factor * 10.0_f64.powi(power)))
            .filter(inside)
            .collect();
        if fine.len() <= at_most || powers(1).count() < 2 {
            return fine;
        }
        powers(powers(1).count().div_ceil(at_most)).collect()
    }

    /// The number at a tick.
    pub fn label(&self, value: f64) -> String {
        let step = if self.log { value.abs() } else { round_up((self.high - self.low) / 10.0) };
        number(value, step)
    }
}

/// A number with as many decimals as tell it from its neighbors `step` away.
pub(super) fn number(value: f64, step: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-4..1e6).contains(&size) {
        let short = format!("{value:.2e}");
        return match short.split_once('e') {
            Some((digits, power)) => format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.')),
            None => short,
        };
    }
    let decimals = (-step.log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_round_and_hold_the_values() {
        assert_eq!(Axis::around([0.3, 4.2], false), Axis { low: 0.0, high: 5.0, log: false });
        assert_eq!(Axis::around([0.03, 420.0], true), Axis { low: 0.02, high: 500.0, log: true });
        assert_eq!(Axis::around([], false), Axis { low: 0.0, high: 1.0, log: false });
        for values in [[7.0, 7.0], [-3.0, -3.0], [0.0, 0.0], [1e99, -1e99], [1e15, 1e15 + 2.0]] {
            let axis = Axis::around(values, false);
            assert!(axis.low <= values[0].min(values[1]) && axis.high >= values[0].max(values[1]), "{axis:?}");
            assert!((2..=12).contains(&axis.ticks(6).len()), "{axis:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_sparse_over_many_decades_and_fine_over_few() {
        let wide = Axis { low: 1e-12, high: 1e12, log: true }.ticks(6);
        assert!(
            (3..=6).contains(&wide.len()) && wide.iter().all(|tick| (tick.log10().round() - tick.log10()).abs() < 1e-9)
        );
        let narrow = Axis { low: 2.0, high: 20.0, log: true };
        assert_eq!(narrow.ticks(6), [2.0, 5.0, 10.0, 20.0]);
        assert!((narrow.position(20.0_f64.sqrt() * 2.0_f64.sqrt()) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn numbers_are_short_and_exact() {
        let axis = Axis { low: 0.0, high: 0.5, log: false };
        assert_eq!(
            axis.ticks(5).iter().map(|&tick| axis.label(tick)).collect::<Vec<_>>(),
            ["0", "0.1", "0.2", "0.3", "0.4", "0.5"]
        );
        assert_eq!([1e-7, 2.5e8, 1000.0].map(|value| number(value, value)), ["1e-7", "2.5e8", "1000"]);
    }
}
