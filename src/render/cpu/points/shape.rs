//! The shape of a point, from the corners of its cell.

use super::super::raster::boxes::{Bounds, BoxSource, ScreenPoint, box_of_hull, pixels_of};
use super::super::ray::ViewVertex;
use super::super::splat::ellipsoid::{Chord, Ellipsoid, half_pixel, weights_in_tet};
use super::tets::Corners;
use crate::camera::View;
use crate::field::Scalars;
use crate::mesh::Mesh;
use crate::render::RenderJob;
use crate::render::points::{Compositing, Footprint, PointStyle};
use glam::DVec3;
use std::f64::consts::PI;

/// What shapes of points are made from.
pub(super) struct ShapeSource<'a> {
    pub(super) view: &'a View,
    pub(super) vertices: &'a [ViewVertex],
    tets: &'a [[u32; 4]],
    /// Radii of a cloud.
    radii: Option<&'a [f32]>,
    mesh: &'a Mesh,
    scalars: &'a Scalars,
    pub(super) style: PointStyle,
    /// L^-1/2.
    enlarged_by: f64,
    /// Cells that a point stands for: L^-2.
    stands_for: f64,
    /// Least half width of a footprint on the image plane; 0 if rays decide.
    least: f64,
}

/// A point in view coordinates.
pub(super) struct Point {
    pub(super) cell: u32,
    pub(super) shape: Shape,
    /// The centroid.
    pub(super) center: DVec3,
    /// Mean scalar of the corners, or the cell's.
    pub(super) mean: f64,
    /// Scalars of the corners, for the scalar within.
    scalars: [f64; 4],
    /// Volume of the cells that it stands for.
    volume: f64,
    is_enlarged: bool,
}

/// The shape of a point.
pub(super) enum Shape {
    /// The middle and half width of a square on the image plane.
    Square([f64; 2], f64),
    /// An ellipsoid, or a ball.
    Round(Ellipsoid),
    /// A tet, and its length along a ray over that of the cell for which it stands.
    Tet(Corners, f64),
}

/// Sorts corners by their coordinates and scalars: sums over them then do not depend on the order in which the cell has them.
fn by_coordinates(mut corners: [ViewVertex; 4]) -> [ViewVertex; 4] {
    let key = |v: &ViewVertex| (v.w, v.x, v.y, v.s);
    for (a, b) in [(0, 1), (2, 3), (0, 2), (1, 3), (1, 2)] {
        if key(&corners[b]) < key(&corners[a]) {
            corners.swap(a, b);
        }
    }
    corners
}

fn place_of(v: &ViewVertex) -> DVec3 {
    DVec3::new(v.x, v.y, v.w)
}

impl<'a> ShapeSource<'a> {
    pub(super) fn new(vertices: &'a [ViewVertex], job: &'a RenderJob, view: &'a View, style: PointStyle) -> Self {
        let least = if style.is_exact() { 0.0 } else { half_pixel(view) };
        let (enlarged_by, stands_for) = (style.lod.powf(-0.5), style.lod.powi(-2));
        let (tets, radii, scalars) = (&job.mesh.topology.tets[..], job.mesh.radii.as_deref(), &job.scalars);
        let mesh = &*job.mesh;
        Self { view, vertices, tets, radii, mesh, scalars, style, enlarged_by, stands_for, least }
    }

    /// Whether round footprints are balls, of one scalar.
    fn are_balls(&self) -> bool {
        self.style.footprint == Footprint::Circle || self.radii.is_some()
    }

    /// Whether cells have the scalars, and so the values of a joint table's rows.
    pub(super) fn has_cell_scalars(&self) -> bool {
        matches!(self.scalars, Scalars::Cells(_))
    }

    /// Whether points are whole cells, at their places.
    pub(super) fn are_cells(&self) -> bool {
        self.style.is_exact()
    }

    fn corners(&self, cell: u32) -> [ViewVertex; 4] {
        by_coordinates(self.tets[cell as usize].map(|v| self.vertices[v as usize]))
    }

