//! PNG files of display-referred values.

use super::{Plane, RgbaImage, over};
use crate::error::{FileError, FileResult};
use crate::files;
use std::io::{BufReader, BufWriter};
use std::path::Path;
use std::str::FromStr;

/// Bits per channel of a written PNG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

impl FromStr for PngDepth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "8" => Ok(Self::Eight),
            "16" => Ok(Self::Sixteen),
            _ => Err("a PNG has 8 or 16 bits".to_owned()),
        }
    }
}

/// Writes an image: with straight alpha, or opaque over `background` if given. The file is written whole or not at all. Colours are clamped
/// to 0..=1.
///
/// # Errors
/// If the image has no pixels or one that is not finite, or the file cannot be written.
pub fn write_png(path: &Path, image: &RgbaImage, background: Option<[f32; 3]>, depth: PngDepth) -> FileResult<()> {
    write_png_with_texts(path, image, background, depth, &[])
}

/// Like [`write_png`], with `texts`: keywords and values (tEXt chunks, Latin-1).
///
/// # Errors
/// As [`write_png`], or if a keyword or a text cannot be stored.
pub fn write_png_with_texts(
    path: &Path,
    image: &RgbaImage,
    background: Option<[f32; 3]>,
    depth: PngDepth,
    texts: &[(&str, &str)],
) -> FileResult<()> {
    if let Some((i, j)) = image.first_not_finite() {
        return Err(FileError::invalid(path, format!("pixel ({i}, {j})"), "is not finite and has no colour"));
    }
    let color = if background.is_some() { png::ColorType::Rgb } else { png::ColorType::Rgba };
    let bytes = samples(image, background, depth);
    let (Ok(width), Ok(height)) = (u32::try_from(image.width), u32::try_from(image.height)) else {
        return Err(FileError::unsupported(path, "", "a PNG has less than 2^31 pixels a row and rows")
            .remedy("make it smaller"));
    };
    files::replace(path, |file| {
        let mut encoder = png::Encoder::new(BufWriter::new(file), width, height);
        encoder.set_color(color);
        encoder.set_depth(match depth {
            PngDepth::Eight => png::BitDepth::Eight,
            PngDepth::Sixteen => png::BitDepth::Sixteen,
        });
        let mut write = || {
            for &(keyword, text) in texts {
                encoder.add_text_chunk(keyword.to_owned(), text.to_owned())?;
            }
            Ok(())
        };
        let written = write().and_then(|()| encoder.write_header()).and_then(|mut writer| {
            writer.write_image_data(&bytes)?;
            writer.finish()
        });
        written.map_err(|e| match e {
            png::EncodingError::IoError(e) => FileError::io(path, "write", &e),
            other => FileError::invalid(path, "", other.to_string()),
        })
    })
}

/// The samples of an image in PNG's byte order.
fn samples(image: &RgbaImage, background: Option<[f32; 3]>, depth: PngDepth) -> Vec<u8> {
    let (channels, size) = (if background.is_some() { 3 } else { 4 }, if depth == PngDepth::Eight { 1 } else { 2 });
    let mut bytes = Vec::with_capacity(image.pixels.len() * channels * size);
    let mut add = |channels: &[f32]| match depth {
        PngDepth::Eight => bytes.extend(channels.iter().map(|c| (c * 255.0).round() as u8)),
        PngDepth::Sixteen => bytes.extend(channels.iter().flat_map(|c| ((c * 65535.0).round() as u16).to_be_bytes())),
    };
    for pixel in &image.pixels {
        match background {
            Some(background) => add(&over(pixel, background)),
            None => add(&straight(pixel)),
        }
    }
    bytes
}

/// A pixel with straight instead of premultiplied alpha, clamped to 0..=1; transparent black for alpha 0.
fn straight(&[r, g, b, a]: &[f32; 4]) -> [f32; 4] {
    if a <= 0.0 {
        return [0.0; 4];
    }
    [r / a, g / a, b / a, a].map(|c| c.clamp(0.0, 1.0))
}

