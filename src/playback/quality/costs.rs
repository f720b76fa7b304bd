//! What frames took, and what others would.
//!
//! ```text
//! cost(rung)   median of its last three measurements
//! between two measured rungs of a family     share(rung) * ratio, the logarithm of the ratio linear between theirs
//! beyond them                                share(rung) * ratio of the nearest
//! ```
//! `ratio` is a measured cost over the share that was expected. Frames get cheaper or dearer while the camera moves, all ways alike as a first
//! guess: where a rung is measured again and again, the others' costs change by the same factor.

use super::Family;
use super::rungs::{EXACT, RUNGS, ladder};
use std::collections::VecDeque;

/// Measurements of a rung whose median counts: one slow frame changes nothing, a lasting step counts from the second.
const FRAMES: usize = 3;
/// Frames that say how dear others may be: a loop over a few steps comes back to the dearest.
const RECENT: usize = 16;
/// What was measured so many frames ago is not known any more: it may have been one slow frame.
const LIFE: u32 = 250;

/// Milliseconds that a way to draw took, as logarithms.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    ln_ms: [f64; FRAMES],
    /// How many of them there are, and where the next one goes.
    count: usize,
    next: usize,
    /// Frames measured since.
    age: u32,
}

impl Measured {
    fn add(&mut self, ln_ms: f64) {
        self.ln_ms[self.next] = ln_ms;
        self.next = (self.next + 1) % FRAMES;
        self.count = (self.count + 1).min(FRAMES);
        self.age = 0;
    }

    /// The median; the lesser of two.
    fn median(&self) -> Option<f64> {
        let mut known = self.ln_ms;
        let known = &mut known[..self.count];
        known.sort_unstable_by(f64::total_cmp);
        known.get(self.count.checked_sub(1)? / 2).copied()
    }
}

/// What is known of all ways to draw.
#[derive(Clone, Debug)]
pub(super) struct Costs {
    rungs: [Measured; RUNGS.len()],
    /// The rung that was measured last.
    last: Option<usize>,
    /// The last frames, the newest at the end.
    recent: VecDeque<(usize, f64)>,
}

impl Default for Costs {
    fn default() -> Self {
        Self { rungs: [Measured::default(); RUNGS.len()], last: None, recent: VecDeque::with_capacity(RECENT) }
    }
}

impl Costs {
    /// A frame took so many milliseconds; what is no positive number is no measurement.
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

    /// Of the last frames, drawn in one way: how many took more than a limit, and how many did not.
    pub(super) fn beyond(&self, rung: usize, limit_ms: f64) -> [usize; 2] {
        let of_rung = self.recent.iter().filter(|(of, _)| *of == rung);
        of_rung.fold([0; 2], |[beyond, within], (_, ln_ms)| match ln_ms.exp() > limit_ms {
            true => [beyond + 1, within],
            false => [beyond, within + 1],
        })
    }

    /// From now on a way to draw is taken to cost what the dearest of the last frames did that were drawn so.
    pub(super) fn expect_dearest(&mut self, rung: usize) {
        let dearest = self.recent.iter().filter(|(of, _)| *of == rung).map(|(_, ln_ms)| *ln_ms).reduce(f64::max);
        if let Some(ln_ms) = dearest {
            self.rungs[rung].ln_ms = [ln_ms; FRAMES];
        }
    }

    /// How dear the dearest of the last frames were, over what their ways to draw are taken to cost: 1 at least. One of them alone changes
    /// nothing.
    pub(super) fn dearest(&self) -> f64 {
        let over = self.recent.iter().filter_map(|&(rung, ln_ms)| Some(ln_ms - self.rungs[rung].median()?));
        let by_size = |[most, second]: [f64; 2], over: f64| [most.max(over), second.max(over.min(most))];
        over.fold([0.0; 2], by_size)[1].exp()
    }

    /// All costs change by a factor: other pixels, say.
    pub(super) fn scale(&mut self, factor: f64) {
        self.recent.iter_mut().for_each(|(_, ln_ms)| *ln_ms += factor.ln());
        self.rungs.iter_mut().flat_map(|measured| &mut measured.ln_ms).for_each(|ln_ms| *ln_ms += factor.ln());
    }

    /// Forgets all but what was measured last: nothing else says how dear frames may be now.
    pub(super) fn forget(&mut self) {
        let last = self.last.map(|at| (at, self.rungs[at]));
        *self = Self::default();
        if let Some((at, measured)) = last.and_then(|(at, measured)| Some((at, measured.median()?))) {
            self.rungs[at].add(measured);
        }
    }

    /// Milliseconds that a way to draw took; `None` if that was not measured.
    pub(super) fn measured(&self, rung: usize) -> Option<f64> {
        self.rungs[rung].median().map(f64::exp)
    }

    /// Milliseconds that a way to draw of a family is expected to take; `None` if nothing is known that tells.
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
        // What is finer than the last frame takes no less.
        let last = self.last.filter(|&last| steps().skip(place as usize).any(|(_, at)| at == last));
        Some(last.and_then(|last| self.measured(last)).map_or(expected, |last| expected.max(last)))
    }
}
