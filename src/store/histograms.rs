//! The stored histograms of a field.
//!
//! | array of `histograms` in a field's group | u64 counts |
//! |---|---|
//! | `scalar`, `cov` | [256] |
//! | `scalar_gradient`, `scalar_cov` | [64, 256]: y, x |
//!
//! [`crate::histograms`] defines samples and bins; the attributes `x_range` and `y_range` are the ends of the axes (`null` without a finite
//! value or a `y` axis), `nonfinite` the number of samples in no bin.
//!
//! They count decoded values: with codec `vq` the values shown, of which those outside the source's range go to the bins at its ends. So
//! histograms of an import and later ones are the same. Version 2 of `cov`: the last edge is a quarter of an octave, as for the `y` of
//! `scalar_cov`; counts of version 1, where it was a sixteenth, are moved. The first request counts all steps, and the store keeps the
//! counts if it is writable. Adding steps removes them, because ranges grow and coefficients of variation change, and with them the bin of
//! every sample. They are derived: with a version, the number of steps and a checksum of the values (`of`; older versions wrote them with
//! the steps and have none); missing, damaged or outdated ones are counted again.

use super::FieldReader;
use super::array::StoredArray;
use super::field::StoredField;
use super::layout::{self, DERIVED_ATTRIBUTE};
use super::mesh::{ArrayWriter, column};
use crate::codec::{Chunking, ElementType, StepRequest};
use crate::error::{FileError, FileResult};
use crate::files;
use crate::histograms::{Counted, Histogram, Kind, Ranges, SeriesView, of_series, spread};
use crate::mesh::Mesh;
use crate::moments::{AxisScale, CovDenominator, Histogram1d, Moments};
use crate::task::Cancel;
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;

/// Group of the histograms of a field.
pub(super) const HISTOGRAMS: &str = "histograms";
/// Version of the samples and the bins.
const HISTOGRAMS_VERSION: u64 = 1;
/// Version of kinds with octaves along x; in version 1 these ended with the bin of the greatest value.
const OCTAVES_VERSION: u64 = 2;
const STEPS: &str = "steps";
const OF: &str = "of";
const NONFINITE: &str = "nonfinite";
const AXES: [&str; 2] = ["x_range", "y_range"];

impl FieldReader {
    /// The histograms of the whole series, one for each of [`Kind::ALL`]: from the store, or, if it has none of this version and number of
    /// steps, counted now, which takes as long as decoding every step and some ten nanoseconds a cell and step, and then stored if
    /// possible. `mesh` is that of the store. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If a step has to be decoded and cannot be.
    ///
    /// # Panics
    /// If `mesh` is not that of the store.
    pub fn histograms(&self, mesh: &Mesh, cancel: &Cancel) -> FileResult<Option<Vec<Histogram>>> {
        let mut counted = None;
        let is_whole = self.go_on_counting(&mut counted, mesh, cancel, &mut |_| true)?;
        Ok(counted.filter(|_| is_whole).map(|counted| counted.histograms.to_vec()))
    }

    /// Counts the histograms of [`Self::histograms`] step by step, from coarse to fine ([`spread`]): `told` is called after each step with
    /// those of the steps so far, and returns whether to go on. `counted` is `None` at first, and what a call leaves there is where the next
    /// one goes on: when it was cancelled, told to stop, or failed. Stored ones are there at once. Returns whether all steps are counted; if
    /// the store could not keep them, `counted` says why.
    ///
    /// # Errors
    /// If a step cannot be decoded.
    ///
    /// # Panics
    /// If `mesh` is not that of the store, or `counted` is of another series.
    pub fn go_on_counting(
        &self,
        counted: &mut Option<Counted>,
        mesh: &Mesh,
        cancel: &Cancel,
        told: &mut dyn FnMut(&Counted) -> bool,
    ) -> FileResult<bool> {
        if counted.is_none()
            && let Some(stored) = self.stored_histograms()
        {
            *counted = Some(Counted::whole(stored, self.step_count()));
        }
        if counted.as_ref().is_some_and(Counted::is_whole) {
            return Ok(true);
        }
        let Some(cov) = self.coefficients_of_variation(cancel)? else { return Ok(false) };
        let (series, steps) = (self.view(mesh, &cov), self.step_count());
        let begin = || Counted::none(&Kind::ALL, &Kind::ALL.map(|kind| series.known_ranges(&kind)), steps);
        let counted = counted.get_or_insert_with(begin);
        let order = spread(steps, self.info().coding().map_or(1, |coding| coding.codec().block_steps), steps);
        let is_whole = counted.go_on(&Kind::ALL, &series, &order, self.scalars_unless(cancel), told)?;
        if is_whole && let Err(problem) = self.keep_histograms(&counted.histograms) {
            // The next one who opens the store counts them again.
            tracing::info!(%problem, "histograms are not kept");
            counted.not_kept = Some(problem.to_string());
        }
        Ok(is_whole)
    }

