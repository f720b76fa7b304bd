//! The rungs of quality, family by family from the finest to the coarsest, and their expected costs before any measurement.

use super::{Family, Quality};
use crate::render::Contrast;

/// A way to draw a frame, with its cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rung {
    pub(super) quality: Quality,
    /// Cost relative to the first rung of its family until it is measured. Rather too low, so that the rung is tried and measured.
    pub(super) share: f64,
}

const fn rays(contrast: f32, share: f64) -> Rung {
    match Contrast::new(contrast) {
        Some(contrast) => Rung { quality: Quality::Rays(contrast), share },
        None => Rung { quality: Quality::Exact, share: 1.0 },
    }
}

/// A tenth of a frame does not depend on its pixels.
const fn scaled(share: f64) -> Rung {
    Rung { quality: Quality::Scaled(share), share: 0.1 + 0.9 * share * share }
}

/// A twentieth of a frame does not depend on its faces.
const fn faces(level: f64) -> Rung {
    Rung { quality: Quality::Faces(level), share: 0.05 + 0.95 * level }
}

/// A fiftieth of a frame does not depend on its points.
const fn points(share: f64) -> Rung {
    Rung { quality: Quality::Points(share), share: 0.02 + 0.98 * share }
}

/// Number of rungs of each family, without the exact one.
const COUNTS: [usize; 5] = [12, 8, 1, 13, 9];

/// All rungs: the exact one, then those of each family.
pub(super) const RUNGS: [Rung; 1 + COUNTS[0] + COUNTS[1] + COUNTS[2] + COUNTS[3] + COUNTS[4]] = [
    Rung { quality: Quality::Exact, share: 1.0 },
    // Shares of all rays as measured on dense transfer functions (docs/sampling.md), below.
    rays(0.002, 0.9),
    rays(0.003, 0.8),
    rays(0.005, 0.65),
    rays(0.007, 0.5),
    rays(0.01, 0.4),
    rays(0.02, 0.25),
    rays(0.03, 0.17),
    rays(0.05, 0.1),
    rays(0.07, 0.09),
    rays(0.1, 0.075),
    rays(0.14, 0.067),
    rays(0.2, 0.06),
    scaled(0.85),
    scaled(0.7),
    scaled(0.6),
    scaled(0.5),
    scaled(0.375),
    scaled(0.25),
    scaled(0.1875),
    scaled(0.125),
    // One ray in sixteen, each dearer than a ray of a whole image, and all rays in one row of thirty-two.
    Rung { quality: Quality::Details, share: 0.15 },
    faces(1.0),
    faces(0.75),
    faces(0.5),
    faces(0.375),
    faces(0.25),
    faces(0.18),
    faces(0.13),
    faces(0.1),
    faces(0.07),
    faces(0.05),
    faces(0.035),
    faces(0.026),
    faces(0.02),
    // As measured (docs/points.md, table 3.2). Of fewer there are too few cells to see anything: 0.0025 of all.
    points(0.75),
    points(0.5),
    points(0.375),
    points(0.25),
    points(0.18),
    points(0.13),
    points(0.1),
    points(0.07),
    points(0.05),
];

/// Index of the exact rung.
pub(super) const EXACT: usize = 0;

/// Index of the rung with details.
pub(super) const DETAILS: usize = 1 + COUNTS[0] + COUNTS[1];

/// Indices of the rungs of a family, finest first. The exact one is the finest of all families but faces.
pub(super) fn ladder(family: Family) -> impl Iterator<Item = usize> + Clone {
    let first = match family {
        Family::Rays => 1,
        Family::Scaled => 1 + COUNTS[0],
        Family::Details => DETAILS,
        Family::Faces => DETAILS + 1,
        Family::Points => DETAILS + 1 + COUNTS[3],
    };
    let has_exact = family != Family::Faces;
    has_exact.then_some(EXACT).into_iter().chain(first..first + COUNTS[family as usize])
}

/// The family of a rung; `None` for the exact one.
pub(super) fn family_of(rung: usize) -> Option<Family> {
    Family::ALL.into_iter().find(|&family| rung != EXACT && ladder(family).any(|of| of == rung))
}

/// The rung nearest to a quality.
pub(super) fn nearest(drawn: Quality) -> usize {
    let knob = |quality: Quality| match quality {
        Quality::Exact | Quality::Details => f64::INFINITY,
        Quality::Rays(contrast) => f64::from(contrast.get()).ln(),
        Quality::Scaled(share) => share.ln(),
        Quality::Faces(share) | Quality::Points(share) => share.max(f64::MIN_POSITIVE).ln(),
    };
    let distance = |quality: Quality| match std::mem::discriminant(&quality) == std::mem::discriminant(&drawn) {
        true if quality == drawn => 0.0,
        true => (knob(quality) - knob(drawn)).abs(),
        false => f64::INFINITY,
    };
    let distances = RUNGS.iter().map(|rung| distance(rung.quality)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(EXACT, |(at, _)| at)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ladders_go_from_fine_to_coarse_and_cheap_and_each_rung_is_the_nearest_to_itself() {
        for family in Family::ALL {
            let ladder: Vec<usize> = ladder(family).collect();
            let shares: Vec<f64> = ladder.iter().map(|&at| RUNGS[at].share).collect();
            assert!(shares[0] == 1.0 && shares.windows(2).all(|pair| pair[0] > pair[1]), "{family}: {shares:?}");
            for &at in &ladder {
                assert_eq!(nearest(RUNGS[at].quality), at);
                assert_eq!(family_of(at), (at != EXACT).then_some(family));
            }
        }
        assert_eq!(RUNGS[nearest(Quality::Faces(0.4))].quality, Quality::Faces(0.375));
        assert_eq!(RUNGS[nearest(Quality::Faces(0.0))].quality, Quality::Faces(0.02));
        assert_eq!(RUNGS[nearest(Quality::Points(1.0))].quality, Quality::Points(0.75));
        assert_eq!(RUNGS[nearest(Quality::Points(0.0))].quality, Quality::Points(0.05));
        let all: usize = Family::ALL.into_iter().map(|family| ladder(family).filter(|&at| at != EXACT).count()).sum();
        assert_eq!(all + 1, RUNGS.len());
    }
}
