//! Isosurfaces in the cells: against closed forms, against the judge, and from renderer to renderer.

use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::{LAYERS, ROWS, SCALARS, noisy, with_joint_table};
use super::*;
use crate::meshes::{build, grid, noise, sample};
use tetreel::image::Planes;
use tetreel::optics::OpticsKind;
use tetreel::render::surfaces::{
    Isosurface, Light, Normals, SURFACES_MAX, SurfaceError, SurfaceScene, SurfaceShading, VertexGradients,
};
use tetreel::task::Cancel;
use tetreel::visibility::Skip;

pub(super) const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 35.0 };
pub(super) const OUTSIDE: DVec3 = DVec3::new(3.0, 2.0, 2.5);

pub(super) fn surface(value: f64, front: [f64; 3], opacity: f64) -> Isosurface {
    Isosurface { front: Some(front), opacity, ..Isosurface::new(value) }
}

pub(super) fn shading(normals: Normals) -> SurfaceShading {
    SurfaceShading { normals, ..Default::default() }
}

/// The job with surfaces in its volume.
pub(super) fn with_surfaces(job: &RenderJob, surfaces: &[Isosurface], shading: SurfaceShading) -> RenderJob {
    let mut scene = SurfaceScene::new(surfaces, shading, &job.table).unwrap();
    if scene.lacks_gradients() {
        let found = VertexGradients::default().update(
            &job.mesh,
            job.scalars.of_vertices().unwrap(),
            &job.active,
            &Cancel::new(),
        );
        scene = scene.with_gradients(found.unwrap());
    }
    RenderJob { surfaces: Some(scene), ..job.clone() }
}

/// The same without a volume.
pub(super) fn alone(job: &RenderJob, surfaces: &[Isosurface], shading: SurfaceShading) -> RenderJob {
    RenderJob { table: Arc::new(NodeTable::transparent()), ..with_surfaces(job, surfaces, shading) }
}

pub(super) fn planes(path: &str, job: &RenderJob) -> Planes {
    match path {
        "raycast" => Raycast::new().render(job.clone()).unwrap().planes.clone(),
        "portable" => Raycast::portable().render(job.clone()).unwrap().planes.clone(),
        "faces" => havs(&with_all_faces(job)).planes,
        "points" => points(job).planes,
        #[cfg(feature = "gpu")]
        "walk on the GPU" => gpu::render(job).unwrap().planes,
        #[cfg(feature = "gpu")]
        "faces on the GPU" => super::havs::gpu::render(&with_all_faces(job)).unwrap().planes,
        #[cfg(feature = "gpu")]
        "points on the GPU" => gpu::points(job).unwrap().planes,
        _ => Reference::new().render(job.clone()).unwrap().planes.clone(),
    }
}

/// The renderers that there are on this machine beside the judge; the last three on its GPU.
pub(super) fn paths() -> Vec<&'static str> {
    let on_cpu = ["raycast", "portable", "faces", "points"];
    #[cfg(feature = "gpu")]
    if gpu::context().is_some() {
        return [&on_cpu[..], &["walk on the GPU", "faces on the GPU", "points on the GPU"]].concat();
    }
    on_cpu.to_vec()
}

/// A mesh with places that are no part of it: holes where scalars are not numbers, and where there are no cells.
pub(super) fn with_holes(size: (usize, usize), position: DVec3, projection: Projection) -> RenderJob {
    let mesh = Arc::new(build(grid(7, 0.15, 11, |p| (p - DVec3::new(0.4, 0.2, 0.3)).length() > 0.35)));
    let mut scalars = sample(&mesh, wave);
    let vertices = scalars.len();
    for i in 0..6 {
        scalars[vertices / 7 * i + 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][i % 3];
    }
    job(&mesh, scalars, &camera(position, projection), size, dense())
}

/// Cells a thousand times as wide as high.
pub(super) fn slivers() -> RenderJob {
    let mut raw = grid(5, 0.15, 3, |_| true);
    raw.points.iter_mut().for_each(|p| p.z *= 1e-3);
    let mesh = Arc::new(build(raw));
    let scalars = sample(&mesh, |p| wave(DVec3::new(p.x, p.y, 1e3 * p.z)));
    job(&mesh, scalars, &camera(DVec3::new(1.5, 1.1, 0.9), PERSPECTIVE), (60, 41), dense())
}

