use super::icon::MEAN;
use super::splat::Splat;
use super::*;
use crate::camera::{Camera, Lattice, PixelSet, Projection, Samples};
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
use crate::node_table::{Node, NodeTable};
use crate::render::cpu::raycast::Raycast;
use crate::render::reference::{Reference, flow_fragments};
use crate::render::testing::{self, difference, is_within};
use crate::render::{LayerFragments, RenderJob, Renderer};
use glam::DVec2;

#[cfg(feature = "gpu")]
mod gpu;
mod kernels;
mod mixture;
mod outside;
#[cfg(feature = "gpu")]
mod stages;

fn mesh(side: usize) -> Arc<Mesh> {
    Arc::new(Mesh::build(jittered(kuhn_grid([side; 3]), &mut Random::new(side as u64))).unwrap().0)
}

/// A field of vectors by a function of local coordinates.
fn vectors(mesh: &Mesh, of: impl Fn(DVec3) -> DVec3) -> [Arc<Vec<f32>>; 3] {
    let all: Vec<DVec3> = mesh.positions.local.iter().map(|p| of(p.as_dvec3())).collect();
    [0, 1, 2].map(|axis| Arc::new(all.iter().map(|v| v[axis] as f32).collect()))
}

fn vortex(p: DVec3) -> DVec3 {
    DVec3::new(-p.y, p.x, 0.4 + 0.3 * p.z)
}

fn scene(mesh: &Arc<Mesh>, style: FlowStyle, of: impl Fn(DVec3) -> DVec3) -> FlowScene {
    let travel = mesh.positions.local.iter().map(|p| f64::from(p.x) + 3.0).collect();
    FlowScene::new(mesh.clone(), Association::Point, style, vectors(mesh, of), Arc::new(travel))
}

fn camera(mesh: &Mesh) -> Camera {
    Camera::default_for(mesh.positions.world_bounds()).unwrap().orbit(25.0, 15.0).unwrap()
}

/// Perspective, parallel, with a wide angle, and with the eye inside.
fn cameras(mesh: &Mesh) -> [Camera; 4] {
    let outside = camera(mesh);
    let (lo, hi) = mesh.positions.world_bounds();
    let parallel = Camera { projection: Projection::Parallel { scale: 0.4 * (hi - lo).length() }, ..outside };
    let wide = Projection::Perspective { view_angle: 100.0 };
    let inside = Camera { position: 0.55 * lo + 0.45 * hi + DVec3::new(0.1, 0.05, -0.07), ..outside };
    [outside, parallel, Camera { projection: wide, ..inside }, inside]
}

fn local_view(mesh: &Arc<Mesh>, camera: &Camera, size_px: (usize, usize)) -> View {
    job(mesh, camera, size_px).local_view()
}

fn job(mesh: &Arc<Mesh>, camera: &Camera, size_px: (usize, usize)) -> RenderJob {
    let node = |scalar, rgb, tau| Node { scalar, rgb, tau };
    let table = NodeTable::new(vec![node(-1.0, [0.1, 0.2, 0.9], 0.05), node(1.0, [0.9, 0.3, 0.1], 0.8)]).unwrap();
    let scalars = mesh.positions.local.iter().map(|p| p.x + p.y * p.z).collect();
    testing::job(mesh, scalars, camera, size_px, Arc::new(table))
}

/// The image of a job with the fragments of a scene.
fn image(renderer: &mut dyn Renderer, job: &RenderJob, fragments: LayerFragments) -> Vec<[f32; 4]> {
    let job = RenderJob { fragments: Some(Arc::new(fragments)), ..job.clone() };
    renderer.render(job).unwrap().planes.color.pixels.clone()
}

