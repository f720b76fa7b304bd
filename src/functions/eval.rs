//! The field and its gradient at many places, in f32.
//!
//! ```text
//! f = m + sum (v_i - m) phi_i / sum phi_i
//! grad f = (sum (v_i - m) grad phi_i - (f - m) sum grad phi_i) / sum phi_i,    grad phi_i = -exp(-d_i^2 / 2) S_i^-1 (x - mu_i)
//! ```
//!
//! (Jang et al. 2004, section 4, for normalised functions), m between the least and the greatest value of the step: sums are as small as the
//! range, whatever the values are.
//!
//! 1. A grid of boxes lists for each the functions whose own boxes meet it, by ascending id ([`Lists`]): some hundred, where a place is
//!    reached by some dozen.
//! 2. u = L^-1 (x - mu) and d^2 = u . u; a function beyond its end is masked out, so that lists of boxes that touch give the same bits at
//!    places on their border. Sums are by ascending id.
//! 3. [`LANES`] places of one box are evaluated side by side, compiled for the widest registers. There is one source for one place and for many:
//!    each place has the bits that it has alone.
//!
//! [`value_and_gradient_at`] is the same in float64 by all functions.

use super::{Kernels, Placed};
use crate::optics::exp_neg;
use glam::{DVec3, Vec3};

/// Places evaluated side by side.
pub const LANES: usize = 16;

/// What the functions give at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<T, V> {
    /// The field's value.
    pub value: T,
    /// Its gradient, per local unit.
    pub gradient: V,
    /// Number of functions that reach the place.
    pub reached: u32,
}

/// Value and gradient at a place in local coordinates, by all functions, in float64; `None` where none reaches. Functions whose value is not
/// finite are left out.
///
/// # Panics
/// If there is not one value per function.
pub fn value_and_gradient_at(kernels: &Kernels, values: &[f32], at: DVec3) -> Option<Found<f64, DVec3>> {
    assert_eq!(values.len(), kernels.len(), "one value a function");
    let (mut sum, mut weights, mut reached) = (0.0, 0.0, 0);
    let (mut slope, mut slope_of_weights) = (DVec3::ZERO, DVec3::ZERO);
    for (i, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let Some(function) = kernels.get(i) else { continue };
        let u = function.unscaled(at - function.center);
        let weight = kernels.weight(u.length_squared());
        if weight > 0.0 {
            let steep = -(-0.5 * u.length_squared()).exp() * function.unscaled_transposed(u);
            let value = f64::from(value);
            (sum, weights, reached) = (sum + weight * value, weights + weight, reached + 1);
            (slope, slope_of_weights) = (slope + value * steep, slope_of_weights + steep);
        }
    }
    let value = sum / weights;
    (weights > 0.0).then(|| Found { value, gradient: (slope - value * slope_of_weights) / weights, reached })
}

/// A function as it is evaluated.
#[derive(Clone, Copy, Debug)]
struct Prepared {
    center: Vec3,
    /// Rows of L^-1, whose lower triangle is m00, m10, m11, m20, m21, m22.
    inverse: [f32; 6],
}

/// Functions, prepared to be evaluated at many places.
#[derive(Clone, Debug)]
pub struct Evaluator {
    /// `None` for a function that reaches nothing.
    functions: Vec<Option<Prepared>>,
    lists: Lists,
    cut_squared: f32,
    height_at_cut: f32,
}

/// The values of a step, to be evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    evaluator: &'a Evaluator,
    values: &'a [f32],
    /// Between the least and the greatest of the values.
    middle: f32,
}

impl Evaluator {
    /// Prepares functions.
    pub fn new(kernels: &Kernels) -> Self {
        let prepared = |i: usize| {
            let function = kernels.get(i)?;
            let column = |axis: DVec3| function.unscaled(axis);
            let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(column);
            let inverse = [x.x, x.y, y.y, x.z, y.z, z.z].map(|m| m as f32);
            inverse.iter().all(|m| m.is_finite()).then(|| Prepared { center: function.center.as_vec3(), inverse })
        };
        Self {
            functions: (0..kernels.len()).map(prepared).collect(),
            lists: Lists::of(kernels),
            cut_squared: (kernels.cut() * kernels.cut()) as f32,
            height_at_cut: kernels.height_at_cut() as f32,
        }
    }

    /// The field with the values of a step, those that are not finite left out.
    ///
    /// # Panics
    /// If there is not one value per function.
    pub fn field<'a>(&'a self, values: &'a [f32]) -> Field<'a> {
        assert_eq!(values.len(), self.functions.len(), "one value a function");
        let finite = values.iter().copied().filter(|value| value.is_finite());
        let (lo, hi) = finite.fold((f32::MAX, f32::MIN), |(lo, hi), value| (lo.min(value), hi.max(value)));
        Field { evaluator: self, values, middle: if lo <= hi { 0.5 * lo + 0.5 * hi } else { 0.0 } }
    }
}

