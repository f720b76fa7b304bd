//! Faces of the domain's surface as fragments.
//!
//! A ray hits a face if it passes the three edges on one side. The edge function of two vertices a, b (view coordinates) is d . (a x b),
//! d the direction of the ray; its products are the same for b, a except for the sign, so that faces at an edge agree. A zero is decided
//! for a ray shifted by (d, d^2), d -> 0. Weights of the corners are the edge functions opposite to them over their sum.

use super::{DomainScene, DomainSurface, Fragments};
use crate::camera::View;
use glam::DVec3;
use std::ops::Range;

/// The fragments of a face of a cell.
pub(super) fn fragments(face: [u32; 3], cell: u32, surface: &DomainSurface, scene: &DomainScene<'_>) -> Fragments {
    let view = scene.view;
    let corners = face.map(|vertex| scene.in_view(vertex));
    let Some((columns, rows)) = pixels_of(corners, view) else { return Vec::new() };
    let edges = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| Edge::new(corners[i], corners[j], face[i] < face[j], view));
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let scalars = face.map(|vertex| scene.scalar(cell, vertex));
    let mut out = Vec::new();
    for row in rows {
        for (column, place) in view.rendered_in(row, columns.clone()) {
            let (px, py) = view.ray(column, row);
            let values = edges.each_ref().map(|edge| edge.at(px, py));
            let is_inside = values.iter().all(|(_, is_left)| *is_left) || !values.iter().any(|(_, is_left)| *is_left);
            let sum: f64 = values.iter().map(|(value, _)| value).sum();
            if !is_inside || sum == 0.0 {
                continue;
            }
            let weights = values.map(|(value, _)| value / sum);
            let at: DVec3 = (0..3).map(|i| weights[i] * corners[i]).sum();
            if view.perspective && at.z <= 0.0 {
                continue;
            }
            // Relative to one corner's: a constant scalar stays exact.
            let scalar = scalars[0] + (1..3).map(|i| weights[i] * (scalars[i] - scalars[0])).sum::<f64>();
            let light = scene.light_on(normal, at);
            if let Some(fragment) = scene.fragment(surface, at, scalar, light, surface.opacity) {
                out.push((place as u32, fragment));
            }
        }
    }
    out
}

/// The pixels whose rays may hit a triangle; `None` if there are none.
fn pixels_of(corners: [DVec3; 3], view: &View) -> Option<(Range<usize>, Range<usize>)> {
    let (width, height) = (view.width_px, view.height_px);
    let is_behind = |corner: &DVec3| view.perspective && corner.z <= 0.0;
    if corners.iter().all(is_behind) {
        return None;
    }
    if corners.iter().any(is_behind) {
        return Some((0..width, 0..height));
    }
    let spread = |corner: DVec3| if view.perspective { corner / corner.z } else { corner };
    let on_plane = corners.map(spread);
    let range = |values: [f64; 3], half: f64, count: usize| {
        let (lo, hi) = values.iter().fold((f64::MAX, f64::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let place = |v: f64| (v / half + 1.0) * 0.5 * count as f64;
        // One pixel more on either side for rounding; casts saturate.
        let (first, end) = ((place(lo) - 1.5).max(0.0) as usize, (place(hi) + 1.5).max(0.0) as usize);
        first.min(count)..end.min(count)
    };
    let columns = range(on_plane.map(|p| p.x), view.half_width, width);
    // Image rows go down.
    let rows = range(on_plane.map(|p| -p.y), view.half_height, height);
    (!columns.is_empty() && !rows.is_empty()).then_some((columns, rows))
}

/// The edge function of two vertices, linear in the point of the image plane.
struct Edge {
    normal: DVec3,
}

impl Edge {
    fn new(a: DVec3, b: DVec3, ascends: bool, view: &View) -> Self {
        // In vertex order: the same products for both faces at the edge.
        let (from, to) = if ascends { (a, b) } else { (b, a) };
        let normal = if view.perspective {
            from.cross(to)
        } else {
            // All rays are parallel to z: the cross product of the points on the plane.
            DVec3::new(from.y - to.y, to.x - from.x, from.x * to.y - from.y * to.x)
        };
        Self { normal: if ascends { normal } else { -normal } }
    }

    /// The value at a point of the image plane, and whether the point is on the left side.
    fn at(&self, px: f64, py: f64) -> (f64, bool) {
        let DVec3 { x, y, z } = self.normal;
        let value = x * px + y * py + z;
        let shifted = [value, x, y, z].into_iter().find(|v| *v != 0.0);
        (value, shifted.is_some_and(|v| v > 0.0))
    }
}
