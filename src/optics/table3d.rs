//! The pre-integrated table (dissertation 6.1.3 after Engel, Kraus and Ertl, 2001): colour and opacity of a segment by the
//! scalars at its front and back and its length.
//!
//! An entry (s0, s1, d) does not hold colour and opacity, which vanish with d, but quantities that do not: the mean extinction m over the
//! segment (from the 1-D integral of tau, hence exact and the same for every d) and m c, where c is the segment's mean colour weighted by
//! opacity, c (1 - exp(-m d)) = C with C as in [`super`]. For d = 0 that is the mean of colour times extinction. A look-up interpolates (m
//! c, m) between eight entries and gives
//!
//! ```text
//! alpha = 1 - exp(-m d),    C = (m c / m) alpha
//! ```
//!
//! 1. Short segments have exact opacity, to f32 rounding, however short; a constant extinction is exact at any length.
//! 2. Entries are weighted by extinction: colours without extinction do not contribute (no dark or foreign fringes), and a function of one
//!    colour gives that colour exactly.
//! 3. Lengths are spaced by their square root, since entries change with m d, and most segments are much shorter than the
//!    longest; between two lengths entries are linear in the length.
//! 4. Scalars are spaced evenly over the range of the nodes. Beyond it the function is constant: segments are cut there, and parts outside
//!    need no table.
//! 5. Entries are integrals over a table with fewer nodes ([`NodeTable::thinned`]) than the exact integrator uses.
//! 6. Segments longer than the longest length of the table are composited in equal parts.
//!
//! **Limitations.** A segment that is short in scalars (a fine mesh) reads the diagonal s0 = s1, where the table is the transfer function
//! sampled at its resolution: tents and steps narrower than two samples are blurred, and light leaks into transparent scalars. A constant
//! segment exactly at a step has the mean of both sides, at the ends of the range the inner side. `docs/performance.md` has the errors.
//! [`super::exact`] has none of these.

use super::exact::ExactTable;
use super::table3d_entries::{Limits, TAU_MAX, fill_row};
use super::{Accumulator, Integrator, ScalarMap};
use crate::node_table::{Node, NodeTable};
use crate::task::Cancel;
use glam::Vec4;
use rayon::prelude::*;

/// Numbers of entries along the axes of a [`Table3d`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Table3dResolution {
    /// Along each of the two scalar axes, at least 2.
    pub scalars: usize,
    /// Along the length axis, at least 2.
    pub lengths: usize,
}

impl Default for Table3dResolution {
    /// The smallest that keeps smooth functions within RMSE 1e-5 and maximum 1e-3 (`docs/performance.md`). 32 or 64 lengths change none of the
    /// errors by a twentieth, but for that of a slab, which is 3.2e-7 with 16.
    fn default() -> Self {
        Self { scalars: 128, lengths: 16 }
    }
}

impl Table3dResolution {
    /// Size of the table in bytes.
    pub fn bytes(&self) -> usize {
        self.scalars * self.scalars * self.lengths * size_of::<Vec4>()
    }
}

/// Below this mean extinction the colour fades to black: a smaller divisor is not a normal f32.
const MEAN_MIN: f32 = 1e-37;

/// A pre-integrated [`NodeTable`]; see the module.
#[derive(Clone, Debug)]
pub struct Table3d {
    /// The exact table, for where a segment begins to be visible.
    exact: ExactTable,
    /// The table from which entries are computed.
    thinned: NodeTable,
    /// (m r, m g, m b, m); length varies fastest, then s0, then s1.
    entries: Vec<Vec4>,
    entries_built: usize,
    resolution: Table3dResolution,
    lo: f64,
    hi: f64,
    /// Intervals of the scalar axis per unit of the scalar; 0 for an empty range.
    per_scalar: f64,
    length_max: f64,
    /// Entries of scalars below and above the range.
    below: Vec4,
    above: Vec4,
}

/// The parameters that a shader needs beside the entries, laid out as `Table3dParams` in `shaders/lib/optics_table3d.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Table3dParams {
    /// Entry of scalars below the range.
    pub below: [f32; 4],
    /// Entry of scalars above the range.
    pub above: [f32; 4],
    /// The range's lower end, mapped; with `scalar_lo_rest` a sum of two f32.
    pub scalar_lo: f32,
    /// Remainder of `scalar_lo`.
    pub scalar_lo_rest: f32,
    /// The range's upper end, mapped; with `scalar_hi_rest` a sum of two f32.
    pub scalar_hi: f32,
    /// Remainder of `scalar_hi`.
    pub scalar_hi_rest: f32,
    /// Intervals of the scalar axis per mapped scalar.
    pub intervals_per_scalar: f32,
    /// Longest length of the table, in units of the ray's length parameter.
    pub length_max: f32,
    /// Entries along each scalar axis.
    pub scalars: u32,
    /// Entries along the length axis.
    pub lengths: u32,
}

impl Table3d {
    /// The range of a transfer function's nodes, from the first to the last.
    pub fn range_of(table: &NodeTable) -> (f64, f64) {
        let nodes = table.nodes();
        (nodes[0].scalar, nodes[nodes.len() - 1].scalar)
    }

