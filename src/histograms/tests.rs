//! Histograms of series against counting one sample after the other, and invariants.

use super::*;
use crate::field::Association;
use crate::mesh::RawMesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
use crate::moments::{AxisScale, CovDenominator, Moments};
use std::convert::Infallible;

/// A series in memory.
struct Steps {
    mesh: Mesh,
    scalars: Vec<Vec<f32>>,
    cov: Vec<f32>,
    range: Option<[f32; 2]>,
}

impl Steps {
    fn new(mesh: Mesh, scalars: Vec<Vec<f32>>) -> Self {
        let mut moments = Moments::new(mesh.vertex_source.len());
        scalars.iter().for_each(|step| _ = moments.add_step(step));
        let range = moments.series().range;
        let cov = moments.vertex_statistics().coefficient_of_variation(range, CovDenominator::default());
        Self { mesh, scalars, cov: cov.into_iter().map(|c| c as f32).collect(), range }
    }

    /// Noise over a grid of `n` cubes along each axis, with some holes.
    fn noise(n: usize, steps: usize) -> Self {
        let mut random = Random::new(8);
        let mesh = Mesh::build(jittered(kuhn_grid([n, n, n]), &mut random)).unwrap().0;
        let mut step = |t: usize| {
            let mut values: Vec<f32> =
                mesh.vertex_source.iter().map(|_| (random.signed() * (1 + t) as f64) as f32).collect();
            values[(7 * t) % mesh.vertex_source.len()] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][t % 3];
            values
        };
        let scalars = (0..steps).map(&mut step).collect();
        Self::new(mesh, scalars)
    }

    fn view(&self, step: usize) -> StepView<'_> {
        let scalars = &self.scalars[step];
        StepView { mesh: &self.mesh, values_of: Association::Point, scalars, at_vertices: scalars, cov: &self.cov }
    }

    fn series(&self) -> SeriesView<'_> {
        SeriesView { mesh: &self.mesh, values_of: Association::Point, scalar_range: self.range, cov: &self.cov }
    }

    fn count(&self, kinds: &[Kind<'_>]) -> Vec<Histogram> {
        let read = |step: usize, out: &mut [f32]| {
            out.copy_from_slice(&self.scalars[step]);
            Ok::<_, Infallible>(true)
        };
        of_series(kinds, &self.series(), self.scalars.len(), read).unwrap().unwrap()
    }
}

/// The samples of all steps of one of [`Kind::ALL`], as the table in the module's documentation says.
fn samples(series: &Steps, kind: usize) -> Vec<Vec<f32>> {
    let tets = &series.mesh.topology.tets;
    let mean = |s: &[f32], tet: &[u32; 4]| (tet.iter().map(|&v| f64::from(s[v as usize])).sum::<f64>() / 4.0) as f32;
    let of_step = |s: &Vec<f32>| -> Vec<Vec<f32>> {
        match kind {
            0 => s.iter().map(|&v| vec![v]).collect(),
            1 => (0..tets.len()).map(|c| vec![mean(s, &tets[c]), series.mesh.gradient_magnitude(c, s)]).collect(),
            2 => series.cov.iter().map(|&c| vec![c]).collect(),
            _ => s.iter().zip(&series.cov).map(|(&v, &c)| vec![v, c]).collect(),
        }
    };
    series.scalars[..if kind == 2 { 1 } else { series.scalars.len() }].iter().flat_map(of_step).collect()
}

/// Counts one sample after the other, in the first bin whose upper edge is above it.
fn naive(series: &Steps, kind: usize) -> (Vec<u64>, u64) {
    let samples = samples(series, kind);
    let [scalar, octaves] = [AxisScale::Linear, AxisScale::Octaves];
    let top = |i: usize| samples.iter().map(|s| s[i]).filter(|v| v.is_finite()).fold(0.0, f32::max);
    let bins = match kind {
        0 => vec![Bins::new(series.range, scalar, 256)],
        1 | 3 => vec![Bins::new(series.range, scalar, 256), Bins::new(Some([0.0, top(1)]), octaves, 64)],
        _ => vec![Bins::new(Some([0.0, top(0)]), octaves, 256)],
    };
    let mut counts = vec![0; bins.iter().map(Bins::count).product()];
    let mut nonfinite = 0;
    for sample in samples {
        if sample.iter().any(|v| !v.is_finite()) {
            nonfinite += 1;
            continue;
        }
        let find = |(bins, &v): (&Bins, &f32)| {
            let is_below = |&bin: &usize| f64::from(v) < bins.bounds(bin).unwrap()[1];
            (0..bins.count()).find(is_below).unwrap_or(bins.count() - 1)
        };
        let at: Vec<usize> = bins.iter().zip(&sample).map(find).collect();
        counts[at[0] + 256 * at.get(1).unwrap_or(&0)] += 1;
    }
    (counts, nonfinite)
}

