//! Integration of a segment by the formula of its transfer function, without a table.
//!
//! A segment is cut at the formula's knots. Between them extinction and colour times extinction are approximated, on pieces that are
//! halved until it makes no difference, by the cubics through four Gauss-Legendre points.

use super::integrate::{END_DEPTH, Sum};
use crate::render::medium::{Medium, Segment};
use crate::transfer::Formula;

/// Four-point Gauss-Legendre on [0, 1]: nodes and weights.
const PLACES: [f64; 4] =
    [0.069_431_844_202_973_71, 0.330_009_478_207_571_87, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];
const WEIGHTS: [f64; 4] =
    [0.173_927_422_568_726_92, 0.326_072_577_431_273_05, 0.326_072_577_431_273_05, 0.173_927_422_568_726_92];

/// Row i: weights of the values at the four nodes in the integral of their cubic from 0 to node i.
const CUMULATIVE: [[f64; 4]; 4] = [
    [0.086_963_711_284_363_46, -0.026_604_180_084_998_79, 0.012_627_462_689_404_72, -0.003_555_149_685_795_68],
    [0.188_118_117_499_868_06, 0.163_036_288_715_636_55, -0.027_880_428_602_470_9, 0.006_735_500_594_538_16],
    [0.167_191_921_974_188_78, 0.353_953_006_033_743_97, 0.163_036_288_715_636_55, -0.014_190_694_931_141_14],
    [0.177_482_572_254_522_6, 0.313_445_114_741_868_37, 0.352_676_757_516_271_87, 0.086_963_711_284_363_46],
];

/// Weights for the cubic's value in the middle.
const MIDDLE: [f64; 4] =
    [-0.092_326_598_440_728_82, 0.592_326_598_440_728_8, 0.592_326_598_440_728_8, -0.092_326_598_440_728_82];

/// Weights for the coefficient of its Legendre polynomial of degree three.
const CUBIC: [f64; 4] =
    [-0.371_027_003_401_947_33, 0.939_772_470_377_753, -0.939_772_470_377_753, 0.371_027_003_401_947_33];

/// Maximum optical depth of a piece: products of cubics and exponentials are then integrated to rounding.
const PIECE_DEPTH: f64 = 0.25;

/// Error tolerance of a piece, in optical depth or in a colour channel: a path has some thousands of pieces.
const PIECE_TOLERANCE: f64 = 1e-11;

/// Maximum halvings between two knots: at a step in between, a piece of this size has all the error.
const HALVINGS: u32 = 44;

/// Extinction, and each colour channel times extinction.
type Rates = [f64; 4];

impl Medium for Formula<'_> {
    type Ray = ();
    type Light = Sum;
    const HAS_VALUES: bool = false;

    fn pass(&self, (): &mut (), segment: &Segment, sum: &mut Sum) -> u32 {
        let ([near, far], [from, to], length) = (segment.part_scalar, segment.part, segment.length());
        let mut walk = Walk { sum, formula: self, near, rise: far - near, length };
        if near == far {
            walk.constant(0.0, 1.0, from);
            return 1;
        }
        let mut begin = 0.0;
        for end in cuts(self.knots(), near, far) {
            walk.stretch(begin, end, from + begin * (to - from));
            if walk.sum.depth_so_far > END_DEPTH {
                break;
            }
            begin = end;
        }
        1
    }
}

/// Optical depth of a piece that is `width` world units long.
fn depth(rates: &[Rates; 4], width: f64) -> f64 {
    rates.iter().zip(WEIGHTS).map(|(rates, weight)| weight * rates[0]).sum::<f64>() * width
}

/// Fractions of the way from `near` to `far` at the knots in between, in order, and 1.
fn cuts(knots: &[f64], near: f64, far: f64) -> Vec<f64> {
    let (lo, hi) = (near.min(far), near.max(far));
    let inside = knots.iter().skip(knots.partition_point(|&k| k <= lo)).take_while(|&&k| k < hi);
    let mut cuts: Vec<f64> = inside.map(|k| (k - near) / (far - near)).collect();
    if far < near {
        cuts.reverse();
    }
    cuts.push(1.0);
    cuts
}

