//! Some cells of the first step of a source: what can be shown of it before its mesh is known.

use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, FieldSelector, SeriesSource, TimeAxis};
use crate::mesh::{Cells, RawMesh};
use crate::random::hash;
use glam::DVec3;

/// Cells that are shown.
const CELLS: usize = 100_000;

/// A source of one step and one field, with one cell of each of so many stretches of the cells of another source. Each has vertices of its
/// own, and is enlarged about their mean to the volume of those that it stands for, so that a picture is about as dense as that of all.
#[derive(Debug)]
pub struct FirstStep {
    description: String,
    times: TimeAxis,
    fields: Vec<FieldInfo>,
    unit: Option<String>,
    mesh: RawMesh,
    /// The values of each component.
    values: Vec<Vec<f32>>,
}

/// A source and its points and cells, as they are before the mesh is built.
#[derive(Clone, Copy)]
pub struct ReadMesh<'a> {
    /// The source.
    pub source: &'a dyn SeriesSource,
    /// Its points and cells, of which nothing is checked yet; those of a cloud with the radii and volumes that they are imported with, unless
    /// these are estimated.
    pub raw: &'a RawMesh,
}

impl ReadMesh<'_> {
    /// At most 100,000 of the cells, and their values of a field of that name, or else of the first field; `None` if the import is about to
    /// say why there are none.
    pub fn first_step(&self, field: Option<&FieldSelector>) -> Option<FirstStep> {
        self.some_cells(field, CELLS)
    }

    /// [`Self::first_step`] of at most `most` cells.
    pub(crate) fn some_cells(&self, field: Option<&FieldSelector>, most: usize) -> Option<FirstStep> {
        let (source, fields) = (self.source, self.source.fields());
        let named = |info: &&FieldInfo| field.is_some_and(|field| field.name == info.name);
        let info = fields.iter().find(named).or(fields.first())?.clone();
        let numbers = one_of_each(self.raw.cells.len(), most);
        let (mesh, points) = apart(self.raw, &numbers)?;
        let wanted = match info.association {
            Association::Point => &points,
            Association::Cell => &numbers,
        };
        let (mut all, mut values) = (Vec::new(), Vec::new());
        for component in 0..info.components {
            source.read(&info, Component::Index(component), 0, &mut all).ok()?;
            values.push(wanted.iter().map(|&of| all.get(of as usize).copied()).collect::<Option<_>>()?);
        }
        let times = TimeAxis { values: vec![*source.times().values.first()?] };
        let unit = source.unit(&info);
        Some(FirstStep { description: source.describe(), times, fields: vec![info], unit, mesh, values })
    }
}

/// One number of each of at most `most` equal stretches of the numbers below `count`, ascending.
fn one_of_each(count: usize, most: usize) -> Vec<u32> {
    let stretches = count.min(most);
    let begin = |stretch: usize| (stretch as u64 * count as u64 / stretches as u64) as usize;
    let chosen = |stretch: usize| {
        let (from, to) = (begin(stretch), begin(stretch + 1));
        (from + (hash(0, stretch as u64) % (to - from) as u64) as usize) as u32
    };
    (0..stretches).map(chosen).collect()
}