pub(super) const RED: [f64; 3] = [1.0, 0.2, 0.1];
pub(super) const BLUE: [f64; 3] = [0.1, 0.3, 1.0];

pub(super) fn sheets() -> Vec<Isosurface> {
    let back = Some([0.1, 0.6, 0.2]);
    vec![
        surface(0.75, RED, 0.5),
        Isosurface { back, ..surface(-0.6, BLUE, 0.35) },
        surface(0.2, [0.9; 3], 0.6),
        // A second one at the same value, and one in the colours of the transfer function.
        surface(0.2, [0.2, 0.2, 0.0], 0.2),
        Isosurface { opacity: 0.8, ..Isosurface::new(-0.9) },
    ]
}

/// Jobs with eyes outside and inside, holes, slivers, several sheets and one opaque one; with their volume and without.
pub(super) fn scenes() -> Vec<(String, RenderJob)> {
    let outside = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    let parallel = with_holes((50, 50), OUTSIDE, Projection::Parallel { scale: 1.7 });
    let eye = DVec3::new(-0.31, -0.22, -0.17);
    let inside = with_holes((40, 40), eye, Projection::Perspective { view_angle: 80.0 });
    let mut scenes = Vec::new();
    for (name, base) in [("outside", outside), ("parallel", parallel), ("inside", inside), ("slivers", slivers())] {
        for normals in [Normals::None, Normals::Cell, Normals::Vertex] {
            let shading = shading(normals);
            scenes.push((format!("{name}, {normals}"), with_surfaces(&base, &sheets(), shading)));
            scenes.push((format!("{name}, {normals}, alone"), alone(&base, &sheets(), shading)));
        }
        let light =
            SurfaceShading { normals: Normals::Vertex, light: Light::From([0.3, -0.5, 2.0]), ..Default::default() };
        scenes.push((format!("{name}, from above"), alone(&base, &sheets(), light)));
        let opaque = [surface(0.1, RED, 1.0), surface(-0.7, BLUE, 0.4)];
        let mut job = with_surfaces(&base, &opaque, shading(Normals::Cell));
        job.skip = Skip::ALL;
        scenes.push((format!("{name}, opaque"), job));
    }
    scenes
}

/// Depths of the scenes are off by less than this share of their extent (2 a side).
pub(super) const DEPTH_BOUND: f64 = 1e-5 * 2.0;

/// Pixels in which both see something, or only one of them; and how far depths are apart at most.
pub(super) fn compare_depths(a: &Planes, b: &Planes) -> (usize, f64) {
    let (mut unmatched, mut most) = (0, 0.0_f64);
    for (a, b) in a.depth.pixels.iter().zip(&b.depth.pixels) {
        match (a.is_finite(), b.is_finite()) {
            (true, true) => most = most.max((f64::from(*a) - f64::from(*b)).abs()),
            (false, false) => {}
            _ => unmatched += 1,
        }
    }
    (unmatched, most)
}

#[test]
fn surfaces_are_drawn_as_the_judge_draws_them() {
    let mut worst = (0.0_f64, 0.0_f64, 0.0_f64);
    for (name, job) in scenes() {
        let judge = planes("reference", &job);
        assert!(judge.color.pixels.iter().filter(|p| p[3] > 0.1).count() > 100, "{name}");
        for path in ["raycast", "faces"] {
            let found = planes(path, &job);
            let (rmse, max) = difference(&found.color, &judge.color);
            let (unmatched, depth) = compare_depths(&found, &judge);
            worst = (worst.0.max(rmse), worst.1.max(max), worst.2.max(depth));
            assert!(is_within(&found.color, &judge.color), "{name}, {path}: rmse {rmse:.1e}, max {max:.1e}");
            assert!(unmatched == 0 && depth <= DEPTH_BOUND, "{name}, {path}: {unmatched} pixels, {depth:.1e}");
        }
        assert_noticed(&name, &planes("raycast", &stretched(&job)).color, &judge.color);
    }
    eprintln!("surfaces against the judge: rmse {:.1e}, max {:.1e}, depth {:.1e}", worst.0, worst.1, worst.2);
}

