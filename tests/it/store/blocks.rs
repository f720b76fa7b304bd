//! Readers that share a cache: the same bits for any budget, loaded ahead, cancelled, damaged.

use super::{Formulas, import, sample};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tetreel::codec::vq::VqOptions;
use tetreel::codec::{BlockCache, StepRequest};
use tetreel::ingest::{CodecChoice, IngestOptions};
use tetreel::store::{FieldReader, Store};
use tetreel::task::Cancel;

/// Three blocks of `vq`, the last one short.
const STEPS: usize = 140;

fn source() -> Formulas {
    Formulas {
        value: Box::new(|_, component, step, i| match (step, i) {
            (66, 20) => f32::NAN,
            _ => (i as f32 * 0.37).sin() + (component + 1) as f32 * (0.1 * step as f32 + 0.01 * i as f32).cos(),
        }),
        ..sample(STEPS)
    }
}

/// A store of each codec with a scalar and a vector.
fn stores(dir: &Path) -> [PathBuf; 2] {
    let vq = CodecChoice::new(VqOptions { entries: 16, ..VqOptions::default() });
    [("raw.zarr", IngestOptions::default().codec), ("vq.zarr", vq)].map(|(name, codec)| {
        let fields = ["T", "velocity"].map(|field| field.parse().unwrap()).to_vec();
        import(&source(), &dir.join(name), &IngestOptions { fields, codec, ..Default::default() }).unwrap();
        dir.join(name)
    })
}

fn reader(store: &Path, field: &str, cache: &Arc<BlockCache>) -> FieldReader {
    Store::open(store).unwrap().field_with(&field.parse().unwrap(), cache.clone()).unwrap()
}

fn bits(reader: &FieldReader, step: usize) -> Vec<u32> {
    let mut out = vec![0.0; reader.value_count()];
    reader.decode_step(step, &mut out).unwrap();
    out.iter().map(|x| x.to_bits()).collect()
}

/// All steps, by a reader without a cache to share.
fn all_bits(store: &Path, field: &str) -> Vec<Vec<u32>> {
    let plain = Store::open(store).unwrap().field(&field.parse().unwrap()).unwrap();
    (0..STEPS).map(|step| bits(&plain, step)).collect()
}

/// Bytes in memory of the largest block.
fn largest_block(store: &Path, field: &str) -> u64 {
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let reader = reader(store, field, &cache);
    reader.expect(&(0..STEPS).collect::<Vec<_>>());
    let (mut before, mut largest) = (0, 0);
    while reader.prefetch(&Cancel::new()).unwrap() {
        let now = cache.statistics().resident_bytes;
        (before, largest) = (now, largest.max(now - before));
    }
    largest
}

#[test]
fn every_step_has_the_same_bits_for_any_budget_and_from_one_to_four_threads() {
    let dir = tempfile::tempdir().unwrap();
    for store in &stores(dir.path()) {
        for field in ["T", "velocity:mag"] {
            let expected = all_bits(store, field);
            let block = largest_block(store, field);
            assert!(expected[0] != expected[1], "another step is noticed");
            for (threads, budget) in [(1, 0), (2, 0), (3, block), (4, 3 * block), (2, 7 * block), (4, u64::MAX)] {
                let cache = Arc::new(BlockCache::new(budget));
                let reader = reader(store, field, &cache);
                std::thread::scope(|scope| {
                    for thread in 0..threads {
                        let (reader, expected) = (&reader, &expected);
                        scope.spawn(move || {
                            // Each in its own direction; 37 is prime to the number of steps.
                            for i in 0..STEPS {
                                let step = [i, STEPS - 1 - i, 37 * i % STEPS, i][thread];
                                reader.expect(&[step, (step + 1) % STEPS, (step + 100) % STEPS]);
                                reader.prefetch(&Cancel::new()).unwrap();
                                assert_eq!(bits(reader, step), expected[step], "{step} {threads} {budget}");
                            }
                        });
                    }
                });
                let statistics = cache.statistics();
                assert!(statistics.resident_bytes <= budget || statistics.resident_blocks == 1, "{statistics:?}");
                assert!(
                    statistics.loads > 0 && statistics.peak_bytes <= budget.saturating_add(block),
                    "{statistics:?}"
                );
            }
        }
    }
}

