//! A GPU for tests, and comparisons that say by how much two results differ.

use glam::Vec3;

/// A device, or `None` with a line that says so; a failure if `REQUIRE_GPU` is set.
pub fn device(test: &str) -> Option<(wgpu::Device, wgpu::Queue)> {
    device_with(test, |adapter| adapter.limits())
}

/// The same with chosen limits.
pub fn device_with(
    test: &str,
    limits: impl FnOnce(&wgpu::Adapter) -> wgpu::Limits,
) -> Option<(wgpu::Device, wgpu::Queue)> {
    match pollster::block_on(crate::gpu::headless_with(limits)) {
        Ok(found) => Some(found),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some() => panic!("{test}: {error}"),
        Err(error) => {
            eprintln!("SKIPPED {test}: {error}");
            None
        }
    }
}

/// Root of the mean squared difference over the root of the mean square of `expected`.
pub fn relative_rms(found: &[Vec3], expected: &[Vec3]) -> f64 {
    assert_eq!(found.len(), expected.len());
    assert!(!expected.is_empty(), "nothing to compare");
    let square = |v: Vec3| f64::from(v.x).powi(2) + f64::from(v.y).powi(2) + f64::from(v.z).powi(2);
    let differences: f64 = found.iter().zip(expected).map(|(&a, &b)| square(a - b)).sum();
    let squares: f64 = expected.iter().map(|&v| square(v)).sum();
    assert!(squares > 0.0, "nothing but zeros to compare with");
    (differences / squares).sqrt()
}

#[test]
fn relative_rms_sees_a_difference() {
    assert_eq!(relative_rms(&[Vec3::X, Vec3::Y], &[Vec3::X, Vec3::Y]), 0.0);
    assert_eq!(relative_rms(&[Vec3::X, Vec3::ZERO], &[Vec3::X, Vec3::Y]), 0.5f64.sqrt());
    assert!(relative_rms(&[Vec3::NAN], &[Vec3::X]).is_nan());
}
