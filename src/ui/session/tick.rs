//! The periodic update of a session.

use super::{Asked, Session, Shown};
use crate::look::Look;
use crate::pipeline::{Delivery, FaceDetail, FrameRequest, SharedFrame};
use crate::playback::quality::Quality;
use crate::ui::jobs::{Done, Screenshot};
use crate::ui::motion::Drawing;
use crate::ui::notice::{self, NoticeKind};
use crate::ui::shortfall;
use crate::ui::still::Still;
use std::sync::Arc;
use std::time::Duration;

impl Session {
    /// Shows the due frame and requests the next ones. Returns whether there is something new to show, and after how long to call again at
    /// the latest (`None`: after an action, or when woken).
    pub fn tick(&mut self, now: Duration) -> (bool, Option<Duration>) {
        self.finish_jobs();
        self.take_growth(now);
        self.tick_exports();
        let passes = notice::pass(&mut self.notices, now);
        self.requests.worker.collect();
        let (state, is_busy) = (self.state(), now < self.busy_until);
        self.player.pipelined().leave_a_core(is_busy);
        let Some(size) = self.size_px() else { return (false, passes) };
        // An image to be saved must be on the CPU.
        let is_elsewhere = self.shown.as_ref().is_some_and(|shown| shown.frame.planes.color.pixels.is_empty());
        let is_wanted_here = self.shared.is_compared || (self.wants_screenshot && is_elsewhere);
        let for_window = self.has_window_gpu && !is_wanted_here;
        self.open_shutter(&state);
        let drift = self.drift(now, &state);
        let (series, target_ms, family) = (self.series().clone(), self.target_ms(&state, now), self.family);
        self.look_at_costs(size);
        self.requests.previews = if target_ms.is_none() { self.previews() } else { Vec::new() };
        let Self { player, requests, quality, drawing, look, asked, document, .. } = self;
        let project = document.project();
        let last = *drawing;
        let mut choose = |of: Drawing| {
            *drawing = Some(of);
            quality.choose(&of.wanted(family, target_ms))
        };
        // The next frame is drawn like the last one, unless a project says otherwise.
        let now_drawn = last.map_or_else(Quality::default, &mut choose);
        // Frames of another quality suffice in motion; at rest the quality must be the chosen one.
        let moves = target_ms.is_some();
        let is_same = |asked: &mut Asked| {
            let before = std::mem::replace(&mut asked.quality, now_drawn);
            let is_same_project = Arc::ptr_eq(&asked.project, project);
            is_same_project && asked.look == *look && asked.size_px == size && (moves || before == now_drawn)
        };
        if !asked.as_mut().is_some_and(is_same) || requests.for_window != for_window {
            requests.for_window = for_window;
            // Before the first frame there is none to redraw.
            if asked.is_some() {
                player.redraw();
            }
            *asked = Some(Asked { project: project.clone(), look: look.clone(), size_px: size, quality: now_drawn });
        }
        let tick = player.tick(now, &mut |time| requests.make(project, look, &series, time, size, &mut choose));
        if let Some(problem) = self.requests.problem.take() {
            self.fail(problem);
        }
        let mut is_new = false;
        if let Some(delivery) = tick.shown {
            self.show(delivery, now);
            is_new = true;
        }
        if self.wants_screenshot {
            self.take_screenshot();
        }
        let request = self.shown.as_ref().map(|shown| &shown.request);
        if is_new && self.shown.as_ref().is_some_and(|shown| shown.is_final) {
            self.insight.repeat(&series, request);
        }
        self.insight.take(request);
        let is_late = state.playing && (state.speed.is_none() || shortfall(&state).is_some());
        // A clock that leads this session runs.
        let is_led_on = self.shared.views > 1 && self.rest(now).is_some();
        self.insight.pause(is_busy || is_late || is_led_on);
        let busy = is_busy.then(|| self.busy_until.saturating_sub(now));
        let wait = tick.wait.into_iter().chain(self.rest(now)).chain(busy).chain(passes).chain(drift).min();
        (is_new, wait)
    }

