//! Draws one tile: fragments of its points, then light of its pixels.

use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::{Medium, RayPoint, Segment};
#[cfg(target_arch = "x86_64")]
use super::super::lanes::segments::{RowScratch, SegmentRays, SegmentsByPixel, Target};
use super::super::light::RayLight;
use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::fragments::PIXELS;
#[cfg(target_arch = "x86_64")]
use super::super::raster::fragments::SegmentEnds;
use super::super::raster::lists::Bins;
use super::super::ray::Ray;
use super::super::tiles::{PixelRect, TILE_PX, TileBits, TilePixel};
use super::super::values::ValuesOnRay;
use super::cover::CoverScratch;
use super::fragment::{self, Fragment, Fragments, FragmentsByPixel};
use super::shape::ShapeSource;
use crate::mesh::Topology;
use crate::optics::Accumulator;
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::stats::FrameStats;
use crate::task::Cancel;
use pulp::Arch;
#[cfg(target_arch = "x86_64")]
use std::ops::Range;

/// Fragments of a tile in memory at a time, as bounded by boxes: 15 MB a thread.
const FRAGMENTS_AT_ONCE: usize = 1 << 18;

/// Scene data shared by all tiles of a frame.
pub(super) struct Scene<'a, M, Y> {
    pub(super) topology: &'a Topology,
    pub(super) source: ShapeSource<'a>,
    pub(super) bins: &'a Bins<u32>,
    pub(super) medium: &'a M,
    pub(super) layers: &'a Y,
    pub(super) early_termination: bool,
    pub(super) cancel: &'a Cancel,
    /// The vectors that are used.
    pub(super) arch: Arch,
}

/// Buffers of a tile, reused from tile to tile.
#[derive(Default)]
pub(super) struct TileScratch {
    cover: CoverScratch,
    fragments: Fragments,
    #[cfg(target_arch = "x86_64")]
    rows: RowScratch,
}

/// The segments of rays in cells.
#[cfg(target_arch = "x86_64")]
struct Segments<'a> {
    fragments: FragmentsByPixel<'a>,
    /// One scalar per cell, instead of those of fragments.
    scalars: Option<&'a [f32]>,
}

#[cfg(target_arch = "x86_64")]
impl SegmentsByPixel for Segments<'_> {
    fn range(&self, pixel: usize) -> Range<usize> {
        self.fragments.range(pixel)
    }

    #[inline(always)]
    fn some(&self, range: Range<usize>) -> impl Iterator<Item = SegmentEnds> {
        let scalars = self.scalars;
        self.fragments.some(range).map(move |(ends, cell)| match scalars {
            None => ends,
            Some(scalars) => SegmentEnds { scalar: [f64::from(scalars[cell as usize]); 2], ..ends },
        })
    }
}

