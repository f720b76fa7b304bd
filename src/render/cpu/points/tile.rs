//! Draws one tile: fragments of its points, then light of its pixels.

use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::{Medium, RayPoint, Segment};
use super::super::light::RayLight;
use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::lists::Bins;
use super::super::ray::Ray;
use super::super::tiles::{PixelRect, TILE_PX, TileBits, TilePixel};
use super::super::values::ValuesOnRay;
use super::fragment::{Fragment, Fragments, Order};
use super::shape::{Point, Shape, ShapeSource};
use crate::mesh::Topology;
use crate::optics::Accumulator;
use crate::render::points::{Compositing, Footprint};
use crate::stats::FrameStats;
use crate::task::Cancel;
use pulp::WithSimd;

/// Pixels of a tile.
pub(super) const PIXELS: usize = TILE_PX * TILE_PX;

/// Fragments of a tile in memory at a time, as bounded by boxes: 10 MB a thread.
const FRAGMENTS_AT_ONCE: usize = 1 << 18;

/// Points drawn between two checks of the cancel flag.
const POINTS_AT_ONCE: usize = 1024;

/// Scene data shared by all tiles of a frame.
pub(super) struct Scene<'a, M, Y> {
    pub(super) topology: &'a Topology,
    pub(super) source: ShapeSource<'a>,
    pub(super) bins: &'a Bins<u32>,
    pub(super) medium: &'a M,
    pub(super) layers: &'a Y,
    pub(super) early_termination: bool,
    pub(super) cancel: &'a Cancel,
}

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    fragments: Fragments,
}

/// Renders one tile into the first pixels of `pixels`, row by row; returns its statistics.
pub(super) struct RenderTile<'a, M, Y> {
    pub(super) scene: &'a Scene<'a, M, Y>,
    pub(super) tile: usize,
    pub(super) scratch: &'a mut TileScratch,
    pub(super) pixels: &'a mut [TilePixel],
}

impl<M: Medium<Light = Accumulator>, Y: Layers> WithSimd for RenderTile<'_, M, Y> {
    type Output = FrameStats;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> FrameStats {
        let Self { scene, tile, scratch, pixels } = self;
        pixels.fill(TilePixel::TRANSPARENT);
        let mut stats = FrameStats::default();
        let rect = scene.bins.grid.rect(tile);
        let PixelRect { x, y, width, height } = rect;
        let has_layers = scene.layers.has_some_in(x..x + width, y..y + height);
        if !scene.bins.has_some(tile) && !has_layers {
            return stats;
        }
        let view = scene.source.view;
        let rays = TileRays::new(view, Bounds { x0: x, x1: x + width, y0: y, y1: y + height });
        if has_layers {
            // Those without points; the others follow.
            scene.each(&rays.rendered, |pixel| {
                let (column, row) = (pixel % TILE_PX, pixel / TILE_PX);
                let light = RayLight::<M::Ray, _>::new(view.near_depth(), scene.layers.ahead(x + column, y + row));
                pixels[row * width + column] = light.pixel();
            });
        }
        for wanted in scene.passes(tile, &rays) {
            scene.collect(tile, &rays, &wanted, &mut scratch.fragments.found);
            if scene.cancel.is_cancelled() {
                break;
            }
            stats.fragments += scratch.fragments.found.len() as u64;
            scratch.fragments.each_pixel(scene.order(), |pixel, found, words| {
                let (column, row) = (pixel % TILE_PX, pixel / TILE_PX);
                let fragments = words.iter().map(|&word| &found[word as u32 as usize]);
                let ahead = scene.layers.ahead(x + column, y + row);
                let light = scene.light(&rays.ray(view, pixel), fragments, ahead);
                stats.segments += u64::from(light.segments);
                stats.out_of_order += u64::from(light.out_of_order);
                stats.rays_stopped_early += u64::from(scene.early_termination && light.is_opaque());
                stats.rays_hit += 1;
                pixels[row * width + column] = light.pixel();
            });
        }
        stats
    }
}

