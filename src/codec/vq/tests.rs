//! The codec as a whole: against its definition, on special values, on any number of threads, on damaged stores.

use super::encode::encode_block;
use super::test_data::Random;
use super::*;
use crate::codec::test_objects::Objects;
use crate::codec::{Decoder, Encoder, ErrorTally, Quality, StepRequest, chunk_key, seal};
use crate::moments::Moments;
use crate::task::Cancel;
use std::sync::Arc;

/// An encoded series.
struct Coded {
    objects: Objects,
    decoder: VqDecoder,
    quality: Quality,
}

fn code(values: &[f32], vertices: usize, options: VqOptions) -> Coded {
    let mut objects = Objects::default();
    let mut encoder = Box::new(VqEncoder::new(vertices, options));
    let mut moments = Moments::new(vertices);
    for row in values.chunks_exact(vertices) {
        encoder.push(row, &mut objects).unwrap();
        moments.add_step(row);
    }
    let encoded = encoder.finish(&mut objects).unwrap();
    let steps = values.len() / vertices;
    let parameters = VqParameters::read(&encoded.parameters).unwrap();
    let missing = |key: &str| !objects.0.contains_key(&format!("f/{key}"));
    for array in &encoded.arrays {
        let key = chunk_key(&array.name, 0, array.shape.len());
        assert!(!missing(&key) || array.name == "vq/exponent", "{key}");
    }
    let decoder = VqDecoder::new(Arc::new(objects.clone()), "f", parameters, steps, vertices);
    let quality = encoded.errors.unwrap().quality(&moments.vertex_statistics());
    Coded { objects, decoder, quality }
}

impl Coded {
    fn step(&self, step: usize, vertices: usize) -> Vec<f32> {
        let mut out = vec![0.0; vertices];
        self.decoder.decode_step(step, &mut out).unwrap();
        out
    }

