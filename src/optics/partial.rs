//! Partial pre-integration (Moreland and Angel, "A fast high accuracy volume renderer for unstructured data", VolVis 2004): between two
//! scalars integrals over the scalar are used, computed once per transfer function; a segment costs the same however many nodes it crosses.
//!
//! Along a segment of length d from scalar s0 to s1 everything is a function of the scalar, and dt = d ds / (s1 - s0):
//!
//! ```text
//! optical depth  x = d / (s1 - s0) * integral from s0 to s1 of tau ds,    alpha = 1 - exp(-x)
//! ```
//!
//! so **opacity is exact**. Colour is not a function of an integral over the scalar. With u in [0, 1] the share of the optical depth
//! that lies in front, C = x * integral of c(u) exp(-x u) du; c(u) is replaced by the linear function that has its two first
//! moments,
//!
//! ```text
//! mean = integral of c du,    h = integral of c (u - 1/2) du,    c(u) ~ mean + 12 h (u - 1/2)
//! ```
//!
//! which are integrals over the scalar too, du being tau ds over its integral: neither depends on d. With tilt = 6 h this is a
//! homogeneous stretch with colours mean - tilt in front and mean + tilt at the back, whose weights are Moreland and Angel's: 1 - psi
//! and psi - exp(-x), psi = (1 - exp(-x)) / x ([`homogeneous_weights`]). Their psi has two arguments, the optical depths that the
//! extinctions at both ends would give; it is used where it is exact, between two nodes ([`piece_weights`], computed rather than
//! looked up: their table over x / (1 + x), 512 x 512 and bilinear, is off by up to 1.4e-2 where one end is opaque, RMS 4.5e-4).
//!
//! Up to the first node and behind the last one a segment is integrated exactly; in between it is cut into stretches as long as their
//! optical depth allows: up to [`DEPTH_MAX`], or one interval, which is exact again. Thin segments are four parts at most; thick ones are
//! some dozens in front of what they make opaque, and two behind it. Sums over nodes are kept for halves of blocks of 2, 4, 8... nodes,
//! each from the block's middle: two of them cover the range between any two nodes ([`PartialTable::behind`]). No sums are subtracted: a
//! running sum from the first node, as in the paper, would need that, and behind an extinction of 1e6 leave no digits of one of 1e-3 (in
//! f32, behind one of 1e4). Two nodes at one scalar have no width, and need no rule of their own; the intervals of a segment's ends are
//! chosen as in [`super::exact`].
//!
//! **Why not the colours at the ends**, as in the paper: between nodes these are right, across nodes they miss a spike in the middle, where
//! all the light may come from. Largest error of a channel over the segments across nodes of the test
//! `the_moments_are_better_than_the_colors_at_the_ends`, by optical depth:
//!
//! | rule for all of a segment | to 0.1 | to 0.5 | to 2 | to 20 |
//! |---|---|---|---|---|
//! | colours of the ends | 5.3e-2 | 1.9e-1 | 4.5e-1 | 8.6e-1 |
//! | mean | 7.0e-4 | 1.4e-2 | 1.1e-1 | 6.2e-1 |
//! | mean and tilt | 6.3e-6 | 5.6e-4 | 1.9e-2 | 3.3e-1 |
//! | this | 4.3e-6 | 7.2e-5 | 1.0e-4 | 6.1e-5 |
//!
//! Stretches of up to 0.5 leave errors of 5.8e-4 in the hard cases of `docs/accuracy.md`, of up to 1 3.5e-3, and take as long.
//!
//! **Limitations.** Three and more colours in a stretch are represented by two: errors of up to 1e-4. A segment that crosses one node or
//! none has no error, so a finer mesh has less of it. Between nodes it is slower than [`super::exact`], which knows the one end from the
//! segment before: 15 ns against 9, across 3 nodes 75 against 52, across 7 nodes 67 against 104, across 30 nodes 82 against 412.

