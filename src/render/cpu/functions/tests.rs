use super::*;
use crate::camera::{Camera, Lattice, PixelSet, Projection, Samples};
use crate::functions::vertices::VertexFunctions;
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
use crate::node_table::{Node, NodeTable};
use crate::render::functions::{SheetSpacing, SheetStyle};
use crate::render::reference::Reference;
use crate::render::testing::{self, difference};
use crate::render::{Planes, Renderer};
use crate::visibility::Skip;
use glam::{DVec3, Vec3};

pub(super) fn node(scalar: f64, rgb: [f64; 3], tau: f64) -> Node {
    Node { scalar, rgb, tau }
}

/// Colours everywhere, thicker where the scalar is greater.
pub(super) fn dense() -> Arc<NodeTable> {
    Arc::new(NodeTable::new(vec![node(-1.0, [0.1, 0.2, 0.9], 0.05), node(1.0, [0.9, 0.3, 0.1], 1.5)]).unwrap())
}

/// Visible in two narrow intervals.
pub(super) fn tents() -> Arc<NodeTable> {
    let (blue, red, none) = ([0.2, 0.4, 1.0], [1.0, 0.3, 0.2], 0.0);
    let nodes = vec![
        node(-0.5, blue, none),
        node(-0.4, blue, 6.0),
        node(-0.3, blue, none),
        node(0.3, red, none),
        node(0.45, red, 9.0),
        node(0.6, red, none),
    ];
    Arc::new(NodeTable::new(nodes).unwrap())
}

pub(super) fn mesh(side: usize) -> Arc<Mesh> {
    Arc::new(Mesh::build(jittered(kuhn_grid([side; 3]), &mut Random::new(side as u64))).unwrap().0)
}

/// A smooth field between -1 and 1.
pub(super) fn smooth(mesh: &Mesh) -> Vec<f32> {
    let wave = |p: glam::Vec3| (4.0 * p.x).sin() * (3.0 * p.y + 1.0).cos() * (2.0 * p.z).cos();
    mesh.positions.local.iter().map(|&p| wave(p)).collect()
}

/// A job of functions at the vertices of a mesh.
pub(super) fn job(
    mesh: &Arc<Mesh>,
    values: Vec<f32>,
    camera: &Camera,
    size_px: (usize, usize),
    spacing: SheetSpacing,
) -> RenderJob {
    let kernels = Arc::new(VertexFunctions::default().of(mesh).unwrap().kernels);
    let style = SheetStyle { spacing };
    let functions = Some(FunctionScene::new(kernels, style, 2.0));
    RenderJob { functions, ..testing::job(mesh, values, camera, size_px, dense()) }
}

pub(super) fn camera(mesh: &Mesh) -> Camera {
    Camera::default_for(mesh.positions.world_bounds()).unwrap().orbit(25.0, 15.0).unwrap()
}

/// Perspective, parallel, close with the eye inside.
pub(super) fn cameras(mesh: &Mesh) -> [Camera; 3] {
    let outside = camera(mesh);
    let (lo, hi) = mesh.positions.world_bounds();
    let parallel = Camera { projection: Projection::Parallel { scale: 0.4 * (hi - lo).length() }, ..outside };
    let inside = Camera { position: 0.55 * lo + 0.45 * hi + DVec3::new(0.1, 0.05, -0.07), ..outside };
    [outside, parallel, inside]
}

pub(super) fn drawn(job: &RenderJob) -> Frame {
    Sheets::new().render(job.clone()).unwrap().clone()
}

pub(super) fn judged(job: &RenderJob) -> Planes {
    Reference::new().render(job.clone()).unwrap().planes.clone()
}

const FINE: SheetSpacing = SheetSpacing::Error(1e-5);

#[test]
fn sheets_agree_with_the_judge() {
    let mesh = mesh(4);
    for camera in cameras(&mesh) {
        for table in [dense(), tents()] {
            let job = RenderJob { table, ..job(&mesh, smooth(&mesh), &camera, (24, 20), FINE) };
            let (found, expected) = (drawn(&job), judged(&job));
            let [rmse, most] = difference(&found.planes.color.pixels, &expected.color.pixels);
            println!("{rmse:.1e} {most:.1e} {} sheets", found.stats.sheets);
            assert!(rmse <= 1e-4 && most <= 1e-3, "{rmse} {most}");
            assert!(expected.color.pixels.iter().any(|p| p[3] > 0.02));
            assert_eq!(found.stats.function_gaps, 0);
            // The comparison can fail: cells are another field.
            let cells = RenderJob { functions: None, ..job.clone() };
            assert!(difference(&judged(&cells).color.pixels, &expected.color.pixels)[1] > 1e-2);
        }
    }
}

