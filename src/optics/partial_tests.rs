//! Partial pre-integration against the definition in f64, and against the exact integrator where both are equal.

use super::*;
use crate::optics::quadrature::quadrature;
use proptest::prelude::*;

fn nodes(of: &[(f64, [f64; 3], f64)]) -> NodeTable {
    NodeTable::new(of.iter().map(|&(scalar, rgb, tau)| Node { scalar, rgb, tau }).collect()).unwrap()
}

/// The pixel of one segment.
fn pixel<I: Integrator>(table: &I, s0: f64, s1: f64, length: f64) -> [f32; 4] {
    let mut light = Accumulator::TRANSPARENT;
    table.segment(&mut table.enter(s0), s0, s1, length, &mut light);
    light.pixel()
}

/// Largest differences from the definition: of a colour channel, of opacity.
fn errors(table: &NodeTable, partial: &PartialTable, (s0, s1, length): (f64, f64, f64)) -> [f64; 2] {
    let truth = quadrature(table, s0, s1, length, 0.5);
    let off = pixel(partial, s0, s1, length).map(f64::from);
    let of = |c: usize| (off[c] - truth[c]).abs();
    [of(0).max(of(1)).max(of(2)), of(3)]
}

/// A number in [0, 1) from a seed and an index.
fn random(seed: u64, index: u64) -> f64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(index.wrapping_mul(0xD1B5_4A32_D192_ED03));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Up to 40 nodes from 0 to 1, with steps, transparent pieces, and extinctions over four decades.
fn random_table(seed: u64) -> NodeTable {
    let count = 2 + (random(seed, 0) * 38.0) as u64;
    let mut scalars: Vec<f64> = (1..count).map(|i| random(seed, i)).chain([0.0, 1.0]).collect();
    scalars.sort_by(f64::total_cmp);
    let mut made = Vec::new();
    for (i, &scalar) in (0..).zip(&scalars) {
        let value = |k: u64| random(seed, 1000 + 16 * i + k);
        let node = |k: u64| {
            let tau = if value(k + 4) < 0.3 { 0.0 } else { 10f64.powf(4.0 * value(k + 3) - 2.0) };
            (scalar, [value(k), value(k + 1), value(k + 2)], tau)
        };
        made.push(node(0));
        if value(5) < 0.2 {
            made.push(node(8));
        }
    }
    nodes(&made)
}

/// The segment `index` through a table and its optical depth, up to 20: from within an interval to all of the range.
fn random_segment(table: &NodeTable, seed: u64, index: u64) -> ((f64, f64, f64), f64) {
    let at = |k: u64| random(seed ^ 0x5eed, 8 * index + k);
    let s0 = at(0);
    let s1 = (s0 + 10f64.powf(-3.0 * at(1)) * (2.0 * at(2) - 1.0)).clamp(-0.2, 1.2);
    let depth = 10f64.powf(4.0 * at(3) - 2.7);
    // The mean extinction, from the opacity of a thin segment.
    let mean = quadrature(table, s0, s1, 1e-9, 0.5)[3] / 1e-9;
    let length = if mean > 0.0 { depth / mean } else { 1.0 };
    ((s0, s1, length), if mean > 0.0 { depth } else { 0.0 })
}

#[test]
fn opacity_is_that_of_the_definition_and_colors_are_within_their_bounds() {
    // Largest error of a channel for optical depths up to these; measured: 4.3e-6, 7.2e-5, 1.0e-4, 6.1e-5.
    let bounds = [(0.1, 8e-6), (0.5, 1.5e-4), (2.0, 2e-4), (20.0, 2e-4)];
    let mut worst = [0.0f64; 4];
    let (mut opacity, mut wrong_opacity) = (0.0f64, 0.0f64);
    for seed in 0..150 {
        let table = random_table(seed);
        let partial = PartialTable::new(&table, 1.0);
        let off = PartialTable::new(&table, 1.0 + 1e-5);
        for index in 0..60 {
            let (segment, depth) = random_segment(&table, seed, index);
            let [color, alpha] = errors(&table, &partial, segment);
            let class = bounds.iter().position(|&(most, _)| depth <= most).unwrap();
            worst[class] = worst[class].max(color);
            opacity = opacity.max(alpha);
            wrong_opacity = wrong_opacity.max(errors(&table, &off, segment)[1]);
        }
    }
    println!("partial: opacity {opacity:.1e}, colours {worst:?}");
    // One exponential of a depth summed in f64, in f32. Measured: 1.5e-7.
    assert!(opacity < 5e-7, "{opacity:e}");
    assert!(wrong_opacity > 2e-6, "an extinction that is off by 1e-5 is seen: {wrong_opacity:e}");
    for ((depth, bound), found) in bounds.iter().zip(worst) {
        assert!(found < *bound, "optical depths to {depth}: {found:e}");
    }
}

