use super::super::ray::transform;
use super::shape::{Shape, ShapeSource};
use super::*;
use crate::camera::{Camera, PixelSet, Projection, Samples};
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid, kuhn_grid_of, torn};
use crate::mesh::{Mesh, RawMesh};
use crate::node_table::{Node, NodeTable};
use crate::render::Renderer;
use crate::render::cpu::raycast::Raycast;
use crate::render::points::{Footprint, PointStyle};
use crate::render::reference::Reference;
use crate::render::testing::{self, BOUNDS, difference, is_within, with_points, with_sample, with_selection};
use crate::task::Cancel;
use crate::visibility::{CellSet, Drawn, Selection};
use glam::DVec3;

type Pixels = Vec<[f32; 4]>;

const EXACT: PointStyle = PointStyle::EXACT;
const GAP: PointStyle = PointStyle { compositing: Compositing::Gap, ..EXACT };
const ELLIPSE: PointStyle = PointStyle { footprint: Footprint::Ellipse, ..EXACT };

pub(super) fn built(raw: RawMesh) -> Arc<Mesh> {
    Arc::new(Mesh::build(raw).unwrap().0)
}

/// A smooth field in [0, 1] of a vertex's place in the box.
pub(super) fn field(mesh: &Mesh) -> Vec<f32> {
    let (lo, hi) = mesh.positions.world_bounds();
    let at = |v: usize| (mesh.positions.world(v) - lo) / (hi - lo);
    let value = |p: DVec3| 0.5 + 0.3 * (5.0 * p.x + p.z).sin() * (4.0 * p.y).cos() + 0.2 * (7.0 * p.z).sin();
    (0..mesh.positions.local.len()).map(|v| value(at(v)) as f32).collect()
}

fn nodes(nodes: &[(f64, f64, f64)]) -> Arc<NodeTable> {
    let node = |&(scalar, red, tau): &(f64, f64, f64)| Node { scalar, rgb: [red, 0.5, 1.0 - red], tau };
    Arc::new(NodeTable::new(nodes.iter().map(node).collect()).unwrap())
}

pub(super) fn dense() -> Arc<NodeTable> {
    nodes(&[(0.0, 0.0, 0.5), (0.4, 0.2, 2.0), (0.4, 0.9, 0.3), (1.0, 1.0, 3.0)])
}

pub(super) fn tents() -> Arc<NodeTable> {
    let tent = |at: f64, red: f64| [(at - 0.05, red, 0.0), (at, red, 8.0), (at + 0.05, red, 0.0)];
    nodes(&[tent(0.2, 0.1), tent(0.5, 0.5), tent(0.8, 0.9)].concat())
}

pub(super) fn constant(tau: f64) -> Arc<NodeTable> {
    nodes(&[(0.5, 0.5, tau)])
}

/// Cameras outside, inside of a cell, close with a near plane, and with parallel rays along the edges of a grid of unit cubes.
pub(super) fn cameras(mesh: &Mesh) -> [Camera; 4] {
    let outside = Camera::default_for(mesh.positions.world_bounds()).unwrap();
    let (lo, hi) = mesh.positions.world_bounds();
    let inside = Camera { position: lo + 0.37 * (hi - lo), focal_point: hi, ..outside };
    let near = Camera { position: lo + 0.3 * (hi - lo), near: 0.2 * (hi - lo).length(), ..inside };
    let parallel = Camera {
        position: 0.5 * (lo + hi) - 3.0 * (hi - lo).length() * DVec3::Y,
        focal_point: 0.5 * (lo + hi),
        projection: Projection::Parallel { scale: 0.5 * (hi.z - lo.z) },
        ..outside
    };
    [outside, inside, near, parallel]
}

pub(super) fn job_of(mesh: &Arc<Mesh>, camera: &Camera, size: usize, table: Arc<NodeTable>) -> RenderJob {
    testing::job(mesh, field(mesh), camera, (size, size), table)
}

fn frame(job: &RenderJob) -> Frame {
    Points::new().render(job.clone()).unwrap().clone()
}

