//! Eyes where f32 decides otherwise than exact arithmetic: next to edges and vertices, and far away.

use super::images::compare;
use super::*;
use tetreel::camera::CameraError;

/// Cells that are nearly opaque: a ray that is lost shows.
fn opaque() -> NodeTable {
    table(&[(-1.5, [0.9, 0.1, 0.2], 6.0), (0.1, [0.1, 0.8, 0.3], 20.0), (1.5, [0.2, 0.3, 1.0], 60.0)])
}

/// A vector whose components are random in [-1, 1].
fn random(seed: u64, index: u64) -> DVec3 {
    DVec3::new(noise(seed, 3 * index), noise(seed, 3 * index + 1), noise(seed, 3 * index + 2))
}

#[test]
fn eyes_next_to_edges_vertices_and_faces_lose_no_ray() {
    if context().is_none() {
        return;
    }
    let mesh = Arc::new(build(grid(4, 0.15, 3, |p| p.length() > 0.4)));
    let scalars = sample(&mesh, wave);
    let tets = &mesh.topology.tets;
    let mut views = 0;
    for index in 0..150u64 {
        let tet = tets[(index as usize * 7919) % tets.len()].map(|v| mesh.positions.world(v as usize));
        // A vertex, a place on an edge, one in a face, moved a little.
        let share = 0.5 + 0.3 * noise(5, index);
        let on_edge = tet[0].lerp(tet[1], share);
        let place = [tet[0], on_edge, on_edge.lerp(tet[2], 0.4)][index as usize % 3];
        let offset = [0.0, 1e-9, 1e-8, 3e-8, 1e-7, 1e-6][index as usize / 3 % 6];
        let position = place + offset * random(6, index);
        let looking = Camera {
            position,
            focal_point: position + random(7, index).normalize(),
            view_up: random(8, index),
            projection: Projection::Perspective { view_angle: 90.0 },
            near: 0.0,
        };
        let Ok(job) = try_job(&mesh, &scalars, &looking, opaque()) else { continue };
        // Eyes outside that look away see nothing.
        let cpu = raycast(&job);
        if cpu.pixels.iter().any(|p| p[3] > 0.0) {
            let name = format!("place {index}, {offset:e} off");
            compare(&name, &job).unwrap();
            if offset == 0.0 {
                assert_within(&format!("{name}: CPU against reference"), &cpu, &reference(&job));
            }
            views += 1;
        }
    }
    assert!(views > 100, "{views} views");
}

fn try_job(mesh: &Arc<Mesh>, scalars: &[f32], camera: &Camera, table: NodeTable) -> Result<RenderJob, CameraError> {
    camera.view(24, 20).map(|_| job(mesh, scalars.to_vec(), camera, (24, 20), table))
}

#[test]
fn far_eyes_see_the_parts_of_a_mesh_in_their_order() {
    if context().is_none() {
        return;
    }
    // Holes and separate parts: rays enter many times.
    let keep = |p: DVec3| (7.0 * p.x).sin() + (6.0 * p.y).cos() + (9.0 * p.z).sin() > -0.2;
    let mesh = Arc::new(build(grid(7, 0.15, 4, keep)));
    for (index, distance) in [5.0, 60.0, 1e3, 3e4, 1e5, 3e5, 9e5].into_iter().enumerate() {
        for table in [dense(), opaque()] {
            let view_angle = (2.4f64 / distance).atan().to_degrees();
            let from = distance * random(11, index as u64).normalize();
            let camera = camera(from, Projection::Perspective { view_angle });
            let job = job(&mesh, sample(&mesh, wave), &camera, (64, 48), table);
            let (gpu, cpu) = compare(&format!("from {distance:e}"), &job).unwrap();
            assert_eq!(gpu.stats.out_of_order, cpu.stats.out_of_order, "from {distance:e}");
            assert!(gpu.stats.entries > gpu.stats.rays_hit, "from {distance:e}: rays enter once");
        }
    }
}
