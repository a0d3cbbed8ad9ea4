//! Triangles by corner weights.

/// Middles of the `steps²` equal triangles that a triangle falls into, as corner weights.
pub fn subdivision(steps: u32) -> impl Iterator<Item = [f32; 3]> {
    let at = move |u: f32, v: f32| [u / steps as f32, v / steps as f32, 1.0 - (u + v) / steps as f32];
    (0..steps).flat_map(move |row| {
        (0..steps - row).flat_map(move |column| {
            let (u, v) = (row as f32, column as f32);
            let upright = at(u + 1.0 / 3.0, v + 1.0 / 3.0);
            let turned = (column + row + 1 < steps).then(|| at(u + 2.0 / 3.0, v + 2.0 / 3.0));
            [Some(upright), turned].into_iter().flatten()
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_falls_into_equal_triangles_that_cover_it() {
        for steps in 1..6 {
            let middles: Vec<[f32; 3]> = subdivision(steps).collect();
            assert_eq!(middles.len() as u32, steps * steps);
            for corner in 0..3 {
                let mean = middles.iter().map(|weights| weights[corner]).sum::<f32>() / middles.len() as f32;
                assert!((mean - 1.0 / 3.0).abs() < 1e-6);
            }
            assert!(middles.iter().flatten().all(|&weight| weight > 0.0));
        }
    }
}
