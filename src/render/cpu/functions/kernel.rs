//! One function in view coordinates.

use super::super::raster::TileRays;
use super::super::raster::boxes::{Bounds, pixels_of};
use super::super::splat::ellipsoid::{Ellipsoid, half_pixel};
use crate::camera::View;
use crate::functions::Placed;
use glam::DVec3;

/// Largest squared distance in a function's box for which products go from sheet to sheet: half of it is an exponent that f32 has room for,
/// both as a height and, inverted, as a factor.
pub(super) const MOST: f64 = 120.0;

/// A function in view coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    /// Its centre.
    center: DVec3,
    /// L^-1 times the view's axes: x right, y up, w forward.
    axes: [DVec3; 3],
}

/// Where a function is in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub(super) bounds: Bounds,
    /// Least and greatest depth.
    pub(super) depths: [f64; 2],
    /// 1 / its least width along the rays of `bounds`, where that is not below [`LEAST_WIDTH`] pixels.
    pub(super) per_width: f64,
    /// Whether it is wider than it was, so that it reaches a pixel.
    pub(super) is_widened: bool,
    /// Whether its distances within are too large for products from sheet to sheet.
    pub(super) is_thin: bool,
}

/// A function as the pixels of a tile see it, in f32: L^-1 (x - mu) is `a` + i `a_x` + j `a_y` + s (`b` + i `b_x` + j `b_y`) for the pixel in
/// column i and row j, s behind the centre.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileKernel {
    pub(super) a: [[f32; 3]; 3],
    pub(super) b: [[f32; 3]; 3],
    /// L^-1 times the view's axes: the gradient of d^2 / 2 along each is its product with L^-1 (x - mu).
    pub(super) axes: [[f32; 3]; 3],
    /// Depth of the centre.
    pub(super) depth: f64,
    /// On row j the nearest place to the centre at s behind it has the squared distance q s^2 + 2 p s + r, whatever its column: q, p and r are
    /// polynomials of j, constants first.
    rows: [[f64; 3]; 3],
}

/// Radius on the screen within which a function has some weight at least, in pixels: more than half the diagonal of one, so that a ray meets it.
const LEAST_RADIUS: f64 = 0.75;

/// Widths along rays count as this at least when sheets are spaced, in pixels at the function's nearest depth: what is finer in depth than in
/// the image is not resolved.
const LEAST_WIDTH: f64 = 0.5;

impl Kernel {
    /// A function that ends at the distance `cut`, and its ellipsoid at the distance 1. What has not [`LEAST_RADIUS`] on the screen is wider.
    fn new(view: &View, function: &Placed, cut: f64) -> (Self, Ellipsoid, bool) {
        let row = |axis: DVec3| {
            let [r0, r1, r2] = function.factor;
            axis.x * r0 + axis.y * r1 + axis.z * r2
        };
        let axes = [view.right, view.up, view.forward];
        let ellipsoid = Ellipsoid { center: view.to_view(function.center), rows: axes.map(row) };
        let least = 2.0 * half_pixel(view) * LEAST_RADIUS / cut;
        match ellipsoid.widened(view.perspective, least) {
            None => {
                (Self { center: ellipsoid.center, axes: axes.map(|axis| function.unscaled(axis)) }, ellipsoid, false)
            }
            Some(wide) => (Self { center: wide.center, axes: inverse(wide.rows) }, wide, true),
        }
    }

    /// A function that ends at the distance `cut` for the rays of a tile.
    pub(super) fn for_tile(view: &View, function: &Placed, cut: f64, rays: &TileRays) -> TileKernel {
        Self::new(view, function, cut).0.in_tile(view, rays)
    }

    /// Where a function that ends at the distance `cut` is; `None` if no ray meets it in front of the eye.
    pub(super) fn extent(view: &View, function: &Placed, cut: f64) -> Option<Extent> {
        let (kernel, unit, is_widened) = Self::new(view, function, cut);
        let ellipsoid = unit.scaled(cut);
        let plane = ellipsoid.bounds(view.perspective)?;
        let half_depth = ellipsoid.rows[2].length();
        let (near, far) = (kernel.center.z - half_depth, kernel.center.z + half_depth);
        if far <= view.near_depth() {
            return None;
        }
        let bounds = pixels_of(view, plane)?;
        let depths = [near.max(view.near_depth()), far];
        let farthest = kernel.farthest(view, bounds, depths);
        let is_thin = farthest > MOST || farthest.is_nan();
        let pixel = 2.0 * half_pixel(view) * if view.perspective { depths[0] } else { 1.0 };
        let per_width = kernel.per_width(view, bounds).min(1.0 / (LEAST_WIDTH * pixel));
        Some(Extent { bounds, depths, per_width, is_widened, is_thin })
    }

