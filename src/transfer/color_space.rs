//! Colour spaces in which a map may interpolate, and their refinement to piecewise-linear RGB.
//!
//! HSV, Lab and Diverging are VTK's (`vtkColorTransferFunction`): HSV without wrapping; Lab over sRGB with D65 white
//! (0.9505, 1, 1.089); Diverging after K. Moreland, "Diverging Color Maps for Scientific Visualization" (ISVC 2009), in
//! Msh, the polar form of Lab.

use super::color_map::{ColorPoint, mix};
use rayon::prelude::*;

/// How colours are interpolated between two points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorSpace {
    /// Linear in RGB.
    Rgb,
    /// Linear in hue, saturation and value; hue does not wrap around.
    Hsv,
    /// Linear in CIE L*a*b*.
    Lab,
    /// Moreland's diverging maps.
    Diverging,
}

/// Refined maps stay within this of the formula, so that the table built from them keeps most of its own tolerance.
const REFINEMENT: f64 = 1.0 / 16_384.0;

/// An interval between two points is halved at most this often; sRGB's slope at black needs about ten.
const MAX_HALVINGS: u32 = 14;

/// A map of many points is halved less often, so that it has at most this many pieces, or as many as points: with so many, neighbours are
/// indistinguishable. (ParaView samples every map at a thousand positions.)
const MOST_PIECES: usize = 1 << 18;

/// White point D65.
const WHITE: [f64; 3] = [0.9505, 1.0, 1.089];

/// The colour space that ParaView calls `name`.
pub(super) fn from_name(name: &str) -> Option<ColorSpace> {
    Some(match name.to_ascii_lowercase().as_str() {
        "rgb" => ColorSpace::Rgb,
        "hsv" => ColorSpace::Hsv,
        "lab" | "cielab" => ColorSpace::Lab,
        "diverging" => ColorSpace::Diverging,
        _ => return None,
    })
}

/// Points between which linear RGB is within [`REFINEMENT`] of `space`; coarser if there are very many points.
pub(super) fn to_linear_rgb(space: ColorSpace, points: &[ColorPoint]) -> Vec<ColorPoint> {
    let halvings = (MOST_PIECES / points.len().max(1)).checked_ilog2().unwrap_or(0).min(MAX_HALVINGS);
    let ways: Vec<Option<Vec<Place>>> = points.par_windows(2).map(|pair| way_between(space, pair, halvings)).collect();
    let mut refined: Vec<ColorPoint> = points.first().copied().into_iter().collect();
    for (pair, way) in points.windows(2).zip(ways) {
        let at = |&(f, rgb): &Place| ColorPoint { position: pair[0].position * (1.0 - f) + pair[1].position * f, rgb };
        if let Some([first, inner @ .., last]) = way.as_deref() {
            begin(at(first), &mut refined);
            refined.extend(inner.iter().map(at));
            if !is_close(last.1, pair[1].rgb) {
                refined.push(at(last));
            }
        }
        refined.push(pair[1]);
    }
    refined
}

/// The places from one point to the next between which RGB is linear, both ends included; `None` if it is linear throughout.
fn way_between(space: ColorSpace, pair: &[ColorPoint], halvings: u32) -> Option<Vec<Place>> {
    if space == ColorSpace::Rgb || pair[0].position >= pair[1].position {
        return None;
    }
    let way = Way::new(space, pair[0].rgb, pair[1].rgb);
    let ends = [(0.0, way.at(0.0)), (1.0, way.at(1.0))];
    let mut places = vec![ends[0]];
    halve(&way, ends, halvings, &mut places);
    places.push(ends[1]);
    Some(places)
}

/// Begins an interval whose formula may not begin with its point's colour: a diverging map turns the hue of grayish points toward that of
/// the other end. The point then becomes a step.
fn begin(first: ColorPoint, refined: &mut Vec<ColorPoint>) {
    let before = refined.len().checked_sub(2).and_then(|i| refined.get(i)).map(|p| p.position);
    match refined.last_mut() {
        Some(last) if is_close(last.rgb, first.rgb) => {}
        // A place has two colours at most: those of its sides.
        Some(last) if before == Some(last.position) => *last = first,
        _ => refined.push(first),
    }
}

