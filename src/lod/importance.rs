//! Importance of faces and cells by the change of their scalars over time.

use crate::mesh::Topology;
use rayon::prelude::*;

/// Faces per task.
const FACES_AT_ONCE: usize = 1 << 14;

/// The importance of every face (dissertation 6.1.4.2): the sum of the coefficients of variation at its three vertices, of which `vertices`
/// has one each ([`coefficient_of_variation`]). Summed in f64, rounded once.
///
/// [`coefficient_of_variation`]: crate::moments::VertexStatistics::coefficient_of_variation
///
/// # Panics
/// If there is not one coefficient for each vertex of `topology`.
pub fn importance(topology: &Topology, vertices: &[f32]) -> Vec<f32> {
    assert_eq!(vertices.len(), topology.vertex_count as usize, "one coefficient of variation per vertex");
    let sum = |face: &[u32; 3]| face.iter().map(|&v| f64::from(vertices[v as usize])).sum::<f64>() as f32;
    topology.connectivity().faces.par_iter().with_min_len(FACES_AT_ONCE).map(sum).collect()
}

/// The density of a sample of cells by importance, one number for each: the mean importance plus its own, so that half of a sample is
/// spread evenly whatever the importances are (a defensive mixture: T. Hesterberg, "Weighted average importance sampling and defensive
/// mixture distributions", Technometrics 37(2), 1995). A cell's importance is the sum of the coefficients of variation at its four
/// corners, of which `vertices` has one each; NaN and infinity count as 0. Where nothing changes all densities are one.
///
/// # Panics
/// If there is not one coefficient for each vertex of `topology`.
pub fn cell_density(topology: &Topology, vertices: &[f32]) -> Vec<f32> {
    assert_eq!(vertices.len(), topology.vertex_count as usize, "one coefficient of variation per vertex");
    let of = |v: u32| f64::from(vertices[v as usize]);
    let sum = |tet: &[u32; 4]| tet.iter().map(|&v| of(v)).filter(|of| of.is_finite()).sum::<f64>();
    let importance: Vec<f64> = topology.tets.par_iter().with_min_len(FACES_AT_ONCE).map(sum).collect();
    // In the order of cells, so that rounding does not depend on the number of threads.
    let mean = importance.iter().sum::<f64>() / importance.len().max(1) as f64;
    if !(mean > 0.0 && mean.is_finite()) {
        return vec![1.0; importance.len()];
    }
    importance.into_iter().map(|of| (1.0 + of / mean) as f32).collect()
}
