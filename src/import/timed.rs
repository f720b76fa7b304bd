//! Files of one step or several each: their times, and the part of a file that is read for its time.

use super::series::{Series, StepReader};
use crate::error::{FileError, FileResult};
use crate::field::{SeriesSource, TimeAxis};
use crate::files;
use std::cmp::Ordering;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Opens steps, each named by a file, as one series. Times are those that `time_of` finds, called `name`, as [`open_files`] takes them.
///
/// # Errors
/// If there is no step, a time cannot be read, or as [`Series::new`].
pub(super) fn open_steps<S: StepReader + 'static>(
    steps: Vec<(PathBuf, S::Origin)>,
    name: &str,
    time_of: impl Fn(&S::Origin) -> FileResult<Option<f64>>,
    notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let timed = |(path, origin): (PathBuf, S::Origin)| {
        Ok(Timed { times: time_of(&origin)?.map(|time| vec![time]), path, origins: vec![origin] })
    };
    open_files::<S>(steps.into_iter().map(timed).collect::<FileResult<Vec<_>>>()?, name, notes)
}

/// Opens files of one step or several each as one series. Times are those of the files, called `name`, if all have some and each begins
/// behind the last step of another (which then orders the files), else 0, 1, 2, ...; the source's notes say which. A single step without a
/// time is at 0.
///
/// # Errors
/// If there is no file, or as [`Series::new`].
pub(super) fn open_files<S: StepReader + 'static>(
    mut files: Vec<Timed<S::Origin>>,
    name: &str,
    mut notes: Vec<String>,
) -> FileResult<Box<dyn SeriesSource>> {
    let (description, times) = match &files[..] {
        [only] => {
            let numbers = (0..only.origins.len()).map(|step| step as f64);
            let values = only.times.clone().unwrap_or_else(|| numbers.collect());
            (only.path.display().to_string(), TimeAxis { values })
        }
        [first, .., last] => {
            let description = format!("{} .. {} ({} files)", first.path.display(), last.path.display(), files.len());
            let (times, note) = times_of(&mut files, name);
            notes.insert(0, note);
            (description, times)
        }
        [] => return Err(FileError::invalid("", "", "no file was named")),
    };
    let origins = files.into_iter().flat_map(|file| file.origins).collect();
    Ok(Box::new(Series::<S>::new(description, times, origins, notes)?))
}

/// A file, its steps, and their times in ascending order, one for each, if it has any.
pub(super) struct Timed<O> {
    pub(super) path: PathBuf,
    pub(super) times: Option<Vec<f64>>,
    pub(super) origins: Vec<O>,
}

impl<O> Timed<O> {
    fn first(&self) -> Option<f64> {
        self.times.as_ref()?.first().copied()
    }

    fn last(&self) -> Option<f64> {
        self.times.as_ref()?.last().copied()
    }
}

/// The times of the steps of files, which are sorted by them, and a note on where the times are from.
fn times_of<O>(files: &mut [Timed<O>], name: &str) -> (TimeAxis, String) {
    let steps: usize = files.iter().map(|file| file.origins.len()).sum();
    let number = |why: String| {
        let values = (0..steps).map(|i| i as f64).collect();
        (TimeAxis { values }, format!("times are 0, 1, 2, ...: {why}"))
    };
    if let Some(without) = files.iter().find(|file| file.first().is_none()) {
        return number(format!("{} has no {name}", without.path.display()));
    }
    let by_time = |a: &Timed<O>, b: &Timed<O>| a.first().partial_cmp(&b.first()).unwrap_or(Ordering::Equal);
    let mut sorted: Vec<&Timed<O>> = files.iter().collect();
    sorted.sort_by(|a, b| by_time(a, b));
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0].last() >= pair[1].first()) {
        let how = if pair.iter().all(|file| file.origins.len() == 1) { "the same" } else { "overlapping" };
        let [a, b] = [pair[0], pair[1]].map(|file| file.path.display());
        return number(format!("{a} and {b} have {how} {name}"));
    }
    files.sort_by(by_time);
    let values = files.iter().filter_map(|file| file.times.as_ref()).flatten().copied().collect();
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

    fn timed(origins: &[usize], times: Option<Vec<f64>>) -> Timed<usize> {
        Timed { times, path: PathBuf::new(), origins: origins.to_vec() }
    }

    fn in_order(mut files: Vec<Timed<usize>>) -> (Vec<f64>, Vec<usize>, String) {
        let (axis, note) = times_of(&mut files, "TimeValue");
        (axis.values, files.into_iter().flat_map(|file| file.origins).collect(), note)
    }

    #[test]
    fn files_of_several_steps_follow_each_other_unless_they_overlap() {
        let files = |last: f64| vec![timed(&[0, 1], Some(vec![2.0, 3.0])), timed(&[2, 3], Some(vec![0.5, last]))];
        let (values, order, _) = in_order(files(1.0));
        assert_eq!((values, order), (vec![0.5, 1.0, 2.0, 3.0], vec![2, 3, 0, 1]));
        for last in [2.0, 5.0] {
            let (values, order, note) = in_order(files(last));
            assert_eq!((values, order), (vec![0.0, 1.0, 2.0, 3.0], vec![0, 1, 2, 3]));
            assert!(note.contains("overlapping TimeValue"), "{note}");
        }
    }

    #[test]
    fn times_are_numbered_unless_all_files_have_their_own() {
        let run = |times: &[Option<f64>]| {
            let step = |(origin, time): (usize, &Option<f64>)| timed(&[origin], time.map(|time| vec![time]));
            in_order(times.iter().enumerate().map(step).collect())
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
