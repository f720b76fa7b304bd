//! A box of hexahedra, wedges, pyramids, tetrahedra, and polyhedra beside refined cells.

use crate::meshes::noise;
use glam::DVec3;
use std::collections::HashMap;
use tetreel::mesh::polyhedron::close;
use tetreel::mesh::{Cells, RawMesh, SolidShape, Solids, split};

/// Cells along each axis. Places are counted in halves of a cell.
const N: usize = 4;

/// A place in halves of a cell.
type Place = [usize; 3];

/// The cells that are eight hexahedra.
const REFINED: [Place; 4] = [[0, 0, 0], [3, 2, 1], [2, 2, 2], [1, 3, 3]];

/// The box from -1 to 1; planes between cells are not evenly spaced.
pub fn box_of_shapes() -> RawMesh {
    let mut shapes = Shapes::default();
    // Corners are numbered in order, so that the diagonals of wedges begin at the lowest corner of their cell.
    for place in all(N + 1) {
        shapes.point(place.map(|i| 2 * i));
    }
    for cell in all(N) {
        shapes.add(cell);
    }
    shapes.mesh
}

/// The places of a grid with `count` along each axis.
fn all(count: usize) -> impl Iterator<Item = Place> {
    (0..count.pow(3)).map(move |i| [i % count, i / count % count, i / count / count])
}

#[derive(Default)]
struct Shapes {
    mesh: RawMesh,
    numbers: HashMap<Place, u32>,
}

impl Shapes {
    fn point(&mut self, place: Place) -> u32 {
        *self.numbers.entry(place).or_insert_with(|| {
            let along = |axis: usize| {
                let i = place[axis];
                let is_inside = i > 0 && i < 2 * N;
                let shift = if is_inside { 0.3 * noise(axis as u64, i as u64) } else { 0.0 };
                (i as f64 + shift) / N as f64 - 1.0
            };
            self.mesh.points.push(DVec3::new(along(0), along(1), along(2)));
            self.mesh.points.len() as u32 - 1
        })
    }

    /// Corners of a box as VTK numbers them.
    fn corners(&mut self, from: Place, side: usize) -> [u32; 8] {
        let of = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
        of.map(|[x, y, z]| self.point([from[0] + side * x, from[1] + side * y, from[2] + side * z]))
    }

    fn push(&mut self, shape: SolidShape, corners: &[u32]) {
        self.mesh.cells.solids.push(shape, corners.iter().copied());
    }

    fn add(&mut self, cell: Place) {
        let from = cell.map(|i| 2 * i);
        if REFINED.contains(&cell) {
            for child in all(2) {
                let corners = self.corners([0, 1, 2].map(|axis| from[axis] + child[axis]), 1);
                self.push(SolidShape::Hexahedron, &corners);
            }
            return;
        }
        let mut faces = self.faces(cell);
        close(&mut faces).unwrap();
        if faces.len() > 6 || faces.iter().any(|face| face.len() > 4) {
            self.mesh.cells.solids.push_polyhedron(faces.iter().map(Vec::as_slice));
            return;
        }
        let corners = self.corners(from, 2);
        let of = |at: &[usize]| at.iter().map(|&i| corners[i]).collect::<Vec<_>>();
        match (cell[0] + 2 * cell[1] + 3 * cell[2]) % 4 {
            0 => self.push(SolidShape::Hexahedron, &corners),
            1 => {
                self.push(SolidShape::Wedge, &of(&[0, 1, 2, 4, 5, 6]));
                self.push(SolidShape::Wedge, &of(&[0, 2, 3, 4, 6, 7]));
            }
            2 => {
                let middle = self.point(from.map(|i| i + 1));
                for face in faces {
                    self.push(SolidShape::Pyramid, &[&face[..], &[middle]].concat());
                }
            }
            _ => {
                let mut solids = Solids::default();
                solids.push(SolidShape::Hexahedron, corners.into_iter());
                let split = split(Cells { solids, ..Cells::default() }, &[]);
                self.mesh.cells.tets.extend(split.tets);
            }
        }
    }

    /// The faces of a cell: of a side beside a refined cell four; edges of refined cells have a further vertex.
    fn faces(&mut self, cell: Place) -> Vec<Vec<u32>> {
        let mut faces = Vec::new();
        for axis in 0..3 {
            for is_upper in [false, true] {
                let at = |u: usize, v: usize| {
                    let mut place = cell.map(|i| 2 * i);
                    place[axis] += 2 * usize::from(is_upper);
                    place[(axis + 1) % 3] += u;
                    place[(axis + 2) % 3] += v;
                    place
                };
                let is_refined = beside(cell, axis, is_upper).is_some_and(|other| REFINED.contains(&other));
                if is_refined {
                    for [u, v] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                        let quad = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
                        faces.push(quad.map(|place| self.point(place)).to_vec());
                    }
                    continue;
                }
                let around = [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]].map(|[u, v]| at(u, v));
                let kept = around.into_iter().enumerate().filter(|(i, place)| i % 2 == 0 || is_of_refined(*place));
                faces.push(kept.map(|(_, place)| self.point(place)).collect());
            }
        }
        faces
    }
}

/// The cell on the other side of a side.
fn beside(cell: Place, axis: usize, is_upper: bool) -> Option<Place> {
    let mut other = cell;
    other[axis] = if is_upper { cell[axis] + 1 } else { cell[axis].checked_sub(1)? };
    (other[axis] < N).then_some(other)
}

/// Whether a place on an edge of cells is one of a refined cell.
fn is_of_refined(place: Place) -> bool {
    REFINED.iter().any(|cell| (0..3).all(|axis| (2 * cell[axis]..=2 * cell[axis] + 2).contains(&place[axis])))
}
