//! The order in which a series' faces are drawn at a level of detail.

use super::kept::{Key, Rankings};
use super::series::Series;
use crate::error::FileResult;
use crate::lod::{Interval, Partition, Ranking, cell_density, importance, interval_at, sampling_density, step_change};
use crate::moments::{CovDenominator, Moments};
use crate::store::FieldReader;
use crate::task::Cancel;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, PoisonError};

/// How faces are ranked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sampling {
    /// At random, more densely where omitted faces show: one ranking for all steps ([`sampling_density`]).
    #[default]
    Error,
    /// At random.
    Random,
    /// By how much their scalars change over time: one ranking for all steps (dissertation 6.1.4.2).
    Global(CovDenominator),
    /// By strata of the scalars of one step in each interval (dissertation 6.1.4.1).
    Local(Partition),
}

impl Sampling {
    /// The measure of importance by which cells are sampled that are drawn as points: that of faces, or none.
    pub fn importance(self) -> Option<CovDenominator> {
        match self {
            Self::Global(denominator) => Some(denominator),
            Self::Error | Self::Random | Self::Local(_) => None,
        }
    }
}

impl FromStr for Sampling {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, count) = text.split_once(':').map_or((text, None), |(name, count)| (name, Some(count)));
        let no_number = || format!("'{text}': after the colon comes the number of intervals, 1 or more");
        let count = count.map(|n| n.parse().ok().filter(|&n: &usize| n > 0).ok_or_else(no_number)).transpose()?;
        let intervals = count.unwrap_or(Partition::USUAL);
        match name {
            "regular" => Ok(Self::Local(Partition::Regular(intervals))),
            "logarithmic" => Ok(Self::Local(Partition::Logarithmic(intervals))),
            "greedy" => Ok(Self::Local(Partition::Greedy(intervals))),
            "error" | "random" | "global" | "plain" if count.is_some() => {
                Err(format!("'{name}' is one ranking for all steps; leave ':' out"))
            }
            "error" => Ok(Self::Error),
            "random" => Ok(Self::Random),
            "global" => Ok(Self::Global(CovDenominator::default())),
            "plain" => Ok(Self::Global(CovDenominator::Plain)),
            _ => Err(format!(
                "there is no sampling '{text}'; choose error, random, global, plain, regular, logarithmic or greedy, the \
                 last three with :N for a number of intervals"
            )),
        }
    }
}

impl fmt::Display for Sampling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, intervals) = match *self {
            Self::Error => ("error", Partition::USUAL),
            Self::Random => ("random", Partition::USUAL),
            Self::Global(CovDenominator::Plain) => ("plain", Partition::USUAL),
            Self::Global(CovDenominator::Floored { .. }) => ("global", Partition::USUAL),
            Self::Local(Partition::Regular(intervals)) => ("regular", intervals),
            Self::Local(Partition::Logarithmic(intervals)) => ("logarithmic", intervals),
            Self::Local(Partition::Greedy(intervals)) => ("greedy", intervals),
        };
        f.write_str(name)?;
        if intervals == Partition::USUAL { Ok(()) } else { write!(f, ":{intervals}") }
    }
}

/// Steps evaluated for [`Sampling::Error`], evenly spread: more change little, and take longer.
const ERROR_STEPS: usize = 16;

/// Seed of the random numbers by which cells are chosen.
const CELL_SEED: u32 = 0;

/// Most cached rankings: four bytes per face or cell each.
const MOST: usize = 8;

impl Series {
    /// The ranking of the faces at a step, the same [`Arc`] for all steps that share it. A ranking is computed when first asked for, which
    /// takes about a tenth of a second per million cells, or as long as decoding the whole series ([`Partition::Greedy`], or a store
    /// without statistics). Eight rankings are cached. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If a step that is needed cannot be decoded.
    pub fn ranking(&self, step: usize, sampling: Sampling, cancel: &Cancel) -> FileResult<Option<Arc<Ranking>>> {
        let mut kept = self.rankings.lock().unwrap_or_else(PoisonError::into_inner);
        let key = match sampling {
            Sampling::Error => Key::Error,
            Sampling::Random => Key::Random,
            Sampling::Global(denominator) => Key::Global(denominator),
            Sampling::Local(partition) => {
                let Some(intervals) = self.intervals_in(&mut kept, partition, cancel)? else { return Ok(None) };
                Key::Step(interval_at(&intervals, step).map_or(0, |interval| interval.sampled))
            }
        };
        self.ranking_in(&mut kept, key, cancel)
    }

    /// A sample of the cells, stratified along the curve that they follow, all alike or by their importance. It is cached as the others
    /// are. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If a step that is needed cannot be decoded.
    pub fn cell_ranking(
        &self,
        importance: Option<CovDenominator>,
        cancel: &Cancel,
    ) -> FileResult<Option<Arc<Ranking>>> {
        let mut kept = self.rankings.lock().unwrap_or_else(PoisonError::into_inner);
        self.ranking_in(&mut kept, Key::Cells(importance), cancel)
    }

    /// Any ranking, for a level of detail that draws all faces; costs no sorting.
    pub fn any_ranking(&self) -> Arc<Ranking> {
        let mut kept = self.rankings.lock().unwrap_or_else(PoisonError::into_inner);
        kept.unordered.get_or_insert_with(|| Arc::new(Ranking::unordered(&self.mesh.topology))).clone()
    }