/// Maximum pixels per byte: deflate expands at most 1032 times (one bit per code for 258 bytes, and block headers), and a byte holds at
/// most eight pixels. A header that claims more is damaged.
const MOST_PIXELS_PER_BYTE: u64 = 1032 * 8;

/// Reads a PNG to its end and returns its text under `keyword`, if any.
///
/// # Errors
/// If the file cannot be opened, is no PNG, or is damaged or truncated.
pub fn read_png_text(path: &Path, keyword: &str) -> FileResult<Option<String>> {
    let mut reader = open(path)?;
    let mut bytes = vec![0; buffer_size(path, &reader)?];
    let read = reader.next_frame(&mut bytes).and_then(|_| reader.finish());
    read.map_err(|e| unreadable(path, e))?;
    let found = reader.info().uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == keyword);
    Ok(found.map(|chunk| chunk.text.clone()))
}

type PngReader = png::Reader<BufReader<std::fs::File>>;

fn unreadable(path: &Path, error: png::DecodingError) -> FileError {
    match error {
        png::DecodingError::IoError(e) if e.kind() != std::io::ErrorKind::UnexpectedEof => {
            FileError::io(path, "read", &e)
        }
        other => FileError::invalid(path, "", other.to_string()).remedy("is it a whole PNG file?"),
    }
}

/// Reads the header, which must not claim more pixels than the file can hold.
fn open(path: &Path) -> FileResult<PngReader> {
    let file = std::fs::File::open(path).map_err(|e| FileError::io(path, "open", &e))?;
    let file_bytes = file.metadata().map_err(|e| FileError::io(path, "open", &e))?.len();
    let mut decoder = png::Decoder::new(BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let reader = decoder.read_info().map_err(|e| unreadable(path, e))?;
    let pixels = u64::from(reader.info().width) * u64::from(reader.info().height);
    if pixels > file_bytes.saturating_mul(MOST_PIXELS_PER_BYTE) {
        return Err(FileError::invalid(path, "header", format!("promises {pixels} pixels in {file_bytes} bytes")));
    }
    Ok(reader)
}

/// Bytes of the decoded image.
fn buffer_size(path: &Path, reader: &PngReader) -> FileResult<usize> {
    let (width, height) = (reader.info().width, reader.info().height);
    let too_large = || {
        let problem = format!("{width} x {height} pixels do not fit memory");
        FileError::unsupported(path, "header", problem).remedy("make the image smaller, or cut it into parts")
    };
    reader.output_buffer_size().ok_or_else(too_large)
}

/// Decodes the pixels of a PNG; samples of less than 8 bits come as bytes.
fn decoded(path: &Path) -> FileResult<(png::OutputInfo, Vec<u8>)> {
    let mut reader = open(path)?;
    let mut bytes = vec![0; buffer_size(path, &reader)?];
    let info = reader.next_frame(&mut bytes).map_err(|e| unreadable(path, e))?;
    bytes.truncate(info.buffer_size());
    Ok((info, bytes))
}

/// Reads a grey PNG of 8 or 16 bits without alpha to levels of 16 bits.
///
/// # Errors
/// If the file cannot be opened, is no PNG, is damaged, or has colours or alpha.
pub fn read_grey_png(path: &Path) -> FileResult<Plane<u16>> {
    let (info, bytes) = decoded(path)?;
    let refused = match info.color_type {
        png::ColorType::Grayscale => None,
        png::ColorType::GrayscaleAlpha => Some("alpha"),
        png::ColorType::Rgb | png::ColorType::Rgba | png::ColorType::Indexed => Some("colours"),
    };
    if let Some(has) = refused {
        let problem = format!("the picture has {has}, and one channel is needed");
        return Err(FileError::unsupported(path, "header", problem).remedy("save it in shades of grey, without alpha"));
    }
    let pixels = match info.bit_depth {
        png::BitDepth::Sixteen => bytes.as_chunks().0.iter().map(|&level| u16::from_be_bytes(level)).collect(),
        _ => bytes.iter().map(|&level| 257 * u16::from(level)).collect(),
    };
    Ok(Plane { width: info.width as usize, height: info.height as usize, pixels })
}

/// Reads a PNG of 8 or 16 bits, grey, RGB or palette, with or without alpha, to premultiplied values.
///
/// # Errors
/// If the file cannot be opened, is no PNG, or is damaged.
pub fn read_png(path: &Path) -> FileResult<RgbaImage> {
    let (info, bytes) = decoded(path)?;
    let samples: Vec<f32> = match info.bit_depth {
        png::BitDepth::Sixteen => {
            bytes.as_chunks().0.iter().map(|&b| f32::from(u16::from_be_bytes(b)) / 65535.0).collect()
        }
        _ => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
    };
    let pixels = match info.color_type {
        png::ColorType::Grayscale => samples.iter().map(|&v| [v, v, v, 1.0]).collect(),
        png::ColorType::GrayscaleAlpha => {
            samples.as_chunks().0.iter().map(|&[v, a]| premultiplied([v, v, v, a])).collect()
        }
        png::ColorType::Rgb => samples.as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, 1.0]).collect(),
        png::ColorType::Rgba => samples.as_chunks().0.iter().map(|&p| premultiplied(p)).collect(),
        png::ColorType::Indexed => return Err(FileError::invalid(path, "", "has a palette that cannot be expanded")),
    };
    Ok(RgbaImage { width: info.width as usize, height: info.height as usize, pixels })
}