/// Whether colours differ by at most half of [`REFINEMENT`].
fn is_close(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= 0.5 * REFINEMENT)
}

/// A fraction of the interval between two points, and the colour there.
type Place = (f64, [f64; 3]);

/// Collects the fractions between two places at which the path must be cut to be linear in between.
fn halve(way: &Way, [a, b]: [Place; 2], halvings_left: u32, cuts: &mut Vec<Place>) {
    if halvings_left == 0 {
        return;
    }
    let at = |eighths: u32| {
        let f = f64::from(eighths) / 8.0;
        (f, way.at(a.0 + (b.0 - a.0) * f))
    };
    let fits = |(f, rgb): Place| is_close(rgb, mix(a.1, b.1, f));
    // Seven samples: the middle alone would miss curves symmetric around it. It is tried first, as the error is mostly largest there.
    let (_, middle) = at(4);
    if fits((0.5, middle)) && [2, 6, 1, 3, 5, 7].into_iter().all(|eighths| fits(at(eighths))) {
        return;
    }
    let middle = (0.5 * (a.0 + b.0), middle);
    halve(way, [a, middle], halvings_left - 1, cuts);
    cuts.push(middle);
    halve(way, [middle, b], halvings_left - 1, cuts);
}

/// The path from one colour to another; `ends` are coordinates in the colour space.
struct Way {
    space: ColorSpace,
    ends: [[f64; 3]; 2],
}

impl Way {
    fn new(space: ColorSpace, a: [f64; 3], b: [f64; 3]) -> Self {
        let into: fn([f64; 3]) -> [f64; 3] = match space {
            ColorSpace::Rgb => |rgb| rgb,
            ColorSpace::Hsv => rgb_to_hsv,
            ColorSpace::Lab => rgb_to_lab,
            ColorSpace::Diverging => rgb_to_msh,
        };
        Self { space, ends: [into(a), into(b)] }
    }

    /// The colour at `f` (0..=1).
    fn at(&self, f: f64) -> [f64; 3] {
        #[cfg(test)]
        tests::LOOKS.with(|looks| looks.set(looks.get() + 1));
        let [a, b] = self.ends;
        match self.space {
            ColorSpace::Rgb => mix(a, b, f),
            ColorSpace::Hsv => hsv_to_rgb(mix(a, b, f)),
            ColorSpace::Lab => lab_to_rgb(mix(a, b, f)),
            ColorSpace::Diverging => lab_to_rgb(msh_to_lab(diverging(a, b, f))),
        }
    }
}

/// The colour at `f` (0..=1) from `a` to `b`.
#[cfg(test)]
pub(super) fn interpolate(space: ColorSpace, a: [f64; 3], b: [f64; 3], f: f64) -> [f64; 3] {
    Way::new(space, a, b).at(f)
}