#[test]
fn splats_in_a_volume_agree_with_the_judge() {
    let mesh = mesh(4);
    let icons = Icon::ALL.into_iter().cycle();
    for (number, (icon, camera)) in icons.zip(cameras(&mesh)).enumerate() {
        // Two of them are held, with some patterns blurred over more than a period.
        let held = if number < 2 { HeldFlow::default() } else { HeldFlow { time: 7.0, shutter: 0.8 } };
        let fidelity = FlowFidelity::ALL[number % 2];
        let scene = FlowScene { held, ..scene(&mesh, FlowStyle { icon, fidelity, ..FlowStyle::default() }, vortex) };
        let job = job(&mesh, &camera, (40, 32));
        let view = job.local_view();
        let [(found, drawn), (judged, asked)] =
            [scene.fragments(&view, None).unwrap(), flow_fragments(&scene, &view).unwrap()];
        assert!(drawn.splats > 10 && drawn.splats <= asked.splats && found.count() > 1000);
        let expected = image(&mut Reference::new(), &job, judged);
        let compared = difference(&image(&mut Raycast::new(), &job, found), &expected);
        assert!(is_within(compared), "{icon}: {compared:?}");
        // Another place in the pattern is noticed.
        let later = FlowScene { travel: Arc::new(scene.travel.iter().map(|way| way + 0.01).collect()), ..scene };
        let moved = image(&mut Raycast::new(), &job, later.fragments(&view, None).unwrap().0);
        assert!(!is_within(difference(&moved, &expected)), "{icon}");
    }
}

/// A scene of vectors of cells by a function of their centroids.
fn scene_of_cells(mesh: &Arc<Mesh>, style: FlowStyle, of: impl Fn(DVec3) -> DVec3) -> FlowScene {
    let corners = |tet: &[u32; 4]| tet.map(|vertex| mesh.positions.local[vertex as usize].as_dvec3());
    let centroids: Vec<DVec3> = mesh.topology.tets.iter().map(|tet| corners(tet).iter().sum::<DVec3>() / 4.0).collect();
    let vectors = [0, 1, 2].map(|axis| Arc::new(centroids.iter().map(|p| of(*p)[axis] as f32).collect()));
    let travel = Arc::new(centroids.iter().map(|p| p.x + 3.0).collect());
    FlowScene::new(mesh.clone(), Association::Cell, style, vectors, travel)
}

#[test]
fn splats_of_cells_agree_with_the_judge_and_are_others_than_those_of_vertices() {
    let mesh = mesh(3);
    for (icon, camera) in Icon::ALL.into_iter().zip(cameras(&mesh)) {
        let style = FlowStyle { icon, ..FlowStyle::default() };
        let scene = scene_of_cells(&mesh, style, vortex);
        let job = job(&mesh, &camera, (40, 32));
        let view = job.local_view();
        let [(found, drawn), (judged, asked)] =
            [scene.fragments(&view, None).unwrap(), flow_fragments(&scene, &view).unwrap()];
        assert!(drawn.splats > 10 && drawn.splats <= asked.splats && found.count() > 1000);
        let expected = image(&mut Reference::new(), &job, judged);
        let compared = difference(&image(&mut Raycast::new(), &job, found), &expected);
        assert!(is_within(compared), "{icon}: {compared:?}");
        // A shape that is off by a twentieth is noticed.
        let of_sites = scene.shapes.of_sites.iter().map(|shape| shape.map(|s| 1.05 * s)).collect();
        let wider = Arc::new(Shapes { of_sites, ..Shapes::of(&mesh, Association::Cell) });
        let other = FlowScene { shapes: wider, ..scene }.fragments(&view, None).unwrap().0;
        assert!(!is_within(difference(&image(&mut Raycast::new(), &job, other), &expected)), "{icon}");
    }
    // All cells have a splat, unless their centroid is clipped.
    let all = scene_of_cells(&mesh, FlowStyle::default(), vortex);
    assert_eq!(all.sites().len(), mesh.topology.tets.len());
    let clips = vec![Plane::new(&mesh.positions, mesh.positions.origin, DVec3::X).unwrap()];
    let clipped = FlowScene { clips, ..all.clone() };
    let count = |scene: &FlowScene| scene.sites().into_iter().filter(|&cell| scene.shows(cell)).count();
    let left = clipped.sites().into_iter().filter(|&cell| clipped.center(cell).x <= 0.0).count();
    assert!(count(&clipped) == left && left < count(&all) && left > 0);
}

