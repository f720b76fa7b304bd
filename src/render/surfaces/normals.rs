//! Gradients at vertices, for smooth normals.
//!
//! The vector of a vertex is the mean of the gradients in its cells, weighted by their volumes. A gradient times six volumes is the sum
//! of cross products r_a b x c + r_b c x a + r_c a x b (edges a, b, c from one corner, rises r of the scalar along them), without
//! division, so that slivers count no more than their volume.

use crate::mesh::Mesh;
use crate::task::Cancel;
use crate::visibility::{CellSet, Pool};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Weak};

/// Vertices processed between two checks of the cancel flag.
const CHUNK: usize = 4096;

/// Gradients at the vertices of active cells, updated from step to step.
#[derive(Debug, Default)]
pub struct VertexGradients {
    of: Weak<Mesh>,
    cells: CellsOfVertices,
    vertices: Vec<AtomicU8>,
    pool: Pool<Vec<[f32; 3]>>,
    last: Option<Last>,
}

/// The last gradients and their inputs.
#[derive(Clone, Debug)]
struct Last {
    scalars: Weak<Vec<f32>>,
    active: Arc<CellSet>,
    gradients: Arc<Vec<[f32; 3]>>,
}

/// States of a vertex: of no active cell, gradient wanted, gradient known.
const OUTSIDE: u8 = 0;
const WANTED: u8 = 1;
const KNOWN: u8 = 2;

impl VertexGradients {
    /// For each vertex of an active cell the unit vector (local coordinates) along the mean gradient of its cells with finite scalars, or
    /// zero if that is zero. Vertices of other cells have zero, or their vector from when their cells were active with the same scalars.
    /// `None` if `cancel` was raised.
    pub fn update(
        &mut self,
        mesh: &Arc<Mesh>,
        scalars: &Arc<Vec<f32>>,
        active: &Arc<CellSet>,
        cancel: &Cancel,
    ) -> Option<Arc<Vec<[f32; 3]>>> {
        if self.of.as_ptr() != Arc::as_ptr(mesh) {
            let of = Arc::downgrade(mesh);
            *self = Self { of, cells: CellsOfVertices::of(&mesh.topology.tets, scalars.len()), ..Self::default() };
        }
        let last = self.last.take().filter(|last| last.scalars.as_ptr() == Arc::as_ptr(scalars));
        if let Some(last) = last.as_ref().filter(|last| Arc::ptr_eq(&last.active, active)) {
            self.last = Some(last.clone());
            return Some(last.gradients.clone());
        }
        if last.is_none() {
            self.vertices.clear();
            self.vertices.resize_with(scalars.len(), || AtomicU8::new(OUTSIDE));
        }
        self.want(&mesh.topology.tets, active, last.as_ref().map(|last| &*last.active));
        let Self { cells, vertices, pool, .. } = self;
        let gradients = pool.make(|out| {
            out.resize(scalars.len(), [0.0; 3]);
            let chunks = out.par_chunks_mut(CHUNK).zip(vertices.par_chunks_mut(CHUNK)).enumerate();
            chunks.filter(|_| !cancel.is_cancelled()).for_each(|(chunk, (out, vertices))| {
                let first = chunk * CHUNK;
                match &last {
                    Some(last) => out.copy_from_slice(&last.gradients[first..][..out.len()]),
                    None => out.fill([0.0; 3]),
                }
                for (vertex, (out, state)) in (first..).zip(out.iter_mut().zip(vertices)) {
                    if *state.get_mut() == WANTED {
                        *state.get_mut() = KNOWN;
                        *out = gradient(mesh, scalars, cells.of_vertex(vertex));
                    }
                }
            });
        });
        if cancel.is_cancelled() {
            return None;
        }
        self.last =
            Some(Last { scalars: Arc::downgrade(scalars), active: active.clone(), gradients: gradients.clone() });
        Some(gradients)
    }

