//! Pixel boxes of faces.

use super::super::ray::{CLUSTER, CLUSTERS_AT_ONCE, ViewVertex, greater, is_needed, less};
use super::lists::{ListedFace, SeenItem};
use crate::camera::View;
use crate::task::Cancel;
use rayon::prelude::*;

/// Image position of a vertex, in pixels from the centre of the first one (NaN if it is not in front of the eye), and its depth; padded
/// to four numbers for a single load.
pub(in crate::render::cpu) type ScreenPoint = [f32; 4];

/// Projects all vertices to the image; those of clusters known not to be `needed` keep their old positions.
pub(in crate::render::cpu) fn project(
    view: &View,
    vertices: &[ViewVertex],
    needed: Option<&[bool]>,
    cancel: &Cancel,
    out: &mut Vec<ScreenPoint>,
) {
    out.resize(vertices.len(), [0.0; 4]);
    let to_px = |half: f64, pixels: usize| (0.5 * pixels as f64 / half, 0.5 * pixels as f64 - 0.5);
    let ((scale_x, middle_x), (scale_y, middle_y)) =
        (to_px(view.half_width, view.width_px), to_px(view.half_height, view.height_px));
    let clusters = out.par_chunks_mut(CLUSTER).zip(vertices.par_chunks(CLUSTER)).enumerate();
    clusters.with_min_len(CLUSTERS_AT_ONCE).for_each(|(cluster, (out, vertices))| {
        if !is_needed(needed, cluster) || cancel.is_cancelled() {
            return;
        }
        for (out, v) in out.iter_mut().zip(vertices) {
            let h = if view.perspective { v.w } else { 1.0 };
            let per_h = if h > 0.0 { 1.0 / h } else { f64::NAN };
            let (x, y) = (v.x * per_h * scale_x + middle_x, -v.y * per_h * scale_y + middle_y);
            *out = [x as f32, y as f32, v.w as f32, 0.0];
        }
    });
}

/// Pixels from `x0` to `x1` and `y0` to `y1`, ends excluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render::cpu) struct Bounds {
    pub(in crate::render::cpu) x0: usize,
    pub(in crate::render::cpu) x1: usize,
    pub(in crate::render::cpu) y0: usize,
    pub(in crate::render::cpu) y1: usize,
}

/// Data from which boxes of faces are computed.
#[derive(Clone, Copy)]
pub(in crate::render::cpu) struct BoxSource<'a> {
    pub(in crate::render::cpu) view: &'a View,
    pub(in crate::render::cpu) vertices: &'a [ViewVertex],
    pub(in crate::render::cpu) screen: &'a [ScreenPoint],
}

impl BoxSource<'_> {
    /// A face with its box, if that is not empty.
    #[inline(always)]
    pub(in crate::render::cpu) fn seen(&self, face: &ListedFace) -> Option<SeenItem<ListedFace>> {
        Some(SeenItem { bounds: self.bounds(face.ids)?, item: *face, nearest: self.nearest(face.ids) })
    }

    /// Least depth of a corner, rounded to f32.
    #[inline(always)]
    pub(in crate::render::cpu) fn nearest<const N: usize>(&self, ids: [u32; N]) -> f32 {
        ids.iter().fold(f32::INFINITY, |least, &v| less(least, self.screen[v as usize][2]))
    }

    /// Greatest depth of a corner, rounded to f32.
    #[inline(always)]
    pub(in crate::render::cpu) fn furthest<const N: usize>(&self, ids: [u32; N]) -> f32 {
        ids.iter().fold(f32::NEG_INFINITY, |most, &v| greater(most, self.screen[v as usize][2]))
    }

    /// Pixels of the image whose rays may meet the hull of some corners, as of a face or a cell, in front of the eye; `None` if there are
    /// none. Conservative: image positions are accurate to 2^-22 of the image's size.
    #[inline(always)]
    pub(in crate::render::cpu) fn bounds<const N: usize>(&self, ids: [u32; N]) -> Option<Bounds> {
        let corners = ids.map(|v| self.screen[v as usize]);
        if is_at_eye(&corners) {
            pixel_box(self.view, self.corners(ids))
        } else {
            bounds_on_screen(&corners, self.view)
        }
    }

    /// As [`Self::bounds`], for a face that counts only for rays that see its corners counter-clockwise.
    #[inline(always)]
    pub(in crate::render::cpu) fn bounds_from_front(&self, ids: [u32; 3]) -> Option<Bounds> {
        let corners = ids.map(|v| self.screen[v as usize]);
        if is_at_eye(&corners) {
            let corners = self.corners(ids);
            return if is_back_facing(self.view, corners) { None } else { pixel_box(self.view, corners) };
        }
        let size = self.view.width_px.max(self.view.height_px) as f32;
        if is_clockwise(&corners, size) { None } else { bounds_on_screen(&corners, self.view) }
    }

    fn corners<const N: usize>(&self, ids: [u32; N]) -> [ViewVertex; N] {
        ids.map(|v| self.vertices[v as usize])
    }
}

/// [`box_of_hull`], out of the way.
#[cold]
#[inline(never)]
fn pixel_box<const N: usize>(view: &View, corners: [ViewVertex; N]) -> Option<Bounds> {
    box_of_hull(view, &corners)
}

/// Pixels whose rays may meet the convex hull of some corners in front of the eye; `None` if there are none. Conservative.
#[inline(always)]
pub(in crate::render::cpu) fn box_of_hull<const N: usize>(view: &View, corners: &[ViewVertex; N]) -> Option<Bounds> {
    let mut range = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let mut include =
        |axis: usize, value: f64| range[axis] = [less(range[axis][0], value), greater(range[axis][1], value)];
    let is_in_front = |v: &ViewVertex| !view.perspective || v.w > 0.0;
    for v in corners.iter().filter(|v| is_in_front(v)) {
        let per_h = if view.perspective { 1.0 / v.w } else { 1.0 };
        include(0, v.x * per_h);
        include(1, v.y * per_h);
    }
    if !corners.iter().all(is_in_front) {
        include_around_eye(corners, include);
    }
    pixels_of(view, range)
}

