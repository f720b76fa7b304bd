//! Pieces of a step: points, cells and arrays of both, each read when it is asked for.

use super::cells::GridReader;
use super::numbers::Values;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use std::collections::HashMap;
use std::hash::DefaultHasher;
use std::path::Path;

/// More components than any field has.
pub(super) const COMPONENTS_MAX: u64 = 1 << 16;

/// Name of a block, and its number if the file has one.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct BlockName {
    pub(super) name: String,
    pub(super) number: Option<u32>,
}

/// A part of a step's mesh, and the arrays of its points and cells.
pub(super) trait Piece: Send + Sync {
    /// A decoded array.
    type Array: Send + Sync;

    /// The file that it is from.
    fn path(&self) -> &Path;
    /// Number of points, and of cells of any kind.
    fn counts(&self) -> (usize, usize);
    /// Adds its points and cells to a mesh.
    fn add_to(&self, grid: &mut GridReader) -> FileResult<()>;
    /// Hashes its mesh as stored: equal bytes are equal meshes, other bytes may be.
    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()>;
    /// A number of each point that the points of other pieces which are the same point have too; `None` if the format has no such
    /// numbers.
    fn point_numbers(&self) -> FileResult<Option<Vec<u64>>> {
        Ok(None)
    }
    /// What its arrays hold, in the order in which [`Self::decode`] numbers them.
    fn arrays(&self) -> Vec<FieldInfo>;
    /// The blocks of its cells, in order, and their numbers of cells of any kind; none if it is of no block.
    fn blocks(&self) -> Vec<(BlockName, usize)> {
        Vec::new()
    }
    /// Arrays that are not read, as `'NAME' (REASON)`.
    fn left_out(&self) -> Vec<String> {
        Vec::new()
    }
    /// The unit of an array, if the file says it.
    fn unit(&self, _array: usize) -> Option<String> {
        None
    }
    /// Reads an array with all its components.
    fn decode(&self, array: usize) -> FileResult<Self::Array>;
    /// The numbers of a decoded array.
    fn values<'a>(&'a self, array: &'a Self::Array) -> Values<'a>;
}

/// The fields that all pieces have, those of points first, and the names of other arrays, each with the reason why it is left out.
pub(super) fn fields_of(pieces: &[impl Piece]) -> (Vec<FieldInfo>, Vec<String>) {
    let mut left_out = Vec::new();
    let mut met: HashMap<FieldInfo, usize> = HashMap::new();
    let mut order: Vec<FieldInfo> = Vec::new();
    for piece in pieces {
        left_out.extend(piece.left_out());
        let mut names = HashMap::new();
        for field in piece.arrays() {
            if field.name.is_empty() {
                left_out.push("'' (has no name)".to_owned());
            } else if names.insert((field.association, field.name.clone()), ()).is_some() {
                left_out.push(format!("'{}' (a second array of that name)", field.name));
            } else {
                let count = met.entry(field.clone()).or_default();
                if *count == 0 {
                    order.push(field);
                }
                *count += 1;
            }
        }
    }
    let is_whole = |field: &FieldInfo| met.get(field) == Some(&pieces.len());
    let (mut fields, others): (Vec<_>, Vec<_>) = order.into_iter().partition(is_whole);
    left_out.extend(others.iter().map(|field| format!("'{}' (not the same in all pieces)", field.name)));
    fields.sort_by_key(|field| field.association == Association::Cell);
    (fields, left_out)
}

/// Reads a field of a piece; `None` if the piece has no such array. `step` is for messages.
///
/// # Errors
/// If the piece has it with another number of components or in a way that is not read, or its data are damaged.
pub(super) fn decode<P: Piece>(piece: &P, field: &FieldInfo, step: usize) -> FileResult<Option<P::Array>> {
    let invalid = |problem: String| {
        FileError::invalid(piece.path(), format!("step {step}"), problem).remedy("leave that step or that field out")
    };
    let arrays = piece.arrays();
    let found = arrays.iter().position(|of| (of.association, &of.name) == (field.association, &field.name));
    let Some(found) = found else {
        let prefix = format!("'{}' (", field.name);
        return match piece.left_out().into_iter().find(|text| text.starts_with(&prefix)) {
            Some(reason) => Err(invalid(format!("lacks a field of the first step: {reason}"))),
            None => Ok(None),
        };
    };
    let (new, old) = (arrays[found].components, field.components);
    if new != old {
        return Err(invalid(format!("array '{}' has {new} components, but {old} in the first step", field.name)));
    }
    piece.decode(found).map(Some)
}
