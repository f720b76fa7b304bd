//! Fields in a box and by coverage, of meshes and of points, and eq. 20.

use super::tests::{camera, cameras, dense, drawn, job, judged, mesh, node, smooth, tents};
use super::*;
#[cfg(feature = "clouds")]
use crate::camera::Camera;
use crate::camera::{PixelSet, Samples};
use crate::node_table::NodeTable;
use crate::render::Renderer;
use crate::render::functions::{FieldDomain, FunctionDomain, Normalise, SheetSpacing, SheetStyle};
use crate::render::testing::{self, difference};
use crate::visibility::Skip;
use glam::DVec3;

const FINE: SheetSpacing = SheetSpacing::Error(1e-5);

fn with(job: RenderJob, domain: FunctionDomain, normalise: Normalise) -> RenderJob {
    let of = |of: FunctionScene| FunctionScene { domain: FieldDomain::of(domain, &of.kernels), normalise, ..of };
    RenderJob { functions: job.functions.map(of), ..job }
}

/// Points of a ball, denser towards its middle, with a value each.
#[cfg(feature = "clouds")]
fn cloud_job(count: usize, camera: impl Fn((DVec3, DVec3)) -> Camera, size_px: (usize, usize)) -> RenderJob {
    let mut random = crate::mesh::test_meshes::Random::new(11);
    let mut point = || DVec3::new(random.signed(), random.signed(), random.signed());
    let balls: Vec<(DVec3, f64)> = (0..count).map(|_| point()).map(|p| (p.length() * p, 0.1)).collect();
    let mesh = crate::mesh::test_meshes::cloud(&balls, &[]);
    let kernels = crate::functions::points::PointFunctions::default().of(&mesh).unwrap();
    let style = SheetStyle { spacing: FINE };
    let functions = Some(FunctionScene::new(Arc::new(kernels), style, 2.0));
    let values = smooth(&mesh);
    let job = testing::job(&mesh, values, &camera(mesh.frame()), size_px, dense());
    with(RenderJob { functions, ..job }, FunctionDomain::Coverage, Normalise::Sum)
}

#[test]
fn sheets_agree_with_the_judge_in_all_domains_and_by_eq_20() {
    use FunctionDomain::{Box, Coverage, Mesh};
    let mesh = mesh(3);
    let [outside, parallel, inside] = cameras(&mesh);
    for (camera, table, domain, normalise) in [
        (outside, dense(), Coverage, Normalise::Sum),
        (parallel, tents(), Coverage, Normalise::Sum),
        (inside, dense(), Coverage, Normalise::Eq20),
        (outside, tents(), Box, Normalise::Sum),
        (inside, dense(), Box, Normalise::Eq20),
        (parallel, tents(), Mesh, Normalise::Eq20),
    ] {
        let of_mesh = RenderJob { table, ..job(&mesh, smooth(&mesh), &camera, (10, 8), FINE) };
        let job = with(of_mesh.clone(), domain, normalise);
        let (found, expected) = (drawn(&job), judged(&job));
        let [rmse, most] = difference(&found.planes.color.pixels, &expected.color.pixels);
        println!("{domain} {normalise}: {rmse:.1e} {most:.1e} {} sheets", found.stats.sheets);
        assert!(rmse <= 1e-4 && most <= 1e-3, "{domain} {normalise}: {rmse} {most}");
        assert!(expected.color.pixels.iter().any(|p| p[3] > 0.02));
        // The comparison can fail: another domain is another field. The mesh fills the box of its vertices, and inside of it weights add up to
        // more than 1, nearly everywhere.
        if domain == Coverage {
            assert!(difference(&judged(&of_mesh).color.pixels, &expected.color.pixels)[1] > 1e-2);
        }
    }
}

#[cfg(feature = "clouds")]
#[test]
fn points_without_cells_agree_with_the_judge() {
    let near = |bounds| Camera::default_for(bounds).unwrap().orbit(20.0, 10.0).unwrap();
    for (table, count) in [(dense(), 150), (tents(), 40)] {
        let job = RenderJob { table, ..cloud_job(count, near, (12, 10)) };
        let (found, expected) = (drawn(&job), judged(&job));
        let [rmse, most] = difference(&found.planes.color.pixels, &expected.color.pixels);
        println!("{count} points: {rmse:.1e} {most:.1e} {} sheets", found.stats.sheets);
        assert!(rmse <= 1e-4 && most <= 1e-3, "{rmse} {most}");
        assert!(expected.color.pixels.iter().any(|p| p[3] > 0.1));
        assert_eq!(found.stats.function_gaps, 0);
        // The comparison can fail.
        let boxed = with(job, FunctionDomain::Box, Normalise::Sum);
        assert!(difference(&judged(&boxed).color.pixels, &expected.color.pixels)[1] > 1e-2);
    }
}

#[test]
fn the_error_by_coverage_falls_with_the_square_of_the_distance_between_sheets() {
    let mesh = mesh(2);
    let of = |count| {
        let job = job(&mesh, smooth(&mesh), &camera(&mesh), (10, 8), SheetSpacing::Count(count));
        let job = with(job, FunctionDomain::Coverage, Normalise::Sum);
        difference(&drawn(&job).planes.color.pixels, &judged(&job).color.pixels)[0]
    };
    let errors = [40, 80, 160].map(of);
    for pair in errors.windows(2) {
        assert!((3.5..=4.5).contains(&(pair[0] / pair[1])), "{errors:?}");
    }
}

