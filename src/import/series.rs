//! Steps of files as a [`SeriesSource`]: the mesh, checked at every step, and the values of its fields.

use super::cache::StepCache;
use super::cells::GridReader;
use super::joints::{Joints, agree, coincident, of_one_number};
use super::made::{Made, blocks_of};
use super::pieces::{Piece, decode, fields_of};
use super::tally::Tally;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::{Cells, RawMesh, gather};
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// One step in a format: a mesh in pieces, and fields on it.
pub(super) trait StepReader: Send + Sync + Sized {
    /// Location of a step, from which it is opened.
    type Origin: Send + Sync;
    /// The pieces of its mesh.
    type Piece: Piece;

    /// Opens a step and reads its list of arrays.
    fn open(origin: &Self::Origin) -> FileResult<Self>;
    /// The file that errors about the whole step name.
    fn path(&self) -> &Path;
    /// Bytes of memory that the step takes.
    fn bytes(&self) -> usize;
    /// The pieces that have points or cells.
    fn pieces(&self) -> &[Self::Piece];

    /// Number of points, and of cells of any kind.
    fn counts(&self) -> (usize, usize) {
        self.pieces().iter().map(Piece::counts).fold((0, 0), |(points, cells), (more_points, more_cells)| {
            (points.saturating_add(more_points), cells.saturating_add(more_cells))
        })
    }

    /// Reads the mesh.
    ///
    /// # Errors
    /// If it is damaged, or has cells that are not read.
    fn read_grid(&self) -> FileResult<GridReader> {
        let mut grid = GridReader::default();
        self.pieces().iter().try_for_each(|piece| piece.add_to(&mut grid))?;
        grid.finish();
        Ok(grid)
    }

    /// A hash of the stored mesh: equal hashes are equal meshes, other hashes may be.
    ///
    /// # Errors
    /// If it is damaged.
    fn stored_hash(&self) -> FileResult<u64> {
        let mut state = DefaultHasher::new();
        self.pieces().iter().try_for_each(|piece| piece.hash_mesh(&mut state))?;
        Ok(state.finish())
    }
}

/// The decoded arrays of a field, one for each piece that has it.
type Arrays<S> = Vec<Option<<<S as StepReader>::Piece as Piece>::Array>>;

/// A series of steps of one format.
pub(super) struct Series<S: StepReader> {
    description: String,
    times: TimeAxis,
    steps: Vec<S::Origin>,
    fields: Vec<FieldInfo>,
    shape: Shape,
    /// Fields among these that no file has.
    made: Vec<Made>,
    notes: Vec<String>,
    cache: StepCache<Step<S>>,
    /// Values that became infinite, points that were joined and have other values than the first of them, and values that are missing.
    overflows: Tally,
    differing: Tally,
    missing: Tally,
    /// Steps at which points are elsewhere than at the first.
    moved: Tally,
}

/// A step in memory, and the field decoded last, for reading its components one after the other.
struct Step<S: StepReader> {
    reader: S,
    decoded: Mutex<Option<DecodedField<Arrays<S>>>>,
}

struct DecodedField<D> {
    association: Association,
    name: String,
    arrays: Arc<D>,
    bytes: usize,
}

/// Mesh data shared by all steps.
struct Shape {
    points: usize,
    cells: usize,
    /// Index of each cell of the mesh among all cells of the file; `None` if it is the same.
    kept: Option<Vec<u32>>,
    /// Hashes of the mesh arrays as stored: of the first step, and of those whose mesh was found to be the same.
    stored_hashes: Mutex<HashSet<u64>>,
    /// Hashes of the points and cells themselves.
    points_hash: u64,
    cells_hash: u64,
    /// Points that pieces share.
    joints: Option<Joints>,
}