    fn ranking_in(&self, kept: &mut Rankings, key: Key, cancel: &Cancel) -> FileResult<Option<Arc<Ranking>>> {
        if let Some(at) = kept.rankings.iter().position(|(of, _)| *of == key) {
            let found = kept.rankings.remove(at);
            let ranking = found.1.clone();
            kept.rankings.push(found);
            return Ok(Some(ranking));
        }
        let topology = &self.mesh.topology;
        let ranking = match key {
            Key::Error => {
                let Some((scalars, steps)) = self.spread_steps(cancel)? else { return Ok(None) };
                Ranking::by_density(topology, &sampling_density(&self.mesh, &scalars, steps))
            }
            Key::Random => Ranking::by_hash(topology),
            Key::Global(denominator) => {
                let Some(variation) = self.variation(denominator, cancel)? else { return Ok(None) };
                Ranking::by_importance(topology, &importance(topology, &self.at_vertices(variation)))
            }
            Key::Cells(None) => Ranking::of_cells(topology.tets.len(), CELL_SEED),
            Key::Cells(Some(denominator)) => {
                let Some(variation) = self.variation(denominator, cancel)? else { return Ok(None) };
                Ranking::of_cells_by_density(&cell_density(topology, &self.at_vertices(variation)), CELL_SEED)
            }
            Key::Step(step) => {
                let mut scalars = vec![0.0; self.scalar_count()];
                if !self.decode_step(step, &mut scalars, cancel)? {
                    return Ok(None);
                }
                let scalars = self.at_vertices(scalars);
                kept.by_hash.get_or_insert_with(|| Arc::new(Ranking::by_hash(topology))).in_strata(topology, &scalars)
            }
        };
        if kept.rankings.len() == MOST {
            kept.rankings.remove(0);
        }
        let ranking = Arc::new(ranking);
        kept.rankings.push((key, ranking.clone()));
        Ok(Some(ranking))
    }

    /// The intervals of a partition of the series. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// As [`Self::ranking`].
    pub fn intervals(&self, partition: Partition, cancel: &Cancel) -> FileResult<Option<Arc<[Interval]>>> {
        let mut kept = self.rankings.lock().unwrap_or_else(PoisonError::into_inner);
        self.intervals_in(&mut kept, partition, cancel)
    }

    fn intervals_in(
        &self,
        kept: &mut Rankings,
        partition: Partition,
        cancel: &Cancel,
    ) -> FileResult<Option<Arc<[Interval]>>> {
        if let Some((of, intervals)) = &kept.intervals
            && *of == partition
        {
            return Ok(Some(intervals.clone()));
        }
        let stored = match partition {
            Partition::Regular(count) => self.source.reader().and_then(|reader| reader.intervals(count)),
            _ => None,
        };
        let steps = self.times.len();
        let intervals = match (stored, partition) {
            (Some(intervals), _) => intervals,
            (None, Partition::Greedy(_)) => {
                let mut changes = Vec::with_capacity(steps);
                let mut before = Vec::new();
                let whole = self.for_each_step(cancel, |values| {
                    changes.push(step_change(&before, values));
                    before.clear();
                    before.extend_from_slice(values);
                })?;
                if !whole {
                    return Ok(None);
                }
                partition.intervals(steps, &changes)
            }
            (None, _) => partition.intervals(steps, &[]),
        };
        let intervals: Arc<[Interval]> = intervals.into();
        kept.intervals = Some((partition, intervals.clone()));
        Ok(Some(intervals))
    }

    /// The scalars of some steps from first to last at the vertices, vertex by vertex, and the number of these steps. `None` if `cancel` was raised.
    fn spread_steps(&self, cancel: &Cancel) -> FileResult<Option<(Vec<f32>, usize)>> {
        let (last, vertices) = (self.times.len().saturating_sub(1), self.mesh.positions.local.len());
        let count = self.times.len().min(ERROR_STEPS);
        let mut scalars = vec![0.0; count * vertices];
        for place in 0..count {
            let mut values = vec![0.0; self.scalar_count()];
            if !self.decode_step(place * last / (count - 1).max(1), &mut values, cancel)? {
                return Ok(None);
            }
            let values = self.at_vertices(values);
            scalars[place..].iter_mut().step_by(count).zip(&values).for_each(|(to, &value)| *to = value);
        }
        Ok(Some((scalars, count)))
    }

    /// Coefficients of variation of the scalars: from the store, its statistics, or all steps.
    pub(super) fn variation(&self, denominator: CovDenominator, cancel: &Cancel) -> FileResult<Option<Vec<f32>>> {
        if denominator == CovDenominator::default()
            && let Some(stored) = self.source.reader().and_then(FieldReader::variation)
        {
            return Ok(Some(stored));
        }
        // Damaged statistics are computed again.
        let stored = self.source.reader().and_then(|reader| reader.statistics().ok().flatten());
        let statistics = match stored {
            Some(statistics) => statistics,
            None => {
                let mut moments = Moments::new(self.scalar_count());
                if !self.for_each_step(cancel, |values| _ = moments.add_step(values))? {
                    return Ok(None);
                }
                moments.vertex_statistics()
            }
        };
        let cov = statistics.coefficient_of_variation(self.field.range, denominator);
        Ok(Some(cov.into_iter().map(|c| c as f32).collect()))
    }

    /// Passes every step to `take`; whether it finished before `cancel` was raised.
    fn for_each_step(&self, cancel: &Cancel, mut take: impl FnMut(&[f32])) -> FileResult<bool> {
        let mut values = vec![0.0; self.scalar_count()];
        for step in 0..self.times.len() {
            if !self.decode_step(step, &mut values, cancel)? {
                return Ok(false);
            }
            take(&values);
        }
        Ok(true)
    }
}
