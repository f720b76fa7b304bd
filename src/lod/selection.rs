//! Selects the faces or cells of a level of detail.

use super::Ranking;
use super::ranking::share;
use crate::mesh::{Mesh, Topology};
use crate::slowdown::{Slow, waste};
use crate::visibility::{CellSet, IdSet, Pool, Selection};
use std::sync::Arc;

/// The faces drawn at level of detail `fraction` (0 to 1; NaN counts as 1): of those between two active cells, this fraction (rounded), in
/// the order of `ranking`; and all faces between an active cell and an inactive one or the outside. Faces without an active cell are
/// excluded.
///
/// [`Selector`] does the same incrementally.
///
/// # Panics
/// If `ranking` or `active` belongs to another mesh.
pub fn select(topology: &Topology, ranking: &Ranking, fraction: f64, active: &CellSet) -> Selection {
    let mut parts = Parts::default();
    parts.set(topology, active);
    let mut out = Selection::default();
    parts.choose(ranking, fraction, &mut out);
    out
}

/// The faces of the active cells.
#[derive(Debug, Default)]
struct Parts {
    surface: IdSet,
    inner: IdSet,
    inner_count: usize,
    all_active: bool,
}

impl Parts {
    fn set(&mut self, topology: &Topology, active: &CellSet) {
        assert_eq!(active.universe(), topology.tets.len(), "a set of the cells of this mesh");
        self.surface.set_boundary_of(active, &topology.connectivity().face_cells, &mut self.inner);
        self.inner_count = self.inner.count();
        self.all_active = active.count() == active.universe();
    }

    fn choose(&self, ranking: &Ranking, fraction: f64, out: &mut Selection) {
        assert_eq!(ranking.universe(), self.inner.universe(), "a ranking of this mesh");
        let mut left = share(fraction, self.inner_count);
        out.ids.copy_from(&self.surface);
        out.is_complete = left == self.inner_count;
        if out.is_complete {
            out.ids.insert_all(&self.inner);
        } else if self.all_active {
            // All interior faces lie between active cells.
            ranking.ids()[..left].iter().for_each(|&face| out.ids.set(face, true));
        } else {
            for &face in ranking.ids() {
                if left == 0 {
                    break;
                }
                if self.inner.contains(face) {
                    out.ids.set(face, true);
                    left -= 1;
                }
            }
        }
    }
}

/// [`select()`] from frame to frame: updates only what has changed, in the same memory (three bits per face).
#[derive(Debug, Default)]
pub struct Selector {
    /// Mesh and active cells that the sets belong to.
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    parts: Parts,
    last: Option<(Arc<Ranking>, f64, Arc<Selection>)>,
    pool: Pool<Selection>,
}

impl Selector {
    /// The faces to draw; the same [`Arc`] as before if nothing has changed.
    ///
    /// # Panics
    /// As [`select()`].
    pub fn select(
        &mut self,
        mesh: &Arc<Mesh>,
        ranking: &Arc<Ranking>,
        fraction: f64,
        active: &Arc<CellSet>,
    ) -> Arc<Selection> {
        let is_same = |(of, cells): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(of, mesh) && (Arc::ptr_eq(cells, active) || cells == active)
        };
        if !self.of.as_ref().is_some_and(is_same) {
            (self.of, self.last) = (None, None);
            self.parts.set(&mesh.topology, active);
            self.of = Some((mesh.clone(), active.clone()));
        }
        if let Some((of, at, selection)) = &self.last
            && *at == fraction
            && Arc::ptr_eq(of, ranking)
        {
            return selection.clone();
        }
        let Self { parts, pool, .. } = self;
        let selection = pool.make(|out| parts.choose(ranking, fraction, out));
        waste(Slow::LodSelection, ranking.universe());
        self.last = Some((ranking.clone(), fraction, selection.clone()));
        selection
    }
}

/// Selects cells from frame to frame, in the same memory.
#[derive(Debug, Default)]
pub struct CellSelector {
    last: Option<LastCells>,
    pool: Pool<Selection>,
}

/// A selection of cells, and what it is of.
#[derive(Debug)]
struct LastCells {
    ranking: Option<Arc<Ranking>>,
    count: usize,
    active: Arc<CellSet>,
    selection: Arc<Selection>,
}

impl LastCells {
    fn is_of(&self, ranking: Option<&Arc<Ranking>>, count: usize, active: &Arc<CellSet>) -> bool {
        self.count == count
            && self.ranking.as_ref().map(Arc::as_ptr) == ranking.map(Arc::as_ptr)
            && (Arc::ptr_eq(&self.active, active) || self.active == *active)
    }
}

impl CellSelector {
    /// The first `count` active cells in the order of `ranking`, all without one; the same [`Arc`] as before if nothing has changed.
    ///
    /// # Panics
    /// If `ranking` or `active` belongs to another mesh.
    pub fn select(&mut self, ranking: Option<&Arc<Ranking>>, count: usize, active: &Arc<CellSet>) -> Arc<Selection> {
        if let Some(last) = self.last.as_ref().filter(|last| last.is_of(ranking, count, active)) {
            return last.selection.clone();
        }
        let is_of_mesh = |ranking: &Arc<Ranking>| ranking.universe() == active.universe();
        assert!(ranking.is_none_or(is_of_mesh), "a ranking of the cells of this mesh");
        self.last = None;
        let selection = self.pool.make(|out| {
            out.is_complete = count >= active.count();
            let Some(ranking) = ranking.filter(|_| !out.is_complete) else {
                out.ids.copy_from(active);
                return;
            };
            out.ids.clear_to(active.universe());
            let chosen = ranking.ids().iter().filter(|&&cell| active.contains(cell)).take(count);
            chosen.for_each(|&cell| out.ids.set(cell, true));
        });
        let (ranking, active) = (ranking.cloned(), active.clone());
        self.last = Some(LastCells { ranking, count, active, selection: selection.clone() });
        selection
    }
}