fn drawn(job: &RenderJob, style: PointStyle) -> Pixels {
    frame(&with_points(job, style)).planes.color.pixels
}

fn walked(job: &RenderJob) -> Pixels {
    Raycast::new().render(job.clone()).unwrap().planes.color.pixels.clone()
}

fn judged(job: &RenderJob) -> Pixels {
    Reference::new().render(job.clone()).unwrap().planes.color.pixels.clone()
}

fn mean_depth(pixels: &Pixels) -> f64 {
    pixels.iter().map(|p| -f64::from(-p[3]).ln_1p()).sum::<f64>() / pixels.len() as f64
}

#[test]
fn exact_points_are_the_walk_and_the_reference_from_everywhere_and_along_edges() {
    let mesh = built(jittered(kuhn_grid([6; 3]), &mut Random::new(1)));
    let aligned = built(kuhn_grid([4; 3]));
    for (mesh, table) in [(&mesh, dense()), (&mesh, tents()), (&aligned, dense()), (&aligned, constant(4e3))] {
        for (i, camera) in cameras(mesh).iter().enumerate() {
            let job = job_of(mesh, camera, 33, table.clone());
            let points = drawn(&job, EXACT);
            let walk = difference(&points, &walked(&job));
            assert!(is_within(walk), "camera {i}: {walk:?}");
            assert!(points.iter().any(|p| p[3] > 0.0), "camera {i}");
            // Listed by depth and not sorted: in a conforming mesh some are behind what is composited, none before.
            let listed = frame(&with_points(&job, PointStyle { exact_order: false, ..EXACT }));
            assert!(difference(&listed.planes.color.pixels, &walked(&job))[0] < 0.05);
        }
    }
    let job = job_of(&mesh, &cameras(&mesh)[0], 33, nodes(&[(0.0, 0.0, 0.02), (1.0, 1.0, 0.2)]));
    let reference = judged(&job);
    assert!(is_within(difference(&drawn(&job, EXACT), &reference)));
    // A scalar that is off, and a cell that is missing, are noticed.
    let mut scalars = field(&mesh);
    let middle = scalars.len() / 2;
    scalars[middle] += 0.2;
    let off = RenderJob { scalars: Arc::new(scalars).into(), ..job.clone() };
    assert!(!is_within(difference(&drawn(&off, EXACT), &reference)));
    let mut active = (*job.active).clone();
    active.set(700, false);
    let off = RenderJob { active: Arc::new(active), ..job };
    assert!(!is_within(difference(&drawn(&off, EXACT), &reference)));
}

#[test]
fn no_ray_through_edges_and_vertices_misses_a_cell_or_meets_one_twice() {
    let mesh = built(kuhn_grid([4; 3]));
    let job = job_of(&mesh, &cameras(&mesh)[3], 34, constant(0.3));
    let points = drawn(&job, EXACT);
    // Parallel rays along an axis through a cube of 4 units.
    let expected = 1.0 - (-0.3f64 * 4.0).exp();
    let (lowest, highest) = points.iter().fold((1.0f32, 0.0f32), |(lo, hi), p| (lo.min(p[3]), hi.max(p[3])));
    assert!(points.iter().all(|p| (f64::from(p[3]) - expected).abs() < 1e-5), "{lowest} {highest} {expected}");
}

#[test]
fn a_mesh_torn_into_cells_has_the_same_bits() {
    let mut random = Random::new(2);
    let raw = jittered(kuhn_grid([4; 3]), &mut random);
    let (mesh, soup) = (built(raw.clone()), built(torn(&raw, &mut random)));
    assert_eq!(soup.positions.local.len(), 4 * mesh.topology.tets.len(), "nothing was joined");
    let scalars_of = |mesh: &Mesh| -> Vec<f32> {
        let bits =
            |p: &glam::Vec3| u64::from(p.x.to_bits()) << 32 ^ u64::from(p.y.to_bits()) << 16 ^ u64::from(p.z.to_bits());
        mesh.positions.local.iter().map(|p| crate::random::unit(crate::random::hash(3, bits(p))) as f32).collect()
    };
    for camera in cameras(&mesh) {
        for style in [EXACT, GAP, ELLIPSE, PointStyle { footprint: Footprint::Square, ..GAP }] {
            let of = |mesh: &Arc<Mesh>, factor: f32| {
                let scalars = scalars_of(mesh).into_iter().map(|s| factor * s).collect();
                drawn(&testing::job(mesh, scalars, &camera, (40, 40), dense()), style)
            };
            let whole = of(&mesh, 1.0);
            // Points at one depth may come in any order if only gaps lie between them.
            if style.compositing == Compositing::Own {
                assert_eq!(whole, of(&soup, 1.0), "{style:?}");
            }
            assert_ne!(whole, of(&mesh, 0.999), "{style:?}: the test can fail");
        }
    }
}

