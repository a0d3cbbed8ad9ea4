//! Steps of light between receivers that lie side by side: what compression adds at cluster borders and at chart seams.

use super::selection::Pairs;
use serde::Serialize;

/// Steps across one kind of border, as shares of the mean luminance over all measured receivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Step {
    /// Pairs measured.
    pub pairs: usize,
    /// `sqrt(mean(step^2)) / mean` of the compressed light.
    pub compressed: f64,
    /// The same of the uncompressed light: what is there in any case.
    pub uncompressed: f64,
    /// The same of the paper's rows, uncompressed: what fitted rows are to be held against.
    pub paper: f64,
    /// `sqrt(mean((step - uncompressed step)^2)) / mean`: what compression changes of it.
    pub added: f64,
}

/// Steps by kind of border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Steps {
    /// Across chart seams, at the same place on both sides.
    pub charts: Step,
    /// Between neighbors of different clusters.
    pub clusters: Step,
    /// Between neighbors of one cluster, to compare with.
    pub within: Step,
}

impl Steps {
    /// Luminances by receiver in file order: `compressed` of all, `uncompressed` and `paper` of those in the pairs; `mean` is
    /// that of the reference.
    pub fn of(
        pairs: &Pairs,
        compressed: impl Fn(u32) -> f64,
        uncompressed: impl Fn(u32) -> f64,
        paper: impl Fn(u32) -> f64,
        mean: f64,
    ) -> Self {
        let step = |pairs: &[[u32; 2]]| {
            let n = pairs.len().max(1) as f64;
            // The sum of nothing is -0.0, which reads badly.
            let root =
                |square: &dyn Fn(&[u32; 2]) -> f64| (pairs.iter().map(square).sum::<f64>() / n).sqrt() / mean + 0.0;
            let of = |value: &dyn Fn(u32) -> f64, pair: &[u32; 2]| value(pair[1]) - value(pair[0]);
            Step {
                pairs: pairs.len(),
                compressed: root(&|pair| of(&compressed, pair).powi(2)),
                uncompressed: root(&|pair| of(&uncompressed, pair).powi(2)),
                paper: root(&|pair| of(&paper, pair).powi(2)),
                added: root(&|pair| (of(&compressed, pair) - of(&uncompressed, pair)).powi(2)),
            }
        };
        Self { charts: step(&pairs.charts), clusters: step(&pairs.clusters), within: step(&pairs.within) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_told_from_what_is_there_anyway() {
        let pairs = Pairs { charts: vec![[0, 1]], clusters: vec![[1, 2], [3, 2]], within: vec![] };
        let compressed = [1.0, 1.0, 5.0, 2.0];
        let uncompressed = [1.0, 2.0, 4.0, 1.0];
        let paper = [3.0, 2.0, 2.0, 0.0];
        let steps =
            Steps::of(&pairs, |i| compressed[i as usize], |i| uncompressed[i as usize], |i| paper[i as usize], 2.0);
        assert_eq!(steps.charts, Step { pairs: 1, compressed: 0.0, uncompressed: 0.5, paper: 0.5, added: 0.5 });
        // Compressed steps 4 and 3, uncompressed 2 and 3, the paper's 0 and 2.
        let expected = Step {
            pairs: 2,
            compressed: 12.5f64.sqrt() / 2.0,
            uncompressed: 6.5f64.sqrt() / 2.0,
            paper: 2.0f64.sqrt() / 2.0,
            added: 2.0f64.sqrt() / 2.0,
        };
        assert_eq!(steps.clusters, expected);
        assert_eq!(steps.within, Step::default());
    }
}
