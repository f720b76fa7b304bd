//! The scalars at which a transfer function is transparent.
//!
//! A cell is active if the table has extinction somewhere between the least and the greatest of its scalars. The table is transparent in a
//! few intervals of scalars; a cell is invisible if and only if all of its scalars lie in one of them. So each vertex is labelled with its
//! interval, and cells compare labels: no cell needs a scalar range, nor samples of the table, which would miss what lies between two of
//! them.

use crate::node_table::{Node, NodeTable};

/// Transparent interval of a scalar, counted from 1; or [`VISIBLE`], or [`HOLE`].
pub type Label = u8;

/// The table has extinction at the scalar.
pub const VISIBLE: Label = 0;

/// The scalar is not finite: cells with it are outside of the domain.
pub const HOLE: Label = Label::MAX;

/// Maximum number of intervals with their own labels.
const INTERVALS_MAX: usize = HOLE as usize - 1;

/// Up to this number of intervals are searched linearly, for many scalars side by side; more by bisection.
const GONE_THROUGH: usize = 16;

/// The scalars at which a table has no extinction, as maximal closed intervals of f32, ascending. By default there are none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransparentIntervals {
    /// Least and greatest scalar of each interval.
    intervals: Vec<[f32; 2]>,
}

impl TransparentIntervals {
    /// The intervals of a table. A scalar at a discontinuity counts as visible if either side is: a cell that reaches it would show it.
    ///
    /// Exact: nodes are compared with scalars in f64. Intervals beyond the first 254 count as visible.
    pub fn of(table: &NodeTable) -> Self {
        let mut found = Found::default();
        let groups: Vec<&[Node]> = table.nodes().chunk_by(|a, b| a.scalar == b.scalar).collect();
        let is_transparent = |nodes: &[Node]| nodes.iter().all(|n| n.tau == 0.0);
        for (at, nodes) in groups.iter().enumerate() {
            let (first, last) = (&nodes[0], &nodes[nodes.len() - 1]);
            if at == 0 {
                found.add(first.tau == 0.0, f64::NEG_INFINITY, first.scalar);
            }
            found.add_point(is_transparent(nodes), first.scalar);
            let (transparent, end) = match groups.get(at + 1) {
                Some(next) => (last.tau == 0.0 && next[0].tau == 0.0, next[0].scalar),
                None => (last.tau == 0.0, f64::INFINITY),
            };
            found.add(transparent, last.scalar, end);
        }
        Self::rounded(&found.done())
    }

    /// The intervals that are transparent in a table sampled at `samples` scalars, evenly spaced from its first node to its last, and
    /// linear in between: extinction spreads from each sample to its neighbours. Two more samples on either side are excluded for rounding.
    pub fn of_sampled(table: &NodeTable, samples: usize) -> Self {
        let nodes = table.nodes();
        let (lo, hi) = (nodes[0].scalar, nodes[nodes.len() - 1].scalar);
        let margin = 2.0 * (hi - lo) / (samples.max(2) - 1) as f64;
        let shrunk = |&[a, b]: &[f32; 2]| {
            let [a, b] = [a, b].map(f64::from);
            // A constant extends beyond the last node unchanged; the samples do not.
            let end = |end: f64, by: f64| if end.is_finite() { end + by } else { end };
            let (a, b) = (end(a, margin), end(b, -margin));
            (a <= b).then_some(Interval { lo: a, hi: b, lo_is_in: true, hi_is_in: true })
        };
        Self::rounded(&Self::of(table).intervals.iter().filter_map(shrunk).collect::<Vec<_>>())
    }

    /// The same intervals, each split at every value inside of it, which belongs to the upper part: a cell with scalars on both sides of a
    /// value is then in no interval, and shows the isosurface at that value.
    #[must_use]
    pub fn cut_at(&self, values: &[f64]) -> Self {
        let mut intervals = Vec::with_capacity(self.intervals.len() + values.len());
        for &[lo, hi] in &self.intervals {
            let mut from = lo;
            let mut ascending: Vec<f64> = values.to_vec();
            ascending.sort_by(f64::total_cmp);
            for value in ascending {
                // The least f32 that is at least the value.
                let nearest = value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
                let above = if f64::from(nearest) < value { nearest.next_up() } else { nearest };
                if from < above && above <= hi {
                    intervals.push([from, above.next_down()]);
                    from = above;
                }
            }
            intervals.push([from, hi]);
        }
        intervals.truncate(INTERVALS_MAX);
        Self { intervals }
    }