/// Alternative pixels of a segment across nodes: by the colours at its ends, and by the mean.
fn rivals(table: &PartialTable, (s0, s1, length): (f64, f64, f64)) -> Option<[[f32; 3]; 2]> {
    let ends = if s1 >= s0 { (false, true) } else { (true, false) };
    let (first, last) = (table.interval_of(0, s0, ends.0), table.interval_of(0, s1, ends.1));
    if first == last || s0 == s1 {
        return None;
    }
    let [near, far] = [(first, s0), (last, s1)]
        .map(|(i, s)| (table.exact.interval(i).at(s).color(), depth_of(table.tau_at(i, s), length)));
    let alpha = pixel(table, s0, s1, length)[3];
    // The colours at the ends and psi, with the right opacity.
    let psi = piece_weights(near.1, far.1);
    let total = psi.near + psi.far;
    let ends = if total > 0.0 { (near.0 * psi.near + far.0 * psi.far) * (alpha / total) } else { Vec4::ZERO };
    // The mean colour, as of a thin segment.
    let thin = pixel(table, s0, s1, 1e-12);
    let mean = if thin[3] > 0.0 { Vec4::from_array(thin) * (alpha / thin[3]) } else { Vec4::ZERO };
    Some([ends, mean].map(|c| [c.x, c.y, c.z]))
}

#[test]
fn the_moments_are_better_than_the_colors_at_the_ends() {
    let classes = [0.1, 0.5, 2.0, 20.0];
    let mut worst = [[0.0f64; 3]; 4];
    for seed in 0..150 {
        let table = random_table(seed);
        let partial = PartialTable::new(&table, 1.0);
        for index in 0..60 {
            let (segment, depth) = random_segment(&table, seed, index);
            let Some([ends, mean]) = rivals(&partial, segment) else { continue };
            let (s0, s1, length) = segment;
            let truth = quadrature(&table, s0, s1, length, 0.5);
            let [r, g, b, _] = pixel(&partial, s0, s1, length);
            let class = classes.iter().position(|&most| depth <= most).unwrap();
            for (rule, color) in [ends, mean, [r, g, b]].into_iter().enumerate() {
                let off = color.iter().zip(truth).map(|(c, t)| (f64::from(*c) - t).abs()).fold(0.0, f64::max);
                worst[class][rule] = worst[class][rule].max(off);
            }
        }
    }
    println!("ends, mean, moments: {worst:?}");
    for (most, [ends, mean, moments]) in classes.into_iter().zip(worst) {
        assert!(moments < 0.02 * mean && moments < 0.02 * ends, "depths to {most}: {ends:e} {mean:e} {moments:e}");
    }
}

#[test]
fn between_two_nodes_it_is_the_exact_integrator() {
    let (mut compared, mut noticed) = (0, 0);
    for seed in 0..60 {
        let table = random_table(seed);
        let (partial, exact) = (PartialTable::new(&table, 1.0), ExactTable::new(&table, 1.0));
        let longer = ExactTable::new(&table, 1.000_1);
        for pair in table.nodes().windows(2).filter(|pair| pair[1].scalar > pair[0].scalar) {
            let at = |share: f64| pair[0].scalar + share * (pair[1].scalar - pair[0].scalar);
            for (s0, s1) in [(0.1, 0.9), (0.8, 0.2), (0.0, 1.0), (1.0, 0.0), (0.3, 0.3)] {
                let [a, b] = [pixel(&partial, at(s0), at(s1), 0.1), pixel(&exact, at(s0), at(s1), 0.1)];
                let off = |b: [f32; 4]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                // Extinction is rounded from f64 once instead of three times in f32: x e^-x < 0.4 of 2e-7.
                assert!(off(b) < 3e-7, "seed {seed}: {a:?} {b:?}");
                compared += usize::from(b[3] > 0.01);
                noticed += usize::from(off(pixel(&longer, at(s0), at(s1), 0.1)) > 3e-7);
            }
        }
    }
    assert!(compared > 1000 && noticed > 500, "{compared}, {noticed} lengths off by 1e-4 noticed");
}

