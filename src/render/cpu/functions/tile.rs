//! Draws one tile: slab by slab, nearest first.

use super::super::super::functions::FunctionScene;
use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::{Medium, RayLine, RayPoint, Segment};
use super::super::light::RayLight;
use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::lanes::Lanes;
use super::super::tiles::{PixelRect, TILE_PX, TilePixel};
use super::domain::Domain;
use super::place::FunctionsInView;
use super::sheets::{AT_ONCE, SheetDepths, Sums, Term};
use super::slabs::{Slab, Slabs};
use super::slopes::Slopes;
use crate::camera::View;
use crate::node_table::NodeTable;
use crate::optics::Accumulator;
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::visibility::Skip;
use glam::{DVec3, Vec3};
use pulp::NullaryFnOnce;

const PIXELS: usize = TILE_PX * TILE_PX;

/// Scene data shared by all tiles of a frame.
pub(super) struct Scene<'a, M, Y> {
    pub(super) functions: &'a FunctionScene,
    pub(super) in_view: &'a FunctionsInView,
    /// Values of the functions.
    pub(super) values: &'a [f32],
    pub(super) view: &'a View,
    pub(super) table: &'a NodeTable,
    pub(super) medium: &'a M,
    pub(super) layers: &'a Y,
    pub(super) skip: Skip,
    pub(super) cancel: &'a Cancel,
}

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    domain: Domain,
    slabs: Slabs,
    sums: Sums,
    /// Of lit fields.
    slopes: Slopes,
}

/// Renders one tile into the first pixels of `pixels`, row by row; returns its statistics.
pub(super) struct RenderTile<'a, M, Y, L: Lanes> {
    pub(super) lanes: L,
    pub(super) scene: &'a Scene<'a, M, Y>,
    pub(super) tile: usize,
    pub(super) scratch: &'a mut TileScratch,
    pub(super) pixels: &'a mut [TilePixel],
}

impl<M: Medium<Light = Accumulator>, Y: Layers, L: Lanes> NullaryFnOnce for RenderTile<'_, M, Y, L> {
    type Output = FrameStats;

    #[inline(always)]
    fn call(self) -> FrameStats {
        let Self { lanes, scene, tile, scratch, pixels } = self;
        pixels.fill(TilePixel::TRANSPARENT);
        let mut stats = FrameStats::default();
        let PixelRect { x, y, width, height } = scene.in_view.bins.grid.rect(tile);
        let has_layers = scene.layers.has_some_in(x..x + width, y..y + height);
        let within = scene.functions.domain.within();
        let is_there = match within {
            None => scene.in_view.boundary.has_some(tile),
            Some(_) => scene.in_view.bins.has_some(tile),
        };
        if !is_there && !has_layers {
            return stats;
        }
        let rays = TileRays::new(scene.view, Bounds { x0: x, x1: x + width, y0: y, y1: y + height });
        let TileScratch { domain, .. } = scratch;
        match within {
            None => domain.find(lanes, (scene.view, &scene.in_view.vertices), (&scene.in_view.boundary, tile), &rays),
            Some(within) => domain.find_in_box(scene.view, within, &rays),
        }
        let near = scene.view.near_depth();
        let mut lights: [_; PIXELS] = std::array::from_fn(|pixel| {
            // Pixels beyond the image's edge have no ray; any of the tile's serves.
            let (column, row) = (x + (pixel % TILE_PX).min(width - 1), y + (pixel / TILE_PX).min(height - 1));
            RayLight::<M::Ray, _>::new(near, scene.layers.ahead(column, row))
        });
        if !scratch.domain.is_empty() {
            scratch.slabs.list(scene.in_view, tile, scene.values);
            scene.draw(scratch, &rays, &mut lights, &mut stats);
        }
        for row in 0..height {
            for column in (0..width).filter(|column| rays.rendered[row] >> column & 1 == 1) {
                let light = &lights[row * TILE_PX + column];
                stats.segments += u64::from(light.segments);
                stats.rays_hit += u64::from(!scratch.domain.of(row * TILE_PX + column).is_empty());
                stats.rays_stopped_early += u64::from(scene.skip.opaque && light.is_opaque());
                pixels[row * width + column] = light.pixel();
            }
        }
        stats
    }
}

