//! Cells, faces and points transformed to the view of a job before its renderer is free.

use super::functions::{FunctionPlacer, FunctionsInView};
use super::havs::{FacePlacer, FacesInView};
use super::is_transparent;
use super::points::{PointPlacer, PointsInView, checked_points};
use super::raycast::{CellPlacer, CellsInView};
use crate::camera::View;
use crate::field::Scalars;
use crate::mesh::Mesh;
use crate::render::functions::FunctionScene;
use crate::render::points::PointScene;
use crate::render::{OpticsTable, RenderJob};
use crate::visibility::{CellSet, Drawn};
use std::sync::Arc;

/// The cells or faces of a job in its view, for its [`RenderJob::placed`].
#[derive(Clone, Debug)]
pub struct Placed {
    mesh: Arc<Mesh>,
    scalars: Scalars,
    active: Arc<CellSet>,
    faces: Option<Arc<Drawn>>,
    points: Option<PointScene>,
    functions: Option<FunctionScene>,
    view: View,
    in_view: InView,
}

#[derive(Clone, Debug)]
enum InView {
    Cells(CellsInView),
    Faces(Arc<FacesInView>),
    Points(Arc<PointsInView>),
    Functions(Arc<FunctionsInView>),
}

impl Placed {
    fn is_of(&self, job: &RenderJob) -> bool {
        Arc::ptr_eq(&self.mesh, &job.mesh)
            && self.scalars.is_same(&job.scalars)
            && Arc::ptr_eq(&self.active, &job.active)
            && self.faces.as_ref().map(Arc::as_ptr) == job.faces.as_ref().map(Arc::as_ptr)
            && is_same_points(self.points.as_ref(), job.points.as_ref())
            && is_same_functions(self.functions.as_ref(), job.functions.as_ref())
            && self.view == job.view
    }

    /// The cells, if they match the job.
    pub(super) fn cells(&self, job: &RenderJob) -> Option<CellsInView> {
        match &self.in_view {
            InView::Cells(cells) => self.is_of(job).then(|| cells.clone()),
            _ => None,
        }
    }

    /// The faces, if they match the job.
    pub(super) fn faces(&self, job: &RenderJob) -> Option<Arc<FacesInView>> {
        match &self.in_view {
            InView::Faces(faces) => self.is_of(job).then(|| faces.clone()),
            _ => None,
        }
    }

    /// The points, if they match the job.
    pub(super) fn points(&self, job: &RenderJob) -> Option<Arc<PointsInView>> {
        match &self.in_view {
            InView::Points(points) => self.is_of(job).then(|| points.clone()),
            _ => None,
        }
    }

    /// The functions, if they match the job.
    pub(super) fn functions(&self, job: &RenderJob) -> Option<Arc<FunctionsInView>> {
        match &self.in_view {
            InView::Functions(functions) => self.is_of(job).then(|| functions.clone()),
            _ => None,
        }
    }
}

fn is_same_points(a: Option<&PointScene>, b: Option<&PointScene>) -> bool {
    let of = |points: Option<&PointScene>| points.map(|points| (Arc::as_ptr(&points.cells), points.style));
    of(a) == of(b)
}

fn is_same_functions(a: Option<&FunctionScene>, b: Option<&FunctionScene>) -> bool {
    let of = |scene: Option<&FunctionScene>| {
        scene.map(|of| (Arc::as_ptr(&of.kernels), of.style, of.range, of.domain, of.normalise))
    };
    of(a) == of(b)
}

/// Places the cells, faces, points and functions of successive jobs to be drawn on the CPU.
#[derive(Debug, Default)]
pub struct Placer {
    cells: CellPlacer,
    faces: FacePlacer,
    points: PointPlacer,
    functions: FunctionPlacer,
}

