//! Flow in a session: switched on and off, coloured, and going on while a step is held.

use super::Session;
use crate::look::{BesideError, FlowLook, colors_beside};
use crate::pipeline::{ColorsBeside, FlowLayer, FrameTime, vector_fields};
use crate::playback::State;
use crate::render::flow::{FlowStyle, Icon};
use crate::render::surfaces::ByField;
use crate::task::Cancel;
use crate::ui::jobs::Done;
use std::time::Duration;

/// Least time between two frames of a moment that is held: that of most displays.
const FRAME: Duration = Duration::from_micros(16_667);

/// Longest time by which the flow goes on from one frame to the next, however long that took.
const LONGEST: Duration = Duration::from_millis(250);

/// Frame rate for which the usual rate of flow is chosen.
const NOMINAL_FPS: f64 = 25.0;

/// How the flow of a held moment goes on.
#[derive(Debug, Default)]
pub(super) struct Drift {
    /// What is usual for a flow, and what is being worked out.
    usual: Option<(FlowLayer, Usual)>,
    asked: Option<FlowLayer>,
    /// The moment that is held, and when its last frame was asked for.
    held: Option<(FrameTime, Duration)>,
}

/// What is usual for a flow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Usual {
    /// Time of the series a second.
    pub rate: f64,
    /// World length of a period of the pattern.
    pub length: f64,
}

/// Whether two flows have the same usual rate.
fn is_alike(a: &FlowLayer, b: &FlowLayer) -> bool {
    (&a.field, a.style.length, a.style.speed) == (&b.field, b.style.length, b.style.speed)
}

impl Session {
    /// What is usual for the flow that is shown; `None` without flow, or until it is known.
    pub fn usual_flow(&self) -> Option<Usual> {
        let flow = self.look.flow.as_ref()?;
        self.drift.usual.as_ref().filter(|(of, _)| is_alike(of, &flow.layer)).map(|(_, usual)| *usual)
    }

    /// The time of the series a second with which the flow of a held step goes on; `None` without flow, or until it is known.
    pub fn flow_rate(&self) -> Option<f64> {
        self.look.flow.as_ref()?.rate.or_else(|| Some(self.usual_flow()?.rate))
    }

    /// Whether a step is held while its flow goes on. Beside another view with which it is compared it stands still.
    pub(super) fn drifts(&self, state: &State) -> bool {
        !state.playing && !self.shared.is_compared && self.flow_rate().is_some_and(|rate| rate > 0.0)
    }

    /// Lets the flow of a held step go on once its last frame is there. Returns after how long it goes on at the latest.
    pub(super) fn drift(&mut self, now: Duration, state: &State) -> Option<Duration> {
        self.work_out_usual_flow();
        let shown = self.shown.as_ref().map(|shown| shown.request.time);
        let moment = shown.filter(|shown| state.frame == Some(*shown) && self.drifts(state));
        let Some((moment, rate)) = moment.zip(self.flow_rate()) else {
            self.stop_drift();
            return None;
        };
        let Some((_, since)) = self.drift.held.filter(|(held, _)| *held == moment) else {
            self.stop_drift();
            self.drift.held = Some((moment, now));
            return Some(FRAME);
        };
        // A picture that is to be saved stands still, and one that another view's clock leads on.
        let is_led_on = self.shared.views > 1 && self.rest(now).is_some();
        if self.wants_screenshot || is_led_on || self.is_waiting() {
            return None;
        }
        let elapsed = now.saturating_sub(since);
        if elapsed < FRAME {
            return Some(FRAME - elapsed);
        }
        let way = rate * elapsed.min(LONGEST).as_secs_f64();
        let before = self.requests.held.map_or(0.0, |(_, held, _)| held);
        self.requests.held = Some((moment, before + way, way));
        self.drift.held = Some((moment, now));
        self.player.redraw();
        None
    }

