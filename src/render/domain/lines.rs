//! Edges of the domain's surface as fragments: lines one pixel wide.
//!
//! A line covers, in each column or row of pixels that it crosses, the two pixels around it by their distance from it (Wu, "An efficient
//! antialiasing technique", SIGGRAPH 1991). Depths and scalars between its ends are those of the line in space.

use super::{DomainScene, DomainSurface, Fragments};
use glam::{DVec2, DVec3};

/// Lines lie this much in front of the faces that they bound, local units: otherwise rounding would let the faces hide them.
const BEFORE: f64 = 1e-3;

/// An end of a line in the image.
#[derive(Clone, Copy)]
struct End {
    /// Pixels from the upper left corner.
    at: DVec2,
    /// The depth term that is linear in the image: 1 / depth in perspective, depth in parallel projection.
    depth: f64,
    /// The scalar times 1 / depth in perspective, the scalar itself in parallel projection.
    scalar: f64,
}

/// The fragments of an edge of a cell.
pub(super) fn fragments(edge: [u32; 2], cell: u32, surface: &DomainSurface, scene: &DomainScene<'_>) -> Fragments {
    let view = scene.view;
    let points = edge.map(|vertex| (scene.in_view(vertex), scene.scalar(cell, vertex)));
    let Some(points) = before_the_eye(points, view.perspective) else { return Vec::new() };
    let (width, height) = (view.width_px as f64, view.height_px as f64);
    let ends = points.map(|(point, scalar)| {
        let over = if view.perspective { 1.0 / point.z } else { 1.0 };
        let x = (point.x * over / view.half_width + 1.0) * 0.5 * width;
        let y = (1.0 - point.y * over / view.half_height) * 0.5 * height;
        let depth = if view.perspective { over } else { point.z };
        End { at: DVec2::new(x, y), depth, scalar: scalar * if view.perspective { over } else { 1.0 } }
    });
    let across = ends[1].at - ends[0].at;
    // Steps along the axis with the longer extent, one point per pixel.
    let is_flat = across.x.abs() >= across.y.abs();
    let (main, count) = (|p: DVec2| if is_flat { p.x } else { p.y }, if is_flat { width } else { height });
    let (from, to) = (main(ends[0].at), main(ends[1].at));
    let (lo, hi) = (from.min(to).max(0.0), from.max(to).min(count));
    // Also returns for NaN.
    if lo.partial_cmp(&hi) != Some(std::cmp::Ordering::Less) {
        return Vec::new();
    }
    let mut out = Vec::new();
    for place in (lo.floor() as usize)..(hi.ceil() as usize) {
        let share = ((place as f64 + 0.5 - from) / (to - from)).clamp(0.0, 1.0);
        let between = |a: f64, b: f64| a + share * (b - a);
        let (depth, scalar) = (between(ends[0].depth, ends[1].depth), between(ends[0].scalar, ends[1].scalar));
        let (depth, scalar) = if view.perspective { (1.0 / depth, scalar / depth) } else { (depth, scalar) };
        let side = ends[0].at + share * across;
        let beside = (if is_flat { side.y } else { side.x }) - 0.5;
        // The fraction of this column or row that the line covers, below 1 at its ends.
        let covered = ((place as f64 + 1.0).min(from.max(to)) - (place as f64).max(from.min(to))).clamp(0.0, 1.0);
        for (pixel, weight) in [(beside.floor(), 1.0 - beside.fract()), (beside.floor() + 1.0, beside.fract())] {
            let (column, row) = if is_flat { (place as f64, pixel) } else { (pixel, place as f64) };
            let opacity = surface.opacity * (weight * covered).clamp(0.0, 1.0);
            if opacity <= 0.0 || column < 0.0 || row < 0.0 || column >= width || row >= height {
                continue;
            }
            let (column, row) = (column as usize, row as usize);
            let Some((_, at_plane)) = view.rendered_in(row, column..column + 1).next() else { continue };
            let (px, py) = view.ray(column, row);
            let spread = if view.perspective { depth } else { 1.0 };
            let at = DVec3::new(px * spread, py * spread, depth - BEFORE);
            if let Some(fragment) = scene.fragment(surface, at, scalar, 1.0, opacity) {
                out.push((at_plane as u32, fragment));
            }
        }
    }
    out
}

/// The part of a line at depths above a millionth of its distance, in perspective; `None` if there is none.
fn before_the_eye([a, b]: [(DVec3, f64); 2], perspective: bool) -> Option<[(DVec3, f64); 2]> {
    let near = 1e-6 * a.0.length().max(b.0.length());
    if !perspective || a.0.z > near && b.0.z > near {
        return Some([a, b]);
    }
    let (before, behind) = if a.0.z > b.0.z { (a, b) } else { (b, a) };
    let share = (before.0.z - near) / (before.0.z - behind.0.z);
    let cut = (before.0.lerp(behind.0, share), before.1 + share * (behind.1 - before.1));
    (before.0.z > near).then_some([before, cut])
}
