//! The scalars of a mesh at one time.

use super::Association;
use std::sync::Arc;

/// The scalars of a mesh at one time. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub enum Scalars {
    /// One per vertex, linear in each cell.
    Vertices(Arc<Vec<f32>>),
    /// One per cell, constant in it.
    Cells(Arc<Vec<f32>>),
}

impl From<Arc<Vec<f32>>> for Scalars {
    /// Scalars of vertices.
    fn from(values: Arc<Vec<f32>>) -> Self {
        Self::Vertices(values)
    }
}

impl Scalars {
    /// One value per vertex or cell.
    pub fn new(association: Association, values: Arc<Vec<f32>>) -> Self {
        match association {
            Association::Point => Self::Vertices(values),
            Association::Cell => Self::Cells(values),
        }
    }

    /// The values, one per vertex or one per cell.
    pub fn values(&self) -> &Arc<Vec<f32>> {
        match self {
            Self::Vertices(values) | Self::Cells(values) => values,
        }
    }

    /// What has the values.
    pub fn association(&self) -> Association {
        match self {
            Self::Vertices(_) => Association::Point,
            Self::Cells(_) => Association::Cell,
        }
    }

    /// The values, if vertices have them.
    pub fn of_vertices(&self) -> Option<&Arc<Vec<f32>>> {
        match self {
            Self::Vertices(values) => Some(values),
            Self::Cells(_) => None,
        }
    }

    /// The values, if cells have them.
    pub fn of_cells(&self) -> Option<&Arc<Vec<f32>>> {
        match self {
            Self::Vertices(_) => None,
            Self::Cells(values) => Some(values),
        }
    }

    /// The scalars at the corners of a cell with these vertices: equal ones, if cells have the values.
    ///
    /// # Panics
    /// If there is no such cell or vertex.
    #[inline]
    pub fn at_corners(&self, cell: u32, tet: [u32; 4]) -> [f32; 4] {
        match self {
            Self::Vertices(values) => tet.map(|vertex| values[vertex as usize]),
            Self::Cells(values) => [values[cell as usize]; 4],
        }
    }

    /// Whether both are the same values in memory. Compares by pointer, not by content.
    pub fn is_same(&self, other: &Self) -> bool {
        self.association() == other.association() && Arc::ptr_eq(self.values(), other.values())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_have_the_scalars_of_their_vertices_or_that_of_their_cell() {
        let values = Arc::new(vec![0.5, 1.5, 2.5, 3.5, 4.5]);
        let [points, cells] = [Association::Point, Association::Cell].map(|of| Scalars::new(of, values.clone()));
        assert_eq!(points.at_corners(1, [4, 2, 0, 3]), [4.5, 2.5, 0.5, 3.5]);
        assert_eq!(cells.at_corners(1, [4, 2, 0, 3]), [1.5; 4]);
        assert_eq!(
            [&points, &cells].map(|s| (s.of_vertices().is_some(), s.of_cells().is_some())),
            [(true, false), (false, true)]
        );
        assert!(points.is_same(&values.clone().into()) && !points.is_same(&cells));
        assert!(!points.is_same(&Arc::new((*values).clone()).into()));
    }
}
