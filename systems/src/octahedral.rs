//! Maps over all directions: a square of texels by the octahedral mapping, with a border of one texel that repeats what lies across the
//! edge, so that bilinear reads need no seams.
//!
//! Source: Cigolle et al. 2014, A Survey of Efficient Representations for Independent Unit Vectors.

use glam::{Vec2, Vec3};

/// Place of a unit direction in the square of -1 to 1.
pub fn encode(dir: Vec3) -> Vec2 {
    let flat = dir.truncate() / (dir.x.abs() + dir.y.abs() + dir.z.abs());
    if dir.z >= 0.0 { flat } else { fold(flat) }
}

/// Unit direction of a place in the square of -1 to 1.
pub fn decode(place: Vec2) -> Vec3 {
    let z = 1.0 - place.x.abs() - place.y.abs();
    let flat = if z >= 0.0 { place } else { fold(place) };
    flat.extend(z).normalize()
}

fn fold(flat: Vec2) -> Vec2 {
    (1.0 - Vec2::new(flat.y, flat.x).abs()) * Vec2::new(1f32.copysign(flat.x), 1f32.copysign(flat.y))
}

/// Layout of one map: `side` x `side` texels within a border of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OctahedralMap {
    /// Texels per side, without the border.
    pub side: usize,
}

impl OctahedralMap {
    /// Texels with the border.
    pub fn texels(self) -> usize {
        self.width() * self.width()
    }

    /// Texels per side with the border.
    pub fn width(self) -> usize {
        self.side + 2
    }

    /// Unit direction of the middle of a texel, counted without the border.
    pub fn dir(self, x: usize, y: usize) -> Vec3 {
        let place = (Vec2::new(x as f32, y as f32) + 0.5) / self.side as f32;
        decode(2.0 * place - 1.0)
    }

    /// Number, in the map with its border, of a texel counted without it.
    pub fn index(self, x: usize, y: usize) -> usize {
        (y + 1) * self.width() + x + 1
    }

    /// Number of the texel that holds a direction, in the map with its border.
    pub fn nearest(self, dir: Vec3) -> usize {
        let place = (encode(dir) + 1.0) * 0.5 * self.side as f32;
        let last = self.side - 1;
        self.index((place.x.max(0.0) as usize).min(last), (place.y.max(0.0) as usize).min(last))
    }

    /// The four texels of a bilinear read, in the map with its border, and their weights.
    pub fn bilinear(self, dir: Vec3) -> [(usize, f32); 4] {
        // Half a texel back to texel middles, a texel on for the border.
        let place = (encode(dir) + 1.0) * 0.5 * self.side as f32 + 0.5;
        let low = place.floor().clamp(Vec2::ZERO, Vec2::splat(self.side as f32));
        let (along, low) = ((place - low).clamp(Vec2::ZERO, Vec2::ONE), [low.x as usize, low.y as usize]);
        let at = |x: usize, y: usize| (low[1] + y) * self.width() + low[0] + x;
        [
            (at(0, 0), (1.0 - along.x) * (1.0 - along.y)),
            (at(1, 0), along.x * (1.0 - along.y)),
            (at(0, 1), (1.0 - along.x) * along.y),
            (at(1, 1), along.x * along.y),
        ]
    }

    /// Fills the border of a map from its texels: an edge is its own neighbor, the other way around, and corners lie across.
    ///
    /// # Panics
    /// If the map does not have [`OctahedralMap::texels`].
    pub fn copy_border<T: Copy>(self, map: &mut [T]) {
        assert_eq!(map.len(), self.texels());
        let (side, width) = (self.side, self.width());
        for along in 1..=side {
            let across = side + 1 - along;
            map[along] = map[width + across];
            map[(width - 1) * width + along] = map[side * width + across];
            map[along * width] = map[across * width + 1];
            map[along * width + width - 1] = map[across * width + side];
        }
        let at = |x: usize, y: usize| y * width + x;
        map[at(0, 0)] = map[at(side, side)];
        map[at(width - 1, 0)] = map[at(1, side)];
        map[at(0, width - 1)] = map[at(side, 1)];
        map[at(width - 1, width - 1)] = map[at(1, 1)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_formats::directions::spherical_fibonacci;

    fn directions(n: u32) -> impl Iterator<Item = Vec3> {
        (0..n).map(move |i| Vec3::from(spherical_fibonacci(i, n)))
    }

    #[test]
    fn directions_come_back_from_the_square() {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
        for dir in directions(4000).chain(axes) {
            let place = encode(dir);
            assert!(place.abs().max_element() <= 1.0, "{dir} {place}");
            // A few roundings of coordinates up to 1.
            assert!(decode(place).distance(dir) < 1e-6, "{dir} {place}");
        }
    }

    #[test]
    fn a_texel_holds_its_own_direction_and_a_read_at_its_middle_is_its_value() {
        for side in [1, 8, 16] {
            let map = OctahedralMap { side };
            for y in 0..side {
                for x in 0..side {
                    let dir = map.dir(x, y);
                    assert_eq!(map.nearest(dir), map.index(x, y));
                    let own: f32 =
                        map.bilinear(dir).iter().filter(|(texel, _)| *texel == map.index(x, y)).map(|t| t.1).sum();
                    assert!(own > 1.0 - 1e-4, "{side} {x} {y}: {own}");
                }
            }
        }
    }

    #[test]
    fn reads_go_on_over_the_edges() {
        // A function that is linear in the direction is read closely everywhere; with a border that was wrong it would jump.
        let map = OctahedralMap { side: 16 };
        let axis = Vec3::new(0.3, -0.8, 0.52).normalize();
        let mut values = vec![f32::NAN; map.texels()];
        for y in 0..16 {
            for x in 0..16 {
                values[map.index(x, y)] = map.dir(x, y).dot(axis);
            }
        }
        map.copy_border(&mut values);
        for dir in directions(5000) {
            let read: f32 = map.bilinear(dir).iter().map(|&(texel, weight)| values[texel] * weight).sum();
            // Where the mapping has its creases a slope of up to 2 changes its sign within a cell of 1/8: 1/16 at most.
            assert!((read - dir.dot(axis)).abs() < 1.0 / 16.0, "{dir}: {read} {}", dir.dot(axis));
        }
    }
}
