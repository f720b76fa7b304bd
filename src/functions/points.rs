//! One function at each point of a cloud, which has no cells (Neophytou and Mueller 2006, who call such data scattered).
//!
//! S at a point is w^2 times the mean of e e^T over the ways e to the nearest other places. All that are as far as the k-th count, so that
//! neither a grid's symmetry nor the order of points is lost. Points at one place have one function each, of the same widths. What no
//! neighbour says, of points all at one place, the ball's radius says: e is as long as its diameter, in all directions.

use super::Kernels;
use super::factor::factor;
use crate::mesh::{Mesh, Symmetric};
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// How functions follow the points around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointFunctions {
    /// Number of places that say how wide a function is.
    pub neighbours: usize,
    /// Widths, in root mean squares of the ways there.
    pub width: f64,
    /// Distance in widths at which functions end.
    pub cut: f64,
}

impl Default for PointFunctions {
    fn default() -> Self {
        Self { neighbours: 12, width: 0.7, cut: 3.0 }
    }
}

/// By how much squares of distances may be off by rounding: three squares of differences, and their sum.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl PointFunctions {
    /// Least and greatest number of neighbours.
    pub const NEIGHBOURS: std::ops::RangeInclusive<usize> = 3..=100;

    /// The functions at the points of a cloud. The same for any number of threads.
    ///
    /// # Errors
    /// If neighbours, width or cut are out of range; says what the range is. If the mesh is not a cloud.
    pub fn of(&self, mesh: &Mesh) -> Result<Kernels, String> {
        let (least, most) = Self::NEIGHBOURS.into_inner();
        if !Self::NEIGHBOURS.contains(&self.neighbours) {
            return Err(format!(
                "functions of {} neighbours; from {least} to {most} can be asked for",
                self.neighbours
            ));
        }
        if !(self.width > 0.0 && self.width <= 4.0) {
            return Err(format!("functions {} times as wide as points are apart; above 0, and at most 4", self.width));
        }
        let radii = mesh.radii.as_ref().ok_or("the mesh has cells: its functions are those of their edges")?;
        let places = Places::of(&mesh.positions.local);
        let shapes = places.shapes(self.neighbours);
        let factor_of = |(&place, &radius): (&u32, &f32)| {
            let shape = shapes.as_ref().map_or_else(|| of_ball(radius.into()), |shapes| shapes[place as usize]);
            factor(&shape, self.width)
        };
        let factors = places.of_points.par_iter().zip(radii).map(factor_of).collect();
        Kernels::new(mesh.positions.local.clone(), factors, self.cut)
    }
}

/// The mean of e e^T over all directions, e as long as a ball's diameter.
fn of_ball(radius: f64) -> Symmetric {
    let mean = (2.0 * radius).powi(2) / 3.0;
    [mean, 0.0, 0.0, mean, 0.0, mean]
}

/// Where points are, each place once.
struct Places {
    /// Local coordinates, in an order of their own.
    at: Vec<[f64; 3]>,
    /// The place of each point.
    of_points: Vec<u32>,
}

impl Places {
    fn of(points: &[glam::Vec3]) -> Self {
        // Adding zero turns -0 into +0.
        let bits = |point: u32| points[point as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.par_sort_unstable_by_key(|&point| (bits(point), point));
        let (mut at, mut of_points) = (Vec::new(), vec![0; points.len()]);
        for same in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
            same.iter().for_each(|&point| of_points[point as usize] = at.len() as u32);
            at.push(points[same[0] as usize].as_dvec3().to_array());
        }
        Self { at, of_points }
    }

