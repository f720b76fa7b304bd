//! A homogeneous volume lets exp(-tau d) through wherever a ray goes: none misses a cell, none meets one twice.

use super::cameras::within;
use super::shapes::box_of_shapes;
use super::*;
use crate::meshes::{build, grid, noise};
use crate::render::raycast;
use glam::DVec3;
use rayon::prelude::*;
use tetreel::camera::View;
use tetreel::visibility::CellSet;

/// Optical depth of the box across its smallest width.
const DEPTH: f64 = 1.0;
/// What transmittance may be off by. A ray ends when less than 2^-17 (7.6e-6) shines through; that is nearly all of it.
const BOUND: f64 = 1e-5;

/// A box of cells, and its extinction.
struct Volume {
    name: &'static str,
    mesh: Arc<Mesh>,
    tau: f64,
}

impl Volume {
    fn new(name: &'static str, jitter: f64, squash: f64, thinnest: f64) -> Self {
        let mut raw = grid(6, jitter, 31, |_| true);
        for p in &mut raw.points {
            let layer = if thinnest == 1.0 { p.z } else { thinnest.powf(0.5 - 0.5 * p.z) * 2.0 - 1.0 };
            p.z = squash * layer;
        }
        Self { name, mesh: Arc::new(build(raw)), tau: 0.5 * DEPTH / squash }
    }

    fn of_shapes() -> Self {
        let (mesh, report) = Mesh::build(box_of_shapes()).unwrap();
        let found = (report.gapped_cells, report.warped_cells, report.zero_volume, report.non_manifold_faces);
        assert_eq!((found, report.parts), ((0, 0, 0, 0), 1));
        assert!(report.split_cells > 100 && mesh.topology.check().is_ok());
        // The faces of the boundary, and no others, are those in the sides of the box.
        let on_side = |face: u32| {
            let corners = mesh.topology.connectivity().faces[face as usize].map(|v| mesh.positions.world(v as usize));
            (0..3).any(|axis| corners.iter().all(|p| p[axis].abs() == 1.0 && p[axis] == corners[0][axis]))
        };
        let count = mesh
            .topology
            .connectivity()
            .boundary_faces()
            .inspect(|&face| assert!(on_side(face), "an inner face"))
            .count();
        assert!(count as u64 == report.boundary_faces && count > 150, "{count}");
        Self { name: "shapes", mesh: Arc::new(mesh), tau: 0.5 * DEPTH }
    }

    fn job(&self, view: View) -> RenderJob {
        let camera = camera(DVec3::X, cameras::PARALLEL);
        let scalars = vec![0.5; self.mesh.positions.local.len()];
        let job = job(&self.mesh, scalars, &camera, (1, 1), table(&[(0.0, [1.0; 3], self.tau)]));
        RenderJob { view, ..job }
    }
}

fn volumes() -> Vec<Volume> {
    vec![
        Volume::new("regular", 0.0, 1.0, 1.0),
        Volume::new("jittered", 0.16, 1.0, 1.0),
        Volume::new("slivers of 1e-3", 0.16, 1e-3, 1.0),
        Volume::new("slivers of 1e-5", 0.16, 1e-5, 1.0),
        Volume::new("layers to 1e-6", 0.16, 1.0, 1e-6),
        Volume::of_shapes(),
    ]
}

/// Length of a pixel's ray in the box from `lo` to `hi`; `None` if it lies in one of its sides.
fn chord(view: &View, (lo, hi): (DVec3, DVec3), pixel: usize) -> Option<f64> {
    let (px, py) = view.ray(pixel % view.width_px, pixel / view.width_px);
    let sideways = px * view.right + py * view.up;
    let (origin, direction, start) = if view.perspective {
        (view.eye, view.forward + sideways, view.near.max(0.0))
    } else {
        (view.eye + sideways, view.forward, f64::NEG_INFINITY)
    };
    let (mut near, mut far) = (start, f64::INFINITY);
    for axis in 0..3 {
        let (from, along, lo, hi) = (origin[axis], direction[axis], lo[axis], hi[axis]);
        // Within rounding of the view's frame, and of the place, parallel to these two sides.
        if along.abs() < 1e-14 {
            let gap = (from - lo).abs().min((from - hi).abs());
            if gap < 1e-12 {
                return None;
            }
            if from < lo || from > hi {
                return Some(0.0);
            }
        } else {
            let (a, b) = ((lo - from) / along, (hi - from) / along);
            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
        }
    }
    Some((far - near).max(0.0) * direction.length())
}

