use super::*;
use proptest::prelude::*;

/// The number that a label stands for, parsed independently, as digits for `parse`.
fn read(label: &str, factor_exponent: i32) -> (f64, f64) {
    let plain = |c: char| match c {
        '−' | '⁻' => '-',
        '⁰' => '0',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴'..='⁹' => char::from(b'4' + (c as u32 - '⁴' as u32) as u8),
        c => c,
    };
    let is_raised = |c: char| "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".contains(c);
    let (mantissa, exponent) = match label.find(is_raised) {
        Some(at) => {
            let head = label[..at].strip_suffix("10").unwrap();
            let head = head.strip_suffix('×').unwrap_or(if head.is_empty() { "1" } else { head });
            (head.to_owned(), label[at..].chars().map(plain).collect::<String>().parse::<i32>().unwrap())
        }
        None => (label.chars().map(plain).collect(), 0),
    };
    let decimals = mantissa.split_once('.').map_or(0, |(_, fraction)| fraction.len() as i32);
    let value = format!("{mantissa}e{}", exponent + factor_exponent).parse().unwrap();
    (value, format!("1e{}", exponent + factor_exponent - decimals).parse().unwrap())
}

fn check(range: &MappedRange) -> Result<Ticks, TestCaseError> {
    let found = ticks(range);
    let scalars: Vec<f64> = found.ticks.iter().map(|t| t.scalar).collect();
    prop_assert!(COUNT.contains(&scalars.len()), "{range:?} {found:?}");
    prop_assert!(scalars.iter().all(|s| (range.lo()..=range.hi()).contains(s)), "{range:?} {found:?}");
    prop_assert!(scalars.windows(2).all(|s| s[0] < s[1]), "{range:?} {found:?}");
    for (i, tick) in found.ticks.iter().enumerate() {
        let (value, last_digit) = read(&tick.label, found.factor_exponent);
        prop_assert!((value - tick.scalar).abs() <= 0.5 * last_digit, "{range:?} {tick:?}");
        prop_assert!(found.ticks[..i].iter().all(|other| other.label != tick.label), "{range:?} {found:?}");
    }
    Ok(found)
}

proptest! {
    #[test]
    fn linear_ranges_have_three_to_eight_ticks_with_labels_that_read_back(
        exponent in -300_i32..300, center in -1e4_f64..1e4, width in 1e-3_f64..1e3,
    ) {
        let unit = 10_f64.powi(exponent);
        let range = MappedRange::new((center - width) * unit, (center + width) * unit, false).unwrap();
        check(&range)?;
    }

    #[test]
    fn log_ranges_have_three_to_eight_ticks_with_labels_that_read_back(lo in -300.0_f64..200.0, decades in 0.01_f64..100.0) {
        check(&MappedRange::new(10_f64.powf(lo), 10_f64.powf(lo + decades), true).unwrap())?;
    }

    #[test]
    fn ticks_of_any_range_lie_in_it(a in any::<f64>(), b in any::<f64>(), log in any::<bool>()) {
        let Ok(range) = MappedRange::new(a.min(b), a.max(b), log) else { return Ok(()) };
        let found = ticks(&range);
        prop_assert!(found.ticks.len() >= 2 && found.ticks.len() <= *COUNT.end());
        prop_assert!(found.ticks.iter().all(|t| (range.lo()..=range.hi()).contains(&t.scalar)));
        prop_assert!(found.ticks.windows(2).all(|t| t[0].scalar < t[1].scalar));
    }
}

fn shown(lo: f64, hi: f64, log: bool) -> (String, i32) {
    let found = ticks(&MappedRange::new(lo, hi, log).unwrap());
    let labels: Vec<String> = found.ticks.into_iter().map(|t| t.label).collect();
    (labels.join(" "), found.factor_exponent)
}

#[test]
fn labels_are_the_numbers_a_person_would_choose() {
    for (lo, hi, labels, factor) in [
        (0.0, 1.0, "0.0 0.2 0.4 0.6 0.8 1.0", 0),
        (-2.0, 6.0, "−2 0 2 4 6", 0),
        (0.3, 101.0, "20 40 60 80 100", 0),
        (101_324.5, 101_325.6, "101.3246 101.3248 101.3250 101.3252 101.3254 101.3256", 3),
        (-3e38, 3e38, "−300 −200 −100 0 100 200 300", 36),
        (0.0, 1e-42, "0.0 0.2 0.4 0.6 0.8 1.0", -42),
        (0.0, 4.2e-5, "0 10 20 30 40", -6),
        (-0.5, 0.5, "−0.4 −0.2 0.0 0.2 0.4", 0),
        (0.0, 60_000.0, "0 20000 40000 60000", 0),
    ] {
        assert_eq!(shown(lo, hi, false), (labels.to_owned(), factor), "{lo} {hi}");
    }
}

#[test]
fn log_ranges_are_labelled_with_powers_of_ten() {
    for (lo, hi, labels) in [
        (1e-6, 1.0, "10⁻⁶ 10⁻⁵ 10⁻⁴ 10⁻³ 10⁻² 10⁻¹ 10⁰"),
        (0.01, 200.0, "0.01 0.1 1 10 100"),
        (1e-45, 3e38, "10⁻⁴⁰ 10⁻³⁰ 10⁻²⁰ 10⁻¹⁰ 10⁰ 10¹⁰ 10²⁰ 10³⁰"),
        (1.0, 50.0, "1 2 5 10 20 50"),
        (1e-12, 2e-11, "10⁻¹² 2×10⁻¹² 5×10⁻¹² 10⁻¹¹ 2×10⁻¹¹"),
        (3.0, 4.0, "3.0 3.2 3.4 3.6 3.8 4.0"),
    ] {
        assert_eq!(shown(lo, hi, true).0, labels, "{lo} {hi}");
    }
}

#[test]
fn a_range_too_narrow_for_its_distance_from_zero_shows_its_ends() {
    assert_eq!(shown(1.0, 1.0_f64.next_up(), false), ("1e0 1.0000000000000002e0".to_owned(), 0));
    assert_eq!(shown(0.0, 5e-324, false).0, "0e0 5e−324");
}

#[test]
fn the_check_of_labels_notices_a_wrong_digit() {
    let (value, last_digit) = read("−1.25", 3);
    assert_eq!((value, last_digit), (-1250.0, 10.0));
    assert_eq!(read("2×10⁻¹²", 0).0, 2e-12);
    assert!((read("0.3", 0).0 - 0.4).abs() > 0.5 * read("0.3", 0).1);
}
