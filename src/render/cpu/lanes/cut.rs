//! Cuts segments of eight rays at the fragments of other layers.
//!
//! ```text
//! for each row, each lane: the parts of its segment between fragments, one after the other in rows of the lane's own
//! those rows are composited: at the end of each a lane may have a fragment
//! ```
//!
//! Fragments in front of a segment have a row without a segment, and so do those behind all of a ray's, at its end. Lanes have as many rows as they
//! need, so that few are idle; all begin anew where one has no room left.

use super::super::super::layers::Ahead;
use super::super::super::medium::{RayLine, RayPoint, Segment};
use super::rows::{Lights, Out, ROWS, RayEnd, Rows};
use super::vector::{Eight, LANES, Lanes};
use crate::mesh::NONE;
use pulp::NullaryFnOnce;

/// What rows have besides if their segments were cut.
#[derive(Default)]
pub(in crate::render::cpu) struct Cuts {
    /// Bits of the lanes with a fragment at the end of their segment.
    pub(super) fragments: [u8; ROWS],
    /// The fragments: depths, and red, green, blue and opacity.
    pub(super) depth: [Eight; ROWS],
    pub(super) rgba: [[[f32; LANES]; 4]; ROWS],
    /// Bits of the lanes whose segment is a part, and the ends of the whole.
    parts: [u8; ROWS],
    wholes: [[[RayPoint; 2]; LANES]; ROWS],
    /// The row before cutting, or [`BEHIND`].
    sources: [[u8; LANES]; ROWS],
    /// Rows of each lane.
    counts: [usize; LANES],
}

/// The source of rows behind all segments of a ray.
const BEHIND: u8 = u8::MAX;
const _: () = assert!(ROWS < BEHIND as usize);

impl Cuts {
    /// The whole segment of which a lane has a part in a row.
    pub(super) fn whole(&self, row: usize, lane: usize) -> Option<[RayPoint; 2]> {
        (self.parts[row] >> lane & 1 == 1).then(|| self.wholes[row][lane])
    }

    /// Steps of a lane's ray behind that of a row, up to the last row before `end`; `None` if the row is behind all of them.
    pub(super) fn steps_behind(&self, lane: usize, row: usize, end: Option<usize>) -> Option<u64> {
        let source = |row: usize| self.sources[row][lane];
        let rest = row..end.map_or(self.counts[lane], |end| end + 1);
        let last = rest.rev().map(source).find(|source| *source != BEHIND)?;
        (source(row) != BEHIND).then(|| u64::from(last - source(row)))
    }
}

/// The light of eight rays whose segments are cut. `fragments_of` has the fragments on the ray of a pixel.
pub(in crate::render::cpu) struct CutLights<'a, L, K, A, F> {
    lanes: L,
    lights: K,
    rows: &'a mut Rows,
    fragments_of: F,
    ahead: [A; LANES],
    /// Depths of their next fragments, infinite without one.
    next: Eight,
    /// Bits of the lanes in whose rows a ray ends, so that the light is not yet that of the lane's ray.
    others: u8,
}

impl<'a, L: Lanes, K: Lights, A: Ahead, F: Fn(usize) -> A> CutLights<'a, L, K, A, F> {
    pub(in crate::render::cpu) fn new(lanes: L, lights: K, rows: &'a mut Rows, fragments_of: F) -> Self {
        rows.cuts.get_or_insert_default();
        let (ahead, next) = ([A::NONE; LANES], [f64::INFINITY; LANES]);
        let mut new = Self { lanes, lights, rows, fragments_of, ahead, next, others: 0 };
        new.clear();
        new
    }

    fn clear(&mut self) {
        self.others = 0;
        self.rows.alive = [0; ROWS];
        self.rows.count = 0;
        self.rows.ends.clear();
        if let Some(cuts) = &mut self.rows.cuts {
            (cuts.fragments, cuts.parts, cuts.counts) = ([0; ROWS], [0; ROWS], [0; LANES]);
        }
    }

    /// Composites the rows.
    #[inline(never)]
    fn flush(&mut self, out: &mut Out<'_>) {
        self.rows.ends.sort_unstable_by_key(|end| (end.row, end.lane));
        self.lanes.vectorize(Composite { lights: &mut self.lights, rows: self.rows, out });
        self.clear();
    }

    /// Whether a lane's ray has ended at rows that have been composited: further steps were in vain.
    #[inline(always)]
    fn is_opaque(&self, lane: usize, out: &Out<'_>) -> bool {
        out.early_termination && (self.lights.opaque() & !self.others) >> lane & 1 == 1
    }

    /// A lane's next row, from the row `source` before cutting.
    #[inline(always)]
    fn row(&mut self, lane: usize, source: u8, out: &mut Out<'_>) -> (usize, &mut Cuts) {
        if let Some(cuts) = &self.rows.cuts
            && cuts.counts[lane] == ROWS
        {
            let is_next = source != BEHIND && source != cuts.sources[ROWS - 1][lane];
            self.flush(out);
            if is_next && self.is_opaque(lane, out) {
                out.stats.steps -= 1;
            }
        }
        let cuts = self.rows.cuts.get_or_insert_default();
        let row = cuts.counts[lane];
        cuts.counts[lane] += 1;
        cuts.sources[row][lane] = source;
        self.rows.count = self.rows.count.max(row + 1);
        (row, cuts)
    }