impl Field<'_> {
    /// Value and gradient at a place in local coordinates; `None` where no function reaches.
    pub fn at(&self, place: Vec3) -> Option<Found<f32, Vec3>> {
        let list = self.evaluator.lists.at(place)?;
        self.sums(list, place.to_array().map(|x| [x])).found(0, self.middle)
    }

    /// Values and gradients at many places, each as [`Self::at`] has it, to the bit.
    pub fn at_all(&self, places: &[Vec3]) -> Vec<Option<Found<f32, Vec3>>> {
        let mut found = vec![None; places.len()];
        let box_of = |(i, place): (usize, &Vec3)| Some((self.evaluator.lists.box_of(*place)?, i));
        let mut order: Vec<(usize, usize)> = places.iter().enumerate().filter_map(box_of).collect();
        order.sort_unstable();
        for of_box in order.chunk_by(|a, b| a.0 == b.0) {
            let list = self.evaluator.lists.list(of_box[0].0);
            for together in of_box.chunks(LANES) {
                // Lanes beyond the last place have that place again.
                let lane = |l: usize| places[together[l.min(together.len() - 1)].1];
                let lanes: [Vec3; LANES] = std::array::from_fn(lane);
                let coordinates = [0, 1, 2].map(|axis| lanes.map(|place| place[axis]));
                let sums = pulp::Arch::new().dispatch(Side { field: self, list, coordinates });
                for (l, &(_, i)) in together.iter().enumerate() {
                    found[i] = sums.found(l, self.middle);
                }
            }
        }
        found
    }

    /// The sums over the functions of a list, at some places.
    #[inline(always)]
    fn sums<const N: usize>(&self, list: &[u32], [x, y, z]: [[f32; N]; 3]) -> Sums<N> {
        let Evaluator { functions, cut_squared, height_at_cut, .. } = self.evaluator;
        // Arrays of their own, and no array by axis within the loop over lanes: only so is that made of vectors.
        let Sums { mut value, mut weight, slope, slope_of_weights, mut reached } = Sums::<N>::default();
        let ([mut sx, mut sy, mut sz], [mut wx, mut wy, mut wz]) = (slope, slope_of_weights);
        for &id in list {
            let of = self.values[id as usize];
            let (Some(function), true) = (functions[id as usize], of.is_finite()) else { continue };
            let (of, c, [m00, m10, m11, m20, m21, m22]) = (of - self.middle, function.center, function.inverse);
            for l in 0..N {
                let (dx, dy, dz) = (x[l] - c.x, y[l] - c.y, z[l] - c.z);
                let (u0, u1, u2) = (m00 * dx, m10 * dx + m11 * dy, m20 * dx + m21 * dy + m22 * dz);
                let squared = u0 * u0 + u1 * u1 + u2 * u2;
                let height = exp_neg(0.5 * squared);
                let is_inside = (squared < *cut_squared) & (height > *height_at_cut);
                let inside = |number: f32| if is_inside { number } else { 0.0 };
                let above = inside(height - height_at_cut);
                value[l] += of * above;
                weight[l] += above;
                reached[l] += u32::from(is_inside);
                let gx = inside(height * (m00 * u0 + m10 * u1 + m20 * u2));
                let gy = inside(height * (m11 * u1 + m21 * u2));
                let gz = inside(height * (m22 * u2));
                (sx[l], sy[l], sz[l]) = (sx[l] - of * gx, sy[l] - of * gy, sz[l] - of * gz);
                (wx[l], wy[l], wz[l]) = (wx[l] - gx, wy[l] - gy, wz[l] - gz);
            }
        }
        Sums { value, weight, slope: [sx, sy, sz], slope_of_weights: [wx, wy, wz], reached }
    }
}

/// Places of one box, evaluated side by side.
struct Side<'a> {
    field: &'a Field<'a>,
    list: &'a [u32],
    coordinates: [[f32; LANES]; 3],
}

impl pulp::NullaryFnOnce for Side<'_> {
    type Output = Sums<LANES>;

    #[inline(always)]
    fn call(self) -> Sums<LANES> {
        self.field.sums(self.list, self.coordinates)
    }
}

/// Sums over functions at N places.
struct Sums<const N: usize> {
    value: [f32; N],
    weight: [f32; N],
    slope: [[f32; N]; 3],
    slope_of_weights: [[f32; N]; 3],
    reached: [u32; N],
}

impl<const N: usize> Default for Sums<N> {
    fn default() -> Self {
        let (value, weight, slope, slope_of_weights) = ([0.0; N], [0.0; N], [[0.0; N]; 3], [[0.0; N]; 3]);
        Self { value, weight, slope, slope_of_weights, reached: [0; N] }
    }
}

impl<const N: usize> Sums<N> {
    fn found(&self, lane: usize, middle: f32) -> Option<Found<f32, Vec3>> {
        let weight = self.weight[lane];
        let from_middle = self.value[lane] / weight;
        let along = |axis: usize| (self.slope[axis][lane] - from_middle * self.slope_of_weights[axis][lane]) / weight;
        let gradient = Vec3::from_array([0, 1, 2].map(along));
        (weight > 0.0).then(|| Found { value: middle + from_middle, gradient, reached: self.reached[lane] })
    }
}

