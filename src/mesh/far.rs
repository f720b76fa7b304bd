//! Connected parts so far from the rest that a picture of the whole mesh shows next to nothing.

use super::Positions;
use glam::{DVec3, Vec3};
use serde::Serialize;

/// How many times the size of the rest the box of the mesh is with a part that is far away.
const FAR: f64 = 100.0;

/// The connected parts each of which makes the box of the mesh over 100 times the size of the rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FarParts {
    /// Number of such parts.
    pub parts: u64,
    /// Number of their cells.
    pub cells: u64,
    /// A cell of the source in one of them; in the report of an import its number in the files.
    pub cell: u32,
    /// The diagonal of the mesh's box over that of the rest.
    pub ratio: f64,
    /// Corners of the box of the rest, in world coordinates.
    pub rest: [[f64; 3]; 2],
}

/// A box, in local units.
#[derive(Clone, Copy)]
struct Bounds(Vec3, Vec3);

impl Bounds {
    const EMPTY: Self = Self(Vec3::INFINITY, Vec3::NEG_INFINITY);

    fn with(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.max(other.1))
    }

    fn diagonal(self) -> f64 {
        (self.1.as_dvec3() - self.0.as_dvec3()).length()
    }
}

impl FarParts {
    /// The far parts of a mesh; `None` if there are none, or if what is left would be less than half of the cells: there is no rest then
    /// that a picture could be of. `part_of_cell` and `sizes` are those of [`Connectivity::parts`](super::Connectivity::parts).
    ///
    /// The rest grows from the largest part, by the others in the order of their distances from it.
    pub(super) fn of(
        tets: &[[u32; 4]],
        (part_of_cell, sizes): (Vec<u32>, Vec<usize>),
        positions: &Positions,
        cell_source: &[u32],
    ) -> Option<Self> {
        if sizes.len() < 2 {
            return None;
        }
        let mut bounds = vec![Bounds::EMPTY; sizes.len()];
        for (tet, &part) in tets.iter().zip(&part_of_cell) {
            let corners = tet.map(|v| positions.local[v as usize]).map(|p| Bounds(p, p));
            let bounds = &mut bounds[part as usize];
            *bounds = corners.into_iter().fold(*bounds, Bounds::with);
        }
        let whole = bounds.iter().copied().fold(Bounds::EMPTY, Bounds::with);
        let mut rest = bounds[0];
        if whole.diagonal() <= FAR * rest.diagonal() {
            return None;
        }
        let first = rest;
        let mut others: Vec<(f64, usize)> =
            bounds.iter().enumerate().skip(1).map(|(part, other)| (first.with(*other).diagonal(), part)).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut far = Vec::new();
        for (_, part) in others {
            let grown = rest.with(bounds[part]);
            if grown.diagonal() > FAR * rest.diagonal() {
                far.push(part);
            } else {
                rest = grown;
            }
        }
        let cells: usize = far.iter().map(|&part| sizes[part]).sum();
        if far.is_empty() || 2 * cells >= tets.len() {
            return None;
        }
        let farthest = *far.last()?;
        let cell = part_of_cell.iter().position(|&part| part as usize == farthest)?;
        let world = |p: Vec3| (positions.origin + positions.scale * p.as_dvec3()).to_array();
        Some(Self {
            parts: far.len() as u64,
            cells: cells as u64,
            cell: cell_source[cell],
            ratio: whole.diagonal() / rest.diagonal(),
            rest: [world(rest.0), world(rest.1)],
        })
    }

    /// The box of the rest.
    pub fn frame(&self) -> (DVec3, DVec3) {
        let [lo, hi] = self.rest.map(DVec3::from_array);
        (lo, hi)
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_meshes::kuhn_grid;
    use super::super::{Mesh, RawMesh, RepairReport};
    use super::*;

    /// Blocks of `n` x `n` x `n` unit cubes with these lowest corners, as parts of their own.
    fn blocks(places: &[(usize, DVec3)]) -> (Mesh, RepairReport) {
        let mut raw = RawMesh::default();
        for &(n, place) in places {
            let block = kuhn_grid([n; 3]);
            let first = raw.points.len() as u32;
            raw.points.extend(block.points.iter().map(|&point| point + place));
            raw.cells.tets.extend(block.cells.tets.iter().map(|tet| tet.map(|v| v + first)));
        }
        Mesh::build(raw).expect("a mesh")
    }

    #[test]
    fn a_part_a_thousand_sizes_away_is_named_and_left_out_of_the_frame() {
        let away = DVec3::new(0.0, -4000.0, 10.0);
        let (mesh, report) = blocks(&[(2, DVec3::ONE), (1, away), (1, DVec3::splat(9.0))]);
        let far = report.far_parts.as_ref().expect("a far part");
        assert_eq!((far.parts, far.cells, report.parts), (1, 6, 3));
        assert!((48..54).contains(&far.cell), "{far:?}");
        assert_eq!(mesh.frame(), (DVec3::ONE, DVec3::splat(10.0)), "the near one is of the rest");
        let (lo, hi) = mesh.positions.world_bounds();
        assert!((far.ratio - (hi - lo).length() / (9.0 * 3.0_f64.sqrt())).abs() < 1e-3, "{far:?}");
        let text = report.to_string();
        assert!(text.contains("far from the rest") && text.contains("1 part of 6 cells"), "{text}");
        assert!(!report.is_clean());
    }

    #[test]
    fn parts_are_not_far_where_there_is_no_rest_or_the_way_is_shorter() {
        let frame_is_box = |places: &[(usize, DVec3)]| {
            let (mesh, report) = blocks(places);
            assert_eq!(report.far_parts, None, "{places:?}");
            assert_eq!(mesh.frame(), mesh.positions.world_bounds());
        };
        let at = |x: f64| DVec3::new(x, 0.0, 0.0);
        frame_is_box(&[(2, DVec3::ZERO)]);
        // 90 times the size of the first block.
        frame_is_box(&[(2, at(0.0)), (1, at(90.0 * 12.0_f64.sqrt()))]);
        // As many cells there as here.
        frame_is_box(&[(1, at(0.0)), (1, at(1e4))]);
        // A trail, each block 50 sizes behind the last.
        frame_is_box(&[(1, at(0.0)), (1, at(80.0)), (1, at(4e3)), (1, at(2e5))]);
        // Dust everywhere.
        let dust: Vec<(usize, DVec3)> =
            (0..27).map(|i| (1, 1e4 * DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9)))).collect();
        frame_is_box(&dust);
    }
}
