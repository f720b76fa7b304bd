//! The visible point at an image position: the point in the mesh under the mouse.
//!
//! A volume has no surface to hit. Of all cells on the ray, the visible one is the cell whose segment contributes most to the opacity of
//! the pixel (transmittance in front of it times its own opacity), as the eye takes the dominant layer for the object itself; the nearest
//! of equal ones. The point in that cell has half of the segment's opacity in front of it. Both depend on the picture alone: the first
//! visible point would be faint haze in front of the object, and the point where half of the *pixel's* opacity is reached may lie in the
//! empty space between two layers. The price: in a smooth haze without any layer the largest cell wins, wherever it is. An isosurface, a
//! section or the surface of the domain or of a region is met in one point, and contributes its opacity there; clipped parts and drawn
//! edges are ignored.
//!
//! ```text
//! reject    cells wholly on one side of the ray in the image: a bit per vertex and side, four bits ANDed   (most cells)
//! clip      the others, as the reference does: barycentric coordinates, segments sorted by depth
//! absorb    optical depth of every segment from the front, in pieces between the nodes of the table (closed form)
//! choose    the greatest contribution, and where the segment's own absorption is half
//! ```
//!
//! Clipping and pieces are the reference's own code, so that a probe finds the reference's cells; tests compare the sum of all
//! contributions with its pixels. All in f64 and on one thread.

use super::domain::{DomainStyle, Shell};
use super::medium::Segment;
use super::reference::clip::Cell;
use super::reference::integrate::{END_DEPTH, Transfer};
use super::surfaces::cuts_in_view::CutsInView;
use super::{RenderError, RenderJob};
use crate::camera::View;
use crate::visibility::CutPlanes;
use glam::DVec3;

/// A visible point in the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// The cell, in the numbering of the mesh (a store's order, not its source's).
    pub cell: u32,
    /// The cell's number in the source's mesh, of which it is or is a part: the order in which `export` writes cells.
    pub source_cell: u32,
    /// World coordinates; of a ball its middle.
    pub position: DVec3,
    /// Barycentric coordinates in the order of the cell's vertices: not negative, sum 1.
    pub weights: [f64; 4],
    /// Scalar at the point: [`interpolate`].
    pub scalar: f64,
    /// World length along the viewing direction, from the eye (parallel projection: from the camera's position).
    pub depth: f64,
    /// This cell's share of the pixel's opacity, in (0, 1]; 1 of a ball.
    pub share: f64,
}

/// Interpolates the scalars of a cell's vertices; NaN if one of them is not finite. Four equal scalars are reproduced exactly.
pub fn interpolate(weights: [f64; 4], scalars: [f32; 4]) -> f64 {
    if !scalars.iter().all(|s| s.is_finite()) {
        return f64::NAN;
    }
    let [first, rest @ ..] = scalars.map(f64::from);
    first + (1..4).zip(rest).map(|(i, scalar)| weights[i] * (scalar - first)).sum::<f64>()
}

/// The visible point at an image position of a job: `at_px` is in pixels, from the left and from the top, with pixel centres at
/// (i + .5, j + .5). `None` outside the image and where nothing is visible. Fragments of other layers count as far as they are of the
/// job's shells. Of a cloud: the nearest active ball, where the ray is nearest to its middle.
///
/// # Errors
/// If the parts of the job do not match.
pub fn probe(job: &RenderJob, at_px: (f64, f64)) -> Result<Option<Probe>, RenderError> {
    job.check()?;
    let Some(ray) = Ray::new(job, at_px) else { return Ok(None) };
    if let Some(radii) = &job.mesh.radii {
        return Ok(ray.nearest_ball(job, radii));
    }
    let chain = ray.chain(job);
    let mut total = 0.0;
    let mut best: Option<Seen> = None;
    ray.absorb(job, &chain, |seen| {
        total += seen.contribution;
        if seen.contribution > best.map_or(0.0, |best| best.contribution) {
            best = Some(seen);
        }
    });
    Ok(best.map(|seen| ray.point(job, seen, (seen.contribution / total).min(1.0))))
}

/// Bound on the rounding of depths at which the ray passes from cell to cell, local units.
const AT_FACE: f64 = 1e-6;

/// The ray through an image position, in the mesh's local coordinates.
struct Ray<'a> {
    view: View,
    px: f64,
    py: f64,
    cuts: CutsInView,
    /// The shells that are drawn as surfaces.
    shells: Vec<&'a Shell>,
}

/// The part of a ray in a cell.
struct OnRay {
    number: u32,
    cell: Cell,
    /// The part left by clipping.
    segment: Segment,
    /// Depth at which the ray leaves the cell.
    exit: f64,
    /// Whether the cell's volume, and surfaces in it, are drawn.
    is_active: bool,
    /// Depths and opacities of shells that the ray passes, into the cell and out of it.
    on_shells: [Option<(f64, f64)>; 2],
}