#[test]
fn whatever_is_played_in_its_direction_is_in_memory_when_it_is_shown() {
    let dir = tempfile::tempdir().unwrap();
    let cancel = Cancel::new();
    for (store, steps_of_block) in stores(dir.path()).iter().zip([1, 64]) {
        for (field, components) in [("T", 1), ("velocity:mag", 3)] {
            let cache = Arc::new(BlockCache::new(u64::MAX));
            let reader = reader(store, field, &cache);
            reader.expect(&[70]);
            while reader.prefetch(&cancel).unwrap() {}
            let step_bytes = cache.statistics().resident_bytes;
            assert_eq!(cache.statistics().resident_blocks, components, "those of all components");
            let resident = |step: usize| step / steps_of_block == 70 / steps_of_block;
            assert!((0..STEPS + 1).all(|step| reader.is_resident(step) == resident(step)));

            // What is shown and what comes next; special values make one block a little larger.
            cache.set_budget(2 * step_bytes + 100 * components as u64);
            let backwards: Vec<usize> = (0..STEPS).rev().collect();
            for i in 0..STEPS {
                reader.expect(&backwards[i..]);
                while reader.prefetch(&cancel).unwrap() {}
                let next = backwards[i..].iter().find(|&&step| step / steps_of_block != backwards[i] / steps_of_block);
                assert!(reader.is_resident(backwards[i]) && next.is_none_or(|&step| reader.is_resident(step)), "{i}");
                let mut out = vec![0.0; reader.value_count()];
                assert_eq!(reader.decode_step(backwards[i], &mut out).unwrap().bytes_read, 0);
            }
            assert_eq!(cache.statistics().misses, 0);
            drop(reader);
            assert_eq!(cache.statistics().resident_bytes, 0);
        }
    }
}

#[test]
fn a_raised_flag_stops_reading_decoding_and_loading_ahead() {
    let dir = tempfile::tempdir().unwrap();
    let raised = Cancel::new();
    raised.cancel();
    for store in stores(dir.path()) {
        let cache = Arc::new(BlockCache::new(u64::MAX));
        let reader = reader(&store, "velocity:mag", &cache);
        let mut out = vec![0.0; reader.value_count()];
        reader.expect(&[3]);
        assert!(!reader.prefetch(&raised).unwrap());
        assert_eq!(reader.decode_step_unless(StepRequest::whole(3, &raised), &mut out).unwrap(), None);
        assert_eq!(cache.statistics().resident_blocks, 0);
        let expected = bits(&reader, 3);
        assert!(reader.decode_step_unless(StepRequest::whole(3, &Cancel::new()), &mut out).unwrap().is_some());
        assert_eq!(out.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), expected);
        while reader.prefetch(&Cancel::new()).unwrap() {}
        assert_eq!(
            reader.decode_step_unless(StepRequest::whole(3, &raised), &mut out).unwrap(),
            None,
            "from memory, too"
        );
    }
}

#[test]
fn a_damaged_chunk_met_ahead_is_named_and_the_rest_plays() {
    let dir = tempfile::tempdir().unwrap();
    let chunks = ["fields/velocity%3A1/raw/c/7/0", "fields/velocity%3A1/vq/cb64/c/1/0/0"];
    for ((store, chunk), place) in stores(dir.path()).iter().zip(chunks).zip(["step 7", "step 64"]) {
        let expected = all_bits(store, "velocity:mag");
        let cache = Arc::new(BlockCache::new(u64::MAX));
        let reader = reader(store, "velocity:mag", &cache);
        let path = store.join(chunk);
        let sound = std::fs::read(&path).unwrap();
        std::fs::write(&path, &sound[..sound.len() - 1]).unwrap();
        let steps = [7, 64, 130];
        reader.expect(&steps);
        let mut errors = Vec::new();
        while reader.prefetch(&Cancel::new()).unwrap_or_else(|error| {
            errors.push(error);
            true
        }) {}
        assert_eq!(errors.len(), 1, "{errors:?}");
        assert!(errors[0].path.ends_with(chunk) && errors[0].place == place, "{}", errors[0]);
        assert_eq!(steps.map(|step| reader.is_resident(step)).iter().filter(|&&resident| resident).count(), 2);
        let damaged = steps.into_iter().find(|&step| !reader.is_resident(step)).unwrap();
        let error = reader.decode_step(damaged, &mut vec![0.0; reader.value_count()]).unwrap_err();
        assert!(error.path.ends_with(chunk) && error.place == format!("step {damaged}"), "{error}");
        std::fs::write(&path, sound).unwrap();
        assert!(steps.iter().all(|&step| bits(&reader, step) == expected[step]));
    }
}

#[test]
fn a_reader_without_a_cache_to_share_loads_nothing_ahead() {
    let dir = tempfile::tempdir().unwrap();
    for store in stores(dir.path()) {
        let reader = Store::open(store).unwrap().field(&"T".parse().unwrap()).unwrap();
        reader.expect(&[0, 1]);
        assert!(!reader.prefetch(&Cancel::new()).unwrap() && !reader.is_resident(0));
    }
}