#[test]
fn fewer_splats_of_cells_are_spread_by_volume() {
    let mesh = mesh(6);
    let cells = mesh.topology.tets.len() as u32;
    let mut last = Vec::new();
    for count in [1, 5, 80, 200, cells, cells + 9] {
        let found = chosen(&mesh, Association::Cell, count);
        assert_eq!(found.len(), count.min(cells) as usize);
        assert!(found.is_sorted_by(|a, b| a < b) && last.iter().all(|cell| found.contains(cell)));
        last = found;
    }
    // Along the order of the cells, every tenth of the volume has a tenth of the splats, to within the discrepancy of such shares: log2(N) / 3 + 1
    // at either end.
    let found = chosen(&mesh, Association::Cell, 100);
    let (mut before, mut shares) = (0.0, [0; 10]);
    for cell in 0..cells {
        let middle = before + 0.5 * mesh.cell_volume(cell);
        before += mesh.cell_volume(cell);
        if found.contains(&cell) {
            shares[(10.0 * middle / mesh.total_volume()) as usize] += 1;
        }
    }
    assert!(shares.iter().all(|share| (4..=16).contains(share)), "{shares:?}");
}

#[test]
fn any_samples_and_threads_have_the_fragments_of_the_whole_image() {
    let mesh = mesh(4);
    let scene = scene(&mesh, FlowStyle::default(), vortex);
    let whole = local_view(&mesh, &camera(&mesh), (37, 29));
    let (all, _) = scene.fragments(&whole, None).unwrap();
    // In no order.
    let pixels: Vec<u32> = (0..200).map(|i| i * 17 % (37 * 29)).collect();
    let listed = Samples::Pixels(Arc::new(PixelSet::new((37, 29), &pixels).unwrap()));
    for samples in [Samples::Lattice(Lattice::new(3.try_into().unwrap())), listed] {
        let view = View { samples, ..whole.clone() };
        let (some, _) = scene.fragments(&view, None).unwrap();
        for place in 0..some.pixels() {
            let (column, row) = view.pixel_at(place);
            assert_eq!(some.of_pixel(place), all.of_pixel(row * 37 + column));
        }
    }
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(alone.install(|| scene.fragments(&whole, None).unwrap().0) == all);
}

/// A splat of a uniform field at a vertex of a mesh.
fn splat_of(mesh: &Arc<Mesh>, vertex: u32, direction: DVec3, view: &View) -> Option<Splat> {
    let scene = scene(mesh, FlowStyle::default(), |_| direction);
    Splat::of(&scene, vertex, view)
}

