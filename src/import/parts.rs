//! Files that stand for several: what parallel codes write (`.pvtu`, `.pvti`, ...), blocks (`.vtm`), and lists of such files with their times
//! (`.vtu.series`, `.pvtu.series`, `.vtm.series`, `.vtk.series`).
//!
//! Pieces and blocks merge to one mesh. They lie in the folder of the file that names them, or below it.

use super::content::Head;
use super::format::{Format, extension};
use super::grids::{GridFile, GridStep, open_steps};
use super::legacy::is_legacy;
use super::series::Series;
use super::xml::{Attributes, same_length_utf8};
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use crate::files;
use quick_xml::Reader;
use quick_xml::events::Event;
use serde::Deserialize;
use std::path::{Component, Path, PathBuf};

/// Parallel files, one step each.
pub(super) const PVTU: Format = Format {
    name: "grids in pieces",
    extensions: &["pvtu", "pvti", "pvtr", "pvts"],
    joins: true,
    recognises: |head| PARALLEL.iter().any(|(_, of_type)| head.is_vtk(&[of_type])),
    open: open_each,
    files: |path| Ok(Parts::of(path)?.all()),
};

/// Files of blocks, one step each.
pub(super) const VTM: Format = Format {
    name: "blocks",
    extensions: &["vtm"],
    joins: true,
    recognises: |head| head.is_vtk(&[BLOCKS]),
    open: open_each,
    files: |path| Ok(Parts::of(path)?.all()),
};

/// Lists of files with their times.
pub(super) const SERIES: Format = Format {
    name: "lists of such files",
    extensions: &["series"],
    joins: false,
    recognises: |head| head.has(b"\"file-series-version\""),
    open: open_list,
    files: |path| {
        let parts = listed(path)?.into_iter().map(|(_, file)| Ok(Parts::of(&file)?.all()));
        Ok(parts.collect::<FileResult<Vec<_>>>()?.concat())
    },
};

/// Extensions of files that are read as a piece or block, and their types.
const GRIDS: [(&str, &str); 4] =
    [("vtu", "UnstructuredGrid"), ("vti", "ImageData"), ("vtr", "RectilinearGrid"), ("vts", "StructuredGrid")];
/// Extensions of files of pieces, and their types.
const PARALLEL: [(&str, &str); 4] =
    [("pvtu", "PUnstructuredGrid"), ("pvti", "PImageData"), ("pvtr", "PRectilinearGrid"), ("pvts", "PStructuredGrid")];
/// The type of files of blocks.
const BLOCKS: &str = "vtkMultiBlockDataSet";

/// The extension of legacy files.
const LEGACY: &str = "vtk";

/// Whether a kind is that of a grid.
fn is_grid(kind: &str) -> bool {
    kind == LEGACY || GRIDS.iter().any(|(grid, _)| *grid == kind)
}

/// The error for a file of a kind that is no part of a step; `None` for others.
pub(super) fn refused(path: &Path) -> Option<(String, &'static str)> {
    let kind = kind_of(path);
    let is_known = is_grid(&kind) || kind == "vtm" || PARALLEL.iter().any(|(parallel, _)| *parallel == kind);
    (!is_known).then(|| (format!("files of kind .{kind} are no part of a step"), "save it as .vtu"))
}

/// The extension of a file, or that of its type where that is none of these.
fn kind_of(path: &Path) -> String {
    let kinds = || GRIDS.into_iter().chain(PARALLEL).chain([("vtm", BLOCKS)]);
    let named = extension(path);
    if kinds().any(|(known, _)| known == named) {
        return named;
    }
    if is_legacy(path) {
        return LEGACY.to_owned();
    }
    let head = Head::of(path);
    kinds().find(|(_, of_type)| head.is_vtk(&[of_type])).map_or(named, |(kind, _)| kind.to_owned())
}

/// What a file of a step stands for.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Parts {
    /// The files of grids, in the order of their names.
    pub(super) files: Vec<GridFile>,
    /// The files that name them.
    pub(super) lists: Vec<PathBuf>,
    /// What was skipped.
    pub(super) notes: Vec<String>,
}

