//! The triangles of single cells, with corners keyed by mesh edges.

use super::Crossing;
use crate::mesh::FACE_VERTICES;
use glam::DVec3;
use rayon::prelude::*;

/// Key of a point on an edge of the mesh, with the lower vertex in the upper half; a vertex is the edge from it to itself.
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

/// Triangles in the order of the cells.
#[derive(Default)]
pub(super) struct Triangles {
    /// Corner keys of each triangle.
    pub(super) keys: Vec<[Key; 3]>,
    /// The cell of each triangle.
    pub(super) cells: Vec<u32>,
    /// The cell whose triangles are being added.
    cell: u32,
    /// Triangles without area that were left out.
    pub(super) dropped: u64,
}

impl Triangles {
    /// The triangles of all cells in their order, found in parallel: `add` gets the index of a cell, its vertices, and where to put its
    /// triangles.
    pub(super) fn collect(tets: &[[u32; 4]], add: impl Fn(u32, &[u32; 4], &mut Self) + Sync) -> Self {
        /// Cells per task; one thread takes well under a millisecond for them.
        const RUN: usize = 1 << 14;
        let of_run = |(run, cells): (usize, &[[u32; 4]])| {
            let mut triangles = Self::default();
            for (i, tet) in cells.iter().enumerate() {
                triangles.cell = (run * RUN + i) as u32;
                add(triangles.cell, tet, &mut triangles);
            }
            triangles
        };
        let runs: Vec<Self> = tets.par_chunks(RUN).enumerate().map(of_run).collect();
        let count = runs.iter().map(|run| run.keys.len()).sum();
        let mut all = Self { keys: Vec::with_capacity(count), cells: Vec::with_capacity(count), ..Self::default() };
        for run in runs {
            all.keys.extend(run.keys);
            all.cells.extend(run.cells);
            all.dropped += run.dropped;
        }
        all
    }

    /// Adds a triangle.
    pub(super) fn push(&mut self, corners: [Key; 3]) {
        self.keys.push(corners);
        self.cells.push(self.cell);
    }

    /// Adds a triangle unless two of its corners coincide.
    fn add(&mut self, [a, b, c]: [Key; 3]) {
        if a == b || b == c || c == a {
            self.dropped += 1;
        } else {
            self.push([a, b, c]);
        }
    }
}

/// A scalar and its isovalue.
pub(super) struct Cut<'a, L> {
    /// World coordinates of the vertices.
    pub(super) points: &'a [DVec3],
    /// The scalar at a vertex.
    pub(super) level: L,
    /// The isovalue.
    pub(super) value: f64,
}

/// For each pair of vertices above the isovalue (a bit mask): the pair and then the other two, as an even permutation, so that a cell with
/// its vertices in this order is still positively oriented.
const PAIRS: [(u8, [usize; 4]); 6] = [
    (0b0011, [0, 1, 2, 3]),
    (0b0101, [0, 2, 3, 1]),
    (0b1001, [0, 3, 1, 2]),
    (0b0110, [1, 2, 0, 3]),
    (0b1010, [1, 3, 2, 0]),
    (0b1100, [2, 3, 0, 1]),
];

impl<L: Fn(u32) -> f64> Cut<'_, L> {
    /// The point of an edge that crosses the surface, or the vertex where the surface meets it.
    pub(super) fn crossing(&self, key: Key) -> (Crossing, DVec3) {
        let (low, high) = (key.low(), key.high());
        let [from, to] = [low, high].map(|v| self.points[v as usize]);
        if low == high {
            return (key.crossing(0.0), from);
        }
        let [at_low, at_high] = [low, high].map(|v| (self.level)(v));
        let t = ((self.value - at_low) / (at_high - at_low)).clamp(0.0, 1.0);
        let way = to - from;
        // The difference of the ends may overflow although the ends are finite.
        let point = if way.is_finite() { from + t * way } else { (1.0 - t) * from + t * to };
        (key.crossing(t), point.clamp(from.min(to), from.max(to)))
    }

    /// Key of the crossing between two vertices; that of a vertex if the crossing rounds to it.
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

    /// Adds the triangles of a positively oriented cell, with normals towards lower scalars.
    pub(super) fn add_cell(&self, tet: [u32; 4], out: &mut Triangles) {
        let is_above = tet.map(|v| (self.level)(v) >= self.value);
        let mask = (0..4).fold(0, |mask, i| mask | u8::from(is_above[i]) << i);
        match mask.count_ones() {
            // Seen from the single vertex on one side, the others have the order of the opposite face.
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

    /// The crossings on the three edges at a vertex, counter-clockwise seen from the opposite face.
    fn around(&self, tet: [u32; 4], i: usize) -> [Key; 3] {
        FACE_VERTICES[i].map(|other| self.corner(tet[i], tet[other]))
    }

    /// Adds the quadrilateral of a positively oriented cell whose first two vertices are above, split along its shorter diagonal.
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
