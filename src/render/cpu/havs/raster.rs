//! Which rays of a tile hit a face, and where.
//!
//! A ray hits a face if the three edge functions of the face's corners, sheared along the ray, have one sign, decided as
//! everywhere by [`signed_edge`](super::super::ray::signed_edge). Those signs and values are computed pixel by pixel only
//! where it matters. Elsewhere an edge function of corners p, q that have been sheared along the ray through the middle of
//! the tile is linear in a pixel's distance (dx, dy) from there,
//!
//! ```text
//! E(dx, dy) = p.x q.y - q.x p.y  +  dx (q.h p.y - p.h q.y)  +  dy (p.h q.x - q.h p.x)
//! ```
//!
//! (h: depth in perspective, 1 in parallel projection), evaluated for eight pixels of a row at a time.
//!
//! **Bound.** Let R be the largest |x| + |y| of a corner sheared along any ray of the tile, and D the largest sum of the
//! magnitudes that shearing adds up. Shearing, here and pixel by pixel, rounds coordinates by at most 3 2^-53 D; the
//! products and sums above by at most 6 2^-53 R^2: both ways of computing E differ by less than 2^-48 (R^2 + D R). Above
//! `2^-30 R^2 + 2^-45 D R` the sign is certain, and the value as accurate as pixel by pixel (there, values above 2^-30 R^2
//! count as accurate). All the rest, one pixel in many thousands, is asked pixel by pixel: neighbouring faces agree about every
//! ray, and with the ray caster.

use super::super::ray::{Ray, ViewVertex, crossing};
use super::bins::{Bounds, BoxSource};
use super::fragment::Fragment;
use super::sides::Sides;
use crate::camera::View;
use crate::mesh::{NONE, Topology};
use crate::visibility::CellSet;

/// Pixels at a time.
pub(super) const LANES: usize = 8;
type Lanes = [f64; LANES];
/// A byte of 1 for each.
const ONES: u64 = 0x0101_0101_0101_0101;

/// What all tiles of a frame read to find hits.
pub(super) struct Faces<'a> {
    pub(super) topology: &'a Topology,
    /// `None`: all.
    pub(super) active: Option<&'a CellSet>,
    pub(super) sides: &'a Sides,
    pub(super) source: BoxSource<'a>,
}

/// Corners of a face, and the cells in front of it and behind it.
pub(super) type Loaded = ([u32; 3], [u32; 2]);

impl Faces<'_> {
    /// What is known of a face without a view.
    #[inline(always)]
    pub(super) fn load(&self, face: Option<u32>) -> Loaded {
        let Some(face) = face else { return ([0; 3], [NONE; 2]) };
        (self.topology.faces[face as usize], self.sides.cells(self.topology, self.active, face))
    }
}

/// The rays of a tile.
pub(super) struct TileRays {
    pub(super) bounds: Bounds,
    centre: [f64; 2],
    /// Distances of the columns and rows from the middle; room for eight columns more.
    dx: [f64; super::TILE_PX + LANES],
    dy: [f64; super::TILE_PX],
    /// Largest |dx| and |dy|.
    reach: [f64; 2],
}

impl TileRays {
    pub(super) fn new(view: &View, bounds: Bounds) -> Self {
        let middle = |a: usize, b: usize| 0.5 * (a + b) as f64;
        let (cx, cy) = view.ray_at(middle(bounds.x0, bounds.x1), middle(bounds.y0, bounds.y1));
        let mut rays = Self {
            bounds,
            centre: [cx, cy],
            dx: [0.0; super::TILE_PX + LANES],
            dy: [0.0; super::TILE_PX],
            reach: [0.0; 2],
        };
        for (i, dx) in rays.dx.iter_mut().take(bounds.x1 - bounds.x0).enumerate() {
            *dx = view.ray(bounds.x0 + i, bounds.y0).0 - cx;
            rays.reach[0] = rays.reach[0].max(dx.abs());
        }
        for (j, dy) in rays.dy.iter_mut().take(bounds.y1 - bounds.y0).enumerate() {
            *dy = view.ray(bounds.x0, bounds.y0 + j).1 - cy;
            rays.reach[1] = rays.reach[1].max(dy.abs());
        }
        rays
    }
}

