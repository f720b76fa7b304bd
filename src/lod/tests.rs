//! Rankings, selections and the controller against their definitions.

use super::ranking::hash;
use super::*;
use crate::mesh::{Mesh, NONE, RawMesh, Topology, test_meshes};
use crate::moments::{CovDenominator, Moments};
use crate::visibility::{CellSet, Selection};
use glam::DVec3;
use proptest::prelude::*;
use std::sync::Arc;

fn mesh(n: [usize; 3]) -> Mesh {
    Mesh::build(test_meshes::kuhn_grid(n)).unwrap().0
}

/// Pseudo-random numbers, one for each index.
fn noise(count: usize, seed: u64) -> Vec<f32> {
    let mut random = test_meshes::Random::new(seed);
    (0..count).map(|_| random.signed() as f32).collect()
}

fn vertices(topology: &Topology) -> usize {
    topology.vertex_count as usize
}

fn interior(topology: &Topology) -> Vec<u32> {
    (0..topology.connectivity().faces.len() as u32)
        .filter(|&face| topology.connectivity().face_cells[face as usize][1] != NONE)
        .collect()
}

fn assert_is_of_all_interior_faces(ranking: &Ranking, topology: &Topology) {
    let mut faces = ranking.ids().to_vec();
    faces.sort_unstable();
    assert_eq!(faces, interior(topology));
}

// Importance and rankings

/// Coefficients of variation by definition, in two passes in f64, and their sums over faces.
fn naive_importance(topology: &Topology, steps: &[Vec<f32>], floor_share: f64) -> Vec<f64> {
    let all = || steps.iter().flatten().copied().filter(|v| v.is_finite()).map(f64::from);
    let width = all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min);
    let of = |vertex: usize| {
        let samples: Vec<f64> = steps.iter().map(|s| f64::from(s[vertex])).filter(|v| v.is_finite()).collect();
        let n = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / n;
        let variance = samples.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        if variance > 0.0 { variance.sqrt() / mean.abs().max(floor_share * width) } else { 0.0 }
    };
    let vertices: Vec<f64> = (0..self::vertices(topology)).map(of).collect();
    topology.connectivity().faces.iter().map(|face| face.iter().map(|&v| vertices[v as usize]).sum()).collect()
}

fn importance_of(topology: &Topology, steps: &[Vec<f32>], denominator: CovDenominator) -> Vec<f32> {
    let mut moments = Moments::new(vertices(topology));
    steps.iter().for_each(|step| _ = moments.add_step(step));
    let cov = moments.vertex_statistics().coefficient_of_variation(moments.series().range, denominator);
    importance(topology, &cov.iter().map(|&c| c as f32).collect::<Vec<_>>())
}

/// Means well above rounding; a hole, and a vertex without a finite value.
fn series(topology: &Topology) -> Vec<Vec<f32>> {
    let mut steps: Vec<Vec<f32>> = (0..7).map(|step| noise(vertices(topology), step)).collect();
    for (step, values) in steps.iter_mut().enumerate() {
        values.iter_mut().enumerate().for_each(|(i, v)| *v = 0.5 * *v + if i % 3 == 0 { 2.0 } else { 1e-3 });
        values[5] = 1.25;
        values[7] = f32::NAN;
        values[9] = if step == 3 { f32::INFINITY } else { values[9] };
    }
    steps
}

#[test]
fn importance_is_the_sum_of_the_coefficients_of_variation() {
    let mesh = mesh([4, 3, 3]);
    let steps = series(&mesh.topology);
    for (denominator, share) in [(CovDenominator::default(), 0.01), (CovDenominator::Plain, 0.0)] {
        let ours = importance_of(&mesh.topology, &steps, denominator);
        let expected = naive_importance(&mesh.topology, &steps, share);
        // A mean of seven numbers up to 3 is off by some of their rounding, 7 * 3 * 2^-53, which counts as much as the mean is
        // small; those here are above 1e-6. A coefficient is rounded to f32, and so is the sum of three.
        let bound = |x: f64| x * (2.0 * f64::from(f32::EPSILON) + 7.0 * 3.0 * f64::EPSILON / 1e-6);
        for (a, b) in ours.iter().zip(&expected) {
            assert!((f64::from(*a) - b).abs() <= bound(*b), "{a} instead of {b}");
        }
        // Without the last step the result differs.
        let fewer = importance_of(&mesh.topology, &steps[..6], denominator);
        assert!(fewer.iter().zip(&expected).any(|(a, b)| (f64::from(*a) - b).abs() > bound(*b)));
    }
}

