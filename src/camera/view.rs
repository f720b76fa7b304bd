//! From a camera to the view frame and the rays of its pixels.

use super::{Camera, CameraError, Projection, Samples, unit};
use glam::DVec3;
use std::ops::Range;

/// An orthonormal view frame and the image plane of a given size in pixels.
///
/// The ray of image-plane point (px, py) is, in view coordinates, `(px * w, py * w, w)` (perspective) or `(px, py, w)`
/// (parallel) over depth w; a step dw in depth is a length of [`View::length_per_depth`] * dw.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The eye, world.
    pub eye: DVec3,
    /// Unit vector to the right, world.
    pub right: DVec3,
    /// Unit vector upwards in the image, world.
    pub up: DVec3,
    /// Unit vector of the viewing direction, world.
    pub forward: DVec3,
    /// Whether the projection is perspective.
    pub perspective: bool,
    /// Near distance, world; negative infinity for parallel projection.
    pub near: f64,
    /// Half width of the image plane: at depth 1 (perspective) or in world units (parallel).
    pub half_width: f64,
    /// Half height, as `half_width`.
    pub half_height: f64,
    /// Pixels per row of the image.
    pub width_px: usize,
    /// Rows of the image.
    pub height_px: usize,
    /// The pixels for which rays are cast.
    pub samples: Samples,
}

/// Below this sine between viewing direction and up (sqrt of the f64 rounding unit) the cross product has lost half of its
/// digits, and another up is taken.
const DEGENERATE_SINE: f64 = 1.5e-8;

impl Camera {
    /// The view frame of an image of `width_px` x `height_px` pixels.
    ///
    /// An up that is zero or parallel to the viewing direction is replaced by +Z, or +Y where that is parallel too.
    ///
    /// # Errors
    /// If a field is not finite, position and focal point coincide, the angle is outside (0, 180), the parallel scale or
    /// the near distance is out of range, or the image has no pixels or more than [`u32::MAX`].
    pub fn view(&self, width_px: usize, height_px: usize) -> Result<View, CameraError> {
        check_size((width_px, height_px))?;
        let (forward, right) = self.forward_and_right()?;
        let half_height = self.half_height()?;
        let half_width = half_height * (width_px as f64 / height_px as f64);
        if !(half_width.is_normal() && half_height.is_normal()) {
            return Err(CameraError::NotFinite("image plane"));
        }
        if !self.near.is_finite() {
            return Err(CameraError::NotFinite("near distance"));
        }
        if self.near < 0.0 {
            return Err(CameraError::BadNear(self.near));
        }
        let perspective = matches!(self.projection, Projection::Perspective { .. });
        Ok(View {
            eye: self.position,
            right,
            up: right.cross(forward).normalize(),
            forward,
            perspective,
            near: if perspective { self.near } else { f64::NEG_INFINITY },
            half_width,
            half_height,
            width_px,
            height_px,
            samples: Samples::ALL,
        })
    }

    /// Half height of the image plane at depth 1 (perspective) or in world units (parallel).
    fn half_height(&self) -> Result<f64, CameraError> {
        match self.projection {
            Projection::Perspective { view_angle } if view_angle > 0.0 && view_angle < 180.0 => {
                Ok((0.5 * view_angle.to_radians()).tan())
            }
            Projection::Perspective { view_angle } => Err(CameraError::BadAngle(view_angle)),
            Projection::Parallel { scale } if scale > 0.0 && scale.is_finite() => Ok(scale),
            Projection::Parallel { scale } => Err(CameraError::BadScale(scale)),
        }
    }

    /// Unit vectors forward and right.
    pub(super) fn forward_and_right(&self) -> Result<(DVec3, DVec3), CameraError> {
        for (name, v) in [("position", self.position), ("focal point", self.focal_point), ("up", self.view_up)] {
            if !v.is_finite() {
                return Err(CameraError::NotFinite(name));
            }
        }
        if self.position == self.focal_point {
            return Err(CameraError::NoDirection);
        }
        let forward = unit(self.focal_point - self.position).ok_or(CameraError::NotFinite("distance"))?;
        let ups = [self.view_up, DVec3::Z, DVec3::Y];
        let sideways = ups.into_iter().filter_map(unit).map(|up| forward.cross(up));
        let right = sideways.into_iter().find(|r| r.length() > DEGENERATE_SINE);
        // Z and Y cannot both be parallel to the direction.
        let right = right.map(DVec3::normalize).ok_or(CameraError::NoDirection)?;
        Ok((forward, right))
    }
}

/// Checks that an image can have this width and height.
pub(crate) fn check_size((width_px, height_px): (usize, usize)) -> Result<(), CameraError> {
    match width_px.checked_mul(height_px) {
        Some(0) => Err(CameraError::NoPixels(width_px, height_px)),
        Some(pixels) if u32::try_from(pixels).is_ok() => Ok(()),
        _ => Err(CameraError::TooManyPixels(width_px, height_px)),
    }
}

