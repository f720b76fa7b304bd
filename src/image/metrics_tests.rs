use super::*;

fn image(width: usize, height: usize, colour: impl Fn(usize, usize) -> [f32; 3]) -> RgbaImage {
    let mut image = RgbaImage::new(width, height);
    for (index, pixel) in image.pixels.iter_mut().enumerate() {
        let [r, g, b] = colour(index % width, index / width);
        *pixel = [r, g, b, 1.0];
    }
    image
}

/// Hard edges, ramps and noise in the three channels.
fn busy(width: usize, height: usize) -> RgbaImage {
    image(width, height, |i, j| {
        [((i * 7 + j * 3) % 64) as f32 / 63.0, ((i * i + 5 * j) % 97) as f32 / 96.0, ((i / 8 + j / 8) % 2) as f32]
    })
}

fn smooth(width: usize, height: usize) -> RgbaImage {
    image(width, height, |i, j| {
        let (x, y) = (i as f64, j as f64);
        let r = 0.5 + 0.5 * (x * 0.05).sin() * (y * 0.07).cos();
        let g = 0.5 + 0.4 * (x * 0.02 + y * 0.03).sin();
        [r as f32, g as f32, (x / (width - 1) as f64) as f32]
    })
}

fn changed(image: &RgbaImage, change: impl Fn(usize, usize, [f32; 4]) -> [f32; 4]) -> RgbaImage {
    let mut copy = image.clone();
    for (index, pixel) in copy.pixels.iter_mut().enumerate() {
        *pixel = change(index % image.width, index / image.width, *pixel);
    }
    copy
}

/// The pairs measured in [`MEASURED`], in that order.
fn pairs(width: usize, height: usize) -> [(RgbaImage, RgbaImage); 4] {
    let (a, s) = (busy(width, height), smooth(width, height));
    let shifted = changed(&a, |i, j, _| a.pixels[j * width + (i + width - 1) % width]);
    let inverted = changed(&a, |_, _, [r, g, b, a]| [1.0 - r, g, b, a]);
    let darker = changed(&a, |_, _, [r, g, b, a]| [0.9 * r, 0.9 * g, 0.9 * b, a]);
    let in_square = |i, j| (width / 4..width / 2).contains(&i) && (height / 4..height / 2).contains(&j);
    let square = changed(&s, |i, j, p| if in_square(i, j) { [0.8 * p[0], 0.8 * p[1], 0.8 * p[2], 1.0] } else { p });
    [(a.clone(), shifted), (a.clone(), inverted), (a, darker), (s, square)]
}

/// Width, height, pair, FLIP of flip-evaluator 1.7 (PyPI, NVIDIA's implementation, mean LDR-FLIP at its default 67.02 pixels per
/// degree), and SSIM of scikit-image 0.26 (`gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1` on
/// Rec. 601 luma), which needs 11 pixels a side.
const MEASURED: [(usize, usize, usize, f64, Option<f64>); 8] = [
    (64, 48, 0, 0.4159318506717682, Some(0.06514972854508352)),
    (64, 48, 1, 0.5136684775352478, Some(0.5932816129210805)),
    (64, 48, 2, 0.32447880506515503, Some(0.989078122043385)),
    (64, 48, 3, 0.06805344671010971, Some(0.8835305571641137)),
    (9, 40, 0, 0.6230652928352356, None),
    (9, 40, 1, 0.5682358145713806, None),
    (9, 40, 2, 0.3430667221546173, None),
    (9, 40, 3, 0.06070435419678688, None),
];

#[test]
fn flip_and_ssim_equal_the_published_implementations() {
    for (width, height, pair, flip, ssim) in MEASURED {
        let (a, b) = &pairs(width, height)[pair];
        let metrics = compare(a, b, [0.0; 3]).unwrap();
        // flip-evaluator computes in f32; measured distance to ours in f64 is up to 5e-7. A slightly narrower filter
        // (67 instead of 67.02 pixels per degree) is off by 1e-4.
        assert!((metrics.flip - flip).abs() < 2e-6, "{width} x {height} pair {pair}: {} not {flip}", metrics.flip);
        if let Some(ssim) = ssim {
            // Both in f64 on the same f32 images: measured distance 1e-15; the window's tail beyond 5 pixels is 1e-3.
            assert!((metrics.ssim - ssim).abs() < 1e-14, "{width} x {height} pair {pair}: {} not {ssim}", metrics.ssim);
        }
        // A one per cent darker image is detected.
        let darker = changed(b, |_, _, [r, g, b, a]| [0.99 * r, 0.99 * g, 0.99 * b, a]);
        let other = compare(a, &darker, [0.0; 3]).unwrap();
        assert!((other.flip - flip).abs() > 2e-6, "{width} x {height} pair {pair}: {} and {flip}", other.flip);
        assert!(ssim.is_none_or(|ssim| (other.ssim - ssim).abs() > 1e-14), "{width} x {height} pair {pair}");
    }
}