#[test]
fn the_ranking_descends_by_importance_and_is_random_among_equals() {
    let mesh = mesh([6, 5, 4]);
    let topology = &mesh.topology;
    // Few distinct values: many ties.
    let mut importance: Vec<f32> =
        noise(topology.connectivity().faces.len(), 1).iter().map(|x| (3.0 * x).round()).collect();
    (importance[3], importance[4], importance[5]) = (f32::NAN, f32::INFINITY, -0.0);
    let ranking = Ranking::by_importance(topology, &importance);
    assert_is_of_all_interior_faces(&ranking, topology);
    let number = |face: u32| if importance[face as usize].is_nan() { 0.0 } else { importance[face as usize] };
    let mut expected = interior(topology);
    expected.sort_by(|&a, &b| number(b).partial_cmp(&number(a)).unwrap().then(hash(a).cmp(&hash(b))));
    assert_eq!(ranking.ids(), expected);
    importance[expected[0] as usize] = -9.0;
    assert_ne!(Ranking::by_importance(topology, &importance).ids(), expected, "the comparison notices one number");
}

#[test]
fn where_nothing_changes_every_part_of_the_mesh_has_its_share_of_the_first_faces() {
    let mesh = mesh([12, 12, 12]);
    let topology = &mesh.topology;
    let ranking = Ranking::by_importance(topology, &vec![0.0; topology.connectivity().faces.len()]);
    let taken = &ranking.ids()[..ranking.ids().len() / 10];
    // Along the curve, in ten parts of equally many faces.
    let part = |face: u32| face as usize * 10 / topology.connectivity().faces.len();
    let mut counts = [0_f64; 10];
    taken.iter().for_each(|&face| counts[part(face)] += 1.0);
    let mut sizes = [0_f64; 10];
    interior(topology).iter().for_each(|&face| sizes[part(face)] += 1.0);
    for (count, size) in counts.iter().zip(sizes) {
        let expected = 0.1 * size;
        // A binomial share of a tenth: five standard deviations.
        assert!((count - expected).abs() < 5.0 * (0.9 * expected).sqrt(), "{counts:?} of {sizes:?}");
    }
    // In id order, they would all be in one part.
    assert!(interior(topology)[..taken.len()].iter().all(|&face| part(face) <= 1));
}

#[test]
fn the_hash_has_another_number_for_each_face() {
    let mut numbers: Vec<u32> = (0..100_000).map(hash).collect();
    numbers.sort_unstable();
    numbers.dedup();
    assert_eq!(numbers.len(), 100_000);
}

/// Oracle: the bins give their next face in turn.
fn naive_strata(topology: &Topology, scalars: &[f32]) -> Vec<u32> {
    let mean = |face: usize| {
        topology.connectivity().faces[face].iter().map(|&v| f64::from(scalars[v as usize])).sum::<f64>() / 3.0
    };
    let finite: Vec<f64> = (0..topology.connectivity().faces.len()).map(mean).filter(|m| m.is_finite()).collect();
    let lo = finite.iter().copied().fold(f64::INFINITY, f64::min);
    let hi = finite.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut bins = vec![Vec::new(); 257];
    let mut faces = interior(topology);
    faces.sort_by_key(|&face| hash(face));
    for face in faces.into_iter().rev() {
        let mean = mean(face as usize);
        let bin = ((mean - lo) / (hi - lo) * 256.0) as usize;
        bins[if mean.is_finite() { bin.min(255) } else { 256 }].push(face);
    }
    let mut order: Vec<u32> = (0..256).collect();
    order.sort_by_key(|&bin| hash(bin));
    let mut out = Vec::new();
    while bins[..256].iter().any(|bin| !bin.is_empty()) {
        out.extend(order.iter().filter_map(|&bin| bins[bin as usize].pop()));
    }
    out.extend(bins[256].iter().rev());
    out
}

