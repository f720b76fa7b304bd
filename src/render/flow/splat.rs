//! A splat on the screen.

use super::kernel::{Kernel, OnScreen};
use super::mixture::Mix;
use super::{FlowScene, IconSums};
use crate::camera::View;
use crate::mesh::Symmetric;
use glam::{DVec2, DVec3};

/// Distance from the centre, in widths of the kernel, at which a splat ends.
pub(in crate::render) const END: f64 = 2.5;

/// Variance of a pixel, in pixels squared, by which every splat is wider.
pub(in crate::render) const PIXEL: f64 = 0.25;

/// Periods per period's length on the screen, at most: below a projected length of 1 / this, patterns are no more compressed but fade.
pub(in crate::render) const COMPRESSED: f64 = 3.0;

/// A splat on the screen; lengths are in pixels, x to the right and y down.
#[derive(Clone, Debug)]
pub(in crate::render) struct Splat {
    /// Local depth of its centre along the view direction.
    pub(super) depth: f64,
    /// The vertex or the cell that it is of.
    pub(super) site: u32,
    pub(super) center: DVec2,
    /// The inverse of the covariance: xx, xy, yy.
    pub(super) form: [f64; 3],
    /// Half of its extent downwards.
    pub(super) half_height: f64,
    /// Direction of the projected vector.
    pub(super) along: DVec2,
    /// Periods per pixel along and across.
    pub(super) frequency: [f64; 2],
    /// Place in the pattern at the centre.
    pub(super) phase: [f64; 2],
    /// Periods of the pattern that pass the centre while the shutter is open.
    pub(super) blur: f64,
    /// Box over which the pattern is averaged, a pixel and the blur: its length, and the level across.
    pub(super) width: f64,
    pub(super) level: u32,
    /// How much of the pattern is left where the vector is nearly along the ray.
    pub(super) contrast: f64,
    pub(super) mix: Mix,
    pub(super) color: [f64; 3],
    /// Whether it has an icon: with a kernel, it may have none.
    pub(super) flows: bool,
    pub(super) kernel: Option<Kernel>,
}

/// From 0 to 1 without a bend at either end.
pub(super) fn smoothstep(at: f64) -> f64 {
    let at = at.clamp(0.0, 1.0);
    at * at * (3.0 - 2.0 * at)
}

/// What a site's splat is before it is projected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unprojected {
    /// Unit vector of the flow; 0 if nothing flows.
    pub(super) direction: DVec3,
    pub(super) color: [f64; 3],
    pub(super) mix: Mix,
    /// Whether it has an icon.
    pub(super) flows: bool,
}

impl Unprojected {
    /// That of a site; `None` if it has no splat.
    pub(super) fn of(scene: &FlowScene, site: u32) -> Option<Self> {
        let vector = scene.vector(site);
        // The length of a vector of large numbers is not finite in itself.
        let direction = (vector / vector.abs().max_element()).normalize_or_zero();
        let (color, mix) = (scene.color(site), scene.mix(site));
        let flows = vector.is_finite() && direction != DVec3::ZERO && color.is_some() && mix.is_some();
        if !(flows || scene.kernels.is_some()) || !scene.shows(site) {
            return None;
        }
        Some(Self { direction, color: color.unwrap_or_default(), mix: mix.unwrap_or_default(), flows })
    }
}

