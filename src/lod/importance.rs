//! Importance of faces by the change of their scalars over time.

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