    /// Appends a lane's segment, or a part of one, and returns its row.
    #[inline(always)]
    fn segment(&mut self, lane: usize, [from, to]: [RayPoint; 2], source: u8, out: &mut Out<'_>) -> usize {
        let (row, _) = self.row(lane, source, out);
        (self.rows.from_depth[row][lane], self.rows.from_scalar[row][lane]) = (from.depth, from.scalar);
        (self.rows.to_depth[row][lane], self.rows.to_scalar[row][lane]) = (to.depth, to.scalar);
        self.rows.alive[row] |= 1 << lane;
        row
    }

    /// Appends a part of a lane's segment `whole`, and returns its row.
    #[inline(always)]
    fn part(&mut self, lane: usize, part: [RayPoint; 2], whole: [RayPoint; 2], source: u8, out: &mut Out<'_>) -> usize {
        let row = self.segment(lane, part, source, out);
        if let Some(cuts) = &mut self.rows.cuts {
            cuts.parts[row] |= 1 << lane;
            cuts.wholes[row][lane] = whole;
        }
        row
    }

    /// Puts a fragment at the end of a lane's row.
    #[inline(always)]
    fn fragment(&mut self, row: usize, lane: usize, (depth, rgba): (f64, [f32; 4])) {
        if let Some(cuts) = &mut self.rows.cuts {
            cuts.fragments[row] |= u8::from(rgba != [0.0; 4]) << lane;
            cuts.depth[row][lane] = depth;
            for (channel, value) in cuts.rgba[row].iter_mut().zip(rgba) {
                channel[lane] = value;
            }
        }
    }

    /// The light of a lane's next fragment, if it lies before a depth.
    #[inline(always)]
    fn take_before(&mut self, lane: usize, depth: f64) -> Option<(f64, [f32; 4])> {
        let taken = self.ahead[lane].take_before(depth)?;
        self.next[lane] = self.ahead[lane].next_depth();
        Some(taken)
    }

    /// Gives a lane the fragments on the ray of a pixel, if there is one.
    #[inline(always)]
    fn look_at(&mut self, lane: usize, pixel: Option<usize>) {
        self.ahead[lane] = pixel.map_or(A::NONE, &self.fragments_of);
        self.next[lane] = self.ahead[lane].next_depth();
    }

    /// Appends a lane's segment, cut at the fragments in front of its end, of which there are some.
    #[inline(always)]
    fn cut(&mut self, lane: usize, whole: [RayPoint; 2], source: u8, out: &mut Out<'_>) {
        let [mut near, far] = whole;
        let segment = Segment::of_scalars(NONE, near, far, RayLine::default());
        while let Some(fragment) = self.take_before(lane, far.depth) {
            let depth = fragment.0;
            let row = if near.depth < depth {
                let here = RayPoint { depth, scalar: segment.scalar_at(depth) };
                let row = self.part(lane, [near, here], whole, source, out);
                near = here;
                row
            } else {
                self.row(lane, source, out).0
            };
            self.fragment(row, lane, fragment);
        }
        if near == whole[0] {
            self.segment(lane, whole, source, out);
        } else {
            self.part(lane, [near, far], whole, source, out);
        }
    }

    /// Ends the ray of a lane, behind its last fragments.
    #[inline(never)]
    fn end(&mut self, &RayEnd { lane, pixel, line, next, .. }: &RayEnd, out: &mut Out<'_>) {
        // The last of these rows is without a fragment.
        let row = loop {
            let (row, _) = self.row(lane, BEHIND, out);
            let Some(fragment) = self.take_before(lane, f64::INFINITY) else { break row };
            self.fragment(row, lane, fragment);
        };
        self.rows.ends.push(RayEnd { row, lane, pixel, line, next });
        self.others |= 1 << lane;
        self.look_at(lane, next);
    }
}

impl<L: Lanes, K: Lights, A: Ahead, F: Fn(usize) -> A> Lights for CutLights<'_, L, K, A, F> {
    const CELLS: bool = K::CELLS;

    #[inline(always)]
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>) {
        let mut ends = &rows.ends[..];
        for row in 0..rows.count {
            let of_row = ends.iter().take_while(|end| end.row == row).count();
            let (ended, rest) = ends.split_at(of_row);
            let (next, to) = (self.lanes.load(&self.next), self.lanes.load(&rows.to_depth[row]));
            let has_fragments = self.lanes.bits(self.lanes.lt(next, to));
            let mut todo = rows.alive[row];
            while todo != 0 {
                let lane = todo.trailing_zeros() as usize;
                todo &= todo - 1;
                if self.is_opaque(lane, out) {
                    out.stats.steps -= 1;
                } else {
                    let ends = [rows.from(row, lane), rows.to(row, lane)];
                    if has_fragments >> lane & 1 == 1 {
                        self.cut(lane, ends, row as u8, out);
                    } else {
                        self.segment(lane, ends, row as u8, out);
                    }
                }
                if let Some(end) = ended.iter().find(|end| end.lane == lane) {
                    self.end(end, out);
                }
            }
            ends = rest;
        }
        self.flush(out);
    }

    fn begin(&mut self, lane: usize, line: RayLine, pixel: Option<usize>, out: &Out<'_>) {
        self.lights.begin(lane, line, pixel, out);
        self.look_at(lane, pixel);
    }

    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize) {
        self.lights.finish(lane, out, pixel);
    }

    fn opaque(&self) -> u8 {
        self.lights.opaque()
    }
}

/// Composites rows; compiled for the vectors of the processor.
struct Composite<'a, 'p, K> {
    lights: &'a mut K,
    rows: &'a mut Rows,
    out: &'a mut Out<'p>,
}

impl<K: Lights> NullaryFnOnce for Composite<'_, '_, K> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.lights.composite(self.rows, self.out);
    }
}
