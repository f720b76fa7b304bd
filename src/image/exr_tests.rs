use super::*;
use ::exr::image::write::WritableImage as _;
use ::exr::image::{Encoding, FlatImage};
use ::exr::meta::attribute::ChannelDescription;

/// Typical colours of a volume, and edge cases: dark, bright, below 0, without opacity, faint.
fn image(width: usize, height: usize) -> RgbaImage {
    let corners = [
        [0.0; 4],
        [0.3, 0.2, 0.1, 0.0],
        [1.0, 0.5, 0.25, 1.0],
        [3.0, -1.0, 0.01, 0.9],
        [-0.0, 1e-30, 1e-38, 1e-30],
        [0.01, 0.02, 0.0404, 1.0],
        [1e-45, 1e-42, 1.2e-40, 1.0],
        [0.2, 0.1, 0.4, -0.5],
        [0.9, 0.9, 0.9, 1.0001],
    ];
    let smooth = |i: usize| {
        let x = i as f32 / (width * height) as f32;
        let a = (x * 37.0).sin().abs();
        [a * x, a * (1.0 - x), a * (x * 11.0).cos().abs(), a]
    };
    let pixels = (0..width * height).map(|i| corners.get(i / 2).copied().filter(|_| i % 2 == 0).unwrap_or(smooth(i)));
    RgbaImage { width, height, pixels: pixels.collect() }
}

/// Colour with or without depth, and no other planes.
fn planes(color: &RgbaImage, depth: Option<&Plane<f32>>) -> Planes {
    Planes { color: color.clone(), depth: depth.cloned().unwrap_or_default(), ..Planes::default() }
}

fn depth_of(color: &RgbaImage) -> Plane<f32> {
    let depth = |i: usize| if i.is_multiple_of(3) { f32::INFINITY } else { 0.1 + i as f32 / 7.0 - 2.0 };
    Plane { width: color.width, height: color.height, pixels: (0..color.pixels.len()).map(depth).collect() }
}

fn some_attributes() -> ExrAttributes {
    let text = |text: &str| ExrValue::Text(text.to_owned());
    ExrAttributes::from([
        ("software".to_owned(), text("tetreel 0.0")),
        ("tetreel.time".to_owned(), ExrValue::Number(0.1)),
        ("tetreel.field".to_owned(), text("θ:mag")),
        ("tetreel.camera".to_owned(), text("pos=1,2,3 focal=0,0,0")),
        ("tetreel.extra.a name that is longer than 31 bytes".to_owned(), text("")),
    ])
}

fn bits(image: &RgbaImage) -> Vec<u32> {
    image.pixels.iter().flatten().map(|c| c.to_bits()).collect()
}

fn place() -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    (dir, path)
}

#[test]
fn raw_images_of_any_size_come_back_bit_for_bit() {
    let (_dir, path) = place();
    for (width, height) in [(1, 1), (1, 35), (33, 1), (16, 16), (17, 33)] {
        let (color, attributes) = (image(width, height), some_attributes());
        let depth = depth_of(&color);
        write_exr(&path, &planes(&color, Some(&depth)), ExrColor::Raw, &attributes).unwrap();
        let back = read_exr(&path).unwrap();
        assert_eq!(bits(&back.planes.color), bits(&color), "{width} x {height}");
        assert_eq!((back.planes.color.width, back.planes.color.height), (width, height));
        assert_eq!((back.planes.depth, back.stored), (depth, ExrColor::Raw));
        let expected = attributes.into_iter().chain([(COLOR.to_owned(), ExrValue::Text("raw".to_owned()))]);
        assert_eq!(back.attributes, expected.collect());
    }
}

#[test]
fn without_depth_there_is_none() {
    let (_dir, path) = place();
    write_exr(&path, &planes(&image(3, 2), None), ExrColor::Raw, &ExrAttributes::new()).unwrap();
    assert_eq!(read_exr(&path).unwrap().planes.depth, Plane::default());
}

/// Bound of a colour's round-trip error. Stored linear light is rounded to f32, by a share of 2^-24 or, where it is subnormal, by 2^-150;
/// sRGB's inverse makes relative errors no larger (its curve c(l) has l c'(l) <= c(l)) and absolute ones at most 12.92 times, its steepest
/// slope; then the colour is rounded. Some slack is left for f64.
fn bound(c: f32) -> f64 {
    let relative = 2.0 * 2.0_f64.powi(-24);
    f64::from(c.abs()) * relative * 1.000_001 + (12.92 + 1.0) * 2.0_f64.powi(-150) * 1.000_001
}

