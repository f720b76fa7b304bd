//! Quality of frames in motion and at rest.

use super::{Session, Shown};
use crate::image::RgbaImage;
use crate::optics::OpticsKind;
use crate::pipeline::{FaceDetail, FrameRequest, FrameTime, RenderMode, TetDraw};
use crate::playback::State;
use crate::playback::quality::Quality;
use crate::render::Contrast;
use crate::render::points::PointStyle;
use crate::short::Short;
use crate::ui::motion::MotionError;
use std::time::Duration;

/// Time after the last motion until the camera counts as still and the image is drawn in full.
pub(super) const SETTLE: Duration = Duration::from_millis(200);

/// Default target frame rate while something moves.
pub const DEFAULT_TARGET_FPS: f64 = 25.0;

/// Valid target frame rates.
pub const TARGET_FPS: std::ops::RangeInclusive<f64> = 1.0..=120.0;

/// Notches of the target frame rate, for keys.
const NOTCHES: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 15.0, 25.0, 40.0, 60.0, 120.0];

/// The target frame rate a notch higher: less is drawn.
pub(super) fn less_quality(fps: Option<f64>) -> Option<f64> {
    let now = fps.unwrap_or(0.0);
    NOTCHES.into_iter().find(|notch| *notch > now).or(fps)
}

/// The target frame rate a notch lower: more is drawn; `None`: all.
pub(super) fn more_quality(fps: Option<f64>) -> Option<f64> {
    NOTCHES.into_iter().rev().find(|notch| Some(*notch) < fps)
}

/// Contrasts of the previews of an image in full, if that takes longer than [`PREVIEWED_MS`].
const PREVIEWS: [f32; 2] = [0.1, 0.02];
const PREVIEWED_MS: f64 = 100.0;
/// Largest contrast of a preview relative to that on the screen.
const BETTER: f32 = 0.5;

/// A share in percent, as a text of one decimal.
fn percent(share: f64) -> Short<f64> {
    Short((1e3 * share).round() / 10.0)
}

impl Session {
    /// The quality of a request: its share of width and height, contrast or level.
    pub(super) fn quality_of(&self, request: &FrameRequest) -> Quality {
        if request.residual.is_some() {
            return Quality::Details;
        }
        if let Some(faces) = request.tets().and_then(|tets| tets.draw.drawn_by().faces()) {
            return Quality::Faces(faces.lod);
        }
        let points = request.tets().and_then(|tets| tets.draw.drawn_by().points());
        let points = points.map(|drawn| Quality::of_points(drawn, self.points_at_rest(request.time)));
        if let Some(points @ Quality::Points(_)) = points {
            return points;
        }
        let contrast = request.samples.contrast().filter(|contrast| contrast.get() > 0.0);
        let share = self.size_px().map_or(1.0, |full| request.size_px.1 as f64 / full.1 as f64);
        match contrast {
            Some(contrast) => Quality::Rays(contrast),
            // The largest share below the full size.
            None if share < 0.92 => Quality::Scaled(share),
            None => Quality::Exact,
        }
    }

    /// How points are drawn at rest, at a time whose settings are known.
    fn points_at_rest(&self, time: FrameTime) -> PointStyle {
        let keyed = self.requests.worker.known(time).map(|keyed| self.look.lod_at(keyed));
        let lod = keyed.or(self.drawing.map(|drawing| drawing.lod)).unwrap_or(self.look.faces.lod);
        let draw = TetDraw::chosen(RenderMode::Points, FaceDetail { lod, ..self.look.faces }, self.look.points);
        draw.drawn_by().points().unwrap_or_default()
    }

    /// Target milliseconds per frame: while something moves and no picture in full is awaited.
    pub(super) fn target_ms(&self, state: &State, now: Duration) -> Option<f64> {
        let is_in_full = self.wants_screenshot || self.shared.is_compared;
        let moves = (state.playing || self.rest(now).is_some() || self.drifts(state)) && !is_in_full;
        self.target_fps.filter(|_| moves).map(|fps| 1e3 / fps / self.shared.views as f64)
    }

    /// Time until the camera counts as still; `None` if it does.
    pub(super) fn rest(&self, now: Duration) -> Option<Duration> {
        self.moving_until.and_then(|until| until.checked_sub(now)).filter(|rest| !rest.is_zero())
    }

