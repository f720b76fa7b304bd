//! Points and cells of structured grids, which files do not list: x runs fastest, then y, then z.

use super::cells::{GridReader, kind};
use crate::error::{FileError, FileResult};
use glam::DVec3;
use std::hash::{Hash, Hasher};
use std::path::Path;

/// The types of VTK that are reported.
const VOXEL: u8 = 11;
const HEXAHEDRON: u8 = 12;
const QUAD: u8 = 9;
/// Most points per byte of a file that does not list them: an array of bytes at deflate's limit.
const POINTS_PER_BYTE: usize = 1032;

/// Where the points of a grid with equal distances along each axis lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EvenGrid {
    pub(super) origin: [f64; 3],
    pub(super) spacing: [f64; 3],
    /// A matrix by rows, the identity unless the grid is turned.
    pub(super) direction: [[f64; 3]; 3],
}

impl EvenGrid {
    /// A grid along the axes.
    pub(super) fn of(origin: [f64; 3], spacing: [f64; 3]) -> Self {
        Self { origin, spacing, direction: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// Whether all numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.origin.iter().chain(&self.spacing).chain(self.direction.as_flattened()).all(|v| v.is_finite())
    }
}

impl Hash for EvenGrid {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let numbers = self.origin.iter().chain(&self.spacing).chain(self.direction.as_flattened());
        numbers.for_each(|number| number.to_bits().hash(state));
    }
}

/// The points of a structured grid, and the cells between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Lattice {
    /// Number of points along each axis, none of them 0.
    dims: [usize; 3],
}

impl Lattice {
    /// A lattice of these numbers of points along x, y and z, of a file of this size; the error says what is wrong with them.
    pub(super) fn of(dims: [u64; 3], file_bytes: usize) -> Result<Self, String> {
        let [x, y, z] = dims;
        let points = x.checked_mul(y).and_then(|n| n.checked_mul(z)).and_then(|n| usize::try_from(n).ok());
        match points {
            Some(0) => Err(format!("has {x} x {y} x {z} points")),
            Some(points) if points <= file_bytes.saturating_mul(POINTS_PER_BYTE) => {
                Ok(Self { dims: dims.map(|n| n as usize) })
            }
            _ => Err(format!("claims {x} x {y} x {z} points in a file of {file_bytes} bytes")),
        }
    }

    /// A lattice between the least and greatest index along x, y and z, as VTK's extents have them: `x0 x1 y0 y1 z0 z1`.
    pub(super) fn of_extent(extent: [i64; 6], file_bytes: usize) -> Result<Self, String> {
        let [x0, x1, y0, y1, z0, z1] = extent;
        let count = |first: i64, last: i64| {
            let count = last.checked_sub(first).and_then(|n| n.checked_add(1)).and_then(|n| u64::try_from(n).ok());
            count.ok_or_else(|| format!("has the extent {extent:?}, which ends before it begins"))
        };
        Self::of([count(x0, x1)?, count(y0, y1)?, count(z0, z1)?], file_bytes)
    }

    /// Number of points along x, y and z.
    pub(super) fn dims(self) -> [usize; 3] {
        self.dims
    }

    /// Number of points.
    pub(super) fn points(self) -> usize {
        self.dims.iter().product()
    }

    /// Number of cells, those of lower dimension where an axis has one point alone.
    pub(super) fn cells(self) -> usize {
        self.dims.iter().map(|&n| (n - 1).max(1)).product()
    }

    /// The points at these coordinates along each axis.
    ///
    /// # Errors
    /// If an axis has another number of coordinates.
    pub(super) fn product(self, axes: [&[f64]; 3]) -> Result<Vec<DVec3>, String> {
        for (axis, (coordinates, points)) in ["x", "y", "z"].iter().zip(axes.iter().zip(self.dims)) {
            if coordinates.len() != points {
                return Err(format!("has {} coordinates along {axis} for {points} points", coordinates.len()));
            }
        }
        let [x, y, z] = axes;
        let row = |&z: &f64| y.iter().flat_map(move |&y| x.iter().map(move |&x| DVec3::new(x, y, z)));
        Ok(z.iter().flat_map(row).collect())
    }

    /// The points at equal distances along axes: `origin + direction * (spacing * index)`, indices counted from `first`. The rows of
    /// `direction` are x, y and z of the points.
    pub(super) fn even(self, first: [i64; 3], grid: &EvenGrid) -> Vec<DVec3> {
        let step = |axis: usize| DVec3::from_array(grid.direction.map(|row| row[axis])) * grid.spacing[axis];
        let [x, y, z] = [step(0), step(1), step(2)];
        let at = |axis: usize, i: usize| (first[axis] + i as i64) as f64;
        let [nx, ny, nz] = self.dims;
        let row = |y: DVec3, z: DVec3| (0..nx).map(move |i| (x * at(0, i) + y) + z + DVec3::from(grid.origin));
        (0..nz).flat_map(|k| (0..ny).flat_map(move |j| row(y * at(1, j), z * at(2, k)))).collect()
    }

