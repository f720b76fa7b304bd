//! One step of a VTKHDF file: the parts of its blocks, each read when it is asked for.

use super::super::cell_list::{CellList, GHOST_ARRAY};
use super::super::cells::GridReader;
use super::super::faces::{CELLS_OF_A_FACE, FacesOfCells, of_too_many};
use super::super::hdf::Hdf;
use super::super::numbers::{Numbers, Values};
use super::super::pieces::{BlockName, Piece};
use super::super::series::StepReader;
use super::block::{Block, Mesh, indices, invalid};
use super::lists::{Place, Rows};
use super::{ROOT, open_file};
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use crate::mesh::POLYHEDRON_VTK_TYPE;
use glam::DVec3;
use std::hash::{DefaultHasher, Hash};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Location of a step.
pub(super) struct Origin {
    pub(super) path: Arc<PathBuf>,
    pub(super) blocks: Arc<Vec<Arc<Block>>>,
    pub(super) step: usize,
}

/// A step, with its file open.
pub(super) struct VtkHdfStep {
    file: Arc<Hdf>,
    parts: Vec<Part>,
}

/// A part of a block at a step.
pub(super) struct Part {
    file: Arc<Hdf>,
    block: Arc<Block>,
    step: usize,
    points: usize,
    cells: usize,
    /// `None` for an image.
    place: Option<Place>,
}

impl StepReader for VtkHdfStep {
    type Origin = Origin;
    type Piece = Part;

    fn open(origin: &Origin) -> FileResult<Self> {
        let file = Arc::new(open_file(&origin.path)?);
        let mut parts = Vec::new();
        for block in origin.blocks.iter() {
            let part = |points: usize, cells: usize, place: Option<Place>| Part {
                file: file.clone(),
                block: block.clone(),
                step: origin.step,
                points,
                cells,
                place,
            };
            match &block.mesh {
                Mesh::Image(image) => parts.push(part(image.lattice.points(), image.lattice.cells(), None)),
                Mesh::Lists(lists) => {
                    let places = lists.places(origin.step).map_err(|problem| invalid(&file, &block.group, problem))?;
                    let filled = places.into_iter().filter(|place| place.points.count > 0 || place.cells.count > 0);
                    parts.extend(filled.map(|place| {
                        let count = |rows: Rows| usize::try_from(rows.count).unwrap_or(usize::MAX);
                        part(count(place.points), count(place.cells), Some(place))
                    }));
                }
            }
        }
        Ok(Self { file, parts })
    }

    fn path(&self) -> &Path {
        self.file.path()
    }

    fn bytes(&self) -> usize {
        0
    }

    fn pieces(&self) -> &[Part] {
        &self.parts
    }
}

impl Piece for Part {
    type Array = Numbers;

    fn path(&self) -> &Path {
        self.file.path()
    }

    fn counts(&self) -> (usize, usize) {
        (self.points, self.cells)
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        let Some(place) = &self.place else {
            return match &self.block.mesh {
                Mesh::Image(image) => image.add_to(grid, self.path(), &self.ghosts()?),
                Mesh::Lists(_) => Ok(()),
            };
        };
        grid.check_room(self.path(), &format!("group '{}'", self.block.group), self.points, self.cells)?;
        let first_point = grid.mesh.points.len();
        self.add_points(grid, place)?;
        if self.cells > 0 {
            self.add_cells(grid, place, first_point)?;
        }
        grid.cells += self.cells;
        Ok(())
    }

    /// Hashes where the mesh is, not what is there.
    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        (self.path(), &self.block.group, self.place).hash(state);
        if let Mesh::Image(image) = &self.block.mesh {
            image.hash_mesh(state);
        }
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        self.block.arrays.iter().map(|array| array.field.clone()).collect()
    }

    fn blocks(&self) -> Vec<(BlockName, usize)> {
        let name = self.block.group.strip_prefix(ROOT).and_then(|name| name.strip_prefix('/'));
        name.map(|name| (BlockName { name: name.to_owned(), number: None }, self.cells)).into_iter().collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.block.left_out.clone()
    }

    fn unit(&self, array: usize) -> Option<String> {
        self.file.unit(&self.block.arrays.get(array)?.name)
    }

    fn decode(&self, array: usize) -> FileResult<Numbers> {
        let found = self.block.arrays.get(array);
        let found = found.ok_or_else(|| FileError::invalid(self.path(), "", "has no such array"))?;
        let (points, cells) = (self.points as u64, self.cells as u64);
        let count = if found.field.association == Association::Point { points } else { cells };
        let of_mesh = self.place.map_or((0, 0), |place| match found.field.association {
            Association::Point => (place.points.first, place.before[0]),
            Association::Cell => (place.cells.first, place.before[1]),
        });
        let first = match &found.offsets {
            None => Some(of_mesh.0),
            Some(offsets) => offsets.get(self.step).and_then(|first| first.checked_add(of_mesh.1)),
        };
        let data = self.file.array(&found.name)?;
        let first = first.ok_or_else(|| data.invalid(format!("has no place for step {}", self.step)))?;
        data.read_rows(first, found.rows.unwrap_or(count))
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}