#[test]
fn linear_images_come_back_within_the_rounding_of_floats() {
    let (_dir, path) = place();
    let color = image(40, 30);
    write_exr(&path, &planes(&color, None), ExrColor::Linear, &ExrAttributes::new()).unwrap();
    let back = read_exr(&path).unwrap();
    assert_eq!(back.stored, ExrColor::Linear);
    for (was, is) in color.pixels.iter().zip(&back.planes.color.pixels) {
        assert_eq!(was[3].to_bits(), is[3].to_bits());
        for c in 0..3 {
            assert!((f64::from(was[c]) - f64::from(is[c])).abs() <= bound(was[c]), "{was:?} {is:?}");
        }
    }
    // The bound is tight enough to detect a change of a few units in the last place.
    assert!(f64::from(0.5_f32) * (1.0 + 3e-7) - 0.5 > bound(0.5));
}

#[test]
fn stored_linear_light_is_that_of_the_straight_colour() {
    let (_dir, path) = place();
    // Straight 0.5 is 0.2140411 of linear light (sRGB), at half opacity 0.1070206; without opacity as if opaque.
    let pixels = vec![[0.25, 0.5, 0.0, 0.5], [0.5, 0.0, 0.0, 0.0]];
    let color = RgbaImage { width: 2, height: 1, pixels };
    write_exr(&path, &planes(&color, None), ExrColor::Linear, &ExrAttributes::new()).unwrap();
    let file: FlatImage = ::exr::image::read::read_all_flat_layers_from_file(&path).unwrap();
    let channels = &file.layer_data[0].channel_data.list;
    let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R"]);
    let of = |i: usize| channels[i].sample_data.values_as_f32().collect::<Vec<_>>();
    assert_eq!((of(0), of(1)), (vec![0.5, 0.0], vec![0.0, 0.0]));
    assert_eq!((of(2), of(3)), (vec![0.5, 0.0], vec![0.107_020_57, 0.214_041_14]));
}

#[test]
fn the_same_image_makes_the_same_bytes_in_the_order_of_names() {
    let (_dir, path) = place();
    let write = || {
        write_exr(&path, &planes(&image(9, 40), None), ExrColor::Linear, &some_attributes()).unwrap();
        std::fs::read(&path).unwrap()
    };
    let first = write();
    // Six attributes in hash maps with random keys: unsorted, ten files would agree once in 720^9 tests.
    assert!((0..10).all(|_| write() == first));
    let at = |name: &str| first.windows(name.len()).position(|w| w == name.as_bytes()).unwrap();
    assert!(at("channels\0") < at("compression\0") && at("tetreel.camera\0") < at("tetreel.time\0"));
    assert!(!String::from_utf8_lossy(&first).contains("capDate"));
}

#[test]
fn normals_and_numbers_come_back_and_those_of_another_size_are_refused() {
    let (_dir, path) = place();
    let normal = Plane { width: 3, height: 2, pixels: (0..6).map(|i| [i as f32, -0.5, 1e-30]).collect() };
    let id = Plane { width: 3, height: 2, pixels: vec![0, 1, 32, u32::MAX, 7, 16_777_217] };
    let all = Planes { normal, id, ..planes(&image(3, 2), Some(&depth_of(&image(3, 2)))) };
    write_exr(&path, &all, ExrColor::Raw, &ExrAttributes::new()).unwrap();
    assert_eq!(read_exr(&path).unwrap().planes, all);
    let refused = |bad: Planes| write_exr(&path, &bad, ExrColor::Raw, &ExrAttributes::new()).unwrap_err().to_string();
    let id = Plane { width: 2, height: 3, ..all.id.clone() };
    assert!(refused(Planes { id, ..all.clone() }).contains("id: is 2 x 3, colour 3 x 2"));
    let mut bad = all.clone();
    bad.normal.pixels[4][1] = f32::NAN;
    assert!(refused(bad).contains("normal of pixel (1, 1)"));
}

