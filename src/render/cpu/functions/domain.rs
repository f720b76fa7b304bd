//! Where rays are in the field's domain: inside the mesh, or in a box.

use super::super::raster::lanes::{BLOCK, Lanes, PixelList};
use super::super::raster::lists::{Bins, ListedFace};
use super::super::raster::{FACES_AT_ONCE, Faces, TileRays};
use super::super::ray::ViewVertex;
use super::super::tiles::TILE_PX;
use crate::camera::View;
use crate::render::functions::depths_in_box;
use glam::DVec3;

const PIXELS: usize = TILE_PX * TILE_PX;

/// A ray's passage through the boundary.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Passage {
    pixel: u16,
    /// Whether the ray enters.
    enters: bool,
    depth: f64,
}

/// The intervals of depth in which the rays of a tile are in the domain, in front of the near distance.
pub(super) struct Domain {
    faces: Box<Faces>,
    candidates: Box<PixelList>,
    passages: Vec<Passage>,
    /// Pixel by pixel, nearest first.
    intervals: Vec<[f64; 2]>,
    /// First interval of each pixel, and the end of the last.
    starts: [u32; PIXELS + 1],
}

impl Default for Domain {
    fn default() -> Self {
        Self {
            faces: Box::new(Faces::NONE),
            candidates: Box::new([0; PIXELS + BLOCK]),
            passages: Vec::new(),
            intervals: Vec::new(),
            starts: [0; PIXELS + 1],
        }
    }
}

impl Domain {
    /// Finds the intervals in the mesh of the rays that are cast.
    #[inline(always)]
    pub(super) fn find<L: Lanes>(
        &mut self,
        lanes: L,
        (view, vertices): (&View, &[ViewVertex]),
        (boundary, tile): (&Bins<ListedFace>, usize),
        rays: &TileRays,
    ) {
        let Self { faces, candidates, passages, .. } = self;
        passages.clear();
        for chunk in 0..boundary.chunk_count() {
            for batch in boundary.items(chunk, tile).chunks(FACES_AT_ONCE) {
                faces.set(view, vertices, rays, batch);
                for i in 0..batch.len() {
                    faces.hits(lanes, i, (view, vertices), rays, candidates, |pixel, hit| {
                        passages.push(Passage { pixel: pixel as u16, enters: !hit.is_turned, depth: hit.depth });
                    });
                }
            }
        }
        // Of a place where parts touch, rays leave one before they enter the other.
        passages.sort_unstable_by(|a, b| {
            a.pixel.cmp(&b.pixel).then(a.depth.total_cmp(&b.depth)).then(a.enters.cmp(&b.enters))
        });
        self.pair(view.near_depth());
    }

    /// Finds the intervals in a box of the rays that are cast.
    pub(super) fn find_in_box(&mut self, view: &View, within: [DVec3; 2], rays: &TileRays) {
        let Self { intervals, starts, .. } = self;
        intervals.clear();
        for (pixel, start) in starts.iter_mut().take(PIXELS).enumerate() {
            *start = intervals.len() as u32;
            if rays.rendered[pixel / TILE_PX] >> (pixel % TILE_PX) & 1 == 1 {
                let line = rays.ray(view, pixel).line;
                intervals.extend(depths_in_box(view, (line.px, line.py), within));
            }
        }
        starts[PIXELS] = intervals.len() as u32;
    }

    /// Makes intervals of passages.
    fn pair(&mut self, near: f64) {
        let Self { passages, intervals, starts, .. } = self;
        intervals.clear();
        let mut of_pixels = passages.chunk_by(|a, b| a.pixel == b.pixel).peekable();
        for (pixel, start) in starts.iter_mut().take(PIXELS).enumerate() {
            *start = intervals.len() as u32;
            let Some(passages) = of_pixels.next_if(|passages| usize::from(passages[0].pixel) == pixel) else {
                continue;
            };
            let sign = |passage: &Passage| if passage.enters { 1 } else { -1 };
            // A ray that leaves more often than it enters begins inside.
            let mut inside = (-passages.iter().map(sign).sum::<i32>()).max(0);
            let mut from = near;
            for passage in passages {
                let before = inside;
                inside += sign(passage);
                match (before > 0, inside > 0) {
                    (false, true) => from = passage.depth,
                    (true, false) if passage.depth.max(near) > from.max(near) => {
                        intervals.push([from.max(near), passage.depth]);
                    }
                    _ => {}
                }
            }
        }
        starts[PIXELS] = intervals.len() as u32;
    }

    /// The intervals of a pixel, nearest first.
    #[inline(always)]
    pub(super) fn of(&self, pixel: usize) -> &[[f64; 2]] {
        &self.intervals[self.starts[pixel] as usize..self.starts[pixel + 1] as usize]
    }

    /// Whether no ray is in the domain.
    pub(super) fn is_empty(&self) -> bool {
        self.intervals.is_empty()
    }
}
