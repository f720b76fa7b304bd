//! The functions of a tile, and the depths between which they are summed: a binary tree of slabs.

use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::lists::TileItem;
use super::kernel::{Kernel, TileKernel};
use super::place::{FunctionsInView, ListedFunction};
use super::sheets::{AT_ONCE, base_of};
use super::slopes;
use crate::camera::View;
use crate::functions::Kernels;
use crate::functions::coverage::Coverage;
use crate::optics::exp_neg;
use crate::render::functions::{FunctionScene, Normalise, SheetSpacing, SheetStyle};
use glam::Vec3;
use std::ops::Range;

/// Slabs are halved at most so often: as many sheets as may be asked for by number.
const MOST_HALVINGS: u32 = (SheetStyle::MOST_SHEETS as usize / AT_ONCE).ilog2();

/// The depths of a frame's sheets.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Depths {
    /// Where the field begins and ends, in front of the near distance.
    pub(super) ends: [f64; 2],
    /// Length of the whole, from which slabs are halved: at least that of `ends`.
    length: f64,
    /// Distance between sheets, where their number is asked for.
    apart: Option<f64>,
    /// 1 / (8 e R) for an error e of a range R, else.
    per_error: f64,
    /// Least number of sheets per width of a function, else: about two sheets meet each, and coverage between them is as it should.
    per_width: f64,
}

impl Depths {
    /// Depths for a field between these ends, `depth` from its nearest to its farthest place, those behind the eye included.
    pub(super) fn new(ends: [f64; 2], depth: f64, scene: &FunctionScene) -> Self {
        let length = (ends[1] - ends[0]).max(f64::MIN_POSITIVE);
        let least = 1.0 / scene.kernels.cut();
        match scene.style.spacing {
            SheetSpacing::Error(error) => {
                let of_coverage = scene.domain.coverage().map_or(0.0, |_| (Coverage::BENDING / (8.0 * error)).sqrt());
                let (per_error, per_width) = (1.0 / (8.0 * error * scene.range), least.max(of_coverage));
                Self { ends, length, apart: None, per_error, per_width }
            }
            SheetSpacing::Count(count) => {
                let apart = depth / f64::from(count);
                // Halved, it ends at slabs of as many sheets as are summed at a time.
                let mut whole = AT_ONCE as f64 * apart;
                while whole < length {
                    whole *= 2.0;
                }
                Self { ends, length: whole, apart: Some(apart), per_error: 0.0, per_width: least }
            }
        }
    }

    fn of(&self, node: &Slab) -> [f64; 2] {
        let length = self.length / f64::from(1u32 << node.halvings);
        [0, 1].map(|end| self.ends[0] + f64::from(node.number + end) * length)
    }
}

/// A slab of depths of a tile.
#[derive(Clone, Debug)]
pub(super) struct Slab {
    halvings: u32,
    /// Its place among those as deep, from the nearest.
    number: u32,
    /// The indices of its functions, a range of [`Slabs::members`].
    members: Range<usize>,
}

impl Slab {
    /// How often the whole was halved for it.
    #[cfg(test)]
    pub(super) fn halvings(&self) -> u32 {
        self.halvings
    }
}

/// A function in a tile.
struct Member {
    id: u32,
    function: ListedFunction,
    bounds: Bounds,
    value: f32,
    /// The function as the tile sees it, once it is needed.
    kernel: Option<TileKernel>,
}

/// The slabs of a tile that are still to be drawn, nearest first.
#[derive(Default)]
pub(super) struct Slabs {
    functions: Vec<Member>,
    /// The nearest one last.
    left: Vec<Slab>,
    /// Indices into `functions`, ascending in each slab.
    members: Vec<u32>,
}

impl Slabs {
    /// Lists the functions of a tile, in one slab.
    pub(super) fn list(&mut self, in_view: &FunctionsInView, tile: usize, values: &[f32]) {
        let Self { functions, left, members } = self;
        let bins = &in_view.bins;
        let items = (0..bins.chunk_count()).flat_map(|chunk| bins.items(chunk, tile));
        functions.clear();
        functions.extend(items.map(|listed: &TileItem<u32>| Member {
            id: listed.item,
            function: in_view.functions[listed.item as usize],
            bounds: listed.bounds(),
            value: values[listed.item as usize],
            kernel: None,
        }));
        members.clear();
        members.extend(0..functions.len() as u32);
        left.clear();
        left.push(Slab { halvings: 0, number: 0, members: 0..members.len() });
    }

    /// The next slab, and its depths.
    pub(super) fn next(&mut self, depths: &Depths) -> Option<(Slab, [f64; 2])> {
        let slab = self.left.pop()?;
        self.members.truncate(slab.members.end);
        let ends = depths.of(&slab);
        Some((slab, ends))
    }