impl Splat {
    /// The splat of a site; `None` if there is none, or none in view.
    pub(super) fn of(scene: &FlowScene, site: u32, view: &View) -> Option<Self> {
        let Unprojected { direction, color, mix, flows } = Unprojected::of(scene, site)?;
        let (at, screen, shape) = Screen::around(scene, site, view)?;
        let ([xx, xy, yy], determinant) = screen.covariance(&shape);
        if !screen.reaches(view, [xx, yy]) {
            return None;
        }
        let form = [yy / determinant, -xy / determinant, xx / determinant];
        if !(form.iter().all(|f| f.is_finite()) && scene.period() > 0.0) {
            return None;
        }
        let kernel = scene.kernels.is_some().then(|| screen.kernel(scene, site, &shape, determinant));
        if kernel.as_ref().is_some_and(Option::is_none) {
            return None;
        }
        let projected = screen.project(direction);
        let length = projected.length();
        let foreshortening = length / screen.per_unit;
        let per_period = scene.period() * screen.per_unit;
        let frequency = [foreshortening.recip().min(COMPRESSED) / per_period, per_period.recip()];
        let blur = if flows { scene.blur(site) } else { 0.0 };
        Some(Self {
            depth: at.z,
            site,
            center: screen.center,
            form,
            half_height: END * yy.sqrt(),
            along: if length > 0.0 { projected / length } else { DVec2::X },
            frequency,
            phase: scene.phase(site),
            blur,
            width: IconSums::width(frequency[0] + blur),
            level: IconSums::level(frequency[1]),
            contrast: scene.style.fidelity.contrast(foreshortening),
            mix,
            color,
            flows,
            kernel: kernel.flatten(),
        })
    }

    /// The depth of a site whose splat is in view, its centre there, and half of its width and height, in pixels.
    #[cfg(feature = "gpu")]
    pub(super) fn extent(scene: &FlowScene, site: u32, view: &View) -> Option<(f64, DVec2, [f64; 2])> {
        let (at, screen, shape) = Screen::around(scene, site, view)?;
        let variances = screen.ways(&shape).map(|way| way + PIXEL);
        let is_seen = screen.reaches(view, variances);
        is_seen.then(|| (at.z, screen.center, variances.map(|variance| END * variance.sqrt())))
    }
}

/// The projection around a point, linearised: J takes a small way in space to one on the screen.
struct Screen {
    center: DVec2,
    /// Rows of J, in local coordinates.
    rows: [DVec3; 2],
    /// Pixels of a unit of length that faces the viewer.
    per_unit: f64,
    /// Length of the ray through the point, per depth.
    length_per_depth: f64,
}

impl Screen {
    /// A site in view coordinates, the projection around it, and its kernel's shape in space; `None` if it is before the near plane.
    fn around(scene: &FlowScene, site: u32, view: &View) -> Option<(DVec3, Self, Symmetric)> {
        let at = view.to_view(scene.center(site));
        if at.z <= view.near_depth() {
            return None;
        }
        let size = scene.style.size;
        Some((at, Self::at(view, at), scene.shapes.of_sites[site as usize].map(|s| size * size * s)))
    }

    /// Whether a splat with these variances to the right and down reaches the image.
    fn reaches(&self, view: &View, variances: [f64; 2]) -> bool {
        let [half_width, half_height] = variances.map(|variance| END * variance.sqrt());
        let is_beside = |at: f64, half: f64, count: usize| at + half <= 0.0 || at - half >= count as f64;
        let DVec2 { x, y } = self.center;
        let is_beside = is_beside(x, half_width, view.width_px) || is_beside(y, half_height, view.height_px);
        !is_beside && variances.iter().all(|variance| variance.is_finite())
    }

    /// Around a point in view coordinates, in front of the eye.
    fn at(view: &View, at: DVec3) -> Self {
        let (depth, slope) = if view.perspective { (at.z, 1.0) } else { (1.0, 0.0) };
        let per_unit = 0.5 * view.width_px as f64 / view.half_width / depth;
        let (x, y) = (at.x / depth, at.y / depth);
        // Pixels are squares; the rows of an image go down.
        let rows =
            [per_unit * (view.right - slope * x * view.forward), -per_unit * (view.up - slope * y * view.forward)];
        let center = DVec2::new(
            0.5 * view.width_px as f64 * (x / view.half_width + 1.0),
            0.5 * view.height_px as f64 * (1.0 - y / view.half_height),
        );
        let length_per_depth = if view.perspective { at.length() / at.z } else { 1.0 };
        Self { center, rows, per_unit, length_per_depth }
    }

