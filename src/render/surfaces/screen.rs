//! Lighting of the nearest surface in image space.
//!
//! The renderer leaves colours unlit and returns the depth of the nearest surface; this depth is smoothed where faces were left out,
//! normals are central differences of it, and colours are multiplied by the light (dissertation 6.1.3.2, after Livnat and Tricoche 2004).
//!
//! ```text
//! depth, id -> smoothed (faces left out) -> positions -> normal = horizontal x vertical difference -> light -> colour
//! ```
//! A difference is central where both neighbours lie on the same surface, and one-sided where one of them lies on another surface, or so
//! much farther away that the surface ends in between.
//!
//! Normals and numbers take a second pass over the surfaces alone, with the normal and number of the nearest surface as colour and
//! opacity, on the CPU whatever renders the frame.
//!
//! The lower row of figure 6.4 on the torso (`tests/it/surfaces.rs`: a close view of 320 x 240 pixels, faces by the coefficient of variation, light
//! by `screen`): holes, and root mean square angles to the facets of all faces and to smooth normals of all cells. Smoothing takes the picture away
//! from the facets and towards the smooth surface; holes at the outline are not closed.
//!
//! ```text
//! faces     plain: holes, to facets, to smooth     smoothed: holes, to facets, to smooth
//! 100 %              0        0         44.1                   0        0         44.1
//!  50 %             25        9.9       37.5                  23       18.8       34.2
//!  25 %             68       12.1       32.9                  68       17.3       30.2
//!  10 %            117       17.3       21.4                 117       18.9       16.3
//! ```

use super::{Normals, SurfaceShading};
use crate::camera::View;
use crate::image::{DepthImage, Plane, Planes};
use glam::DVec3;
use rayon::prelude::*;

/// A neighbour is beyond an edge if its depth difference is this many times that of the opposite neighbour.
const EDGE: f64 = 8.0;

/// Weights of a row or a column of the smoothing pass, in sixteenths.
const BINOMIAL: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

/// For the smoothing pass, an edge separates depths that differ by more than this many pixel lengths per pixel.
const STEEP: f64 = 4.0;

/// A pixel without a surface is a hole if pixels with surfaces have this share of the weights: at a straight edge they have less than a
/// third.
const HOLE: f64 = 0.6;

/// Brightness of the farthest surface of a mesh when shaded by depth.
const FARTHEST: f64 = 0.25;

/// Ambient occlusion samples up to this distance, as a fraction of the image height, in this many directions at this many distances.
const REACH: f64 = 0.06;
const DIRECTIONS: usize = 8;
const DISTANCES: usize = 3;
/// Occluders lower than this fraction of their distance above a pixel's plane are curvature of the surface itself.
const BIAS: f64 = 0.1;

/// Sets the planes of normals and numbers from the image of a job's [guides](crate::render::RenderJob::of_guides); returns the depths of
/// the nearest surface.
pub(crate) fn set_guides(planes: &mut Planes, guides: &Planes) -> DepthImage {
    let Plane { width, height, ref pixels } = guides.color;
    let of = |[x, y, z, number]: [f32; 4]| ([x, y, z], number as u32);
    let (normal, id) = pixels.iter().map(|&pixel| of(pixel)).unzip();
    planes.normal = Plane { width, height, pixels: normal };
    planes.id = Plane { width, height, pixels: id };
    guides.depth.clone()
}

/// Inputs of lighting in image space.
#[derive(Debug)]
pub(crate) struct Screen {
    pub(crate) view: View,
    pub(crate) shading: SurfaceShading,
    /// Least and greatest depth of the mesh in the view.
    pub(crate) depth_range: (f64, f64),
    /// Number of isosurfaces: greater numbers are sections, which are unlit.
    pub(crate) isosurfaces: u32,
    /// Whether faces were left out.
    pub(crate) is_thinned: bool,
}

