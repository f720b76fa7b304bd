//! Kernels of active cells, face selection and depth order.

use super::Work;
use crate::scene::{Jet, TENTS};
use glam::DVec3;
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use tetreel::lod::{Ranking, Selector};
use tetreel::task::Cancel;
use tetreel::visibility::{ActiveCells, CellSet, Clusters, DepthOrder, TransparentIntervals};

/// Sorts all faces in new directions.
pub fn radix_sort(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(30_000, &[])?;
    let all = Arc::new(CellSet::all(jet.cells()));
    let selection = Selector::default().select(&jet.mesh, &Arc::new(Ranking::by_hash(&jet.mesh.topology)), 1.0, &all);
    let mut order = DepthOrder::default();
    Ok(Box::new(move || {
        for round in 0..4 {
            let angle = 0.7 + 0.4 * f64::from(round);
            let direction = DVec3::new(angle.cos(), 0.6 * angle.sin(), 0.8 * angle.sin());
            black_box(order.order(&jet.mesh, direction, &selection, &Cancel::new()).ok_or("cancelled")?);
        }
        Ok(())
    }))
}

/// Updates vertex labels and active cells at other steps.
pub fn active_cells(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(30_000, &[2, 5, 8])?;
    let transparent = Arc::new(TransparentIntervals::of(&*jet.table(TENTS)?));
    let clusters = Arc::new(Clusters::new(&jet.mesh));
    let mut cells = ActiveCells::default();
    Ok(Box::new(move || {
        for scalars in jet.scalars.iter().cycle().take(30) {
            let found =
                cells.update(&jet.mesh, &clusters, &scalars.clone().into(), (&transparent, &[]), false, &Cancel::new());
            black_box(found.ok_or("cancelled")?);
        }
        Ok(())
    }))
}

/// Selects half of the faces of different cells each time.
pub fn lod_selection(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(30_000, &[])?;
    let ranking = Arc::new(Ranking::by_hash(&jet.mesh.topology));
    let some: Vec<Arc<CellSet>> =
        (0..10).map(|round| Arc::new(CellSet::of(jet.cells(), |cell| (cell / 64 + round).is_multiple_of(3)))).collect();
    let mut selector = Selector::default();
    Ok(Box::new(move || {
        for active in &some {
            black_box(selector.select(&jet.mesh, &ranking, 0.5, active));
        }
        Ok(())
    }))
}
