//! What is known of a series beside its pictures: its values over time, what is under the mouse, small pictures of its steps.

use super::picture::Picture;
use super::probe::{Curve, Hover, HoverRequest, Prober};
use super::survey::{Survey, Surveyed};
use super::thumbnails::Thumbnails;
use crate::pipeline::{FrameRequest, Series};
use crate::render::probe::Probe;
use glam::DVec3;
use std::io;
use std::sync::Arc;

/// A point that was picked, and its value over the series.
#[derive(Clone, Debug)]
pub struct Picked {
    /// World coordinates.
    pub position: DVec3,
    /// Number of its cell in the source.
    pub source_cell: u32,
    /// Values at the point over the steps, as far as they have been read.
    pub curve: Option<Arc<Curve>>,
}

/// So far from the mouse, in pixels, what was found is still what is under it: while it moves, answers are for where it was.
const NEAR_PX: f64 = 6.0;

/// A place of a picture, from shares of its width and height.
fn in_pixels((x, y): (f64, f64), shown: &FrameRequest) -> (f64, f64) {
    let (width, height) = shown.size_px;
    (x * width as f64, y * height as f64)
}

/// Whether two ask for the same place of the same picture.
fn is_same(a: &HoverRequest, b: &HoverRequest) -> bool {
    a.at_px == b.at_px && Arc::ptr_eq(&a.series, &b.series) && a.request == b.request
}

/// Finds out, on threads of its own.
pub(super) struct Insight {
    wake: Arc<dyn Fn() + Send + Sync>,
    survey: Survey,
    prober: Prober,
    thumbnails: Thumbnails,
    /// Where the mouse is, as shares of the picture's width and height from its left upper corner.
    mouse: Option<(f64, f64)>,
    hover: Option<Hover>,
    /// What was asked last.
    asked: Option<HoverRequest>,
    /// What is at this place is to be picked, once it is known. Until then nothing else is asked: the mouse may have gone on.
    wants_pick: Option<HoverRequest>,
    picked: Option<(Probe, Option<Arc<Curve>>)>,
}

impl Insight {
    /// # Errors
    /// If the system gives no threads.
    pub(super) fn of(series: Arc<Series>, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        Ok(Self {
            survey: Survey::start(series, wake.clone())?,
            prober: Prober::start(wake.clone())?,
            thumbnails: Thumbnails::start(wake.clone())?,
            wake,
            mouse: None,
            hover: None,
            asked: None,
            wants_pick: None,
            picked: None,
        })
    }

    /// Another series is played from now on, of the same mesh: a point that was picked is one of it, too.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub(super) fn turn_to(&mut self, series: &Arc<Series>) -> io::Result<()> {
        self.survey = Survey::start(series.clone(), self.wake.clone())?;
        (self.hover, self.asked, self.wants_pick) = (None, None, None);
        if let Some((probe, _)) = self.picked {
            self.prober.pick(series.clone(), probe.cell, probe.weights);
        }
        Ok(())
    }

    /// Takes what was found; `shown` is what is on the screen.
    pub(super) fn take(&mut self, shown: Option<&FrameRequest>) {
        while let Some(hover) = self.prober.take_hover() {
            let is_same = |wanted: &HoverRequest| is_same(wanted, &hover.asked);
            if self.wants_pick.as_ref().is_some_and(is_same) {
                self.wants_pick = None;
                self.pick_found(&hover);
                self.prober.hover(self.asked.clone());
            }
            self.hover = Some(hover);
        }
        // What is elsewhere in the picture or of another picture is not what is under the mouse.
        let place = self.mouse.zip(shown).map(|(mouse, shown)| in_pixels(mouse, shown));
        let is_near = |at: (f64, f64)| place.is_some_and(|(x, y)| (x - at.0).hypot(y - at.1) <= NEAR_PX);
        let is_of_screen = |asked: &HoverRequest| shown == Some(&asked.request) && is_near(asked.at_px);
        if !self.hover.as_ref().is_some_and(|hover| is_of_screen(&hover.asked)) {
            self.hover = None;
        }
        if let Some((_, curve)) = &mut self.picked {
            *curve = self.prober.curve();
        }
    }

    /// The mouse is at this place of the picture `shown`, or another picture is under it.
    pub(super) fn point_at(&mut self, place: Option<(f64, f64)>, series: &Arc<Series>, shown: Option<&FrameRequest>) {
        self.mouse = place;
        self.asked = place.zip(shown).map(|((x, y), shown)| HoverRequest {
            series: series.clone(),
            request: shown.clone(),
            at_px: in_pixels((x, y), shown),
        });
        if self.wants_pick.is_none() {
            self.prober.hover(self.asked.clone());
        }
    }

    /// Another picture is on the screen.
    pub(super) fn repeat(&mut self, series: &Arc<Series>, shown: Option<&FrameRequest>) {
        if self.mouse.is_some() {
            self.point_at(self.mouse, series, shown);
        }
    }

    /// Where the mouse is.
    pub(super) fn mouse(&self) -> Option<(f64, f64)> {
        self.mouse
    }

    /// What is under the mouse.
    pub(super) fn hover(&self) -> Option<&Hover> {
        self.hover.as_ref()
    }

    /// Picks the point that is under the mouse, as soon as it is known; nothing if there is none.
    pub(super) fn pick(&mut self) {
        let Some(asked) = &self.asked else { return };
        match self.hover.clone().filter(|hover| is_same(asked, &hover.asked)) {
            Some(known) => self.pick_found(&known),
            None => self.wants_pick = Some(asked.clone()),
        }
    }

    fn pick_found(&mut self, hover: &Hover) {
        if let Hover { asked, found: Ok(Some(probe)) } = hover {
            self.prober.pick(asked.series.clone(), probe.cell, probe.weights);
            self.picked = Some((*probe, None));
        }
    }

    /// No point is picked any more.
    pub(super) fn forget_pick(&mut self) {
        self.prober.forget_pick();
        self.picked = None;
    }

    /// The point that is picked.
    pub(super) fn picked(&self) -> Option<Picked> {
        let (probe, curve) = self.picked.as_ref()?;
        Some(Picked { position: probe.position, source_cell: probe.source_cell, curve: curve.clone() })
    }

    /// The series as far as it is known.
    pub(super) fn survey(&self) -> Arc<Surveyed> {
        self.survey.snapshot()
    }

    /// Rests while others need the processor.
    pub(super) fn pause(&self, pauses: bool) {
        self.survey.pause(pauses);
    }

    /// The small picture of a frame, or asks for it.
    pub(super) fn thumbnail(
        &self,
        series: &Arc<Series>,
        request: &FrameRequest,
        background: [f32; 3],
    ) -> Option<Arc<Picture>> {
        self.thumbnails.want(series, request, background);
        self.thumbnails.get(request)
    }

    /// Nobody looks at small pictures.
    pub(super) fn forget_thumbnails(&self) {
        self.thumbnails.forget_wanted();
    }
}