/// Includes where the hull of corners on both sides of the eye leaves the half-space in front of it.
#[cold]
#[inline(never)]
fn include_around_eye(corners: &[ViewVertex], mut include: impl FnMut(usize, f64)) {
    let extent = corners.iter().fold(0.0f64, |m, v| m.max(v.x.abs()).max(v.y.abs()).max(v.w.abs()));
    for (i, a) in corners.iter().enumerate() {
        for b in corners[..i].iter().filter(|b| (a.w > 0.0) != (b.w > 0.0)) {
            // The edge leaves it here: towards infinity on the image plane, on the side of x and y (on both sides if rounding leaves that
            // open).
            let f = a.w / (a.w - b.w);
            for (axis, value) in [(0, a.x + f * (b.x - a.x)), (1, a.y + f * (b.y - a.y))] {
                if value >= -1e-9 * extent {
                    include(axis, f64::INFINITY);
                }
                if value <= 1e-9 * extent {
                    include(axis, f64::NEG_INFINITY);
                }
            }
        }
    }
}

/// Pixels with a point of the image plane in these ranges of x and y, which may be infinite; `None` if there are none. Conservative.
#[inline(always)]
pub(in crate::render::cpu) fn pixels_of(view: &View, [[left, right], [bottom, top]]: [[f64; 2]; 2]) -> Option<Bounds> {
    // Boxes are exact up to f64's rounding.
    const PAD_PX: f64 = 1e-3;
    let axis_range = |lo: f64, hi: f64, half: f64, pixels: usize| {
        let to_px = |v: f64| (v / half + 1.0) * 0.5 * pixels as f64 - 0.5;
        let (lo, hi) = (to_px(lo) - PAD_PX, to_px(hi) + PAD_PX);
        let first = lo.ceil().clamp(0.0, pixels as f64);
        let end = (hi.floor() + 1.0).clamp(0.0, pixels as f64);
        (first as usize, end as usize)
    };
    let (x0, x1) = axis_range(left, right, view.half_width, view.width_px);
    let (y0, y1) = axis_range(-top, -bottom, view.half_height, view.height_px);
    (x0 < x1 && y0 < y1).then_some(Bounds { x0, x1, y0, y1 })
}

/// Whether a corner is not in front of the eye: NaN propagates.
#[inline(always)]
fn is_at_eye(corners: &[ScreenPoint]) -> bool {
    corners.iter().fold(0.0, |sum, p| sum + p[0]).is_nan()
}

#[inline(always)]
fn bounds_on_screen(corners: &[ScreenPoint], view: &View) -> Option<Bounds> {
    let range = |axis: usize, end: usize| {
        let pad = 1e-3 + end as f32 * (1.0 / (1u32 << 22) as f32);
        let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
        for p in corners {
            (lo, hi) = (less(lo, p[axis]), greater(hi, p[axis]));
        }
        let (lo, hi) = (lo - pad, hi + pad);
        // Casts of numbers beyond the integer range saturate. A pixel exactly at an end lies a pad outside.
        let from = if lo > 0.0 { lo as i32 as usize + 1 } else { 0 };
        let to = if hi > 0.0 { hi as i32 as usize + 1 } else { 0 };
        (from, to.min(end))
    };
    let ((x0, x1), (y0, y1)) = (range(0, view.width_px), range(1, view.height_px));
    (x0 < x1 && y0 < y1).then_some(Bounds { x0, x1, y0, y1 })
}

/// Whether all rays that meet a face in front of the eye certainly see its corners clockwise; `size` is that of the image.
///
/// Let M be the largest coordinate, or `size`, and L the longest side of the face's box, at most 2 M. Rounding to f32 moves corners by
/// 2^-24 M, and rounding in f64, shearing included, by far less: differences are wrong by 2^-22 M at most, and twice the area, a
/// difference of two products of two of them, by 2^-20 L M + 2^-23 L^2. Overflows count as uncertain.
#[inline(always)]
fn is_clockwise([a, b, c]: &[ScreenPoint; 3], size: f32) -> bool {
    let [ab, ac] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
    // Image rows go down.
    let clockwise = ab[0] * ac[1] - ac[0] * ab[1];
    let longest = greater(greater(ab[0].abs(), ab[1].abs()), greater(ac[0].abs(), ac[1].abs()));
    let largest = greater(greater(a[0].abs(), a[1].abs()) + longest, size);
    clockwise > longest * largest * (1.0 / (1u32 << 18) as f32)
}

/// Whether every ray certainly sees the triangle clockwise, on whichever side of the eye it is.
#[cold]
#[inline(never)]
pub(in crate::render::cpu) fn is_back_facing(view: &View, [a, b, c]: [ViewVertex; 3]) -> bool {
    let (ab, ac) = ([b.x - a.x, b.y - a.y, b.w - a.w], [c.x - a.x, c.y - a.y, c.w - a.w]);
    let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    // Along the ray to corner a; parallel rays all go along w.
    let ray = if view.perspective { [a.x, a.y, a.w] } else { [0.0, 0.0, 1.0] };
    let dot: f64 = (0..3).map(|i| normal[i] * ray[i]).sum();
    let length = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Far above f64's rounding: uncertain cases are decided pixel by pixel.
    dot < -1e-9 * length(&ab) * length(&ac) * length(&ray)
}
