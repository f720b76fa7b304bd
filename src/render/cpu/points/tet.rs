//! Entry and exit of a ray in a tet, by the signs of its six edge functions.
//!
//! A ray hits a face if the edge functions of its three edges, sheared along the ray, have one sign
//! ([`signed_edge`](super::super::ray::signed_edge)). A tet has six edges; their signs name the faces that are hit, two or none: a table of
//! 64 entries. The cell walk and all cells at an edge agree on every ray.

use super::super::ray::{Ray, ViewVertex, accurate_edge, hit};
use crate::render::medium::RayPoint;

/// The edges by the corners at their ends.
pub(super) const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// For the face opposite each corner its corners a < b < c, and the edges bc, ac and ab.
pub(super) const FACES: [([usize; 3], [usize; 3]); 4] =
    [([1, 2, 3], [5, 4, 3]), ([0, 2, 3], [5, 2, 1]), ([0, 1, 3], [4, 2, 0]), ([0, 1, 2], [3, 1, 0])];

/// Marks signs of edges that no ray has, or of one that misses.
const MISS: u8 = 4;

/// For each combination of signs (bit e set: edge e is positive) the two faces that are hit.
const HIT: [[u8; 2]; 64] = {
    let mut table = [[MISS; 2]; 64];
    let mut signs = 0;
    while signs < 64 {
        let (mut found, mut face) = (0, 0);
        while face < 4 {
            let [bc, ac, ab] = FACES[face].1;
            // Around the face go bc, ca, ab; ca is -ac.
            let (first, second, third) = (signs >> bc & 1, 1 - (signs >> ac & 1), signs >> ab & 1);
            if first == second && second == third {
                if found < 2 {
                    table[signs][found] = face as u8;
                }
                found += 1;
            }
            face += 1;
        }
        if found != 2 {
            table[signs] = [MISS; 2];
        }
        signs += 1;
    }
    table
};

/// The points at which a ray enters and leaves a tet, by the definition; `None` if it misses. The corners are sorted.
#[cold]
#[inline(never)]
pub(super) fn careful_ends(corners: &[ViewVertex; 4], ray: &Ray) -> Option<[RayPoint; 2]> {
    let corners = corners.map(|v| ray.shear(&v));
    let mut signs = 0;
    let edges = [0, 1, 2, 3, 4, 5].map(|edge| {
        let [a, b] = EDGES[edge];
        let (value, is_positive) = accurate_edge(&corners[a], &corners[b], a as u32, b as u32);
        signs |= usize::from(is_positive) << edge;
        value
    });
    let [first, second] = HIT[signs % 64];
    if first == MISS {
        return None;
    }
    let [a, b] = [first, second].map(|face| {
        let (of, of_face) = FACES[usize::from(face) % 4];
        // Positive, or rounding around zero.
        let along = |edge: usize| if signs >> edge & 1 == 1 { edges[edge] } else { -edges[edge] };
        let [p, q, r] = of.map(|i| &corners[i]);
        hit(of_face.map(along), p, q, r)
    });
    Some(if b.depth < a.depth { [b, a] } else { [a, b] })
}
