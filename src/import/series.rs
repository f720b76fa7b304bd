//! A series of `.vtu` files as a [`SeriesSource`]: one mesh, checked at every step, and the values of its fields.

use super::cache::StepCache;
use super::vtu::{ArrayBytes, ArrayInfo, GridReader, Piece, VtuFile};
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::RawMesh;
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Steps made of one or more `.vtu` files each.
pub(super) struct VtuSeries {
    description: String,
    times: TimeAxis,
    /// Files of each step.
    steps: Vec<Vec<PathBuf>>,
    fields: Vec<FieldInfo>,
    shape: Shape,
    notes: Vec<String>,
    cache: StepCache<Step>,
    /// Values that became infinite, by field and step: reading a step again does not count them again.
    overflows: Mutex<BTreeMap<(String, usize), u64>>,
}

/// A step in memory: its files as they are, and the array decoded last.
struct Step {
    files: Vec<VtuFile>,
    decoded: Mutex<Option<DecodedField>>,
}

/// One field of a step, for reading its components one after the other.
struct DecodedField {
    association: Association,
    name: String,
    /// One for each piece that holds something, in order.
    pieces: Arc<Vec<ArrayBytes>>,
}

/// What is the same for all steps.
struct Shape {
    points: usize,
    cells: usize,
    /// Index of each tetrahedron among all cells; `None` if all cells are tetrahedra.
    kept: Option<Vec<u32>>,
    /// Of the mesh arrays as stored, and of the points and tetrahedra themselves.
    stored_hash: u64,
    points_hash: u64,
    cells_hash: u64,
}

impl VtuSeries {
    /// A series of `steps`, each a time and its files. The first step is read for the mesh and the fields.
    ///
    /// # Errors
    /// If the first step cannot be read or has no tetrahedra.
    pub(super) fn new(
        description: String,
        times: TimeAxis,
        steps: Vec<Vec<PathBuf>>,
        mut notes: Vec<String>,
    ) -> FileResult<Self> {
        let first = Step::open(steps.first().map_or(&[], Vec::as_slice))?;
        let grid = first.read_grid()?;
        let Some(file) = first.files.first() else {
            return Err(FileError::invalid(&description, "", "there are no files to read"));
        };
        if grid.mesh.tets.is_empty() {
            let found = [vec![format!("{} cells", grid.cells)], grid.notes()].concat().join("; ");
            return Err(FileError::unsupported(file.path(), "", format!("has no tetrahedra ({found})")));
        }
        notes.extend(grid.notes());
        if first.files.len() > 1 || file.pieces().count() > 1 {
            notes.push("the mesh comes in pieces: points on borders between them are kept apart".to_owned());
        }
        let fields = first.fields(&mut notes);
        let shape = Shape::of(&first, grid)?;
        let cache = StepCache::default();
        cache.get(0, || Ok(first), Step::bytes)?;
        Ok(Self { description, times, steps, fields, shape, notes, cache, overflows: Mutex::default() })
    }

    fn step(&self, step: usize) -> FileResult<Arc<Step>> {
        let Some(files) = self.steps.get(step) else {
            let problem = format!("there is no step {step}: the series has {}", self.steps.len());
            return Err(FileError::invalid(&self.description, "", problem));
        };
        let load = || {
            let loaded = Step::open(files)?;
            self.check_mesh(&loaded, step)?;
            Ok(loaded)
        };
        self.cache.get(step, load, Step::bytes)
    }