impl<M: Medium<Light = Accumulator>, Y: Layers> Scene<'_, M, Y> {
    /// Draws the slabs of a tile.
    #[inline(always)]
    fn draw<A: Ahead + Copy>(
        &self,
        scratch: &mut TileScratch,
        rays: &TileRays,
        lights: &mut [RayLight<M::Ray, A>; PIXELS],
        stats: &mut FrameStats,
    ) {
        let TileScratch { domain, slabs, sums, slopes } = scratch;
        let depths = &self.in_view.depths;
        while let Some((slab, ends)) = slabs.next(depths) {
            if self.cancel.is_cancelled() {
                return;
            }
            let Some(wanted) = self.wanted(domain, rays, lights, ends) else { continue };
            let Some(values) = slabs.values(&slab, self.functions.normalise) else { continue };
            let [least, most] = values.map(f64::from);
            if self.skip.transparent_cells && !self.table.is_visible_in(least, most) {
                stats.function_slabs_clear += 1;
                continue;
            }
            let (asked, is_halved) = slabs.sheets(&slab, ends, values, depths);
            if is_halved {
                slabs.halve(&slab, depths);
                continue;
            }
            stats.function_slabs += 1;
            stats.functions_projected += slabs.project(&slab, &self.functions.kernels, self.view, rays);
            stats.function_slabs_limited += u64::from(asked > AT_ONCE as f64);
            let sheets = SheetDepths::between(ends, asked, depths.ends[1]);
            stats.sheets += sheets.count as u64 + 1;
            sums.begin(sheets, values, self.functions.normalise);
            let mut slopes = self.functions.light.map(|_| &mut *slopes);
            if let Some(slopes) = &mut slopes {
                slopes.begin(sheets.count + 1);
            }
            self.sum(slabs, &slab, (&mut *sums, slopes.as_deref_mut()), sheets, wanted);
            sums.divide(sheets, wanted);
            let summed = Summed { slabs, slab: &slab, values, sums, slopes: slopes.as_deref(), sheets };
            self.pass(domain, (rays, wanted), summed, lights, stats);
        }
    }

    /// The rows of a tile with a ray that is cast, in the domain between two depths, and not opaque; `None` without one.
    #[inline(always)]
    fn wanted<A: Ahead + Copy>(
        &self,
        domain: &Domain,
        rays: &TileRays,
        lights: &[RayLight<M::Ray, A>; PIXELS],
        [near, far]: [f64; 2],
    ) -> Option<u16> {
        let mut rows = 0u16;
        for (row, &bits) in rays.rendered.iter().enumerate() {
            let is_wanted = |column: usize| {
                let pixel = row * TILE_PX + column;
                bits >> column & 1 == 1
                    && domain.of(pixel).iter().any(|[from, to]| *from < far && *to > near)
                    && !(self.skip.opaque && lights[pixel].is_opaque())
            };
            rows |= u16::from((0..TILE_PX).any(is_wanted)) << row;
        }
        (rows != 0).then_some(rows)
    }

    /// Sums the functions of a slab on some of its sheets.
    #[inline(always)]
    fn sum(
        &self,
        slabs: &Slabs,
        slab: &Slab,
        (sums, mut slopes): (&mut Sums, Option<&mut Slopes>),
        sheets: SheetDepths,
        rows: u16,
    ) {
        let kernels = &self.functions.kernels;
        let (cut, height_at_cut) = (kernels.cut(), kernels.height_at_cut() as f32);
        for (function, bounds, value, kernel) in slabs.members(slab) {
            let term = Term { kernel, value, height_at_cut, cut, bounds, is_thin: function.is_thin };
            sums.add(term, sheets, rows, slopes.as_deref_mut());
        }
    }

    /// Integrates light between the sheets.
    #[inline(always)]
    fn pass<A: Ahead + Copy>(
        &self,
        domain: &Domain,
        (rays, rows): (&TileRays, u16),
        summed: Summed<'_>,
        lights: &mut [RayLight<M::Ray, A>; PIXELS],
        stats: &mut FrameStats,
    ) {
        let Summed { sums, sheets, .. } = summed;
        let all = [sheets.depth(0), sheets.depth(sheets.count)];
        for pixel in (0..PIXELS).filter(|pixel| is_cast(rays, rows, *pixel)) {
            let light = &mut lights[pixel];
            if self.skip.opaque && light.is_opaque() {
                continue;
            }
            let line = rays.ray(self.view, pixel).line;
            for &[from, to] in domain.of(pixel).iter().filter(|[from, to]| *from < all[1] && *to > all[0]) {
                // Each part by itself: what is left out before it changes nothing.
                light.leave();
                let mut near = RayPoint { depth: all[0], scalar: sums.field(0, pixel) };
                for sheet in 1..=sheets.count {
                    let far = RayPoint { depth: sheets.depth(sheet), scalar: sums.field(sheet, pixel) };
                    let between =
                        Between { pixel, sheet, ends: [near, far], from: near.depth.max(from), to: far.depth.min(to) };
                    self.pass_between(&summed, between, line, light, stats);
                    near = far;
                }
            }
        }
    }

    /// Integrates light in a part of what is between two sheets.
    #[inline(always)]
    fn pass_between<A: Ahead>(
        &self,
        summed: &Summed<'_>,
        between: Between,
        line: RayLine,
        light: &mut RayLight<M::Ray, A>,
        stats: &mut FrameStats,
    ) {
        let share = self.covered(summed, &between);
        if share <= 0.0 {
            light.leave();
            return;
        }
        if between.from >= between.to {
            return;
        }
        let Some([near, far]) = between.reached(|| Some(self.in_the_middle(summed, &between)?.0)) else {
            light.leave();
            stats.function_gaps += 1;
            return;
        };
        let covered = RayLine { length_per_depth: line.length_per_depth * share, ..line };
        let segment = Segment::of_scalars(0, near, far, covered).between([between.from, between.to]);
        match self.functions.light.zip(summed.slopes) {
            None => light.go_on(self.medium, segment),
            Some((slope_light, slopes)) => {
                let share = || {
                    let on = |sheet| slopes.gradient(summed.sums, sheet, between.pixel, self.functions.normalise);
                    let gradient = between.gradient([on(between.sheet - 1), on(between.sheet)]);
                    let gradient = gradient.or_else(|| Some(self.in_the_middle(summed, &between)?.1));
                    slope_light.share(in_space(self.view, gradient.unwrap_or_default()), along(self.view, line)) as f32
                };
                light.go_on(&Lit { medium: self.medium, share }, segment);
            }
        }
    }

    /// The share of the optical depth in a part of what is between two sheets: the coverage, linear there, in its middle.
    #[inline(always)]
    fn covered(&self, summed: &Summed<'_>, between: &Between) -> f64 {
        let Some(coverage) = self.functions.domain.coverage() else { return 1.0 };
        let weight = |sheet| f64::from(summed.sums.weight(sheet, between.pixel));
        let [a, b] = [between.sheet - 1, between.sheet].map(|sheet| coverage.at(weight(sheet)));
        a + (b - a) * between.share()
    }

    /// The field in the middle of a part of what is between two sheets that no function reaches, and its gradient along the view's axes.
    fn in_the_middle(&self, summed: &Summed<'_>, between: &Between) -> Option<(f64, Vec3)> {
        let at = (between.pixel % TILE_PX, between.pixel / TILE_PX);
        summed.slabs.value(summed.slab, at, between.middle(), (self.functions, summed.values))
    }
}