/// A contribution to the opacity of a pixel: of the volume in a cell, or of a surface there.
#[derive(Clone, Copy)]
struct Seen<'a> {
    on_ray: &'a OnRay,
    contribution: f64,
    /// Depth of the surface; `None` for the volume.
    surface_depth: Option<f64>,
}

impl<'a> Ray<'a> {
    fn new(job: &'a RenderJob, (x_px, y_px): (f64, f64)) -> Option<Self> {
        let view = job.local_view();
        let is_inside = (0.0..=view.width_px as f64).contains(&x_px) && (0.0..=view.height_px as f64).contains(&y_px);
        let (px, py) = view.ray_at(x_px, y_px);
        let none = CutPlanes::default();
        let cuts = CutsInView::new(job.surfaces.as_ref().map_or(&none, |scene| scene.planes()), &view);
        let shells = job.shells.iter().filter(|shell| shell.surface.style == DomainStyle::Solid).collect();
        is_inside.then_some(Self { view, px, py, cuts, shells })
    }

    /// Where the ray enters a cell, and leaves it, through a face at which shells with the cell end, and their opacity together. Each
    /// shell has one cell at a face: none counts twice.
    fn on_shells(&self, job: &RenderJob, number: u32, cell: &Cell, ends: [f64; 2]) -> [Option<(f64, f64)>; 2] {
        /// Bound on the rounded weight of the opposite corner for a point on a face, except at the eye inside the cell.
        const ON_FACE: f64 = 1e-6;
        let around: Vec<&&Shell> = self.shells.iter().filter(|shell| shell.cells.contains(number)).collect();
        if around.is_empty() {
            return [None; 2];
        }
        ends.map(|depth| {
            let weights = cell.weights(self.at(depth));
            let (face, weight) = (0..4).zip(weights).min_by(|a, b| a.1.total_cmp(&b.1))?;
            let behind = job.mesh.topology.connectivity().neighbours[number as usize][face].cell();
            let ending = around.iter().filter(|shell| !behind.is_some_and(|cell| shell.cells.contains(cell)));
            let opacity = 1.0 - ending.map(|shell| 1.0 - shell.surface.opacity).product::<f64>();
            (opacity > 0.0 && weight < ON_FACE).then_some((depth, opacity))
        })
    }