    /// Integrates `table` over the scalars of `range` and segments up to `length_max`, on all threads; the result does not depend on their
    /// number. `world_per_length` is the world length of one unit in which lengths are given.
    ///
    /// Scalars outside `range` look like its ends, so it should contain either all scalars that occur or all nodes ([`Self::range_of`]).
    pub fn new(
        table: &NodeTable,
        range: (f64, f64),
        length_max: f64,
        world_per_length: f64,
        resolution: Table3dResolution,
    ) -> Self {
        Self::changed(None, table, range, length_max, world_per_length, resolution, &Cancel::new())
    }

    /// As [`Self::new`], but incomplete if `cancel` is raised. Entries of `last`, made with the same `world_per_length`, are reused where
    /// the segment meets no changed scalar, if the axes are the same.
    pub fn changed(
        last: Option<&Self>,
        table: &NodeTable,
        range: (f64, f64),
        length_max: f64,
        world_per_length: f64,
        resolution: Table3dResolution,
        cancel: &Cancel,
    ) -> Self {
        let (lo, hi) = (range.0.min(range.1), range.0.max(range.1));
        let resolution = Table3dResolution { scalars: resolution.scalars.max(2), lengths: resolution.lengths.max(2) };
        let length_max = if length_max.is_finite() { length_max.max(f64::MIN_POSITIVE) } else { 1.0 };
        // Extinction is per unit of length from here on.
        let scaled = |n: &Node| Node { tau: (n.tau * world_per_length).min(TAU_MAX), ..*n };
        let thinned = table.thinned(length_max * world_per_length);
        let nodes: Vec<Node> = thinned.nodes().iter().map(scaled).collect();
        let intervals = (resolution.scalars - 1) as f64;
        let per_scalar = if hi > lo { intervals / (hi - lo) } else { 0.0 };
        let scalar = |i: usize| lo + (hi - lo) * (i as f64 / intervals);
        let length = |k: usize| length_max * (k as f64 / (resolution.lengths - 1) as f64).powi(2);
        let lengths: Vec<f64> = (0..resolution.lengths).map(length).collect();
        let scalars: Vec<f64> = (0..resolution.scalars).map(scalar).collect();
        let axes = (lo, hi, length_max, resolution);
        let last = last.filter(|last| (last.lo, last.hi, last.length_max, last.resolution) == axes);
        let changed = last.map_or((f64::NEG_INFINITY, f64::INFINITY), |last| change(&last.thinned, &thinned));
        let mut entries = match last {
            Some(last) => last.entries.clone(),
            None => vec![Vec4::ZERO; resolution.scalars * resolution.scalars * resolution.lengths],
        };
        let entries_built = entries
            .par_chunks_exact_mut(resolution.scalars * resolution.lengths)
            .zip(&scalars)
            .take_any_while(|_| !cancel.is_cancelled())
            .map(|(row, &s1)| fill_row(&nodes, &scalars, s1, &lengths, changed, row))
            .sum();
        let (below, above) = (Limits::at(&nodes, lo).left, Limits::at(&nodes, hi).right);
        let exact = ExactTable::new(table, world_per_length);
        Self { exact, thinned, entries, entries_built, resolution, lo, hi, per_scalar, length_max, below, above }
    }

    /// The entries (m r, m g, m b, m); length varies fastest, then s0, then s1.
    pub fn entries(&self) -> &[Vec4] {
        &self.entries
    }

    /// Number of entries that were computed, not reused from another table.
    pub fn entries_built(&self) -> usize {
        self.entries_built
    }

    /// Numbers of entries along the axes.
    pub fn resolution(&self) -> Table3dResolution {
        self.resolution
    }

    /// The shader parameters for scalars seen through `map`.
    pub fn params(&self, map: ScalarMap) -> Table3dParams {
        let split = |s: f64| {
            let mapped = map.apply(s);
            (mapped as f32, (mapped - f64::from(mapped as f32)) as f32)
        };
        let ((scalar_lo, scalar_lo_rest), (scalar_hi, scalar_hi_rest)) = (split(self.lo), split(self.hi));
        Table3dParams {
            below: self.below.to_array(),
            above: self.above.to_array(),
            scalar_lo,
            scalar_lo_rest,
            scalar_hi,
            scalar_hi_rest,
            intervals_per_scalar: (self.per_scalar / (map.prescale * map.scale)).min(f64::from(f32::MAX)) as f32,
            length_max: self.length_max as f32,
            scalars: self.resolution.scalars as u32,
            lengths: self.resolution.lengths as u32,
        }
    }

    /// Interval of the scalar axis that contains a scalar of the range, and the position within it, 0..=1.
    #[inline(always)]
    fn place(&self, scalar: f64) -> (usize, f32) {
        let at = ((scalar - self.lo) * self.per_scalar) as f32;
        let interval = (at as usize).min(self.resolution.scalars - 2);
        (interval, (at - interval as f32).min(1.0))
    }

