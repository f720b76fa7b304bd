//! Where a field of functions is, by the functions themselves: for points, which have no cells.
//!
//! With W(x) = sum phi_i(x), the optical depth is multiplied by the coverage
//!
//! ```text
//! smoothstep(W / W_ref),    smoothstep(t) = t^2 (3 - 2 t) for t in 0 to 1, 0 below and 1 above
//! ```
//!
//! W_ref is the median, over the functions' centres, of what the others give there: as at a place between functions, W without the one whose
//! centre it is. It is at least the height of one function. Inside of evenly spread points the field is whole, and fades out around them.

use super::{Kernels, Placed};
use glam::DVec3;
use rayon::prelude::*;

/// How much of a field is where functions have some weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Sum of weights from which on the field is whole; above zero.
    reference: f64,
}

/// Centres at which W is asked for.
const SAMPLES: usize = 257;

impl Coverage {
    /// Largest second derivative along a line of the coverage by one function alone whose height is W_ref, per width squared, with c = 3. Of
    /// many, whose sum rises as one of them does, it is about that.
    pub const BENDING: f64 = 1.5;

    /// The coverage by some functions: W_ref is the median at 257 to 512 evenly numbered centres. The same for any number of threads.
    pub fn of(kernels: &Kernels) -> Self {
        let every = (kernels.len() / SAMPLES).max(1);
        let samples: Vec<DVec3> =
            (0..kernels.len()).step_by(every).filter_map(|at| kernels.get(at)).map(|of| of.center).collect();
        let all: Vec<Placed> = (0..kernels.len()).filter_map(|at| kernels.get(at)).collect();
        // A sum each, in the order of the functions.
        let weight_at = |at: &DVec3| -> f64 {
            all.iter().map(|of| kernels.weight(of.unscaled(*at - of.center).length_squared())).sum()
        };
        let mut weights: Vec<f64> = samples.par_iter().map(weight_at).collect();
        weights.sort_unstable_by(f64::total_cmp);
        let own = kernels.weight(0.0);
        let of_others = weights.get(weights.len() / 2).map_or(0.0, |weight| weight - own);
        Self { reference: of_others.max(own) }
    }

    /// W_ref.
    pub fn reference(&self) -> f64 {
        self.reference
    }

