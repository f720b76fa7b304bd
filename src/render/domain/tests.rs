//! The faces and edges that are found, on rows of cubes.

use super::*;
use crate::mesh::test_meshes::kuhn_grid;
use std::collections::BTreeSet;

/// A row of three cubes along x, and the cells of some of them.
fn row() -> (Arc<Mesh>, impl Fn(&[usize]) -> Arc<CellSet>) {
    let mesh = Arc::new(Mesh::build(kuhn_grid([3, 1, 1])).unwrap().0);
    let middle = |tet: &[u32; 4]| tet.iter().map(|&v| mesh.positions.world(v as usize).x).sum::<f64>() / 4.0;
    let cube_of: Vec<usize> = mesh.topology.tets.iter().map(|tet| middle(tet) as usize).collect();
    let cells = move |cubes: &[usize]| Arc::new(CellSet::of(cube_of.len(), |cell| cubes.contains(&cube_of[cell])));
    (mesh, cells)
}

fn found(mesh: &Arc<Mesh>, cells: &Arc<CellSet>) -> DomainFaces {
    let mut faces = DomainFaces::default();
    faces.update(mesh, cells);
    faces
}

#[test]
fn a_region_has_the_faces_towards_other_cells_and_towards_none() {
    let (mesh, cells) = row();
    // Sides of two triangles; edges of a cuboid's triangles are their number times 3 / 2; feature edges are in pieces of cubes.
    for (cubes, sides, pieces) in [(&[0][..], 6, 12), (&[1], 6, 12), (&[0, 1], 10, 16), (&[0, 1, 2], 14, 20)] {
        let of = found(&mesh, &cells(cubes));
        assert_eq!((of.faces.len(), of.edges.len(), of.turns.len()), (2 * sides, 3 * sides, pieces), "{cubes:?}");
        assert!(of.faces.iter().all(|(_, cell)| cells(cubes).contains(*cell)));
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.positions.world(v as usize));
            0.5 * (b - a).cross(c - a).length()
        };
        let whole: f64 = of.faces.iter().map(|(face, _)| area(face)).sum();
        assert!((whole - sides as f64).abs() < 1e-5, "{cubes:?}: {whole}");
    }
    // Two cubes apart share no edge; nothing has no face.
    assert_eq!(found(&mesh, &cells(&[0, 2])).faces.len(), 24);
    assert!(found(&mesh, &cells(&[])).faces.is_empty());
}

#[test]
fn a_face_that_two_regions_share_has_the_same_depths_to_the_bit_in_both() {
    let (mesh, cells) = row();
    let [a, b] = [[0], [1]].map(|cubes| found(&mesh, &cells(&cubes)));
    let of = |faces: &DomainFaces| faces.faces.iter().map(|(face, _)| *face).collect::<BTreeSet<_>>();
    let shared: Vec<[u32; 3]> = of(&a).intersection(&of(&b)).copied().collect();
    assert_eq!(shared.len(), 2);
    let camera = crate::camera::Camera {
        position: DVec3::new(-4.0, 2.3, 1.9),
        focal_point: DVec3::new(1.0, 0.5, 0.5),
        view_up: DVec3::Z,
        projection: crate::camera::Projection::Perspective { view_angle: 25.0 },
        near: 0.0,
    };
    let table = Arc::new(NodeTable::transparent());
    let scalars = (0..mesh.positions.local.len()).map(|v| v as f32).collect();
    let job = crate::render::testing::job(&mesh, scalars, &camera, (40, 30), table);
    let view = job.local_view();
    let scene = DomainScene {
        mesh: &mesh,
        scalars: &job.scalars,
        colors: &job.table,
        shading: SurfaceShading::default(),
        view: &view,
        clips: &[],
    };
    let surface: DomainSurface = "solid:#ff8000".parse().unwrap();
    let on = |faces: &DomainFaces| {
        let with_cell = |face: &[u32; 3]| faces.faces.iter().find(|(of, _)| of == face).copied().unwrap();
        let all = shared.iter().map(with_cell).collect();
        DomainFaces { faces: all, ..DomainFaces::default() }.fragments(&surface, &scene)
    };
    assert!(on(&a).len() > 20 && on(&a) == on(&b), "{} fragments", on(&a).len());
}
