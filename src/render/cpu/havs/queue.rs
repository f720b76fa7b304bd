//! The faces of a tile, in the order of their list.

use super::super::raster::FACES_AT_ONCE;
use super::super::raster::boxes::Bounds;
use super::super::raster::lists::{Bins, ListedFace, TileFace};
use super::super::tiles::TileBits;
use crate::task::Cancel;

/// The faces of a tile still to be drawn.
pub(super) struct FaceQueue<'a> {
    bins: &'a Bins<ListedFace>,
    tile: usize,
    cancel: &'a Cancel,
    next_chunk: usize,
    faces: &'a [TileFace],
    /// Number of faces left out since rays are opaque.
    pub(super) hidden: u64,
}

impl<'a> FaceQueue<'a> {
    pub(super) fn new(bins: &'a Bins<ListedFace>, tile: usize, cancel: &'a Cancel) -> Self {
        Self { bins, tile, cancel, next_chunk: 0, faces: &[], hidden: 0 }
    }

    /// Puts the next faces that rays may meet into `batch` and returns their number, 0 at the end of the list. Faces over pixels that are not
    /// `open` any more are left out; `some_are_closed`: since their rays are opaque.
    #[inline(always)]
    pub(super) fn take(&mut self, open: &TileBits, some_are_closed: bool, batch: &mut [TileFace]) -> usize {
        let chunks = self.bins.chunk_count();
        let mut ready = 0;
        while ready < FACES_AT_ONCE {
            let Some((face, rest)) = self.faces.split_first() else {
                if self.next_chunk == chunks || self.cancel.is_cancelled() || *open == TileBits::default() {
                    let left: usize = (self.next_chunk..chunks).map(|c| self.bins.items(c, self.tile).len()).sum();
                    self.hidden += left as u64;
                    self.next_chunk = chunks;
                    break;
                }
                self.faces = self.bins.items(self.next_chunk, self.tile);
                self.next_chunk += 1;
                continue;
            };
            self.faces = rest;
            let is_seen = !some_are_closed || has_some_in(open, face.bounds());
            batch[ready] = *face;
            ready += usize::from(is_seen);
            self.hidden += u64::from(!is_seen);
        }
        ready
    }

    /// Lower bound on the depth of the faces that are left.
    pub(super) fn nearest_left(&self) -> f64 {
        self.faces.iter().map(TileFace::nearest).fold(self.bins.nearest_from(self.next_chunk), f64::min)
    }
}

/// Whether a box has an open pixel.
#[inline(always)]
fn has_some_in(open: &TileBits, Bounds { x0, x1, y0, y1 }: Bounds) -> bool {
    let columns = ((1u32 << x1) - (1u32 << x0)) as u16;
    open[y0..y1].iter().fold(0, |some, row| some | row & columns) != 0
}
