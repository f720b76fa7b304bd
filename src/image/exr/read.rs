//! Reads EXR files, our own and those of other programs.

use super::{
    COLOR, ExrAttributes, ExrColor, ExrImage, ExrValue, ID, NORMAL, SAVE_AS, SOFTWARE, file_error, on_straight,
};
use crate::error::{FileError, FileResult};
use crate::image::srgb::srgb_from_linear;
use crate::image::{Plane, Planes, RgbaImage};
use ::exr::image::read::image::ReadLayers as _;
use ::exr::image::read::layers::ReadChannels as _;
use ::exr::image::{AnyChannels, FlatSamples};
use ::exr::math::Vec2;
use ::exr::meta::attribute::AttributeValue;
use ::exr::meta::header::{Header, LayerAttributes};
use std::io::BufReader;
use std::path::Path;

/// Reads the first part of an EXR: channels R, G and B (or Y, grey) of halfs, floats or integers, A (1 if missing), Z, N.X to N.Z and id.
/// Whole images only: the data window must be the display window.
///
/// Colours become accumulators: [`ExrColor::Raw`] ones unchanged, all others by sRGB's curve.
///
/// # Errors
/// If the file cannot be opened, is no EXR, is damaged, has no colour, or needs an unsupported feature (deep data, subsampled channels,
/// cropped or overscanned images).
pub fn read_exr(path: &Path) -> FileResult<ExrImage> {
    let file = std::fs::File::open(path).map_err(|e| FileError::io(path, "open", &e))?;
    let file_bytes = file.metadata().map_err(|e| FileError::io(path, "open", &e))?.len();
    let chunks = ::exr::block::read(BufReader::new(file), false).map_err(|e| file_error(path, e))?;
    for header in chunks.headers() {
        check_header(path, header, file_bytes)?;
    }
    let image = ::exr::image::read::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        // Two chunks at one position mean that another is missing.
        .pedantic()
        .from_chunks(chunks)
        .map_err(|e| file_error(path, e))?;
    let (layer, Vec2(width, height)) = (&image.layer_data, image.layer_data.size);
    let attributes = attributes(&layer.attributes);
    let stored = match attributes.get(COLOR) {
        Some(ExrValue::Text(name)) => {
            name.parse().map_err(|e: String| FileError::unsupported(path, COLOR, e).remedy("remove the attribute"))?
        }
        _ => ExrColor::Linear,
    };
    let mut color = color_of(path, &layer.channel_data, width, height)?;
    if stored == ExrColor::Linear {
        color.pixels.iter_mut().for_each(|p| *p = on_straight(*p, srgb_from_linear));
    }
    let channels = &layer.channel_data;
    let depth = channel(channels, "Z").map(|z| Plane { width, height, pixels: floats(z) }).unwrap_or_default();
    let normal = match NORMAL.map(|name| channel(channels, name)) {
        [Some(x), Some(y), Some(z)] => {
            let [x, y, z] = [x, y, z].map(floats);
            let pixels = (0..x.len()).map(|i| [x[i], y[i], z[i]]).collect();
            Plane { width, height, pixels }
        }
        _ => Plane::default(),
    };
    let id = match channel(channels, ID) {
        Some(FlatSamples::U32(pixels)) => Plane { width, height, pixels: pixels.clone() },
        // Another program's channel, with another meaning.
        _ => Plane::default(),
    };
    Ok(ExrImage { planes: Planes { color, depth, normal, id }, stored, attributes })
}

/// Maximum expansion of a block by decompression, small blocks aside: the bound of deflate.
const MOST_EXPANSION: u64 = 1032;
/// Images up to this size are allocated unchecked: 4096 x 4096 pixels of four floats.
const HARMLESS_BYTES: u64 = 1 << 28;

/// Checks before allocation that a header describes a supported image that fits in the file.
pub(super) fn check_header(path: &Path, header: &Header, file_bytes: u64) -> FileResult<()> {
    let Vec2(width, height) = header.layer_size;
    // A sample has at most four bytes.
    let samples = [height, header.channels.list.len(), 4];
    let bytes = samples.iter().try_fold(width as u64, |product, &n| product.checked_mul(n as u64));
    let most = file_bytes.saturating_mul(MOST_EXPANSION).saturating_add(HARMLESS_BYTES);
    // The block table has eight bytes per block.
    if bytes.is_none_or(|bytes| bytes > most) || header.chunk_count as u64 > file_bytes / 8 {
        let promise = format!("promises {width} x {height} pixels in {file_bytes} bytes");
        return Err(FileError::invalid(path, "header", promise).remedy("is it a whole EXR file?"));
    }
    let unsupported = |problem: &str| Err(FileError::unsupported(path, "header", problem).remedy(SAVE_AS));
    if header.deep {
        return unsupported("deep images cannot be read");
    }
    if header.channels.list.iter().any(|c| c.sampling != Vec2(1, 1)) {
        return unsupported("subsampled channels cannot be read");
    }
    if header.data_window() != header.shared_attributes.display_window {
        return unsupported("the data window is not the display window; cropped images cannot be read");
    }
    Ok(())
}

fn channel<'a>(channels: &'a AnyChannels<FlatSamples>, name: &str) -> Option<&'a FlatSamples> {
    channels.list.iter().find(|c| c.name.eq(name)).map(|c| &c.sample_data)
}

fn floats(samples: &FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F32(values) => values.clone(),
        others => others.values_as_f32().collect(),
    }
}

/// The colours as stored.
fn color_of(path: &Path, channels: &AnyChannels<FlatSamples>, width: usize, height: usize) -> FileResult<RgbaImage> {
    let mut color = RgbaImage { width, height, pixels: vec![[0.0, 0.0, 0.0, 1.0]; width * height] };
    let grey = if channel(channels, "R").is_none() { channel(channels, "Y") } else { None };
    for (i, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        let samples = match channel(channels, name) {
            None if i < 3 => grey,
            found => found,
        };
        match samples {
            Some(samples) => color.pixels.iter_mut().zip(floats(samples)).for_each(|(p, v)| p[i] = v),
            None if i == 3 => {}
            None => {
                let names: Vec<String> = channels.list.iter().map(|c| c.name.to_string()).collect();
                let problem = format!("there is no channel {name}, only {}", names.join(", "));
                return Err(FileError::unsupported(path, "channels", problem).remedy(SAVE_AS));
            }
        }
    }
    Ok(color)
}

/// All text and number attributes outside of the standard, and `software`.
fn attributes(layer: &LayerAttributes) -> ExrAttributes {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let value = |value: &AttributeValue| match value {
        AttributeValue::Text(value) => Some(ExrValue::Text(text(value.as_slice()))),
        AttributeValue::F64(value) => Some(ExrValue::Number(*value)),
        AttributeValue::F32(value) => Some(ExrValue::Number(f64::from(*value))),
        AttributeValue::I32(value) => Some(ExrValue::Number(f64::from(*value))),
        _ => None,
    };
    let others = layer.other.iter().filter_map(|(name, v)| Some((text(name.as_slice()), value(v)?)));
    let software = layer.software_name.iter().map(|name| (SOFTWARE.to_owned(), ExrValue::Text(text(name.as_slice()))));
    others.chain(software).collect()
}
