//! Memory that goes round: shared results whose last holder gives them back.

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
    /// Results that are remembered; one more is made anew and then remembered instead of the oldest.
    const MOST: usize = 8;

    /// Hands out what `fill` makes of a result that nobody holds any more, or of a new one.
    pub fn make(&mut self, fill: impl FnOnce(&mut T)) -> Arc<T> {
        let free = self.0.iter_mut().position(|one| Arc::get_mut(one).is_some());
        let mut one = free.map(|at| self.0.remove(at)).unwrap_or_default();
        match Arc::get_mut(&mut one) {
            Some(unshared) => fill(unshared),
            // Somebody with a weak reference has taken hold of it between the two looks.
            None => {
                let mut new = T::default();
                fill(&mut new);
                one = Arc::new(new);
            }
        }
        if self.0.len() == Self::MOST {
            self.0.remove(0);
        }
        self.0.push(one.clone());
        one
    }
}