/// The cells of these numbers, with vertices of their own, and the point that each vertex was; `None` if a cell names a point that is not
/// there.
fn apart(raw: &RawMesh, numbers: &[u32]) -> Option<(RawMesh, Vec<u32>)> {
    let gathered = raw.cells.gathered(numbers);
    let stands_for = raw.cells.len() as f64 / numbers.len().max(1) as f64;
    let larger = stands_for.cbrt();
    let mut cells = Cells {
        radii: gathered.radii.iter().map(|radius| radius * larger).collect(),
        volumes: gathered.volumes.iter().map(|volume| volume * stands_for).collect(),
        ..Cells::default()
    };
    let (mut points, mut source) = (Vec::new(), Vec::new());
    // Vertices of all cells are numbered one after the other.
    let mut add = |vertices: &[u32]| -> Option<u32> {
        let first = u32::try_from(points.len()).ok()?;
        let own: Option<Vec<DVec3>> = vertices.iter().map(|&v| raw.points.get(v as usize).copied()).collect();
        let own = own?;
        let middle = own.iter().sum::<DVec3>() / own.len() as f64;
        points.extend(own.iter().map(|&point| middle + (point - middle) * larger));
        source.extend_from_slice(vertices);
        Some(first)
    };
    for tet in &gathered.tets {
        let first = add(tet)?;
        cells.tets.push([0, 1, 2, 3].map(|corner| first + corner));
    }
    for solid in gathered.solids.iter() {
        let vertices = solid.vertices();
        let first = add(vertices)?;
        let place = |vertex: u32| (0u32..).zip(vertices).find(|(_, other)| **other == vertex).map_or(0, |(at, _)| at);
        cells.solids.push_renumbered(solid, |vertex| first + place(vertex));
    }
    for &point in &gathered.points {
        cells.points.push(add(&[point])?);
    }
    Some((RawMesh { points, cells }, source))
}