    fn view<'a>(&self, mesh: &'a Mesh, cov: &'a [f32]) -> SeriesView<'a> {
        SeriesView { mesh, values_of: self.info().values_of, scalar_range: self.info().range, cov }
    }

    /// Loads the scalars of a step; `false` if `cancel` was raised.
    fn scalars_unless(&self, cancel: &Cancel) -> impl FnMut(usize, &mut [f32]) -> FileResult<bool> {
        |step, out| Ok(self.decode_step_unless(StepRequest::whole(step, cancel), out)?.is_some())
    }

    /// Stores histograms of [`Kind::ALL`], replacing old ones. They are written to a temporary folder and moved.
    fn keep_histograms(&self, histograms: &[Histogram]) -> FileResult<()> {
        let Some(of) = self.checksum() else { return Ok(()) };
        let staging = files::sibling_folder(&self.series.root, "tmp")?;
        let field = self.info().group();
        write(staging.path(), &field, (self.step_count(), of), histograms)?;
        // Another series in the place of this one must not get them.
        self.series.source.check()?;
        let key = format!("{field}/{HISTOGRAMS}");
        let (new, kept) = (staging.path().join(&key), self.series.root.join(&key));
        if fs::rename(&new, &kept).is_ok() {
            return Ok(());
        }
        // A rename does not replace a folder that is not empty.
        let old = staging.path().join("old");
        fs::rename(&kept, old).map_err(|e| FileError::io(&kept, "move", &e))?;
        fs::rename(&new, &kept).map_err(|e| FileError::io(&kept, "write", &e))
    }

    /// A checksum of the values of all steps and of their coding; `None` if the store lacks theirs.
    fn checksum(&self) -> Option<u32> {
        let own = std::iter::once(self.info()).filter(|field| field.magnitude_of.is_empty());
        let mut checksum = 0;
        for field in own.chain(self.components()) {
            let StoredField { checksums, codec, codec_parameters, .. } = field;
            checksum = crc32c::crc32c_append(checksum, bytemuck::cast_slice(checksums.as_ref()?));
            checksum = crc32c::crc32c_append(checksum, format!("{codec}{codec_parameters}").as_bytes());
        }
        Some(checksum)
    }

