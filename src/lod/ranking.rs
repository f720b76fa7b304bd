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
        let Self { faces, face_count } = Self::unordered(topology);
        Self { faces: sorted(&faces, hash), face_count }
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

    /// In the order of their ids: for a level that draws all of them.
    pub fn unordered(topology: &Topology) -> Self {
        let interior = (0u32..).zip(&topology.face_cells).filter(|(_, cells)| cells[1] != NONE);
        Self { faces: interior.map(|(face, _)| face).collect(), face_count: topology.faces.len() }
    }

    /// A sample that is as dense everywhere as `density` says, relative to elsewhere: the first n faces are those with
    /// density above a threshold times chance (order sampling; B. Rosen, "On sampling with probability proportional to size",
    /// J. Statistical Planning and Inference 62, 1997). Chance is stratified: ids follow the mesh along a curve, and of any 2^m
    /// neighbours in a row that begin at a multiple of that, about the same number is in the sample, which of them by lot (the radical inverse of the
    /// place, with its digits scrambled: B. Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020; scrambled by the
    /// digits of the place above each, since neighbours in the list are of one vertex and in an order, of which every second
    /// would be all of one kind). Faces without a positive density come last. Deterministic.
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

/// Each bit flipped or not by a hash of those below it (the permutation of Burley 2020, listing 3, after S. Laine and T. Karras).
fn scrambled(bits: u32) -> u32 {
    let mut x = bits.wrapping_add(0x1234_5678);
    for factor in [0x6C50_B47C, 0xB82F_1E52, 0xC7AF_E638, 0x8D22_F6E6u32] {
        x ^= x.wrapping_mul(factor);
    }
    x
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