/// What rays were found to be off by.
#[derive(Clone, Copy, Default)]
struct Tally {
    rays: usize,
    /// Of these, with something in their way.
    hit: usize,
    /// Rays in sides of the box, which have no one answer.
    ambiguous: usize,
    wrong: usize,
    worst: f64,
}

impl Tally {
    fn of(volume: &Volume, view: &View, image: &RgbaImage) -> Self {
        let bounds = volume.mesh.positions.world_bounds();
        let mut tally = Self { rays: image.pixels.len(), ..Self::default() };
        for (pixel, rgba) in image.pixels.iter().enumerate() {
            let Some(length) = chord(view, bounds, pixel) else {
                tally.ambiguous += 1;
                continue;
            };
            let error = (1.0 - f64::from(rgba[3]) - (-volume.tau * length).exp()).abs();
            tally.hit += usize::from(length > 0.0);
            tally.wrong += usize::from(error.is_nan() || error > BOUND);
            tally.worst = tally.worst.max(error);
        }
        tally
    }

    fn and(self, other: Self) -> Self {
        Self {
            rays: self.rays + other.rays,
            hit: self.hit + other.hit,
            ambiguous: self.ambiguous + other.ambiguous,
            wrong: self.wrong + other.wrong,
            worst: self.worst.max(other.worst),
        }
    }

    fn report(&self, name: &str) {
        let Self { rays, hit, ambiguous, wrong, worst } = self;
        eprintln!("{name} | {rays} rays | {hit} hit | {ambiguous} in sides | {wrong} wrong | {worst:.1e}");
        assert_eq!(*wrong, 0, "{name}: worst {worst:.1e}");
    }
}

/// Random views, from outside and from within, both projections; the same for all volumes but for their height.
fn random_views(volume: &Volume, size: usize) -> Vec<View> {
    let squash = volume.mesh.positions.world_bounds().1.z;
    let views = (0..6u64).map(|seed| {
        let at = |i: u64| DVec3::new(noise(seed, i), noise(seed, i + 1), noise(seed, i + 2));
        let (focal_point, view_up) = (0.3 * at(10) * DVec3::new(1.0, 1.0, squash), at(20));
        let camera = match seed {
            0 | 1 => within(0.9 * at(0) * DVec3::new(1.0, 1.0, squash), 120.0, 0.0),
            2 | 3 => Camera { focal_point, view_up, ..camera(3.5 * at(0).normalize(), cameras::PERSPECTIVE) },
            _ => Camera { focal_point, view_up, ..camera(3.5 * at(0).normalize(), cameras::PARALLEL) },
        };
        camera.view(size, size).unwrap()
    });
    views.collect()
}

#[test]
fn random_rays_through_a_homogeneous_volume_lose_no_cell_and_meet_none_twice() {
    eprintln!("volume | rays | hit | in sides | wrong | worst");
    let mut all = Tally::default();
    for volume in volumes() {
        let views = random_views(&volume, 256);
        let tallies = views.iter().map(|view| Tally::of(&volume, view, &raycast(&volume.job(view.clone()))));
        let tally = tallies.fold(Tally::default(), Tally::and);
        tally.report(volume.name);
        all = all.and(tally);
    }
    assert!(all.rays > 1_900_000 && all.hit > 500_000, "{} rays, {} hit", all.rays, all.hit);
}

#[test]
fn no_path_loses_a_ray() {
    for path in paths() {
        for volume in volumes() {
            let views = random_views(&volume, 64);
            let tallies = views.iter().filter_map(|view| {
                let frame = (path.render)(&volume.job(view.clone()))?;
                Some(Tally::of(&volume, view, &frame.planes.color))
            });
            let tally = tallies.fold(Tally::default(), Tally::and);
            tally.report(&format!("{}, {}", volume.name, path.name));
        }
    }
}

/// Places that arithmetic may get wrong, each with a direction in which it may: vertices and points of edges and faces from three
/// sides, edges and faces from one end to the other.
fn adversarial(mesh: &Mesh) -> Vec<(DVec3, DVec3)> {
    let world = |v: u32| mesh.positions.world(v as usize);
    let sides = [DVec3::new(1.0, -2.0, 0.5), DVec3::ONE, DVec3::X].map(DVec3::normalize);
    let mut rays = Vec::new();
    for vertex in 0..mesh.positions.local.len() as u32 {
        rays.extend(sides.map(|side| (world(vertex), side)));
    }
    for (n, face) in mesh.topology.connectivity().faces.iter().enumerate() {
        let [a, b, c] = face.map(world);
        // An edge from its end, and from the side; a line in the face, and through a point of it.
        let edge = (b - a).normalize();
        rays.extend([(a, edge), (a.lerp(b, 0.5), sides[n % 3]), (a.lerp(b, 0.381_966), sides[(n + 1) % 3])]);
        rays.extend([(a.lerp(b, 0.7), (c - a.lerp(b, 0.3)).normalize()), ((a + b + c) / 3.0, sides[n % 3])]);
    }
    rays
}

