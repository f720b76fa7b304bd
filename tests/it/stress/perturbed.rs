//! What the comparison of a case must notice.

use super::*;
use glam::Vec3;
use tetreel::visibility::CellSet;

/// Something done to a job at one of its cells; `None` if that is no change.
type Change = fn(&RenderJob, u32) -> Option<RenderJob>;

const CHANGES: [(&str, Change); 3] =
    [("a lost cell", lose_cell), ("two exchanged scalars", exchange_scalars), ("a moved vertex", move_vertex)];

fn lose_cell(job: &RenderJob, cell: u32) -> Option<RenderJob> {
    let mut active = (*job.active).clone();
    active.set(cell, false);
    Some(RenderJob { active: Arc::new(active), ..job.clone() })
}

fn exchange_scalars(job: &RenderJob, cell: u32) -> Option<RenderJob> {
    let ours = job.mesh.topology.tets[cell as usize][0] as usize;
    let other = (ours + job.scalars.values().len() / 2) % job.scalars.values().len();
    let mut scalars = job.scalars.values().to_vec();
    scalars.swap(ours, other);
    let is_change = scalars[ours].is_finite() && scalars[other].is_finite() && scalars[ours] != scalars[other];
    is_change.then(|| RenderJob { scalars: Arc::new(scalars).into(), ..job.clone() })
}

/// Within its cell, so that the mesh stays one.
fn move_vertex(job: &RenderJob, cell: u32) -> Option<RenderJob> {
    let tet = job.mesh.topology.tets[cell as usize];
    let mut mesh = (*job.mesh).clone();
    let centroid: Vec3 = mesh.positions.corners(tet).iter().sum::<Vec3>() / 4.0;
    let vertex = &mut mesh.positions.local[tet[1] as usize];
    *vertex = vertex.lerp(centroid, 0.3);
    Some(RenderJob { mesh: Arc::new(mesh), ..job.clone() })
}

/// Cells that are tried before a change counts as unnoticed: most lie in the view, and what cannot be seen is no error.
const CELLS_TRIED: usize = 100;

/// That all paths' images of the same changed job are too far off. A field that is constant has no scalars to exchange, and a moved
/// vertex does not show where all is alike.
pub fn assert_noticed(case: &Case, judged: &[Judged]) {
    let paths = paths();
    let Judged { job, .. } = &judged[0];
    let notices = |path: &Path, job: &RenderJob| {
        (path.render)(job).is_none_or(|frame| !case.bound_of(path).holds(judged[0].errors(&frame.planes.color)))
    };
    let mut noticed = Vec::new();
    for (name, change) in CHANGES {
        let tried = some_cells(&job.active).into_iter().filter_map(|cell| change(job, cell));
        let Some(other) = tried.into_iter().find(|other| paths.iter().all(|path| notices(path, other))) else {
            continue;
        };
        let mut off = Vec::new();
        for path in &paths {
            let Some(frame) = (path.render)(&other) else { continue };
            off.push(format!("{:.0e}", judged[0].errors(&frame.planes.color).1));
        }
        noticed.push(format!("{name} ({})", off.join(", ")));
    }
    eprintln!("{} | noticed: {}", case.name, noticed.join("; "));
    let varies = case.scalars.iter().any(|s| *s != case.scalars[0]);
    let is_lost_noticed = noticed.first().is_some_and(|first| first.starts_with(CHANGES[0].0));
    assert!(is_lost_noticed && (noticed.len() > 1 || !varies), "{}: {noticed:?}", case.name);
}

/// Active cells from all over the mesh.
fn some_cells(active: &CellSet) -> Vec<u32> {
    let all: Vec<u32> = (0..active.universe() as u32).filter(|&cell| active.contains(cell)).collect();
    let tried = all.len().min(CELLS_TRIED);
    // From the middle on: a stride without a common divisor would do as well, but the curve puts the middle into the mesh's.
    (0..tried).map(|i| all[(all.len() / 2 + i * all.len() / tried) % all.len()]).collect()
}
