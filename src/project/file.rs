//! Project files: reading and writing.

use super::{Project, ProjectError};
use crate::error::FileError;
use crate::files;
use std::io::Write;
use std::path::Path;

impl Project {
    /// Reads a project file and checks it. The source stays as it is written: relative to the file's folder.
    ///
    /// # Errors
    /// If the file cannot be read; with line and column, if it is no TOML, has a key that is not known or a value that is none;
    /// or if its parts do not belong together.
    pub fn read(path: &Path) -> Result<Self, ProjectError> {
        let text = std::fs::read_to_string(path).map_err(|e| FileError::io(path, "read the project", &e))?;
        Self::parse(&text, path)
    }

    /// Reads the text of a project file; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, ProjectError> {
        let project: Self = toml::from_str(text).map_err(|e| {
            let place = e.span().map_or_else(String::new, |span| place_of(text, span.start));
            FileError::invalid(path, place, e.message().to_owned()).remedy("docs/projects.md has all keys")
        })?;
        project.check().map_err(|problem| FileError::invalid(path, "", problem.to_string()))?;
        Ok(project)
    }

    /// The text of a project file. It reads back as the same project, every number bit for bit.
    ///
    /// # Errors
    /// If a path is not Unicode.
    pub fn to_toml(&self) -> Result<String, ProjectError> {
        let invalid = |e: toml::ser::Error| FileError::unsupported(&self.data.source, "", e.to_string());
        Ok(toml::to_string(self).map_err(invalid)?)
    }

    /// Writes a project file: under a temporary name, which is then given its own, so that one that was there is replaced as a
    /// whole or not at all.
    ///
    /// # Errors
    /// If the project has a fault that [`Self::check`] finds, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ProjectError> {
        self.check()?;
        let text = self.to_toml()?;
        let write = |file: &mut std::fs::File| {
            file.write_all(text.as_bytes())
                .and_then(|()| file.sync_all())
                .map_err(|e| FileError::io(path, "write the project", &e))
        };
        Ok(files::replace(path, write)?)
    }
}

/// Line and column, from 1, of a byte of a text.
fn place_of(text: &str, byte: usize) -> String {
    let before = text.get(..byte).unwrap_or(text);
    let line = before.bytes().filter(|b| *b == b'\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    format!("line {line} column {column}")
}