impl Parts {
    /// The parts of a file of a grid, of pieces or of blocks.
    ///
    /// # Errors
    /// If the file cannot be read, names no grid, or one that is missing or outside of its folder.
    pub(super) fn of(path: &Path) -> FileResult<Self> {
        match kind_of(path).as_str() {
            kind if is_grid(kind) => Ok(Self { files: vec![path.to_owned().into()], ..Self::default() }),
            kind if let Some((_, of_type)) = PARALLEL.iter().find(|(parallel, _)| *parallel == kind) => {
                Self::named(path, of_type, &[("Piece", "Source")])
            }
            "vtm" => Self::named(path, BLOCKS, &[("DataSet", "file"), ("Piece", "file")]),
            _ => {
                let (problem, remedy) = refused(path).unwrap_or_default();
                Err(FileError::unsupported(path, "", problem).remedy(remedy))
            }
        }
    }

    /// All files that are read.
    fn all(self) -> Vec<PathBuf> {
        self.files.into_iter().map(|file| file.path).chain(self.lists).collect()
    }

    /// The files that elements of an XML file of this type name in an attribute.
    fn named(path: &Path, kind: &str, elements: &[(&str, &str)]) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let text = same_length_utf8(&bytes);
        let mut reader = Reader::from_str(&text);
        let mut parts = Self { lists: vec![path.to_owned()], ..Self::default() };
        let is_of_blocks = kind == BLOCKS;
        let (mut is_of_kind, mut skipped) = (false, 0);
        let mut names = BlockNames::default();
        loop {
            let byte = reader.buffer_position();
            let invalid = |problem: String| FileError::invalid(path, format!("byte {byte}"), problem);
            match reader.read_event().map_err(|e| invalid(format!("malformed XML: {e}")))? {
                event @ (Event::Start(_) | Event::Empty(_)) => {
                    let is_opened = matches!(event, Event::Start(_));
                    let (Event::Start(tag) | Event::Empty(tag)) = event else { continue };
                    let (name, attributes) = (tag.name(), Attributes::of(&tag).map_err(invalid)?);
                    if name.as_ref() == "VTKFile" {
                        is_of_kind = attributes.get("type") == Some(kind);
                    }
                    if !is_of_kind {
                        return Err(invalid(format!("this is no VTK file of type {kind}")));
                    }
                    if is_of_blocks && matches!(name.as_ref(), "Block" | "DataSet") {
                        names.enter(&attributes, is_opened);
                    }
                    // A block without a file is empty.
                    let named = elements.iter().find(|(element, _)| *element == name.as_ref());
                    let Some(file) = named.and_then(|(_, attribute)| attributes.get(attribute)) else { continue };
                    if matches!(extension(Path::new(file)).as_str(), "vtp" | "pvtp") {
                        skipped += 1;
                        continue;
                    }
                    let file = located(path, file).map_err(invalid)?;
                    match kind_of(&file).as_str() {
                        grid if is_grid(grid) => parts.files.push(GridFile { path: file, block: names.last.clone() }),
                        parallel if is_of_blocks && PARALLEL.iter().any(|(other, _)| *other == parallel) => {
                            let more = Self::of(&file)?;
                            let of_block = |file| GridFile { block: names.last.clone(), ..file };
                            parts.files.extend(more.files.into_iter().map(of_block));
                            parts.lists.extend(more.lists);
                        }
                        other => {
                            return Err(invalid(format!(
                                "names a file of kind .{other}; only grids are read ({}, {LEGACY})",
                                GRIDS.map(|(grid, _)| grid).join(", ")
                            )));
                        }
                    }
                }
                Event::End(tag) if matches!(tag.name().as_ref(), "Block" | "DataSet") => names.leave(),
                Event::End(tag) if tag.name().as_ref() == "VTKFile" => break,
                Event::Eof => {
                    let problem = if is_of_kind { "the file ends before </VTKFile>" } else { "this is no VTK file" };
                    return Err(invalid(problem.to_owned()).remedy("write the file again"));
                }
                _ => {}
            }
        }
        if parts.files.is_empty() {
            return Err(FileError::invalid(path, "", "names no grid"));
        }
        if skipped > 0 {
            parts.notes.push(format!("skipped {skipped} blocks that are surfaces (.vtp)"));
        }
        Ok(parts)
    }
}

/// Names of nested blocks.
#[derive(Default)]
struct BlockNames {
    open: Vec<String>,
    /// The name of the block met last, behind those that it is in.
    last: Option<String>,
}