#[test]
fn the_error_falls_with_the_square_of_the_distance_between_sheets() {
    let mesh = mesh(3);
    let of = |count| {
        let job = job(&mesh, smooth(&mesh), &camera(&mesh), (12, 10), SheetSpacing::Count(count));
        difference(&drawn(&job).planes.color.pixels, &judged(&job).color.pixels)[0]
    };
    let errors = [40, 80, 160].map(of);
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.5..=4.5).contains(&ratio), "{errors:?}");
    }
}

#[test]
fn a_constant_field_is_a_homogeneous_body() {
    // Sheets that no function reaches, before and behind a part of the mesh, leave none of it out.
    for (side, spacing) in [(2, SheetSpacing::Count(2)), (7, SheetSpacing::Count(5)), (7, SheetSpacing::Error(1e-3))] {
        let mesh = mesh(side);
        let values = vec![0.25f32; mesh.positions.local.len()];
        let job = job(&mesh, values, &camera(&mesh), (16, 12), spacing);
        let found = drawn(&job);
        // Cells of one scalar are the same body, by closed forms.
        let mut walk = crate::render::cpu::raycast::Raycast::new();
        let cells = walk.render(RenderJob { functions: None, ..job }).unwrap();
        let [rmse, most] = difference(&found.planes.color.pixels, &cells.planes.color.pixels);
        assert!(rmse <= 1e-6 && most <= 1e-5, "{side} {spacing:?}: {rmse} {most}");
        assert!(cells.planes.color.pixels.iter().any(|p| p[3] > 0.1));
        assert_eq!(found.stats.function_gaps, 0, "{side} {spacing:?}");
    }
}

#[test]
fn a_field_without_a_range_is_drawn_in_any_spacing() {
    let mesh = mesh(2);
    let values = vec![0.25f32; mesh.positions.local.len()];
    let of = |spacing, range| {
        let job = job(&mesh, values.clone(), &camera(&mesh), (16, 12), spacing);
        let functions = job.functions.clone().map(|of| FunctionScene { range, ..of });
        drawn(&RenderJob { functions, ..job }).planes
    };
    let expected = of(SheetSpacing::Error(1e-3), 2.0);
    assert!(expected.color.pixels.iter().any(|p| p[3] > 0.1));
    assert_eq!(of(SheetSpacing::Error(1e-3), 0.0), expected);
}

#[test]
fn holes_have_no_functions_and_no_field() {
    let mesh = mesh(4);
    let mut values = smooth(&mesh);
    let inside = |v: &usize| mesh.positions.local[*v].abs().max_element() < 0.45;
    let holes: Vec<usize> = (0..values.len()).filter(inside).collect();
    for (at, value) in holes.iter().zip([f32::NAN, f32::INFINITY].into_iter().cycle()) {
        values[*at] = value;
    }
    assert!(!holes.is_empty());
    let whole = job(&mesh, smooth(&mesh), &camera(&mesh), (20, 16), FINE);
    let job = job(&mesh, values, &camera(&mesh), (20, 16), FINE);
    assert!(job.active.count() > 0 && job.active.count() < whole.active.count());
    let found = drawn(&job);
    let [rmse, most] = difference(&found.planes.color.pixels, &judged(&job).color.pixels);
    assert!(rmse <= 1e-4 && most <= 1e-3, "{rmse} {most}");
    assert!(found.stats.functions_drawn <= (mesh.positions.local.len() - holes.len()) as u64);
    assert_ne!(drawn(&whole).planes, found.planes);
}

#[test]
fn what_does_not_change_from_frame_to_frame_is_kept() {
    let mesh = mesh(3);
    let of = |camera: &Camera| job(&mesh, smooth(&mesh), camera, (16, 12), SheetSpacing::Count(20));
    let (first, mut second) = (of(&camera(&mesh)), of(&cameras(&mesh)[1]));
    (second.active, second.functions) = (first.active.clone(), first.functions.clone());
    let mut sheets = Sheets::new();
    let kept: Vec<u64> = [&first, &second].map(|job| sheets.render(job.clone()).unwrap().stats.entry_lists_kept).into();
    assert_eq!(kept, [0, 1]);
    assert_eq!(sheets.frame_mut().planes, drawn(&second).planes);
    assert!(sheets.frame_mut().stats.entry_faces > 0 && sheets.frame_mut().stats.function_slabs > 0);
}

