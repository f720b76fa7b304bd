//! Entry and exit of rays in a tet, by the signs of its six edge functions.
//!
//! A ray hits a face if the edge functions of its three edges, sheared along the ray, have one sign
//! ([`signed_edge`](super::super::ray::signed_edge)). A tet has six edges; their signs name the faces that are hit, two or none: a table of
//! 64 entries. Over a tile edge functions are linear, with the bounds of [`raster`](super::super::raster); where one is within its
//! bound, the pixel is decided by the definition, so that the cell walk and all cells at an edge agree on every ray.

use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::ray::{Sheared, ViewVertex, accurate_edge, greater, hit, less};
use super::super::tiles::{TILE_PX, TileBits};
use crate::camera::View;
use crate::render::medium::RayPoint;

/// The edges by the corners at their ends.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// For the face opposite each corner its corners a < b < c, and the edges bc, ac and ab.
const FACES: [([usize; 3], [usize; 3]); 4] =
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

/// Columns looked at side by side.
const EIGHT: usize = 8;

/// A tet with its corners in view coordinates, sorted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tet {
    pub(super) corners: [ViewVertex; 4],
}

/// A tet made ready for the rays of a tile.
pub(super) struct TetInTile<'a> {
    tet: &'a Tet,
    /// Edge functions at the middle of the tile, and per dx and dy.
    middle: [f64; 6],
    per_dx: [f64; 6],
    per_dy: [f64; 6],
    /// Edge functions that are not above this are recomputed pixel by pixel.
    certain: f64,
}

impl Tet {
    pub(super) fn new(corners: [ViewVertex; 4]) -> Self {
        Self { corners }
    }

    /// Makes it ready for the rays of a tile.
    #[inline(always)]
    pub(super) fn in_tile(&self, view: &View, rays: &TileRays) -> TetInTile<'_> {
        let h = self.corners.map(|v| if view.perspective { v.w } else { 1.0 });
        let ([cx, cy], wide) = (rays.centre, rays.reach[0] + rays.reach[1]);
        let x: [f64; 4] = std::array::from_fn(|i| self.corners[i].x - cx * h[i]);
        let y: [f64; 4] = std::array::from_fn(|i| self.corners[i].y - cy * h[i]);
        let (mut reach, mut summed) = (0.0, 0.0);
        for i in 0..4 {
            let wide = wide * h[i].abs();
            reach = greater(x[i].abs() + y[i].abs() + wide, reach);
            let all = self.corners[i].x.abs() + self.corners[i].y.abs() + (cx.abs() + cy.abs()) * h[i].abs() + wide;
            summed = greater(all, summed);
        }
        let certain = super::super::raster::certain_above(reach, summed);
        TetInTile {
            tet: self,
            middle: EDGES.map(|[p, q]| x[p] * y[q] - x[q] * y[p]),
            per_dx: EDGES.map(|[p, q]| h[q] * y[p] - h[p] * y[q]),
            per_dy: EDGES.map(|[p, q]| h[p] * x[q] - h[q] * x[p]),
            certain,
        }
    }

    /// The points at which a ray with these edge functions of these signs enters and leaves it.
    #[inline(always)]
    fn ends(&self, signs: usize, edges: &[f64; 6]) -> Option<[RayPoint; 2]> {
        let [first, second] = HIT[signs % 64];
        if first == MISS {
            return None;
        }
        let [a, b] = [first, second].map(|face| {
            let (corners, of_face) = FACES[usize::from(face) % 4];
            // Positive, or rounding around zero.
            let along = |edge: usize| if signs >> edge & 1 == 1 { edges[edge] } else { -edges[edge] };
            let [p, q, r] = corners.map(|i| {
                let v = &self.corners[i];
                Sheared { x: 0.0, y: 0.0, w: v.w, s: v.s }
            });
            hit(of_face.map(along), &p, &q, &r)
        });
        Some(if b.depth < a.depth { [b, a] } else { [a, b] })
    }

    /// The same for one ray, by the definition.
    #[cold]
    #[inline(never)]
    fn careful_ends(&self, view: &View, rays: &TileRays, pixel: usize) -> Option<[RayPoint; 2]> {
        let ray = rays.ray(view, pixel);
        let corners = self.corners.map(|v| ray.shear(&v));
        let mut signs = 0;
        let edges = [0, 1, 2, 3, 4, 5].map(|edge| {
            let [a, b] = EDGES[edge];
            let (value, is_positive) = accurate_edge(&corners[a], &corners[b], a as u32, b as u32);
            signs |= usize::from(is_positive) << edge;
            value
        });
        self.ends(signs, &edges)
    }
}

impl TetInTile<'_> {
    /// Calls `hit` with each of the `wanted` pixels in a box (row times [`TILE_PX`] plus column) whose ray hits the tet, also behind the
    /// eye, and the points where it enters and leaves.
    #[inline(always)]
    pub(super) fn hits(
        &self,
        (view, rays): (&View, &TileRays),
        Bounds { x0, x1, y0, y1 }: Bounds,
        wanted: &TileBits,
        mut hit: impl FnMut(usize, [RayPoint; 2]),
    ) {
        let columns = ((1u32 << x1) - (1u32 << x0)) as u16;
        for row in y0..y1 {
            let asked = wanted[row % TILE_PX] & columns;
            let dy = rays.dy[row % TILE_PX];
            for half in 0..TILE_PX / EIGHT {
                let mut asked = (asked >> (half * EIGHT)) as u8;
                if asked == 0 {
                    continue;
                }
                let dx = rays.dx[half * EIGHT..].first_chunk().unwrap_or(&[0.0; EIGHT]);
                let (edges, signs, least) = self.edges(dx, dy);
                while asked != 0 {
                    let l = asked.trailing_zeros() as usize % EIGHT;
                    asked &= asked - 1;
                    let pixel = row * TILE_PX + half * EIGHT + l;
                    let found = if least[l] > self.certain {
                        let signs = signs[l] as usize;
                        if HIT[signs % 64][0] == MISS {
                            continue;
                        }
                        self.tet.ends(signs, &edges.map(|edge| edge[l]))
                    } else {
                        self.tet.careful_ends(view, rays, pixel)
                    };
                    if let Some(ends) = found {
                        hit(pixel, ends);
                    }
                }
            }
        }
    }

    /// For eight pixels of a row the edge functions, their signs as bits, and the least of their magnitudes.
    #[inline(always)]
    fn edges(&self, dx: &[f64; EIGHT], dy: f64) -> ([[f64; EIGHT]; 6], [u64; EIGHT], [f64; EIGHT]) {
        let (mut edges, mut signs, mut least) = ([[0.0; EIGHT]; 6], [0; EIGHT], [f64::INFINITY; EIGHT]);
        for (e, edge) in edges.iter_mut().enumerate() {
            let (row, per_dx) = (self.middle[e] + dy * self.per_dy[e], self.per_dx[e]);
            for l in 0..EIGHT {
                let value = row + dx[l] * per_dx;
                edge[l] = value;
                signs[l] |= u64::from(value > 0.0) << e;
                least[l] = less(least[l], value.abs());
            }
        }
        (edges, signs, least)
    }
}
