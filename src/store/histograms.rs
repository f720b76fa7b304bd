//! The histograms of a field, in a store.
//!
//! | array of `fields/FOLDER/histograms` | u64 counts |
//! |---|---|
//! | `scalar`, `cov` | [256] |
//! | `scalar_gradient`, `scalar_cov` | [64, 256]: y, x |
//!
//! What they count, and where bins lie, says [`crate::histograms`]; the attributes `x_range` and `y_range` are the ends of the axes
//! (`null` if there is no finite value, and for the `y` of one that has none), `nonfinite` the samples that are in no bin.
//!
//! They count what the store gives back, not what the source had: with codec `vq` the values as they are shown, whatever the
//! scalar's range over the source leaves out being in the bins at its ends. So those of an import and those counted later are
//! the same. Version 2 of `cov`: the last edge is a quarter of an octave, as that of the `y` of `scalar_cov`; of version 1, where it was a
//! sixteenth, the counts are moved. An import counts when all steps are written (but not that of a source that is opened: nobody waits
//! for them); to add steps removes them, because ranges grow and coefficients of
//! variation change, and with them the bin of every sample. They are derived: with a version and the number of steps, and whatever
//! is missing, damaged or of another version or number is counted when it is asked for.

use super::array::StoredArray;
use super::field::{Series, StoredField};
use super::folder::Folder;
use super::layout::{self, DERIVED_ATTRIBUTE, FIELDS, Storage};
use super::mesh::{ArrayWriter, column};
use super::{FieldReader, StoreWriter, components_of, open_fields};
use crate::codec::{Chunking, ElementType};
use crate::error::FileResult;
use crate::histograms::{Histogram, Kind, Ranges, of_series};
use crate::mesh::Mesh;
use crate::moments::{AxisScale, CovDenominator, Histogram1d, Moments};
use crate::task::{Cancel, Progress};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::Arc;

/// Group of the histograms of a field.
pub(super) const HISTOGRAMS: &str = "histograms";
/// Version of what is counted and of the bins.
const HISTOGRAMS_VERSION: u64 = 1;
/// The same, of octaves along x; of version 1 these ended with the bin of the greatest value.
const OCTAVES_VERSION: u64 = 2;
const STEPS: &str = "steps";
const NONFINITE: &str = "nonfinite";
const AXES: [&str; 2] = ["x_range", "y_range"];

impl FieldReader {
    /// The histograms of the whole series, one for each of [`Kind::ALL`]: those of the store, or, if it has none of this
    /// version and of these steps, counted now, which takes as long as decoding every step and some ten nanoseconds a cell
    /// and step. `mesh` is that of the store. `None` if `cancel` was raised.
    ///
    /// # Errors
    /// If there are none and a step cannot be decoded.
    ///
    /// # Panics
    /// If `mesh` is another one.
    pub fn histograms(&self, mesh: &Mesh, cancel: &Cancel) -> FileResult<Option<Vec<Histogram>>> {
        match self.stored_histograms() {
            Some(histograms) => Ok(Some(histograms)),
            None => self.count_histograms(&Kind::ALL, mesh, cancel),
        }
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
        let Some(cov) = self.coefficients_of_variation(cancel)? else { return Ok(None) };
        of_series(kinds, mesh, &cov, self.info().range, self.step_count(), |step, out| {
            Ok(self.decode_step_unless(step, None, out, cancel)?.is_some())
        })
    }

    /// Those that the store has, if it has all of them.
    pub fn stored_histograms(&self) -> Option<Vec<Histogram>> {
        Kind::ALL.iter().map(|kind| self.stored_histogram(kind)).collect()
    }

