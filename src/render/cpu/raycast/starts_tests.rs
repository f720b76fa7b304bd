//! Starts found many pixels at a time against the definition, pixel by pixel and face by face.

use super::super::super::raster::boxes::{BoxSource, project};
use super::super::super::ray::{Crossing, crossing, transform};
use super::super::EYE_TOLERANCE;
use super::super::entries::face_of;
use super::super::entry_faces::EntryFaces;
use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::{Mesh, RawMesh};
use crate::random::SplitMix64;
use crate::render::medium::RayPoint;
use crate::task::Cancel;
use crate::visibility::CellSet;
use glam::{DVec3, IVec3};
use std::sync::Arc;

/// A mesh, its active cells, and a view in its local coordinates.
struct Scene {
    mesh: Arc<Mesh>,
    active: Arc<CellSet>,
    view: View,
}

/// A scene's data for finding starts.
struct Prepared {
    vertices: Vec<ViewVertex>,
    bins: EntryBins,
    eye_cells: Vec<u32>,
}

impl Scene {
    fn new(mesh: &Arc<Mesh>, active: CellSet, camera: &Camera) -> Self {
        // A size that is no multiple of the tiles.
        let mut view = camera.view(40, 21).unwrap();
        view.eye = (view.eye - mesh.positions.origin) / mesh.positions.scale;
        if !view.perspective {
            view.half_width /= mesh.positions.scale;
            view.half_height /= mesh.positions.scale;
        }
        Self { mesh: mesh.clone(), active: Arc::new(active), view }
    }

    fn prepare(&self) -> Prepared {
        let (never, local) = (Cancel::new(), &self.mesh.positions.local);
        let (mut vertices, mut screen) = (Vec::new(), Vec::new());
        transform(&self.view, local, &Arc::new(vec![0.0; local.len()]).into(), None, &never, &mut vertices);
        project(&self.view, &vertices, None, &never, &mut screen);
        let (mut faces, mut bins) = (EntryFaces::default(), EntryBins::default());
        faces.update(&self.mesh, &self.active, false, &never);
        bins.fill(BoxSource { view: &self.view, vertices: &vertices, screen: &screen }, &faces, None, &never);
        let eye_cells = if self.view.perspective {
            let near = self.mesh.cells_near(self.view.eye, EYE_TOLERANCE);
            near.into_iter().filter(|&cell| self.active.contains(cell)).collect()
        } else {
            Vec::new()
        };
        Prepared { vertices, bins, eye_cells }
    }

    /// The starts of each tile, sorted.
    fn found(&self, prepared: &Prepared, portable: bool, scratch: &mut StartScratch) -> Vec<Vec<PixelStart>> {
        let Prepared { vertices, bins, eye_cells } = prepared;
        let entries = Entries { topology: &self.mesh.topology, view: &self.view, vertices, bins, eye_cells, portable };
        let plane = RayPlane::of_view(&self.view);
        (0..bins.grid.tile_count())
            .map(|tile| entries.starts(&plane, plane.grid.rect(tile), scratch).to_vec())
            .collect()
    }

    /// The starts by their definition, with edge functions of a view shifted by `off` pixels.
    fn defined(&self, prepared: &Prepared, off: f64) -> Vec<Vec<PixelStart>> {
        let (topology, grid) = (&self.mesh.topology, prepared.bins.grid);
        let mut off_view = self.view.clone();
        off_view.half_width *= 1.0 + off / 20.0;
        let mut starts = Vec::new();
        for tile in 0..grid.tile_count() {
            let rect = grid.rect(tile);
            let mut found = Vec::new();
            for (row, column) in (0..rect.height).flat_map(|row| (0..rect.width).map(move |column| (row, column))) {
                let ray = Ray::of_pixel(&off_view, rect.x + column, rect.y + row);
                let pixel = (row * rect.width + column) as u32;
                for cell in (0..topology.tets.len() as u32).filter(|&cell| self.active.contains(cell)) {
                    for opposite in 0..4 {
                        let neighbour = topology.connectivity().neighbours[cell as usize][opposite].cell();
                        if neighbour.is_some_and(|other| self.active.contains(other)) {
                            continue;
                        }
                        let ids = face_of(topology, cell, opposite).vertices;
                        let hit = crossing(&ray, &prepared.vertices, ids);
                        let seen = hit.filter(|hit| !self.view.perspective || hit.is_in_front(ids));
                        found.extend(
                            seen.map(|hit| (pixel, Start { depth: hit.point.depth, cell, opposite: opposite as u32 })),
                        );
                    }
                    if prepared.eye_cells.contains(&cell)
                        && let Some(at_eye) = EyeCell::new(topology, &prepared.vertices, &ray, cell)
                    {
                        let Crossing { point: RayPoint { depth, .. }, .. } = at_eye.entry;
                        found.push((pixel, Start { depth, cell, opposite: at_eye.opposite }));
                    }
                }
            }
            found.sort_by(|(p, a), (q, b)| p.cmp(q).then(a.cell.cmp(&b.cell)).then(a.opposite.cmp(&b.opposite)));
            starts.push(found);
        }
        starts
    }
}