/// Neither samples, vectors, threads nor what is skipped change a bit.
fn has_one_image(job: &RenderJob) {
    let (width, height) = (job.view.width_px, job.view.height_px);
    let all = drawn(job);
    assert!(all.planes.color.pixels.iter().any(|p| p[3] > 0.02));
    assert_eq!(Sheets::portable().render(job.clone()).unwrap().planes, all.planes);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(pool.install(|| drawn(job)).planes, all.planes);
    }
    let unskipped = drawn(&RenderJob { skip: Skip::NONE, ..job.clone() });
    assert_eq!(unskipped.planes, all.planes);
    assert!(all.stats.function_slabs_clear > 0 && unskipped.stats.function_slabs_clear == 0);
    let listed: Vec<u32> = (0..(width * height) as u32).filter(|at| at % 7 == 3).collect();
    let mut some = job.clone();
    some.view.samples = Samples::Pixels(Arc::new(PixelSet::new((width, height), &listed).unwrap()));
    let found = drawn(&some).planes;
    for (at, &pixel) in listed.iter().enumerate() {
        let bits = |planes: &crate::render::Planes, at: usize| planes.color.pixels[at].map(f32::to_bits);
        assert_eq!(bits(&found, at), bits(&all.planes, pixel as usize), "{pixel}");
    }
}

/// Visible for great values.
fn tent() -> Arc<NodeTable> {
    let nodes = vec![node(0.4, [1.0; 3], 0.0), node(0.6, [1.0, 0.5, 0.2], 9.0), node(1.0, [1.0; 3], 0.0)];
    Arc::new(NodeTable::new(nodes).unwrap())
}

#[test]
fn a_field_by_coverage_has_one_image() {
    let mesh = mesh(4);
    for (camera, normalise) in cameras(&mesh).into_iter().zip([Normalise::Sum, Normalise::Eq20, Normalise::Sum]) {
        let rising = mesh.positions.local.iter().map(|p| p.x + 0.3 * p.y).collect();
        let job = job(&mesh, rising, &camera, (37, 29), SheetSpacing::Error(1e-3));
        has_one_image(&with(RenderJob { table: tent(), ..job }, FunctionDomain::Coverage, normalise));
    }
}

#[cfg(feature = "clouds")]
#[test]
fn points_without_cells_have_one_image_also_after_other_jobs() {
    let camera = |bounds| Camera::default_for(bounds).unwrap();
    let style = SheetStyle { spacing: SheetSpacing::Error(1e-3) };
    let job = RenderJob { table: tent(), ..cloud_job(300, camera, (37, 29)) };
    let job = RenderJob { functions: job.functions.map(|of| FunctionScene { style, ..of }), ..job };
    has_one_image(&job);
    // Faces that are kept for a mesh are its own.
    let mesh = mesh(3);
    let of_mesh = super::tests::job(&mesh, smooth(&mesh), &super::tests::camera(&mesh), (16, 12), style.spacing);
    let mut sheets = Sheets::new();
    let mut rendered = |job: &RenderJob| sheets.render(job.clone()).unwrap().planes.clone();
    let by_coverage = with(of_mesh.clone(), FunctionDomain::Coverage, Normalise::Sum);
    let found = [&of_mesh, &by_coverage, &of_mesh, &job].map(&mut rendered);
    assert_eq!(found, [&of_mesh, &by_coverage, &of_mesh, &job].map(|job| drawn(job).planes));
    // Inside of a mesh that it does not have a cloud is refused, by the judge as well.
    let nowhere = with(job, FunctionDomain::Mesh, Normalise::Sum);
    for renderer in [&mut Sheets::new() as &mut dyn Renderer, &mut crate::render::reference::Reference::new()] {
        assert!(renderer.render(nowhere.clone()).unwrap_err().to_string().contains("no mesh"));
    }
}

#[test]
fn by_eq_20_values_fall_towards_zero_where_weights_are_below_one() {
    // One function of the value 1: the mean is 1, by eq. 20 the field is its weight.
    let raw = crate::mesh::RawMesh {
        points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        cells: vec![[0, 1, 2, 3]].into(),
    };
    let mesh = Arc::new(crate::mesh::Mesh::build(raw).unwrap().0);
    let mut values = vec![f32::NAN; 4];
    values[1] = 1.0;
    let factor = [0.2, 0.0, 0.2, 0.0, 0.0, 0.2];
    let kernels = crate::functions::Kernels::new(mesh.positions.local.clone(), vec![factor; 4], 3.0).unwrap();
    let style = SheetStyle { spacing: SheetSpacing::Error(1e-4) };
    let functions = Some(FunctionScene::new(Arc::new(kernels), style, 1.0));
    // Visible halfway only: a value that is not in the data.
    let table = vec![node(0.3, [1.0; 3], 0.0), node(0.5, [1.0; 3], 20.0), node(0.7, [1.0; 3], 0.0)];
    let table = Arc::new(NodeTable::new(table).unwrap());
    let job = RenderJob { functions, table, ..testing::job(&mesh, values, &camera(&mesh), (24, 24), dense()) };
    let job = RenderJob { active: Arc::new(crate::visibility::CellSet::all(1)), ..job };
    let most = |normalise| {
        let job = with(job.clone(), FunctionDomain::Box, normalise);
        let found = drawn(&job).planes.color.pixels;
        let [rmse, apart] = difference(&found, &judged(&job).color.pixels);
        assert!(rmse <= 1e-3 && apart <= 1e-2, "{normalise}: {rmse} {apart}");
        found.iter().map(|p| p[3]).fold(0.0, f32::max)
    };
    assert_eq!(most(Normalise::Sum), 0.0);
    assert!(most(Normalise::Eq20) > 0.5);
}