    /// Marks the vertices of active cells that have no gradient yet; `before`: cells whose vertices have theirs.
    fn want(&self, tets: &[[u32; 4]], active: &CellSet, before: Option<&CellSet>) {
        let words = active.words().par_iter().enumerate().with_min_len(256);
        words.for_each(|(at, &word)| {
            let mut new = before.map_or(word, |before| word & !before.words()[at]);
            while new != 0 {
                let cell = 64 * at + new.trailing_zeros() as usize;
                new &= new - 1;
                for &vertex in &tets[cell] {
                    let state = &self.vertices[vertex as usize];
                    if state.load(Ordering::Relaxed) == OUTSIDE {
                        state.store(WANTED, Ordering::Relaxed);
                    }
                }
            }
        });
    }
}

/// The unit vector along the mean gradient in some cells.
fn gradient(mesh: &Mesh, scalars: &[f32], cells: &[u32]) -> [f32; 3] {
    let sum: DVec3 = cells.iter().map(|&cell| times_six_volumes(mesh, scalars, cell)).sum();
    sum.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().to_array()
}

/// The gradient in a cell times six times its volume; zero if a scalar is not finite.
fn times_six_volumes(mesh: &Mesh, scalars: &[f32], cell: u32) -> DVec3 {
    let tet = mesh.topology.tets[cell as usize];
    let values = tet.map(|v| f64::from(scalars[v as usize]));
    if values.iter().any(|value| !value.is_finite()) {
        return DVec3::ZERO;
    }
    let corners = mesh.positions.corners(tet).map(|corner| corner.as_dvec3());
    let [a, b, c] = [1, 2, 3].map(|i| corners[i] - corners[0]);
    let [ra, rb, rc] = [1, 2, 3].map(|i| values[i] - values[0]);
    ra * b.cross(c) + rb * c.cross(a) + rc * a.cross(b)
}

/// The cells around each vertex, ascending.
#[derive(Debug, Default)]
struct CellsOfVertices {
    /// The end of each vertex's cells; they begin where those of the previous vertex end.
    ends: Vec<u32>,
    cells: Vec<u32>,
}

impl CellsOfVertices {
    fn of(tets: &[[u32; 4]], vertices: usize) -> Self {
        let mut ends = vec![0u32; vertices];
        tets.as_flattened().iter().for_each(|&vertex| ends[vertex as usize] += 1);
        let mut sum = 0;
        for end in &mut ends {
            sum += std::mem::replace(end, sum);
        }
        // `ends` now has the starts, and each advances to its end.
        let mut cells = vec![0u32; 4 * tets.len()];
        for (cell, tet) in (0..).zip(tets) {
            for &vertex in tet {
                let at = &mut ends[vertex as usize];
                cells[*at as usize] = cell;
                *at += 1;
            }
        }
        Self { ends, cells }
    }