impl View {
    /// Width and height of the rendered plane: pixels of the lattice per row and rows of it, or one row of listed pixels.
    pub fn plane_px(&self) -> (usize, usize) {
        match &self.samples {
            Samples::Lattice(lattice) => (lattice.count(self.width_px), lattice.count(self.height_px)),
            Samples::Pixels(pixels) => (pixels.len(), 1),
        }
    }

    /// Number of rays: one for each pixel of the rendered plane.
    pub(crate) fn ray_count(&self) -> u64 {
        let (columns, rows) = self.plane_px();
        columns as u64 * rows as u64
    }

    /// Depth at which rays start: the near distance, but at least 0 in perspective; parallel rays may start anywhere.
    pub fn near_depth(&self) -> f64 {
        if self.perspective { self.near.max(0.0) } else { f64::NEG_INFINITY }
    }

    /// Whether a ray is cast for a pixel.
    #[inline]
    pub fn renders(&self, column: usize, row: usize) -> bool {
        match &self.samples {
            Samples::Lattice(lattice) => lattice.has(column, self.width_px) && lattice.has(row, self.height_px),
            Samples::Pixels(pixels) => pixels.in_row(row, column..column + 1).next().is_some(),
        }
    }

    /// The pixels for which rays are cast in a range of columns of a row, from left to right: their columns and their indices in the
    /// rendered plane.
    pub fn rendered_in(&self, row: usize, columns: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
        let (width, height) = (self.width_px, self.height_px);
        let (of_lattice, of_set) = match &self.samples {
            Samples::Lattice(lattice) => {
                let of_row = lattice.first_from(row, height) * lattice.count(width);
                let found = lattice.has(row, height).then(|| {
                    let places = lattice.first_from(columns.start, width)..lattice.first_from(columns.end, width);
                    places.map(move |at| (lattice.pixel(at, width), of_row + at))
                });
                (found, None)
            }
            Samples::Pixels(pixels) => (None, Some(pixels.in_row(row, columns))),
        };
        of_lattice.into_iter().flatten().chain(of_set.into_iter().flatten())
    }

    /// Column and row of the pixel at an index of the rendered plane.
    pub fn pixel_at(&self, place: usize) -> (usize, usize) {
        match &self.samples {
            Samples::Lattice(lattice) => {
                let columns = lattice.count(self.width_px);
                let (column, row) = (place % columns, place / columns);
                (lattice.pixel(column, self.width_px), lattice.pixel(row, self.height_px))
            }
            Samples::Pixels(pixels) => pixels.pixel(place),
        }
    }

    /// Whether rays are cast for any pixel of a rectangle.
    pub fn renders_some_in(&self, columns: Range<usize>, mut rows: Range<usize>) -> bool {
        self.samples == Samples::ALL && !columns.is_empty() && !rows.is_empty()
            || rows.any(|row| self.rendered_in(row, columns.clone()).next().is_some())
    }

    /// Range of image rows with the pixels at `places`, indices of the rendered plane; rows between them may have none.
    pub fn rows_of(&self, places: Range<usize>) -> Range<usize> {
        match &self.samples {
            Samples::Lattice(lattice) => {
                let columns = lattice.count(self.width_px);
                let end = places.end.div_ceil(columns);
                let end = if end == 0 { 0 } else { lattice.pixel(end - 1, self.height_px) + 1 };
                lattice.pixel(places.start / columns, self.height_px)..end
            }
            Samples::Pixels(pixels) => {
                let row = |place| pixels.pixel(place).1;
                let (first, last) = (places.clone().map(row).min(), places.map(row).max());
                first.zip(last).map_or(0..0, |(first, last)| first..last + 1)
            }
        }
    }

    /// Image-plane coordinates of the centre of pixel (`px_i`, `px_j`): column from the left, row from the top.
    pub fn ray(&self, px_i: usize, px_j: usize) -> (f64, f64) {
        self.ray_at(px_i as f64 + 0.5, px_j as f64 + 0.5)
    }

    /// Image-plane coordinates of a position in pixels, `x_px` from the left and `y_px` from the top.
    pub fn ray_at(&self, x_px: f64, y_px: f64) -> (f64, f64) {
        let x = x_px / self.width_px as f64 * 2.0 - 1.0;
        let y = 1.0 - y_px / self.height_px as f64 * 2.0;
        (x * self.half_width, y * self.half_height)
    }

    /// World length along the ray of image-plane point (`px`, `py`) per unit of depth.
    pub fn length_per_depth(&self, px: f64, py: f64) -> f64 {
        if self.perspective { (1.0 + px * px + py * py).sqrt() } else { 1.0 }
    }

    /// View coordinates (x right, y up, w forward) of a world point. The eye is subtracted in f64, so that a scene far
    /// from the origin keeps its digits.
    pub fn to_view(&self, world: DVec3) -> DVec3 {
        let d = world - self.eye;
        DVec3::new(self.right.dot(d), self.up.dot(d), self.forward.dot(d))
    }
}