    /// 1 / the least width along the rays of some pixels. It is convex in column and row: greatest in a corner.
    fn per_width(&self, view: &View, bounds: Bounds) -> f64 {
        let [x, y, w] = self.axes;
        if !view.perspective {
            return w.length();
        }
        let corners = corners(view, bounds).map(|(px, py)| (w + px * x + py * y).length());
        corners.into_iter().fold(0.0, f64::max)
    }

    /// Greatest squared distance on the rays of some pixels between two depths. It is convex in column, row and depth, each alone: greatest in
    /// a corner.
    fn farthest(&self, view: &View, bounds: Bounds, depths: [f64; 2]) -> f64 {
        let ends = corners(view, bounds)
            .into_iter()
            .flat_map(|at| depths.map(|depth| self.at(view.perspective, at, depth).length_squared()));
        // NaN counts as far.
        ends.fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
    }

    /// L^-1 (x - mu) at a depth on the ray of an image-plane point.
    fn at(&self, perspective: bool, (px, py): (f64, f64), depth: f64) -> DVec3 {
        let [x, y, w] = self.axes;
        let h = if perspective { depth } else { 1.0 };
        (px * h - self.center.x) * x + (py * h - self.center.y) * y + (depth - self.center.z) * w
    }

    /// The function for the rays of a tile.
    fn in_tile(&self, view: &View, rays: &TileRays) -> TileKernel {
        let ([x, y, w], c) = (self.axes, self.center);
        let (px, py) = rays.at(0);
        let step = |half: f64, pixels: usize| 2.0 * half / pixels as f64;
        let (dx, dy) = (step(view.half_width, view.width_px), -step(view.half_height, view.height_px));
        let h = if view.perspective { c.z } else { 1.0 };
        let a = [(px * h - c.x) * x + (py * h - c.y) * y, dx * h * x, dy * h * y];
        let b = if view.perspective { [w + px * x + py * y, dx * x, dy * y] } else { [w, DVec3::ZERO, DVec3::ZERO] };
        // Whatever the column, what is not along x.
        let beside = |v: DVec3| v - v.dot(x) / x.length_squared() * x;
        let [a0, ay, b0, by] = [a[0], a[2], b[0], b[2]].map(beside);
        let product = |u: [DVec3; 2], v: [DVec3; 2]| [u[0].dot(v[0]), u[0].dot(v[1]) + u[1].dot(v[0]), u[1].dot(v[1])];
        let rows = [product([b0, by], [b0, by]), product([a0, ay], [b0, by]), product([a0, ay], [a0, ay])];
        let rounded = |vectors: [DVec3; 3]| vectors.map(|v| v.as_vec3().to_array());
        TileKernel { a: rounded(a), b: rounded(b), axes: rounded(self.axes), depth: c.z, rows }
    }
}

impl TileKernel {
    /// L^-1 (x - mu) at a depth on the ray of a pixel in this column and row.
    pub(super) fn in_widths(&self, column: usize, row: usize, depth: f64) -> [f32; 3] {
        let (i, j, s) = (column as f32, row as f32, (depth - self.depth) as f32);
        let at = |of: &[[f32; 3]; 3], c: usize| of[0][c] + i * of[1][c] + j * of[2][c];
        std::array::from_fn(|c| at(&self.a, c) + s * at(&self.b, c))
    }

    /// Between which depths behind the centre a row has places nearer than `cut` to it; `None` if it has none.
    #[inline(always)]
    pub(super) fn on_row(&self, row: usize, cut: f64) -> Option<[f64; 2]> {
        let j = row as f64;
        let [q, p, r] = self.rows.map(|[c0, c1, c2]| c0 + j * (c1 + j * c2));
        let root = (p * p - q * (r - cut * cut)).sqrt();
        // NaN where there is none.
        (root >= 0.0).then(|| [(-p - root) / q, (-p + root) / q])
    }
}

