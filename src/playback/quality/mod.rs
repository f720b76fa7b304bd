//! Holds a frame rate while something moves, with the least error that it allows.
//!
//! A frame is drawn in full, or by one of the [families](Family): fewer rays, a smaller image, fewer faces, each with a number that goes from
//! fine to coarse. [`QualityControl`] keeps what each of them took and says how the next frame is drawn. It has no clock and no threads.
//!
//! ```text
//! fall    at once, if the way in use takes more than 0.92 of the time: to the finest one that takes at most 0.88 of it
//! rise    to a way that is expected to take at most 0.85 of it, if frames were as dear as the second dearest of the last sixteen, and at most 1.6 times
//!         what the one in use takes or the next finer one, once that one has been measured
//! rays    if some contrast is within the time; else smaller images. If neither is: the finest way that takes at most 1.1 times what the
//!         cheapest does, for which the coarsest ways of both are tried, and finer ones as long as they take no more
//! details where the camera stands still, in place of either: as soon as they have been measured to be off by less (`details.rs`)
//! faces   where the user draws faces
//! ```
//! A frame is measured with the way in which it was drawn, so it may come late (frames are rendered in a pipeline). A finer way that took too
//! long is remembered, and not tried again until its cost has changed with that of the others: nothing goes up and down.

mod costs;
mod details;
mod rungs;
#[cfg(test)]
mod tests;

use crate::pipeline::{FaceDetail, FrameRequest, SampleSet, TetDraw};
use crate::render::Contrast;
use crate::words::words;
use costs::Costs;
use details::DetailsError;
use rungs::{DETAILS, EXACT, RUNGS, family_of, ladder, nearest};
use serde::{Deserialize, Serialize};

/// How a frame is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Quality {
    /// All there is.
    #[default]
    Exact,
    /// Only the rays that a contrast asks for ([`SampleSet::Adaptive`]).
    Rays(Contrast),
    /// An image of this share of width and height, enlarged.
    Scaled(f64),
    /// Rays at every fourth pixel, with details of an earlier frame ([`crate::pipeline::ResidualRequest`]).
    Details,
    /// By faces: the share of those inside the volume that is drawn.
    Faces(f64),
}

impl Quality {
    /// The request drawn like this; `faces` says how faces are, but for their number. Details are for who has them to add.
    #[must_use]
    pub fn of_request(self, request: FrameRequest, faces: FaceDetail) -> FrameRequest {
        match self {
            Self::Exact | Self::Details => request,
            Self::Rays(contrast) => FrameRequest { samples: SampleSet::Adaptive { contrast }, ..request },
            Self::Scaled(share) => {
                let side = |px: usize| ((px as f64 * share).round() as usize).max(1);
                let (width, height) = request.size_px;
                FrameRequest { size_px: (side(width), side(height)), ..request }
            }
            Self::Faces(lod) => request.with_draw(TetDraw::Faces(FaceDetail { lod, ..faces })),
        }
    }
}

/// What is given up for time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Rays where neighbouring ones hardly differ.
    Rays,
    /// Pixels.
    Scaled,
    /// Changes between rays, while the camera stands still.
    Details,
    /// Faces inside the volume.
    Faces,
}

impl Family {
    /// The ways to draw that the control chooses from, finest first.
    pub fn qualities(self) -> impl Iterator<Item = Quality> {
        ladder(self).map(|at| RUNGS[at].quality)
    }
}

words!(
    Family,
    "there is no way to be faster",
    ["rays" = Rays, "scaled" = Scaled, "details" = Details, "faces" = Faces]
);

/// What a frame is wanted for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Milliseconds that a frame may take, if something moves and a rate is to be held.
    pub target_ms: Option<f64>,
    /// What may be given up for it; `None`: what costs least.
    pub family: Option<Family>,
    /// Whether rays can be left out of the frame.
    pub has_rays: bool,
    /// Whether there are details of an earlier frame of the same view.
    pub has_details: bool,
    /// The share of faces that is drawn in full quality, if faces are what the user draws.
    pub faces: Option<f64>,
    /// Whether all cells may be drawn in place of those faces where that takes no longer.
    pub or_exact: bool,
}

/// A way in use is left if it takes more than this share of the time.
const FALL: f64 = 0.92;
/// It is also left, for the next coarser one, if more frames than these were late of the last sixteen, and as many were not: what is dear comes
/// back.
const LATE: usize = 2;
/// What it is left for takes at most this share.
const AIM: f64 = 0.88;
/// A finer way is taken that is expected to take at most this share.
const RISE: f64 = 0.85;
/// It takes at most so many times what the one in use does: what is not measured may be expected wrongly.
const RISE_BY: f64 = 1.6;
/// Where nothing is within the time: so many times the least possible.
const NEAR: f64 = 1.1;
/// A view that is so many times nearer or farther costs something else.
const OTHER_ZOOM: f64 = 1.5;