#[test]
fn one_function_is_a_gaussian_over_itself() {
    // Of one function the normalised field is its value wherever it reaches, whatever the distance.
    let raw = crate::mesh::RawMesh {
        points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
        cells: vec![[0, 1, 2, 3]].into(),
    };
    let mesh = Arc::new(Mesh::build(raw).unwrap().0);
    let mut values = vec![f32::NAN; 4];
    values[2] = 0.5;
    let narrow = [0.15, 0.0, 0.1, 0.05, 0.0, 0.15];
    let kernels = crate::functions::Kernels::new(mesh.positions.local.clone(), vec![narrow; 4], 3.0).unwrap();
    let style = SheetStyle { spacing: SheetSpacing::Count(64) };
    let functions = Some(FunctionScene::new(Arc::new(kernels), style, 2.0));
    let job = testing::job(&mesh, values, &camera(&mesh), (16, 12), dense());
    // The cell has holes for vertices; the field is where it is said to be.
    let job = RenderJob { functions, active: Arc::new(crate::visibility::CellSet::all(1)), ..job };
    let (found, expected) = (drawn(&job), judged(&job));
    let [rmse, most] = difference(&found.planes.color.pixels, &expected.color.pixels);
    assert!(expected.color.pixels.iter().any(|p| p[3] > 0.01));
    // The field ends where the function does, drawn up to the next sheet: each end is off by a 64th of the depth at most, of this extinction.
    let most_off = 2.0 * 3f64.sqrt() / 64.0 * 1.2;
    assert!(rmse <= 0.1 * most_off && most <= most_off, "{rmse} {most}");
    assert_eq!(found.stats.functions_drawn, 1);
    assert!(found.stats.function_gaps > 0);
}

#[test]
fn functions_smaller_than_a_pixel_are_widened_to_one_and_counted() {
    let mesh = mesh(8);
    for camera in &cameras(&mesh)[..2] {
        let away = Camera { position: camera.focal_point + 3.0 * (camera.position - camera.focal_point), ..*camera };
        let projection = match away.projection {
            Projection::Parallel { scale } => Projection::Parallel { scale: 3.0 * scale },
            other => other,
        };
        let job = job(&mesh, smooth(&mesh), &Camera { projection, ..away }, (13, 11), FINE);
        let (found, expected) = (drawn(&job), judged(&job));
        let [rmse, most] = difference(&found.planes.color.pixels, &expected.color.pixels);
        println!("{rmse:.1e} {most:.1e} {} of {}", found.stats.functions_widened, found.stats.functions_drawn);
        assert!(rmse <= 1e-4 && most <= 1e-3, "{rmse} {most}");
        assert!(expected.color.pixels.iter().any(|p| p[3] > 0.02));
        assert!(found.stats.functions_widened > 100);
        // The comparison can fail: at three times the size none is widened, and every third pixel has the same ray.
        let mut larger = job.clone();
        (larger.view.width_px, larger.view.height_px) = (39, 33);
        let larger = drawn(&larger);
        assert!(larger.stats.functions_widened < found.stats.functions_widened);
        let same_rays = (0..143).map(|at| larger.planes.color.pixels[(at / 13 * 3 + 1) * 39 + at % 13 * 3 + 1]);
        let apart = same_rays.zip(&found.planes.color.pixels).map(|(a, b)| (a[3] - b[3]).abs()).fold(0.0, f32::max);
        assert!(apart > 1e-3, "{apart}");
    }
}

#[test]
fn a_function_between_all_rays_is_seen() {
    let mesh = mesh(2);
    let count = mesh.positions.local.len();
    // At the vertex in the middle a needle along the viewing direction, far narrower than a pixel.
    let middle = mesh.vertex_source.iter().position(|&source| source == 13).unwrap();
    let values: Vec<f32> = (0..count).map(|v| if v == middle { 0.5 } else { f32::NAN }).collect();
    let from = camera(&mesh);
    let along = DVec3::Z * (from.position - from.focal_point).length();
    let projection = Projection::Parallel { scale: 1.0 };
    let from = Camera { position: from.focal_point + along, view_up: DVec3::Y, projection, ..from };
    for narrow in [1e-4, 1e-6, 1e-9] {
        let needle = [narrow, 0.0, narrow, 0.0, 0.0, 0.05];
        let kernels = crate::functions::Kernels::new(mesh.positions.local.clone(), vec![needle; count], 3.0).unwrap();
        let style = SheetStyle { spacing: SheetSpacing::Error(1e-3) };
        let functions = Some(FunctionScene::new(Arc::new(kernels), style, 2.0));
        let job = testing::job(&mesh, values.clone(), &from, (16, 12), dense());
        let active = Arc::new(crate::visibility::CellSet::all(mesh.topology.tets.len()));
        let found = drawn(&RenderJob { functions, active, ..job });
        assert_eq!((found.stats.functions_widened, found.stats.functions_drawn), (1, 1));
        let seen = found.planes.color.pixels.iter().filter(|p| p[3] > 1e-3).count();
        assert!((1..=4).contains(&seen), "{narrow:?}: {seen}");
    }
}

