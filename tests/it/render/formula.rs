//! Every exact path against the formula of the transfer function, which knows no table.

use super::havs::{havs, with_all_faces};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use proptest::prelude::*;
use tetreel::transfer::{
    BlendedEnsembles, ColorWeighting, Ensemble, Function, Lengths, MappedRange, Member, OpacityKind, RangeMap,
    RangePolicy, TransferContent, TransferFunction, TransferSource, build_node_table,
};

/// A pixel whose formula changes by more when all scalars move by 4 units in the last place is decided by rounding.
const SENSITIVE: f64 = 1e-3;

/// The job of a source: its table, and what that was made from.
pub fn job_of(
    mesh: &Arc<Mesh>,
    scalars: Vec<f32>,
    camera: &Camera,
    size: (usize, usize),
    source: TransferSource,
) -> RenderJob {
    let table = match &source.content {
        TransferContent::Function { function, range } => {
            build_node_table(function, range, source.kind, &source.lengths).unwrap()
        }
        TransferContent::Ensembles(blended) => {
            let BlendedEnsembles { ensemble, series, step, .. } = &**blended;
            let context = tetreel::transfer::Context::new(*series, *step, source.kind, source.lengths);
            ensemble.curve(&context).unwrap().node_table(&source.lengths).unwrap()
        }
    };
    RenderJob { formula: Some(Arc::new(source)), ..job(mesh, scalars, camera, size, table) }
}

fn diagonal(mesh: &Mesh) -> f64 {
    let (lo, hi) = mesh.positions.world_bounds();
    (hi - lo).length()
}

/// All scalars, 4 units in the last place away.
fn moved(job: &RenderJob, up: bool) -> RenderJob {
    let next = |s: &f32| (0..4).fold(*s, |s, _| if up { s.next_up() } else { s.next_down() });
    RenderJob { scalars: Arc::new(job.scalars.values().iter().map(next).collect::<Vec<_>>()).into(), ..job.clone() }
}

/// What all images of a test came to.
#[derive(Debug, Default)]
struct Worst {
    rmse: f64,
    max: f64,
    of_table: f64,
    pixels: usize,
    sensitive: usize,
    seen: f32,
}

impl Worst {
    /// Compares the exact paths of the CPU, and of the GPU where there is one, with the formula.
    fn compare(&mut self, name: &str, job: &RenderJob) {
        let judge = reference(job);
        let others = [false, true].map(|up| reference(&moved(job, up)));
        let is_sensitive = |pixel: usize| {
            let off = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).any(|(a, b)| f64::from((a - b).abs()) > SENSITIVE);
            others.iter().any(|other| off(&judge.pixels[pixel], &other.pixels[pixel]))
        };
        let kept: Vec<usize> = (0..judge.pixels.len()).filter(|&pixel| !is_sensitive(pixel)).collect();
        let only = |image: &RgbaImage| RgbaImage {
            width: kept.len(),
            height: 1,
            pixels: kept.iter().map(|&pixel| image.pixels[pixel]).collect(),
        };
        self.pixels += judge.pixels.len();
        self.sensitive += judge.pixels.len() - kept.len();
        self.seen = judge.pixels.iter().fold(self.seen, |most, pixel| most.max(pixel[3]));
        let truth = only(&judge);
        if kept.is_empty() {
            return;
        }
        let paths = [("rays", raycast(job)), ("faces", havs(&with_all_faces(job)).planes.color)];
        #[cfg(feature = "gpu")]
        let on_gpu = gpu::render(job).map(|frame| ("rays on the GPU", frame.planes.color));
        #[cfg(not(feature = "gpu"))]
        let on_gpu = None;
        for (path, image) in paths.into_iter().chain(on_gpu) {
            let image = only(&image);
            assert_within(&format!("{name}, {path}"), &image, &truth);
            let (rmse, max) = difference(&image, &truth);
            (self.rmse, self.max) = (self.rmse.max(rmse), self.max.max(max));
        }
        let table = reference(&RenderJob { formula: None, ..job.clone() });
        self.of_table = self.of_table.max(difference(&only(&table), &truth).1);
    }
}

fn unit_range() -> MappedRange {
    MappedRange::new(0.0, 1.0, false).unwrap()
}

pub fn function(text: &str, range: MappedRange, kind: OpacityKind, lengths: Lengths) -> TransferSource {
    let function = TransferFunction::parse(text).unwrap();
    TransferSource { content: TransferContent::Function { function, range }, kind, lengths }
}

