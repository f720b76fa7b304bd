//! Stored form of the codec: arrays, their shapes, and the parameters in the attributes of the field.

use super::{GROUPS, STEPS, VqOptions, group_of_step};
use crate::codec::{ArraySpec, Chunking, ElementType, ReadRange, chunk_key, read_rows};
use crate::error::{FileError, FileResult};
use serde::{Deserialize, Serialize};

/// Name of the codec and of its group.
pub const NAME: &str = "vq";
/// Most entries of a codebook.
pub const MAX_ENTRIES: usize = 1 << 16;
/// Rows of a chunk of `special`; fewer only if there are fewer in total.
pub(super) const SPECIAL_ROWS: u64 = 16_384;

/// Bytes that the dissertation counts for a field (6.2.2): v c 3 4 + c (s 64 4 + s 8 4), with c blocks of 64 steps (the
/// last may be short), and mean and both indices of four bytes each.
pub fn paper_bytes(vertices: u64, steps: u64, entries: u64) -> u64 {
    let blocks = steps.div_ceil(STEPS as u64);
    let numbers = vertices.saturating_mul(3).saturating_add(entries * (STEPS + GROUPS) as u64);
    blocks.saturating_mul(numbers).saturating_mul(size_of::<f32>() as u64)
}

/// Parameters of the codec in the attributes of a field.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct VqParameters {
    /// Entries of each codebook.
    pub entries: u64,
    /// Steps of a block, 64.
    pub block: u64,
    /// The group of each step of a block.
    pub group: Vec<u64>,
    /// Whether the array `exponent` exists.
    pub exponents: bool,
    /// Number of runs of special values.
    pub specials: u64,
    /// How codebooks were trained: `fast` or `exact`.
    pub search: String,
    /// Whether each vertex was given its own power of two whatever its values; `None` in stores of an older version, which did not record
    /// it. Ignored by decoders.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative: Option<bool>,
}

impl VqParameters {
    pub(super) fn new(options: &VqOptions, exponents: bool, specials: u64) -> Self {
        Self {
            entries: options.entries as u64,
            block: STEPS as u64,
            group: (0..STEPS).map(|j| group_of_step(j) as u64).collect(),
            exponents,
            specials,
            search: options.search.as_str().to_owned(),
            relative: Some(options.own_scales),
        }
    }

    /// Reads the attributes; a problem is returned as a message for the user.
    ///
    /// # Errors
    /// If they are not of this codec, or need a later version.
    pub fn read(attributes: &serde_json::Value) -> Result<Self, String> {
        let read: Self = serde_json::from_value(attributes.clone()).map_err(|e| format!("parameters of vq: {e}"))?;
        if !(2..=MAX_ENTRIES as u64).contains(&read.entries) {
            return Err(format!("parameters of vq: {} entries, not 2 to {MAX_ENTRIES}", read.entries));
        }
        let group: Vec<u64> = (0..STEPS).map(|j| group_of_step(j) as u64).collect();
        if read.block != STEPS as u64 || read.group != group {
            return Err(format!("parameters of vq: blocks other than {GROUPS} times {GROUPS} steps"));
        }
        Ok(read)
    }

    /// The options of the encoder; `None` if an older version did not record them.
    pub fn options(&self) -> Option<VqOptions> {
        let search = self.search.parse().ok()?;
        Some(VqOptions { entries: usize::try_from(self.entries).ok()?, search, own_scales: self.relative? })
    }

    /// Keys, below the group `group_key` of `source`, of the chunks of the last block, if it is short: those that are rewritten when steps
    /// are added. `steps` is the number of steps so far.
    pub fn unsettled_chunks(&self, source: &dyn ReadRange, group_key: &str, steps: u64) -> Vec<String> {
        if steps.is_multiple_of(STEPS as u64) {
            return Vec::new();
        }
        let block = steps / STEPS as u64;
        let key = |name: &str, row: u64, rank: usize| chunk_key(&format!("{NAME}/{name}"), row, rank);
        let mut keys = vec![key("mean", block, 2), key("i8", block, 2), key("i64", block, 2)];
        keys.extend([key("cb8", block, 3), key("cb64", block, 3), key("exponent", block, 2)]);
        if self.specials > 0 {
            let starts = self.special_starts(source, &format!("{group_key}/{NAME}"), steps);
            // Damage is reported when decoding.
            let start = starts.ok().and_then(|starts| starts.get(block as usize).copied()).unwrap_or(0);
            let rows = self.special_rows();
            keys.push(key("special_start", 0, 1));
            keys.extend((start / rows..self.specials.div_ceil(rows)).map(|chunk| key("special", chunk, 2)));
        }
        keys.into_iter().map(|key| format!("{group_key}/{key}")).collect()
    }

    /// Where the rows of each block begin in `special`, for `steps` steps, and the end of the last; empty if there are none.
    pub(super) fn special_starts(&self, source: &dyn ReadRange, vq_key: &str, steps: u64) -> FileResult<Vec<u64>> {
        if self.specials == 0 {
            return Ok(Vec::new());
        }
        let key = chunk_key(&format!("{vq_key}/special_start"), 0, 1);
        let starts = read_rows::<u64, 1>(source, &key, steps.div_ceil(STEPS as u64) + 1)?.into_flattened();
        if starts.is_sorted() && starts.last().is_some_and(|&end| end <= self.specials) {
            return Ok(starts);
        }
        Err(FileError::invalid(source.path(&key), "chunk", "holds no ranges of rows").remedy("import the series again"))
    }

