//! Decoders with a cache, on an instrumented source.

use super::*;
use crate::codec::chunk::PIECE_BYTES;
use crate::codec::raw::{RawDecoder, RawEncoder};
use crate::codec::test_objects::Objects;
use crate::codec::vq::{VqDecoder, VqEncoder, VqOptions, VqParameters};
use crate::codec::{Decoder, Encoder, ReadRange, StepRequest, Wanted};
use std::path::PathBuf;

/// A source that can be damaged, counts its reads and raises a cancel flag at one of them.
struct Watched {
    objects: Mutex<Objects>,
    reads: AtomicU64,
    raise: Mutex<Option<(u64, Cancel)>>,
}

impl Watched {
    fn new(objects: Objects) -> Arc<Self> {
        Arc::new(Self { objects: Mutex::new(objects), reads: AtomicU64::new(0), raise: Mutex::default() })
    }

    fn reads(&self) -> u64 {
        self.reads.swap(0, Ordering::SeqCst)
    }

    /// A flag that is raised after this many reads.
    fn raise_after(&self, reads: u64) -> Cancel {
        let cancel = Cancel::new();
        *self.raise.lock().unwrap() = Some((reads, cancel.clone()));
        self.reads();
        cancel
    }

    fn flip(&self, key: &str) {
        self.objects.lock().unwrap().0.get_mut(key).unwrap()[1] ^= 4;
    }
}

impl ReadRange for Watched {
    fn size(&self, key: &str) -> FileResult<u64> {
        self.objects.lock().unwrap().size(key)
    }

    fn exists(&self, key: &str) -> FileResult<bool> {
        self.objects.lock().unwrap().exists(key)
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        assert!(parts.iter().map(|part| part.len()).sum::<usize>() <= PIECE_BYTES, "more than a piece at once");
        let reads = self.reads.fetch_add(1, Ordering::SeqCst) + 1;
        if let Some((at, cancel)) = &*self.raise.lock().unwrap()
            && *at == reads
        {
            cancel.cancel();
        }
        self.objects.lock().unwrap().read(key, offset, parts)
    }

    fn path(&self, key: &str) -> PathBuf {
        key.into()
    }
}

/// Vertices of a raw step of more than three pieces, and of more than one task.
const RAW_VERTICES: usize = 3 * PIECE_BYTES / 4 + 1000;

fn raw_value(step: usize, v: usize) -> f32 {
    (step * 1000) as f32 + (v as f32 * 0.01).sin()
}

fn raw(steps: usize) -> Arc<Watched> {
    let mut objects = Objects::default();
    let mut encoder = RawEncoder::new(RAW_VERTICES);
    for step in 0..steps {
        let values: Vec<f32> = (0..RAW_VERTICES).map(|v| raw_value(step, v)).collect();
        encoder.push(&values, &mut objects).unwrap();
    }
    Watched::new(objects)
}

const VQ_VERTICES: usize = 70_000;

