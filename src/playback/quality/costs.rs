//! Measured and expected frame times.
//!
//! ```text
//! cost(rung)   median of its last three measurements
//! between two measured rungs of a family     share(rung) * ratio, the logarithm of the ratio linear between theirs
//! beyond them                                share(rung) * ratio of the nearest
//! ```
//! `ratio` is a measured cost over the expected share. Frames get cheaper or dearer while the camera moves, all rungs alike as a first
//! guess: where a rung is measured repeatedly, the costs of the others change by the same factor.

use super::Family;
use super::rungs::{EXACT, RUNGS, ladder};
use std::collections::VecDeque;

/// Measurements in the median of a rung: one slow frame changes nothing, a lasting step counts from the second.
const FRAMES: usize = 3;
/// Frames that [`Costs::dearest`] looks back on: a loop over a few steps comes back to the dearest.
const RECENT: usize = 16;
/// A measurement expires after this many frames: it may have been one slow frame.
const LIFE: u32 = 250;

/// Last measurements of a rung, logarithms of milliseconds.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    ln_ms: [f64; FRAMES],
    /// Number of measurements; the next one replaces that at `next`.
    count: usize,
    next: usize,
    /// Frames measured since the last one.
    age: u32,
}

impl Measured {
    fn add(&mut self, ln_ms: f64) {
        self.ln_ms[self.next] = ln_ms;
        self.next = (self.next + 1) % FRAMES;
        self.count = (self.count + 1).min(FRAMES);
        self.age = 0;
    }

    /// The median; the smaller one of two.
    fn median(&self) -> Option<f64> {
        let mut known = self.ln_ms;
        let known = &mut known[..self.count];
        known.sort_unstable_by(f64::total_cmp);
        known.get(self.count.checked_sub(1)? / 2).copied()
    }
}

/// Costs of all rungs.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    rungs: [Measured; RUNGS.len()],
    /// The rung that was measured last.
    last: Option<usize>,
    /// Rungs and log milliseconds of the last frames, the newest at the end.
    recent: VecDeque<(usize, f64)>,
}

impl Default for Costs {
    fn default() -> Self {
        Self { rungs: [Measured::default(); RUNGS.len()], last: None, recent: VecDeque::with_capacity(RECENT) }
    }
}

impl Costs {
    /// Adds the milliseconds of a frame; ignores numbers that are not positive and finite.
    pub(super) fn add(&mut self, rung: usize, ms: f64) {
        if !(ms > 0.0 && ms.is_finite()) {
            return;
        }
        let before = self.rungs[rung].median().filter(|_| self.last == Some(rung));
        self.rungs[rung].add(ms.ln());
        self.last = Some(rung);
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back((rung, ms.ln()));
        let after = self.rungs[rung].median();
        let by = before.zip(after).map_or(0.0, |(before, after)| after - before);
        for (_, measured) in self.rungs.iter_mut().enumerate().filter(|(at, _)| *at != rung) {
            measured.ln_ms.iter_mut().for_each(|ln_ms| *ln_ms += by);
            measured.age += 1;
            if measured.age > LIFE {
                *measured = Measured::default();
            }
        }
    }

    /// How many of the last frames of a rung took more than a limit, and how many did not.
    pub(super) fn beyond(&self, rung: usize, limit_ms: f64) -> [usize; 2] {
        let of_rung = self.recent.iter().filter(|(of, _)| *of == rung);
        of_rung.fold([0; 2], |[beyond, within], (_, ln_ms)| match ln_ms.exp() > limit_ms {
            true => [beyond + 1, within],
            false => [beyond, within + 1],
        })
    }

    /// Sets the expected cost of a rung to that of its dearest recent frame.
    pub(super) fn expect_dearest(&mut self, rung: usize) {
        let dearest = self.recent.iter().filter(|(of, _)| *of == rung).map(|(_, ln_ms)| *ln_ms).reduce(f64::max);
        if let Some(ln_ms) = dearest {
            self.rungs[rung].ln_ms = [ln_ms; FRAMES];
        }
    }

    /// Largest ratio of a recent frame's cost to the expected cost of its rung, the top one ignored as an outlier; at least 1.
    pub(super) fn dearest(&self) -> f64 {
        let over = self.recent.iter().filter_map(|&(rung, ln_ms)| Some(ln_ms - self.rungs[rung].median()?));
        let by_size = |[most, second]: [f64; 2], over: f64| [most.max(over), second.max(over.min(most))];
        over.fold([0.0; 2], by_size)[1].exp()
    }

    /// Scales all costs by a factor, for another pixel count, say.
    pub(super) fn scale(&mut self, factor: f64) {
        self.recent.iter_mut().for_each(|(_, ln_ms)| *ln_ms += factor.ln());
        self.rungs.iter_mut().flat_map(|measured| &mut measured.ln_ms).for_each(|ln_ms| *ln_ms += factor.ln());
    }

    /// Forgets all but the last measurement, the only hint at what frames cost now.
    pub(super) fn forget(&mut self) {
        let last = self.last.map(|at| (at, self.rungs[at]));
        *self = Self::default();
        if let Some((at, measured)) = last.and_then(|(at, measured)| Some((at, measured.median()?))) {
            self.rungs[at].add(measured);
        }
    }

    /// Milliseconds that a rung took; `None` if not measured.
    pub(super) fn measured(&self, rung: usize) -> Option<f64> {
        self.rungs[rung].median().map(f64::exp)
    }

    /// Milliseconds that a rung of a family is expected to take; `None` if neither the family nor the exact rung is measured.
    pub(super) fn expected(&self, family: Family, rung: usize) -> Option<f64> {
        let ratio = |at: usize| Some(self.rungs[at].median()? - RUNGS[at].share.ln());
        let steps = || ladder(family).enumerate();
        let (place, _) = steps().find(|&(_, at)| at == rung)?;
        let known = |(place, at): (usize, usize)| Some((place as f64, ratio(at)?));
        let finer = steps().take(place + 1).filter_map(known).last();
        let coarser = steps().skip(place).find_map(known);
        let place = place as f64;
        let ratio = match (finer, coarser) {
            (Some((a, finer)), Some((b, coarser))) if b > a => finer + (coarser - finer) * (place - a) / (b - a),
            (Some((_, ratio)), _) | (None, Some((_, ratio))) => ratio,
            // All faces may take as long as all cells.
            (None, None) => ratio(EXACT)?,
        };
        let expected = (ratio + RUNGS[rung].share.ln()).exp();
        // A finer rung than the last frame's takes no less.
        let last = self.last.filter(|&last| steps().skip(place as usize).any(|(_, at)| at == last));
        Some(last.and_then(|last| self.measured(last)).map_or(expected, |last| expected.max(last)))
    }
}
