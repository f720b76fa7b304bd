//! Entry and exit of the rays of a tile in tets, many tets and rays side by side.
//!
//! Each tet is made ready for the rays of a tile: its edge functions there are linear, with the bounds of [`raster`](super::super::raster).
//! Where all four faces certainly are turned to the eye or away from it in the whole tile, their turns name the edges of the tet's outline,
//! three or four of the six; with the turns, the sign that each has for a ray within is known. Pixels outside of one of them certainly miss
//! the tet: sixteen at a time are left out in f32. For the rest all six edge functions are computed in f64, eight pixels at a time, and
//! what [`tet`](super::tet) defines is decided and interpolated side by side; in doubt by the definition.
//!
//! **The outline.** At a pixel the corners, sheared along its ray, are four points in the plane. An edge is one of their hull's if both other
//! corners are on the same side of it: if the two faces at the edge, which are triangles on their sides of it, ask the same sign of its edge
//! function. A ray with the other sign is outside of the hull, and of all faces. Twice the area of a face is the sum of three edge functions,
//! linear over the tile as well. Each of these is off by 2^-48 (R^2 + D R) at most, the sum by three times that and a few roundings
//! of sums below 6 R^2: by less than the bound `2^-30 R^2 + 2^-45 D R` of one edge function.

use super::super::raster::boxes::Bounds;
use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::{TileRays, certain_above, coarse_above, rounded_to_f32};
use super::super::ray::{ViewVertex, greater, less};
use super::super::tiles::TileBits;
use super::tet::{EDGES, FACES, careful_ends};
use crate::camera::View;

/// Pixels or tets processed at a time.
const EIGHT: usize = 8;
type Eight = [f64; EIGHT];

/// Tets set up at a time, to overlap their memory latency.
pub(super) const TETS_AT_ONCE: usize = 32;

/// One number per tet.
type PerTet = [f64; TETS_AT_ONCE];

/// The corners of a tet.
pub(super) type Corners = [ViewVertex; 4];

/// An outline of which nothing is known.
const UNKNOWN: usize = 16;

/// For each combination of turns (bit f set: the corners of face f are seen counter-clockwise) edges of the outline and the signs that they
/// have for a ray within, some twice; signs of zero where nothing is known.
const OUTLINES: [[(usize, f32); 4]; UNKNOWN + 1] = {
    let mut table = [[(0, 0.0); 4]; UNKNOWN + 1];
    let mut turns = 0;
    while turns < UNKNOWN {
        let (mut found, mut edge) = (0, 0);
        let mut outline = [(0, 0.0); 4];
        while edge < 6 {
            let sign = outline_sign(turns, edge);
            if sign != 0.0 {
                outline[found % 4] = (edge, sign);
                found += 1;
            }
            edge += 1;
        }
        if found == 3 {
            outline[3] = outline[0];
        }
        if found == 3 || found == 4 {
            table[turns] = outline;
        }
        turns += 1;
    }
    table
};

/// The sign that an edge of the outline has for a ray within; 0 if the edge is inside of it.
const fn outline_sign(turns: usize, edge: usize) -> f32 {
    let (mut sum, mut face) = (0i32, 0);
    while face < 4 {
        let [bc, ac, ab] = FACES[face].1;
        let turned = if turns >> face & 1 == 1 { 1 } else { -1 };
        if edge == bc || edge == ab {
            sum += turned;
        } else if edge == ac {
            sum -= turned;
        }
        face += 1;
    }
    (sum / 2) as f32
}

/// Tets set up for the rays of a tile.
pub(super) struct Tets {
    /// x, y, w and scalar of the corners, sorted.
    corners: [[PerTet; 4]; 4],
    /// Edge functions at the middle of the tile, and per dx and dy.
    edges: [[PerTet; 3]; 6],
    /// Edge functions that are not above this are recomputed pixel by pixel.
    certain: PerTet,
    /// The edge functions in f32: those not above the bound `coarse` are recomputed in f64.
    rounded: [[[f32; TETS_AT_ONCE]; 3]; 6],
    coarse: [f32; TETS_AT_ONCE],
    /// Row of [`OUTLINES`].
    outline: [u8; TETS_AT_ONCE],
}

