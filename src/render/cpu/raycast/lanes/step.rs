//! One step of eight rays: through a cell each, and what it is made of.

use super::super::super::lanes::vector::{Eight, LANES, Lanes};
use super::super::super::ray::{Sheared, ViewVertex};
use super::super::walk::careful_signs;
use super::Place;
use pulp::cast;

#[inline(always)]
pub(super) fn load_three<L: Lanes>(lanes: L, of: &[Eight; 3]) -> [L::F; 3] {
    [lanes.load(&of[0]), lanes.load(&of[1]), lanes.load(&of[2])]
}

#[inline(always)]
pub(super) fn store_three<L: Lanes>(lanes: L, of: &[L::F; 3]) -> [Eight; 3] {
    [lanes.store(of[0]), lanes.store(of[1]), lanes.store(of[2])]
}

/// Gathers rows of a table.
#[inline(always)]
pub(super) fn rows_at<T>(table: &[T], at: [u32; LANES]) -> [&T; LANES] {
    let [a, b, c, d, e, f, g, h] = at;
    [
        &table[a as usize],
        &table[b as usize],
        &table[c as usize],
        &table[d as usize],
        &table[e as usize],
        &table[f as usize],
        &table[g as usize],
        &table[h as usize],
    ]
}

/// Mesh data of the walk, as plain numbers.
pub(super) struct Cells<'a> {
    pub(super) tets: &'a [[u32; 4]],
    /// Vertices of the cells, cell by cell.
    pub(super) vertex_of: &'a [u32],
    pub(super) neighbours: &'a [[u32; 4]],
    /// x, y, w and s of each vertex.
    pub(super) vertices: &'a [[f64; 4]],
    /// Bits of the active cells; `None` if all are active.
    pub(super) active: Option<&'a [u64]>,
    pub(super) perspective: bool,
    /// One scalar per cell, if the medium has these instead of those of vertices.
    pub(super) scalars: Option<&'a [f32]>,
}

/// Outcome of a step.
pub(super) struct Stepped {
    /// Bits of the lanes whose paths go on.
    pub(super) goes_on: u8,
    /// Bits of the lanes in which signs contradicted each other.
    pub(super) broken: u8,
}

/// Walks each lane through one cell.
#[inline(always)]
pub(super) fn step<L: Lanes>(lanes: L, cells: &Cells<'_>, place: &mut Place<L>, alive: u8) -> Stepped {
    let at: [u32; LANES] = cast(place.at);
    let [a, b, c, d, e, f, g, h] = rows_at(cells.vertex_of, at);
    let new_ids = [*a, *b, *c, *d, *e, *f, *g, *h];
    let [nx, ny, nw, ns] = lanes.transpose(rows_at(cells.vertices, new_ids));
    let (nx, ny) = shear(lanes, cells.perspective, (place.px, place.py), [nx, ny, nw]);
    let reach = lanes.add(lanes.abs(nx), lanes.abs(ny));
    let mut to = [nx; 3];
    for (i, to) in to.iter_mut().enumerate() {
        *to = lanes.sub(lanes.mul(nx, place.y[i]), lanes.mul(place.x[i], ny));
    }
    let zero = lanes.splat(0.0);
    let mut positive = [lanes.lt(zero, to[0]), lanes.lt(zero, to[1]), lanes.lt(zero, to[2])];
    let least = lanes.less(lanes.less(lanes.abs(to[0]), lanes.abs(to[1])), lanes.abs(to[2]));
    let reaches = lanes.add(lanes.add(place.reach[0], place.reach[1]), place.reach[2]);
    let is_sure = lanes.bits(lanes.lt(uncertainty(lanes, reach, reaches), least));
    if alive & !is_sure != 0 {
        let new = NewVertices { x: lanes.store(nx), y: lanes.store(ny), ids: new_ids };
        let [b0, b1, b2] = positive;
        let positive_bits = [lanes.bits(b0), lanes.bits(b1), lanes.bits(b2)];
        let mut careful = Careful { to: store_three(lanes, &to), positive: positive_bits };
        let (x, y) = (store_three(lanes, &place.x), store_three(lanes, &place.y));
        careful.refine(alive & !is_sure, &new, &x, &y, &cast(place.ids));
        to = load_three(lanes, &careful.to);
        let [b0, b1, b2] = careful.positive;
        positive = [lanes.mask(b0), lanes.mask(b1), lanes.mask(b2)];
    }
    let [b0, b1, b2] = positive;
    // As in REPLACED: the corner that the new vertex replaces.
    let k = [lanes.and_not(b1, b2), lanes.and_not(b2, b0)];
    let k2 = lanes.and_not(b0, b1);
    let broken = alive & !(lanes.bits(k[0]) | lanes.bits(k[1]) | lanes.bits(k2));
    debug_assert!(broken == 0, "signs of edge functions are exact");

    let gone = lanes.select3_u32(k, place.ids);
    let edges = [
        lanes.neg(lanes.select3(k, [to[2], to[0], to[1]])),
        lanes.select3(k, [to[1], to[2], to[0]]),
        lanes.select3(k, place.edges),
    ];
    place.x = turned(lanes, k, &place.x, nx);
    place.y = turned(lanes, k, &place.y, ny);
    place.w = turned(lanes, k, &place.w, nw);
    place.s = turned(lanes, k, &place.s, ns);
    place.reach = turned(lanes, k, &place.reach, reach);
    place.edges = edges;
    let [a, b, c] = place.ids;
    let ids = [lanes.select3_u32(k, [b, c, a]), lanes.select3_u32(k, [c, a, b]), cast(new_ids)];
    // Lanes without a ray stay in place.
    let is_alive = lanes.mask(alive);
    for (id, to) in place.ids.iter_mut().zip(ids) {
        *id = lanes.select_u32(is_alive, to, *id);
    }
    let mut cell = at;
    cell.iter_mut().for_each(|cell| *cell >>= 2);
    let across = lanes.across(rows_at(cells.tets, cell), rows_at(cells.neighbours, cell), gone);
    let goes_on = alive & !broken & is_active(cells, cast(across));
    place.at = lanes.select_u32(lanes.mask(goes_on), across, place.at);
    (place.depth, place.scalar) = hit(lanes, edges, &place.w, &place.s);
    Stepped { goes_on, broken }
}

