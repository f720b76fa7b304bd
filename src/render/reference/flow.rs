//! The fragments of flow by brute force, in float64: every splat is asked at every pixel, every texel in its box.
//!
//! The projection's derivative is that of finite differences, the kernel's form the inverse of a matrix, the pattern a sum over texels: no
//! tiles, rows, running sums or extents; a cell's splat has the mean of its corners, and of their differences. A fragment is in the domain if it is in
//! one of the cells, each of which is clipped by the ray, and in front of every clip. What a vertex or cell has (vector, colour, place in the
//! pattern) and the constants of docs/flow.md are the scene's.

use super::clip::Tet;
use crate::camera::View;
use crate::field::Association;
use crate::mesh::Plane;
use crate::render::flow::{
    COMPRESSED, END, FlowCounts, FlowFidelity, FlowScene, ON_BOUNDARY, PIXEL, Pattern, TEXELS, Thresholds,
};
use crate::render::{LayerFragment, LayerFragments, RenderError};
use glam::{DMat2, DMat3, DVec2, DVec3};
use rayon::prelude::*;

/// All fragments of a view in local coordinates, of the splats in front of the eye.
///
/// # Errors
/// If a fragment is out of range.
pub(crate) fn flow_fragments(scene: &FlowScene, view: &View) -> Result<(LayerFragments, FlowCounts), RenderError> {
    let Thresholds { first, further } = scene.patterns();
    let thresholds: Vec<f64> = further.iter().map(|(from, _)| *from).collect();
    let patterns = [&first].into_iter().chain(further.iter().map(|(_, pattern)| pattern));
    let icons = &patterns.map(JudgedIcon::of).collect::<Vec<_>>()[..];
    let of_site = |site: u32| Judged::of(scene, &thresholds, site, view);
    let splats: Vec<Judged> = scene.sites().into_iter().filter_map(of_site).collect();
    let domain = scene.kernels.is_none().then(|| Domain::of(scene, view));
    let (width, height) = view.plane_px();
    let per_unit = scene.mesh.positions.scale;
    let of_pixel = |place: usize| {
        let (column, row) = view.pixel_at(place);
        let at = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        let seen = splats.iter().map(|splat| {
            let [window, pattern] = splat.seen(at, icons);
            (splat.depth, splat.light(window, scene.style.opacity * pattern).map(|c| c as f32))
        });
        let seen: Vec<(f64, [f32; 4])> = seen.filter(|(_, rgba)| rgba[3] > 0.0).collect();
        let is_in = domain.as_ref().map(|domain| domain.on_ray(view, (column, row)));
        let inside = seen.iter().filter(|(depth, _)| is_in.as_ref().is_none_or(|is_in| is_in(*depth)));
        let fragment = |&(depth, rgba)| (place as u32, LayerFragment { depth: depth * per_unit, rgba });
        let found: Vec<(u32, LayerFragment)> = inside.map(fragment).collect();
        let outside = seen.len() - found.len();
        (found, outside as u64)
    };
    let found: Vec<(Vec<_>, u64)> = (0..width * height).into_par_iter().map(of_pixel).collect();
    let fast = splats.iter().filter(|splat| FlowCounts::is_fast(splat.blur)).count() as u64;
    let outside = found.iter().map(|(_, outside)| outside).sum();
    let counts = FlowCounts { splats: splats.len() as u64, fast, outside };
    Ok((LayerFragments::new(width * height, found.into_iter().flat_map(|(found, _)| found))?, counts))
}

/// Where fragments are drawn: in the cells that are shown, and in no clip.
struct Domain<'a> {
    cells: Vec<Tet>,
    clips: &'a [Plane],
}

impl<'a> Domain<'a> {
    fn of(scene: &'a FlowScene, view: &View) -> Self {
        let in_view = |vertex: u32| view.to_view(scene.mesh.positions.local[vertex as usize].as_dvec3());
        let shown = scene.mesh.topology.tets.iter().enumerate().filter(|(cell, _)| scene.cells.contains(*cell as u32));
        let cells = shown.filter_map(|(_, tet)| Tet::new(view, tet.map(in_view))).collect();
        Self { cells, clips: &scene.clips }
    }

