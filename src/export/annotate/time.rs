//! The time of a frame as text of constant width over a series.

use super::text;
use super::ticks::{factor_exponent, power_of_ten};

/// The format of the times of a series.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TimeFormat {
    /// Digits after the decimal point.
    decimals: usize,
    /// Times are shown divided by ten to this power.
    factor_exponent: i32,
    /// Text after the number: factor and unit.
    suffix: String,
    /// Width of the widest number of the series, in ems.
    number_width_em: f32,
}

/// Text before the number.
pub(super) const PREFIX: &str = "t = ";

/// Rounding may move a time by this share of the least distance of two neighbours, so that equal steps look equal. Two neighbours then
/// differ by at least 1 - 2/50 of that distance, and stay distinct.
const ROUNDING_SHARE: f64 = 1.0 / 50.0;

/// Digits that distinguish any two doubles.
const DIGITS_MAX: i32 = 17;

/// Font size in pixels at which widths are measured; they are proportional to it.
const MEASURED_AT_PX: f32 = 100.0;

impl TimeFormat {
    /// A format with enough decimals to distinguish neighbouring times. `times` increase; the unit may be unknown.
    pub(super) fn new(times: &[f64], units: Option<&str>) -> Self {
        let largest = times.iter().fold(0.0_f64, |most, t| most.max(t.abs()));
        let largest_exponent = if largest > 0.0 { largest.log10().floor() as i32 } else { 0 };
        let factor_exponent = factor_exponent(largest_exponent);
        let least_gap = times.windows(2).map(|t| t[1] - t[0]).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
        let mut suffix = String::new();
        if factor_exponent != 0 {
            suffix = format!(" × {}", power_of_ten(factor_exponent));
        }
        if let Some(units) = units.filter(|u| !u.is_empty()) {
            suffix = format!("{suffix} {units}");
        }
        let mut format = Self { decimals: 0, factor_exponent, suffix, number_width_em: 0.0 };
        // A series of one step has no gaps: its time has six digits at most.
        let tolerance = if least_gap.is_finite() { least_gap * ROUNDING_SHARE } else { largest * 1e-6 };
        let decimals_max = (DIGITS_MAX - 1 - (largest_exponent - factor_exponent)).max(0) as usize;
        let is_off = |format: &Self, t: f64| (format.read(&format.number(t)) - t).abs() > tolerance;
        while format.decimals < decimals_max && times.iter().any(|&t| is_off(&format, t)) {
            format.decimals += 1;
        }
        let width = |&t: &f64| text::width_px(&format.number(t), MEASURED_AT_PX) / MEASURED_AT_PX;
        format.number_width_em = times.iter().map(width).fold(0.0, f32::max);
        format
    }

    /// The number of a time, without factor and unit.
    pub(super) fn number(&self, time: f64) -> String {
        // Via decimal text, so that dividing by the factor does not round: 17 digits are exact.
        let text = format!("{time:.16e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let exponent = exponent.parse::<i32>().unwrap_or(0) - self.factor_exponent;
        let scaled = format!("{mantissa}e{exponent}").parse::<f64>().unwrap_or(time);
        let number = format!("{scaled:.*}", self.decimals);
        let is_zero = !number.contains(|c: char| c.is_ascii_digit() && c != '0');
        if is_zero { number.replace('-', "") } else { number.replace('-', "−") }
    }

    /// Parses a formatted number back into a time.
    fn read(&self, number: &str) -> f64 {
        format!("{}e{}", number.replace('−', "-"), self.factor_exponent).parse().unwrap_or(f64::NAN)
    }

    /// Text after the number: factor and unit.
    pub(super) fn suffix(&self) -> &str {
        &self.suffix
    }

    /// Width reserved for each number of the series, at `size_px` per em.
    pub(super) fn number_width_px(&self, size_px: f32) -> f32 {
        self.number_width_em * size_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shown(times: &[f64]) -> Vec<String> {
        let format = TimeFormat::new(times, None);
        times.iter().map(|&t| format!("{}{}", format.number(t), format.suffix())).collect()
    }

    #[test]
    fn times_have_the_decimals_that_tell_neighbours_apart() {
        assert_eq!(shown(&[0.0, 1.0, 2.0]), ["0", "1", "2"]);
        assert_eq!(shown(&[0.0, 0.25, 0.5]), ["0.00", "0.25", "0.50"]);
        assert_eq!(shown(&[0.0, 1.0 / 3.0, 2.0 / 3.0]), ["0.00", "0.33", "0.67"]);
        assert_eq!(shown(&[0.1 + 0.2, 0.4]), ["0.3", "0.4"]);
        assert_eq!(shown(&[-0.5, -0.0, 0.5]), ["−0.5", "0.0", "0.5"]);
        assert_eq!(shown(&[1.234]), ["1.234"]);
        assert_eq!(shown(&[0.0]), ["0"]);
    }

    #[test]
    fn tiny_and_huge_times_have_a_factor() {
        assert_eq!(shown(&[0.0, 1e-9, 2.5e-9]), ["0.0 × 10⁻⁹", "1.0 × 10⁻⁹", "2.5 × 10⁻⁹"]);
        assert_eq!(shown(&[1.5e13, 1.6e13]), ["15 × 10¹²", "16 × 10¹²"]);
        assert_eq!(shown(&[1e-310, 2e-310]).len(), 2);
    }

    #[test]
    fn the_unit_follows_the_number() {
        assert_eq!(TimeFormat::new(&[0.0, 1.0], Some("µs")).suffix(), " µs");
        assert_eq!(TimeFormat::new(&[0.0, 1e-6], Some("s")).suffix(), " × 10⁻⁶ s");
    }

    #[test]
    fn a_series_without_steps_has_a_format_too() {
        assert_eq!(TimeFormat::new(&[], None).number(2.0), "2");
    }

    proptest! {
        #[test]
        fn neighbouring_times_differ_and_none_is_wider_than_its_place(
            start in -1e6_f64..1e6, gaps in prop::collection::vec(1e-6_f64..10.0, 1..20), exponent in -200_i32..200,
        ) {
            let mut t = start;
            let unit = 10_f64.powi(exponent);
            let times: Vec<f64> = std::iter::once(start * unit).chain(gaps.iter().map(|gap| { t += gap; t * unit })).collect();
            let format = TimeFormat::new(&times, None);
            let numbers: Vec<String> = times.iter().map(|&t| format.number(t)).collect();
            prop_assert!(numbers.windows(2).all(|n| n[0] != n[1]), "{times:?} {numbers:?}");
            for number in &numbers {
                // Widths are sums over glyphs in f32: 2^-20 of them is more than twenty roundings.
                let width = text::width_px(number, 20.0);
                prop_assert!(width <= format.number_width_px(20.0) * (1.0 + 1e-6));
            }
        }
    }
}
