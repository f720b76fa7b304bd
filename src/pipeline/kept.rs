//! What a series keeps of what was found about it: quantities, ranges of chunks, rankings of faces.

use crate::histograms::Counted;
use crate::lod::{Interval, Partition, Ranking};
use crate::moments::{CovDenominator, Distribution};
use crate::visibility::Clusters;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock};

/// Quantities of a series that do not change over time, computed when first asked for.
#[derive(Debug, Default)]
pub(super) struct Quantities {
    pub(super) cov: OnceLock<Arc<Vec<f32>>>,
    /// Histograms of the steps counted so far. Locked while some are counted: only one caller does.
    pub(super) counting: Mutex<Option<Counted>>,
    /// A copy for all others.
    pub(super) counted: Mutex<Option<Arc<Counted>>>,
    /// Locked while it is computed, so that concurrent callers wait for the result.
    pub(super) distribution: Mutex<Option<Arc<Distribution>>>,
}

/// Least and greatest scalar of each chunk of a step; NaN if a scalar of the chunk is not finite.
pub(super) type StepRanges = Arc<[[f32; 2]]>;

/// Budget in bytes for the ranges of a series, at eight per chunk and step. When it is used up, no further steps are learned: each round of
/// a loop over all steps then knows the same ones.
const BYTES_MAX: usize = 64 << 20;

/// The known ranges of a series.
#[derive(Debug)]
pub(super) struct ChunkRanges {
    pub(super) clusters: OnceLock<Arc<Clusters>>,
    /// Ranges of chunks, by step; steps beyond `bytes_max` are not kept.
    pub(super) steps: Mutex<HashMap<usize, StepRanges>>,
    pub(super) bytes_max: usize,
}

impl Default for ChunkRanges {
    fn default() -> Self {
        Self { clusters: OnceLock::new(), steps: Mutex::default(), bytes_max: BYTES_MAX }
    }
}

impl ChunkRanges {
    /// How many steps of this many scalars fit in the budget.
    pub(super) fn steps_max(&self, scalars: usize) -> usize {
        self.bytes_max / (scalars.div_ceil(Clusters::SCALARS).max(1) * size_of::<[f32; 2]>())
    }
}

/// Cache key of a ranking within a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Key {
    Error,
    Random,
    Global(CovDenominator),
    /// The step whose scalars are sampled.
    Step(usize),
    /// Of cells, by their importance if there is a measure of it.
    Cells(Option<CovDenominator>),
}

/// The cached rankings of a series, computed when first asked for.
#[derive(Debug, Default)]
pub(super) struct Rankings {
    /// The ranking that orders the faces within a stratum.
    pub(super) by_hash: Option<Arc<Ranking>>,
    pub(super) unordered: Option<Arc<Ranking>>,
    /// The partition asked for last and its intervals.
    pub(super) intervals: Option<(Partition, Arc<[Interval]>)>,
    /// Rankings by last use, the most recent at the end.
    pub(super) rankings: Vec<(Key, Arc<Ranking>)>,
}