    /// Shows a delivered frame, or reports its error.
    fn show(&mut self, delivery: Delivery, now: Duration) {
        let Delivery { request, frame, is_kept, is_final, .. } = delivery;
        let step = request.time.step();
        match frame {
            Ok(frame) => {
                // A cached frame may be better than requested.
                let is_kept_whole = is_kept && frame.details.is_none();
                let request = if is_kept_whole { FrameRequest { residual: None, ..request } } else { request };
                let quality = self.quality_of(&request);
                let at_rest = self.drawing.map_or(Quality::Exact, Drawing::at_rest);
                if is_final {
                    self.kept_frames += u64::from(is_kept);
                    self.history.add(now, &frame, is_kept);
                    if !is_kept {
                        self.quality.measured(quality, frame.stats.ms_worked());
                    }
                    self.look_at_details(&request, &frame, quality);
                }
                self.tell_of_still_flow(&request, &frame.stats);
                self.shown = Some(Shown { frame, request, is_kept, quality, at_rest, is_final });
                self.compare_with_motion();
            }
            Err(error) => {
                // A picture of another time would be mistaken for this one.
                self.shown = None;
                self.wants_screenshot = false;
                let (text, step) = (error.to_string(), format!("step {step}"));
                self.fail(if text.contains(&step) { text } else { format!("{step}: {text}") });
            }
        }
    }

    /// Keeps details for later frames of the same view.
    fn look_at_details(&mut self, request: &FrameRequest, frame: &SharedFrame, quality: Quality) {
        let still = &mut self.requests.still;
        match quality {
            Quality::Exact => {
                let is_here = !frame.planes.color.pixels.is_empty();
                *still = is_here.then(|| Still::of(request, frame));
            }
            Quality::Details => {
                if let Some(still) = still {
                    still.renew(request, frame);
                }
                if let Some(rmse) = frame.stats.residual_rmse {
                    self.quality.measured_details(rmse);
                }
            }
            Quality::Rays(_) | Quality::Scaled(_) | Quality::Faces(_) | Quality::Points(_) => {}
        }
    }

    /// Adapts costs to the view and the look.
    fn look_at_costs(&mut self, size: (usize, usize)) {
        let camera = self.camera();
        if let Ok(height) = camera.half_height_at_focus() {
            self.quality.set_view(size.0 * size.1, height);
        }
        let Some(asked) = &self.asked else { return };
        // A drag changes colours and opacities little by little, and costs with them; another way to draw has costs of its own.
        let is_dragged = self.gesture.is_some();
        let as_asked = Look { camera: asked.look.camera, ..self.look.clone() };
        let is_other_project = !is_dragged && !Arc::ptr_eq(&asked.project, self.document.project());
        if asked.look != as_asked || is_other_project {
            self.quality.forget();
        }
    }

    /// Saves the picture on the screen once it is in full, with the current camera.
    fn take_screenshot(&mut self) {
        let (Some(shown), Some(size)) = (&self.shown, self.size_px()) else { return };
        let series = self.series().clone();
        let time = shown.request.time;
        let project = self.document.project();
        let wanted = self.requests.make(project, &self.look, &series, time, size, &mut Drawing::at_rest);
        let Some(wanted) = wanted else { return };
        // All cells are at least as good as the chosen faces.
        let lod = shown.request.lod().max(wanted.lod());
        let mode = self.look.mode.on(series.mesh());
        let draw = self.look.draw(mode, FaceDetail { lod, ..self.look.faces });
        let wanted = FrameRequest { for_window: shown.request.for_window, ..wanted.with_draw(draw) };
        let is_here = !shown.frame.planes.color.pixels.is_empty();
        let is_due = is_here && (self.state().playing || self.state().frame == Some(shown.request.time));
        if is_due && shown.is_final && shown.request.same_view(&wanted) {
            self.wants_screenshot = false;
            let shot = Screenshot::of(shown.frame.clone(), &shown.request, &self.look, &series, self.background);
            self.jobs.write(shot, self.screenshot_folder.clone());
        }
    }

    fn finish_jobs(&mut self) {
        while let Some(done) = self.jobs.take() {
            match done {
                Done::Written(Ok(path)) => {
                    notice::add(&mut self.notices, NoticeKind::Done, format!("saved {}", path.display()));
                }
                Done::Written(Err(error)) => self.fail(error.to_string()),
                Done::Project(written, state) => {
                    self.is_saving = false;
                    match written {
                        Ok(path) => {
                            notice::add(&mut self.notices, NoticeKind::Done, format!("saved {}", path.display()));
                            self.document.set_file(path, *state);
                        }
                        Err(error) => self.fail(error.to_string()),
                    }
                }
                Done::Function(Ok(tf), colors_only) => self.take_function(tf, colors_only),
                Done::Function(Err(error), _) => self.fail(error.to_string()),
                Done::Compared(error, _) => self.motion_error = Some(error),
                Done::Flow(field, measure) => self.take_flow_measure(field, measure),
                Done::FlowColors(by, colors) => self.take_flow_colors(by, *colors),
                Done::Failed(problem) => {
                    (self.opens_field, self.is_saving) = (false, false);
                    self.fail(problem);
                }
                Done::Series(series, turn, looks) => self.turn_to_field(series, turn, *looks),
            }
        }
    }
}