/// A slab whose functions are summed on its sheets.
#[derive(Clone, Copy)]
struct Summed<'a> {
    slabs: &'a Slabs,
    slab: &'a Slab,
    /// Least and greatest value that the field can have there.
    values: [f32; 2],
    sums: &'a Sums,
    /// Of a lit field.
    slopes: Option<&'a Slopes>,
    sheets: SheetDepths,
}

/// The part of a ray between a sheet and the one before, from one depth to another.
#[derive(Clone, Copy)]
struct Between {
    pixel: usize,
    /// The farther one of the two.
    sheet: usize,
    /// Where the ray meets them; scalars are NaN where no function reaches.
    ends: [RayPoint; 2],
    from: f64,
    to: f64,
}

impl Between {
    fn middle(&self) -> f64 {
        0.5 * (self.from + self.to)
    }

    /// Where the middle is from the nearer sheet to the farther one, 0 to 1.
    fn share(&self) -> f64 {
        let [near, far] = self.ends.map(|end| end.depth);
        (self.middle() - near) / (far - near)
    }

    /// The ends: where functions reach one of them only, its scalar holds, and where they reach none, that in between them does; `None` if there
    /// is none.
    #[inline(always)]
    fn reached(&self, there: impl FnOnce() -> Option<f64>) -> Option<[RayPoint; 2]> {
        let [near, far] = self.ends.map(|end| (!end.scalar.is_nan()).then_some(end.scalar));
        let scalar = near.or(far).or_else(there)?;
        Some([
            RayPoint { scalar: near.unwrap_or(scalar), ..self.ends[0] },
            RayPoint { scalar: far.unwrap_or(scalar), ..self.ends[1] },
        ])
    }

