//! Where rays enter and leave tets, side by side, against the definition that the cell walk has.

use super::super::raster::TileRays;
use super::super::raster::boxes::Bounds;
use super::super::raster::fragments::PIXELS;
use super::super::raster::lanes::{BLOCK, Lanes};
use super::super::ray::{Ray, ViewVertex, crossing, transform};
use super::super::raycast::entries::face_of;
use super::tests::{built, cameras, dense, job_of};
use super::tets::{Corners, TETS_AT_ONCE, Tets};
use crate::camera::View;
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};
use crate::task::Cancel;
use pulp::{Arch, Scalar};

/// The faces of a cell that a ray enters through and leaves through, by the definition that the cell walk has.
fn by_faces(mesh: &Mesh, vertices: &[ViewVertex], ray: &Ray, cell: u32) -> Option<[f64; 2]> {
    let crossed = |turned: bool| {
        let faces = (0..4).map(|i| face_of(&mesh.topology, cell, i).vertices);
        let ids = faces.map(|[a, b, c]| if turned { [a, c, b] } else { [a, b, c] });
        ids.filter_map(|ids| crossing(ray, vertices, ids)).map(|found| found.point.depth).collect::<Vec<_>>()
    };
    match (&crossed(false)[..], &crossed(true)[..]) {
        ([entry], [exit]) => Some([*entry, *exit]),
        ([], []) => None,
        (entries, exits) => panic!("{} entries and {} exits", entries.len(), exits.len()),
    }
}

/// Where the rays of a tile enter and leave a tet.
fn hits_of(corners: &Corners, (view, rays): (&View, &TileRays), lanes: impl Lanes) -> Vec<Option<[f64; 2]>> {
    let (mut tets, mut list, mut found) = (Tets::NONE, [0; PIXELS + BLOCK], vec![None; PIXELS]);
    tets.set(view, rays, &[*corners; TETS_AT_ONCE], 1);
    tets.hits(lanes, 0, (view, rays), rays.bounds, (&rays.rendered, &mut list), |pixels, which, ends| {
        for l in (0..8).filter(|l| which >> l & 1 == 1) {
            found[pixels[l] as usize] = Some(ends.depth.map(|of| of[l]));
        }
    });
    found
}

#[test]
fn a_ray_hits_a_cell_exactly_if_it_hits_its_faces_also_through_edges_and_vertices() {
    let aligned = built(kuhn_grid([4; 3]));
    let jittered = built(jittered(kuhn_grid([3; 3]), &mut Random::new(9)));
    let (mut hits, mut careful) = (0, 0);
    for mesh in [&aligned, &jittered] {
        for camera in cameras(mesh) {
            // Rays of every eighth or so pixel of the parallel view go through vertices, those of its diagonal along faces.
            let job = job_of(mesh, &camera, 34, dense());
            let view = job.local_view();
            let mut vertices = Vec::new();
            transform(&view, &mesh.positions.local, &job.scalars, None, &Cancel::new(), &mut vertices);
            let bounds = Bounds { x0: 0, x1: 16, y0: 0, y1: 16 };
            let rays = TileRays::new(&view, bounds);
            for cell in 0..mesh.topology.tets.len() as u32 {
                let corners = mesh.topology.tets[cell as usize].map(|v| vertices[v as usize]);
                let found = hits_of(&corners, (&view, &rays), Scalar);
                #[cfg(target_arch = "x86_64")]
                match Arch::new() {
                    Arch::V4(lanes) => assert_eq!(found, hits_of(&corners, (&view, &rays), lanes)),
                    Arch::V3(lanes) => assert_eq!(found, hits_of(&corners, (&view, &rays), lanes)),
                    _ => {}
                }
                for (pixel, found) in found.iter().enumerate() {
                    let ray = rays.ray(&view, pixel);
                    let expected = by_faces(mesh, &vertices, &ray, cell);
                    assert_eq!(found.is_some(), expected.is_some(), "cell {cell}, pixel {pixel}");
                    hits += u32::from(found.is_some());
                    let corners = corners.map(|v| ray.shear(&v));
                    careful += u32::from(corners.iter().any(|v| v.x == 0.0 && v.y == 0.0));
                    for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
                        // Edge functions are right to 2^-21 of themselves where they are least accurate.
                        assert!((a - b).abs() < 1e-6, "{a} {b}");
                    }
                }
            }
        }
    }
    assert!(hits > 10_000 && careful > 0, "{hits} {careful}");
}
