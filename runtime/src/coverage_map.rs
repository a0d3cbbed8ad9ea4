//! Square maps over the lightmap layout in which only some texels hold a value, and the one way to read them.

use glam::{Vec2, Vec3, Vec4};

/// A square RGB map whose texels know how much of them is covered by surface.
///
/// Texel `y * size + x` holds `(r c, g c, b c, c)` with coverage c in 0..=1, so means and bilinear reads weighted by
/// coverage are plain sums followed by one division, and an uncovered texel can never darken a covered one.
/// Row 0 is at v = 0; texel centers are at `(x + 0.5, y + 0.5) / size`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoverageMap {
    size: u32,
    texels: Vec<Vec4>,
}

impl CoverageMap {
    /// A map of `size * size` uncovered texels.
    pub fn uncovered(size: u32) -> Self {
        Self { size, texels: vec![Vec4::ZERO; size as usize * size as usize] }
    }

    /// Texels per side.
    pub fn size(&self) -> u32 {
        self.size
    }

    /// `[size * size]` color times coverage, coverage.
    pub fn texels(&self) -> &[Vec4] {
        &self.texels
    }

    /// Color of a texel; zero where nothing covers it or outside of the map.
    pub fn color(&self, texel: usize) -> Vec3 {
        self.texels.get(texel).and_then(|&sum| divide_by_coverage(sum)).unwrap_or(Vec3::ZERO)
    }

    /// Covered share of a texel, 0..=1; zero outside of the map.
    pub fn coverage(&self, texel: usize) -> f32 {
        self.texels.get(texel).map_or(0.0, |texel| texel.w)
    }

    /// Bilinear read at `uv` in 0..=1, taps weighted by coverage and clamped at the border.
    ///
    /// `None` if all taps with weight are uncovered.
    pub fn sample(&self, uv: Vec2) -> Option<Vec3> {
        if self.size == 0 {
            return None;
        }
        let last = self.size as usize - 1;
        let position = (uv * self.size as f32 - 0.5).max(Vec2::ZERO);
        // `as` saturates, so that no uv reads outside; clamping the lower index needs no care of the fraction, as both
        // taps then fall on the border texel.
        let x = (position.x as usize).min(last);
        let y = (position.y as usize).min(last);
        let fraction = (position - Vec2::new(x as f32, y as f32)).clamp(Vec2::ZERO, Vec2::ONE);
        let size = self.size as usize;
        let (row, next_row) = (y * size, (y + 1).min(last) * size);
        let next = (x + 1).min(last);
        let top = self.texels[row + x] * (1.0 - fraction.x) + self.texels[row + next] * fraction.x;
        let bottom = self.texels[next_row + x] * (1.0 - fraction.x) + self.texels[next_row + next] * fraction.x;
        divide_by_coverage(top * (1.0 - fraction.y) + bottom * fraction.y)
    }

    pub(crate) fn texels_mut(&mut self) -> &mut [Vec4] {
        &mut self.texels
    }
}

fn divide_by_coverage(sum: Vec4) -> Option<Vec3> {
    (sum.w > 0.0).then(|| sum.truncate() / sum.w)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 x 3, texel i holds (i, 2 i, 3 i) except for an uncovered one in the middle.
    fn map() -> CoverageMap {
        let mut map = CoverageMap::uncovered(3);
        for (i, texel) in map.texels_mut().iter_mut().enumerate() {
            if i != 4 {
                *texel = (i as f32 * Vec3::new(1.0, 2.0, 3.0)).extend(1.0);
            }
        }
        map
    }

    #[test]
    fn centers_read_their_own_texel() {
        let map = map();
        for i in 0..9 {
            let uv = Vec2::new((i % 3) as f32 + 0.5, (i / 3) as f32 + 0.5) / 3.0;
            // uv * 3 - 0.5 is off by up to 3 ulp of 2.5 = 7.2e-7; a neighbor differs by up to 3 * 3.
            let expected = i as f32 * Vec3::new(1.0, 2.0, 3.0);
            match map.sample(uv) {
                Some(found) if i != 4 => assert!((found - expected).abs().max_element() < 1e-5, "{i}: {found}"),
                // Rounding may give a covered neighbor a weight of 1e-7; then its value counts alone.
                Some(_) => assert_eq!(i, 4),
                None => assert_eq!(i, 4),
            }
        }
    }

    #[test]
    fn between_centers_reads_blend_linearly() {
        let found = map().sample(Vec2::new(1.25 / 3.0, 0.5 / 3.0)).unwrap();
        assert!((found - 0.75 * Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5, "{found}");
    }

    #[test]
    fn uncovered_taps_do_not_darken() {
        let mut map = CoverageMap::uncovered(2);
        map.texels_mut()[0] = Vec4::new(4.0, 5.0, 6.0, 1.0);
        let found = map.sample(Vec2::splat(0.7)).unwrap();
        assert!((found - Vec3::new(4.0, 5.0, 6.0)).abs().max_element() < 1e-5);
        assert_eq!(map.sample(Vec2::ONE), None);
    }

    #[test]
    fn reads_clamp_at_the_border() {
        let map = map();
        for (uv, texel) in [((0.0, 0.0), 0), ((1.0, 0.0), 2), ((0.0, 1.0), 6), ((1.0, 1.0), 8), ((9.0, -9.0), 2)] {
            assert_eq!(map.sample(Vec2::new(uv.0, uv.1)).unwrap(), map.color(texel), "{uv:?}");
        }
        assert!(map.sample(Vec2::NAN).is_some());
        assert_eq!(CoverageMap::default().sample(Vec2::ZERO), None);
    }
}
