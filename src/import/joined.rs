//! Several sources with the same mesh and times as one: many solvers write a file per field.

use crate::error::{FileError, FileResult};
use crate::field::{Blocks, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::RawMesh;
use std::path::Path;

/// Sources with the same mesh and times, and the fields of all.
pub(super) struct Joined {
    /// At least two.
    sources: Vec<Box<dyn SeriesSource>>,
    fields: Vec<FieldInfo>,
    /// The source of each field.
    owners: Vec<usize>,
    description: String,
    notes: Vec<String>,
}

impl Joined {
    /// Joins sources; a single one is returned as it is. Of fields with the same name, the first is used. `path` names the joined source in
    /// messages.
    ///
    /// # Errors
    /// If there is no source, or one differs from the first in times or mesh.
    pub(super) fn of(path: &Path, mut sources: Vec<Box<dyn SeriesSource>>) -> FileResult<Box<dyn SeriesSource>> {
        if sources.len() == 1
            && let Some(source) = sources.pop()
        {
            return Ok(source);
        }
        let Some((first, others)) = sources.split_first() else {
            return Err(FileError::invalid(path, "", "there are no files to read"));
        };
        let mesh = first.mesh()?;
        for other in others {
            let differs = |what: &str| {
                let problem = format!("has {what} than {}", first.describe());
                FileError::unsupported(other.describe(), "", problem).remedy("import it to a store of its own")
            };
            if other.times() != first.times() {
                return Err(differs("other times"));
            }
            if other.mesh()? != mesh {
                return Err(differs("another mesh"));
            }
        }
        let (mut fields, mut owners, mut notes) = (Vec::<FieldInfo>::new(), Vec::new(), Vec::new());
        for (i, source) in sources.iter().enumerate() {
            for field in source.fields() {
                if fields.iter().any(|f| f.name == field.name && f.association == field.association) {
                    notes.push(format!("left out a second field '{}' ({})", field.name, source.describe()));
                } else {
                    fields.push(field.clone());
                    owners.push(i);
                }
            }
        }
        let mut names: Vec<String> = sources.iter().map(|source| source.describe()).collect();
        names.dedup();
        Ok(Box::new(Self { sources, fields, owners, description: names.join(", "), notes }))
    }
}

impl Joined {
    /// The source of a field.
    fn owner(&self, field: &FieldInfo) -> FileResult<&dyn SeriesSource> {
        let owner = self.fields.iter().position(|f| f == field).and_then(|i| self.sources.get(*self.owners.get(i)?));
        owner
            .map(AsRef::as_ref)
            .ok_or_else(|| FileError::invalid(&self.description, format!("field '{}'", field.name), "does not exist"))
    }
}

impl SeriesSource for Joined {
    fn describe(&self) -> String {
        self.description.clone()
    }

    fn times(&self) -> &TimeAxis {
        self.sources[0].times()
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn unit(&self, field: &FieldInfo) -> Option<String> {
        self.owner(field).ok()?.unit(field)
    }

    fn cell_number(&self, cell: u32) -> u32 {
        self.sources.first().map_or(cell, |first| first.cell_number(cell))
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        self.sources[0].mesh()
    }

    fn blocks(&self) -> FileResult<Option<Blocks>> {
        self.sources.first().map_or(Ok(None), |first| first.blocks())
    }

    fn fix_points(&mut self) -> FileResult<()> {
        self.sources.iter_mut().try_for_each(|source| source.fix_points())?;
        let of_first = self.sources.first().map_or(&[][..], |first| first.fields());
        for field in of_first.iter().filter(|field| !self.fields.contains(field)).cloned().collect::<Vec<_>>() {
            self.fields.push(field);
            self.owners.push(0);
        }
        Ok(())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        self.owner(field)?.read(field, component, step, out)
    }

    fn read_f64(&self, field: &FieldInfo, component: usize, step: usize, out: &mut Vec<f64>) -> FileResult<()> {
        self.owner(field)?.read_f64(field, component, step, out)
    }

    fn check(&self, step: usize) -> FileResult<()> {
        self.sources.iter().try_for_each(|source| source.check(step))
    }

    fn counted(&self, last: usize) -> serde_json::Value {
        self.sources.iter().map(|source| source.counted(last)).collect()
    }

    fn count_on(&self, counted: &serde_json::Value) {
        let each = self.sources.iter().zip(counted.as_array().into_iter().flatten());
        each.for_each(|(source, counted)| source.count_on(counted));
    }

    fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.sources.iter().flat_map(|source| source.notes()).collect();
        let mut seen = std::collections::BTreeSet::new();
        notes.retain(|note| seen.insert(note.clone()));
        notes.into_iter().chain(self.notes.iter().cloned()).collect()
    }
}