#[test]
fn what_cannot_be_stored_is_refused_and_the_old_file_stays() {
    let (dir, path) = place();
    std::fs::write(&path, "old").unwrap();
    let (color, none) = (image(3, 2), ExrAttributes::new());
    let refused = |color: &RgbaImage, depth: Option<&Plane<f32>>, stored, attributes: &ExrAttributes, part: &str| {
        let error = write_exr(&path, &planes(color, depth), stored, attributes).unwrap_err().to_string();
        assert!(error.contains("a.exr") && error.contains(part), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
    };
    for bad in [f32::NAN, f32::INFINITY] {
        let mut color = color.clone();
        color.pixels[5][1] = bad;
        refused(&color, None, ExrColor::Raw, &none, "pixel (2, 1)");
    }
    let mut bright = color.clone();
    bright.pixels[4][0] = 1e30;
    refused(&bright, None, ExrColor::Linear, &none, "pixel (1, 1)");
    refused(&RgbaImage::new(0, 4), None, ExrColor::Raw, &none, "without pixels");
    refused(&color, Some(&Plane { width: 2, height: 3, pixels: vec![1.0; 6] }), ExrColor::Raw, &none, "2 x 3");
    for bad in [f32::NAN, f32::NEG_INFINITY] {
        let mut depth = depth_of(&color);
        depth.pixels[3] = bad;
        refused(&color, Some(&depth), ExrColor::Raw, &none, "depth of pixel (0, 1)");
    }
    for name in ["channels", "", "a.\0", &".".repeat(256)] {
        let attributes = ExrAttributes::from([(name.to_owned(), ExrValue::Number(1.0))]);
        refused(&color, None, ExrColor::Raw, &attributes, "attribute");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    assert!(write_exr(&dir.path().join("no/a.exr"), &planes(&color, None), ExrColor::Raw, &none).is_err());
    write_exr(&path, &planes(&bright, None), ExrColor::Raw, &none).unwrap();
}

/// A file in the style of another program.
fn write_foreign(path: &Path, encoding: Encoding, samples: Vec<(&str, FlatSamples)>, size: (usize, usize)) {
    let channels = samples.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let layer = Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    let attributes = ImageAttributes::new(IntegerBounds::new((0, 0), size));
    Image::new(attributes, layer).write().to_file(path).unwrap();
}

#[test]
fn files_of_other_programs_are_linear_with_halfs_tiles_or_grey() {
    let (_dir, path) = place();
    let half = |v: &[f32]| FlatSamples::F16(v.iter().map(|&v| ::exr::prelude::f16::from_f32(v)).collect());
    for encoding in [Encoding::SMALL_FAST_LOSSLESS, Encoding::UNCOMPRESSED, Encoding::SMALL_LOSSLESS] {
        let rgb = vec![("R", half(&[1.0, 0.0])), ("G", half(&[0.0, 0.25])), ("B", half(&[0.0, 0.0]))];
        write_foreign(&path, encoding, rgb, (2, 1));
        let back = read_exr(&path).unwrap();
        assert_eq!((back.planes.color.pixels[0], back.planes.depth), ([1.0, 0.0, 0.0, 1.0], Plane::default()));
        // Half a unit of the sixth digit, and f32's rounding of it (3e-8).
        assert!((back.planes.color.pixels[1][1] - 0.537_099).abs() < 6e-7, "sRGB of 0.25 is 0.537099");
    }
    write_foreign(&path, Encoding::SMALL_LOSSLESS, vec![("Y", half(&[0.0, 1.0]))], (2, 1));
    assert_eq!(read_exr(&path).unwrap().planes.color.pixels[1], [1.0; 4]);
    write_foreign(&path, Encoding::SMALL_LOSSLESS, vec![("Z", half(&[0.0, 1.0])), ("G", half(&[0.0, 1.0]))], (2, 1));
    let error = read_exr(&path).unwrap_err().to_string();
    assert!(error.contains("no channel R, only G, Z"), "{error}");
}

#[test]
fn cropped_images_are_refused() {
    let (_dir, path) = place();
    let plane = || FlatSamples::F32(vec![0.5; 4]);
    let channels = ["B", "G", "R"].into_iter().map(|name| AnyChannel::new(name, plane())).collect();
    let layer = Layer::new((2, 2), LayerAttributes::default(), Encoding::default(), AnyChannels::sort(channels));
    let attributes = ImageAttributes::new(IntegerBounds::new((0, 0), (3, 2)));
    Image::new(attributes, layer).write().to_file(&path).unwrap();
    assert!(read_exr(&path).unwrap_err().to_string().contains("cropped"));
}

/// The bytes of a small file written by [`write_exr`].
fn whole(path: &Path) -> Vec<u8> {
    write_exr(path, &planes(&image(5, 20), Some(&depth_of(&image(5, 20)))), ExrColor::Raw, &some_attributes()).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn files_cut_anywhere_are_refused() {
    let (_dir, path) = place();
    let bytes = whole(&path);
    for length in 0..bytes.len() {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = read_exr(&path).expect_err("a part is no whole").to_string();
        assert!(error.contains("a.exr"), "{error}");
    }
}

#[test]
fn no_changed_byte_makes_the_reader_panic() {
    let (_dir, path) = place();
    let bytes = whole(&path);
    let mut refused = 0;
    for at in 0..bytes.len() {
        for change in [0xff, 0x01] {
            let mut damaged = bytes.clone();
            damaged[at] ^= change;
            std::fs::write(&path, &damaged).unwrap();
            refused += usize::from(read_exr(&path).is_err());
        }
    }
    // Attributes, and blocks that did not shrink, have no checksum; most of the header must fit the rest.
    assert!(refused > 100, "{refused} of {}", 2 * bytes.len());
}

#[test]
fn random_bytes_are_refused() {
    let (_dir, path) = place();
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u8
    };
    for length in 0..300 {
        let mut bytes: Vec<u8> = (0..length).map(|_| random()).collect();
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_exr(&path).is_err());
        // The same after a magic number and version.
        bytes.splice(0..0, [0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0]);
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_exr(&path).is_err());
    }
}