#[test]
fn one_color_is_that_color_whatever_the_extinction_does() {
    let mut noticed = 0;
    for seed in 0..60 {
        let gray = random_table(seed).nodes().iter().map(|n| (n.scalar, [0.8, 0.3, 1.0], n.tau)).collect::<Vec<_>>();
        let table = nodes(&gray);
        let partial = PartialTable::new(&table, 1.0);
        for index in 0..60 {
            let ((s0, s1, length), _) = random_segment(&table, seed, index);
            let [r, g, b, alpha] = pixel(&partial, s0, s1, length);
            for (channel, color) in [(r, 0.8), (g, 0.3), (b, 1.0)] {
                // Shares that add up to 1 but for rounding, three times, and products.
                assert!((channel - color * alpha).abs() <= 1e-6 * alpha, "seed {seed}: {channel} {color} {alpha}");
                noticed += usize::from((channel - (color + 1e-5) * alpha).abs() > 1e-6 * alpha);
            }
        }
    }
    assert!(noticed > 5000, "{noticed} of 10800 colors that are off by 1e-5 noticed");
}

#[test]
fn at_a_step_the_side_that_the_segment_goes_to_holds() {
    let step = nodes(&[
        (0.0, [1.0, 0.0, 0.0], 2.0),
        (0.5, [1.0, 0.0, 0.0], 2.0),
        (0.5, [0.0, 0.0, 1.0], 0.5),
        (1.0, [0.0, 0.0, 1.0], 0.5),
    ]);
    let (partial, exact) = (PartialTable::new(&step, 1.0), ExactTable::new(&step, 1.0));
    for (s0, s1) in [(0.5, 0.9), (0.9, 0.5), (0.5, 0.1), (0.1, 0.5), (0.5, 0.5)] {
        assert_eq!(pixel(&partial, s0, s1, 0.7), pixel(&exact, s0, s1, 0.7), "{s0} {s1}");
    }
    // Across it both colours are visible, from either side: two parts, each exact but for 4e-7 of its visible part from the weights.
    for (s0, s1) in [(0.2, 0.8), (0.8, 0.2)] {
        let [color, alpha] = errors(&step, &partial, (s0, s1, 1.0));
        assert!(alpha < 4e-7 && color < 4e-7, "{s0} {s1}: {color:e} {alpha:e}");
    }
    let [color, alpha] = errors(&step, &PartialTable::new(&step, 1.000_01), (0.2, 0.8, 1.0));
    assert!(alpha > 1e-6 && color > 1e-6, "an extinction off by 1e-5: {color:e} {alpha:e}");
    // The first and the last node too; of opacity, which is one exponential rounded to f32.
    let ends = nodes(&[(0.0, [1.0; 3], 0.0), (0.0, [0.2; 3], 1.0), (1.0, [0.4; 3], 2.0), (1.0, [1.0; 3], 9.0)]);
    let partial = PartialTable::new(&ends, 1.0);
    for segment in
        [(-1.0, 2.0, 0.5), (2.0, -1.0, 0.5), (-1.0, 0.0, 3.0), (0.0, -1.0, 3.0), (1.0, 1.5, 0.1), (1.5, 1.0, 0.1)]
    {
        assert!(errors(&ends, &partial, segment)[1] < 3e-7, "{segment:?}");
    }
}

