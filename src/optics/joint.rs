//! The exact integrator for a [`JointTable`]: a segment is split where it crosses a line of the table (a scalar node, a row, the
//! diagonal of a rectangle), and each piece is integrated by [`piece_weights`].
//!
//! Positions on a segment are shares of it, 0 at its near and 1 at its far end. The rectangle that contains a piece is counted from line to
//! line, not looked up: on a line rounding would decide it. A piece that ends on a line has exactly the values of the line there, so that
//! nothing transparent on one side becomes visible.

use super::{Accumulator, ScalarMap, piece_weights};
use crate::node_table::JointTable;
use glam::Vec4;

/// A segment of a ray in a cell, as a line through a [`JointTable`].
#[derive(Clone, Copy, Debug)]
pub struct JointSegment<'a> {
    table: &'a JointTable,
    /// Scalars at the near and at the far end.
    scalars: [f64; 2],
    vertex_values: [f64; 2],
    layers: [usize; 2],
    /// Weight of the upper of the two layers.
    layer_share: f32,
}

/// A part of a segment on which values are linear: its ends as shares of the segment, and red, green, blue and extinction there.
struct Piece {
    shares: [f64; 2],
    values: [Vec4; 2],
}

impl<'a> JointSegment<'a> {
    /// The line between two (scalar, value at vertices) points, all finite, in a cell with value `cell_value`.
    pub fn new(table: &'a JointTable, scalars: [f64; 2], vertex_values: [f64; 2], cell_value: f64) -> Self {
        let (layers, share) = table.layer_at(cell_value);
        Self { table, scalars, vertex_values, layers, layer_share: share as f32 }
    }

    /// Composites the part of the segment between two shares of it, `from` < `to`, of this length in the unit that extinctions refer to.
    /// Returns the number of pieces that were integrated; 0 if nothing was visible.
    pub fn composite(&self, from: f64, to: f64, length: f64, out: &mut Accumulator) -> u64 {
        // The largest depth that stays finite when it is averaged.
        const DEEPEST: f32 = f32::MAX / 4.0;
        let per_share = length / (to - from);
        let mut count = 0;
        self.each_piece(from, to, |Piece { shares: [start, end], values }| {
            let length = ((end - start) * per_share) as f32;
            let [near, far] = values.map(|value| (value.w * length).min(DEEPEST));
            if near > 0.0 || far > 0.0 {
                let [near_color, far_color] = values.map(|value| value.with_w(1.0));
                out.add(piece_weights(near, far), near_color, far_color);
                count += 1;
            }
        });
        count
    }

    /// The share of the whole segment at which the first piece with extinction between `from` and `to` begins.
    pub fn first_visible(&self, from: f64, to: f64) -> Option<f64> {
        let mut first = None;
        self.each_piece(from, to, |Piece { shares, values }| {
            if first.is_none() && values.iter().any(|value| value.w > 0.0) {
                first = Some(shares[0]);
            }
        });
        first
    }

    fn each_piece(&self, from: f64, to: f64, mut take: impl FnMut(Piece)) {
        // Outside of all rectangles values are as below the diagonal: (1, 0) is its corner.
        let mut x = Way::new(self.table.scalars(), self.scalars, from, 1.0);
        let mut y = Way::new(self.table.vertex_axis(), self.vertex_values, from, 0.0);
        let mut start = from;
        loop {
            let (x_crosses, y_crosses) = (x.crosses_at(), y.crosses_at());
            let next = x_crosses.min(y_crosses);
            let is_last = next >= to;
            // Rounding may put `start` beyond the next line.
            let end = next.min(to).max(start);
            let (x_crosses, y_crosses) = (!is_last && x_crosses <= end, !is_last && y_crosses <= end);
            let (near, far) = ([x.place, y.place], [x.place_at(end, x_crosses), y.place_at(end, y_crosses)]);
            if end > start {
                self.in_rectangle([x.corners(), y.corners()], [near, far], [start, end], &mut take);
            }
            if is_last {
                return;
            }
            x.go_on(far[0], x_crosses);
            y.go_on(far[1], y_crosses);
            start = end;
        }
    }

