//! The scalars of a given mesh, fading linearly to zero, on that mesh or a refinement of it.
//!
//! The dissertation of Callahan (6.3.1) made its SPX1, SPX2 and Blunt series from static meshes this way: SPX1 and SPX2 are the SPX mesh
//! split once and twice, every cell into eight.

use super::{MAX_CELLS, MAX_STEPS, SynthError};
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::{self, RawMesh};
use rayon::prelude::*;

/// A scalar per point that fades: at step i of n its value is multiplied by 1 - i / (n - 1). Times are 0, 1, 2, ...
#[derive(Debug)]
pub struct FadedSeries {
    description: String,
    mesh: RawMesh,
    values: Vec<f32>,
    fields: Vec<FieldInfo>,
    times: TimeAxis,
}

impl FadedSeries {
    /// The series of `values`, one for each point of `mesh`, named `field`, after `splits` splits of every cell into
    /// eight. `description` names their source.
    ///
    /// # Errors
    /// If the steps or the cells are too many to generate.
    ///
    /// # Panics
    /// If there is not one value for each point, or a cell names a missing point.
    pub fn new(
        description: &str,
        field: &str,
        mesh: RawMesh,
        values: Vec<f32>,
        splits: u32,
        steps: usize,
    ) -> Result<Self, SynthError> {
        assert_eq!(mesh.points.len(), values.len(), "one value for each point");
        if steps == 0 || steps > MAX_STEPS {
            return Err(SynthError::Steps(steps));
        }
        let mesh = RawMesh { cells: mesh::split(mesh.cells, &mesh.points).tets.into(), ..mesh };
        let cells =
            8_u64.checked_pow(splits).and_then(|n| n.checked_mul(mesh.cells.tets.len() as u64)).unwrap_or(u64::MAX);
        if cells > MAX_CELLS {
            return Err(SynthError::Cells(cells));
        }
        let description = match splits {
            0 => format!("decay of {description}"),
            n => format!("decay of {description}, split {n} times"),
        };
        let (mesh, values) = (0..splits).fold((mesh, values), |(mesh, values), _| split(&mesh, &values));
        let fields = vec![FieldInfo { name: field.to_owned(), components: 1, association: Association::Point }];
        let times = TimeAxis { values: (0..steps).map(|i| i as f64).collect() };
        Ok(Self { description, mesh, values, fields, times })
    }

    /// Number of cells.
    pub fn cell_count(&self) -> u64 {
        self.mesh.cells.tets.len() as u64
    }
}

impl SeriesSource for FadedSeries {
    fn describe(&self) -> String {
        self.description.clone()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let has_component = !matches!(component, Component::Index(1..));
        if self.fields.first() != Some(field) || !has_component || step >= self.times.len() {
            let place = format!("field '{}', step {step}", field.name);
            return Err(FileError::invalid(&self.description, place, "does not exist"));
        }
        let last = self.times.len() - 1;
        let left = if last == 0 { 1.0 } else { 1.0 - step as f64 / last as f64 };
        let is_norm = component == Component::Magnitude;
        let value = |&v: &f32| (left * f64::from(v)) as f32;
        out.clear();
        out.extend(self.values.iter().map(value).map(|v| if is_norm { v.abs() } else { v }));
        Ok(())
    }
}

/// Whether a cell names four different vertices.
fn has_inside(tet: &[u32; 4]) -> bool {
    EDGES.iter().all(|&[a, b]| tet[a] != tet[b])
}

/// Corners of the edges whose midpoints form the octahedron that remains when the four corners are cut off.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
/// The cells at the corners: `Ok` is a corner, `Err` the midpoint of an edge.
const CORNERS: [[Result<usize, usize>; 4]; 4] = [
    [Ok(0), Err(0), Err(1), Err(2)],
    [Err(0), Ok(1), Err(3), Err(4)],
    [Err(1), Err(3), Ok(2), Err(5)],
    [Err(2), Err(4), Err(5), Ok(3)],
];
/// Each diagonal of the octahedron with the ring of midpoints around it, in the order that keeps the cell's orientation.
const DIAGONALS: [([usize; 2], [usize; 4]); 3] =
    [([0, 5], [1, 2, 4, 3]), ([1, 4], [0, 3, 5, 2]), ([2, 3], [0, 1, 5, 4])];

/// Splits every cell into eight of its orientation at its edge midpoints, whose values are the mean of the ends. The inner octahedron is
/// cut along its shortest diagonal, which keeps the cells well shaped (as in the first of several splits of Bey, "Tetrahedral grid
/// refinement", 1995). Midpoints are numbered after the old points, in the order of their ends.
///
/// A cell that names a vertex twice, as one of the SPX mesh does, becomes eight copies of itself: no import keeps it, but rounding could
/// give some of its parts a volume.
pub(super) fn split(mesh: &RawMesh, values: &[f32]) -> (RawMesh, Vec<f32>) {
    let key = |tet: &[u32; 4], [a, b]: [usize; 2]| (tet[a].min(tet[b]), tet[a].max(tet[b]));
    let mut edges: Vec<(u32, u32)> = mesh
        .cells
        .tets
        .par_iter()
        .filter(|tet| has_inside(tet))
        .flat_map_iter(|tet| EDGES.map(|edge| key(tet, edge)))
        .collect();
    edges.par_sort_unstable();
    edges.dedup();
    let first = mesh.points.len();
    let mut points = mesh.points.clone();
    points.extend(edges.iter().map(|&(a, b)| 0.5 * mesh.points[a as usize] + 0.5 * mesh.points[b as usize]));
    let mean =
        |&(a, b): &(u32, u32)| (0.5 * f64::from(values[a as usize]) + 0.5 * f64::from(values[b as usize])) as f32;
    let values = values.iter().copied().chain(edges.iter().map(mean)).collect();
    // Contains every edge of a cell with four different vertices, fewer than 6 MAX_CELLS < 2^32 in all.
    let middle = |tet: &[u32; 4], edge| (first + edges.binary_search(&key(tet, edge)).unwrap_or_default()) as u32;
    let eight = |tet: &[u32; 4]| {
        if !has_inside(tet) {
            return [*tet; 8];
        }
        let middles = EDGES.map(|edge| middle(tet, edge));
        let corner =
            |of: [Result<usize, usize>; 4]| of.map(|v| v.map_or_else(|edge| middles[edge], |corner| tet[corner]));
        let length = |[a, b]: [usize; 2]| points[middles[a] as usize].distance_squared(points[middles[b] as usize]);
        let shortest = DIAGONALS
            .iter()
            .skip(1)
            .fold(&DIAGONALS[0], |best, other| if length(other.0) < length(best.0) { other } else { best });
        let ([a, b], ring) = *shortest;
        let around = |i: usize| [middles[a], middles[b], middles[ring[i]], middles[ring[(i + 1) % 4]]];
        let [c0, c1, c2, c3] = CORNERS.map(corner);
        [c0, c1, c2, c3, around(0), around(1), around(2), around(3)]
    };
    let tets: Vec<_> = mesh.cells.tets.par_iter().flat_map_iter(eight).collect();
    (RawMesh { points, cells: tets.into() }, values)
}
