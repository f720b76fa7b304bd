//! View coordinates against f64.

use super::*;
use crate::field::Scalars;
use crate::node_table::JointTable;
use crate::optics::ScalarMap;
use crate::render::JointScene;
use crate::render::gpu::layout::{PLANE_SCALE, depth_of};

/// Error of a view coordinate, relative to the distances of vertex and mesh from the eye (D) and of the eye from the local
/// origin (E), added.
///
/// With u = 2^-24, half a unit of f32's last place: the parts of the eye are right to u^2 E. The difference of the lower parts
/// loses 2 u^2 (D + E), the axes' third part 7 u^2 D. Each of twelve exact products, added one after the other, leaves
/// a rest of at most u D; their sum loses (1 + 2 + .. + 12) u^2 D = 78 u^2 D. The small products (4 u D and 2 u (D + E)) lose
/// 12 u^2 D and 8 u^2 (D + E), what is left out of them is 8 u^2 (D + E), and their sum with the rests loses
/// 16 u^2 D + 2 u^2 (D + E). Counting depths from another place loses 6 u^2 (D + E) more: below 140 u^2 (D + E), 2^-40.
const BOUND: f64 = 1.0 / (1u64 << 40) as f64;

/// Largest error of a coordinate in units of D + E, and whether the first part of each depth has 12 bits.
fn largest_error(prepared: &[[f32; 8]], job: &RenderJob, view: &View) -> f64 {
    let two = |v: &[f32]| f64::from(v[0]) + f64::from(v[1]);
    let mut largest = 0f64;
    for (found, place) in prepared.iter().zip(&job.mesh.positions.local) {
        let place = place.as_dvec3();
        let expected = seen(view, place);
        // Depths of parallel rays are counted from the local origin.
        let depth = if view.perspective { expected.z } else { view.forward.dot(place) };
        let errors = [
            two(&found[0..2]) / PLANE_SCALE - expected.x,
            two(&found[2..4]) / PLANE_SCALE - expected.y,
            f64::from(found[4]) + two(&found[5..7]) - depth,
        ];
        let unit = expected.length() + view.eye.length();
        largest = errors.iter().fold(largest, |m, e| m.max(e.abs() / unit));
    }
    largest
}

#[test]
fn view_coordinates_are_those_of_f64() {
    let Some(context) = context() else { return };
    for offset in [DVec3::ZERO, DVec3::new(1e7, -3e5, 8e4)] {
        let mesh = mesh(1, 0, offset);
        for (name, camera) in cameras(offset) {
            let job = job(&mesh, &camera, (40, 30));
            let view = job.local_view();
            let Prepared { params, vertices, .. } = prepare(&context, &job);
            let error = largest_error(&vertices, &job, &view);
            assert!(error <= BOUND, "{name}, offset {offset}: 2^{:.1}", error.log2());
            for v in &vertices {
                assert_eq!(v[4].to_bits() & 0xfff, 0, "{name}: the first part of a depth has 12 bits");
            }
            let origin = if view.perspective { 0.0 } else { -view.forward.dot(view.eye) };
            assert!((depth_of(params.depth_origin) - origin).abs() <= BOUND * view.eye.length());
        }
    }
}

#[test]
fn the_comparison_notices_a_moved_eye_and_lost_rests() {
    let Some(context) = context() else { return };
    let mesh = mesh(1, 0, DVec3::ZERO);
    for (name, camera) in cameras(DVec3::ZERO) {
        let job = job(&mesh, &camera, (40, 30));
        let view = job.local_view();
        let Prepared { vertices, .. } = prepare(&context, &job);
        // Four bounds along each axis, of the least unit in the mesh.
        let unit = |p: &glam::Vec3| seen(&view, p.as_dvec3()).length() + view.eye.length();
        let least = mesh.positions.local.iter().map(unit).fold(f64::INFINITY, f64::min);
        let step = 4.0 * BOUND * least * (view.right + view.up);
        let moved = View { eye: view.eye + step, ..view.clone() };
        assert!(largest_error(&vertices, &job, &moved) > BOUND, "{name}: a moved eye");
        // Of x and y seen from far, which are small beside the distance, the first part is right to the bound.
        let rests: &[usize] = if name == "far" { &[5, 6] } else { &[1, 3, 5, 6] };
        for &rest in rests {
            let mut cut = vertices.clone();
            cut.iter_mut().for_each(|v| v[rest] = 0.0);
            let error = largest_error(&cut, &job, &view);
            assert!(error > BOUND, "{name}, rest {rest}: 2^{:.1}", error.log2());
        }
    }
}

