//! Flow in a session: switched on and off, coloured, and going on while a step is held.

use super::Session;
use crate::field::Association;
use crate::look::{BesideError, ColorBar, FlowLook, colors_beside};
use crate::pipeline::{ColorsBeside, FlowLayer, FlowMeasure, FrameRequest, FrameTime, Layer, vector_fields};
use crate::playback::State;
use crate::render::flow::{FlowStyle, Icon};
use crate::render::surfaces::ByField;
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::ui::jobs::Done;
use crate::ui::notice::NoticeKind;
use crate::ui::requests::Shutter;
use std::time::Duration;

/// Least time between two frames of a moment that is held: that of most displays.
const FRAME: Duration = Duration::from_micros(16_667);

/// Longest time by which the flow goes on from one frame to the next, however long that took.
const LONGEST: Duration = Duration::from_millis(250);

/// How the flow of a held moment goes on.
#[derive(Debug, Default)]
pub(super) struct Drift {
    /// What is usual for the vectors of a field, and the field of which it is being worked out.
    measured: Option<(String, Option<FlowMeasure>)>,
    asked: Option<String>,
    /// The moment that is held, and when its last frame was asked for.
    held: Option<(FrameTime, Duration)>,
    /// The last field of which it was said that nothing flows.
    still: Option<String>,
}

impl Session {
    /// Frame rate for which the usual rate of flow is chosen.
    pub(in crate::ui) const NOMINAL_FPS: f64 = 25.0;

    /// What is usual for the vectors whose flow is shown; `None` without flow, until it is known, or if they cannot be read.
    pub fn flow_measure(&self) -> Option<FlowMeasure> {
        let flow = self.look.flow.as_ref()?;
        self.drift.measured.as_ref().filter(|(of, _)| *of == flow.layer.field)?.1
    }

    /// The time of the series a second with which the flow of a held step goes on; `None` as [`Self::flow_measure`], unless one is chosen.
    pub fn flow_rate(&self) -> Option<f64> {
        let flow = self.look.flow.as_ref()?;
        flow.rate.or_else(|| Some(self.flow_measure()?.rate(&flow.layer.style, Self::NOMINAL_FPS)))
    }

    /// What the colours of the flow mean; `None` if no field colours it.
    pub fn flow_bar(&self) -> Option<ColorBar> {
        let flow = self.look.flow.as_ref()?;
        let name = &flow.layer.colors.as_ref()?.field;
        flow.color_bar(self.store.fields().iter().find(|field| field.name == *name)?)
    }

    /// Whether a step is held while its flow goes on. Beside another view with which it is compared it stands still.
    pub(super) fn drifts(&self, state: &State) -> bool {
        !state.playing && !self.shared.is_compared && self.flow_rate().is_some_and(|rate| rate > 0.0)
    }

    /// The time for which frames show the flow that goes on while the series plays. Frames that are compared with another view's are as those
    /// at rest.
    pub(super) fn shutter(&self, state: &State) -> Shutter {
        match self.led_shutter {
            _ if self.shared.is_compared => Shutter::Closed,
            open if open > 0.0 => Shutter::Led(open),
            _ if state.playing => Shutter::Played(*state, self.target_fps.unwrap_or(Self::NOMINAL_FPS)),
            _ => Shutter::Closed,
        }
    }

    /// Opens the shutter for further frames, or closes it: the frame on the screen, or on its way there, is then drawn as it is at rest.
    pub(super) fn open_shutter(&mut self, state: &State) {
        let shutter = self.shutter(state);
        let before = std::mem::replace(&mut self.requests.shutter, shutter);
        let closes = before != Shutter::Closed && shutter == Shutter::Closed;
        if closes && self.look.flow.is_some() {
            self.ask_again();
        }
    }

    /// Says that nothing flows in a frame: once, while the field stays.
    pub(super) fn tell_of_still_flow(&mut self, request: &FrameRequest, stats: &FrameStats) {
        let Some(flow) = request.layers.iter().find_map(Layer::flow).filter(|_| stats.flow_still) else { return };
        if self.drift.still.as_ref() == Some(&flow.field) {
            return;
        }
        let step = request.time.step();
        self.drift.still = Some(flow.field.clone());
        self.tell(
            NoticeKind::Done,
            format!("step {step}: nothing flows, since all vectors of '{}' are 0 or not finite", flow.field),
        );
    }

