//! Recycled memory: shared results are reused once nobody holds them.

use std::sync::Arc;

/// Results that were handed out, newest last.
#[derive(Debug)]
pub struct Pool<T>(Vec<Arc<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Default> Pool<T> {
    /// Maximum number of results kept; a further one replaces the oldest.
    const MOST: usize = 8;

    /// Hands out a result filled by `fill`: one that nobody holds any more, or a new one.
    pub fn make(&mut self, fill: impl FnOnce(&mut T)) -> Arc<T> {
        let free = self.0.iter_mut().position(|one| Arc::get_mut(one).is_some());
        // Nothing if a weak reference was upgraded in between.
        let mut one = free.and_then(|at| Arc::into_inner(self.0.remove(at))).unwrap_or_default();
        fill(&mut one);
        let one = Arc::new(one);
        if self.0.len() == Self::MOST {
            self.0.remove(0);
        }
        self.0.push(one.clone());
        one
    }
}
