//! Writing one frame to an image file: its metadata and formats.

use crate::error::{FileError, FileResult};
use crate::image::{
    ExrAttributes, ExrEncoding, ExrValue, Planes, PngDepth, read_exr, read_png_text, write_exr, write_png_with_texts,
};
use crate::transfer::{MappedRange, OpacityKind, RangePolicy};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use std::str::FromStr;

/// A frame to be written: its planes and their description.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OutputFrame {
    /// Colours; depths of the same size, or empty.
    pub planes: Planes,
    /// Description of the planes.
    pub attributes: FrameAttributes,
}

/// Description of a frame, as plain data: written into formats with metadata, and the source of annotations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameAttributes {
    /// Time of the series, in its unit.
    pub time: f64,
    /// Zero-based step of the series; the last one at or before `time` where steps are interpolated.
    pub step: usize,
    /// Zero-based number of the frame in its run.
    pub frame: usize,
    /// Field shown, as the user selects it: `T`, `velocity:mag`.
    pub field: String,
    /// Unit of the field, if known.
    pub units: Option<String>,
    /// Camera as `--camera` takes it.
    pub camera: String,
    /// Transfer function as `--tf` takes it.
    pub transfer_function: String,
    /// Scalars covered by the transfer function in this frame; `None` if not known.
    pub range: Option<MappedRange>,
    /// Meaning of the opacities.
    pub opacity_kind: OpacityKind,
    /// Reference length of the opacities, world units.
    pub unit_distance: f64,
    /// `tetreel VERSION`.
    pub software: String,
    /// Further properties of this frame, by name.
    pub extras: BTreeMap<String, String>,
}

impl FrameAttributes {
    /// The value of [`Self::software`] for this version.
    pub const SOFTWARE: &str = concat!("tetreel ", env!("CARGO_PKG_VERSION"));

    /// The attributes of an EXR: `software`, and `tetreel.NAME` for known properties. Camera, transfer function and range are texts as on
    /// the command line; numbers are doubles; extras are `tetreel.extra.NAME`.
    pub fn to_exr(&self) -> ExrAttributes {
        let range = self.range.map_or(String::new(), |range| {
            let (lo, hi) = (range.lo(), range.hi());
            if range.is_log() { RangePolicy::LogManual(lo, hi) } else { RangePolicy::Manual(lo, hi) }.to_string()
        });
        let texts = [
            ("field", self.field.as_str()),
            ("units", self.units.as_deref().unwrap_or_default()),
            ("camera", &self.camera),
            ("transferFunction", &self.transfer_function),
            ("range", &range),
            ("opacityKind", self.opacity_kind.as_str()),
        ];
        let numbers = [
            ("time", self.time),
            ("step", self.step as f64),
            ("frame", self.frame as f64),
            ("unitDistance", self.unit_distance),
        ];
        let text = |text: &str| ExrValue::Text(text.to_owned());
        let known = texts.into_iter().filter(|(_, value)| !value.is_empty());
        let mut attributes: ExrAttributes = known.map(|(name, v)| (format!("tetreel.{name}"), text(v))).collect();
        attributes.extend(numbers.map(|(name, v)| (format!("tetreel.{name}"), ExrValue::Number(v))));
        attributes.extend(self.extras.iter().map(|(name, v)| (format!("tetreel.extra.{name}"), text(v))));
        if !self.software.is_empty() {
            attributes.insert("software".to_owned(), text(&self.software));
        }
        attributes
    }

    /// Name of the fingerprint in [`Self::extras`], which [`read_fingerprint`] reads back.
    pub const FINGERPRINT: &str = "fingerprint";

    /// The fingerprint of the request that the frame was rendered for, if it has one.
    pub fn fingerprint(&self) -> Option<&str> {
        self.extras.get(Self::FINGERPRINT).map(String::as_str)
    }
}

/// The background behind the volume.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Background {
    /// No background: the image keeps its opacity as straight alpha.
    #[default]
    Transparent,
    /// A display-referred colour, 0..=1 per channel: the image is opaque.
    Color([f32; 3]),
}

impl Background {
    /// The colour; `None` for a transparent background.
    pub fn color(self) -> Option<[f32; 3]> {
        match self {
            Self::Transparent => None,
            Self::Color(rgb) => Some(rgb),
        }
    }
}

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" | "transparent" => return Ok(Self::Transparent),
            "black" => return Ok(Self::Color([0.0; 3])),
            "white" => return Ok(Self::Color([1.0; 3])),
            "gray" | "grey" => return Ok(Self::Color([0.5; 3])),
            _ => {}
        }
        let hex = text.strip_prefix('#').filter(|h| h.len() == 6 && h.bytes().all(|b| b.is_ascii_hexdigit()));
        let packed = hex.and_then(|h| u32::from_str_radix(h, 16).ok());
        let packed = packed.ok_or("write #rrggbb, black, white, gray or none")?;
        Ok(Self::Color([16, 8, 0].map(|shift| (packed >> shift & 255) as f32 / 255.0)))
    }
}

/// A format of still images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StillFormat {
    /// PNG: colour in 8 or 16 bits.
    Png,
    /// OpenEXR: colour and depth as floats, and [`FrameAttributes`].
    Exr,
}

impl StillFormat {
    /// The format for a file name's extension, in upper or lower case.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_ascii_lowercase().to_str()? {
            "png" => Some(Self::Png),
            "exr" => Some(Self::Exr),
            _ => None,
        }
    }
}

/// How still images are written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillOptions {
    /// Background behind the volume, PNG only.
    pub background: Background,
    /// Bits per channel of a PNG.
    pub png_depth: PngDepth,
    /// Encoding of an EXR.
    pub exr: ExrEncoding,
}

