//! Fragments of other layers of the frame on the rays of this one.
//!
//! A layer that does not consist of cells reaches the rays of this one as a list of fragments per pixel. A fragment has a depth, at which
//! it cuts the segment of the cell there: the near part ends before it, the far part begins at it.
//!
//! Fragments are sorted nearest first, equal depths in layer order. They are composited in front of the cells, in gaps, behind them and
//! where there are no cells, but not in front of the near plane nor behind an opaque depth. Frames of one layer compile to code without
//! them (`NoLayers`). The GPU has them in a texture (`render/gpu/layer_fragments.rs`), for rays and faces; it leaves points, and rays that contrast
//! decides about, to the CPU. The surfaces of the domain and of regions are such a layer, and flow, of which a hardware GPU draws the splats
//! themselves ([`super::flow`]).

use super::{RenderError, RenderJob};
use crate::camera::View;
use std::ops::Range;
use std::sync::Arc;

/// A point at which a ray passes through a surface of another layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerFragment {
    /// World length along the viewing direction, from the eye (parallel projection: from the camera's position); finite.
    pub depth: f64,
    /// Premultiplied colour, and opacity.
    pub rgba: [f32; 4],
}

/// The fragments of some pixels that follow each other in a rendered plane.
#[derive(Clone, Debug, Default)]
pub(in crate::render) struct ListedFragments {
    /// For each pixel, where its fragments begin and end.
    pub(in crate::render) spans: Vec<[u32; 2]>,
    /// The fragments of each pixel, nearest first, equal depths in layer order.
    pub(in crate::render) fragments: Vec<LayerFragment>,
}

impl ListedFragments {
    /// Keeps the fragments whose depths, in units of `per_unit`, lie in the intervals of their pixel, which ascend and have both ends; returns how
    /// many are left out.
    pub(in crate::render) fn keep_within<'a>(
        &mut self,
        intervals_of: impl Fn(usize) -> &'a [[f64; 2]],
        per_unit: f64,
    ) -> u64 {
        let Self { spans, fragments } = self;
        let mut left_out = 0;
        for (pixel, [begin, end]) in spans.iter_mut().enumerate() {
            let (mut kept, mut next, all) = (*begin as usize, *begin as usize, *end as usize);
            for [near, far] in intervals_of(pixel) {
                let from = next + fragments[next..all].partition_point(|of| of.depth / per_unit < *near);
                next = from + fragments[from..all].partition_point(|of| of.depth / per_unit <= *far);
                if kept < from {
                    fragments.copy_within(from..next, kept);
                }
                kept += next - from;
            }
            left_out += (all - kept) as u64;
            *end = kept as u32;
        }
        left_out
    }
}

/// The fragments of all pixels of a rendered plane.
#[derive(Clone, Debug, Default)]
pub struct LayerFragments {
    /// Each pixel's part of a list.
    pixels: Vec<Span>,
    /// One list, or one per row of pixels: lists that are made side by side are not copied together.
    lists: Vec<Vec<LayerFragment>>,
    /// Fragments of all pixels.
    count: usize,
    /// Whether light changes from pixel to pixel within a layer, not at its ends alone.
    is_textured: bool,
}

/// The fragments of a pixel: a part of a list.
#[derive(Clone, Copy, Debug)]
struct Span {
    list: u32,
    begin: u32,
    end: u32,
}

/// Compares the fragments of each pixel, however they are listed.
impl PartialEq for LayerFragments {
    fn eq(&self, other: &Self) -> bool {
        let is_same = |pixel| self.of_pixel(pixel) == other.of_pixel(pixel);
        (self.pixels(), self.is_textured) == (other.pixels(), other.is_textured) && (0..self.pixels()).all(is_same)
    }
}

impl LayerFragments {
    /// Sorts (pixel, fragment) pairs, given layer by layer, into lists for a plane of `pixels` pixels.
    ///
    /// # Errors
    /// If a pixel is beyond the plane, or a depth, colour or opacity is out of range.
    pub fn new(pixels: usize, found: impl IntoIterator<Item = (u32, LayerFragment)>) -> Result<Self, RenderError> {
        let mut found: Vec<(u32, LayerFragment)> = found.into_iter().collect();
        for &(pixel, LayerFragment { depth, rgba }) in &found {
            let is_light = rgba[3] <= 1.0 && rgba.iter().all(|&c| (0.0..=f32::MAX).contains(&c));
            if pixel as usize >= pixels || !depth.is_finite() || !is_light {
                return Err(RenderError::BadLayerFragment { pixel, depth, rgba });
            }
        }
        // Stable sort: equal depths stay in layer order.
        found.sort_by(|(a, of_a), (b, of_b)| a.cmp(b).then(of_a.depth.total_cmp(&of_b.depth)));
        let mut spans = Vec::with_capacity(pixels);
        let mut begin = 0;
        for pixel in 0..pixels {
            let count = found[begin..].iter().take_while(|(of, _)| *of as usize == pixel).count();
            spans.push([begin, begin + count].map(|at| at as u32));
            begin += count;
        }
        let fragments = found.into_iter().map(|(_, fragment)| fragment).collect();
        Ok(Self::of_lists(vec![ListedFragments { spans, fragments }], false))
    }

