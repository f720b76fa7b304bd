//! The way that the flow of a field of vectors has travelled, kept every few steps.
//!
//! `flow/FOLDER/travel` is f32 [sums, vertices or cells of the source], one chunk a sum: row k is the integral of the vectors' lengths from
//! the first step to step 8 (k + 1). FOLDER is the name of the vector's folder: that of its first component without `%3A0`.
//!
//! It is derived, with a version. The attribute `rows` has for each row a checksum of what it is the sum of (times, values of the components,
//! their coding) and one of the row itself; rows are used as far as both agree. So a store to which steps were added keeps the rows of the steps
//! before, except for those of a last short block, which is coded anew, and whoever needs more rows adds them. Rows are written by whoever
//! has made them, under the store's lock, so that nobody adds steps meanwhile.

use super::array::{StoredArray, write_metadata};
use super::field::{FieldReader, StoredField};
use super::folder::{Folder, FolderSink};
use super::layout::{self, DERIVED_ATTRIBUTE};
use super::lock::StoreLock;
use crate::codec::{ArraySpec, ChunkSink, Chunking, ElementType, chunk_key, read_chunk, to_bytes};
use crate::error::FileResult;
use crate::field::{Association, TimeAxis};
use crate::mesh::SourceCells;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use std::sync::Arc;

/// Group of what is kept of flow.
const FLOW: &str = "flow";
const TRAVEL: &str = "travel";
/// Version of the sums.
const TRAVEL_VERSION: u64 = 1;
/// Attribute with the checksums of the rows.
const ROWS: &str = "rows";

/// The checksums of a row: of what it is the sum of, and of its bytes.
type Row = [u32; 2];

/// The ways of a field of vectors, as far as its store has them.
#[derive(Clone, Debug)]
pub struct StoredTravel {
    root: PathBuf,
    source: Arc<Folder>,
    /// Its group below the root.
    group: String,
    values_of: Association,
    /// Values of a row in the store.
    count: usize,
    parts: Option<Arc<SourceCells>>,
    /// For each step a checksum of what the way until there is the sum of.
    until_step: Vec<u32>,
}

impl StoredTravel {
    /// Steps from row to row.
    pub const STEPS: usize = 8;

    /// Those of the vectors with these components, whose steps have these times. `None` if an older version has written the store, without
    /// checksums of values, or if they have other numbers of steps.
    pub fn of(components: [&FieldReader; 3], times: &TimeAxis) -> Option<Self> {
        let fields = components.map(FieldReader::info);
        let series = &components[0].series;
        // A store that grows may be opened twice.
        if components.iter().any(|of| of.series.steps != series.steps) {
            return None;
        }
        let folder = fields[0].folder.replacen("%3A0", "", 1);
        Some(Self {
            root: series.root.clone(),
            source: series.source.clone(),
            group: format!("{FLOW}/{folder}"),
            values_of: fields[0].values_of,
            count: series.count,
            parts: series.parts.clone(),
            until_step: until_steps(fields, times.values.get(..series.steps)?)?,
        })
    }

    /// Whether the first rows are sums of the same as those of another series, which may have other steps after these.
    pub fn agrees_with(&self, other: &Self, rows: usize) -> bool {
        let first = |of: &Self| of.sums_of().take(rows).collect::<Vec<u32>>();
        first(self).len() == rows && first(self) == first(other)
    }

    /// A checksum of all that the way until a step is the sum of: times, vectors and their coding; `None` if there is no such step.
    pub fn depends_on(&self, step: usize) -> Option<u32> {
        self.until_step.get(step).copied()
    }

    /// A checksum of what each row is the sum of, for each row that the series has.
    fn sums_of(&self) -> impl Iterator<Item = u32> {
        self.until_step.iter().copied().step_by(Self::STEPS).skip(1)
    }

    /// Number of rows that the store has, from the first one on.
    pub fn rows(&self) -> usize {
        self.known().len()
    }

    /// Row `row`, one way for each vertex or cell of the store's mesh, in world units of the vectors times those of time; `None` if it is
    /// missing, damaged, or not of these values.
    pub fn row(&self, row: usize) -> Option<Vec<f32>> {
        let [_, checksum] = *self.known().get(row)?;
        let mut ways = vec![0.0f32; self.count];
        read_chunk(&*self.source, &chunk_key(&format!("{}/{TRAVEL}", self.group), row as u64, 2), &mut ways).ok()?;
        // No way is negative or NaN.
        if crc32c::crc32c(&to_bytes(&ways)) != checksum || !ways.iter().all(|&way| way >= 0.0) {
            return None;
        }
        let Some(parts) = &self.parts else { return Some(ways) };
        let mut expanded = vec![0.0; parts.cells()];
        parts.expand(&ways, &mut expanded);
        Some(expanded)
    }