#[test]
fn any_samples_of_an_image_have_its_bits() {
    let mesh = mesh(4);
    for camera in cameras(&mesh) {
        let job = job(&mesh, smooth(&mesh), &camera, (37, 29), SheetSpacing::Error(1e-3));
        let all = drawn(&job).planes;
        let bits = |planes: &Planes, at: usize| planes.color.pixels[at].map(f32::to_bits);
        let listed: Vec<u32> = (0..37 * 29).filter(|at| at % 7 == 3 || (400..420).contains(at)).collect();
        let mut some = job.clone();
        some.view.samples = Samples::Pixels(Arc::new(PixelSet::new((37, 29), &listed).unwrap()));
        let found = drawn(&some).planes;
        for (at, &pixel) in listed.iter().enumerate() {
            assert_eq!(bits(&found, at), bits(&all, pixel as usize), "{pixel}");
            assert_eq!(found.depth.pixels[at].to_bits(), all.depth.pixels[pixel as usize].to_bits());
        }
        some.view.samples = Samples::Lattice(Lattice::new(std::num::NonZero::new(4).unwrap()));
        let found = drawn(&some).planes;
        let (columns, rows) = some.view.plane_px();
        for row in 0..rows {
            for column in 0..columns {
                let (x, y) = some.view.pixel_at(row * columns + column);
                assert_eq!(bits(&found, row * columns + column), bits(&all, y * 37 + x), "{x}, {y}");
            }
        }
    }
}

#[test]
fn neither_vectors_nor_threads_nor_what_is_skipped_change_a_bit() {
    let mesh = mesh(5);
    for camera in cameras(&mesh) {
        let rising = mesh.positions.local.iter().map(|p| p.x + 0.3 * p.y).collect();
        let job = job(&mesh, rising, &camera, (40, 33), SheetSpacing::Error(1e-3));
        // Visible at one end of the mesh.
        let tent = vec![node(0.6, [1.0; 3], 0.0), node(0.8, [1.0, 0.5, 0.2], 9.0), node(1.0, [1.0; 3], 0.0)];
        let job = RenderJob { table: Arc::new(NodeTable::new(tent).unwrap()), ..job };
        let expected = drawn(&RenderJob { skip: Skip::NONE, ..job.clone() });
        let skipped = drawn(&job);
        assert_eq!(skipped.planes, expected.planes);
        assert!(skipped.stats.function_slabs_clear > 0 && expected.stats.function_slabs_clear == 0);
        assert!(skipped.stats.sheets < expected.stats.sheets);
        assert!(skipped.stats.functions_projected < expected.stats.functions_projected);
        assert_eq!(Sheets::portable().render(job.clone()).unwrap().planes, expected.planes);
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| drawn(&job)).planes, expected.planes);
        }
        let mut in_slices = Sheets::new();
        in_slices.begin(job.clone()).unwrap();
        while let crate::render::Advance::Partial(_) = in_slices.advance(Duration::ZERO).unwrap() {}
        assert_eq!(in_slices.frame_mut().planes, expected.planes);
        // The comparison can fail.
        let other = RenderJob { table: dense(), ..job };
        assert_ne!(drawn(&other).planes, expected.planes);
    }
}

#[test]
fn opaque_rays_end_and_end_alike() {
    let mesh = mesh(4);
    let opaque = Arc::new(NodeTable::new(vec![node(-1.0, [0.4; 3], 50.0), node(1.0, [0.9; 3], 5000.0)]).unwrap());
    let job = job(&mesh, smooth(&mesh), &camera(&mesh), (24, 24), SheetSpacing::Error(1e-3));
    let job = RenderJob { table: opaque, ..job };
    let (early, late) = (drawn(&job), drawn(&RenderJob { skip: Skip { opaque: false, ..Skip::ALL }, ..job }));
    assert!(early.stats.rays_stopped_early > 0 && early.stats.sheets < late.stats.sheets);
    assert_eq!(early.planes, late.planes);
}