impl BlockNames {
    /// Enters a block; one without a name has its index.
    fn enter(&mut self, attributes: &Attributes, is_opened: bool) {
        let of = |attribute| attributes.get(attribute).map(str::trim).filter(|text| !text.is_empty());
        let name = of("name").or_else(|| of("index")).unwrap_or("").to_owned();
        let path = self.open.iter().chain([&name]).map(String::as_str).collect::<Vec<_>>().join("/");
        self.last = Some(path);
        if is_opened {
            self.open.push(name);
        }
    }

    fn leave(&mut self) {
        self.open.pop();
    }
}

/// The file of a name in another file, in whose folder or below it must lie; the error says what is wrong with it.
pub(super) fn located(path: &Path, name: &str) -> Result<PathBuf, String> {
    let name = name.replace('\\', "/");
    let relative = Path::new(&name);
    if !relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(format!("names '{name}', which lies outside of the folder of this file"));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(relative);
    if file.is_file() { Ok(file) } else { Err(format!("the file {} is missing", file.display())) }
}

/// Opens files that are a step each.
fn open_each(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let (mut steps, mut notes) = (Vec::new(), Vec::new());
    for path in paths {
        let Parts { files, notes: more, .. } = Parts::of(path)?;
        notes.extend(more.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        steps.push((path.clone(), files));
    }
    open_steps(steps, notes)
}

/// A file of a list, as ParaView writes it (`file-series-version` 1.0).
#[derive(Deserialize)]
struct ListedFile {
    name: String,
    time: f64,
}

#[derive(Deserialize)]
struct List {
    files: Vec<ListedFile>,
}

/// The files of a list with their times, in order of time.
fn listed(path: &Path) -> FileResult<Vec<(f64, PathBuf)>> {
    let bytes = files::read(path)?;
    let list: List = serde_json::from_slice(&bytes).map_err(|error| {
        let place = format!("line {}", error.line());
        FileError::invalid(path, place, format!("is no list of files with their times: {error}"))
    })?;
    let mut found = Vec::new();
    for (number, ListedFile { name, time }) in list.files.into_iter().enumerate() {
        let invalid = |problem: String| FileError::invalid(path, format!("file {number}"), problem);
        // Adding zero turns -0 into +0.
        found.push((time + 0.0, located(path, &name).map_err(invalid)?));
    }
    if found.is_empty() {
        return Err(FileError::invalid(path, "", "lists no files"));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let Some(pair) = found.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let [a, b] = [&pair[0].1, &pair[1].1].map(|file| file.display());
        let error = FileError::invalid(path, format!("time {}", pair[0].0), format!("both {a} and {b} have it"));
        return Err(error.remedy("remove one of the two"));
    }
    Ok(found)
}

/// Opens a list, the only one of `paths`.
fn open_list(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "a list is opened alone")) };
    let listed = listed(path)?;
    let (mut times, mut steps, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    for (time, file) in listed {
        let Parts { files, notes: more, .. } = Parts::of(&file)?;
        notes.extend(more.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        times.push(time);
        steps.push(files);
    }
    let times = TimeAxis { values: times };
    Ok(Box::new(Series::<GridStep>::new(path.display().to_string(), times, steps, notes)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Parts of a file with this text beside `a.vtu`, `b.vtu`, `c.pvtu` (of `b.vtu`) and `s.vtp`.
    fn parts(name: &str, text: &str) -> Result<Vec<String>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("a file");
        ["a.vtu", "b.vtu", "s.vtp"].iter().for_each(|name| write(name, ""));
        write("c.pvtu", &pieces("<Piece Source=\"b.vtu\"/>"));
        write(name, text);
        let found = Parts::of(&folder.path().join(name)).map_err(|error| error.to_string())?;
        let name = |file: &GridFile| file.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(found.files.iter().map(name).chain(found.notes).collect())
    }

    fn pieces(pieces: &str) -> String {
        format!(
            "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid GhostLevel=\"0\">{pieces}</PUnstructuredGrid></VTKFile>"
        )
    }

    fn blocks(blocks: &str) -> String {
        format!(
            "<VTKFile type=\"vtkMultiBlockDataSet\"><vtkMultiBlockDataSet>{blocks}</vtkMultiBlockDataSet></VTKFile>"
        )
    }

    #[test]
    fn pieces_and_blocks_are_the_files_that_they_name() {
        let two = "<Piece Source=\"b.vtu\"/><Piece Source=\"./a.vtu\"/>";
        assert_eq!(parts("x.pvtu", &pieces(two)), Ok(vec!["b.vtu".to_owned(), "a.vtu".to_owned()]));
        let nested = "<Block index=\"0\"><DataSet index=\"0\" file=\"a.vtu\"/><DataSet index=\"1\"/></Block>\
                      <DataSet file=\"c.pvtu\"/><DataSet file=\"s.vtp\"/>";
        let found = parts("x.vtm", &blocks(nested)).expect("valid");
        assert_eq!(found, ["a.vtu", "b.vtu", "skipped 1 blocks that are surfaces (.vtp)"]);
    }

    #[test]
    fn blocks_have_the_names_of_those_that_they_are_in() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("x.vtm");
        ["a.vtu", "b.vtu", "c.vtu", "d.vtu"]
            .iter()
            .for_each(|name| fs::write(folder.path().join(name), "").expect("a file"));
        let nested = "<Block index=\"0\" name=\"heart\"><DataSet index=\"0\" name=\"left\" file=\"a.vtu\"/>\
                      <DataSet index=\"1\" file=\"b.vtu\"></DataSet></Block>\
                      <DataSet index=\"4\" name=\"lung\" file=\"c.vtu\"/><Block><Block name=\"b\"><DataSet name=\"x\" file=\"d.vtu\"/></Block></Block>";
        fs::write(&path, blocks(nested)).expect("a file");
        let found = Parts::of(&path).expect("valid").files;
        let names: Vec<_> = found.iter().filter_map(|file| file.block.as_deref()).collect();
        assert_eq!(names, ["heart/left", "heart/1", "lung", "/b/x"]);
    }

    #[test]
    fn what_is_missing_outside_or_of_another_kind_is_named() {
        for (name, text, expected) in [
            ("x.pvtu", pieces("<Piece Source=\"d.vtu\"/>"), "d.vtu is missing"),
            ("x.pvtu", pieces("<Piece Source=\"../a.vtu\"/>"), "outside"),
            ("x.pvtu", pieces("<Piece Source=\"/etc/passwd\"/>"), "outside"),
            ("x.pvtu", pieces("<Piece Source=\"c.pvtu\"/>"), ".pvtu"),
            ("x.pvtu", pieces(""), "names no grid"),
            ("x.pvtu", blocks(""), "PUnstructuredGrid"),
            ("x.vtm", blocks("<DataSet file=\"x.vtm\"/>"), ".vtm"),
            ("x.vtm", blocks("<DataSet file=\"s.vtp\"/>"), "names no grid"),
            ("x.vtm", "<VTKFile type=\"vtkMultiBlockDataSet\">".to_owned(), "ends before"),
            ("x.vtm", "no XML at all".to_owned(), "no VTK file"),
        ] {
            let error = parts(name, &text).expect_err(&text);
            assert!(error.contains(expected) && error.contains(name), "{error}");
        }
    }

    #[test]
    fn lists_are_in_order_of_time_and_a_time_twice_is_named() {
        let list = |text: &str| {
            let folder = tempfile::tempdir().expect("a folder");
            ["a.vtu", "b.vtu"].iter().for_each(|name| fs::write(folder.path().join(name), "").expect("a file"));
            let path = folder.path().join("x.vtu.series");
            fs::write(&path, text).expect("a file");
            listed(&path)
                .map(|found| found.into_iter().map(|(time, _)| time).collect::<Vec<_>>())
                .map_err(|e| e.to_string())
        };
        let of = |a: &str, b: &str| {
            format!(
                "{{\"file-series-version\": \"1.0\", \"files\": [{{\"name\": \"b.vtu\", \"time\": {b}}}, {{\"name\": \"a.vtu\", \"time\": {a}}}]}}"
            )
        };
        assert_eq!(list(&of("0.5", "2")), Ok(vec![0.5, 2.0]));
        assert!(list(&of("1", "1")).unwrap_err().contains("both"));
        assert!(list("{\"files\": []}").unwrap_err().contains("lists no files"));
        assert!(list("[]").unwrap_err().contains("x.vtu.series"));
        assert!(list(&of("1e999", "0")).is_err());
    }
}