#[test]
fn patterns_lie_along_the_projected_vector_and_move_by_its_projected_length() {
    let mesh = mesh(3);
    let mut random = Random::new(50);
    let view = local_view(&mesh, &camera(&mesh), (640, 480));
    let (positions, mut compared) = (&mesh.positions.local, 0);
    let on_screen = |at: DVec3| {
        let at = view.to_view(at);
        let px = |share: f64, count: usize| 0.5 * share * count as f64;
        DVec2::new(
            px(at.x / at.z / view.half_width, view.width_px),
            -px(at.y / at.z / view.half_height, view.height_px),
        )
    };
    for _ in 0..50 {
        let direction = DVec3::new(random.signed(), random.signed(), random.signed()).normalize();
        for vertex in (0..positions.len() as u32).step_by(7) {
            let Some(splat) = splat_of(&mesh, vertex, direction, &view) else { continue };
            let (at, step) = (positions[vertex as usize].as_dvec3(), 1e-5);
            let way = (on_screen(at + step * direction) - on_screen(at - step * direction)) / (2.0 * step);
            let (along, [frequency, _]) = splat.pattern();
            if way.length() * frequency > 0.0 && splat.is_whole() {
                // Differences of numbers of size 300, 2e-5 apart.
                assert!((along - way.normalize()).length() < 1e-5, "{along} {way}");
                // A period on the screen is the projection of one in space: what moves |v| there moves |J v| here.
                let period = scene(&mesh, FlowStyle::default(), vortex).period();
                assert!((way.length() * period * frequency - 1.0).abs() < 1e-5);
                compared += 1;
            }
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn a_vector_along_the_ray_has_no_pattern_and_turning_does_not_move_one() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (640, 480));
    let vertex = (mesh.positions.local.len() / 2) as u32;
    let at = mesh.positions.local[vertex as usize].as_dvec3();
    // To the bits of the direction, which is f32.
    let splat = splat_of(&mesh, vertex, (at - view.eye).normalize(), &view).unwrap();
    assert!(splat.contrast < 1e-12, "{}", splat.contrast);
    let scene = scene(&mesh, FlowStyle::default(), vortex);
    let phases = |camera: &Camera, size_px, style| {
        let scene = FlowScene { style, ..scene.clone() };
        let view = local_view(&mesh, camera, size_px);
        Splat::of(&scene, vertex, &view).unwrap().phase
    };
    let first = phases(&camera(&mesh), (640, 480), FlowStyle::default());
    for degrees in [0.1, 1.0, 90.0] {
        let turned = camera(&mesh).orbit(degrees, 0.0).unwrap();
        assert_eq!(phases(&turned, (64, 48), FlowStyle { splats: Some(3), ..FlowStyle::default() }), first);
    }
}

#[test]
fn near_the_ray_the_pattern_fades_instead_of_spinning() {
    // One splat, looked at nearly along its vector, while the camera turns by a tenth of a degree.
    let mesh = mesh(3);
    let vertex = (mesh.positions.local.len() / 2) as u32;
    let at = mesh.positions.local[vertex as usize].as_dvec3();
    let straight = camera(&mesh);
    let direction = (at - local_view(&mesh, &straight, (200, 200)).eye).normalize();
    let sums = IconSums::of(Icon::Strokes);
    let mut most = [0.0f64; 2];
    let sample = |degrees: f64, fades: bool| -> Vec<f64> {
        let view = local_view(&mesh, &straight.orbit(degrees, 0.05).unwrap(), (200, 200));
        let splat = splat_of(&mesh, vertex, direction, &view).unwrap();
        let splat = if fades { splat } else { splat.without_fading() };
        (0..9).map(|i| splat.opacity([f64::from(i % 3 - 1) * 4.0, f64::from(i / 3 - 1) * 4.0], 0.5, sums)).collect()
    };
    for k in -5..5 {
        for (most, fades) in most.iter_mut().zip([true, false]) {
            let [a, b] = [0.1 * f64::from(k), 0.1 * f64::from(k + 1)].map(|degrees| sample(degrees, fades));
            *most = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(*most, f64::max);
        }
    }
    // Half a degree from the ray the contrast is at most 3 (3 sin 0.5)^2 = 2e-3, of which a step changes a part. The clamp alone, as printed
    // in the paper, turns the pattern around within a step.
    assert!(most[0] < 1e-3 && most[1] > 20.0 * most[0], "{most:?}");
}

#[test]
fn the_average_over_a_period_does_not_pulse() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (64, 64));
    let vertex = (mesh.positions.local.len() / 2) as u32;
    for icon in Icon::ALL {
        let (sums, style) = (IconSums::of(icon), FlowStyle { icon, ..FlowStyle::default() });
        let steps = 256;
        let at_way = |k: usize| {
            let mut scene = scene(&mesh, style, vortex);
            let period = scene.period() * mesh.positions.scale;
            scene.travel = Arc::new(vec![period * k as f64 / steps as f64; mesh.positions.local.len()]);
            // Averaged across as well, over the place by chance.
            let splat = Splat::of(&scene, vertex, &view).unwrap();
            (0..64).map(|row| splat.across(f64::from(row) / 64.0).opacity([2.0, 1.0], 1.0, sums)).sum::<f64>() / 64.0
        };
        let mean = (0..steps).map(at_way).sum::<f64>() / steps as f64;
        let expected = MEAN * f64::from(lanes::window(1.0));
        assert!((mean - expected).abs() < 1e-3 * expected, "{icon}: {mean} {expected}");
    }
}

