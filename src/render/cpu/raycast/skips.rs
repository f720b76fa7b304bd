//! Whether skipping transparent cells pays.
//!
//! A ray that skips transparent cells leaves the active ones and enters them again, and each entry costs more than a step. Averaged over
//! views of a mesh, let a be the mean area of a face in the image. A cell is a closed surface of four faces: on average they cover its
//! image twice, so that 2 a rays step through it. An entry face is entered from one of its two sides: by a / 2 rays on average over
//! directions. So `c` transparent cells behind `e` entry faces save 2 a c steps and cost a e / 2 entries.

use super::entries::count_beside;
use crate::render::RenderJob;
use crate::visibility::CellSet;
use std::sync::{Arc, Weak};

/// Cost of an entry in steps: finding its start among the pixels of the face's box, sorting it, and beginning a path.
/// A least-squares fit to times and counters of 60 runs (two threads of a Xeon, a graded Delaunay mesh of a million cells, all switches on or
/// one off) gives 10.5 ± 0.7 ns of a core for a step, 13.9 ± 1.9 for the light of a visible one, and 266 ± 36 for an entry.
const STEPS_PER_ENTRY: f64 = 26.0;

/// Chooses between the active cells and all finite ones, from job to job.
#[derive(Debug, Default)]
pub(in crate::render) struct CellChoice {
    /// The active cells of the last choice, compared by pointer.
    active: Weak<CellSet>,
    is_worth_it: bool,
}

impl CellChoice {
    /// The cells that rays walk through: the active ones, or all finite ones if that is cheaper. The image is the same. Contrast-adaptive
    /// sampling needs the active ones.
    pub(in crate::render) fn cells(&mut self, job: &RenderJob) -> Arc<CellSet> {
        let Some(finite) = job.finite.as_ref().filter(|_| job.contrasts().is_empty()) else {
            return job.active.clone();
        };
        if self.active.as_ptr() != Arc::as_ptr(&job.active) || !job.skip.unchanged {
            let transparent = finite.count().saturating_sub(job.active.count());
            self.is_worth_it = is_worth_it(transparent, || count_beside(&job.mesh.topology, &job.active, finite));
            self.active = Arc::downgrade(&job.active);
        }
        if self.is_worth_it { job.active.clone() } else { finite.clone() }
    }
}

/// Whether skipping this many transparent cells pays, behind this many entry faces.
fn is_worth_it(transparent_cells: usize, entry_faces: impl FnOnce() -> usize) -> bool {
    transparent_cells > 0 && 2.0 * transparent_cells as f64 > STEPS_PER_ENTRY * 0.5 * entry_faces() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_clear_regions_are_gone_around_small_ones_and_single_cells_are_not() {
        // A ball of n^3 cells has some 6 n^2 boundary faces.
        assert!(is_worth_it(1_000_000, || 60_000));
        assert!(is_worth_it(64_000, || 9600));
        assert!(!is_worth_it(1000, || 600));
        // Single cells have four faces each.
        assert!(!is_worth_it(1000, || 4000));
        assert!(!is_worth_it(0, || unreachable!("there is nothing to go around")));
    }
}
