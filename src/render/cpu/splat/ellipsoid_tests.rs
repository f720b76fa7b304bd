use super::*;
use crate::random::SplitMix64;
use glam::{DMat3, DQuat};

const COUNT: usize = 100_000;

fn direction(random: &mut SplitMix64) -> DVec3 {
    loop {
        let v = DVec3::from_array(std::array::from_fn(|_| random.between(-1.0, 1.0)));
        if (0.01..1.0).contains(&v.length()) {
            return v.normalize();
        }
    }
}

fn rotation(random: &mut SplitMix64) -> DMat3 {
    DMat3::from_quat(DQuat::from_axis_angle(direction(random), random.between(0.0, 6.0)))
}

/// An ellipsoid with half axes from `least` to 1, about a point `center`.
fn ellipsoid(random: &mut SplitMix64, least: f64, center: DVec3) -> Ellipsoid {
    let axes = DVec3::from_array(std::array::from_fn(|_| least.powf(random.unit())));
    let a = rotation(random) * DMat3::from_diagonal(axes) * rotation(random);
    Ellipsoid { center, rows: [a.row(0), a.row(1), a.row(2)] }
}

fn matrix(of: &Ellipsoid) -> DMat3 {
    DMat3::from_cols(of.rows[0], of.rows[1], of.rows[2]).transpose()
}

/// An image-plane point whose ray passes at most 1.3 of an ellipsoid away.
fn near(random: &mut SplitMix64, of: &Ellipsoid) -> (f64, f64) {
    let p = of.center + matrix(of) * (1.3 * random.unit().cbrt() * direction(random));
    (p.x / p.z, p.y / p.z)
}

/// By the quadratic in the space of the sphere: q, and the depths of the chord's middle and of half of it.
fn by_quadratic(of: &Ellipsoid, (px, py): (f64, f64)) -> [f64; 3] {
    let inverse = matrix(of).inverse();
    let (along, from) = (inverse * DVec3::new(px, py, 1.0), inverse * -of.center);
    let (a, b, c) = (along.dot(along), from.dot(along), from.dot(from));
    let q = c - b * b / a;
    [q, -b / a, (1.0 - q).max(0.0).sqrt() / a.sqrt()]
}

#[test]
fn chords_are_those_of_the_quadratic_in_f64() {
    let mut random = SplitMix64::new(31);
    let (mut hits, mut worst) = (0, [0.0f64; 3]);
    for _ in 0..COUNT {
        let center = DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(3.0, 6.0));
        let of = ellipsoid(&mut random, 0.3, center);
        let at = near(&mut random, &of);
        let [q, middle, half] = by_quadratic(&of, at);
        match of.chord(true, at) {
            Some(chord) => {
                hits += 1;
                // The square root of a difference: near the rim half of the digits are left.
                let errors = [chord.q - q, chord.middle - middle, chord.half_depth(of.det()).powi(2) - half.powi(2)];
                worst = std::array::from_fn(|i| worst[i].max(errors[i].abs()));
                let u = DVec3::from_array(chord.at);
                assert!((of.center + matrix(&of) * u).z - chord.middle < 1e-12, "the middle is at its depth");
            }
            None => assert!(q > 1.0 - 1e-12, "{q}"),
        }
    }
    assert!(hits > COUNT / 4, "{hits}");
    assert!(worst.iter().all(|&error| error < 1e-12), "{worst:?}");
    // A row that is a billionth off is noticed.
    let of = Ellipsoid { center: DVec3::new(0.1, 0.2, 4.0), rows: [DVec3::X, 0.5 * DVec3::Y, DVec3::Z] };
    let mut off = of;
    off.rows[1].x += 1e-9;
    assert!((off.chord(true, (0.1, 0.1)).unwrap().q - by_quadratic(&of, (0.1, 0.1))[0]).abs() > 1e-12);
}

