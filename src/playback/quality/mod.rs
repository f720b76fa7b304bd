//! Holds a frame rate while something moves, with the least error that allows it.
//!
//! A frame is drawn in full, or by one of the [families](Family): fewer rays, a smaller image, fewer faces or points, each with a parameter
//! from fine to coarse (its rungs). [`QualityControl`] records what each rung took and chooses that of the next frame. It has no clock and no
//! threads.
//!
//! ```text
//! fall    at once, if the rung in use takes more than 0.92 of the target: to the finest one that takes at most 0.88 of it
//! rise    to a rung that is expected to take at most 0.85 of it, if frames were as dear as the second dearest of the last sixteen, and at most 1.6 times
//!         what the one in use takes or the next finer one, once that one has been measured
//! rays    if some contrast is within the target; else smaller images. If neither is: the finest rung that takes at most 1.1 times what the
//!         cheapest does, for which the coarsest ways of both are tried, and finer ones as long as they take no more
//! details where the camera stands still, in place of either: as soon as their measured error is smaller (`details.rs`)
//! faces   where the user draws faces
//! points  where points are drawn, if no smaller image is within the target; the smallest is tried before (`points.rs`)
//! ```
//! A measurement names the quality of its frame, so it may come late (frames are rendered in a pipeline). A finer rung that took too long
//! is not tried again until its cost has changed with that of the others: the quality does not oscillate.

mod costs;
mod details;
mod points;
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
    /// In full: all rays or cells, or the points that were chosen.
    #[default]
    Exact,
    /// Only the rays that a contrast needs ([`SampleSet::Adaptive`]).
    Rays(Contrast),
    /// A smaller image, enlarged: this share of width and height.
    Scaled(f64),
    /// Rays at every fourth pixel, with details of an earlier frame ([`crate::pipeline::ResidualRequest`]).
    Details,
    /// By faces: this share of the interior ones.
    Faces(f64),
    /// By points with about this share of the fragments of a frame in full.
    Points(f64),
}

impl Quality {
    /// The request with this quality; `faces` are the settings of faces except their number. The caller adds the details of
    /// [`Quality::Details`].
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
            Self::Points(share) => request.with_tets(|tets| {
                if let TetDraw::Points(style) = &mut tets.draw {
                    *style = points::coarser(*style, share);
                }
            }),
        }
    }
}

/// What is reduced to save time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Rays where neighbouring ones differ little.
    Rays,
    /// Pixels of the image.
    Scaled,
    /// Changes between sparse rays, while the camera stands still.
    Details,
    /// Interior faces.
    Faces,
    /// Points.
    Points,
}

impl Family {
    /// The qualities that the control chooses from, finest first.
    pub fn qualities(self) -> impl Iterator<Item = Quality> {
        ladder(self).map(|at| RUNGS[at].quality)
    }
}

words!(
    Family,
    "there is no way to be faster",
    ["rays" = Rays, "scaled" = Scaled, "details" = Details, "faces" = Faces, "points" = Points]
);

/// Requirements on a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Target milliseconds per frame, if something moves and a rate is to be held.
    pub target_ms: Option<f64>,
    /// The family to use; `None`: the one with the least error.
    pub family: Option<Family>,
    /// Whether the frame can be drawn with fewer rays.
    pub has_rays: bool,
    /// Whether there are details of an earlier frame of the same view.
    pub has_details: bool,
    /// Share of faces in full quality, if the user draws faces.
    pub faces: Option<f64>,
    /// Whether the frame is drawn as points, and can be with fewer ([`FrameRequest::may_leave_points_out`]).
    pub has_points: bool,
    /// Whether all cells may be drawn in place of faces where that takes no longer.
    pub or_exact: bool,
}

