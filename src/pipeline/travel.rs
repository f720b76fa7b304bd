//! The way that the flow has travelled at each vertex since the first step.
//!
//! L(t) is the integral of |v| over time, by trapezoids over the stored times. t |v(t)| would run backwards wherever the flow slows down. Every
//! [`KEPT`] steps the sums are kept, as f32; from there on they are summed in f64, in one order, so that a frame reached by a seek has the bits
//! of one that was played. Between two steps L integrates the two speeds mixed: it is continuous.

use super::FrameTime;
use crate::field::TimeAxis;
use std::sync::Arc;

/// Steps between two sums that are kept.
const KEPT: usize = 8;

/// The lengths of the vectors at a step; those that are not finite count 0.
pub(super) type Speeds = Arc<Vec<f64>>;

/// The sums of a field.
#[derive(Debug, Default)]
pub(super) struct Travel {
    /// After each [`KEPT`] steps.
    kept: Vec<Vec<f32>>,
    /// The last sums that were asked for, by step.
    last: Vec<(usize, Arc<Vec<f64>>)>,
}

impl Travel {
    /// The way at a time; `speeds` has those of a step, or `None` if the request was cancelled.
    pub(super) fn at<E>(
        &mut self,
        times: &TimeAxis,
        time: FrameTime,
        speeds: &mut impl FnMut(usize) -> Result<Option<Speeds>, E>,
    ) -> Result<Option<Arc<Vec<f64>>>, E> {
        let Some(from) = self.at_step(times, time.step(), speeds)? else { return Ok(None) };
        // Sequences that begin again are not mixed over their end.
        let Some((next, weight)) = time.toward().filter(|(next, _)| *next > time.step()) else { return Ok(Some(from)) };
        let Some(to) = self.at_step(times, next, speeds)? else { return Ok(None) };
        let (Some(a), Some(b)) = (speeds(time.step())?, speeds(next)?) else { return Ok(None) };
        let ways = from.iter().zip(&*to).zip(a.iter().zip(&*b));
        Ok(Some(Arc::new(ways.map(|((from, to), (a, b))| from + share([*a, *b], weight) * (to - from)).collect())))
    }

    /// The way at a step.
    fn at_step<E>(
        &mut self,
        times: &TimeAxis,
        step: usize,
        speeds: &mut impl FnMut(usize) -> Result<Option<Speeds>, E>,
    ) -> Result<Option<Arc<Vec<f64>>>, E> {
        while self.kept.len() < step / KEPT {
            let first = self.kept.len() * KEPT;
            let Some(found) = self.go_on(times, first, first + KEPT, speeds)? else { return Ok(None) };
            self.kept.push(found.iter().map(|way| *way as f32).collect());
        }
        let Some(found) = self.go_on(times, step / KEPT * KEPT, step, speeds)? else { return Ok(None) };
        if !self.last.iter().any(|(of, _)| *of == step) {
            self.last.truncate(1);
            self.last.insert(0, (step, found.clone()));
        }
        Ok(Some(found))
    }

    /// The way at a step from the sums kept at `first`, at most [`KEPT`] steps before.
    fn go_on<E>(
        &self,
        times: &TimeAxis,
        first: usize,
        step: usize,
        speeds: &mut impl FnMut(usize) -> Result<Option<Speeds>, E>,
    ) -> Result<Option<Arc<Vec<f64>>>, E> {
        let known = self.last.iter().filter(|(of, _)| (first..=step).contains(of)).max_by_key(|(of, _)| *of);
        let (mut at, mut ways) = match known {
            Some((of, ways)) => (*of, ways.clone()),
            None => {
                let kept = (first / KEPT).checked_sub(1).map(|before| &self.kept[before]);
                let Some(count) = speeds(first)?.map(|speeds| speeds.len()) else { return Ok(None) };
                (
                    first,
                    Arc::new(kept.map_or(vec![0.0; count], |kept| kept.iter().map(|way| f64::from(*way)).collect())),
                )
            }
        };
        while at < step {
            let (Some(a), Some(b)) = (speeds(at)?, speeds(at + 1)?) else { return Ok(None) };
            let time = |step: usize| times.values.get(step).copied().unwrap_or(f64::NAN);
            let half = Some(0.5 * (time(at + 1) - time(at))).filter(|half| half.is_finite()).unwrap_or(0.0);
            let sums = Arc::make_mut(&mut ways);
            sums.iter_mut().zip(a.iter().zip(&*b)).for_each(|(way, (a, b))| *way += half * (a + b));
            at += 1;
        }
        Ok(Some(ways))
    }
}