use super::exact::{ExactTable, Interval};
use super::table3d_entries::TAU_MAX;
use super::{Accumulator, Integrator, ScalarMap, homogeneous_weights, piece_weights};
use crate::node_table::{Node, NodeTable};
use glam::Vec4;

/// Largest optical depth of a stretch across nodes, represented by two colours.
const DEPTH_MAX: f64 = 0.25;

/// Integrals between two scalars, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stretch {
    /// Integral of the extinction over the scalar.
    depth: f64,
    /// Red, green, blue averaged over the optical depth, and 1.
    mean: Vec4,
    /// Half the rise over the optical depth of the linear function that has the same first moment, and 0.
    tilt: Vec4,
}

impl Stretch {
    const NOTHING: Self = Self { depth: 0.0, mean: Vec4::ONE, tilt: Vec4::ZERO };

    /// A stretch whose colours and extinctions are linear from one end to the other.
    ///
    /// With y = (tau0 - tau1) / (tau0 + tau1) and t in [0, 1], du/dt = 1 + y (1 - 2 t). The mean of t over u is then 1/2 - y / 6,
    /// and its moment about u = 1/2, by parts half the integral of u - u^2 over t, is (5 - y^2) / 60.
    #[inline(always)]
    fn linear(width: f64, colors: [Vec4; 2], taus: [f64; 2]) -> Self {
        let sum = taus[0] + taus[1];
        let skew = if sum > 0.0 { ((taus[0] - taus[1]) / sum) as f32 } else { 0.0 };
        let rise = colors[1] - colors[0];
        Self {
            depth: 0.5 * sum * width,
            mean: 0.5 * (colors[0] + colors[1]) - rise * (skew * (1.0 / 6.0)),
            tilt: rise * (0.5 - 0.1 * skew * skew),
        }
    }

    /// This stretch followed by `next`. With p and q their shares of the optical depth, h = p^2 h0 + q^2 h1 + p q (mean1 - mean0) / 2.
    #[inline(always)]
    fn then(self, next: Self) -> Self {
        let depth = self.depth + next.depth;
        if depth <= 0.0 {
            return Self::NOTHING;
        }
        let (p, q) = ((self.depth / depth) as f32, (next.depth / depth) as f32);
        Self {
            depth,
            mean: self.mean * p + next.mean * q,
            tilt: self.tilt * (p * p) + next.tilt * (q * q) + (next.mean - self.mean) * (3.0 * p * q),
        }
    }

    /// The stretch seen from its other end.
    #[inline(always)]
    fn reversed(self) -> Self {
        Self { tilt: -self.tilt, ..self }
    }
}

/// A [`NodeTable`] prepared for partial pre-integration, extinction per unit of the ray's length parameter.
#[derive(Clone, Debug)]
pub struct PartialTable {
    exact: ExactTable,
    /// Extinction at the lower and the upper end of each interval of `exact`, where it is f32: too coarse where a steep ramp reaches zero.
    taus: Vec<[f64; 2]>,
    /// Number of distinct node scalars (*places*).
    places: usize,
    /// The stretch between each place and the middle of its block: for blocks of 2 places, of 4, and so on.
    sums: Vec<Stretch>,
}

impl PartialTable {
    /// Prepares `table`; `world_per_length` is the world length of one unit in which segment lengths will be given.
    pub fn new(table: &NodeTable, world_per_length: f64) -> Self {
        let exact = ExactTable::new(table, world_per_length);
        let places = exact.intervals().len() - 1;
        let mut table = Self { exact, taus: taus_of(table, world_per_length), places, sums: Vec::new() };
        let levels = usize::BITS - (places - 1).leading_zeros();
        table.sums = vec![Stretch::NOTHING; places * levels as usize];
        for level in 0..levels {
            table.sum_blocks(1 << level, level as usize * places);
        }
        table
    }