    /// The kernel of a site, of this shape in space, whose covariance on the screen has this determinant; `None` without extinction: it shows
    /// nothing, nor does its icon.
    fn kernel(&self, scene: &FlowScene, site: u32, shape: &Symmetric, determinant: f64) -> Option<Kernel> {
        let kernels = scene.kernels.as_ref()?;
        let node = kernels.node(site).filter(|node| node.tau > 0.0)?;
        let scale = scene.mesh.positions.scale;
        // Of all places on the ray, which is along n, the Gaussian has a width of 1 / sqrt(n^T S^-1 n) for n of length 1.
        let n = self.rows[0].cross(self.rows[1]).normalize_or_zero();
        let adjugate = adjugate(shape);
        let determinant_of_shape = (0..3).map(|i| shape[i] * adjugate[i]).sum::<f64>().max(0.0);
        let squared = determinant_of_shape / n.dot(times(&adjugate, n));
        let width = if squared.is_finite() { scale * squared.sqrt() } else { 0.0 };
        let volume = scale * kernels.volumes[site as usize] * self.per_unit.powi(2) * self.length_per_depth;
        let on_screen = OnScreen { width, area: determinant.sqrt(), volume };
        Some(Kernel::of(node, &on_screen, scene.style.fidelity))
    }

    fn project(&self, way: DVec3) -> DVec2 {
        DVec2::new(self.rows[0].dot(way), self.rows[1].dot(way))
    }

    /// J S J^T and a pixel's variance (xx, xy, yy), and the determinant. A needle keeps it: it is n^T adj(S) n with n the product of J's rows,
    /// of which no part is negative, not a difference of large numbers.
    fn covariance(&self, shape: &Symmetric) -> ([f64; 3], f64) {
        let ([a, b], [along, down]) = (self.rows, self.ways(shape));
        let (mixed, n) = (a.dot(times(shape, b)), a.cross(b));
        let determinant = n.dot(times(&adjugate(shape), n)).max(0.0) + PIXEL * (along + down) + PIXEL * PIXEL;
        ([along + PIXEL, mixed, down + PIXEL], determinant)
    }

    /// J S J^T without a pixel's variance: xx and yy.
    fn ways(&self, shape: &Symmetric) -> [f64; 2] {
        self.rows.map(|row| row.dot(times(shape, row)).max(0.0))
    }
}

fn times(&[xx, xy, xz, yy, yz, zz]: &Symmetric, w: DVec3) -> DVec3 {
    DVec3::new(xx * w.x + xy * w.y + xz * w.z, xy * w.x + yy * w.y + yz * w.z, xz * w.x + yz * w.y + zz * w.z)
}

/// The adjugate of a symmetric matrix: its inverse times its determinant.
fn adjugate(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> Symmetric {
    [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy, xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy]
}

#[cfg(test)]
impl Splat {
    /// Periods of the pattern along and across, per pixel to the right and down.
    #[cfg(feature = "gpu")]
    pub(super) fn periods_per_pixel(&self) -> [DVec2; 2] {
        let (DVec2 { x, y }, [along, across]) = (self.along, self.frequency);
        [along * DVec2::new(x, y), across * DVec2::new(y, -x)]
    }

    pub(super) fn pattern(&self) -> (DVec2, [f64; 2]) {
        (self.along, self.frequency)
    }

    /// Whether the pattern is not compressed more than it is shown.
    pub(super) fn is_whole(&self) -> bool {
        self.contrast == 1.0
    }

    pub(super) fn without_fading(self) -> Self {
        Self { contrast: 1.0, ..self }
    }

    /// The splat with another place across the pattern.
    pub(super) fn across(&self, at: f64) -> Self {
        Self { phase: [self.phase[0], at], ..self.clone() }
    }
}