impl<S: StepReader> Series<S> {
    /// A series of `steps`, one for each time. The first step is read for the mesh and the fields.
    ///
    /// # Errors
    /// If the first step cannot be read or has no cells with a volume.
    pub(super) fn new(
        description: String,
        times: TimeAxis,
        steps: Vec<S::Origin>,
        mut notes: Vec<String>,
    ) -> FileResult<Self> {
        let Some(origin) = steps.first() else {
            return Err(FileError::invalid(&description, "", "there are no files to read"));
        };
        let first = Step::<S>::open(origin)?;
        let grid = first.reader.read_grid()?;
        if grid.mesh.cells.is_empty() {
            let found = [vec![format!("{} cells", grid.cells)], grid.notes()].concat().join("; ");
            return Err(FileError::unsupported(
                first.reader.path(),
                "",
                format!("has no cells with a volume ({found})"),
            )
            .remedy("write a volume mesh: tetrahedra, hexahedra, wedges, pyramids, prisms or polyhedra; or a cloud of vertices"));
        }
        notes.extend(grid.notes());
        let (fields, mut left_out) = fields_of(first.reader.pieces());
        if !left_out.is_empty() {
            left_out.sort();
            left_out.dedup();
            notes.push(format!("left out {} arrays: {}", left_out.len(), left_out.join(", ")));
        }
        let (joints, apart) = joints_of(&first, &grid.mesh, &fields)?;
        if let Some(joints) = &joints {
            notes.push(format!("joined {} points on borders between pieces", joints.len()));
        }
        if apart > 0 {
            notes.push(format!("kept {apart} points on borders between pieces apart: their values differ"));
        }
        let (mut fields, mut made) = (fields, Vec::new());
        made.extend(Made::blocks(first.reader.pieces(), &mut fields));
        let shape = Shape { joints, ..Shape::of(&first.reader, grid)? };
        let cache = StepCache::default();
        cache.get(0, || Ok(first), Step::bytes)?;
        Ok(Self {
            description,
            times,
            steps,
            fields,
            shape,
            made,
            notes,
            cache,
            overflows: Tally::default(),
            differing: Tally::default(),
            missing: Tally::default(),
            moved: Tally::default(),
        })
    }

    fn step(&self, step: usize) -> FileResult<Arc<Step<S>>> {
        let Some(origin) = self.steps.get(step) else {
            let problem = format!("there is no step {step}: the series has {}", self.steps.len());
            return Err(FileError::invalid(&self.description, "", problem));
        };
        let load = || {
            let loaded = Step::open(origin)?;
            self.check_mesh(&loaded.reader, step)?;
            Ok(loaded)
        };
        self.cache.get(step, load, Step::bytes)
    }

    /// Fails unless there is such a field, and it has that component.
    fn check_field(&self, field: &FieldInfo, component: usize, path: &Path) -> FileResult<()> {
        let problem = match () {
            () if !self.fields.contains(field) => "is none of the fields of the first step".to_owned(),
            () if component >= field.components => {
                format!("has {} components, and no component {component}", field.components)
            }
            () => return Ok(()),
        };
        Err(FileError::invalid(path, format!("field '{}'", field.name), problem))
    }

    /// Fails unless the mesh of `loaded` is that of the first step. Its arrays are decoded only if their stored hash differs.
    fn check_mesh(&self, loaded: &S, step: usize) -> FileResult<()> {
        let (points, cells) = loaded.counts();
        let changed = |what: String| {
            let before = match step {
                // The file of the first step may be written anew while the series is open.
                0 | 1 => String::new(),
                _ => format!(", as those before it (--steps 0..{})", step - 1),
            };
            let problem = format!("the mesh changes between steps 0 and {step}: {what}");
            let remedy = "where points alone move, import with --fixed-points";
            FileError::unsupported(loaded.path(), format!("step {step}"), problem)
                .remedy(format!("import only steps with the same mesh{before}; {remedy}"))
        };
        if (points, cells) != (self.shape.points, self.shape.cells) {
            let (old_points, old_cells) = (self.shape.points, self.shape.cells);
            return Err(changed(format!("{old_points} points and {old_cells} cells, then {points} and {cells}")));
        }
        let stored_hash = loaded.stored_hash()?;
        let known = || self.shape.stored_hashes.lock().unwrap_or_else(PoisonError::into_inner);
        if known().contains(&stored_hash) {
            return Ok(());
        }
        let grid = loaded.read_grid()?;
        if hash_cells(&grid) != self.shape.cells_hash {
            return Err(changed("other cells".to_owned()));
        }
        if hash_points(&grid.mesh) != self.shape.points_hash {
            if !self.made.iter().any(Made::is_displacement) {
                return Err(changed("points move".to_owned()));
            }
            self.moved.note("", step, 1);
            return Ok(());
        }
        known().insert(stored_hash);
        Ok(())
    }

    /// All that is counted.
    fn tallies(&self) -> [&Tally; 4] {
        [&self.overflows, &self.differing, &self.missing, &self.moved]
    }

    /// Values of a field that no file has, of all pieces; `None` if a file has it.
    fn made(&self, field: &FieldInfo, component: Component, step: usize, loaded: &S) -> FileResult<Option<Vec<f64>>> {
        let made = self.made.iter().find(|made| made.info == *field);
        made.map(|made| made.values(component, (step, loaded))).transpose()
    }
}