/// Frames of this many pixels each way, with such a ray in the middle.
const FRAME_PX: usize = 5;

/// Views along a ray: from afar with its neighbours a millionth away, in parallel with them next to it, and with an eye on it.
fn views_along((place, direction): (DVec3, DVec3), index: usize) -> View {
    let projection = match index % 3 {
        0 => Projection::Perspective { view_angle: 1e-4 },
        1 => Projection::Parallel { scale: 1e-9 },
        _ => Projection::Perspective { view_angle: 60.0 },
    };
    // The last stands on the place itself.
    let back = if index % 3 == 2 { 0.0 } else { 4.0 };
    let position = place - back * direction;
    let focal_point = position + direction;
    let camera = Camera { position, focal_point, view_up: DVec3::new(0.3, 0.5, 0.8), projection, near: 0.0 };
    camera.view(FRAME_PX, FRAME_PX).unwrap()
}

// Long: every vertex, edge and face of five meshes has rays of its own, each an image.
#[test]
fn rays_through_vertices_along_edges_and_in_faces_lose_no_cell_and_meet_none_twice() {
    let mut all = Tally::default();
    for volume in volumes() {
        let rays = adversarial(&volume.mesh);
        let job = volume.job(views_along(rays[0], 0));
        let (chunks, bounds) = (rays.par_chunks(64).enumerate(), volume.mesh.positions.world_bounds());
        let tallies = chunks.map(|(chunk, rays)| {
            let mut renderer = Raycast::new();
            let tally = |(n, ray): (usize, &(DVec3, DVec3))| {
                let view = views_along(*ray, 64 * chunk + n);
                let is_on_side = view.perspective && on_side(view.eye, bounds);
                // An eye on a side of the box sees along it.
                if is_on_side {
                    return Tally::default();
                }
                let frame = renderer.render(RenderJob { view: view.clone(), ..job.clone() }).unwrap();
                Tally::of(&volume, &view, &frame.planes.color)
            };
            rays.iter().enumerate().map(tally).fold(Tally::default(), Tally::and)
        });
        let tally = tallies.reduce(Tally::default, Tally::and);
        tally.report(&format!("{}, adversarial", volume.name));
        all = all.and(tally);
    }
    assert!(all.rays > 500_000 && all.hit > 400_000, "{} rays, {} hit", all.rays, all.hit);
}

fn on_side(eye: DVec3, (lo, hi): (DVec3, DVec3)) -> bool {
    (0..3).any(|axis| (eye[axis] - lo[axis]).abs().min((eye[axis] - hi[axis]).abs()) < 1e-12)
}

#[test]
fn a_cell_that_is_lost_and_a_side_that_is_dented_are_noticed() {
    for volume in volumes() {
        let view = random_views(&volume, 128).swap_remove(2);
        let whole = volume.job(view.clone());
        let wrong = |job: &RenderJob| Tally::of(&volume, &view, &raycast(job)).wrong;
        assert_eq!(wrong(&whole), 0, "{}", volume.name);
        let cells = whole.active.universe();
        let noticed = (0..cells as u32).step_by(cells / 20).filter(|&cell| {
            let fewer = CellSet::of(cells, |c| c != cell as usize);
            wrong(&RenderJob { active: Arc::new(fewer), ..whole.clone() }) > 0
        });
        let lost = noticed.count();
        let mut dented = (*volume.mesh).clone();
        let top = dented.positions.local.iter().fold(f32::MIN, |top, p| top.max(p.z));
        let in_side = dented.positions.local.iter().position(|p| p.z == top && p.truncate().length() < 0.5).unwrap();
        dented.positions.local[in_side].z *= 0.9;
        let dent = wrong(&RenderJob { mesh: Arc::new(dented), ..whole.clone() });
        eprintln!("{}: {lost} of 20 lost cells noticed, {dent} rays through a dent", volume.name);
        assert!(lost > 0 && dent > 0, "{}", volume.name);
    }
}