#[test]
fn the_counts_of_a_series_are_those_of_one_sample_after_the_other() {
    let series = Steps::noise(5, 4);
    for (i, found) in series.count(&Kind::ALL).iter().enumerate() {
        let (counts, nonfinite) = naive(&series, i);
        assert_eq!((found.counts(), found.nonfinite()), (&counts[..], nonfinite), "{}", Kind::ALL[i].name());
        assert_eq!(counts.iter().sum::<u64>() + nonfinite, samples(&series, i).len() as u64);
        assert!(i == 2 || nonfinite > 0, "there are holes");
    }
    // One value of one step moved by a bin: the test can fail.
    let mut other = Steps::noise(5, 4);
    let [lo, hi] = other.range.unwrap();
    let finite = other.scalars[1].iter().position(|v| v.abs() < 0.5).unwrap();
    other.scalars[1][finite] += (hi - lo) / 256.0;
    other.cov[finite] *= 2.0;
    for (i, found) in other.count(&Kind::ALL).iter().enumerate() {
        assert_ne!(found.counts(), naive(&series, i).0, "{}", Kind::ALL[i].name());
    }
}

#[test]
fn any_number_of_threads_counts_the_same() {
    let series = Steps::noise(28, 2);
    assert!(series.mesh.topology.tets.len() > LEAST_SAMPLES, "more than one task");
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| series.count(&Kind::ALL))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn the_steps_together_are_the_series() {
    let series = Steps::noise(4, 5);
    for (kind, whole) in Kind::ALL.iter().zip(series.count(&Kind::ALL)) {
        let steps = if kind.changes() { 5 } else { 1 };
        let mut merged = kind.empty(whole.ranges());
        (0..steps).for_each(|step| merged.merge(&kind.of_step(whole.ranges(), &series.view(step))));
        assert_eq!(merged, whole, "{}", kind.name());
        assert_ne!(kind.of_step(whole.ranges(), &series.view(0)).counts().iter().sum::<u64>(), 0);
    }
}

#[test]
fn ranges_are_those_of_all_steps_and_octaves_begin_at_zero() {
    let series = Steps::noise(4, 3);
    let histograms = series.count(&Kind::ALL);
    let gradients = samples(&series, 1).into_iter().map(|s| s[1]).filter(|g| g.is_finite());
    let steepest = gradients.fold(0.0, f32::max);
    let most = series.cov.iter().copied().fold(0.0, f32::max);
    let [scalar, gradient, cov] = [series.range, Some([0.0, steepest]), Some([0.0, most])];
    let ranges: Vec<Ranges> = histograms.iter().map(Histogram::ranges).collect();
    assert_eq!(ranges, [[scalar, None], [scalar, gradient], [cov, None], [scalar, cov]]);
    assert!(steepest > 0.0 && most > 0.0);
    let two = histograms[1].two().unwrap();
    assert_eq!((two.x().count(), two.y().count(), two.y().scale()), (256, 64, AxisScale::Octaves));
    assert!(histograms[0].one().is_some() && histograms[0].two().is_none() && histograms[1].one().is_none());
}

fn flat(value: f32, steps: usize) -> Steps {
    let mesh = Mesh::build(kuhn_grid([2, 2, 2])).unwrap().0;
    Steps::new(mesh, vec![vec![value; 27]; steps])
}

#[test]
fn a_constant_series_has_one_bin_in_every_histogram() {
    for value in [0.0, 2.5, -1e30] {
        let histograms = flat(value, 3).count(&Kind::ALL);
        let firsts: Vec<u64> = histograms.iter().map(|h| h.counts()[0]).collect();
        assert_eq!(firsts, [81, 144, 27, 81], "{value}");
        assert!(histograms.iter().all(|h| h.counts()[1..].iter().all(|&c| c == 0) && h.nonfinite() == 0));
        assert_eq!(histograms[1].ranges(), [Some([value; 2]), Some([0.0; 2])]);
    }
}

