//! Data of a series beside its pictures: values over time, the point under the mouse, thumbnails.

use super::histograms::Histograms;
use super::probe::{Curve, Hover, HoverRequest, Prober};
use super::survey::Survey;
use super::thumbnails::{Thumbnails, WIDTH_PX};
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
    /// Index of its cell in the source.
    pub source_cell: u32,
    /// Values at the point over the steps read so far.
    pub curve: Option<Arc<Curve>>,
}

/// Distance from the mouse, in pixels, within which an answer still holds: while the mouse moves, answers are for where it was.
const NEAR_PX: f64 = 6.0;

/// A position in pixels, from shares of width and height.
fn in_pixels((x, y): (f64, f64), shown: &FrameRequest) -> (f64, f64) {
    let (width, height) = shown.size_px;
    (x * width as f64, y * height as f64)
}

/// Whether two requests are for the same position in the same picture.
fn is_same(a: &HoverRequest, b: &HoverRequest) -> bool {
    a.at_px == b.at_px && Arc::ptr_eq(&a.series, &b.series) && a.request == b.request
}

/// The field whose flow a picture shows.
fn flow_of(request: &FrameRequest) -> Option<String> {
    request.layers.iter().find_map(|layer| layer.flow()).map(|flow| flow.field.clone())
}

/// Finds these data on threads of its own.
pub(super) struct Insight {
    wake: Arc<dyn Fn() + Send + Sync>,
    pub(super) survey: Survey,
    prober: Prober,
    pub(super) thumbnails: Thumbnails,
    pub(super) histograms: Histograms,
    /// Position of the mouse, as shares of the picture's width and height from the top left corner.
    pub(super) mouse: Option<(f64, f64)>,
    /// The answer for the point under the mouse.
    pub(super) hover: Option<Hover>,
    /// The last request.
    asked: Option<HoverRequest>,
    /// Request whose point is to be picked once known. Until then no other request is made: the mouse may have moved on.
    wants_pick: Option<HoverRequest>,
    /// The picked point, the field of the vectors that are read for it, and its values.
    picked: Option<(Probe, Option<String>, Option<Arc<Curve>>)>,
}

impl Insight {
    /// # Errors
    /// If the system gives no threads.
    pub(super) fn of(series: Arc<Series>, wake: Arc<dyn Fn() + Send + Sync>) -> io::Result<Self> {
        Ok(Self {
            survey: Survey::start(series, wake.clone())?,
            prober: Prober::start(wake.clone())?,
            thumbnails: Thumbnails::start(WIDTH_PX, wake.clone())?,
            histograms: Histograms::start(wake.clone())?,
            wake,
            mouse: None,
            hover: None,
            asked: None,
            wants_pick: None,
            picked: None,
        })
    }

    /// Pauses what may wait, or resumes it: for while the user waits for frames.
    pub(super) fn pause(&self, pauses: bool) {
        self.survey.pause(pauses);
        self.histograms.pause(pauses);
    }

    /// Switches to another series of the same mesh: a picked point stays.
    ///
    /// # Errors
    /// If the system gives no thread.
    pub(super) fn turn_to(&mut self, series: &Arc<Series>) -> io::Result<()> {
        self.survey = Survey::start(series.clone(), self.wake.clone())?;
        (self.hover, self.asked, self.wants_pick) = (None, None, None);
        if let Some((probe, vectors, _)) = &self.picked {
            self.prober.pick(series.clone(), probe.cell, probe.weights, vectors.clone());
        }
        Ok(())
    }

    /// Takes results; `shown` is the request of the frame on the screen.
    pub(super) fn take(&mut self, shown: Option<&FrameRequest>) {
        self.histograms.take();
        while let Some(hover) = self.prober.take_hover() {
            let is_same = |wanted: &HoverRequest| is_same(wanted, &hover.asked);
            if self.wants_pick.as_ref().is_some_and(is_same) {
                self.wants_pick = None;
                self.pick_found(&hover);
                self.prober.hover(self.asked.clone());
            }
            self.hover = Some(hover);
        }
        // An answer for another position or picture is not for the point under the mouse.
        let place = self.mouse.zip(shown).map(|(mouse, shown)| in_pixels(mouse, shown));
        let is_near = |at: (f64, f64)| place.is_some_and(|(x, y)| (x - at.0).hypot(y - at.1) <= NEAR_PX);
        let is_of_screen = |asked: &HoverRequest| shown == Some(&asked.request) && is_near(asked.at_px);
        if !self.hover.as_ref().is_some_and(|hover| is_of_screen(&hover.asked)) {
            self.hover = None;
        }
        if let Some((probe, vectors, curve)) = &mut self.picked {
            *curve = self.prober.curve();
            // Flow that is shown since then.
            let flow = shown.and_then(flow_of);
            if let Some(known) = curve.as_ref().filter(|_| flow.is_some() && flow != *vectors) {
                self.prober.pick(known.series.clone(), probe.cell, probe.weights, flow.clone());
                *vectors = flow;
            }
        }
    }

    /// Handles a new mouse position in the picture `shown`, or another picture under the mouse.
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

    /// Handles another picture on the screen.
    pub(super) fn repeat(&mut self, series: &Arc<Series>, shown: Option<&FrameRequest>) {
        if self.mouse.is_some() {
            self.point_at(self.mouse, series, shown);
        }
    }

    /// Picks the point under the mouse, as soon as it is known; no point if there is none.
    pub(super) fn pick(&mut self) {
        let Some(asked) = &self.asked else { return };
        match self.hover.clone().filter(|hover| is_same(asked, &hover.asked)) {
            Some(known) => self.pick_found(&known),
            None => self.wants_pick = Some(asked.clone()),
        }
    }

    fn pick_found(&mut self, hover: &Hover) {
        if let Hover { asked, found: Ok(Some(probe)), .. } = hover {
            let vectors = flow_of(&asked.request);
            self.prober.pick(asked.series.clone(), probe.cell, probe.weights, vectors.clone());
            self.picked = Some((*probe, vectors, None));
        }
    }

    /// Drops the picked point.
    pub(super) fn forget_pick(&mut self) {
        self.prober.forget_pick();
        self.picked = None;
    }

    /// The picked point.
    pub(super) fn picked(&self) -> Option<Picked> {
        let (probe, _, curve) = self.picked.as_ref()?;
        Some(Picked { position: probe.position, source_cell: probe.source_cell, curve: curve.clone() })
    }
}