/// Largest error of a mapped scalar, relative to itself.
fn largest_scalar_error(vertices: &[[f32; 8]], params: &Params, scalars: &[f64]) -> f64 {
    let (offset, scale) = (f64::from(params.scalar_offset), f64::from(params.scalar_scale));
    let error = |(v, s): (&[f32; 8], &f64)| {
        let expected = (s - offset) * scale;
        ((f64::from(v[7]) - expected) / expected).abs()
    };
    vertices.iter().zip(scalars).map(error).fold(0.0, f64::max)
}

#[test]
fn scalars_are_seen_through_their_map() {
    let Some(context) = context() else { return };
    let mesh = mesh(1, 0, DVec3::ZERO);
    let base = job(&mesh, &cameras(DVec3::ZERO)[0].1, (40, 30));
    // Below 2^-63 scalars are sent times 2^100 (`GpuScalars`).
    for (factor, shift, prescale) in [(1.0, 0.0, 1.0), (1e-30, 0.0, 100f64.exp2()), (3.0, 1e4, 1.0)] {
        let scalars: Vec<f32> = base.scalars.values().iter().map(|s| s * factor + shift).collect();
        let nodes = base.table.nodes().iter();
        let nodes = nodes.map(|n| Node { scalar: n.scalar * f64::from(factor) + f64::from(shift), ..*n }).collect();
        let table = Arc::new(NodeTable::new(nodes).unwrap());
        let job = RenderJob { scalars: Arc::new(scalars).into(), table, ..base.clone() };
        let Prepared { params, vertices, .. } = prepare(&context, &job);
        // A difference and a product, rounded by 2^-24 each.
        let bound = 1.01 / (1u64 << 23) as f64;
        let sent: Vec<_> = job.scalars.values().iter().map(|&s| f64::from(s) * prescale).collect();
        let error = largest_scalar_error(&vertices, &params, &sent);
        assert!(error <= bound, "factor {factor}, shift {shift}: {error:.1e}");
        let other = Params { scalar_scale: params.scalar_scale * (1.0 + 1e-6), ..params };
        assert!(largest_scalar_error(&vertices, &other, &sent) > bound);
        // The map keeps what the table can tell apart near 1.
        assert!(vertices.iter().all(|v| v[7].abs() < 8.0));
    }
}

#[test]
fn scalars_of_cells_are_seen_through_their_map_and_followed_by_the_values_of_rows() {
    let Some(context) = context() else { return };
    // Both numbers of cells leave a part of the last vertex's space.
    for missing in [0, 5] {
        let mesh = mesh(1, missing, DVec3::ZERO);
        let cells = mesh.topology.tets.len();
        let base = job(&mesh, &cameras(DVec3::ZERO)[0].1, (40, 30));
        let of_cell = |seed: f32| (0..cells).map(|cell| (seed * cell as f32).sin()).collect::<Vec<f32>>();
        let table = |scalar: f64| {
            let values = vec![[1.0, 0.5, 0.2, 1.0]; 4];
            Arc::new(JointTable::new(vec![scalar, scalar + 0.5], vec![0.0, 3.0], vec![0.0], values).unwrap())
        };
        // Far from zero scalars have an offset.
        for (scalar, rows) in [(-0.2, true), (-0.2, false), (300.0, true)] {
            let scalars: Vec<f32> = of_cell(0.3).iter().map(|s| s + scalar as f32).collect();
            let (table, row_values) = (table(scalar), of_cell(0.7));
            let joint = rows.then(|| JointScene {
                table: table.clone(),
                row_values: Some(Scalars::Cells(Arc::new(row_values.clone()))),
                cell_values: None,
            });
            let (scalars, table) = (Scalars::Cells(Arc::new(scalars)), table.projection().clone());
            let job = RenderJob { scalars: scalars.clone(), joint, table, ..base.clone() };
            let Prepared { params, behind, .. } = prepare(&context, &job);
            assert_eq!((params.cell_count as usize, params.scalar_offset != 0.0), (cells, scalar != -0.2));
            let map = ScalarMap {
                prescale: 1.0,
                offset: f64::from(params.scalar_offset),
                scale: f64::from(params.scalar_scale),
                of_cells: true,
            };
            let seen = |map: ScalarMap| scalars.values().iter().map(|&s| map.seen(s).to_bits()).collect::<Vec<_>>();
            let bits = |numbers: &[f32]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<_>>();
            assert!(bits(&behind[..cells]) == seen(map), "{missing} {scalar}");
            assert!(bits(&behind[..cells]) != seen(ScalarMap { offset: map.offset + 0.01, ..map }));
            if rows {
                let of_rows: Vec<f32> = row_values.iter().map(|&value| value / 4.0).collect();
                assert!(bits(&behind[cells.next_multiple_of(8)..][..cells]) == bits(&of_rows), "{missing} {scalar}");
            }
        }
    }
}