#[test]
fn overlapping_cells_are_cut_where_what_is_composited_ends() {
    let raw = kuhn_grid([2; 3]);
    let doubled: Vec<_> = raw.cells.tets.iter().flat_map(|&tet| [tet; 3]).collect();
    let mut random = Random::new(4);
    let thrice = built(torn(&RawMesh { points: raw.points.clone(), cells: doubled.into() }, &mut random));
    let once = built(raw);
    for camera in cameras(&once) {
        let [thrice, once] = [&thrice, &once].map(|mesh| job_of(mesh, &camera, 24, dense()));
        let frame = frame(&with_points(&thrice, EXACT));
        assert!(is_within(difference(&frame.planes.color.pixels, &drawn(&once, EXACT))));
        assert!(frame.stats.out_of_order > 0, "each cell is there three times");
        let added = PointStyle { footprint: Footprint::Ellipse, ..EXACT };
        assert!(mean_depth(&drawn(&thrice, added)) > 2.0 * mean_depth(&drawn(&once, added)), "others add up");
    }
}

#[test]
fn gaps_fill_a_cavity_and_cells_by_themselves_do_not() {
    let is_wall = |cube: [usize; 3]| cube.iter().any(|&i| !(3..6).contains(&i));
    let mesh = built(kuhn_grid_of([9; 3], is_wall));
    let job = job_of(&mesh, &cameras(&mesh)[0], 31, constant(0.12));
    let middle = 15 * 31 + 15;
    let truth = judged(&job)[middle][3];
    let error = |style| (drawn(&job, style)[middle][3] - truth).abs();
    assert!(error(GAP) >= 0.1, "{}", error(GAP));
    assert!(error(EXACT) <= 1e-3, "{}", error(EXACT));
}