    /// Computes the sums of one level, from `first` on.
    fn sum_blocks(&mut self, half: usize, first: usize) {
        for middle in (half..self.places).step_by(2 * half) {
            let mut sum = Stretch::NOTHING;
            for place in (middle - half..middle).rev() {
                sum = self.behind_place(place).then(sum);
                self.sums[first + place] = sum;
            }
            sum = Stretch::NOTHING;
            for place in middle + 1..(middle + half).min(self.places) {
                sum = sum.then(self.behind_place(place - 1));
                self.sums[first + place] = sum;
            }
        }
    }

    /// The stretch from a place to the next.
    fn behind_place(&self, place: usize) -> Stretch {
        let Interval { lo, hi, .. } = *self.exact.interval(place + 1);
        self.part(place + 1, lo, hi)
    }

    /// The part of an interval between two of its scalars, in that direction.
    #[inline(always)]
    fn part(&self, interval: usize, from: f64, to: f64) -> Stretch {
        let colors = [from, to].map(|s| self.exact.interval(interval).at(s).color());
        Stretch::linear((to - from).abs(), colors, [self.tau_at(interval, from), self.tau_at(interval, to)])
    }

    #[inline(always)]
    fn tau_at(&self, interval: usize, scalar: f64) -> f64 {
        let [lo, hi] = self.taus[interval];
        let (foot, top) = if lo <= hi { (lo, hi) } else { (hi, lo) };
        let share = self.exact.interval(interval).share(scalar);
        // Neither end plus a part of the rise: the other end would not be exact.
        (foot * (1.0 - share) + top * share).max(0.0)
    }

    /// The stretch behind place `from` on the way to place `to`, and the place where it ends: the middle of the largest block whose halves
    /// they are in, or `to` if `from` is the middle of a block that contains it.
    #[inline(always)]
    fn behind(&self, from: usize, to: usize) -> (usize, Stretch) {
        let differ = (from ^ to).ilog2();
        let own = if from == 0 { 0 } else { from.trailing_zeros() };
        let (level, end, kept) = if from < to && own <= differ {
            (differ, to >> differ << differ, from)
        } else if from > to && own < differ {
            (differ, from >> differ << differ, from)
        } else {
            (own, to, to)
        };
        let sum = self.sums[level as usize * self.places + kept];
        (end, if from < to { sum } else { sum.reversed() })
    }

    /// The interval that contains a scalar; `guess` is tried first. At a node it is the one that ends there if `ends`, else the one that
    /// begins.
    #[inline(always)]
    fn interval_of(&self, guess: usize, scalar: f64, ends: bool) -> usize {
        let Interval { lo, hi, .. } = *self.exact.interval(guess);
        if if ends { lo < scalar && scalar <= hi } else { lo <= scalar && scalar < hi } {
            return guess;
        }
        self.exact.intervals().partition_point(|i| if ends { i.hi < scalar } else { i.hi <= scalar })
    }

    /// Composites a segment that crosses no node, as [`super::exact`] does.
    #[inline(always)]
    fn within(&self, interval: usize, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        let of = self.exact.interval(interval);
        if of.transparent {
            return 0;
        }
        let [near, far] = [s0, s1].map(|s| depth_of(self.tau_at(interval, s), length));
        if near <= 0.0 && far <= 0.0 {
            return 0;
        }
        out.add(piece_weights(near, far), of.at(s0).color(), of.at(s1).color());
        1
    }

    /// Composites a segment from one interval to another.
    #[inline(always)]
    fn across(&self, (first, last): (usize, usize), s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        // The places where it leaves the first and enters the last interval: interval i ends at place i.
        let (left, entered) = if first < last { (first, last - 1) } else { (first - 1, last) };
        let [leaves, enters] = [left, entered].map(|place| self.exact.interval(place).hi);
        let per_scalar = length / (s1 - s0).abs();
        let length_of = |from: f64, to: f64| (to - from).abs() * per_scalar;
        let mut pieces = self.within(first, s0, leaves, length_of(s0, leaves), out);
        let mut at = left;
        while at != entered {
            let (mut end, mut sum) = self.behind(at, entered);
            while end.abs_diff(at) > 1 && sum.depth * per_scalar > DEPTH_MAX && !out.is_opaque() {
                (end, sum) = self.behind(at, (at + end) / 2);
            }
            pieces += if end.abs_diff(at) == 1 {
                let &Interval { lo, hi, .. } = self.exact.interval(at.max(end));
                let (from, to) = if at < end { (lo, hi) } else { (hi, lo) };
                self.within(at.max(end), from, to, length_of(from, to), out)
            } else {
                composite(sum, depth_of(sum.depth, per_scalar), out)
            };
            at = end;
        }
        pieces + self.within(last, enters, s1, length_of(enters, s1), out)
    }