#[test]
fn surfaces_and_sections_have_the_colours_of_another_field_as_the_judge_has_them() {
    use tetreel::node_table::Node;
    use tetreel::render::surfaces::{Cut, FieldBeside, cut_planes};
    let node = |scalar: f64, rgb: [f64; 3]| Node { scalar, rgb, tau: 0.0 };
    let colors = NodeTable::new(vec![node(-1.0, [0.1, 0.2, 0.9]), node(0.0, [0.9; 3]), node(1.0, [0.9, 0.1, 0.0])]);
    let colors = Arc::new(colors.unwrap());
    for base in [with_holes((61, 47), OUTSIDE, PERSPECTIVE), slivers()] {
        let mut scalars = sample(&base.mesh, |p| (3.0 * p.x).sin() * p.y + 50.0 * p.z);
        // It may have no value where the field that is drawn has one.
        scalars[base.mesh.topology.tets[5][0] as usize] = f32::NAN;
        let beside = FieldBeside { scalars: Arc::new(scalars).into(), colors: colors.clone() };
        let cut = Cut { point: [0.1, 0.0, 0.0], normal: [1.0, 0.2, 0.0], clips: false, by: Some(0) };
        let planes_of = cut_planes(&[cut], &base.mesh.positions).unwrap();
        let surfaces = [Isosurface { by: Some(0), ..surface(0.2, RED, 0.6) }, surface(-0.6, BLUE, 0.35)];
        let plain = alone(&base, &surfaces, shading(Normals::Vertex));
        let scene = plain.surfaces.clone().unwrap().with_planes(planes_of);
        let job = RenderJob { surfaces: Some(scene.clone().with_beside(vec![beside], vec![Some(0)])), ..plain.clone() };
        let judge = planes("reference", &job);
        for path in ["raycast", "faces"] {
            assert_within(path, &planes(path, &job).color, &judge.color);
        }
        assert!(planes("raycast", &job) == planes("portable", &job));
        let own = RenderJob { surfaces: Some(scene), ..plain };
        assert_noticed("its own colours", &planes("raycast", &own).color, &judge.color);
        assert_eq!(planes("raycast", &own).depth, planes("raycast", &job).depth);
    }
}

#[test]
fn a_lit_volume_is_as_the_judge_lights_it() {
    for base in [with_holes((61, 47), OUTSIDE, PERSPECTIVE), slivers()] {
        for normals in [Normals::Cell, Normals::Vertex] {
            let lit = SurfaceShading { volume: true, ..shading(normals) };
            for surfaces in [&[][..], &sheets()] {
                let job = with_surfaces(&base, surfaces, lit);
                let judge = planes("reference", &job);
                for path in ["raycast", "faces"] {
                    assert_within(path, &planes(path, &job).color, &judge.color);
                }
                assert!(planes("raycast", &job) == planes("portable", &job));
                let unlit = planes("raycast", &with_surfaces(&base, surfaces, shading(normals)));
                assert_noticed("unlit", &unlit.color, &judge.color);
            }
        }
    }
}

#[test]
fn a_surface_that_moves_is_noticed() {
    let base = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    let of = |value: f64, normals| alone(&base, &[surface(value, RED, 0.7)], shading(normals));
    let judge = planes("reference", &of(0.2, Normals::Cell));
    let moved = planes("raycast", &of(0.205, Normals::Cell));
    assert_noticed("moved by 2e-3 of the range", &moved.color, &judge.color);
    assert!(compare_depths(&moved, &judge).1 > DEPTH_BOUND);
    assert_noticed("smooth", &planes("raycast", &of(0.2, Normals::Vertex)).color, &judge.color);
}

#[test]
fn rays_side_by_side_see_the_bits_that_they_see_one_by_one() {
    for (name, job) in scenes() {
        assert!(planes("raycast", &job) == planes("portable", &job), "{name}");
    }
}

