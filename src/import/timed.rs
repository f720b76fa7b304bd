//! Files that are a step each: their times, and the part of a file that is read for its time.

use super::series::{Series, StepReader};
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use crate::files;
use std::cmp::Ordering;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Opens steps, each named by a file, as one series. Times are those that `time_of` finds, called `name`, if all steps have one and no two
/// are equal (which then orders the steps), else 0, 1, 2, ...; the source's notes say which. A single step without one is at 0.
///
/// # Errors
/// If there is no step, a time cannot be read, or as [`Series::new`].
pub(super) fn open_steps<S: StepReader + 'static>(
    steps: Vec<(PathBuf, S::Origin)>,
    name: &str,
    time_of: impl Fn(&S::Origin) -> FileResult<Option<f64>>,
    mut notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let timed = |(path, origin): (PathBuf, S::Origin)| Ok(Timed { time: time_of(&origin)?, path, origin });
    let mut timed = steps.into_iter().map(timed).collect::<FileResult<Vec<_>>>()?;
    let (description, times) = match &timed[..] {
        [only] => (only.path.display().to_string(), TimeAxis { values: vec![only.time.unwrap_or(0.0)] }),
        [first, .., last] => {
            let description = format!("{} .. {} ({} files)", first.path.display(), last.path.display(), timed.len());
            let (times, note) = times_of(&mut timed, name);
            notes.insert(0, note);
            (description, times)
        }
        [] => return Err(FileError::invalid("", "", "no file was named")),
    };
    let origins = timed.into_iter().map(|step| step.origin).collect();
    Ok(Box::new(Series::<S>::new(description, times, origins, notes)?))
}

/// A step and its time.
struct Timed<O> {
    time: Option<f64>,
    path: PathBuf,
    origin: O,
}

/// The times of the steps, which are sorted by them, and a note on where the times are from.
fn times_of<O>(timed: &mut [Timed<O>], name: &str) -> (TimeAxis, String) {
    let number = |why: String| {
        let values = (0..timed.len()).map(|i| i as f64).collect();
        (TimeAxis { values }, format!("times are 0, 1, 2, ...: {why}"))
    };
    if let Some(without) = timed.iter().find(|step| step.time.is_none()) {
        return number(format!("{} has no {name}", without.path.display()));
    }
    let by_time = |a: &Timed<O>, b: &Timed<O>| a.time.partial_cmp(&b.time).unwrap_or(Ordering::Equal);
    let mut sorted: Vec<&Timed<O>> = timed.iter().collect();
    sorted.sort_by(|a, b| by_time(a, b));
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].time == pair[1].time) {
        let [a, b] = [pair[0], pair[1]].map(|step| step.path.display());
        return number(format!("{a} and {b} have the same {name}"));
    }
    timed.sort_by(by_time);
    let values = timed.iter().filter_map(|step| step.time).collect();
    (TimeAxis { values }, format!("times are the {name} of the files"))
}

/// A time that a file has in an array of that name.
///
/// # Errors
/// If it is not finite.
pub(super) fn finite(path: &Path, array: &str, time: f64) -> FileResult<f64> {
    if time.is_finite() {
        // Adding zero turns -0 into +0.
        return Ok(time + 0.0);
    }
    Err(FileError::invalid(path, format!("array '{array}'"), format!("the time {time} is not finite")))
}

/// What `parse` finds at the start of a file, reading no more of it than needed: `parse` fails if what it needs is behind the bytes that it
/// is given, and gives them back.
///
/// # Errors
/// If the file cannot be read, or `parse` fails on all of it.
pub(super) fn at_start<T>(path: &Path, mut parse: impl FnMut(Vec<u8>) -> (FileResult<T>, Vec<u8>)) -> FileResult<T> {
    const FIRST_READ: u64 = 1 << 16;
    let mut file = files::open(path)?;
    let mut bytes = Vec::new();
    let mut wanted = FIRST_READ;
    loop {
        let got = file.by_ref().take(wanted).read_to_end(&mut bytes).map_err(|e| FileError::io(path, "read", &e))?;
        let (found, given_back) = parse(bytes);
        // What is cut off at the end of this part may be in the next.
        if found.is_ok() || (got as u64) < wanted {
            return found;
        }
        bytes = given_back;
        wanted = bytes.len() as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_numbered_unless_all_files_have_their_own() {
        let run = |times: &[Option<f64>]| {
            let step = |(origin, time): (usize, &Option<f64>)| Timed { time: *time, path: PathBuf::new(), origin };
            let mut timed: Vec<_> = times.iter().enumerate().map(step).collect();
            let (axis, note) = times_of(&mut timed, "TimeValue");
            (axis.values, timed.iter().map(|step| step.origin).collect::<Vec<_>>(), note)
        };
        let (values, order, note) = run(&[Some(2.5), Some(0.5), Some(1.0)]);
        assert_eq!((values, order), (vec![0.5, 1.0, 2.5], vec![1, 2, 0]));
        assert!(note.contains("TimeValue of the files"));
        for times in [[Some(1.0), None, Some(2.0)], [Some(1.0), Some(0.0), Some(1.0)]] {
            let (values, order, note) = run(&times);
            assert_eq!((values, order), (vec![0.0, 1.0, 2.0], vec![0, 1, 2]));
            assert!(note.contains("0, 1, 2"), "{note}");
        }
    }
}