    /// Pixels of a point, its least depth, and whether it was widened; `None` if it has none. `screen`: image positions of all vertices, if
    /// points are whole cells.
    #[inline(always)]
    pub(super) fn place(&self, cell: u32, screen: &[ScreenPoint]) -> Option<(Bounds, f64, bool)> {
        if self.are_cells() {
            let (view, ids) = (self.view, self.tets[cell as usize]);
            let source = BoxSource { view, vertices: self.vertices, screen };
            // False for NaN. What is not behind the near distance is not after rounding.
            let is_in_front = f64::from(source.furthest(ids)) >= f64::from(view.near_depth() as f32);
            let bounds = if is_in_front { source.bounds(ids) } else { None };
            return bounds.map(|bounds| (bounds, f64::from(source.nearest(ids)), false));
        }
        let point = self.point(cell)?;
        match &point.shape {
            Shape::Tet(corners, _) => self.box_of(corners, point.is_enlarged),
            Shape::Square([x, y], half) => {
                let range = [[x - half, x + half], [y - half, y + half]];
                Some((pixels_of(self.view, range)?, point.center.z, point.is_enlarged))
            }
            Shape::Round(of) => {
                let depth = of.center.z - of.rows[2].length();
                Some((pixels_of(self.view, of.bounds(self.view.perspective)?)?, depth, point.is_enlarged))
            }
        }
    }

    fn box_of(&self, corners: &[ViewVertex; 4], is_enlarged: bool) -> Option<(Bounds, f64, bool)> {
        let nearest = corners.iter().fold(f64::INFINITY, |least, v| least.min(v.w));
        Some((box_of_hull(self.view, corners)?, nearest, is_enlarged))
    }

    /// A point; `None` if it has no shape in front of the eye.
    #[inline(always)]
    pub(super) fn point(&self, cell: u32) -> Option<Point> {
        if self.are_cells() && !self.style.constant_scalar {
            // Nothing else is asked of these.
            let [a, b, c, d] = self.tets[cell as usize];
            let vertex = |v: u32| self.vertices[v as usize];
            let corners = [vertex(a), vertex(b), vertex(c), vertex(d)];
            let (shape, center, scalars) = (Shape::Tet(corners, 1.0), DVec3::ZERO, [0.0; 4]);
            return Some(Point { cell, shape, center, mean: 0.0, scalars, volume: 0.0, is_enlarged: false });
        }
        let corners = self.corners(cell);
        let places = [0, 1, 2, 3].map(|i| place_of(&corners[i]));
        let [a, b, c, d] = places;
        let center = 0.25 * ((a + b) + (c + d));
        let radius = self.radii.map(|radii| f64::from(radii[cell as usize]));
        let volume = match radius {
            // The thickness of a ball is the chord, times its filling.
            Some(_) => self.mesh.cell_volume(cell),
            None => (b - a).cross(c - a).dot(d - a).abs() / 6.0,
        };
        let scalars = corners.map(|v| v.s);
        let mean = match self.scalars {
            Scalars::Vertices(_) => 0.25 * ((scalars[0] + scalars[1]) + (scalars[2] + scalars[3])),
            Scalars::Cells(values) => f64::from(values[cell as usize]),
        };
        let farthest = || places.iter().fold(0.0f64, |most, p| most.max(p.distance_squared(center))).sqrt();
        let radius = radius.unwrap_or_else(farthest);
        let (shape, is_enlarged) = self.shape(corners, (center, radius))?;
        Some(Point { cell, shape, center, mean, scalars, volume: volume * self.stands_for, is_enlarged })
    }

    #[inline(always)]
    fn shape(&self, corners: [ViewVertex; 4], (center, radius): (DVec3, f64)) -> Option<(Shape, bool)> {
        let Self { style, least, enlarged_by, .. } = *self;
        let perspective = self.view.perspective;
        let per_plane = if perspective { center.z } else { 1.0 };
        if !radius.is_finite() || !center.is_finite() {
            return None;
        }
        let scale = style.radius * enlarged_by;
        match style.footprint {
            Footprint::Square if per_plane <= 0.0 => None,
            Footprint::Square => {
                let half = scale * radius / per_plane;
                let middle = [center.x / per_plane, center.y / per_plane];
                Some((Shape::Square(middle, half.max(least)), half < least))
            }
            Footprint::Circle | Footprint::Ellipse => {
                let of = if self.are_balls() {
                    Ellipsoid::ball(center, radius)
                } else {
                    Ellipsoid::of_tet([0, 1, 2, 3].map(|i| place_of(&corners[i])))
                };
                let of = of.scaled(scale);
                let widened = of.widened(perspective, least);
                Some((Shape::Round(widened.unwrap_or(of)), widened.is_some()))
            }
            Footprint::Exact => {
                let size = enlarged_by * radius;
                let wide = if per_plane > 0.0 && size < least * per_plane { least * per_plane / size } else { 1.0 };
                // A cell without extent has no shape.
                let by = Some(enlarged_by * wide).filter(|by| by.is_finite())?;
                let corners = corners.map(|v| {
                    let p = center + by * (place_of(&v) - center);
                    ViewVertex { x: p.x, y: p.y, w: p.z, s: v.s }
                });
                Some((Shape::Tet(corners, enlarged_by / (wide * wide)), wide > 1.0))
            }
        }
    }
}