    /// The finite f32 range of each interval.
    fn rounded(found: &[Interval]) -> Self {
        let intervals = found.iter().filter_map(Interval::rounded).take(INTERVALS_MAX).collect();
        Self { intervals }
    }

    /// Whether every scalar is visible.
    pub fn is_empty(&self) -> bool {
        self.intervals.is_empty()
    }

    /// The scalars whose label differs from that of the next lower one, ascending.
    pub(super) fn steps(&self) -> Vec<f32> {
        // Zeros of both signs are one step: scalars are compared by value.
        let ends = self.intervals.iter().flat_map(|&[lo, hi]| [lo + 0.0, hi.next_up() + 0.0]);
        let mut steps: Vec<f32> = ends.filter(|step| step.is_finite()).collect();
        steps.dedup();
        steps
    }

    /// The label of a scalar.
    pub fn label(&self, scalar: f32) -> Label {
        if !scalar.is_finite() {
            return HOLE;
        }
        let after = self.intervals.partition_point(|interval| interval[0] <= scalar);
        match after.checked_sub(1).map(|at| self.intervals[at][1]) {
            Some(hi) if scalar <= hi => after as Label,
            _ => VISIBLE,
        }
    }

    /// The common label of all scalars from `lo` to `hi`, if they have one other than [`VISIBLE`].
    pub fn label_of_range(&self, lo: f32, hi: f32) -> Option<Label> {
        let label = self.label(lo);
        (label != VISIBLE && label != HOLE && label == self.label(hi)).then_some(label)
    }

    /// Labels many scalars.
    pub(super) fn label_all(&self, scalars: &[f32], out: &mut [Label]) {
        if self.intervals.len() > GONE_THROUGH {
            out.iter_mut().zip(scalars).for_each(|(out, &s)| *out = self.label(s));
            return;
        }
        // In blocks that stay in the first-level cache.
        for (out, scalars) in out.chunks_mut(1024).zip(scalars.chunks(1024)) {
            for (label, &s) in out.iter_mut().zip(scalars) {
                *label = if s.is_finite() { VISIBLE } else { HOLE };
            }
            for (at, &[lo, hi]) in self.intervals.iter().enumerate() {
                for (label, &s) in out.iter_mut().zip(scalars) {
                    *label = if (s >= lo) & (s <= hi) { at as Label + 1 } else { *label };
                }
            }
        }
    }
}

/// An interval of scalars, open or closed at each end.
#[derive(Clone, Copy, Debug)]
struct Interval {
    lo: f64,
    hi: f64,
    lo_is_in: bool,
    hi_is_in: bool,
}

impl Interval {
    /// Its least and greatest finite f32, if any.
    fn rounded(&self) -> Option<[f32; 2]> {
        let mut lo = self.lo.max(f64::from(f32::MIN)) as f32;
        let mut hi = self.hi.min(f64::from(f32::MAX)) as f32;
        let (below, above) = (f64::from(lo) < self.lo, f64::from(hi) > self.hi);
        if below || !self.lo_is_in && f64::from(lo) == self.lo {
            lo = lo.next_up();
        }
        if above || !self.hi_is_in && f64::from(hi) == self.hi {
            hi = hi.next_down();
        }
        (lo <= hi && lo.is_finite() && hi.is_finite()).then_some([lo, hi])
    }
}

/// Merges transparent pieces of the scalar axis, from left to right, into intervals.
#[derive(Default)]
struct Found {
    done: Vec<Interval>,
    open: Option<Interval>,
}

impl Found {
    /// Adds an open piece.
    fn add(&mut self, transparent: bool, lo: f64, hi: f64) {
        self.add_part(transparent, [lo, hi], false);
    }

    /// Adds a single scalar.
    fn add_point(&mut self, transparent: bool, at: f64) {
        self.add_part(transparent, [at, at], true);
    }

    /// Adds what lies between two scalars, with these themselves if `is_in`.
    fn add_part(&mut self, transparent: bool, [lo, hi]: [f64; 2], is_in: bool) {
        match (&mut self.open, transparent) {
            (Some(open), true) => (open.hi, open.hi_is_in) = (hi, is_in),
            (None, true) => self.open = Some(Interval { lo, hi, lo_is_in: is_in, hi_is_in: is_in }),
            (_, false) => self.done.extend(self.open.take()),
        }
    }

    fn done(mut self) -> Vec<Interval> {
        self.done.extend(self.open.take());
        self.done
    }
}

#[cfg(test)]
#[path = "transparent_tests.rs"]
mod tests;