impl Screen {
    /// Lights the nearest surface from its normals, numbers and depths; stores the normals used.
    pub(crate) fn light(&self, planes: &mut Planes, mut depth: DepthImage) {
        if self.is_thinned && self.shading.smooth {
            depth = smoothed(planes, &depth, |depth| self.pixel_length(depth));
        }
        if self.shading.normals == Normals::Screen {
            planes.normal = self.normals(&depth, &planes.id);
        }
        let width = planes.color.width;
        let factors: Vec<f32> = (0..planes.color.pixels.len())
            .into_par_iter()
            .map(|pixel| {
                if !(1..=self.isosurfaces).contains(&planes.id.pixels[pixel]) {
                    return 1.0;
                }
                let (column, row) = (pixel % width, pixel / width);
                let normal = DVec3::from(planes.normal.pixels[pixel].map(f64::from));
                let mut factor = match self.shading.normals {
                    Normals::Screen => self.facing(normal, column, row),
                    Normals::Depth => self.nearness(f64::from(depth.pixels[pixel])),
                    Normals::None | Normals::Cell | Normals::Vertex => 1.0,
                };
                if self.shading.ambient_occlusion {
                    factor *= self.openness(&depth, &planes.id, normal, (column, row));
                }
                factor as f32
            })
            .collect();
        for ([r, g, b, _], factor) in planes.color.pixels.iter_mut().zip(factors) {
            [r, g, b].into_iter().for_each(|c| *c *= factor);
        }
    }

    /// The visible point of a pixel at a depth, world coordinates relative to the eye.
    fn point(&self, column: usize, row: usize, depth: f64) -> DVec3 {
        let View { right, up, forward, perspective, .. } = self.view;
        let (px, py) = self.view.ray(column, row);
        let spread = if perspective { depth } else { 1.0 };
        spread * px * right + spread * py * up + depth * forward
    }

    /// World length of a pixel at a depth.
    fn pixel_length(&self, depth: f64) -> f64 {
        let View { half_height, height_px, perspective, .. } = self.view;
        2.0 * half_height / height_px as f64 * if perspective { depth.abs() } else { 1.0 }
    }

    /// Unit vector towards the eye from the visible point of a pixel.
    fn to_eye(&self, column: usize, row: usize) -> DVec3 {
        let View { right, up, forward, perspective, .. } = self.view;
        let (px, py) = self.view.ray(column, row);
        -(if perspective { px * right + py * up + forward } else { forward }).normalize()
    }

    /// Normals from depth differences.
    fn normals(&self, depth: &DepthImage, id: &Plane<u32>) -> Plane<[f32; 3]> {
        let (width, height) = (depth.width, depth.height);
        let place = |column: usize, row: usize| row * width + column;
        let at = |column: usize, row: usize| self.point(column, row, f64::from(depth.pixels[place(column, row)]));
        let normal = |pixel: usize| {
            let (column, row) = (pixel % width, pixel / width);
            let number = id.pixels[pixel];
            if number == 0 {
                return [0.0; 3];
            }
            // Between the two neighbours, or between one and the pixel itself.
            let difference = |before: Option<(usize, usize)>, after: Option<(usize, usize)>| {
                let on_surface = |n: &(usize, usize)| id.pixels[place(n.0, n.1)] == number;
                let off = |n: (usize, usize)| f64::from(depth.pixels[place(n.0, n.1)] - depth.pixels[pixel]).abs();
                let (before, after) = (before.filter(on_surface), after.filter(on_surface));
                let (from, to) = match (before, after) {
                    (Some(a), Some(b)) if off(a) > EDGE * off(b) && off(b) > 0.0 => ((column, row), b),
                    (Some(a), Some(b)) if off(b) > EDGE * off(a) && off(a) > 0.0 => (a, (column, row)),
                    (Some(a), Some(b)) => (a, b),
                    (Some(a), None) => (a, (column, row)),
                    (None, Some(b)) => ((column, row), b),
                    (None, None) => return DVec3::ZERO,
                };
                at(to.0, to.1) - at(from.0, from.1)
            };
            let across = difference(column.checked_sub(1).map(|c| (c, row)), next(column, width).map(|c| (c, row)));
            let down = difference(row.checked_sub(1).map(|r| (column, r)), next(row, height).map(|r| (column, r)));
            let normal = across.cross(down).normalize_or_zero();
            let turned = if normal.dot(self.to_eye(column, row)) < 0.0 { -normal } else { normal };
            turned.as_vec3().to_array()
        };
        Plane { width, height, pixels: (0..width * height).into_par_iter().map(normal).collect() }
    }

