//! Data of a session beside its pictures.

use super::Session;
use crate::pipeline::FrameTime;
use crate::transfer::Space;
use crate::ui::Picked;
use crate::ui::histograms::{Asked, Shown as Histogram, Wanted};
use crate::ui::motion::Drawing;
use crate::ui::picture::Picture;
use crate::ui::probe::Hover;
use crate::ui::survey::Surveyed;
use std::sync::Arc;

impl Session {
    /// Position of the mouse in the picture, as in [`PointAt`](crate::ui::Action::PointAt).
    pub fn mouse(&self) -> Option<(f64, f64)> {
        self.insight.mouse
    }

    /// The answer for the point under the mouse.
    pub fn hover(&self) -> Option<&Hover> {
        self.insight.hover.as_ref()
    }

    /// The picked point.
    pub fn picked(&self) -> Option<Picked> {
        self.insight.picked()
    }

    /// Means and histograms of the field, as far as they are known.
    pub fn survey(&self) -> Arc<Surveyed> {
        self.insight.survey.snapshot()
    }

    /// Requests the histogram over which a transfer function is edited: of the series, or of the step shown. `None`: nobody looks at one.
    pub fn want_histogram(&mut self, wanted: Option<(Space, bool)>) {
        let series = self.series().clone();
        let step = self.shown.as_ref().map(|shown| shown.request.time.step());
        let asked = wanted.and_then(|(kind, is_of_step)| {
            let of = if is_of_step { Wanted::Step(step?) } else { Wanted::Series };
            Some(Asked { series, kind, of })
        });
        self.insight.histograms.ask(asked);
    }

    /// The last histogram that was found; of this series, if of other axes or another step than the one requested.
    pub fn histogram(&self) -> Option<&Arc<Histogram>> {
        self.insight.histograms.shown()
    }

    /// Why there is no histogram, or not the one requested.
    pub fn histogram_problem(&self) -> Option<&str> {
        self.insight.histograms.problem()
    }

    /// The thumbnail of a step; requested if missing. `None` also drops a pending request.
    pub fn thumbnail(&mut self, step: Option<usize>) -> Option<Arc<Picture>> {
        let Some((step, size)) = step.zip(self.size_px()) else {
            self.insight.thumbnails.forget_wanted();
            return None;
        };
        let series = self.series().clone();
        let (project, time) = (self.document.project(), FrameTime::from(step));
        let request = self.previews.make(project, &self.look, &series, time, size, &mut Drawing::at_rest)?;
        self.insight.thumbnails.want(&series, &request, self.background);
        self.insight.thumbnails.get(&request)?.ok()
    }
}
