//! Hits found many pixels at a time against the definition, pixel by pixel.

use super::super::ray::transform;
use super::super::tiles::TILE_PX;
use super::boxes::{Bounds, BoxSource, project};
use super::lists::{ListedFace, SeenItem};
use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::{Mesh, RawMesh};
use crate::random::SplitMix64;
use crate::task::Cancel;
use glam::DVec3;
use std::sync::Arc;

/// A pixel and the hit of its ray.
type HitIn = (usize, Hit);

/// The hits of all faces of a mesh in one tile, as drawn, and by the definition in every pixel.
fn both(mesh: &Arc<Mesh>, view: &View, perturb: f64, lanes: impl Lanes) -> (Vec<HitIn>, Vec<HitIn>) {
    let never = Cancel::new();
    let (mut vertices, mut screen) = (Vec::new(), Vec::new());
    let scalars: Vec<f32> = mesh.positions.local.iter().map(|p| p.x + 0.5 * p.y).collect();
    transform(view, &mesh.positions.local, &Arc::new(scalars).into(), None, &never, &mut vertices);
    project(view, &vertices, None, &never, &mut screen);
    let source = BoxSource { view, vertices: &vertices, screen: &screen };
    let bounds = Bounds { x0: 0, x1: view.width_px, y0: 0, y1: view.height_px };
    let rays = TileRays::new(view, bounds);
    let (mut drawn, mut defined) = (Vec::new(), Vec::new());
    let (mut faces, mut list) = (Faces::NONE, [0; TILE_PX * TILE_PX + BLOCK]);
    // Arbitrary, but all different.
    let listed =
        |id: u32| ListedFace { ids: mesh.topology.connectivity().faces[id as usize], cells: [2 * id, 2 * id + 1] };
    let all: Vec<ListedFace> = (0..mesh.topology.connectivity().faces.len() as u32).map(listed).collect();
    let seen: Vec<TileFace> = all.iter().filter_map(|face| Some(in_tile(face, source.bounds(face.ids)?))).collect();
    for some in seen.chunks(FACES_AT_ONCE) {
        faces.set(view, &vertices, &rays, some);
        for i in 0..some.len() {
            faces.middle[0][i] += perturb;
            faces.hits(lanes, i, (view, &vertices), &rays, &mut list, |pixel, hit| drawn.push((pixel, hit)));
        }
    }
    for face in all {
        let face = in_tile(&face, bounds);
        for (row, column) in (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| (j, i))) {
            let found = careful_hit(&face, &vertices, &Ray::of_pixel(view, column, row));
            defined.extend(found.map(|hit| (row * TILE_PX + column, hit)));
        }
    }
    (drawn, defined)
}

/// A face in the only tile of the image.
fn in_tile(face: &ListedFace, bounds: Bounds) -> TileFace {
    TileFace::new(&SeenItem { item: *face, bounds, nearest: 0.0 }, [0, 0])
}

/// Cells between random points, flattened to slivers of 2^-`flatness`.
fn random_mesh(random: &mut SplitMix64, flatness: i32) -> Option<Arc<Mesh>> {
    let flat = 2f64.powi(-flatness);
    let mut point =
        || DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), flat * random.between(-1.0, 1.0));
    let points = (0..20).map(|_| point()).collect();
    let tets: Vec<_> = (0..12).map(|_| std::array::from_fn(|_| random.below(20) as u32)).collect();
    Mesh::build(RawMesh { points, cells: tets.into() }).ok().map(|(mesh, _)| Arc::new(mesh))
}

/// Meshes and views: from nearby, from inside, from far away, and onto the edge of a flat mesh, in both projections.
fn scenes() -> Vec<(Arc<Mesh>, View)> {
    let mut random = SplitMix64::new(11);
    let mut scenes = Vec::new();
    for i in 0..200 {
        let Some(mesh) = random_mesh(&mut random, [0, 0, 10, 24][i % 4]) else { continue };
        let distance = [0.3, 2.0, 5.0, 1e4][i / 4 % 4];
        let mut component = || random.between(-1.0, 1.0);
        let mut direction = DVec3::new(component(), component(), component());
        if i % 5 == 0 {
            direction.z = 0.0;
        }
        let position = distance * direction.normalize_or(DVec3::X);
        let angle = if distance < 1.0 { 100.0 } else { 120.0 / distance };
        let perspective = Projection::Perspective { view_angle: angle };
        let projection = if i % 3 == 0 { Projection::Parallel { scale: 1.0 } } else { perspective };
        let camera = Camera { position, focal_point: DVec3::ZERO, view_up: DVec3::Z, projection, near: 0.0 };
        let mut view = camera.view(16, 13).unwrap();
        view.eye = (view.eye - mesh.positions.origin) / mesh.positions.scale;
        scenes.push((mesh, view));
    }
    scenes
}

fn sorted(mut hits: Vec<HitIn>) -> Vec<HitIn> {
    hits.sort_by(|(p, a), (q, b)| p.cmp(q).then(a.cells.cmp(&b.cells)));
    hits
}

/// Whether all hits agree, within the accuracy of three weights (2^-20 each) of depths and scalars of magnitude `most`.
fn agree((drawn, defined): (Vec<HitIn>, Vec<HitIn>), most: f64) -> bool {
    let (drawn, defined) = (sorted(drawn), sorted(defined));
    let bound = 6.0 / (1 << 20) as f64 * most;
    let same = |(p, a): &HitIn, (q, b): &HitIn| {
        let place = (a.depth - b.depth).abs().max((a.scalar - b.scalar).abs());
        (p, a.cells, a.is_turned) == (q, b.cells, b.is_turned) && place <= bound
    };
    drawn.len() == defined.len() && drawn.iter().zip(&defined).all(|(a, b)| same(a, b))
}

fn compare(lanes: impl Lanes) {
    let mut hits = 0;
    for (i, (mesh, view)) in scenes().iter().enumerate() {
        let both = both(mesh, view, 0.0, lanes);
        hits += both.1.len();
        assert!(agree(both, view.eye.length() + 2.0), "scene {i}: {view:?}");
    }
    assert!(hits > 20_000, "{hits} hits");
}

#[test]
fn every_ray_hits_the_same_faces_as_by_the_definition() {
    compare(pulp::Scalar);
    // Every kind of vectors that this processor has, not only the best.
    #[cfg(target_arch = "x86_64")]
    {
        pulp::x86::V3::try_new().into_iter().for_each(compare);
        pulp::x86::V4::try_new().into_iter().for_each(compare);
    }
}

#[test]
fn the_comparison_notices_an_edge_that_is_off_by_a_thousandth() {
    let notices =
        |(mesh, view): &&(Arc<Mesh>, View)| !agree(both(mesh, view, 1e-3, pulp::Scalar), view.eye.length() + 2.0);
    let other = scenes().iter().filter(notices).count();
    assert!(other > 50, "{other} scenes");
}
