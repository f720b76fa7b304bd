//! Values at vertices, interpolated along a ray for media that need them beside depth and scalar.

use super::super::medium::Medium;
use super::ray::{Ray, ViewVertex, hit, hit_weights, signed_edge};
use super::raycast::entries::face_of;
use crate::mesh::Topology;

/// Value at a ray's hit of a triangle with these edge functions: with the weights of the scalar, relative to one corner's and clamped to
/// the corners', as the scalar.
pub(super) fn value_on_face<M: Medium>(medium: &M, ids: [u32; 3], edges: [f64; 3]) -> f64 {
    let [_, q_weight, r_weight] = hit_weights(edges);
    let [p, q, r] = ids.map(|id| medium.vertex_value(id));
    (p + q_weight * (q - p) + r_weight * (r - p)).clamp(p.min(q).min(r), p.max(q).max(r))
}

/// A ray that computes values from its cells, as fragments do not know their face.
pub(super) struct ValuesOnRay<'a, M> {
    pub(super) medium: &'a M,
    pub(super) topology: &'a Topology,
    pub(super) vertices: &'a [ViewVertex],
    pub(super) ray: Ray,
}

/// A point on the ray: its depth, and the value there.
#[derive(Clone, Copy)]
struct ValuePoint {
    depth: f64,
    value: f64,
}

impl<M: Medium> ValuesOnRay<'_, M> {
    /// Values at both ends of a gap: at a depth at which the ray enters `first` or begins in it, and where it leaves `last`. Depths that
    /// differ by less than `tie` are equal.
    pub(super) fn along(&self, first: u32, depth: f64, tie: f64, last: u32) -> [f64; 2] {
        let ends = self.ends_in(first);
        let near = match ends {
            (Some(entry), Some(exit)) if depth > entry.depth + tie => {
                let share = ((depth - entry.depth) / (exit.depth - entry.depth)).clamp(0.0, 1.0);
                entry.value + (exit.value - entry.value) * share
            }
            (Some(point), _) | (None, Some(point)) => point.value,
            (None, None) => self.anywhere_in(first),
        };
        let (entry, exit) = if last == first { ends } else { self.ends_in(last) };
        [near, exit.or(entry).map_or_else(|| self.anywhere_in(last), |point| point.value)]
    }

    /// The points of entry and exit of a cell. The signs of edge functions are exact: a ray with a fragment at the cell has both.
    fn ends_in(&self, cell: u32) -> (Option<ValuePoint>, Option<ValuePoint>) {
        let (mut entry, mut exit) = (None, None);
        for opposite in 0..4 {
            let ids = face_of(self.topology, cell, opposite).vertices;
            let [p, q, r] = ids.map(|v| self.ray.shear(&self.vertices[v as usize]));
            let signed = [
                signed_edge(&q, &r, ids[1], ids[2]),
                signed_edge(&r, &p, ids[2], ids[0]),
                signed_edge(&p, &q, ids[0], ids[1]),
            ];
            let enters = signed[0].1;
            if signed.iter().any(|edge| edge.1 != enters) {
                continue;
            }
            // Edge functions change sign when seen from behind.
            let edges = signed.map(|(edge, _)| if enters { edge } else { -edge });
            let (depth, value) = (hit(edges, &p, &q, &r).depth, value_on_face(self.medium, ids, edges));
            *(if enters { &mut entry } else { &mut exit }) = Some(ValuePoint { depth, value });
            if entry.is_some() && exit.is_some() {
                break;
            }
        }
        (entry, exit)
    }

    fn anywhere_in(&self, cell: u32) -> f64 {
        self.medium.vertex_value(self.topology.tets[cell as usize][0])
    }
}
