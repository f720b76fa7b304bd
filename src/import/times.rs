//! Times of steps that a file lists.

/// The times with the numbers of their steps, in order of time; the error says what is wrong with them.
pub(super) fn in_order(times: &[f64]) -> Result<Vec<(f64, usize)>, String> {
    if let Some(time) = times.iter().find(|time| !time.is_finite()) {
        return Err(format!("the time {time} is not finite"));
    }
    // Adding zero turns -0 into +0.
    let mut steps: Vec<(f64, usize)> = times.iter().enumerate().map(|(step, time)| (time + 0.0, step)).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    match steps.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => Err(format!("steps {} and {} have the same time {}", pair[0].1, pair[1].1, pair[0].0)),
        None if steps.is_empty() => Err("there are no steps".to_owned()),
        None => Ok(steps),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_in_order_of_time_and_each_has_its_own() {
        assert_eq!(in_order(&[2.0, -0.0, 1.5]), Ok(vec![(0.0, 1), (1.5, 2), (2.0, 0)]));
        assert!(in_order(&[0.0, 1.0, -0.0]).unwrap_err().contains("steps 0 and 2"));
        assert!(in_order(&[0.0, f64::NAN]).unwrap_err().contains("not finite"));
        assert!(in_order(&[]).unwrap_err().contains("no steps"));
    }
}
