//! Meshes: regular ones with rays in faces and along edges, holes, slivers, boundary layers, far from the origin, tiny and huge.

use super::cameras::{PARALLEL, moved, oblique};
use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::{difference, raycast};
use glam::DVec3;
use tetreel::mesh::RawMesh;

type Shape = Box<dyn Fn(DVec3) -> bool>;

/// A mesh with [`wave`] in it.
fn case(name: impl Into<String>, raw: RawMesh) -> Case {
    let mesh = Arc::new(build(raw));
    let scalars = sample(&mesh, wave);
    Case::new(name, &mesh, scalars, dense())
}

/// Which cubes of a grid are there, by their middles.
fn shapes() -> [(&'static str, Shape); 4] {
    [
        ("hole", Box::new(|c: DVec3| c.length() > 0.5)),
        ("two parts", Box::new(|c: DVec3| c.x.abs() > 0.3)),
        (
            "checkerboard touching in edges",
            Box::new(|c: DVec3| ((c + DVec3::ONE) * 4.0).floor().as_ivec3().element_sum() % 2 == 0),
        ),
        ("shell", Box::new(|c: DVec3| c.abs().max_element() > 0.6)),
    ]
}

/// A box whose heights are squashed by `squash`, and whose layers become as thin as `thinnest` towards one side. The field and the
/// extinction are stretched with it, so that as much is to be seen as in a cube.
pub fn layered(name: &str, squash: f64, thinnest: f64) -> Case {
    let mut raw = grid(6, 0.16, 5, |_| true);
    let values: Vec<f64> = raw.points.iter().map(|&p| wave(p)).collect();
    let place = |z: f64| if thinnest == 1.0 { z } else { thinnest.powf(0.5 - 0.5 * z) * 2.0 - 1.0 };
    for p in &mut raw.points {
        p.z = place(p.z) * squash;
    }
    let mesh = Arc::new(build(raw));
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize] as f32).collect();
    let cameras = [[0.5, 0.3, 4.0], [2.0, 1.0, 3.0], [3.0, 2.0, 0.1], [-3.0, 2.0, -1.5]]
        .into_iter()
        .flat_map(|p| [cameras::PERSPECTIVE, PARALLEL].map(|projection| camera(DVec3::from_array(p), projection)))
        .collect();
    // Layers to 1e-6 keep the bound (measured: 7.7e-8, 1.8e-6): those in f32's reach of each other are next to nothing.
    let bound_on_gpu = if squash < 1e-4 { THIN_ON_GPU } else { BOUND };
    Case { cameras, bound_on_gpu, ..Case::new(name, &mesh, scalars, dense_per(squash)) }
}

/// Cells much wider than high.
pub fn anisotropic() -> Vec<Case> {
    vec![
        layered("slivers of 1e-3", 1e-3, 1.0),
        layered("slivers of 1e-5", 1e-5, 1.0),
        layered("layers to 1e-3", 1.0, 1e-3),
        layered("layers to 1e-6", 1.0, 1e-6),
    ]
}

pub fn regular() -> Case {
    case("regular", grid(6, 0.0, 1, |_| true))
}

pub fn jittered() -> Case {
    case("jittered", grid(6, 0.16, 1, |_| true))
}

/// The jittered box elsewhere, or of another size.
pub fn displaced(offset: DVec3, scale: f64) -> Case {
    let original = jittered();
    let mut raw = grid(6, 0.16, 1, |_| true);
    for p in &mut raw.points {
        *p = offset + scale * *p;
    }
    // The order along the curve is that of the rounded coordinates: vertices are found by their source.
    let values: Vec<(u32, f32)> = original.mesh.vertex_source.iter().copied().zip(original.scalars).collect();
    let mesh = Arc::new(build(raw));
    let value = |source: u32| values.iter().find(|v| v.0 == source).unwrap().1;
    let scalars = mesh.vertex_source.iter().map(|&source| value(source)).collect();
    let name = format!("offset {:.0e}, scale {scale:.0e}", offset.x);
    let cameras = oblique().iter().map(|c| moved(c, offset, scale)).collect();
    Case { cameras, size: (48, 48), ..Case::new(name, &mesh, scalars, dense_per(scale)) }
}

#[test]
fn regular_and_jittered_meshes_agree_with_rays_in_faces_and_along_edges() {
    run([regular(), jittered()]);
}

#[test]
fn parallel_rays_along_the_axes_agree() {
    let along = |case: Case| Case { name: format!("{} along axes", case.name), cameras: cameras::along_axes(), ..case };
    run([regular(), jittered()].map(along));
}

#[test]
fn every_ray_on_a_plane_of_the_lattice_agrees_where_it_has_an_answer() {
    // Rays a sixth apart, as half the cubes' edges: each runs in a face or along an edge, the outer ones in the boundary.
    let scale = 13.0 / 12.0;
    let cameras = cameras::AXES.map(|axis| camera(4.0 * axis, Projection::Parallel { scale })).to_vec();
    let ambiguous = Some("the rays at the box's outline lie in its faces");
    run([Case { name: "lattice".into(), size: (13, 13), cameras, ambiguous, ..regular() }]);
}