    /// The mean of e e^T at each place over the nearest others; `None` without a second place.
    fn shapes(&self, neighbours: usize) -> Option<Vec<Symmetric>> {
        let all = NonZero::new(neighbours.saturating_add(1).min(self.at.len()))?;
        if all.get() < 2 {
            return None;
        }
        let tree = ImmutableKdTree::<f64, 3>::new_from_slice(&self.at).ok()?;
        let shape = |place: &[f64; 3]| {
            let nearest = tree.query(place).nearest_n::<SquaredEuclidean<f64>>(all).execute();
            let farthest = nearest.iter().map(|found| found.distance).fold(0.0, f64::max);
            let found = tree.query(place).within::<SquaredEuclidean<f64>>(farthest * (1.0 + ROUNDING)).execute();
            // By ascending numbers, whatever the tree's order.
            let mut ids: Vec<u64> = found.iter().map(|found| u64::from(found.item)).collect();
            ids.sort_unstable();
            let ways = ids.iter().map(|&id| DVec3::from_array(self.at[id as usize]) - DVec3::from_array(*place));
            mean_of(ways.filter(|e| *e != DVec3::ZERO))
        };
        Some(self.at.par_iter().map(shape).collect())
    }
}

/// The mean of e e^T; zero without any.
fn mean_of(ways: impl Iterator<Item = DVec3>) -> Symmetric {
    let (mut sum, mut count) = (Symmetric::default(), 0u32);
    for e in ways {
        let terms = [e.x * e.x, e.x * e.y, e.x * e.z, e.y * e.y, e.y * e.z, e.z * e.z];
        sum.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        count += 1;
    }
    sum.map(|sum| sum / f64::from(count.max(1)))
}

#[cfg(test)]
mod tests {
    use super::super::value_at;
    use super::*;
    use crate::mesh::test_meshes::{Random, cloud};
    use std::sync::Arc;

    fn of(points: &[DVec3]) -> (Arc<Mesh>, Kernels) {
        let balls: Vec<_> = points.iter().map(|point| (*point, 0.25)).collect();
        let mesh = cloud(&balls, &[]);
        let kernels = PointFunctions::default().of(&mesh).unwrap();
        (mesh, kernels)
    }

    fn random_points(count: usize, seed: u64) -> Vec<DVec3> {
        let mut random = Random::new(seed);
        (0..count).map(|_| DVec3::new(random.signed(), random.signed(), random.signed())).collect()
    }

    /// S, from L.
    fn shape(kernels: &Kernels, at: usize) -> [[f64; 3]; 3] {
        let rows = kernels.get(at).unwrap().factor;
        rows.map(|a| rows.map(|b| a.dot(b)))
    }

