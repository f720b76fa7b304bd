//! What a session does whenever its time comes.

use super::{Asked, Session, Shown};
use crate::pipeline::{FaceDetail, FrameRequest, RenderMode, TetDraw};
use crate::playback::State;
use crate::ui::detail::{Measured, Wanted};
use crate::ui::jobs::{Done, Screenshot};
use crate::ui::notice::{self, NoticeKind};
use crate::ui::shortfall;
use std::time::Duration;

impl Session {
    /// Shows what is due and asks for what comes next. Returns whether there is something new to show, and after how long to
    /// call again at the latest (`None`: after an action, or when woken).
    pub fn tick(&mut self, now: Duration) -> (bool, Option<Duration>) {
        self.finish_jobs();
        self.requests.collect();
        let (state, is_busy) = (self.state(), now < self.busy_until);
        self.player.pipelined().leave_a_core(is_busy);
        let Some(size) = self.size_px(now) else { return (false, None) };
        // An image that is to be saved must be here.
        let is_elsewhere = self.shown.as_ref().is_some_and(|shown| shown.frame.planes.color.pixels.is_empty());
        let for_window = self.has_window_gpu && !(self.wants_screenshot && is_elsewhere);
        let (series, held_ms) = (self.series().clone(), self.held_ms(&state, now));
        let Self { player, requests, detail, look, asked, .. } = self;
        let (mode, pixels) = (look.mode, size.0 * size.1);
        let mut level = |most| detail.level(Wanted { mode, most, held_ms, pixels });
        // What the look wants, and all: what a project wants is not known here, but comes with these.
        let lods = [look.faces.lod, 1.0].map(&mut level);
        // Frames of another level are as good while more of them follow; at rest it is the one that was chosen.
        let is_same = |asked: &mut Asked| {
            let before = std::mem::replace(&mut asked.lods, lods);
            asked.look == *look && asked.size_px == size && (state.playing || before == lods)
        };
        if !asked.as_mut().is_some_and(is_same) || requests.for_window != for_window {
            requests.for_window = for_window;
            // Before the first frame there is nothing to draw again.
            if asked.is_some() {
                player.redraw();
            }
            *asked = Some(Asked { look: look.clone(), size_px: size, lods });
        }
        let tick = player.tick(now, &mut |time| requests.make(look, &series, time, size, &mut level));
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
                    let is_judge = delivery.request.tets().is_some_and(|tets| tets.draw == TetDraw::Reference);
                    if !delivery.is_kept && !is_judge {
                        let level = (frame.stats.faces_total > 0).then_some(delivery.request.lod());
                        let pixels = width * height;
                        let ms = frame.stats.ms_worked();
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

    /// Milliseconds that a frame may take, if its level of detail is to be lower for it: while something moves and the rate is to
    /// be held.
    fn held_ms(&self, state: &State, now: Duration) -> Option<f64> {
        let moves = state.playing || self.motion.scale_at(now).is_some();
        (moves && self.has_levels()).then_some(1e3 / self.target_fps)
    }

    /// Of what is on the screen, once that is what it should be: in full, and of the camera as it is.
    fn take_screenshot(&mut self) {
        let (Some(shown), Some(size)) = (&self.shown, self.size_at(1.0)) else { return };
        let series = self.series().clone();
        let wanted = self.requests.make(&self.look, &series, shown.request.time, size, &mut |lod| lod);
        let Some(wanted) = wanted else { return };
        // All cells are as good as the faces that were chosen.
        let lod = shown.request.lod().max(wanted.lod());
        let draw = TetDraw::chosen(self.look.mode, FaceDetail { lod, ..self.look.faces });
        let wanted = FrameRequest { for_window: shown.request.for_window, ..wanted.with_draw(draw) };
        let is_here = !shown.frame.planes.color.pixels.is_empty();
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
                        Ok((series, looks)) => {
                            let [before, first] = *looks;
                            // Whoever has chosen colours keeps them.
                            if self.look.is_first(&before) {
                                (self.look.tf, self.look.range) = (first.tf, first.range);
                            }
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
