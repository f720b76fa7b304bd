//! A box of unit cubes, each of six tetrahedra or a hexahedron, with fields of cells and points by formula.

use glam::DVec3;
use tetreel::error::FileResult;
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::mesh::{RawMesh, SolidShape};

/// Value of (field name, step, point or middle of a cell).
type Formula = Box<dyn Fn(&str, usize, DVec3) -> f32 + Send + Sync>;

/// The series.
pub struct Cubes {
    mesh: RawMesh,
    /// The middle of each cell.
    middles: Vec<DVec3>,
    times: TimeAxis,
    fields: Vec<FieldInfo>,
    value: Formula,
}

/// The box from 0 to `size`, with fields of points and of cells.
pub fn cubes(
    size: [u32; 3],
    are_whole: bool,
    steps: usize,
    fields: &[(&str, Association)],
    value: impl Fn(&str, usize, DVec3) -> f32 + Send + Sync + 'static,
) -> Cubes {
    let [nx, ny, nz] = size;
    let at = |[x, y, z]: [u32; 3]| x + (nx + 1) * (y + (ny + 1) * z);
    let place = |i: u32, [nx, ny]: [u32; 2]| [i % nx, i / nx % ny, i / nx / ny];
    let point = |[x, y, z]: [u32; 3]| DVec3::new(x.into(), y.into(), z.into());
    let points = (0..(nx + 1) * (ny + 1) * (nz + 1)).map(|i| point(place(i, [nx + 1, ny + 1])));
    let mut mesh = RawMesh { points: points.collect(), ..RawMesh::default() };
    let mut middles = Vec::new();
    for corner in (0..nx * ny * nz).map(|i| place(i, [nx, ny])) {
        if are_whole {
            let layer = |dz: u32| {
                [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[dx, dy]| at([corner[0] + dx, corner[1] + dy, corner[2] + dz]))
            };
            mesh.cells.solids.push(SolidShape::Hexahedron, [layer(0), layer(1)].concat().into_iter());
            middles.push(point(corner) + 0.5);
            continue;
        }
        for path in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut to = corner;
            let mut tet = [at(to); 4];
            for (vertex, axis) in tet[1..].iter_mut().zip(path) {
                to[axis] += 1;
                *vertex = at(to);
            }
            middles.push(tet.iter().map(|&v| mesh.points[v as usize]).sum::<DVec3>() / 4.0);
            mesh.cells.tets.push(tet);
        }
    }
    let times = TimeAxis { values: (0..steps).map(|step| step as f64).collect() };
    let field =
        |&(name, association): &(&str, Association)| FieldInfo { name: name.to_owned(), components: 1, association };
    Cubes { mesh, middles, times, fields: fields.iter().map(field).collect(), value: Box::new(value) }
}

impl SeriesSource for Cubes {
    fn describe(&self) -> String {
        "cubes".to_owned()
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

    fn read(&self, field: &FieldInfo, _: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let places = match field.association {
            Association::Point => &self.mesh.points,
            Association::Cell => &self.middles,
        };
        out.clear();
        out.extend(places.iter().map(|&at| (self.value)(&field.name, step, at)));
        Ok(())
    }
}
