//! Intersects the rays of a tile with faces.
//!
//! A ray hits a face if the three edge functions of the face's corners, sheared along the ray, have one sign, decided as everywhere by
//! [`signed_edge`](super::ray::signed_edge). Those signs and values are computed pixel by pixel only where necessary. Elsewhere an edge
//! function of corners p, q that have been sheared along the ray through the middle of the tile is linear in a pixel's distance (dx, dy)
//! from there,
//!
//! ```text
//! E(dx, dy) = p.x q.y - q.x p.y  +  dx (q.h p.y - p.h q.y)  +  dy (p.h q.x - q.h p.x)
//! ```
//!
//! (h: depth in perspective, 1 in parallel projection). Most pixels of a face's box are not hit: sixteen at a time are tested in f32, and
//! those that the face certainly misses are left out. For the rest, E is computed in f64, eight pixels at a time.
//!
//! **Bound.** Let R be the largest |x| + |y| of a corner sheared along any ray of the tile, and D the largest sum of the magnitudes that
//! shearing adds up. Shearing, here and pixel by pixel, rounds coordinates by at most 3 2^-53 D; the products and sums above by at most 6
//! 2^-53 R^2: both ways of computing E differ by less than 2^-48 (R^2 + D R). Above `2^-30 R^2 + 2^-45 D R` the sign is certain, and the
//! value as accurate as pixel by pixel (there, values above 2^-30 R^2 count as accurate). The rest, one pixel in many thousands, is
//! computed pixel by pixel: neighbouring faces agree about every ray, and with the ray caster.
//!
//! **Bound in f32.** The three numbers of E and the distances are rounded from f64, by 2^-24 of themselves; products and
//! sums are rounded as well. The terms' magnitudes sum to at most 2 R^2, each with at most six roundings: less than
//! 2^-20 R^2 in all. Above `2^-19 R^2 + 2^-45 D R` in f32, E has that sign in f64 and is above its own bound there.

pub(super) mod boxes;
pub(super) mod fragments;
pub(super) mod lanes;
pub(super) mod lists;
mod rays;

use super::ray::{Ray, ViewVertex, crossing, greater, less};
use crate::camera::View;
use lanes::{BLOCK, Lanes, PixelList};
use lists::TileFace;
pub(super) use rays::TileRays;

/// Pixels or faces processed at a time.
const EIGHT: usize = 8;
type Eight = [f64; EIGHT];

/// The point at which a ray passes through a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    pub(super) depth: f64,
    pub(super) scalar: f64,
    /// The cells of the face, in the order in which the ray meets them.
    pub(super) cells: [u32; 2],
    /// Whether the ray sees the corners clockwise.
    pub(super) is_turned: bool,
}

/// Hits of one face by the rays of eight pixels, those of them whose bits are set, at least one.
pub(super) struct Hits<'a> {
    pub(super) which: u8,
    pub(super) pixels: &'a [u32; EIGHT],
    pub(super) depth: &'a Eight,
    pub(super) scalar: &'a Eight,
    /// Bits of the rays that see the corners clockwise.
    pub(super) turned: u8,
    /// The cells of the face in the order of the other rays.
    pub(super) cells: [u32; 2],
}

impl Hits<'_> {
    /// Calls `hit` with each pixel and its hit.
    #[inline(always)]
    pub(super) fn each(&self, mut hit: impl FnMut(usize, Hit)) {
        let Self { mut which, pixels, depth, scalar, turned, cells: [front, behind] } = *self;
        while which != 0 {
            let l = which.trailing_zeros() as usize % EIGHT;
            which &= which - 1;
            let is_turned = turned >> l & 1 == 1;
            let cells = if is_turned { [behind, front] } else { [front, behind] };
            hit(pixels[l] as usize, Hit { depth: depth[l], scalar: scalar[l], cells, is_turned });
        }
    }
}

/// Faces set up at a time, to overlap their memory latency.
pub(super) const FACES_AT_ONCE: usize = 32;

/// One number per face.
type PerFace = [f64; FACES_AT_ONCE];

/// Faces set up for the rays of a tile.
pub(super) struct Faces {
    faces: [TileFace; FACES_AT_ONCE],
    /// Edge functions opposite the corners: at the middle of the tile, and per dx and dy.
    middle: [PerFace; 3],
    per_dx: [PerFace; 3],
    per_dy: [PerFace; 3],
    depth: [PerFace; 3],
    scalar: [PerFace; 3],
    /// Edge functions that are not above this are recomputed pixel by pixel.
    certain: PerFace,
    /// The edge functions in f32, three numbers each: those not above the bound `coarse` are recomputed in f64.
    rounded: [[[f32; FACES_AT_ONCE]; 3]; 3],
    coarse: [f32; FACES_AT_ONCE],
    /// Whether a face is not entirely in front of the eye.
    at_eye: [bool; FACES_AT_ONCE],
}