#[test]
fn spikes_far_scalars_and_huge_extinctions_keep_their_opacity() {
    let mut noticed = 0;
    for (offset, width) in [(0.0, 1.0), (1e7, 1.0), (-1e7, 64.0), (0.0, 1e-38), (0.0, 3e38), (1e-3, 1e-9)] {
        let at = |share: f64| offset + share * width;
        // A spike of 1/4096 of the range; a wall in front of which and behind which a mist must still be seen.
        for (spike, wall) in [(4096.0, 1.0), (1e4, 1e30), (1.0, 1e300)] {
            let table = nodes(&[
                (at(0.0), [0.2, 0.4, 0.6], 1e-3),
                (at(0.3), [0.2, 0.4, 0.6], 0.0),
                (at(0.3 + 1.0 / 8192.0), [1.0, 0.0, 0.0], spike),
                (at(0.3 + 1.0 / 4096.0), [0.2, 0.4, 0.6], 0.0),
                (at(0.6), [0.0, 1.0, 0.0], 1e-3),
                (at(0.7), [0.0, 1.0, 0.0], wall),
                (at(0.8), [0.0, 1.0, 0.0], 1e-3),
                (at(1.0), [0.0, 0.0, 1.0], 1e-3),
            ]);
            let partial = PartialTable::new(&table, 1.0);
            for (s0, s1) in
                [(0.1, 0.5), (0.5, 0.1), (0.29, 0.31), (0.45, 0.55), (0.79, 0.99), (0.99, 0.79), (-0.5, 1.5)]
            {
                for length in [1e-9, 1e-3, 0.1, 10.0] {
                    let (s0, s1) = (at(s0), at(s1));
                    let truth = quadrature(&table, s0, s1, length, 0.5)[3];
                    let alpha = f64::from(pixel(&partial, s0, s1, length)[3]);
                    // Relative too: only sums and products of positive f64, then one exponential in f32.
                    let bound = 1e-6 * truth + f64::from(f32::MIN_POSITIVE);
                    assert!(
                        (alpha - truth).abs() <= bound,
                        "{offset} {width} {spike} {wall}: {s0} to {s1} by {length}: {alpha:e} {truth:e}"
                    );
                    let longer = quadrature(&table, s0, s1, length * 1.000_01, 0.5)[3];
                    noticed += usize::from((alpha - longer).abs() > bound);
                }
            }
        }
    }
    assert!(noticed > 100, "{noticed} of 504 lengths off by 1e-5 noticed");
}

#[test]
fn sums_over_blocks_are_those_from_node_to_node() {
    let mut noticed = 0;
    for seed in 0..30 {
        let table = PartialTable::new(&random_table(seed), 1.0);
        for from in 0..table.places {
            let mut sum = Stretch::NOTHING;
            for to in from + 1..table.places {
                let before = sum;
                sum = sum.then(table.behind_place(to - 1));
                let (middle, near) = table.behind(from, to);
                assert!((from + 1..=to).contains(&middle));
                let found = if middle == to { near } else { near.then(table.behind(middle, to).1) };
                assert!(middle == to || table.behind(middle, to).0 == to, "two sums at most");
                // Up to 40 additions of positive numbers, each rounded by 2^-53 of the sum.
                assert!((found.depth - sum.depth).abs() <= 1e-14 * sum.depth, "{from} {to}");
                let off = (found.mean - sum.mean).abs().max_element().max((found.tilt - sum.tilt).abs().max_element());
                // Up to 40 additions in f32, in another order.
                assert!(off < 3e-6, "{from} {to}: {off:e}");
                let is_other = (found.mean - before.mean).abs().max_element() > 3e-6;
                noticed += usize::from((found.depth - before.depth).abs() > 1e-14 * before.depth && is_other);
                let (back, far) = table.behind(to, from);
                let returned = if back == from { far } else { far.then(table.behind(back, from).1) };
                let off = (returned.mean - found.mean)
                    .abs()
                    .max_element()
                    .max((returned.tilt + found.tilt).abs().max_element());
                // The same two sums in the other order: two roundings of f64, and a few of f32 below 1 (6e-8). Measured: 2.4e-7.
                assert!(
                    (returned.depth - found.depth).abs() <= 1e-15 * found.depth && off < 1e-6,
                    "{to} {from}: {off:e}"
                );
            }
        }
    }
    assert!(noticed > 1000, "sums that lack the last place are noticed {noticed} times");
}

#[test]
fn without_extinction_on_the_way_there_is_nothing_to_be_seen() {
    let table = nodes(&[
        (0.0, [1.0; 3], 0.0),
        (0.5, [0.0; 3], 0.0),
        (0.7, [1.0; 3], 3.0),
        (0.9, [1.0; 3], 0.0),
        (1.0, [0.5; 3], 0.0),
    ]);
    let table = PartialTable::new(&table, 1.0);
    let mut light = Accumulator::TRANSPARENT;
    for (s0, s1) in [(-1.0, 0.5), (0.5, -1.0), (0.1, 0.4), (0.9, 3.0), (2.0, 0.9), (0.0, 0.0), (0.5, 0.5), (0.9, 0.9)] {
        assert_eq!(table.segment(&mut table.enter(s0), s0, s1, 5.0, &mut light), 0, "{s0} {s1}");
        assert_eq!((light, table.exact().transparent_share(s0, s1)), (Accumulator::TRANSPARENT, 1.0));
    }
    assert_eq!(table.segment(&mut table.enter(0.4), 0.4, 0.6, 1.0, &mut light), 1);
    assert!(!table.exact().is_transparent() && table.exact().transparent_share(0.4, 0.6) > 0.49);
    let transparent = PartialTable::new(&nodes(&[(0.0, [1.0; 3], 0.0)]), 1.0);
    assert!(transparent.exact().is_transparent());
}