/// Three blocks with exponents and special values, with enough vertices for several tasks.
fn vq() -> (Arc<Watched>, VqParameters) {
    let mut objects = Objects::default();
    let options = VqOptions { entries: 16, own_scales: true, ..VqOptions::default() };
    let mut encoder = Box::new(VqEncoder::new(VQ_VERTICES, options));
    for step in 0..130 {
        let value = |v: usize| match (v, step % 7) {
            (40_000, 3) => f32::NAN,
            _ => (0.1 * step as f32 + 0.01 * v as f32).sin() * 10f32.powi((v % 7) as i32),
        };
        encoder.push(&(0..VQ_VERTICES).map(value).collect::<Vec<_>>(), &mut objects).unwrap();
    }
    let encoded = encoder.finish(&mut objects).unwrap();
    (Watched::new(objects), VqParameters::read(&encoded.parameters).unwrap())
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Cancels a decode at each of its reads: it stops there, leaves nothing in the cache, and can be repeated.
fn cancelled_at_every_read(source: &Watched, cache: &BlockCache, decoder: &dyn Decoder, vertices: usize) {
    let [mut out, mut expected] = [0; 2].map(|_| vec![0.0; vertices]);
    source.reads();
    decoder.decode_step(1, &mut expected).unwrap();
    let whole = source.reads();
    assert!(whole >= 4, "{whole}");
    for at in 1..=whole {
        decoder.blocks().iter().for_each(|loader| cache.forget(loader.id()));
        let cancel = source.raise_after(at);
        assert_eq!(
            decoder.decode_step_unless(StepRequest::whole(1, &cancel), &mut out).unwrap(),
            None,
            "{at} of {whole}"
        );
        assert_eq!(source.reads(), at, "nothing is read once the flag is up");
        assert_eq!(cache.statistics().resident_blocks, 0);
        let done = decoder.decode_step_unless(StepRequest::whole(1, &Cancel::new()), &mut out).unwrap().unwrap();
        assert_eq!(done.vertices_decoded, vertices as u64);
        assert_eq!(bits(&out), bits(&expected));
    }
    // From memory as well.
    let raised = Cancel::new();
    raised.cancel();
    source.reads();
    assert_eq!(decoder.decode_step_unless(StepRequest::whole(1, &raised), &mut out).unwrap(), None);
    assert_eq!(source.reads(), 0);
}

#[test]
fn a_cancelled_raw_step_stops_at_the_piece_that_is_read() {
    let source = raw(2);
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let decoder = RawDecoder::new(source.clone(), "f", 2, RAW_VERTICES).with_cache(cache.clone());
    cancelled_at_every_read(&source, &cache, &decoder, RAW_VERTICES);
}

#[test]
fn a_cancelled_block_of_vq_stops_at_the_piece_that_is_read() {
    let (source, parameters) = vq();
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let decoder = VqDecoder::new(source.clone(), "f", parameters, 130, VQ_VERTICES).with_cache(cache.clone());
    cancelled_at_every_read(&source, &cache, &decoder, VQ_VERTICES);
}

/// Cancels a decode at each of its checks of the flag; with `chunks`, of all chunks of this length.
fn cancelled_at_every_look(decoder: &dyn Decoder, vertices: usize, chunks: Option<usize>) {
    /// A value that is in no step.
    const BEFORE: f32 = 7e33;
    let mut expected = vec![0.0; vertices];
    decoder.decode_step(1, &mut expected).unwrap();
    for looks in 0.. {
        let cancel = Cancel::after_looks(looks);
        let mut out = vec![BEFORE; vertices];
        let all = vec![true; vertices.div_ceil(chunks.unwrap_or(1))];
        let wanted = chunks.map(|length| Wanted { length, chunks: &all });
        let done = decoder.decode_step_unless(StepRequest { step: 1, wanted, cancel: &cancel }, &mut out);
        let is_whole = bits(&out) == bits(&expected);
        if done.unwrap().is_some() {
            assert!(is_whole, "what was given up after {looks} looks counts as whole");
            assert!(looks > 0, "the flag is looked at on the way");
            return;
        }
    }
}

#[test]
fn a_decode_that_is_cancelled_at_any_look_is_none() {
    let blocks = Arc::new(BlockCache::new(u64::MAX));
    let (source, parameters) = vq();
    let decoder = VqDecoder::new(source, "f", parameters, 130, VQ_VERTICES).with_cache(blocks.clone());
    for chunks in [None, Some(256)] {
        cancelled_at_every_look(&decoder, VQ_VERTICES, chunks);
    }
    let decoder = RawDecoder::new(raw(2), "f", 2, RAW_VERTICES).with_cache(blocks.clone());
    cancelled_at_every_look(&decoder, RAW_VERTICES, None);
    let loader = decoder.blocks().unwrap();
    blocks.expect([BlockKey { decoder: loader.id(), index: 1 }]);
    assert!(blocks.prefetch(|_| Some(loader), &Cancel::new()).unwrap(), "and now from memory");
    for chunks in [None, Some(256)] {
        cancelled_at_every_look(&decoder, RAW_VERTICES, chunks);
    }
}

#[test]
fn a_cancelled_prefetch_leaves_nothing_and_can_be_repeated() {
    let source = raw(3);
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let decoder = RawDecoder::new(source.clone(), "f", 3, RAW_VERTICES).with_cache(cache.clone());
    let loader = decoder.blocks().unwrap();
    cache.expect([2, 1].map(|index| BlockKey { decoder: loader.id(), index }));
    for at in 1..=5 {
        let cancel = source.raise_after(at);
        assert!(!cache.prefetch(|_| Some(loader), &cancel).unwrap());
        assert_eq!((source.reads(), cache.statistics()), (at, CacheStatistics::default()));
    }
    assert!(cache.prefetch(|_| Some(loader), &Cancel::new()).unwrap());
    assert!(cache.is_resident(BlockKey { decoder: loader.id(), index: 2 }));
}

#[test]
fn a_raw_step_loaded_ahead_is_copied_bit_for_bit_and_one_that_is_not_stays_out() {
    let source = raw(3);
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let decoder = RawDecoder::new(source.clone(), "f", 3, RAW_VERTICES).with_cache(cache.clone());
    let loader = decoder.blocks().unwrap();
    cache.expect([BlockKey { decoder: loader.id(), index: 2 }]);
    while cache.prefetch(|_| Some(loader), &Cancel::new()).unwrap() {}
    source.reads();
    let mut out = vec![0.0; RAW_VERTICES];
    let copied = decoder.decode_step(2, &mut out).unwrap();
    assert_eq!((copied.bytes_read, source.reads()), (0, 0));
    assert!(out.iter().enumerate().all(|(v, x)| x.to_bits() == raw_value(2, v).to_bits()));
    let read = decoder.decode_step(1, &mut out).unwrap();
    assert_eq!((read.bytes_read, source.reads()), (4 * RAW_VERTICES as u64 + 4, 5));
    assert!(out.iter().enumerate().all(|(v, x)| x.to_bits() == raw_value(1, v).to_bits()));
    let statistics = cache.statistics();
    assert_eq!((statistics.resident_blocks, statistics.hits, statistics.misses), (1, 1, 1));
    assert_eq!((statistics.resident_bytes, statistics.bytes_read), (4 * RAW_VERTICES as u64, read.bytes_read));
    drop(decoder);
    assert_eq!(cache.statistics().resident_bytes, 0, "a decoder takes its blocks with it");
}

#[test]
fn a_block_of_vq_takes_what_it_is_expected_to_take_but_for_its_special_values() {
    let (source, parameters) = vq();
    let decoder = VqDecoder::new(source, "f", parameters, 130, VQ_VERTICES);
    let block = decoder.resident_block(0).unwrap();
    let specials = size_of_val(block.specials());
    assert!(specials > 0 && !block.exponents().is_empty());
    assert_eq!(decoder.blocks().unwrap().expected_bytes(0), (block.bytes() - specials) as u64);
}

#[test]
fn a_damaged_block_is_named_passed_over_and_read_again_once_it_is_restored() {
    let (source, parameters) = vq();
    let cache = Arc::new(BlockCache::new(u64::MAX));
    let decoder = VqDecoder::new(source.clone(), "f", parameters, 130, VQ_VERTICES).with_cache(cache.clone());
    let loader = decoder.blocks().unwrap();
    let expect = || cache.expect((0..3).map(|index| BlockKey { decoder: loader.id(), index }));
    let ahead = || cache.prefetch(|_| Some(loader), &Cancel::new());
    source.flip("f/vq/i64/c/1/0");
    expect();
    assert!(ahead().unwrap());
    let error = ahead().unwrap_err();
    assert_eq!((error.path.to_str().unwrap(), error.place.as_str()), ("f/vq/i64/c/1/0", "step 64"));
    assert!(ahead().unwrap() && !ahead().unwrap(), "the third block, and no second try at the second");
    let mut out = vec![0.0; VQ_VERTICES];
    let error = decoder.decode_step(100, &mut out).unwrap_err();
    assert_eq!((error.path.to_str().unwrap(), error.place.as_str()), ("f/vq/i64/c/1/0", "step 100"));
    decoder.decode_step(128, &mut out).unwrap();
    source.flip("f/vq/i64/c/1/0");
    expect();
    assert!(ahead().unwrap() && !ahead().unwrap());
    assert_eq!(decoder.decode_step(100, &mut out).unwrap().bytes_read, 0);
}