    /// The fragments of rows of pixels, which follow each other in the rendered plane.
    pub(in crate::render) fn of_lists(rows: Vec<ListedFragments>, is_textured: bool) -> Self {
        let mut all = Self { is_textured, ..Self::default() };
        all.pixels.reserve(rows.iter().map(|row| row.spans.len()).sum());
        for ListedFragments { spans, fragments } in rows {
            let list = all.lists.len() as u32;
            all.count += spans.iter().map(|[begin, end]| (end - begin) as usize).sum::<usize>();
            all.pixels.extend(spans.into_iter().map(|[begin, end]| Span { list, begin, end }));
            all.lists.push(fragments);
        }
        all
    }

    /// Its lists, whose memory others may use.
    pub(in crate::render) fn into_lists(self) -> Vec<Vec<LayerFragment>> {
        self.lists
    }

    /// The fragments of each pixel at another place; `places` are those of all of the plane.
    pub(in crate::render) fn at(self, places: &[u32]) -> Self {
        let mut from = vec![0; places.len()];
        places.iter().enumerate().for_each(|(pixel, &place)| from[place as usize] = pixel);
        let pixels = from.into_iter().map(|pixel: usize| self.pixels[pixel]).collect();
        Self { pixels, ..self }
    }

    /// These and others of the same plane; at equal depths these lie in front.
    #[must_use]
    pub fn with(&self, others: &Self) -> Self {
        let mut both = ListedFragments::default();
        for pixel in 0..self.pixels() {
            let begin = both.fragments.len() as u32;
            let (mut front, mut back) = (self.of_pixel(pixel), others.of_pixel(pixel));
            while let (Some(a), Some(b)) = (front.first(), back.first()) {
                let from = if a.depth <= b.depth { &mut front } else { &mut back };
                both.fragments.extend(from.first());
                *from = &from[1..];
            }
            both.fragments.extend_from_slice(front);
            both.fragments.extend_from_slice(back);
            both.spans.push([begin, both.fragments.len() as u32]);
        }
        Self::of_lists(vec![both], self.is_textured || others.is_textured)
    }

    /// Pixels of the plane.
    pub fn pixels(&self) -> usize {
        self.pixels.len()
    }

    /// Fragments of all pixels.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The fragments of a pixel, nearest first.
    pub fn of_pixel(&self, pixel: usize) -> &[LayerFragment] {
        let Span { list, begin, end } = self.pixels[pixel];
        &self.lists[list as usize][begin as usize..end as usize]
    }
}

impl RenderJob {
    /// The job for a renderer that draws splats, or for one that gets their fragments.
    ///
    /// # Errors
    /// If there are more fragments than memory is for.
    pub(super) fn with_flow_for(mut self, draws_flow: bool) -> Result<Self, RenderError> {
        let Some(flow) = self.flow.take() else { return Ok(self) };
        if draws_flow {
            self.fragments = flow.others().cloned();
            // They are counted where they are drawn.
            (self.stats.flow_fragments, self.stats.flow_outside) = (0, 0);
            self.flow = Some(flow);
        } else if self.fragments.is_none() {
            let (fragments, counts) = flow.fragments(None)?;
            (self.stats.flow_fragments, self.stats.flow_outside) = (fragments.count() as u64, counts.outside);
            self.fragments = Some(flow.with_others(Arc::new(fragments)));
        }
        Ok(self)
    }

    /// Whether the frame has other layers before, between and behind the cells.
    pub(crate) fn has_other_layers(&self) -> bool {
        self.fragments.is_some() || self.flow.is_some()
    }
}

/// The fragments of a frame as renderers read them; [`NoLayers`] compiles to no code.
pub(in crate::render) trait Layers: Sync {
    /// The fragments on a ray that are still ahead.
    type Ahead<'a>: Ahead
    where
        Self: 'a;

    /// Whether rays may meet fragments.
    const ANY: bool;

    /// The fragments on a pixel's ray from the near distance on.
    fn ahead(&self, column: usize, row: usize) -> Self::Ahead<'_>;

    /// Whether a rectangle of pixels has fragments.
    fn has_some_in(&self, columns: Range<usize>, rows: Range<usize>) -> bool;

