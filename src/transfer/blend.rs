//! Blending rules (dissertation 7.3.1), for curves and for values at one scalar.

use super::opacity::OpacityKind;
use super::pieces::{
    ColorWeighting, Piece, Pieces, Quadratic, Rule, VALUE, absolute_difference, crossings, is_below, level_cuts,
};
use super::profile::Side;
use serde::{Deserialize, Serialize};

/// How a member of an ensemble is blended with the result of those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Blend {
    /// C = C1 + C2, a = a1 + a2; then each at most 1 (an optical depth, of opacity kind `extinction`, is unbounded).
    #[default]
    Add,
    /// C = max(C1, C2), a = min(a1, a2).
    And,
    /// (x and not y) or (not x and y), bit by bit, on levels round(255 C) and round(255 a), as printed. Only for opacity
    /// kind `alpha`: an optical depth has no levels.
    Xor8,
    /// C = |C1 - C2|, a = |a1 - a2|: exclusive or where both are 0 or 1, and continuous.
    Xor,
}

/// Levels of [`Blend::Xor8`] above 0.
const LEVELS: f64 = 255.0;

impl Blend {
    /// Applies the rule to curves. Depths whose sum overflows are not finite in the result.
    pub(super) fn pieces(self, a: &Pieces, b: &Pieces, weighting: ColorWeighting, kind: OpacityKind) -> Pieces {
        let blended = match self {
            Self::Add => {
                let sum = a.combine(b, &Sum);
                if !sum.is_finite() {
                    return sum; // for the caller to find
                }
                let one = |c: usize| weighting == ColorWeighting::Plain || c == VALUE;
                let bounded = |c: usize| one(c) && !(c == VALUE && kind == OpacityKind::Extinction);
                sum.combine_with(|p| p.with(|c| if bounded(c) { [1.0; 3] } else { p.channels[c] }), &Least)
            }
            Self::And => a.combine(b, &And),
            Self::Xor => a.combine(b, &Difference),
            Self::Xor8 => a.combine(b, &Levels),
        };
        match weighting {
            ColorWeighting::Plain => blended,
            // A colour is at most 1, and so a weighted one at most the opacity.
            ColorWeighting::Opacity => blended.combine_with(|p| p.with(|_| p.channels[VALUE]), &Least),
        }
    }

    /// Applies the rule's formula to the values at one scalar.
    pub(super) fn sides(self, a: &Side, b: &Side, weighting: ColorWeighting, kind: OpacityKind) -> Side {
        let weigh = |side: &Side| match weighting {
            ColorWeighting::Plain => side.rgb,
            ColorWeighting::Opacity => side.rgb.map(|c| c * side.value),
        };
        let of = |color: fn(f64, f64) -> f64, value: fn(f64, f64) -> f64| {
            let (x, y) = (weigh(a), weigh(b));
            Side { rgb: std::array::from_fn(|c| color(x[c], y[c])), value: value(a.value, b.value) }
        };
        let mut side = match self {
            Self::Add => of(|x, y| x + y, |x, y| x + y),
            Self::And => of(f64::max, f64::min),
            Self::Xor => of(|x, y| (x - y).abs(), |x, y| (x - y).abs()),
            Self::Xor8 => of(xor8, xor8),
        };
        if kind == OpacityKind::Alpha {
            side.value = side.value.min(1.0);
        }
        divided(side, weighting)
    }
}

/// Interpolates from `a` (`f` = 0) to `b` (`f` = 1) at one scalar by the formula; [`Mix`] does it for curves.
pub(super) fn mix_sides(a: &Side, b: &Side, f: f64, weighting: ColorWeighting) -> Side {
    if f.is_nan() || f <= 0.0 || a == b {
        return *a;
    }
    if f >= 1.0 {
        return *b;
    }
    match weighting {
        ColorWeighting::Plain => Side::mix(a, b, f),
        ColorWeighting::Opacity => {
            let weighted = |side: &Side| Side { rgb: side.rgb.map(|c| c * side.value), ..*side };
            divided(Side::mix(&weighted(a), &weighted(b), f), weighting)
        }
    }
}