impl<M: Medium<Light = Accumulator>, Y: Layers> Scene<'_, M, Y> {
    /// Renders one tile into the first pixels of `pixels`, row by row; returns its statistics.
    pub(super) fn render(&self, tile: usize, scratch: &mut TileScratch, pixels: &mut [TilePixel]) -> FrameStats {
        pixels.fill(TilePixel::TRANSPARENT);
        let mut stats = FrameStats::default();
        let rect = self.bins.grid.rect(tile);
        let PixelRect { x, y, width, height } = rect;
        let has_layers = self.layers.has_some_in(x..x + width, y..y + height);
        if !self.bins.has_some(tile) && !has_layers {
            return stats;
        }
        let view = self.source.view;
        let rays = TileRays::new(view, Bounds { x0: x, x1: x + width, y0: y, y1: y + height });
        self.list(tile, &mut scratch.cover);
        for wanted in self.passes(tile, &rays) {
            self.collect((&rays, &wanted), &mut scratch.cover, &mut scratch.fragments);
            if self.cancel.is_cancelled() {
                break;
            }
            stats.fragments += scratch.fragments.len() as u64;
            let fragments = match self.source.style.exact_order {
                true => scratch.fragments.by_pixel(fragment::sort),
                false => scratch.fragments.by_pixel(|_, _| ()),
            };
            #[cfg(target_arch = "x86_64")]
            if let Some(table) = self.medium.exact_table().filter(|_| self.are_cut() && !has_layers) {
                let segments = Segments { fragments, scalars: self.medium.cell_scalars() };
                let into = Target { scratch: &mut scratch.rows, pixels, unfinished: None };
                let in_lanes = SegmentRays::new((view, &rays), segments);
                if let Some(counts) = in_lanes.composite(self.arch, table, self.early_termination, into) {
                    stats.add_counts(&counts);
                    continue;
                }
            }
            self.each(&wanted, |pixel| self.composite(pixel, &rays, &fragments, pixels, &mut stats));
        }
        stats
    }

    /// Calls `each` with each wanted pixel of a tile.
    fn each(&self, wanted: &TileBits, mut each: impl FnMut(usize)) {
        for (row, bits) in wanted.iter().enumerate() {
            (0..TILE_PX).filter(|column| bits >> column & 1 == 1).for_each(|column| each(row * TILE_PX + column));
        }
    }

    /// Composites the fragments of a pixel, also those of other layers alone.
    #[inline(always)]
    fn composite(
        &self,
        pixel: usize,
        rays: &TileRays,
        fragments: &FragmentsByPixel<'_>,
        pixels: &mut [TilePixel],
        stats: &mut FrameStats,
    ) {
        let range = fragments.range(pixel);
        let Bounds { x0, x1, y0, .. } = rays.bounds;
        let (column, row) = (pixel % TILE_PX, pixel / TILE_PX);
        let (place, ahead) = (row * (x1 - x0) + column, self.layers.ahead(x0 + column, y0 + row));
        if range.is_empty() {
            if Y::ANY {
                pixels[place] = RayLight::<M::Ray, _>::new(self.source.view.near_depth(), ahead).pixel();
            }
            return;
        }
        let light = self.light(&rays.ray(self.source.view, pixel), fragments.some(range).map(Fragment::from), ahead);
        stats.segments += u64::from(light.segments);
        stats.out_of_order += u64::from(light.out_of_order);
        stats.rays_stopped_early += u64::from(self.early_termination && light.is_opaque());
        stats.rays_hit += 1;
        pixels[place] = light.pixel();
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

    /// Whether segments are those of rays in cells, each of which begins where what is composited ends.
    fn are_cut(&self) -> bool {
        let PointStyle { compositing, footprint, .. } = self.source.style;
        compositing == Compositing::Own && footprint == Footprint::Exact
    }

    /// The light of a ray from its fragments in order.
    #[inline(always)]
    fn light<A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = Fragment> + Clone,
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
    fn light_of_gaps<A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = Fragment>,
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
    fn light_of_slabs<A: Ahead>(
        &self,
        ray: &Ray,
        fragments: impl Iterator<Item = Fragment>,
        mut light: RayLight<M::Ray, A>,
    ) -> RayLight<M::Ray, A> {
        let near = self.source.view.near_depth();
        for fragment in fragments {
            let [from, to] = fragment.ends_of_slab();
            light.add(self.medium, self.segment(ray, fragment.cell, from, to), near);
            if self.early_termination && light.is_opaque() {
                break;
            }
        }
        light
    }

    /// Light of the segments in cells. Where the ray goes from cell to cell, runs of them are composited together.
    #[inline(always)]
    fn light_of_cells<A: Ahead>(
        &self,
        ray: &Ray,
        mut fragments: impl Iterator<Item = Fragment> + Clone,
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

    /// Number of fragments that follow each other without a gap from the point `last` on and are composited together, and their end. None
    /// behind them begins before it: a run counts as visible to its end, which would cut what begins there.
    #[inline(always)]
    fn run<A: Ahead>(
        &self,
        light: &RayLight<M::Ray, A>,
        last: RayPoint,
        fragments: impl Iterator<Item = Fragment>,
    ) -> (usize, RayPoint) {
        let up_to = light.runs_up_to(self.medium);
        if !self.source.style.exact_order || up_to == f64::NEG_INFINITY || !light.is_at(last.depth) {
            return (0, last);
        }
        let (mut count, mut before, mut end) = (0, last, last);
        for fragment in fragments {
            let [entry, exit] = fragment.ends();
            if entry != end || exit.depth <= entry.depth || exit.depth > up_to {
                return if entry.depth < end.depth && count > 0 { (count - 1, before) } else { (count, end) };
            }
            (count, before, end) = (count + 1, end, exit);
        }
        (count, end)
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
        if style.is_exact() && !style.constant_scalar {
            let on_ray = ValuesOnRay { medium: self.medium, topology: self.topology, vertices, ray: *ray };
            return on_ray.along(cell, depth[0], 0.0, cell);
        }
        if self.source.has_cell_scalars() {
            return [self.medium.value_in_cell(cell); 2];
        }
        let sum: f64 = self.topology.tets[cell as usize].iter().map(|&v| self.medium.vertex_value(v)).sum();
        [0.25 * sum; 2]
    }
}
