//! The triangles of single cells, whose corners are named by edges.

use super::Crossing;
use crate::mesh::FACE_VERTICES;
use glam::DVec3;
use rayon::prelude::*;

/// An edge of the mesh, or a vertex as an edge from it to itself: the lower vertex in the upper half.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key(u64);

impl Key {
    pub(super) fn edge(a: u32, b: u32) -> Self {
        Self(u64::from(a.min(b)) << 32 | u64::from(a.max(b)))
    }

    pub(super) fn vertex(v: u32) -> Self {
        Self::edge(v, v)
    }

    pub(super) fn low(self) -> u32 {
        (self.0 >> 32) as u32
    }

    pub(super) fn high(self) -> u32 {
        self.0 as u32
    }

    pub(super) fn crossing(self, t: f64) -> Crossing {
        Crossing { low: self.low(), high: self.high(), t }
    }
}

/// Triangles as they come from the cells.
#[derive(Default)]
pub(super) struct Triangles {
    /// Of each triangle its corners.
    pub(super) keys: Vec<[Key; 3]>,
    /// Triangles without area that were left out.
    pub(super) dropped: u64,
}

impl Triangles {
    /// The triangles of all cells in their order, found in parallel: `add` gets the index of a cell, its vertices, and where to put its
    /// triangles.
    pub(super) fn collect(tets: &[[u32; 4]], add: impl Fn(usize, &[u32; 4], &mut Self) + Sync) -> Self {
        /// Cells that one thread works on in well under a millisecond.
        const RUN: usize = 1 << 14;
        let of_run = |(run, cells): (usize, &[[u32; 4]])| {
            let mut triangles = Self::default();
            for (i, tet) in cells.iter().enumerate() {
                add(run * RUN + i, tet, &mut triangles);
            }
            triangles
        };
        let runs: Vec<Self> = tets.par_chunks(RUN).enumerate().map(of_run).collect();
        let mut all = Self { keys: Vec::with_capacity(runs.iter().map(|run| run.keys.len()).sum()), dropped: 0 };
        for run in runs {
            all.keys.extend(run.keys);
            all.dropped += run.dropped;
        }
        all
    }

    /// Adds a triangle unless two of its corners are one.
    fn add(&mut self, [a, b, c]: [Key; 3]) {
        if a == b || b == c || c == a {
            self.dropped += 1;
        } else {
            self.keys.push([a, b, c]);
        }
    }
}

/// A scalar and the value at which it is cut.
pub(super) struct Cut<'a, L> {
    /// World coordinates of the vertices.
    pub(super) points: &'a [DVec3],
    /// The scalar at a vertex.
    pub(super) level: L,
    /// The value.
    pub(super) value: f64,
}

/// For each set of two vertices of a cell that are above (bits of a mask) these two and the other two, as an even permutation: a cell of
/// which the vertices are taken in this order is still positively oriented.
const PAIRS: [(u8, [usize; 4]); 6] = [
    (0b0011, [0, 1, 2, 3]),
    (0b0101, [0, 2, 3, 1]),
    (0b1001, [0, 3, 1, 2]),
    (0b0110, [1, 2, 0, 3]),
    (0b1010, [1, 3, 2, 0]),
    (0b1100, [2, 3, 0, 1]),
];

impl<L: Fn(u32) -> f64> Cut<'_, L> {
    /// The point of an edge whose ends lie on both sides of the surface, or at an end of it.
    pub(super) fn crossing(&self, key: Key) -> (Crossing, DVec3) {
        let (low, high) = (key.low(), key.high());
        let [from, to] = [low, high].map(|v| self.points[v as usize]);
        if low == high {
            return (key.crossing(0.0), from);
        }
        let [at_low, at_high] = [low, high].map(|v| (self.level)(v));
        let t = ((self.value - at_low) / (at_high - at_low)).clamp(0.0, 1.0);
        let way = to - from;
        // An edge may be longer than the largest number, as its ends are not.
        let point = if way.is_finite() { from + t * way } else { (1.0 - t) * from + t * to };
        (key.crossing(t), point.clamp(from.min(to), from.max(to)))
    }

    /// The key of the point between two vertices: that of a vertex where it cannot be told from it.
    fn corner(&self, a: u32, b: u32) -> Key {
        let key = Key::edge(a, b);
        let (Crossing { low, high, t }, point) = self.crossing(key);
        let is_at = |v: u32, end: f64| t == end || point == self.points[v as usize];
        if is_at(low, 0.0) {
            Key::vertex(low)
        } else if is_at(high, 1.0) {
            Key::vertex(high)
        } else {
            key
        }
    }

    /// Adds the triangles of a positively oriented cell. Normals point to where the scalar is below the value.
    pub(super) fn add_cell(&self, tet: [u32; 4], out: &mut Triangles) {
        let is_above = tet.map(|v| (self.level)(v) >= self.value);
        let mask = (0..4).fold(0, |mask, i| mask | u8::from(is_above[i]) << i);
        match mask.count_ones() {
            // Seen from its single vertex on a side, the others are in the order of the face opposite.
            1 => out.add(self.around(tet, mask.trailing_zeros() as usize)),
            3 => {
                let [a, b, c] = self.around(tet, (!mask).trailing_zeros() as usize);
                out.add([a, c, b]);
            }
            2 => {
                if let Some((_, order)) = PAIRS.iter().find(|(pair, _)| *pair == mask) {
                    self.add_quad(order.map(|i| tet[i]), out);
                }
            }
            _ => {}
        }
    }

    /// The points of the three edges at a vertex, counter-clockwise seen from the face opposite.
    fn around(&self, tet: [u32; 4], i: usize) -> [Key; 3] {
        FACE_VERTICES[i].map(|other| self.corner(tet[i], tet[other]))
    }

    /// The quadrilateral of a positively oriented cell of which the first two vertices are above, parted along its shorter diagonal.
    fn add_quad(&self, [a, b, c, d]: [u32; 4], out: &mut Triangles) {
        let [p, q, r, s] = [(a, c), (a, d), (b, d), (b, c)].map(|(above, below)| self.corner(above, below));
        let length = |k: Key, l: Key| self.crossing(k).1.distance_squared(self.crossing(l).1);
        if length(p, r) <= length(q, s) {
            out.add([p, q, r]);
            out.add([r, s, p]);
        } else {
            out.add([q, r, s]);
            out.add([s, p, q]);
        }
    }
}