#[test]
fn all_optics_and_joint_tables_have_surfaces() {
    let base = with_holes((40, 31), OUTSIDE, PERSPECTIVE);
    for optics in [OpticsKind::Partial, OpticsKind::Table3d] {
        let job = RenderJob { optics, ..base.clone() };
        let lit = with_surfaces(&job, &sheets(), shading(Normals::Cell));
        assert!(planes("raycast", &lit) == planes("portable", &lit), "{optics}");
        let (rmse, _) = difference(&planes("raycast", &lit).color, &planes("reference", &lit).color);
        let (without, _) = difference(&planes("raycast", &job).color, &planes("reference", &job).color);
        // Sheets hide a part of what the volume has wrong.
        assert!(rmse <= 1.2 * without + BOUND_RMSE, "{optics}: {rmse:.1e}, without surfaces {without:.1e}");
        assert_noticed("without", &planes("raycast", &job).color, &planes("raycast", &lit).color);
    }
    let joint = super::joint::scene(4, PERSPECTIVE);
    let vertex = sample(&joint.mesh, |p| 0.3 * p.x + 0.5 * p.y);
    let cell = (0..joint.mesh.topology.tets.len() as u64).map(|i| noise(7, i) as f32).collect();
    let joint = with_joint_table(&joint, noisy(&SCALARS, &ROWS, &LAYERS, 3), Some(vertex), Some(cell));
    let lit = with_surfaces(&joint, &[surface(0.3, RED, 0.5), surface(0.6, BLUE, 0.5)], shading(Normals::Cell));
    let judge = planes("reference", &lit);
    for path in ["raycast", "faces"] {
        assert_within(path, &planes(path, &lit).color, &judge.color);
    }
    assert_noticed("joint", &planes("raycast", &joint).color, &judge.color);
}

/// The field x + y / 2 in a cube of 2 a side: surfaces are planes.
fn slanted(size: (usize, usize), projection: Projection) -> RenderJob {
    let mesh = Arc::new(build(grid(4, 0.15, 5, |_| true)));
    let scalars = sample(&mesh, |p| p.x + 0.5 * p.y);
    job(&mesh, scalars, &camera(DVec3::new(5.0, 0.0, 0.0), projection), size, NodeTable::transparent())
}

#[test]
fn a_plane_has_the_depth_and_the_light_of_the_closed_form() {
    let parallel = Projection::Parallel { scale: 0.9 };
    for projection in [parallel, PERSPECTIVE] {
        let base = slanted((33, 33), projection);
        let view = &base.view;
        let normal = DVec3::new(1.0, 0.5, 0.0).normalize();
        for normals in [Normals::Cell, Normals::Vertex] {
            // From x = 5 the ray goes down the gradient: it sees the back of the nearer plane first.
            let front = surface(0.0, BLUE, 1.0);
            let near = Isosurface { back: Some([0.5, 1.0, 0.25]), ..surface(0.3, RED, 0.25) };
            let lit = alone(&base, &[front, near], shading(normals));
            for path in paths().into_iter().chain(["reference"]) {
                let found = planes(path, &lit);
                let mut seen = 0;
                for pixel in 0..33 * 33 {
                    let (px, py) = view.ray(pixel % 33, pixel / 33);
                    let (origin, direction) = if view.perspective {
                        (view.eye, view.forward + px * view.right + py * view.up)
                    } else {
                        (view.eye + px * view.right + py * view.up, view.forward)
                    };
                    let depth = |value: f64| {
                        let along = |d: DVec3| d.x + 0.5 * d.y;
                        let depth = (value - along(origin)) / along(direction);
                        let point = origin + depth * direction;
                        (depth, point.abs().max_element() < 0.999)
                    };
                    let ((near_depth, sees_near), (_, sees_far)) = (depth(0.3), depth(0.0));
                    if !(sees_near && sees_far) {
                        continue;
                    }
                    seen += 1;
                    let cosine = normal.dot(direction.normalize()).abs();
                    let expected: Vec<f64> = [0.5, 1.0, 0.25]
                        .into_iter()
                        .zip(BLUE)
                        .map(|(near, far)| cosine * (0.25 * near + 0.75 * far))
                        .chain([1.0])
                        .collect();
                    let color = found.color.pixels[pixel];
                    // Scalars are rounded to 2^-24, colours to that of f32.
                    for (found, expected) in color.iter().zip(&expected) {
                        assert!((f64::from(*found) - expected).abs() < 1e-5, "{path}: {color:?}, not {expected:?}");
                    }
                    assert!((f64::from(found.depth.pixels[pixel]) - near_depth).abs() < 1e-5, "{path}");
                }
                assert!(seen > 200, "{path}: {seen}");
            }
        }
    }
}