    /// Least and greatest value that the field can have in a slab; `None` where no function reaches.
    pub(super) fn values(&self, slab: &Slab, normalise: Normalise) -> Option<[f32; 2]> {
        let of = self.members[slab.members.clone()].iter().map(|&member| self.functions[member as usize].value);
        let ends = of.map(|value| [value; 2]).reduce(|[least, most], [value, _]| [least.min(value), most.max(value)]);
        ends.map(|ends| normalise.values(ends))
    }

    /// Number of distances between sheets in a slab with these values, and whether it is to be halved for them.
    pub(super) fn sheets(&self, slab: &Slab, [near, far]: [f64; 2], values: [f32; 2], depths: &Depths) -> (f64, bool) {
        let length = far - near;
        let asked = match depths.apart {
            Some(apart) => length / apart,
            None => {
                let range = values[1] - values[0];
                let needed = |member: &u32| {
                    let ListedFunction { per_width, difference, .. } = self.functions[*member as usize].function;
                    // Of a field without a range the error is not a number.
                    let by_error = f64::from(difference.min(range)) * depths.per_error;
                    f64::from(per_width).powi(2) * by_error.max(depths.per_width * depths.per_width)
                };
                let members = self.members[slab.members.clone()].iter();
                (length * members.map(needed).fold(0.0, f64::max).sqrt()).max(1.0)
            }
        };
        (asked, asked > AT_ONCE as f64 && slab.halvings < MOST_HALVINGS)
    }

    /// Halves a slab; both halves are still to be drawn.
    pub(super) fn halve(&mut self, slab: &Slab, depths: &Depths) {
        let Self { functions, left, members } = self;
        for number in [2 * slab.number + 1, 2 * slab.number] {
            let start = members.len();
            let mut half = Slab { halvings: slab.halvings + 1, number, members: start..start };
            let [near, far] = depths.of(&half).map(|depth| depth as f32);
            for at in slab.members.clone() {
                let member = members[at];
                let [from, to] = functions[member as usize].function.depths;
                // Rounded depths may be equal.
                if from <= far && to >= near {
                    members.push(member);
                }
            }
            half.members.end = members.len();
            if !half.members.is_empty() {
                left.push(half);
            }
        }
    }

    /// Projects the functions of a slab; returns how many had not been.
    pub(super) fn project(&mut self, slab: &Slab, kernels: &Kernels, view: &View, rays: &TileRays) -> u64 {
        let mut count = 0;
        for &member in &self.members[slab.members.clone()] {
            let member = &mut self.functions[member as usize];
            if member.kernel.is_none() {
                let function = kernels.get(member.id as usize);
                member.kernel = function.map(|function| Kernel::for_tile(view, &function, kernels.cut(), rays));
                count += 1;
            }
        }
        count
    }

    /// The field at a depth on the ray of a pixel in this column and row, between these least and greatest values, and its gradient along the
    /// view's axes; `None` where no function reaches.
    pub(super) fn value(
        &self,
        slab: &Slab,
        (column, row): (usize, usize),
        depth: f64,
        (scene, within): (&FunctionScene, [f32; 2]),
    ) -> Option<(f64, Vec3)> {
        let height_at_cut = scene.kernels.height_at_cut() as f32;
        let (base, least_weight) = base_of(within, scene.normalise);
        let (mut sum, mut weight) = (0.0, 0.0);
        let [mut of_sum, mut of_weight] = [Vec3::ZERO; 2];
        for (.., value, kernel) in self.members(slab) {
            let y = Vec3::from_array(kernel.in_widths(column, row, depth));
            let height = exp_neg(0.5 * y.length_squared());
            if height > height_at_cut {
                let slope = -height * Vec3::from_array(kernel.axes.map(|axis| Vec3::from_array(axis).dot(y)));
                (sum, weight) = (sum + (value - base) * (height - height_at_cut), weight + (height - height_at_cut));
                (of_sum, of_weight) = (of_sum + (value - base) * slope, of_weight + slope);
            }
        }
        let [least, most] = within.map(f64::from);
        let above_base = sum / if weight < least_weight { least_weight } else { weight };
        (weight > 0.0).then(|| {
            let gradient = slopes::gradient(of_sum, of_weight, above_base, weight, scene.normalise);
            ((f64::from(base) + f64::from(above_base)).clamp(least, most), gradient)
        })
    }

    /// The functions of a slab, ascending, projected, with their values.
    pub(super) fn members(&self, slab: &Slab) -> impl Iterator<Item = (&ListedFunction, Bounds, f32, &TileKernel)> {
        self.members[slab.members.clone()].iter().filter_map(|&member| {
            let Member { function, bounds, value, kernel, .. } = &self.functions[member as usize];
            Some((function, *bounds, *value, kernel.as_ref()?))
        })
    }
}