#[test]
fn strata_give_one_face_each_in_turn() {
    let mesh = mesh([6, 5, 4]);
    let topology = &mesh.topology;
    let mut scalars = noise(vertices(topology), 3);
    scalars.iter_mut().for_each(|s| *s = s.powi(5));
    let check = |scalars: &[f32]| {
        let ranking = Ranking::by_strata(topology, scalars);
        assert_is_of_all_interior_faces(&ranking, topology);
        assert_eq!(ranking.ids(), naive_strata(topology, scalars));
        ranking
    };
    let ranking = check(&scalars);
    let mut holes = scalars.clone();
    (holes[17], holes[40]) = (f32::NAN, f32::INFINITY);
    let with_holes = check(&holes);
    let is_hole = |face: &u32| topology.connectivity().faces[*face as usize].iter().any(|v| [17, 40].contains(v));
    let first = with_holes.ids().iter().position(is_hole).unwrap();
    assert!(with_holes.ids()[first..].iter().all(is_hole), "faces of holes are the last");
    assert_ne!(with_holes, ranking);
    // Constants, zeros of both signs, all holes and the widest range are handled.
    for value in [0.0, -7.5, f32::NAN, f32::MAX] {
        check(&vec![value; scalars.len()]);
    }
    check(&scalars.iter().map(|s| if *s < 0.0 { f32::MIN } else { f32::MAX }).collect::<Vec<_>>());
}

#[test]
fn every_value_that_occurs_is_among_the_first_faces() {
    let mesh = mesh([12, 12, 12]);
    let topology = &mesh.topology;
    // Nearly all vertices have one value; one in 500 has another one.
    let rare: Vec<f32> = (0..vertices(topology)).map(|v| if v % 500 == 250 { 1.0 } else { 0.0 }).collect();
    let values = |ranking: &Ranking, count: usize| {
        let value = |face: &u32| {
            topology.connectivity().faces[*face as usize].iter().map(|&v| rare[v as usize]).sum::<f32>() as u32
        };
        let mut values: Vec<u32> = ranking.ids()[..count].iter().map(value).collect();
        values.sort_unstable();
        values.dedup();
        values
    };
    assert_eq!(values(&Ranking::by_strata(topology, &rare), 2), [0, 1], "two faces, both values");
    assert_eq!(values(&Ranking::by_hash(topology), 2), [0], "without strata the rare one is missed");
}

#[test]
fn rankings_and_selections_are_the_same_with_any_number_of_threads() {
    let mesh = Arc::new(mesh([14, 14, 14]));
    let topology = &mesh.topology;
    let scalars = noise(vertices(topology), 5);
    let active = CellSet::of(topology.tets.len(), |cell| cell % 7 != 0);
    let run = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let strata = Ranking::by_strata(topology, &scalars);
            let global = Ranking::by_importance(topology, &importance(topology, &scalars));
            let drawn = select(topology, &global, 0.3, &active);
            (strata, global, drawn)
        })
    };
    let one = run(1);
    assert!(one.0 != one.1, "rankings can differ");
    assert!((2..=4).all(|threads| run(threads) == one));
}

#[test]
fn lists_change_by_the_share_of_faces_that_are_others() {
    let ranking = |faces: &[u32]| Ranking { ids: faces.to_vec(), universe: 9 };
    let (a, b) = (ranking(&[1, 2, 3, 4, 5, 6]), ranking(&[6, 3, 2, 1, 5, 4]));
    assert_eq!(list_change(&a, &b, 0.5), 1.0 / 3.0);
    assert_eq!(list_change(&a, &b, 1.0 / 6.0), 1.0);
    assert_eq!((list_change(&a, &b, 1.0), list_change(&a, &a, 0.5), list_change(&a, &b, 0.0)), (0.0, 0.0, 0.0));
}

