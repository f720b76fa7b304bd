//! Pieces: the algebra that blending rules are made of.
//!
//! The real axis is cut into pieces; in each of them every channel (red, green, blue, value) is a polynomial of degree at most two in the
//! fraction 0..=1 between its ends. Colours and values of a curve are linear; the product of both, a colour weighted by its opacity, is
//! quadratic. Sum, weight, mix, minimum, maximum, difference and quantisation map pieces to pieces, exactly but for rounding: only cuts are
//! added, where two channels cross, at roots of quadratics. So nothing is approximated until colours are divided by opacity again, once, at
//! the end ([`Pieces::to_curve`]).
//!
//! A polynomial is kept as its Bernstein coefficients [p0, p1, p2]: p0 and p2 are its values at the ends, a constant stays
//! constant when it is cut, and neighbours that come from one cut have the same value there, bit for bit.

use super::TransferError;
use super::color_map::lerp;
use super::profile::{ProfilePoint, Side};
use super::table::CURVE_PART;
use super::tolerance::COLOR_TOLERANCE;
use serde::{Deserialize, Serialize};

/// How colours enter the blending rules of an ensemble.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorWeighting {
    /// Colours as they are.
    #[default]
    Plain,
    /// Colours times opacity. The result is divided by the resulting opacity, and at most 1.
    Opacity,
}

/// Bernstein coefficients of a polynomial of degree two over 0..=1.
pub(super) type Quadratic = [f64; 3];

/// Index of the opacity or optical depth among the four channels; the others are red, green and blue.
pub(super) const VALUE: usize = 3;

/// One piece. The first one starts at minus infinity, the last one ends at infinity; these are constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Piece {
    pub from: f64,
    pub to: f64,
    /// Red, green, blue (or these times the value, if weighted) and value.
    pub channels: [Quadratic; 4],
}

/// The real axis in pieces, each of which begins where the one before ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pieces(pub Vec<Piece>);

/// Largest error of a colour by one division: a quarter of what curves may be off ([`CURVE_PART`]). There are at most two, in an ensemble
/// and between two keyframes.
pub(super) const DIVISION_TOLERANCE: f64 = 0.25 * CURVE_PART * 0.5 * COLOR_TOLERANCE;

/// Most points of a curve. Rules that fold a curve repeatedly make it grow exponentially with the number of members.
pub(super) const MOST_POINTS: usize = 1 << 18;

/// Rounding of a difference of channels, as a share of the larger one. A coefficient has gone through a cut (two nested
/// interpolations, at most three roundings each), a product or sum (one) and the difference itself (one).
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl Piece {
    /// The value of a channel at `f` in 0..=1.
    pub(super) fn at(&self, channel: usize, f: f64) -> f64 {
        eval(&self.channels[channel], f)
    }

    /// The part of the piece between two scalars.
    fn part(&self, from: f64, to: f64) -> Piece {
        if self.from.is_infinite() || self.to.is_infinite() || (from == self.from && to == self.to) {
            return Piece { from, to, channels: self.channels };
        }
        let width = self.to - self.from;
        let share = |s: f64| if s == self.to { 1.0 } else { (s - self.from) / width };
        let (a, b) = (share(from), share(to));
        Piece { from, to, channels: self.channels.map(|q| part(&q, a, b)) }
    }

    /// The scalar at fraction `f` in 0..=1.
    fn scalar(&self, f: f64) -> f64 {
        lerp(self.from, self.to, f)
    }

    /// A piece of the same extent, with other channels.
    pub(super) fn with(&self, channel: impl Fn(usize) -> Quadratic) -> Piece {
        Piece { channels: std::array::from_fn(channel), ..*self }
    }
}

/// The value of a polynomial at `f`, by de Casteljau; exact at both ends.
pub(super) fn eval(&[p0, p1, p2]: &Quadratic, f: f64) -> f64 {
    lerp(lerp(p0, p1, f), lerp(p1, p2, f), f)
}

/// The polynomial restricted to `a`..`b`, by blossoming.
fn part(q: &Quadratic, a: f64, b: f64) -> Quadratic {
    let &[p0, p1, p2] = q;
    [eval(q, a), lerp(lerp(p0, p1, a), lerp(p1, p2, a), b), eval(q, b)]
}

