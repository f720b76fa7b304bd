//! Vertices of polyhedra from which faces are cut first, so that no piece is flat: hanging nodes, as refinement leaves them.
//!
//! A side of a polyhedron may be several faces in one plane, and an edge of a face may have further vertices on it. A face that is cut from
//! the end of such an edge has a triangle without area, and a cell that is cut from a vertex in the plane of a side, but not of all
//! of its faces, has tetrahedra without volume; these are dropped, and what they would have closed is left open. Such vertices are told by
//! angles alone; as every cell goes by the same ranks, a face is cut alike from both sides whatever they are.

use super::split::{Solid, Solids};
use glam::DVec3;

/// Rank of a vertex that belongs to all faces of a side of several faces.
const OF_A_SIDE: u8 = 0;
/// Rank of a vertex on an edge of a face.
const ON_AN_EDGE: u8 = 1;
/// Rank of any other.
const OTHER: u8 = 2;

/// Sine of the angle up to which edges are in one line and faces in one plane.
const FLAT: f64 = 1e-4;

/// The rank of each point; empty if there are no polyhedra: all have the same.
pub(super) fn ranks(solids: &Solids, points: &[DVec3]) -> Vec<u8> {
    let mut ranks = Vec::new();
    for solid in solids.iter() {
        let Solid::Polyhedron(polyhedron) = solid else { continue };
        ranks.resize(points.len(), OTHER);
        let faces: Vec<&[u32]> = polyhedron.faces().collect();
        // Vertices that do not exist are found when the mesh is checked.
        let at = |vertex: u32| points.get(vertex as usize).copied().unwrap_or(DVec3::NAN);
        let mut lower = |vertex: u32, rank: u8| {
            if let Some(known) = ranks.get_mut(vertex as usize) {
                *known = rank.min(*known);
            }
        };
        for face in &faces {
            on_edges(face, at).for_each(|vertex| lower(vertex, ON_AN_EDGE));
        }
        for side in sides(&faces, at) {
            let mut of_all = side.iter().map(|&face| faces[face]);
            let Some(first) = of_all.next() else { continue };
            let is_of_all = |vertex: &&u32| side.iter().all(|&face| faces[face].contains(vertex));
            first.iter().filter(is_of_all).for_each(|&vertex| lower(vertex, OF_A_SIDE));
        }
    }
    ranks
}

/// The corners of a face that lie between their neighbours on one line.
fn on_edges(face: &[u32], at: impl Fn(u32) -> DVec3) -> impl Iterator<Item = u32> {
    let count = face.len();
    (0..count)
        .filter(move |&i| {
            let [a, b, c] = [i + count - 1, i, i + 1].map(|i| at(face[i % count]));
            is_same_direction(b - a, c - b)
        })
        .map(move |i| face[i])
}

/// The sides of several faces: faces in one plane that are connected by edges.
fn sides(faces: &[&[u32]], at: impl Fn(u32) -> DVec3) -> Vec<Vec<usize>> {
    let normals: Vec<DVec3> = faces.iter().map(|face| normal(face, &at)).collect();
    let mut side: Vec<usize> = (0..faces.len()).collect();
    let mut edges: Vec<([u32; 2], usize)> = Vec::new();
    for (number, face) in faces.iter().enumerate() {
        edges.extend(face.iter().zip(face.iter().cycle().skip(1)).map(|(&a, &b)| ([a.min(b), a.max(b)], number)));
    }
    edges.sort_unstable();
    for pair in edges.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        let [a, b] = [pair[0].1, pair[1].1];
        if side[a] != side[b] && is_same_direction(normals[a], normals[b]) {
            let (from, to) = (side[a], side[b]);
            side.iter_mut().filter(|side| **side == from).for_each(|side| *side = to);
        }
    }
    let of = |number: usize| (0..faces.len()).filter(|&face| side[face] == number).collect::<Vec<_>>();
    (0..faces.len()).map(of).filter(|side| side.len() > 1).collect()
}

/// Normal of a polygon by the areas of its projections (Newell), of any length.
fn normal(face: &[u32], at: impl Fn(u32) -> DVec3) -> DVec3 {
    let Some(&first) = face.first() else { return DVec3::ZERO };
    let origin = at(first);
    face.windows(2).map(|pair| (at(pair[0]) - origin).cross(at(pair[1]) - origin)).sum()
}

fn is_same_direction(a: DVec3, b: DVec3) -> bool {
    a.dot(b) > 0.0 && a.cross(b).length() <= FLAT * a.length() * b.length()
}