    /// Stores rows from `first` on, beside those that are there. Whether they could be stored: somebody may be about to change the
    /// store, or rows before be missing.
    ///
    /// # Errors
    /// If the store cannot be written, or another series has taken its place.
    pub fn keep(&self, first: usize, rows: &[Arc<Vec<f32>>]) -> FileResult<bool> {
        let Some(_lock) = StoreLock::at_once(&self.root) else { return Ok(false) };
        self.source.check()?;
        let mut known = self.known();
        if known.len() < first {
            return Ok(false);
        }
        layout::write_group(&self.root, FLOW, &Map::new())?;
        layout::write_group(&self.root, &self.group, &Map::new())?;
        let mut to = FolderSink::new(self.root.join(&self.group));
        for ((row, sum_of), ways) in (first..).zip(self.sums_of().skip(first)).zip(rows) {
            let compact: Option<Vec<f32>> =
                self.parts.as_ref().map(|parts| parts.firsts().map(|cell| ways[cell as usize]).collect());
            let bytes = to_bytes(compact.as_deref().unwrap_or(ways));
            to.put(&chunk_key(TRAVEL, row as u64, 2), &bytes)?;
            let new = [sum_of, crc32c::crc32c(&bytes)];
            match known.get_mut(row) {
                Some(known) => *known = new,
                None => known.push(new),
            }
        }
        let attributes =
            Map::from_iter([(DERIVED_ATTRIBUTE.to_owned(), json!(TRAVEL_VERSION)), (ROWS.to_owned(), json!(known))]);
        let value = match self.values_of {
            Association::Point => "vertex",
            Association::Cell => "cell",
        };
        let spec = ArraySpec {
            name: TRAVEL.to_owned(),
            element: ElementType::F32,
            shape: vec![known.len() as u64, self.count as u64],
            chunking: Chunking::PerRow,
            axes: vec!["eighth_step", value],
        };
        write_metadata(&self.root, &self.group, &spec, attributes)?;
        Ok(true)
    }

    /// The checksums of the rows that are there, from the first one on, as far as they are sums of this series.
    fn known(&self) -> Vec<Row> {
        let key = format!("{}/{TRAVEL}", self.group);
        let Ok(array) = StoredArray::open(&self.root, &key, ElementType::F32, Chunking::PerRow, 2) else {
            return Vec::new();
        };
        let rows: Option<Vec<Row>> =
            array.attributes.get(ROWS).and_then(|rows| serde_json::from_value(rows.clone()).ok());
        let is_current = array.attributes.get(DERIVED_ATTRIBUTE).and_then(Value::as_u64) == Some(TRAVEL_VERSION);
        let rows = rows.filter(|rows| is_current && array.shape == [rows.len() as u64, self.count as u64]);
        let own = rows.unwrap_or_default().into_iter().zip(self.sums_of());
        own.take_while(|([of, _], sum_of)| of == sum_of).map(|(row, _)| row).collect()
    }
}

/// For each step a checksum of all that the way until there is the sum of; `None` if the store does not know its values. The steps of a last
/// short block are coded anew when others are added: with them the number of steps counts.
fn until_steps(fields: [&StoredField; 3], times: &[f64]) -> Option<Vec<u32>> {
    let mut sum_of = 0;
    let mut add = |bytes: &[u8]| {
        sum_of = crc32c::crc32c_append(sum_of, bytes);
        sum_of
    };
    fields.iter().for_each(|of| _ = add(format!("{}{}", of.codec, of.codec_parameters).as_bytes()));
    let mut all = Vec::with_capacity(times.len());
    for (step, time) in times.iter().enumerate() {
        let mut found = add(&time.to_bits().to_le_bytes());
        for field in fields {
            let values = *field.checksums.as_ref()?.get(step)?;
            let coded_with = if step < field.settled_steps(times.len()) { 0 } else { times.len() as u64 };
            add(&values.to_le_bytes());
            found = add(&coded_with.to_le_bytes());
        }
        all.push(found);
    }
    Some(all)
}
