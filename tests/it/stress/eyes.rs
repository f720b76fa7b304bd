//! Cameras inside of cells, on vertices, edges and faces, and in planes of faces.

use super::cameras::within;
use super::*;
use crate::meshes::{build, grid, sample};
use glam::DVec3;

/// Eyes inside of a mesh: names and places.
fn eyes(mesh: &Mesh) -> Vec<(&'static str, DVec3)> {
    let tet = mesh.topology.tets[100].map(|v| mesh.positions.world(v as usize));
    vec![
        ("in a cell", DVec3::new(0.31, 0.22, 0.73)),
        ("near the middle", DVec3::new(0.01, 0.02, 0.03)),
        ("on a vertex", mesh.positions.world(mesh.positions.local.len() / 2)),
        ("on an edge", 0.5 * (tet[0] + tet[1])),
        ("on a face", (tet[0] + tet[1] + tet[2]) / 3.0),
        ("in a face's plane", tet[0] + 3.0 * (tet[1] - tet[0]) + 2.0 * (tet[2] - tet[0])),
    ]
}

// Long: four views from every kind of place in three meshes, on every path.
#[test]
fn eyes_in_cells_on_vertices_edges_and_faces_agree() {
    for (kind, jitter, hole) in [("jittered", 0.16, 0.0), ("regular", 0.0, 0.0), ("hole", 0.16, 0.5)] {
        let mesh = Arc::new(build(grid(6, jitter, 9, |c| c.length() >= hole)));
        run(eyes(&mesh).into_iter().map(|(place, eye)| {
            let views = [(30.0, 0.0), (30.0, 0.4), (120.0, 0.0), (120.0, 0.4)];
            let cameras = views.map(|(angle, near)| within(eye, angle, near)).to_vec();
            let case = Case::new(format!("{kind}, eye {place}"), &mesh, sample(&mesh, wave), dense());
            Case { cameras, size: (40, 40), ..case }
        }));
    }
}

fn looking(position: DVec3, focal_point: DVec3, view_angle: f64) -> Camera {
    let view_up = if (focal_point - position).cross(DVec3::Z).length() < 1e-9 { DVec3::Y } else { DVec3::Z };
    Camera { position, focal_point, view_up, projection: Projection::Perspective { view_angle }, near: 0.0 }
}

#[test]
fn eyes_in_the_planes_of_faces_agree() {
    // Every face of this mesh lies in a plane through lattice points: rays from lattice points run along faces.
    let mesh = Arc::new(build(grid(3, 0.0, 1, |_| true)));
    let scalars = sample(&mesh, |p| p.x + 2.0 * p.y * p.z);
    let third = 1.0 / 3.0;
    let views = [
        ("on the axis", DVec3::new(0.0, 0.0, -0.2), DVec3::NEG_Z),
        ("in the middle", DVec3::ZERO, DVec3::ONE),
        ("on a plane of faces", DVec3::new(third, 0.1, 0.2), DVec3::new(third, 1.0, 0.2)),
        ("on a vertex", DVec3::new(third, third, -third), DVec3::new(third, 1.0, -third)),
        ("on an edge", DVec3::new(third, third, 0.1), DVec3::new(1.0, 1.0, 0.1)),
    ];
    run(views.map(|(name, eye, focal)| {
        let cameras = [60.0, 100.0, 170.0].map(|angle| looking(eye, focal, angle)).to_vec();
        let case = Case::new(format!("lattice, eye {name}"), &mesh, scalars.clone(), dense());
        Case { cameras, size: (101, 67), ..case }
    }));
}

#[test]
fn eyes_on_the_boundary_see_what_is_before_them_and_nothing_behind() {
    let mesh = Arc::new(build(grid(3, 0.0, 1, |_| true)));
    // Opaque within a ten-millionth: whoever is let through or held up where he should not is seen.
    let opaque = table(&[(-1.5, [1.0, 0.1, 0.2], 3e7), (1.5, [0.1, 0.9, 1.0], 3e7)]);
    let on_face = looking(DVec3::new(0.25, 0.31, 1.0), DVec3::new(2.0, 0.7, 0.9), 100.0);
    let case = Case::new("eye on the boundary", &mesh, sample(&mesh, wave), opaque);
    let even = Case { cameras: vec![on_face], size: (64, 48), ..case };
    let image = crate::render::reference(&even.jobs()[0]);
    let transparent = image.pixels.iter().filter(|p| p[3] == 0.0).count();
    assert!(transparent > 0 && transparent < 64 * 48, "{transparent} transparent pixels");
    // Level, and of an odd height: the middle row lies in the boundary.
    let level = looking(DVec3::new(0.25, 0.31, 1.0), DVec3::new(2.0, 0.7, 1.0), 100.0);
    let ambiguous = Some("the eye looks along the boundary that it lies in");
    let odd = Case {
        name: "eye that looks along the boundary".into(),
        cameras: vec![level],
        size: (63, 47),
        ambiguous,
        ..even.clone()
    };
    run([even, odd]);
}

#[test]
fn parallel_rays_that_begin_inside_see_all_of_the_mesh() {
    // Depth is counted from a camera that may be anywhere: the image does not change along the view.
    let mesh = Arc::new(build(grid(6, 0.16, 9, |c| c.length() > 0.4)));
    let direction = DVec3::new(1.0, -2.0, 0.5).normalize();
    let at =
        |distance: f64| Camera { focal_point: -9.0 * direction, ..camera(distance * direction, cameras::PARALLEL) };
    let case = Case::new("parallel from inside", &mesh, sample(&mesh, wave), dense());
    run([Case { cameras: [5.0, 0.3, 0.0, -4.0].map(at).to_vec(), size: (48, 48), ..case }]);
}