#[test]
fn one_step_varies_nowhere() {
    let series = Steps::noise(3, 1);
    let histograms = series.count(&Kind::ALL);
    assert_eq!((histograms[2].counts()[0], histograms[2].ranges()[0]), (64, Some([0.0, 0.0])));
    assert_eq!(histograms[3].counts()[..256], *histograms[0].counts());
}

#[test]
fn holes_everywhere_are_counted_and_nothing_else() {
    let histograms = flat(f32::NAN, 2).count(&Kind::ALL);
    let nonfinite: Vec<u64> = histograms.iter().map(Histogram::nonfinite).collect();
    // A vertex without a finite value does not vary: that is how its coefficient is defined.
    assert_eq!(nonfinite, [54, 96, 0, 54]);
    assert!(histograms[1].counts().iter().all(|&c| c == 0) && histograms[1].ranges() == [None, None]);
}

#[test]
fn a_mirrored_series_has_mirrored_counts_over_a_symmetric_range() {
    let mut series = Steps::noise(4, 2);
    series.range = Some([-2.0, 2.0]);
    // No value of this noise is on an edge: those are multiples of 2^-6.
    let mut mirrored = Steps::noise(4, 2);
    mirrored.range = series.range;
    mirrored.scalars.iter_mut().flatten().for_each(|v| *v = -*v);
    let on_edge = |v: f32| (v * 64.0).fract() == 0.0 && v.is_finite();
    assert!(![0, 1, 3].into_iter().flat_map(|i| samples(&series, i)).any(|s| on_edge(s[0])));
    let [ours, theirs] = [&series, &mirrored].map(|series| series.count(&Kind::ALL));
    for i in [0, 1, 3] {
        let turned: Vec<u64> = theirs[i].counts().chunks(256).flat_map(|row| row.iter().rev()).copied().collect();
        assert_eq!(ours[i].counts(), turned);
        assert_ne!(ours[i].counts(), theirs[i].counts(), "the test can fail");
    }
}

#[test]
fn who_asks_to_stop_gets_none_and_an_error_is_passed_on() {
    let series = Steps::noise(2, 3);
    let run = |stop_after: usize, fails: bool| {
        let mut reads = 0;
        of_series(&Kind::ALL, &series.series(), 3, |_, _| {
            reads += 1;
            if reads > stop_after && fails { Err("damaged") } else { Ok(reads <= stop_after) }
        })
    };
    for stop_after in 0..3 {
        assert_eq!(run(stop_after, false), Ok(None));
        assert_eq!(run(stop_after, true), Err("damaged"));
    }
    assert!(run(3, true).unwrap().is_some(), "each step is read once");
}

/// Counts in another order, with a break after `pause` steps, an error and a cancelled step.
fn in_parts(series: &Steps, order: &[usize], pause: usize) -> Counted {
    let view = series.series();
    let mut counted = Counted::none(&Kind::ALL, &Kind::ALL.map(|kind| view.known_ranges(&kind)), order.len());
    let read = |step: usize, out: &mut [f32]| {
        out.copy_from_slice(&series.scalars[step]);
        Ok::<_, &str>(true)
    };
    let first = counted.go_on(&Kind::ALL, &view, order, read, |counted| counted.steps < pause);
    assert_eq!((first, counted.steps), (Ok(pause == order.len()), pause));
    if pause < order.len() {
        assert_eq!(counted.go_on(&Kind::ALL, &view, order, |_, _| Err("damaged"), |_| true), Err("damaged"));
        assert_eq!(counted.go_on(&Kind::ALL, &view, order, |_, _| Ok::<_, &str>(false), |_| true), Ok(false));
    }
    assert_eq!(counted.go_on(&Kind::ALL, &view, order, read, |_| true), Ok(true));
    counted
}

