//! LDR-FLIP: the perceived difference when flipping between two images.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Moeller, M. Oskarsson, K. Astroem, M. D. Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020; section numbers are the paper's. Edges of the image are replicated.
//!
//! 1. Colour (4.1): both images in YCxCz, filtered by the eye's contrast sensitivity at a given number of pixels per degree,
//!    back to RGB, clamped, to Hunt-adjusted L*a*b*; HyAB distance, remapped to 0..1.
//! 2. Features (4.2): edges and points of the luminance by derivatives of a Gaussian of the eye's resolution.
//! 3. Difference per pixel: colour ^ (1 - feature). The result is the mean over all pixels.

use super::Plane;
use super::filter::Kernel;
use super::srgb::linear_from_srgb;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of visual angle of the paper's viewer, a 0.7 m wide display of 3840 pixels seen from 0.7 m: 67.02.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

const Q_COLOUR: f64 = 0.7;
const P_COLOUR: f64 = 0.4;
const P_THRESHOLD: f64 = 0.95;
const Q_FEATURE: f64 = 0.5;
/// Width of an edge or point that the eye resolves, degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity (table 1): (a, b) of the Gaussians of Y, Cx and Cz.
const SENSITIVITY: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];

/// The largest b, which determines the radius of all filters.
const WIDEST: f64 = 0.04;

/// Linear sRGB to XYZ, and its inverse.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.2410032329763583, -1.537398969488785, -0.4986158819963628],
    [-0.9692242522025163, 1.8759299836951757, 0.04155422634008469],
    [0.05563941985197541, -0.20401120612390994, 1.0571489771875333],
];

type Pixel = [f64; 3];

/// Mean FLIP of two images of equal size: display-referred sRGB in 0..=1, `width * height` pixels, at least one.
pub(super) fn mean_flip(reference: &[[f32; 3]], test: &[[f32; 3]], width: usize, height: usize) -> f64 {
    let ycxcz = |pixels: &[[f32; 3]]| -> [Plane<f64>; 3] {
        let pixels: Vec<Pixel> =
            pixels.par_iter().map(|&p| ycxcz_from_linear(p.map(|c| linear_from_srgb(f64::from(c))))).collect();
        std::array::from_fn(|c| Plane { width, height, pixels: pixels.iter().map(|p| p[c]).collect() })
    };
    let (reference, test) = (ycxcz(reference), ycxcz(test));
    let (seen_reference, seen_test) = (as_seen(&reference), as_seen(&test));
    let (features_reference, features_test) = (features(&reference[0]), features(&test[0]));
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(Q_COLOUR);
    let difference = |i: usize| {
        let colour = remap(hyab(seen_reference[i], seen_test[i]).powf(Q_COLOUR), largest);
        let [edge, point]: [f64; 2] = std::array::from_fn(|k| (features_reference[i][k] - features_test[i][k]).abs());
        let feature = (edge.max(point) / 2.0_f64.sqrt()).powf(Q_FEATURE);
        colour.powf(1.0 - feature)
    };
    let differences: Vec<f64> = (0..width * height).into_par_iter().map(difference).collect();
    // Sequential sum, so that the mean is the same for any number of threads.
    differences.iter().sum::<f64>() / differences.len() as f64
}

/// Maps small and large colour differences to shares of 0..1 (4.1.3).
fn remap(difference: f64, largest: f64) -> f64 {
    let knee = P_COLOUR * largest;
    if difference < knee {
        P_THRESHOLD / knee * difference
    } else {
        P_THRESHOLD + (difference - knee) / (largest - knee) * (1.0 - P_THRESHOLD)
    }
}

/// Hunt-adjusted L*a*b* after the contrast sensitivity filter (4.1.1, 4.1.2).
fn as_seen(ycxcz: &[Plane<f64>; 3]) -> Vec<Pixel> {
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as usize;
    let [y, cx, cz] = std::array::from_fn(|c| {
        // A 2-D Gaussian is the product of one along rows and one along columns; its share is its sum over both.
        let parts: Vec<(f64, Kernel)> = SENSITIVITY[c]
            .iter()
            .map(|&(a, b)| {
                let kernel = Kernel::sample(radius, |x| (-(PI * x / PIXELS_PER_DEGREE).powi(2) / b).exp());
                (a * (PI / b).sqrt() * kernel.sum().powi(2), kernel.normalised())
            })
            .collect();
        let all: f64 = parts.iter().map(|(weight, _)| weight).sum();
        let mut filtered = vec![0.0; ycxcz[c].pixels.len()];
        for (weight, kernel) in &parts {
            let part = ycxcz[c].convolved(kernel, kernel);
            filtered.iter_mut().zip(&part.pixels).for_each(|(sum, v)| *sum += weight / all * v);
        }
        filtered
    });
    let seen = |i: usize| hunt_lab(linear_from_ycxcz([y[i], cx[i], cz[i]]).map(|c| c.clamp(0.0, 1.0)));
    (0..y.len()).into_par_iter().map(seen).collect()
}

/// Strength of edges and of points at each pixel (4.2).
fn features(y: &Plane<f64>) -> Vec<[f64; 2]> {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as usize;
    let gaussian = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let smooth = Kernel::sample(radius, gaussian).normalised();
    let edge = Kernel::sample(radius, |x| -x * gaussian(x)).signs_normalised();
    let point = Kernel::sample(radius, |x| (x * x / (deviation * deviation) - 1.0) * gaussian(x)).signs_normalised();
    let luminance = Plane { pixels: y.pixels.iter().map(|v| (v + 16.0) / 116.0).collect(), ..*y };
    let strength = |kernel: &Kernel| -> Vec<f64> {
        let (across, down) = (luminance.convolved(kernel, &smooth), luminance.convolved(&smooth, kernel));
        across.pixels.iter().zip(&down.pixels).map(|(x, y)| x.hypot(*y)).collect()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(e, p)| [e, p]).collect()
}

/// Distance of two colours (4.1.2).
fn hyab(a: Pixel, b: Pixel) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

fn times(matrix: &[[f64; 3]; 3], v: Pixel) -> Pixel {
    std::array::from_fn(|i| matrix[i][0] * v[0] + matrix[i][1] * v[1] + matrix[i][2] * v[2])
}

/// XYZ of white, to which all XYZ are relative.
fn white() -> Pixel {
    times(&XYZ_FROM_RGB, [1.0; 3])
}

fn xyz_shares(linear: Pixel) -> Pixel {
    let (xyz, white) = (times(&XYZ_FROM_RGB, linear), white());
    std::array::from_fn(|i| xyz[i] / white[i])
}

fn ycxcz_from_linear(linear: Pixel) -> Pixel {
    let [x, y, z] = xyz_shares(linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_ycxcz([y, cx, cz]: Pixel) -> Pixel {
    let (y, white) = ((y + 16.0) / 116.0, white());
    times(&RGB_FROM_XYZ, [(y + cx / 500.0) * white[0], y * white[1], (y - cz / 200.0) * white[2]])
}

/// L*a*b* with chroma reduced at low luminance, after Hunt.
fn hunt_lab(linear: Pixel) -> Pixel {
    const DELTA: f64 = 6.0 / 29.0;
    let root = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = xyz_shares(linear).map(root);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}