fn jet(cells: usize) -> Arc<Mesh> {
    use crate::field::SeriesSource;
    use crate::synth::{SeriesName, SynthSpec, generate};
    let jet = generate(&SynthSpec { cells: cells as u64, steps: 1, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    built(jet.mesh().unwrap())
}

#[test]
fn the_closer_the_footprint_to_the_cell_the_smaller_the_error() {
    let mesh = jet(20_000);
    let job = job_of(&mesh, &cameras(&mesh)[0], 64, dense());
    let truth = walked(&job);
    let footprints = [Footprint::Square, Footprint::Circle, Footprint::Ellipse, Footprint::Exact];
    let errors = |compositing| {
        footprints.map(|footprint| difference(&drawn(&job, PointStyle { footprint, compositing, ..EXACT }), &truth)[0])
    };
    let (gap, own) = (errors(Compositing::Gap), errors(Compositing::Own));
    println!("gap {gap:?}, own {own:?}");
    assert!(gap.is_sorted_by(|a, b| a > b), "square, circle, ellipse, exact: {gap:?}");
    assert!(own[2] < gap[2] && own[3] < BOUNDS[0], "{own:?}");
}

#[test]
fn thin_optical_depth_does_not_depend_on_the_level_of_detail() {
    let mesh = jet(100_000);
    let (lo, hi) = mesh.positions.world_bounds();
    let per_length = 1.0 / (hi - lo).length();
    let job =
        job_of(&mesh, &cameras(&mesh)[0], 96, nodes(&[(0.0, 0.0, 0.02 * per_length), (1.0, 1.0, 0.04 * per_length)]));
    let whole = frame(&with_points(&job, ELLIPSE));
    let all = mean_depth(&whole.planes.color.pixels);
    assert!(whole.planes.color.pixels.iter().all(|p| p[3] < 0.05), "thin");
    let truth = mean_depth(&walked(&job));
    assert!((all / truth - 1.0).abs() < 0.02, "{all} {truth}");
    let mut last = 0.0;
    for lod in [0.75, 0.5, 0.25] {
        const SEEDS: u32 = 16;
        let style = PointStyle { lod, ..ELLIPSE };
        let (mut depth, mut fragments, mut error) = (0.0, 0.0, 0.0);
        for seed in 0..SEEDS {
            let sampled = frame(&with_sample(&job, style, seed));
            depth += mean_depth(&sampled.planes.color.pixels) / f64::from(SEEDS);
            fragments += sampled.stats.fragments as f64 / f64::from(SEEDS);
            error += difference(&sampled.planes.color.pixels, &whole.planes.color.pixels)[0] / f64::from(SEEDS);
            assert_eq!(sampled.stats.points_drawn, (lod * lod * mesh.topology.tets.len() as f64).round() as u64);
        }
        assert!((depth / all - 1.0).abs() < 0.02, "{lod}: {depth} for {all}");
        let share = fragments / whole.stats.fragments as f64;
        assert!((share / lod - 1.0).abs() < 0.1, "{lod}: {share} of the fragments");
        assert!(error > last, "the error does not fall: {error} after {last}");
        last = error;
    }
    // Points that stand for one cell each would lose most of it.
    let alone = with_sample(&job, PointStyle { lod: 0.5, ..ELLIPSE }, 0);
    let alone = frame(&RenderJob { points: alone.points.map(|p| PointScene { style: ELLIPSE, ..p }), ..alone });
    assert!(mean_depth(&alone.planes.color.pixels) < 0.5 * all);
}

#[test]
fn cells_below_a_pixel_keep_their_optical_depth() {
    let mesh = jet(20_000);
    // Fewer pixels than cells across.
    let job = job_of(&mesh, &cameras(&mesh)[0], 9, nodes(&[(0.0, 0.0, 0.05), (1.0, 1.0, 0.2)]));
    let fine = RenderJob { view: cameras(&mesh)[0].view(144, 144).unwrap(), ..job.clone() };
    let truth = mean_depth(&walked(&fine));
    for footprint in [Footprint::Square, Footprint::Circle, Footprint::Ellipse] {
        let found = frame(&with_points(&job, PointStyle { footprint, ..EXACT }));
        let depth = mean_depth(&found.planes.color.pixels);
        assert!((depth / truth - 1.0).abs() < 0.1, "{footprint}: {depth} {truth}");
        assert!(found.stats.points_enlarged > 0, "{footprint}");
        let small = PointStyle { footprint, radius: 0.01, ..EXACT };
        let depth = mean_depth(&drawn(&job, small));
        assert!((depth / truth - 1.0).abs() < 0.1, "{footprint}, tiny: {depth} {truth}");
    }
    assert_eq!(frame(&with_points(&job, EXACT)).stats.points_enlarged, 0, "rays decide");
    assert!(frame(&with_points(&job, PointStyle { radius: 1.0, ..GAP })).stats.points_enlarged > 0);
}

#[test]
fn sampled_pixels_slices_threads_and_passes_give_the_bits_of_the_whole_image() {
    let mesh = built(jittered(kuhn_grid([6; 3]), &mut Random::new(5)));
    let size = 40;
    for style in [EXACT, GAP, ELLIPSE, PointStyle { exact_order: false, ..ELLIPSE }] {
        let job = with_points(&job_of(&mesh, &cameras(&mesh)[1], size, dense()), style);
        let whole = frame(&job).planes.color.pixels;
        let portable = Points::portable().render(job.clone()).unwrap().clone();
        assert_eq!(portable.planes.color.pixels, whole, "{style:?}");
        let listed: Vec<u32> = (0..90).map(|i| i * 17 % (size * size) as u32).collect();
        let set = PixelSet::new((size, size), &listed).unwrap();
        let mut some = job.clone();
        some.view.samples = Samples::Pixels(Arc::new(set));
        let found = frame(&some).planes.color.pixels;
        for (at, found) in found.iter().enumerate() {
            let (column, row) = some.view.pixel_at(at);
            assert_eq!(*found, whole[row * size + column], "{style:?} {column} {row}");
        }
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| frame(&job)).planes.color.pixels, whole);
        }
        let mut sliced = Points::new();
        sliced.begin(job.clone()).unwrap();
        while !matches!(sliced.advance(Duration::ZERO).unwrap(), crate::render::Advance::Done(_)) {}
        assert_eq!(sliced.advance(Duration::ZERO).unwrap().frame().planes.color.pixels, whole);
    }
}

