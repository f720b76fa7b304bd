//! Clips rays against a tet.

use super::{GRAZING_LENGTH, INFLATION};
use crate::camera::View;
use crate::render::RenderJob;
use crate::render::medium::{RayLine, Segment};
use glam::DVec3;
use std::ops::Range;

/// The shape of a cell in view coordinates (local units).
#[derive(Clone, Debug)]
pub(super) struct Tet {
    /// Barycentric coordinate i at a point p is `offset[i] + gradient[i] . p`.
    offset: [f64; 4],
    gradient: [DVec3; 4],
    /// Pixels whose rays may meet the cell.
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

/// The part of a ray in a cell.
pub(super) struct Part {
    /// Depths at its ends.
    pub(super) ends: [f64; 2],
    /// Barycentric coordinates on the ray, at depth 0 and per depth.
    at_zero: [f64; 4],
    slope: [f64; 4],
}

impl Tet {
    /// A cell from its corners in view coordinates; `None` if no pixel can see it.
    pub(super) fn new(view: &View, corners: [DVec3; 4]) -> Option<Self> {
        let (columns, rows) = pixel_ranges(view, &corners)?;
        let mut offset = [0.0; 4];
        let mut gradient = [DVec3::ZERO; 4];
        for i in 0..4 {
            let [a, b, c] = [1, 2, 3].map(|k| corners[(i + k) % 4]);
            // The normal of the face opposite corner i, scaled so that the coordinate is 0 on the face and 1 at the corner.
            let normal = (b - a).cross(c - a);
            let height = normal.dot(corners[i] - a);
            if height == 0.0 {
                return None;
            }
            gradient[i] = normal / height;
            offset[i] = -gradient[i].dot(a);
        }
        Some(Self { offset, gradient, columns, rows })
    }

    /// Barycentric coordinates of a point in view coordinates, also outside of the cell.
    fn weights(&self, point: DVec3) -> [f64; 4] {
        std::array::from_fn(|i| self.offset[i] + self.gradient[i].dot(point))
    }

    /// The part of the ray of image-plane point (px, py).
    pub(super) fn part(&self, view: &View, px: f64, py: f64) -> Option<Part> {
        let (origin, direction) = if view.perspective {
            (DVec3::ZERO, DVec3::new(px, py, 1.0))
        } else {
            (DVec3::new(px, py, 0.0), DVec3::new(0.0, 0.0, 1.0))
        };
        let start = if view.perspective { 0.0 } else { f64::NEG_INFINITY };
        let at_zero = self.weights(origin);
        let slope = self.gradient.map(|gradient| gradient.dot(direction));
        let grazing = || inside(start, &at_zero, &slope, -INFLATION).filter(|(near, far)| far - near > GRAZING_LENGTH);
        let (near, far) = inside(start, &at_zero, &slope, 0.0).or_else(grazing)?;
        Some(Part { ends: [near, far], at_zero, slope })
    }
}

/// A cell in view coordinates (local units), ready to be clipped by rays.
#[derive(Clone, Debug)]
pub(in crate::render) struct Cell {
    pub(super) tet: Tet,
    /// Number in the mesh.
    number: u32,
    scalars: [f64; 4],
    /// Values at its vertices, for a transfer function of more than the scalar.
    vertex_values: [f64; 4],
}

impl Cell {
    /// A cell of a job from its corners in view coordinates; `None` if no pixel can see it.
    pub(in crate::render) fn new(job: &RenderJob, view: &View, number: u32, corners: [DVec3; 4]) -> Option<Self> {
        let vertices = job.mesh.topology.tets[number as usize];
        let scalars = job.scalars.at_corners(number, vertices).map(f64::from);
        let vertex_values = job.joint.as_ref().map_or([0.0; 4], |scene| scene.values_at_corners(number, vertices));
        Some(Self { tet: Tet::new(view, corners)?, number, scalars, vertex_values })
    }

    /// Barycentric coordinates of a point in view coordinates, also outside of the cell.
    pub(in crate::render) fn weights(&self, point: DVec3) -> [f64; 4] {
        self.tet.weights(point)
    }

    /// The segment of the ray of image-plane point (px, py) inside the cell; `scale` is the world length of a local one.
    pub(in crate::render) fn clip(&self, view: &View, scale: f64, px: f64, py: f64) -> Option<Segment> {
        let Part { ends, at_zero, slope } = self.tet.part(view, px, py)?;
        // Relative to one corner's: a constant scalar stays exact, as it may lie on a step of the table.
        let between = |values: &[f64; 4], depth: f64| -> f64 {
            let rise = |i: usize| (at_zero[i] + slope[i] * depth) * (values[i] - values[0]);
            values[0] + (1..4).map(rise).sum::<f64>()
        };
        let at_ends = |values: &[f64; 4]| ends.map(|depth| between(values, depth));
        let line = RayLine { px, py, length_per_depth: view.length_per_depth(px, py) * scale };
        let (scalar, value) = (at_ends(&self.scalars), at_ends(&self.vertex_values));
        Some(Segment::new(self.number, ends, scalar, value, line))
    }
}

/// Depths, from `start` on, between which four coordinates `at_zero + slope * depth` are all at least `bound`.
fn inside(start: f64, at_zero: &[f64; 4], slope: &[f64; 4], bound: f64) -> Option<(f64, f64)> {
    let (mut near, mut far) = (start, f64::INFINITY);
    for (&at_zero, &slope) in at_zero.iter().zip(slope) {
        let meets = (bound - at_zero) / slope;
        if slope > 0.0 {
            near = near.max(meets);
        } else if slope < 0.0 {
            far = far.min(meets);
        } else if at_zero < bound {
            return None;
        }
    }
    (near < far && near.is_finite() && far.is_finite()).then_some((near, far))
}

/// Columns and rows of the pixels whose rays may meet the corners' hull.
fn pixel_ranges(view: &View, corners: &[DVec3; 4]) -> Option<(Range<usize>, Range<usize>)> {
    let all = Some((0..view.width_px, 0..view.height_px));
    if view.perspective {
        if corners.iter().all(|c| c.z <= 0.0) {
            return None;
        }
        // A cell that reaches behind the eye may be visible anywhere; few do.
        if corners.iter().any(|c| c.z <= 1e-9) {
            return all;
        }
    }
    let on_plane = |c: &DVec3| if view.perspective { (c.x / c.z, c.y / c.z) } else { (c.x, c.y) };
    let range = |values: [f64; 4], half: f64, pixels: usize| {
        let to_px = |v: f64| (v / half + 1.0) * 0.5 * pixels as f64 - 0.5;
        let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        // One pixel more on each side than rounding needs.
        let first = (to_px(lo) - 1.0).floor().clamp(0.0, pixels as f64) as usize;
        let end = (to_px(hi) + 2.0).ceil().clamp(0.0, pixels as f64) as usize;
        (first < end).then_some(first..end)
    };
    let columns = range(std::array::from_fn(|i| on_plane(&corners[i]).0), view.half_width, view.width_px)?;
    let rows = range(std::array::from_fn(|i| -on_plane(&corners[i]).1), view.half_height, view.height_px)?;
    Some((columns, rows))
}

/// Segments sorted by their near end, each shortened to begin behind depth `front` and behind the ones before it.
pub(super) fn without_overlap(front: f64, sorted: impl Iterator<Item = Segment>) -> impl Iterator<Item = Segment> {
    let mut front = front;
    sorted.filter_map(move |segment| {
        let left = segment.behind(front)?;
        front = left.part[1];
        Some(left)
    })
}
