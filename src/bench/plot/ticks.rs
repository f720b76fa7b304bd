//! Ticks of logarithmic axes.

/// Maximum number of labels of an axis.
const MOST: i32 = 12;

/// Up to this number of decades, ticks include 2 and 5.
const FEW: i32 = 3;

/// Powers of ten in `lo..=hi` (both positive), all or every n-th; over few decades their two- and fivefold as well.
pub(super) fn log_ticks(lo: f64, hi: f64) -> Vec<f64> {
    let (first, last) = (exponent(lo, f64::floor), exponent(hi, f64::ceil));
    let every = ((last - first) / MOST + 1) as usize;
    let steps: &[f64] = if last - first <= FEW { &[1.0, 2.0, 5.0] } else { &[1.0] };
    // Round ends may be off by rounding.
    let is_inside = |tick: &f64| (lo * (1.0 - 1e-9)..=hi * (1.0 + 1e-9)).contains(tick);
    let powers = (first..=last).step_by(every);
    powers.flat_map(|e| steps.iter().map(move |step| step * power_of_ten(e))).filter(is_inside).collect()
}

/// The nearest power of ten below (with `floor`) or above (`ceil`).
pub(super) fn exponent(value: f64, round: fn(f64) -> f64) -> i32 {
    let log = value.log10();
    // The logarithm of a power of ten may be off a whole number by rounding.
    if (log - log.round()).abs() < 1e-9 { log.round() as i32 } else { round(log) as i32 }
}

/// A power of ten, rounded once, as written by `1e-7`.
pub(super) fn power_of_ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The shortest distinct form of a number.
pub(super) fn label(value: f64) -> String {
    if (1e-3..1e5).contains(&value) || value == 0.0 { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_decades_or_ones_twos_and_fives() {
        assert_eq!(log_ticks(1e-7, 1e-2), [1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2]);
        assert_eq!(log_ticks(3.0, 700.0), [5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0]);
        assert_eq!(log_ticks(1.0, 10.0), [1.0, 2.0, 5.0, 10.0]);
    }

    #[test]
    fn there_are_never_more_ticks_than_can_be_read_and_all_lie_inside() {
        for (lo, hi) in [(1e-12, 1e3), (1e-300, 1e300), (0.03, 0.04), (9.9, 10.1), (1e-9, 1e-8)] {
            let ticks = log_ticks(lo, hi);
            assert!(ticks.len() <= MOST as usize + 1, "{ticks:?}");
            assert!(ticks.iter().all(|t| (lo * 0.999..=hi * 1.001).contains(t)), "{ticks:?}");
            assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]), "{ticks:?}");
        }
        assert_eq!(log_ticks(9.9, 10.1), [10.0]);
    }

    #[test]
    fn labels_are_short() {
        assert_eq!([1e-7, 0.001, 20.0, 1e5, 0.0].map(label), ["1e-7", "0.001", "20", "1e5", "0"]);
        assert_eq!((exponent(1000.0, f64::floor), exponent(1e-5, f64::ceil), exponent(2e-5, f64::floor)), (3, -5, -5));
        assert_eq!([power_of_ten(-7), power_of_ten(3)], [1e-7, 1e3]);
    }
}