impl Placer {
    /// Places the cells of a job, or its faces or points if it has some, unless nothing is visible or the job is invalid. `table` is its transfer
    /// function.
    pub fn place(&mut self, job: &mut RenderJob, table: &OpticsTable) {
        if is_transparent(job, table) || job.check().is_err() {
            return;
        }
        let view = job.local_view();
        let mut stats = std::mem::take(&mut job.stats);
        let in_view = match job.faces {
            // The renderer reports invalid functions.
            None if job.functions.is_some() => {
                let functions = FunctionScene::of_job(job).ok();
                functions.map(|functions| InView::Functions(self.functions.place(job, &functions, &view, &mut stats)))
            }
            // The renderer reports invalid points.
            None if job.points.is_some() => {
                let points = checked_points(job).ok();
                points.map(|points| InView::Points(self.points.place(job, &points, &view, &mut stats)))
            }
            None => Some(InView::Cells(self.cells.place(job, &view, &mut stats))),
            // The renderer reports invalid faces.
            Some(_) => self.faces.place(job, &view, &mut stats).ok().map(InView::Faces),
        };
        job.stats = stats;
        job.placed = in_view.map(|in_view| Placed {
            mesh: job.mesh.clone(),
            scalars: job.scalars.clone(),
            active: job.active.clone(),
            faces: job.faces.clone(),
            points: job.points.clone(),
            functions: job.functions.clone(),
            view: job.view.clone(),
            in_view,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::havs::Havs;
    use super::super::raycast::Raycast;
    use super::*;
    use crate::camera::Camera;
    use crate::mesh::test_meshes::kuhn_grid;
    use crate::node_table::{Node, NodeTable};
    use crate::render::{Frame, OpticsTables, Renderer, testing};

    fn all_faces(mesh: &Mesh) -> Arc<Drawn> {
        Arc::new(Drawn { ids: (0..mesh.topology.connectivity().faces.len() as u32).collect(), is_complete: true })
    }

    /// One job for each renderer.
    fn jobs() -> [RenderJob; 2] {
        let mesh = Arc::new(Mesh::build(kuhn_grid([3; 3])).unwrap().0);
        let camera = Camera::default_for(mesh.positions.world_bounds()).unwrap();
        let node = |scalar, red| Node { scalar, rgb: [red, 1.0, 1.0 - red], tau: 0.4 };
        let table = Arc::new(NodeTable::new(vec![node(0.0, 0.0), node(1.0, 1.0)]).unwrap());
        let scalars = (0..mesh.positions.local.len()).map(|v| (v % 7) as f32 / 6.0).collect();
        let cells = testing::job(&mesh, scalars, &camera, (40, 23), table);
        let faces = RenderJob { faces: Some(all_faces(&mesh)), ..cells.clone() };
        [cells, faces]
    }

    fn placed(job: &RenderJob) -> RenderJob {
        let (mut job, table) = (job.clone(), OpticsTables::default().get(job));
        Placer::default().place(&mut job, &table);
        job
    }

    fn frame(job: &RenderJob) -> Frame {
        let mut renderer: Box<dyn Renderer> =
            if job.faces.is_some() { Box::new(Havs::new()) } else { Box::new(Raycast::new()) };
        renderer.render(job.clone()).unwrap().clone()
    }

    #[test]
    fn what_was_placed_ahead_is_drawn_to_the_bit_and_not_placed_again() {
        for job in jobs() {
            let (ahead, expected) = (placed(&job), frame(&job));
            let drawn = frame(&ahead);
            assert!(drawn.planes == expected.planes && drawn.planes.color.pixels.iter().any(|p| p[3] > 0.0));
            assert_eq!(drawn.stats.ms_place, ahead.stats.ms_place);
            assert!(ahead.stats.ms_place > 0.0 && expected.stats.ms_place > 0.0);
            let counts = |frame: &Frame| (frame.stats.entry_faces, frame.stats.faces_drawn);
            assert_eq!(counts(&drawn), counts(&expected));
        }
    }

    #[test]
    fn what_was_placed_for_another_job_is_placed_anew() {
        let changes: [fn(&mut RenderJob); 4] = [
            |job| job.view.eye.x += 0.25,
            |job| job.scalars = Arc::new(job.scalars.values().iter().map(|s| 1.0 - s).collect::<Vec<_>>()).into(),
            |job| {
                let half = CellSet::of(job.active.universe(), |cell| cell.is_multiple_of(2));
                job.active = Arc::new(half);
            },
            |job| {
                if let Some(drawn) = &mut job.faces {
                    *drawn = Arc::new(Drawn { ids: drawn.ids[1..].to_vec(), is_complete: false });
                } else {
                    job.faces = Some(all_faces(&job.mesh));
                }
            },
        ];
        for job in jobs() {
            for (number, change) in changes.iter().enumerate() {
                let mut ahead = placed(&job);
                change(&mut ahead);
                let drawn = frame(&ahead);
                assert_eq!(drawn.planes, frame(&RenderJob { placed: None, ..ahead.clone() }).planes, "{number}");
                assert!(drawn.stats.ms_place > ahead.stats.ms_place, "{number}");
                // Faces are drawn exactly, like cells: only then may the images be equal.
                assert!(drawn.planes != frame(&job).planes || number == 3, "{number}: the test can fail");
            }
        }
    }

    #[test]
    fn nothing_is_placed_of_what_cannot_be_drawn_or_seen() {
        for job in jobs() {
            let transparent = Arc::new(NodeTable::transparent());
            let cancelled = job.clone();
            let faults = [
                RenderJob { table: transparent, ..job.clone() },
                RenderJob { scalars: Arc::new(vec![0.0]).into(), ..job.clone() },
                RenderJob { active: Arc::new(CellSet::none(job.active.universe())), ..job.clone() },
                RenderJob { faces: Some(Arc::new(Drawn { ids: vec![u32::MAX], is_complete: false })), ..job },
            ];
            assert!(faults.iter().all(|job| placed(job).placed.is_none()));
            cancelled.cancel.cancel();
            assert!(placed(&cancelled).placed.is_none());
        }
    }
}
