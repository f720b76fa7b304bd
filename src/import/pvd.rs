//! Reader of `.pvd` files: ParaView's list of the files of a series, each with its time.

use super::format::{Format, extension};
use super::grids::{GridFile, GridStep};
use super::parts::{Parts, refused};
use super::series::Series;
use super::xml::{Attributes, same_length_utf8};
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use crate::files;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::path::{Path, PathBuf};

/// ParaView's lists of files with their times.
pub(super) const FORMAT: Format = Format {
    name: "ParaView collections",
    extensions: &["pvd"],
    joins: false,
    recognises: |head| head.is_vtk(&["Collection"]),
    open,
    files: |path| Ok(read(path)?.0.into_iter().flat_map(Step::files).collect()),
};

/// Opens a collection, the only one of `paths`.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let [path] = paths else { return Err(FileError::invalid("", "", "a collection is opened alone")) };
    let (steps, notes) = read(path)?;
    let times = TimeAxis { values: steps.iter().map(|step| step.time).collect() };
    let files = steps.into_iter().map(|step| step.parts).collect();
    Ok(Box::new(Series::<GridStep>::new(path.display().to_string(), times, files, notes)?))
}

/// One step of a collection.
#[derive(Debug, PartialEq)]
struct Step {
    /// Time in the file's unit.
    time: f64,
    /// The files that make up the mesh and its fields at this time.
    parts: Vec<GridFile>,
    /// Files that name some of them.
    lists: Vec<PathBuf>,
}

impl Step {
    /// All files that are read.
    fn files(self) -> Vec<PathBuf> {
        self.parts.into_iter().map(|file| file.path).chain(self.lists).collect()
    }
}

/// A `DataSet` element.
struct Entry {
    /// Position among the `DataSet` elements, from 0.
    index: usize,
    time: f64,
    group: String,
    part: i64,
    file: String,
}

impl Entry {
    fn place(&self) -> String {
        format!("entry {} (timestep {}, file '{}')", self.index, self.time, self.file)
    }
}

