//! Readers of foreign files, one per format.
//!
//! | extension | what it is | read by |
//! |---|---|---|
//! | `.vtu` | an unstructured grid of VTK in XML: one step | `vtu` |
//! | `.pvd` | ParaView's list of `.vtu` files, each with its time | `pvd` |
//! | `.xdmf`, `.xmf` | XDMF: an XML file with the arrays of a series in HDF5 or binary files beside it | `xdmf` |
//!
//! A reader yields a [`SeriesSource`]; a further format is one more file here and one more arm in [`open`].

mod cache;
mod cells;
mod joined;
mod numbers;
mod pvd;
mod series;
mod vtu;
mod xdmf;
mod xml;

use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use joined::Joined;
use series::Series;
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// What [`open`] reads, for messages.
const SUPPORTED: &str = ".pvd (ParaView collections), .vtu (unstructured grids of VTK) and .xdmf (XDMF with HDF5)";

/// Opens a series: a `.pvd` collection, an XDMF file, or a single `.vtu` file as a series of one step, at the time that its
/// field data name `TimeValue`, else at 0.
///
/// The first step is read for the mesh and the fields; that the files of the others exist is checked.
///
/// # Errors
/// If the file is of another kind, is damaged, has cells with a volume that are no tetrahedra, or names missing files.
pub fn open(path: &Path) -> FileResult<Box<dyn SeriesSource>> {
    match extension(path).as_str() {
        "pvd" => {
            let (steps, notes) = pvd::read(path)?;
            let times = TimeAxis { values: steps.iter().map(|step| step.time).collect() };
            let files = steps.into_iter().map(|step| step.parts).collect();
            Ok(Box::new(Series::<vtu::VtuStep>::new(path.display().to_string(), times, files, notes)?))
        }
        "vtu" => {
            let time = finite(path, vtu::time_value_of(path)?)?.unwrap_or(0.0);
            let times = TimeAxis { values: vec![time] };
            Ok(Box::new(Series::<vtu::VtuStep>::new(
                path.display().to_string(),
                times,
                vec![vec![path.to_owned()]],
                Vec::new(),
            )?))
        }
        "xdmf" | "xmf" => xdmf::open(path),
        _ => Err(unsupported(path)),
    }
}

/// All files that [`open`] would read for the series at `path`: that path, and for a collection those it names.
///
/// # Errors
/// If a collection is damaged or names missing files.
pub fn files(path: &Path) -> FileResult<Vec<PathBuf>> {
    let mut files = vec![path.to_owned()];
    match extension(path).as_str() {
        "pvd" => files.extend(pvd::read(path)?.0.into_iter().flat_map(|step| step.parts)),
        "xdmf" | "xmf" => files.extend(xdmf::files(path)?),
        _ => {}
    }
    Ok(files)
}

/// Opens several `.vtu` files as a series of one step each, in natural order of their names (2 before 10); or several
/// XDMF files, each with fields of its own on the same mesh at the same times, as one series.
///
/// Times are the `TimeValue` of the files' field data if all have one and no two are equal (the steps are then in their
/// order), else 0, 1, 2, ...; the source's notes say which. A single path is opened as [`open`] does.
///
/// # Errors
/// As for [`open`]; if `paths` is empty; if several paths are of other or of different kinds.
pub fn open_many(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    let mut paths = paths.to_vec();
    paths.sort_by(|a, b| natural_order(a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes()));
    let (first, last) = match paths.as_slice() {
        [] => return Err(FileError::invalid("", "", "no file was named").remedy(format!("name one: {SUPPORTED}"))),
        [path] => return open(path),
        [first, .., last] => (first, last),
    };
    let is_xdmf = |path: &PathBuf| matches!(extension(path).as_str(), "xdmf" | "xmf");
    if paths.iter().all(is_xdmf) {
        return Joined::of(first, paths.iter().map(|path| open(path)).collect::<FileResult<_>>()?);
    }
    if let Some(other) = paths.iter().find(|path| extension(path) != "vtu") {
        return Err(if extension(other) == "pvd" || is_xdmf(other) {
            FileError::unsupported(other, "", "only files of one kind, .vtu or .xdmf, can be joined to a series")
                .remedy("open it alone")
        } else {
            unsupported(other)
        });
    }
    let description = format!("{} .. {} ({} files)", first.display(), last.display(), paths.len());
    let mut timed = Vec::new();
    for path in &paths {
        timed.push((finite(path, vtu::time_value_of(path)?)?, path.clone()));
    }
    let (times, note) = times_of(&mut timed);
    let steps = timed.into_iter().map(|(_, path)| vec![path]).collect();
    Ok(Box::new(Series::<vtu::VtuStep>::new(description, times, steps, vec![note])?))
}

