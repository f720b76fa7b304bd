//! Interior faces in the order in which they are drawn as the level of detail rises.

use crate::mesh::{NONE, Topology};
use crate::visibility::{FaceSelection, ascending_bits};
use rayon::prelude::*;

/// The interior faces of a mesh, each once, those that matter most first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranking {
    pub(super) faces: Vec<u32>,
    pub(super) face_count: usize,
}

impl Ranking {
    /// Ascending by nothing but a hash of the id: every part of it is spread evenly over the mesh. Deterministic.
    pub fn by_hash(topology: &Topology) -> Self {
        let interior = (0u32..).zip(&topology.face_cells).filter(|(_, cells)| cells[1] != NONE);
        let ids: Vec<u32> = interior.map(|(face, _)| face).collect();
        Self { faces: sorted(&ids, hash), face_count: topology.faces.len() }
    }

    /// Descending by `importance`, one number for each face ([`importance`](super::importance())); equal ones by hash. NaN is 0.
    ///
    /// # Panics
    /// If there is not one for each face of `topology`.
    pub fn by_importance(topology: &Topology, importance: &[f32]) -> Self {
        assert_eq!(importance.len(), topology.faces.len(), "one importance per face");
        let Self { faces, face_count } = Self::by_hash(topology);
        let key = |face: u32| {
            let importance = importance[face as usize];
            !ascending_bits(if importance.is_nan() { 0.0 } else { importance + 0.0 })
        };
        Self { faces: sorted(&faces, key), face_count }
    }

    /// The faces, those that matter most first.
    pub fn faces(&self) -> &[u32] {
        &self.faces
    }

    /// Number of faces of the mesh, those of its surface included.
    pub fn universe(&self) -> usize {
        self.face_count
    }
}

/// Sorted by a key, those of one key in the order that they have (fewer than 2^32).
fn sorted(ids: &[u32], key: impl Fn(u32) -> u32 + Sync) -> Vec<u32> {
    let word = |(at, &id): (usize, &u32)| u64::from(key(id)) << 32 | at as u64;
    let mut words: Vec<u64> = ids.par_iter().enumerate().with_min_len(1 << 14).map(word).collect();
    words.par_sort_unstable();
    words.par_iter().with_min_len(1 << 14).map(|&word| ids[word as u32 as usize]).collect()
}

/// A number that looks like chance, another one for each face: the finalizer of MurmurHash3 (A. Appleby), a bijection.
pub(super) fn hash(face: u32) -> u32 {
    // It maps 0 to 0; another number does so here.
    let mut h = face ^ 0x9E37_79B9;
    h = (h ^ h >> 16).wrapping_mul(0x85EB_CA6B);
    h = (h ^ h >> 13).wrapping_mul(0xC2B2_AE35);
    h ^ h >> 16
}

/// Number of faces that a level of detail of `fraction` (0 to 1; NaN counts as 1) has of `count`.
pub(super) fn share(fraction: f64, count: usize) -> usize {
    let fraction = if fraction.is_nan() { 1.0 } else { fraction.clamp(0.0, 1.0) };
    // Within 2^53 exact; the cast cannot go beyond the count.
    (fraction * count as f64).round() as usize
}

/// How many of the faces drawn at a level of detail are others with ranking `b` than with `a`, as a share (0 to 1): what flickers
/// when one takes the place of the other. 0 if there are none.
///
/// # Panics
/// If the rankings are of meshes with different numbers of faces.
pub fn list_change(a: &Ranking, b: &Ranking, fraction: f64) -> f64 {
    assert_eq!((a.face_count, a.faces.len()), (b.face_count, b.faces.len()), "rankings of one mesh");
    let count = share(fraction, a.faces.len());
    if count == 0 {
        return 0.0;
    }
    let mut drawn = FaceSelection::default();
    drawn.clear(a.face_count);
    a.faces[..count].iter().for_each(|&face| drawn.insert(face));
    let others = b.faces[..count].iter().filter(|&&face| !drawn.contains(face)).count();
    others as f64 / count as f64
}