    /// Lets the flow of a held step go on once its last frame is there. Returns after how long it goes on at the latest.
    pub(super) fn drift(&mut self, now: Duration, state: &State) -> Option<Duration> {
        self.measure_flow();
        let is_seen =
            |request: &FrameRequest| request.layers.iter().any(|of| of.flow().is_some_and(FlowLayer::is_seen));
        let shown = self.shown.as_ref().filter(|shown| is_seen(&shown.request)).map(|shown| shown.request.time);
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

    /// Works out on another thread what is usual for the flow that is shown, unless that is known.
    fn measure_flow(&mut self) {
        let Some(FlowLook { layer, .. }) = &self.look.flow else { return };
        let known = self.drift.measured.as_ref().map(|(field, _)| field);
        if [known, self.drift.asked.as_ref()].contains(&Some(&layer.field)) {
            return;
        }
        let (layer, series) = (layer.clone(), self.series().clone());
        self.drift.asked = Some(layer.field.clone());
        self.jobs.run(move || {
            // Whoever draws flow that cannot be read says why.
            let measure = layer.measure(&series, &Cancel::new()).ok().flatten();
            Done::Flow(layer.field, measure)
        });
    }

    /// Takes over what is usual for the vectors of a field.
    pub(super) fn take_flow_measure(&mut self, field: String, measure: Option<FlowMeasure>) {
        self.drift.asked = None;
        self.drift.measured = Some((field, measure));
    }

    /// Shows another flow, or none.
    pub(super) fn set_flow(&mut self, flow: Option<FlowLook>) {
        let is_right = |flow: &FlowLook| {
            flow.layer.style.check().is_ok() && flow.rate.is_none_or(|rate| FlowLook::check_rate(rate).is_ok())
        };
        if !flow.as_ref().is_none_or(is_right) {
            return;
        }
        if let Some(before) = std::mem::replace(&mut self.look.flow, flow)
            && self.look.flow.is_none()
        {
            self.flow_before = Some(before);
        }
    }

    /// A style in which each splat of the vectors of a field can be seen.
    pub fn few_splats(&self, field: &str) -> FlowStyle {
        let component = format!("{field}:0");
        let found = self.store.fields().iter().find(|of| of.name == component);
        FlowStyle::few_on(self.series().mesh(), found.map_or(Association::Point, |of| of.values_of))
    }

    /// Shows flow, that which was shown before or the first one that the series has; or no flow.
    pub(super) fn toggle_flow(&mut self) {
        if self.look.flow.is_some() {
            return self.set_flow(None);
        }
        let fields = vector_fields(self.store.fields());
        let before = self.flow_before.take().filter(|flow| fields.contains(&flow.layer.field.as_str()));
        let first = || fields.first().map(|field| FlowLook::new((*field).to_owned(), self.few_splats(field)));
        match before.or_else(first) {
            Some(flow) => self.set_flow(Some(flow)),
            None => self
                .fail("the series has no vectors in cells or at their vertices whose flow could be shown".to_owned()),
        }
    }

    /// Shows the flow with an opacity, at all times; does nothing without flow.
    pub(super) fn set_flow_opacity(&mut self, opacity: f64) {
        if let Some(flow) = self.look.flow.as_mut().filter(|_| !opacity.is_nan()) {
            flow.layer.style.opacity = opacity.clamp(0.0, 1.0);
            self.leave(|followed| followed.flow = false);
        }
    }

    /// Shows the next generated icon.
    pub(super) fn next_icon(&mut self) {
        if let Some(flow) = &mut self.look.flow {
            let next = Icon::ALL.iter().position(|icon| *icon == flow.layer.style.icon).map_or(0, |at| at + 1);
            flow.set_icon(Icon::ALL[next % Icon::ALL.len()]);
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
