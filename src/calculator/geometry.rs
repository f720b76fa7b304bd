//! Gradients on a mesh in the numbering of its source, as means over its cells.
//!
//! The scalar is linear in each tetrahedron, so that volume times gradient is a sum of products without a division:
//! `(s_a b x c + s_b c x a + s_c a x b) / 6` for edges a, b, c from one corner and differences s of scalars (see `mesh::gradient`),
//! with the sign of the determinant. The mean gradient in a cell is the sum over its tetrahedra over its volume; that at a point is the
//! sum over the cells around it over theirs. Slivers weigh as little as they fill, and flat tetrahedra nothing. A point that was added in the
//! middle of a cell has the mean of its corners.

use super::values::Values;
use crate::field::Association;
use crate::mesh::{RawMesh, split};
use glam::DVec3;
use rayon::prelude::*;

/// Most components of what a gradient is taken of.
pub(super) const COMPONENTS_MAX: usize = 3;

/// The points and cells of a source, and the tetrahedra of each cell.
pub(super) struct Geometry {
    /// The points, then those that were added.
    points: Vec<DVec3>,
    /// Number of points of the source.
    of_source: usize,
    /// The points that were added, each with the corners of its cell.
    steiner: Vec<(u32, Vec<u32>)>,
    /// Vertices of the tetrahedra, cell by cell, and where those of each cell end.
    tets: Vec<[u32; 4]>,
    ends: Vec<usize>,
    /// Volume of each cell.
    volumes: Vec<f64>,
}

impl Geometry {
    pub(super) fn of(mesh: RawMesh) -> Self {
        let RawMesh { mut points, cells } = mesh;
        let (count, of_source) = (cells.len(), points.len());
        let mut split = split(cells, &points);
        points.append(&mut split.steiner.points);
        let steiner = split.steiner_corners().collect();
        let mut ends = vec![0; count];
        match &split.cell_of_tet {
            None => ends.iter_mut().enumerate().for_each(|(cell, end)| *end = cell + 1),
            Some(cells) => {
                cells.iter().enumerate().for_each(|(tet, &cell)| ends[cell as usize] = tet + 1);
                // A cell without tetrahedra ends where the one before it does.
                (1..count).for_each(|cell| ends[cell] = ends[cell].max(ends[cell - 1]));
            }
        }
        let mut geometry = Self { points, of_source, steiner, tets: split.tets, ends, volumes: Vec::new() };
        let volume = |cell| geometry.tets(cell).iter().map(|tet| geometry.edges(*tet).1.abs() / 6.0).sum();
        geometry.volumes = (0..count).into_par_iter().map(volume).collect();
        geometry
    }

    /// Number of points or cells.
    pub(super) fn len(&self, association: Association) -> usize {
        if association == Association::Point { self.of_source } else { self.ends.len() }
    }

    /// Whether a cell has a volume.
    pub(super) fn has_volume(&self) -> bool {
        self.volumes.iter().any(|volume| *volume > 0.0)
    }

    fn tets(&self, cell: usize) -> &[[u32; 4]] {
        let begin = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.tets[begin..self.ends[cell]]
    }

    /// The edges from the first corner, and their determinant.
    fn edges(&self, tet: [u32; 4]) -> ([DVec3; 3], f64) {
        let [o, p, q, r] = tet.map(|vertex| self.points[vertex as usize]);
        let [a, b, c] = [p - o, q - o, r - o];
        ([a, b, c], a.dot(b.cross(c)))
    }

    /// The distinct vertices of a cell into `out`, without one that was added.
    fn vertices(&self, cell: usize, out: &mut Vec<u32>) {
        out.clear();
        for &vertex in self.tets(cell).as_flattened() {
            if (vertex as usize) < self.of_source && !out.contains(&vertex) {
                out.push(vertex);
            }
        }
    }

    /// Positions of points, or means of the vertices of cells, three numbers each.
    pub(super) fn positions(&self, association: Association) -> Values {
        let data = match association {
            Association::Point => self.points[..self.of_source].iter().flat_map(|p| p.to_array()).collect(),
            Association::Cell => {
                let mut vertices = Vec::new();
                let mut mean = |cell| {
                    self.vertices(cell, &mut vertices);
                    let sum: DVec3 = vertices.iter().map(|&vertex| self.points[vertex as usize]).sum();
                    (sum / vertices.len() as f64).to_array()
                };
                (0..self.ends.len()).flat_map(&mut mean).collect()
            }
        };
        Values::of(3, data)
    }