    /// The cosine between a normal towards the eye and the light; 1 without a normal.
    fn facing(&self, normal: DVec3, column: usize, row: usize) -> f64 {
        let toward = self.shading.towards_light().unwrap_or_else(|| self.to_eye(column, row));
        if normal == DVec3::ZERO { 1.0 } else { normal.dot(toward).max(0.0) }
    }

    /// Brightness by depth: 1 at the near end of the mesh, [`FARTHEST`] at its far end.
    fn nearness(&self, depth: f64) -> f64 {
        let (near, far) = self.depth_range;
        let share = if far > near { ((depth - near) / (far - near)).clamp(0.0, 1.0) } else { 0.0 };
        1.0 + share * (FARTHEST - 1.0)
    }

    /// The fraction of ambient light that reaches a pixel: 1 - 2 mean of max(0, n . v / |v| - bias) f(|v|) over samples around it in the
    /// image, v the vector to the visible point there, f falling from 1 to 0 at twice the reach (after McGuire et al., "The Alchemy
    /// Screen-Space Ambient Obscurance Algorithm", HPG 2011).
    fn openness(&self, depth: &DepthImage, id: &Plane<u32>, normal: DVec3, (column, row): (usize, usize)) -> f64 {
        let (width, height) = (depth.width, depth.height);
        let here = self.point(column, row, f64::from(depth.pixels[row * width + column]));
        let reach_px = (REACH * height as f64).max(2.0);
        let reach = reach_px * self.pixel_length(f64::from(depth.pixels[row * width + column]));
        if normal == DVec3::ZERO || reach <= 0.0 {
            return 1.0;
        }
        let mut occlusion = 0.0;
        for place in 0..DIRECTIONS * DISTANCES {
            let (direction, distance) = (place % DIRECTIONS, place / DIRECTIONS);
            let angle = std::f64::consts::TAU * (direction as f64 + 0.5 * distance as f64) / DIRECTIONS as f64;
            let radius = reach_px * (distance + 1) as f64 / DISTANCES as f64;
            let (x, y) = (column as f64 + radius * angle.cos(), row as f64 + radius * angle.sin());
            let is_inside = (0.0..width as f64).contains(&x.round()) && (0.0..height as f64).contains(&y.round());
            if !is_inside {
                continue;
            }
            let (x, y) = (x.round() as usize, y.round() as usize);
            if id.pixels[y * width + x] == 0 {
                continue;
            }
            let way = self.point(x, y, f64::from(depth.pixels[y * width + x])) - here;
            let length = way.length();
            if length > 0.0 {
                let falls_off = (1.0 - (length / (2.0 * reach)).powi(2)).max(0.0);
                occlusion += (normal.dot(way) / length - BIAS).max(0.0) * falls_off;
            }
        }
        (1.0 - 2.0 * occlusion / (DIRECTIONS * DISTANCES) as f64).max(0.0)
    }
}

/// The next column or row, if there is one.
fn next(at: usize, count: usize) -> Option<usize> {
    (at + 1 < count).then_some(at + 1)
}