fn rgb_to_hsv([r, g, b]: [f64; 3]) -> [f64; 3] {
    let (lo, value) = (r.min(g).min(b), r.max(g).max(b));
    let range = value - lo;
    if range == 0.0 {
        return [0.0, 0.0, value];
    }
    let sixth = if r == value {
        (g - b) / range
    } else if g == value {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    [(sixth / 6.0).rem_euclid(1.0), range / value, value]
}

fn hsv_to_rgb([h, s, v]: [f64; 3]) -> [f64; 3] {
    [5.0, 3.0, 1.0].map(|n: f64| {
        let k = (n + h * 6.0) % 6.0;
        v - v * s * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

fn rgb_to_lab(rgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = rgb.map(|c| if c > 0.04045 { ((c + 0.055) / 1.055).powf(2.4) } else { c / 12.92 });
    let xyz = [
        0.4124 * r + 0.3576 * g + 0.1805 * b,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        0.0193 * r + 0.1192 * g + 0.9505 * b,
    ];
    let [x, y, z] = std::array::from_fn(|i| {
        let t = xyz[i] / WHITE[i];
        if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn lab_to_rgb([l, a, b]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let cube = |t: f64| if t.powi(3) > 0.008856 { t.powi(3) } else { (t - 16.0 / 116.0) / 7.787 };
    let [x, y, z] = [cube(a / 500.0 + y) * WHITE[0], cube(y) * WHITE[1], cube(y - b / 200.0) * WHITE[2]];
    // The exact inverse of the matrix above. VTK rounds it to four digits, so that colours change by up to 6e-4 on their
    // way to Lab and back; here the points of a map keep their colours.
    let linear = [
        3.240625477320054 * x - 1.537207972210319 * y - 0.4986285986982478 * z,
        -0.9689307147293196 * x + 1.8757560608852415 * y + 0.04151752384295395 * z,
        0.05571012044551064 * x - 0.20402105059848671 * y + 1.0569959422543882 * z,
    ];
    let rgb = linear.map(|c| if c > 0.0031308 { 1.055 * c.powf(1.0 / 2.4) - 0.055 } else { 12.92 * c });
    // Scaling out-of-gamut colours keeps their hue, as in VTK.
    let largest = rgb.iter().fold(1.0_f64, |m, &c| m.max(c));
    rgb.map(|c| (c / largest).clamp(0.0, 1.0))
}

fn rgb_to_msh(rgb: [f64; 3]) -> [f64; 3] {
    let [l, a, b] = rgb_to_lab(rgb);
    let m = (l * l + a * a + b * b).sqrt();
    let s = if m > 0.001 { (l / m).clamp(-1.0, 1.0).acos() } else { 0.0 };
    [m, s, if s > 0.001 { b.atan2(a) } else { 0.0 }]
}

fn msh_to_lab([m, s, h]: [f64; 3]) -> [f64; 3] {
    [m * s.cos(), m * s.sin() * h.cos(), m * s.sin() * h.sin()]
}

/// Msh colour between two; two saturated colours of different hue have white between them.
fn diverging(mut a: [f64; 3], mut b: [f64; 3], mut f: f64) -> [f64; 3] {
    use std::f64::consts::{FRAC_PI_3, TAU};
    const UNSATURATED: f64 = 0.05;
    let turn = (a[2] - b[2]).abs();
    if a[1] > UNSATURATED && b[1] > UNSATURATED && turn.min(TAU - turn) > FRAC_PI_3 {
        let white = [a[0].max(b[0]).max(88.0), 0.0, 0.0];
        if f < 0.5 {
            (b, f) = (white, 2.0 * f);
        } else {
            (a, f) = (white, 2.0 * f - 1.0);
        }
    }
    if a[1] < UNSATURATED && b[1] > UNSATURATED {
        a[2] = adjust_hue(b, a[0]);
    } else if b[1] < UNSATURATED && a[1] > UNSATURATED {
        b[2] = adjust_hue(a, b[0]);
    }
    mix(a, b, f)
}

/// The hue that an unsaturated colour of magnitude `m_unsaturated` takes, so that the way to it looks even.
fn adjust_hue([m, s, h]: [f64; 3], m_unsaturated: f64) -> f64 {
    if m >= m_unsaturated - 0.1 {
        return h;
    }
    let spin = s * (m_unsaturated * m_unsaturated - m * m).sqrt() / (m * s.sin());
    if h > -0.3 * std::f64::consts::PI { h + spin } else { h - spin }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    thread_local! {
        /// Colours that this thread has evaluated on paths.
        pub(super) static LOOKS: Cell<u64> = const { Cell::new(0) };
    }

    use proptest::prelude::*;

    fn is_within(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
        a.iter().zip(b).all(|(x, y)| (x - y).abs() <= tolerance)
    }

    fn assert_close(a: [f64; 3], b: [f64; 3], tolerance: f64) {
        assert!(is_within(a, b, tolerance), "{a:?} instead of {b:?}");
    }

    /// `vtkColorTransferFunction::GetColor` of VTK 9.7.2 (HSV without wrapping) between two colours.
    type Measured = (ColorSpace, [f64; 3], [f64; 3], [(f64, [f64; 3]); 3]);

    const BLUE: [f64; 3] = [0.1, 0.2, 0.9];
    const AMBER: [f64; 3] = [0.9, 0.7, 0.1];
    const VTK: [Measured; 3] = [
        (
            ColorSpace::Diverging,
            [59.0 / 255.0, 76.0 / 255.0, 192.0 / 255.0],
            [180.0 / 255.0, 4.0 / 255.0, 38.0 / 255.0],
            [
                (0.25, [0.5533179441991012, 0.6886346049931449, 0.9951879290543643]),
                (0.5, [0.8653951965183807, 0.8654102100698873, 0.8653955608359496]),
                (0.8, [0.9328818412203502, 0.5197678798785921, 0.40605005511171954]),
            ],
        ),
        (
            ColorSpace::Lab,
            BLUE,
            AMBER,
            [
                (0.25, [0.5291951068988445, 0.3095723848506507, 0.7367961963159886]),
                (0.5, [0.6990622522480942, 0.4344316174594194, 0.5707383585641]),
                (0.8, [0.832749210820443, 0.5920739134423305, 0.34764862841991767]),
            ],
        ),
        (
            ColorSpace::Hsv,
            BLUE,
            AMBER,
            [
                (0.25, [0.09999999999999995, 0.8250000000000004, 0.9]),
                (0.5, [0.09999999999999995, 0.9, 0.34999999999999987]),
                (0.8, [0.6000000000000001, 0.9, 0.09999999999999985]),
            ],
        ),
    ];

    #[test]
    fn colours_between_two_points_are_those_of_vtk() {
        for (space, from, to, colours) in VTK {
            for (f, rgb) in colours {
                // VTK's matrix from XYZ back to RGB has four digits: up to 5e-5 of a linear channel, and sRGB's curve is
                // less than 13 times as steep. HSV has no matrix, only some roundings of hues up to 6 (4e-16 each).
                let tolerance = if space == ColorSpace::Hsv { 4e-15 } else { 13.0 * 5e-5 };
                assert_close(interpolate(space, from, to, f), rgb, tolerance);
                assert!(!is_within(interpolate(space, from, to, f + 0.01), rgb, tolerance), "{space:?} {f}");
            }
        }
    }

    fn colour() -> impl Strategy<Value = [f64; 3]> {
        let gray = (0.0..=0.95, [0.0..=0.05, 0.0..=0.05, 0.0..=0.05]).prop_map(|(gray, by)| by.map(|by| gray + by));
        prop_oneof![2 => [0.0..=1.0, 0.0..=1.0, 0.0..=1.0], 1 => gray, 1 => Just([0.0; 3]), 1 => Just([1.0; 3]), 1 => Just([1.0, 0.0, 0.0])]
    }

    #[test]
    fn a_grayish_point_of_a_diverging_map_has_the_hue_of_either_side() {
        let colours = [[0.0, 0.0, 0.85], [0.848, 0.846, 0.819], [0.85, 0.0, 0.0]];
        let points: Vec<_> =
            colours.iter().zip([0.0, 0.5, 1.0]).map(|(&rgb, position)| ColorPoint { position, rgb }).collect();
        let refined = to_linear_rgb(ColorSpace::Diverging, &points);
        let there: Vec<_> = refined.iter().filter(|p| p.position == 0.5).map(|p| p.rgb).collect();
        let [blue, gray, red] = colours;
        let sides =
            [interpolate(ColorSpace::Diverging, blue, gray, 1.0), interpolate(ColorSpace::Diverging, gray, red, 0.0)];
        assert_eq!(there, sides);
        assert!(!is_within(sides[0], sides[1], 1e-3) && !is_within(sides[0], gray, 1e-3));
    }

    proptest! {
        #[test]
        fn conversions_are_inverses(rgb in colour()) {
            let other = rgb.map(|c| if c < 0.5 { c + 0.005 } else { c - 0.005 });
            let check = |there_and_back: &dyn Fn([f64; 3]) -> [f64; 3], tolerance: f64| {
                assert_close(there_and_back(rgb), rgb, tolerance);
                assert!(!is_within(there_and_back(other), rgb, tolerance), "{other:?} is taken for {rgb:?}");
            };
            // The linear pieces of sRGB and Lab are published with four digits: their joints are off by up to 1e-5.
            check(&|c| lab_to_rgb(rgb_to_lab(c)), 1e-5);
            // Some roundings of hues up to 6 (4e-16 each), and of saturations, which are differences of channels divided.
            check(&|c| hsv_to_rgb(rgb_to_hsv(c)), 1e-14);
            // Msh has no hue where a and b are below 0.001 of M, which is 100 at most: without 0.1 of b, Z is off by 3 * 0.1 / 200 and
            // blue by as much at white, where sRGB's slope is 0.44; without 0.1 of a, red by 3.2 * 3 * 0.1 / 500 of that. In dark
            // colours less.
            check(&|c| lab_to_rgb(msh_to_lab(rgb_to_msh(c))), 1e-3);
        }

        #[test]
        fn refined_maps_follow_the_formula(a in colour(), b in colour(), f in 0.0..1.0) {
            for space in [ColorSpace::Hsv, ColorSpace::Lab, ColorSpace::Diverging] {
                let ends = [ColorPoint { position: 0.0, rgb: a }, ColorPoint { position: 1.0, rgb: b }];
                let refined = to_linear_rgb(space, &ends);
                let after = refined.partition_point(|p| p.position <= f);
                let (p, q) = (refined[after - 1], refined[after]);
                let chord = mix(p.rgb, q.rgb, (f - p.position) / (q.position - p.position));
                assert_close(chord, interpolate(space, a, b, f), REFINEMENT);
                assert_eq!((refined[0].rgb, refined[refined.len() - 1].rgb), (a, b), "beyond its ends a map has their colours");
            }
            // An unrefined map is noticed.
            assert!(!is_within(mix(BLUE, AMBER, 0.5), interpolate(ColorSpace::Lab, BLUE, AMBER, 0.5), 0.01));
        }
    }

    #[test]
    fn a_map_of_very_many_unrelated_colours_has_a_bounded_number_of_pieces() {
        let noise = |i: usize, c: usize| (((i * 3 + c) as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0);
        for count in [300, 5000, 100_000, 300_000] {
            let point =
                |i: usize| ColorPoint { position: i as f64 / (count - 1) as f64, rgb: [0, 1, 2].map(|c| noise(i, c)) };
            let points: Vec<_> = (0..count).map(point).collect();
            let refined = to_linear_rgb(ColorSpace::Lab, &points);
            assert!(refined.len() <= MOST_PIECES.max(count) + 1, "{count}: {}", refined.len());
            // The points themselves are kept.
            let mut rest = refined.iter();
            assert!(points.iter().all(|p| rest.any(|q| q.position == p.position && is_close(q.rgb, p.rgb))), "{count}");
        }
    }

    #[test]
    fn no_colour_of_a_way_is_looked_up_twice() {
        let ends = [[0.1, 0.9, 0.2], [0.9, 0.0, 0.8]].map(|rgb| ColorPoint { position: 0.0, rgb });
        let pair = [ends[0], ColorPoint { position: 1.0, ..ends[1] }];
        let before = LOOKS.get();
        let places = way_between(ColorSpace::Lab, &pair, MAX_HALVINGS).unwrap().len() as u64;
        let (pieces, looks) = (places - 1, LOOKS.get() - before);
        assert!(pieces > 8);
        // Samples: both ends, seven in a piece, and in each that was cut one to seven.
        assert!(looks <= 2 + 7 * pieces + 7 * (pieces - 1), "{looks} for {pieces} pieces");
    }
}