    /// The nearest active ball on the ray.
    fn nearest_ball(&self, job: &RenderJob, radii: &[f32]) -> Option<Probe> {
        let (mesh, near) = (&job.mesh, self.view.near_depth());
        let hit = |cell: u32| {
            let center = self.view.to_view(mesh.positions.local[cell as usize].as_dvec3());
            let along = DVec3::new(self.px, self.py, 1.0);
            let depth = if self.view.perspective { center.dot(along) / along.length_squared() } else { center.z };
            let is_met = self.at(depth).distance(center) <= f64::from(radii[cell as usize]) && depth > near;
            is_met.then_some((depth, cell))
        };
        let cells = (0..radii.len() as u32).filter(|&cell| job.active.contains(cell));
        let (depth, cell) = cells.filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))?;
        Some(Probe {
            cell,
            source_cell: mesh.cell_source.get(cell as usize).copied().unwrap_or(cell),
            position: mesh.positions.world(cell as usize),
            weights: [1.0, 0.0, 0.0, 0.0],
            scalar: f64::from(job.scalars.at_corners(cell, mesh.topology.tets[cell as usize])[0]),
            depth: depth * mesh.positions.scale,
            share: 1.0,
        })
    }

    /// View coordinates at a depth.
    fn at(&self, depth: f64) -> DVec3 {
        let spread = if self.view.perspective { depth } else { 1.0 };
        DVec3::new(self.px * spread, self.py * spread, depth)
    }

    /// The cells on the ray from the front, without overlap and behind the near plane.
    fn chain(&self, job: &RenderJob) -> Vec<OnRay> {
        let view = &self.view;
        let to_view = |v: u32| view.to_view(job.mesh.positions.local[v as usize].as_dvec3());
        let clipped = |number: u32| {
            let tet = job.mesh.topology.tets[number as usize];
            let cell = Cell::new(job, view, number, tet.map(to_view))?;
            let segment = cell.clip(view, job.mesh.positions.scale, self.px, self.py)?;
            let on_shells = self.on_shells(job, number, &cell, segment.part);
            let is_active = job.active.contains(number);
            Some(OnRay { number, cell, segment, exit: segment.part[1], is_active, on_shells })
        };
        let is_met = |cell: u32| job.active.contains(cell) || self.shells.iter().any(|of| of.cells.contains(cell));
        let mut found: Vec<OnRay> = self.near_cells(job).filter(|&number| is_met(number)).filter_map(clipped).collect();
        // Stable sort: of equal intervals the cell with the lower number comes first, as in the reference.
        found.sort_by(|a, b| {
            let (a, b) = (&a.segment, &b.segment);
            a.part[0].total_cmp(&b.part[0]).then(a.part[1].total_cmp(&b.part[1]))
        });
        let mut front = view.near_depth();
        found.retain_mut(|on_ray| {
            let Some(left) = on_ray.segment.behind(front) else { return false };
            front = left.part[1];
            on_ray.segment = left;
            true
        });
        found.retain_mut(|on_ray| {
            let left = self.cuts.left_of(&on_ray.segment);
            on_ray.segment = left.map_or(on_ray.segment, |left| on_ray.segment.between(left));
            left.is_some()
        });
        found
    }

    /// A superset of the cells that the ray meets: those that do not lie wholly beside, above or below it, or behind the eye.
    fn near_cells<'j>(&self, job: &'j RenderJob) -> impl Iterator<Item = u32> + 'j {
        let view = &self.view;
        // Coordinates across the ray, which is the origin.
        let (across, up, shift) = if view.perspective {
            (view.right - self.px * view.forward, view.up - self.py * view.forward, (0.0, 0.0))
        } else {
            (view.right, view.up, (self.px, self.py))
        };
        // A millionth of the mesh's box is far above the inflation of cells. Coordinates are at most `reach`, products with it
        // and their sums round by a few 2^-53 of that.
        let reach = view.eye.length() + 2.0;
        let margin = (1e-6 + reach * 2f64.powi(-48)) * (1.0 + self.px.abs() + self.py.abs());
        let side_bits = |p: &glam::Vec3| {
            let d = p.as_dvec3() - view.eye;
            let (x, y) = (across.dot(d) - shift.0, up.dot(d) - shift.1);
            let is_behind = view.perspective && view.forward.dot(d) < -margin;
            let sides = [x > margin, x < -margin, y > margin, y < -margin, is_behind];
            sides.iter().enumerate().fold(0, |bits, (i, &is_beyond)| bits | u8::from(is_beyond) << i)
        };
        let sides: Vec<u8> = job.mesh.positions.local.iter().map(side_bits).collect();
        let tets = (0..).zip(&job.mesh.topology.tets);
        tets.filter(move |(_, tet)| tet.iter().fold(u8::MAX, |common, &v| common & sides[v as usize]) == 0)
            .map(|(number, _)| number)
    }

    /// Reports the contribution of each visible segment, and of each surface in it, to the opacity of the ray, from the front, until the
    /// ray is opaque.
    fn absorb<'c>(&self, job: &RenderJob, chain: &'c [OnRay], mut give: impl FnMut(Seen<'c>)) {
        let table = Transfer::of(job);
        let mut depth_so_far = 0.0_f64;
        // Light absorbed by a further optical depth.
        let mut take = |depth: f64| {
            let taken = (-depth_so_far).exp() * -(-depth).exp_m1();
            depth_so_far += depth;
            (taken, depth_so_far > END_DEPTH)
        };
        for on_ray in chain {
            let optical_depth = |part: &Segment| match on_ray.is_active {
                true => self.absorbing(table, part).map(|piece| piece.depth).sum::<f64>(),
                false => 0.0,
            };
            let (mut rest, mut of_volume, mut is_over) = (on_ray.segment, 0.0, false);
            for (depth, opacity) in self.surfaces_on(job, on_ray) {
                let (before, behind) = rest.split(depth);
                rest = behind;
                of_volume += before.map_or(0.0, |before| take(optical_depth(&before)).0);
                let (contribution, is_opaque) = take(-(-opacity).ln_1p());
                give(Seen { on_ray, contribution, surface_depth: Some(depth) });
                is_over |= is_opaque;
            }
            if !is_over {
                let (taken, is_opaque) = take(optical_depth(&rest));
                (of_volume, is_over) = (of_volume + taken, is_opaque);
            }
            if of_volume > 0.0 {
                give(Seen { on_ray, contribution: of_volume, surface_depth: None });
            }
            if is_over {
                return;
            }
        }
    }

    /// Depth and opacity of the surfaces and sections that a segment meets, nearest first.
    fn surfaces_on(
        &self,
        job: &RenderJob,
        OnRay { segment, exit, is_active, on_shells, .. }: &OnRay,
    ) -> Vec<(f64, f64)> {
        let ([near, far], [from, to]) = (segment.part, segment.part_scalar);
        let sheets = job.surfaces.as_ref().map_or(&[][..], |surfaces| surfaces.sheets());
        let met = sheets.iter().filter(|_| *is_active).filter(|sheet| (from >= sheet.value) != (to >= sheet.value));
        let depth = |value: f64| near + (value - from) / (to - from) * (far - near);
        let mut met: Vec<(f64, f64)> = met.map(|sheet| (depth(sheet.value), sheet.opacity)).collect();
        let mut last = (f64::NEG_INFINITY, 0);
        let whole = Segment { part: [segment.part[0], *exit], ..*segment };
        while let Some(next) = self.cuts.next_section(&whole, segment.part, last).filter(|_| *is_active) {
            met.push((next.0, 1.0));
            last = next;
        }
        // The cell in front may end behind the beginning of this one by a rounding: the face between them is still met.
        let [begin, end] = segment.part;
        let is_left = |(depth, _): &&(f64, f64)| (begin - AT_FACE..=end + AT_FACE).contains(depth);
        let shells = on_shells.iter().flatten().filter(is_left);
        met.extend(shells.map(|&(depth, opacity)| (depth.clamp(begin, end), opacity)));
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met
    }

    /// The pieces of a segment between the nodes of the table, from the front.
    fn absorbing(&self, table: Transfer<'_>, segment: &Segment) -> impl Iterator<Item = Piece> + use<> {
        let length = segment.length();
        table.pieces(segment).into_iter().map(move |(from, to, share)| Piece {
            share,
            from: from.tau,
            to: to.tau,
            // Halved first: the sum could overflow.
            depth: (0.5 * from.tau + 0.5 * to.tau) * (share * length),
        })
    }

    /// The point of a surface, or the point of a segment in front of which half of its opacity lies.
    fn point(&self, job: &RenderJob, Seen { on_ray, surface_depth, .. }: Seen<'_>, share: f64) -> Probe {
        let OnRay { number, cell, segment, .. } = on_ray;
        let depth = surface_depth.unwrap_or_else(|| {
            let pieces: Vec<Piece> = self.absorbing(Transfer::of(job), segment).collect();
            let [near, far] = segment.part;
            near + half_absorbed(&pieces) * (far - near)
        });
        let weights = normalised(cell.weights(self.at(depth)));
        let (mesh, tet) = (&job.mesh, job.mesh.topology.tets[*number as usize]);
        // From the corners, as the eye may be far away.
        let corners = mesh.positions.corners(tet);
        let local: DVec3 = (0..4).map(|i| weights[i] * corners[i].as_dvec3()).sum();
        Probe {
            cell: *number,
            source_cell: mesh.cell_source.get(*number as usize).copied().unwrap_or(*number),
            position: mesh.positions.origin + mesh.positions.scale * local,
            weights,
            scalar: interpolate(weights, job.scalars.at_corners(*number, tet)),
            depth: depth * mesh.positions.scale,
            share,
        }
    }
}

