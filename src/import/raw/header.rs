//! What a header says, whatever its format.

use super::data::Data;
use crate::error::{FileError, FileResult};
use crate::files;
use crate::import::lattice::{EvenGrid, Lattice};
use crate::import::numbers::Number;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Most bytes of a header.
const HEADER_MAX: u64 = 1 << 16;
/// Most components of a value.
pub(super) const COMPONENTS_MAX: u64 = 1 << 10;

/// A file: the grid, and where the values are.
pub(super) struct Brick {
    /// The file with the header.
    pub(super) path: PathBuf,
    pub(super) lattice: Lattice,
    pub(super) grid: EvenGrid,
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) steps: usize,
    pub(super) number: Number,
    pub(super) big_endian: bool,
    pub(super) data: Data,
}

/// Counts of a header that are not checked.
pub(super) struct Counts {
    pub(super) dims: [u64; 3],
    pub(super) components: u64,
    pub(super) steps: u64,
}

impl Counts {
    /// The grid, and numbers of components and steps of values of this type, which the data hold.
    ///
    /// # Errors
    /// If they do not.
    pub(super) fn checked(&self, path: &Path, data: &Data, number: Number) -> FileResult<(Lattice, usize, usize)> {
        let invalid = |problem: String| FileError::invalid(path, "", problem).remedy("correct the sizes in the header");
        let Self { dims, components, steps } = *self;
        if components == 0 || components > COMPONENTS_MAX || steps == 0 {
            return Err(invalid(format!("has {components} components and {steps} steps")));
        }
        let file_bytes = usize::try_from(data.file_bytes()?).unwrap_or(usize::MAX);
        let lattice = Lattice::of(dims, file_bytes).map_err(invalid)?;
        let of_step = (lattice.points() as u64).checked_mul(components * number.size() as u64);
        let all = of_step.and_then(|bytes| bytes.checked_mul(steps));
        let all = all.ok_or_else(|| invalid(format!("claims {steps} steps of {dims:?} points")))?;
        data.check(all, number)?;
        let count = |n: u64| usize::try_from(n).map_err(|_| invalid(format!("claims {n} steps")));
        Ok((lattice, count(components)?, count(steps)?))
    }
}

/// The beginning of a file, with its header.
///
/// # Errors
/// If it cannot be read.
pub(super) fn beginning(path: &Path) -> FileResult<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = files::open(path)?;
    file.take(HEADER_MAX).read_to_end(&mut bytes).map_err(|e| FileError::io(path, "read", &e))?;
    Ok(bytes)
}

/// Words as this many numbers.
pub(super) fn numbers<T: FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    numbers?.try_into().ok()
}

/// A grid whose numbers are finite.
///
/// # Errors
/// If they are not.
pub(super) fn finite(path: &Path, grid: EvenGrid) -> FileResult<EvenGrid> {
    if grid.is_finite() {
        return Ok(grid);
    }
    Err(FileError::invalid(path, "", "has an origin, distances or directions of points that are not finite"))
}