impl Pieces {
    /// The pieces of a curve of these points, sorted by scalar, with colours times opacity if weighted.
    pub(super) fn of(points: &[ProfilePoint], weighting: ColorWeighting) -> Self {
        let constant = |from, to, side: Side| piece(from, to, &side, &side, weighting);
        let mut pieces = Vec::with_capacity(points.len() + 1);
        if let (Some(first), Some(last)) = (points.first(), points.last()) {
            pieces.push(constant(f64::NEG_INFINITY, first.scalar, first.left));
            pieces
                .extend(points.windows(2).map(|p| piece(p[0].scalar, p[1].scalar, &p[0].right, &p[1].left, weighting)));
            pieces.push(constant(last.scalar, f64::INFINITY, last.right));
        }
        Self(pieces)
    }

    /// The points of the curve; weighted colours are divided by opacity, within [`DIVISION_TOLERANCE`].
    ///
    /// # Errors
    /// If there are more than [`MOST_POINTS`].
    pub(super) fn to_curve(&self, weighting: ColorWeighting) -> Result<Vec<ProfilePoint>, TransferError> {
        let mut sides: Vec<(f64, [Side; 2])> = Vec::new();
        for piece in &self.0 {
            match weighting {
                ColorWeighting::Plain => sides.push(plain_sides(piece)),
                ColorWeighting::Opacity => divide(piece, &mut sides)?,
            }
        }
        if sides.len() > MOST_POINTS {
            return Err(TransferError::TooManyPoints { most: MOST_POINTS });
        }
        Ok(points_of(&sides))
    }

    /// The points of a curve with plain colours.
    pub(super) fn plain_points(&self) -> Vec<ProfilePoint> {
        points_of(&self.0.iter().map(plain_sides).collect::<Vec<_>>())
    }

    /// Combines two sets of pieces by `rule`, cut at the ends of either and at the cuts of `rule`.
    pub(super) fn combine<R: Rule>(&self, other: &Pieces, rule: &R) -> Pieces {
        let mut out = Vec::with_capacity(self.0.len() + other.0.len());
        let (mut i, mut j, mut from) = (0, 0, f64::NEG_INFINITY);
        while let (Some(a), Some(b)) = (self.0.get(i), other.0.get(j)) {
            let to = a.to.min(b.to);
            apply(&a.part(from, to), &b.part(from, to), rule, &mut out);
            i += usize::from(a.to == to);
            j += usize::from(b.to == to);
            from = to;
        }
        Pieces(out)
    }

    /// Combines each piece by `rule` with the one that `other` makes of it.
    pub(super) fn combine_with<R: Rule>(&self, other: impl Fn(&Piece) -> Piece, rule: &R) -> Pieces {
        let mut out = Vec::with_capacity(self.0.len());
        self.0.iter().for_each(|piece| apply(piece, &other(piece), rule, &mut out));
        Pieces(out)
    }

    /// Applies `change` to each piece.
    pub(super) fn map(&self, change: impl Fn(&Piece) -> Piece) -> Pieces {
        Pieces(self.0.iter().map(change).collect())
    }

    /// Whether every number is finite.
    pub(super) fn is_finite(&self) -> bool {
        self.0.iter().flat_map(|p| p.channels.as_flattened()).all(|x| x.is_finite())
    }
}

/// How two pieces of the same extent are combined.
pub(super) trait Rule {
    /// The channels whose result has no steps if the pieces have none.
    const CONTINUOUS: [bool; 4] = [true; 4];

    /// Collects the fractions in 0..1 at which the pieces have to be cut: by default where a channel of one crosses that of the other.
    fn cuts(&self, a: &Piece, b: &Piece, cuts: &mut Vec<f64>) {
        a.channels.iter().zip(&b.channels).for_each(|(x, y)| crossings(x, y, cuts));
    }

    /// The result for two pieces without such cuts.
    fn put_together(&self, a: &Piece, b: &Piece) -> Piece;
}

/// Appends the combination of two pieces of the same extent.
fn apply<R: Rule>(a: &Piece, b: &Piece, rule: &R, out: &mut Vec<Piece>) {
    let mut cuts = Vec::new();
    rule.cuts(a, b, &mut cuts);
    cuts.sort_by(f64::total_cmp);
    let mut from = a.from;
    for scalar in cuts.iter().map(|&f| a.scalar(f)).chain([a.to]) {
        // Cuts that round to the same double, or to an end, are merged.
        if scalar <= from {
            continue;
        }
        let mut made = rule.put_together(&a.part(from, scalar), &b.part(from, scalar));
        if from > a.from
            && let Some(before) = out.last_mut()
        {
            join(before, &mut made, R::CONTINUOUS);
        }
        out.push(made);
        from = scalar;
    }
}