#[test]
fn what_is_not_finite_hidden_or_without_a_way_has_no_splat() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (64, 48));
    let count = |scene: &FlowScene| scene.fragments(&view, None).unwrap().1.splats;
    let all = scene(&mesh, FlowStyle::default(), vortex);
    let most = count(&all);
    assert!(most > 40);
    assert_eq!(count(&scene(&mesh, FlowStyle::default(), |_| DVec3::ZERO)), 0);
    for bad in [f64::NAN, f64::INFINITY] {
        let holes = scene(&mesh, FlowStyle::default(), |p| if p.x > 0.0 { DVec3::splat(bad) } else { vortex(p) });
        assert!((1..most).contains(&count(&holes)));
    }
    // Lengths whose squares leave f64's range of f32, and denormals.
    for scale in [1e38, 1e-45, 1e-30] {
        let far = count(&scene(&mesh, FlowStyle::default(), |_| scale * DVec3::ONE));
        assert!(far >= most, "{scale}: {far} {most}");
    }
    let shown = Arc::new(mesh.positions.local.iter().map(|p| p.y > 0.0).collect());
    assert!((1..most).contains(&count(&FlowScene { shown, ..all.clone() })));
    let infinite = FlowScene { travel: Arc::new(vec![f64::INFINITY; mesh.positions.local.len()]), ..all.clone() };
    assert_eq!(count(&infinite), most);
    let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0, 0.0, 0.5], tau: 0.0 }]).unwrap();
    let scalars = crate::field::Scalars::Vertices(Arc::new(vec![f32::NAN; mesh.positions.local.len()]));
    let colors = FlowColors::Of(FieldBeside { scalars, colors: Arc::new(table) });
    assert_eq!(count(&FlowScene { colors, ..all.clone() }), 0);
    // Opacity 0 leaves nothing.
    let clear = FlowScene { style: FlowStyle { opacity: 0.0, ..all.style }, ..all };
    assert_eq!(clear.fragments(&view, None).unwrap().0.count(), 0);
}

#[test]
fn a_held_moment_flows_on_by_its_speeds_and_what_is_too_fast_is_blurred() {
    let mesh = mesh(3);
    let view = local_view(&mesh, &camera(&mesh), (64, 48));
    let at =
        |held: HeldFlow| FlowScene { held, ..scene(&mesh, FlowStyle { speed: 1.5, ..FlowStyle::default() }, vortex) };
    let [now, later] = [0.0, 0.3].map(|time| at(HeldFlow { time, shutter: 0.0 }));
    for vertex in now.sites() {
        let way = 1.5 * 0.3 * now.vector(vertex).length() / mesh.positions.scale;
        let [from, to] = [&now, &later].map(|scene| scene.phase(vertex));
        // Backwards through the pattern, so that the pattern goes forwards; the places are rounded a few times each.
        let moved = (from[0] - to[0] - way / now.period()).rem_euclid(1.0);
        assert!(moved.min(1.0 - moved) < 1e-12 && from[1] == to[1], "{moved}");
    }
    let of = |shutter: f64, vertex| Splat::of(&at(HeldFlow { time: 0.0, shutter }), vertex, &view);
    let sums = IconSums::of(Icon::default());
    let mut fast = 0;
    for vertex in now.sites() {
        let (Some(sharp), Some(slow), Some(spun)) = (of(0.0, vertex), of(0.1, vertex), of(1e9, vertex)) else {
            continue;
        };
        assert!(sharp.blur == 0.0 && slow.blur > 0.0 && spun.blur > 1e6);
        fast += u64::from(FlowCounts::is_fast(slow.blur));
        // Blurred over many periods, a row of the pattern is its mean, and all rows together are the icon's.
        let rows = (0..64).map(|row| spun.across(f64::from(row) / 64.0).opacity([2.0, 1.0], 1.0, sums));
        let mean = rows.sum::<f64>() / 64.0;
        // Sums in f32, as in icon.rs, and a product by the window.
        assert!((mean / (MEAN * f64::from(lanes::window(1.0))) - 1.0).abs() < 5e-7, "{mean}");
    }
    let (fragments, counts) = at(HeldFlow { time: 0.0, shutter: 0.1 }).fragments(&view, None).unwrap();
    assert!(
        fragments.count() > 0 && counts.fast == fast && now.fragments(&view, None).unwrap().1.fast == 0,
        "{counts:?}"
    );
    assert!(at(HeldFlow { time: 0.0, shutter: 1e9 }).fragments(&view, None).unwrap().1.fast == counts.splats);
}

