use super::*;
use crate::image::RgbaImage;
use crate::task::Cancel;

/// An image whose channels are linear in the position, as a share of the height from the centre.
fn ramp(width: usize, height: usize) -> RgbaImage {
    let mut image = RgbaImage::new(width, height);
    for (i, pixel) in image.pixels.iter_mut().enumerate() {
        let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let (u, v) = ((x - 0.5 * width as f64) / height as f64, (y - 0.5 * height as f64) / height as f64);
        *pixel = [u as f32, v as f32, (u + 2.0 * v) as f32, 1.0];
    }
    image
}

/// Pseudo-random numbers of 0 to 1.
fn noise(seed: usize) -> impl Fn(usize) -> f32 {
    move |i| {
        let mixed = (i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(seed.wrapping_mul(0xD1B5_4A32_D192_ED03));
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f32 / (1u64 << 24) as f32
    }
}

fn noisy(width: usize, height: usize, seed: usize) -> RgbaImage {
    let value = noise(seed);
    let pixel = |i: usize| std::array::from_fn(|c| value(4 * i + c));
    RgbaImage { width, height, pixels: (0..width * height).map(pixel).collect() }
}

/// Depths that vary by about sigma from pixel to pixel, with one missing (2) here and there.
fn depths(width: usize, height: usize, seed: usize) -> Reference {
    let value = noise(seed);
    let pixel = |i: usize| {
        let missing = if value(7 * i) < 0.3 { 2.0 } else { 0.9 };
        [0.3 + 0.03 * value(3 * i), 0.6 + 0.02 * value(3 * i + 1), missing]
    };
    Reference { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn largest_difference(a: &RgbaImage, b: &RgbaImage) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let pairs = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Oracle: eq. 4.3, in f64.
fn naive(image: &RgbaImage, reference: &Reference, kernel: JointKernel) -> RgbaImage {
    let JointKernel { kernel_px, sigma_reference } = kernel;
    let gauss = |square: f64, sigma: f64| (-square / (2.0 * sigma * sigma)).exp();
    let mut out = RgbaImage::new(image.width, image.height);
    for (p, pixel) in out.pixels.iter_mut().enumerate() {
        let (px, py) = ((p % image.width) as f64, (p / image.width) as f64);
        let (mut sums, mut weights) = ([0.0; 4], 0.0);
        for q in 0..image.pixels.len() {
            let (dx, dy) = ((q % image.width) as f64 - px, (q / image.width) as f64 - py);
            if dx.abs() > kernel_px as f64 / 2.0 || dy.abs() > kernel_px as f64 / 2.0 {
                continue;
            }
            let pairs = reference.pixels[p].iter().zip(reference.pixels[q]);
            let apart = pairs.map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum();
            let weight = gauss(dx * dx + dy * dy, kernel_px as f64 / 2.0) * gauss(apart, sigma_reference);
            weights += weight;
            (0..4).for_each(|c| sums[c] += weight * f64::from(image.pixels[q][c]));
        }
        *pixel = sums.map(|sum| (sum / weights) as f32);
    }
    out
}

fn filtered(image: &RgbaImage, reference: &Reference, kernel: JointKernel) -> RgbaImage {
    joint(image, reference, kernel, &Cancel::new()).unwrap()
}

#[test]
fn what_is_linear_in_the_scene_stays_where_it_is_at_any_size() {
    for (small, full) in [((20, 15), (40, 30)), ((10, 8), (41, 30)), ((40, 30), (40, 30))] {
        let (from, to) = (ramp(small.0, small.1), ramp(full.0, full.1));
        let large = bilinear(&from, &Enlarging::between(small, full));
        let factor = full.1.div_ceil(small.1);
        let mut worst = 0.0_f32;
        for (i, (a, b)) in large.pixels.iter().zip(&to.pixels).enumerate() {
            // Edges are replicated beyond the outermost centres.
            let (x, y) = (i % full.0, i / full.0);
            if x >= factor && x + factor < full.0 && y >= factor && y + factor < full.1 {
                worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(worst, f32::max);
            }
        }
        // A few roundings of numbers below 2.
        assert!(worst <= 1e-6, "{small:?} to {full:?}: {worst}");
    }
    let moved = bilinear(&ramp(20, 15), &Enlarging::between((20, 15), (40, 30)));
    assert!((moved.pixels[15 * 40 + 20][0] - ramp(40, 30).pixels[15 * 40 + 21][0]).abs() > 1e-6, "cannot fail");
}

#[test]
fn the_smallest_image_and_none_are_enlarged_too() {
    let one = RgbaImage { width: 1, height: 1, pixels: vec![[0.25, 0.5, 0.75, 1.0]] };
    let reference = |(width, height)| Reference { width, height, pixels: vec![[0.5; 3]; width * height] };
    for full in [(1, 1), (7, 3), (8, 8)] {
        let enlarging = Enlarging::by(8, full);
        assert_eq!(enlarging.small, (1, 1));
        let (alike, fell_back) = joint2x2(&one, &enlarging, [&reference(full), &reference((1, 1))], 0.01);
        let large = [nearest(&one, &enlarging), bilinear(&one, &enlarging), alike];
        assert!(large.iter().all(|image| image.pixels == vec![one.pixels[0]; full.0 * full.1]) && fell_back == 0);
        let kernel = JointKernel { kernel_px: 16, sigma_reference: 0.01 };
        assert!(largest_difference(&filtered(&large[0], &reference(full), kernel), &large[0]) < 1e-6);
    }
    assert_eq!(bilinear(&RgbaImage::default(), &Enlarging::between((0, 0), (2, 2))), RgbaImage::new(2, 2));
    assert_eq!(bilinear(&one, &Enlarging::by(2, (0, 2))), RgbaImage::new(0, 2));
    assert!(nearest(&RgbaImage::default(), &Enlarging::between((0, 0), (2, 2))).pixels.is_empty());
}

#[test]
fn a_small_image_covers_the_full_one_around_the_same_middle_and_pixels_have_their_nearest_sample() {
    for full in [(1023, 767), (5, 3), (16, 8)] {
        for factor in [2, 4, 8] {
            let enlarging = Enlarging::by(factor, full);
            let (width, height) = enlarging.small;
            assert!(
                (0..factor).contains(&(width * factor - full.0)) && (0..factor).contains(&(height * factor - full.1))
            );
            let numbered = Plane { width, height, pixels: (0..width * height).collect::<Vec<_>>() };
            let large = nearest(&numbered, &enlarging);
            assert_eq!((large.width, large.height, large.pixels.len()), (full.0, full.1, full.0 * full.1));
            for (i, sample) in large.pixels.iter().enumerate() {
                // Integers, in halves of a pixel from the centre of the full image.
                let away = |pixel: usize, of: usize| (2 * pixel + 1) as i64 - of as i64;
                let of_sample = |at: usize, of: usize| factor as i64 * away(at, of);
                let x = (away(i % full.0, full.0) - of_sample(sample % width, width)).abs();
                let y = (away(i / full.0, full.1) - of_sample(sample / width, height)).abs();
                assert!(x.max(y) <= factor as i64, "pixel {i} has sample {sample}");
            }
        }
    }
}

#[test]
fn the_joint_filter_is_its_equation() {
    for (width, height, kernel_px, sigma) in [
        (37, 23, 4, 0.01),
        (20, 33, 8, 0.02),
        (40, 19, 16, 0.01),
        (21, 9, 64, 0.05),
        (5, 3, 16, 0.01),
        (6, 5, 3, 1e-9),
        (9, 1, 1, 0.01),
    ] {
        let kernel = JointKernel { kernel_px, sigma_reference: sigma };
        let (image, reference) = (noisy(width, height, kernel_px), depths(width, height, 5));
        let (fast, slow) = (filtered(&image, &reference, kernel), naive(&image, &reference, kernel));
        let worst = largest_difference(&fast, &slow);
        assert!(worst <= 1e-5, "{width}x{height}, kernel {kernel_px}: {worst}");
        if kernel_px == 8 {
            let other = depths(width, height, 6);
            assert!(largest_difference(&fast, &naive(&image, &other, kernel)) > 1e-3, "cannot fail");
        }
    }
}

#[test]
fn without_a_reference_that_says_something_the_joint_filter_is_gaussian() {
    let image = noisy(40, 30, 1);
    let flat = Reference { width: 40, height: 30, pixels: vec![[0.25, 0.5, 2.0]; 1200] };
    let gaussian = naive(&image, &flat, JointKernel { kernel_px: 8, sigma_reference: 1.0 });
    let of_flat = filtered(&image, &flat, JointKernel { kernel_px: 8, sigma_reference: 0.01 });
    assert!(largest_difference(&of_flat, &gaussian) <= 1e-5);
    for sigma_reference in [1e6, f64::INFINITY] {
        let of_all = filtered(&image, &depths(40, 30, 2), JointKernel { kernel_px: 8, sigma_reference });
        assert!(largest_difference(&of_all, &gaussian) <= 1e-5);
    }
}

#[test]
fn no_weight_crosses_a_step_of_the_reference() {
    // 1e12 after the step, 0 before it: the result there is the weight.
    let (width, height, sigma) = (40, 12, 0.01);
    let is_beyond = |i: usize| i % width >= 17;
    let pixel = |i| if is_beyond(i) { [1e12; 4] } else { [0.0; 4] };
    let image = RgbaImage { width, height, pixels: (0..width * height).map(pixel).collect() };
    let filter = |step: f32| {
        let value = |i| if is_beyond(i) { [0.5 + step, 0.5, 2.0] } else { [0.5, 0.5, 2.0] };
        let reference = Reference { width, height, pixels: (0..width * height).map(value).collect() };
        let image = filtered(&image, &reference, JointKernel { kernel_px: 16, sigma_reference: sigma });
        (0..width * height).filter(|&i| !is_beyond(i)).map(|i| f64::from(image.pixels[i][0]) / 1e12).fold(0.0, f64::max)
    };
    let crossed = filter(8.0 * sigma as f32);
    assert!(crossed < 1e-12, "{crossed}");
    assert!(filter(2.0 * sigma as f32) > 1e-3, "cannot fail");
}

#[test]
fn the_exponential_is_right_to_two_units_in_the_last_place_or_so() {
    let at = |i: u32| -(f64::from(i) * 0.01) as f32;
    let apart = |t: f32| (f64::from(exp2_of(t)) / f64::from(t).exp2() - 1.0).abs();
    let worst = (0..12_600).map(|i| apart(at(i))).fold(0.0, f64::max);
    assert!(worst <= 3e-7, "{worst}");
    assert_eq!(exp2_of(0.0), 1.0);
    assert_eq!(exp2_of(f32::NEG_INFINITY), f32::MIN_POSITIVE);
}

fn exp2_of(t: f32) -> f32 {
    super::joint::exp2_of_negative(t)
}

#[test]
fn joint2x2_is_bilinear_where_the_reference_is_flat_and_where_all_samples_lie_across_an_edge() {
    let (full, small) = ((10, 8), (5, 4));
    let enlarging = Enlarging::by(2, full);
    let image = noisy(small.0, small.1, 3);
    let plane = |(width, height): (usize, usize), value: f32| Reference {
        width,
        height,
        pixels: vec![[value; 3]; width * height],
    };
    let linear = bilinear(&image, &enlarging);
    let (alike, fell_back) = joint2x2(&image, &enlarging, [&plane(full, 0.5), &plane(small, 0.5)], 0.01);
    assert!(largest_difference(&alike, &linear) < 1e-6 && fell_back == 0);
    // One pixel has another depth than all samples.
    let mut lonely = plane(full, 0.5);
    lonely.pixels[33] = [2.0; 3];
    let (alike, fell_back) = joint2x2(&image, &enlarging, [&lonely, &plane(small, 0.5)], 0.01);
    assert!(largest_difference(&alike, &linear) < 1e-6 && fell_back == 1);
}

#[test]
fn joint2x2_takes_samples_of_its_own_side_of_an_edge_alone() {
    let (full, small) = ((12, 8), (6, 4));
    let enlarging = Enlarging::by(2, full);
    // The edge lies at the fifth column, between samples 1 and 2.
    let side = |is_right: bool| if is_right { 1.0 } else { 0.0 };
    let pixels = |width: usize, height: usize, edge: f32, per: f32| {
        (0..width * height).map(move |i| side(((i % width) as f32 + 0.5) * per > edge)).collect::<Vec<f32>>()
    };
    let reference = |(width, height), per| Reference {
        width,
        height,
        pixels: pixels(width, height, 5.0, per).into_iter().map(|v| [v; 3]).collect(),
    };
    let colors = pixels(small.0, small.1, 5.0, 2.0).into_iter().map(|v| [v; 4]).collect();
    let image = RgbaImage { width: small.0, height: small.1, pixels: colors };
    let (alike, _) = joint2x2(&image, &enlarging, [&reference(full, 1.0), &reference(small, 2.0)], 0.01);
    let exact = pixels(full.0, full.1, 5.0, 1.0).into_iter().map(|v| [v; 4]).collect();
    let exact = RgbaImage { width: full.0, height: full.1, pixels: exact };
    assert!(largest_difference(&alike, &exact) < 1e-6);
    assert!(largest_difference(&bilinear(&image, &enlarging), &exact) > 0.2, "cannot fail");
}

#[test]
fn a_filter_that_nobody_waits_for_gives_nothing_and_threads_change_no_bit() {
    let (image, reference) = (noisy(50, 40, 1), depths(50, 40, 1));
    let kernel = JointKernel { kernel_px: 8, sigma_reference: 0.01 };
    let cancelled = Cancel::new();
    cancelled.cancel();
    assert!(joint(&image, &reference, kernel, &cancelled).is_none());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| filtered(&image, &reference, kernel))
    };
    assert_eq!(with(1), with(3));
}

/// Oracle: the mean of four samples by bilinear weights and g, in f64; `None` if the weights vanish.
fn naive_joint2x2(
    image: &RgbaImage,
    factor: usize,
    [at_pixels, at_samples]: [&Reference; 2],
    sigma: f64,
    pixel: usize,
) -> Option<[f64; 4]> {
    let full = (at_pixels.width, at_pixels.height);
    // In samples from the left end of the small image, which has the same centre as the full one.
    let place = |i: usize, full: usize, small: usize| {
        (i as f64 + 0.5 + (small * factor) as f64 / 2.0 - full as f64 / 2.0) / factor as f64
    };
    let (x, y) = (place(pixel % full.0, full.0, image.width), place(pixel / full.0, full.1, image.height));
    let tent =
        |s: usize, at: f64, last: usize| (1.0 - (at.clamp(0.5, last as f64 + 0.5) - s as f64 - 0.5).abs()).max(0.0);
    let (mut sums, mut weights) = ([0.0; 4], 0.0);
    for sample in 0..image.pixels.len() {
        let (column, row) = (sample % image.width, sample / image.width);
        let pairs = at_pixels.pixels[pixel].iter().zip(at_samples.pixels[sample]);
        let square: f64 = pairs.map(|(a, b)| (f64::from(*a) - f64::from(b)).powi(2)).sum();
        let shares = tent(column, x, image.width - 1) * tent(row, y, image.height - 1);
        let weight = shares * (-square / (2.0 * sigma * sigma)).exp();
        weights += weight;
        (0..4).for_each(|c| sums[c] += weight * f64::from(image.pixels[sample][c]));
    }
    (weights >= 1e-6).then(|| sums.map(|sum| sum / weights))
}

#[test]
fn joint2x2_is_its_equation_and_counts_where_it_falls_back() {
    let (mut fallen, mut worst) = (0, 0.0f64);
    for (full, factor) in [((37, 23), 2), ((37, 23), 4), ((5, 3), 8), ((5, 3), 2), ((1, 1), 4), ((19, 40), 8)] {
        let enlarging = Enlarging::by(factor, full);
        let (width, height) = enlarging.small;
        let image = noisy(width, height, factor);
        let references = [&depths(full.0, full.1, 3), &depths(width, height, 4)];
        let (fast, fell_back) = joint2x2(&image, &enlarging, references, 0.006);
        let linear = bilinear(&image, &enlarging);
        let mut expected = 0;
        for (at, pixel) in fast.pixels.iter().enumerate() {
            let slow = naive_joint2x2(&image, factor, references, 0.006, at);
            expected += u64::from(slow.is_none());
            let slow = slow.unwrap_or(linear.pixels[at].map(f64::from));
            worst = (0..4).map(|c| (f64::from(pixel[c]) - slow[c]).abs()).fold(worst, f64::max);
        }
        assert_eq!(fell_back, expected, "{full:?} by {factor}");
        fallen += expected;
    }
    assert!(worst <= 1e-5, "{worst}");
    assert!(fallen > 100, "{fallen}");
}

#[test]
fn a_large_image_is_filtered_at_its_border_as_inside() {
    let (full, kernel) = ((1023, 767), JointKernel::of_factor(2));
    let (image, reference) = (noisy(full.0, full.1, 1), depths(full.0, full.1, 2));
    let fast = filtered(&image, &reference, kernel);
    // Crops at a corner, an edge and the centre, larger than the kernel.
    for (x, y) in [(0, 0), (1013, 757), (500, 0), (0, 400), (511, 383)] {
        let cut = |i: usize| (y + i / 10) * full.0 + x + i % 10;
        let image = RgbaImage { width: 10, height: 10, pixels: (0..100).map(|i| image.pixels[cut(i)]).collect() };
        let reference =
            Reference { width: 10, height: 10, pixels: (0..100).map(|i| reference.pixels[cut(i)]).collect() };
        let slow = naive(&image, &reference, kernel);
        let mut compared = 0;
        for i in 0..100 {
            let is_whole = |at: usize, first: usize, of: usize| (at >= 2 || first == 0) && (at < 8 || first + 10 == of);
            if is_whole(i % 10, x, full.0) && is_whole(i / 10, y, full.1) {
                compared += 1;
                (0..4)
                    .for_each(|c| assert!((fast.pixels[cut(i)][c] - slow.pixels[i][c]).abs() <= 1e-5, "{x}, {y}: {i}"));
            }
        }
        assert!(compared >= 36);
    }
}

#[test]
fn kernels_have_bounds() {
    for (kernel, sigma) in [(0, 0.01), (65, 0.01), (8, 0.0), (8, -1.0), (8, f64::NAN), (8, f64::INFINITY)] {
        assert_eq!(JointKernel::new(kernel, sigma), None, "{kernel}, {sigma}");
    }
    assert_eq!(JointKernel::new(64, 0.01).map(|kernel| kernel.kernel_px), Some(64));
    assert_eq!([1, 2, 4, 8, 500].map(|factor| JointKernel::of_factor(factor).kernel_px), [8, 4, 8, 16, 64]);
}

#[test]
fn an_image_of_another_size_through_the_same_camera_is_bilinear() {
    let image = noisy(10, 8, 1);
    assert_eq!(enlarged(&image, 41, 30), bilinear(&image, &Enlarging::between((10, 8), (41, 30))));
}
