//! Interior faces, or cells, in the order in which they are drawn as the level of detail rises.

use crate::mesh::{NONE, Topology};
use crate::visibility::{IdSet, ascending_bits};
use rayon::prelude::*;

/// The interior faces of a mesh, or its cells, each once, most important first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ranking {
    pub(super) ids: Vec<u32>,
    pub(super) universe: usize,
}

impl Ranking {
    /// Ascending by a hash of the id: every subset is spread evenly over the mesh. Deterministic.
    pub fn by_hash(topology: &Topology) -> Self {
        let Self { ids, universe } = Self::unordered(topology);
        Self { ids: sorted(&ids, hash), universe }
    }

    /// Descending by `importance`, one number for each face ([`importance`](super::importance())); ties by hash. NaN counts as 0.
    ///
    /// # Panics
    /// If there is not one for each face of `topology`.
    pub fn by_importance(topology: &Topology, importance: &[f32]) -> Self {
        assert_eq!(importance.len(), topology.connectivity().faces.len(), "one importance per face");
        let Self { ids, universe } = Self::by_hash(topology);
        let key = |face: u32| {
            let importance = importance[face as usize];
            !ascending_bits(if importance.is_nan() { 0.0 } else { importance + 0.0 })
        };
        Self { ids: sorted(&ids, key), universe }
    }

    /// In id order: for a level that draws all of them.
    pub fn unordered(topology: &Topology) -> Self {
        let interior = (0u32..).zip(&topology.connectivity().face_cells).filter(|(_, cells)| cells[1] != NONE);
        Self { ids: interior.map(|(face, _)| face).collect(), universe: topology.connectivity().faces.len() }
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
        assert_eq!(density.len(), topology.connectivity().faces.len(), "one density per face");
        Self::unordered(topology).sampled(|face| density[face as usize], 0)
    }

    /// A sample of `cells` cells, all of one density, by the random numbers of a seed: otherwise as [`Self::by_density`].
    pub fn of_cells(cells: usize, seed: u32) -> Self {
        Self { ids: (0..cells as u32).collect(), universe: cells }.sampled(|_| 1.0, seed)
    }

    /// A sample of cells with `density` as relative density, one number for each: otherwise as [`Self::by_density`].
    pub fn of_cells_by_density(density: &[f32], seed: u32) -> Self {
        let cells = density.len();
        Self { ids: (0..cells as u32).collect(), universe: cells }.sampled(|cell| density[cell as usize], seed)
    }

    /// A sample of these ids by their densities.
    fn sampled(self, density: impl Fn(u32) -> f32 + Sync, seed: u32) -> Self {
        let Self { ids, universe } = self;
        let key = |place: u32| {
            let density = density(ids[place as usize]);
            let key = (f64::from(scrambled(place.reverse_bits(), seed)) + 0.5) / f64::from(density);
            if density > 0.0 { ascending_bits(key as f32) } else { u32::MAX }
        };
        let places: Vec<u32> = (0..ids.len() as u32).collect();
        let order = sorted(&places, key);
        Self { ids: order.into_iter().map(|place| ids[place as usize]).collect(), universe }
    }

    /// The faces or cells, most important first.
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Number of cells, or of faces, those of the surface included, of the mesh.
    pub fn universe(&self) -> usize {
        self.universe
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
fn scrambled(bits: u32, seed: u32) -> u32 {
    let mut x = bits.wrapping_add(0x1234_5678).wrapping_add(seed.wrapping_mul(0x9E37_79B9));
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
    assert_eq!((a.universe, a.ids.len()), (b.universe, b.ids.len()), "rankings of one mesh");
    let count = share(fraction, a.ids.len());
    if count == 0 {
        return 0.0;
    }
    let mut drawn = IdSet::none(a.universe);
    a.ids[..count].iter().for_each(|&face| drawn.set(face, true));
    let others = b.ids[..count].iter().filter(|&&face| !drawn.contains(face)).count();
    others as f64 / count as f64
}