    fn of_vertex(&self, vertex: usize) -> &[u32] {
        let begin = vertex.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.cells[begin as usize..self.ends[vertex] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::kuhn_grid;
    use glam::Vec3;

    fn mesh() -> Arc<Mesh> {
        Arc::new(Mesh::build(kuhn_grid([5, 4, 3])).unwrap().0)
    }

    fn of(mesh: &Mesh, value: impl Fn(Vec3) -> f32) -> Arc<Vec<f32>> {
        Arc::new(mesh.positions.local.iter().map(|&p| value(p)).collect())
    }

    #[test]
    fn a_linear_field_has_one_direction_at_all_vertices() {
        let mesh = mesh();
        let all = Arc::new(CellSet::all(mesh.topology.tets.len()));
        let direction = Vec3::new(2.0, -1.0, 0.5);
        let scalars = of(&mesh, |p| 3.0 + direction.dot(p));
        let found = VertexGradients::default().update(&mesh, &scalars, &all, &Cancel::new()).unwrap();
        assert_eq!(found.len(), scalars.len());
        // Scalars are rounded to 2^-24 of 6, and differ by at least a tenth along an edge.
        assert!(found.iter().all(|&v| (Vec3::from(v) - direction.normalize()).length() < 1e-5));
    }

    #[test]
    fn vertices_take_part_in_their_cells_by_volume_and_holes_do_not() {
        let mesh = mesh();
        let all = Arc::new(CellSet::all(mesh.topology.tets.len()));
        let scalars = of(&mesh, |p| p.x * p.x + 0.3 * p.y * p.z);
        let mut gradients = VertexGradients::default();
        let found = gradients.update(&mesh, &scalars, &all, &Cancel::new()).unwrap();
        let mut sums = vec![DVec3::ZERO; scalars.len()];
        for tet in &mesh.topology.tets {
            let corners = mesh.positions.corners(*tet);
            let gradient = crate::mesh::tet_gradient(corners, tet.map(|v| scalars[v as usize])).unwrap();
            tet.iter().for_each(|&v| sums[v as usize] += gradient * crate::mesh::tet_volume(corners));
        }
        for (found, sum) in found.iter().zip(&sums) {
            assert!((Vec3::from(*found).as_dvec3() - sum.normalize()).length() < 1e-6);
        }
        // Unchanged input is not recomputed; without a vertex its cells do not count.
        let again = gradients.update(&mesh, &scalars, &all, &Cancel::new()).unwrap();
        assert!(Arc::ptr_eq(&found, &again));
        let hole = mesh.topology.tets[7][0];
        let mut with_hole = scalars.to_vec();
        with_hole[hole as usize] = f32::NAN;
        let with_hole = gradients.update(&mesh, &Arc::new(with_hole), &all, &Cancel::new()).unwrap();
        assert_eq!(with_hole[hole as usize], [0.0; 3]);
        assert!(with_hole.iter().flatten().all(|c| c.is_finite()) && with_hole != found);
    }

    #[test]
    fn cells_that_become_active_over_the_same_scalars_have_the_gradients_that_they_would_have_alone() {
        let mesh = mesh();
        let scalars = of(&mesh, |p| p.x * p.x + 0.3 * p.y * p.z);
        let every = |n: usize| Arc::new(CellSet::of(mesh.topology.tets.len(), |cell| cell % n == 1));
        let mut gradients = VertexGradients::default();
        let mut held = Vec::new();
        for (scalars, active) in [
            (scalars.clone(), every(31)),
            (scalars.clone(), every(29)),
            (of(&mesh, |p| p.y), every(29)),
            (scalars.clone(), every(7)),
            (scalars, every(31)),
        ] {
            let found = gradients.update(&mesh, &scalars, &active, &Cancel::new()).unwrap();
            let alone = VertexGradients::default().update(&mesh, &scalars, &active, &Cancel::new()).unwrap();
            let is_of_active =
                |v: &u32| (0..).zip(&mesh.topology.tets).any(|(c, tet)| active.contains(c) && tet.contains(v));
            let vertices: Vec<u32> = (0..scalars.len() as u32).filter(is_of_active).collect();
            assert!(!vertices.is_empty() && vertices.iter().all(|&v| found[v as usize] == alone[v as usize]));
            assert!(vertices.iter().any(|&v| found[v as usize] != [0.0; 3]));
            held.push((found.clone(), found.to_vec()));
        }
        assert!(held.iter().all(|(shared, copy)| **shared == *copy), "what was handed out stays as it is");
    }

    #[test]
    fn only_vertices_of_active_cells_have_gradients() {
        let mesh = mesh();
        let scalars = of(&mesh, |p| p.x);
        let one = Arc::new(CellSet::of(mesh.topology.tets.len(), |cell| cell == 3));
        let found = VertexGradients::default().update(&mesh, &scalars, &one, &Cancel::new()).unwrap();
        let tet = mesh.topology.tets[3];
        assert!((0..).zip(found.iter()).all(|(v, g)| (*g != [0.0; 3]) == tet.contains(&v)));
        let cancel = Cancel::new();
        cancel.cancel();
        assert!(VertexGradients::default().update(&mesh, &scalars, &one, &cancel).is_none());
    }
}