/// A rung is left if it takes more than this share of the target.
const FALL: f64 = 0.92;
/// A rung is also left, for the next coarser one, if more than this many of the last sixteen frames were late, and as many were not: dear
/// steps come back.
const LATE: usize = 2;
/// Its replacement takes at most this share.
const AIM: f64 = 0.88;
/// A finer rung is taken if it is expected to take at most this share.
const RISE: f64 = 0.85;
/// It takes at most this many times what the one in use does: an unmeasured cost is uncertain.
const RISE_BY: f64 = 1.6;
/// Where no rung is within the target: at most this many times the least cost.
const NEAR: f64 = 1.1;
/// If the view is nearer or farther by this factor, costs are forgotten.
const OTHER_ZOOM: f64 = 1.5;

/// Chooses how frames are drawn from what the last ones took.
#[derive(Clone, Debug, Default)]
pub struct QualityControl {
    costs: Costs,
    details: DetailsError,
    /// The rung in use, while something moves.
    in_use: Option<usize>,
    /// Whether it has been measured since it came into use.
    is_confirmed: bool,
    /// Pixels of an image in full, and the world units that its height showed when costs were measured.
    view: Option<(usize, f64)>,
}

impl QualityControl {
    /// Sets the pixels of a frame in full, and the world units that its height shows at the camera's target. Costs are proportional to the
    /// pixels, and are forgotten if that height has changed by a factor of more than 1.5.
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

    /// Forgets costs after a change of what is shown (other colours, say), except the last one as a first guess.
    pub fn forget(&mut self) {
        self.costs.forget();
        self.details = DetailsError::default();
    }

    /// Forgets everything: frames are of another mesh.
    pub fn forget_all(&mut self) {
        *self = Self::default();
    }

    /// Adds the milliseconds of a frame with this quality. Numbers that are not positive and finite are ignored.
    pub fn measured(&mut self, drawn: Quality, ms: f64) {
        let rung = nearest(drawn);
        self.costs.add(rung, ms);
        self.details.pass();
        self.is_confirmed |= self.in_use == Some(rung);
    }

    /// Adds the root mean square errors of a frame: with details, and without.
    pub fn measured_details(&mut self, rmse: [f64; 2]) {
        self.details.add(rmse);
    }

    /// Milliseconds that a frame in full quality is expected to take.
    pub fn exact_ms(&self) -> Option<f64> {
        self.costs.expected(Family::Rays, EXACT)
    }

    /// Quality of the next frame.
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

    /// Whether details are within the target, and have a smaller error than `rung`, or that is not known yet.
    fn has_better_details(&mut self, rung: usize, wanted: &Wanted, target_ms: f64) -> bool {
        let is_asked = wanted.has_details && wanted.family.is_none() && rung != EXACT;
        let limit = if self.details.is_in_use { FALL } else { AIM };
        let is_in_time = is_within(self.costs.expected(Family::Details, DETAILS), limit * target_ms);
        self.details.is_in_use = is_asked && is_in_time && self.details.is_better_than(RUNGS[rung].quality);
        self.details.is_in_use
    }

    /// Quality when no rate is to be held: exact, or the faces that the user chose.
    fn at_rest(&self, wanted: &Wanted) -> Quality {
        let Some(most) = wanted.faces else { return Quality::Exact };
        let faces_ms = self.costs.expected(Family::Faces, nearest(Quality::Faces(most)));
        if faces_ms.is_some_and(|ms| self.is_exact_as_fast(wanted, ms)) { Quality::Exact } else { Quality::Faces(most) }
    }

    /// Whether all cells may be drawn in place of faces, and took no longer than the limit.
    fn is_exact_as_fast(&self, wanted: &Wanted, limit_ms: f64) -> bool {
        wanted.or_exact && is_within(self.costs.measured(EXACT), limit_ms)
    }