/// Integration of a segment.
struct Walk<'a, 'b> {
    sum: &'a mut Sum,
    formula: &'a Formula<'b>,
    near: f64,
    rise: f64,
    length: f64,
}

impl Walk<'_, '_> {
    fn at(&self, u: f64) -> ([f64; 3], f64) {
        self.formula.eval(self.near + u * self.rise)
    }

    /// Integrates between two knots, from depth `depth` on.
    fn stretch(&mut self, begin: f64, end: f64, depth: f64) {
        if end <= begin {
            return;
        }
        let (_, middle) = self.at(0.5 * (begin + end));
        let is_opaque =
            middle == f64::INFINITY && PLACES.iter().all(|x| self.at(begin + x * (end - begin)).1 == f64::INFINITY);
        if is_opaque {
            self.constant(begin, end, depth);
            return;
        }
        let before = self.sum.depth_so_far;
        self.piece(begin, end, HALVINGS);
        if self.sum.depth_so_far > before {
            self.sum.visible_from = self.sum.visible_from.min(depth);
        }
    }

    /// Integrates a stretch of constant colour and extinction, opaque or not.
    fn constant(&mut self, begin: f64, end: f64, depth: f64) {
        let (rgb, tau) = self.at(0.5 * (begin + end));
        let total = tau * (end - begin) * self.length;
        // Infinite extinction over no length is NaN, and does not count.
        if total.is_nan() || total <= 0.0 {
            return;
        }
        self.sum.visible_from = self.sum.visible_from.min(depth);
        let light = (-self.sum.depth_so_far).exp() * -(-total).exp_m1();
        self.sum.rgb.iter_mut().zip(rgb).for_each(|(sum, c)| *sum += light * c);
        self.sum.depth_so_far += total;
    }

    /// Adds a piece, halved if one cubic is not accurate enough.
    fn piece(&mut self, begin: f64, end: f64, halvings: u32) {
        if self.sum.depth_so_far > END_DEPTH {
            return;
        }
        let width = (end - begin) * self.length;
        let rates = PLACES.map(|x| self.rates(begin + x * (end - begin)));
        if halvings > 0 && !self.is_smooth(begin, end, &rates) {
            let middle = 0.5 * (begin + end);
            self.piece(begin, middle, halvings - 1);
            self.piece(middle, end, halvings - 1);
            return;
        }
        if halvings == 0 && depth(&rates, width) > PIECE_DEPTH {
            // No cubic fits a function that touches opacity 1: its integral might be negative.
            self.constant(begin, end, f64::INFINITY);
            return;
        }
        let mut total = 0.0;
        for (i, rates_here) in rates.iter().enumerate() {
            let passed: f64 = CUMULATIVE[i].iter().zip(&rates).map(|(weight, rates)| weight * rates[0]).sum();
            let light = WEIGHTS[i] * width * (-(self.sum.depth_so_far + passed * width)).exp();
            self.sum.rgb.iter_mut().zip(&rates_here[1..]).for_each(|(sum, rate)| *sum += light * rate);
            total += WEIGHTS[i] * rates_here[0] * width;
        }
        self.sum.depth_so_far += total;
    }

    fn rates(&self, u: f64) -> Rates {
        let (rgb, tau) = self.at(u);
        // Within the last halving around a point that only touches opacity 1.
        let tau = tau.min(f64::MAX.sqrt());
        [tau, rgb[0] * tau, rgb[1] * tau, rgb[2] * tau]
    }

    /// Whether the cubics through these points are within the tolerance: in the contribution of their cubic terms, and in their error in
    /// the middle, which detects even kinks.
    fn is_smooth(&self, begin: f64, end: f64, rates: &[Rates; 4]) -> bool {
        let width = (end - begin) * self.length;
        let middle = self.rates(0.5 * (begin + end));
        let is_exact = |channel: usize| {
            let of = |weights: &[f64; 4]| -> f64 { weights.iter().zip(rates).map(|(w, r)| w * r[channel]).sum() };
            let off = (of(&MIDDLE) - middle[channel]).abs().max(of(&CUBIC).abs());
            off * width <= PIECE_TOLERANCE + f64::EPSILON * 16.0 * middle[channel].abs() * width
        };
        depth(rates, width) <= PIECE_DEPTH && (0..4).all(is_exact)
    }
}