/// The columns of the inverse of a matrix with these rows.
fn inverse([x, y, w]: [DVec3; 3]) -> [DVec3; 3] {
    let columns = [y.cross(w), w.cross(x), x.cross(y)];
    let per_det = 1.0 / x.dot(columns[0]);
    columns.map(|column| per_det * column)
}

/// The image-plane points of the corners of some pixels.
fn corners(view: &View, bounds: Bounds) -> [(f64, f64); 4] {
    let Bounds { x0, x1, y0, y1 } = bounds;
    [(x0, y0), (x1 - 1, y0), (x0, y1 - 1), (x1 - 1, y1 - 1)].map(|(x, y)| view.ray(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::functions::{Kernels, random_factor};
    use crate::mesh::test_meshes::Random;
    use glam::Vec3;

    /// Cameras from all sides of the unit ball, in perspective and parallel.
    fn views(random: &mut Random) -> Vec<View> {
        let camera = Camera::default_for((DVec3::splat(-1.0), DVec3::splat(1.0))).unwrap();
        let mut turned = || camera.orbit(180.0 * random.signed(), 80.0 * random.signed()).unwrap();
        let parallel = |camera| Camera { projection: Projection::Parallel { scale: 2.0 }, ..camera };
        let camera = |i| if i % 2 == 0 { turned() } else { parallel(turned()) };
        (0..16).map(camera).map(|camera| camera.view(32, 32).unwrap()).collect()
    }

    #[test]
    fn sections_with_sheets_are_the_gaussian_in_space_and_those_of_the_conic() {
        let mut random = Random::new(17);
        let views = views(&mut random);
        let (mut most, mut most_of_conic, mut needles) = (0.0f64, 0.0f64, 0);
        for round in 0..1_000_000 {
            let factor = random_factor(&mut random).map(|width| 3.0 * width);
            needles += u32::from(factor[5] < 0.01 * factor[0] || factor[0] < 0.01 * factor[5]);
            let center = 0.5 * Vec3::new(random.signed() as f32, random.signed() as f32, random.signed() as f32);
            let kernels = Kernels::new(vec![center], vec![factor], 3.0).unwrap();
            let function = kernels.get(0).unwrap();
            let view = &views[round % views.len()];
            // As the sheet has it: narrower than a pixel it would be another function.
            let axes = [view.right, view.up, view.forward];
            let kernel =
                Kernel { center: view.to_view(function.center), axes: axes.map(|axis| function.unscaled(axis)) };
            // A place within.
            let in_widths = 1.7 * DVec3::new(random.signed(), random.signed(), random.signed());
            let [a, b, c] = function.factor;
            let place = function.center + DVec3::new(a.dot(in_widths), b.dot(in_widths), c.dot(in_widths));
            let at = view.to_view(place);
            if view.perspective && at.z < 0.5 {
                // Image-plane points of places beside the eye are anywhere.
                continue;
            }
            let (px, py) = if view.perspective { (at.x / at.z, at.y / at.z) } else { (at.x, at.y) };
            let height = |d: f64| (-0.5 * d).exp();
            let expected = height(in_widths.length_squared());
            most = most.max((height(kernel.at(view.perspective, (px, py), at.z).length_squared()) - expected).abs());
            // The conic on the sheet: Q_xy about mu_xy + S_xz / S_zz (z - mu_z), and what it has at its middle.
            let rows = axes.map(|axis| axis.x * a + axis.y * b + axis.z * c);
            let (szz, away) = (rows[2].length_squared(), at - kernel.center);
            let moved = [0, 1].map(|i| away[i] - rows[i].dot(rows[2]) / szz * away.z);
            let beside = moved[0] * kernel.axes[0] + moved[1] * kernel.axes[1];
            let of_conic = height(beside.length_squared()) * height(away.z * away.z / szz);
            most_of_conic = most_of_conic.max((of_conic - expected).abs());
        }
        println!("{most:.1e} {most_of_conic:.1e}, {needles} needles");
        // Places some lengths from the eye are rounded by 2^-52 of that, by a thousand times as many widths of a needle.
        assert!(most < 1e-12 && most_of_conic < 1e-12 && needles > 10_000, "{most} {most_of_conic} {needles}");
    }
}
