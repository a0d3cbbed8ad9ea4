//! Weight kernel of a radiance probe.

/// Weight kernel: 1 at the probe, 0 at the support radius, flat at both ends.
///
/// `t` is distance over support radius, unitless and not negative.
///
/// Source: Eq. (10).
pub fn weight_kernel(t: f32) -> f32 {
    if t >= 1.0 {
        return 0.0;
    }
    t * t * (2.0 * t - 3.0) + 1.0
}

#[cfg(test)]
mod tests {
    use super::weight_kernel;

    #[test]
    fn one_at_the_probe_half_in_the_middle_zero_outside() {
        assert_eq!(weight_kernel(0.0), 1.0);
        assert_eq!(weight_kernel(0.5), 0.5);
        assert_eq!(weight_kernel(1.0), 0.0);
        assert_eq!(weight_kernel(7.0), 0.0);
        // Flat at both ends: the slope 6t(t - 1) is 0 there; a step of 1e-3 changes w by at most 3e-6.
        assert!(1.0 - weight_kernel(1e-3) <= 3.1e-6);
        assert!(weight_kernel(1.0 - 1e-3) <= 3.1e-6);
    }
}