    /// Contrasts of previews, better than the picture on the screen.
    pub(super) fn previews(&self) -> Vec<Contrast> {
        if self.quality.exact_ms().is_none_or(|ms| ms < PREVIEWED_MS) {
            return Vec::new();
        }
        let is_same_view = |shown: &&Shown| shown.request.camera == self.camera();
        let shown = self.shown.as_ref().filter(is_same_view).and_then(|shown| shown.request.samples.contrast());
        let is_better = |contrast: &Contrast| shown.is_none_or(|shown| contrast.get() <= BETTER * shown.get());
        PREVIEWS.into_iter().filter_map(Contrast::new).filter(is_better).collect()
    }

    /// How the picture on the screen falls short of that at rest, as text; `None` if it does not.
    pub fn lacks(&self) -> Option<String> {
        let shown = self.shown.as_ref()?;
        match shown.quality {
            Quality::Rays(contrast) => Some(format!("fewer rays: contrast {contrast}")),
            Quality::Scaled(share) => Some(format!("smaller image: {:.0} %", 100.0 * share)),
            Quality::Details => Some("few rays, with details of earlier steps".to_owned()),
            Quality::Faces(level) if shown.at_rest != shown.quality => {
                Some(format!("fewer faces: {} %", percent(level)))
            }
            Quality::Points(_) => Some(format!("fewer points: {} %", percent(shown.request.lod()))),
            Quality::Faces(_) | Quality::Exact => None,
        }
    }

    /// How much the picture on the screen has, as a short text: `exact` if all is drawn, with exact optics.
    pub fn drawn(&self) -> String {
        let Some(shown) = &self.shown else { return "nothing yet".to_owned() };
        let tets = shown.request.tets();
        let points = tets.and_then(|tets| tets.draw.drawn_by().points());
        match shown.quality {
            Quality::Rays(contrast) => format!("rays: contrast {contrast}"),
            Quality::Scaled(share) => format!("pixels: {:.0} %", 100.0 * share),
            Quality::Details => "details".to_owned(),
            Quality::Faces(level) if level < 1.0 => format!("faces: {} %", percent(level)),
            Quality::Faces(_) | Quality::Points(_) | Quality::Exact => match points {
                Some(style) if style.lod < 1.0 => format!("points: {} %", percent(style.lod)),
                _ => {
                    let optics = tets.map(|tets| tets.optics).filter(|_| self.look.mode != RenderMode::Reference);
                    let are_cells = points.is_none_or(|style| style.is_exact());
                    let is_exact = are_cells && optics.is_none_or(|optics| optics == OpticsKind::Exact);
                    if is_exact { "exact" } else { "all drawn" }.to_owned()
                }
            },
        }
    }

    /// Error of the last picture of the last motion.
    pub fn motion_error(&self) -> Option<MotionError> {
        self.motion_error
    }

    /// Compares the last frame of a motion with the one in full that is on the screen, on another thread.
    pub(super) fn compare_with_motion(&mut self) {
        let Some(shown) = &self.shown else { return };
        if !shown.is_final {
            return;
        }
        if shown.quality != shown.at_rest {
            self.moved = Some(shown.clone());
            return;
        }
        let Some(moved) = self.moved.take() else { return };
        let (request, draw) = (&shown.request, shown.request.tets().map(|tets| tets.draw).unwrap_or_default());
        let as_exact =
            FrameRequest { size_px: request.size_px, samples: request.samples.clone(), ..moved.request.clone() };
        let as_exact = as_exact.with_draw(draw);
        if !moved.request.same_moment(request) || !as_exact.same_view(request) {
            return;
        }
        let exact = shown.frame.clone();
        self.jobs.compare(move || MotionError::of(&moved, &exact.planes.color));
    }
}

impl MotionError {
    pub(in crate::ui) fn of(moved: &Shown, exact: &RgbaImage) -> Self {
        let (stats, color) = (&moved.frame.stats, &moved.frame.planes.color);
        let cast: u64 = stats.rays_by_level.iter().sum();
        let pixels = moved.request.size_px.0 * moved.request.size_px.1;
        Self {
            quality: moved.quality,
            ms: stats.ms_worked(),
            rays: matches!(moved.quality, Quality::Rays(_)).then(|| cast as f64 / pixels as f64),
            error: Self::between(color, exact),
        }
    }
}