    /// The gradient in the middle: linear, or that of the one sheet which functions reach; `None` without one.
    fn gradient(&self, [near, far]: [Vec3; 2]) -> Option<Vec3> {
        match [near, far].map(|gradient| !gradient.is_nan()) {
            [true, true] => Some(near + self.share() as f32 * (far - near)),
            [true, false] => Some(near),
            [false, true] => Some(far),
            [false, false] => None,
        }
    }
}

/// A medium whose colours are multiplied by a share, which is asked for where something is to be seen.
struct Lit<'a, M, S> {
    medium: &'a M,
    share: S,
}

impl<M: Medium<Light = Accumulator>, S: Fn() -> f32 + Sync> Medium for Lit<'_, M, S> {
    type Ray = M::Ray;
    type Light = Accumulator;
    const HAS_VALUES: bool = M::HAS_VALUES;

    #[inline(always)]
    fn pass(&self, ray: &mut M::Ray, segment: &Segment, light: &mut Accumulator) -> u32 {
        let mut behind = light.behind();
        let pieces = self.medium.pass(ray, segment, &mut behind);
        if pieces > 0 {
            light.add_lit(behind, (self.share)());
        }
        pieces
    }
}

/// A vector along the axes of a view in world directions.
fn in_space(view: &View, along_axes: Vec3) -> DVec3 {
    let [x, y, z] = along_axes.as_dvec3().to_array();
    x * view.right + y * view.up + z * view.forward
}

/// Direction of a ray, per unit of depth.
fn along(view: &View, RayLine { px, py, .. }: RayLine) -> DVec3 {
    if view.perspective { px * view.right + py * view.up + view.forward } else { view.forward }
}

/// Whether the ray of a pixel is cast, and its row wanted.
#[inline(always)]
fn is_cast(rays: &TileRays, rows: u16, pixel: usize) -> bool {
    let (row, column) = (pixel / TILE_PX, pixel % TILE_PX);
    rows >> row & 1 == 1 && rays.rendered[row] >> column & 1 == 1
}