/// The share of the way between two steps that is behind at a weight, by the integral of the speeds mixed.
fn share([a, b]: [f64; 2], weight: f64) -> f64 {
    let all = 0.5 * (a + b);
    if all > 0.0 && all.is_finite() { weight * (a + 0.5 * weight * (b - a)) / all } else { weight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// Speeds at two vertices: one changes, one has a hole at step 3.
    fn speed(step: usize) -> [f64; 2] {
        let of = step as f64;
        [1.0 + (0.7 * of).sin(), if step == 3 { 0.0 } else { 0.3 * of }]
    }

    fn times(count: usize) -> TimeAxis {
        // Not uniform.
        TimeAxis { values: (0..count).map(|i| (i as f64).powf(1.3)).collect() }
    }

    fn way(travel: &mut Travel, time: FrameTime, asked: &mut Vec<usize>) -> Vec<f64> {
        let mut speeds = |step: usize| {
            asked.push(step);
            Ok::<_, Infallible>(Some(Arc::new(speed(step).to_vec())))
        };
        let found = travel.at(&times(40), time, &mut speeds);
        found.unwrap().unwrap().to_vec()
    }

    #[test]
    fn it_is_the_sum_of_trapezoids_and_a_seek_has_the_bits_of_playing() {
        let (mut played, times, mut sum) = (Travel::default(), times(40), [0.0; 2]);
        for step in 0..40 {
            if step > 0 {
                let ([a, b], [c, d]) = (speed(step - 1), speed(step));
                let half = 0.5 * (times.values[step] - times.values[step - 1]);
                sum = [sum[0] + half * (a + c), sum[1] + half * (b + d)];
            }
            let found = way(&mut played, step.into(), &mut Vec::new());
            let mut asked = Vec::new();
            let sought = way(&mut Travel::default(), step.into(), &mut asked);
            assert_eq!(found, sought, "{step}");
            for (found, sum) in found.iter().zip(sum) {
                // One rounding to f32 for each sum that was kept, and some of f64.
                let bound = (step / KEPT) as f64 * f64::from(f32::EPSILON) * sum + 1e-12;
                assert!((found - sum).abs() <= bound, "{step}: {found} {sum}");
            }
        }
        // Playing on asks for the two steps of one trapezoid.
        let mut asked = Vec::new();
        way(&mut played, 39.into(), &mut asked);
        assert!(asked.is_empty());
        way(&mut played, 30.into(), &mut asked);
        assert!(asked.iter().all(|step| (24..=30).contains(step)), "{asked:?}");
    }

    #[test]
    fn between_steps_it_goes_on_without_a_jump_and_never_back() {
        let mut travel = Travel::default();
        let mut last = vec![0.0; 2];
        for k in 0..400 {
            let (step, weight) = (k / 20, (k % 20) as f64 / 20.0);
            let found = way(&mut travel, FrameTime::between(step, step + 1, weight), &mut Vec::new());
            for ((found, last), fastest) in found.iter().zip(&last).zip([2.0, 6.0]) {
                // A twentieth of the longest interval, and a rounding of f32.
                assert!(*found >= last - 1e-5 && found - last <= 0.16 * fastest, "{k}: {found} {last}");
            }
            last = found;
        }
        let (a, b) = (speed(4)[0], speed(5)[0]);
        let [from, to, between] =
            [4.into(), 5.into(), FrameTime::between(4, 5, 0.25)].map(|time| way(&mut travel, time, &mut vec![])[0]);
        let duration = times(6).values[5] - times(6).values[4];
        // The integral of a + x (b - a) to a quarter.
        let expected = from + duration * (0.25 * a + 0.5 * 0.0625 * (b - a));
        assert!((between - expected).abs() < 1e-12 && to > between, "{between} {expected}");
    }
}
