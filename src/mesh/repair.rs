//! Finds what is wrong with the cells of a [`RawMesh`](super::RawMesh): bad indices and points, wrong winding, no
//! volume, duplicates.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curve::{CurveKey, ascending};
use super::geometry::tet_volume;
use super::positions::LocalFrame;
use super::{MeshError, Positions};

/// Cells are numbered in 30 bits: see [`CellNeighbour`](super::CellNeighbour).
const MAX_CELLS: usize = (1 << 30) - 1;
/// Vertices are numbered in 32 bits, less [`NONE`](super::NONE); and one less, so that their count is not [`NONE`].
const MAX_VERTICES: usize = u32::MAX as usize - 1;

/// # Errors
/// If there are more cells or vertices than can be numbered.
pub(super) fn check_counts(cells: usize, vertices: usize) -> Result<(), MeshError> {
    if cells > MAX_CELLS {
        return Err(MeshError::TooManyCells(cells));
    }
    if vertices > MAX_VERTICES {
        return Err(MeshError::TooManyVertices(vertices));
    }
    Ok(())
}

/// # Errors
/// If a cell names a vertex that does not exist (the first such cell).
pub(super) fn check_indices(tets: &[[u32; 4]], vertex_count: usize) -> Result<(), MeshError> {
    let missing = |&index: &u32| index as usize >= vertex_count;
    match tets.iter().position(|tet| tet.iter().any(missing)) {
        None => Ok(()),
        Some(cell) => {
            let index = tets[cell].into_iter().find(missing).unwrap_or_default();
            Err(MeshError::VertexOutOfRange { cell, index, vertex_count })
        }
    }
}

/// Local positions of all points used by a cell of four different points; zero for all others.
///
/// # Errors
/// If such a point is not finite, or their extent cannot be scaled.
pub(super) fn local_positions(points: &[DVec3], tets: &[[u32; 4]]) -> Result<Positions, MeshError> {
    let (used, _, frame) = frame(points, tets)?;
    let local = points.par_iter().zip(&used).map(|(&p, &used)| if used { frame.local(p) } else { Vec3::ZERO });
    Ok(Positions { origin: frame.origin, scale: frame.scale, local: local.collect() })
}

/// Which points are used by a cell of four different points; the corners of their box; and the frame around that.
///
/// # Errors
/// As [`local_positions`].
pub(super) fn frame(points: &[DVec3], tets: &[[u32; 4]]) -> Result<(Vec<bool>, [DVec3; 2], LocalFrame), MeshError> {
    let used = used_vertices(tets.iter().filter(|tet| has_four_vertices(tet)), points.len());
    let used_points =
        || points.iter().zip(&used).enumerate().filter(|(_, (_, used))| **used).map(|(i, (p, _))| (i, *p));
    if let Some((point, position)) = used_points().find(|(_, p)| !p.is_finite()) {
        return Err(MeshError::NotFinite { point, position });
    }
    let bounds = used_points().map(|(_, p)| (p, p)).reduce(|(lo, hi), (p, _)| (lo.min(p), hi.max(p)));
    let (lo, hi) = bounds.unwrap_or_default();
    let frame = LocalFrame::around(lo, hi)?;
    Ok((used, [lo, hi], frame))
}

/// Whether each vertex is used by one of these cells. Indices must be in range.
pub(super) fn used_vertices<'a>(tets: impl Iterator<Item = &'a [u32; 4]>, vertex_count: usize) -> Vec<bool> {
    let mut used = vec![false; vertex_count];
    tets.flatten().for_each(|&v| used[v as usize] = true);
    used
}

/// Whether a cell names four different vertices.
fn has_four_vertices(tet: &[u32; 4]) -> bool {
    ascending(*tet).windows(2).all(|pair| pair[0] != pair[1])
}

/// Orientation of a cell by the exact predicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Orientation {
    /// Positive volume, as all cells of a mesh have.
    Positive,
    /// Negative volume; its last two vertices were swapped.
    Negative,
    /// No volume.
    Flat,
}