    /// The next rung, given the current one.
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
        // An earlier family, as soon as it is fast enough.
        let before = families.iter().take_while(|&&of| of != family).filter(|_| at != EXACT);
        let limit = RISE * target_ms / self.costs.dearest();
        let coarsest = |&of: &Family| ladder(of).last().filter(|&last| is_within(expected(of, last), limit));
        let within = |limit: f64| move |finer: &usize| is_within(expected(family, *finer), limit);
        let finer = || ladder(family).take_while(|&of| of != at);
        let by_steps = || finer().find(within(limit.min(RISE_BY * ms))).or(finer().last().filter(within(limit)));
        before.filter_map(coarsest).next().or_else(by_steps).unwrap_or(at)
    }

    /// The first rung, from known costs.
    fn pick(&self, families: &[Family], target_ms: f64) -> usize {
        let is_unknown =
            |&family: &Family| ladder(family).next().is_none_or(|at| self.costs.expected(family, at).is_none());
        if families.iter().all(is_unknown) {
            // No cost is known yet.
            return ladder(families[0]).next().unwrap_or(EXACT);
        }
        let within = self.finest_within(AIM * target_ms, families);
        within.unwrap_or_else(|| self.cheapest(families))
    }

    /// The finest rung within the limit, in the first family that has one. The coarsest rungs before points are tried first: the guess
    /// may be too high, and the error of points is much larger.
    fn finest_within(&self, limit_ms: f64, families: &[Family]) -> Option<usize> {
        let within = |family, at: &usize| is_within(self.costs.expected(family, *at), limit_ms);
        let are_points_last = families.contains(&Family::Points);
        let untried = |family| {
            let is_tried = !are_points_last || family == Family::Points;
            ladder(family).last().filter(|&last| !is_tried && self.costs.measured(last).is_none())
        };
        families.iter().find_map(|&family| ladder(family).find(|at| within(family, at)).or_else(|| untried(family)))
    }

    /// Where no rung is within the target: a rung near the cheapest one, after trying the coarsest ones.
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
            // The rung in use stays while it is hardly dearer.
            return if is_within(in_use, NEAR * NEAR * all) { at } else { self.cheapest(families) };
        }
        // A finer rung may take no more: it is tried.
        let finer = ladder(family).take_while(|&of| of != at).last();
        finer.filter(|finer| is_new(finer) || is_within(self.costs.measured(*finer), NEAR * all)).unwrap_or(at)
    }

    /// The finest rung near the cheapest; earlier families have less error, and may take a little longer.
    fn cheapest(&self, families: &[Family]) -> usize {
        let all = self.least(families);
        let of_family =
            |&family: &Family| ladder(family).find(|&at| is_within(self.costs.expected(family, at), NEAR * all));
        families.iter().find_map(of_family).unwrap_or(EXACT)
    }

    /// The least expected milliseconds.
    fn least(&self, families: &[Family]) -> f64 {
        let expected = |&family: &Family| ladder(family).filter_map(move |at| self.costs.expected(family, at));
        families.iter().flat_map(expected).fold(f64::INFINITY, f64::min)
    }
}

/// Whether a cost is known and at most the limit.
fn is_within(ms: Option<f64>, limit: f64) -> bool {
    ms.is_some_and(|ms| ms <= limit)
}

impl Wanted {
    /// The usable families, that of the least error first; at least one. In place of a chosen one that is not usable there are those with
    /// which nothing is chosen; faces and points are in place of each other.
    fn families(&self) -> Vec<Family> {
        let all = [(self.has_rays, Family::Rays), (true, Family::Scaled), (self.has_points, Family::Points)];
        match (self.family, self.faces) {
            (Some(Family::Scaled), _) => vec![Family::Scaled],
            (Some(Family::Points | Family::Faces), _) if self.has_points => vec![Family::Points],
            (Some(Family::Faces), _) | (None | Some(Family::Points), Some(_)) => vec![Family::Faces],
            (Some(Family::Rays), _) if self.has_rays => vec![Family::Rays],
            (Some(Family::Details), _) if self.has_details => vec![Family::Details],
            _ => all.into_iter().filter_map(|(is_usable, family)| is_usable.then_some(family)).collect(),
        }
    }
}