/// The points at which eight rays enter and leave a tet.
#[derive(Clone, Copy)]
pub(super) struct Ends {
    pub(super) depth: [Eight; 2],
    pub(super) scalar: [Eight; 2],
}

impl Tets {
    pub(super) const NONE: Self = Self {
        corners: [[[0.0; TETS_AT_ONCE]; 4]; 4],
        edges: [[[0.0; TETS_AT_ONCE]; 3]; 6],
        certain: [0.0; TETS_AT_ONCE],
        rounded: [[[0.0; TETS_AT_ONCE]; 3]; 6],
        coarse: [0.0; TETS_AT_ONCE],
        outline: [UNKNOWN as u8; TETS_AT_ONCE],
    };

    /// Sets up `count` tets for the rays of a tile, each with its corners in any order.
    #[inline(always)]
    pub(super) fn set(&mut self, view: &View, rays: &TileRays, tets: &[Corners; TETS_AT_ONCE], count: usize) {
        let mut first = 0;
        while first < count {
            if let Some(tets) = tets[first..].first_chunk() {
                self.set_eight(view, rays, tets, first);
            }
            first += EIGHT;
        }
    }

    /// Sets up eight tets from `first` on, side by side.
    #[inline(always)]
    fn set_eight(&mut self, view: &View, rays: &TileRays, tets: &[Corners; EIGHT], first: usize) {
        let [mut x, mut y, mut w, mut s] = [[[0.0; EIGHT]; 4]; 4];
        for (l, corners) in tets.iter().enumerate() {
            for (i, v) in corners.iter().enumerate() {
                (x[i][l], y[i][l], w[i][l], s[i][l]) = (v.x, v.y, v.w, v.s);
            }
        }
        sort_corners([&mut w, &mut x, &mut y, &mut s]);
        for (into, from) in self.corners.iter_mut().zip([&x, &y, &w, &s]) {
            for i in 0..4 {
                put(&mut into[i], first, from[i]);
            }
        }
        let h = if view.perspective { w } else { [[1.0; EIGHT]; 4] };
        let ([cx, cy], wide) = (rays.centre, rays.reach[0] + rays.reach[1]);
        let (mut reach, mut summed) = ([0.0; EIGHT], [0.0; EIGHT]);
        for i in 0..4 {
            for l in 0..EIGHT {
                let wide = wide * h[i][l].abs();
                let all = x[i][l].abs() + y[i][l].abs() + (cx.abs() + cy.abs()) * h[i][l].abs() + wide;
                x[i][l] -= cx * h[i][l];
                y[i][l] -= cy * h[i][l];
                reach[l] = greater(x[i][l].abs() + y[i][l].abs() + wide, reach[l]);
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
        let mut edges = [[[0.0; EIGHT]; 3]; 6];
        for (e, [p, q]) in EDGES.into_iter().enumerate() {
            for l in 0..EIGHT {
                edges[e][0][l] = x[p][l] * y[q][l] - x[q][l] * y[p][l];
                edges[e][1][l] = h[q][l] * y[p][l] - h[p][l] * y[q][l];
                edges[e][2][l] = h[p][l] * x[q][l] - h[q][l] * x[p][l];
            }
            for (k, &of) in edges[e].iter().enumerate() {
                put(&mut self.edges[e][k], first, of);
                put(&mut self.rounded[e][k], first, rounded_to_f32(&of));
            }
        }
        put(&mut self.outline, first, outlines(&edges, &certain, rays.reach));
    }

    /// Calls `hit` with eight pixels of the tile (row times [`TILE_PX`](super::super::tiles::TILE_PX) plus column), bits of those whose rays
    /// hit tet `i`, also behind the eye, and where they enter and leave; for all of the `wanted` pixels in a box.
    #[inline(always)]
    pub(super) fn hits<L: Lanes>(
        &self,
        lanes: L,
        i: usize,
        (view, rays): (&View, &TileRays),
        bounds: Bounds,
        (wanted, list): (&TileBits, &mut PixelList),
        mut hit: impl FnMut(&[u32; EIGHT], u8, &Ends),
    ) {
        let i = i % TETS_AT_ONCE;
        let outline = OUTLINES[usize::from(self.outline[i]) % OUTLINES.len()];
        // Written out, here and below, since a mapped closure becomes a call.
        let [a, b, c, d] = [
            self.outside(i, outline[0]),
            self.outside(i, outline[1]),
            self.outside(i, outline[2]),
            self.outside(i, outline[3]),
        ];
        let candidates = rays.candidates(lanes, bounds, wanted, (list, self.coarse[i]), |dx, dy| {
            let mut outside = [0.0; BLOCK];
            for l in 0..BLOCK {
                let at = (dx[l], dy[l]);
                outside[l] = greater(greater(linear(a, at), linear(b, at)), greater(linear(c, at), linear(d, at)));
            }
            outside
        });
        let mut first = 0;
        while first < candidates {
            let pixels = list[first..].first_chunk().unwrap_or(&[0; EIGHT]);
            let asked = (0xffu32 >> EIGHT.saturating_sub(candidates - first)) as u8;
            let edges = self.edges(lanes, i, rays, pixels);
            let [a, b, c] = [magnitudes(&edges[0]), magnitudes(&edges[1]), magnitudes(&edges[2])];
            let magnitudes = [a, b, c, magnitudes(&edges[3]), magnitudes(&edges[4]), magnitudes(&edges[5])];
            let certain = asked & lanes.less_f64([self.certain[i]; EIGHT], least_of(&magnitudes));
            let (mut is_hit, mut ends) = self.ends(lanes, i, (&edges, &magnitudes));
            is_hit &= certain;
            if certain != asked {
                is_hit |= self.careful(i, (view, rays), pixels, asked & !certain, &mut ends);
            }
            if is_hit != 0 {
                hit(pixels, is_hit, &ends);
            }
            first += EIGHT;
        }
    }

    /// The edge function of tet `i` in f32 that is positive outside of an edge of the outline.
    #[inline(always)]
    fn outside(&self, i: usize, (edge, sign): (usize, f32)) -> [f32; 3] {
        let [middle, per_dx, per_dy] = &self.rounded[edge];
        [-sign * middle[i], -sign * per_dx[i], -sign * per_dy[i]]
    }

    /// Edge functions of tet `i` at eight pixels.
    #[inline(always)]
    fn edges<L: Lanes>(&self, lanes: L, i: usize, rays: &TileRays, pixels: &[u32; EIGHT]) -> [Eight; 6] {
        let [dx, dy] = lanes.look_up(pixels, &rays.dx, &rays.dy);
        let edge = (i, &dx, &dy);
        let [ab, ac, ad] = [self.edge(0, edge), self.edge(1, edge), self.edge(2, edge)];
        [ab, ac, ad, self.edge(3, edge), self.edge(4, edge), self.edge(5, edge)]
    }

    #[inline(always)]
    fn edge(&self, e: usize, (i, dx, dy): (usize, &Eight, &Eight)) -> Eight {
        let [middle, per_dx, per_dy] = &self.edges[e];
        let (middle, per_dx, per_dy) = (middle[i], per_dx[i], per_dy[i]);
        let mut values = [0.0; EIGHT];
        for l in 0..EIGHT {
            values[l] = middle + dy[l] * per_dy + dx[l] * per_dx;
        }
        values
    }

    /// Bits of the rays that hit tet `i`, by their edge functions, all of them certain, and where they enter and leave; undefined for
    /// others.
    #[inline(always)]
    fn ends<L: Lanes>(&self, lanes: L, i: usize, (edges, magnitudes): (&[Eight; 6], &[Eight; 6])) -> (u8, Ends) {
        let zero = [0.0; EIGHT];
        let [ab, ac] = [lanes.less_f64(zero, edges[0]), lanes.less_f64(zero, edges[1])];
        let [ad, bc] = [lanes.less_f64(zero, edges[2]), lanes.less_f64(zero, edges[3])];
        let [bd, cd] = [lanes.less_f64(zero, edges[4]), lanes.less_f64(zero, edges[5])];
        let [f0, f1, f2, f3] = [is_hit(cd, bd, bc), is_hit(cd, ad, ac), is_hit(bd, ad, ab), is_hit(bc, ac, ab)];
        let (of_first, of_last) = (f0 | f1, f3 | f2);
        let &[ab, ac, ad, bc, bd, cd] = magnitudes;
        let [.., w, s] = &self.corners;
        let [aw, bw, cw, dw] = [[w[0][i]; EIGHT], [w[1][i]; EIGHT], [w[2][i]; EIGHT], [w[3][i]; EIGHT]];
        let [a_s, bs, cs, ds] = [[s[0][i]; EIGHT], [s[1][i]; EIGHT], [s[2][i]; EIGHT], [s[3][i]; EIGHT]];
        // Of the two faces the first is that opposite a, b or c, the last that opposite d, c or b. Two faces differ in one corner.
        let first = [
            [lanes.select(of_first, cd, bd), lanes.select(f0, bd, ad), lanes.select(f0, bc, lanes.select(f1, ac, ab))],
            [lanes.select(f0, bw, aw), lanes.select(of_first, cw, bw), dw],
            [lanes.select(f0, bs, a_s), lanes.select(of_first, cs, bs), ds],
        ];
        let last = [
            [lanes.select(f3, bc, lanes.select(f2, bd, cd)), lanes.select(f3, ac, ad), lanes.select(of_last, ab, ac)],
            [aw, lanes.select(of_last, bw, cw), lanes.select(f3, cw, dw)],
            [a_s, lanes.select(of_last, bs, cs), lanes.select(f3, cs, ds)],
        ];
        let (first, last) = (interpolated(&first), interpolated(&last));
        let swapped = lanes.less_f64(last[0], first[0]);
        let depth = [lanes.select(swapped, last[0], first[0]), lanes.select(swapped, first[0], last[0])];
        let scalar = [lanes.select(swapped, last[1], first[1]), lanes.select(swapped, first[1], last[1])];
        // A ray hits two faces or none.
        (f0 | f1 | f2 | f3, Ends { depth, scalar })
    }

    /// Bits of the rays, of some of eight pixels, that hit tet `i` by the definition, and where they enter and leave.
    #[cold]
    #[inline(never)]
    fn careful(
        &self,
        i: usize,
        (view, rays): (&View, &TileRays),
        pixels: &[u32; EIGHT],
        mut which: u8,
        ends: &mut Ends,
    ) -> u8 {
        let corners = [0, 1, 2, 3].map(|k| {
            let [x, y, w, s] = [0, 1, 2, 3].map(|of| self.corners[of][k][i]);
            ViewVertex { x, y, w, s }
        });
        let mut is_hit = 0;
        while which != 0 {
            let l = which.trailing_zeros() as usize % EIGHT;
            which &= which - 1;
            let Some(found) = careful_ends(&corners, &rays.ray(view, pixels[l] as usize)) else { continue };
            is_hit |= 1 << l;
            for (end, point) in found.into_iter().enumerate() {
                (ends.depth[end][l], ends.scalar[end][l]) = (point.depth, point.scalar);
            }
        }
        is_hit
    }
}

/// Bits of the rays that hit a face with corners a < b < c, by those whose edge functions there are positive. Around it go bc, ca, ab; ca
/// is -ac.
#[inline(always)]
fn is_hit(bc: u8, ac: u8, ab: u8) -> u8 {
    bc & !ac & ab | !(bc | !ac | ab)
}

/// Depths and scalars of eight hits, from the magnitudes of edge functions opposite the corners, and the corners' depths and scalars, as by
/// [`hit`](super::super::ray::hit).
#[inline(always)]
fn interpolated([edges, depths, scalars]: &[[Eight; 3]; 3]) -> [Eight; 2] {
    let (mut depth, mut scalar) = ([0.0; EIGHT], [0.0; EIGHT]);
    for l in 0..EIGHT {
        let per_sum = 1.0 / (edges[0][l] + edges[1][l] + edges[2][l]);
        let [p, q, r] = [edges[0][l] * per_sum, edges[1][l] * per_sum, edges[2][l] * per_sum];
        depth[l] = p * depths[0][l] + q * depths[1][l] + r * depths[2][l];
        let [a, b, c] = [scalars[0][l], scalars[1][l], scalars[2][l]];
        let (lo, hi) = (less(less(a, b), c), greater(greater(a, b), c));
        scalar[l] = less(greater(a + q * (b - a) + r * (c - a), lo), hi);
    }
    [depth, scalar]
}

/// Sorts the corners of eight tets by their coordinates and scalars, in the order in which these are given: sums over corners then do not
/// depend on the order in which the cell has them.
#[inline(always)]
fn sort_corners(mut keys: [&mut [Eight; 4]; 4]) {
    for (a, b) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        for l in 0..EIGHT {
            let first = [keys[0][a][l], keys[1][a][l], keys[2][a][l], keys[3][a][l]];
            let second = [keys[0][b][l], keys[1][b][l], keys[2][b][l], keys[3][b][l]];
            let mut is_less = second[3] < first[3];
            for k in [2, 1, 0] {
                is_less = (second[k] < first[k]) | ((second[k] == first[k]) & is_less);
            }
            for (k, key) in keys.iter_mut().enumerate() {
                (key[a][l], key[b][l]) = if is_less { (second[k], first[k]) } else { (first[k], second[k]) };
            }
        }
    }
}

/// Rows of [`OUTLINES`] of eight tets, from their edge functions and the bound of these.
#[inline(always)]
fn outlines(edges: &[[Eight; 3]; 6], certain: &Eight, reach: [f64; 2]) -> [u8; EIGHT] {
    let (mut turns, mut is_known) = ([0u8; EIGHT], [true; EIGHT]);
    for (face, (_, [bc, ac, ab])) in FACES.into_iter().enumerate() {
        for l in 0..EIGHT {
            let of = |k: usize| edges[bc][k][l] - edges[ac][k][l] + edges[ab][k][l];
            let [middle, per_dx, per_dy] = [of(0), of(1), of(2)];
            let least = middle.abs() - (per_dx.abs() * reach[0] + per_dy.abs() * reach[1]);
            is_known[l] &= least > certain[l];
            turns[l] |= u8::from(middle > 0.0) << face;
        }
    }
    let mut outlines = [UNKNOWN as u8; EIGHT];
    for l in 0..EIGHT {
        outlines[l] = if is_known[l] { turns[l] } else { UNKNOWN as u8 };
    }
    outlines
}

/// A linear function of three numbers at (dx, dy).
#[inline(always)]
fn linear([middle, per_dx, per_dy]: [f32; 3], (dx, dy): (f32, f32)) -> f32 {
    middle + dy * per_dy + dx * per_dx
}

#[inline(always)]
fn magnitudes(of: &Eight) -> Eight {
    let mut magnitudes = [0.0; EIGHT];
    for l in 0..EIGHT {
        magnitudes[l] = of[l].abs();
    }
    magnitudes
}

#[inline(always)]
fn least_of([a, b, c, d, e, f]: &[Eight; 6]) -> Eight {
    let mut least = [0.0; EIGHT];
    for l in 0..EIGHT {
        least[l] = less(less(less(a[l], b[l]), less(c[l], d[l])), less(e[l], f[l]));
    }
    least
}

#[inline(always)]
fn put<T: Copy>(into: &mut [T; TETS_AT_ONCE], first: usize, values: [T; EIGHT]) {
    if let Some(into) = into[first..].first_chunk_mut() {
        *into = values;
    }
}