#[test]
fn the_place_of_the_segment_before_changes_nothing() {
    let table = random_table(7);
    let table = PartialTable::new(&table, 1.0);
    for index in 0..40 {
        let ((s0, s1, length), _) = random_segment(&random_table(7), 7, index);
        for mut place in 0..table.interval_count() {
            let mut light = Accumulator::TRANSPARENT;
            table.segment(&mut place, s0, s1, length, &mut light);
            assert_eq!(light.pixel(), pixel(&table, s0, s1, length));
        }
    }
}

#[test]
fn no_table_and_no_segment_gives_anything_but_a_pixel() {
    for seed in 0..60 {
        let scale = [1.0, 1e-44, 3e38, 1e7, 1e-3][seed as usize % 5];
        let mut scalars: Vec<f64> = (0..1 + seed % 7).map(|i| scale * (2.0 * random(seed, i) - 1.0)).collect();
        scalars.sort_by(f64::total_cmp);
        let taus = [0.0, 1e-300, 1e-40, 1e-3, 1.0, 1e6, 1e30, f64::MAX];
        let node = |(i, &scalar): (usize, &f64)| {
            let at = |k: u64| random(seed, 100 + 10 * i as u64 + k);
            Node { scalar, rgb: [at(0), at(1), at(2)], tau: taus[(at(3) * 8.0) as usize] }
        };
        let table = NodeTable::new(scalars.iter().enumerate().map(node).collect()).unwrap();
        let map = ScalarMap::of_table(&table, if scale < 1e-30 { 2f64.powi(100) } else { 1.0 });
        let table = PartialTable::new(&table, 1.0);
        assert!(table.packed(map).iter().flatten().all(|v| v.is_finite()), "seed {seed}");
        for i in 0..200 {
            let scalar = |k| f64::from((scale * (3.0 * random(seed, 1000 + 3 * i + k) - 1.5)) as f32);
            let s0 = if scalar(0).is_finite() { scalar(0) } else { 0.0 };
            let s1 = if i % 5 == 0 || !scalar(1).is_finite() { s0 } else { scalar(1) };
            let length = 10.0f64.powf(-40.0 * random(seed, 1002 + 3 * i));
            let p = pixel(&table, s0, s1, length);
            assert!(p.iter().all(|v| (0.0..=1.000_001).contains(v)), "seed {seed}, segment {i}: {p:?}");
            assert!(p[0].max(p[1]).max(p[2]) <= p[3] * 1.000_01 + 1e-37, "seed {seed}, segment {i}: {p:?}");
        }
    }
}

proptest! {
    #[test]
    fn two_parts_of_a_segment_have_the_opacity_of_the_whole(seed in 0..1000u64, index in 0..1000u64, share in 0.0..1.0f64) {
        let table = random_table(seed);
        let ((s0, s1, length), _) = random_segment(&table, seed, index);
        let partial = PartialTable::new(&table, 1.0);
        let middle = s0 + share * (s1 - s0);
        let mut light = Accumulator::TRANSPARENT;
        let mut place = partial.enter(s0);
        partial.segment(&mut place, s0, middle, share * length, &mut light);
        partial.segment(&mut place, middle, s1, (1.0 - share) * length, &mut light);
        let whole = pixel(&partial, s0, s1, length)[3];
        // The cut is a rounded scalar: 1e-16 of a mean extinction of at most 1e2 over its mean; and three times f32.
        prop_assert!((light.pixel()[3] - whole).abs() < 1e-6, "{} {whole}", light.pixel()[3]);
        // A length that is off by 1e-3 changes x e^-x by that much of it: at least 1e-5 here.
        let longer = pixel(&partial, s0, s1, length * 1.001)[3];
        prop_assert!(!(0.01..0.99).contains(&whole) || (light.pixel()[3] - longer).abs() > 1e-6, "{longer} {whole}");
    }
}