    /// Whether a layer begins or ends in a rectangle: its pixels differ in their number of fragments, or have textured ones.
    fn ends_in(&self, columns: Range<usize>, rows: Range<usize>) -> bool;
}

/// The fragments on a ray that are still ahead.
pub(in crate::render) trait Ahead: Copy {
    /// An empty list.
    const NONE: Self;

    /// Local depth of the next fragment; infinite if there is none.
    fn next_depth(&self) -> f64;

    /// Takes the next fragment if it lies before a local depth: its local depth and its light.
    fn take_before(&mut self, depth: f64) -> Option<(f64, [f32; 4])>;
}

/// The layers of a frame that has only one.
pub(in crate::render) struct NoLayers;

/// An empty list of fragments.
#[derive(Clone, Copy)]
pub(in crate::render) struct NothingAhead;

impl Layers for NoLayers {
    type Ahead<'a> = NothingAhead;
    const ANY: bool = false;

    #[inline(always)]
    fn ahead(&self, _: usize, _: usize) -> NothingAhead {
        NothingAhead
    }

    #[inline(always)]
    fn has_some_in(&self, _: Range<usize>, _: Range<usize>) -> bool {
        false
    }

    #[inline(always)]
    fn ends_in(&self, _: Range<usize>, _: Range<usize>) -> bool {
        false
    }
}

impl Ahead for NothingAhead {
    const NONE: Self = Self;

    #[inline(always)]
    fn next_depth(&self) -> f64 {
        f64::INFINITY
    }

    #[inline(always)]
    fn take_before(&mut self, _: f64) -> Option<(f64, [f32; 4])> {
        None
    }
}

/// The fragments of a job, for rays in the local coordinates of its mesh.
pub(in crate::render) struct JobLayers<'a> {
    fragments: &'a LayerFragments,
    view: &'a View,
    /// Local depth of the near plane.
    near: f64,
    local_per_world: f64,
}

impl<'a> JobLayers<'a> {
    /// The fragments of a job with this local view.
    pub(in crate::render) fn of(job: &'a RenderJob, view: &'a View) -> Option<Self> {
        let near = view.near_depth();
        let local_per_world = 1.0 / job.mesh.positions.scale;
        let fragments = job.fragments.as_deref()?;
        Some(Self { fragments, view, near, local_per_world })
    }

    /// The fragments of a pixel; empty if no ray is cast for it.
    fn of_pixel(&self, column: usize, row: usize) -> &[LayerFragment] {
        let place = self.view.rendered_in(row, column..column + 1).next();
        place.map_or(&[], |(_, place)| self.fragments.of_pixel(place))
    }
}

impl Layers for JobLayers<'_> {
    type Ahead<'a>
        = FragmentsAhead<'a>
    where
        Self: 'a;
    const ANY: bool = true;

    fn ahead(&self, column: usize, row: usize) -> FragmentsAhead<'_> {
        let rest = self.of_pixel(column, row);
        let local_per_world = self.local_per_world;
        let is_hidden = |fragment: &LayerFragment| fragment.depth * local_per_world < self.near;
        // Seldom any: the search would look at half of the list's memory.
        let hidden = if rest.first().is_some_and(is_hidden) { rest.partition_point(is_hidden) } else { 0 };
        FragmentsAhead { rest: &rest[hidden..], local_per_world }
    }

    fn has_some_in(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        let has_some = |(_, place)| !self.fragments.of_pixel(place).is_empty();
        rows.into_iter().any(|row| self.view.rendered_in(row, columns.clone()).any(has_some))
    }

    fn ends_in(&self, columns: Range<usize>, rows: Range<usize>) -> bool {
        if self.fragments.is_textured {
            return self.has_some_in(columns, rows);
        }
        let first = self.of_pixel(columns.start, rows.start).len();
        let is_other = |(_, place)| self.fragments.of_pixel(place).len() != first;
        rows.into_iter().any(|row| self.view.rendered_in(row, columns.clone()).any(is_other))
    }
}

/// The fragments of a pixel from the next one on.
#[derive(Clone, Copy)]
pub(in crate::render) struct FragmentsAhead<'a> {
    rest: &'a [LayerFragment],
    local_per_world: f64,
}

impl Ahead for FragmentsAhead<'_> {
    const NONE: Self = Self { rest: &[], local_per_world: 1.0 };

    fn next_depth(&self) -> f64 {
        self.rest.first().map_or(f64::INFINITY, |next| next.depth * self.local_per_world)
    }

    fn take_before(&mut self, depth: f64) -> Option<(f64, [f32; 4])> {
        let at = self.next_depth();
        let (next, rest) = self.rest.split_first().filter(|_| at < depth)?;
        self.rest = rest;
        Some((at, next.rgba))
    }
}
