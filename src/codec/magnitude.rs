//! Euclidean norm of a field's tuples.

use crate::task::Cancel;
use rayon::prelude::*;

/// Values that one task computes.
const CHUNK: usize = 16_384;

/// Euclidean norm of each tuple: `out[v] = |(components[0][v], components[1][v], ..)|`.
///
/// Squares are summed in f64 in the order of the components, so that neither large nor denormal components overflow or vanish and the
/// result does not depend on the thread. A NaN component gives NaN; otherwise an infinite one gives infinity, as does a norm beyond the
/// largest f32.
///
/// # Panics
/// If a component is shorter than `out`.
pub fn magnitude(components: &[&[f32]], out: &mut [f32]) {
    magnitude_unless(components, out, &Cancel::new());
}

/// As [`magnitude`], unless `cancel` is raised. Returns false if it was; `out` is then unspecified.
///
/// # Panics
/// As [`magnitude`].
pub fn magnitude_unless(components: &[&[f32]], out: &mut [f32], cancel: &Cancel) -> bool {
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        if cancel.is_cancelled() {
            return;
        }
        let first = chunk * CHUNK;
        for (i, out) in out.iter_mut().enumerate() {
            let sum: f64 = components.iter().map(|values| f64::from(values[first + i]).powi(2)).sum();
            *out = sum.sqrt() as f32;
        }
    });
    !cancel.is_cancelled()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn norm(tuple: &[f32]) -> f32 {
        let columns: Vec<&[f32]> = tuple.iter().map(std::slice::from_ref).collect();
        let mut out = [0.0];
        magnitude(&columns, &mut out);
        out[0]
    }

    #[test]
    fn the_norm_is_euclidean() {
        assert_eq!(norm(&[3.0, -4.0, 12.0]), 13.0);
        assert_eq!(norm(&[-2.5]), 2.5);
    }

    #[test]
    fn large_and_denormal_components_neither_overflow_nor_vanish() {
        assert_eq!(norm(&[3e30, 4e30]), 5e30);
        let tiny = f32::from_bits(1);
        assert_eq!(norm(&[3.0 * tiny, 4.0 * tiny]), 5.0 * tiny);
        assert_eq!(norm(&[f32::MAX, f32::MAX]), f32::INFINITY);
    }

    #[test]
    fn non_finite_components_stay_visible() {
        assert!(norm(&[1.0, f32::NAN, 2.0]).is_nan());
        assert!(norm(&[f32::INFINITY, f32::NAN]).is_nan());
        assert_eq!(norm(&[f32::NEG_INFINITY, 1.0]), f32::INFINITY);
    }

    #[test]
    fn every_chunk_is_computed() {
        let x: Vec<f32> = (0..2 * CHUNK + 5).map(|i| i as f32).collect();
        let mut out = vec![0.0; x.len()];
        magnitude(&[&x], &mut out);
        assert_eq!(out, x);
    }

    #[test]
    fn a_norm_that_nobody_wants_is_not_computed() {
        let (cancel, x) = (Cancel::new(), vec![2.0; CHUNK + 5]);
        let mut out = vec![0.0; x.len()];
        assert!(magnitude_unless(&[&x], &mut out, &cancel) && out == x);
        cancel.cancel();
        out.fill(0.0);
        assert!(!magnitude_unless(&[&x], &mut out, &cancel));
        assert!(out.iter().all(|&x| x == 0.0));
    }
}
