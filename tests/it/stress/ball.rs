//! A sphere of constant density, as a polyhedron whose distance from the sphere is known.

use super::*;
use crate::meshes::build;
use crate::render::{raycast, reference};
use glam::DVec3;
use std::collections::HashMap;
use tetreel::camera::View;
use tetreel::mesh::{NONE, RawMesh};

const TAU: f64 = 0.8;

/// What a channel may be off by: the project's bound. Measured on the CPU: 4.5e-7 of f32 sums, and never beyond the spheres.
const TOLERANCE: f64 = 1e-5;

/// The octahedron, each triangle split in four `splits` times and its corners put onto the unit sphere; a cell from the middle to
/// each triangle.
fn ball(splits: usize) -> RawMesh {
    let mut points = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let sign = |positive: bool, axis: usize| if positive { axis } else { axis + 3 };
    let mut triangles: Vec<[usize; 3]> =
        (0..8).map(|octant| [0, 1, 2].map(|axis| sign(octant >> axis & 1 == 0, axis))).collect();
    for _ in 0..splits {
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a] + points[b]).normalize());
                points.len() - 1
            })
        };
        let split = |[a, b, c]: [usize; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let centre = points.len() as u32;
    points.push(DVec3::ZERO);
    let tets: Vec<_> = triangles.iter().map(|t| [centre, t[0] as u32, t[1] as u32, t[2] as u32]).collect();
    RawMesh { points, cells: tets.into() }
}

/// Planes of the boundary's faces: unit normals outwards, and distances from the middle.
fn planes(mesh: &Mesh) -> Vec<(DVec3, f64)> {
    let topology = &mesh.topology;
    let boundary = topology
        .connectivity()
        .faces
        .iter()
        .zip(&topology.connectivity().face_cells)
        .filter(|(_, cells)| cells.contains(&NONE));
    let plane = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|v| mesh.positions.world(v as usize));
        let normal = (b - a).cross(c - a).normalize();
        let normal = normal * normal.dot(a).signum();
        (normal, normal.dot(a))
    };
    boundary.map(|(face, _)| plane(face)).collect()
}

/// Origin of a pixel's ray, and its direction, of length 1.
fn ray(view: &View, pixel: usize) -> (DVec3, DVec3) {
    let (px, py) = view.ray(pixel % view.width_px, pixel / view.width_px);
    let sideways = px * view.right + py * view.up;
    if view.perspective {
        (view.eye, (view.forward + sideways).normalize())
    } else {
        (view.eye + sideways, view.forward)
    }
}

/// Length of a ray in the convex polyhedron.
fn chord(planes: &[(DVec3, f64)], (origin, direction): (DVec3, DVec3)) -> f64 {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for (normal, distance) in planes {
        let (slope, gap) = (normal.dot(direction), distance - normal.dot(origin));
        if slope > 0.0 {
            far = far.min(gap / slope);
        } else if slope < 0.0 {
            near = near.max(gap / slope);
        } else if gap < 0.0 {
            return 0.0;
        }
    }
    (far - near).max(0.0)
}

/// Length of a ray in the ball of a radius around the origin, which the ray passes at the distance `miss`.
fn chord_of_ball(radius: f64, miss: f64) -> f64 {
    2.0 * (radius * radius - miss * miss).max(0.0).sqrt()
}

fn opacity(length: f64) -> f64 {
    -(-TAU * length).exp_m1()
}

/// Views that leave something of the background.
fn jobs(mesh: &Arc<Mesh>) -> Vec<RenderJob> {
    let scalars = vec![0.5; mesh.positions.local.len()];
    let nodes = table(&[(0.0, [1.0, 0.5, 0.0], TAU)]);
    [Projection::Perspective { view_angle: 30.0 }, Projection::Parallel { scale: 1.1 }]
        .map(|projection| camera(DVec3::new(3.0, 2.0, 2.5), projection))
        .iter()
        .map(|camera| job(mesh, scalars.clone(), camera, (48, 48), nodes.clone()))
        .collect()
}

/// The largest excess over the bracket of the spheres inside and outside, and the largest difference from the polyhedron.
fn errors(job: &RenderJob, image: &RgbaImage, planes: &[(DVec3, f64)], radii: [f64; 2]) -> [f64; 2] {
    let (mut beyond, mut off) = (0f64, 0f64);
    for (pixel, rgba) in image.pixels.iter().enumerate() {
        let (origin, direction) = ray(&job.view, pixel);
        let miss = (origin - origin.dot(direction) * direction).length();
        let [least, most] = radii.map(|radius| opacity(chord_of_ball(radius, miss)));
        let right = opacity(chord(planes, (origin, direction)));
        for (channel, share) in [1.0, 0.5, 0.0, 1.0].into_iter().enumerate() {
            let ours = f64::from(rgba[channel]);
            beyond = beyond.max(share * least - ours).max(ours - share * most);
            off = off.max((ours - share * right).abs());
        }
    }
    [beyond, off]
}

#[test]
fn a_sphere_of_constant_density_lies_between_its_inner_and_its_outer_sphere() {
    for splits in [3, 4] {
        let mesh = Arc::new(build(ball(splits)));
        let planes = planes(&mesh);
        assert_eq!(planes.len(), 8 << (2 * splits));
        let world = || (0..mesh.positions.local.len()).map(|v| mesh.positions.world(v));
        // Convex, but for what f64 rounds a plane's equation to. Measured: 2.2e-16.
        let beyond = planes.iter().flat_map(|(normal, distance)| world().map(move |p| normal.dot(p) - distance));
        let beyond = beyond.fold(0.0, f64::max);
        assert!(beyond < 2e-15);
        // A ball of the smallest distance of a plane is inside, one of the largest distance of a corner outside.
        let inner = planes.iter().fold(1.0, |least: f64, plane| least.min(plane.1));
        let outer = world().fold(0.0, |most: f64, p| most.max(p.length()));
        assert!(inner > 0.98 && outer < 1.0 + 1e-7, "{inner} to {outer}");
        for job in jobs(&mesh) {
            let drawn = paths().into_iter().filter_map(|path| Some((path.name, (path.render)(&job)?.planes.color)));
            for (name, image) in std::iter::once(("reference", reference(&job))).chain(drawn) {
                let [beyond, off] = errors(&job, &image, &planes, [inner, outer]);
                eprintln!("sphere {inner:.4}..1 | {name} | beyond {beyond:.1e} | from the polyhedron {off:.1e}");
                assert!(beyond <= TOLERANCE && off <= TOLERANCE, "{name}: {beyond:.1e}, {off:.1e}");
            }
            let mut denser = job.clone();
            denser.table = Arc::new(table(&[(0.0, [1.0, 0.5, 0.0], 1.0001 * TAU)]));
            let [_, off] = errors(&job, &raycast(&denser), &planes, [inner, outer]);
            assert!(off > TOLERANCE, "a ten-thousandth denser: {off:.1e}");
            let mut nearer = job.clone();
            nearer.view.eye *= 0.98;
            nearer.view.half_width *= 0.98;
            let [beyond, _] = errors(&job, &raycast(&nearer), &planes, [inner, outer]);
            assert!(beyond > TOLERANCE, "a larger sphere: {beyond:.1e}");
        }
    }
}