/// A face ready to be met by the rays of a tile.
#[derive(Clone, Copy)]
pub(super) struct Face {
    ids: [u32; 3],
    /// In front of it and behind it, for rays that see its corners counter-clockwise.
    cells: [u32; 2],
    bounds: Bounds,
    /// Edge functions opposite the corners: at the middle of the tile, and per dx and dy.
    middle: [f64; 3],
    per_dx: [f64; 3],
    per_dy: [f64; 3],
    depth: [f64; 3],
    scalar: [f64; 3],
    /// Edge functions that are not above this are asked pixel by pixel.
    certain: f64,
    /// The face is not wholly in front of the eye.
    at_eye: bool,
}

impl Face {
    pub(super) const UNUSED: Self = Self {
        ids: [0; 3],
        cells: [NONE; 2],
        bounds: Bounds { x0: 0, x1: 0, y0: 0, y1: 0 },
        middle: [0.0; 3],
        per_dx: [0.0; 3],
        per_dy: [0.0; 3],
        depth: [0.0; 3],
        scalar: [0.0; 3],
        certain: 0.0,
        at_eye: false,
    };

    /// Makes this a face that the rays of a tile may meet; false, and no face, if they do not.
    #[inline(always)]
    pub(super) fn set(&mut self, faces: &Faces<'_>, rays: &TileRays, &(ids, cells): &Loaded) -> bool {
        let Some(bounds) = faces.source.bounds(ids, rays.bounds) else { return false };
        let perspective = faces.source.view.perspective;
        let corners = ids.map(|v| faces.source.vertices[v as usize]);
        let [cx, cy] = rays.centre;
        let h = corners.map(|v| if perspective { v.w } else { 1.0 });
        let [x, y] = [[0, 1, 2].map(|i| corners[i].x - cx * h[i]), [0, 1, 2].map(|i| corners[i].y - cy * h[i])];
        let (mut reach, mut summed) = (0.0f64, 0.0f64);
        for i in 0..3 {
            let wide = (rays.reach[0] + rays.reach[1]) * h[i].abs();
            let here = x[i].abs() + y[i].abs() + wide;
            let all = corners[i].x.abs() + corners[i].y.abs() + (cx.abs() + cy.abs()) * h[i].abs() + wide;
            reach = if here > reach { here } else { reach };
            summed = if all > summed { all } else { summed };
        }
        const ACCURATE: f64 = 1.0 / (1u64 << 30) as f64;
        const SHEARED: f64 = 1.0 / (1u64 << 45) as f64;
        let certain = reach * (ACCURATE * reach + SHEARED * summed) + f64::MIN_POSITIVE;
        let edge = |p: usize, q: usize| x[p] * y[q] - x[q] * y[p];
        let edge_dx = |p: usize, q: usize| h[q] * y[p] - h[p] * y[q];
        let edge_dy = |p: usize, q: usize| h[p] * x[q] - h[q] * x[p];
        *self = Self {
            ids,
            cells,
            bounds,
            middle: [edge(1, 2), edge(2, 0), edge(0, 1)],
            per_dx: [edge_dx(1, 2), edge_dx(2, 0), edge_dx(0, 1)],
            per_dy: [edge_dy(1, 2), edge_dy(2, 0), edge_dy(0, 1)],
            depth: corners.map(|v| v.w),
            scalar: corners.map(|v| v.s),
            certain,
            at_eye: perspective && !(h[0] > 0.0 && h[1] > 0.0 && h[2] > 0.0),
        };
        true
    }