    /// Tells of depths on a pixel's ray whether they are in it.
    fn on_ray(&self, view: &View, (column, row): (usize, usize)) -> impl Fn(f64) -> bool {
        let (px, py) = view.ray(column, row);
        let may_meet = |tet: &&Tet| tet.columns.contains(&column) && tet.rows.contains(&row);
        let parts = self.cells.iter().filter(may_meet).filter_map(|tet| Some(tet.part(view, px, py)?.ends));
        let parts: Vec<[f64; 2]> = parts.collect();
        move |depth| {
            let at = on_ray(view, (px, py), depth);
            let is_left = self.clips.iter().all(|clip| clip.distance(at) <= ON_BOUNDARY);
            is_left && parts.iter().any(|[near, far]| near - ON_BOUNDARY <= depth && depth <= far + ON_BOUNDARY)
        }
    }
}

/// The local point at a depth on the ray of an image-plane point.
fn on_ray(view: &View, (px, py): (f64, f64), depth: f64) -> DVec3 {
    let spread = if view.perspective { depth } else { 1.0 };
    view.eye + depth * view.forward + spread * (px * view.right + py * view.up)
}

/// Position on the screen of a local point, in pixels.
fn on_screen(view: &View, at: DVec3) -> DVec2 {
    let at = view.to_view(at);
    let depth = if view.perspective { at.z } else { 1.0 };
    let [x, y] = [at.x / depth / view.half_width, at.y / depth / view.half_height];
    DVec2::new(0.5 * (1.0 + x) * view.width_px as f64, 0.5 * (1.0 - y) * view.height_px as f64)
}

/// Where a splat's centre is, and the mean of e e^T over the edges there; local.
fn place(scene: &FlowScene, site: u32) -> (DVec3, [[f64; 3]; 3]) {
    let at = |vertex: u32| scene.mesh.positions.local[vertex as usize].as_dvec3();
    if scene.shapes.sites == Association::Point {
        let [xx, xy, xz, yy, yz, zz] = scene.shapes.of_sites[site as usize];
        return (at(site), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    }
    let corners = scene.mesh.topology.tets[site as usize].map(at);
    let mut shape = [[0.0; 3]; 3];
    // Each edge twice, and each corner with itself, which adds nothing.
    for (a, b) in (0..16).map(|k| (corners[k / 4], corners[k % 4])) {
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            shape[i][j] += (b - a)[i] * (b - a)[j] / 12.0;
        }
    }
    (corners.iter().sum::<DVec3>() / 4.0, shape)
}

/// An icon's texels, and their mean.
struct JudgedIcon {
    texels: Vec<[f64; TEXELS]>,
    whole: f64,
}

impl JudgedIcon {
    fn of(pattern: &Pattern) -> Self {
        let texels = pattern.texels();
        let whole = texels.iter().flatten().sum::<f64>() / (TEXELS * TEXELS) as f64;
        Self { texels, whole }
    }
}

/// The share of each icon at a site: every further one covers those before it, the more the farther the value is beyond the beginning of its
/// cross-fade. `None` if the value is not finite.
fn shares(scene: &FlowScene, thresholds: &[f64], site: u32) -> Option<Vec<f64>> {
    let mut shares = vec![1.0];
    let Some(mixture) = &scene.mixture else { return Some(shares) };
    let (value, fade) = (scene.icon_value(site)?, mixture.icons.fade);
    for threshold in thresholds {
        let beyond = value - (threshold - 0.5 * fade);
        let x = if beyond < fade { (beyond / fade).max(0.0) } else { f64::from(u8::from(beyond >= 0.0)) };
        let share = x * x * (3.0 - 2.0 * x);
        shares.iter_mut().for_each(|before| *before *= 1.0 - share);
        shares.push(share);
    }
    Some(shares)
}

struct Judged {
    depth: f64,
    center: DVec2,
    form: DMat2,
    along: DVec2,
    per_period: f64,
    foreshortening: f64,
    phase: [f64; 2],
    blur: f64,
    /// Whether the pattern goes over into its mean where the vector is nearly along the ray.
    fades: bool,
    /// Share of each icon.
    shares: Vec<f64>,
    color: [f64; 3],
    /// Whether it has an icon.
    flows: bool,
    kernel: Option<JudgedKernel>,
}

