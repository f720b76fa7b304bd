//! OpenEXR files: colour, depth and normals as 32-bit floats, surface ids as 32-bit integers, and attributes.
//!
//! Channels R, G, B (premultiplied), A and, if the planes exist: Z (world units, infinite without a surface), N.X, N.Y, N.Z and id. One
//! part of scan lines, losslessly compressed ([`ExrEncoding`]). Equal images give equal bytes.
//!
//! Colours of an EXR are scene-linear by convention, accumulators are display-referred: [`ExrColor`] says which a file holds, and is stored
//! in the file, so that reading gives accumulators again.

use super::srgb::linear_from_srgb;
use super::{Plane, Planes, RgbaImage};
use crate::error::{FileError, FileResult};
use crate::files;
use ::exr::error::Error as ExrError;
use ::exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image, Layer};
use ::exr::math::Vec2;
use ::exr::meta::attribute::{AttributeValue, IntegerBounds, LineOrder, Text};
use ::exr::meta::header::{ImageAttributes, LayerAttributes};
use ::exr::prelude::f16;
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

mod encoding;
mod read;
pub use encoding::{ExrCompression, ExrDepth, ExrEncoding};
pub use read::read_exr;

/// Colour space of an EXR's colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrColor {
    /// Linear light, premultiplied, as other programs expect. sRGB's curve is inverted on straight colours; where alpha is 0, on the stored
    /// colour.
    #[default]
    Linear,
    /// Display-referred accumulators; as floats, bit for bit.
    Raw,
}

impl ExrColor {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Raw => "raw",
        }
    }
}

impl FromStr for ExrColor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = [Self::Linear, Self::Raw].into_iter().find(|c| c.name() == text);
        known.ok_or_else(|| format!("'{text}' is neither linear nor raw"))
    }
}

/// The value of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum ExrValue {
    /// A string, UTF-8.
    Text(String),
    /// A double.
    Number(f64),
}

/// Attributes by name: `software`, or a name with a dot in it (no standard name has one), 1 to 255 bytes.
pub type ExrAttributes = BTreeMap<String, ExrValue>;

/// Result of [`read_exr`].
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Accumulators, and the planes whose channels exist: Z, N.X to N.Z, id.
    pub planes: Planes,
    /// Colour space in the file; [`ExrColor::Linear`] if not stated.
    pub stored: ExrColor,
    /// All text and number attributes outside of the standard, and `software`.
    pub attributes: ExrAttributes,
}

/// The attribute that holds the name of an [`ExrColor`].
const COLOR: &str = "tetreel.color";
/// The standard's attribute for the program that wrote the file.
const SOFTWARE: &str = "software";
/// The longest name of an attribute, bytes.
const LONGEST_NAME: usize = 255;
/// The largest width and height that the format supports (OpenEXR keeps twice of it within an i32).
const LARGEST_SIDE: usize = i32::MAX as usize / 2 - 1;

