//! A step of a case; its pieces are the parts of its geometry.

use super::geometry::{Geometry, Part};
use super::plan::Plan;
use super::variable::VariableFile;
use crate::error::{FileError, FileResult};
use crate::field::FieldInfo;
use crate::import::cells::GridReader;
use crate::import::numbers::{Numbers, Values};
use crate::import::pieces::{BlockName, Piece};
use crate::import::series::StepReader;
use std::hash::{DefaultHasher, Hash};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// A case, and the geometry of its first step.
pub(super) struct Case {
    pub(super) plan: Plan,
    pub(super) first: Arc<Geometry>,
}

/// A step in memory.
pub(super) struct EnsightStep {
    shared: Arc<Shared>,
    parts: Vec<PartOfStep>,
}

/// What the parts of a step share.
struct Shared {
    case: Arc<Case>,
    step: usize,
    geometry: Arc<Geometry>,
    /// The variable read last, kept while its parts are decoded one after the other.
    last: Mutex<Option<(usize, Arc<VariableFile>)>>,
}

/// A part that has points or elements.
pub(super) struct PartOfStep {
    shared: Arc<Shared>,
    index: usize,
    is_first: bool,
    is_last: bool,
}

impl StepReader for EnsightStep {
    type Origin = (Arc<Case>, usize);
    type Piece = PartOfStep;

    fn open((case, step): &Self::Origin) -> FileResult<Self> {
        let path = case.plan.geometry.at(*step)?;
        let geometry = if path == case.first.path { case.first.clone() } else { Arc::new(Geometry::open(&path)?) };
        let is_there = |part: &Part| part.points > 0 || part.cells > 0;
        let there: Vec<usize> = (0..geometry.parts.len()).filter(|&i| is_there(&geometry.parts[i])).collect();
        let shared = Arc::new(Shared { case: case.clone(), step: *step, geometry, last: Mutex::new(None) });
        let ends = (there.first().copied(), there.last().copied());
        let part = |index: usize| PartOfStep {
            shared: shared.clone(),
            index,
            is_first: ends.0 == Some(index),
            is_last: ends.1 == Some(index),
        };
        let parts = there.into_iter().map(part).collect();
        Ok(Self { shared, parts })
    }

    fn path(&self) -> &Path {
        &self.shared.geometry.path
    }

    /// The first geometry is in memory whatever steps are.
    fn bytes(&self) -> usize {
        let Shared { case, geometry, .. } = &*self.shared;
        if Arc::ptr_eq(geometry, &case.first) { 0 } else { geometry.bytes.len() }
    }

    fn pieces(&self) -> &[PartOfStep] {
        &self.parts
    }
}

impl Shared {
    /// The file of a variable at this step.
    fn variable(&self, array: usize, field: &FieldInfo, path: &Path) -> FileResult<Arc<VariableFile>> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, file)) = last.as_ref().filter(|(known, _)| *known == array) {
            return Ok(file.clone());
        }
        *last = None;
        let file = Arc::new(VariableFile::open(path, &self.geometry, field)?);
        *last = Some((array, file.clone()));
        Ok(file)
    }
}

impl PartOfStep {
    fn part(&self) -> &Part {
        &self.shared.geometry.parts[self.index]
    }
}

impl Piece for PartOfStep {
    type Array = Numbers;

    fn path(&self) -> &Path {
        &self.shared.geometry.path
    }

    fn counts(&self) -> (usize, usize) {
        (self.part().points, self.part().cells)
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        let (points, cells) = self.counts();
        grid.check_room(self.path(), "", points, cells)?;
        self.shared.geometry.add_to(self.part(), grid)?;
        grid.cells += cells;
        Ok(())
    }

    /// A geometry is the same at all steps that have its file.
    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        (self.path(), self.shared.geometry.bytes.len(), self.index).hash(state);
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        self.shared.case.plan.variables.iter().map(|(field, _)| field.clone()).collect()
    }

    fn blocks(&self) -> Vec<(BlockName, usize)> {
        let Part { name, number, cells, .. } = self.part();
        vec![(BlockName { name: name.clone(), number: Some(*number) }, *cells)]
    }

    fn left_out(&self) -> Vec<String> {
        if self.is_first { self.shared.case.plan.left_out.clone() } else { Vec::new() }
    }

    fn decode(&self, array: usize) -> FileResult<Numbers> {
        let Shared { case, step, geometry, last } = &*self.shared;
        let no_array = || FileError::invalid(self.path(), "", "has no such array");
        let (field, files) = case.plan.variables.get(array).ok_or_else(no_array)?;
        let file = self.shared.variable(array, field, &files.at(*step)?)?;
        if self.is_last {
            *last.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
        file.of_part(geometry, self.index, field)
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}