/// Whether the starts agree, within the accuracy of three weights (2^-20 each) of depths of magnitude `most`; and those found are sorted.
fn agree(found: &[Vec<PixelStart>], defined: &[Vec<PixelStart>], most: f64) -> bool {
    let bound = 3.0 / (1 << 20) as f64 * most;
    found.len() == defined.len()
        && found.iter().zip(defined).all(|(found, defined)| {
            let is_in_order = found.is_sorted_by(|(p, a), (q, b)| (p, a.depth) <= (q, b.depth));
            let mut found = found.clone();
            found.sort_by(|(p, a), (q, b)| p.cmp(q).then(a.cell.cmp(&b.cell)).then(a.opposite.cmp(&b.opposite)));
            let same = |((p, a), (q, b)): (&PixelStart, &PixelStart)| {
                (p, a.cell, a.opposite) == (q, b.cell, b.opposite) && (a.depth - b.depth).abs() <= bound
            };
            is_in_order && found.len() == defined.len() && found.iter().zip(defined).all(same)
        })
}

fn some_of(mesh: &Mesh, share: f64, random: &mut SplitMix64) -> CellSet {
    let mut some = CellSet::none(mesh.topology.tets.len());
    (0..some.universe() as u32).for_each(|cell| some.set(cell, random.unit() < share));
    some
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

/// A regular grid of n^3 cubes in [-1, 1]^3, six cells each.
fn grid(n: i32) -> Arc<Mesh> {
    let at = |p: IVec3| (p.x + (n + 1) * (p.y + (n + 1) * p.z)) as u32;
    let all = |n: i32| (0..n * n * n).map(move |i| IVec3::new(i % n, i / n % n, i / n / n));
    let points = all(n + 1).map(|p| p.as_dvec3() * (2.0 / f64::from(n)) - 1.0).collect();
    let axes = [IVec3::X, IVec3::Y, IVec3::Z];
    let ways = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let cube = |p: IVec3| {
        ways.map(|way| {
            let mut corner = p;
            let mut tet = [at(p); 4];
            for (i, axis) in way.into_iter().enumerate() {
                corner += axes[axis];
                tet[i + 1] = at(corner);
            }
            tet
        })
    };
    let tets: Vec<_> = all(n).flat_map(cube).collect();
    Arc::new(Mesh::build(RawMesh { points, cells: tets.into() }).unwrap().0)
}

fn camera(position: DVec3, focal_point: DVec3, projection: Projection) -> Camera {
    Camera { position, focal_point, view_up: DVec3::Z, projection, near: 0.0 }
}

fn scenes() -> Vec<Scene> {
    let mut random = SplitMix64::new(5);
    let mut scenes = Vec::new();
    // Slivers from nearby, from inside, from far away, and edge-on to a flat mesh, in both projections.
    for i in 0..120 {
        let Some(mesh) = random_mesh(&mut random, [0, 0, 10, 24][i % 4]) else { continue };
        let distance = [0.3, 2.0, 5.0, 1e4][i / 4 % 4];
        let mut component = || random.between(-1.0, 1.0);
        let mut direction = DVec3::new(component(), component(), component());
        if i % 5 == 0 {
            direction.z = 0.0;
        }
        let angle = if distance < 1.0 { 100.0 } else { 120.0 / distance };
        let perspective = Projection::Perspective { view_angle: angle };
        let projection = if i % 3 == 0 { Projection::Parallel { scale: 1.0 } } else { perspective };
        let camera = camera(distance * direction.normalize_or(DVec3::X), DVec3::ZERO, projection);
        scenes.push(Scene::new(&mesh, some_of(&mesh, 0.8, &mut random), &camera));
    }
    // Rays through vertices and along faces; the eye on a vertex, on an edge, inside.
    let mesh = grid(4);
    let wide = Projection::Perspective { view_angle: 90.0 };
    for (i, (eye, focal)) in [
        (DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO),
        (DVec3::new(5.0, 5.0, 0.0), DVec3::ZERO),
        (DVec3::ZERO, DVec3::X),
        (DVec3::new(0.25, 0.0, 0.0), DVec3::ONE),
        (DVec3::new(0.1, 0.2, 0.3), DVec3::new(-1.0, 0.4, 0.0)),
        (DVec3::new(0.5, 0.5, 1.0), DVec3::new(0.5, 0.0, 1.0)),
    ]
    .into_iter()
    .enumerate()
    {
        for share in [0.3, 0.9, 1.1] {
            let cells = some_of(&mesh, share, &mut random);
            scenes.push(Scene::new(&mesh, cells.clone(), &camera(eye, focal, wide)));
            if i < 2 {
                // 21 rows: the middle one goes through vertices.
                scenes.push(Scene::new(&mesh, cells, &camera(eye, focal, Projection::Parallel { scale: 1.05 })));
            }
        }
    }
    scenes
}

#[test]
fn the_starts_are_those_of_the_definition() {
    let (mut starts, mut at_eye) = (0, 0);
    // Scratch reused from mesh to mesh, also from large ones to small ones.
    let mut scratch = StartScratch::default();
    for (i, scene) in scenes().iter().enumerate().rev() {
        let prepared = scene.prepare();
        let defined = scene.defined(&prepared, 0.0);
        starts += defined.iter().map(Vec::len).sum::<usize>();
        at_eye += prepared.eye_cells.len();
        for portable in [false, true] {
            let found = scene.found(&prepared, portable, &mut scratch);
            assert!(agree(&found, &defined, scene.view.eye.length() + 2.0), "scene {i}, portable {portable}");
        }
    }
    assert!(starts > 50_000 && at_eye > 10, "{starts} starts, {at_eye} cells at eyes");
}

#[test]
fn the_comparison_notices_rays_that_are_off_by_a_tenth_of_a_pixel() {
    let notices = |scene: &&Scene| {
        let prepared = scene.prepare();
        let (found, defined) =
            (scene.found(&prepared, false, &mut StartScratch::default()), scene.defined(&prepared, 0.1));
        !agree(&found, &defined, scene.view.eye.length() + 2.0)
    };
    let other = scenes().iter().filter(notices).count();
    assert!(other > 50, "{other} scenes");
}

#[test]
#[cfg(target_arch = "x86_64")]
fn entries_of_eight_paths_have_the_bits_of_one() {
    use super::super::lanes::{EntryBits, entries_of};
    use super::super::{path, walk};
    let mut random = SplitMix64::new(11);
    let (mut compared, mut turned) = (0, 0);
    for scene in scenes() {
        let mut prepared = scene.prepare();
        // Some vertices have no finite scalar: the order of corners is then that of the face.
        let scalar = |_| if random.unit() < 0.1 { f32::NAN } else { random.unit() as f32 };
        let scalars: Vec<f32> = (0..prepared.vertices.len()).map(scalar).collect();
        prepared.vertices.iter_mut().zip(&scalars).for_each(|(vertex, &s)| vertex.s = f64::from(s));
        let found = scene.found(&prepared, false, &mut StartScratch::default());
        let (mesh, view, scalars) = (&*scene.mesh, &scene.view, Arc::new(scalars).into());
        let Prepared { vertices, bins, eye_cells } = &prepared;
        let entries = Entries { topology: &mesh.topology, view, vertices, bins, eye_cells, portable: false };
        let plane = RayPlane::of_view(view);
        let scene = walk::Scene {
            mesh,
            neighbours: &mesh.topology.connectivity().neighbours,
            active: &scene.active,
            all_active: false,
            view,
            plane,
            medium: &(),
            vertices,
            scalars: &scalars,
            entries,
            domain: None,
            early_termination: true,
        };
        for (tile, starts) in found.iter().enumerate() {
            let rect = plane.grid.rect(tile);
            let one_by_one = starts.iter().map(|&(pixel, Start { cell, opposite, .. })| -> Option<EntryBits> {
                let ray = plane.ray(rect, pixel as usize);
                let (ids, Crossing { corners, edges, point }) = path::enter(&scene, &ray, cell, opposite)?;
                turned += u32::from(ids != face_of(&mesh.topology, cell, opposite as usize).vertices);
                let of_corners = [
                    corners.map(|corner| corner.x),
                    corners.map(|corner| corner.y),
                    corners.map(|corner| corner.w),
                    corners.map(|corner| corner.s),
                    corners.map(|corner| corner.reach()),
                    edges,
                ];
                let of_ray = [ray.line.px, ray.line.py, point.depth, point.scalar];
                let numbers = of_corners.into_iter().flatten().chain(of_ray).map(f64::to_bits).collect();
                Some((ids, cell << 2 | opposite, numbers))
            });
            let one_by_one: Vec<_> = one_by_one.collect();
            let of_eight = entries_of(&scene, rect, starts);
            if !of_eight.is_empty() {
                assert_eq!(of_eight, one_by_one);
                compared += starts.len();
            }
        }
    }
    // Without vectors there is nothing to compare.
    assert!(matches!(Arch::new(), Arch::Scalar) || compared > 50_000 && turned > 5000, "{compared}, {turned} turned");
}