    fn stored_histogram(&self, kind: &Kind<'_>) -> Option<Histogram> {
        let key = format!("{FIELDS}/{}/{HISTOGRAMS}/{}", self.info().folder, kind.name());
        let rank = kind.axes().count();
        let array = StoredArray::open(&self.root, &self.storage, &key, ElementType::U64, Chunking::Whole, rank).ok()?;
        let number = |name: &str| array.attributes.get(name).and_then(Value::as_u64);
        let found = number(DERIVED_ATTRIBUTE)?;
        let is_known = found == version(kind) || found == HISTOGRAMS_VERSION;
        if !is_known || number(STEPS) != Some(self.step_count() as u64) {
            return None;
        }
        let [x, y] = AXES.map(|name| array.attributes.get(name));
        let empty = kind.empty([range_of(x?)?, range_of(y?)?]);
        let shape = [Kind::ROWS as u64, Histogram1d::BINS as u64];
        let array = array.expect_shape(&self.root, &shape[2 - rank..]).ok()?;
        let counts = match rank {
            1 => array.read::<u64, 1>(&self.root, &*self.source).ok()?.into_flattened(),
            _ => array.read::<u64, { Histogram1d::BINS }>(&self.root, &*self.source).ok()?.into_flattened(),
        };
        let nonfinite = array.attributes.get(NONFINITE)?.as_u64()?;
        match &empty {
            Histogram::One(h) if found < version(kind) => {
                Histogram1d::from_tight_counts(h.bins().clone(), counts, nonfinite).map(Histogram::One)
            }
            _ => empty.with_counts(counts, nonfinite),
        }
    }

    /// The coefficient of variation of every vertex with the usual denominator: that of the store, or from its statistics, or from
    /// all steps. `None` if `cancel` was raised.
    fn coefficients_of_variation(&self, cancel: &Cancel) -> FileResult<Option<Vec<f32>>> {
        if let Some(stored) = self.vertex_importance() {
            return Ok(Some(stored));
        }
        let statistics = match self.vertex_statistics().ok().flatten() {
            Some(statistics) => statistics,
            None => {
                let mut moments = Moments::new(self.vertex_count());
                let mut values = vec![0.0; self.vertex_count()];
                for step in 0..self.step_count() {
                    if self.decode_step_unless(step, None, &mut values, cancel)?.is_none() {
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

/// The version of a kind that is written.
fn version(kind: &Kind<'_>) -> u64 {
    match kind.x.scale() {
        AxisScale::Linear => HISTOGRAMS_VERSION,
        AxisScale::Octaves => OCTAVES_VERSION,
    }
}

/// A range as JSON has it: every f32 is a f64, and comes back as it went in. `None` if this is none.
fn range_of(value: &Value) -> Option<Option<[f32; 2]>> {
    if value.is_null() {
        return Some(None);
    }
    let end = |i: usize| value.get(i)?.as_f64().map(|x| x as f32).filter(|x| x.is_finite());
    let range = [end(0)?, end(1)?];
    (range[0] <= range[1]).then_some(Some(range))
}

impl StoreWriter {
    /// Counts the histograms of all fields, which must be finished, as the mesh and the times must be written. `false` if
    /// `cancel` was raised.
    ///
    /// # Errors
    /// If what was written cannot be read, or a file cannot be written.
    ///
    /// # Panics
    /// If `mesh` is another one than was written.
    pub fn write_histograms(
        &mut self,
        mesh: &Mesh,
        steps: usize,
        progress: &dyn Progress,
        cancel: &Cancel,
    ) -> FileResult<bool> {
        self.write_fields()?;
        let (root, storage) = (self.staging.path(), &self.storage);
        let source = Arc::new(Folder::new(root));
        let vertices = mesh.vertex_source.len();
        let fields = open_fields(root, storage, &source, steps as u64, vertices as u64)?;
        progress.begin("histograms", fields.len() as u64, "fields");
        let series = Series { root, storage, source: &source, steps, vertices, cache: None };
        let write_field = |field: &StoredField| {
            let reader = FieldReader::new(field.clone(), &components_of(&fields, field), &series);
            let Some(histograms) = reader.count_histograms(&Kind::ALL, mesh, cancel)? else { return Ok(false) };
            write(root, storage, &field.folder, steps, &histograms)?;
            progress.advance(1);
            Ok(true)
        };
        let whole = fields.iter().try_fold(true, |whole, field| Ok(whole && write_field(field)?));
        progress.end();
        whole
    }
}

/// Writes the histograms of [`Kind::ALL`].
fn write(root: &Path, storage: &Storage, folder: &str, steps: usize, histograms: &[Histogram]) -> FileResult<()> {
    let group = format!("{FIELDS}/{folder}/{HISTOGRAMS}");
    layout::write_group(root, storage, &group, &Map::new())?;
    let mut to = ArrayWriter::new(root, storage, &group);
    for (kind, histogram) in Kind::ALL.iter().zip(histograms) {
        let [x, y]: Ranges = histogram.ranges();
        let attributes = Map::from_iter([
            (DERIVED_ATTRIBUTE.to_owned(), json!(version(kind))),
            (STEPS.to_owned(), json!(steps)),
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
