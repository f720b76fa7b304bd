//! Project files: reading and writing.

use super::{Project, ProjectError};
use crate::error::FileError;
use crate::files;
use serde::Deserialize;
use std::io::Write;
use std::path::Path;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

impl Project {
    /// Reads a project file and checks it. The source stays as it is written: relative to the file's folder.
    ///
    /// # Errors
    /// If the file cannot be read; with line and column, if it is not TOML or has an unknown key or an invalid value; or if its parts are
    /// inconsistent.
    pub fn read(path: &Path) -> Result<Self, ProjectError> {
        files::check_kind(path)?;
        let text = std::fs::read_to_string(path).map_err(|e| FileError::io(path, "read the project", &e))?;
        Self::parse(&text, path)
    }

    /// Reads the text of a project file; `path` is for messages.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, ProjectError> {
        // The version comes first: keys unknown here may be known in another version.
        if let Ok(OfVersion { version }) = toml::from_str(text)
            && !Self::VERSIONS.contains(&version)
        {
            let problem = ProjectError::Version(version).to_string();
            return Err(FileError::unsupported(path, "version", problem)
                .remedy("use the tetreel that wrote it")
                .into());
        }
        let project: Self = toml::from_str(text).map_err(|e| {
            let place = e.span().map_or_else(String::new, |span| place_of(text, span.start));
            FileError::invalid(path, place, e.message().to_owned()).remedy("docs/projects.md has all keys")
        })?;
        if let (Ok(written), Ok(Value::Table(read))) = (DeTable::parse(text), Value::try_from(&project))
            && let Some(byte) = other_length(written.get_ref(), &read)
        {
            let problem = "the list has more values than belong there";
            return Err(FileError::invalid(path, place_of(text, byte), problem)
                .remedy("docs/projects.md has all keys")
                .into());
        }
        project.check().map_err(|problem| FileError::invalid(path, "", problem.to_string()))?;
        Ok(project)
    }

    /// The text of a project file. It reads back as the same project, every number bit for bit.
    ///
    /// # Errors
    /// If a path is not Unicode.
    pub fn to_toml(&self) -> Result<String, ProjectError> {
        toml::to_string(self).map_err(|e| ProjectError::NoText(e.to_string()))
    }

    /// Writes a project file: under a temporary name, then renamed, so that an existing file is replaced as a whole or not at all.
    ///
    /// # Errors
    /// If [`Self::check`] fails, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ProjectError> {
        self.check()?;
        let text = self.to_toml()?;
        let write = |file: &mut std::fs::File| {
            file.write_all(text.as_bytes())
                .and_then(|()| file.sync_all())
                .map_err(|e| files::cannot_write(path, "write the project", &e))
        };
        Ok(files::replace(path, write)?)
    }
}

/// The part common to all versions of a project file.
#[derive(Deserialize)]
struct OfVersion {
    version: u32,
}

/// The first byte of a list that is longer than what was read of it: lists of fixed length ignore the rest.
fn other_length(written: &DeTable<'_>, read: &toml::Table) -> Option<usize> {
    // ParaView's form of a colour map has its own order and keys; it is parsed separately.
    let known = written.iter().filter(|(key, _)| key.get_ref() != "color_map");
    known.filter_map(|(key, value)| Some((value, read.get(&**key.get_ref())?))).find_map(other_length_in)
}

fn other_length_in((written, read): (&Spanned<DeValue<'_>>, &Value)) -> Option<usize> {
    match (written.get_ref(), read) {
        (DeValue::Table(written), Value::Table(read)) => other_length(written, read),
        (DeValue::Array(written_in), Value::Array(read)) if written_in.len() == read.len() => {
            written_in.iter().zip(read).find_map(other_length_in)
        }
        (DeValue::Array(_), Value::Array(_)) => Some(written.span().start),
        _ => None,
    }
}

/// Line and column, from 1, of a byte of a text.
fn place_of(text: &str, byte: usize) -> String {
    let before = text.get(..byte).unwrap_or(text);
    let line = before.bytes().filter(|b| *b == b'\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    format!("line {line} column {column}")
}
