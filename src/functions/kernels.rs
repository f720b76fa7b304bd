//! Functions without values.

use glam::{DVec3, Vec3};

/// Ellipsoidal Gaussians that end where they fall to a fraction of their height.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernels {
    /// Centres, local coordinates.
    centers: Vec<Vec3>,
    /// L of S = L L^T, local units: rows of the lower triangle, l00, l10, l11, l20, l21, l22.
    factors: Vec<[f32; 6]>,
    /// Distance in units of the widths at which they end.
    cut: f64,
}

/// One function, in float64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Centre, local coordinates.
    pub center: DVec3,
    /// Rows of L.
    pub factor: [DVec3; 3],
}

impl Kernels {
    /// Least and greatest distance at which functions may end, in units of their widths.
    pub const CUTS: std::ops::RangeInclusive<f64> = 0.5..=6.0;

    /// Functions with these centres and factors, which end at the distance `cut`.
    ///
    /// # Errors
    /// If there are not as many factors as centres, if the cut is not in [`Self::CUTS`], or if a number is not finite; says which.
    pub fn new(centers: Vec<Vec3>, factors: Vec<[f32; 6]>, cut: f64) -> Result<Self, String> {
        if centers.len() != factors.len() {
            return Err(format!("{} centres and {} widths of functions", centers.len(), factors.len()));
        }
        Self::check_cut(cut)?;
        let is_finite = |i: &usize| centers[*i].is_finite() && factors[*i].iter().all(|number| number.is_finite());
        match (0..centers.len()).find(|i| !is_finite(i)) {
            Some(at) => Err(format!("function {at} has a centre or width that is not finite")),
            None => Ok(Self { centers, factors, cut }),
        }
    }

    /// Checks a distance at which functions end.
    ///
    /// # Errors
    /// If it is not in [`Self::CUTS`].
    pub fn check_cut(cut: f64) -> Result<(), String> {
        let (least, most) = Self::CUTS.into_inner();
        let is_known = Self::CUTS.contains(&cut);
        if is_known {
            Ok(())
        } else {
            Err(format!("functions that end at {cut} widths; from {least} to {most} can be drawn"))
        }
    }

    /// Number of functions.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// L of each function, local units: rows of the lower triangle, l00, l10, l11, l20, l21, l22.
    pub fn factors(&self) -> &[[f32; 6]] {
        &self.factors
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// Distance in units of the widths at which functions end.
    pub fn cut(&self) -> f64 {
        self.cut
    }

    /// The height of a whole Gaussian where functions end, which is subtracted from it.
    pub fn height_at_cut(&self) -> f64 {
        (-0.5 * self.cut * self.cut).exp()
    }

    /// A function; `None` if it has no width in some direction, and so reaches nothing.
    pub fn get(&self, at: usize) -> Option<Placed> {
        let [l00, l10, l11, l20, l21, l22] = self.factors[at].map(f64::from);
        let factor = [DVec3::new(l00, 0.0, 0.0), DVec3::new(l10, l11, 0.0), DVec3::new(l20, l21, l22)];
        (l00 > 0.0 && l11 > 0.0 && l22 > 0.0).then(|| Placed { center: self.centers[at].as_dvec3(), factor })
    }

    /// The weight phi at a distance of this square in widths.
    pub fn weight(&self, distance_squared: f64) -> f64 {
        ((-0.5 * distance_squared).exp() - self.height_at_cut()).max(0.0)
    }
}

impl Placed {
    /// The product of L^-1 with a vector: its length is the distance in widths.
    pub fn unscaled(&self, v: DVec3) -> DVec3 {
        let [r0, r1, r2] = self.factor;
        let x = v.x / r0.x;
        let y = (v.y - r1.x * x) / r1.y;
        DVec3::new(x, y, (v.z - r2.x * x - r2.y * y) / r2.z)
    }

    /// The product of L^-T with a vector: of what [`Self::unscaled`] gives, S^-1 times the vector that it was given.
    pub fn unscaled_transposed(&self, u: DVec3) -> DVec3 {
        let [r0, r1, r2] = self.factor;
        let z = u.z / r2.z;
        let y = (u.y - r2.y * z) / r1.y;
        DVec3::new((u.x - r1.x * y - r2.x * z) / r0.x, y, z)
    }