#[test]
fn a_tile_with_more_fragments_than_it_has_room_for_is_drawn_in_parts() {
    let once = kuhn_grid([1; 3]);
    let many: Vec<_> = (0..600).flat_map(|_| once.cells.tets.clone()).collect();
    let mut random = Random::new(6);
    let many = built(torn(&RawMesh { points: once.points.clone(), cells: many.into() }, &mut random));
    let once = built(once);
    let camera = cameras(&once)[1];
    let [many, once] = [&many, &once].map(|mesh| job_of(mesh, &camera, 20, dense()));
    let found = frame(&with_points(&many, EXACT));
    assert!(found.stats.fragments > 400_000, "{}", found.stats.fragments);
    assert!(is_within(difference(&found.planes.color.pixels, &drawn(&once, EXACT))));
}

#[test]
fn what_is_skipped_changes_nothing_and_is_counted() {
    let mesh = built(jittered(kuhn_grid([6; 3]), &mut Random::new(7)));
    let job = job_of(&mesh, &cameras(&mesh)[0], 32, tents());
    // Cells in which nothing is visible.
    let visible = |cell: usize| {
        let s = mesh.topology.tets[cell].map(|v| job.scalars.values()[v as usize]);
        let (lo, hi) = s.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &s| (lo.min(s), hi.max(s)));
        [0.2f32, 0.5, 0.8].iter().any(|at| lo < at + 0.05 && hi > at - 0.05)
    };
    let some = RenderJob { active: Arc::new(CellSet::of(mesh.topology.tets.len(), visible)), ..job.clone() };
    let [all, fewer] = [&job, &some].map(|job| frame(&with_points(job, EXACT)));
    assert_eq!(all.planes, fewer.planes);
    assert!(fewer.stats.points_drawn < all.stats.points_drawn && fewer.stats.fragments < all.stats.fragments);
    assert_eq!(fewer.stats.points_total, fewer.stats.cells_active);
    assert_eq!(all.stats.points_culled, 0);
    let close = RenderJob { view: cameras(&mesh)[1].view(32, 32).unwrap(), ..job.clone() };
    assert!(frame(&with_points(&close, EXACT)).stats.points_culled > 0, "behind the eye, or beside the image");
    let opaque = RenderJob { table: constant(1e5), ..job };
    let mut looked_at_all = opaque.clone();
    looked_at_all.skip.opaque = false;
    let [stopped, whole] = [&opaque, &looked_at_all].map(|job| frame(&with_points(job, EXACT)));
    assert_eq!(stopped.planes, whole.planes);
    assert!(stopped.stats.rays_stopped_early > 0 && stopped.stats.rays_hit > 0);
}