    fn stop_drift(&mut self) {
        self.drift.held = None;
        if let Some((moment, ..)) = self.requests.held.take()
            && self.state().frame == Some(moment)
        {
            self.ask_again();
        }
    }

    fn work_out_usual_flow(&mut self) {
        let Some(FlowLook { layer, .. }) = &self.look.flow else { return };
        let is_known = |of: &FlowLayer| is_alike(of, layer);
        if self.drift.usual.as_ref().is_some_and(|(of, _)| is_known(of))
            || self.drift.asked.as_ref().is_some_and(is_known)
        {
            return;
        }
        let (layer, series) = (layer.clone(), self.series().clone());
        self.drift.asked = Some(layer.clone());
        self.jobs.run(move || {
            let length = layer.period(series.mesh());
            // Whoever draws flow that cannot be read says why.
            let rate = layer.usual_rate(&series, NOMINAL_FPS, &Cancel::new()).ok().flatten().unwrap_or(0.0);
            Done::Flow(Box::new(layer), Usual { rate, length })
        });
    }

    /// Takes over what is usual for a flow.
    pub(super) fn take_usual_flow(&mut self, of: FlowLayer, usual: Usual) {
        self.drift.asked = None;
        self.drift.usual = Some((of, usual));
    }

    /// Shows another flow, or none.
    pub(super) fn set_flow(&mut self, flow: Option<FlowLook>) {
        if flow.as_ref().is_some_and(|flow| flow.layer.style.check().is_err()) {
            return;
        }
        if let Some(before) = std::mem::replace(&mut self.look.flow, flow)
            && self.look.flow.is_none()
        {
            self.flow_before = Some(before);
        }
    }

    /// Shows flow, that which was shown before or the first one that the series has; or no flow.
    pub(super) fn toggle_flow(&mut self) {
        if self.look.flow.is_some() {
            return self.set_flow(None);
        }
        let fields = vector_fields(self.store.fields());
        let before = self.flow_before.take().filter(|flow| fields.contains(&flow.layer.field.as_str()));
        let first =
            || fields.first().map(|field| FlowLook::new((*field).to_owned(), FlowStyle::few_on(self.series().mesh())));
        match before.or_else(first) {
            Some(flow) => self.set_flow(Some(flow)),
            None => self.fail("the series has no vectors at its vertices whose flow could be shown".to_owned()),
        }
    }

    /// Shows the next icon.
    pub(super) fn next_icon(&mut self) {
        if let Some(FlowLook { layer, .. }) = &mut self.look.flow {
            let next = Icon::ALL.iter().position(|icon| *icon == layer.style.icon).map_or(0, |at| at + 1);
            layer.style.icon = Icon::ALL[next % Icon::ALL.len()];
        }
    }

    /// Colours the flow by a field, or by none. The field is opened on another thread.
    pub(super) fn color_flow(&mut self, by: Option<ByField>) {
        let Some(flow) = &mut self.look.flow else { return };
        let Some(by) = by else {
            (flow.layer.colors, flow.color_by) = (None, None);
            return;
        };
        let (series, tf, lengths) = (self.series().clone(), self.look.tf.clone(), self.look.lengths);
        self.jobs.run(move || {
            let colors = colors_beside(&series, &tf, lengths, &by);
            Done::FlowColors(by, Box::new(colors))
        });
    }

    /// Takes over the colours of a field for the flow, as a change of its own.
    pub(super) fn take_flow_colors(&mut self, by: ByField, colors: Result<ColorsBeside, BesideError>) {
        let before = self.document.state(&self.look);
        match (colors, &mut self.look.flow) {
            (Ok(colors), Some(flow)) => (flow.layer.colors, flow.color_by) = (Some(colors), Some(by)),
            (Ok(_), None) => {}
            (Err(error), _) => self.fail(format!("colours of the flow by '{by}': {error}")),
        }
        self.document.record(before, &self.look, None);
    }
}
