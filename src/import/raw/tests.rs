//! Volumes of both headers in all encodings, refusals, and damage.

use crate::field::{Component, SeriesSource};
use crate::import::{files, open_many};
use crate::random::SplitMix64;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use std::fs;
use std::io::Write;
use std::path::PathBuf;

const META: &str = "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementSpacing = 0.5 1 2\nOffset = 10 20 30\nElementType = MET_SHORT\n";
const NRRD: &str = "NRRD0004\n# by hand\ncontent: T\ntype: short\ndimension: 3\nsizes: 2 3 4\nspacings: 0.5 1 2\naxis mins: 10 20 30\nkey:=value\n";

fn values(big_endian: bool, count: i16) -> Vec<u8> {
    (0..count).flat_map(|v| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() }).collect()
}

fn text(count: i16) -> Vec<u8> {
    (0..count).map(|v| format!("{v} ")).collect::<String>().into_bytes()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

type Opened = Result<Box<dyn SeriesSource>, String>;

/// Files in a folder, of which the first `count` are opened.
fn opened(files: &[(&str, &[u8])], count: usize) -> (tempfile::TempDir, Opened) {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| fs::write(folder.path().join(name), bytes).unwrap());
    let paths: Vec<PathBuf> = files.iter().take(count).map(|(name, _)| folder.path().join(name)).collect();
    let source = open_many(&paths).map_err(|error| error.to_string());
    (folder, source)
}

fn read(source: &dyn SeriesSource, component: usize, step: usize) -> Vec<f32> {
    let mut out = Vec::new();
    source.read(&source.fields()[0], Component::Index(component), step, &mut out).unwrap();
    out
}

/// Headers with their values behind them, of the volume that all of them hold.
fn all() -> Vec<(&'static str, Vec<u8>)> {
    let meta = |lines: &str, data: &[u8]| {
        ("a.mha", [format!("{META}{lines}ElementDataFile = LOCAL\n").as_bytes(), data].concat())
    };
    let nrrd = |lines: &str, data: &[u8]| ("a.nrrd", [format!("{NRRD}{lines}\n").as_bytes(), data].concat());
    vec![
        meta("", &values(false, 24)),
        meta("BinaryDataByteOrderMSB = True\nHeaderSize = -1\n", &[b"skipped", &values(true, 24)[..]].concat()),
        meta("CompressedData = True\n", &zlib(&values(false, 24))),
        meta("BinaryData = False\n", &text(24)),
        nrrd("encoding: raw\nendian: big\n", &values(true, 24)),
        nrrd("encoding: gzip\nendian: little\nbyte skip: 3\n", &gzip(&[b"abc", &values(false, 24)[..]].concat())),
        nrrd("encoding: ascii\n", &text(24)),
        nrrd("encoding: raw\nendian: little\nbyte skip: -1\n", &[b"skipped", &values(false, 24)[..]].concat()),
    ]
}

#[test]
fn all_encodings_of_both_headers_hold_the_same_volume() {
    for (name, bytes) in all() {
        let head = String::from_utf8_lossy(&bytes).into_owned();
        let (_folder, source) = opened(&[(name, &bytes)], 1);
        let source = source.unwrap_or_else(|error| panic!("{error}: {head}"));
        let mesh = source.mesh().unwrap();
        assert_eq!((mesh.points.len(), mesh.cells.len()), (24, 6));
        assert_eq!([mesh.points[1], mesh.points[23]].map(|p| p.to_array()), [[10.5, 20.0, 30.0], [10.5, 22.0, 36.0]]);
        assert_eq!(source.fields()[0].name, if name == "a.mha" { "values" } else { "T" });
        assert_eq!(read(source.as_ref(), 0, 0), (0_i16..24).map(f32::from).collect::<Vec<_>>(), "{head}");
        assert_eq!(source.times().values, [0.0]);
    }
}

