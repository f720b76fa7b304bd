//! The level-of-detail arrays of a field in a store.
//!
//! | array of `lod/FOLDER` | |
//! |---|---|
//! | `global` | f32 [vertices or cells of the source]: coefficient of variation of each over all steps, with the usual denominator; may be infinite |
//! | `local_N` | u64 [N, 3]: first step, end and sampled step of N intervals |
//!
//! Rankings are not stored: two million faces take 8 MB, and rankings of six intervals and the whole would take more than 64 raw steps of
//! the same mesh. They are computed in an instant from these arrays and the scalars of one step. Both arrays are derived, with a version
//! and the number of steps they cover; an array that does not match counts as missing.

use super::FieldReader;
use super::array::StoredArray;
use super::layout::{self, DERIVED_ATTRIBUTE};
use super::mesh::{ArrayWriter, column};
use crate::codec::{Chunking, ElementType};
use crate::error::FileResult;
use crate::lod::{Interval, Partition};
use crate::moments::{CovDenominator, Moments, VertexStatistics};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Group of the level of detail.
pub(super) const LOD: &str = "lod";
/// Version of the level-of-detail arrays.
const LOD_VERSION: u64 = 1;
/// Attribute with the number of steps covered.
const STEPS_ATTRIBUTE: &str = "steps";
const GLOBAL: &str = "global";

fn local(count: usize) -> String {
    format!("local_{count}")
}

/// Writes the level-of-detail arrays of a field whose steps are complete; returns the bytes of the chunks.
pub(super) fn write(root: &Path, folder: &str, moments: &Moments, statistics: &VertexStatistics) -> FileResult<u64> {
    let group = format!("{LOD}/{folder}");
    layout::write_group(root, LOD, &Map::new())?;
    layout::write_group(root, &group, &Map::new())?;
    let steps = moments.steps().len();
    let attributes = Map::from_iter([
        (DERIVED_ATTRIBUTE.to_owned(), json!(LOD_VERSION)),
        (STEPS_ATTRIBUTE.to_owned(), json!(steps)),
    ]);
    let cov = statistics.coefficient_of_variation(moments.series().range, CovDenominator::default());
    let cov: Vec<f32> = cov.into_iter().map(|c| c as f32).collect();
    let partition = Partition::default();
    let intervals = partition.intervals(steps, &[]);
    let rows: Vec<[u64; 3]> = intervals.iter().map(|i| [i.first, i.end, i.sampled].map(|n| n as u64)).collect();
    let mut to = ArrayWriter::new(root, &group);
    to.write(GLOBAL, column(&cov), ["vertex", ""], attributes.clone())?;
    to.write(&local(partition.count()), &rows, ["interval", "first_end_sampled"], attributes)?;
    Ok(to.sink.bytes)
}

impl FieldReader {
    /// The coefficient of variation of every value of a step with the usual denominator, from the import; `None` if it is missing, damaged, or of
    /// another version or number of steps.
    pub fn variation(&self) -> Option<Vec<f32>> {
        let array = self.open_lod(GLOBAL, ElementType::F32, 1)?;
        let array = array.expect_shape(&[self.stored_count() as u64]).ok()?;
        let values = array.read::<f32, 1>(&*self.series.source).ok()?.into_flattened();
        // No coefficient of variation is negative or NaN.
        values.iter().all(|&cov| cov >= 0.0).then(|| self.expanded(values))
    }

    /// The `count` intervals of the series that were chosen at import, as [`Self::variation`].
    pub fn intervals(&self, count: usize) -> Option<Vec<Interval>> {
        let array = self.open_lod(&local(count), ElementType::U64, 2)?;
        let rows = array.read::<u64, 3>(&*self.series.source).ok()?;
        let interval = |row: [u64; 3]| {
            let [first, end, sampled] = row.map(|n| usize::try_from(n).ok());
            Some(Interval { first: first?, end: end?, sampled: sampled? })
        };
        let intervals = rows.into_iter().map(interval).collect::<Option<Vec<_>>>()?;
        let mut next = 0;
        let follows =
            |i: &Interval| std::mem::replace(&mut next, i.end) == i.first && i.first <= i.sampled && i.sampled < i.end;
        let are_sound = intervals.iter().all(follows) && next == self.step_count();
        (are_sound && intervals.len() <= count.max(1)).then_some(intervals)
    }

    fn open_lod(&self, name: &str, element: ElementType, rank: usize) -> Option<StoredArray> {
        let key = format!("{LOD}/{}/{name}", self.info().folder);
        let array = StoredArray::open(&self.series.root, &key, element, Chunking::Whole, rank).ok()?;
        let number = |name: &str| array.attributes.get(name).and_then(Value::as_u64);
        let is_current =
            number(DERIVED_ATTRIBUTE) == Some(LOD_VERSION) && number(STEPS_ATTRIBUTE) == Some(self.step_count() as u64);
        is_current.then_some(array)
    }
}