#[test]
fn few_splats_fill_as_much_as_one_for_each_vector() {
    for sites in [Association::Point, Association::Cell] {
        assert_eq!(FlowStyle::few_on(&mesh(3), sites), FlowStyle::default());
        let mesh = mesh(12);
        let few = FlowStyle::few_on(&mesh, sites);
        assert!(few.check().is_ok() && few.splats == Some(1000) && few.size > 0.5, "{few:?}");
        let count = Shapes::of(&mesh, sites).of_sites.len();
        // Volumes are as cubes of sizes; a few roundings each.
        let [usual, wider] = [FlowStyle::default().size, few.size].map(|size| size.powi(3));
        assert!((1000.0 * wider / (count as f64 * usual) - 1.0).abs() < 1e-12);
        let period = usual_period(&mesh, sites) * mesh.positions.scale;
        assert!((few.length.unwrap() / period - few.size / FlowStyle::default().size).abs() < 1e-12);
    }
}

#[test]
fn what_is_limited_is_at_least_what_is_listed() {
    let mesh = mesh(4);
    for size in [0.01, 0.5, 30.0] {
        for camera in cameras(&mesh) {
            let scene = scene(&mesh, FlowStyle { size, ..FlowStyle::default() }, vortex);
            let view = local_view(&mesh, &camera, (40, 32));
            let splats = scene.sites().into_iter().filter_map(|vertex| Splat::of(&scene, vertex, &view));
            let (mut rows, mut limited) = (0, 0);
            for splat in splats {
                rows += splat.rows(view.height_px).len() as u64;
                limited += splat.most_pixels(&view);
            }
            let fragments = scene.fragments(&view, None).unwrap().0.count() as u64;
            assert!(limited >= rows && limited >= fragments && fragments > 0, "{size}: {limited} {rows} {fragments}");
        }
    }
}

#[test]
fn more_fragments_than_memory_is_for_are_refused() {
    let mesh = mesh(8);
    // Each of 729 splats covers the image.
    let style = FlowStyle { size: 1e4, ..FlowStyle::default() };
    let view = local_view(&mesh, &camera(&mesh), (1000, 1000));
    let error = scene(&mesh, style, vortex).fragments(&view, None).unwrap_err().to_string();
    assert!(error.contains("fewer splats"), "{error}");
}

#[test]
fn fewer_splats_are_a_part_of_more_and_spread_evenly() {
    let mesh = mesh(6);
    let vertices = mesh.positions.local.len() as u32;
    let mut last = Vec::new();
    for count in [1, 5, 40, 41, 200, vertices, vertices + 9] {
        let found = chosen(&mesh, Association::Point, count);
        assert_eq!(found.len(), count.min(vertices) as usize);
        assert!(found.is_sorted_by(|a, b| a < b) && last.iter().all(|vertex| found.contains(vertex)));
        last = found;
    }
    // Of 40, each octant has its share.
    let found = chosen(&mesh, Association::Point, 40);
    for octant in 0..8 {
        let is_in = |v: &&u32| {
            let p = mesh.positions.local[**v as usize];
            [p.x, p.y, p.z].iter().enumerate().all(|(axis, x)| (*x > 0.0) == (octant >> axis & 1 == 1))
        };
        let count = found.iter().filter(is_in).count();
        assert!((2..=9).contains(&count), "{octant}: {count}");
    }
}

#[test]
fn styles_out_of_range_are_refused() {
    let good = FlowStyle::default();
    assert!(good.check().is_ok());
    let bad = [
        FlowStyle { size: 0.0, ..good },
        FlowStyle { size: f64::NAN, ..good },
        FlowStyle { length: Some(-1.0), ..good },
        FlowStyle { length: Some(f64::INFINITY), ..good },
        FlowStyle { opacity: 1.5, ..good },
        FlowStyle { speed: -1.0, ..good },
        FlowStyle { splats: Some(0), ..good },
    ];
    assert!(bad.iter().all(|style| style.check().is_err()));
}