/// A point on a ray, as the others but *exact* have it.
pub(super) struct Slab {
    /// Depth of the middle.
    pub(super) middle: f64,
    /// Thickness in depth.
    pub(super) thickness: f64,
    pub(super) scalar: f64,
}

impl Point {
    /// The slab of a ray through a square or round footprint; `None` if it misses, or hits behind the eye.
    #[inline(always)]
    pub(super) fn slab(&self, source: &ShapeSource<'_>, (px, py): (f64, f64)) -> Option<Slab> {
        let slab = match &self.shape {
            Shape::Tet(..) => None,
            Shape::Square([x, y], half) => {
                let is_hit = (px - x).abs() <= *half && (py - y).abs() <= *half;
                let per_plane = if source.view.perspective { self.center.z } else { 1.0 };
                let width = 2.0 * half * per_plane;
                let thickness = self.volume / (width * width);
                is_hit.then_some(Slab { middle: self.center.z, thickness, scalar: self.mean })
            }
            Shape::Round(of) => {
                let chord = of.chord(source.view.perspective, (px, py))?;
                let Chord { q, middle, at, area } = chord;
                let reaches_eye = source.view.perspective && of.center.z <= of.rows[2].length();
                if reaches_eye && middle + chord.half_depth(of.det()) <= 0.0 {
                    return None;
                }
                let thickness = 1.5 / PI * self.volume * (1.0 - q).max(0.0).sqrt() / area;
                let is_ball = source.are_balls();
                let middle = if is_ball { self.nearest_to_center(source.view.perspective, (px, py)) } else { middle };
                let has_one = is_ball || source.style.constant_scalar;
                let scalar = if has_one { self.mean } else { self.scalar_at(at, source.style.radius) };
                Some(Slab { middle, thickness, scalar })
            }
        }?;
        Some(match source.style.compositing {
            Compositing::Own => slab,
            Compositing::Gap => Slab { middle: self.center.z, scalar: self.mean, ..slab },
        })
    }

    /// Depth at which the ray of an image-plane point is nearest to the centre: that of the middle of a ball's chord, which does not depend
    /// on the radius, so that balls of one centre have it to the bit.
    #[inline(always)]
    fn nearest_to_center(&self, perspective: bool, (px, py): (f64, f64)) -> f64 {
        let c = self.center;
        let slope = if perspective { [px, py] } else { [0.0; 2] };
        let [x, y] = [c.x - slope[0] * c.z, c.y - slope[1] * c.z];
        c.z + (x * slope[0] + y * slope[1]) / (1.0 + slope[0] * slope[0] + slope[1] * slope[1])
    }

    /// The scalar at a point `at` of the unit sphere of the ellipsoid, which is `radius` times the cell's own; within the corners' range.
    #[inline(always)]
    fn scalar_at(&self, at: [f64; 3], radius: f64) -> f64 {
        let weights = weights_in_tet(at.map(|u| radius * u));
        // Relative to one corner's: a constant scalar stays exact, as it may lie on a step of the table.
        let [first, rest @ ..] = self.scalars;
        let rise: f64 = rest.iter().zip(&weights[1..]).map(|(s, weight)| weight * (s - first)).sum();
        let (lo, hi) = self.scalars.iter().fold((first, first), |(lo, hi), &s| (lo.min(s), hi.max(s)));
        (first + rise).clamp(lo, hi)
    }
}