/// Chooses how frames are drawn from what the last ones took.
#[derive(Clone, Debug, Default)]
pub struct QualityControl {
    costs: Costs,
    details: DetailsError,
    /// The way in use, while something moves.
    in_use: Option<usize>,
    /// Whether it has been measured since it is.
    is_confirmed: bool,
    /// Pixels of an image in full, and units of length in their height when costs were measured.
    view: Option<(usize, f64)>,
}

impl QualityControl {
    /// Frames have so many pixels in full, whose height shows so many units of length at what is looked at. Costs go with the pixels, and are
    /// forgotten if that height has changed by a factor of more than 1.5.
    pub fn set_view(&mut self, pixels: usize, height: f64) {
        let pixels = pixels.max(1);
        let Some((before, at)) = self.view else {
            self.view = Some((pixels, height));
            return;
        };
        if pixels != before {
            self.costs.scale(pixels as f64 / before as f64);
        }
        let ratio = height / at;
        let is_near = (1.0 / OTHER_ZOOM..=OTHER_ZOOM).contains(&ratio);
        if !is_near && !ratio.is_nan() {
            self.forget();
        }
        self.view = Some((pixels, if is_near { at } else { height }));
    }

    /// Frames show something else (other colours, say): what they took counts no more, but for the last one as a first guess.
    pub fn forget(&mut self) {
        self.costs.forget();
        self.details = DetailsError::default();
    }

    /// Frames are of another mesh: nothing is known.
    pub fn forget_all(&mut self) {
        *self = Self::default();
    }

    /// A frame drawn like this took so many milliseconds. Numbers that are not positive and finite are no measurements.
    pub fn measured(&mut self, drawn: Quality, ms: f64) {
        let rung = nearest(drawn);
        self.costs.add(rung, ms);
        self.details.pass();
        self.is_confirmed |= self.in_use == Some(rung);
    }

    /// Pixels of a frame with details were off by so much, as a root mean square: with them, and without any.
    pub fn measured_details(&mut self, rmse: [f64; 2]) {
        self.details.add(rmse);
    }

    /// Milliseconds that a frame in full quality is expected to take.
    pub fn exact_ms(&self) -> Option<f64> {
        self.costs.expected(Family::Rays, EXACT)
    }

    /// How to draw the next frame.
    pub fn choose(&mut self, wanted: &Wanted) -> Quality {
        let Some(target_ms) = wanted.target_ms.filter(|ms| *ms > 0.0) else {
            self.in_use = None;
            return self.at_rest(wanted);
        };
        if self.is_exact_as_fast(wanted, AIM * target_ms) {
            self.in_use = None;
            return Quality::Exact;
        }
        let families = wanted.families();
        let usable = |at: &usize| families.iter().any(|&family| ladder(family).any(|of| of == *at));
        let rung = match self.in_use.filter(usable) {
            None => self.pick(&families, target_ms),
            Some(at) => self.go_on(at, &families, target_ms),
        };
        if self.in_use != Some(rung) {
            (self.in_use, self.is_confirmed) = (Some(rung), false);
        }
        let rung = if self.has_better_details(rung, wanted, target_ms) { DETAILS } else { rung };
        match (RUNGS[rung].quality, wanted.faces) {
            (Quality::Faces(level), Some(most)) => Quality::Faces(level.min(most)),
            (quality, _) => quality,
        }
    }

    /// Whether details are within the time, and off by less than what would be drawn otherwise, or nobody knows yet.
    fn has_better_details(&mut self, rung: usize, wanted: &Wanted, target_ms: f64) -> bool {
        let is_asked = wanted.has_details && wanted.family.is_none() && rung != EXACT;
        let limit = if self.details.is_in_use { FALL } else { AIM };
        let is_in_time = is_within(self.costs.expected(Family::Details, DETAILS), limit * target_ms);
        self.details.is_in_use = is_asked && is_in_time && self.details.is_better_than(RUNGS[rung].quality);
        self.details.is_in_use
    }

    /// What is drawn when nothing is to be held: everything, or the faces that were chosen.
    fn at_rest(&self, wanted: &Wanted) -> Quality {
        let Some(most) = wanted.faces else { return Quality::Exact };
        let faces_ms = self.costs.expected(Family::Faces, nearest(Quality::Faces(most)));
        if faces_ms.is_some_and(|ms| self.is_exact_as_fast(wanted, ms)) { Quality::Exact } else { Quality::Faces(most) }
    }

    /// Whether all cells may be drawn in place of faces, and took no longer than that.
    fn is_exact_as_fast(&self, wanted: &Wanted, limit_ms: f64) -> bool {
        wanted.or_exact && is_within(self.costs.measured(EXACT), limit_ms)
    }

