//! CPU twin of the mip chain.

use crate::coverage_map::CoverageMap;
use glam::Vec4;
use rayon::prelude::*;

/// Texels per side of every level for a map of `size`: halves, rounded up, down to 1. Empty for size 0.
pub fn level_sizes(size: u32) -> Vec<u32> {
    let mut sizes = Vec::new();
    let mut next = size;
    while next > 1 {
        sizes.push(next);
        next = next.div_ceil(2);
    }
    sizes.extend((next == 1).then_some(1));
    sizes
}

/// Fills `levels[1..]` from `levels[0]`: level l is the coverage-weighted mean of the 2 x 2 texels below.
///
/// The coverage of a texel is the mean of the four coverages below; where the level below has an odd size, the texels
/// missing at its end count as uncovered. So the coverage-weighted mean over the whole map is the same on all levels.
///
/// # Panics
/// If the sizes are not those of [`level_sizes`].
pub fn lightmap_mips(levels: &mut [CoverageMap]) {
    for upper in 1..levels.len() {
        let (below, above) = levels.split_at_mut(upper);
        halve(&below[upper - 1], &mut above[0]);
    }
}

fn halve(below: &CoverageMap, above: &mut CoverageMap) {
    assert_eq!(above.size(), below.size().div_ceil(2), "a level must be half of the level below, rounded up");
    let (size, size_below) = (above.size() as usize, below.size() as usize);
    let texels = below.texels();
    above.texels_mut().par_chunks_mut(size).enumerate().for_each(|(y, row)| {
        let first = &texels[2 * y * size_below..][..size_below];
        let second = texels.get((2 * y + 1) * size_below..).unwrap_or_default();
        let second = second.get(..size_below).unwrap_or_default();
        for (x, texel) in row.iter_mut().enumerate() {
            let at = |row: &[Vec4], x: usize| row.get(x).copied().unwrap_or(Vec4::ZERO);
            // Colors are stored times coverage: their mean is the weighted sum, divided when read.
            *texel = 0.25 * (at(first, 2 * x) + at(first, 2 * x + 1) + at(second, 2 * x) + at(second, 2 * x + 1));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use localprt_formats::directions::counter_uniform;

    fn chain(size: u32, fill: impl Fn(usize) -> Vec4) -> Vec<CoverageMap> {
        let mut levels: Vec<_> = level_sizes(size).into_iter().map(CoverageMap::uncovered).collect();
        levels[0].texels_mut().iter_mut().enumerate().for_each(|(i, texel)| *texel = fill(i));
        lightmap_mips(&mut levels);
        levels
    }

    #[test]
    fn sizes_are_halves_rounded_up() {
        assert_eq!(level_sizes(8), [8, 4, 2, 1]);
        assert_eq!(level_sizes(11), [11, 6, 3, 2, 1]);
        assert_eq!(level_sizes(1), [1]);
        assert!(level_sizes(0).is_empty());
    }

    #[test]
    fn every_level_keeps_the_coverage_weighted_mean() {
        for size in [8, 11, 13] {
            let levels = chain(size, |i| {
                let random = |k| counter_uniform(1, i as u64, k) as f32;
                if random(0) < 0.4 { Vec4::ZERO } else { Vec3::new(random(1), random(2), random(3)).extend(1.0) }
            });
            let mean = |map: &CoverageMap| {
                let sum: Vec4 = map.texels().iter().copied().sum();
                sum.truncate() / sum.w
            };
            let expected = mean(&levels[0]);
            for level in &levels {
                // Sums of at most 169 numbers up to 1 in f32, twice: 2 * 169 * 2^-24 = 2e-5.
                assert!((mean(level) - expected).abs().max_element() < 2e-5, "size {size}");
            }
            let top = levels.last().unwrap();
            assert!((top.color(0) - expected).abs().max_element() < 2e-5);
        }
    }

    #[test]
    fn uncovered_texels_never_darken() {
        let color = Vec3::new(0.3, 0.6, 0.9);
        // One covered texel in a corner of an odd map, where blocks are cut off as well.
        for level in chain(7, |i| if i == 48 { color.extend(1.0) } else { Vec4::ZERO }) {
            let last = level.texels().len() - 1;
            // Times and divided by powers of two only: exact.
            assert_eq!(level.color(last), color);
            assert!(level.texels()[..last].iter().all(|texel| *texel == Vec4::ZERO));
        }
    }

    #[test]
    fn a_level_is_the_mean_of_the_four_below() {
        let levels =
            chain(2, |i| (Vec3::splat(i as f32) * if i == 3 { 0.0 } else { 1.0 }).extend((i < 3) as u8 as f32));
        assert_eq!((levels[1].color(0), levels[1].coverage(0)), (Vec3::ONE, 0.75));
    }
}