    /// Gives `hit` each pixel of the tile (row times [`super::TILE_PX`] plus column) whose ray hits the face in front of the
    /// eye, with the fragment.
    #[inline(always)]
    pub(super) fn hits(
        &self,
        view: &View,
        vertices: &[ViewVertex],
        rays: &TileRays,
        mut hit: impl FnMut(usize, Fragment),
    ) {
        let Bounds { x0, x1, y0, y1 } = self.bounds;
        let (first, end) = (x0 - rays.bounds.x0, x1 - rays.bounds.x0);
        for row in y0 - rays.bounds.y0..y1 - rays.bounds.y0 {
            let dy = rays.dy[row & (super::TILE_PX - 1)];
            let [e0, e1, e2] = [0, 1, 2].map(|i| self.middle[i] + dy * self.per_dy[i]);
            let mut column = first;
            while column < end {
                let dx: &Lanes = rays.dx[column..].first_chunk().unwrap_or(&[0.0; LANES]);
                let at = |e: f64, per_dx: f64| -> Lanes { std::array::from_fn(|l| e + dx[l] * per_dx) };
                let e = [at(e0, self.per_dx[0]), at(e1, self.per_dx[1]), at(e2, self.per_dx[2])];
                let asked = ONES >> (8 * (LANES - (end - column).min(LANES)));
                let (inside, outside) = self.sides_of(&e);
                let mut certain = inside & asked;
                let mut doubtful = asked & !(inside | outside);
                if self.at_eye {
                    doubtful |= std::mem::take(&mut certain);
                }
                if certain != 0 {
                    let (depth, scalar) = self.depth_and_scalar(&e);
                    while certain != 0 {
                        let l = (certain.trailing_zeros() as usize / 8) & (LANES - 1);
                        certain &= certain - 1;
                        let turned = usize::from(e[0][l] < 0.0);
                        let (near, far) = (self.cells[turned], self.cells[1 - turned]);
                        hit(
                            row * super::TILE_PX + column + l,
                            Fragment { depth: depth[l], scalar: scalar[l], near, far },
                        );
                    }
                }
                while doubtful != 0 {
                    let l = doubtful.trailing_zeros() as usize / 8;
                    doubtful &= doubtful - 1;
                    let (i, j) = (rays.bounds.x0 + column + l, rays.bounds.y0 + row);
                    if let Some(fragment) = self.careful_hit(view, vertices, i, j) {
                        hit(row * super::TILE_PX + column + l, fragment);
                    }
                }
                column += LANES;
            }
        }
    }

    /// Pixels certainly hit and certainly missed: a byte of 1 each.
    #[inline(always)]
    fn sides_of(&self, [e0, e1, e2]: &[Lanes; 3]) -> (u64, u64) {
        let (mut inside, mut outside) = ([0u8; LANES], [0u8; LANES]);
        for l in 0..LANES {
            let (a, b, c) = (e0[l], e1[l], e2[l]);
            let least = if a < b { a } else { b };
            let least = if least < c { least } else { c };
            let most = if a > b { a } else { b };
            let most = if most > c { most } else { c };
            // The least of three of one sign and the most of them otherwise, and the other way round.
            let all = if least > -most { least } else { -most };
            let some = if -least < most { -least } else { most };
            inside[l] = u8::from(all > self.certain);
            outside[l] = u8::from(some > self.certain);
        }
        (u64::from_le_bytes(inside), u64::from_le_bytes(outside))
    }

    /// Of all pixels, as [`hit`](super::super::ray::hit) has them; of no meaning where the face is not hit.
    #[inline(always)]
    fn depth_and_scalar(&self, [e0, e1, e2]: &[Lanes; 3]) -> (Lanes, Lanes) {
        let [p, q, r] = self.depth;
        let [ps, qs, rs] = self.scalar;
        let (qs, rs) = (qs - ps, rs - ps);
        let (mut depth, mut scalar) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let per_sum = 1.0 / (e0[l] + e1[l] + e2[l]);
            let (wp, wq, wr) = (e0[l] * per_sum, e1[l] * per_sum, e2[l] * per_sum);
            depth[l] = wp * p + wq * q + wr * r;
            scalar[l] = ps + wq * qs + wr * rs;
        }
        (depth, scalar)
    }

    /// The fragment of one pixel by the definition.
    #[cold]
    #[inline(never)]
    fn careful_hit(&self, view: &View, vertices: &[ViewVertex], column: usize, row: usize) -> Option<Fragment> {
        let ray = Ray::of_pixel(view, column, row);
        let [a, b, c] = self.ids;
        let [front, behind] = self.cells;
        let (ids, near, far, found) = match crossing(&ray, vertices, [a, b, c]) {
            Some(found) => ([a, b, c], front, behind, found),
            None => ([a, c, b], behind, front, crossing(&ray, vertices, [a, c, b])?),
        };
        let is_seen = !self.at_eye || found.is_in_front(ids);
        is_seen.then_some(Fragment { depth: found.depth, scalar: found.scalar, near, far })
    }
}

#[cfg(test)]
#[path = "raster_tests.rs"]
mod tests;
