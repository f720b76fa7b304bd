//! Formulas of renderers that lose digits if they are written down as they come. Each test shows that the usual formula fails on
//! the numbers on which the renderers do not. (The eye, which is subtracted in f64: `geometry`.)

use super::*;
use crate::meshes::{build, sample};
use glam::{DVec3, Vec3};
use tetreel::mesh::RawMesh;

/// A column of `cubes` cubes of six cells each along z, from -1 to 1, as wide as a cube is high.
fn column(cubes: usize) -> RawMesh {
    let height = 2.0 / cubes as f64;
    let corner = |n: usize| {
        let side = |bit: usize| if n >> bit & 1 == 1 { 0.5 * height } else { -0.5 * height };
        DVec3::new(side(0), side(1), (n / 4) as f64 * height - 1.0)
    };
    let points = (0..4 * (cubes + 1)).map(corner).collect();
    let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    let cube = |c: usize| paths.map(|path| [0, path[0], path[1], 7].map(|v| (4 * c + v) as u32));
    RawMesh { points, cells: (0..cubes).flat_map(cube).collect::<Vec<_>>().into() }
}

const CUBES: usize = 3400;
/// Segments of a ray along the column: three in each cube.
const SEGMENTS: usize = 3 * CUBES;

/// What an opacity may be off by, of itself where it is small. Measured on the CPU: 3.9e-6 of ten thousand sums of f32, each
/// rounded by 2^-24 at most and as often up as down but where all are alike; 2.3e-7 of what is small.
const TOLERANCE: f64 = 1e-5;

#[test]
fn products_over_ten_thousand_segments_keep_their_digits() {
    let mesh = Arc::new(build(column(CUBES)));
    let along = Projection::Parallel { scale: 0.4 * 2.0 / CUBES as f64 };
    let scalars = sample(&mesh, |p| p.z);
    for (name, tau) in [("optical depth 1", 0.5), ("optical depth 3", 1.5), ("optical depth 0.1", 0.05)] {
        let nodes = table(&[(-1.0, [0.25, 1.0, 0.0], tau), (1.0, [0.25, 1.0, 0.0], tau)]);
        let camera = camera(DVec3::new(0.0, 0.0, 5.0), along);
        let job = job(&mesh, scalars.clone(), &camera, (6, 6), nodes);
        let steps = Raycast::new().render(job.clone()).unwrap().stats.steps;
        assert!(steps >= (36 * SEGMENTS) as u64, "{steps} steps");
        let alpha = -(-2.0 * tau).exp_m1();
        for path in paths() {
            let Some(frame) = (path.render)(&job) else { continue };
            let errors = frame.planes.color.pixels.iter().flat_map(|p| {
                let right = [0.25 * alpha, alpha, 0.0, alpha];
                [0, 1, 2, 3].map(|c| (f64::from(p[c]) - right[c]).abs())
            });
            let worst = errors.fold(0.0, f64::max);
            eprintln!("{SEGMENTS} segments, {name} | {} | {worst:.1e}", path.name);
            assert_eq!(frame.stats.broken_paths, 0, "{name}, {}", path.name);
            assert!(worst <= TOLERANCE, "{name}, {}: {worst:.1e}", path.name);
        }
    }
    // The usual way: what is let through by each segment, rounded, multiplied. All are rounded alike.
    let of_one = 1.0 / SEGMENTS as f64;
    let let_through = 1.0 + (-of_one).exp_m1() as f32;
    let product = (0..SEGMENTS).fold(1f32, |product, _| product * let_through);
    let off = (f64::from(product) - (-1f64).exp()).abs();
    eprintln!("{SEGMENTS} segments, product of f32: {off:.1e}");
    assert!(off > TOLERANCE, "{off:.1e}");
}

