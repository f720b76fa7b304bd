//! Deliberate slow-downs, which show that the throughput gate notices them (`cargo bench --bench gate --features slowdown -- prove`).
//!
//! Everything that the gate counts or times has a [`Slow`] and one call of [`waste`], with the units of its work. Without the feature
//! `slowdown` the call compiles to nothing. With it, the places in the environment variable `TETREEL_SLOWDOWN` (comma-separated) waste
//! instructions at their rate, in thousandths of an instruction per unit: a tenth of a counted kernel's cost, and more than the limit of a
//! timed ratio allows.

/// A place that can be slowed down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slow {
    /// A unit is a vertex.
    DecodeVq,
    /// A unit is a vertex.
    DecodeRaw,
    /// The walk in lanes; a unit is a step from cell to cell.
    Walk,
    /// The walk of one ray after the other; a unit is a step from cell to cell.
    WalkPortable,
    /// A unit is a cell of the mesh.
    Entries,
    /// Binning of faces into tiles; a unit is a face.
    Raster,
    /// Fragments of faces, put in order and composited; a unit is a fragment.
    Faces,
    /// A unit is a face.
    RadixSort,
    /// A unit is a cell.
    ActiveCells,
    /// A unit is a face of the mesh.
    LodSelection,
    /// A unit is a point of the curve from which the table is made.
    NodeTable,
    /// A unit is a point of the resulting curve.
    Ensemble,
    /// A unit is a value.
    EncodeVq,
    /// A unit is a byte of a decoded array.
    ReadVtu,
    /// A unit is a number of an array.
    ReadXdmf,
    /// A unit is a file.
    StoreChunk,
    /// Frames with all skipping; a unit is a cell.
    Skipping,
    /// The walk in lanes, as timed; a unit is a step from cell to cell.
    Lanes,
    /// Faces in wide registers, as timed; a unit is a fragment.
    FaceLanes,
    /// Decoding of codec `vq`, as timed; a unit is a vertex.
    DecodeLanes,
    /// Frames prepared while others are rendered; a unit is a cell.
    Pipelined,
    /// Frames of a share of the faces; a unit is a fragment.
    FewFaces,
    /// Early termination of opaque rays, as timed; a unit is a ray.
    OpaqueRays,
    /// A unit is a cell beyond half a million.
    LargeMeshes,
    /// A unit is a cell below fifty thousand.
    CoarseMeshes,
    /// A unit is a cell of a mesh in its first frame.
    FirstFrame,
    /// A unit is an earlier frame.
    LateFrames,
    /// A unit is a value of a step.
    Import,
}

/// Wastes the time of these units if the place is slowed down; here it never is.
#[cfg(not(feature = "slowdown"))]
#[inline(always)]
pub(crate) fn waste(_place: Slow, _units: usize) {}

/// Number of frames so far, if frames slow down over time; here they do not.
#[cfg(not(feature = "slowdown"))]
#[inline(always)]
pub(crate) fn frames_before() -> usize {
    0
}

#[cfg(feature = "slowdown")]
pub(crate) use with_feature::{frames_before, waste};

#[cfg(feature = "slowdown")]
mod with_feature {
    use super::Slow;
    use std::hint::black_box;
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

    /// Comma-separated names of the places to slow down.
    const VARIABLE: &str = "TETREEL_SLOWDOWN";

    /// Instructions per turn of the wasting loop.
    const PER_TURN: usize = 4;

    /// The places, their names in the environment variable and in the gate, and the wasted thousandths of an instruction per unit.
    const PLACES: [(Slow, &str, usize); 28] = [
        (Slow::DecodeVq, "decode_vq", 560),
        (Slow::DecodeRaw, "decode_raw", 630),
        (Slow::Walk, "walk", 41_000),
        (Slow::WalkPortable, "walk_portable", 64_000),
        (Slow::Entries, "entries", 20_000),
        (Slow::Raster, "raster", 51_000),
        (Slow::Faces, "faces", 68_000),
        (Slow::RadixSort, "radix_sort", 22_000),
        (Slow::ActiveCells, "active_cells", 4400),
        (Slow::LodSelection, "lod_selection", 6100),
        (Slow::NodeTable, "node_table", 1_200_000),
        (Slow::Ensemble, "ensemble", 650_000),
        (Slow::EncodeVq, "encode_vq", 88_000),
        (Slow::ReadVtu, "read_vtu", 9000),
        (Slow::ReadXdmf, "read_xdmf", 18_000),
        (Slow::StoreChunk, "store_chunk", 1_600_000),
        (Slow::Skipping, "skipping", 2_000_000),
        (Slow::Lanes, "lanes", 500_000),
        (Slow::FaceLanes, "face_lanes", 1_500_000),
        (Slow::DecodeLanes, "decode_lanes", 20_000),
        (Slow::Pipelined, "pipelined", 6_000_000),
        (Slow::FewFaces, "few_faces", 3_000_000),
        (Slow::OpaqueRays, "opaque_rays", 60_000_000),
        (Slow::LargeMeshes, "large_meshes", 5_000_000),
        (Slow::CoarseMeshes, "coarse_meshes", 40_000_000),
        (Slow::FirstFrame, "first_frame", 10_000_000),
        (Slow::LateFrames, "late_frames", 500_000_000),
        (Slow::Import, "import", 4_000_000),
    ];

    /// The places to slow down, and their rates.
    fn slowed() -> &'static [(Slow, usize)] {
        static SLOWED: OnceLock<Vec<(Slow, usize)>> = OnceLock::new();
        SLOWED.get_or_init(|| {
            let names = std::env::var(VARIABLE).unwrap_or_default();
            let place = |name: &str| {
                let found = PLACES.into_iter().find(|(_, known, _)| *known == name);
                assert!(found.is_some(), "{VARIABLE}: there is no place '{name}'");
                found.map(|(place, _, rate)| (place, rate))
            };
            names.split(',').filter(|name| !name.is_empty()).filter_map(place).collect()
        })
    }

    /// Wastes the time of these units if the place is slowed down.
    #[inline(never)]
    pub(crate) fn waste(place: Slow, units: usize) {
        if let Some((_, rate)) = slowed().iter().find(|(of, _)| *of == place) {
            let turns = units * rate / 1000 / PER_TURN;
            for turn in 0..turns {
                black_box(turn);
            }
        }
    }

    /// Number of frames so far: with [`Slow::LateFrames`], each is slower than the one before.
    pub(crate) fn frames_before() -> usize {
        static FRAMES: AtomicUsize = AtomicUsize::new(0);
        FRAMES.fetch_add(1, Relaxed)
    }
}