    /// The part of the segment within one rectangle, given by its `corners` on both axes: one piece, or two if it crosses the diagonal.
    /// `ends` are positions in the rectangle, 0..=1 on both axes.
    fn in_rectangle(
        &self,
        corners: [[usize; 2]; 2],
        [near, far]: [[f64; 2]; 2],
        [start, end]: [f64; 2],
        take: &mut impl FnMut(Piece),
    ) {
        let below = |[x, y]: [f64; 2]| x - y;
        let (first, last) = (below(near), below(far));
        let mut piece = |ends: [[f64; 2]; 2], shares, is_below| {
            let triangle = self.triangle(corners, is_below);
            take(Piece { shares, values: ends.map(|at| in_triangle(triangle, at, is_below)) });
        };
        if first * last < 0.0 {
            let share = first / (first - last);
            let middle = [near[0] + share * (far[0] - near[0]); 2];
            let cut = (start + share * (end - start)).clamp(start, end);
            piece([near, middle], [start, cut], first > 0.0);
            piece([middle, far], [cut, end], last > 0.0);
        } else {
            piece([near, far], [start, end], first + last >= 0.0);
        }
    }

    /// Values at the corners of the triangle below or above a rectangle's diagonal: lower end of the diagonal, third corner, upper end.
    #[inline]
    fn triangle(&self, [xs, ys]: [[usize; 2]; 2], is_below: bool) -> [Vec4; 3] {
        let beside = if is_below { self.corner(xs[1], ys[0]) } else { self.corner(xs[0], ys[1]) };
        [self.corner(xs[0], ys[0]), beside, self.corner(xs[1], ys[1])]
    }

    #[inline]
    fn corner(&self, scalar: usize, row: usize) -> Vec4 {
        let [below, above] = self.layers.map(|layer| Vec4::from_array(self.table.value(scalar, row, layer)));
        below * (1.0 - self.layer_share) + above * self.layer_share
    }
}

/// Values at a position in a rectangle, interpolated in one of its triangles.
#[inline]
fn in_triangle([lower, beside, upper]: [Vec4; 3], [x, y]: [f64; 2], is_below: bool) -> Vec4 {
    let (more, less) = if is_below { (x, y) } else { (y, x) };
    // Weights are not negative: what is transparent at all corners is transparent in between.
    let [of_lower, of_beside, of_upper] = [1.0 - more, more - less, less].map(|weight| weight.max(0.0) as f32);
    lower * of_lower + beside * of_beside + upper * of_upper
}

/// A table in the layout of `shaders/lib/optics_joint.wgsl`.
pub struct PackedJoint {
    /// Intervals of the scalar, then of the rows: (lo, hi, width, index of the first place); the first and the last are unbounded and have
    /// no width. Then the values in the order of the table, extinctions per unit of a ray's length.
    pub words: Vec<[f32; 4]>,
    /// Number of intervals of the scalar.
    pub scalar_intervals: u32,
    /// Number of intervals of the rows.
    pub row_intervals: u32,
}

/// Most vectors of a packed table.
pub fn packed_len(table: &JointTable) -> usize {
    let (scalars, rows, layers) = (table.scalars().len(), table.vertex_axis().len(), table.cell_axis().len());
    scalars + 1 + rows + 1 + scalars * rows * layers
}

/// Packs the table over scalars and rows seen through these maps; `world_per_length` is the world length of one unit of a ray's length.
pub fn packed(table: &JointTable, scalars: ScalarMap, rows: ScalarMap, world_per_length: f64) -> PackedJoint {
    let mut words = Vec::with_capacity(packed_len(table));
    words.extend(intervals(table.scalars(), scalars));
    let scalar_intervals = words.len() as u32;
    words.extend(intervals(table.vertex_axis(), rows));
    let row_intervals = words.len() as u32 - scalar_intervals;
    // The largest extinction that stays finite when it is averaged.
    let tau = |tau: f32| (f64::from(tau) * world_per_length).min(f64::from(f32::MAX / 4.0)) as f32;
    words.extend(table.values().iter().map(|&[r, g, b, t]| [r, g, b, tau(t)]));
    PackedJoint { words, scalar_intervals, row_intervals }
}

