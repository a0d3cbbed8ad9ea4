//! What makes few rays a picture: a cross-bilateral filter between pixels of one surface, and a moving average over frames.
//!
//! Source: sec. 5.1. For a still view both are fixed linear filters, so their order does not matter: the average comes first, which keeps
//! what is stored sharp.

use super::settings::Filter;
use crate::Shaded;
use glam::Vec3;
use localprt_formats::directions::counter_hash;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Power of the cosine between normals: half the weight at 24 degrees.
const NORMAL_POWER: i32 = 8;
/// Steepness over the tangent plane at which a neighbor is of another surface: 1 in 5.
const PLANE_SLOPE: f32 = 5.0;

/// Averages over frames, by the points that they are of.
#[derive(Default)]
pub(super) struct Histories(Mutex<BTreeMap<u64, History>>);

struct History {
    frame: u64,
    values: Vec<Vec3>,
}

impl Histories {
    /// The average with what `trace` finds in this frame; what it was, if this frame has been asked for already.
    ///
    /// Source: sec. 5.1, exponentially weighted moving average. Points that were not asked for in the last frame start anew.
    pub(super) fn average(
        &self,
        key: u64,
        frame: u64,
        filter: &Filter,
        trace: impl FnOnce() -> Vec<Vec3>,
    ) -> Vec<Vec3> {
        let before =
            self.0.lock().expect("no panic while it is held").get(&key).map(|held| (held.frame, held.values.clone()));
        let values = match before {
            Some((of, values)) if of == frame => return values,
            Some((_, before)) => {
                before.iter().zip(trace()).map(|(before, now)| before.lerp(now, 1.0 - filter.hysteresis)).collect()
            }
            None => trace(),
        };
        let mut held = self.0.lock().expect("no panic while it is held");
        held.insert(key, History { frame, values: values.clone() });
        values
    }

    /// Forgets what has not been asked for in this frame.
    pub(super) fn keep(&mut self, frame: u64) {
        self.0.get_mut().expect("no panic while it is held").retain(|_, held| held.frame == frame);
    }

    /// Points that it holds an average of.
    pub(super) fn points(&self) -> usize {
        self.0.lock().expect("no panic while it is held").values().map(|held| held.values.len()).sum()
    }
}

/// A number for a list of points, with the views where these matter.
pub(super) fn key(kind: u64, points: &[Shaded], with_views: bool) -> u64 {
    points.iter().fold(counter_hash(kind, points.len() as u64, 0), |key, shaded| {
        let view = if with_views { shaded.to_eye } else { Vec3::ZERO };
        [shaded.point.position, shaded.point.normal, view].iter().fold(key, |key, vector| {
            let [x, y, z] = vector.to_array().map(f32::to_bits);
            counter_hash(key, u64::from(x) << 32 | u64::from(y), u64::from(z))
        })
    })
}

/// Filters the values of a picture, row by row: every pixel by those around it, weighted by distance in pixels, by the cosine between
/// normals and by how little they are off each other's plane.
pub(super) fn bilateral(points: &[Shaded], width: usize, values: &[Vec3], filter: &Filter) -> Vec<Vec3> {
    let (radius, stride) = (filter.radius as isize, filter.stride.max(1));
    // Two deviations to the edge.
    let falloff = 2.0 / (filter.radius as f32).max(1.0).powi(2);
    let height = points.len().div_ceil(width);
    let inside = |place: isize, end: usize| usize::try_from(place).ok().filter(|&place| place < end);
    (0..points.len())
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
            let taps = || (-radius / stride as isize..=radius / stride as isize).map(|tap| tap * stride as isize);
            for row in taps().filter(|row| inside(y + row, height).is_some()) {
                for column in taps().filter(|column| inside(x + column, width).is_some()) {
                    let other = (y + row) as usize * width + (x + column) as usize;
                    let Some(neighbor) = points.get(other) else { continue };
                    let near = (-falloff * (row * row + column * column) as f32).exp();
                    let weight = near * likeness(&points[pixel], neighbor);
                    sum += weight * values[other];
                    weights += weight;
                }
            }
            if weights > 0.0 { sum / weights } else { values[pixel] }
        })
        .collect()
}