    /// The box around the part that is closer than `cut`, in units of the widths.
    pub fn bounds(&self, cut: f64) -> [DVec3; 2] {
        let [x, y, z] = self.factor.map(|row| row.length());
        let half = cut * DVec3::new(x, y, z);
        [self.center - half, self.center + half]
    }
}

/// The field's value at a place in local coordinates, by all functions, in float64; `None` where none reaches. Functions whose value is
/// not finite are holes: they are left out.
///
/// # Panics
/// If there is not one value per function.
pub fn value_at(kernels: &Kernels, values: &[f32], at: DVec3) -> Option<f64> {
    assert_eq!(values.len(), kernels.len(), "one value a function");
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let Some(function) = kernels.get(i) else { continue };
        let weight = kernels.weight(function.unscaled(at - function.center).length_squared());
        (sum, weights) = (sum + weight * f64::from(value), weights + weight);
    }
    (weights > 0.0).then(|| sum / weights)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::mesh::test_meshes::Random;

    pub(crate) fn random_factor(random: &mut Random) -> [f32; 6] {
        let mut side = || random.signed() as f32;
        let [l10, l20, l21] = [side(), side(), side()];
        // Needles of 1:1000 among them.
        let width = [(); 3].map(|()| 10f32.powf(1.5 * side() - 1.5));
        [width[0], l10 * width[0], width[1], l20 * width[0], l21 * width[1], width[2]]
    }

    #[test]
    fn distances_are_those_of_the_inverse_of_s() {
        let mut random = Random::new(3);
        for _ in 0..10_000 {
            let kernels = Kernels::new(vec![Vec3::ZERO], vec![random_factor(&mut random)], 3.0).unwrap();
            let function = kernels.get(0).unwrap();
            let [a, b, c] = function.factor;
            // A point at a known distance: L times a vector of this length.
            let away = DVec3::new(random.signed(), random.signed(), random.signed());
            let found = function.unscaled(DVec3::new(a.dot(away), b.dot(away), c.dot(away))).length_squared();
            // Needles of 1:1000 multiply the rounding of a point, 2^-53, by as much.
            assert!((found - away.length_squared()).abs() <= 1e-12 * away.length_squared(), "{found} {away}");
        }
    }

    #[test]
    fn a_function_ends_where_it_is_said_to_without_a_jump() {
        let kernels = Kernels::new(vec![Vec3::ZERO], vec![[0.1, 0.0, 0.1, 0.0, 0.0, 0.1]], 3.0).unwrap();
        assert!((kernels.weight(0.0) - (1.0 - (-4.5f64).exp())).abs() < 1e-15);
        assert!(kernels.weight(9.0 - 1e-9) < 1e-9 && kernels.weight(9.0 - 1e-9) > 0.0);
        assert_eq!(kernels.weight(9.0 + 1e-9), 0.0);
        assert_eq!(value_at(&kernels, &[5.0], DVec3::X * 0.29).map(|v| v as f32), Some(5.0));
        assert_eq!(value_at(&kernels, &[5.0], DVec3::X * 0.31), None);
        assert_eq!(value_at(&kernels, &[f32::NAN], DVec3::ZERO), None);
    }

    #[test]
    fn a_function_without_a_width_reaches_nothing_and_what_is_not_finite_is_refused() {
        let flat = Kernels::new(vec![Vec3::ZERO], vec![[0.1, 0.0, 0.0, 0.0, 0.0, 0.1]], 3.0).unwrap();
        assert_eq!((flat.get(0), value_at(&flat, &[1.0], DVec3::ZERO)), (None, None));
        let of = |factor, cut| Kernels::new(vec![Vec3::ZERO], vec![factor], cut).unwrap_err();
        assert!(of([f32::NAN; 6], 3.0).contains("function 0"));
        assert!(of([1.0; 6], f64::NAN).contains("widths"));
        assert!(Kernels::new(vec![], vec![[1.0; 6]], 3.0).is_err());
    }
}