#[test]
fn headers_that_promise_too_much_are_refused_before_memory_is_taken() {
    let (_dir, path) = place();
    let bytes = whole(&path);
    let window = |side: i32| [0, 0, side, side].into_iter().flat_map(i32::to_le_bytes).collect::<Vec<u8>>();
    for side in [20_000, 200_000, i32::MAX / 2 - 2, i32::MAX, -5, i32::MIN] {
        let mut lying = bytes.clone();
        for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
            let at = bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap() + name.len() + 4;
            lying[at..at + 16].copy_from_slice(&window(side));
        }
        std::fs::write(&path, &lying).unwrap();
        let error = read_exr(&path).unwrap_err().to_string();
        assert!(error.contains("a.exr"), "{error}");
    }
}

#[test]
fn subsampled_channels_are_refused() {
    let (_dir, path) = place();
    let mut channels: Vec<_> = ["B", "G", "R"].map(|n| AnyChannel::new(n, FlatSamples::F32(vec![0.5; 4]))).into();
    for channel in &mut channels {
        channel.sampling = Vec2(2, 2);
    }
    let layer = Layer::new((4, 4), LayerAttributes::default(), Encoding::default(), AnyChannels::sort(channels.into()));
    let image = Image::new(ImageAttributes::new(IntegerBounds::new((0, 0), (4, 4))), layer);
    let mut header = image.write().infer_meta_data().remove(0);
    header.channels.list.iter_mut().for_each(|c: &mut ChannelDescription| c.sampling = Vec2(2, 2));
    assert!(super::read::check_header(&path, &header, 1 << 20).unwrap_err().to_string().contains("subsampled"));
}

#[test]
fn every_encoding_comes_back_and_does_not_depend_on_threads() {
    let (_dir, path) = place();
    for (width, height) in [(1, 1), (33, 1), (17, 67)] {
        let smooth = |i: usize| [0.5, 0.25, (i % 7) as f32 / 8.0, 1.0 / 3.0];
        let color = RgbaImage { width, height, pixels: (0..width * height).map(smooth).collect() };
        let planes = planes(&color, Some(&depth_of(&color)));
        for compression in ExrCompression::ALL {
            let encoding = ExrEncoding { color: ExrColor::Raw, depth: ExrDepth::Float, compression };
            write_exr(&path, &planes, encoding, &some_attributes()).unwrap();
            assert!(read_exr(&path).unwrap().planes == planes, "{compression}, {width} x {height}");
            let bytes = std::fs::read(&path).unwrap();
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| write_exr(&path, &planes, encoding, &some_attributes()).unwrap());
                assert!(std::fs::read(&path).unwrap() == bytes, "{compression}, {threads} threads");
            }
            write_exr(&path, &planes, ExrEncoding { depth: ExrDepth::Half, ..encoding }, &some_attributes()).unwrap();
            let back = read_exr(&path).unwrap().planes;
            assert!(back.depth == planes.depth, "depths stay floats");
            let pairs = back.color.pixels.iter().flatten().zip(color.pixels.iter().flatten());
            // Halves have 11 significant bits and round to nearest.
            assert!(pairs.clone().all(|(a, b)| (a - b).abs() <= b * 2.0_f32.powi(-11)), "{compression}");
            assert!(pairs.into_iter().any(|(a, b)| a != b), "a third is none of them");
        }
    }
}

#[test]
fn what_is_beyond_halves_is_refused_where_it_is() {
    let (_dir, path) = place();
    let mut color = image(5, 3);
    color.pixels[7][1] = 65519.0;
    let half = ExrEncoding { color: ExrColor::Raw, depth: ExrDepth::Half, ..ExrEncoding::default() };
    let error = write_exr(&path, &planes(&color, None), half, &ExrAttributes::new()).unwrap_err().to_string();
    assert!(["(2, 1)", "halves", "32 bits"].iter().all(|part| error.contains(part)) && !path.exists(), "{error}");
    color.pixels[7][1] = 65504.0;
    write_exr(&path, &planes(&color, None), half, &ExrAttributes::new()).unwrap();
    assert_eq!(read_exr(&path).unwrap().planes.color.pixels[7][1], 65504.0);
}