impl SeriesSource for FirstStep {
    fn describe(&self) -> String {
        self.description.clone()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn unit(&self, _: &FieldInfo) -> Option<String> {
        self.unit.clone()
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let values = match component {
            Component::Index(component) if step == 0 => self.values.get(component),
            _ => None,
        };
        let values = values.ok_or_else(|| {
            let place = format!("field '{}', step {step}", field.name);
            FileError::invalid(&self.description, place, "only components of the first step are there")
        })?;
        out.clone_from(values);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::{IngestOptions, ingest};
    use crate::mesh::{ConnectivityChoice, Mesh, SolidShape};
    use crate::store::Store;
    use crate::synth::{SeriesName, SynthSpec, generate};
    use crate::task::{Cancel, Silent};

    #[test]
    fn one_number_of_each_stretch_is_chosen() {
        assert_eq!(one_of_each(5, 9), [0, 1, 2, 3, 4]);
        assert!(one_of_each(0, 9).is_empty());
        let chosen = one_of_each(1003, 100);
        assert!(chosen.iter().zip(0..).all(|(&number, at)| (at * 1003 / 100..(at + 1) * 1003 / 100).contains(&number)));
        // Not the same cell of each group of six, say, into which a box was split.
        let of_six: std::collections::BTreeSet<u32> = one_of_each(600, 100).iter().map(|number| number % 6).collect();
        assert_eq!(of_six.len(), 6);
    }

    #[test]
    fn some_cells_have_the_volume_and_the_values_of_all() {
        let series = generate(&SynthSpec { cells: 6000, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let raw = series.mesh().unwrap();
        let (all, _) = Mesh::build(raw.clone()).unwrap();
        let read = ReadMesh { source: &series, raw: &raw };
        let some = read.some_cells(None, 500).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("some.zarr");
        let options = IngestOptions { connectivity: ConnectivityChoice::None, ..Default::default() };
        ingest(&some, &out, &options, &Silent, &Cancel::new()).unwrap();
        let store = Store::open(&out).unwrap();
        let mesh = store.mesh().unwrap();
        assert_eq!((mesh.topology.tets.len(), mesh.positions.local.len()), (500, 2000));
        assert!(!mesh.is_connected);
        // Of stretches of 12 cells, whose volumes differ by a tenth or so: the error of a mean of 500 is below 2 %.
        let world = |mesh: &Mesh| mesh.total_volume() * mesh.positions.scale.powi(3);
        let ratio = world(&mesh) / world(&all);
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
        let mut values = Vec::new();
        series.read(&series.fields()[0], Component::Index(0), 0, &mut values).unwrap();
        assert!(some.values[0].iter().all(|value| values.iter().any(|of_all| of_all.to_bits() == value.to_bits())));
    }

    #[test]
    fn cells_of_other_shapes_and_points_are_enlarged_about_their_middles() {
        let corner = |i: u32| DVec3::new(f64::from((i ^ (i >> 1)) & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
        let mut raw = RawMesh::default();
        for at in 0..8u32 {
            raw.points.extend((0..8).map(|i| corner(i) + DVec3::X * f64::from(at)));
            raw.cells.solids.push(SolidShape::Hexahedron, 8 * at..8 * at + 8);
        }
        let (larger, source) = apart(&raw, &[3]).unwrap();
        assert_eq!((larger.points.len(), source), (8, (24..32).collect()));
        assert_eq!((larger.points[0], larger.points[6]), (DVec3::new(2.5, -0.5, -0.5), DVec3::new(4.5, 1.5, 1.5)));
        assert!(Mesh::build(larger).is_ok());
        let cells = Cells { points: (0..8).collect(), radii: vec![1.5; 8], volumes: vec![2.0; 8], ..Cells::default() };
        let balls = RawMesh { points: raw.points[..8].to_vec(), cells };
        let (larger, _) = apart(&balls, &[5]).unwrap();
        assert_eq!((larger.points[0], larger.cells.radii[0], larger.cells.volumes[0]), (balls.points[5], 3.0, 16.0));
    }

    #[test]
    fn points_have_the_sizes_that_they_are_imported_with() {
        let field = |name: &str| FieldInfo { name: name.to_owned(), association: Association::Point, components: 1 };
        let points: Vec<DVec3> =
            (0..40).map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5), f64::from(i % 3))).collect();
        let cells = Cells { points: (0..40).collect(), ..Cells::default() };
        let source = |name| FirstStep {
            description: "cloud".to_owned(),
            times: TimeAxis { values: vec![0.0] },
            fields: vec![field(name)],
            unit: None,
            mesh: RawMesh { points: points.clone(), cells: cells.clone() },
            values: vec![(0u8..40).map(|i| 0.25 + f32::from(i)).collect()],
        };
        let dir = tempfile::tempdir().unwrap();
        let told = |source: &FirstStep, options: &IngestOptions| {
            let (out, mut told) = (dir.path().join("cloud.zarr"), None);
            let options = IngestOptions { overwrite: true, ..options.clone() };
            let mut read = |mesh: ReadMesh<'_>| told = mesh.some_cells(None, 5);
            crate::ingest::ingest_and_tell(source, &out, &options, &Silent, &Cancel::new(), &mut read).unwrap();
            told.unwrap()
        };
        let chosen = one_of_each(40, 5);
        // Five points in place of forty have eight times the volume.
        let of_field: Vec<f64> = chosen.iter().map(|&point| 2.0 * (0.25 + f64::from(point))).collect();
        assert_eq!(told(&source("radius"), &IngestOptions::default()).mesh.cells.radii, of_field);
        let given = IngestOptions { radius: Some(0.5), volume: Some(0.125), ..Default::default() };
        let cells = told(&source("radius"), &given).mesh.cells;
        assert_eq!((cells.radii, cells.volumes), (vec![1.0; 5], vec![1.0; 5]));
        let of_field: Vec<f64> = of_field.iter().map(|radius| 4.0 * radius).collect();
        assert_eq!(told(&source("volume"), &IngestOptions::default()).mesh.cells.volumes, of_field);
        // Those of points without any are estimated from the few points, which are farther apart.
        let cells = told(&source("v"), &IngestOptions::default()).mesh.cells;
        assert!(cells.radii.is_empty() && cells.volumes.is_empty());
    }

    #[test]
    fn what_no_import_takes_has_no_first_step() {
        let series = generate(&SynthSpec { cells: 600, steps: 1, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
        let mut raw = series.mesh().unwrap();
        let last = raw.cells.tets.len() - 1;
        raw.cells.tets[last][2] = u32::MAX;
        assert!(ReadMesh { source: &series, raw: &raw }.first_step(None).is_none());
        // More cells than the fields of the source have values for.
        raw.points.truncate(10);
        assert!(ReadMesh { source: &series, raw: &raw }.first_step(None).is_none());
    }
}
