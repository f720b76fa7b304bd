//! Image planes, their metrics, PNG and EXR files.
//!
//! Row 0 is the top row; the centre of pixel (i, j) is (i + 0.5, j + 0.5).

mod exr;
mod filter;
mod flip;
mod metrics;
mod planes;
mod png;
mod sheet;
mod srgb;
pub mod upsample;

pub use exr::{
    ExrAttributes, ExrColor, ExrCompression, ExrDepth, ExrEncoding, ExrImage, ExrValue, read_exr, write_exr,
};
pub use metrics::{
    IdMetrics, ImageMetrics, MetricsError, PlaneMetrics, RawDifference, compare, compare_depth, compare_ids,
    compare_normals, compare_raw,
};
pub use planes::{Plane, PlaneSamples, Planes};
pub use png::{PngDepth, read_grey_png, read_png, read_png_text, write_png, write_png_with_texts};
pub use sheet::{amplified_difference, contact_sheet};

use crate::error::{FileError, FileResult};
use std::io::Read;
use std::path::Path;

/// The first bytes of every EXR.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reads a PNG or an EXR, recognised by its first bytes: accumulators, and other planes if the file has them.
///
/// # Errors
/// As [`read_png`] and [`read_exr`].
pub fn read_image(path: &Path) -> FileResult<Planes> {
    let mut first = Vec::new();
    let file = std::fs::File::open(path).map_err(|e| FileError::io(path, "open", &e))?;
    file.take(4).read_to_end(&mut first).map_err(|e| FileError::io(path, "read", &e))?;
    if first != EXR_MAGIC {
        return Ok(Planes { color: read_png(path)?, ..Planes::default() });
    }
    Ok(read_exr(path)?.planes)
}

/// A plane of raw accumulators: premultiplied, display-referred RGB and opacity per pixel, no background.
pub type RgbaImage = Plane<[f32; 4]>;

/// A plane of distances, world units; infinite without a surface.
pub type DepthImage = Plane<f32>;

impl RgbaImage {
    /// A fully transparent image.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![[0.0; 4]; width * height] }
    }

    /// Colours over an opaque background, clamped to 0..=1; `width * height`, top row first.
    pub fn over(&self, background: [f32; 3]) -> Vec<[f32; 3]> {
        self.pixels.iter().map(|pixel| over(pixel, background)).collect()
    }

    /// Column and row of the first pixel with a NaN or an infinity.
    pub fn first_not_finite(&self) -> Option<(usize, usize)> {
        let bad = self.pixels.iter().position(|p| !p.iter().all(|c| c.is_finite()))?;
        Some((bad % self.width, bad / self.width))
    }
}

/// A pixel over an opaque background, clamped to 0..=1.
fn over(&[r, g, b, a]: &[f32; 4], background: [f32; 3]) -> [f32; 3] {
    let premultiplied = [r, g, b];
    std::array::from_fn(|c| (premultiplied[c] + (1.0 - a) * background[c]).clamp(0.0, 1.0))
}
