//! Meshes and random numbers shared by several test modules.

use super::{Cells, Mesh, RawMesh};
use crate::random::SplitMix64;
use glam::DVec3;
use std::sync::Arc;

/// Random numbers that are repeatable from their seed, which a failing property prints.
pub struct Random(SplitMix64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    pub fn next(&mut self) -> u64 {
        self.0.next_u64()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// Uniform in [-1, 1), a multiple of 2^-23: exact in f32, sums of a few in f64, but not products of three.
    pub fn signed(&mut self) -> f64 {
        self.below(1 << 24) as f64 / f64::from(1 << 23) - 1.0
    }

    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

/// A cloud of balls: middle and radius; and their volumes, if they have some. Points are in the order of a curve; those of one place as given.
pub fn cloud(balls: &[(DVec3, f64)], volumes: &[f64]) -> Arc<Mesh> {
    let (points, radii): (Vec<_>, Vec<_>) = balls.iter().copied().unzip();
    let cells =
        Cells { points: (0..balls.len() as u32).collect(), radii, volumes: volumes.to_vec(), ..Cells::default() };
    Arc::new(Mesh::build_cloud(&RawMesh { points, cells }).unwrap().0)
}

/// The six paths from a cube's first corner to its last along the axes: H. W. Kuhn's subdivision, which matches between cubes. Beside each,
/// whether it is an even permutation.
const AXIS_PATHS: [([usize; 3], bool); 6] = [
    ([0, 1, 2], true),
    ([1, 2, 0], true),
    ([2, 0, 1], true),
    ([0, 2, 1], false),
    ([2, 1, 0], false),
    ([1, 0, 2], false),
];

/// Unit cubes at integer coordinates, six positive tets each, for the cubes that `keep` accepts. Points of other cubes are included.
pub fn kuhn_grid_of([nx, ny, nz]: [usize; 3], keep: impl Fn([usize; 3]) -> bool) -> RawMesh {
    let coordinates =
        |n: [usize; 3]| (0..n[2]).flat_map(move |z| (0..n[1]).flat_map(move |y| (0..n[0]).map(move |x| [x, y, z])));
    let vertex = |[x, y, z]: [usize; 3]| (x + (nx + 1) * (y + (ny + 1) * z)) as u32;
    let points = coordinates([nx + 1, ny + 1, nz + 1]).map(|p| DVec3::from_array(p.map(|i| i as f64))).collect();
    let mut tets = Vec::new();
    for cube in coordinates([nx, ny, nz]).filter(|&cube| keep(cube)) {
        for (path, is_even) in AXIS_PATHS {
            let mut corner = cube;
            let mut tet = [vertex(corner); 4];
            for (axis, v) in path.into_iter().zip(&mut tet[1..]) {
                corner[axis] += 1;
                *v = vertex(corner);
            }
            if !is_even {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    RawMesh { points, cells: tets.into() }
}

/// All cubes of a grid.
pub fn kuhn_grid(n: [usize; 3]) -> RawMesh {
    kuhn_grid_of(n, |_| true)
}

/// Points moved by up to an eighth of a cube along each axis. Every tet stays positive: a plane through all four moved
/// corners would pass within sqrt(3) / 8 = 0.22 of each corner, but half the tet's width is 1 / sqrt(12) = 0.29.
pub fn jittered(mut raw: RawMesh, random: &mut Random) -> RawMesh {
    for p in &mut raw.points {
        *p += 0.125 * DVec3::from_array(std::array::from_fn(|_| random.signed()));
    }
    raw
}

/// The same mesh with points and cells in random order, and the old index of each new point.
pub fn shuffled(raw: &RawMesh, random: &mut Random) -> (RawMesh, Vec<u32>) {
    let mut old: Vec<u32> = (0..raw.points.len() as u32).collect();
    random.shuffle(&mut old);
    let mut new = vec![0; old.len()];
    for (i, &v) in (0u32..).zip(&old) {
        new[v as usize] = i;
    }
    let mut tets: Vec<_> = raw.cells.tets.iter().map(|tet| tet.map(|v| new[v as usize])).collect();
    random.shuffle(&mut tets);
    (RawMesh { points: old.iter().map(|&v| raw.points[v as usize]).collect(), cells: tets.into() }, old)
}

/// Every cell with vertices of its own, in random order, its corners turned.
pub fn torn(raw: &RawMesh, random: &mut Random) -> RawMesh {
    let mut points = Vec::new();
    let mut tets = Vec::new();
    for tet in &raw.cells.tets {
        let first = points.len() as u32;
        points.extend(tet.map(|v| raw.points[v as usize]));
        let turned = [[0, 1, 2, 3], [1, 2, 0, 3], [1, 0, 3, 2], [3, 2, 1, 0]][random.below(4)];
        tets.push(turned.map(|i| first + i));
    }
    shuffled(&RawMesh { points, cells: tets.into() }, random).0
}
