//! A choice between many things by their weights.

/// Probabilities in proportion to weights, as running sums.
#[derive(Default)]
pub struct Distribution {
    /// Ending at 1; empty where there is nothing to choose.
    rising: Vec<f64>,
}

impl Distribution {
    /// Weights that are not above 0 are never chosen. Nothing can be chosen where all are like that.
    pub fn of(weights: impl Iterator<Item = f64>) -> Self {
        let mut total = 0.0;
        let mut rising: Vec<f64> = weights
            .map(|weight| {
                total += weight.max(0.0);
                total
            })
            .collect();
        if total > 0.0 {
            rising.iter_mut().for_each(|end| *end /= total);
        } else {
            rising.clear();
        }
        Self { rising }
    }

    /// True where nothing can be chosen.
    pub fn is_empty(&self) -> bool {
        self.rising.is_empty()
    }

    /// The choice that a number in `[0, 1)` stands for. Not to be asked of an empty one.
    pub fn choose(&self, uniform: f64) -> usize {
        self.rising.partition_point(|&end| end <= uniform).min(self.rising.len() - 1)
    }

    /// Probability of a choice; 0 in an empty one.
    pub fn probability(&self, index: usize) -> f64 {
        match self.rising.get(index) {
            Some(end) => end - if index > 0 { self.rising[index - 1] } else { 0.0 },
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_follow_their_weights() {
        let some = Distribution::of([0.0, 1.0, -5.0, 3.0, 0.0].into_iter());
        let shares: Vec<f64> = (0..5).map(|index| some.probability(index)).collect();
        assert_eq!(shares, [0.0, 0.25, 0.0, 0.75, 0.0]);
        assert_eq!([0.0, 0.2499, 0.25, 0.9999].map(|uniform| some.choose(uniform)), [1, 1, 3, 3]);
        let none = Distribution::of([0.0, 0.0].into_iter());
        assert!(none.is_empty() && none.probability(0) == 0.0);
    }
}
