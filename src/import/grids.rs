//! A step as one or more files of VTK's grids: in XML, or legacy ones.

use super::cells::GridReader;
use super::legacy::{self, LegacyFile, is_legacy};
use super::numbers::{ArrayBytes, Values};
use super::pieces::{BlockName, Piece};
use super::series::StepReader;
use super::timed;
use super::vtu::{self, VtuPiece};
use crate::error::{FileError, FileResult};
use crate::field::{FieldInfo, SeriesSource};
use std::hash::DefaultHasher;
use std::path::{Path, PathBuf};

/// A file of a step, and the block of its cells if it is one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GridFile {
    pub(super) path: PathBuf,
    pub(super) block: Option<String>,
}

impl From<PathBuf> for GridFile {
    fn from(path: PathBuf) -> Self {
        Self { path, block: None }
    }
}

/// Opens files that are a step each.
///
/// # Errors
/// As for [`open_steps`].
pub(super) fn open_each(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    open_steps(paths.iter().map(|path| (path.clone(), vec![path.clone().into()])).collect(), Vec::new())
}

/// Opens steps, each named by a file and read from some, with times as [`timed::open_steps`] takes them from the first of these.
///
/// # Errors
/// As for [`timed::open_steps`].
pub(super) fn open_steps(
    steps: Vec<(PathBuf, Vec<GridFile>)>,
    notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let has_legacy = steps.iter().filter_map(|(_, files)| files.first()).any(|file| is_legacy(&file.path));
    let name = if has_legacy { legacy::time_name() } else { vtu::TIME.to_owned() };
    let time_of = |files: &Vec<GridFile>| match files.first() {
        None => Ok(None),
        Some(GridFile { path, .. }) if is_legacy(path) => legacy::time_of(path),
        Some(GridFile { path, .. }) => vtu::time_of(path),
    };
    timed::open_steps::<GridStep>(steps, &name, time_of, notes)
}

/// A step in memory: its files, undecoded.
pub(super) struct GridStep {
    /// The first file.
    path: PathBuf,
    bytes: usize,
    /// The pieces that have points or cells; others may lack arrays.
    pieces: Vec<GridPiece>,
}

/// A piece of a file, and the block that the file is.
pub(super) struct GridPiece {
    of: OfFile,
    block: Option<String>,
}

enum OfFile {
    Xml(VtuPiece),
    Legacy(Box<LegacyFile>),
}

impl StepReader for GridStep {
    type Origin = Vec<GridFile>;
    type Piece = GridPiece;

    fn open(files: &Vec<GridFile>) -> FileResult<Self> {
        let Some(first) = files.first() else {
            return Err(FileError::invalid("", "", "there are no files to read"));
        };
        let mut step = Self { path: first.path.clone(), bytes: 0, pieces: Vec::new() };
        for GridFile { path, block } in files {
            let piece = |of: OfFile| GridPiece { of, block: block.clone() };
            if is_legacy(path) {
                let file = LegacyFile::open(path)?;
                step.bytes += file.size();
                step.pieces.push(piece(OfFile::Legacy(Box::new(file))));
            } else {
                let (bytes, pieces) = VtuPiece::all(path)?;
                step.bytes += bytes;
                step.pieces.extend(pieces.into_iter().map(OfFile::Xml).map(piece));
            }
        }
        step.pieces.retain(|piece| piece.counts() != (0, 0));
        Ok(step)
    }

    fn path(&self) -> &Path {
        &self.path
    }

    fn bytes(&self) -> usize {
        self.bytes
    }

    fn pieces(&self) -> &[GridPiece] {
        &self.pieces
    }
}

/// Runs `$body` with `$piece` being what a piece is.
macro_rules! either {
    ($of:expr, $piece:ident => $body:expr) => {
        match $of {
            OfFile::Xml($piece) => $body,
            OfFile::Legacy($piece) => $body,
        }
    };
}

impl Piece for GridPiece {
    type Array = ArrayBytes;

    fn path(&self) -> &Path {
        either!(&self.of, piece => piece.path())
    }

    fn counts(&self) -> (usize, usize) {
        either!(&self.of, piece => piece.counts())
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        either!(&self.of, piece => piece.add_to(grid))
    }

    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        either!(&self.of, piece => piece.hash_mesh(state))
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        either!(&self.of, piece => piece.arrays())
    }

    fn blocks(&self) -> Vec<(BlockName, usize)> {
        let name = self.block.clone().map(|name| BlockName { name, number: None });
        name.map(|name| (name, self.counts().1)).into_iter().collect()
    }

    fn left_out(&self) -> Vec<String> {
        either!(&self.of, piece => piece.left_out())
    }

    fn unit(&self, array: usize) -> Option<String> {
        either!(&self.of, piece => piece.unit(array))
    }

    fn decode(&self, array: usize) -> FileResult<ArrayBytes> {
        either!(&self.of, piece => piece.decode(array))
    }

    fn values<'a>(&'a self, array: &'a ArrayBytes) -> Values<'a> {
        either!(&self.of, piece => piece.values(array))
    }
}

#[cfg(test)]
mod tests {
    use crate::field::Component;
    use crate::import::open;
    use std::fs;

    const XML: &str = r#"<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<PointData><DataArray type="Float64" Name="T" format="ascii">0 1 2 3</DataArray></PointData>
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
<Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>"#;
    const LEGACY: &str = "# vtk DataFile Version 3.0\na\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
        0 0 0 0 1 0 1 0 0 0 0 -1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nSCALARS T float 1\n\
        LOOKUP_TABLE default\n0 2 1 7\n";

    #[test]
    fn files_in_xml_and_legacy_ones_are_pieces_of_one_step() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        put("a.vtu", XML);
        put("b.vtk", LEGACY);
        put("b", LEGACY);
        let blocks = |file: &str| {
            let blocks = format!("<DataSet index=\"0\" file=\"a.vtu\"/><DataSet index=\"1\" file=\"{file}\"/>");
            format!(
                "<VTKFile type=\"vtkMultiBlockDataSet\"><vtkMultiBlockDataSet>{blocks}</vtkMultiBlockDataSet></VTKFile>"
            )
        };
        put("m.vtm", &blocks("b.vtk"));
        put("n.vtm", &blocks("b"));
        let entry = |part: usize, file: &str| format!("<DataSet timestep=\"1\" part=\"{part}\" file=\"{file}\"/>");
        let entries = format!("{}{}", entry(0, "a.vtu"), entry(1, "b.vtk"));
        put("p.pvd", &format!("<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>"));
        put("s.vtm.series", r#"{"files": [{"name": "m.vtm", "time": 2}, {"name": "n.vtm", "time": 3}]}"#);
        for name in ["m.vtm", "n.vtm", "p.pvd", "s.vtm.series"] {
            let source = open(&folder.path().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
            let mesh = source.mesh().unwrap();
            assert_eq!((mesh.points.len(), mesh.cells.len()), (5, 2), "{name}");
            let field = &source.fields()[0];
            let mut values = Vec::new();
            source.read(field, Component::Index(0), source.times().len() - 1, &mut values).unwrap();
            assert_eq!(values, [0.0, 1.0, 2.0, 3.0, 7.0], "{name}");
        }
        put("b.vtk", "# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n");
        let error = open(&folder.path().join("m.vtm")).err().unwrap().to_string();
        assert!(error.contains("b.vtk"), "{error}");
    }
}
