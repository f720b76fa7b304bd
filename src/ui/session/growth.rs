//! A session whose series grows.

use super::Session;
use crate::pipeline::Series;
use crate::playback::Command;
use crate::store::Store;
use crate::ui::following::{Follower, Grown};
use std::sync::Arc;
use std::time::Duration;

impl Session {
    /// Takes up steps that this follower finds.
    pub fn grow_with(&mut self, follower: Follower) {
        self.follower = Some(follower);
    }

    /// Shows steps that were added to the store.
    pub(super) fn take_growth(&mut self, now: Duration) {
        while let Some(grown) = self.follower.as_ref().and_then(Follower::take) {
            match grown {
                Ok(Grown { store, series }) => self.grow(store, series, now),
                Err(problem) => self.fail(problem),
            }
        }
    }

    /// Continues with the grown series.
    ///
    /// At rest on the last step it goes on to the new last one.
    pub fn grow(&mut self, store: Arc<Store>, series: Arc<Series>, now: Duration) {
        let before = self.state();
        let is_at_end = !before.playing && before.frame.is_some_and(|frame| frame.step() + 1 == before.steps);
        match self.player.grow(series) {
            Ok(()) => {
                self.store = store;
                self.study();
                if is_at_end && let Err(error) = self.player.apply(Command::SeekStep(usize::MAX), now) {
                    self.fail(error.to_string());
                }
            }
            Err(error) => self.fail(error.to_string()),
        }
    }
}
