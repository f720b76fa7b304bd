//! Jittered Kuhn grids: a box of cubes, each cut into six tets along its main diagonal, possibly without some cells.
//!
//! All cubes are cut the same way, so faces of neighbours agree and the mesh conforms (Freudenthal 1942, Kuhn 1960).
//!
//! **Jitter.** Every vertex moves by at most [`JITTER`] of a cube's edge along each axis, vertices on the box only within its faces, so
//! that the box stays a box. No tet can invert: in units of the cube, the matrix of consecutive edges of a tet is a permutation of the
//! identity plus differences of two displacements, each entry within 2 * JITTER; with 6 * JITTER < 1 its rows stay strictly diagonally
//! dominant, so that its determinant keeps its sign. The bound is sharp: the least volume is 1 - 6 * JITTER of the original.

use crate::random::{hash, unit};
use glam::DVec3;
use rayon::prelude::*;

/// Largest displacement of a vertex along an axis, as a fraction of a cube's edge; below 1/6 (see above).
pub const JITTER: f64 = 0.15;

/// Corners of the six tets of a cube, positively oriented; bit 0, 1 and 2 of a corner are its x, y and z.
const TETS: [[u8; 4]; 6] = [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 1, 7, 5], [0, 2, 7, 3], [0, 4, 7, 6]];

/// A node of the grid that no cell uses.
const UNUSED: u32 = u32::MAX;

/// An axis-aligned box, possibly without some cells.
pub struct Domain {
    /// Corner with the smallest coordinates.
    pub lo: DVec3,
    /// Corner with the largest coordinates.
    pub hi: DVec3,
    /// Kept volume as a fraction of the box.
    pub fraction: f64,
    /// Whether the cell with this centroid (before jitter) is kept.
    pub keep: fn(DVec3) -> bool,
}

impl Domain {
    /// The whole box.
    pub fn full(lo: DVec3, hi: DVec3) -> Self {
        Self { lo, hi, fraction: 1.0, keep: |_| true }
    }

    /// Number of cubes along the axes for about `cells` tets, with nearly equal edges.
    ///
    /// Tries the four counts around the ideal one on each axis; the deviation from `cells` weighs ten times as much as
    /// the stretch of the cubes.
    pub fn cubes_for(&self, cells: f64) -> [u32; 3] {
        let extent = self.hi - self.lo;
        let wanted = cells / (TETS.len() as f64 * self.fraction);
        let edge = (extent.element_product() / wanted).cbrt();
        let around = (extent / edge).floor().max(DVec3::splat(1.0)).to_array().map(|n| n as u32);
        let candidates = |axis: usize| around[axis].saturating_sub(1).max(1)..=around[axis] + 2;
        let mut best = (f64::INFINITY, around);
        for x in candidates(0) {
            for y in candidates(1) {
                for z in candidates(2) {
                    let cubes = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    let edges = extent / cubes;
                    let stretch = (edges.max_element() / edges.min_element()).ln();
                    let cost = (cubes.element_product() / wanted).ln().abs() + 0.1 * stretch;
                    if cost < best.0 {
                        best = (cost, [x, y, z]);
                    }
                }
            }
        }
        best.1
    }
}

/// A grid with chosen cells and vertices; computes points and tets on request.
pub struct KuhnGrid {
    lo: DVec3,
    hi: DVec3,
    cubes: [usize; 3],
    /// One bit for each kept tet of each cube, x fastest.
    kept: Vec<u8>,
    /// Vertex at each node, x fastest, or [`UNUSED`].
    vertex_at: Vec<u32>,
}

impl KuhnGrid {
    /// The grid over `domain` whose number of tets comes nearest to `cells` in a few attempts: stepped outlines keep more
    /// or less than the domain's fraction where cells are large.
    pub fn with_cells(domain: &Domain, cells: u64) -> Self {
        const ATTEMPTS: usize = 6;
        const NEAR: f64 = 0.01;
        let off = |grid: &Self| (grid.cell_count().max(1) as f64 / cells as f64).ln();
        let mut best = Self::new(domain, domain.cubes_for(cells as f64));
        let mut aim = cells as f64;
        let mut error = off(&best);
        for _ in 1..ATTEMPTS {
            if off(&best).abs() < NEAR {
                break;
            }
            aim *= (-error).exp();
            let grid = Self::new(domain, domain.cubes_for(aim));
            error = off(&grid);
            if error.abs() < off(&best).abs() {
                best = grid;
            }
        }
        best
    }