impl<S: StepReader> SeriesSource for Series<S> {
    fn describe(&self) -> String {
        self.description.clone()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn unit(&self, field: &FieldInfo) -> Option<String> {
        let first = self.step(0).ok()?;
        let piece = first.reader.pieces().first()?;
        piece.unit(piece.arrays().iter().position(|array| array == field)?)
    }

    fn cell_number(&self, cell: u32) -> u32 {
        self.shape.kept.as_ref().and_then(|kept| kept.get(cell as usize)).copied().unwrap_or(cell)
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        let mesh = self.step(0)?.reader.read_grid()?.mesh;
        Ok(match &self.shape.joints {
            Some(joints) => joints.join(mesh),
            None => mesh,
        })
    }

    fn blocks(&self) -> FileResult<Option<Blocks>> {
        let loaded = self.step(0)?;
        let Some(mut blocks) = blocks_of(loaded.reader.pieces()) else { return Ok(None) };
        if let Some(kept) = &self.shape.kept {
            gather(&mut blocks.of_cell, kept);
        }
        Ok(Some(blocks))
    }

    fn fix_points(&mut self) -> FileResult<()> {
        if !self.made.iter().any(Made::is_displacement) {
            let points = self.step(0)?.reader.read_grid()?.mesh.points;
            self.made.push(Made::displacement(points, &mut self.fields));
        }
        Ok(())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        out.clear();
        let loaded = self.step(step)?;
        let index = if let Component::Index(index) = component { index } else { 0 };
        self.check_field(field, index, loaded.reader.path())?;
        if let Some(values) = self.made(field, component, step, &loaded.reader)? {
            out.extend(values.into_iter().map(|value| value as f32));
            self.shape.select(field.association, out, |_, _| true);
            return Ok(());
        }
        let decoded = loaded.field(field, step)?;
        let (mut overflows, mut missing) = (0, 0);
        for (piece, array) in loaded.reader.pieces().iter().zip(decoded.iter()) {
            let Some(array) = array else {
                missing += pad(piece, field, f32::NAN, out);
                continue;
            };
            let values = piece.values(array);
            overflows += match component {
                Component::Index(index) => values.component(field.components, index, out),
                Component::Magnitude => values.magnitude(field.components, out),
            };
        }
        self.differing.note(&field.name, step, self.shape.select(field.association, out, agree) as u64);
        self.overflows.note(&field.name, step, overflows);
        self.missing.note(&field.name, step, missing);
        Ok(())
    }

    fn read_f64(&self, field: &FieldInfo, component: usize, step: usize, out: &mut Vec<f64>) -> FileResult<()> {
        out.clear();
        let loaded = self.step(step)?;
        self.check_field(field, component, loaded.reader.path())?;
        if let Some(values) = self.made(field, Component::Index(component), step, &loaded.reader)? {
            *out = values;
            self.shape.select(field.association, out, |_, _| true);
            return Ok(());
        }
        let decoded = loaded.field(field, step)?;
        for (piece, array) in loaded.reader.pieces().iter().zip(decoded.iter()) {
            match array {
                Some(array) => piece.values(array).component_f64(field.components, component, out),
                None => self.missing.note(&field.name, step, pad(piece, field, f64::NAN, out)),
            }
        }
        self.shape.select(field.association, out, |_, _| true);
        Ok(())
    }

    fn check(&self, step: usize) -> FileResult<()> {
        let loaded = self.step(step)?;
        for piece in loaded.reader.pieces() {
            let arrays: HashSet<FieldInfo> = piece.arrays().into_iter().collect();
            let of_files = self.fields.iter().filter(|field| self.made.iter().all(|made| made.info != **field));
            let missing = of_files.filter(|field| !arrays.contains(field));
            missing.for_each(|field| self.missing.note(&field.name, step, 1));
        }
        Ok(())
    }

    fn counted(&self, last: usize) -> serde_json::Value {
        self.tallies().map(|tally| tally.counted(last)).into_iter().collect()
    }

    fn count_on(&self, counted: &serde_json::Value) {
        self.tallies()
            .into_iter()
            .zip(counted.as_array().into_iter().flatten())
            .for_each(|(tally, counted)| tally.count_on(counted));
    }

    fn notes(&self) -> Vec<String> {
        let overflows = self.overflows.lines(|name, count, steps| {
            format!("field '{name}': {count} values in {steps} are beyond the range of f32 and became infinite")
        });
        let differing = self.differing.lines(|name, count, steps| {
            let problem = "points on borders between pieces have another value than in the first piece, which is taken";
            format!("field '{name}': {count} {problem}, in {steps}")
        });
        let missing = self.missing.lines(|name, _, steps| format!("field '{name}' is missing in {steps}: holes"));
        let moved = self.moved.lines(|_, _, steps| {
            format!("points move in {steps}: shown where they are in the first; a field has their displacement")
        });
        [self.notes.clone(), overflows, differing, missing, moved].concat()
    }
}

/// Appends a value for each point or cell of a piece that lacks a field; returns how many.
fn pad<T: Copy>(piece: &impl Piece, field: &FieldInfo, value: T, out: &mut Vec<T>) -> u64 {
    let (points, cells) = piece.counts();
    let count = if field.association == Association::Point { points } else { cells };
    out.extend(std::iter::repeat_n(value, count));
    count as u64
}

impl<S: StepReader> Step<S> {
    fn open(origin: &S::Origin) -> FileResult<Self> {
        Ok(Self { reader: S::open(origin)?, decoded: Mutex::new(None) })
    }