/// The intervals between the positions of an axis, none at steps. Widths are those before rounding, as in
/// [`ExactTable::packed`](super::exact::ExactTable::packed).
fn intervals(axis: &[f64], map: ScalarMap) -> impl Iterator<Item = [f32; 4]> {
    const FAR: f64 = 3e38;
    // The inverse of a narrower one is beyond f32.
    const NARROWEST: f64 = 1e-30;
    let between = move |i: usize| {
        let width = ((axis[i] - axis[i - 1]) * map.prescale * map.scale).min(FAR);
        let width = if width < NARROWEST { 0.0 } else { width };
        [map.place(axis[i - 1]), map.place(axis[i]), width as f32, (i - 1) as f32]
    };
    let inner = (1..axis.len()).filter(|&i| axis[i] > axis[i - 1]).map(between);
    let last = axis.len() - 1;
    let first = [-FAR as f32, map.place(axis[0]), 0.0, 0.0];
    std::iter::once(first).chain(inner).chain([[map.place(axis[last]), FAR as f32, 0.0, last as f32]])
}

/// State of a segment along one axis.
struct Way<'a> {
    axis: &'a [f64],
    /// Value at its near end, and the rise to its far end.
    start: f64,
    rise: f64,
    /// Number of axis positions below: it lies between the last of these and the next.
    below: usize,
    /// Share of the way between these two positions.
    place: f64,
    /// Value of `place` beyond the ends of the axis, where it has no effect.
    outside: f64,
}

impl<'a> Way<'a> {
    fn new(axis: &'a [f64], [start, end]: [f64; 2], from: f64, outside: f64) -> Self {
        let rise = end - start;
        let here = start + from * rise;
        // At a step the side that the segment goes to holds; a constant one takes the right side.
        let below = axis.partition_point(|&place| if rise < 0.0 { place < here } else { place <= here });
        let mut way = Self { axis, start, rise, below, place: outside, outside };
        way.place = way.place_at(from, false);
        way
    }

    /// Indices of the axis positions around it; beyond the ends of the axis twice the same.
    fn corners(&self) -> [usize; 2] {
        [self.below.saturating_sub(1), self.below.min(self.axis.len() - 1)]
    }

    /// The share of the segment at which it reaches the next axis position; infinite if it does not.
    fn crosses_at(&self) -> f64 {
        let next = match self.rise {
            rise if rise > 0.0 => self.axis.get(self.below),
            rise if rise < 0.0 => self.below.checked_sub(1).map(|last| &self.axis[last]),
            _ => None,
        };
        next.map_or(f64::INFINITY, |next| (next - self.start) / self.rise)
    }

    /// Share of the way between the two axis positions at a share of the segment; exactly on the next one if it `crosses`.
    fn place_at(&self, share: f64, crosses: bool) -> f64 {
        let [lo, hi] = self.corners().map(|i| self.axis[i]);
        match (lo < hi, crosses) {
            (false, _) => self.outside,
            (true, true) => f64::from(u8::from(self.rise > 0.0)),
            (true, false) => ((self.start + share * self.rise - lo) / (hi - lo)).clamp(0.0, 1.0),
        }
    }

    /// Moves to a share, or, if it `crosses`, past the next axis position; both positions of a step are passed together.
    fn go_on(&mut self, place: f64, crosses: bool) {
        self.place = place;
        if !crosses {
            return;
        }
        let is_rising = self.rise > 0.0;
        loop {
            self.below = if is_rising { self.below + 1 } else { self.below - 1 };
            let [lo, hi] = self.corners();
            if lo == hi {
                self.place = self.outside;
                return;
            }
            if self.axis[lo] < self.axis[hi] {
                self.place = if is_rising { 0.0 } else { 1.0 };
                return;
            }
        }
    }
}

#[cfg(test)]
#[path = "joint_tests.rs"]
mod tests;
