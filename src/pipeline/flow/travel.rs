//! The way that the flow has travelled at each vertex or cell since the first step.
//!
//! L(t) is the integral of |v| over time, by trapezoids over the stored times. t |v(t)| would run backwards wherever the flow slows down. Every
//! [`StoredTravel::STEPS`] steps the sums are rounded to f32 and kept; from there on they are summed in f64, one trapezoid after the other, so
//! that a frame reached by a seek has the bits of one that was played. Between two steps L integrates the two speeds mixed: it is continuous.
//!
//! A thread gives the sums to the store; until they are there, and where they cannot be, they are in memory.

use crate::field::TimeAxis;
use crate::pipeline::FrameTime;
use crate::store::StoredTravel;
use std::sync::Arc;
use std::thread::JoinHandle;

/// Steps between two sums that are kept.
const KEPT: usize = StoredTravel::STEPS;

/// The lengths of the vectors at a step; those that are not finite count 0.
pub(super) type Speeds = Arc<Vec<f64>>;

/// The sums of a field.
#[derive(Debug, Default)]
pub(super) struct Travel {
    stored: Option<StoredTravel>,
    /// Sums that the store has, from the first on: after each [`KEPT`] steps.
    in_store: usize,
    /// Those that follow.
    kept: Vec<Arc<Vec<f32>>>,
    /// The last sums that were asked for, by step.
    last: Vec<(usize, Arc<Vec<f64>>)>,
    /// A thread that stores sums, and how many the store then has; 0 if it has refused them.
    storing: Option<JoinHandle<usize>>,
    /// How many sums the store was to have when it was last asked.
    offered: usize,
}

impl Travel {
    /// Takes the sums of a series, which has gone on, or is another one: sums of the same steps are kept.
    pub(super) fn turn_to(&mut self, stored: Option<StoredTravel>) {
        self.settle();
        let sums = self.in_store + self.kept.len();
        let goes_on = |(new, old): (&StoredTravel, &StoredTravel)| new.agrees_with(old, sums);
        if sums == 0 || !stored.as_ref().zip(self.stored.as_ref()).is_some_and(goes_on) {
            (self.in_store, self.offered) = (stored.as_ref().map_or(0, StoredTravel::rows), 0);
            self.kept.clear();
        }
        // These may be of steps that are coded anew.
        self.last.clear();
        self.stored = stored;
    }

    /// Gives the store the sums that it does not have, on a thread.
    pub(super) fn keep(&mut self) {
        if self.storing.as_ref().is_some_and(|storing| !storing.is_finished()) {
            return;
        }
        self.settle();
        let (first, sums) = (self.in_store, self.in_store + self.kept.len());
        let Some(stored) = self.stored.clone().filter(|_| !self.kept.is_empty() && self.offered != sums) else {
            return;
        };
        self.offered = sums;
        let kept = self.kept.clone();
        let store = move || match stored.keep(first, &kept) {
            Ok(is_kept) => usize::from(is_kept) * sums,
            Err(problem) => {
                tracing::info!(%problem, "the way of the flow is not kept");
                0
            }
        };
        self.storing = std::thread::Builder::new().name("flow".to_owned()).spawn(store).ok();
    }

    /// Waits for the thread that stores sums, and forgets those that the store has.
    fn settle(&mut self) {
        let sums = self.storing.take().and_then(|storing| storing.join().ok()).unwrap_or(0);
        if (self.in_store..=self.in_store + self.kept.len()).contains(&sums) {
            self.kept.drain(..sums - self.in_store);
            self.in_store = sums;
        }
    }

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
        let mut from = self.known(step / KEPT * KEPT, step);
        if from.is_none() {
            let (mut sums, mut kept) = self.nearest(step / KEPT);
            while sums < step / KEPT {
                let (first, end) = (sums * KEPT, (sums + 1) * KEPT);
                let from = self.known(first, end).or_else(|| kept.map(|kept| (first, in_f64(&kept))));
                let Some(found) = go_on(times, from, end, speeds)? else { return Ok(None) };
                let rounded: Arc<Vec<f32>> = Arc::new(found.iter().map(|way| *way as f32).collect());
                self.kept.push(rounded.clone());
                (sums, kept) = (sums + 1, Some(rounded));
            }
            from = kept.map(|kept| (sums * KEPT, in_f64(&kept)));
        }
        let Some(found) = go_on(times, from, step, speeds)? else { return Ok(None) };
        if !self.last.iter().any(|(of, _)| *of == step) {
            self.last.truncate(1);
            self.last.insert(0, (step, found.clone()));
        }
        Ok(Some(found))
    }

    /// The last one of the sums that were asked for, of these steps.
    fn known(&self, first: usize, step: usize) -> Option<(usize, Arc<Vec<f64>>)> {
        self.last.iter().filter(|(of, _)| (first..=step).contains(of)).max_by_key(|(of, _)| *of).cloned()
    }

    /// The greatest number of times [`KEPT`] steps whose sums are there, at most `sums`, and these; none at the first step. Those that the store
    /// cannot give are made anew.
    fn nearest(&mut self, sums: usize) -> (usize, Option<Arc<Vec<f32>>>) {
        let mut sums = sums.min(self.in_store + self.kept.len());
        while let Some(row) = sums.checked_sub(1) {
            if row >= self.in_store {
                return (sums, Some(self.kept[row - self.in_store].clone()));
            }
            if let Some(ways) = self.stored.as_ref().and_then(|stored| stored.row(row)) {
                return (sums, Some(Arc::new(ways)));
            }
            (self.in_store, self.offered, sums) = (row, 0, row);
            self.kept.clear();
        }
        (0, None)
    }
}

impl Drop for Travel {
    /// Whoever shows a single frame leaves its sums behind.
    fn drop(&mut self) {
        self.settle();
        self.keep();
        self.settle();
    }
}

fn in_f64(ways: &[f32]) -> Arc<Vec<f64>> {
    Arc::new(ways.iter().map(|way| f64::from(*way)).collect())
}

/// The way at a step from that at an earlier one; `None`: from the first step.
fn go_on<E>(
    times: &TimeAxis,
    from: Option<(usize, Arc<Vec<f64>>)>,
    step: usize,
    speeds: &mut impl FnMut(usize) -> Result<Option<Speeds>, E>,
) -> Result<Option<Arc<Vec<f64>>>, E> {
    let (first, mut ways) = match from {
        Some(from) => from,
        None => {
            let Some(count) = speeds(0)?.map(|speeds| speeds.len()) else { return Ok(None) };
            (0, Arc::new(vec![0.0; count]))
        }
    };
    for at in first..step {
        let (Some(a), Some(b)) = (speeds(at)?, speeds(at + 1)?) else { return Ok(None) };
        let time = |step: usize| times.values.get(step).copied().unwrap_or(f64::NAN);
        let half = Some(0.5 * (time(at + 1) - time(at))).filter(|half| half.is_finite()).unwrap_or(0.0);
        let sums = Arc::make_mut(&mut ways);
        sums.iter_mut().zip(a.iter().zip(&*b)).for_each(|(way, (a, b))| *way += half * (a + b));
    }
    Ok(Some(ways))
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