/// Greatest errors of q and of the depth of the middle in f32, over 2^-24 |r_x| |r_y| / |n|, and for the depth |r_w|.
fn errors_in_f32(chord: impl Fn([[f32; 3]; 3], [f32; 3]) -> Option<(f32, f32)>) -> [f64; 2] {
    let mut random = SplitMix64::new(32);
    let mut worst = [0.0f64; 2];
    for _ in 0..COUNT {
        let of = ellipsoid(&mut random, 1e-6, DVec3::ZERO);
        let u = random.unit().cbrt() * direction(&mut random);
        let (rows, center) = (of.rows.map(|row| row.as_vec3()), (-(matrix(&of) * u)).as_vec3());
        // The same rounded numbers in both precisions.
        let exact = Ellipsoid { center: center.as_dvec3(), rows: rows.map(|row| row.as_dvec3()) };
        let ([x, y, w], n) = (exact.rows, exact.rows[0].cross(exact.rows[1]));
        let unit = (-24.0f64).exp2() * x.length() * y.length() / n.length();
        let found = chord(rows.map(|row| row.to_array()), center.to_array());
        let Some(expected) = Chord::of(exact.rows.map(|row| row.to_array()), exact.center.to_array()) else {
            continue;
        };
        // Where the bound is an eighth of the sphere or more, it says nothing.
        if let Some((q, middle)) = found.filter(|_| unit < 1.0 / 64.0) {
            let depth = unit * w.length() + (-24.0f64).exp2() * exact.center.z.abs();
            worst[0] = worst[0].max((f64::from(q) - expected.q).abs() / unit);
            worst[1] = worst[1].max((f64::from(middle) - expected.middle).abs() / depth);
        }
    }
    worst
}

#[test]
fn chords_in_f32_are_right_within_8_units_of_the_angle_between_the_rows_down_to_slivers_of_a_millionth() {
    let ours = errors_in_f32(|rows, center| Chord::of(rows, center).map(|chord| (chord.q, chord.middle)));
    assert!(ours.iter().all(|&error| error <= 8.0), "{ours:?}");
    // By the normal equations: u = B^T (B B^T)^-1 b.
    let normal = errors_in_f32(|[x, y, w], [cx, cy, cw]| {
        let (xx, xy, yy) = (dot(x, x), dot(x, y), dot(y, y));
        let det = xx * yy - xy * xy;
        let (a, b) = ((cy * xy - cx * yy) / det, (cx * xy - cy * xx) / det);
        let u = [0, 1, 2].map(|i| a * x[i] + b * y[i]);
        Some((dot(u, u), cw + dot(w, u)))
    });
    assert!(normal.iter().all(|&error| error > 100.0), "{normal:?}");
}

#[test]
fn an_ellipsoid_around_a_tet_touches_its_corners_and_has_its_weights() {
    let mut random = SplitMix64::new(33);
    let corners: [DVec3; 4] = std::array::from_fn(|_| direction(&mut random) + DVec3::new(0.0, 0.0, 4.0));
    let of = Ellipsoid::of_tet(corners);
    for (i, v) in CORNERS.iter().enumerate() {
        let unit = PER_SQRT_3 * *v;
        assert!((of.center + matrix(&of) * unit - corners[i]).length() < 1e-14);
        let weights = weights_in_tet(unit.to_array());
        assert!((0..4).all(|j| (weights[j] - f64::from(u8::from(i == j))).abs() < 1e-14));
    }
    let volume = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(corners[3] - corners[0]).abs() / 6.0;
    assert!((of.det() - 27.0 * volume / (8.0 * 3.0f64.sqrt())).abs() < 1e-14);
    assert!(matrix(&of).determinant() * (corners[1] - corners[0]).dot(DVec3::ONE).signum() != 0.0);
}