    /// Fails unless the mesh of `loaded` is the one of the first step. Its arrays are decoded only if their bytes
    /// in the file are not the same.
    fn check_mesh(&self, loaded: &Step, step: usize) -> FileResult<()> {
        let (points, cells) = loaded.counts();
        let changed = |what: String| {
            let path = loaded.files.first().map_or(self.description.as_str().into(), |file| file.path().to_owned());
            FileError::unsupported(
                path,
                format!("step {step}"),
                format!("the mesh changes between steps 0 and {step}: {what}"),
            )
            .remedy("import only steps with the same mesh; of a moving mesh, write the displacement as a field")
        };
        if (points, cells) != (self.shape.points, self.shape.cells) {
            let (old_points, old_cells) = (self.shape.points, self.shape.cells);
            return Err(changed(format!("{old_points} points and {old_cells} cells, then {points} and {cells}")));
        }
        if loaded.stored_hash()? == self.shape.stored_hash {
            return Ok(());
        }
        let grid = loaded.read_grid()?;
        if hash_cells(&grid) != self.shape.cells_hash {
            return Err(changed("other cells".to_owned()));
        }
        if hash_points(&grid.mesh) != self.shape.points_hash {
            return Err(changed("points move".to_owned()));
        }
        Ok(())
    }
}

impl SeriesSource for VtuSeries {
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
        Ok(self.step(0)?.read_grid()?.mesh)
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        out.clear();
        let loaded = self.step(step)?;
        let pieces = loaded.field(field, step)?;
        let mut overflows = 0;
        for (bytes, (file, _)) in pieces.iter().zip(loaded.pieces()) {
            let values = file.values(bytes);
            overflows += match component {
                Component::Index(index) if index < field.components => values.component(field.components, index, out),
                Component::Index(index) => {
                    let problem = format!("has {} components, and no component {index}", field.components);
                    return Err(FileError::invalid(file.path(), format!("field '{}'", field.name), problem));
                }
                Component::Magnitude => values.magnitude(field.components, out),
            };
        }
        if let (Association::Cell, Some(kept)) = (field.association, &self.shape.kept) {
            for (to, &from) in kept.iter().enumerate() {
                out[to] = out[from as usize];
            }
            out.truncate(kept.len());
        }
        if overflows > 0 {
            let mut counts = self.overflows.lock().unwrap_or_else(PoisonError::into_inner);
            let count = counts.entry((field.name.clone(), step)).or_default();
            *count = overflows.max(*count);
        }
        Ok(())
    }

    fn notes(&self) -> Vec<String> {
        let mut by_field: BTreeMap<String, (u64, usize)> = BTreeMap::new();
        for ((name, _), count) in self.overflows.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            let (values, steps) = by_field.entry(name.clone()).or_default();
            *values += count;
            *steps += 1;
        }
        let line = |(name, (values, steps)): (String, (u64, usize))| {
            format!("field '{name}': {values} values in {steps} steps are beyond the range of f32 and became infinite")
        };
        self.notes.iter().cloned().chain(by_field.into_iter().map(line)).collect()
    }
}

impl Step {
    fn open(paths: &[PathBuf]) -> FileResult<Self> {
        let files = paths.iter().map(|path| VtuFile::open(path)).collect::<FileResult<_>>()?;
        Ok(Self { files, decoded: Mutex::new(None) })
    }

    fn bytes(&self) -> usize {
        self.files.iter().map(VtuFile::len).sum()
    }

    /// The pieces of all files that hold something.
    fn pieces(&self) -> impl Iterator<Item = (&VtuFile, &Piece)> {
        self.files.iter().flat_map(|file| file.pieces().map(move |piece| (file, piece)))
    }

    fn counts(&self) -> (usize, usize) {
        self.pieces().fold((0, 0), |(points, cells), (_, piece)| {
            (points.saturating_add(piece.points), cells.saturating_add(piece.cells))
        })
    }

    fn read_grid(&self) -> FileResult<GridReader> {
        let mut grid = GridReader::default();
        for (file, piece) in self.pieces() {
            grid.add(file, piece)?;
        }
        Ok(grid)
    }

    fn stored_hash(&self) -> FileResult<u64> {
        let mut state = DefaultHasher::new();
        for (file, piece) in self.pieces() {
            (piece.points, piece.cells).hash(&mut state);
            file.hash_stored_mesh(piece, &mut state)?;
        }
        Ok(state.finish())
    }