#[test]
fn degenerate_cells_give_no_light_that_is_not_a_number() {
    let mut random = Random::new(8);
    let raw = jittered(kuhn_grid([3; 3]), &mut random);
    let mesh = built(raw);
    let flatten: [&dyn Fn(glam::Vec3) -> glam::Vec3; 5] = [
        &|p| glam::Vec3::new(p.x, p.y, 0.0),
        &|p| glam::Vec3::new(p.x, 0.0, 0.0),
        &|_| glam::Vec3::ZERO,
        &|p| p * 1e-38,
        &|p| p * 1e38,
    ];
    for (i, flatten) in flatten.into_iter().enumerate() {
        let mut flat = (*mesh).clone();
        flat.positions.local.iter_mut().for_each(|p| *p = flatten(*p));
        let flat = Arc::new(flat);
        for camera in cameras(&mesh) {
            for footprint in Footprint::ALL {
                for (compositing, lod) in [(Compositing::Own, 1.0), (Compositing::Gap, 1.0), (Compositing::Own, 0.5)] {
                    let style = PointStyle { footprint, compositing, lod, ..EXACT };
                    let job = testing::job(&flat, field(&mesh), &camera, (17, 17), dense());
                    let found = frame(&with_points(&job, style));
                    let is_light = |p: &[f32; 4]| p.iter().all(|c| c.is_finite() && (-1e-6..=1.0 + 1e-5).contains(c));
                    assert!(found.planes.color.pixels.iter().all(is_light), "case {i}, {style:?}");
                }
            }
        }
    }
    // Behind the eye, and none at all.
    let away = Camera { position: DVec3::splat(50.0), focal_point: DVec3::splat(60.0), ..cameras(&mesh)[0] };
    let job = job_of(&mesh, &away, 17, dense());
    let found = frame(&with_points(&job, EXACT));
    assert_eq!(found.stats.points_culled, found.stats.points_drawn);
    assert!(found.planes.color.pixels.iter().all(|p| *p == [0.0; 4]));
    let none = Arc::new(Selection { ids: CellSet::none(job.active.universe()), is_complete: false });
    assert_eq!(frame(&with_selection(&job, EXACT, none)).stats.fragments, 0);
}

#[test]
fn a_cell_that_covers_the_image_is_in_every_pixel() {
    let corners = [[0.0, 0.0, 3e3], [-3e3, -3e3, -1e3], [3e3, -3e3, -1e3], [0.0, 4e3, -1e3]];
    let points = corners.map(DVec3::from_array).to_vec();
    let mesh = built(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() });
    // Before its base, and in it.
    for z in [-2e3, 500.0] {
        let position = DVec3::new(0.0, 0.0, z);
        let camera = Camera { position, focal_point: position + DVec3::Z, ..cameras(&mesh)[0] };
        let job = job_of(&mesh, &camera, 33, nodes(&[(0.0, 0.0, 1e-4), (1.0, 1.0, 5e-4)]));
        for footprint in Footprint::ALL {
            for lod in [1.0, 0.9] {
                let found = frame(&with_points(&job, PointStyle { footprint, lod, ..EXACT }));
                // A square around the eye has no place on the image plane.
                assert!(
                    found.stats.fragments == 33 * 33 || (footprint == Footprint::Square && z > 0.0),
                    "{footprint}, {z}"
                );
                let pixels = &found.planes.color.pixels;
                assert!(pixels.iter().flatten().all(|c| c.is_finite()), "{footprint}, {z}");
                // The eye in it may have the slab of another shape, thinner than its chord, behind it.
                let has_light = pixels.iter().all(|p| p[3] > 0.01);
                assert!(has_light || (footprint != Footprint::Exact && z > 0.0), "{footprint}, {z}");
            }
            // One point has no gap.
            assert!(drawn(&job, PointStyle { footprint, ..GAP }).iter().all(|p| *p == [0.0; 4]));
        }
        assert!(is_within(difference(&drawn(&job, EXACT), &judged(&job))), "{z}");
    }
}

#[test]
fn what_a_ray_meets_behind_the_eye_is_no_fragment() {
    let mesh = built(jittered(kuhn_grid([3; 3]), &mut Random::new(12)));
    let job = job_of(&mesh, &cameras(&mesh)[1], 24, dense());
    let (view, mut vertices) = (job.local_view(), Vec::new());
    transform(&view, &mesh.positions.local, &job.scalars, None, &Cancel::new(), &mut vertices);
    let source = ShapeSource::new(&vertices, &job, &view, ELLIPSE);
    let (mut before, mut behind) = (0, 0);
    for point in (0..mesh.topology.tets.len() as u32).filter_map(|cell| source.point(cell)) {
        let Shape::Round(of) = &point.shape else { panic!("an ellipsoid") };
        for at in (0..24).flat_map(|row| (0..24).map(move |column| (column, row))).map(|(i, j)| view.ray(i, j)) {
            let chord = of.chord(view.perspective, at);
            let is_seen = chord.is_some_and(|chord| chord.middle + chord.half_depth(of.det()) > 0.0);
            assert_eq!(point.slab(&source, at).is_some(), is_seen, "cell {}", point.cell);
            (before, behind) = (before + usize::from(is_seen), behind + usize::from(chord.is_some() && !is_seen));
        }
    }
    assert!(before > 1000 && behind > 1000, "{before} {behind}");
}

