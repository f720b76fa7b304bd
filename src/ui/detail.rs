//! How much is drawn of a frame: all cells, or some of the faces.
//!
//! The user sets the most that is drawn, and whether a frame rate is held while something moves (dissertation 6.1.4). Where the
//! renderer is left to the program, a level of 1 is the ray caster's and any other the face renderer's
//! ([`RenderMode::Auto`]); faces are no bargain where they take longer than all cells do, which is judged by the last frames.

use crate::lod::Controller;
use crate::pipeline::RenderMode;

/// What a level is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wanted {
    /// The renderer that was chosen.
    pub mode: RenderMode,
    /// The most that is drawn, 0 to 1.
    pub most: f64,
    /// Milliseconds that a frame may take, if that is to be held now.
    pub held_ms: Option<f64>,
    /// Pixels of the image.
    pub pixels: usize,
}

/// A frame that was rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// The level that its faces had; `None` if all cells were drawn.
    pub level: Option<f64>,
    /// What it took.
    pub ms: f64,
    /// Pixels of the image.
    pub pixels: usize,
}

/// What frames cost lately, and the level of detail that follows from it.
#[derive(Clone, Debug)]
pub(super) struct Detail {
    controller: Controller,
    /// Milliseconds a pixel of all cells.
    cells: Option<f64>,
    /// A level of faces, and its milliseconds a pixel.
    faces: Option<(f64, f64)>,
}

impl Default for Detail {
    fn default() -> Self {
        Self { controller: Controller::new(f64::INFINITY), cells: None, faces: None }
    }
}

/// Estimates are used for levels so many times higher or lower than what was measured.
const NEAR: f64 = 2.0;

impl Detail {
    /// The level to draw a frame with, 0 to 1.
    pub(super) fn level(&mut self, wanted: Wanted) -> f64 {
        let most = if wanted.most.is_nan() { 1.0 } else { wanted.most.clamp(0.0, 1.0) };
        let Wanted { mode, held_ms, pixels, .. } = wanted;
        if !matches!(mode, RenderMode::Auto | RenderMode::Havs) {
            return most;
        }
        let cells_ms = self.cells.map(|ms| ms * pixels as f64);
        let level = match held_ms {
            Some(target_ms) => {
                if target_ms != self.controller.target_ms() {
                    self.controller.set_target(target_ms);
                    // All cells stand for all faces, until those are measured: the first frame need not be too slow.
                    cells_ms.map(|ms| self.controller.measured(ms, 1.0));
                }
                self.controller.fraction().min(most)
            }
            None => most,
        };
        // What all cells may take for faces to be no gain.
        let bargain_ms = held_ms.or_else(|| Some(self.faces_ms(level)? * pixels as f64));
        let are_cells_better = cells_ms.zip(bargain_ms).is_some_and(|(cells, bargain)| cells <= bargain);
        if mode == RenderMode::Auto && are_cells_better { 1.0 } else { level }
    }

    /// A frame was rendered.
    pub(super) fn measured(&mut self, frame: Measured) {
        let per_pixel = frame.ms / frame.pixels as f64;
        match frame.level {
            Some(level) => self.faces = Some((level, per_pixel)),
            None => self.cells = Some(per_pixel),
        }
        self.controller.measured(frame.ms, frame.level.unwrap_or(1.0));
    }

    /// Milliseconds a pixel of faces at a level, if that is known: they go with their number.
    fn faces_ms(&self, level: f64) -> Option<f64> {
        let (at, ms) = self.faces?;
        let ratio = level / at;
        (1.0 / NEAR..=NEAR).contains(&ratio).then_some(ms * ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: usize = 1000;
    const TARGET: Option<f64> = Some(40.0);

    fn wanted(mode: RenderMode, most: f64, held_ms: Option<f64>) -> Wanted {
        Wanted { mode, most, held_ms, pixels: PIXELS }
    }

    fn cells(ms: f64) -> Measured {
        Measured { level: None, ms, pixels: PIXELS }
    }

    fn faces(level: f64, ms: f64) -> Measured {
        Measured { level: Some(level), ms, pixels: PIXELS }
    }

    /// A machine on which all cells take `cells` and all faces `faces` milliseconds; levels of the frames that it draws.
    fn play(detail: &mut Detail, cells_ms: f64, faces_ms: f64, frames: usize) -> Vec<f64> {
        let draw = |_| {
            let level = detail.level(wanted(RenderMode::Auto, 1.0, TARGET));
            detail.measured(if level < 1.0 { faces(level, 2.0 + level * faces_ms) } else { cells(cells_ms) });
            level
        };
        (0..frames).map(draw).collect()
    }

    #[test]
    fn a_rate_is_held_with_faces_where_all_cells_are_too_slow() {
        let mut detail = Detail::default();
        let levels = play(&mut detail, 200.0, 300.0, 20);
        assert_eq!(levels[0], 1.0, "nobody knows yet");
        let mut known = Detail::default();
        known.measured(cells(200.0));
        assert!(play(&mut known, 200.0, 300.0, 1)[0] < 0.25, "what is known is used at once");
        let last = levels[19];
        let ms = 2.0 + last * 300.0;
        assert!((0.75 * 40.0..=40.0).contains(&ms), "{ms} ms: {levels:?}");
        assert!(levels[10..].iter().all(|&l| l == last), "it settles: {levels:?}");
        // Faces become cheap (another transfer function): as many as there are, and then cells again.
        let levels = play(&mut detail, 30.0, 10.0, 20);
        assert_eq!(levels[19], 1.0, "{levels:?}");
        assert!(levels.windows(2).all(|l| l[0] <= l[1]));
        assert!(play(&mut detail, 30.0, 300.0, 20).iter().all(|&l| l == 1.0), "all cells are within the time");
    }

    #[test]
    fn at_rest_the_level_is_the_one_chosen() {
        let mut detail = Detail::default();
        play(&mut detail, 200.0, 300.0, 20);
        for most in [1.0, 0.9] {
            assert_eq!(detail.level(wanted(RenderMode::Auto, most, None)), most);
            assert!(detail.level(wanted(RenderMode::Auto, most, TARGET)) < 0.2);
        }
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.01, TARGET)), 0.01, "never more than was chosen");
        assert_eq!(detail.level(wanted(RenderMode::Auto, f64::NAN, None)), 1.0);
    }

    #[test]
    fn faces_that_take_longer_than_all_cells_are_not_drawn_unless_asked_for() {
        let mut detail = Detail::default();
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.8, None)), 0.8);
        detail.measured(cells(100.0));
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.8, None)), 0.8, "faces are not known yet");
        detail.measured(faces(0.8, 160.0));
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.8, None)), 1.0);
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.45, None)), 0.45, "these would take 90 ms");
        assert_eq!(detail.level(wanted(RenderMode::Auto, 0.1, None)), 0.1, "too far from what is known");
        assert_eq!(detail.level(wanted(RenderMode::Havs, 0.8, None)), 0.8);
        assert_eq!(detail.level(wanted(RenderMode::Raycast, 0.8, TARGET)), 0.8, "it has no levels");
    }
}