    /// Gradients of values of points or cells, row by row (the derivatives of a component along x, y, z). Values of cells are brought to the
    /// points first. NaN where a scalar around is NaN, or where there is no cell with a volume.
    pub(super) fn gradient(&self, values: &Values, association: Association) -> Values {
        let components = values.components;
        if values.is_constant {
            return Values { components: 3 * components, data: vec![0.0; 3 * components], is_constant: true };
        }
        let mut of_points = (association == Association::Cell).then(|| self.to_points(values));
        if !self.steiner.is_empty() {
            self.add_means(of_points.get_or_insert_with(|| values.clone()));
        }
        let of_points = of_points.as_ref().unwrap_or(values);
        let integral = |cell: usize| {
            let mut sum = [[0.0; 3]; COMPONENTS_MAX];
            for &tet in self.tets(cell) {
                let ([a, b, c], determinant) = self.edges(tet);
                if determinant == 0.0 {
                    continue;
                }
                let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
                for (component, sum) in sum.iter_mut().enumerate().take(components) {
                    let [o, p, q, r] = tet.map(|vertex| of_points.data[vertex as usize * components + component]);
                    let numerator = (p - o) * bc + (q - o) * ca + (r - o) * ab;
                    let numerator = (numerator * (determinant.signum() / 6.0)).to_array();
                    sum.iter_mut().zip(numerator).for_each(|(sum, part)| *sum += part);
                }
            }
            sum
        };
        let integrals: Vec<[[f64; 3]; COMPONENTS_MAX]> = (0..self.ends.len()).into_par_iter().map(integral).collect();
        let width = 3 * components;
        let data = match association {
            Association::Cell => {
                let mean = |(sum, volume): (&[[f64; 3]; COMPONENTS_MAX], f64)| {
                    sum.as_flattened()[..width].iter().map(|part| part / volume).collect::<Vec<_>>()
                };
                integrals.iter().zip(self.volumes.iter().copied()).flat_map(mean).collect()
            }
            Association::Point => self.around(width, |cell, out| {
                out.extend_from_slice(&integrals[cell].as_flattened()[..width]);
            }),
        };
        Values::of(width, data)
    }

    /// Appends to values of the source's points those of the points that were added: means of the corners of their cells.
    fn add_means(&self, values: &mut Values) {
        let width = values.components;
        values.data.resize(self.points.len() * width, 0.0);
        for (point, corners) in &self.steiner {
            for component in 0..width {
                let sum: f64 = corners.iter().map(|&corner| values.data[corner as usize * width + component]).sum();
                values.data[*point as usize * width + component] = sum / corners.len() as f64;
            }
        }
    }

    /// The means of cells around each point, weighted by volume.
    fn to_points(&self, values: &Values) -> Values {
        let weighted = |cell: usize, out: &mut Vec<f64>| {
            // A flat cell counts nothing, whatever its value.
            let volume = self.volumes[cell];
            out.extend(values.tuple(cell).iter().map(|value| if volume > 0.0 { value * volume } else { 0.0 }));
        };
        Values::of(values.components, self.around(values.components, weighted))
    }