#[test]
fn gaps_have_the_values_of_cells_where_cells_have_the_scalars() {
    let mesh = built(jittered(kuhn_grid([4; 3]), &mut Random::new(11)));
    let job = testing::of_cells(&job_of(&mesh, &cameras(&mesh)[0], 24, dense()));
    let of = |rows: f32| drawn(&testing::with_rows(&job, |_| rows), GAP);
    assert_ne!(of(-1.0), of(1.0), "the lowest row, and the highest");
}

#[test]
fn cells_of_one_scalar_are_those_whose_scalars_are_the_means() {
    let mesh = built(jittered(kuhn_grid([5; 3]), &mut Random::new(12)));
    // Means of four are exact in f32.
    let scalars: Vec<f32> = field(&mesh).iter().map(|s| (s * 64.0).round() / 64.0).collect();
    let mean = |tet: &[u32; 4]| tet.iter().map(|&v| scalars[v as usize]).sum::<f32>() / 4.0;
    let means: Vec<f32> = mesh.topology.tets.iter().map(mean).collect();
    let job = testing::job(&mesh, scalars, &cameras(&mesh)[0], (33, 33), dense());
    let of_cells = RenderJob { scalars: Scalars::Cells(Arc::new(means)), ..job.clone() };
    for style in [EXACT, ELLIPSE, PointStyle { lod: 0.5, ..EXACT }, PointStyle { exact_order: false, ..EXACT }] {
        let constant = drawn(&job, PointStyle { constant_scalar: true, ..style });
        assert!(is_within(difference(&constant, &drawn(&of_cells, style))), "{style:?}");
        assert!(!is_within(difference(&drawn(&job, style), &constant)), "{style:?}: it makes a difference");
    }
    for style in [GAP, PointStyle { footprint: Footprint::Circle, ..EXACT }] {
        let [a, b] = [false, true].map(|constant_scalar| drawn(&job, PointStyle { constant_scalar, ..style }));
        assert_eq!(a, b, "{style:?} have one anyhow");
    }
    // So has the other quantity of a joint table.
    let job = testing::with_rows(&job, |v| (v % 2) as f32);
    let of = |constant_scalar| drawn(&job, PointStyle { constant_scalar, ..EXACT });
    assert_ne!(of(true), of(false));
}

#[test]
fn invalid_points_are_refused() {
    let mesh = built(kuhn_grid([1; 3]));
    let job = job_of(&mesh, &cameras(&mesh)[0], 8, dense());
    let error = |job: RenderJob| Points::new().begin(job).unwrap_err().to_string();
    assert!(error(job.clone()).contains("no cells"));
    let good = with_points(&job, EXACT);
    for radius in [0.0, -1.0, 8.5, f64::NAN, f64::INFINITY] {
        let bad = good.points.clone().map(|p| PointScene { style: PointStyle { radius, ..EXACT }, ..p });
        assert!(error(RenderJob { points: bad, ..job.clone() }).contains("at most 8"), "{radius}");
    }
    for lod in [-0.1, 1.5, f64::NAN] {
        let bad = good.points.clone().map(|p| PointScene { style: PointStyle { lod, ..EXACT }, ..p });
        assert!(error(RenderJob { points: bad, ..job.clone() }).contains("0 to 1"), "{lod}");
    }
    let cells = Arc::new(Drawn { ids: vec![0, 99], is_complete: false });
    let bad = Some(PointScene { cells, style: EXACT });
    assert!(error(RenderJob { points: bad, ..job }).contains("cell 99"));
}