fn premultiplied([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    [r * a, g * a, b * a, a]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write_with(path: &Path, color: png::ColorType, depth: png::BitDepth, palette: Option<&[u8]>, data: &[u8]) {
        let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if let Some(palette) = palette {
            encoder.set_palette(palette.to_vec());
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
    }

    /// Premultiplied values that 8-bit straight alpha represents exactly.
    fn image() -> RgbaImage {
        let pixel = |r: f32, a: f32| [r * a, 0.2 * a, a, a];
        RgbaImage { width: 2, height: 2, pixels: vec![pixel(1.0, 1.0), pixel(0.4, 0.6), pixel(0.0, 0.2), [0.0; 4]] }
    }

    #[test]
    fn straight_alpha_round_trips_in_both_depths() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        for depth in [PngDepth::Eight, PngDepth::Sixteen] {
            write_png(&path, &image(), None, depth).unwrap();
            let back = read_png(&path).unwrap();
            assert_eq!((back.width, back.height), (2, 2));
            let is_back = |image: &RgbaImage| {
                let mut channels = back.pixels.iter().flatten().zip(image.pixels.iter().flatten());
                // All values are multiples of 1/255: only a few roundings of f32 below 1 (2^-25 each) are left. Measured: none.
                channels.all(|(a, b)| (a - b).abs() <= f32::EPSILON)
            };
            let mut other = image();
            other.pixels[1][0] += 1.0 / 65_535.0;
            assert!(is_back(&image()) && !is_back(&other), "{back:?}");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "a temporary file is left");
    }

    #[test]
    fn an_opaque_image_has_the_background_and_no_alpha() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        write_png(&path, &image(), Some([1.0, 0.0, 0.4]), PngDepth::Eight).unwrap();
        let back = read_png(&path).unwrap();
        assert!(back.pixels.iter().all(|p| p[3] == 1.0));
        assert_eq!(back.pixels[3], [1.0, 0.0, 0.4, 1.0]);
    }

    #[test]
    fn values_above_one_are_clamped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let bright = RgbaImage { width: 1, height: 1, pixels: vec![[3.0, -1.0, 0.5, 1.0001]] };
        write_png(&path, &bright, None, PngDepth::Sixteen).unwrap();
        let back = read_png(&path).unwrap().pixels[0];
        assert_eq!((back[0], back[1], back[3]), (1.0, 0.0, 1.0));
    }

    #[test]
    fn images_without_pixels_or_with_nan_are_not_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let mut nan = RgbaImage::new(3, 2);
        nan.pixels[5][1] = f32::NAN;
        let error = write_png(&path, &nan, None, PngDepth::Eight).unwrap_err().to_string();
        assert!(error.contains("a.png") && error.contains("pixel (2, 1)"), "{error}");
        assert!(write_png(&path, &RgbaImage::new(0, 4), None, PngDepth::Eight).is_err());
        assert!(write_png(&dir.path().join("no/such/a.png"), &image(), None, PngDepth::Eight).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn gray_palette_and_small_depths_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let read = || read_png(&path).unwrap().pixels;
        write_with(&path, png::ColorType::Grayscale, png::BitDepth::Eight, None, &[0, 51]);
        assert_eq!(read(), [[0.0, 0.0, 0.0, 1.0], [0.2, 0.2, 0.2, 1.0]]);
        write_with(&path, png::ColorType::Grayscale, png::BitDepth::One, None, &[0b0100_0000]);
        assert_eq!(read(), [[0.0, 0.0, 0.0, 1.0], [1.0; 4]]);
        write_with(
            &path,
            png::ColorType::GrayscaleAlpha,
            png::BitDepth::Sixteen,
            None,
            &[255, 255, 0, 0, 255, 255, 255, 255],
        );
        assert_eq!(read(), [[0.0; 4], [1.0; 4]]);
        write_with(
            &path,
            png::ColorType::Rgb,
            png::BitDepth::Sixteen,
            None,
            &[0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 0, 0],
        );
        assert_eq!(read(), [[0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
        write_with(&path, png::ColorType::Indexed, png::BitDepth::Two, Some(&[255, 0, 0, 0, 0, 255]), &[0b0100_0000]);
        assert_eq!(read(), [[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0]]);
    }

    #[test]
    fn one_channel_is_read_to_sixteen_bits_and_colours_and_alpha_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        write_with(&path, png::ColorType::Grayscale, png::BitDepth::Eight, None, &[7, 255]);
        let grey = read_grey_png(&path).unwrap();
        assert_eq!((grey.width, grey.height, grey.pixels), (2, 1, vec![7 * 257, 65_535]));
        write_with(&path, png::ColorType::Grayscale, png::BitDepth::Sixteen, None, &[1, 2, 255, 254]);
        assert_eq!(read_grey_png(&path).unwrap().pixels, [258, 65_534]);
        for (color, samples, has) in [
            (png::ColorType::Rgb, 6, "colours"),
            (png::ColorType::Rgba, 8, "colours"),
            (png::ColorType::GrayscaleAlpha, 4, "alpha"),
            (png::ColorType::Indexed, 2, "colours"),
        ] {
            let palette = (color == png::ColorType::Indexed).then_some(&[0; 3][..]);
            write_with(&path, color, png::BitDepth::Eight, palette, &vec![0; samples]);
            let error = read_grey_png(&path).unwrap_err().to_string();
            assert!(["a.png", "header", has, "shades of grey"].iter().all(|part| error.contains(part)), "{error}");
        }
    }

    #[test]
    fn files_that_are_no_whole_png_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("broken.png");
        assert!(read_png(&path).unwrap_err().to_string().contains("broken.png"));
        assert!(read_grey_png(&path).unwrap_err().to_string().contains("broken.png"));
        write_png(&path, &image(), None, PngDepth::Eight).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in 0..whole.len() - 12 {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read_png(&path).is_err(), "cut at {length} of {}", whole.len());
        }
        std::fs::write(&path, b"no image at all").unwrap();
        assert!(read_png(&path).unwrap_err().to_string().contains("broken.png"));
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused_before_memory_is_taken() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("huge.png");
        let mut encoder = png::Encoder::new(std::fs::File::create(&path).unwrap(), 1 << 20, 1 << 20);
        encoder.set_color(png::ColorType::Grayscale);
        drop(encoder.write_header().unwrap());
        let error = read_png(&path).unwrap_err().to_string();
        assert!(error.contains("huge.png"), "{error}");
    }
}
