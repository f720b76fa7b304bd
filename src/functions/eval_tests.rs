//! Values, gradients and lists.

use super::super::value_at;
use super::super::vertices::VertexFunctions;
use super::*;
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};

fn fixture() -> (Kernels, Vec<f32>) {
    let mesh = Mesh::build(jittered(kuhn_grid([6; 3]), &mut Random::new(1))).unwrap().0;
    let kernels = VertexFunctions::default().of(&mesh).unwrap().kernels;
    let values = mesh.positions.local.iter().map(|p| 1000.0 + (3.0 * p.x).sin() + p.y * p.z).collect();
    (kernels, values)
}

fn places(count: usize) -> Vec<Vec3> {
    let mut random = Random::new(5);
    (0..count).map(|_| DVec3::new(random.signed(), random.signed(), random.signed()).as_vec3()).collect()
}

#[test]
fn in_float64_the_value_is_the_judges_and_the_gradient_that_of_differences() {
    let (kernels, values) = fixture();
    for place in places(60) {
        let at = 0.8 * place.as_dvec3();
        let found = value_and_gradient_at(&kernels, &values, at).unwrap();
        assert_eq!(Some(found.value), value_at(&kernels, &values, at));
        // No function ends within the step, or the slope jumps: few do.
        let step = 1e-5;
        let reached = |at| value_and_gradient_at(&kernels, &values, at).unwrap().reached;
        for (axis, unit) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let [before, after] = [-step, step].map(|by| at + by * unit);
            if reached(before) != found.reached || reached(after) != found.reached {
                continue;
            }
            let [before, after] = [before, after].map(|at| value_at(&kernels, &values, at).unwrap());
            let expected = (after - before) / (2.0 * step);
            // Values of 1000 are rounded to 1e-13, divided by 2e-5; third derivatives of size 1e3 times the step's square are as much.
            assert!((found.gradient[axis] - expected).abs() < 1e-6, "{expected} {found:?}");
        }
    }
}

#[test]
fn in_f32_values_and_gradients_are_those_in_float64() {
    let (kernels, values) = fixture();
    let evaluator = Evaluator::new(&kernels);
    let field = evaluator.field(&values);
    let (mut worst, mut steepest, mut reached) = (0.0f64, 0.0f64, 0);
    for place in places(400) {
        let expected = value_and_gradient_at(&kernels, &values, place.as_dvec3());
        let found = field.at(place);
        assert_eq!(expected.is_some(), found.is_some());
        let (Some(expected), Some(found)) = (expected, found) else { continue };
        // At their ends functions are as small as their rounding.
        assert!(expected.reached.abs_diff(found.reached) <= 1, "{expected:?} {found:?}");
        worst = worst.max((f64::from(found.value) - expected.value).abs());
        steepest = steepest.max((found.gradient.as_dvec3() - expected.gradient).length());
        reached += 1;
    }
    assert!(reached > 200);
    // Weights are off by 2^-24 times 20 of a whole Gaussian (d^2 by 2^-22 of itself, which is at most 9, halved; 2e-7 of the exponential; the
    // difference), values by that times the range of 3.7 and the sum of whole Gaussians over that of weights, at most 2; the value itself
    // is rounded to 2^-15 as it is about 1000.
    let bound = 2f64.powi(-15) + 20.0 * 2f64.powi(-24) * 3.7 * 2.0;
    assert!(worst <= bound && worst > 0.0, "{worst:.2e} {bound:.2e}");
    // Slopes are differences of sums that are larger by 1 / width, about 10, twice.
    assert!(steepest <= 1e-3 && steepest > 0.0, "{steepest:.2e}");
}

#[test]
fn many_places_have_the_bits_of_each_alone_wherever_they_are() {
    let (kernels, mut values) = fixture();
    values[30] = f32::NAN;
    let evaluator = Evaluator::new(&kernels);
    let field = evaluator.field(&values);
    let mut places = places(500);
    // Outside, and in the borders of boxes.
    places.push(Vec3::splat(40.0));
    places.push(Vec3::splat(f32::NAN));
    let lists = &evaluator.lists;
    places.extend((0..20).map(|i| (lists.lo + f64::from(i) / lists.per_side).as_vec3()));
    let all = field.at_all(&places);
    assert!(all.iter().filter(|found| found.is_some()).count() > 300 && all.contains(&None));
    let bits = |found: &Option<Found<f32, Vec3>>| {
        found.map(|found| (found.value.to_bits(), found.gradient.to_array().map(f32::to_bits), found.reached))
    };
    for (place, found) in places.iter().zip(&all) {
        assert_eq!(bits(found), bits(&field.at(*place)), "{place}");
    }
    // Without the vectors of this processor, too.
    let list: Vec<u32> = (0..kernels.len() as u32).collect();
    for (place, found) in places.iter().zip(&all) {
        // All functions in place of a box's.
        assert_eq!(bits(&field.sums(&list, place.to_array().map(|x| [x])).found(0, field.middle)), bits(found));
    }
    // A value that is changed is noticed.
    values[200] += 0.5;
    assert_ne!(evaluator.field(&values).at_all(&places), all);
}

#[test]
fn lists_stay_short_where_widths_differ_much_and_none_is_no_field() {
    let mut centers: Vec<Vec3> = places(3000).iter().map(|place| 1e-3 * *place).collect();
    let mut factors = vec![[1e-4, 0.0, 1e-4, 0.0, 0.0, 1e-4]; centers.len()];
    centers.extend(places(3000));
    factors.extend(vec![[0.2, 0.0, 0.2, 0.0, 0.0, 0.2]; 3000]);
    let kernels = Kernels::new(centers, factors, 3.0).unwrap();
    let evaluator = Evaluator::new(&kernels);
    assert!(evaluator.lists.ids.len() <= Lists::ENTRIES * kernels.len());
    let values: Vec<f32> = (0..kernels.len()).map(|i| (i % 7) as f32).collect();
    let found = evaluator.field(&values).at(Vec3::splat(5e-4)).unwrap();
    let expected = value_at(&kernels, &values, DVec3::splat(f64::from(5e-4f32))).unwrap();
    assert!((f64::from(found.value) - expected).abs() < 1e-4, "{found:?} {expected}");
    let none = Kernels::new(vec![], vec![], 3.0).unwrap();
    assert_eq!(Evaluator::new(&none).field(&[]).at(Vec3::ZERO), None);
    let constant = vec![0.3f32; kernels.len()];
    let found = evaluator.field(&constant).at(Vec3::splat(5e-4)).unwrap();
    assert_eq!((found.value, found.gradient), (0.3, Vec3::ZERO));
}