#[test]
fn a_light_from_the_side_reaches_what_faces_it_on_the_side_of_the_eye() {
    let base = slanted((9, 9), Projection::Parallel { scale: 0.5 });
    let normal = DVec3::new(1.0, 0.5, 0.0).normalize();
    for path in paths() {
        let center = |light: [f64; 3]| {
            let shading = SurfaceShading { normals: Normals::Cell, light: Light::From(light), ..Default::default() };
            planes(path, &alone(&base, &[surface(0.0, [1.0; 3], 1.0)], shading)).color.pixels[40]
        };
        for light in [[1.0, 0.0, 0.0], [1.0, 3.0, 1.0], [0.0, 0.2, 0.0]] {
            let expected = normal.dot(DVec3::from(light).normalize());
            assert!((f64::from(center(light)[0]) - expected).abs() < 1e-6, "{path}, {light:?}");
        }
        // A direction has no length.
        for length in [1e-300, 1e200] {
            let expected = normal.dot(DVec3::new(1.0, 3.0, 1.0).normalize());
            let found = f64::from(center([length, 3.0 * length, length])[0]);
            assert!((found - expected).abs() < 1e-6, "{path}, {length:e}: {found}");
        }
        // From behind it is dark, and there.
        assert_eq!(center([-1.0, 0.0, 0.0]), [0.0, 0.0, 0.0, 1.0], "{path}");
    }
}

#[test]
fn isovalues_at_scalars_of_vertices_are_met_once_and_constant_cells_never() {
    // Integers at all vertices: x from 0 to 6, flat between 2 and 4.
    let mesh = Arc::new(build(grid(6, 0.0, 1, |_| true)));
    let scalars = sample(&mesh, |p| match (3.0 * p.x + 3.0).round() as i32 {
        x @ 0..=2 => f64::from(x),
        3 | 4 => 2.0,
        x => f64::from(x - 2),
    });
    let base = job(
        &mesh,
        scalars,
        &camera(DVec3::new(-5.0, 0.0, 0.0), Projection::Parallel { scale: 0.7 }),
        (20, 20),
        NodeTable::transparent(),
    );
    // At the greatest scalar, which is met where the mesh ends, rounding decides for the judge.
    let opacity_of = |value: f64| {
        let judge = (value != 4.0).then_some("reference");
        let job = alone(&base, &[surface(value, [1.0; 3], 0.5)], shading(Normals::Cell));
        let images: Vec<_> = paths().into_iter().chain(judge).map(|path| (path, planes(path, &job))).collect();
        let first = images[0].1.color.pixels[0][3];
        for (path, image) in &images {
            let other = image.color.pixels.iter().position(|p| p[3] != first);
            let other = other.map(|pixel| (pixel, image.color.pixels[pixel], image.depth.pixels[pixel]));
            assert!(other.is_none(), "isovalue {value}, {path}: {other:?}, {first} elsewhere");
        }
        (first, images[0].1.depth.pixels[0])
    };
    let met = |value: f64, x: f64| {
        let (opacity, depth) = opacity_of(value);
        assert_eq!(opacity, 0.5, "isovalue {value}: met once");
        assert!((f64::from(depth) - (5.0 + x)).abs() < 1e-5, "isovalue {value} at depth {depth}");
    };
    met(1.0, -2.0 / 3.0);
    // Where the flat part begins, not where it ends.
    met(2.0, -1.0 / 3.0);
    met(4.0, 1.0);
    met(3.5, 1.0 - 1.0 / 6.0);
    // Nothing lies below the least scalar, and nothing above what is more than the greatest.
    assert_eq!(opacity_of(0.0).0, 0.0);
    assert_eq!(opacity_of(4.0f64.next_up()).0, 0.0);
}