    /// The table as `shaders/lib/optics_partial.wgsl` reads it, over scalars seen through `map`: the intervals of
    /// [`ExactTable::packed`], then the sums, each as (mean, integral of the extinction over the mapped scalar), (tilt, 0).
    pub fn packed(&self, map: ScalarMap) -> Vec<[f32; 4]> {
        let mut words = self.exact.packed(map);
        words.extend(self.sums.iter().flat_map(|sum| {
            let depth = (sum.depth * map.prescale * map.scale).min(TAU_MAX) as f32;
            [sum.mean.with_w(depth).to_array(), sum.tilt.to_array()]
        }));
        words
    }

    /// Number of intervals, including the two beyond the nodes.
    pub fn interval_count(&self) -> usize {
        self.exact.intervals().len()
    }
}

/// Extinction at both ends of the intervals of an [`ExactTable`].
fn taus_of(table: &NodeTable, world_per_length: f64) -> Vec<[f64; 2]> {
    let nodes = table.nodes();
    let tau = |n: &Node| (n.tau * world_per_length).min(TAU_MAX);
    let mut taus = vec![[tau(&nodes[0]); 2]];
    let wide = nodes.windows(2).filter(|pair| pair[1].scalar > pair[0].scalar);
    taus.extend(wide.map(|pair| [tau(&pair[0]), tau(&pair[1])]));
    taus.push([tau(&nodes[nodes.len() - 1]); 2]);
    taus
}

/// Composites a stretch of this optical depth; returns 1 if it is visible.
#[inline(always)]
fn composite(Stretch { mean, tilt, .. }: Stretch, depth: f32, out: &mut Accumulator) -> u64 {
    if depth <= 0.0 {
        return 0;
    }
    let weights = homogeneous_weights(depth);
    let alpha = weights.near + weights.far;
    // The linear function may leave the range of colours.
    let light = (mean * alpha + tilt * (weights.far - weights.near)).clamp(Vec4::ZERO, Vec4::splat(alpha));
    out.add_premultiplied(light.with_w(alpha), alpha);
    1
}

/// Extinction times length, capped to f32: transmittance is 0 long before.
#[inline(always)]
fn depth_of(tau: f64, length: f64) -> f32 {
    (tau * length).min(f64::from(f32::MAX / 4.0)) as f32
}

impl Integrator for PartialTable {
    /// The interval in which the segment before ended.
    type Place = usize;

    #[inline(always)]
    fn enter(&self, scalar: f64) -> usize {
        self.exact.interval_at(scalar)
    }

    #[inline(always)]
    fn segment(&self, place: &mut usize, s0: f64, s1: f64, length: f64, out: &mut Accumulator) -> u64 {
        // At a node the side that the ray goes to holds; a constant segment takes the right one.
        let ascends = s1 >= s0;
        let first = self.interval_of(*place, s0, !ascends);
        let last = if s0 == s1 { first } else { self.interval_of(first, s1, ascends) };
        *place = last;
        if first == last {
            self.within(first, s0, s1, length, out)
        } else {
            self.across((first, last), s0, s1, length, out)
        }
    }

    fn exact(&self) -> &ExactTable {
        &self.exact
    }
}

#[cfg(test)]
#[path = "partial_tests.rs"]
mod tests;