/// A field over 0..=1 on a mesh of [-1, 1]^3.
pub fn field(n: usize) -> (Arc<Mesh>, Vec<f32>) {
    let mesh = Arc::new(build(grid(n, 0.16, 3, |_| true)));
    let scalars = sample(&mesh, |p| (0.5 + 0.36 * wave(p)).clamp(0.0, 1.0));
    (mesh, scalars)
}

/// Transfer functions that were drawn wrongly by up to 400 times the bound while a table could be off by 2^-12 of each unit distance,
/// and unit distances as parts of the diagonal.
const THIN: [(&str, f64); 5] = [
    ("viridis@0:0,1:0.15", 0.01),
    ("viridis@0:0,0.5:0.02,0.7:0.3,1:0.6", 0.01),
    ("viridis@0:0,0.1:0.002,0.2:0.0021,0.4:0.05,1:0.05", 0.001),
    ("viridis@0:0,0.5:0.00002,1:0.0004", 0.0001),
    ("cool-to-warm@0:0.1,0.45:0,0.55:0,1:0.1", 0.1),
];

#[test]
fn long_paths_through_little_opacity_are_as_the_formula_has_them() {
    let (mesh, scalars) = field(6);
    let mut worst = Worst::default();
    for (text, share) in THIN {
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            for eye in [DVec3::new(4.0, 3.0, 3.5), DVec3::splat(0.1)] {
                let camera = camera(eye, Projection::Perspective { view_angle: 40.0 });
                let source = function(text, unit_range(), kind, Lengths::new(share * diagonal(&mesh), diagonal(&mesh)));
                worst.compare(text, &job_of(&mesh, scalars.clone(), &camera, (33, 31), source));
            }
        }
    }
    eprintln!("formula, thin: {worst:?}");
    assert!(worst.seen > 0.5);
}

#[test]
fn the_judge_is_finite_where_a_ramp_touches_opacity_1() {
    let (mesh, scalars) = field(6);
    let camera = camera(DVec3::new(4.0, 3.0, 3.5), Projection::Perspective { view_angle: 40.0 });
    let lengths = Lengths::of_diagonal(diagonal(&mesh));
    for spread in [1.0, 1e-3, 1e-6] {
        let scalars = scalars.iter().map(|s| 0.5 + spread * (s - 0.5)).collect();
        let source = function("turbo@0:0.9,0.5:1,1:0.99", unit_range(), OpacityKind::Alpha, lengths);
        let image = reference(&job_of(&mesh, scalars, &camera, (33, 31), source));
        assert!(image.pixels.iter().flatten().all(|c| (0.0..=1.0 + 1e-6).contains(c)), "{spread}");
    }
}

#[test]
fn a_table_for_one_unit_distance_alone_is_noticed() {
    // As it was: within its tolerance of a path of one unit distance.
    let (mesh, scalars) = field(6);
    let camera = camera(DVec3::new(4.0, 3.0, 3.5), Projection::Perspective { view_angle: 40.0 });
    let unit = 1e-4 * diagonal(&mesh);
    let right = function(
        "viridis@0:0,0.5:0.00002,1:0.0004",
        unit_range(),
        OpacityKind::Alpha,
        Lengths::new(unit, diagonal(&mesh)),
    );
    let short = TransferSource { lengths: Lengths::new(unit, unit), ..right.clone() };
    let (right, short) =
        (job_of(&mesh, scalars.clone(), &camera, (33, 31), right), job_of(&mesh, scalars, &camera, (33, 31), short));
    assert_noticed("a short path", &raycast(&short), &reference(&right));
}

#[test]
fn a_job_says_whether_its_formula_was_judged() {
    let (mesh, scalars) = field(2);
    let camera = camera(DVec3::new(4.0, 3.0, 3.5), Projection::Perspective { view_angle: 40.0 });
    let source = function("viridis@0:0,1:0.5", unit_range(), OpacityKind::Alpha, Lengths::of_diagonal(diagonal(&mesh)));
    let job = job_of(&mesh, scalars, &camera, (9, 9), source);
    let by_formula = |job: &RenderJob| Reference::new().render(job.clone()).unwrap().stats.by_formula;
    assert!(by_formula(&job) && !by_formula(&RenderJob { formula: None, ..job }));
}

prop_compose! {
    /// Plateaus, steps, spikes and ramps, from nearly nothing to opaque.
    fn opacity_points()(
        points in proptest::collection::vec(
            (
                prop_oneof![3 => 0.0..=1.0, 1 => Just(0.5)],
                prop_oneof![2 => 0.0..0.05, 1 => 0.0..1.0, 1 => Just(0.0), 1 => 0.0..1e-4],
            ),
            2..8,
        ),
    ) -> String {
        let mut points: Vec<(f64, f64)> = points;
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut text = Vec::new();
        for (i, (position, value)) in points.iter().enumerate() {
            if i < 2 || points[i - 2].0 != *position {
                text.push(format!("{position}:{value}"));
            }
        }
        text.join(",")
    }
}

