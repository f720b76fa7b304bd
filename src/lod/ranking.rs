//! Interior faces in the order in which they are drawn as the level of detail rises.

use crate::mesh::{NONE, Topology};
use crate::visibility::{IdSet, ascending_bits};
use rayon::prelude::*;

/// The interior faces of a mesh, each once, most important first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranking {
    pub(super) faces: Vec<u32>,
    pub(super) face_count: usize,
}

impl Ranking {
    /// Ascending by a hash of the id: every subset is spread evenly over the mesh. Deterministic.
    pub fn by_hash(topology: &Topology) -> Self {
        let Self { faces, face_count } = Self::unordered(topology);
        Self { faces: sorted(&faces, hash), face_count }
    }

    /// Descending by `importance`, one number for each face ([`importance`](super::importance())); ties by hash. NaN counts as 0.
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

    /// In id order: for a level that draws all of them.
    pub fn unordered(topology: &Topology) -> Self {
        let interior = (0u32..).zip(&topology.face_cells).filter(|(_, cells)| cells[1] != NONE);
        Self { faces: interior.map(|(face, _)| face).collect(), face_count: topology.faces.len() }
    }

    /// A sample with `density` as relative density: the first n faces are those with density above a threshold times a random number (order
    /// sampling; B. Rosen, "On sampling with probability proportional to size", J. Statistical Planning and Inference 62, 1997). The random
    /// numbers are stratified: ids follow the mesh along a curve, and of any aligned 2^m neighbours in the list, about the same number is
    /// in the sample, chosen at random (the radical inverse of the index, with its digits scrambled: B. Burley, "Practical hash-based Owen
    /// scrambling", JCGT 9(4), 2020; scrambled by the higher digits of the index, since neighbours in the list share a vertex and are
    /// sorted, so that every second would be all of one kind). Faces without a positive density come last. Deterministic.
    ///
    /// # Panics
    /// If there is not one density for each face of `topology`.
    pub fn by_density(topology: &Topology, density: &[f32]) -> Self {
        assert_eq!(density.len(), topology.faces.len(), "one density per face");
        let Self { faces, face_count } = Self::unordered(topology);
        let key = |place: u32| {
            let density = density[faces[place as usize] as usize];
            let key = (f64::from(scrambled(place.reverse_bits())) + 0.5) / f64::from(density);
            if density > 0.0 { ascending_bits(key as f32) } else { u32::MAX }
        };
        let places: Vec<u32> = (0..faces.len() as u32).collect();
        let order = sorted(&places, key);
        Self { faces: order.into_iter().map(|place| faces[place as usize]).collect(), face_count }
    }

    /// The faces, most important first.
    pub fn faces(&self) -> &[u32] {
        &self.faces
    }

    /// Number of faces of the mesh, those of its surface included.
    pub fn universe(&self) -> usize {
        self.face_count
    }
}

/// Sorts ids (fewer than 2^32) stably by a key.
fn sorted(ids: &[u32], key: impl Fn(u32) -> u32 + Sync) -> Vec<u32> {
    let word = |(at, &id): (usize, &u32)| u64::from(key(id)) << 32 | at as u64;
    let mut words: Vec<u64> = ids.par_iter().enumerate().with_min_len(1 << 14).map(word).collect();
    words.par_sort_unstable();
    words.par_iter().with_min_len(1 << 14).map(|&word| ids[word as u32 as usize]).collect()
}

/// Hash of a face id, distinct for each: the finalizer of MurmurHash3 (A. Appleby), a bijection.
pub(super) fn hash(face: u32) -> u32 {
    // The finalizer maps 0 to 0; here another number does.
    let mut h = face ^ 0x9E37_79B9;
    h = (h ^ h >> 16).wrapping_mul(0x85EB_CA6B);
    h = (h ^ h >> 13).wrapping_mul(0xC2B2_AE35);
    h ^ h >> 16
}

/// Flips each bit by a hash of those below it (the permutation of Burley 2020, listing 3, after S. Laine and T. Karras).
fn scrambled(bits: u32) -> u32 {
    let mut x = bits.wrapping_add(0x1234_5678);
    for factor in [0x6C50_B47C, 0xB82F_1E52, 0xC7AF_E638, 0x8D22_F6E6u32] {
        x ^= x.wrapping_mul(factor);
    }
    x
}

/// Number of faces, out of `count`, at a level of detail of `fraction` (0 to 1; NaN counts as 1).
pub(super) fn share(fraction: f64, count: usize) -> usize {
    let fraction = if fraction.is_nan() { 1.0 } else { fraction.clamp(0.0, 1.0) };
    // Exact within 2^53; the cast cannot exceed the count.
    (fraction * count as f64).round() as usize
}

/// Share (0 to 1) of the faces drawn at a level of detail that differ between rankings `a` and `b`: what flickers when one replaces the
/// other. 0 if there are none.
///
/// # Panics
/// If the rankings are of meshes with different numbers of faces.
pub fn list_change(a: &Ranking, b: &Ranking, fraction: f64) -> f64 {
    assert_eq!((a.face_count, a.faces.len()), (b.face_count, b.faces.len()), "rankings of one mesh");
    let count = share(fraction, a.faces.len());
    if count == 0 {
        return 0.0;
    }
    let mut drawn = IdSet::none(a.face_count);
    a.faces[..count].iter().for_each(|&face| drawn.set(face, true));
    let others = b.faces[..count].iter().filter(|&&face| !drawn.contains(face)).count();
    others as f64 / count as f64
}