#[test]
fn bounds_on_the_screen_are_reached_and_never_passed_wherever_the_eye_is() {
    let mut random = SplitMix64::new(34);
    let (mut inside, mut around, mut ahead, mut behind) = (0, 0, 0, 0);
    for _ in 0..2000 {
        let center = 2.0 * direction(&mut random) * random.unit();
        let of = ellipsoid(&mut random, 0.05, center);
        let a = matrix(&of);
        let bounds = of.bounds(true);
        let surface = (0..2000).map(|_| of.center + a * direction(&mut random)).filter(|p| p.z > 0.0);
        let seen = surface.fold([[f64::INFINITY, f64::NEG_INFINITY]; 2], |range, p| {
            let at = [p.x / p.z, p.y / p.z];
            std::array::from_fn(|i| [range[i][0].min(at[i]), range[i][1].max(at[i])])
        });
        let Some(bounds) = bounds else {
            behind += 1;
            assert!(seen[0][0] == f64::INFINITY);
            continue;
        };
        let is_inside = (a.inverse() * of.center).length() < 1.0;
        inside += u32::from(is_inside);
        for axis in 0..2 {
            let [lo, hi] = bounds[axis];
            assert!(lo <= seen[axis][0] + 1e-9 && hi >= seen[axis][1] - 1e-9, "{bounds:?} {seen:?}");
            assert!(!is_inside || lo == f64::NEG_INFINITY && hi == f64::INFINITY);
            ahead += u32::from(lo.is_finite() && hi.is_finite());
            around += u32::from(lo.is_finite() != hi.is_finite());
            // A plane through the eye at a finite bound touches: its least q is 1.
            for end in [lo, hi].into_iter().filter(|end| end.is_finite()) {
                let across = of.rows[axis] - end * of.rows[2];
                let off = of.center[axis] - end * of.center.z;
                assert!((off * off / across.length_squared() - 1.0).abs() < 1e-6);
            }
        }
    }
    assert!(inside > 50 && around > 50 && ahead > 50 && behind > 50, "{inside} {around} {ahead} {behind}");
    let parallel = Ellipsoid::ball(DVec3::new(1.0, 2.0, -5.0), 0.5).bounds(false);
    assert_eq!(parallel, Some([[0.5, 1.5], [1.5, 2.5]]));
}

#[test]
fn sections_and_spread_are_those_of_its_points() {
    let mut random = SplitMix64::new(35);
    for _ in 0..200 {
        let of = ellipsoid(&mut random, 0.2, DVec3::new(0.3, -0.2, 5.0));
        let a = matrix(&of);
        let p = of.center + a * direction(&mut random);
        let Conic { center, matrix, level } = of.section(p.z);
        let off = DVec2::new(p.x, p.y) - center;
        assert!((off.dot(matrix * off) - level).abs() < 1e-10, "a point of its surface is on the rim of its section");
        let tiny = of.scaled(1e-5);
        let spread = tiny.spread(true);
        let [[lo, hi], [bottom, top]] = tiny.bounds(true).unwrap();
        for (width, variance) in [(hi - lo, spread.x_axis.x), (top - bottom, spread.y_axis.y)] {
            assert!((0.5 * width / variance.sqrt() - 1.0).abs() < 1e-8);
        }
    }
}

#[test]
fn what_is_narrower_than_half_a_pixel_is_widened_to_it_and_nothing_else() {
    let mut random = SplitMix64::new(36);
    for case in 0..300 {
        let perspective = case % 2 == 0;
        let mut of = ellipsoid(&mut random, 1e-4, DVec3::new(0.3, -0.2, 5.0));
        if case % 3 == 0 {
            // Flat, and edge-on.
            of.rows[0] = 0.5 * of.rows[1];
        }
        let half_axes = |of: &Ellipsoid| {
            let m = of.spread(perspective);
            let (middle, half) = (0.5 * (m.x_axis.x + m.y_axis.y), 0.5 * (m.x_axis.x - m.y_axis.y));
            let root = half.hypot(m.x_axis.y);
            [middle + root, (middle - root).max(0.0)].map(f64::sqrt)
        };
        let least = 0.01;
        let before = half_axes(&of);
        match of.widened(perspective, least) {
            None => assert!(before[1] >= least * (1.0 - 1e-6)),
            Some(wide) => {
                let after = half_axes(&wide);
                for axis in 0..2 {
                    assert!((after[axis] - before[axis].max(least)).abs() < 1e-6, "{before:?} {after:?}");
                }
            }
        }
    }
    let behind = Ellipsoid::ball(DVec3::new(0.0, 0.0, -1.0), 1e-9);
    assert_eq!(behind.widened(true, 0.1), None);
    let point = Ellipsoid::ball(DVec3::Z, 0.0).widened(true, 0.1).unwrap();
    assert!((point.rows[0].cross(point.rows[1]).length() - 0.01).abs() < 1e-15);
}