/// A grid of boxes over all that functions reach, with a list of functions for each.
#[derive(Clone, Debug)]
struct Lists {
    lo: DVec3,
    per_side: DVec3,
    /// Boxes along each axis.
    counts: [usize; 3],
    /// Where the list of each box begins in `ids`, and the end.
    starts: Vec<usize>,
    ids: Vec<u32>,
}

impl Lists {
    /// The sides of boxes, in median widths.
    const SIDE: f64 = 3.0;
    /// Most entries of lists, for each function; boxes become larger until there are no more.
    const ENTRIES: usize = 64;
    /// Functions are enlarged by this share: more than what f32 moves the surface of a function by that is a thousand times as long as wide.
    const MARGIN: f64 = 1e-3;

    fn of(kernels: &Kernels) -> Self {
        let boxed = |i: usize| Some((i as u32, kernels.get(i)?.bounds((1.0 + Self::MARGIN) * kernels.cut())));
        let is_finite = |(_, [lo, hi]): &(u32, [DVec3; 2])| lo.is_finite() && hi.is_finite();
        let boxes: Vec<(u32, [DVec3; 2])> = (0..kernels.len()).filter_map(boxed).filter(is_finite).collect();
        let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [lo, hi] = boxes.iter().fold(empty, |[lo, hi], (_, [from, to])| [lo.min(*from), hi.max(*to)]);
        if boxes.is_empty() {
            return Self { lo: DVec3::ZERO, per_side: DVec3::ZERO, counts: [0; 3], starts: vec![0], ids: vec![] };
        }
        let mut side = (Self::SIDE * median_width(kernels)).max(1e-3 * (hi - lo).max_element());
        loop {
            let counts = ((hi - lo) / side).to_array().map(|count| count.ceil().max(1.0) as usize);
            let grid = Self { lo, per_side: DVec3::splat(1.0 / side), counts, starts: vec![], ids: vec![] };
            let entries: usize = boxes.iter().map(|(_, ends)| grid.boxes(*ends).count()).fold(0, usize::saturating_add);
            let most = Self::ENTRIES * boxes.len();
            if counts == [1; 3] || (entries <= most && counts.iter().product::<usize>() <= most) {
                return grid.filled(&boxes);
            }
            side *= 2.0;
        }
    }

    /// Fills the lists; functions come in ascending order.
    fn filled(mut self, boxes: &[(u32, [DVec3; 2])]) -> Self {
        let mut lengths = vec![0usize; self.counts.iter().product::<usize>() + 1];
        boxes.iter().for_each(|(_, ends)| self.boxes(*ends).for_each(|at| lengths[at + 1] += 1));
        for at in 1..lengths.len() {
            lengths[at] += lengths[at - 1];
        }
        self.ids = vec![0; lengths[lengths.len() - 1]];
        let mut next = lengths.clone();
        for (id, ends) in boxes {
            for at in self.boxes(*ends) {
                self.ids[next[at]] = *id;
                next[at] += 1;
            }
        }
        self.starts = lengths;
        self
    }

    /// The boxes that meet another one.
    fn boxes(&self, ends: [DVec3; 2]) -> impl Iterator<Item = usize> + use<> {
        let [from, to] = ends.map(|end| ((end - self.lo) * self.per_side).to_array());
        let [nx, ny, nz] = self.counts;
        let index = |x: f64, count: usize| (x.max(0.0) as usize).min(count - 1);
        let along = |axis: usize, count| index(from[axis], count)..=index(to[axis], count);
        let (x, y, z) = (along(0, nx), along(1, ny), along(2, nz));
        z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| x + nx * (y + ny * z)))
        })
    }

    /// The box that a place is in; `None` where no function reaches.
    fn box_of(&self, place: Vec3) -> Option<usize> {
        let at = ((place.as_dvec3() - self.lo) * self.per_side).to_array();
        let index = |axis: usize| {
            let is_within = at[axis] >= 0.0 && at[axis] < self.counts[axis] as f64;
            is_within.then_some(at[axis] as usize)
        };
        let [nx, ny, _] = self.counts;
        Some(index(0)? + nx * (index(1)? + ny * index(2)?))
    }

    fn list(&self, at: usize) -> &[u32] {
        &self.ids[self.starts[at]..self.starts[at + 1]]
    }

    fn at(&self, place: Vec3) -> Option<&[u32]> {
        self.box_of(place).map(|at| self.list(at))
    }
}

/// The median, over about a thousand functions, of the widths' geometric means, local units; 1 without a function.
fn median_width(kernels: &Kernels) -> f64 {
    const SAMPLES: usize = 1001;
    let every = kernels.len().div_ceil(SAMPLES).max(1);
    let placed = (0..kernels.len()).step_by(every).filter_map(|at| kernels.get(at));
    let mut widths: Vec<f64> = placed.map(|Placed { factor: [a, b, c], .. }| (a.x * b.y * c.z).cbrt()).collect();
    widths.sort_unstable_by(f64::total_cmp);
    widths.get(widths.len() / 2).copied().unwrap_or(1.0)
}

#[cfg(test)]
#[path = "eval_tests.rs"]
mod tests;