    /// The interpolated entry of a segment with both scalars in the range and a length within the table.
    #[inline(always)]
    fn look_up(&self, s0: f64, s1: f64, length: f64) -> Vec4 {
        let Table3dResolution { scalars, lengths } = self.resolution;
        let ((i, fi), (j, fj)) = (self.place(s0), self.place(s1));
        // Entry k has length length_max (k / (lengths - 1))^2; in between, interpolation is linear in the length.
        let last = (lengths - 1) as f32;
        let at = (length / self.length_max) as f32 * (last * last);
        let k = (at.sqrt() as usize).min(lengths - 2);
        let fk = ((at - (k * k) as f32) / (2 * k + 1) as f32).clamp(0.0, 1.0);
        let first = (j * scalars + i) * lengths + k;
        let along_length = |at: usize| {
            let pair = &self.entries[at..at + 2];
            pair[0] + (pair[1] - pair[0]) * fk
        };
        let along_s0 = |at: usize| {
            let (a, b) = (along_length(at), along_length(at + lengths));
            a + (b - a) * fi
        };
        let (a, b) = (along_s0(first), along_s0(first + scalars * lengths));
        a + (b - a) * fj
    }

    /// Composites a segment that leaves the range, or is longer than the table's longest length.
    #[cold]
    #[inline(never)]
    fn segment_in_parts(&self, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let (low, high) = (s0.min(s1), s0.max(s1));
        if low < self.lo && high <= self.lo {
            return composite(self.below, length, out);
        }
        if low >= self.hi {
            return composite(self.above, length, out);
        }
        let (from, to) = (s0.clamp(self.lo, self.hi), s1.clamp(self.lo, self.hi));
        // The segment is not constant if a part is outside: a constant one would be outside or inside as a whole.
        let share = |a: f64, b: f64| if a == b { 0.0 } else { (b - a) / (s1 - s0) };
        let (before, after) = (share(s0, from), share(to, s1));
        let outside = |ascends: bool| if ascends { self.below } else { self.above };
        let mut visible = composite(outside(s1 > s0), before * length, out);
        let inside = length * if s0 == s1 { 1.0 } else { share(from, to) };
        let parts = (inside / self.length_max).ceil().max(1.0);
        let (rise, part) = ((to - from) / parts, inside / parts);
        let mut done = 0.0;
        while inside > 0.0 && done < parts && !out.is_opaque() {
            let (a, b) = (from + rise * done, if done + 1.0 == parts { to } else { from + rise * (done + 1.0) });
            visible += composite(self.look_up(a, b, part), part, out);
            done += 1.0;
        }
        visible += composite(outside(s1 < s0), after * length, out);
        visible.min(1)
    }
}

/// The scalars between which two tables differ, both ends included; from infinity to -infinity if they are equal.
fn change(a: &NodeTable, b: &NodeTable) -> (f64, f64) {
    let (a, b) = (a.nodes(), b.nodes());
    let before = a.iter().zip(b).take_while(|(a, b)| a == b).count();
    if before == a.len() && before == b.len() {
        return (f64::INFINITY, f64::NEG_INFINITY);
    }
    let behind = a.iter().rev().zip(b.iter().rev()).take_while(|(a, b)| a == b).count();
    // An equal node belongs to both: the change begins behind the last equal one and ends before the next.
    let lo = before.checked_sub(1).map_or(f64::NEG_INFINITY, |last| a[last].scalar);
    let hi = a.len().checked_sub(behind).and_then(|first| a.get(first)).map_or(f64::INFINITY, |n| n.scalar);
    (lo.min(hi), hi.max(lo))
}

/// Composites a length with this entry; returns 1 if it is visible.
#[inline(always)]
fn composite(entry: Vec4, length: f64, out: &mut Accumulator) -> u64 {
    // Rounding may leave a tiny negative extinction.
    let mean = entry.w.max(0.0);
    let depth = mean * length as f32;
    let alpha = alpha_of_depth(depth);
    out.add_premultiplied(entry * (alpha / mean.max(MEAN_MIN)), alpha);
    u64::from(depth > 0.0)
}

/// 1 - exp(-x) for x >= 0, infinity included. Relative error below 3e-7.
///
/// Up to 1/4 the power series: the first term left out is x^6 / 5040 of the result, 5e-8.
#[inline(always)]
fn alpha_of_depth(x: f32) -> f32 {
    if x <= 0.25 {
        x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x * (1.0 / 120.0 - x * (1.0 / 720.0))))))
    } else {
        -(-x).exp_m1()
    }
}

impl Integrator for Table3d {
    type Place = ();

    #[inline(always)]
    fn enter(&self, _scalar: f64) {}

    #[inline(always)]
    fn segment(&self, (): &mut (), s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let (low, high) = (s0.min(s1), s0.max(s1));
        if low >= self.lo && high <= self.hi && low < self.hi && length <= self.length_max {
            return composite(self.look_up(s0, s1, length), length, out);
        }
        self.segment_in_parts(s0, s1, length, out)
    }

    fn exact(&self) -> &ExactTable {
        &self.exact
    }
}

#[cfg(test)]
#[path = "table3d_tests.rs"]
mod tests;