/// What a splat shows of the scalar.
struct JudgedKernel {
    color: [f64; 3],
    /// Optical depth of a ray through the centre: that which makes the whole window as dark as the site's volume is, and that of a cloud of the
    /// site's extinction.
    depths: [f64; 2],
    is_printed: bool,
}

impl JudgedKernel {
    /// `facing` are the pixels of a unit across the view direction, `shape` is the covariance in space, `on_screen` the one on the screen.
    fn of(scene: &FlowScene, site: u32, view: &View, facing: f64, shape: DMat3, on_screen: DMat2) -> Option<Self> {
        let kernels = scene.kernels.as_ref()?;
        let (node, scale) = (kernels.node(site)?, scene.mesh.positions.scale);
        let center = place(scene, site).0 - view.eye;
        let ray = if view.perspective { center.normalize() } else { view.forward };
        let width = scale / ray.dot(shape.inverse() * ray).sqrt();
        // The window's integral over r, by the midpoint rule: right to 1e-7.
        let (steps, least) = (4000, (-0.5 * END * END).exp());
        let step = END / f64::from(steps);
        let radius = |i: i32| (f64::from(i) + 0.5) * step;
        let mass: f64 = (0..steps).map(|i| step * radius(i) * ((-0.5 * radius(i).powi(2)).exp() - least)).sum();
        let mass = std::f64::consts::TAU * mass / (1.0 - least) * on_screen.determinant().sqrt();
        // A volume's length along the ray, by its pixels across it.
        let volume = scale * kernels.volumes[site as usize] * facing.powi(2) / ray.dot(view.forward);
        let depths = [volume / mass, std::f64::consts::TAU.sqrt() * width].map(|length| node.tau * length);
        Some(Self { color: node.rgb, depths, is_printed: scene.style.fidelity == FlowFidelity::Paper })
    }
}

