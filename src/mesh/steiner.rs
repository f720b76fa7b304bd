//! Points in the middle of cells that cannot be cut from their corners: Steiner points.
//!
//! Pulling (`split.rs`) fills a cell if its corner of least number sees all of its faces. If it does not, as in cells that are warped or not
//! convex, some tetrahedra overlap others or are flat and leave inner faces open. Such a cell is cut from a point inside: with it, each
//! triangle of its faces is a tetrahedron. The faces are cut as they were, so that neighbours fit as before.
//!
//! ```text
//! suspect  cells some tetrahedra of which are of one sign and others of the other, and those with flat ones that leave a triangle
//!          open that is none of the cell's faces
//! point    the mean of the corners, each once; if that does not do, the centroid of the volume; each moved into the box of the corners
//! judge    it does if all tetrahedra have a volume and the same sign, and their solid angles at the point are one sphere; if neither
//!          does, the cell stays as it was
//! ```
//! 1. Signs are those of the exact predicate on the rounded positions that [`Mesh::build`](super::Mesh::build) judges and draws. So the
//!    frame is found here as well, from the tetrahedra as pulled; a cell that would widen their box is left as it was.
//! 2. Tetrahedra of one sign could still go round the point twice (a branched covering of the sphere). Their solid angles then sum up to 8
//!    pi or more instead of 4 pi. Where they are one sphere, every ray from the point leaves the cell once: the tetrahedra fill it.
//! 3. The values of the point are means of those at the corners (`ingest`). So a linear field stays linear around a mean; around a centroid
//!    it does not.
//! 4. Cells of the same corners with the same point share it, so that duplicates are found as such.

use super::positions::LocalFrame;
use super::repair::{check_counts, check_indices, frame};
use super::split::{Solid, Solids, Split, pull};
use super::topology::FACE_VERTICES;
use super::{NONE, tet_volume};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;

/// Points that were added in the middle of cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SteinerPoints {
    /// World coordinates; numbered on from the points of the source.
    pub points: Vec<DVec3>,
    /// The split cells that are cut from such a point, by their place in [`Split::solids`], ascending, and the number of the point.
    pub of_solids: Vec<[u32; 2]>,
}

/// The points that are added to cells (their places in `solids`, ascending), each with the distinct corners of its cell, in ascending order.
pub(super) fn corners(solids: &Solids, of_solids: &[[u32; 2]]) -> impl Iterator<Item = (u32, Vec<u32>)> {
    let mut wanted = of_solids.iter().peekable();
    (0u32..).zip(solids.iter()).filter_map(move |(place, solid)| {
        let &[_, point] = wanted.next_if(|[of, _]| *of == place)?;
        Some((point, distinct(solid)))
    })
}

/// The corners of a cell, each once, in ascending order.
fn distinct(solid: Solid<'_>) -> Vec<u32> {
    let mut corners = solid.vertices().to_vec();
    corners.sort_unstable();
    corners.dedup();
    corners
}

/// Cuts cells that their corners do not fill from a point in their middle, where one does. `order` is that by which faces are cut. Cells
/// that name missing points, or are of no finite box, are left to the checks of the mesh.
pub(super) fn cut_again(split: Split, points: &[DVec3], order: impl Fn(u32) -> (u8, u32) + Sync) -> Split {
    if split.solids.is_empty() || check_indices(&split.tets, points.len()).is_err() {
        return split;
    }
    let Ok((_, bounds, frame)) = frame(points, &split.tets) else { return split };
    let judge = Judge { points, bounds, frame, order };
    let suspects = judge.suspects(&split);
    let found: Vec<_> = suspects.par_iter().map(|(_, solid)| judge.point_in(*solid)).collect();
    let mut steiner = SteinerPoints::default();
    let mut known = HashMap::new();
    for ((place, _), (corners, point)) in suspects.iter().zip(found).filter_map(|(cell, found)| Some((cell, found?))) {
        // At most as many as there are cells.
        let next = points.len() + steiner.points.len();
        let number = *known.entry((corners, point.to_array().map(f64::to_bits))).or_insert(next);
        if number == next {
            steiner.points.push(point);
        }
        steiner.of_solids.push([*place, number as u32]);
    }
    drop(suspects);
    let is_too_many = check_counts(0, points.len() + steiner.points.len()).is_err();
    if steiner.points.is_empty() || is_too_many { split } else { with_points(split, steiner, &judge.order) }
}

/// The tetrahedra of all cells, those of cells with such a point cut from it.
fn with_points(split: Split, steiner: SteinerPoints, order: impl Fn(u32) -> (u8, u32)) -> Split {
    let first = split.cell_count() - split.solids.len();
    let mut tets = Vec::with_capacity(split.tets.len() + 6 * steiner.points.len());
    tets.extend_from_slice(&split.tets[..first]);
    let mut cell_of_tet: Vec<u32> = (0..first as u32).collect();
    let mut points = steiner.of_solids.iter().peekable();
    for ((place, solid), range) in (0u32..).zip(split.solids.iter()).zip(split.groups()) {
        match points.next_if(|[of, _]| *of == place) {
            Some(&[_, point]) => pull(solid, point, &order, &mut tets),
            None => tets.extend_from_slice(&split.tets[range]),
        }
        cell_of_tet.resize(tets.len(), first as u32 + place);
    }
    Split { tets, cell_of_tet: Some(cell_of_tet), solids: split.solids, steiner }
}

/// Judges cuts on positions as they will be rounded.
struct Judge<'a, O> {
    points: &'a [DVec3],
    /// Corners of the box of the points in use.
    bounds: [DVec3; 2],
    frame: LocalFrame,
    /// Order of points by which faces are cut.
    order: O,
}

