//! The steps of a case: their times, and the files of each.

use super::case::{Contents, Named, TimeSet, parse};
use crate::error::{FileError, FileResult};
use crate::field::FieldInfo;
use crate::files;
use crate::import::parts::located;
use crate::import::times::in_order;
use std::path::{Path, PathBuf};

/// Most digits of a number in a file name; u64 has 20.
const DIGITS_MAX: usize = 20;

/// The steps of a case.
pub(super) struct Plan {
    pub(super) times: Vec<f64>,
    pub(super) geometry: Files,
    pub(super) variables: Vec<(FieldInfo, Files)>,
    pub(super) left_out: Vec<String>,
    pub(super) notes: Vec<String>,
}

/// A file at each step, or one for all.
pub(super) struct Files {
    case: PathBuf,
    pattern: String,
    /// The number in the name at each step; none if the name is the same.
    numbers: Vec<u64>,
}

/// A time set that was checked: times in order, each with the number in the names of its files.
struct Times {
    number: u64,
    steps: Vec<(f64, u64)>,
}

impl Plan {
    /// Reads a case file.
    ///
    /// # Errors
    /// If it is damaged, or of a kind that is not read.
    pub(super) fn of(path: &Path) -> FileResult<Self> {
        let bytes = files::read(path)?;
        let Contents { model, variables, sets, mut left_out, notes, .. } =
            parse(path, &String::from_utf8_lossy(&bytes))?;
        let no_model = || FileError::invalid(path, "section GEOMETRY", "names no file: the line 'model:' is missing");
        let model = model.ok_or_else(no_model)?;
        let sets = sets.iter().map(|set| Times::of(path, set)).collect::<FileResult<Vec<_>>>()?;
        let leading = leading(path, &sets, &model, variables.iter().map(|variable| &variable.file))?;
        let times = leading.map_or(vec![0.0], |set| set.steps.iter().map(|(time, _)| *time).collect());
        let mut plan = Self {
            geometry: Files::of(path, &model, &sets, &times)?,
            times,
            variables: Vec::new(),
            left_out: Vec::new(),
            notes,
        };
        for variable in variables {
            if let Some(set) = set_of(path, &sets, &variable.file)?
                && set.steps.len() > 1
                && !set.steps.iter().map(|(time, _)| time).eq(&plan.times)
            {
                left_out.push(format!("'{}' (at other times, those of time set {})", variable.name, set.number));
                continue;
            }
            let files = Files::of(path, &variable.file, &sets, &plan.times)?;
            let (name, association, components) = (variable.name, variable.association, variable.components);
            plan.variables.push((FieldInfo { name, components, association }, files));
        }
        plan.left_out = left_out;
        Ok(plan)
    }

    /// All files of all steps, which exist.
    ///
    /// # Errors
    /// If one is missing, or outside of the folder of the case file.
    pub(super) fn files(&self) -> FileResult<Vec<PathBuf>> {
        let mut all = Vec::new();
        for files in std::iter::once(&self.geometry).chain(self.variables.iter().map(|(_, files)| files)) {
            for step in 0..files.numbers.len().max(1) {
                all.push(files.at(step)?);
            }
        }
        Ok(all)
    }
}

/// The time set with the most steps of those that variables have; else that of the geometry, else the first one if it has one step.
fn leading<'a>(
    path: &Path,
    sets: &'a [Times],
    model: &Named,
    variables: impl Iterator<Item = &'a Named>,
) -> FileResult<Option<&'a Times>> {
    let mut leading: Option<&Times> = None;
    for named in variables {
        let set = set_of(path, sets, named)?;
        if let Some(set) = set.filter(|set| leading.is_none_or(|leading| leading.steps.len() < set.steps.len())) {
            leading = Some(set);
        }
    }
    let of_model = set_of(path, sets, model)?;
    let single = || sets.first().filter(|set| set.steps.len() == 1);
    Ok(leading.or(of_model).or_else(single))
}