impl Judged {
    fn of(scene: &FlowScene, thresholds: &[f64], site: u32, view: &View) -> Option<Self> {
        let (vector, (center, shape)) = (scene.vector(site), place(scene, site));
        let depth = view.to_view(center).z;
        let (color, shares) = (scene.color(site), shares(scene, thresholds, site));
        let flows = vector.is_finite() && vector != DVec3::ZERO && color.is_some() && shares.is_some();
        if !(flows || scene.kernels.is_some()) || !scene.shows(site) || depth <= view.near_depth() {
            return None;
        }
        // A hundred-thousandth of the depth: the third derivative is off by 1e-10, rounding by as much.
        let step = if view.perspective { 1e-5 * depth } else { 1e-5 };
        let derivative =
            |way: DVec3| (on_screen(view, center + step * way) - on_screen(view, center - step * way)) / (2.0 * step);
        let columns = [DVec3::X, DVec3::Y, DVec3::Z].map(derivative);
        let mut covariance = DMat2::from_diagonal(DVec2::splat(PIXEL));
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            let (a, b, s) = (columns[i], columns[j], scene.style.size.powi(2) * shape[i][j]);
            covariance += DMat2::from_cols(a * b.x, a * b.y) * s;
        }
        let unit = if flows { vector / vector.length() } else { DVec3::ZERO };
        let projected = derivative(unit);
        // Pixels of a unit across the view direction, at this depth, in the middle of the view.
        let middle = view.eye + depth * view.forward;
        let facing = (on_screen(view, middle + view.right) - on_screen(view, middle)).length();
        let along = if projected.length() > 0.0 { projected.normalize() } else { DVec2::X };
        let in_space = DMat3::from_cols_array_2d(&shape) * scene.style.size.powi(2);
        let kernel = JudgedKernel::of(scene, site, view, facing, in_space, covariance);
        if kernel.is_none() && scene.kernels.is_some() {
            return None;
        }
        Some(Self {
            depth,
            center: on_screen(view, center),
            form: covariance.inverse(),
            along,
            per_period: scene.period() * facing,
            foreshortening: projected.length() / facing,
            phase: scene.phase(site),
            blur: scene.blur(site),
            fades: scene.style.fidelity == FlowFidelity::Smooth,
            shares: shares.unwrap_or_default(),
            color: color.unwrap_or_default(),
            flows,
            kernel,
        })
    }

    /// Premultiplied colour and opacity where the window and the icon have these values.
    fn light(&self, window: f64, icon: f64) -> [f64; 4] {
        let Some(JudgedKernel { color, depths, is_printed }) = &self.kernel else {
            return [self.color[0] * icon, self.color[1] * icon, self.color[2] * icon, icon];
        };
        let of_cloud = 1.0 - (-depths[1]).exp();
        let of_kernel = if *is_printed { of_cloud * window } else { 1.0 - (-depths[0] * window).exp() };
        let alpha = (1.0 - icon) * of_kernel + icon * of_cloud;
        let of = |pri: f64, sec: f64| {
            if *is_printed {
                alpha * (pri * (1.0 - icon) + sec * icon)
            } else {
                (1.0 - icon) * of_kernel * pri + icon * of_cloud * sec
            }
        };
        [of(color[0], self.color[0]), of(color[1], self.color[1]), of(color[2], self.color[2]), alpha]
    }

    /// The window at a place on the screen, and the opacity of a pattern of opacity 1.
    fn seen(&self, at: DVec2, icons: &[JudgedIcon]) -> [f64; 2] {
        let beside = at - self.center;
        let squared = beside.dot(self.form * beside);
        let least = (-0.5 * END * END).exp();
        let window = ((-0.5 * squared).exp() - least) / (1.0 - least);
        if window.is_nan() || window <= 0.0 {
            return [0.0; 2];
        }
        if !self.flows {
            return [window, 0.0];
        }
        let x = (self.foreshortening * COMPRESSED).min(1.0);
        let contrast = if self.fades { x * x * (3.0 - 2.0 * x) } else { 1.0 };
        let frequency = (1.0 / self.foreshortening).min(COMPRESSED) / self.per_period;
        let along = beside.dot(self.along);
        let across = beside.x * self.along.y - beside.y * self.along.x;
        let (s, t) = (along * frequency + self.phase[0], across / self.per_period + self.phase[1]);
        let size = TEXELS as f64;
        let width = ((frequency + self.blur) * size).clamp(1.0, size);
        let mut height = 1.0;
        while height < (size / self.per_period).min(size) {
            height *= 2.0;
        }
        let shown = self.shares.iter().zip(icons).filter(|(share, _)| **share > 0.0);
        let each = shown.map(|(share, JudgedIcon { texels, whole })| {
            let pattern = mean(texels, [s * size, t * size], [width, height]);
            share * (contrast * pattern + (1.0 - contrast) * whole)
        });
        [window, window * each.sum::<f64>()]
    }
}

/// The mean of an endless pattern over a box around a place; all in texels.
fn mean(texels: &[[f64; TEXELS]], [s, t]: [f64; 2], [width, height]: [f64; 2]) -> f64 {
    let parts = |middle: f64, extent: f64| {
        let (from, to) = (middle - 0.5 * extent, middle + 0.5 * extent);
        let each = (from.floor() as i64)..(to.ceil() as i64);
        each.map(move |i| {
            (i.rem_euclid(TEXELS as i64) as usize, (to.min(i as f64 + 1.0) - from.max(i as f64)) / extent)
        })
    };
    let row = |row: usize| parts(s, width).map(|(column, share)| share * texels[row][column]).sum::<f64>();
    parts(t, height).map(|(of, share)| share * row(of)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::flow::Icon;

    #[test]
    fn the_mean_over_a_box_is_that_of_its_texels() {
        let texels = Icon::Arrows.texels();
        let all = mean(&texels, [0.0, 0.0], [64.0, 64.0]);
        assert!((all - texels.iter().flatten().sum::<f64>() / 4096.0).abs() < 1e-12);
        assert_eq!(mean(&texels, [10.5, -63.5], [1.0, 1.0]), texels[0][10]);
        let two = mean(&texels, [64.0, 3.5], [1.0, 1.0]);
        assert!((two - 0.5 * (texels[3][63] + texels[3][0])).abs() < 1e-15);
    }
}