impl Faces {
    pub(super) const NONE: Self = Self {
        faces: [TileFace::UNUSED; FACES_AT_ONCE],
        middle: [[0.0; FACES_AT_ONCE]; 3],
        per_dx: [[0.0; FACES_AT_ONCE]; 3],
        per_dy: [[0.0; FACES_AT_ONCE]; 3],
        depth: [[0.0; FACES_AT_ONCE]; 3],
        scalar: [[0.0; FACES_AT_ONCE]; 3],
        certain: [0.0; FACES_AT_ONCE],
        rounded: [[[0.0; FACES_AT_ONCE]; 3]; 3],
        coarse: [0.0; FACES_AT_ONCE],
        at_eye: [false; FACES_AT_ONCE],
    };

    /// Sets up at most [`FACES_AT_ONCE`] faces for the rays of a tile.
    #[inline(always)]
    pub(super) fn set(&mut self, view: &View, vertices: &[ViewVertex], rays: &TileRays, faces: &[TileFace]) {
        let count = faces.len().min(FACES_AT_ONCE);
        self.faces[..count].copy_from_slice(&faces[..count]);
        // Pads the last eight: old entries may be of another mesh.
        self.faces[count..count.next_multiple_of(EIGHT)].fill(TileFace::UNUSED);
        let mut first = 0;
        while first < count {
            self.set_eight(view, vertices, rays, first);
            first += EIGHT;
        }
    }

