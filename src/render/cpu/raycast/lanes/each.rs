//! The light of eight rays, one after the other: for any integrator.

use super::super::super::super::layers::NothingAhead;
use super::super::super::super::medium::{ScalarMedium, Segment};
use super::super::super::light::RayLight;
use super::rows::{Lights, Out, Rows};
use super::vector::LANES;
use crate::optics::Integrator;

pub(super) struct EachLight<'a, I: Integrator> {
    medium: ScalarMedium<'a, I>,
    lights: [RayLight<Option<I::Place>, NothingAhead>; LANES],
    length_per_depth: [f64; LANES],
    near_distance: f64,
    opaque: u8,
}

impl<'a, I: Integrator> EachLight<'a, I> {
    pub(super) fn new(table: &'a I, near_distance: f64) -> Self {
        let lights = [RayLight::new(near_distance, NothingAhead); LANES];
        Self { medium: ScalarMedium(table), lights, length_per_depth: [0.0; LANES], near_distance, opaque: 0 }
    }
}

impl<I: Integrator> Lights for EachLight<'_, I> {
    #[inline(always)]
    fn composite(&mut self, rows: &mut Rows, out: &mut Out<'_>) {
        let mut ends = rows.ends.iter().peekable();
        for row in 0..rows.count {
            let mut todo = rows.alive[row] & if out.early_termination { !self.opaque } else { u8::MAX };
            while todo != 0 {
                let lane = todo.trailing_zeros() as usize;
                todo &= todo - 1;
                let from = (rows.from_depth[row][lane], rows.from_scalar[row][lane]);
                let to = (rows.to_depth[row][lane], rows.to_scalar[row][lane]);
                let light = &mut self.lights[lane];
                // A path may begin anywhere.
                let goes_on = row > 0 && (rows.to_depth[row - 1][lane], rows.to_scalar[row - 1][lane]) == from;
                if !goes_on {
                    light.leave();
                }
                light.go_on(&self.medium, Segment::of_scalars(from, to, self.length_per_depth[lane]));
                if light.is_opaque() && self.opaque >> lane & 1 == 0 {
                    self.opaque |= 1 << lane;
                    out.stop_early(rows, lane, row);
                }
            }
            while let Some(end) = ends.next_if(|end| end.row == row) {
                self.finish(end.lane, out, end.pixel);
                self.begin(end.lane, end.length_per_depth);
            }
        }
    }

    fn begin(&mut self, lane: usize, length_per_depth: f64) {
        self.lights[lane] = RayLight::new(self.near_distance, NothingAhead);
        self.length_per_depth[lane] = length_per_depth;
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