    /// Rows of a chunk of `special`.
    pub(super) fn special_rows(&self) -> u64 {
        self.specials.min(SPECIAL_ROWS)
    }

    /// The arrays of a field with this many steps and vertices.
    pub fn arrays(&self, steps: u64, vertices: u64) -> Vec<ArraySpec> {
        let blocks = steps.div_ceil(STEPS as u64);
        let array = |name: &str, element, shape: Vec<u64>, chunking, axes| ArraySpec {
            name: format!("{NAME}/{name}"),
            element,
            shape,
            chunking,
            axes,
        };
        let index = if self.entries <= 256 { ElementType::U8 } else { ElementType::U16 };
        let per_vertex =
            |name, element| array(name, element, vec![blocks, vertices], Chunking::PerRow, vec!["block", "vertex"]);
        let codebook = |name, rows: usize, axis| {
            let shape = vec![blocks, rows as u64, self.entries];
            array(name, ElementType::F32, shape, Chunking::PerRow, vec!["block", axis, "entry"])
        };
        let mut arrays = vec![
            per_vertex("mean", ElementType::F32),
            per_vertex("i8", index),
            per_vertex("i64", index),
            codebook("cb8", GROUPS, "group"),
            codebook("cb64", STEPS, "step"),
        ];
        if self.exponents {
            arrays.push(per_vertex("exponent", ElementType::I8));
        }
        if self.specials > 0 {
            let axes = vec!["run", "vertex_first_count_bits"];
            let chunking = Chunking::Rows(self.special_rows());
            arrays.push(array("special", ElementType::U32, vec![self.specials, 4], chunking, axes));
            let axes = vec!["block"];
            arrays.push(array("special_start", ElementType::U64, vec![blocks + 1], Chunking::Whole, axes));
        }
        arrays
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 6.1: name, thousands of vertices, steps, entries, size, compressed size, ratio, decimals of the two sizes.
    #[test]
    fn the_papers_formula_reproduces_the_rows_of_its_table() {
        const KI: f64 = 1024.0;
        const MI: f64 = KI * KI;
        let printed = |value: f64, decimals: usize| format!("{value:.decimals$}");
        // Thousands are 1024, as the sizes tell.
        for (name, thousands, steps, size, compressed, ratio) in [
            ("SPX1", 36u64, 64u64, "9.0", "504K", "18.3"),
            ("SPX2", 162, 64, "40.5", "2.0M", "20.6"),
            ("Blunt", 40, 64, "10.0", "552K", "18.6"),
            ("Torso", 8, 360, "11.2", "1.0M", "11.4"),
        ] {
            let vertices = thousands * 1024;
            let raw = (vertices * steps * 4) as f64;
            let bytes = paper_bytes(vertices, steps, 256) as f64;
            // 11.25 is printed as 11.2: halves are cut, which the formatting (to even) does as well.
            assert_eq!(printed(raw / MI, 1), size, "{name}");
            let text = match compressed.ends_with('K') {
                true => printed(bytes / KI, 0) + "K",
                false => printed(bytes / MI, 1) + "M",
            };
            assert_eq!(text, compressed, "{name}");
            assert_eq!(printed(raw / bytes, 1), ratio, "{name}");
        }
    }

    #[test]
    fn two_rows_of_the_table_contradict_the_formula_as_documented() {
        const MI: f64 = 1024.0 * 1024.0;
        // SPXF: 7.1 at 2.0M needs four blocks; 192 steps are three.
        let raw = (19 * 1024 * 192 * 4) as f64;
        assert_eq!(format!("{:.1}", raw / paper_bytes(19 * 1024, 256, 1024) as f64), "7.1");
        assert_eq!(format!("{:.1}", raw / paper_bytes(19 * 1024, 192, 1024) as f64), "9.4");
        // TJet: 2.7M counts the values per vertex of one block only, beside three codebooks.
        let vertices = 160 * 1024;
        let printed = (vertices * 12 + 3 * 1024 * 72 * 4) as f64;
        assert_eq!(format!("{:.1} {:.1}", printed / MI, (vertices * 150 * 4) as f64 / printed), "2.7 34.5");
        let formula = paper_bytes(vertices, 150, 1024) as f64;
        assert_eq!(format!("{:.1}", (vertices * 150 * 4) as f64 / formula), "14.5");
    }

    #[test]
    fn parameters_of_other_codecs_or_versions_are_refused() {
        let good = VqParameters::new(&VqOptions::default(), false, 0);
        let json = serde_json::to_value(&good).unwrap();
        assert_eq!(VqParameters::read(&json), Ok(good));
        for (key, value) in [
            ("entries", serde_json::json!(0)),
            ("entries", serde_json::json!(65537)),
            ("block", serde_json::json!(32)),
            ("group", serde_json::json!([0, 1])),
            ("specials", serde_json::json!(-1)),
        ] {
            let mut bad = json.clone();
            bad[key] = value;
            assert!(VqParameters::read(&bad).is_err(), "{key}");
        }
        assert!(VqParameters::read(&serde_json::json!({})).is_err());
    }
}