/// The steps of a collection in order of time, and notes on what was skipped.
///
/// # Errors
/// If the file cannot be read or is not a collection, if two entries are the same part of the same time, or if a file that it names is
/// missing or of another kind.
fn read(path: &Path) -> FileResult<(Vec<Step>, Vec<String>)> {
    let bytes = files::read(path)?;
    let mut entries = parse(path, &bytes)?;
    let all = entries.len();
    entries.retain(|entry| extension(Path::new(&entry.file)) != "vtp");
    let mut notes = Vec::new();
    if entries.len() < all {
        notes.push(format!("skipped {} entries that are surfaces (.vtp)", all - entries.len()));
    }
    if entries.is_empty() {
        let problem = if all == 0 { "lists no files" } else { "lists only surfaces (.vtp)" };
        return Err(FileError::invalid(path, "<Collection>", problem));
    }
    // Stable: parts without numbers keep their order.
    entries.sort_by(|a, b| a.time.total_cmp(&b.time).then_with(|| (&a.group, a.part).cmp(&(&b.group, b.part))));
    let mut steps: Vec<Step> = Vec::new();
    let mut last: Option<&Entry> = None;
    for entry in &entries {
        let Parts { files, lists, notes: more } = Parts::of(&locate(path, entry)?)?;
        notes.extend(more.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        match (last, steps.last_mut()) {
            (Some(last), Some(step)) if last.time == entry.time => {
                if (&last.group, last.part) == (&entry.group, entry.part) {
                    let problem = format!("has the same time and part as {}", last.place());
                    return Err(FileError::invalid(path, entry.place(), problem)
                        .remedy("remove one of the two, or give them different part numbers"));
                }
                step.parts.extend(files);
                step.lists.extend(lists);
            }
            _ => steps.push(Step { time: entry.time, parts: files, lists }),
        }
        last = Some(entry);
    }
    Ok((steps, notes))
}

fn parse(path: &Path, bytes: &[u8]) -> FileResult<Vec<Entry>> {
    let text = same_length_utf8(bytes);
    let mut reader = Reader::from_str(&text);
    let mut entries = Vec::new();
    let mut seen_collection = false;
    loop {
        let byte = reader.buffer_position();
        let invalid = |problem: String| FileError::invalid(path, format!("byte {byte}"), problem);
        match reader.read_event().map_err(|e| invalid(format!("malformed XML: {e}")))? {
            Event::Start(tag) | Event::Empty(tag) => match tag.name().as_ref() {
                "VTKFile" => {
                    let attributes = Attributes::of(&tag).map_err(invalid)?;
                    if attributes.get("type") != Some("Collection") {
                        return Err(invalid("this is no VTK collection".to_owned()));
                    }
                    seen_collection = true;
                }
                "DataSet" if seen_collection => {
                    let attributes = Attributes::of(&tag).map_err(invalid)?;
                    entries
                        .push(entry(entries.len(), &attributes).map_err(|problem| {
                            FileError::invalid(path, format!("entry {}", entries.len()), problem)
                        })?);
                }
                name if !seen_collection => return Err(invalid(format!("this is no VTK collection: <{name}>"))),
                _ => {}
            },
            Event::End(tag) if tag.name().as_ref() == "VTKFile" => return Ok(entries),
            Event::Eof => {
                let problem =
                    if seen_collection { "the file ends before </VTKFile>" } else { "this is no VTK collection" };
                return Err(invalid(problem.to_owned()).remedy("write the file again"));
            }
            _ => {}
        }
    }
}

fn entry(index: usize, attributes: &Attributes) -> Result<Entry, String> {
    // Without a time the collection is one step, as in ParaView.
    let text = attributes.get("timestep").unwrap_or("0");
    let time = text.trim().parse().ok().filter(|time: &f64| time.is_finite());
    let time = time.ok_or_else(|| format!("timestep=\"{text}\" is no finite number"))?;
    let part = attributes.get("part").map(str::trim).filter(|part| !part.is_empty()).unwrap_or("0");
    Ok(Entry {
        index,
        // Adding zero turns -0 into +0.
        time: time + 0.0,
        group: attributes.get("group").unwrap_or("").to_owned(),
        part: part.parse().map_err(|_| format!("part=\"{part}\" is no number"))?,
        file: attributes.get("file").filter(|file| !file.is_empty()).ok_or("names no file")?.to_owned(),
    })
}

/// The file of an entry, relative to the collection or absolute. Some writers percent-encode spaces or use backslashes: these are tried if
/// the literal name does not exist.
fn locate(path: &Path, entry: &Entry) -> FileResult<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let decoded = percent_decoded(&entry.file);
    let candidates = [entry.file.clone(), decoded.clone(), entry.file.replace('\\', "/"), decoded.replace('\\', "/")];
    let found = candidates.iter().map(|name| folder.join(name)).find(|file| file.exists() && !file.is_dir());
    let found = found.ok_or_else(|| {
        let missing = folder.join(&entry.file);
        FileError::invalid(path, entry.place(), format!("the file {} is missing", missing.display()))
            .remedy("copy it there, or remove the entry")
    })?;
    match refused(&found) {
        Some((problem, remedy)) => Err(FileError::unsupported(path, entry.place(), problem).remedy(remedy)),
        None => Ok(found),
    }
}