/// Writes a frame in the format given by the file's extension. The file appears complete or not at all.
///
/// # Errors
/// If the extension is unknown, the format cannot hold the frame, or the folder is not writable.
pub fn write_still(path: &Path, frame: &OutputFrame, options: &StillOptions) -> FileResult<()> {
    match StillFormat::of(path) {
        Some(StillFormat::Png) => {
            let mut texts = Vec::new();
            if let Some(fingerprint) = frame.attributes.fingerprint() {
                texts.push((PNG_SOFTWARE, frame.attributes.software.as_str()));
                texts.push((PNG_FINGERPRINT, fingerprint));
            }
            write_png_with_texts(path, &frame.planes.color, options.background.color(), options.png_depth, &texts)
        }
        Some(StillFormat::Exr) => write_exr(path, &frame.planes, options.exr, &frame.attributes.to_exr()),
        None => Err(FileError::unsupported(path, "", "is no image format that can be written").remedy(REMEDY)),
    }
}

/// The PNG standard's keyword for the software that made an image.
const PNG_SOFTWARE: &str = "Software";
/// PNG keyword of [`FrameAttributes::FINGERPRINT`].
const PNG_FINGERPRINT: &str = "tetreel fingerprint";
/// EXR attribute of [`FrameAttributes::FINGERPRINT`].
const EXR_FINGERPRINT: &str = "tetreel.extra.fingerprint";

/// The fingerprint of the request that an image was rendered for; `None` if it has none. The file is read to its end.
///
/// # Errors
/// If the file cannot be read, is damaged or cut.
pub fn read_fingerprint(path: &Path) -> FileResult<Option<String>> {
    match StillFormat::of(path) {
        Some(StillFormat::Png) => read_png_text(path, PNG_FINGERPRINT),
        Some(StillFormat::Exr) => Ok(match read_exr(path)?.attributes.remove(EXR_FINGERPRINT) {
            Some(ExrValue::Text(fingerprint)) => Some(fingerprint),
            _ => None,
        }),
        None => Ok(None),
    }
}

/// Remedy for a name without a known extension.
const REMEDY: &str = "end the name with .png or .exr";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{DepthImage, RgbaImage};
    use crate::image::{ExrColor, read_exr};

    #[test]
    fn backgrounds_are_named_or_hexadecimal() {
        assert_eq!("#ff8000".parse(), Ok(Background::Color([1.0, 128.0 / 255.0, 0.0])));
        assert_eq!("none".parse(), Ok(Background::Transparent));
        assert!("#12345".parse::<Background>().is_err() && "#+12345".parse::<Background>().is_err());
    }

    /// A frame of 2 x 1 pixels.
    fn frame() -> OutputFrame {
        let color = RgbaImage { width: 2, height: 1, pixels: vec![[0.5, 0.25, 0.125, 0.5], [0.0; 4]] };
        let depth = DepthImage { width: 2, height: 1, pixels: vec![2.5, f32::INFINITY] };
        let attributes = FrameAttributes {
            time: 0.1,
            step: 3,
            units: Some("K".to_owned()),
            range: Some(MappedRange::new(1.0, 1000.0, true).unwrap()),
            software: FrameAttributes::SOFTWARE.to_owned(),
            extras: BTreeMap::from([("lod".to_owned(), "0.5".to_owned())]),
            ..Default::default()
        };
        OutputFrame { planes: Planes { color, depth, ..Planes::default() }, attributes }
    }

    #[test]
    fn an_exr_has_planes_and_attributes_of_the_frame() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let options = StillOptions { exr: ExrColor::Raw.into(), ..Default::default() };
        write_still(&path, &frame(), &options).unwrap();
        let back = read_exr(&path).unwrap();
        assert_eq!(back.planes, frame().planes);
        let text = |text: &str| Some(ExrValue::Text(text.to_owned()));
        let get = |name: &str| back.attributes.get(name).cloned();
        assert_eq!(get("tetreel.time"), Some(ExrValue::Number(0.1)));
        assert_eq!(get("tetreel.step"), Some(ExrValue::Number(3.0)));
        assert_eq!(get("tetreel.range"), text("log:1.0,1000.0"));
        assert_eq!((get("tetreel.units"), get("tetreel.field")), (text("K"), None));
        assert_eq!((get("tetreel.extra.lod"), get("tetreel.opacityKind")), (text("0.5"), text("alpha")));
        assert_eq!(get("software"), text(FrameAttributes::SOFTWARE));
        let mut without_depth = frame();
        without_depth.planes.depth = DepthImage::default();
        write_still(&path, &without_depth, &options).unwrap();
        assert_eq!(read_exr(&path).unwrap().planes, without_depth.planes);
    }

    #[test]
    fn a_png_has_as_many_bits_as_asked_for() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        for (png_depth, bits) in [(PngDepth::Eight, 8), (PngDepth::Sixteen, 16)] {
            write_still(&path, &frame(), &StillOptions { png_depth, ..Default::default() }).unwrap();
            // The bit depth of a PNG's header ("IHDR", PNG specification 11.2.2).
            assert_eq!(std::fs::read(&path).unwrap()[24], bits);
        }
    }

    #[test]
    fn frame_attributes_are_plain_data() {
        let json = serde_json::to_string(&frame().attributes).unwrap();
        assert_eq!(serde_json::from_str::<FrameAttributes>(&json).unwrap(), frame().attributes);
    }

    #[test]
    fn the_extension_chooses_the_format() {
        let of = |name: &str| StillFormat::of(Path::new(name));
        assert_eq!(of("a/b.PNG"), Some(StillFormat::Png));
        assert_eq!(of("b.c.exr"), Some(StillFormat::Exr));
        assert_eq!([of("exr"), of(".png"), of("a.jpg"), of("")], [None; 4]);
    }
}
