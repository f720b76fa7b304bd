//! A job's transfer function, prepared.

use super::super::RenderJob;
use super::raycast::pre_integrated::PreIntegrated;
use crate::optics::exact::ExactTable;
use crate::optics::table3d::Table3d;
use crate::optics::{Integrator, OpticsKind};
use std::sync::Arc;

/// The job's transfer function, prepared.
pub(super) enum Table {
    Exact(ExactTable),
    Table3d(Arc<Table3d>),
}

impl Table {
    /// That of `job`; a pre-integrated one is kept in `pre_integrated`.
    pub(super) fn of(job: &RenderJob, pre_integrated: &mut PreIntegrated) -> Self {
        match job.optics {
            OpticsKind::Exact => Self::Exact(ExactTable::new(&job.table, job.mesh.positions.scale)),
            OpticsKind::Table3d => Self::Table3d(pre_integrated.get(job)),
        }
    }

    pub(super) fn is_clear(&self) -> bool {
        match self {
            Self::Exact(table) => table.is_clear(),
            Self::Table3d(table) => table.is_clear(),
        }
    }
}

/// Depth where a segment from one (depth, scalar) place to another becomes visible; infinite if it does not.
#[cold]
#[inline(never)]
pub(super) fn first_visible<I: Integrator>(table: &I, from: (f64, f64), to: (f64, f64)) -> f64 {
    let share = table.clear_share(from.1, to.1);
    if share < 1.0 { from.0 + share * (to.0 - from.0) } else { f64::INFINITY }
}
