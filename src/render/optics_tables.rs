//! Transfer functions prepared for integration, cached between frames.

use super::RenderJob;
use super::points::PointStyle;
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::optics::exact::ExactTable;
use crate::optics::partial::PartialTable;
use crate::optics::table3d::{Table3d, Table3dResolution};
use crate::optics::{Integrator, OpticsKind};
use rayon::prelude::*;
use std::sync::Arc;

/// A transfer function prepared for its optics.
#[derive(Clone, Debug)]
pub enum OpticsTable {
    /// For [`OpticsKind::Exact`].
    Exact(Arc<ExactTable>),
    /// For [`OpticsKind::Table3d`].
    Table3d(Arc<Table3d>),
    /// For [`OpticsKind::Partial`].
    Partial(Arc<PartialTable>),
}

impl OpticsTable {
    /// Compares by pointer, not by content.
    pub fn is_same(&self, other: &Self) -> bool {
        std::ptr::eq(self.exact(), other.exact())
    }

    /// The transfer function itself, whatever the optics.
    pub fn exact(&self) -> &ExactTable {
        match self {
            Self::Exact(table) => table,
            Self::Table3d(table) => table.exact(),
            Self::Partial(table) => table.exact(),
        }
    }
}

/// A table with its transfer function and mesh: a job with another transfer function, mesh or optics ignores it.
#[derive(Clone, Debug)]
pub struct PreparedOptics {
    of: Arc<NodeTable>,
    mesh: Arc<Mesh>,
    table: OpticsTable,
}

impl PreparedOptics {
    /// The table, if it matches the job.
    fn of_job(&self, job: &RenderJob, resolution: Table3dResolution) -> Option<&OpticsTable> {
        let has_optics = match &self.table {
            OpticsTable::Exact(_) => job.optics == OpticsKind::Exact,
            OpticsTable::Partial(_) => job.optics == OpticsKind::Partial,
            OpticsTable::Table3d(table) => job.optics == OpticsKind::Table3d && table.resolution() == resolution,
        };
        let is_of_job = has_optics && Arc::ptr_eq(&self.of, &job.table) && Arc::ptr_eq(&self.mesh, &job.mesh);
        is_of_job.then_some(&self.table)
    }
}

/// Cache of the last tables, which depend on transfer function, optics and mesh, not on step or view.
#[derive(Debug, Default)]
pub struct OpticsTables {
    resolution: Table3dResolution,
    longest_edge: Option<(Arc<Mesh>, f64)>,
    /// The last table for each [`OpticsKind`]; the pre-integrated one is updated where the transfer function changes.
    last: [Option<Kept>; OpticsKind::ALL.len()],
    entries_built: u64,
}

#[derive(Debug)]
struct Kept {
    of: Arc<NodeTable>,
    scale: f64,
    longest_edge: f64,
    table: OpticsTable,
}

impl OpticsTables {
    /// An empty cache whose pre-integrated tables have this resolution.
    pub fn of_resolution(resolution: Table3dResolution) -> Self {
        Self { resolution, ..Self::default() }
    }

    /// Entries of pre-integrated tables that have been computed so far.
    pub fn entries_built(&self) -> u64 {
        self.entries_built
    }

    /// The table for a job, for its [`RenderJob::prepared`].
    pub fn prepare(&mut self, job: &RenderJob) -> PreparedOptics {
        PreparedOptics { of: job.table.clone(), mesh: job.mesh.clone(), table: self.get(job) }
    }

    /// The table for a job: the job's own, or the cached one if it matches, else a new one. If the job is cancelled, the table is
    /// unusable.
    pub fn get(&mut self, job: &RenderJob) -> OpticsTable {
        if let Some(table) = job.prepared.as_ref().and_then(|prepared| prepared.of_job(job, self.resolution)) {
            return table.clone();
        }
        let scale = job.mesh.positions.scale;
        let longest_edge = if job.optics == OpticsKind::Table3d { self.longest_edge(&job.mesh) } else { 0.0 };
        let last = &mut self.last[job.optics as usize];
        let fitting = last.as_ref().filter(|last| (last.scale, last.longest_edge) == (scale, longest_edge));
        if let Some(last) = fitting.filter(|last| Arc::ptr_eq(&last.of, &job.table)) {
            return last.table.clone();
        }
        let table = match job.optics {
            OpticsKind::Exact => OpticsTable::Exact(Arc::new(ExactTable::new(&job.table, scale))),
            OpticsKind::Partial => OpticsTable::Partial(Arc::new(PartialTable::new(&job.table, scale))),
            OpticsKind::Table3d => {
                let last = fitting.and_then(|last| match &last.table {
                    OpticsTable::Table3d(table) => Some(&**table),
                    _ => None,
                });
                let (range, resolution) = (Table3d::range_of(&job.table), self.resolution);
                let table = Table3d::changed(last, &job.table, range, longest_edge, scale, resolution, &job.cancel);
                OpticsTable::Table3d(Arc::new(table))
            }
        };
        if !job.cancel.is_cancelled() {
            if let OpticsTable::Table3d(table) = &table {
                self.entries_built += table.entries_built() as u64;
            }
            *last = Some(Kept { of: job.table.clone(), scale, longest_edge, table: table.clone() });
        }
        table
    }