// Selection

/// Oracle: face by face; a set of ids.
fn naive_selection(topology: &Topology, ranking: &Ranking, fraction: f64, active: &CellSet) -> (Vec<u32>, bool) {
    let is_active = |cell: u32| cell != NONE && active.contains(cell);
    let sides =
        |face: u32| topology.connectivity().face_cells[face as usize].map(is_active).iter().filter(|&&a| a).count();
    let inner: Vec<u32> = ranking.ids().iter().copied().filter(|&face| sides(face) == 2).collect();
    let count = (fraction * inner.len() as f64).round() as usize;
    let mut drawn = inner[..count].to_vec();
    drawn.extend((0..topology.connectivity().faces.len() as u32).filter(|&face| sides(face) == 1));
    drawn.sort_unstable();
    (drawn, count == inner.len())
}

fn ids(selection: &Selection) -> Vec<u32> {
    (0..selection.ids.universe() as u32).filter(|&face| selection.ids.contains(face)).collect()
}

proptest! {
    #[test]
    fn a_level_has_its_share_of_the_inner_faces_and_the_whole_surface(
        fractions in prop::collection::vec(0.0..=1.0_f64, 3), seed: u64, kept in 0_u64..=8,
    ) {
        let mesh = Arc::new(mesh([4, 4, 3]));
        let topology = &mesh.topology;
        let ranking = Arc::new(Ranking::by_strata(topology, &noise(vertices(topology), seed)));
        let mut random = test_meshes::Random::new(seed);
        let bits: Vec<bool> = topology.tets.iter().map(|_| random.next() % 8 < kept).collect();
        let active = Arc::new(CellSet::of(bits.len(), |cell| bits[cell]));
        let mut selector = Selector::default();
        for fraction in fractions.into_iter().chain([0.0, 1.0]) {
            let (expected, is_complete) = naive_selection(topology, &ranking, fraction, &active);
            let once = select(topology, &ranking, fraction, &active);
            prop_assert_eq!(&ids(&once), &expected);
            prop_assert_eq!(once.is_complete, is_complete);
            prop_assert_eq!(once.ids.count(), expected.len());
            prop_assert_eq!(&*selector.select(&mesh, &ranking, fraction, &active), &once);
        }
        // A single differing cell is detected.
        let mut other = (*active).clone();
        other.set(3, !bits[3]);
        prop_assert_ne!(
            naive_selection(topology, &ranking, 1.0, &other).0,
            ids(&selector.select(&mesh, &ranking, 1.0, &active))
        );
        let other = Arc::new(other);
        prop_assert_eq!(
            naive_selection(topology, &ranking, 1.0, &other).0,
            ids(&selector.select(&mesh, &ranking, 1.0, &other))
        );
    }
}

#[test]
fn what_has_not_changed_is_not_selected_again() {
    let mesh = Arc::new(mesh([3, 3, 3]));
    let ranking = Arc::new(Ranking::by_hash(&mesh.topology));
    let all = Arc::new(CellSet::all(mesh.topology.tets.len()));
    let mut selector = Selector::default();
    let first = selector.select(&mesh, &ranking, 0.5, &all);
    let same = selector.select(&mesh, &ranking, 0.5, &Arc::new((*all).clone()));
    assert!(Arc::ptr_eq(&first, &same));
    let other = selector.select(&mesh, &Arc::new((*ranking).clone()), 0.5, &all);
    assert!(!Arc::ptr_eq(&first, &other) && first == other);
    assert_ne!(selector.select(&mesh, &ranking, 0.4, &all), first);
}

