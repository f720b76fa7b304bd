//! Restricts the cells of a frame to a set.

use super::{Activity, CellSet};
use std::sync::{Arc, Weak};

/// Restricts cells to a set; the result is kept while both stay.
#[derive(Debug, Default)]
pub struct Restricted {
    last: Option<([Weak<CellSet>; 3], Activity)>,
}

impl Restricted {
    /// The cells of `activity` that are among `cells`.
    ///
    /// # Panics
    /// If the sets are of different meshes.
    pub fn to(&mut self, cells: &Arc<CellSet>, activity: Activity) -> Activity {
        let of = [cells, &activity.finite, &activity.active].map(Arc::downgrade);
        if let Some((last, left)) = &self.last
            && std::iter::zip(last, &of).all(|(a, b)| a.ptr_eq(b))
        {
            return Activity { classified: activity.classified, ..left.clone() };
        }
        let both = |set: &CellSet| {
            assert_eq!(set.universe(), cells.universe(), "sets of one mesh");
            let mut left = set.clone();
            left.words_mut().iter_mut().zip(cells.words()).for_each(|(word, kept)| *word &= kept);
            Arc::new(left)
        };
        let finite = both(&activity.finite);
        let is_all = Arc::ptr_eq(&activity.finite, &activity.active);
        let active = if is_all { finite.clone() } else { both(&activity.active) };
        let left = Activity { finite, active, classified: activity.classified };
        self.last = Some((of, left.clone()));
        left
    }
}
