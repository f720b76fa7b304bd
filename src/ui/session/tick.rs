//! What a session does whenever its time comes.

use super::{Session, Shown};
use crate::pipeline::{FaceDetail, FrameRequest, RenderMode};
use crate::playback::State;
use crate::ui::detail::{Measured, Wanted};
use crate::ui::jobs::{Done, Screenshot};
use crate::ui::look::Look;
use crate::ui::notice::{self, NoticeKind};
use crate::ui::shortfall;
use std::time::Duration;

impl Session {
    /// Shows what is due and asks for what comes next. Returns whether there is something new to show, and after how long to
    /// call again at the latest (`None`: after an action, or when woken).
    pub fn tick(&mut self, now: Duration) -> (bool, Option<Duration>) {
        self.finish_jobs();
        let (state, is_busy) = (self.state(), now < self.busy_until);
        self.player.pipelined().leave_a_core(is_busy);
        let Some(size) = self.size_px(now) else { return (false, None) };
        // An image that is to be saved must be here.
        let is_elsewhere = self.shown.as_ref().is_some_and(|shown| shown.frame.color.pixels.is_empty());
        let for_window = self.has_window_gpu && !(self.wants_screenshot && is_elsewhere);
        let lod = self.level_in_motion(&state, size, now);
        let is_asked = self.asked.as_mut().is_some_and(|(asked, asked_size)| {
            // Frames of another level are as good while more of them follow; at rest it is the one that was chosen.
            let before = std::mem::replace(&mut asked.faces.lod, self.look.faces.lod);
            let is_same = *asked == self.look && *asked_size == size;
            asked.faces.lod = lod;
            is_same && (state.playing || before == lod)
        });
        if !is_asked || self.requests.for_window != for_window {
            self.requests.for_window = for_window;
            // Before the first frame there is nothing to draw again.
            if self.asked.is_some() {
                self.player.redraw();
            }
            let faces = FaceDetail { lod, ..self.look.faces };
            self.asked = Some((Look { faces, ..self.look.clone() }, size));
        }
        let series = self.series().clone();
        let Self { player, requests, asked: Some((look, _)), .. } = self else { return (false, None) };
        let tick = player.tick(now, &mut |time| requests.make(look, series.field(), time, size));
        if let Some(problem) = self.requests.problem.take() {
            self.fail(problem);
        }
        let mut is_new = false;
        if let Some(delivery) = tick.shown {
            let step = delivery.request.time.step();
            match delivery.frame {
                Ok(frame) => {
                    self.kept_frames += u64::from(delivery.is_kept);
                    self.history.add(now, &frame, delivery.is_kept);
                    let (width, height) = delivery.request.size_px;
                    self.ms_per_pixel = Some(frame.stats.ms_render / (width * height) as f64);
                    if !delivery.is_kept && delivery.request.mode != RenderMode::Reference {
                        let level = (frame.stats.faces_total > 0).then_some(delivery.request.faces.lod);
                        let pixels = width * height;
                        let ms = frame.stats.ms_decode + frame.stats.ms_order + frame.stats.ms_render;
                        self.detail.measured(Measured { level, ms, pixels });
                    }
                    self.shown = Some(Shown { frame, request: delivery.request, is_kept: delivery.is_kept });
                    is_new = true;
                }
                Err(error) => {
                    // A picture of another moment would pass for this one.
                    self.shown = None;
                    is_new = true;
                    self.wants_screenshot = false;
                    let (text, step) = (error.to_string(), format!("step {step}"));
                    self.fail(if text.contains(&step) { text } else { format!("{step}: {text}") });
                }
            }
        }
        if self.wants_screenshot {
            self.take_screenshot();
        }
        let request = self.shown.as_ref().map(|shown| &shown.request);
        if is_new {
            self.insight.repeat(&series, request);
        }
        self.insight.take(request);
        let is_late = state.playing && (state.speed.is_none() || shortfall(&state).is_some());
        self.insight.pause(is_busy || is_late);
        let busy = is_busy.then(|| self.busy_until.saturating_sub(now));
        let wait = tick.wait.into_iter().chain(self.motion.rest(now)).chain(busy).min();
        (is_new, wait)
    }

    /// Whether the renderer can hold a rate by the level of detail, and is to.
    pub(super) fn has_levels(&self) -> bool {
        self.holds_rate && matches!(self.look.mode, RenderMode::Auto | RenderMode::Havs)
    }

    /// The level of detail of the next frames: another than the one chosen while something moves and the rate is to be held, or
    /// where all cells are drawn as fast.
    fn level_in_motion(&mut self, state: &State, (width, height): (usize, usize), now: Duration) -> f64 {
        let moves = state.playing || self.motion.scale_at(now).is_some();
        let held_ms = (moves && self.has_levels()).then_some(1e3 / self.target_fps);
        let Look { mode, faces, .. } = self.look;
        self.detail.level(Wanted { mode, most: faces.lod, held_ms, pixels: width * height })
    }

    /// Of what is on the screen, once that is what it should be: in full, and of the camera as it is.
    fn take_screenshot(&mut self) {
        let (Some(shown), Some(size)) = (&self.shown, self.size_at(1.0)) else { return };
        let series = self.series().clone();
        let wanted = self.requests.make(&self.look, series.field(), shown.request.time, size);
        let wanted = FrameRequest { for_window: shown.request.for_window, ..wanted };
        let is_here = !shown.frame.color.pixels.is_empty();
        let is_due = is_here && (self.state().playing || self.state().frame == Some(shown.request.time));
        if is_due && shown.request.same_view(&wanted) {
            self.wants_screenshot = false;
            let shot = Screenshot::of(shown.frame.clone(), &shown.request, &self.look, &series, self.background);
            self.jobs.write(shot, self.screenshot_folder.clone());
        }
    }

    fn finish_jobs(&mut self) {
        while let Some(done) = self.jobs.take() {
            match done {
                Done::Screenshot(Ok(path)) => {
                    notice::add(&mut self.notices, NoticeKind::Done, format!("saved {}", path.display()));
                }
                Done::Screenshot(Err(error)) => self.fail(error.to_string()),
                Done::Failed(problem) => {
                    self.opens_field = false;
                    self.fail(problem);
                }
                Done::Series(series) => {
                    self.opens_field = false;
                    match series {
                        Ok(series) => {
                            self.player.set_series(series);
                            // A picture of another field would pass for one of this.
                            self.shown = None;
                            self.study();
                        }
                        Err(error) => self.fail(error.to_string()),
                    }
                }
            }
        }
    }
}
