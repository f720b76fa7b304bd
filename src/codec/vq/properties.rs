//! Property tests on series of any length: reported errors are the actual ones, and exact values stay exact.

use super::test_data::Random;
use super::{Search, VqDecoder, VqEncoder, VqOptions, VqParameters};
use crate::codec::test_objects::Objects;
use crate::codec::{Decoder, Encoder};
use crate::moments::Moments;
use proptest::prelude::*;
use std::sync::Arc;

/// Course of a vertex over time.
#[derive(Clone, Copy, Debug)]
enum Course {
    Constant(f32),
    /// Noise with this mean and deviation.
    Noise(f32, f32),
    /// Noise, and sometimes NaN or infinite.
    Broken(f32, f32),
    Special,
}

fn courses() -> impl Strategy<Value = Course> {
    let mean = prop_oneof![Just(0.0f32), -1.0..1.0f32, Just(1e7f32), Just(-3e-30f32)];
    let deviation = prop_oneof![Just(1e-3f32), Just(1.0f32), Just(1e9f32)];
    prop_oneof![
        prop_oneof![mean.clone(), Just(f32::MAX), Just(1e-45f32)].prop_map(Course::Constant),
        (mean.clone(), deviation.clone()).prop_map(|(m, d)| Course::Noise(m, d)),
        (mean, deviation).prop_map(|(m, d)| Course::Broken(m, d)),
        Just(Course::Special),
    ]
}

const SPECIAL: [u32; 4] = [0x7fc0_0000, 0x7f80_0000, 0xff80_0000, 0xffc1_2345];

fn series(courses: &[Course], steps: usize, seed: u64) -> Vec<f32> {
    let mut random = Random::new(seed);
    let mut values = Vec::new();
    for _ in 0..steps {
        for course in courses {
            let special = f32::from_bits(SPECIAL[(random.next() % 4) as usize]);
            values.push(match *course {
                Course::Constant(value) => value,
                Course::Noise(mean, deviation) => mean + deviation * random.signed(),
                Course::Broken(..) if random.next().is_multiple_of(5) => special,
                Course::Broken(mean, deviation) => mean + deviation * random.signed(),
                Course::Special => special,
            });
        }
    }
    values
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn every_series_comes_back_within_the_error_that_is_reported(
        courses in prop::collection::vec(courses(), 1..24),
        // Blocks of 64 steps: one, several, and a last one of any length.
        steps in prop_oneof![1_usize..10, Just(64), 60_usize..70, 120_usize..140],
        (entries, own_scales, exact) in (2_usize..20, any::<bool>(), any::<bool>()),
        seed: u64,
    ) {
        let vertices = courses.len();
        let values = series(&courses, steps, seed);
        let search = if exact { Search::Exact } else { Search::Fast };
        let mut objects = Objects::default();
        let mut encoder = Box::new(VqEncoder::new(vertices, VqOptions { entries, search, own_scales }));
        let mut moments = Moments::new(vertices);
        for row in values.chunks_exact(vertices) {
            encoder.push(row, &mut objects).unwrap();
            moments.add_step(row);
        }
        let encoded = encoder.finish(&mut objects).unwrap();
        let reported = encoded.errors.unwrap().quality(&moments.vertex_statistics());
        let parameters = VqParameters::read(&encoded.parameters).unwrap();
        prop_assert_eq!(encoded.arrays, parameters.arrays(steps as u64, vertices as u64));
        let decoder = VqDecoder::new(Arc::new(objects), "f", parameters, steps, vertices);

        let (mut largest, mut squares, mut count) = (0.0f64, 0.0, 0);
        let mut out = vec![0.0; vertices];
        for (step, row) in values.chunks_exact(vertices).enumerate() {
            decoder.decode_step(step, &mut out).unwrap();
            for (course, (x, y)) in courses.iter().zip(row.iter().zip(&out)) {
                if !x.is_finite() || matches!(course, Course::Constant(_)) {
                    prop_assert_eq!(x.to_bits(), y.to_bits(), "step {}, {:?}", step, course);
                }
                if x.is_finite() {
                    let error = (f64::from(*x) - f64::from(*y)).abs();
                    (largest, squares, count) = (largest.max(error), squares + error * error, count + 1);
                }
            }
        }
        prop_assert_eq!(reported.max_error, largest);
        // The sums are of the same numbers in another order: each addition rounds by an ulp at most.
        let rmse = (squares / f64::from(count.max(1))).sqrt();
        let is_same = |found: f64| (found - rmse).abs() <= f64::from(count) * f64::EPSILON * rmse;
        prop_assert!(is_same(reported.rmse), "{} {rmse}", reported.rmse);
        prop_assert!(rmse == 0.0 || !is_same(reported.rmse * (1.0 + 1e-9)), "the comparison notices a billionth");
        // No value is farther off than the values of its vertex are apart from their mean, by much: a codebook of one entry does
        // as well. (What noise costs depends on the entries; that it is bounded does not.)
        prop_assert!(largest.is_finite());
    }
}