#[test]
fn files_of_their_own_components_directions_and_steps_are_read() {
    let meta =
        format!("{META}TransformMatrix = 0 1 0 -1 0 0 0 0 1\nElementNumberOfChannels = 2\nElementDataFile = a.raw\n");
    let (folder, source) = opened(&[("a.mhd", meta.as_bytes()), ("a.raw", &values(false, 48))], 1);
    let source = source.unwrap();
    assert_eq!(source.mesh().unwrap().points[1].to_array(), [10.0, 20.5, 30.0], "x of the volume runs along y");
    assert_eq!(read(source.as_ref(), 1, 0)[..3], [1.0, 3.0, 5.0]);
    assert_eq!(files(&folder.path().join("a.mhd")).unwrap().len(), 2);

    let head = "NRRD0005\ntype: short\ndimension: 4\nspace: left-posterior-superior\nspace origin: (1,2,3)\nencoding: raw\nendian: little\n";
    let steps = format!(
        "{head}sizes: 2 2 2 3\nspace directions: (2,0,0) (0, 3, 0) (0,0,4) none\nkinds: domain domain domain list\n\n"
    );
    let (_folder, source) = opened(&[("a.nrrd", &[steps.as_bytes(), &values(false, 24)].concat())], 1);
    let source = source.unwrap();
    assert_eq!((source.times().values.as_slice(), read(source.as_ref(), 0, 2)[0]), (&[0.0, 1.0, 2.0][..], 16.0));
    assert_eq!(source.mesh().unwrap().points[7].to_array(), [3.0, 5.0, 7.0]);

    let vector = format!(
        "{head}sizes: 3 2 2 2\nspace directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: vector space space space\ndata file: b.raw\n"
    );
    let (_folder, source) = opened(&[("a.nhdr", vector.as_bytes()), ("b.raw", &values(false, 24))], 1);
    let source = source.unwrap();
    assert_eq!((source.fields()[0].components, read(source.as_ref(), 2, 0)[1]), (3, 5.0));

    let one = all().swap_remove(4).1;
    let (_folder, source) = opened(&[("a_2.nrrd", &one), ("a_10.nrrd", &one)], 2);
    let source = source.unwrap();
    assert_eq!((source.times().values.as_slice(), read(source.as_ref(), 0, 1)[5]), (&[0.0, 1.0][..], 5.0));
}

#[test]
fn what_is_not_read_or_contradicts_itself_is_named() {
    let (meta, nrrd) =
        (format!("{META}ElementDataFile = a.raw\n"), format!("{NRRD}encoding: raw\nendian: big\ndata file: a.raw\n"));
    for (name, head, from, to, expected) in [
        ("a.mhd", &meta, "NDims = 3", "NDims = 2", "NDims"),
        ("a.mhd", &meta, "MET_SHORT", "MET_NONE", "MET_NONE"),
        ("a.mhd", &meta, "2 3 4", "2 3 5", "has 48 bytes of values, of 60"),
        ("a.mhd", &meta, "2 3 4", "2 3", "DimSize"),
        ("a.mhd", &meta, "2 3 4", "2 3 18446744073709551615", "claims"),
        ("a.mhd", &meta, "2 3 4", "0 3 4", "0 x 3 x 4"),
        ("a.mhd", &meta, "a.raw", "../a.raw", "outside"),
        ("a.mhd", &meta, "a.raw", "LIST", "list of files"),
        ("a.mhd", &meta, "a.raw", "b.raw", "missing"),
        ("a.mhd", &meta, "10 20 30", "10 nan 30", "finite"),
        ("a.nhdr", &nrrd, "NRRD0004", "MRRD0004", "no NRRD"),
        ("a.nhdr", &nrrd, "short", "block", "type"),
        ("a.nhdr", &nrrd, "raw\n", "bzip2\n", "encoding"),
        ("a.nhdr", &nrrd, "endian: big", "endian: middle", "endian"),
        ("a.nhdr", &nrrd, "dimension: 3", "dimension: 4", "sizes"),
        ("a.nhdr", &nrrd, "2 3 4", "2 3 400", "bytes of values"),
        ("a.nhdr", &nrrd, "file: a.raw", "file: /a.raw", "outside"),
        ("a.nhdr", &nrrd, "file: a.raw", "file: a%d.raw 0 1 1", "list of files"),
    ] {
        assert!(head.contains(from), "{from}");
        let (_folder, source) =
            opened(&[(name, head.replacen(from, to, 1).as_bytes()), ("a.raw", &values(true, 24))], 1);
        let error = source.err().unwrap_or_else(|| panic!("{to} is read"));
        assert!(error.contains(expected), "{to}: {error}");
    }
}

#[test]
fn damaged_files_are_read_or_refused_but_never_panic() {
    let mut random = SplitMix64::new(5);
    let run = |name: &str, bytes: &[u8]| {
        let (_folder, source) = opened(&[(name, bytes)], 1);
        let Ok(source) = source else { return false };
        let mut out = Vec::new();
        source.mesh().is_ok() && source.read(&source.fields()[0], Component::Index(0), 0, &mut out).is_ok()
    };
    for (name, bytes) in all() {
        let refused = (0..bytes.len()).filter(|&end| !run(name, &bytes[..end])).count();
        assert!(refused > bytes.len() / 2, "{refused} of {}", bytes.len());
        for _ in 0..300 {
            let mut damaged = bytes.clone();
            damaged[random.below(bytes.len())] ^= 1 << random.below(8);
            run(name, &damaged);
        }
    }
}