#[test]
fn opacities_of_next_to_nothing_keep_their_digits() {
    let mesh = Arc::new(build(crate::meshes::grid(4, 0.16, 3, |_| true)));
    for depth in [1e-3, 1e-5, 1e-7, 1e-12, 1e-30] {
        let nodes = table(&[(0.0, [1.0, 0.5, 0.25], 0.5 * depth)]);
        let scalars = vec![1.0; mesh.positions.local.len()];
        let job = job(&mesh, scalars, &camera(5.0 * DVec3::X, Projection::Parallel { scale: 0.8 }), (16, 16), nodes);
        let alpha = -(-depth).exp_m1();
        for path in paths() {
            let Some(frame) = (path.render)(&job) else { continue };
            let off =
                frame.planes.color.pixels.iter().map(|p| (f64::from(p[3]) / alpha - 1.0).abs()).fold(0.0, f64::max);
            eprintln!("optical depth {depth:.0e} | {} | {off:.1e} of it", path.name);
            assert!(off <= TOLERANCE, "optical depth {depth:e}, {}: {off:.1e}", path.name);
        }
        let usual = f64::from(1.0 - (-depth as f32).exp());
        assert!((usual / alpha - 1.0).abs() > TOLERANCE, "optical depth {depth:e}: 1 - exp(-x) is good enough");
    }
}

/// Where a ray hits a triangle, in f32: by the plane's equation, and as convex combination of the corners' depths.
fn hits_in_f32(corners: [Vec3; 3]) -> Option<[f32; 2]> {
    let [p, q, r] = corners;
    let edge = |a: Vec3, b: Vec3| a.x * b.y - b.x * a.y;
    let e = [edge(q, r), edge(r, p), edge(p, q)];
    let is_hit = e.iter().all(|e| *e > 0.0) || e.iter().all(|e| *e < 0.0);
    let normal = (q - p).cross(r - p);
    let sum = e[0] + e[1] + e[2];
    is_hit.then(|| [normal.dot(p) / normal.z, (e[0] * p.z + e[1] * q.z + e[2] * r.z) / sum])
}

/// Views of a regular mesh almost along an axis: the middle rays pass through faces that they see from the side.
fn along_faces() -> Case {
    let tilted = |tilt: f64| camera(5.0 * DVec3::new(1.0, tilt, 0.37 * tilt), cameras::PARALLEL);
    let cameras = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8].map(tilted).to_vec();
    Case { name: "along faces".into(), cameras, ..geometry::regular() }
}

#[test]
fn depths_of_faces_seen_from_the_side_stay_between_their_corners() {
    let case = along_faces();
    run([case.clone()]);
    let (mut hits, mut usual, mut convex) = (0, 0f32, 0f32);
    for job in case.jobs() {
        let (topology, view) = (&job.mesh.topology, job.local_view());
        let vertices: Vec<DVec3> = job.mesh.positions.local.iter().map(|p| view.to_view(p.as_dvec3())).collect();
        for pixel in 0..view.width_px * view.height_px {
            let (px, py) = view.ray(pixel % view.width_px, pixel / view.width_px);
            for face in &topology.connectivity().faces {
                let sheared = face.map(|v| (vertices[v as usize] - DVec3::new(px, py, 0.0)).as_vec3());
                let Some(depths) = hits_in_f32(sheared) else { continue };
                let [near, far] = [f32::min, f32::max].map(|of| of(of(sheared[0].z, sheared[1].z), sheared[2].z));
                let [by_plane, by_corners] = depths.map(|depth| (near - depth).max(depth - far).max(0.0));
                (hits, usual, convex) = (hits + 1, usual.max(by_plane), convex.max(by_corners));
            }
        }
    }
    eprintln!("{hits} hits: beyond their corners by {usual:.1e} by the plane's equation, {convex:.1e} by corners");
    assert!(hits > 1000 && usual > 5e-5, "{hits} hits, {usual:.1e}");
    // Four rounding units of depths of about 6.
    assert!(convex < 2e-6, "{convex:.1e}");
}
