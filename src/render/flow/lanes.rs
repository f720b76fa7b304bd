//! What a splat shows in eight pixels side by side.
//!
//! Loops over arrays, which the compiler makes vectors of. Places are f64, for splats whose centre is far outside of the image; the window and
//! the pattern are f32: their errors of 1e-6 are far below those of a fragment's eight bits on a screen, and below the bounds against the judge.

use super::IconSums;
use super::splat::{END, Splat};
use crate::optics::exp_neg;

/// Pixels side by side.
pub(super) const LANES: usize = 8;

/// A number for each of the pixels.
pub(super) type Eight = [f64; LANES];

/// A row of pixels through a splat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Distance of the row's middle below the centre, in pixels.
    dy: f64,
    /// The place beside the centre where the squared distance in widths is least, and that distance.
    middle: f64,
    least: f64,
}

/// The icon of a splat, and the one with which it is mixed, if any.
pub(super) type IconsOfSplat<'a> = (&'a IconSums, Option<&'a IconSums>);

/// What a splat shows in pixels side by side.
pub(super) struct Seen {
    /// The kernel's window, 0 to 1.
    pub(super) window: [f32; LANES],
    /// Opacity of the pattern in it, if the style's is 1.
    pub(super) pattern: [f32; LANES],
}

impl Splat {
    /// The row whose middle is `dy` below the centre.
    #[inline(always)]
    pub(super) fn line(&self, dy: f64) -> Line {
        let [xx, xy, _] = self.form;
        // The least squared distance without a difference that a needle would lose.
        Line { dy, middle: -xy / xx * dy, least: (END * dy / self.half_height).powi(2) }
    }

    /// Where a row enters and leaves the window, beside the centre.
    #[inline(always)]
    pub(super) fn ends(&self, line: &Line) -> [f64; 2] {
        let half = ((END * END - line.least).max(0.0) / self.form[0]).sqrt();
        [line.middle - half, line.middle + half]
    }

    /// Of all icons of a scene those of the splat.
    pub(super) fn icons_of<'a>(&self, all: &[&'a IconSums]) -> IconsOfSplat<'a> {
        let mix = self.mix;
        (all[mix.icon], (mix.share > 0.0).then(|| all[mix.icon + 1]))
    }

    /// What it shows in pixels whose middles are at `dx` beside the centre.
    #[inline(always)]
    pub(super) fn seen(&self, dx: &Eight, line: &Line, icons: IconsOfSplat) -> Seen {
        let mut pattern = self.pattern_of(dx, line, icons.0);
        if let Some(next) = icons.1 {
            let (next, share) = (self.pattern_of(dx, line, next), self.mix.share as f32);
            for l in 0..LANES {
                pattern[l] += share * (next[l] - pattern[l]);
            }
        }
        let mut squared = [0.0; LANES];
        for l in 0..LANES {
            let beside = dx[l] - line.middle;
            squared[l] = (self.form[0] * (beside * beside) + line.least) as f32;
        }
        let mut seen = [0.0; LANES];
        for l in 0..LANES {
            seen[l] = window(squared[l]);
        }
        for l in 0..LANES {
            pattern[l] *= seen[l];
        }
        Seen { window: seen, pattern }
    }

    /// An icon, or its mean where the vector is nearly along the ray.
    #[inline(always)]
    fn pattern_of(&self, dx: &Eight, line: &Line, icon: &IconSums) -> [f32; LANES] {
        let (whole, contrast) = (icon.whole() as f32, self.contrast as f32);
        if contrast == 0.0 {
            return [whole; LANES];
        }
        let ([along, across], [s0, t0]) = (self.frequency, self.phase);
        let (x, y, dy) = (self.along.x, self.along.y, line.dy);
        let (mut s, mut t) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            s[l] = (dx[l] * x + dy * y) * along + s0;
            t[l] = (dx[l] * y - dy * x) * across + t0;
        }
        let mut pattern = icon.means(&s, &t, self.width, self.level);
        for of in &mut pattern {
            *of = whole + contrast * (*of - whole);
        }
        pattern
    }
}

/// exp(-END^2 / 2), where the window ends.
const LEAST: f32 = 0.043_936_934;

/// The kernel at a squared distance in widths: a Gaussian that ends at [`END`] without an edge.
#[inline(always)]
pub(in crate::render) fn window(squared: f32) -> f32 {
    let above = exp_neg(0.5 * squared) - LEAST;
    if above > 0.0 { above * (1.0 / (1.0 - LEAST)) } else { 0.0 }
}

#[cfg(test)]
impl Splat {
    /// The opacity of a pattern of opacity 1 at a place beside the centre, of squared distance `squared` in widths.
    pub(super) fn mixed(&self, [dx, dy]: [f64; 2], squared: f64, icons: IconsOfSplat) -> f64 {
        let at = Line { dy, middle: dx, least: squared };
        f64::from(self.seen(&[dx; LANES], &at, icons).pattern[0])
    }

    /// The opacity of one icon.
    pub(super) fn opacity(&self, place: [f64; 2], squared: f64, icon: &IconSums) -> f64 {
        self.mixed(place, squared, (icon, None))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_is_a_gaussian_that_ends_without_an_edge() {
        let least = (-0.5 * END * END).exp();
        assert_eq!(LEAST, least as f32);
        for i in 0..1000 {
            let squared = 7.0 * f64::from(i) / 1000.0;
            let expected = (((-0.5 * squared).exp() - least) / (1.0 - least)).max(0.0);
            // An exponential off by 2e-7, and a rounding each of difference and product.
            assert!((f64::from(window(squared as f32)) - expected).abs() < 5e-7, "{squared}");
        }
        assert_eq!([6.26, 1e30, f32::INFINITY, f32::NAN].map(window), [0.0; 4]);
    }
}