/// The times of the files, which are brought into the order of these, and a note that says where the times are from.
fn times_of(timed: &mut [(Option<f64>, PathBuf)]) -> (TimeAxis, String) {
    let number = |why: String| {
        let values = (0..timed.len()).map(|i| i as f64).collect();
        (TimeAxis { values }, format!("times are 0, 1, 2, ...: {why}"))
    };
    if let Some((_, path)) = timed.iter().find(|(time, _)| time.is_none()) {
        return number(format!("{} has no TimeValue", path.display()));
    }
    let mut sorted = timed.to_vec();
    sorted.sort_by(|(a, _), (b, _)| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let [a, b] = [&pair[0].1, &pair[1].1].map(|path| path.display());
        return number(format!("{a} and {b} have the same TimeValue"));
    }
    timed.clone_from_slice(&sorted);
    let values = sorted.iter().filter_map(|(time, _)| *time).collect();
    (TimeAxis { values }, "times are the TimeValue of the files".to_owned())
}

fn finite(path: &Path, time: Option<f64>) -> FileResult<Option<f64>> {
    match time {
        Some(time) if !time.is_finite() => {
            Err(FileError::invalid(path, "array 'TimeValue'", format!("the time {time} is not finite")))
        }
        // Adding zero makes the two zeros one.
        time => Ok(time.map(|time| time + 0.0)),
    }
}

fn extension(path: &Path) -> String {
    path.extension().map_or(String::new(), |e| e.to_string_lossy().to_ascii_lowercase())
}

fn unsupported(path: &Path) -> FileError {
    let problem = match extension(path).as_str() {
        "" => "a file or folder without an extension is not read".to_owned(),
        extension => format!("files of kind .{extension} are not read"),
    };
    FileError::unsupported(path, "", problem)
        .remedy(format!("convert it, for example with ParaView or meshio, to what is read: {SUPPORTED}"))
}

/// Order of names in which runs of digits compare as numbers; equal ones by their bytes, so that it is total.
fn natural_order(a: &[u8], b: &[u8]) -> Ordering {
    let (mut left, mut right) = (a, b);
    while let (Some(&l), Some(&r)) = (left.first(), right.first()) {
        let (order, taken) = if l.is_ascii_digit() && r.is_ascii_digit() {
            let ((l, m), (r, n)) = (digits(left), digits(right));
            (m.len().cmp(&n.len()).then_with(|| m.cmp(n)), (l, r))
        } else {
            (l.cmp(&r), (1, 1))
        };
        if order != Ordering::Equal {
            return order;
        }
        (left, right) = (&left[taken.0..], &right[taken.1..]);
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// Number of leading digits, and these without leading zeros.
fn digits(text: &[u8]) -> (usize, &[u8]) {
    let length = text.iter().take_while(|b| b.is_ascii_digit()).count();
    let zeros = text[..length].iter().take_while(|&&b| b == b'0').count();
    (length, &text[zeros..length])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_in_names_compare_as_numbers() {
        let mut names = ["t10", "t9", "t010", "t1_2", "t1_10", "t", "t1", "u0", "t99999999999999999999999", "t2"];
        names.sort_by(|a, b| natural_order(a.as_bytes(), b.as_bytes()));
        assert_eq!(names, ["t", "t1", "t1_2", "t1_10", "t2", "t9", "t010", "t10", "t99999999999999999999999", "u0"]);
    }

    #[test]
    fn times_are_numbered_unless_all_files_have_their_own() {
        let run = |times: &[Option<f64>]| {
            let mut timed: Vec<_> = times.iter().enumerate().map(|(i, t)| (*t, PathBuf::from(i.to_string()))).collect();
            let (axis, note) = times_of(&mut timed);
            let order: Vec<_> = timed.iter().map(|(_, path)| path.display().to_string()).collect();
            (axis.values, order.concat(), note)
        };
        let (values, order, note) = run(&[Some(2.5), Some(0.5), Some(1.0)]);
        assert_eq!((values, order.as_str()), (vec![0.5, 1.0, 2.5], "120"));
        assert!(note.contains("TimeValue of the files"));
        for times in [[Some(1.0), None, Some(2.0)], [Some(1.0), Some(0.0), Some(1.0)]] {
            let (values, order, note) = run(&times);
            assert_eq!((values, order.as_str()), (vec![0.0, 1.0, 2.0], "012"));
            assert!(note.contains("0, 1, 2"), "{note}");
        }
    }

    #[test]
    fn other_files_are_refused_with_a_list_of_what_is_read() {
        for name in ["a.stl", "folder", "a.VTK", ""] {
            let error = open(Path::new(name)).err().expect("refused").to_string();
            assert!([".pvd", ".vtu", ".xdmf"].iter().all(|kind| error.contains(kind)), "{error}");
        }
        assert!(open_many(&[]).is_err());
        let pair = [PathBuf::from("a.vtu"), PathBuf::from("b.pvd")];
        assert!(open_many(&pair).err().expect("refused").to_string().contains("open it alone"));
    }
}