    /// Sets up eight faces from `first` on, side by side.
    #[inline(always)]
    fn set_eight(&mut self, view: &View, vertices: &[ViewVertex], rays: &TileRays, first: usize) {
        let Some(faces) = self.faces[first..].first_chunk::<EIGHT>() else { return };
        // Gathers the vertices corner by corner.
        let [mut x, mut y, mut w, mut s] = [[[0.0; EIGHT]; 3]; 4];
        for (l, face) in faces.iter().enumerate() {
            for (corner, &id) in face.item.ids.iter().enumerate() {
                let v = vertices[id as usize];
                (x[corner][l], y[corner][l], w[corner][l], s[corner][l]) = (v.x, v.y, v.w, v.s);
            }
        }
        let h = if view.perspective { w } else { [[1.0; EIGHT]; 3] };
        let [px, py] = [sheared(&x, rays.centre[0], &h), sheared(&y, rays.centre[1], &h)];
        let (mut reach, mut summed) = ([0.0; EIGHT], [0.0; EIGHT]);
        let (wide, centre) = (rays.reach[0] + rays.reach[1], rays.centre[0].abs() + rays.centre[1].abs());
        for i in 0..3 {
            for l in 0..EIGHT {
                let wide = wide * h[i][l].abs();
                let here = px[i][l].abs() + py[i][l].abs() + wide;
                let all = x[i][l].abs() + y[i][l].abs() + centre * h[i][l].abs() + wide;
                reach[l] = greater(here, reach[l]);
                summed[l] = greater(all, summed[l]);
            }
        }
        let (mut certain, mut coarse) = ([0.0; EIGHT], [0.0; EIGHT]);
        for l in 0..EIGHT {
            certain[l] = certain_above(reach[l], summed[l]);
            coarse[l] = coarse_above(reach[l], summed[l]);
        }
        put(&mut self.certain, first, certain);
        put(&mut self.coarse, first, coarse);
        for (i, p, q) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            let edge = [
                differences(&px[p], &py[q], &px[q], &py[p]),
                differences(&h[q], &py[p], &h[p], &py[q]),
                differences(&h[p], &px[q], &h[q], &px[p]),
            ];
            let of = [&mut self.middle[i], &mut self.per_dx[i], &mut self.per_dy[i]];
            for ((of, rounded), edge) in of.into_iter().zip(&mut self.rounded[i]).zip(edge) {
                put(of, first, edge);
                put(rounded, first, rounded_to_f32(&edge));
            }
            put(&mut self.depth[i], first, w[i]);
            put(&mut self.scalar[i], first, s[i]);
        }
        for (l, at_eye) in self.at_eye[first..].iter_mut().take(EIGHT).enumerate() {
            // Slightly above zero: the product with a certain edge function must not vanish.
            let least = f64::EPSILON;
            *at_eye = view.perspective && !((h[0][l] > least) & (h[1][l] > least) & (h[2][l] > least));
        }
    }

    /// Calls `hit` with each pixel of the tile (row times [`TILE_PX`] plus column) whose ray hits face `i` in front of the eye, and with
    /// the hit.
    #[inline(always)]
    pub(super) fn hits<L: Lanes>(
        &self,
        lanes: L,
        i: usize,
        scene: (&View, &[ViewVertex]),
        rays: &TileRays,
        list: &mut PixelList,
        mut hit: impl FnMut(usize, Hit),
    ) {
        self.some_hits(lanes, i, scene, rays, list, |hits| hits.each(&mut hit));
    }

    /// Calls `some` with the hits of face `i` by up to eight, as [`Self::hits`].
    #[inline(always)]
    pub(super) fn some_hits<L: Lanes>(
        &self,
        lanes: L,
        i: usize,
        (view, vertices): (&View, &[ViewVertex]),
        rays: &TileRays,
        list: &mut PixelList,
        mut some: impl FnMut(&Hits<'_>),
    ) {
        let i = i % FACES_AT_ONCE;
        let cells = self.faces[i].item.cells;
        let certain_above = [self.certain[i]; EIGHT];
        let candidates = self.candidates(lanes, i, rays, list);
        let mut first = 0;
        while first < candidates {
            let pixels = list[first..].first_chunk().unwrap_or(&[0; EIGHT]);
            let e = self.edges(lanes, i, rays, pixels);
            let (all, of_both) = all_and_some(&e);
            let asked = (0xffu32 >> EIGHT.saturating_sub(candidates - first)) as u8;
            let mut certain = lanes.less_f64(certain_above, all) & asked;
            let mut doubtful = asked & !(certain | lanes.less_f64(certain_above, of_both));
            if self.at_eye[i] {
                doubtful |= std::mem::take(&mut certain);
            }
            let turned = lanes.less_f64(e[0], [0.0; EIGHT]);
            let (depth, scalar) = self.depth_and_scalar(i, &e);
            if certain != 0 {
                some(&Hits { which: certain, pixels, depth: &depth, scalar: &scalar, turned, cells });
            }
            while doubtful != 0 {
                let l = doubtful.trailing_zeros() as usize % EIGHT;
                doubtful &= doubtful - 1;
                if let Some(found) = careful_hit(&self.faces[i], vertices, &rays.ray(view, pixels[l] as usize)) {
                    let [depth, scalar] = [found.depth, found.scalar].map(|of| [of; EIGHT]);
                    let turned = u8::from(found.is_turned) << l;
                    some(&Hits { which: 1 << l, pixels, depth: &depth, scalar: &scalar, turned, cells });
                }
            }
            first += EIGHT;
        }
    }

    /// Lists the pixels in the box of face `i` that do not certainly miss it; returns their number.
    #[inline(always)]
    fn candidates<L: Lanes>(&self, lanes: L, i: usize, rays: &TileRays, list: &mut PixelList) -> usize {
        let of = |e: usize| [self.rounded[e][0][i], self.rounded[e][1][i], self.rounded[e][2][i]];
        let edges = [of(0), of(1), of(2)];
        let coarse = self.coarse[i];
        rays.candidates(lanes, self.faces[i].bounds(), &rays.rendered, (list, coarse), |dx, dy| {
            let mut some = [0.0; BLOCK];
            for l in 0..BLOCK {
                let [a, b, c] = edges.map(|[middle, per_dx, per_dy]| middle + dy[l] * per_dy + dx[l] * per_dx);
                some[l] = less(-less(less(a, b), c), greater(greater(a, b), c));
            }
            some
        })
    }

    /// Edge functions of face `i` at eight pixels.
    #[inline(always)]
    fn edges<L: Lanes>(&self, lanes: L, i: usize, rays: &TileRays, pixels: &[u32; EIGHT]) -> [Eight; 3] {
        let [dx, dy] = lanes.look_up(pixels, &rays.dx, &rays.dy);
        // Written out, since a mapped closure becomes a call.
        [self.edge(0, i, &dx, &dy), self.edge(1, i, &dx, &dy), self.edge(2, i, &dx, &dy)]
    }

    #[inline(always)]
    fn edge(&self, e: usize, i: usize, dx: &Eight, dy: &Eight) -> Eight {
        let (middle, per_dx, per_dy) = (self.middle[e][i], self.per_dx[e][i], self.per_dy[e][i]);
        let mut values = [0.0; EIGHT];
        for l in 0..EIGHT {
            values[l] = middle + dy[l] * per_dy + dx[l] * per_dx;
        }
        values
    }

    /// Depths and scalars at all pixels, as by [`hit`](super::ray::hit); undefined where the face is not hit.
    #[inline(always)]
    fn depth_and_scalar(&self, i: usize, [e0, e1, e2]: &[Eight; 3]) -> (Eight, Eight) {
        let [p, q, r] = [self.depth[0][i], self.depth[1][i], self.depth[2][i]];
        let [ps, qs, rs] = [self.scalar[0][i], self.scalar[1][i], self.scalar[2][i]];
        let (qs, rs) = (qs - ps, rs - ps);
        let (mut depth, mut scalar) = ([0.0; EIGHT], [0.0; EIGHT]);
        for l in 0..EIGHT {
            let per_sum = 1.0 / (e0[l] + e1[l] + e2[l]);
            let (wp, wq, wr) = (e0[l] * per_sum, e1[l] * per_sum, e2[l] * per_sum);
            depth[l] = wp * p + wq * q + wr * r;
            scalar[l] = ps + wq * qs + wr * rs;
        }
        (depth, scalar)
    }
}

