//! Restricts cells to connected parts of a mesh, by number.

use super::{Activity, CellSet, Restricted};
use crate::mesh::Mesh;
use std::sync::{Arc, Weak};

/// The cells of some parts of a mesh, cached while mesh and parts stay.
#[derive(Debug, Default)]
pub struct PartCells {
    of: Weak<Mesh>,
    parts: Vec<u32>,
    cells: Arc<CellSet>,
    restricted: Restricted,
}

impl PartCells {
    /// The cells of `activity` that belong to these parts of the mesh.
    pub fn restrict(&mut self, mesh: &Arc<Mesh>, parts: &[u32], activity: Activity) -> Activity {
        if self.of.as_ptr() != Arc::as_ptr(mesh) || self.parts != parts {
            let (part, sizes) = mesh.topology.connectivity().parts();
            let mut is_shown = vec![false; sizes.len()];
            for &part in parts {
                is_shown.get_mut(part as usize).into_iter().for_each(|is_shown| *is_shown = true);
            }
            let cells = CellSet::of(part.len(), |cell| is_shown[part[cell] as usize]);
            let cells = Arc::new(cells);
            *self = Self { of: Arc::downgrade(mesh), parts: parts.to_vec(), cells, restricted: Restricted::default() };
        }
        self.restricted.to(&self.cells, activity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::RawMesh;
    use crate::mesh::test_meshes::kuhn_grid;
    use glam::DVec3;

    #[test]
    fn the_largest_part_is_the_first_and_others_are_left_out() {
        let mut raw = RawMesh::default();
        for (size, offset) in [([1, 1, 1], 0.0), ([3, 2, 1], 10.0), ([1, 1, 1], 20.0), ([2, 2, 2], 30.0)] {
            let more = kuhn_grid(size);
            let first = raw.points.len() as u32;
            raw.points.extend(more.points.iter().map(|p| *p + DVec3::splat(offset)));
            raw.cells.tets.extend(more.cells.tets.iter().map(|tet| tet.map(|v| v + first)));
        }
        let mesh = Arc::new(Mesh::build(raw).unwrap().0);
        let (part, sizes) = mesh.topology.connectivity().parts();
        assert_eq!(sizes, [48, 36, 6, 6]);
        assert_eq!((0..4).map(|p| part.iter().filter(|q| **q == p).count()).collect::<Vec<_>>(), sizes);
        assert_eq!(sizes.len() as u64, mesh.topology.connectivity().count_parts());
        let first = |p: u32| part.iter().position(|q| *q == p);
        assert!(first(2) < first(3), "of equal ones the one with the lower cell");
        let all = Arc::new(CellSet::all(part.len()));
        let activity = Activity { finite: all.clone(), active: all, classified: 0 };
        let mut cells = PartCells::default();
        let left = cells.restrict(&mesh, &[1, 3], activity.clone());
        assert!(Arc::ptr_eq(&left.finite, &left.active));
        assert!((0..part.len()).all(|cell| left.active.contains(cell as u32) == [1, 3].contains(&part[cell])));
        assert!(Arc::ptr_eq(&cells.restrict(&mesh, &[1, 3], activity.clone()).active, &left.active));
        let some = Activity { active: Arc::new(CellSet::of(part.len(), |cell| cell % 2 == 0)), ..activity };
        let left = cells.restrict(&mesh, &[0], some);
        assert!((0..part.len()).all(|c| left.active.contains(c as u32) == (c % 2 == 0 && part[c] == 0)));
        assert_eq!(left.finite.count(), 48);
    }
}
