//! A tet and a ray.

use super::{GRAZING_LENGTH, INFLATION};
use crate::camera::View;
use crate::render::RenderJob;
use glam::DVec3;
use std::ops::Range;

/// A cell in view coordinates (local units), ready to be clipped by rays.
#[derive(Clone, Debug)]
pub(in crate::render) struct Cell {
    /// Barycentric coordinate i at a point p is `offset[i] + gradient[i] . p`.
    offset: [f64; 4],
    gradient: [DVec3; 4],
    scalars: [f64; 4],
    beside: Beside,
    /// Pixels whose rays may meet the cell.
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
}

/// What a cell has beside its scalars, for a transfer function of more than them.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::render) struct Beside {
    /// The quantity of its vertices.
    pub(in crate::render) vertex_values: [f64; 4],
    /// The quantity of the cell.
    pub(in crate::render) cell_value: f64,
}

impl Beside {
    /// What a cell of a job has.
    pub(in crate::render) fn of_cell(job: &RenderJob, cell: u32) -> Self {
        let Some(grid) = &job.grid else { return Self::default() };
        let tet = job.mesh.topology.tets[cell as usize];
        Self { vertex_values: tet.map(|v| grid.vertex_value(v)), cell_value: grid.cell_value(cell) }
    }
}

/// The part of a ray inside a cell: depths, scalars and the quantity of vertices at its ends; the quantity of the cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::render) struct Segment {
    pub(in crate::render) near: f64,
    pub(in crate::render) far: f64,
    pub(in crate::render) scalar_near: f64,
    pub(in crate::render) scalar_far: f64,
    pub(in crate::render) value_near: f64,
    pub(in crate::render) value_far: f64,
    pub(in crate::render) cell_value: f64,
}

impl Cell {
    /// `None` if no pixel can see the cell.
    pub(in crate::render) fn new(view: &View, corners: [DVec3; 4], scalars: [f64; 4], beside: Beside) -> Option<Self> {
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
        Some(Self { offset, gradient, scalars, beside, columns, rows })
    }

    /// Barycentric coordinates of a point in view coordinates, outside of the cell too.
    pub(in crate::render) fn weights(&self, point: DVec3) -> [f64; 4] {
        std::array::from_fn(|i| self.offset[i] + self.gradient[i].dot(point))
    }

    /// The segment of the ray of image-plane point (px, py) inside the cell.
    pub(in crate::render) fn clip(&self, view: &View, px: f64, py: f64) -> Option<Segment> {
        let (origin, direction) = if view.perspective {
            (DVec3::ZERO, DVec3::new(px, py, 1.0))
        } else {
            (DVec3::new(px, py, 0.0), DVec3::new(0.0, 0.0, 1.0))
        };
        let start = if view.perspective { 0.0 } else { f64::NEG_INFINITY };
        let mut at_zero = [0.0; 4];
        let mut slope = [0.0; 4];
        for i in 0..4 {
            at_zero[i] = self.offset[i] + self.gradient[i].dot(origin);
            slope[i] = self.gradient[i].dot(direction);
        }
        let grazing = || inside(start, &at_zero, &slope, -INFLATION).filter(|(near, far)| far - near > GRAZING_LENGTH);
        let (near, far) = inside(start, &at_zero, &slope, 0.0).or_else(grazing)?;
        // Relative to one corner's: a constant scalar stays what it is, exactly on a step of the table perhaps.
        let between = |values: &[f64; 4], depth: f64| -> f64 {
            let rise = |i: usize| (at_zero[i] + slope[i] * depth) * (values[i] - values[0]);
            values[0] + (1..4).map(rise).sum::<f64>()
        };
        let Beside { vertex_values, cell_value } = &self.beside;
        Some(Segment {
            near,
            far,
            scalar_near: between(&self.scalars, near),
            scalar_far: between(&self.scalars, far),
            value_near: between(vertex_values, near),
            value_far: between(vertex_values, far),
            cell_value: *cell_value,
        })
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
        // A cell that reaches behind the eye may be seen anywhere; few do.
        if corners.iter().any(|c| c.z <= 1e-9) {
            return all;
        }
    }
    let on_plane = |c: &DVec3| if view.perspective { (c.x / c.z, c.y / c.z) } else { (c.x, c.y) };
    let range = |values: [f64; 4], half: f64, pixels: usize| {
        let to_px = |v: f64| (v / half + 1.0) * 0.5 * pixels as f64 - 0.5;
        let (lo, hi) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        // A pixel more on each side than rounding needs.
        let first = (to_px(lo) - 1.0).floor().clamp(0.0, pixels as f64) as usize;
        let end = (to_px(hi) + 2.0).ceil().clamp(0.0, pixels as f64) as usize;
        (first < end).then_some(first..end)
    };
    let columns = range(std::array::from_fn(|i| on_plane(&corners[i]).0), view.half_width, view.width_px)?;
    let rows = range(std::array::from_fn(|i| -on_plane(&corners[i]).1), view.half_height, view.height_px)?;
    Some((columns, rows))
}

impl Segment {
    /// What is left of it from depth `front` on.
    pub(in crate::render) fn behind(self, front: f64) -> Option<Self> {
        if self.far <= front {
            return None;
        }
        let mut cut = self;
        if self.near < front {
            let f = (front - self.near) / (self.far - self.near);
            cut.near = front;
            cut.scalar_near = self.scalar_near + f * (self.scalar_far - self.scalar_near);
            cut.value_near = self.value_near + f * (self.value_far - self.value_near);
        }
        Some(cut)
    }
}

/// Segments sorted by their near end, each shortened to begin where the ones before it end, from depth `front` on.
pub(super) fn without_overlap(front: f64, sorted: impl Iterator<Item = Segment>) -> impl Iterator<Item = Segment> {
    let mut front = front;
    sorted.filter_map(move |segment| {
        let left = segment.behind(front)?;
        front = left.far;
        Some(left)
    })
}