#[test]
fn any_order_with_breaks_counts_the_same() {
    let series = Steps::noise(5, 9);
    let whole = series.count(&Kind::ALL);
    let steepest = |counted: &[Histogram]| counted[1].ranges()[1].unwrap()[1];
    // The noise grows: octaves are widened at each step from the first on, and never from the last on.
    for order in [spread(9, 1, 9), (0..9).collect(), (0..9).rev().collect()] {
        for pause in [1, 3, 9] {
            let counted = in_parts(&series, &order, pause);
            assert_eq!((counted.steps, counted.of, &counted.histograms[..]), (9, 9, &whole[..]), "{order:?}");
        }
    }
    let mut sample = Counted::none(&Kind::ALL, &Kind::ALL.map(|kind| series.series().known_ranges(&kind)), 9);
    sample.add(&Kind::ALL, &series.view(0));
    assert!(steepest(&sample.histograms) < steepest(&whole), "the test can fail");
    assert!(!sample.is_whole() && sample.histograms[2] == whole[2], "what does not change is there at once");
    assert_eq!(sample.histograms[0].ranges(), whole[0].ranges());
    assert_eq!(sample.of_kind(&Kind::SCALAR_COV), Some(&sample.histograms[3]));
}

#[test]
fn what_needs_no_coefficients_of_variation_is_counted_without() {
    let series = Steps::noise(3, 3);
    let without = SeriesView { cov: &[], ..series.series() };
    let read = |step: usize, out: &mut [f32]| {
        out.copy_from_slice(&series.scalars[step]);
        Ok::<_, Infallible>(true)
    };
    let kinds = [Kind::SCALAR, Kind::SCALAR_GRADIENT];
    assert_eq!(of_series(&kinds, &without, 3, read).unwrap().unwrap(), series.count(&Kind::ALL)[..2]);
    assert_eq!(Kind::ALL.map(|kind| kind.needs_cov()), [false, false, true, true]);
}

#[test]
fn a_step_has_the_bins_of_the_series_or_wider_ones() {
    let series = Steps::noise(4, 3);
    let whole = series.count(&Kind::ALL);
    for (kind, all) in Kind::ALL.iter().zip(&whole) {
        let known = kind.of_step_widened(all.ranges(), &series.view(2));
        assert_eq!(known, kind.of_step(all.ranges(), &series.view(2)));
        let alone = kind.of_step_widened(series.series().known_ranges(kind), &series.view(2));
        // The last step has the greatest values of all.
        assert_eq!(alone, known, "{}", kind.name());
    }
}

/// An axis defined only here: the height of a vertex.
struct Height;

impl Axis for Height {
    fn name(&self) -> &str {
        "height"
    }

    fn unit(&self, _scalar: &str) -> String {
        "length".to_owned()
    }

    fn place(&self) -> Place {
        Place::Scalars
    }

    fn value(&self, step: &StepView<'_>, index: usize) -> f32 {
        step.mesh.positions.world(index).z as f32
    }

    fn changes(&self) -> bool {
        false
    }
}

#[test]
fn another_kind_needs_no_more_than_its_axis() {
    // A column of two cubes: heights 0, 1, 2 of four vertices each, and a scalar that is a tenth of the height.
    let raw: RawMesh = kuhn_grid([1, 1, 2]);
    let mesh = Mesh::build(raw).unwrap().0;
    let scalars: Vec<f32> = (0..12).map(|v| 0.1 * mesh.positions.world(v).z as f32).collect();
    let series = Steps::new(mesh, vec![scalars; 5]);
    let kinds = [
        Kind { x: &Height, y: None },
        Kind { x: &Scalar, y: Some(&Height) },
        Kind { x: &Height, y: Some(&GradientMagnitude) },
    ];
    let found = series.count(&kinds);
    assert_eq!(kinds.map(|k| k.name()), ["height", "scalar_height", "height_gradient"]);
    assert_eq!(kinds.map(|k| k.axes().last().unwrap().unit("K")), ["length", "length", "K per length"]);
    let filled = |i: usize| -> Vec<(usize, u64)> {
        found[i].counts().iter().copied().enumerate().filter(|&(_, count)| count > 0).collect()
    };
    assert_eq!(filled(0), [(0, 4), (128, 4), (255, 4)], "once for all steps");
    assert_eq!(filled(1).iter().map(|&(bin, _)| bin / 256).collect::<Vec<_>>(), [0, 32, 63]);
    assert_eq!(filled(1).iter().map(|&(_, count)| count).collect::<Vec<_>>(), [20, 20, 20], "five steps");
    // At cells: the mean of the heights of four corners, k quarters above the floor of either cube.
    assert_eq!(found[2].ranges()[0], Some([0.25, 1.75]));
    assert_eq!(found[2].counts().iter().sum::<u64>(), 5 * 12);
}