#[test]
fn holes_and_separate_parts_agree() {
    let cases = shapes().map(|(name, keep)| {
        // An even size and cameras off the axes: no ray lies in the flat sides of what is left.
        Case { cameras: oblique(), size: (48, 48), ..case(name, grid(8, 0.16, 7, keep)) }
    });
    run(cases);
}

#[test]
fn a_regular_mesh_with_a_hole_agrees_where_rays_have_an_answer() {
    // Off the middle, so that the planes in which rays run are those of its sides, too.
    let whole = case("regular with a hole", grid(8, 0.0, 7, |c| (c - DVec3::splat(0.25)).length() > 0.5));
    let ambiguous = Some("rays along axes and diagonals lie in faces of the hole's steps");
    let obliquely =
        Case { name: "regular with a hole, obliquely".into(), cameras: oblique(), size: (48, 48), ..whole.clone() };
    run([Case { ambiguous, size: (65, 65), ..whole }, obliquely]);
}

#[test]
fn slivers_and_boundary_layers_agree() {
    run(anisotropic());
}

#[test]
fn meshes_far_from_the_origin_agree() {
    run([1e4, 1e5, 1e6, 1e7, 1e8, 1e9].map(|offset| displaced(DVec3::new(offset, -0.7 * offset, 0.3 * offset), 1.0)));
}

#[test]
fn meshes_of_any_size_agree() {
    run([1e-30, 1e-12, 1e12, 1e30].map(|scale| displaced(DVec3::ZERO, scale)));
    run([displaced(DVec3::splat(1e-25), 1e-30), displaced(DVec3::splat(1e34), 1e30)]);
}

/// What an offset leaves of a mesh is decided by the file: its coordinates, and the camera's, are multiples of the offset's
/// rounding unit (1.2e-7 at 1e9), and a mesh of size 2 loses what is below. Nothing is added to that.
#[test]
fn an_offset_costs_no_more_than_the_coordinates_of_the_file_lose() {
    let at_home: Vec<RgbaImage> = displaced(DVec3::ZERO, 1.0).jobs().iter().map(raycast).collect();
    eprintln!("offset | rounding unit | rmse | max");
    for offset in [1e4, 1e5, 1e6, 1e7, 1e8, 1e9] {
        let away = displaced(DVec3::new(offset, -0.7 * offset, 0.3 * offset), 1.0);
        let unit = f64::max(offset.next_up() - offset, f64::from(f32::EPSILON) / 2.0);
        let errors = away.jobs().into_iter().zip(&at_home).map(|(job, home)| difference(&raycast(&job), home));
        let (rmse, max) = errors.fold((0f64, 0f64), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        eprintln!("{offset:.0e} | {unit:.1e} | {rmse:.1e} | {max:.1e}");
        // A place is off by one unit at most (vertex and eye by half of one on each axis), a ray's length in the mesh by three
        // where it meets faces at an angle, its scalar by as much times the field's slope (3), and the table's step moves by that:
        // optical depths change by (2 + 3 * 2.5 + 2 * 3) units, 16; f32 of the sums adds 1e-6.
        assert!(rmse <= 16.0 * unit + 1e-6, "offset {offset:.0e}: rmse {rmse:.1e}");
        assert!(max <= BOUND.max, "offset {offset:.0e}: max {max:.1e}");
        // An eye that is rounded to f32 would show.
        let mut job = away.jobs().swap_remove(0);
        job.view.eye = job.view.eye.as_vec3().as_dvec3();
        let (rmse, _) = difference(&raycast(&job), &at_home[0]);
        assert!(rmse > 16.0 * unit + 1e-6, "offset {offset:.0e} with an eye in f32: rmse {rmse:.1e}");
    }
}

/// What a table of 128 x 128 x 16 entries may be off by where the transfer function is linear from one end of the field to the
/// other. Mean extinctions are then exact. The mean of colour times extinction is a quadratic of the scalars at the ends, with
/// second derivatives of 2/3 c' t' in each; linear between entries h = r / 127 apart (r the range) it is off by h^2 / 8 (2/3 + 2/3) c' t':
/// with c' = 1 / r and t' = 2 / r by 2.1e-5 per unit of length, 7.2e-5 along the box's diagonal. Between 16 lengths it is off, too:
/// there the bound is measured (2.8e-5 in all; along slivers, with optical depths of hundreds in a cell, 5e-3).
pub fn table3d_bound() -> Bound {
    Bound { rmse: 7.2e-5, max: 1.5e-4 }
}

// Long: every job makes a pre-integrated table of its own.
#[test]
fn the_pre_integrated_table_agrees_where_the_transfer_function_is_linear() {
    let flat = |case: Case| {
        let ends = case.scalars.iter().fold((f64::MAX, f64::MIN), |(lo, hi), &s| (lo.min(s.into()), hi.max(s.into())));
        let nodes = [(ends.0, [0.2, 0.0, 1.0], 0.0), (ends.1, [1.0, 1.0, 0.1], 2.0)];
        let (optics, bound) = (OpticsKind::Table3d, table3d_bound());
        let name = format!("{}, pre-integrated", case.name);
        Case { name, table: table(&nodes), optics, bound, bound_on_gpu: bound, ..case }
    };
    run([regular(), jittered()].map(flat));
}