/// Bounds above: for f64 values, and for the coordinates that they are computed from.
const ACCURATE: f64 = 1.0 / (1u64 << 30) as f64;
const SHEARED: f64 = 1.0 / (1u64 << 45) as f64;
/// Bound for f32 values.
const COARSE: f64 = 1.0 / (1u64 << 19) as f64;

/// Bound in f32 above which an edge function has its sign in f64 (above).
#[inline(always)]
pub(super) fn coarse_above(reach: f64, summed: f64) -> f32 {
    let above = reach * (COARSE * reach + SHEARED * summed);
    (above + 16.0 * f64::from(f32::MIN_POSITIVE)) as f32
}

/// Bound above which an edge function over a tile has its sign and its value (above), of corners with this R and D.
#[inline(always)]
pub(super) fn certain_above(reach: f64, summed: f64) -> f64 {
    reach * (ACCURATE * reach + SHEARED * summed) + f64::MIN_POSITIVE
}

#[inline(always)]
fn put<T: Copy>(into: &mut [T; FACES_AT_ONCE], first: usize, values: [T; EIGHT]) {
    if let Some(into) = into[first..].first_chunk_mut() {
        *into = values;
    }
}

#[inline(always)]
fn sheared(of: &[Eight; 3], centre: f64, h: &[Eight; 3]) -> [Eight; 3] {
    let mut sheared = [[0.0; EIGHT]; 3];
    for i in 0..3 {
        for l in 0..EIGHT {
            sheared[i][l] = of[i][l] - centre * h[i][l];
        }
    }
    sheared
}

/// a b - c d.
#[inline(always)]
fn differences(a: &Eight, b: &Eight, c: &Eight, d: &Eight) -> Eight {
    let mut differences = [0.0; EIGHT];
    for l in 0..EIGHT {
        differences[l] = a[l] * b[l] - c[l] * d[l];
    }
    differences
}

#[inline(always)]
pub(super) fn rounded_to_f32(of: &Eight) -> [f32; EIGHT] {
    let mut rounded = [0.0; EIGHT];
    for l in 0..EIGHT {
        rounded[l] = of[l] as f32;
    }
    rounded
}

/// For three edge functions their least magnitude if all have one sign, and the lesser of the greatest magnitudes of either sign if not.
///
/// So the first is positive where they certainly have one sign, the second where they certainly do not.
#[inline(always)]
fn all_and_some([e0, e1, e2]: &[Eight; 3]) -> (Eight, Eight) {
    let (mut all, mut some) = ([0.0; EIGHT], [0.0; EIGHT]);
    for l in 0..EIGHT {
        let (a, b, c) = (e0[l], e1[l], e2[l]);
        let (least, most) = (less(less(a, b), c), greater(greater(a, b), c));
        all[l] = greater(least, -most);
        some[l] = less(-least, most);
    }
    (all, some)
}

/// The hit of a single pixel's ray by the definition.
#[cold]
#[inline(never)]
fn careful_hit(face: &TileFace, vertices: &[ViewVertex], ray: &Ray) -> Option<Hit> {
    let [a, b, c] = face.item.ids;
    let [front, behind] = face.item.cells;
    let (ids, cells, is_turned, found) = match crossing(ray, vertices, [a, b, c]) {
        Some(found) => ([a, b, c], [front, behind], false, found),
        None => ([a, c, b], [behind, front], true, crossing(ray, vertices, [a, c, b])?),
    };
    let is_seen = !ray.perspective || found.is_in_front(ids);
    is_seen.then_some(Hit { depth: found.point.depth, scalar: found.point.scalar, cells, is_turned })
}

#[cfg(test)]
mod tests;
