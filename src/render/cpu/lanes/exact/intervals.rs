//! Current intervals of the transfer function of eight rays.

use super::super::vector::{Eight, LANES, Lanes};
use super::EightF32;
use crate::optics::exact::IntervalRow;
use pulp::cast;
use std::arch::x86_64::__m256;

/// The table intervals that hold the last scalars.
#[derive(Clone, Copy)]
pub(super) struct Intervals<F, G> {
    pub(super) lo: F,
    pub(super) hi: F,
    /// `lo` of the intervals below, and `hi` of those above.
    pub(super) below: F,
    pub(super) above: F,
    /// The foot, from which shares are counted; 0 where constant.
    pub(super) origin: F,
    pub(super) per_width: F,
    /// Red, green, blue and extinction at the foot, and their rise to the other end.
    pub(super) at_foot: [G; 4],
    pub(super) rise: [G; 4],
}

/// The intervals of [`ExactLights`] in registers.
pub(super) type InRegisters<L> = Intervals<<L as Lanes>::F, __m256>;

impl Intervals<Eight, EightF32> {
    #[inline(always)]
    pub(super) fn load<L: Lanes>(&self, lanes: L) -> InRegisters<L> {
        Intervals {
            lo: lanes.load(&self.lo),
            hi: lanes.load(&self.hi),
            below: lanes.load(&self.below),
            above: lanes.load(&self.above),
            origin: lanes.load(&self.origin),
            per_width: lanes.load(&self.per_width),
            at_foot: cast(self.at_foot),
            rise: cast(self.rise),
        }
    }
}

impl<F: Copy> Intervals<F, __m256> {
    #[inline(always)]
    pub(super) fn store<L: Lanes<F = F>>(&self, lanes: L) -> Intervals<Eight, EightF32> {
        Intervals {
            lo: lanes.store(self.lo),
            hi: lanes.store(self.hi),
            below: lanes.store(self.below),
            above: lanes.store(self.above),
            origin: lanes.store(self.origin),
            per_width: lanes.store(self.per_width),
            at_foot: cast(self.at_foot),
            rise: cast(self.rise),
        }
    }

    /// How far scalars are from the foot, in widths; 0 in lanes outside `mask`.
    #[inline(always)]
    pub(super) fn share<L: Lanes<F = F>>(&self, lanes: L, mask: L::M, scalar: F) -> __m256 {
        let share = lanes.mul(lanes.sub(scalar, self.origin), self.per_width);
        lanes.to_f32(lanes.select(mask, share, lanes.splat(0.0)))
    }

    /// Red, green, blue or extinction at a share.
    #[inline(always)]
    pub(super) fn value<L: Lanes<F = F>>(&self, lanes: L, i: usize, share: __m256) -> __m256 {
        lanes.add_f32(self.at_foot[i], lanes.mul_f32(self.rise[i], share))
    }

    /// Sets a lane's interval. Whole vectors are written, since they are read as such immediately afterwards.
    #[inline(always)]
    pub(super) fn set<L: Lanes<F = F>>(&mut self, lanes: L, lane: usize, row: &IntervalRow) {
        let mask = lanes.mask(1 << lane);
        let [lo, hi, origin, per_width] = row.bounds;
        self.lo = lanes.select(mask, lanes.splat(lo), self.lo);
        self.hi = lanes.select(mask, lanes.splat(hi), self.hi);
        let [below, above, ..] = row.around;
        self.below = lanes.select(mask, lanes.splat(below), self.below);
        self.above = lanes.select(mask, lanes.splat(above), self.above);
        self.origin = lanes.select(mask, lanes.splat(origin), self.origin);
        self.per_width = lanes.select(mask, lanes.splat(per_width), self.per_width);
        for i in 0..4 {
            self.at_foot[i] = lanes.select_f32(mask, lanes.splat_f32(row.values[i]), self.at_foot[i]);
            self.rise[i] = lanes.select_f32(mask, lanes.splat_f32(row.values[4 + i]), self.rise[i]);
        }
    }

    /// The intervals of all lanes.
    #[inline(always)]
    pub(super) fn of_all<L: Lanes<F = F>>(lanes: L, rows: [&IntervalRow; LANES]) -> Self {
        let [a, b, c, d, e, f, g, h] = rows;
        let bounds = [a, b, c, d, e, f, g, h].map(|row| &row.bounds);
        let [lo, hi, origin, per_width] = lanes.transpose(bounds);
        let [below, above, ..] = lanes.transpose([a, b, c, d, e, f, g, h].map(|row| &row.around));
        let values = [a, b, c, d, e, f, g, h].map(|row| &row.values);
        let [r, g, b, tau, dr, dg, db, dtau] = lanes.transpose_f32(values);
        Self { lo, hi, below, above, origin, per_width, at_foot: [r, g, b, tau], rise: [dr, dg, db, dtau] }
    }
}