    /// A grid of `cubes` over `domain`. The number of nodes must fit u32.
    pub fn new(domain: &Domain, cubes: [u32; 3]) -> Self {
        let cubes = cubes.map(|n| n as usize);
        let mut grid = Self { lo: domain.lo, hi: domain.hi, cubes, kept: Vec::new(), vertex_at: Vec::new() };
        let count = cubes.iter().product::<usize>();
        grid.kept = (0..count).into_par_iter().map(|cube| grid.kept_of(cube, domain.keep)).collect();
        let nodes = cubes.iter().map(|n| n + 1).product::<usize>();
        let used: Vec<bool> = (0..nodes).into_par_iter().map(|node| grid.is_used(node)).collect();
        let mut next = 0;
        let number = |used: bool| {
            next += u32::from(used);
            if used { next - 1 } else { UNUSED }
        };
        grid.vertex_at = used.into_iter().map(number).collect();
        grid
    }

    /// Number of tets.
    pub fn cell_count(&self) -> u64 {
        self.kept.par_iter().map(|kept| u64::from(kept.count_ones())).sum()
    }

    /// Coordinates of the vertices, jittered by `seed`.
    pub fn points(&self, seed: u64) -> Vec<DVec3> {
        let used: Vec<u32> =
            (0u32..).zip(&self.vertex_at).filter(|(_, v)| **v != UNUSED).map(|(node, _)| node).collect();
        used.into_par_iter().map(|node| self.point(seed, node as usize)).collect()
    }

    /// The tets, all positively oriented, cube by cube; written in place, without further memory.
    pub fn tets(&self) -> Vec<[u32; 4]> {
        let layer = self.cubes[0] * self.cubes[1];
        let cells = |kept: &[u8]| kept.iter().map(|k| k.count_ones() as usize).sum::<usize>();
        let counts: Vec<usize> = self.kept.par_chunks(layer).map(cells).collect();
        let mut tets = vec![[0; 4]; counts.iter().sum()];
        let mut rest = tets.as_mut_slice();
        let mut parts = Vec::with_capacity(counts.len());
        for (z, count) in counts.into_iter().enumerate() {
            let (part, after) = rest.split_at_mut(count);
            parts.push((z, part));
            rest = after;
        }
        parts.into_par_iter().for_each(|(z, part)| self.fill_layer(z * layer..(z + 1) * layer, part));
        tets
    }

    /// Writes the kept tets of some cubes.
    fn fill_layer(&self, cubes: std::ops::Range<usize>, out: &mut [[u32; 4]]) {
        let kept = cubes.flat_map(|cube| {
            let corners = self.corner_nodes(cube);
            let mask = self.kept[cube];
            let kept = (0..TETS.len()).filter(move |t| mask >> t & 1 != 0);
            kept.map(move |t| TETS[t].map(|corner| self.vertex_at[corners[usize::from(corner)]]))
        });
        for (slot, tet) in out.iter_mut().zip(kept) {
            *slot = tet;
        }
    }

    /// Nodes at the eight corners of a cube.
    fn corner_nodes(&self, cube: usize) -> [usize; 8] {
        let [x, y, z] = coordinates(cube, self.cubes);
        let [nx, ny] = [self.cubes[0] + 1, self.cubes[1] + 1];
        std::array::from_fn(|c| (x + (c & 1)) + nx * ((y + (c >> 1 & 1)) + ny * (z + (c >> 2))))
    }

    /// Bits of the tets of a cube whose centroids are kept.
    fn kept_of(&self, cube: usize, keep: fn(DVec3) -> bool) -> u8 {
        let [x, y, z] = coordinates(cube, self.cubes).map(|c| c as f64);
        let corner = |c: u8| DVec3::new(x + f64::from(c & 1), y + f64::from(c >> 1 & 1), z + f64::from(c >> 2));
        let centroid = |tet: &[u8; 4]| self.world(tet.iter().map(|&c| corner(c)).sum::<DVec3>() / 4.0);
        TETS.iter().enumerate().map(|(bit, tet)| u8::from(keep(centroid(tet))) << bit).sum()
    }