/// Makes two pieces meet in channels that differ only by rounding; a constant one stays constant.
fn join(left: &mut Piece, right: &mut Piece, channels: [bool; 4]) {
    for c in (0..4).filter(|&c| channels[c]) {
        let (l, r) = (&mut left.channels[c], &mut right.channels[c]);
        if l[0] == l[1] && l[1] == l[2] { r[0] = l[2] } else { l[2] = r[0] }
    }
}

fn piece(from: f64, to: f64, a: &Side, b: &Side, weighting: ColorWeighting) -> Piece {
    let linear = |x: f64, y: f64| [x, 0.5 * x + 0.5 * y, y];
    let channel = |c: usize| match weighting {
        _ if c == VALUE => linear(a.value, b.value),
        ColorWeighting::Plain => linear(a.rgb[c], b.rgb[c]),
        // The product of two linear functions.
        ColorWeighting::Opacity => {
            let crossed = 0.5 * (a.rgb[c] * b.value) + 0.5 * (b.rgb[c] * a.value);
            [a.rgb[c] * a.value, crossed, b.rgb[c] * b.value]
        }
    };
    Piece { from, to, channels: std::array::from_fn(channel) }
}

/// The start of a piece, and its colour and value at both ends.
fn plain_sides(piece: &Piece) -> (f64, [Side; 2]) {
    let side = |i: usize| {
        let [r, g, b, value] = piece.channels.map(|q| q[i]);
        Side { rgb: [r, g, b], value }
    };
    (piece.from, [side(0), side(2)])
}

/// The points between linear pieces.
fn points_of(sides: &[(f64, [Side; 2])]) -> Vec<ProfilePoint> {
    let point = |pair: &[(f64, [Side; 2])]| ProfilePoint { scalar: pair[1].0, left: pair[0].1[1], right: pair[1].1[0] };
    sides.windows(2).map(point).collect()
}

/// Appends the linear pieces of a weighted piece whose colours are divided by its value, a.
///
/// With p the weighted colour, p / a is a linear function plus R / a, where R is the constant remainder of the division of p by a. A chord
/// of the linear function has no error, and that of 1 / a between a0 and a1 is farthest off at the root
/// of a0 a1, by (1 / sqrt(a0) - 1 / sqrt(a1))^2. With R = (p0 a1^2 - 2 p1 a0 a1 + p2 a0^2) / (a1 - a0)^2, the value of p
/// where a is zero, and with the colours c0 = p0 / a0 and c1 = p2 / a1 at the ends, their product is
///
///   |c0 a1 - 2 p1 + c1 a0| / (sqrt(a0) + sqrt(a1))^2,
///
/// which also holds for a0 = a1. Where a0 is zero p0 is, too; the colour is linear then, and its limit is c0 = 2 p1 / a1.
/// Where both are, the piece is transparent and black, whatever colours rounding has left.
///
/// # Errors
/// If there are more than [`MOST_POINTS`].
fn divide(piece: &Piece, sides: &mut Vec<(f64, [Side; 2])>) -> Result<(), TransferError> {
    if sides.len() > MOST_POINTS {
        return Err(TransferError::TooManyPoints { most: MOST_POINTS });
    }
    let ([a0, _, a1], [c0, c1]) = (piece.channels[VALUE], divided(piece));
    let square = (a0.sqrt() + a1.sqrt()).powi(2);
    let fits = |c: usize| {
        let error = (c0[c] * a1 - 2.0 * piece.channels[c][1] + c1[c] * a0).abs();
        error <= DIVISION_TOLERANCE * square
    };
    let middle = 0.5 * piece.from + 0.5 * piece.to;
    let splits = middle.is_finite() && piece.from < middle && middle < piece.to;
    let is_transparent = a0 == 0.0 && a1 == 0.0;
    if is_transparent || (0..VALUE).all(fits) || !splits {
        sides.push((piece.from, [Side { rgb: c0, value: a0 }, Side { rgb: c1, value: a1 }]));
        return Ok(());
    }
    divide(&piece.part(piece.from, middle), sides)?;
    divide(&piece.part(middle, piece.to), sides)
}