    /// The fields that all pieces have. Notes what is left out.
    fn fields(&self, notes: &mut Vec<String>) -> Vec<FieldInfo> {
        let mut fields: Vec<FieldInfo> = Vec::new();
        let mut left_out: Vec<String> = Vec::new();
        for association in [Association::Point, Association::Cell] {
            for piece in self.pieces().map(|(_, piece)| piece) {
                for (i, array) in arrays(piece, association).iter().enumerate() {
                    let field = FieldInfo { name: array.name.clone(), components: array.components, association };
                    let is_same = |other: &ArrayInfo| other.components == field.components;
                    let reason = if field.name.is_empty() {
                        "has no name"
                    } else if arrays(piece, association)[..i].iter().any(|other| other.name == field.name) {
                        "a second array of that name"
                    } else if !self.pieces().all(|(_, piece)| find(piece, &field).is_some_and(is_same)) {
                        "not the same in all pieces"
                    } else {
                        if !fields.contains(&field) {
                            fields.push(field);
                        }
                        continue;
                    };
                    left_out.push(format!("'{}' ({reason})", field.name));
                }
            }
        }
        let texts = self.files.iter().flat_map(VtuFile::skipped_arrays);
        left_out.extend(texts.map(|name| format!("'{name}' (holds no numbers)")));
        if !left_out.is_empty() {
            left_out.sort();
            left_out.dedup();
            notes.push(format!("left out {} arrays: {}", left_out.len(), left_out.join(", ")));
        }
        fields
    }

    /// The decoded bytes of a field, one array for each piece; kept until another field of this step is read.
    fn field(&self, field: &FieldInfo, step: usize) -> FileResult<Arc<Vec<ArrayBytes>>> {
        let mut decoded = self.decoded.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = decoded.as_ref()
            && (last.association, &last.name) == (field.association, &field.name)
        {
            return Ok(last.pieces.clone());
        }
        let mut pieces = Vec::new();
        for (file, piece) in self.pieces() {
            let place = || format!("step {step}");
            let kind = if field.association == Association::Point { "point" } else { "cell" };
            let array = find(piece, field).ok_or_else(|| {
                FileError::invalid(file.path(), place(), format!("has no {kind} array '{}'", field.name))
                    .remedy("leave that step or that field out")
            })?;
            if array.components != field.components {
                let (name, new, old) = (&field.name, array.components, field.components);
                let problem = format!("array '{name}' has {new} components, but {old} in the first step");
                return Err(FileError::invalid(file.path(), place(), problem));
            }
            let tuples = if field.association == Association::Point { piece.points } else { piece.cells };
            pieces.push(file.decode(array, tuples)?);
        }
        let pieces = Arc::new(pieces);
        let (association, name) = (field.association, field.name.clone());
        *decoded = Some(DecodedField { association, name, pieces: pieces.clone() });
        Ok(pieces)
    }
}

impl Shape {
    fn of(step: &Step, grid: GridReader) -> FileResult<Self> {
        Ok(Self {
            points: grid.mesh.points.len(),
            cells: grid.cells,
            stored_hash: step.stored_hash()?,
            points_hash: hash_points(&grid.mesh),
            cells_hash: hash_cells(&grid),
            kept: (grid.kept.len() < grid.cells).then_some(grid.kept),
        })
    }
}

fn arrays(piece: &Piece, association: Association) -> &[ArrayInfo] {
    match association {
        Association::Point => &piece.point_data,
        Association::Cell => &piece.cell_data,
    }
}

fn find<'a>(piece: &'a Piece, field: &FieldInfo) -> Option<&'a ArrayInfo> {
    arrays(piece, field.association).iter().find(|array| array.name == field.name)
}

fn hash_points(mesh: &RawMesh) -> u64 {
    let mut state = DefaultHasher::new();
    for point in &mesh.points {
        // Adding zero makes the two zeros one.
        point.to_array().map(|v| (v + 0.0).to_bits()).hash(&mut state);
    }
    state.finish()
}

fn hash_cells(grid: &GridReader) -> u64 {
    let mut state = DefaultHasher::new();
    (&grid.mesh.tets, &grid.kept).hash(&mut state);
    state.finish()
}
