//! Jobs for tests.

use super::points::{PointScene, PointStyle};
use super::{JointScene, RenderJob};
use crate::camera::Camera;
use crate::field::Scalars;
use crate::lod::Ranking;
use crate::mesh::Mesh;
use crate::node_table::{JointTable, NodeTable};
use crate::task::Cancel;
use crate::visibility::{CellSet, DepthOrder, Drawn, Elements, Selection, finite_cells};
use std::sync::Arc;

/// The bounds of all accurate renderers against each other and the reference: root mean square, and greatest difference.
pub(crate) const BOUNDS: [f64; 2] = [1e-5, 1e-3];

/// Root mean square and greatest difference of the channels of two images.
pub(crate) fn difference(a: &[[f32; 4]], b: &[[f32; 4]]) -> [f64; 2] {
    assert_eq!(a.len(), b.len());
    let all = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
    let (sum, most) = all.fold((0.0, 0.0f64), |(sum, most), d| (sum + d * d, most.max(d)));
    [(sum / (4 * a.len()) as f64).sqrt(), most]
}

/// Whether a [`difference`] is within [`BOUNDS`].
pub(crate) fn is_within([rmse, most]: [f64; 2]) -> bool {
    rmse <= BOUNDS[0] && most <= BOUNDS[1]
}

/// A job of all cells with finite scalars, one scalar per vertex, from a camera, the width and height of the image, and a
/// table.
pub(crate) fn job(
    mesh: &Arc<Mesh>,
    scalars: Vec<f32>,
    camera: &Camera,
    size_px: (usize, usize),
    table: Arc<NodeTable>,
) -> RenderJob {
    let active = Arc::new(finite_cells(&mesh.topology, &scalars));
    let view = camera.view(size_px.0, size_px.1).unwrap();
    RenderJob::new(mesh.clone(), Arc::new(scalars), active, view, table)
}

/// The job with all of its active cells as points, in depth order if theirs is not exact.
pub(crate) fn with_points(job: &RenderJob, style: PointStyle) -> RenderJob {
    let selection = Arc::new(Selection { ids: (*job.active).clone(), is_complete: true });
    with_selection(job, style, selection)
}

/// The job with some of its cells as points.
pub(crate) fn with_selection(job: &RenderJob, style: PointStyle, selection: Arc<Selection>) -> RenderJob {
    let cells = if style.exact_order {
        let mut drawn = Drawn::default();
        drawn.list(&selection, &mut Vec::new());
        Arc::new(drawn)
    } else {
        DepthOrder::of(Elements::Cells).order(&job.mesh, job.view.forward, &selection, &Cancel::new()).unwrap()
    };
    RenderJob { points: Some(PointScene { cells, style }), ..job.clone() }
}

/// The job with a sample of its cells for the level of detail of a style.
pub(crate) fn with_sample(job: &RenderJob, style: PointStyle, seed: u32) -> RenderJob {
    let cells = job.active.universe();
    let ranking = Ranking::of_cells(cells, seed);
    let mut ids = CellSet::none(cells);
    ranking.ids()[..style.points(cells)].iter().for_each(|&cell| ids.set(cell, true));
    with_selection(job, style, Arc::new(Selection { ids, is_complete: false }))
}

/// The job with a table of the scalar and a value beside it: of vertices, or of cells, as its scalars; values are `value(i)`, -1 to 1.
pub(crate) fn with_rows(job: &RenderJob, value: impl Fn(usize) -> f32) -> RenderJob {
    let (scalars, rows) = (vec![-1.4, 0.1, 0.1, 1.4], vec![-1.0, 0.2, 1.0]);
    let values = (0..12).map(|i| [i as f32 / 12.0, 0.5, 1.0 - i as f32 / 12.0, 0.3 + (i % 5) as f32]).collect();
    let table = Arc::new(JointTable::new(scalars, rows, vec![0.0], values).unwrap());
    let values: Arc<Vec<f32>> = Arc::new((0..job.scalars.values().len()).map(value).collect());
    let row_values = match job.scalars {
        Scalars::Vertices(_) => Scalars::Vertices(values),
        Scalars::Cells(_) => Scalars::Cells(values),
    };
    let projection = table.projection().clone();
    let joint = Some(JointScene { table, row_values: Some(row_values), cell_values: None });
    RenderJob { table: projection, joint, ..job.clone() }
}

/// The job with scalars of its cells, those of their first corners.
pub(crate) fn of_cells(job: &RenderJob) -> RenderJob {
    let scalars = job.mesh.topology.tets.iter().map(|tet| job.scalars.values()[tet[0] as usize]).collect();
    RenderJob { scalars: Scalars::Cells(Arc::new(scalars)), ..job.clone() }
}