/// The colours at both ends of a weighted piece; black where it is transparent throughout.
fn divided(piece: &Piece) -> [[f64; 3]; 2] {
    let [a0, _, a1] = piece.channels[VALUE];
    let end = |p: f64, middle: f64, a: f64, other: f64| {
        let colour = if a > 0.0 {
            p / a
        } else if other > 0.0 {
            2.0 * middle / other
        } else {
            0.0
        };
        colour.clamp(0.0, 1.0)
    };
    let at = |i: usize, a: f64, other: f64| {
        std::array::from_fn(|c| end(piece.channels[c][i], piece.channels[c][1], a, other))
    };
    [at(0, a0, a1), at(2, a1, a0)]
}

/// `a - b`, and the bound below which it may be rounding.
fn difference(a: &Quadratic, b: &Quadratic) -> (Quadratic, f64) {
    let largest = a.iter().chain(b).fold(0.0, |m: f64, x| m.max(x.abs()));
    (std::array::from_fn(|i| a[i] - b[i]), ROUNDING * largest)
}

/// Whether `a` lies below `b`, which it does not cross, except where both touch. Compared by integrals, since at any one point they may
/// touch.
pub(super) fn is_below(a: &Quadratic, b: &Quadratic) -> bool {
    (a[0] - b[0]) + (a[1] - b[1]) + (a[2] - b[2]) < 0.0
}

/// The absolute difference of two polynomials that do not cross; zero where it may be rounding.
pub(super) fn absolute_difference(a: &Quadratic, b: &Quadratic) -> Quadratic {
    let (d, rounding) = difference(a, b);
    let sign = if is_below(a, b) { -1.0 } else { 1.0 };
    let snapped = d.map(|x| if x.abs() <= rounding { 0.0 } else { sign * x });
    // Both ends are differences of curves that do not cross; only rounding can make one negative.
    [snapped[0].max(0.0), snapped[1], snapped[2].max(0.0)]
}

/// Collects the fractions in 0..1 where `a` crosses `b`. Where they only touch, or differ by no more than rounding on one side, they do not
/// cross.
pub(super) fn crossings(a: &Quadratic, b: &Quadratic, cuts: &mut Vec<f64>) {
    let (d, rounding) = difference(a, b);
    let mut previous: Option<(f64, f64)> = None;
    for f in stops(&d) {
        let value = eval(&d, f);
        if value.abs() <= rounding {
            continue;
        }
        if let Some((before, v)) = previous
            && (v < 0.0) != (value < 0.0)
        {
            cuts.push(root(&d, before, f));
        }
        previous = Some((f, value));
    }
}

/// Collects the fractions in 0..1 where a channel reaches one of the levels from `level(0)` on; `level` and `index`, the number of levels
/// at or below a value, are inverse.
pub(super) fn level_cuts(q: &Quadratic, index: impl Fn(f64) -> i64, level: impl Fn(i64) -> f64, cuts: &mut Vec<f64>) {
    let stops: Vec<f64> = stops(q).collect();
    for pair in stops.windows(2) {
        let (a, b) = (eval(q, pair[0]), eval(q, pair[1]));
        for i in index(a.min(b))..index(a.max(b)) {
            let level = level(i);
            cuts.push(root(&q.map(|p| p - level), pair[0], pair[1]));
        }
    }
}

/// 0, the extremum inside 0..1 if there is one, and 1: the polynomial is monotone in between.
fn stops(&[p0, p1, p2]: &Quadratic) -> impl Iterator<Item = f64> + use<> {
    let turn = (p0 - p1) / (p0 - 2.0 * p1 + p2);
    let inner = (turn > 0.0 && turn < 1.0).then_some(turn);
    [Some(0.0), inner, Some(1.0)].into_iter().flatten()
}

/// The root of a polynomial that is monotone from `from` to `to` and changes sign there.
fn root(&[p0, p1, p2]: &Quadratic, from: f64, to: f64) -> f64 {
    // a f^2 + 2 b f + p0 = 0, solved without cancellation.
    let (a, b) = (p0 - 2.0 * p1 + p2, p1 - p0);
    let q = -(b + (b * b - a * p0).max(0.0).sqrt().copysign(b));
    let off = |f: f64| if f.is_nan() { f64::INFINITY } else { (from - f).max(f - to) };
    let (first, second) = (q / a, p0 / q);
    let nearest = if off(first) < off(second) { first } else { second };
    if nearest.is_nan() { 0.5 * (from + to) } else { nearest.clamp(from, to) }
}

#[cfg(test)]
#[path = "pieces_tests.rs"]
mod tests;