fn percent_decoded(name: &str) -> String {
    let mut out = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| first == b'%').and_then(|hex| std::str::from_utf8(hex).ok());
        match code.filter(|hex| !hex.starts_with('+')).and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(byte) => {
                out.push(byte);
                rest = &after[2..];
            }
            None => {
                out.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn collection(entries: &[(&str, &str, &str)], files: &[&str]) -> FileResult<(Vec<Step>, Vec<String>)> {
        let folder = tempfile::tempdir().expect("a folder");
        for file in files {
            fs::write(folder.path().join(file), "").expect("a file");
        }
        let list: String = entries
            .iter()
            .map(|(time, part, file)| {
                format!("<DataSet timestep=\"{time}\" group=\"\" part=\"{part}\" file=\"{file}\"/>\n")
            })
            .collect();
        let path = folder.path().join("run.pvd");
        let text =
            format!("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\"><Collection>{list}</Collection></VTKFile>");
        fs::write(&path, text).expect("a file");
        read(&path)
    }

    fn names(steps: &[Step]) -> Vec<(f64, Vec<String>)> {
        let name = |file: &GridFile| file.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        steps.iter().map(|step| (step.time, step.parts.iter().map(name).collect())).collect()
    }

    #[test]
    fn entries_are_sorted_by_time_and_parts_by_number() {
        let entries = [
            ("2e-1", "0", "c.vtu"),
            ("0.1", "1", "b.vtu"),
            ("0.1", "0", "a.vtu"),
            ("0.2", "10", "d.vtu"),
            ("0.2", "2", "e.vtu"),
        ];
        let (steps, notes) = collection(&entries, &["a.vtu", "b.vtu", "c.vtu", "d.vtu", "e.vtu"]).expect("valid");
        let name = |list: &[&str]| list.iter().map(|n| n.to_string()).collect::<Vec<_>>();
        assert_eq!(names(&steps), [(0.1, name(&["a.vtu", "b.vtu"])), (0.2, name(&["c.vtu", "e.vtu", "d.vtu"]))]);
        assert_eq!(notes, [""; 0]);
    }

    #[test]
    fn the_same_part_of_the_same_time_twice_is_an_error_that_names_both() {
        let entries = [("0", "0", "a.vtu"), ("-0.0", "0", "b.vtu")];
        let error = collection(&entries, &["a.vtu", "b.vtu"]).expect_err("twice").to_string();
        assert!(error.contains("'a.vtu'") && error.contains("'b.vtu'") && error.contains("run.pvd"), "{error}");
    }

    #[test]
    fn a_missing_file_is_an_error_that_names_collection_entry_and_path() {
        let error =
            collection(&[("0", "0", "a.vtu"), ("1", "0", "b.vtu")], &["a.vtu"]).expect_err("missing").to_string();
        for part in ["run.pvd", "entry 1", "timestep 1", "b.vtu is missing"] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn blanks_written_as_in_urls_and_backslashes_are_understood() {
        let (steps, _) =
            collection(&[("0", "", ".\\a%20b.vtu"), ("1", "0", "100%.vtu")], &["a b.vtu", "100%.vtu"]).expect("valid");
        assert_eq!(names(&steps), [(0.0, vec!["a b.vtu".to_owned()]), (1.0, vec!["100%.vtu".to_owned()])]);
        assert_eq!(percent_decoded("%41%+1%%4"), "A%+1%%4");
    }

    #[test]
    fn other_kinds_of_files_are_refused_and_surfaces_skipped() {
        let error = collection(&[("0", "0", "a.stl")], &["a.stl"]).expect_err("a surface").to_string();
        assert!(error.contains("entry 0") && error.contains(".stl") && error.contains("save it as .vtu"), "{error}");
        let all = ["a.vti", "b.vtk", "c.vts", "d.vtr"];
        let entries = ["0", "1", "2", "3"].iter().zip(all).map(|(time, file)| (*time, "0", file)).collect::<Vec<_>>();
        assert_eq!(collection(&entries, &all).expect("valid").0.len(), 4);
        let (steps, notes) =
            collection(&[("0", "0", "a.vtu"), ("0", "1", "b.vtp")], &["a.vtu", "b.vtp"]).expect("valid");
        assert_eq!((steps.len(), notes.len()), (1, 1));
        assert!(collection(&[], &[]).is_err());
        assert!(collection(&[("nan", "0", "a.vtu")], &["a.vtu"]).expect_err("time").to_string().contains("nan"));
    }
}