    fn all(&self, steps: usize, vertices: usize) -> Vec<f32> {
        (0..steps).flat_map(|step| self.step(step, vertices)).collect()
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Waves of varying place and speed, and a constant vertex in ten.
fn waves(steps: usize, vertices: usize) -> Vec<f32> {
    let wave = |i: usize| {
        let (t, v) = ((i / vertices) as f32, (i % vertices) as f32);
        if i % vertices % 10 == 3 {
            return 0.1 * v;
        }
        let fast = (0.11 * t + 0.037 * v).sin() * (0.013 * v).cos();
        2.0 + fast + 0.3 * (0.031 * t * (1.0 + 0.001 * v)).cos()
    };
    (0..steps * vertices).map(wave).collect()
}

fn options(entries: usize) -> VqOptions {
    VqOptions { entries, ..VqOptions::default() }
}

/// The formula of the module's documentation, entry by entry.
fn by_definition(parts: &block::Encoded, entries: usize, j: usize, v: usize) -> f32 {
    let [a, b] = match &parts.indices {
        block::Indices::Narrow([a, b]) => [usize::from(a[v]), usize::from(b[v])],
        block::Indices::Wide([a, b]) => [usize::from(a[v]), usize::from(b[v])],
    };
    let difference = parts.cb8[group_of_step(j) * entries + a] + parts.cb64[j * entries + b];
    parts.mean[v] + parts.exponent.get(v).map_or(1.0, |&e| 2f32.powi(e.into())) * difference
}

#[test]
fn a_step_is_decoded_as_the_formula_says_for_every_width_of_the_codebook() {
    let (steps, vertices) = (64, 700);
    for entries in [2, 100, 256, 257, 1024, 4000, 16384, 65536] {
        for own_scales in [false, true] {
            let options = VqOptions { own_scales, ..options(entries) };
            let parts = encode_block(&mut waves(steps, vertices), vertices, 0, &options);
            let block = VqBlock::new(parts.clone(), entries, &Cancel::new());
            for j in [0, 7, 8, 63] {
                let mut out = vec![0.0; vertices];
                assert!(block.decode(j, j, &mut out, &Cancel::new()));
                let expected: Vec<f32> = (0..vertices).map(|v| by_definition(&parts, entries, j, v)).collect();
                assert_eq!(bits(&out), bits(&expected), "{entries} {j}");
                let other: Vec<f32> = (0..vertices).map(|v| by_definition(&parts, entries, j ^ 1, v)).collect();
                assert_ne!(bits(&out), bits(&other), "another step is noticed");
                // From anywhere, as threads do it.
                let mut part = vec![0.0; 333];
                block.decode_part(j, j, 300, &mut part);
                assert_eq!(bits(&part), bits(&expected[300..633]));
            }
        }
    }
}

#[test]
fn any_step_is_decoded_in_any_order_and_the_last_block_may_be_short() {
    let vertices = 300;
    for steps in [1, 3, 64, 65, 150] {
        let values = waves(steps, vertices);
        let coded = code(&values, vertices, options(64));
        let forwards = coded.all(steps, vertices);
        for step in (0..steps).rev() {
            assert_eq!(coded.step(step, vertices), forwards[step * vertices..][..vertices]);
        }
        // 64 entries for 300 smooth series: above 40 dB (measured: 46), or something is misplaced.
        assert!(coded.quality.snr_min_db.is_none_or(|snr| snr > 40.0), "{steps}: {:?}", coded.quality);
        let worst = values.iter().zip(&forwards).map(|(x, y)| f64::from(x - y).abs()).fold(0.0, f64::max);
        // The difference is rounded here, by 2^-24 of itself, and not there. Measured: the same.
        assert!((worst - coded.quality.max_error).abs() <= 6e-8 * worst, "{worst} {:?}", coded.quality);
        assert!(coded.decoder.decode_step(steps, &mut vec![0.0; vertices]).is_err());
    }
}

#[test]
fn constants_come_back_bit_for_bit() {
    let vertices = 200;
    let mut values = waves(100, vertices);
    let constants = [0.0, -0.0, 1e-45, -3.4e38, 0.1, 1e20];
    values.iter_mut().enumerate().for_each(|(i, x)| {
        if i % vertices % 3 == 0 {
            *x = constants[i % vertices / 3 % 6];
        }
    });
    for own_scales in [false, true] {
        let coded = code(&values, vertices, VqOptions { own_scales, ..options(16) });
        for (i, x) in coded.all(100, vertices).iter().enumerate().filter(|(i, _)| i % vertices % 3 == 0) {
            assert_eq!(x.to_bits(), values[i].to_bits(), "{i}");
        }
    }
}

#[test]
fn special_values_come_back_bit_for_bit_and_change_no_other_value() {
    let (steps, vertices) = (130, 400);
    let mut filled = waves(steps, vertices);
    let mut special = filled.clone();
    let payload = f32::from_bits(0x7FA0_1234); // a signalling NaN
    let places = [(5, 7, payload), (70, 7, f32::INFINITY), (129, 399, f32::NEG_INFINITY), (64, 0, f32::NAN)];
    for (step, v, x) in places {
        special[step * vertices + v] = x;
        // What the gap is filled with: halfway between its neighbours, or the value beside it at an end of a block.
        let at = |step: usize| f64::from(filled[step * vertices + v]);
        let inner = (step + 1 < steps && step % 64 != 0).then(|| 0.5 * at(step - 1) + 0.5 * at(step + 1));
        filled[step * vertices + v] =
            inner.unwrap_or_else(|| at(if step % 64 == 0 { step + 1 } else { step - 1 })) as f32;
    }
    let [with, without] = [&special, &filled].map(|values| code(values, vertices, options(32)).all(steps, vertices));
    let mut patched = without.clone();
    for (step, v, x) in places {
        assert!(patched[step * vertices + v].is_finite());
        patched[step * vertices + v] = x;
    }
    assert_eq!(bits(&with), bits(&patched));
    assert_ne!(bits(&with), bits(&without));
}

#[test]
fn a_single_nan_leaves_the_other_values_as_close_as_they_were() {
    let (steps, vertices) = (64, 2000);
    let clean = waves(steps, vertices);
    let before = code(&clean, vertices, options(64));
    let mut holed = clean.clone();
    holed[30 * vertices + 1234] = f32::NAN;
    let after = code(&holed, vertices, options(64));
    assert_eq!(after.all(steps, vertices).iter().filter(|x| !x.is_finite()).count(), 1);
    // Measured: 4e-6 more.
    assert!(after.quality.rmse < 1.00004 * before.quality.rmse, "{:?} {:?}", before.quality, after.quality);
}

#[test]
fn a_nan_whose_filling_is_what_was_there_changes_no_bit_of_the_others() {
    let (steps, vertices) = (64, 500);
    let clean = waves(steps, vertices);
    // Vertex 103 is constant: the filling between two equal values is that value.
    let at = 30 * vertices + 103;
    let mut holed = clean.clone();
    holed[at] = f32::NAN;
    let [before, mut after] = [&clean, &holed].map(|values| code(values, vertices, options(64)).all(steps, vertices));
    assert!(after[at].is_nan());
    after[at] = before[at];
    assert_eq!(bits(&before), bits(&after));
}

#[test]
fn vertices_and_series_of_special_values_alone_are_kept() {
    let (steps, vertices) = (70, 50);
    let mut values = waves(steps, vertices);
    values.iter_mut().enumerate().for_each(|(i, x)| {
        if i % vertices == 4 {
            *x = f32::NAN;
        }
        if i % vertices == 5 && i / vertices % 2 == 0 {
            *x = f32::INFINITY;
        }
    });
    let coded = code(&values, vertices, options(256));
    for (x, y) in values.iter().zip(coded.all(steps, vertices)).filter(|(x, _)| !x.is_finite()) {
        assert_eq!(x.to_bits(), y.to_bits());
    }
    let nothing = vec![f32::NAN; steps * vertices];
    assert_eq!(bits(&code(&nothing, vertices, options(256)).all(steps, vertices)), bits(&nothing));
}

#[test]
fn more_special_values_than_a_chunk_has_rows_are_kept() {
    let (steps, vertices) = (128, 700);
    let mut values = waves(steps, vertices);
    // Every other value: no two of them in a run.
    let hole = |i: usize| (i / vertices + i).is_multiple_of(2);
    values.iter_mut().enumerate().filter(|(i, _)| hole(*i)).for_each(|(_, x)| *x = f32::NAN);
    let coded = code(&values, vertices, options(64));
    assert!(coded.objects.0.keys().filter(|key| key.contains("/special/")).count() > 2);
    assert!(coded.all(steps, vertices).iter().enumerate().all(|(i, x)| x.is_nan() == hole(i)));
    // And a few cost no more than themselves.
    let mut values = waves(steps, vertices);
    values[70 * vertices] = f32::NAN;
    values[90 * vertices] = f32::NAN;
    let coded = code(&values, vertices, options(64));
    assert_eq!(coded.objects.0["f/vq/special/c/0/0"].len(), 2 * 16 + 4);
    assert!(coded.step(90, vertices)[0].is_nan() && coded.step(89, vertices)[0].is_finite());
}

#[test]
fn a_large_offset_costs_the_rounding_of_its_numbers_and_no_more() {
    let (steps, vertices) = (130, 600);
    let plain = waves(steps, vertices);
    let rmse = |offset: f32| {
        let values: Vec<f32> = plain.iter().map(|x| (x - 2.0) + offset).collect();
        code(&values, vertices, options(64)).quality.rmse
    };
    let zero_mean = rmse(0.0);
    // Measured: 4.5e-10.
    assert!((rmse(2.0) - zero_mean).abs() < 5e-9 * zero_mean, "only roundings may fall otherwise");
    for offset in [1e3f32, -1e6] {
        // Values, means and results are each rounded to the spacing of floats there, by half of it at most.
        let spacing = f64::from(offset.abs()) * f64::from(f32::EPSILON);
        assert!(rmse(offset) <= zero_mean + 1.5 * spacing, "{offset}");
    }
}

#[test]
fn one_vertex_and_constant_fields_are_kept_for_any_number_of_steps() {
    for steps in [1, 2, 64, 65, 130] {
        let one: Vec<f32> = waves(steps, 7).chunks_exact(7).map(|row| row[5]).collect();
        let decoded = code(&one, 1, options(256)).all(steps, 1);
        for (x, y) in one.iter().zip(&decoded) {
            // Mean, two differences and their two sums are rounded, all below 4.
            assert!((x - y).abs() <= 5.0 * 2.0 * f32::EPSILON, "{steps}: {x} {y}");
            assert!((x * 1.000_01 - y).abs() > 5.0 * 2.0 * f32::EPSILON, "a hundred-thousandth is noticed");
        }
        let constant = vec![-273.15; steps * 9];
        let coded = code(&constant, 9, options(256));
        assert_eq!(bits(&coded.all(steps, 9)), bits(&constant));
        assert_eq!((coded.quality.snr_db, coded.quality.max_error), (None, 0.0));
    }
}

/// A decoder by the documentation of [`VqBlock`], from its slices alone.
fn decoded_elsewhere(block: &VqBlock, step: usize) -> Vec<f32> {
    let (j, n) = (step % STEPS, block.row_len());
    let index = |v: usize| match block.indices() {
        Indices::Narrow([a, b]) => [usize::from(a[v]), usize::from(b[v])],
        Indices::Wide([a, b]) => [usize::from(a[v]), usize::from(b[v])],
    };
    let value = |(v, &mean): (usize, &f32)| {
        let [first, second] = index(v);
        let scale = block.exponents().get(v).map_or(1.0, |&e| block.powers()[usize::from(e.cast_unsigned())]);
        mean + scale * (block.cb8()[j / 8 * n + first] + block.cb64()[j * n + second])
    };
    let mut out: Vec<f32> = block.means().iter().enumerate().map(value).collect();
    for s in block.specials().iter().filter(|s| (s.first as usize..(s.first + s.count) as usize).contains(&step)) {
        out[s.vertex as usize] = f32::from_bits(s.bits);
    }
    out
}

#[test]
fn the_slices_of_a_resident_block_decode_to_the_same_bits() {
    let (steps, vertices) = (70, 300);
    let mut values = waves(steps, vertices);
    values[2 * vertices + 5] = f32::NAN;
    values[66 * vertices + 5] = f32::INFINITY;
    for (entries, own_scales) in [(16, false), (300, false), (300, true), (5000, false)] {
        let coded = code(&values, vertices, VqOptions { own_scales, ..options(entries) });
        for step in [0, 2, 63, 64, 66, 69] {
            let block = coded.decoder.resident_block(step).unwrap();
            assert_eq!(bits(&decoded_elsewhere(&block, step)), bits(&coded.step(step, vertices)), "{entries} {step}");
            assert_ne!(bits(&decoded_elsewhere(&block, step ^ 1)), bits(&coded.step(step, vertices)), "another step");
            assert_eq!([block.cb8().len(), block.cb64().len()], [8 * block.row_len(), 64 * block.row_len()]);
            assert!(block.row_len().is_power_of_two() && block.row_len() >= entries);
        }
        assert!(coded.decoder.resident_block(70).is_err());
    }
}

/// Series over 24 orders of magnitude.
fn decades(steps: usize, vertices: usize) -> Vec<f32> {
    let waves = waves(steps, vertices);
    let size = |v: usize| 10f32.powf(24.0 * v as f32 / vertices as f32 - 12.0);
    (0..steps * vertices).map(|i| size(i % vertices) * (waves[i] - 2.0)).collect()
}

#[test]
fn with_a_scale_of_its_own_every_vertex_of_a_huge_range_is_close() {
    let (steps, vertices) = (64, 3000);
    let values = decades(steps, vertices);
    let common = code(&values, vertices, options(256));
    let own = code(&values, vertices, VqOptions { own_scales: true, ..options(256) });
    assert!(common.quality.over_sigma.median > 0.9, "a common scale loses all but the largest");
    let sigma = own.quality.over_sigma;
    // Measured: 0.06 and 0.12.
    assert!(sigma.median < 0.1 && sigma.p99 < 0.2, "{sigma:?}");
}

#[test]
fn the_largest_numbers_and_the_smallest_stay_finite() {
    let (steps, vertices) = (64, 100);
    let mut random = Random::new(3);
    let sizes = [f32::MAX, 1e38, 1e-38, 1e-44];
    let values: Vec<f32> = (0..steps * vertices).map(|i| sizes[i % vertices % 4] * random.signed().signum()).collect();
    let coded = code(&values, vertices, options(16));
    let decoded = coded.all(steps, vertices);
    assert!(decoded.iter().all(|x| x.is_finite()));
    assert!(coded.quality.max_error.is_finite());
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let (steps, vertices) = (80, 20_000);
    let values = waves(steps, vertices);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let coded = pool.install(|| code(&values, vertices, options(300)));
        (coded.objects, coded.quality)
    };
    let (one, three) = (with(1), with(3));
    assert!(one.0 == three.0 && one.1 == three.1);
    assert!(one.1.rmse > 0.0, "a code without errors would hide another one");
}

#[test]
fn the_fast_search_is_within_half_a_decibel_of_full_lbg() {
    let vertices = 20_000;
    let values = waves(64, vertices);
    for entries in [64, 256] {
        let snr =
            |search, entries| code(&values, vertices, VqOptions { search, ..options(entries) }).quality.snr_db.unwrap();
        let (fast, exact) = (snr(Search::Fast, entries), snr(Search::Exact, entries));
        let fewer = snr(Search::Fast, entries * 3 / 4);
        // Measured: 0.2 dB, and 0.9 dB with a quarter of the entries less.
        assert!(fast > exact - 0.5, "{entries}: {fast} against {exact}");
        assert!(
            fewer <= exact - 0.5,
            "{entries}: a quarter of the entries less is not noticed: {fewer} against {exact}"
        );
    }
}

#[test]
fn more_entries_are_closer() {
    let (steps, vertices) = (64, 5000);
    let values = waves(steps, vertices);
    let rmse = |entries: usize| code(&values, vertices, options(entries)).quality.rmse;
    let errors = [4, 32, 256, 2048].map(rmse);
    // Measured: 0.39 and less.
    assert!(errors.windows(2).all(|w| w[1] < 0.5 * w[0]), "{errors:?}");
}

#[test]
fn every_damaged_chunk_is_noticed_and_other_blocks_play() {
    let (steps, vertices) = (70, 40);
    let mut values = decades(steps, vertices);
    values[66 * vertices + 3] = f32::NAN;
    let coded = code(&values, vertices, VqOptions { own_scales: true, ..options(16) });
    let parameters = VqParameters { specials: 1, exponents: true, ..VqParameters::new(&options(16), true, 1) };
    let expected = coded.step(5, vertices);
    let keys: Vec<&String> = coded.objects.0.keys().filter(|key| key.contains("/c/1/")).collect();
    assert_eq!(keys.len(), 6, "{keys:?}");
    for key in keys {
        for damage in [|b: &mut Vec<u8>| b[3] ^= 4, |b: &mut Vec<u8>| b.truncate(9), |b: &mut Vec<u8>| b.push(0)] {
            let mut objects = coded.objects.clone();
            damage(objects.0.get_mut(key).unwrap());
            let decoder = VqDecoder::new(Arc::new(objects), "f", parameters.clone(), steps, vertices);
            let mut out = vec![0.0; vertices];
            let error = decoder.decode_step(69, &mut out).unwrap_err();
            assert_eq!((error.path.to_str().unwrap(), error.place.as_str()), (key.as_str(), "step 69"));
            decoder.decode_step(5, &mut out).unwrap();
            assert_eq!(bits(&out), bits(&expected));
        }
    }
}

#[test]
fn sound_chunks_with_senseless_content_are_refused() {
    let (steps, vertices) = (64, 40);
    let mut values = waves(steps, vertices);
    values[3] = f32::NAN;
    let coded = code(&values, vertices, options(16));
    let parameters = VqParameters::new(&options(16), false, 1);
    let with = |key: &str, byte: usize, value: u8| {
        let mut objects = coded.objects.clone();
        let chunk = objects.0.get_mut(key).unwrap();
        chunk.truncate(chunk.len() - 4);
        chunk[byte] = value;
        let checksum = seal(chunk);
        chunk.extend(checksum);
        VqDecoder::new(Arc::new(objects), "f", parameters.clone(), steps, vertices).decode_step(0, &mut [0.0; 40])
    };
    assert!(with("f/vq/i8/c/0/0", 7, 15).is_ok());
    assert!(with("f/vq/i8/c/0/0", 7, 16).is_err(), "an entry that the codebook lacks");
    assert!(with("f/vq/special/c/0/0", 0, 39).is_ok());
    assert!(with("f/vq/special/c/0/0", 0, 40).is_err(), "a vertex that the mesh lacks");
    assert!(with("f/vq/special_start/c/0", 0, 2).is_err(), "a block that begins behind its end");
    assert!(with("f/vq/special_start/c/0", 8, 2).is_err(), "rows that there are not");
}

fn resident(coded: &Coded) -> u64 {
    coded.decoder.cache.statistics().resident_bytes
}

#[test]
fn a_block_is_read_once_and_few_are_kept() {
    let (steps, vertices) = (64 * 5, 20);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let coded = one_thread.install(|| code(&waves(steps, vertices), vertices, options(16)));
    let read = |step: usize| coded.decoder.decode_step(step, &mut [0.0; 20]).unwrap().bytes_read;
    let whole = read(0);
    assert_eq!(whole, (20 * (4 + 1 + 1) + 72 * 16 * 4) as u64);
    assert_eq!([read(63), read(0), read(64), read(1)], [0, 0, whole, 0]);
    let one = resident(&coded) / 2;
    (0..5).for_each(|block| assert!(read(64 * block) <= whole));
    assert_eq!(resident(&coded), 3 * one);
    assert_eq!([read(64 * 4), read(0)], [0, whole]);
}

#[test]
fn threads_that_ask_for_one_block_load_it_once() {
    let coded = code(&waves(64, 5000), 5000, options(16));
    let bytes = std::sync::atomic::AtomicU64::new(0);
    std::thread::scope(|scope| {
        for step in 0..8 {
            let (coded, bytes) = (&coded, &bytes);
            scope.spawn(move || {
                let read = coded.decoder.decode_step(step, &mut vec![0.0; 5000]).unwrap().bytes_read;
                bytes.fetch_add(read, std::sync::atomic::Ordering::SeqCst);
            });
        }
    });
    assert_eq!(bytes.into_inner(), (5000 * 6 + 72 * 16 * 4) as u64);
}

#[test]
fn the_tally_is_that_of_the_decoder() {
    let (steps, vertices) = (100, 500);
    let values = waves(steps, vertices);
    let coded = code(&values, vertices, options(8));
    let decoded = coded.all(steps, vertices);
    let mut tally = ErrorTally::new(vertices);
    tally.add(&values, |j, first, out| out.copy_from_slice(&decoded[j * vertices + first..][..out.len()]));
    let mut moments = Moments::new(vertices);
    values.chunks_exact(vertices).for_each(|row| _ = moments.add_step(row));
    assert_eq!(tally.quality(&moments.vertex_statistics()), coded.quality);
    assert!(coded.quality.rmse > 0.0, "a code without errors would hide another tally");
}

#[test]
fn chunks_that_are_wanted_have_the_bits_of_the_whole_step_and_others_are_left_alone() {
    let (steps, vertices) = (70, 1000);
    let mut values = waves(steps, vertices);
    // Special values replace some of the codebooks' ones.
    for i in (0..values.len()).step_by(37) {
        values[i] = f32::NAN;
    }
    let coded = code(&values, vertices, options(16));
    for (step, length) in [(0, 64), (63, 1), (64, 300), (69, 1000), (69, 5000)] {
        let whole = coded.step(step, vertices);
        let chunks: Vec<bool> = (0..vertices.div_ceil(length)).map(|i| i % 3 == 1 || length >= 1000).collect();
        let mut out = vec![7.0; vertices];
        let wanted = crate::codec::Wanted { length, chunks: &chunks };
        let request = StepRequest { step, wanted: Some(wanted), cancel: &Cancel::new() };
        let cost = coded.decoder.decode_step_unless(request, &mut out).unwrap().unwrap();
        let is_wanted = |v: usize| chunks[v / length];
        let count = (0..vertices).filter(|&v| is_wanted(v)).count();
        assert_eq!(cost.vertices_decoded, count as u64, "{step} {length}");
        for v in 0..vertices {
            let expected = if is_wanted(v) { whole[v] } else { 7.0 };
            assert_eq!(out[v].to_bits(), expected.to_bits(), "step {step}, chunks of {length}, vertex {v}");
        }
    }
    let cancelled = Cancel::new();
    cancelled.cancel();
    let wanted = crate::codec::Wanted { length: vertices, chunks: &[true] };
    let request = StepRequest { step: 0, wanted: Some(wanted), cancel: &cancelled };
    assert!(coded.decoder.decode_step_unless(request, &mut vec![0.0; vertices]).unwrap().is_none());
}