impl Part {
    fn name(&self, array: &str) -> String {
        format!("{}/{array}", self.block.group)
    }

    fn add_points(&self, grid: &mut GridReader, place: &Place) -> FileResult<()> {
        if self.points == 0 {
            return Ok(());
        }
        let name = self.name("Points");
        let array = self.file.array(&name)?;
        if !matches!(array.shape(), [_, 3]) {
            return Err(array.invalid(format!("has the shape {:?}, not three coordinates a point", array.shape())));
        }
        let coordinates = array.read_rows(place.points.first, place.points.count)?.values().to_f64();
        grid.mesh.points.extend(coordinates.chunks_exact(3).map(DVec3::from_slice));
        Ok(())
    }

    fn add_cells(&self, grid: &mut GridReader, place: &Place, first_point: usize) -> FileResult<()> {
        let types = self.indices("Types", place.cells)?;
        let ends = self.ends("Offsets", place.offsets)?;
        let connectivity = self.indices("Connectivity", place.corners)?;
        let ghosts = self.ghosts()?;
        let faces = if types.contains(&POLYHEDRON_VTK_TYPE.into()) { Some(self.faces(place)?) } else { None };
        let list = CellList {
            path: self.path(),
            place: &format!("data set '{}/Connectivity', part from {} on", self.block.group, place.corners.first),
            types: &types,
            ends: &ends,
            connectivity: &connectivity,
            ghosts: &ghosts,
        };
        list.add_to(grid, faces.iter().flat_map(|faces| faces.of_cells(self.cells)), (self.points, first_point))
    }

    fn faces(&self, place: &Place) -> FileResult<FacesOfCells> {
        let rows = place.faces.ok_or_else(|| {
            invalid(&self.file, &self.block.group, "has polyhedra, but lacks the data set 'NumberOfFaces'".to_owned())
                .remedy("write it with VTK 9.6 or later, or as .vtu")
        })?;
        let cell_ends = self.ends("PolyhedronOffsets", place.offsets)?;
        let faces = self.indices("PolyhedronToFaces", rows.of_cells)?;
        let face_ends = self.ends("FaceOffsets", rows.offsets)?;
        let corners = self.indices("FaceConnectivity", rows.corners)?;
        let name = self.name("PolyhedronToFaces");
        let wrong = |problem: String| FileError::invalid(self.path(), format!("data set '{name}'"), problem);
        if let Some(face) = faces.iter().find(|&&face| face >= face_ends.len() as u64) {
            return Err(wrong(format!("names face {face}, but there are {}", face_ends.len())));
        }
        if let Some(face) = of_too_many(&faces, face_ends.len()) {
            return Err(wrong(format!("names face {face} for more than {CELLS_OF_A_FACE} cells")));
        }
        Ok(FacesOfCells::Shared { corners, face_ends, faces, cell_ends })
    }

    /// Flags of duplicates; none if there is no such array.
    fn ghosts(&self) -> FileResult<Vec<u64>> {
        let is_it = |field: &FieldInfo| {
            (field.name.as_str(), field.components, field.association) == (GHOST_ARRAY, 1, Association::Cell)
        };
        let Some(at) = self.block.arrays.iter().position(|array| is_it(&array.field)) else { return Ok(Vec::new()) };
        let flags = self.decode(at)?.values().to_indices();
        flags.map_err(|i| invalid(&self.file, &self.block.group, format!("{GHOST_ARRAY} of cell {i} is no flag")))
    }

    fn indices(&self, array: &str, rows: Rows) -> FileResult<Vec<u64>> {
        let name = self.name(array);
        let array = self.file.array(&name)?;
        match array.shape() {
            [_] => indices(&array, &array.read_rows(rows.first, rows.count)?),
            shape => Err(array.invalid(format!("has the shape {shape:?}, not a list"))),
        }
    }

    /// Where things end in a list, from rows that begin with 0.
    fn ends(&self, array: &str, rows: Rows) -> FileResult<Vec<u64>> {
        let mut offsets = self.indices(array, rows)?;
        let wrong = |problem: String| {
            FileError::invalid(self.path(), format!("data set '{}'", self.name(array)), problem)
                .remedy("write the file again, or copy it again if it was cut")
        };
        if let Some(i) = offsets.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(wrong(format!("decreases at row {}", rows.first + i as u64 + 1)));
        }
        match offsets.first() {
            Some(0) => Ok(offsets.split_off(1)),
            Some(first) => Err(wrong(format!("has {first} at row {}, where a part begins with 0", rows.first))),
            None => Ok(offsets),
        }
    }
}