/// The time set of a file whose name changes from step to step.
fn set_of<'a>(path: &Path, sets: &'a [Times], named: &Named) -> FileResult<Option<&'a Times>> {
    if !named.pattern.contains('*') {
        return Ok(None);
    }
    let found = match named.set {
        Some(number) => sets.iter().find(|set| set.number == number),
        None => sets.first(),
    };
    let missing = || {
        let set = named.set.map_or("no time set".to_owned(), |number| format!("no time set {number}"));
        let problem = format!("has {set}, which the file '{}' needs", named.pattern);
        FileError::invalid(path, "section TIME", problem).remedy("write the case file again")
    };
    found.map(Some).ok_or_else(missing)
}

impl Times {
    fn of(path: &Path, set: &TimeSet) -> FileResult<Self> {
        let TimeSet { number, .. } = *set;
        let invalid = |problem: String| {
            FileError::invalid(path, format!("time set {number}"), problem).remedy("write the case file again")
        };
        let count = set.values.len();
        if set.steps.is_some_and(|steps| steps != count as u64) {
            let steps = set.steps.unwrap_or(0);
            return Err(invalid(format!("claims {steps} steps, and has {count} time values")));
        }
        if !set.numbers.is_empty() && set.numbers.len() != count {
            return Err(invalid(format!("has {} filename numbers, and {count} time values", set.numbers.len())));
        }
        let number_of = |step: usize| {
            let counted = || (step as u64).checked_mul(set.increment.unwrap_or(1))?.checked_add(set.start.unwrap_or(0));
            set.numbers.get(step).copied().or_else(counted)
        };
        let steps = in_order(&set.values).map_err(invalid)?.into_iter().map(|(time, step)| {
            let number =
                number_of(step).ok_or_else(|| invalid(format!("has too large a filename number at step {step}")))?;
            Ok((time, number))
        });
        Ok(Self { number, steps: steps.collect::<FileResult<_>>()? })
    }
}

impl Files {
    /// The files at these times: each is the last one that is not later.
    fn of(path: &Path, named: &Named, sets: &[Times], times: &[f64]) -> FileResult<Self> {
        let set = set_of(path, sets, named)?;
        let number_at = |set: &Times, time: f64| {
            let later = set.steps.partition_point(|(of_step, _)| *of_step <= time);
            set.steps.get(later.saturating_sub(1)).map(|(_, number)| *number)
        };
        let numbers = set.map_or(Vec::new(), |set| times.iter().filter_map(|&time| number_at(set, time)).collect());
        Ok(Self { case: path.to_owned(), pattern: named.pattern.clone(), numbers })
    }

    /// The file at a step.
    ///
    /// # Errors
    /// If it is missing, or outside of the folder of the case file.
    pub(super) fn at(&self, step: usize) -> FileResult<PathBuf> {
        let invalid = |problem: String| FileError::invalid(&self.case, "", problem);
        let name = match self.numbers.get(step) {
            None => self.pattern.clone(),
            Some(&number) => filled(&self.pattern, number).map_err(invalid)?,
        };
        located(&self.case, &name).map_err(invalid)
    }
}

/// A pattern with this number in place of each row of asterisks, with at least as many digits.
fn filled(pattern: &str, number: u64) -> Result<String, String> {
    let (mut name, mut rest) = (String::new(), pattern);
    while let Some(from) = rest.find('*') {
        let behind = rest[from..].trim_start_matches('*');
        let digits = rest.len() - from - behind.len();
        if digits > DIGITS_MAX {
            return Err(format!("names a file with {digits} asterisks in a row; at most {DIGITS_MAX} are read"));
        }
        name += &rest[..from];
        name += &format!("{number:0digits$}");
        rest = behind;
    }
    Ok(name + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asterisks_are_filled_with_numbers_of_as_many_digits() {
        assert_eq!(filled("a.***.T", 7).as_deref(), Ok("a.007.T"));
        assert_eq!(filled("*/b**", 123).as_deref(), Ok("123/b123"));
        assert!(filled(&"*".repeat(21), 1).is_err());
    }
}
