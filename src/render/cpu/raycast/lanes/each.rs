//! The light of eight rays, one after the other, for any medium of scalars.

use super::super::super::super::layers::Ahead;
use super::super::super::super::medium::{Medium, RayLine, Segment};
use super::super::super::lanes::rows::{Lights, Out, Rows};
use super::super::super::lanes::vector::LANES;
use super::super::super::light::RayLight;
use crate::optics::Accumulator;

/// `fragments_of` has the fragments of other layers on the ray of a pixel.
pub(super) struct EachLight<'a, M: Medium, A, F> {
    medium: &'a M,
    fragments_of: F,
    lights: [RayLight<M::Ray, A>; LANES],
    lines: [RayLine; LANES],
    near_distance: f64,
    opaque: u8,
}

impl<'a, M: Medium, A: Ahead, F: Fn(usize) -> A> EachLight<'a, M, A, F> {
    pub(super) fn new(medium: &'a M, near_distance: f64, fragments_of: F) -> Self {
        let lights = [RayLight::new(near_distance, A::NONE); LANES];
        Self { medium, fragments_of, lights, lines: [RayLine::default(); LANES], near_distance, opaque: 0 }
    }
}

impl<M: Medium<Light = Accumulator>, A: Ahead, F: Fn(usize) -> A> Lights for EachLight<'_, M, A, F> {
    const CELLS: bool = true;

    #[inline(always)]
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>) {
        let mut ends = rows.ends.iter().peekable();
        for row in 0..rows.count {
            let mut todo = rows.alive[row] & if out.early_termination { !self.opaque } else { u8::MAX };
            while todo != 0 {
                let lane = todo.trailing_zeros() as usize;
                todo &= todo - 1;
                let (from, to) = (rows.from(row, lane), rows.to(row, lane));
                let light = &mut self.lights[lane];
                // A path may begin in any row.
                let goes_on = row > 0 && rows.to(row - 1, lane) == from;
                if !goes_on {
                    light.leave();
                }
                let cell = rows.cell[row][lane] >> 2;
                light.go_on(self.medium, Segment::of_scalars(cell, from, to, self.lines[lane]));
                if light.is_opaque() && self.opaque >> lane & 1 == 0 {
                    self.opaque |= 1 << lane;
                    out.stop_early(rows, lane, row);
                }
            }
            while let Some(end) = ends.next_if(|end| end.row == row) {
                self.finish(end.lane, out, end.pixel);
                self.begin(end.lane, end.line, end.next, out);
            }
        }
    }

    fn begin(&mut self, lane: usize, line: RayLine, pixel: Option<usize>, _: &Out<'_>) {
        self.lights[lane] = RayLight::new(self.near_distance, pixel.map_or(A::NONE, &self.fragments_of));
        self.lines[lane] = line;
        self.opaque &= !(1 << lane);
    }

    fn finish(&mut self, lane: usize, out: &mut Out<'_>, pixel: usize) {
        out.stats.rays_hit += 1;
        let light = &self.lights[lane];
        out.stats.segments += u64::from(light.segments);
        out.stats.out_of_order += u64::from(light.out_of_order);
        out.pixels[pixel] = light.pixel();
    }

    fn opaque(&self) -> u8 {
        self.opaque
    }
}