impl Side {
    /// The side as blended alone: black where it is transparent, if colours are weighted.
    pub(super) fn alone(self, weighting: ColorWeighting) -> Side {
        if weighting == ColorWeighting::Opacity && self.value == 0.0 { Side { rgb: [0.0; 3], ..self } } else { self }
    }
}

/// The colour of a blended side, divided by opacity if weighted; at most 1.
fn divided(side: Side, weighting: ColorWeighting) -> Side {
    let divisor = match weighting {
        ColorWeighting::Plain => 1.0,
        ColorWeighting::Opacity => side.value,
    };
    let rgb = side.rgb.map(|c| if divisor > 0.0 { (c / divisor).min(1.0) } else { 0.0 });
    Side { rgb, ..side }
}

/// round(255 x), x in 0..=1.
fn level(x: f64) -> u8 {
    (LEVELS * x).round() as u8
}

fn xor8(x: f64, y: f64) -> f64 {
    let (x, y) = (level(x), level(y));
    f64::from((x & !y) | (!x & y)) / LEVELS
}

struct Sum;

impl Rule for Sum {
    fn cuts(&self, _: &Piece, _: &Piece, _: &mut Vec<f64>) {}

    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        a.with(|c| std::array::from_fn(|i| a.channels[c][i] + b.channels[c][i]))
    }
}

/// Interpolates from the first piece at 0 to the second at 1.
pub(super) struct Mix(pub f64);

impl Rule for Mix {
    fn cuts(&self, _: &Piece, _: &Piece, _: &mut Vec<f64>) {}

    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        let mix = |x: f64, y: f64| super::color_map::lerp(x, y, self.0);
        a.with(|c| std::array::from_fn(|i| mix(a.channels[c][i], b.channels[c][i])))
    }
}

fn least(x: &Quadratic, y: &Quadratic) -> Quadratic {
    if is_below(x, y) { *x } else { *y }
}

fn greatest(x: &Quadratic, y: &Quadratic) -> Quadratic {
    if is_below(x, y) { *y } else { *x }
}

/// The minimum of each channel.
struct Least;

impl Rule for Least {
    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        a.with(|c| least(&a.channels[c], &b.channels[c]))
    }
}

struct And;

impl Rule for And {
    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        let pick = |c: usize| if c == VALUE { least } else { greatest };
        a.with(|c| pick(c)(&a.channels[c], &b.channels[c]))
    }
}

struct Difference;

impl Rule for Difference {
    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        a.with(|c| absolute_difference(&a.channels[c], &b.channels[c]))
    }
}

/// Cuts where the level of any channel changes; each part is constant, with the levels of its middle.
struct Levels;

impl Rule for Levels {
    const CONTINUOUS: [bool; 4] = [false; 4];

    fn cuts(&self, a: &Piece, b: &Piece, cuts: &mut Vec<f64>) {
        let boundary = |i: i64| (i as f64 + 0.5) / LEVELS;
        let index = |x: f64| i64::from(level(x));
        a.channels.iter().chain(&b.channels).for_each(|q| level_cuts(q, index, boundary, cuts));
    }

    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        a.with(|c| [xor8(a.at(c, 0.5), b.at(c, 0.5)); 3])
    }
}

/// Whichever piece has the larger value, with its colour; the second one where they are equal.
pub(super) struct MoreOpaque;

impl Rule for MoreOpaque {
    const CONTINUOUS: [bool; 4] = [false, false, false, true];

    fn cuts(&self, a: &Piece, b: &Piece, cuts: &mut Vec<f64>) {
        crossings(&a.channels[VALUE], &b.channels[VALUE], cuts);
    }

    fn put_together(&self, a: &Piece, b: &Piece) -> Piece {
        if is_below(&b.channels[VALUE], &a.channels[VALUE]) { *a } else { *b }
    }
}

#[cfg(test)]
#[path = "blend_tests.rs"]
mod tests;
