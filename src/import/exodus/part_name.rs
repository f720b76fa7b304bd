//! Names of the parts of a decomposed file: `NAME.e.4.0` to `NAME.e.4.3` are the four parts of one mesh.

use super::FORMAT;
use crate::error::{FileError, FileResult};
use crate::files;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// Extensions that parts may have beside those of whole files, as `nem_spread` and libMesh write them.
const OF_PARTS: [&str; 3] = ["par", "nem", "n"];
/// Most missing parts that an error names.
const LISTED_MAX: usize = 8;

/// The name of a part.
struct PartName {
    /// The path up to the number of parts: `NAME.e.4`.
    output: PathBuf,
    parts: u64,
    number: u64,
    /// Number of digits of the number.
    width: usize,
}

impl PartName {
    /// The name of a part; `None` for another name.
    fn of(path: &Path) -> Option<Self> {
        let (whole, parts, number) = numbered(path.file_name()?.to_str()?)?;
        let (stem, extension) = whole.rsplit_once('.')?;
        let extension = extension.to_ascii_lowercase();
        let is_known = [FORMAT.extensions, &OF_PARTS].iter().any(|known| known.contains(&extension.as_str()));
        if stem.is_empty() || !is_known {
            return None;
        }
        let output = path.with_file_name(format!("{whole}.{parts}"));
        Some(Self { output, parts: parts.parse().ok()?, number: number.parse().ok()?, width: number.len() })
    }

    fn name(&self, number: u64) -> String {
        let output = self.output.file_name().unwrap_or_default().to_string_lossy();
        format!("{output}.{number:0width$}", width = self.width)
    }
}

/// The name of the whole, the number of parts and that of the part, in a name that ends in these two numbers.
pub(super) fn numbered(name: &str) -> Option<(&str, &str, &str)> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let (rest, number) = name.rsplit_once('.')?;
    let (whole, parts) = rest.rsplit_once('.')?;
    (is_number(number) && is_number(parts)).then_some((whole, parts, number))
}

/// Whether a file is a part, by its name.
pub(in crate::import) fn is_part(path: &Path) -> bool {
    PartName::of(path).is_some()
}

/// The paths, of the parts of each decomposed file only the first in this order.
pub(in crate::import) fn one_of_parts(paths: Vec<PathBuf>) -> Vec<PathBuf> {
    let mut met = HashSet::new();
    let is_first = |path: &PathBuf| PartName::of(path).is_none_or(|part| met.insert(part.output));
    paths.into_iter().filter(is_first).collect()
}

/// All files of the mesh of a file, in the order of their numbers: the file alone unless it is a part.
///
/// # Errors
/// If a part is missing, or there twice.
pub(super) fn all_parts(path: &Path) -> FileResult<Vec<PathBuf>> {
    let Some(name) = PartName::of(path) else { return Ok(vec![path.to_owned()]) };
    if name.number >= name.parts {
        let problem = format!("is named as part {} of {}, which are counted from 0", name.number, name.parts);
        return Err(FileError::invalid(path, "", problem).remedy("rename it if it is no part"));
    }
    let folder = files::parent_of(path);
    let entries = std::fs::read_dir(folder).map_err(|e| FileError::io(folder, "list", &e))?;
    let mut found = BTreeMap::new();
    for file in entries.flatten().map(|entry| path.with_file_name(entry.file_name())) {
        let other = PartName::of(&file).filter(|other| other.output == name.output && other.number < name.parts);
        let Some(number) = other.map(|other| other.number).filter(|_| file.is_file()) else { continue };
        if let Some(same) = found.insert(number, file.clone()) {
            let problem = format!("is part {number}, as {} is", same.display());
            return Err(FileError::invalid(file, "", problem).remedy("remove the one that is of another run"));
        }
    }
    let missing = name.parts - found.len() as u64;
    if missing > 0 {
        let numbers = (0..name.parts).filter(|number| !found.contains_key(number));
        let mut listed: Vec<String> = numbers.take(LISTED_MAX).map(|number| name.name(number)).collect();
        if missing > LISTED_MAX as u64 {
            listed.push(format!("{} more", missing - LISTED_MAX as u64));
        }
        let problem = format!("{missing} of {} parts are missing: {}", name.parts, listed.join(", "));
        return Err(FileError::invalid(path, "", problem).remedy("copy all parts to one folder"));
    }
    Ok(found.into_values().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn the_parts_of_a_file_are_found_by_any_of_them() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let add = |name: &str| fs::write(at(name), "").unwrap();
        let names = |name: &str| -> Result<Vec<String>, String> {
            let parts = all_parts(&at(name)).map_err(|error| error.to_string())?;
            Ok(parts.iter().map(|path| path.file_name().unwrap().to_string_lossy().into_owned()).collect())
        };
        ["a.e.11.00", "a.e.11.10", "a.e.2.0", "a.e", "b.e.11.01"].iter().for_each(|name| add(name));
        let error = names("a.e.11.10").unwrap_err();
        assert!(error.contains("9 of 11 parts are missing: a.e.11.01, a.e.11.02"), "{error}");
        assert!(error.contains("a.e.11.08, 1 more; copy all parts"), "{error}");
        let error = names("a.e.2.0").unwrap_err();
        assert!(error.contains("1 of 2 parts are missing: a.e.2.1;"), "{error}");
        (1..10).for_each(|part| add(&format!("a.e.11.0{part}")));
        let all: Vec<String> = (0..11).map(|part| format!("a.e.11.{part:02}")).collect();
        for name in ["a.e.11.00", "a.e.11.10", "a.e.11.4"] {
            assert_eq!(names(name), Ok(all.clone()), "{name}");
        }
        assert_eq!(names("a.e"), Ok(vec!["a.e".to_owned()]));
        assert!(names("a.e.11.11").unwrap_err().contains("part 11 of 11"));
        assert!(names("a.e.18446744073709551615.0").unwrap_err().contains("18446744073709551615 parts are missing"));
        add("a.e.11.3");
        assert!(names("a.e.11.00").unwrap_err().contains("is part 3, as"));
        assert!(names("none/a.e.11.00").is_err());
    }

    #[test]
    fn names_with_two_numbers_behind_an_extension_of_exodus_are_parts() {
        for name in ["a.e.4.0", "b.c.EXO.16.03", "a.par.2.1", "a.nem.1.0"] {
            assert!(is_part(Path::new(name)), "{name}");
        }
        for name in ["a.4.0", ".e.4.0", "4.0", "e", "a.e.4", "a.e.4.x", "a.e-s002.4.0", "a.vtu.4.0", "a.e.-4.0"] {
            assert!(!is_part(Path::new(name)), "{name}");
        }
        let paths = ["a.e.2.0", "a.e.2.1", "b.e", "c.e.2.1", "a.e.3.0", "x/a.e.2.1"].map(PathBuf::from);
        let kept = one_of_parts(paths.to_vec());
        assert_eq!(kept, ["a.e.2.0", "b.e", "c.e.2.1", "a.e.3.0", "x/a.e.2.1"].map(PathBuf::from));
    }
}
