//! One step of an `.npz` file, whose values are read when they are asked for.

use super::super::cells::GridReader;
use super::super::numbers::{Numbers, Values};
use super::super::pieces::Piece;
use super::super::series::StepReader;
use super::Contents;
use crate::error::{FileError, FileResult};
use crate::field::FieldInfo;
use std::hash::DefaultHasher;
use std::path::Path;
use std::sync::Arc;

/// Location of a step.
pub(super) struct Origin {
    pub(super) contents: Arc<Contents>,
    pub(super) step: usize,
}

/// A step.
pub(super) struct NpzStep {
    whole: [Whole; 1],
}

/// The whole mesh at a step.
pub(super) struct Whole {
    contents: Arc<Contents>,
    step: usize,
}

impl StepReader for NpzStep {
    type Origin = Origin;
    type Piece = Whole;

    fn open(origin: &Origin) -> FileResult<Self> {
        Ok(Self { whole: [Whole { contents: origin.contents.clone(), step: origin.step }] })
    }

    fn path(&self) -> &Path {
        self.whole[0].path()
    }

    fn bytes(&self) -> usize {
        0
    }

    fn pieces(&self) -> &[Whole] {
        &self.whole
    }
}

impl Piece for Whole {
    type Array = Numbers;

    fn path(&self) -> &Path {
        &self.contents.path
    }

    fn counts(&self) -> (usize, usize) {
        (self.contents.mesh.points, self.contents.mesh.cells)
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        self.contents.mesh.add_to(grid, self.path())
    }

    /// There is one mesh for all steps.
    fn hash_mesh(&self, _: &mut DefaultHasher) -> FileResult<()> {
        Ok(())
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        self.contents.fields.iter().map(|field| field.info.clone()).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.contents.left_out.clone()
    }

    fn decode(&self, array: usize) -> FileResult<Numbers> {
        let field = self.contents.fields.get(array);
        let field = field.ok_or_else(|| FileError::invalid(self.path(), "", "has no such array"))?;
        if field.has_steps { field.array.read_rows(self.step as u64, 1) } else { field.array.read() }
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}