    /// Adds the cells to a mesh that has the lattice's points from `first_point` on; those with a flag of `is_hidden` are left out. Whether
    /// edges are parallel to the axes decides on the type that is reported.
    ///
    /// # Errors
    /// If there are too many.
    pub(super) fn add_cells(
        self,
        grid: &mut GridReader,
        path: &Path,
        first_point: usize,
        is_parallel: bool,
        is_hidden: impl Fn(usize) -> bool,
    ) -> FileResult<()> {
        let invalid = |problem: String| FileError::invalid(path, "", problem);
        if self.dims.contains(&1) {
            grid.skip(QUAD, self.cells());
            grid.cells += self.cells();
            return Ok(());
        }
        let [nx, ny, nz] = self.dims;
        let number = if is_parallel { VOXEL } else { HEXAHEDRON };
        let mut cell = 0;
        for z in 0..nz - 1 {
            for y in 0..ny - 1 {
                for x in 0..nx - 1 {
                    if is_hidden(cell) {
                        grid.ghosts += 1;
                    } else {
                        let corner = ((z * ny + y) * nx + x) as u64;
                        let (y, z) = (nx as u64, (nx * ny) as u64);
                        let square = if is_parallel { [0, 1, y, y + 1] } else { [0, 1, y + 1, y] };
                        let low = square.map(|step| corner + step);
                        let vertices: [u64; 8] = std::array::from_fn(|i| low[i % 4] + if i < 4 { 0 } else { z });
                        grid.push(cell, (number, kind(number)), &vertices, self.points(), first_point)
                            .map_err(invalid)?;
                    }
                    cell += 1;
                }
            }
        }
        grid.cells += self.cells();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::split;

    #[test]
    fn counts_that_no_file_could_hold_are_refused() {
        for dims in [[0, 5, 5], [u64::MAX, 2, 2], [1 << 21, 1 << 21, 1 << 22], [200, 200, 200]] {
            assert!(Lattice::of(dims, 1000).is_err(), "{dims:?}");
        }
        assert!(Lattice::of_extent([0, -2, 0, 1, 0, 1], 1000).unwrap_err().contains("before it begins"));
        assert!(Lattice::of_extent([0, -1, 0, -1, 0, -1], 1000).unwrap_err().contains("0 x 0 x 0"), "an empty one");
        assert!(Lattice::of_extent([i64::MIN, i64::MAX, 0, 1, 0, 1], 1000).is_err());
        let lattice = Lattice::of_extent([-2, 1, 3, 5, 7, 8], 1000).unwrap();
        assert_eq!((lattice.dims(), lattice.points(), lattice.cells()), ([4, 3, 2], 24, 6));
    }

    #[test]
    fn cells_fill_the_box_between_the_points_whatever_their_type() {
        let lattice = Lattice::of([4, 3, 3], 1000).unwrap();
        let points = lattice.product([&[0.0, 1.0, 3.0, 4.0], &[0.0, 2.0, 3.0], &[-1.0, 0.0, 1.0]]).unwrap();
        assert_eq!(
            (points[1], points[4], points[12]),
            (DVec3::new(1.0, 0.0, -1.0), DVec3::new(0.0, 2.0, -1.0), DVec3::new(0.0, 0.0, 0.0))
        );
        for is_parallel in [false, true] {
            let mut grid = GridReader::default();
            lattice.add_cells(&mut grid, Path::new("a"), 0, is_parallel, |cell| cell == 5).unwrap();
            assert_eq!((grid.cells, grid.ghosts, grid.mesh.cells.len()), (12, 1, 11));
            let split = split(grid.mesh.cells, &points);
            let volume = |tet: &[u32; 4]| {
                let [a, b, c, d] = tet.map(|v| points[v as usize]);
                (b - a).cross(c - a).dot(d - a) / 6.0
            };
            let volumes: Vec<f64> = split.tets.iter().map(volume).collect();
            assert!(volumes.iter().all(|&v| v > 0.0) || volumes.iter().all(|&v| v < 0.0), "{volumes:?}");
            // Cell 5 lies between 3 and 4, 2 and 3, -1 and 0.
            assert!((volumes.iter().sum::<f64>().abs() - (4.0 * 3.0 * 2.0 - 1.0)).abs() < 1e-12);
        }
        assert!(lattice.product([&[0.0], &[0.0], &[0.0]]).unwrap_err().contains("along x"));
    }

    #[test]
    fn points_at_equal_distances_are_counted_from_the_first_index_along_turned_axes() {
        let lattice = Lattice::of_extent([2, 3, -1, 0, 5, 5], 1000).unwrap();
        let straight = EvenGrid::of([10.0, 20.0, 30.0], [0.5, 2.0, 3.0]);
        let points = lattice.even([2, -1, 5], &straight);
        let expected = [[11.0, 18.0, 45.0], [11.5, 18.0, 45.0], [11.0, 20.0, 45.0], [11.5, 20.0, 45.0]];
        assert_eq!(points, expected.map(DVec3::from));
        // A quarter turn about z: x becomes y, and y becomes -x.
        let turned = EvenGrid { direction: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], ..straight };
        assert_eq!(lattice.even([2, -1, 5], &turned)[1], DVec3::new(12.0, 21.5, 45.0));
    }

    #[test]
    fn flat_lattices_have_cells_without_volume() {
        let lattice = Lattice::of([4, 3, 1], 1000).unwrap();
        let mut grid = GridReader::default();
        lattice.add_cells(&mut grid, Path::new("a"), 0, true, |_| false).unwrap();
        assert_eq!((grid.cells, grid.mesh.cells.len(), lattice.cells()), (6, 0, 6));
        assert!(grid.notes()[0].contains("6 cells without volume"));
    }
}