/// A piece of a segment on which extinction is linear.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Fraction of the segment's length.
    share: f64,
    /// Extinction at its ends.
    from: f64,
    to: f64,
    /// Optical depth of the piece.
    depth: f64,
}

/// The fraction of a segment's length in front of which half of its opacity lies.
fn half_absorbed(pieces: &[Piece]) -> f64 {
    let total: f64 = pieces.iter().map(|piece| piece.depth).sum();
    // 1 - exp(-target) is half of 1 - exp(-total).
    let target = -(0.5 * (-total).exp_m1()).ln_1p();
    let (mut passed, mut depth_so_far) = (0.0, 0.0);
    for piece in pieces {
        if piece.depth > 0.0 && depth_so_far + piece.depth >= target {
            let share = (target - depth_so_far) / piece.depth;
            return (passed + piece.share * place_of(share, piece.from, piece.to)).clamp(0.0, 1.0);
        }
        passed += piece.share;
        depth_so_far += piece.depth;
    }
    1.0
}

/// The fraction of a piece's length, extinction linear between `from` and `to`, at which it has absorbed this share of its optical depth:
/// the stable root of a quadratic, in extinctions relative to their mean.
fn place_of(share: f64, from: f64, to: f64) -> f64 {
    let mean = 0.5 * from + 0.5 * to;
    let (from, rise) = (from / mean, (to - from) / mean);
    let root = (from * from + 2.0 * rise * share).max(0.0).sqrt();
    let place = 2.0 * share / (from + root);
    // 0 / 0 at the start of a ramp from zero.
    if place.is_finite() { place.clamp(0.0, 1.0) } else { 0.0 }
}

/// Clamps weights that rounding has moved out of the cell back onto it.
fn normalised(weights: [f64; 4]) -> [f64; 4] {
    let weights = weights.map(|w| w.max(0.0));
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

#[cfg(test)]
#[path = "probe_tests.rs"]
mod tests;
