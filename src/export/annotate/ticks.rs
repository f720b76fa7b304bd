//! Ticks of a colour bar, and their labels.
//!
//! A tick of a linear range is an integer n times 10^e, with the same e for all; labels are made from the integers, so that
//! they are exact however large or small the scalars. The step is 1, 2 or 5 times a power of ten, the one whose number of
//! ticks is nearest to five. Of the steps whose number is at most eight, the smallest has at least three ticks: the step
//! below it is at least 2/5 of it and has nine ticks or more, so the range is at least 8 of that and 3.2 of this wide.

use crate::transfer::MappedRange;

/// A labelled scalar on the colour bar.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    /// A scalar within the range.
    pub(crate) scalar: f64,
    /// The number drawn, to be multiplied by the factor of [`Ticks`].
    pub(crate) label: String,
}

/// The ticks of a range.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ticks {
    /// Ticks with strictly increasing scalars.
    pub(crate) ticks: Vec<Tick>,
    /// Exponent of the power of ten by which all labels are multiplied: 0, or a multiple of three.
    pub(super) factor_exponent: i32,
}

impl Ticks {
    /// Text of the factor of all labels; empty if it is one.
    pub(crate) fn factor(&self) -> String {
        if self.factor_exponent == 0 { String::new() } else { format!("× {}", power_of_ten(self.factor_exponent)) }
    }
}

/// Fewest and most ticks.
const COUNT: std::ops::RangeInclusive<usize> = 3..=8;

/// Number of ticks aimed at.
const COUNT_AIM: usize = 5;

/// Largest number of steps between zero and an end of the range. Beyond it labels would be too long to read, and soon exceed the digits of
/// a double.
const STEPS_MAX: f64 = 1e12;

/// Labels are plain numbers if the largest is from 10^-2 to below 10^5; otherwise a factor is taken out.
const PLAIN_EXPONENTS: std::ops::RangeInclusive<i32> = -2..=4;

/// The ticks of a range: 3 to 8, or its two ends if it is too narrow for its distance from zero.
///
/// Log-spaced ranges get powers of ten (every second, third... of them if they are many), those with fewer than three of
/// them 1, 2 and 5 times powers of ten, and those with fewer than three of these the ticks of a linear range.
pub(crate) fn ticks(range: &MappedRange) -> Ticks {
    let powers = if range.is_log() { log_ticks(range) } else { None };
    powers.or_else(|| linear_ticks(range)).unwrap_or_else(|| {
        let end = |scalar: f64| Tick { scalar, label: format!("{scalar:e}").replace('-', "−") };
        Ticks { ticks: vec![end(range.lo()), end(range.hi())], factor_exponent: 0 }
    })
}

/// The double nearest to n times 10^e.
fn decimal(n: i64, exponent: i32) -> f64 {
    format!("{n}e{exponent}").parse().unwrap_or(f64::NAN)
}

/// The integers n for which n times 10^e is in the range and a multiple of the step m times 10^e.
fn multiples(range: &MappedRange, m: i64, exponent: i32) -> Option<Vec<i64>> {
    let step = decimal(m, exponent);
    let (first, last) = (range.lo() / step, range.hi() / step);
    if !(first.abs() < STEPS_MAX && last.abs() < STEPS_MAX && last - first < 100.0) {
        return None;
    }
    let inside = |&n: &i64| (range.lo()..=range.hi()).contains(&decimal(n, exponent));
    // The quotients are rounded; the ticks themselves decide which multiples are inside.
    Some((first.ceil() as i64 - 1..=last.floor() as i64 + 1).map(|k| k * m).filter(inside).collect())
}