impl<O: Fn(u32) -> (u8, u32) + Sync> Judge<'_, O> {
    /// Rounded position of a point that exists.
    fn local(&self, point: u32) -> Vec3 {
        self.frame.local(self.points[point as usize])
    }

    /// The split cells that their corners do not fill, each with its place.
    fn suspects<'s>(&self, split: &'s Split) -> Vec<(u32, Solid<'s>)> {
        let first = split.cell_count() - split.solids.len();
        let sign = |tet: &[u32; 4]| sign_of(tet.map(|vertex| self.local(vertex)));
        let signs: Vec<i8> = split.tets[first..].par_iter().map(sign).collect();
        let cells = (0u32..).zip(split.solids.iter()).zip(split.groups());
        let suspects = cells.filter(|((_, solid), range)| {
            let signs = &signs[range.start - first..range.end - first];
            let [is_turned, is_straight, is_flat] = [-1, 1, 0].map(|sign| signs.contains(&sign));
            let has_volume = is_turned || is_straight;
            is_turned && is_straight
                || is_flat && has_volume && self.leaves_open(*solid, &split.tets[range.clone()], signs)
        });
        suspects.map(|(cell, _)| cell).collect()
    }

    /// Whether the tetrahedra of a cell have, without the flat ones, a triangle on one side only that is none of the cell's faces.
    fn leaves_open(&self, solid: Solid<'_>, tets: &[[u32; 4]], signs: &[i8]) -> bool {
        let mut open = HashSet::new();
        for (tet, _) in tets.iter().zip(signs).filter(|(_, sign)| **sign != 0) {
            for face in FACE_VERTICES {
                let triangle = sorted(face.map(|i| tet[i]));
                if !open.remove(&triangle) {
                    open.insert(triangle);
                }
            }
        }
        self.triangles(solid).iter().for_each(|&triangle| _ = open.remove(&sorted(triangle)));
        !open.is_empty()
    }

    /// The triangles of a cell's faces.
    fn triangles(&self, solid: Solid<'_>) -> Vec<[u32; 3]> {
        let mut tets = Vec::new();
        pull(solid, NONE, &self.order, &mut tets);
        tets.into_iter().map(|[a, b, c, _]| [a, b, c]).collect()
    }

    /// A point that sees all of a cell's faces from inside, and the cell's distinct corners; `None` if none was found.
    fn point_in(&self, solid: Solid<'_>) -> Option<(Vec<u32>, DVec3)> {
        let (corners, triangles) = (distinct(solid), self.triangles(solid));
        let is_used = |corner: &u32| triangles.iter().any(|triangle| triangle.contains(corner));
        if !corners.iter().all(is_used) {
            return None;
        }
        let at: Vec<DVec3> =
            corners.iter().map(|&corner| self.points.get(corner as usize).copied()).collect::<Option<_>>()?;
        let (lo, hi) = at.iter().fold((at[0], at[0]), |(lo, hi), &p| (lo.min(p), hi.max(p)));
        let is_inside =
            at.iter().all(|p| p.is_finite() && p.cmpge(self.bounds[0]).all() && p.cmple(self.bounds[1]).all());
        if !is_inside {
            return None;
        }
        // In units of the frame, so that nothing overflows.
        let of_frame = |p: DVec3| (p - self.frame.origin) / self.frame.scale;
        let mean = at.iter().map(|&p| of_frame(p)).sum::<DVec3>() / at.len() as f64;
        let corners_at = triangles.iter().map(|triangle| triangle.map(|v| of_frame(self.points[v as usize])));
        let candidates = [Some(mean), centroid(corners_at, mean)].into_iter().flatten();
        let mut candidates = candidates.map(|p| (self.frame.origin + self.frame.scale * p).clamp(lo, hi));
        let point = candidates.find(|&point| self.sees_all(&triangles, self.frame.local(point)))?;
        Some((corners, point))
    }

    /// Whether the tetrahedra of these triangles with a point go round it once, all with volumes of one sign.
    fn sees_all(&self, triangles: &[[u32; 3]], point: Vec3) -> bool {
        let (mut signs, mut angle) = ([false; 2], 0.0);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|vertex| self.local(vertex));
            match sign_of([a, b, c, point]) {
                0 => return false,
                sign => signs[usize::from(sign > 0)] = true,
            }
            angle += solid_angle([a, b, c].map(|p| p.as_dvec3() - point.as_dvec3()));
        }
        // Halfway between one sphere and two.
        signs != [true; 2] && angle < 6.0 * PI
    }
}

/// Sign of the volume of a tetrahedron, exactly.
fn sign_of(corners: [Vec3; 4]) -> i8 {
    let volume = tet_volume(corners);
    i8::from(volume > 0.0) - i8::from(volume < 0.0)
}

pub(super) fn sorted(mut triangle: [u32; 3]) -> [u32; 3] {
    triangle.sort_unstable();
    triangle
}

/// Centroid of the space that triangles bound, as the sum of the tetrahedra that they make with `base`; `None` if it has no volume.
fn centroid(triangles: impl Iterator<Item = [DVec3; 3]>, base: DVec3) -> Option<DVec3> {
    let (mut moment, mut volume) = (DVec3::ZERO, 0.0);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|p| p - base);
        let determinant = a.dot(b.cross(c));
        moment += determinant * (a + b + c) / 4.0;
        volume += determinant;
    }
    let centroid = base + moment / volume;
    centroid.is_finite().then_some(centroid)
}

/// Solid angle of a triangle seen from the origin (A. van Oosterom and J. Strackee, "The solid angle of a plane triangle", IEEE
/// Transactions on Biomedical Engineering 30, 1983), without its sign.
fn solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).abs().atan2(below)
}