#[test]
fn functions_of_any_size_are_drawn_or_refused_without_a_panic() {
    let camera_of = |mesh: &Mesh| Camera::default_for(mesh.positions.world_bounds()).unwrap();
    for size in [1e-30, 1e-3, 1.0, 1e30] {
        // A sliver beside a regular cell.
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.5, -1e-6]];
        let points = points.map(|p| size * DVec3::from_array(p)).to_vec();
        let raw = crate::mesh::RawMesh { points, cells: vec![[0, 1, 2, 3], [0, 2, 1, 4]].into() };
        let Ok((mesh, _)) = Mesh::build(raw) else { continue };
        let mesh = Arc::new(mesh);
        for spacing in [SheetSpacing::Error(1e-2), SheetSpacing::Count(7)] {
            let values = (0..mesh.positions.local.len()).map(|v| v as f32 / 4.0 - 0.5).collect();
            let job = job(&mesh, values, &camera_of(&mesh), (8, 8), spacing);
            let frame = drawn(&job);
            assert!(frame.planes.color.pixels.iter().flatten().all(|c| c.is_finite()), "{size}");
            assert!(frame.planes.color.pixels.iter().any(|p| p[3] > 0.0), "{size} {:?}", frame.stats);
        }
    }
    let mesh = mesh(2);
    let good = job(&mesh, smooth(&mesh), &camera(&mesh), (8, 8), FINE);
    let behind = Camera { position: DVec3::splat(1e3), focal_point: DVec3::splat(2e3), ..camera(&mesh) };
    let behind = job(&mesh, smooth(&mesh), &behind, (8, 8), FINE);
    assert!(drawn(&behind).planes.color.pixels.iter().all(|p| *p == [0.0; 4]));
    let refused = |job: RenderJob| Sheets::new().render(job).unwrap_err().to_string();
    assert!(refused(RenderJob { functions: None, ..good.clone() }).contains("none"));
    let few = Arc::new(crate::functions::Kernels::new(vec![Vec3::ZERO], vec![[1.0; 6]], 3.0).unwrap());
    let few = Some(FunctionScene::new(few, SheetStyle::default(), 1.0));
    assert!(refused(RenderJob { functions: few, ..good.clone() }).contains("1 functions for 27 vertices"));
    let with = |spacing| {
        let functions = good.functions.clone().map(|of| FunctionScene { style: SheetStyle { spacing }, ..of });
        refused(RenderJob { functions, ..good.clone() })
    };
    assert!(with(SheetSpacing::Error(f64::NAN)).contains("share of the range"));
    assert!(with(SheetSpacing::Count(1)).contains("from 2"));
}

#[test]
fn slabs_in_which_sheets_would_be_too_many_are_counted() {
    let mesh = mesh(1);
    let values: Vec<f32> = (0..8u8).map(|v| f32::from(v) / 4.0 - 1.0).collect();
    let close = Camera { projection: Projection::Parallel { scale: 0.02 }, ..camera(&mesh) };
    let job = job(&mesh, values, &close, (4, 4), SheetSpacing::Error(1e-7));
    assert_eq!(drawn(&job).stats.function_slabs_limited, 0);
    // One function is a plate, a thousandth as thick as it is wide.
    let mut factors = vec![[0.3, 0.0, 0.3, 0.0, 0.0, 0.3]; 8];
    factors[3] = [0.3, 0.0, 0.3, 0.0, 0.0, 0.0003];
    let kernels = crate::functions::Kernels::new(mesh.positions.local.clone(), factors, 3.0).unwrap();
    let functions = job.functions.clone().map(|of| FunctionScene { kernels: Arc::new(kernels), ..of });
    assert!(drawn(&RenderJob { functions, ..job }).stats.function_slabs_limited > 0);
}

#[test]
fn a_transfer_function_of_the_sum_is_not_a_sum_of_transfer_functions() {
    let mesh = mesh(3);
    // Half of the vertices at each end, and something to see in the middle alone.
    let values: Vec<f32> = mesh.positions.local.iter().map(|p| if p.x > 0.0 { 1.0 } else { -1.0 }).collect();
    let tent = vec![node(-0.3, [1.0; 3], 0.0), node(0.0, [1.0; 3], 20.0), node(0.3, [1.0; 3], 0.0)];
    let table = Arc::new(NodeTable::new(tent).unwrap());
    let job = RenderJob { table: table.clone(), ..job(&mesh, values.clone(), &camera(&mesh), (24, 24), FINE) };
    let found = drawn(&job);
    // Each function by itself shows nothing: no value is in the tent.
    assert!(values.iter().all(|&value| !table.is_visible_in(f64::from(value), f64::from(value))));
    assert!(found.planes.color.pixels.iter().any(|p| p[3] > 0.5));
    let [rmse, most] = difference(&found.planes.color.pixels, &judged(&job).color.pixels);
    assert!(rmse <= 1e-4 && most <= 1e-3, "{rmse} {most}");
}