/// How much two pixels are of one surface, 0 to 1.
fn likeness(a: &Shaded, b: &Shaded) -> f32 {
    let way = b.point.position - a.point.position;
    let off_plane = way.dot(a.point.normal).abs().max(way.dot(b.point.normal).abs());
    let slope = off_plane / way.length().max(f32::MIN_POSITIVE);
    a.point.normal.dot(b.point.normal).max(0.0).powi(NORMAL_POWER) * (1.0 - PLANE_SLOPE * slope).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use localprt_scenes::SurfacePoint;

    const FILTER: Filter = Filter { radius: 12, stride: 2, hysteresis: 0.98 };

    /// A picture of 32 x 8 pixels, a centimetre apart, by what is seen left and right of its middle.
    fn picture(right: impl Fn(Vec3) -> (Vec3, Vec3)) -> Vec<Shaded> {
        (0..32 * 8)
            .map(|pixel| {
                let place = Vec3::new((pixel % 32) as f32, 0.0, (pixel / 32) as f32) * 0.01;
                let (position, normal) = if pixel % 32 < 16 { (place, Vec3::Y) } else { right(place) };
                Shaded::from_above(SurfacePoint { position, normal, geometric_normal: normal })
            })
            .collect()
    }

    fn halves() -> Vec<Vec3> {
        (0..32 * 8).map(|pixel| Vec3::splat(f32::from(pixel % 32 < 16))).collect()
    }

    #[test]
    fn edges_of_surfaces_stop_the_filter() {
        let values = halves();
        // A wall that stands up, and the same floor half a metre lower: nothing crosses.
        let wall = picture(|place| (Vec3::new(0.16, place.x - 0.16, place.z), Vec3::NEG_X));
        let step = picture(|place| (place - 0.5 * Vec3::Y, Vec3::Y));
        // And what lies in one plane, but is turned away.
        let turned = picture(|place| (place, Vec3::Z));
        for points in [wall, step, turned] {
            for (filtered, value) in bilateral(&points, 32, &values, &FILTER).iter().zip(&values) {
                // A mean of equal values: roundings of 85 summands.
                assert!(filtered.distance(*value) < 1e-5);
            }
        }
        // One floor: at the middle half of the light comes from the other side.
        let floor = picture(|place| (place, Vec3::Y));
        let filtered = bilateral(&floor, 32, &values, &FILTER);
        assert!((0.4..0.6).contains(&filtered[15].x) && filtered[0].x > 0.99, "{} {}", filtered[15], filtered[0]);
    }

    #[test]
    fn noise_of_a_plane_goes_down_by_the_taps() {
        let floor = picture(|place| (place, Vec3::Y));
        let values: Vec<Vec3> = (0..floor.len())
            .map(|pixel| Vec3::splat(localprt_formats::directions::counter_uniform(1, pixel as u64, 0) as f32))
            .collect();
        let variance = |values: &[Vec3]| {
            let mean = values.iter().map(|value| value.x).sum::<f32>() / values.len() as f32;
            values.iter().map(|value| (value.x - mean).powi(2)).sum::<f32>() / values.len() as f32
        };
        // Up to 13 x 4 taps of uneven weight: about 20 of them count. Without the filter the ratio is 1.
        assert!(variance(&bilateral(&floor, 32, &values, &FILTER)) < variance(&values) / 8.0);
    }

    #[test]
    fn frames_are_averaged_as_long_as_they_are_asked_for() {
        let mut histories = Histories::default();
        let ask = |histories: &Histories, frame, value: f32| {
            histories.average(1, frame, &FILTER, || vec![Vec3::splat(value)])[0].x
        };
        assert_eq!(ask(&histories, 1, 2.0), 2.0);
        // The same frame again: as it was.
        assert_eq!(ask(&histories, 1, 7.0), 2.0);
        histories.keep(1);
        let second = ask(&histories, 2, 4.0);
        assert!((second - (0.98 * 2.0 + 0.02 * 4.0)).abs() < 1e-6, "{second}");
        // A frame that did not ask: begun anew.
        histories.keep(3);
        assert_eq!(histories.points(), 0);
        assert_eq!(ask(&histories, 4, 5.0), 5.0);
    }
}