    /// The sums over the cells around each point of what `integral` appends for a cell, over the sum of the cells' volumes.
    fn around(&self, width: usize, integral: impl Fn(usize, &mut Vec<f64>)) -> Vec<f64> {
        let mut sums = vec![0.0; self.of_source * width];
        let mut volumes = vec![0.0; self.of_source];
        let (mut vertices, mut of_cell) = (Vec::new(), Vec::new());
        for (cell, volume) in self.volumes.iter().enumerate() {
            self.vertices(cell, &mut vertices);
            of_cell.clear();
            integral(cell, &mut of_cell);
            for &vertex in &vertices {
                let vertex = vertex as usize;
                volumes[vertex] += volume;
                sums[vertex * width..][..width].iter_mut().zip(&of_cell).for_each(|(sum, part)| *sum += part);
            }
        }
        for (sum, volume) in sums.chunks_exact_mut(width).zip(volumes) {
            sum.iter_mut().for_each(|sum| *sum /= volume);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Cells, SolidShape};

    /// A hexahedron beside a wedge, warped, one tetrahedron of the other orientation, far from the origin, and a point without a cell.
    fn mesh() -> RawMesh {
        let p = |x: f64, y: f64, z: f64| DVec3::new(1e3 + x, -2e3 + y, z);
        let points = vec![
            p(0.0, 0.0, 0.0),
            p(1.0, 0.0, 0.0),
            p(1.1, 1.0, 0.1),
            p(0.0, 1.0, 0.0),
            p(0.0, 0.0, 1.0),
            p(1.0, 0.1, 1.0),
            p(1.0, 1.0, 1.2),
            p(0.0, 1.0, 1.0),
            p(2.0, 0.5, 0.0),
            p(2.0, 0.5, 1.0),
            p(0.5, 0.5, 3.0),
            p(9.0, 9.0, 9.0),
        ];
        let mut cells = Cells::from(vec![[4, 5, 10, 7]]);
        cells.solids.push(SolidShape::Hexahedron, 0..8);
        cells.solids.push(SolidShape::Wedge, [1, 2, 8, 5, 6, 9].into_iter());
        RawMesh { points, cells }
    }

    #[test]
    fn a_linear_field_has_its_gradient_everywhere_whatever_the_cells() {
        let mesh = mesh();
        let rows = [[1.0, 2.0, -3.0], [0.5, 0.0, 4.0], [-7.0, 1.0, 0.25]];
        let of = |p: &DVec3| rows.map(|[x, y, z]| x * p.x + y * p.y + z * p.z + 5.0);
        let values = Values::of(3, mesh.points.iter().flat_map(of).collect());
        let geometry = Geometry::of(mesh);
        assert_eq!([Association::Point, Association::Cell].map(|of| geometry.len(of)), [12, 3]);
        let gradient = geometry.gradient(&values, Association::Point);
        assert_eq!(gradient.components, 9);
        for (i, tuple) in gradient.data.chunks_exact(9).enumerate().take(11) {
            for (found, expected) in tuple.iter().zip(rows.as_flattened()) {
                // Values of about 1e4 in f64, differences over lengths of about 1, a few tens of them.
                assert!((found - expected).abs() < 1e4 * 64.0 * f64::EPSILON, "{i}: {tuple:?}");
            }
        }
        assert!(gradient.tuple(11).iter().all(|v| v.is_nan()), "no cell there");
    }

    #[test]
    fn a_cell_that_is_cut_from_a_point_in_its_middle_has_its_volume_and_the_gradient_of_a_linear_field() {
        let mut mesh = mesh();
        mesh.cells = Cells::default();
        mesh.cells.solids.push(SolidShape::Hexahedron, 0..8);
        let far = mesh.points[0];
        let cube = |i: u32| DVec3::new(f64::from((i ^ (i >> 1)) & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        (0..8).for_each(|i: u32| mesh.points[i as usize] = far + cube(i));
        mesh.points[1] = far + DVec3::new(0.4375, 0.5, 0.5);
        let row = [1.0, 2.0, -3.0];
        let values = mesh.points.iter().map(|p| row[0] * p.x + row[1] * p.y + row[2] * p.z).collect();
        let geometry = Geometry::of(mesh);
        assert_eq!((geometry.steiner.len(), geometry.len(Association::Point)), (1, 12));
        // By hand; from the corners alone overlaps made it 11/16.
        assert!((geometry.volumes[0] - 31.0 / 48.0).abs() < 1e-12, "{}", geometry.volumes[0]);
        let gradient = geometry.gradient(&Values::of(1, values), Association::Point);
        assert_eq!(gradient.data.len(), 3 * 12);
        for point in 0..8 {
            let near = |(found, expected): (&f64, f64)| (found - expected).abs() < 1e4 * 64.0 * f64::EPSILON;
            assert!(gradient.tuple(point).iter().zip(row).all(near), "{point}: {:?}", gradient.tuple(point));
        }
        assert_eq!(geometry.positions(Association::Point).data.len(), 3 * 12);
    }

    #[test]
    fn gradients_of_cells_are_those_of_the_means_at_their_points() {
        let geometry = Geometry::of(mesh());
        let constant = Values::of(1, vec![2.5; 3]);
        let gradient = geometry.gradient(&constant, Association::Cell);
        assert!(gradient.data.iter().all(|v| v.abs() < 1e-14), "{gradient:?}");
        assert_eq!(gradient.data.len(), 9);
        let positions = geometry.positions(Association::Cell);
        assert!((positions.tuple(0)[2] - 1.5).abs() < 0.1 && positions.data.len() == 9);
        assert_eq!(geometry.positions(Association::Point).tuple(10), [1000.5, -1999.5, 3.0]);
    }

    #[test]
    fn a_value_that_is_not_finite_reaches_the_points_of_its_cells_alone() {
        let geometry = Geometry::of(mesh());
        let mut values = vec![1.0; 12];
        values[10] = f64::NAN;
        let gradient = geometry.gradient(&Values::of(1, values), Association::Point);
        let nan: Vec<usize> = (0..11).filter(|&i| gradient.tuple(i)[0].is_nan()).collect();
        assert_eq!(nan, [4, 5, 7, 10]);
    }
}