/// A transfer function over a range of the scalars 0.01..1.
fn any_function() -> impl Strategy<Value = (String, MappedRange, OpacityKind)> {
    let map = proptest::sample::select(vec!["viridis", "gray", "turbo_r", "cool-to-warm"]);
    let range = prop_oneof![
        Just(unit_range()),
        Just(MappedRange::new(0.2, 0.7, false).unwrap()),
        Just(MappedRange::new(0.01, 1.0, true).unwrap()),
    ];
    let kind = prop_oneof![Just(OpacityKind::Alpha), Just(OpacityKind::Extinction)];
    (map, opacity_points(), range, kind).prop_map(|(map, points, range, kind)| (format!("{map}@{points}"), range, kind))
}

/// An ensemble of two members, one of which has a range map.
fn any_ensemble() -> impl Strategy<Value = Ensemble> {
    let policy = prop_oneof![Just(RangePolicy::Manual(0.0, 1.0)), Just(RangePolicy::LogManual(0.01, 1.0))];
    let weighting = prop_oneof![Just(ColorWeighting::Plain), Just(ColorWeighting::Opacity)];
    (opacity_points(), opacity_points(), policy, weighting, 0.1..0.9).prop_map(|(a, b, policy, colors, bend)| {
        let of = |map: &str, points: &str| {
            let text = format!("{map}@{points}");
            Member::new(text.clone(), Function::TransferFunction(TransferFunction::parse(&text).unwrap()))
        };
        let mut first = Member { map: RangeMap::new(&[[0.5, bend]]).unwrap(), range: policy, ..of("viridis", &a) };
        let mut second = Member { range: RangePolicy::Manual(0.0, 1.0), ..of("inferno", &b) };
        (first.weight, second.weight) = (0.5, 0.5);
        Ensemble { members: vec![first, second], colors, ..Ensemble::default() }
    })
}

/// 200 transfer functions, cameras and meshes, and what all of them came to.
#[test]
fn every_exact_path_is_within_its_bound_of_the_formula() {
    use proptest::test_runner::{Config, TestRunner};
    let mut worst = Worst::default();
    let place =
        (2usize..6, 0.0..0.16, 0u64..1000, [-1.0..1.0, -1.0..1.0, -1.0..1.0], prop_oneof![Just(5.0), Just(0.6)]);
    let mut runner = TestRunner::new(Config { cases: 200, failure_persistence: None, ..Config::default() });
    let worst_of_all = std::cell::RefCell::new(&mut worst);
    let strategy = (any_function(), any_ensemble(), any::<bool>(), 0.01..0.1, place, any::<bool>());
    let result = runner.run(&strategy, |((text, range, kind), ensemble, blended, share, place, parallel)| {
        let (cells, jitter, seed, direction, distance) = place;
        let mesh = Arc::new(build(grid(cells, jitter, seed, |_| true)));
        let scalars = sample(&mesh, |p| 0.5 + 0.3 * wave(p + DVec3::splat(noise(seed, 1))));
        let scalars = scalars.into_iter().map(|s| s.clamp(0.01, 1.0)).collect();
        let projection =
            if parallel { Projection::Parallel { scale: 1.5 } } else { Projection::Perspective { view_angle: 40.0 } };
        let camera = camera(DVec3::from(direction).normalize_or(DVec3::X) * distance, projection);
        let lengths = Lengths::new(share * diagonal(&mesh), diagonal(&mesh));
        let source = if blended {
            let content = BlendedEnsembles {
                ensemble,
                toward: None,
                colors: ColorWeighting::Plain,
                series: (0.0, 1.0),
                step: (0.0, 1.0),
            };
            TransferSource { content: TransferContent::Ensembles(Box::new(content)), kind, lengths }
        } else {
            function(&text, range, kind, lengths)
        };
        let name = format!("{source:?}, {cells} {jitter} {seed} {direction:?} {distance} {parallel}");
        worst_of_all.borrow_mut().compare(&name, &job_of(&mesh, scalars, &camera, (21, 19), source));
        Ok(())
    });
    result.unwrap();
    eprintln!("formula, at random: {worst:?}");
    assert!(1000 * worst.sensitive <= worst.pixels, "{worst:?}");
    assert!(worst.seen > 0.9);
}
