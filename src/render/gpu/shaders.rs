//! The shaders, composed from their parts. The only place that knows which parts a stage is made of.

use crate::optics::OpticsKind;
use std::fmt;

/// A stage of the ray caster: one entry point in one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// A step from its compressed block.
    DecodeVq,
    /// Vertices to view coordinates.
    ViewTransform,
    /// Items that meet each tile.
    EntriesCount,
    /// From counts to places.
    EntriesScan,
    /// The items of each tile.
    EntriesStore,
    /// From entries through the cells.
    Walk(OpticsKind),
    /// To where a window samples it.
    Present,
}

/// All stages.
pub const STAGES: [Stage; 8] = [
    Stage::DecodeVq,
    Stage::ViewTransform,
    Stage::EntriesCount,
    Stage::EntriesScan,
    Stage::EntriesStore,
    Stage::Walk(OpticsKind::Exact),
    Stage::Walk(OpticsKind::Table3d),
    Stage::Present,
];

/// How the records of cells are split over bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordSplit {
    /// Bindings in use, 1 to [`RECORD_PARTS_MAX`].
    pub parts: u32,
    /// Cells of a binding: 2 to this.
    pub shift: u32,
}

/// Bindings that a shader has for the records of cells.
pub const RECORD_PARTS_MAX: u32 = 3;

/// Bytes of a cell's record: four vertices, four neighbours.
pub const RECORD_BYTES: u64 = 32;

impl RecordSplit {
    /// How `cells` records are split if a binding holds at most `binding_bytes`; `None` if they do not fit.
    pub fn new(cells: usize, binding_bytes: u64) -> Option<Self> {
        let shift = (binding_bytes / RECORD_BYTES).checked_ilog2()?.min(30);
        let parts = u32::try_from(cells.div_ceil(1 << shift)).ok()?.max(1);
        (parts <= RECORD_PARTS_MAX).then_some(Self { parts, shift })
    }

    /// The cells of part `part` of a mesh of `cells` cells.
    pub fn cells_of(self, part: u32, cells: usize) -> std::ops::Range<usize> {
        let at = |part: u32| ((part as usize) << self.shift).min(cells);
        at(part)..at(part + 1)
    }
}

impl Stage {
    /// Name of the entry point and of the file.
    pub fn name(self) -> &'static str {
        match self {
            Self::DecodeVq => "decode_vq",
            Self::ViewTransform => "view_transform",
            Self::EntriesCount => "entries_count",
            Self::EntriesScan => "entries_scan",
            Self::EntriesStore => "entries_store",
            Self::Walk(_) => "walk",
            Self::Present => "present",
        }
    }

    /// The whole shader.
    pub fn source(self, split: RecordSplit) -> String {
        const FRAME: &str = include_str!("../../../shaders/lib/frame.wgsl");
        const CELLS: &str = include_str!("../../../shaders/lib/cells.wgsl");
        const BOXES: &str = include_str!("../../../shaders/lib/boxes.wgsl");
        const RAY: &str = include_str!("../../../shaders/lib/ray.wgsl");
        const MATH: &str = include_str!("../../../shaders/lib/math.wgsl");
        const EXACT: &str = include_str!("../../../shaders/lib/optics_exact.wgsl");
        const TABLE3D: &str = include_str!("../../../shaders/lib/optics_table3d.wgsl");
        let constants = Constants(split).to_string();
        let parts: &[&str] = match self {
            Self::DecodeVq => &[include_str!("../../../shaders/decode_vq.wgsl")],
            Self::ViewTransform => &[FRAME, include_str!("../../../shaders/view_transform.wgsl")],
            Self::EntriesCount => {
                &[&constants, FRAME, CELLS, BOXES, include_str!("../../../shaders/entries_count.wgsl")]
            }
            Self::EntriesScan => &[FRAME, include_str!("../../../shaders/entries_scan.wgsl")],
            Self::EntriesStore => {
                &[&constants, FRAME, CELLS, BOXES, include_str!("../../../shaders/entries_store.wgsl")]
            }
            Self::Present => &[include_str!("../../../shaders/present.wgsl")],
            Self::Walk(optics) => {
                let optics = match optics {
                    OpticsKind::Exact => EXACT,
                    OpticsKind::Table3d => TABLE3D,
                };
                &[&constants, FRAME, CELLS, RAY, MATH, optics, include_str!("../../../shaders/walk.wgsl")]
            }
        };
        parts.concat()
    }
}

/// Constants that the host decides on.
struct Constants(RecordSplit);

impl fmt::Display for Constants {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "const RECORD_PARTS: u32 = {}u;\nconst RECORD_SHIFT: u32 = {}u;", self.0.parts, self.0.shift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_split_where_a_binding_ends() {
        let mib = 1 << 20;
        let split = |cells, bytes| RecordSplit::new(cells, bytes).map(|s| (s.parts, s.shift));
        assert_eq!(split(1_000_000, 128 * mib), Some((1, 22)));
        assert_eq!(split(1 << 22, 128 * mib), Some((1, 22)));
        assert_eq!(split((1 << 22) + 1, 128 * mib), Some((2, 22)));
        assert_eq!(split(10_000_000, 128 * mib), Some((3, 22)));
        assert_eq!(split(13_000_000, 128 * mib), None);
        assert_eq!(split(13_000_000, 2048 * mib - 1), Some((1, 25)));
        assert_eq!(split(0, 128 * mib), Some((1, 22)));
        assert_eq!(split(1, 31), None);
        let split = RecordSplit { parts: 3, shift: 4 };
        assert_eq!([0, 1, 2].map(|p| split.cells_of(p, 40)), [0..16, 16..32, 32..40]);
    }
}