    /// Counts histograms of any kinds over the whole series, as [`Self::histograms`].
    ///
    /// # Errors
    /// If a step cannot be decoded.
    ///
    /// # Panics
    /// If `mesh` is not that of the store.
    pub fn count_histograms(
        &self,
        kinds: &[Kind<'_>],
        mesh: &Mesh,
        cancel: &Cancel,
    ) -> FileResult<Option<Vec<Histogram>>> {
        let cov =
            if kinds.iter().any(Kind::needs_cov) { self.coefficients_of_variation(cancel)? } else { Some(Vec::new()) };
        let Some(cov) = cov else { return Ok(None) };
        of_series(kinds, &self.view(mesh, &cov), self.step_count(), self.scalars_unless(cancel))
    }

    /// The stored histograms; `None` unless all kinds are there.
    pub fn stored_histograms(&self) -> Option<Vec<Histogram>> {
        Kind::ALL.iter().map(|kind| self.stored_histogram(kind)).collect()
    }

    fn stored_histogram(&self, kind: &Kind<'_>) -> Option<Histogram> {
        let key = format!("{}/{HISTOGRAMS}/{}", self.info().group(), kind.name());
        let rank = kind.axes().count();
        let array = StoredArray::open(&self.series.root, &key, ElementType::U64, Chunking::Whole, rank).ok()?;
        let number = |name: &str| array.attributes.get(name).and_then(Value::as_u64);
        let found = number(DERIVED_ATTRIBUTE)?;
        let is_known = found == version(kind) || found == HISTOGRAMS_VERSION;
        let is_of_values = array.attributes.get(OF).is_none_or(|of| of.as_u64() == self.checksum().map(u64::from));
        if !is_known || !is_of_values || number(STEPS) != Some(self.step_count() as u64) {
            return None;
        }
        let [x, y] = AXES.map(|name| array.attributes.get(name));
        let empty = kind.empty([range_of(x?)?, range_of(y?)?]);
        let shape = [Kind::ROWS as u64, Histogram1d::BINS as u64];
        let array = array.expect_shape(&shape[2 - rank..]).ok()?;
        let counts = match rank {
            1 => array.read::<u64, 1>(&*self.series.source).ok()?.into_flattened(),
            _ => array.read::<u64, { Histogram1d::BINS }>(&*self.series.source).ok()?.into_flattened(),
        };
        let nonfinite = array.attributes.get(NONFINITE)?.as_u64()?;
        match &empty {
            Histogram::One(h) if found < version(kind) => {
                Histogram1d::from_tight_counts(h.bins().clone(), counts, nonfinite).map(Histogram::One)
            }
            _ => empty.with_counts(counts, nonfinite),
        }
    }

    /// The coefficient of variation of every value of a step with the usual denominator: from the store, its statistics, or all steps. `None` if
    /// `cancel` was raised.
    fn coefficients_of_variation(&self, cancel: &Cancel) -> FileResult<Option<Vec<f32>>> {
        if let Some(stored) = self.variation() {
            return Ok(Some(stored));
        }
        let statistics = match self.statistics().ok().flatten() {
            Some(statistics) => statistics,
            None => {
                let mut moments = Moments::new(self.value_count());
                let mut values = vec![0.0; self.value_count()];
                for step in 0..self.step_count() {
                    if self.decode_step_unless(StepRequest::whole(step, cancel), &mut values)?.is_none() {
                        return Ok(None);
                    }
                    moments.add_step(&values);
                }
                moments.vertex_statistics()
            }
        };
        let cov = statistics.coefficient_of_variation(self.info().range, CovDenominator::default());
        Ok(Some(cov.into_iter().map(|c| c as f32).collect()))
    }
}

/// The version that is written for a kind.
fn version(kind: &Kind<'_>) -> u64 {
    match kind.x.scale() {
        AxisScale::Linear => HISTOGRAMS_VERSION,
        AxisScale::Octaves => OCTAVES_VERSION,
    }
}

/// A range from JSON: every f32 is a f64, and survives the round trip. `None` if it is invalid.
fn range_of(value: &Value) -> Option<Option<[f32; 2]>> {
    if value.is_null() {
        return Some(None);
    }
    let end = |i: usize| value.get(i)?.as_f64().map(|x| x as f32).filter(|x| x.is_finite());
    let range = [end(0)?, end(1)?];
    (range[0] <= range[1]).then_some(Some(range))
}

/// Writes the histograms of [`Kind::ALL`] with the number of steps and the checksum.
fn write(root: &Path, field: &str, (steps, of): (usize, u32), histograms: &[Histogram]) -> FileResult<()> {
    let group = format!("{field}/{HISTOGRAMS}");
    layout::write_group(root, &group, &Map::new())?;
    let mut to = ArrayWriter::new(root, &group);
    for (kind, histogram) in Kind::ALL.iter().zip(histograms) {
        let [x, y]: Ranges = histogram.ranges();
        let attributes = Map::from_iter([
            (DERIVED_ATTRIBUTE.to_owned(), json!(version(kind))),
            (STEPS.to_owned(), json!(steps)),
            (OF.to_owned(), json!(of)),
            (NONFINITE.to_owned(), json!(histogram.nonfinite())),
            (AXES[0].to_owned(), json!(x)),
            (AXES[1].to_owned(), json!(y)),
        ]);
        match histogram {
            Histogram::One(h) => to.write(&kind.name(), column(h.counts()), ["x_bin", ""], attributes)?,
            Histogram::Two(h) => {
                let (rows, _) = h.counts().as_chunks::<{ Histogram1d::BINS }>();
                to.write(&kind.name(), rows, ["y_bin", "x_bin"], attributes)?;
            }
        }
    }
    Ok(())
}
