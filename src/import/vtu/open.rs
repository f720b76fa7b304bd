//! `.vtu` files as a series of one step each.

use super::{VtuStep, time_value_of};
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use crate::import::format::Format;
use crate::import::series::Series;
use std::cmp::Ordering;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// VTK's XML unstructured grids, one step per file.
pub(in crate::import) const FORMAT: Format =
    Format { name: "unstructured grids of VTK", extensions: &["vtu"], joins: true, open, files: |_| Ok(Vec::new()) };

/// Times are the `TimeValue` of the files' field data if all have one and no two are equal (which then orders the steps), else 0, 1, 2,
/// ...; the source's notes say which. A single file without one is at 0.
fn open(paths: &[PathBuf]) -> FileResult<Box<dyn SeriesSource>> {
    open_steps(paths.iter().map(|path| (path.clone(), vec![path.clone()])).collect(), Vec::new())
}

/// Opens steps, each named by a file and read from some, with times as [`open`] takes them from the first of these.
pub(in crate::import) fn open_steps(
    steps: Vec<(PathBuf, Vec<PathBuf>)>,
    mut notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let timed = |(path, files): &(PathBuf, Vec<PathBuf>)| match files.first() {
        Some(first) => Ok((finite(first, time_value_of(first)?)?, path.clone())),
        None => Ok((None, path.clone())),
    };
    let mut timed = steps.iter().map(timed).collect::<FileResult<Vec<_>>>()?;
    let (description, times) = match (&steps[..], &timed[..]) {
        ([(path, _)], [(time, _)]) => (path.display().to_string(), TimeAxis { values: vec![time.unwrap_or(0.0)] }),
        ([(first, _), .., (last, _)], _) => {
            let (times, note) = times_of(&mut timed);
            notes.insert(0, note);
            (format!("{} .. {} ({} files)", first.display(), last.display(), steps.len()), times)
        }
        _ => return Err(FileError::invalid("", "", "no file was named")),
    };
    let files_of: HashMap<PathBuf, Vec<PathBuf>> = steps.into_iter().collect();
    let steps = timed.iter().filter_map(|(_, path)| files_of.get(path).cloned()).collect();
    Ok(Box::new(Series::<VtuStep>::new(description, times, steps, notes)?))
}

/// The times of the files, which are sorted by them, and a note on where the times are from.
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
        // Adding zero turns -0 into +0.
        time => Ok(time.map(|time| time + 0.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
