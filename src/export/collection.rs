//! `.pvd` files: ParaView's lists of the files of a series with their times.

use super::folder::NewFolder;
use super::xml;
use crate::error::{FileError, FileResult};
use crate::files;
use std::fs;
use std::path::{Path, PathBuf};

/// The text of a `.pvd` file being written.
pub(super) struct Collection {
    name: String,
    prefix: String,
    extension: &'static str,
    text: String,
    files: usize,
}

impl Collection {
    /// A list of files `NAME_0000.EXTENSION` and so on, whose names in the list begin with `prefix`. XML must be able to express both.
    pub fn new(name: &str, prefix: &str, extension: &'static str) -> Self {
        let text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
            <VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
            <Collection>\n";
        Self { name: name.to_owned(), prefix: prefix.to_owned(), extension, text: text.to_owned(), files: 0 }
    }

    /// Adds the next file and returns its name.
    pub fn add(&mut self, time: f64) -> String {
        let file = format!("{}_{:04}.{}", self.name, self.files, self.extension);
        self.files += 1;
        // The name was checked, so XML can express it. `{:?}` is the shortest decimal that round-trips an f64.
        let attribute = xml::attribute(&format!("{}{file}", self.prefix)).unwrap_or_default();
        self.text += &format!("<DataSet timestep=\"{time:?}\" group=\"\" part=\"0\" file=\"{attribute}\"/>\n");
        file
    }

    /// The complete text of the file.
    pub fn finish(self) -> String {
        self.text + "</Collection>\n</VTKFile>\n"
    }
}

/// Paths of a new `.pvd` file and the folder of its files beside it: `run.pvd`, and `run/run_0000.vtu` and so on.
pub(super) struct NewCollection<'a> {
    pvd: &'a Path,
    dir: PathBuf,
    name: String,
}

/// A collection being written.
pub(super) struct OpenCollection<'a> {
    place: NewCollection<'a>,
    /// Folder of the files.
    pub folder: NewFolder,
    /// List of the files.
    pub list: Collection,
}

impl<'a> NewCollection<'a> {
    /// The paths for `pvd`.
    ///
    /// # Errors
    /// If it does not end in `.pvd`, exists, or its name cannot be used for files.
    pub fn at(pvd: &'a Path) -> FileResult<Self> {
        if pvd.extension().is_none_or(|e| !e.eq_ignore_ascii_case("pvd")) {
            return Err(FileError::unsupported(pvd, "", "a series is written as a .pvd file").remedy("name it so"));
        }
        check_free(pvd)?;
        let dir = pvd.with_extension("");
        let name = file_name(&dir, None)?;
        // The collection names the folder in text; if the name of `pvd` is not Unicode, the folder has the name of its files.
        Ok(Self { pvd, dir: dir.with_file_name(&name), name })
    }

    /// Creates the folder under a temporary name.
    ///
    /// # Errors
    /// If the folder exists and is not empty, or cannot be created.
    pub fn begin(self, extension: &'static str) -> FileResult<OpenCollection<'a>> {
        let folder = NewFolder::begin(&self.dir)?;
        let list = Collection::new(&self.name, &format!("{}/", self.name), extension);
        Ok(OpenCollection { place: self, folder, list })
    }
}

impl OpenCollection<'_> {
    /// Moves folder and list into place; returns the bytes of the list.
    ///
    /// # Errors
    /// If another process has written there meanwhile, or the disk is full; no files are left then.
    pub fn finish(self) -> FileResult<u64> {
        let NewCollection { pvd, dir, .. } = self.place;
        let text = self.list.finish();
        check_free(pvd)?;
        self.folder.finish()?;
        if let Err(error) = files::replace_with(pvd, text.as_bytes()) {
            // Without its list the folder is useless, and would block the next attempt.
            let _ = fs::remove_dir_all(&dir);
            return Err(error);
        }
        Ok(text.len() as u64)
    }
}

/// # Errors
/// If `path` exists, as a dangling link too.
pub(super) fn check_free(path: &Path) -> FileResult<()> {
    match fs::symlink_metadata(path) {
        Ok(_) => Err(FileError::invalid(path, "", "exists").remedy("choose another name or remove it")),
        Err(_) => Ok(()),
    }
}

/// The prefix of the names of files in the folder `dir`: the folder's name if none is given.
pub(super) fn file_name(dir: &Path, name: Option<&str>) -> FileResult<String> {
    let from_folder = || dir.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = name.map_or_else(from_folder, str::to_owned);
    let plain = Path::new(&name).file_name().is_some_and(|n| n.to_str() == Some(&name));
    if !plain || name.contains(['/', '\\']) || xml::attribute(&name).is_none() {
        let problem = format!("'{}' cannot begin the names of files", name.escape_debug());
        return Err(FileError::invalid(dir, "name", problem).remedy("give a name without separators"));
    }
    Ok(name)
}