    #[test]
    fn functions_are_as_wide_as_the_ways_to_the_nearest_points_by_brute_force() {
        let (mesh, kernels) = of(&random_points(60, 5));
        let local = &mesh.positions.local;
        for (at, center) in local.iter().enumerate() {
            let mut ways: Vec<DVec3> = local.iter().map(|p| p.as_dvec3() - center.as_dvec3()).collect();
            ways.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
            let nearest = &ways[1..=12];
            let found = shape(&kernels, at);
            for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
                let expected = 0.49 / 12.0 * nearest.iter().map(|e| e[row] * e[column]).sum::<f64>();
                let trace = found[0][0] + found[1][1] + found[2][2];
                // Thickening, and rounding of L to f32.
                assert!((found[row][column] - expected).abs() < 2e-6 * trace, "{at} {row} {column}");
            }
        }
    }

    #[test]
    fn a_grid_keeps_its_symmetry_whatever_the_order_of_its_points() {
        let grid: Vec<DVec3> =
            (0..343).map(|i| DVec3::new((i % 7).into(), (i / 7 % 7).into(), f64::from(i / 49))).collect();
        let (mesh, kernels) = of(&grid);
        let middle = (0..343).find(|&i| mesh.vertex_source[i] == 3 + 7 * 3 + 49 * 3).unwrap();
        let [[xx, xy, xz], [_, yy, yz], [.., zz]] = shape(&kernels, middle);
        // Six along the axes, twelve diagonals of squares: 2 + 8 squares of the side a coordinate, of 18.
        let side = 1.0 / mesh.positions.scale;
        let expected = 0.49 * 10.0 / 18.0 * side * side;
        for (found, expected) in [(xx, expected), (yy, expected), (zz, expected), (xy, 0.0), (xz, 0.0), (yz, 0.0)] {
            assert!((found - expected).abs() < 1e-5 * side * side, "{found} {expected}");
        }
        let turned: Vec<DVec3> = grid.into_iter().rev().collect();
        assert_eq!(of(&turned).1, kernels);
    }

    #[test]
    fn coincident_points_are_functions_of_one_width_and_count_as_one_neighbour() {
        let places = random_points(20, 8);
        let (mesh, alone) = of(&places);
        let many: Vec<DVec3> = places.iter().chain(std::iter::repeat_n(&places[0], 50)).copied().collect();
        let (crowded, kernels) = of(&many);
        let at = |mesh: &Mesh, source: u32| mesh.vertex_source.iter().position(|&of| of == source).unwrap();
        let expected = alone.get(at(&mesh, 0)).unwrap();
        for source in std::iter::once(0).chain(20..70) {
            assert_eq!(kernels.get(at(&crowded, source)).unwrap(), expected);
        }
        assert_eq!(kernels.get(at(&crowded, 7)).unwrap(), alone.get(at(&mesh, 7)).unwrap());
    }

    #[test]
    fn few_points_one_point_and_one_place_have_functions() {
        for points in [
            vec![DVec3::X],
            vec![DVec3::X; 30],
            vec![DVec3::ZERO, DVec3::X],
            random_points(5, 2),
            // On a line, and on a plane: needles and plates.
            (0..30).map(|i| DVec3::new(0.1 * f64::from(i), 0.0, 0.0)).collect(),
            (0..30).map(|i| DVec3::new(f64::from(i % 6), f64::from(i / 6), 2.0)).collect(),
            vec![DVec3::ZERO, 1e-30 * DVec3::X, DVec3::Y],
        ] {
            let (mesh, kernels) = of(&points);
            for at in 0..points.len() {
                let function = kernels.get(at).unwrap_or_else(|| panic!("{points:?} {at}"));
                assert!(function.unscaled(DVec3::splat(0.1)).is_finite());
                let center = mesh.positions.local[at].as_dvec3();
                let found = value_at(&kernels, &vec![2.5; points.len()], center).unwrap();
                assert!((found - 2.5).abs() < 1e-12, "{points:?} {at} {found}");
            }
        }
    }

    #[test]
    fn neither_offset_nor_scale_nor_threads_change_functions() {
        let points: Vec<DVec3> = random_points(200, 3).iter().map(|p| (*p * 1024.0).round()).collect();
        let (_, expected) = of(&points);
        // Multiples of 2^-10 of the box: exact far away, too.
        let radius = |radius: f64, scale: f64, offset: f64| {
            let balls: Vec<_> = points.iter().map(|p| (scale * (*p + DVec3::splat(offset)), radius)).collect();
            PointFunctions::default().of(&cloud(&balls, &[])).unwrap()
        };
        assert_eq!(radius(0.25, 1.0, 2f64.powi(35)), expected);
        assert_eq!(radius(16.0, 64.0, 0.0), expected);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| of(&points).1), expected);
        }
        assert_ne!(radius(0.25, 1.0, 0.5), of(&points[1..]).1);
    }

    #[test]
    fn what_is_out_of_range_is_refused() {
        let mesh = cloud(&[(DVec3::ZERO, 1.0), (DVec3::X, 1.0)], &[]);
        let usual = PointFunctions::default();
        let refused = |of: PointFunctions| of.of(&mesh).unwrap_err();
        assert!(refused(PointFunctions { neighbours: 2, ..usual }).contains("from 3 to 100"));
        assert!(refused(PointFunctions { width: 0.0, ..usual }).contains("at most 4"));
        assert!(refused(PointFunctions { cut: f64::NAN, ..usual }).contains("widths"));
        let cells = Mesh::build(crate::mesh::test_meshes::kuhn_grid([1; 3])).unwrap().0;
        assert!(usual.of(&cells).unwrap_err().contains("cells"));
    }
}