#[test]
fn a_sphere_is_approached_with_the_order_of_linear_interpolation() {
    // Root mean squares of depth and light, grazing pixels left out, of the sphere |p| = 0.7.
    let errors = |n: usize, normals: Normals| {
        let mesh = Arc::new(build(grid(n, 0.15, 4, |_| true)));
        let scalars = sample(&mesh, |p| p.length());
        let camera = camera(DVec3::new(2.0, 1.5, 3.0), Projection::Parallel { scale: 0.75 });
        let base = job(&mesh, scalars, &camera, (64, 64), NodeTable::transparent());
        let found = planes("raycast", &alone(&base, &[surface(0.7, [1.0; 3], 1.0)], shading(normals)));
        let view = &base.view;
        let distance = view.eye.length();
        let (mut depth, mut light, mut count) = (0.0, 0.0, 0.0);
        for pixel in 0..64 * 64 {
            let (px, py) = view.ray(pixel % 64, pixel / 64);
            let beside = px * px + py * py;
            let cosine = (1.0 - beside / 0.49).max(0.0).sqrt();
            if cosine < 0.5 {
                continue;
            }
            depth += (f64::from(found.depth.pixels[pixel]) - (distance - 0.7 * cosine)).powi(2);
            light += (f64::from(found.color.pixels[pixel][0]) - cosine).powi(2);
            count += 1.0;
        }
        [(depth / count).sqrt(), (light / count).sqrt()]
    };
    for (normals, order_of_light) in [(Normals::Cell, 0.9), (Normals::Vertex, 0.9)] {
        let [coarse, fine] = [12, 24].map(|n| errors(n, normals));
        let order = |i: usize| (coarse[i] / fine[i]).log2();
        eprintln!("sphere, {normals}: {coarse:?} to {fine:?}, orders {:.2} {:.2}", order(0), order(1));
        assert!(order(0) >= 1.8 && order(1) >= order_of_light, "{normals}: {coarse:?} to {fine:?}");
    }
}

#[test]
fn faces_left_out_leave_the_opaque_pixels_of_the_outline() {
    let base = with_holes((61, 47), OUTSIDE, PERSPECTIVE);
    let job = alone(&base, &[surface(0.2, RED, 1.0)], shading(Normals::Cell));
    let all = planes("faces", &job);
    let error = |share: f64| {
        let some = havs(&with_buffer(&with_some_faces(&job, share, 1), 8, true)).planes;
        assert!(some.color.pixels.iter().flatten().all(|c| c.is_finite()));
        difference(&some.color, &all.color).0
    };
    let errors = [0.9, 0.5, 0.1].map(error);
    assert!(errors[0] > 0.0 && errors[0] < errors[1] && errors[1] < errors[2], "{errors:?}");
}

#[test]
fn what_cannot_be_a_surface_is_refused() {
    let refused =
        |surfaces: &[Isosurface], shading| SurfaceScene::new(surfaces, shading, &Arc::new(dense())).unwrap_err();
    let plain = SurfaceShading::default();
    assert_eq!(refused(&[Isosurface::new(0.0); SURFACES_MAX + 1], plain), SurfaceError::TooMany(33));
    assert!(SurfaceScene::new(&[Isosurface::new(0.0); SURFACES_MAX], plain, &Arc::new(dense())).is_ok());
    for value in [f64::NAN, f64::INFINITY] {
        assert!(matches!(refused(&[Isosurface::new(value)], plain), SurfaceError::Value { place: 0, .. }));
    }
    let two = |second: Isosurface| [Isosurface::new(0.0), second];
    for wrong in [-0.1, 1.1, f64::NAN] {
        let of = |surface| refused(&two(surface), plain).to_string();
        assert!(of(Isosurface { opacity: wrong, ..Isosurface::new(1.0) }).starts_with("isosurface 1 has"));
        assert!(of(surface(1.0, [0.5, wrong, 0.5], 1.0)).starts_with("isosurface 1 has"));
    }
    for direction in [[0.0; 3], [f64::NAN, 0.0, 1.0]] {
        let shading = SurfaceShading { light: Light::From(direction), ..plain };
        assert!(matches!(refused(&[], shading), SurfaceError::Light(_)));
    }
}