    /// The share of the optical depth where functions have this sum of weights, 0 to 1.
    pub fn at(&self, weights: f64) -> f64 {
        let t = (weights / self.reference).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

impl Kernels {
    /// The box of all centres, local coordinates; `None` without a function.
    pub fn box_of_centers(&self) -> Option<[DVec3; 2]> {
        self.box_of(|_| DVec3::ZERO)
    }

    /// The box in which all functions end, local coordinates; `None` without a function.
    pub fn box_of_reach(&self) -> Option<[DVec3; 2]> {
        // Along an axis an ellipsoid reaches as far as the row of L is long.
        self.box_of(|of| self.cut() * DVec3::from_array(of.factor.map(DVec3::length)))
    }

    fn box_of(&self, reach: impl Fn(&Placed) -> DVec3 + Sync) -> Option<[DVec3; 2]> {
        let ends = (0..self.len()).into_par_iter().filter_map(|at| self.get(at));
        let ends = ends.map(|of| [of.center - reach(&of), of.center + reach(&of)]);
        ends.reduce_with(|[a, b], [lo, hi]| [a.min(lo), b.max(hi)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn round(centers: Vec<Vec3>) -> Kernels {
        let factors = vec![[0.1, 0.0, 0.1, 0.0, 0.0, 0.1]; centers.len()];
        Kernels::new(centers, factors, 3.0).unwrap()
    }

    #[test]
    fn the_field_is_whole_at_a_usual_centre_and_nowhere_beyond_all_functions() {
        let lone = Coverage::of(&round(vec![Vec3::ZERO]));
        let height = 1.0 - (-4.5f64).exp();
        assert!((lone.reference() - height).abs() < 1e-15);
        assert_eq!([0.0, height, 2.0].map(|weights| lone.at(weights)), [0.0, 1.0, 1.0]);
        assert!((lone.at(0.5 * height) - 0.5).abs() < 1e-15);
        // Three at one place of five: the median centre has two others. Of two at one place of five it has none.
        let reference = |at: [f32; 5]| Coverage::of(&round(at.map(|x| x * Vec3::X).to_vec())).reference();
        assert!((reference([0.0, 0.0, 0.0, 2.0, 3.0]) - 2.0 * height).abs() < 1e-15);
        assert!((reference([0.0, 0.0, 1.0, 2.0, 3.0]) - height).abs() < 1e-15);
        assert!((Coverage::of(&round(vec![])).reference() - height).abs() < 1e-15);
    }

    #[cfg(feature = "clouds")]
    #[test]
    fn among_evenly_spread_points_the_field_is_whole_and_outside_of_them_it_ends() {
        let mut random = crate::mesh::test_meshes::Random::new(3);
        let side = 12;
        let places = (0..side * side * side).map(|i| [i % side, i / side % side, i / side / side]);
        let place = |at: [i32; 3]| DVec3::from_array(at.map(|i| f64::from(i) + 0.2 * random.signed()));
        let balls: Vec<(DVec3, f64)> = places.map(place).map(|place| (place, 0.1)).collect();
        let mesh = crate::mesh::test_meshes::cloud(&balls, &[]);
        let kernels = crate::functions::points::PointFunctions::default().of(&mesh).unwrap();
        let coverage = Coverage::of(&kernels);
        let share_at = |world: DVec3| {
            let at = mesh.positions.local_from_world(world);
            let all = (0..kernels.len()).filter_map(|i| kernels.get(i));
            coverage.at(all.map(|of| kernels.weight(of.unscaled(at - of.center).length_squared())).sum())
        };
        let mut random = crate::mesh::test_meshes::Random::new(4);
        let mut inside = || DVec3::new(random.signed(), random.signed(), random.signed()) * 4.0 + 5.5;
        let shares: Vec<f64> = (0..500).map(|_| share_at(inside())).collect();
        let mean = shares.iter().sum::<f64>() / 500.0;
        let whole = shares.iter().filter(|share| **share == 1.0).count();
        assert!(mean > 0.99 && whole > 450, "{mean} {whole}");
        // The field ends within two spacings of the outermost points.
        assert_eq!(share_at(DVec3::new(5.5, 5.5, 13.5)), 0.0);
        assert!(share_at(DVec3::new(5.5, 5.5, 11.0)) > 0.5);
    }

    #[test]
    fn the_coverage_by_one_function_bends_no_more_than_is_said() {
        let kernels = round(vec![Vec3::ZERO]);
        let coverage = Coverage::of(&kernels);
        // Differences a thousandth of a width apart, on lines that pass by the centre.
        let (mut most, part) = (0.0f64, 1e-3);
        for (beside, along) in (0..30).flat_map(|b| (0..3000).map(move |a| (0.1 * f64::from(b), 1e-3 * f64::from(a)))) {
            let at = |s: f64| coverage.at(kernels.weight(beside * beside + s * s));
            let second = (at(along - part) - 2.0 * at(along) + at(along + part)) / (part * part);
            most = most.max(second.abs());
        }
        assert!(most <= Coverage::BENDING && most > 0.98 * Coverage::BENDING, "{most}");
    }

    #[test]
    fn boxes_hold_centres_and_what_functions_reach() {
        let slanted = Kernels::new(vec![Vec3::X; 1], vec![[0.1, 0.3, 0.4, 0.0, 0.0, 0.2]], 2.0).unwrap();
        let [lo, hi] = slanted.box_of_reach().unwrap();
        assert!((hi - DVec3::new(1.2, 1.0, 0.4)).abs().max_element() < 1e-6 && (lo.y + 1.0).abs() < 1e-6, "{hi}");
        assert_eq!(slanted.box_of_centers(), Some([DVec3::X, DVec3::X]));
        assert_eq!(round(vec![]).box_of_reach(), None);
    }
}