    /// From one frame to the next.
    fn go_on(&mut self, at: usize, families: &[Family], target_ms: f64) -> usize {
        let family = family_of(at).filter(|family| families.contains(family)).unwrap_or(families[0]);
        let is_cheap = |coarser: &usize| is_within(self.costs.expected(family, *coarser), FALL * target_ms);
        let coarser = ladder(family).skip_while(|&of| of != at).nth(1).filter(is_cheap);
        let [late, in_time] = self.costs.beyond(at, target_ms);
        if let Some(coarser) = coarser.filter(|_| late > LATE && in_time > LATE) {
            self.costs.expect_dearest(at);
            return coarser;
        }
        let expected = |family, at| self.costs.expected(family, at);
        let Some(ms) = expected(family, at) else { return at };
        if ms > FALL * target_ms {
            let within = self.finest_within(AIM * target_ms, families);
            return within.unwrap_or_else(|| self.nearest_to_target(at, family, families));
        }
        if !self.is_confirmed {
            return at;
        }
        // A family that is named before this one, as soon as it is fast enough.
        let before = families.iter().take_while(|&&of| of != family).filter(|_| at != EXACT);
        let limit = RISE * target_ms / self.costs.dearest();
        let coarsest = |&of: &Family| ladder(of).last().filter(|&last| is_within(expected(of, last), limit));
        let within = |limit: f64| move |finer: &usize| is_within(expected(family, *finer), limit);
        let finer = || ladder(family).take_while(|&of| of != at);
        let by_steps = || finer().find(within(limit.min(RISE_BY * ms))).or(finer().last().filter(within(limit)));
        before.filter_map(coarsest).next().or_else(by_steps).unwrap_or(at)
    }

    /// From all that there is, knowing what is known.
    fn pick(&self, families: &[Family], target_ms: f64) -> usize {
        let is_unknown =
            |&family: &Family| ladder(family).next().is_none_or(|at| self.costs.expected(family, at).is_none());
        if families.iter().all(is_unknown) {
            // Nobody knows yet.
            return ladder(families[0]).next().unwrap_or(EXACT);
        }
        let within = self.finest_within(AIM * target_ms, families);
        within.unwrap_or_else(|| self.cheapest(families))
    }

    /// The finest way that takes no more than that, in the first family that has one.
    fn finest_within(&self, limit_ms: f64, families: &[Family]) -> Option<usize> {
        let within = |family, at: &usize| is_within(self.costs.expected(family, *at), limit_ms);
        families.iter().find_map(|&family| ladder(family).find(|at| within(family, at)))
    }

    /// Where nothing is within the time: what comes near to the cheapest, once it is known what that is.
    fn nearest_to_target(&self, at: usize, family: Family, families: &[Family]) -> usize {
        if !self.is_confirmed {
            return at;
        }
        let is_new = |at: &usize| self.costs.measured(*at).is_none();
        let mut coarsest = families.iter().filter_map(|&family| ladder(family).last());
        if let Some(untried) = coarsest.find(is_new) {
            return untried;
        }
        let (all, in_use) = (self.least(families), self.costs.expected(family, at));
        if !is_within(in_use, NEAR * all) {
            // What is in use stays while it is hardly worse.
            return if is_within(in_use, NEAR * NEAR * all) { at } else { self.cheapest(families) };
        }
        // A finer way may take no more: that shows when it is tried.
        let finer = ladder(family).take_while(|&of| of != at).last();
        finer.filter(|finer| is_new(finer) || is_within(self.costs.measured(*finer), NEAR * all)).unwrap_or(at)
    }

    /// The finest of the ways that are near to the cheapest; earlier families have less error, and may take a little longer.
    fn cheapest(&self, families: &[Family]) -> usize {
        let all = self.least(families);
        let of_family =
            |&family: &Family| ladder(family).find(|&at| is_within(self.costs.expected(family, at), NEAR * all));
        families.iter().find_map(of_family).unwrap_or(EXACT)
    }

    /// The least that a frame may be expected to take.
    fn least(&self, families: &[Family]) -> f64 {
        let expected = |&family: &Family| ladder(family).filter_map(move |at| self.costs.expected(family, at));
        families.iter().flat_map(expected).fold(f64::INFINITY, f64::min)
    }
}

/// Whether a cost that is known is at most that.
fn is_within(ms: Option<f64>, limit: f64) -> bool {
    ms.is_some_and(|ms| ms <= limit)
}

impl Wanted {
    /// What may be given up, what costs the least error first; one family at least.
    fn families(&self) -> Vec<Family> {
        let rays = || self.has_rays.then_some(Family::Rays);
        match (self.family, self.faces) {
            (Some(Family::Scaled), _) => vec![Family::Scaled],
            (Some(Family::Faces), _) | (None, Some(_)) => vec![Family::Faces],
            (Some(Family::Rays), _) if self.has_rays => vec![Family::Rays],
            (Some(Family::Details), _) if self.has_details => vec![Family::Details],
            (Some(Family::Rays | Family::Details) | None, _) => rays().into_iter().chain([Family::Scaled]).collect(),
        }
    }
}