/// Writes all planes that have pixels; colour must. The file is written whole or not at all.
///
/// # Errors
/// If colour has no pixels or is too large for the format, a colour (as stored) or a normal is not finite, a depth is NaN or minus
/// infinity, a plane has another size, an attribute's name is not allowed, or the file cannot be written.
pub fn write_exr(
    path: &Path,
    planes: &Planes,
    encoding: impl Into<ExrEncoding>,
    attributes: &ExrAttributes,
) -> FileResult<()> {
    let ExrEncoding { color: stored, depth: bits, compression } = encoding.into();
    let Planes { color, depth, normal, id } = planes;
    check(path, planes)?;
    let names = ["R", "G", "B", "A"].into_iter().enumerate();
    let pixels: Vec<[f32; 4]> = match stored {
        ExrColor::Raw => color.pixels.clone(),
        ExrColor::Linear => color.pixels.iter().map(|&p| on_straight(p, linear_from_srgb)).collect(),
    };
    let (most, problem, remedy) = match bits {
        ExrDepth::Float => (f32::MAX, "is too bright for linear floats", "write accumulators (raw)"),
        ExrDepth::Half => (f16::MAX.to_f32(), "is too bright for halves", "write floats (32 bits)"),
    };
    if let Some(bad) = pixels.iter().position(|p| !p.iter().all(|c| c.abs() <= most)) {
        let place = format!("pixel ({}, {})", bad % color.width, bad / color.width);
        return Err(FileError::invalid(path, place, problem).remedy(remedy));
    }
    let plane = |i: usize| match bits {
        ExrDepth::Float => FlatSamples::F32(pixels.iter().map(|p| p[i]).collect()),
        ExrDepth::Half => FlatSamples::F16(pixels.iter().map(|p| f16::from_f32(p[i])).collect()),
    };
    let mut channels: Vec<_> = names.map(|(i, name)| AnyChannel::new(name, plane(i))).collect();
    drop(pixels);
    if !depth.pixels.is_empty() {
        channels.push(AnyChannel::new("Z", FlatSamples::F32(depth.pixels.clone())));
    }
    if !normal.pixels.is_empty() {
        let axis = |i: usize| FlatSamples::F32(normal.pixels.iter().map(|n| n[i]).collect());
        channels.extend(NORMAL.into_iter().enumerate().map(|(i, name)| AnyChannel::new(name, axis(i))));
    }
    if !id.pixels.is_empty() {
        channels.push(AnyChannel::new(ID, FlatSamples::U32(id.pixels.clone())));
    }

    let size = Vec2(color.width, color.height);
    let encoding = Encoding {
        compression: compression.of_library(),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer_attributes = layer_attributes(path, attributes, stored)?;
    let layer = Layer::new(size, layer_attributes, encoding, AnyChannels::sort(channels.into()));
    let image = Image::new(ImageAttributes::new(IntegerBounds::new((0, 0), size)), layer);
    let mut bytes = encoding::bytes_of(&image).map_err(|e| file_error(path, e))?;
    sort_attributes(&mut bytes).ok_or_else(|| FileError::invalid(path, "header", "does not end"))?;
    files::replace_with(path, &bytes)
}

/// Channels of normals.
const NORMAL: [&str; 3] = ["N.X", "N.Y", "N.Z"];
/// The channel of surface ids.
const ID: &str = "id";

/// Checks that the planes can be stored.
fn check(path: &Path, Planes { color, depth, normal, id }: &Planes) -> FileResult<()> {
    let (width, height) = (color.width, color.height);
    if color.pixels.is_empty() {
        return Err(FileError::invalid(path, "", "an image without pixels cannot be written"));
    }
    if width.max(height) > LARGEST_SIDE {
        let problem = format!("an EXR has at most {LARGEST_SIDE} pixels a row and rows");
        return Err(FileError::unsupported(path, "", problem).remedy("make it smaller"));
    }
    if let Some((i, j)) = color.first_not_finite() {
        return Err(FileError::invalid(path, format!("pixel ({i}, {j})"), "is not finite and has no colour"));
    }
    check_size(path, "depth", depth, color)?;
    check_size(path, "normal", normal, color)?;
    check_size(path, "id", id, color)?;
    let place = |bad: usize| format!("pixel ({}, {})", bad % width, bad / width);
    if let Some(bad) = normal.pixels.iter().position(|n| !n.iter().all(|x| x.is_finite())) {
        return Err(FileError::invalid(path, format!("normal of {}", place(bad)), "is not finite"));
    }
    if let Some(bad) = depth.pixels.iter().position(|d| d.is_nan() || *d == f32::NEG_INFINITY) {
        return Err(FileError::invalid(path, format!("depth of {}", place(bad)), "is no distance"));
    }
    Ok(())
}

/// Checks that a plane with pixels has the size of colour.
fn check_size<P>(path: &Path, name: &str, plane: &Plane<P>, color: &RgbaImage) -> FileResult<()> {
    let (width, height) = (color.width, color.height);
    if plane.pixels.is_empty() || (plane.width, plane.height) == (width, height) {
        return Ok(());
    }
    let problem = format!("is {} x {}, colour {width} x {height} pixels", plane.width, plane.height);
    Err(FileError::invalid(path, name, problem))
}

/// Applies a curve to the straight colour of a premultiplied pixel: `linear_from_srgb` makes linear light of accumulators, and
/// `srgb_from_linear` accumulators of linear light. Colour without opacity has no straight colour: the curve is applied as if the pixel were
/// opaque, so that it stays invertible.
fn on_straight([r, g, b, a]: [f32; 4], curve: impl Fn(f64) -> f64) -> [f32; 4] {
    let opacity = if a == 0.0 { 1.0 } else { f64::from(a) };
    let [r, g, b] = [r, g, b].map(|c| (curve(f64::from(c) / opacity) * opacity) as f32);
    [r, g, b, a]
}

/// Converts the attributes to the library's types.
fn layer_attributes(path: &Path, attributes: &ExrAttributes, stored: ExrColor) -> FileResult<LayerAttributes> {
    let text = |text: &str| Text::from_slice_unchecked(text.as_bytes());
    let mut layer = LayerAttributes::default();
    for (name, value) in attributes {
        if name == SOFTWARE {
            let ExrValue::Text(software) = value else {
                return Err(FileError::invalid(path, "attribute software", "is no text"));
            };
            layer.software_name = Some(text(software));
            continue;
        }
        if name.len() > LONGEST_NAME || name.contains('\0') || !name.contains('.') {
            let problem = format!("a name needs a dot and has at most {LONGEST_NAME} bytes, none of them zero");
            return Err(FileError::unsupported(path, format!("attribute {name:?}"), problem).remedy("rename it"));
        }
        let value = match value {
            ExrValue::Text(value) => AttributeValue::Text(text(value)),
            ExrValue::Number(value) => AttributeValue::F64(*value),
        };
        layer.other.insert(text(name), value);
    }
    layer.other.insert(text(COLOR), AttributeValue::Text(text(stored.name())));
    Ok(layer)
}

/// Offset of the header in a file with one part: after magic number and version.
const HEADER_START: usize = 8;

/// Sorts the attributes of the header by name, since the library writes ours in hash-map order, different each time. Other bytes stay in
/// place: the header keeps its length. `None` if the header does not end.
///
/// An attribute is its name and its type, both ended by a zero byte, the size of its value (i32, little-endian) and the
/// value; a zero byte ends the header ("OpenEXR File Layout", openexr.com).
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    let mut at = HEADER_START;
    let mut attributes = Vec::new();
    while *bytes.get(at)? != 0 {
        let end_of_text = |from: usize| Some(from + bytes.get(from..)?.iter().position(|&b| b == 0)? + 1);
        let value_size = end_of_text(end_of_text(at)?)?;
        let size = i32::from_le_bytes(bytes.get(value_size..value_size + 4)?.try_into().ok()?);
        let end = value_size + 4 + usize::try_from(size).ok()?;
        // The name ends with the first zero byte, so sorting the bytes sorts by name.
        attributes.push(bytes.get(at..end)?.to_vec());
        at = end;
    }
    attributes.sort_unstable();
    bytes[HEADER_START..at].copy_from_slice(&attributes.concat());
    Some(())
}

/// Advice for files of an unsupported kind.
const SAVE_AS: &str =
    "save it as one flat image with channels R, G, B and A, neither cropped nor subsampled, compressed as ZIP";

/// Converts the library's error to a file error.
fn file_error(path: &Path, error: ExrError) -> FileError {
    match error {
        ExrError::NotSupported(problem) => FileError::unsupported(path, "", problem).remedy(SAVE_AS),
        ExrError::Invalid(problem) => FileError::invalid(path, "", problem).remedy("is it a whole EXR file?"),
        ExrError::Io(error) => FileError::io(path, "read or write", &error),
        ExrError::Aborted => FileError::invalid(path, "", "was given up"),
    }
}

#[cfg(test)]
#[path = "exr_tests.rs"]
mod tests;