    fn bytes(&self) -> usize {
        let decoded = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        self.reader.bytes() + decoded.as_ref().map_or(0, |field| field.bytes)
    }

    /// The decoded arrays of a field; cached until another field of this step is read.
    fn field(&self, field: &FieldInfo, step: usize) -> FileResult<Arc<Arrays<S>>> {
        let mut decoded = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = decoded.as_ref()
            && (last.association, &last.name) == (field.association, &field.name)
        {
            return Ok(last.arrays.clone());
        }
        let pieces = self.reader.pieces();
        let arrays = pieces.iter().map(|piece| decode(piece, field, step)).collect::<FileResult<Arrays<S>>>()?;
        let size =
            |(piece, array): (&S::Piece, &Option<_>)| array.as_ref().map_or(0, |array| piece.values(array).bytes.len());
        let bytes = pieces.iter().zip(&arrays).map(size).sum();
        let arrays = Arc::new(arrays);
        let (association, name) = (field.association, field.name.clone());
        *decoded = Some(DecodedField { association, name, arrays: arrays.clone(), bytes });
        Ok(arrays)
    }
}

/// Points that pieces share: those of one number, else those at one place, as far as all values of points agree in this step; and the number
/// of others at one place.
fn joints_of<S: StepReader>(
    step: &Step<S>,
    mesh: &RawMesh,
    fields: &[FieldInfo],
) -> FileResult<(Option<Joints>, usize)> {
    let pieces = step.reader.pieces();
    if pieces.len() < 2 {
        return Ok((None, 0));
    }
    let numbers = pieces.iter().map(Piece::point_numbers).collect::<FileResult<Option<Vec<_>>>>()?;
    if let Some(pairs) = numbers.and_then(|numbers| of_one_number(&mesh.points, &numbers)) {
        return Ok((Joints::of(pairs, mesh.points.len()), 0));
    }
    let mut pairs = coincident(&mesh.points, pieces.iter().map(|piece| piece.counts().0));
    let all = pairs.len();
    let mut values = Vec::new();
    for field in fields.iter().filter(|field| field.association == Association::Point) {
        let decoded = step.field(field, 0)?;
        for component in 0..field.components {
            if pairs.is_empty() {
                break;
            }
            values.clear();
            for (piece, array) in pieces.iter().zip(decoded.iter()) {
                let Some(array) = array else { continue };
                piece.values(array).component(field.components, component, &mut values);
            }
            pairs.retain(|&[point, first]| agree(values[point as usize], values[first as usize]));
        }
    }
    let apart = all - pairs.len();
    Ok((Joints::of(pairs, mesh.points.len()), apart))
}

impl Shape {
    /// Values of the mesh's points or cells in place of those of all pieces. Returns how many joined points had differing values.
    fn select<T: Copy>(&self, of: Association, values: &mut Vec<T>, agree: impl Fn(T, T) -> bool) -> usize {
        match (of, &self.kept, &self.joints) {
            (Association::Cell, Some(kept), _) => gather(values, kept),
            (Association::Point, _, Some(joints)) => return joints.gather(values, agree),
            _ => {}
        }
        0
    }

    fn of(step: &impl StepReader, grid: GridReader) -> FileResult<Self> {
        Ok(Self {
            points: grid.mesh.points.len(),
            cells: grid.cells,
            stored_hashes: Mutex::new(HashSet::from([step.stored_hash()?])),
            points_hash: hash_points(&grid.mesh),
            cells_hash: hash_cells(&grid),
            kept: grid.kept(),
            joints: None,
        })
    }
}

fn hash_points(mesh: &RawMesh) -> u64 {
    let mut state = DefaultHasher::new();
    for point in &mesh.points {
        // Adding zero turns -0 into +0.
        point.to_array().map(|v| (v + 0.0).to_bits()).hash(&mut state);
    }
    state.finish()
}

fn hash_cells(grid: &GridReader) -> u64 {
    let mut state = DefaultHasher::new();
    let Cells { tets, solids, points, radii, volumes } = &grid.mesh.cells;
    (tets, solids, points, grid.kept()).hash(&mut state);
    radii.iter().chain(volumes).for_each(|size| size.to_bits().hash(&mut state));
    state.finish()
}