/// The corners of triangles after a new vertex replaces one; the new vertex is the last.
#[inline(always)]
fn turned<L: Lanes>(lanes: L, k: [L::M; 2], of: &[L::F; 3], new: L::F) -> [L::F; 3] {
    [lanes.select3(k, [of[1], of[2], of[0]]), lanes.select3(k, [of[2], of[0], of[1]]), new]
}

/// Bits of the lanes whose neighbours are active cells.
#[inline(always)]
fn is_active(cells: &Cells<'_>, neighbours: [u32; LANES]) -> u8 {
    let mut bits = 0;
    for (l, neighbour) in neighbours.into_iter().enumerate() {
        let is_active = match cells.active {
            None => neighbour != u32::MAX,
            Some(words) => {
                let word = words.get(neighbour as usize >> 8).copied().unwrap_or(0);
                neighbour != u32::MAX && word >> (neighbour >> 2 & 63) & 1 == 1
            }
        };
        bits |= u8::from(is_active) << l;
    }
    bits
}

/// As the scalar [`shear`](super::super::super::ray::Ray::shear).
#[inline(always)]
pub(super) fn shear<L: Lanes>(
    lanes: L,
    perspective: bool,
    (px, py): (L::F, L::F),
    [x, y, w]: [L::F; 3],
) -> (L::F, L::F) {
    let h = if perspective { w } else { lanes.splat(1.0) };
    (lanes.sub(x, lanes.mul(px, h)), lanes.sub(y, lanes.mul(py, h)))
}

/// As the scalar [`uncertainty`](super::super::super::ray::uncertainty).
#[inline(always)]
pub(super) fn uncertainty<L: Lanes>(lanes: L, reach_a: L::F, reach_b: L::F) -> L::F {
    const CAREFUL: f64 = 1.0 / (1u64 << 30) as f64;
    lanes.add(lanes.mul(lanes.mul(lanes.splat(CAREFUL), reach_a), reach_b), lanes.splat(f64::MIN_POSITIVE))
}

/// Depth and scalar, as by the scalar [`hit`](super::super::super::ray::hit).
#[inline(always)]
pub(super) fn hit<L: Lanes>(lanes: L, e: [L::F; 3], w: &[L::F; 3], s: &[L::F; 3]) -> (L::F, L::F) {
    let (zero, one) = (lanes.splat(0.0), lanes.splat(1.0));
    let [a, b, c] = [lanes.greater(e[0], zero), lanes.greater(e[1], zero), lanes.greater(e[2], zero)];
    let sum = lanes.add(lanes.add(a, b), c);
    let is_more = lanes.lt(zero, sum);
    let per_sum = lanes.select(is_more, lanes.div(one, sum), lanes.splat(1.0 / 3.0));
    let [a, b, c] = [lanes.select(is_more, a, one), lanes.select(is_more, b, one), lanes.select(is_more, c, one)];
    let [a, b, c] = [lanes.mul(a, per_sum), lanes.mul(b, per_sum), lanes.mul(c, per_sum)];
    let depth = lanes.add(lanes.add(lanes.mul(a, w[0]), lanes.mul(b, w[1])), lanes.mul(c, w[2]));
    let rise = [lanes.mul(b, lanes.sub(s[1], s[0])), lanes.mul(c, lanes.sub(s[2], s[0]))];
    let scalar = lanes.add(lanes.add(s[0], rise[0]), rise[1]);
    let lo = lanes.less(lanes.less(s[0], s[1]), s[2]);
    let hi = lanes.greater(lanes.greater(s[0], s[1]), s[2]);
    (depth, lanes.less(lanes.greater(scalar, lo), hi))
}

struct NewVertices {
    x: Eight,
    y: Eight,
    ids: [u32; LANES],
}

/// Edge functions from the new vertices to the corners, and bits of the lanes in which they are positive.
struct Careful {
    to: [Eight; 3],
    positive: [u8; 3],
}

impl Careful {
    /// Recomputes doubtful lanes exactly.
    #[cold]
    #[inline(never)]
    fn refine(&mut self, mut doubtful: u8, new: &NewVertices, x: &[Eight; 3], y: &[Eight; 3], ids: &[[u32; LANES]; 3]) {
        while doubtful != 0 {
            let l = doubtful.trailing_zeros() as usize;
            doubtful &= doubtful - 1;
            // Depth and scalar do not matter here.
            let planar = |x: f64, y: f64| Sheared { x, y, w: 0.0, s: 0.0 };
            let corners = [0, 1, 2].map(|i| planar(x[i][l], y[i][l]));
            let mut to = [0.0; 3];
            let new_vertex = planar(new.x[l], new.y[l]);
            let signs = careful_signs(&mut to, &new_vertex, new.ids[l], &corners, &ids.map(|ids| ids[l]));
            for (i, to) in to.into_iter().enumerate() {
                self.to[i][l] = to;
                let bit = u8::from(signs >> i & 1 == 1) << l;
                self.positive[i] = self.positive[i] & !(1 << l) | bit;
            }
        }
    }
}

const _: () = assert!(size_of::<ViewVertex>() == size_of::<[f64; 4]>());
