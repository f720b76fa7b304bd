//! The pre-integrated table of a job, kept from frame to frame.

use super::super::super::RenderJob;
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::optics::table3d::{Table3d, Table3dResolution};
use rayon::prelude::*;
use std::sync::Arc;

/// The table of the last job that asked for one. It depends on transfer function and mesh, neither on step nor on view.
#[derive(Default)]
pub(in crate::render) struct PreIntegrated {
    resolution: Table3dResolution,
    longest_edge: Option<(Arc<Mesh>, f64)>,
    table: Option<Kept>,
}

struct Kept {
    of: Arc<NodeTable>,
    longest_edge: f64,
    scale: f64,
    table: Arc<Table3d>,
}

impl PreIntegrated {
    pub(in crate::render) fn of_resolution(resolution: Table3dResolution) -> Self {
        Self { resolution, ..Self::default() }
    }

    /// The table of a job; integrated only if transfer function or mesh have changed. If the job is cancelled, what there is.
    pub(in crate::render) fn get(&mut self, job: &RenderJob) -> Arc<Table3d> {
        let scale = job.mesh.positions.scale;
        let longest_edge = self.longest_edge(&job.mesh);
        let same = |k: &&Kept| Arc::ptr_eq(&k.of, &job.table) && (k.longest_edge, k.scale) == (longest_edge, scale);
        if let Some(kept) = self.table.as_ref().filter(same) {
            return kept.table.clone();
        }
        let range = Table3d::range_of(&job.table);
        let table = Table3d::new_unless(&job.table, range, longest_edge, scale, self.resolution, &job.cancel);
        let table = Arc::new(table);
        if !job.cancel.is_cancelled() {
            self.table = Some(Kept { of: job.table.clone(), longest_edge, scale, table: table.clone() });
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
        let longest = mesh.topology.tets.par_iter().map(longest).reduce(|| 0.0, f64::max);
        self.longest_edge = Some((mesh.clone(), longest));
        longest
    }
}