    /// Length of the longest edge in local units: no segment of a ray through a cell is longer.
    fn longest_edge(&mut self, mesh: &Arc<Mesh>) -> f64 {
        if let Some((of, longest)) = &self.longest_edge
            && Arc::ptr_eq(of, mesh)
        {
            return *longest;
        }
        let at = |v: u32| mesh.positions.local[v as usize].as_dvec3();
        let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
        let longest =
            |tet: &[u32; 4]| pairs.map(|(a, b)| at(tet[a]).distance(at(tet[b]))).into_iter().fold(0.0, f64::max);
        let longest = match &mesh.radii {
            // A diameter, widened to the greatest scale, times the filling.
            Some(radii) => {
                let diameter = |(point, &r): (u32, &f32)| 2.0 * f64::from(r) * mesh.filling_of(point);
                PointStyle::MOST_RADIUS * (0..).zip(radii).map(diameter).fold(0.0, f64::max)
            }
            None => mesh.topology.tets.par_iter().map(longest).reduce(|| 0.0, f64::max),
        };
        self.longest_edge = Some((mesh.clone(), longest));
        longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::kuhn_grid_of;
    use crate::node_table::Node;
    use crate::render::testing;

    const SMALL: Table3dResolution = Table3dResolution { scalars: 17, lengths: 5 };
    const ALL: u64 = 17 * 17 * 5;

    fn job(optics: OpticsKind) -> RenderJob {
        let mesh = Arc::new(Mesh::build(kuhn_grid_of([1; 3], |_| true)).unwrap().0);
        let camera = crate::camera::Camera::default_for(mesh.positions.world_bounds()).unwrap();
        let vertices = mesh.positions.local.len();
        RenderJob { optics, ..testing::job(&mesh, vec![0.0; vertices], &camera, (4, 4), ramp(2.0)) }
    }

    /// Extinction 1 except at one node of eleven.
    fn ramp(tau: f64) -> Arc<NodeTable> {
        let tau_at = |i: u32| if i == 8 { tau } else { 1.0 };
        let node = |i: u32| Node { scalar: f64::from(i), rgb: [0.1 * f64::from(i), 0.5, 1.0], tau: tau_at(i) };
        Arc::new(NodeTable::new((0..=10).map(node).collect()).unwrap())
    }

    #[test]
    fn a_table_is_kept_until_something_changes_that_it_depends_on() {
        for optics in OpticsKind::ALL {
            let mut tables = OpticsTables::of_resolution(SMALL);
            let first = job(optics);
            let made = tables.get(&first);
            assert!(tables.get(&first).is_same(&made), "{optics}");
            // A new step or view keeps the table.
            let moved =
                RenderJob { scalars: Arc::new(vec![1.0; first.scalars.values().len()]).into(), ..first.clone() };
            assert!(tables.get(&moved).is_same(&made), "{optics}");
            let alike = RenderJob { table: ramp(2.0), ..first.clone() };
            assert!(!tables.get(&alike).is_same(&made), "{optics}");
        }
    }

    #[test]
    fn an_edit_rebuilds_what_it_meets_and_other_optics_rebuild_nothing() {
        let mut tables = OpticsTables::of_resolution(SMALL);
        let first = job(OpticsKind::Table3d);
        tables.get(&first);
        assert_eq!(tables.entries_built(), ALL);
        let edited = RenderJob { table: ramp(3.0), ..first.clone() };
        let OpticsTable::Table3d(changed) = tables.get(&edited) else { panic!("another table") };
        let built = tables.entries_built() - ALL;
        assert!(0 < built && built < ALL, "{built} of {ALL}");
        let OpticsTable::Table3d(anew) = OpticsTables::of_resolution(SMALL).get(&edited) else {
            panic!("another table")
        };
        assert_eq!(changed.entries(), anew.entries());
        tables.get(&RenderJob { optics: OpticsKind::Exact, ..edited.clone() });
        tables.get(&edited);
        assert_eq!(tables.entries_built(), ALL + built);
        // A mesh of another size needs another table.
        let other = job(OpticsKind::Table3d);
        let mesh = Arc::new(Mesh::build(kuhn_grid_of([2, 1, 1], |_| true)).unwrap().0);
        tables.get(&RenderJob { mesh, table: edited.table.clone(), ..other });
        assert_eq!(tables.entries_built(), 2 * ALL + built);
    }

    #[test]
    fn a_job_brings_its_table_along_unless_it_is_of_another() {
        let mut stage = OpticsTables::of_resolution(SMALL);
        for optics in OpticsKind::ALL {
            let mut job = job(optics);
            let prepared = stage.prepare(&job);
            job.prepared = Some(prepared.clone());
            let mut renderer = OpticsTables::of_resolution(SMALL);
            assert!(renderer.get(&job).is_same(&prepared.table), "{optics}");
            assert_eq!(renderer.entries_built(), 0, "{optics}");
            let other = RenderJob { table: ramp(3.0), ..job.clone() };
            assert!(!renderer.get(&other).is_same(&prepared.table), "{optics}");
            for other in OpticsKind::ALL.into_iter().filter(|other| *other != optics) {
                let other = RenderJob { optics: other, ..job.clone() };
                assert!(!renderer.get(&other).is_same(&prepared.table), "{optics}");
            }
            let finer = Table3dResolution { scalars: 18, ..SMALL };
            let is_own = OpticsTables::of_resolution(finer).get(&job).is_same(&prepared.table);
            assert_eq!(is_own, optics != OpticsKind::Table3d);
        }
    }

    #[test]
    fn what_was_cancelled_is_not_kept() {
        let mut tables = OpticsTables::of_resolution(SMALL);
        let cancelled = job(OpticsKind::Table3d);
        cancelled.cancel.cancel();
        tables.get(&cancelled);
        assert_eq!(tables.entries_built(), 0);
        let again = RenderJob { cancel: Default::default(), ..cancelled };
        tables.get(&again);
        assert_eq!(tables.entries_built(), ALL);
    }
}