impl<M: Medium<Light = Accumulator>, Y: Layers> Scene<'_, M, Y> {
    /// Calls `each` with each wanted pixel of a tile.
    fn each(&self, wanted: &TileBits, mut each: impl FnMut(usize)) {
        for (row, bits) in wanted.iter().enumerate() {
            (0..TILE_PX).filter(|column| bits >> column & 1 == 1).for_each(|column| each(row * TILE_PX + column));
        }
    }

    /// The pixels of a tile whose rays are cast, in parts whose fragments are drawn together.
    fn passes(&self, tile: usize, rays: &TileRays) -> impl Iterator<Item = TileBits> + use<M, Y> {
        let chunks = 0..self.bins.chunk_count();
        let area = |bounds: Bounds| (bounds.x1 - bounds.x0) * (bounds.y1 - bounds.y0);
        let items = chunks.flat_map(|chunk| self.bins.items(chunk, tile));
        let most: usize = items.map(|item| area(item.bounds())).sum();
        let at_once = (PIXELS * FRAGMENTS_AT_ONCE / most.max(1)).clamp(1, PIXELS);
        let rendered = rays.rendered;
        (0..PIXELS.div_ceil(at_once)).map(move |pass| {
            let first = pass * at_once;
            let bits = |row: usize| {
                let columns =
                    (0..TILE_PX).filter(|column| (first..first + at_once).contains(&(row * TILE_PX + column)));
                columns.fold(0u16, |bits, column| bits | 1 << column)
            };
            std::array::from_fn(|row| rendered[row] & bits(row))
        })
    }

    /// Finds the fragments of the wanted pixels, in list order; only some if the job is cancelled.
    #[inline(always)]
    fn collect(&self, tile: usize, rays: &TileRays, wanted: &TileBits, found: &mut Vec<Fragment>) {
        found.clear();
        for chunk in 0..self.bins.chunk_count() {
            for items in self.bins.items(chunk, tile).chunks(POINTS_AT_ONCE) {
                if self.cancel.is_cancelled() {
                    return;
                }
                for item in items {
                    if let Some(point) = self.source.point(item.item) {
                        self.cover(&point, item.bounds(), (rays, wanted), found);
                    }
                }
            }
        }
    }

    /// Finds the fragments of a point.
    #[inline(always)]
    fn cover(&self, point: &Point, bounds: Bounds, (rays, wanted): (&TileRays, &TileBits), found: &mut Vec<Fragment>) {
        let (cell, view) = (point.cell, self.source.view);
        let is_gap = self.source.style.compositing == Compositing::Gap;
        if let Shape::Tet(tet, longer) = &point.shape {
            tet.in_tile(view, rays).hits((view, rays), bounds, wanted, |pixel, [entry, exit]| {
                let (mut depth, mut scalar) = ([entry.depth, exit.depth], [entry.scalar, exit.scalar]);
                if is_gap {
                    (depth, scalar) = ([point.center.z; 2], [point.mean; 2]);
                } else if *longer != 1.0 {
                    let (middle, half) = (0.5 * (depth[0] + depth[1]), 0.5 * longer * (depth[1] - depth[0]));
                    depth = [middle - half, middle + half];
                }
                found.push(Fragment { depth, scalar, cell, pixel: pixel as u32 });
            });
            return;
        }
        let columns = ((1u32 << bounds.x1) - (1u32 << bounds.x0)) as u16;
        for (row, wanted) in wanted.iter().enumerate().take(bounds.y1).skip(bounds.y0) {
            let mut asked = wanted & columns;
            while asked != 0 {
                let pixel = row * TILE_PX + asked.trailing_zeros() as usize;
                asked &= asked - 1;
                if let Some(slab) = point.slab(&self.source, rays.at(pixel)) {
                    let half = if is_gap { 0.0 } else { 0.5 * slab.thickness };
                    let depth = [slab.middle - half, slab.middle + half];
                    found.push(Fragment { depth, scalar: [slab.scalar; 2], cell, pixel: pixel as u32 });
                }
            }
        }
    }

    /// Whether segments are those of rays in cells, each of which begins where what is composited ends.
    fn are_cut(&self) -> bool {
        self.source.style.footprint == Footprint::Exact
    }

    /// What the fragments of a pixel are sorted by.
    fn order(&self) -> Order {
        let style = self.source.style;
        match style.compositing {
            _ if !style.exact_order => Order::Listed,
            Compositing::Own if !self.are_cut() => Order::Middle,
            Compositing::Own | Compositing::Gap => Order::Entry,
        }
    }

    /// The light of a ray from its fragments in order.
    #[inline(always)]
    fn light<'f, A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = &'f Fragment> + Clone,
        ahead: A,
    ) -> RayLight<M::Ray, A> {
        let light = RayLight::new(self.source.view.near_depth(), ahead);
        match self.source.style.compositing {
            Compositing::Gap => self.light_of_gaps(ray, fragments, light),
            Compositing::Own if self.are_cut() => self.light_of_cells(ray, fragments, light),
            Compositing::Own => self.light_of_slabs(ray, fragments, light),
        }
    }

    /// Light of the segments between successive points.
    #[inline(always)]
    fn light_of_gaps<'f, A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = &'f Fragment>,
        mut light: RayLight<M::Ray, A>,
    ) -> RayLight<M::Ray, A> {
        let mut last: Option<RayPoint> = None;
        for fragment in fragments {
            let [point, _] = fragment.ends();
            if let Some(last) = last {
                light.go_on(self.medium, self.segment(ray, fragment.cell, last, point));
            }
            let depth = last.map_or(point.depth, |last| last.depth.max(point.depth));
            last = Some(RayPoint { depth, ..point });
            if self.early_termination && light.is_opaque() {
                break;
            }
        }
        light
    }

    /// Light of slabs, which add up.
    #[inline(always)]
    fn light_of_slabs<'f, A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = &'f Fragment>,
        mut light: RayLight<M::Ray, A>,
    ) -> RayLight<M::Ray, A> {
        let near = self.source.view.near_depth();
        for fragment in fragments {
            let [from, to] = fragment.ends();
            light.add(self.medium, self.segment(ray, fragment.cell, from, to), near);
            if self.early_termination && light.is_opaque() {
                break;
            }
        }
        light
    }

    /// Light of the segments in cells. Where the ray goes from cell to cell, runs of them are composited together.
    #[inline(always)]
    fn light_of_cells<'f, A: Ahead>(
        &self,
        ray: &Ray,
        mut fragments: impl Iterator<Item = &'f Fragment> + Clone,
        mut light: RayLight<M::Ray, A>,
    ) -> RayLight<M::Ray, A> {
        let mut last = RayPoint { depth: f64::NEG_INFINITY, scalar: 0.0 };
        loop {
            let (run, end) = self.run(&light, last, fragments.clone());
            if run > 1 {
                let before = light;
                let segments = fragments.clone().take(run).map(|fragment| {
                    let [entry, exit] = fragment.ends();
                    self.segment(ray, fragment.cell, entry, exit)
                });
                light.go_on_in_run(self.medium, last.scalar, segments, end.depth);
                if !light.is_opaque() {
                    fragments.by_ref().take(run).for_each(drop);
                    last = end;
                    continue;
                }
                // A ray becomes opaque only once: the run is then repeated one by one.
                light = before;
            }
            for fragment in fragments.by_ref().take(run.max(1)) {
                let [entry, exit] = fragment.ends();
                if entry != last {
                    light.leave();
                }
                light.go_on(self.medium, self.segment(ray, fragment.cell, entry, exit));
                last = exit;
                if self.early_termination && light.is_opaque() {
                    return light;
                }
            }
            if fragments.clone().next().is_none() {
                return light;
            }
        }
    }

    /// Number of fragments that follow each other without a gap from the point `last` on and are composited together, and their end.
    #[inline(always)]
    fn run<'f, A: Ahead>(
        &self,
        light: &RayLight<M::Ray, A>,
        mut last: RayPoint,
        fragments: impl Iterator<Item = &'f Fragment>,
    ) -> (usize, RayPoint) {
        let up_to = light.runs_up_to(self.medium);
        if up_to == f64::NEG_INFINITY || !light.is_at(last.depth) {
            return (0, last);
        }
        let goes_on = |fragment: &&Fragment| {
            let [entry, exit] = fragment.ends();
            let goes_on = entry == last && exit.depth > entry.depth && exit.depth <= up_to;
            last = if goes_on { exit } else { last };
            goes_on
        };
        let count = fragments.take_while(goes_on).count();
        (count, last)
    }

    /// The segment of a fragment, with values at its ends for a medium that needs them.
    #[inline(always)]
    fn segment(&self, ray: &Ray, cell: u32, from: RayPoint, to: RayPoint) -> Segment {
        let depth = [from.depth, to.depth];
        let value = if M::HAS_VALUES { self.values(ray, cell, depth) } else { [0.0; 2] };
        Segment::new(cell, depth, [from.scalar, to.scalar], value, ray.line)
    }

    /// Values beside the scalar at the ends of a segment.
    #[cold]
    #[inline(never)]
    fn values(&self, ray: &Ray, cell: u32, depth: [f64; 2]) -> [f64; 2] {
        let ShapeSource { vertices, style, .. } = self.source;
        if style.is_exact() {
            let on_ray = ValuesOnRay { medium: self.medium, topology: self.topology, vertices, ray: *ray };
            return on_ray.along(cell, depth[0], 0.0, cell);
        }
        let sum: f64 = self.topology.tets[cell as usize].iter().map(|&v| self.medium.vertex_value(v)).sum();
        [0.25 * sum; 2]
    }
}
