//! Damaged files: an error that says where, never a panic, never memory for what a file merely claims.

use super::oracle_dir;
use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tetreel::error::FileResult;
use tetreel::field::Component;
use tetreel::import;

/// Opens the file and reads everything in it.
fn read_all(path: &Path) -> FileResult<()> {
    let source = import::open(path)?;
    source.mesh()?;
    let mut out = Vec::new();
    for field in source.fields() {
        source.read(field, Component::Magnitude, 0, &mut out)?;
    }
    Ok(())
}

/// Files that between them take every way through the decoder.
static SAMPLES: LazyLock<Vec<(String, Vec<u8>)>> = LazyLock::new(|| {
    let names = [
        "ascii",
        "inline_none_32_le",
        "inline_zlib_64_be",
        "inline_lzma_32_le",
        "base64_none_64_le",
        "base64_lz4_32_be",
        "raw_none_64_le",
        "raw_zlib_32_le",
        "raw_lz4_64_be",
        "raw_lzma_64_le",
        "blocks_raw_zlib",
        "blocks_base64_lz4",
        "blocks_inline_lzma",
        "mixed_ascii",
        "pieces_ascii",
    ];
    let load = |name: &str| fs::read(oracle_dir().join(format!("{name}.vtu"))).expect("a sample");
    names.iter().map(|name| (name.to_string(), load(name))).collect()
});

/// Writes `bytes` and reads them back as a file.
fn read_bytes(bytes: &[u8]) -> FileResult<()> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("damaged.vtu");
    fs::write(&path, bytes).expect("a file");
    let result = read_all(&path);
    if let Err(error) = &result {
        assert!(error.to_string().contains("damaged.vtu"), "{error}");
    }
    result
}

#[test]
fn a_cut_file_is_an_error_wherever_it_is_cut() {
    for (name, bytes) in SAMPLES.iter() {
        // Behind the last array only closing tags are lost, which raw data need not have.
        let tail = bytes.windows(14).rposition(|w| w == b"</AppendedData").unwrap_or(bytes.len() - 11);
        let last = bytes[..tail].trim_ascii_end().len();
        for length in (0..last).step_by(37).chain([last - 1]) {
            // A cut inside of the padding of base64 loses nothing.
            let error = read_bytes(&bytes[..length]);
            let only_padding = bytes[length..last].iter().all(|&b| b == b'=');
            assert!(error.is_err() || only_padding, "{name} cut at {length} of {}", bytes.len());
        }
    }
}

#[test]
fn a_cut_raw_file_is_named_with_array_and_place() {
    let bytes = fs::read(oracle_dir().join("raw_none_64_le.vtu")).expect("a sample");
    let end = bytes.windows(18).rposition(|w| w == b"\n  </AppendedData>").expect("appended data");
    // The last array is the types of three cells behind a count of eight bytes.
    let error = read_bytes(&bytes[..end - 1]).expect_err("cut").to_string();
    for part in ["array 'types'", &format!("data at byte {}", end - 11), "ends after 2 of 3 bytes"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn wrong_sizes_and_counts_are_errors_with_their_place() {
    let bytes = fs::read(oracle_dir().join("ascii.vtu")).expect("a sample");
    let text = String::from_utf8(bytes).expect("text");
    let error = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        read_bytes(text.replacen(from, to, 1).as_bytes()).expect_err("damaged").to_string()
    };
    let message = error("NumberOfPoints=\"6\"", "NumberOfPoints=\"7\"");
    assert!(message.contains("array 'Points'") && message.contains("18 numbers, but 21"), "{message}");
    let message = error("NumberOfPoints=\"6\"", "NumberOfPoints=\"18446744073709551615\"");
    assert!(message.contains("more than"), "{message}");
    let message = error("NumberOfCells=\"3\"", "NumberOfCells=\"4000000000\"");
    assert!(message.contains("array 'types'") && message.contains("3 numbers"), "{message}");
    let message = error("NumberOfCells=\"3\"", "NumberOfCells=\"-3\"");
    assert!(message.contains("NumberOfCells=\"-3\" is no count"), "{message}");
    let message = error("4 8 12", "4 12 8");
    assert!(message.contains("array 'offsets'") && message.contains("decrease at cell 2"), "{message}");
    let message = error("4 8 12", "4 8 11");
    assert!(message.contains("array 'connectivity'"), "{message}");
    let message = error("format=\"ascii\"", "format=\"binary\"");
    assert!(message.contains("array 'TimeValue'"), "{message}");
    let message = error("Name=\"connectivity\"", "Name=\"connect\"");
    assert!(message.contains("lacks the array 'connectivity'"), "{message}");
    let message = error("header_type=\"UInt32\"", "header_type=\"UInt16\"");
    assert!(message.contains("UInt16"), "{message}");
    let message = error("Name=\"T\"", "Name=\"quo\"te\"");
    assert!(message.contains("quotation mark") || message.contains("malformed"), "{message}");
}

#[test]
fn blocks_that_claim_more_than_their_array_needs_are_refused() {
    let bytes = fs::read(oracle_dir().join("raw_zlib_64_le.vtu")).expect("a sample");
    let start = bytes.windows(2).position(|w| w == b" _").expect("appended data") + 2;
    // Words of the first array: number of blocks, block size, last block size, compressed size.
    for word in 0..4 {
        for value in [0_u64, 2, 0x7fff_ffff, u64::MAX / 8, u64::MAX] {
            let mut damaged = bytes.clone();
            let at = start + word * 8;
            if damaged[at..at + 8] == value.to_le_bytes() {
                continue;
            }
            damaged[at..at + 8].copy_from_slice(&value.to_le_bytes());
            // The size of a block says nothing where the only block is the shorter last one.
            assert!(read_bytes(&damaged).is_err() || word == 1, "word {word} = {value}");
        }
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let path = PathBuf::from("/nowhere/run_07.vtu");
    assert!(import::open(&path).err().expect("missing").to_string().contains("run_07.vtu"));
    assert!(import::open(Path::new("/nowhere/run.pvd")).err().expect("missing").to_string().contains("run.pvd"));
}

proptest! {
    // The seed is fixed, so that a failure can be repeated; proptest prints the case.
    #![proptest_config(ProptestConfig { cases: 400, rng_seed: proptest::test_runner::RngSeed::Fixed(7), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bytes_never_panic(
        sample in 0..15_usize,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = SAMPLES[sample].1.clone();
        for (place, value) in flips {
            let at = place.index(bytes.len());
            bytes[at] = value;
        }
        let _ = read_bytes(&bytes);
    }

    #[test]
    fn digits_replaced_by_other_digits_never_panic(
        sample in 0..15_usize,
        places in prop::collection::vec((any::<prop::sample::Index>(), b'0'..=b'9'), 1..4),
    ) {
        let mut bytes = SAMPLES[sample].1.clone();
        let end = bytes.windows(13).position(|w| w == b"<AppendedData").unwrap_or(bytes.len());
        let digits: Vec<_> = (0..end).filter(|&i| bytes[i].is_ascii_digit()).collect();
        for (place, value) in places {
            bytes[digits[place.index(digits.len())]] = value;
        }
        let _ = read_bytes(&bytes);
    }
}