/// Finds the exact orientation of each cell after rounding, and flips negative ones by swapping their last two vertices.
pub(super) fn orient_cells(tets: &mut [[u32; 4]], positions: &Positions) -> Vec<Orientation> {
    let orient = |tet: &mut [u32; 4]| {
        let volume = tet_volume(positions.corners(*tet));
        if volume > 0.0 {
            Orientation::Positive
        } else if volume < 0.0 {
            tet.swap(2, 3);
            Orientation::Negative
        } else {
            Orientation::Flat
        }
    };
    tets.par_iter_mut().map(orient).collect()
}

/// Removes all but the first (by source index) of the cells that have the same four vertices; the order stays. Such
/// cells share a curve index and are therefore neighbours in `order`, which is sorted.
pub(super) fn drop_duplicates(order: &mut Vec<CurveKey>, tets: &[[u32; 4]]) {
    let vertices = |key: &CurveKey| ascending(tets[key.1 as usize]);
    let same_place = |a: &CurveKey, b: &CurveKey| a.0 == b.0;
    let groups = |order: &mut Vec<CurveKey>, sort: &dyn Fn(&mut [CurveKey])| {
        order.chunk_by_mut(same_place).filter(|group| group.len() > 1).for_each(sort);
    };
    groups(order, &|group| group.sort_unstable_by_key(|key| (vertices(key), key.1)));
    order.dedup_by(|later, earlier| same_place(earlier, later) && vertices(earlier) == vertices(later));
    groups(order, &|group| group.sort_unstable());
}

/// Number of these positions, in curve order (keys beside local positions), that equal an earlier one.
pub(super) fn count_coincident(order: &[CurveKey], local: &[Vec3]) -> u64 {
    let bits = |key: &CurveKey| local[key.1 as usize].to_array().map(f32::to_bits);
    let groups = order.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1);
    let repeats = groups.map(|group| {
        let mut places: Vec<_> = group.iter().map(bits).collect();
        places.sort_unstable();
        places.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64
    });
    repeats.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_cells_or_vertices_than_can_be_numbered_are_refused() {
        assert_eq!(check_counts(MAX_CELLS, MAX_VERTICES), Ok(()));
        assert_eq!(check_counts(1 << 30, 4), Err(MeshError::TooManyCells(1 << 30)));
        let too_many = u32::MAX as usize;
        assert_eq!(check_counts(1, too_many), Err(MeshError::TooManyVertices(too_many)));
    }

    #[test]
    fn the_first_cell_that_names_a_missing_vertex_is_named() {
        let tets = [[0, 1, 2, 3], [0, 1, 9, 4], [7, 1, 2, 3]];
        let error = check_indices(&tets, 4).unwrap_err();
        assert_eq!(error, MeshError::VertexOutOfRange { cell: 1, index: 9, vertex_count: 4 });
        assert_eq!(error.to_string(), "cell 1 names point 9, but there are 4 points (numbered from 0)");
    }

    #[test]
    fn of_duplicates_among_others_at_the_same_place_the_first_stays() {
        let tets = [[4, 5, 6, 7], [0, 1, 2, 3], [7, 6, 5, 4], [3, 2, 1, 0], [0, 1, 2, 4]];
        let mut order: Vec<CurveKey> = (0..5).map(|i| (7, i)).collect();
        drop_duplicates(&mut order, &tets);
        assert_eq!(order, [(7, 0), (7, 1), (7, 4)]);
    }

    #[test]
    fn coincident_points_are_those_that_repeat_a_position() {
        let (a, b) = (Vec3::ZERO, Vec3::new(1e-30, 0.0, 0.0));
        let local = [a, b, a, a, b, Vec3::ONE];
        // a and b share a curve index although they differ.
        let order: Vec<CurveKey> = (0..5).map(|i| (3, i)).chain([(9, 5)]).collect();
        assert_eq!(count_coincident(&order, &local), 3);
    }
}
