//! Lines over the picture: the box of the mesh, and the directions of the axes.

use crate::camera::{Camera, View};
use eframe::egui;
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, pos2, vec2};
use glam::DVec3;

/// Length of an axis in points.
const AXIS: f32 = 30.0;
/// Red, green and blue, light enough for dark backgrounds and dark enough for light ones.
const AXES: [(&str, DVec3, Color32); 3] = [
    ("x", DVec3::X, Color32::from_rgb(235, 80, 80)),
    ("y", DVec3::Y, Color32::from_rgb(70, 180, 80)),
    ("z", DVec3::Z, Color32::from_rgb(90, 140, 255)),
];

/// Draws the directions of the axes around `center`.
pub(super) fn orientation(painter: &Painter, center: Pos2, camera: &Camera, halo: Color32) {
    let Ok(view) = camera.view(1, 1) else { return };
    let tip = |axis: DVec3| DVec3::new(view.right.dot(axis), view.up.dot(axis), view.forward.dot(axis));
    let mut axes = AXES.map(|(name, axis, color)| (name, tip(axis), color));
    // Axes that point away come first.
    axes.sort_by(|a, b| b.1.z.total_cmp(&a.1.z));
    for (name, tip, color) in axes {
        let end = center + AXIS * vec2(tip.x as f32, -tip.y as f32);
        painter.line_segment([center, end], Stroke::new(4.0, halo.gamma_multiply(0.5)));
        painter.line_segment([center, end], Stroke::new(2.0, color));
        let at = center + (AXIS + 9.0) * vec2(tip.x as f32, -tip.y as f32);
        painter.text(at, Align2::CENTER_CENTER, name, FontId::proportional(13.0), color);
    }
}

/// Room that the axes need around their centre.
pub(super) const ORIENTATION_ROOM: f32 = AXIS + 18.0;

/// Draws the edges of a world-space box as seen by `camera` in `rect`.
pub(super) fn bounding_box(painter: &Painter, rect: Rect, camera: &Camera, bounds: (DVec3, DVec3), ink: Color32) {
    let Ok(view) = camera.view(rect.width().max(1.0) as usize, rect.height().max(1.0) as usize) else { return };
    let corner = |i: usize| {
        let pick = |bit: usize, lo: f64, hi: f64| if i >> bit & 1 == 0 { lo } else { hi };
        let (lo, hi) = bounds;
        DVec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
    };
    for from in 0..8_usize {
        for to in (0..3).map(|bit| from | 1 << bit).filter(|&to| to != from) {
            if let Some(ends) = on_screen(&view, rect, view.to_view(corner(from)), view.to_view(corner(to))) {
                painter.line_segment(ends, Stroke::new(1.0, ink.gamma_multiply(0.45)));
            }
        }
    }
}

/// A line of view coordinates in `rect`, clipped to the part before the eye.
fn on_screen(view: &View, rect: Rect, mut from: DVec3, mut to: DVec3) -> Option<[Pos2; 2]> {
    if view.perspective {
        // Nearer than that, lines extend beyond every screen.
        let nearest = 1e-3 * from.z.abs().max(to.z.abs());
        if from.z.max(to.z) <= nearest {
            return None;
        }
        let cut = |behind: DVec3, ahead: DVec3| behind.lerp(ahead, (nearest - behind.z) / (ahead.z - behind.z));
        if from.z < nearest {
            from = cut(from, to);
        } else if to.z < nearest {
            to = cut(to, from);
        }
    }
    let place = |p: DVec3| {
        let depth = if view.perspective { p.z } else { 1.0 };
        let (x, y) = (p.x / depth / view.half_width, p.y / depth / view.half_height);
        rect.center() + vec2(0.5 * rect.width() * x as f32, -0.5 * rect.height() * y as f32)
    };
    Some([place(from), place(to)])
}

/// The position in `rect` of a world point, if it is before the eye.
pub(super) fn place_of(rect: Rect, camera: &Camera, world: DVec3) -> Option<Pos2> {
    let view = camera.view(rect.width().max(1.0) as usize, rect.height().max(1.0) as usize).ok()?;
    let at = view.to_view(world);
    on_screen(&view, rect, at, at).map(|[at, _]| pos2(at.x, at.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Projection;

    #[test]
    fn points_are_where_the_rays_of_their_pixels_go() {
        let rect = Rect::from_min_size(pos2(10.0, 20.0), vec2(200.0, 100.0));
        let perspective = Camera {
            position: DVec3::new(3.0, -2.0, 1.0),
            focal_point: DVec3::new(0.1, 0.2, 0.3),
            view_up: DVec3::Z,
            projection: Projection::Perspective { view_angle: 40.0 },
            near: 0.0,
        };
        let parallel = Camera { projection: Projection::Parallel { scale: 1.5 }, ..perspective };
        for camera in [perspective, parallel] {
            let view = camera.view(200, 100).unwrap();
            let (px, py) = view.ray(150, 20);
            let depth = 2.5;
            let along = if view.perspective { depth } else { 1.0 };
            let world = view.eye + view.right * (px * along) + view.up * (py * along) + view.forward * depth;
            let at = place_of(rect, &camera, world).unwrap();
            assert!((at - pos2(10.0 + 150.5, 20.0 + 20.5)).length() < 1e-3, "{at:?}");
        }
        let behind = perspective.position - (perspective.focal_point - perspective.position);
        assert_eq!(place_of(rect, &perspective, behind), None);
    }

    #[test]
    fn a_line_through_the_eye_is_cut_off() {
        let rect = Rect::from_min_size(pos2(0.0, 0.0), vec2(100.0, 100.0));
        let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
        let view = camera.view(100, 100).unwrap();
        let [from, to] = on_screen(&view, rect, DVec3::new(0.1, 0.0, -1.0), DVec3::new(0.1, 0.0, 1.0)).unwrap();
        assert!(from.is_finite() && to.is_finite() && from.x > to.x);
        assert_eq!(on_screen(&view, rect, DVec3::new(0.0, 0.0, -1.0), DVec3::new(1.0, 0.0, -2.0)), None);
    }
}
