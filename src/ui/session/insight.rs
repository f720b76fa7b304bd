//! What a session knows beside its pictures.

use super::{Drawing, Session};
use crate::pipeline::FrameTime;
use crate::ui::Picked;
use crate::ui::picture::Picture;
use crate::ui::probe::Hover;
use crate::ui::survey::Surveyed;
use std::sync::Arc;

impl Session {
    /// Where the mouse is in the picture, as [`PointAt`](crate::ui::Action::PointAt) has it.
    pub fn mouse(&self) -> Option<(f64, f64)> {
        self.insight.mouse()
    }

    /// What is under the mouse.
    pub fn hover(&self) -> Option<&Hover> {
        self.insight.hover()
    }

    /// The point whose value over the series is wanted.
    pub fn picked(&self) -> Option<Picked> {
        self.insight.picked()
    }

    /// Means and histograms of the field, as far as they are known.
    pub fn survey(&self) -> Arc<Surveyed> {
        self.insight.survey()
    }

    /// A small picture of a step as it would be shown; asked for if it is not there yet. `None` also forgets what was asked for.
    pub fn thumbnail(&mut self, step: Option<usize>) -> Option<Arc<Picture>> {
        let Some((step, size)) = step.zip(self.size_px()) else {
            self.insight.forget_thumbnails();
            return None;
        };
        let series = self.series().clone();
        let request = self.previews.make(&self.look, &series, FrameTime::from(step), size, &mut Drawing::at_rest)?;
        self.insight.thumbnail(&series, &request, self.background)
    }
}
