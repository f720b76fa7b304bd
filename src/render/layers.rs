//! Fragments of other layers of the frame on the rays of this one.
//!
//! A layer that does not consist of cells reaches the rays of this one as a list of fragments per pixel. A fragment has a depth, at which
//! it cuts the segment of the cell there: the near part ends before it, the far part begins at it.
//!
//! Fragments are sorted nearest first, equal depths in layer order. They are composited in front of the cells, in gaps, behind them and
//! where there are no cells, but not in front of the near plane nor behind an opaque depth. Frames of one layer compile to code without
//! them (`NoLayers`). The GPU has them in a texture (`render/gpu/layer_fragments.rs`), for rays and faces; it leaves points, and rays that contrast
//! decides about, to the CPU. The surfaces of the domain and of regions are such a layer, and flow.

use super::{RenderError, RenderJob};
use crate::camera::View;
use std::ops::Range;

/// A point at which a ray passes through a surface of another layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerFragment {
    /// World length along the viewing direction, from the eye (parallel projection: from the camera's position); finite.
    pub depth: f64,
    /// Premultiplied colour, and opacity.
    pub rgba: [f32; 4],
}

/// The fragments of a row of pixels.
#[derive(Debug, Default)]
pub(in crate::render) struct RowFragments {
    /// Per pixel, the end of its fragments.
    pub(in crate::render) ends: Vec<u32>,
    /// The fragments of each pixel, nearest first.
    pub(in crate::render) fragments: Vec<LayerFragment>,
}

impl RowFragments {
    /// Keeps the fragments for which `is_kept`, asked by the number of the pixel in the row and the depth; returns how many are left out.
    pub(in crate::render) fn retain(&mut self, is_kept: impl Fn(usize, f64) -> bool) -> u64 {
        let (mut begin, mut kept) = (0, 0);
        for (pixel, end) in self.ends.iter_mut().enumerate() {
            for i in begin..*end as usize {
                if is_kept(pixel, self.fragments[i].depth) {
                    self.fragments[kept] = self.fragments[i];
                    kept += 1;
                }
            }
            begin = std::mem::replace(end, kept as u32) as usize;
        }
        let left_out = self.fragments.len() - kept;
        self.fragments.truncate(kept);
        left_out as u64
    }
}

/// The fragments of all pixels of a rendered plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LayerFragments {
    /// Per pixel, row by row from the top, the end of its fragments; they begin where those of the previous pixel end.
    ends: Vec<u32>,
    /// The fragments of each pixel, nearest first, equal depths in layer order.
    fragments: Vec<LayerFragment>,
    /// Whether light changes from pixel to pixel within a layer, not at its ends alone.
    is_textured: bool,
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
        let mut ends = Vec::with_capacity(pixels);
        for pixel in 0..pixels {
            let begin = ends.last().map_or(0, |&end| end as usize);
            let count = found[begin..].iter().take_while(|(of, _)| *of as usize == pixel).count();
            ends.push((begin + count) as u32);
        }
        let fragments = found.into_iter().map(|(_, fragment)| fragment).collect();
        Ok(Self { ends, fragments, is_textured: false })
    }

    /// The textured fragments of rows of pixels, which follow each other in the rendered plane.
    pub(in crate::render) fn of_rows(rows: Vec<RowFragments>) -> Self {
        let mut ends = Vec::with_capacity(rows.iter().map(|row| row.ends.len()).sum());
        let mut fragments = Vec::with_capacity(rows.iter().map(|row| row.fragments.len()).sum());
        for row in rows {
            let before = fragments.len() as u32;
            ends.extend(row.ends.iter().map(|end| before + end));
            fragments.extend(row.fragments);
        }
        Self { ends, fragments, is_textured: true }
    }

    /// The fragments of each pixel at another place; `places` are those of all of the plane.
    pub(in crate::render) fn at(&self, places: &[u32]) -> Self {
        let mut from = vec![0; places.len()];
        places.iter().enumerate().for_each(|(pixel, &place)| from[place as usize] = pixel);
        let mut moved = Self { is_textured: self.is_textured, ..Self::default() };
        for pixel in from {
            moved.fragments.extend_from_slice(self.of_pixel(pixel));
            moved.ends.push(moved.fragments.len() as u32);
        }
        moved
    }

    /// These and others of the same plane; at equal depths these lie in front.
    #[must_use]
    pub fn with(&self, others: &Self) -> Self {
        let mut both = Self { is_textured: self.is_textured || others.is_textured, ..Self::default() };
        for pixel in 0..self.pixels() {
            let (mut front, mut back) = (self.of_pixel(pixel), others.of_pixel(pixel));
            while let (Some(a), Some(b)) = (front.first(), back.first()) {
                let from = if a.depth <= b.depth { &mut front } else { &mut back };
                both.fragments.extend(from.first());
                *from = &from[1..];
            }
            both.fragments.extend_from_slice(front);
            both.fragments.extend_from_slice(back);
            both.ends.push(both.fragments.len() as u32);
        }
        both
    }

    /// Pixels of the plane.
    pub fn pixels(&self) -> usize {
        self.ends.len()
    }

    /// Fragments of all pixels.
    pub fn count(&self) -> usize {
        self.fragments.len()
    }

    /// The fragments of a pixel, nearest first.
    pub fn of_pixel(&self, pixel: usize) -> &[LayerFragment] {
        let begin = pixel.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.fragments[begin as usize..self.ends[pixel] as usize]
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
        let hidden = rest.partition_point(|fragment| fragment.depth * local_per_world < self.near);
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