#[test]
fn equal_images_have_no_difference() {
    for (width, height) in [(1, 1), (2, 1), (1, 30), (40, 13)] {
        let a = image(width, height, |i, j| [(i % 2) as f32, 0.5, (j % 3) as f32 / 2.0]);
        let metrics = compare(&a, &a, [1.0; 3]).unwrap();
        assert_eq!((metrics.max, metrics.rmse, metrics.psnr, metrics.flip), (0.0, 0.0, f64::INFINITY, 0.0));
        // Variances are differences of equal sums here, and cancel up to rounding. Measured: exactly.
        assert!((metrics.ssim - 1.0).abs() < 1e-14, "{width} x {height}: {}", metrics.ssim);
    }
}

#[test]
fn max_and_rmse_are_of_raw_accumulators_over_four_channels() {
    let a = RgbaImage::new(10, 10);
    let mut b = a.clone();
    b.pixels[37] = [0.0, 3.0, 0.0, -4.0];
    let metrics = compare(&a, &b, [0.0; 3]).unwrap();
    assert_eq!((metrics.max, metrics.rmse), (4.0, (25.0_f64 / 400.0).sqrt()));
    // Two logarithms of size 1, rounded, times 20. Measured: the same.
    assert!((metrics.psnr - -20.0 * 0.25_f64.log10()).abs() < 1e-14);
}

#[test]
fn the_background_decides_what_ssim_and_flip_see_of_transparent_pixels() {
    let (black, transparent) = (image(16, 16, |_, _| [0.0; 3]), RgbaImage::new(16, 16));
    let over_black = compare(&black, &transparent, [0.0; 3]).unwrap();
    assert_eq!((over_black.max, over_black.flip), (1.0, 0.0));
    let over_white = compare(&black, &transparent, [1.0; 3]).unwrap();
    assert!(over_white.flip > 0.9 && over_white.ssim < 0.1);
}

#[test]
fn a_nan_is_an_error_with_its_place() {
    let a = RgbaImage::new(4, 3);
    let mut b = a.clone();
    b.pixels[6][3] = f32::NAN;
    assert_eq!(compare(&a, &b, [0.0; 3]), Err(MetricsError::NotFinite { which: "second", column: 2, row: 1 }));
    b.pixels[6][3] = f32::INFINITY;
    assert_eq!(compare(&b, &a, [0.0; 3]), Err(MetricsError::NotFinite { which: "first", column: 2, row: 1 }));
}

#[test]
fn images_that_cannot_be_compared_are_errors() {
    let error = compare(&RgbaImage::new(4, 3), &RgbaImage::new(3, 4), [0.0; 3]).unwrap_err();
    assert_eq!(error.to_string(), "the images have different sizes: 4 x 3 and 3 x 4 pixels");
    assert_eq!(compare(&RgbaImage::new(0, 3), &RgbaImage::new(0, 3), [0.0; 3]), Err(MetricsError::NoPixels));
}

#[test]
fn metrics_round_trip_through_json() {
    let a = busy(12, 12);
    for b in [busy(12, 12), smooth(12, 12)] {
        let metrics = compare(&a, &b, [0.0; 3]).unwrap();
        let back: ImageMetrics = serde_json::from_str(&serde_json::to_string(&metrics).unwrap()).unwrap();
        assert_eq!(back.psnr.is_infinite(), metrics.psnr.is_infinite());
        assert_eq!(back.max, metrics.max);
    }
}

#[test]
fn depths_are_compared_where_both_have_one() {
    let plane = |pixels: [f32; 4]| DepthImage { width: 4, height: 1, pixels: pixels.into() };
    let none = f32::INFINITY;
    let metrics = compare_depth(&plane([1.0, 2.0, none, none]), &plane([1.0, 5.0, 3.0, none])).unwrap();
    assert_eq!(metrics, PlaneMetrics { max: 3.0, rmse: 4.5_f64.sqrt(), compared: 2, unmatched: 1 });
    let nothing = compare_depth(&plane([none; 4]), &plane([none; 4])).unwrap();
    assert_eq!(nothing, PlaneMetrics { max: 0.0, rmse: 0.0, compared: 0, unmatched: 0 });
    let other = DepthImage { width: 2, height: 2, pixels: vec![1.0; 4] };
    assert_eq!(compare_depth(&plane([1.0; 4]), &other), Err(MetricsError::DifferentSizes((4, 1), (2, 2))));
    assert_eq!(compare_depth(&DepthImage::default(), &DepthImage::default()), Err(MetricsError::NoPixels));
}
