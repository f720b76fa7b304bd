//! The transfer curve of sRGB (IEC 61966-2-1), continued beyond 0..=1: above 1 by the same power, below 0 as an odd function, as in scRGB
//! (IEC 61966-2-2).

/// The display-referred value below which the curve is linear.
const LINE_END_SRGB: f64 = 0.04045;
/// End of the linear segment in linear light. The published curve has a gap here (a line that ends at 0.0031308050 and a power that starts
/// at 0.0031308072); a bound inside the gap makes each value return by the segment that it came by.
const LINE_END_LINEAR: f64 = 0.003_130_806;

/// Linear light of a display-referred value.
pub(super) fn linear_from_srgb(c: f64) -> f64 {
    let size = c.abs();
    (if size <= LINE_END_SRGB { size / 12.92 } else { ((size + 0.055) / 1.055).powf(2.4) }).copysign(c)
}

/// The display-referred value of linear light: the inverse of [`linear_from_srgb`].
pub(super) fn srgb_from_linear(l: f64) -> f64 {
    let size = l.abs();
    (if size <= LINE_END_LINEAR { size * 12.92 } else { 1.055 * size.powf(1.0 / 2.4) - 0.055 }).copysign(l)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_values_are_met() {
        // sRGB 0.5 is 0.21404 of linear light, but for a few roundings of numbers below 1 (2^-54 each); both ends stay, the curve goes on above and is odd.
        assert!((linear_from_srgb(0.5) - 0.214_041_140_482_232_55).abs() < 1e-15);
        assert_eq!((linear_from_srgb(0.0), linear_from_srgb(1.0)), (0.0, 1.0));
        assert_eq!(linear_from_srgb(-0.5), -linear_from_srgb(0.5));
        assert!(linear_from_srgb(2.0) > 4.0);
    }

    #[test]
    fn every_value_comes_back_also_at_the_joint() {
        let joint = (-50..50).map(|i| LINE_END_SRGB * (1.0 + f64::from(i) * 1e-9));
        let wide = (-40..40).map(|i| 1.7_f64.powi(i));
        for c in joint.chain(wide).flat_map(|c| [c, -c]) {
            let back = srgb_from_linear(linear_from_srgb(c));
            // A few roundings of f64, of which subtracting 0.055 makes the first ones up to 2.4 times larger.
            assert!((back - c).abs() <= 16.0 * f64::EPSILON * c.abs(), "{c} {back}");
            let brighter = srgb_from_linear(linear_from_srgb(c) * (1.0 + 1e-13));
            assert!((brighter - c).abs() > 16.0 * f64::EPSILON * c.abs(), "light off by 1e-13: {c} {brighter}");
        }
    }
}