    /// Whether a kept tet of one of the up to eight cubes around a node has it as a vertex.
    fn is_used(&self, node: usize) -> bool {
        let at = coordinates(node, self.cubes.map(|n| n + 1));
        (0u8..8).any(|corner| {
            // The node is this corner of the cube that starts there.
            let mut start = [0; 3];
            for axis in 0..3 {
                let back = usize::from(corner >> axis & 1);
                if at[axis] < back || at[axis] - back >= self.cubes[axis] {
                    return false;
                }
                start[axis] = at[axis] - back;
            }
            let kept = self.kept[start[0] + self.cubes[0] * (start[1] + self.cubes[1] * start[2])];
            TETS.iter().enumerate().any(|(bit, tet)| kept >> bit & 1 != 0 && tet.contains(&corner))
        })
    }

    /// World coordinates of a node, jittered.
    fn point(&self, seed: u64, node: usize) -> DVec3 {
        let at = coordinates(node, self.cubes.map(|n| n + 1));
        let shifted: [f64; 3] = std::array::from_fn(|axis| {
            let on_boundary = at[axis] == 0 || at[axis] == self.cubes[axis];
            let random = unit(hash(seed, node as u64 * 3 + axis as u64));
            at[axis] as f64 + if on_boundary { 0.0 } else { JITTER * (2.0 * random - 1.0) }
        });
        self.world(DVec3::from_array(shifted))
    }

    /// World coordinates of a position in units of cubes; exact on the faces of the box.
    fn world(&self, at: DVec3) -> DVec3 {
        let part = at / DVec3::from_array(self.cubes.map(|n| n as f64));
        self.lo * (1.0 - part) + self.hi * part
    }
}

/// Grid coordinates of item `index` in a grid of `counts` items, x fastest.
fn coordinates(index: usize, counts: [usize; 3]) -> [usize; 3] {
    [index % counts[0], index / counts[0] % counts[1], index / (counts[0] * counts[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Smallest of six times the volume of any tet of a unit cube with vertices displaced by `jitter` along each axis.
    /// The volume is linear in each single coordinate, so that it is smallest where all are displaced as far as can be.
    fn smallest_volume6(jitter: f64) -> f64 {
        let mut smallest = f64::INFINITY;
        for tet in TETS {
            for signs in 0u32..1 << 12 {
                let vertex = |i: usize| {
                    let coordinate = |axis: usize| {
                        let sign = if signs >> (3 * i + axis) & 1 == 0 { -1.0 } else { 1.0 };
                        f64::from(tet[i] >> axis & 1) + sign * jitter
                    };
                    DVec3::from_array(std::array::from_fn(coordinate))
                };
                let [a, b, c, d] = std::array::from_fn(vertex);
                smallest = smallest.min((b - a).dot((c - a).cross(d - a)));
            }
        }
        smallest
    }

    #[test]
    fn no_tet_can_invert_within_the_jitter_and_some_could_beyond_a_sixth() {
        // The smallest volume is 1 - 6 * jitter: the bound is sharp. Determinants of order 1 round to about 1e-16.
        for jitter in [0.0, JITTER, 0.2] {
            assert!((smallest_volume6(jitter) - (1.0 - 6.0 * jitter)).abs() < 1e-12, "{jitter}");
        }
        assert!(smallest_volume6(JITTER) > 0.0);
    }

    #[test]
    fn extreme_seeds_and_flat_boxes_make_grids_too() {
        let flat = Domain::full(DVec3::new(-1e6, 0.0, 1e-3), DVec3::new(1e6, 1e-6, 2e-3));
        for seed in [0, u64::MAX] {
            let grid = KuhnGrid::new(&flat, [4, 1, 3]);
            let points = grid.points(seed);
            assert_eq!((points.len(), grid.tets().len() as u64), (5 * 2 * 4, grid.cell_count()));
            for tet in grid.tets() {
                let [a, b, c, d] = tet.map(|v| points[v as usize]);
                assert!((b - a).dot((c - a).cross(d - a)) > 0.0);
            }
        }
    }
}