/// Depths without outliers and noise: medians over 3 x 3 pixels, then means over 5 x 5 with binomial weights. Both use pairs of pixels on
/// opposite sides, so that planes are preserved, also at edges: a pair counts if both show a surface, for the mean without an edge in
/// between. Pixels in holes get depth, normal, number and colour of their surroundings.
fn smoothed(planes: &mut Planes, depth: &DepthImage, one_px: impl Fn(f64) -> f64 + Sync) -> DepthImage {
    let (width, height) = (depth.width, depth.height);
    let Planes { color, normal, id, .. } = &*planes;
    let seen = |pixel: usize, dx: isize, dy: isize| {
        let (x, y) = ((pixel % width) as isize + dx, (pixel / width) as isize + dy);
        let is_inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
        let at = is_inside.then(|| y as usize * width + x as usize)?;
        (id.pixels[at] != 0).then_some(at)
    };
    let pair = |pixel: usize, dx: isize, dy: isize| Some((seen(pixel, dx, dy)?, seen(pixel, -dx, -dy)?));
    let median = |pixel: usize| {
        let itself = seen(pixel, 0, 0).map(|at| f64::from(depth.pixels[at]));
        let middle = |(a, b): (usize, usize)| 0.5 * (f64::from(depth.pixels[a]) + f64::from(depth.pixels[b]));
        let pairs = [(1, 0), (0, 1), (1, 1), (1, -1)].into_iter().filter_map(|(dx, dy)| pair(pixel, dx, dy));
        let mut depths: Vec<f64> = itself.into_iter().chain(pairs.map(middle)).collect();
        depths.sort_by(f64::total_cmp);
        depths.get(depths.len() / 2).copied()
    };
    let medians: Vec<Option<f64>> = (0..width * height).into_par_iter().map(median).collect();
    let binomial = |offset: isize| BINOMIAL[(offset + 2) as usize] / 16.0;
    let mean = |pixel: usize| {
        let (Some(middle), mut sum) = (medians[pixel], Around::default()) else { return Around::default() };
        for (dx, dy) in (-2..=2).flat_map(|dy: isize| (-2..=2).map(move |dx: isize| (dx, dy))) {
            let weight = binomial(dx) * binomial(dy);
            sum.all += if seen(pixel, dx, dy).is_some() { weight } else { 0.0 };
            let Some((at, opposite)) = pair(pixel, dx, dy) else { continue };
            let (Some(a), Some(b)) = (medians[at], medians[opposite]) else { continue };
            // Depth differences on a slope grow with the pixel distance.
            let steep = STEEP * dx.abs().max(dy.abs()) as f64 * one_px(middle);
            if (a - middle).abs().max((b - middle).abs()) <= steep {
                sum.weight += weight;
                sum.depth += weight * a;
                sum.normal.iter_mut().zip(normal.pixels[at]).for_each(|(sum, n)| *sum += weight * f64::from(n));
                sum.rgba.iter_mut().zip(color.pixels[at]).for_each(|(sum, c)| *sum += weight * f64::from(c));
                sum.number = sum.number.max(id.pixels[at]);
            }
        }
        sum
    };
    let all: Vec<Around> = (0..width * height).into_par_iter().map(mean).collect();
    let mut smooth = depth.clone();
    for (pixel, Around { all, weight, depth, normal, rgba, number }) in all.into_iter().enumerate() {
        let is_hole = planes.id.pixels[pixel] == 0;
        if weight == 0.0 || is_hole && all < HOLE {
            continue;
        }
        smooth.pixels[pixel] = (depth / weight) as f32;
        if is_hole {
            planes.normal.pixels[pixel] = DVec3::from(normal).normalize_or_zero().as_vec3().to_array();
            planes.id.pixels[pixel] = number;
            planes.color.pixels[pixel] = rgba.map(|c| (c / weight) as f32);
            planes.depth.pixels[pixel] = planes.depth.pixels[pixel].min(smooth.pixels[pixel]);
        }
    }
    smooth
}

/// Weighted sums around a pixel.
#[derive(Clone, Copy, Default)]
struct Around {
    /// Weights of all pixels with a surface.
    all: f64,
    /// Weights of those on the same side of edges.
    weight: f64,
    depth: f64,
    normal: [f64; 3],
    rgba: [f64; 4],
    /// The greatest number: two surfaces may meet in a hole.
    number: u32,
}