#[test]
fn a_mesh_without_inner_faces_is_drawn_whole_at_any_level() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let (mesh, _) = Mesh::build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }).unwrap();
    let topology = &mesh.topology;
    for ranking in [
        Ranking::by_hash(topology),
        Ranking::by_importance(topology, &[1.0; 4]),
        Ranking::by_strata(topology, &[f32::NAN; 4]),
    ] {
        assert!(ranking.ids().is_empty());
        for fraction in [0.0, 0.3, 1.0, f64::NAN, -1.0, 7.0] {
            let drawn = select(topology, &ranking, fraction, &CellSet::all(1));
            assert_eq!((ids(&drawn), drawn.is_complete), (vec![0, 1, 2, 3], true));
            assert_eq!(select(topology, &ranking, fraction, &CellSet::none(1)).ids.count(), 0);
        }
        assert_eq!(list_change(&ranking, &ranking, 0.5), 0.0);
    }
}

// Intervals

#[test]
fn intervals_cover_every_step_once_and_sample_one_of_their_own() {
    let changes: Vec<f64> = noise(400, 9).iter().map(|&x| f64::from(x).powi(4)).collect();
    for steps in [1, 2, 5, 6, 7, 64, 150, 360] {
        for count in [0, 1, 3, 6, 400] {
            for partition in [Partition::Regular(count), Partition::Logarithmic(count), Partition::Greedy(count)] {
                let intervals = partition.intervals(steps, &changes);
                assert_eq!(intervals.len(), count.clamp(1, steps), "{partition:?} of {steps}");
                assert_eq!((intervals[0].first, intervals[intervals.len() - 1].end), (0, steps));
                assert!(intervals.windows(2).all(|pair| pair[0].end == pair[1].first));
                assert!(intervals.iter().all(|i| (i.first..i.end).contains(&i.sampled)), "{intervals:?}");
                for step in 0..steps {
                    let of = interval_at(&intervals, step).unwrap();
                    assert!((of.first..of.end).contains(&step));
                }
                assert_eq!(interval_at(&intervals, steps + 3), intervals.last());
            }
        }
    }
    assert!(Partition::default().intervals(0, &[]).is_empty() && interval_at(&[], 0).is_none());
}

fn lengths(partition: Partition, steps: usize, changes: &[f64]) -> Vec<usize> {
    partition.intervals(steps, changes).iter().map(|i| i.end - i.first).collect()
}

#[test]
fn regular_intervals_are_equally_long_and_logarithmic_ones_grow() {
    assert_eq!(lengths(Partition::Regular(6), 360, &[]), [60; 6]);
    assert_eq!(lengths(Partition::Regular(4), 10, &[]), [2, 3, 2, 3]);
    // Ends at (2^i - 1) / 63 of 630 steps.
    assert_eq!(lengths(Partition::Logarithmic(6), 630, &[]), [10, 20, 40, 80, 160, 320]);
}

#[test]
fn greedy_intervals_are_short_where_much_changes() {
    // All change is in steps 100 to 107, equal in each.
    let changes: Vec<f64> = (0..200).map(|step| if (100..108).contains(&step) { 2.0 } else { 0.0 }).collect();
    let ends: Vec<usize> = Partition::Greedy(4).intervals(200, &changes).iter().map(|i| i.end).collect();
    // Step 104 is the first beyond half of it; then a quarter each.
    assert_eq!(ends, [102, 104, 106, 200].map(|end: usize| if end == 200 { 200 } else { end }));
    // NaN changes count as 0; then the longest interval is halved.
    assert_eq!(lengths(Partition::Greedy(4), 16, &[f64::NAN; 16]), [4; 4]);
    assert_eq!(lengths(Partition::Greedy(2), 9, &[]), [4, 5]);
}

#[test]
fn the_change_of_a_step_is_the_mean_square_over_finite_values() {
    assert_eq!(step_change(&[1.0, 2.0, f32::NAN, 0.0], &[3.0, 2.0, 1.0, f32::INFINITY]), 2.0);
    assert_eq!(step_change(&[f32::NAN], &[1.0]), 0.0);
    assert_eq!(step_change(&[], &[]), 0.0);
}
