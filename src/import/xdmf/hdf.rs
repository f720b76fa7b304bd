//! Data sets that an XDMF file names.

use super::super::hdf::{Hdf, SlabAxis, product};
use super::super::numbers::Numbers;
use crate::error::FileResult;
use std::path::Path;

/// Reads the data set `name`, which must have the shape `dims` (axes of length 1 do not count; a flat list has any
/// shape), or the part of it that `slab` selects.
///
/// # Errors
/// If there is no such file or data set, it is damaged, has another shape, is not numeric, or has an unsupported encoding.
pub(super) fn read(path: &Path, name: &str, dims: &[u64], slab: Option<&[SlabAxis]>) -> FileResult<Numbers> {
    let missing = "correct the name behind the colon in the XDMF file; h5ls -r lists those there are";
    let file = Hdf::open(path, || format!("data set '{name}'"), missing)?;
    let array = file.array(name)?;
    if let Some(slab) = slab {
        return array.read_slab(slab);
    }
    if !is_same_shape(array.shape(), dims) {
        let problem = format!("has the shape {:?}, but the XDMF file says {dims:?}", array.shape());
        return Err(array.invalid(problem).remedy("correct the Dimensions of its DataItem"));
    }
    array.read()
}

/// The unit of the data set `name`, if it says one.
pub(super) fn unit(path: &Path, name: &str) -> Option<String> {
    Hdf::open(path, String::new, "").ok()?.unit(name)
}

/// Whether two shapes hold the same numbers in the same order.
fn is_same_shape(a: &[u64], b: &[u64]) -> bool {
    let real = |shape: &[u64]| shape.iter().copied().filter(|&d| d != 1).collect::<Vec<_>>();
    let (a, b) = (real(a), real(b));
    a == b || ((a.len() <= 1 || b.len() <= 1) && product(&a) == product(&b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_are_the_same_if_they_differ_in_axes_of_one_or_are_flat() {
        assert!(is_same_shape(&[8, 1], &[8]) && is_same_shape(&[1, 8, 3], &[8, 3]) && is_same_shape(&[24], &[8, 3]));
        assert!(is_same_shape(&[1], &[]) && is_same_shape(&[0], &[0, 3]));
        assert!(!is_same_shape(&[3, 8], &[8, 3]) && !is_same_shape(&[24], &[8, 4]) && !is_same_shape(&[7], &[8]));
        assert!(!is_same_shape(&[u64::MAX, 2], &[8]));
    }
}