fn linear_ticks(range: &MappedRange) -> Option<Ticks> {
    let magnitude = (range.hi() - range.lo()).log10().floor() as i32;
    let steps = (magnitude - 1..=magnitude).flat_map(|e| [1, 2, 5].map(|m| (m, e)));
    let counted = steps.filter_map(|(m, e)| Some((multiples(range, m, e)?, e)));
    let (integers, exponent) = counted
        .filter(|(n, _)| COUNT.contains(&n.len()) && n.windows(2).all(|n| decimal(n[0], 0) < decimal(n[1], 0)))
        .min_by_key(|(n, _)| n.len().abs_diff(COUNT_AIM))?;
    let largest = integers.iter().map(|n| n.unsigned_abs()).max()?;
    let largest_exponent = exponent + largest.checked_ilog10().unwrap_or(0) as i32;
    let factor_exponent = factor_exponent(largest_exponent);
    let tick = |&n: &i64| Tick { scalar: decimal(n, exponent), label: fixed_point(n, exponent - factor_exponent) };
    let ticks: Vec<Tick> = integers.iter().map(tick).collect();
    // Deep among the subnormal numbers neighbouring multiples may be one double.
    ticks.windows(2).all(|t| t[0].scalar < t[1].scalar).then_some(Ticks { ticks, factor_exponent })
}

/// Exponent of the factor to take out of numbers whose largest has this exponent.
pub(super) fn factor_exponent(largest_exponent: i32) -> i32 {
    if PLAIN_EXPONENTS.contains(&largest_exponent) { 0 } else { largest_exponent.div_euclid(3) * 3 }
}

/// Decimal digits of n times 10^e.
fn fixed_point(n: i64, exponent: i32) -> String {
    let sign = if n < 0 { "−" } else { "" };
    let digits = n.unsigned_abs().to_string();
    let Ok(zeros) = usize::try_from(exponent) else {
        let decimals = exponent.unsigned_abs() as usize;
        let digits = format!("{digits:0>width$}", width = decimals + 1);
        let (whole, fraction) = digits.split_at(digits.len() - decimals);
        return format!("{sign}{whole}.{fraction}");
    };
    let zeros = if n == 0 { 0 } else { zeros };
    format!("{sign}{digits}{}", "0".repeat(zeros))
}

fn log_ticks(range: &MappedRange) -> Option<Ticks> {
    let (lowest, highest) = (range.lo().log10().floor() as i32, range.hi().log10().ceil() as i32);
    let inside = |m: i64, e: i32| (range.lo()..=range.hi()).contains(&decimal(m, e));
    let powers: Vec<(i64, i32)> = (lowest..=highest).filter(|&e| inside(1, e)).map(|e| (1, e)).collect();
    let chosen = if powers.len() >= *COUNT.start() {
        (1..)
            .map(|stride| -> Vec<(i64, i32)> { powers.iter().copied().filter(|(_, e)| e % stride == 0).collect() })
            .find(|every| every.len() <= *COUNT.end())?
    } else {
        let all = (lowest..=highest).flat_map(|e| [1, 2, 5].map(|m| (m, e)));
        all.filter(|&(m, e)| inside(m, e)).collect()
    };
    let is_plain = chosen.iter().all(|(_, e)| (-3..=4).contains(e));
    let label = |m, e| match (is_plain, m) {
        (true, _) => fixed_point(m, e),
        (false, 1) => power_of_ten(e),
        (false, _) => format!("{m}×{}", power_of_ten(e)),
    };
    let tick = |&(m, e): &(i64, i32)| Tick { scalar: decimal(m, e), label: label(m, e) };
    let ticks: Vec<Tick> = chosen.iter().map(tick).collect();
    let is_good = COUNT.contains(&ticks.len()) && ticks.windows(2).all(|t| t[0].scalar < t[1].scalar);
    is_good.then_some(Ticks { ticks, factor_exponent: 0 })
}

/// 10 with an exponent in superscript digits.
pub(super) fn power_of_ten(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => digit.to_digit(10).and_then(|d| char::from_u32('⁰' as u32 + d)).unwrap_or(digit),
    };
    format!("10{}", exponent.to_string().chars().map(raised).collect::<String>())
}

#[cfg(test)]
#[path = "ticks_tests.rs"]
mod tests;
