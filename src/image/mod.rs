//! Image planes, their metrics, and PNG files.
//!
//! Row 0 is the top row; the centre of pixel (i, j) is (i + 0.5, j + 0.5).

/// A plane of raw accumulators: premultiplied, display-referred RGB and opacity per pixel, no background.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RgbaImage {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels, top row first: red, green, blue (premultiplied), opacity.
    pub pixels: Vec<[f32; 4]>,
}

impl RgbaImage {
    /// A fully transparent image.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![[0.0; 4]; width * height] }
    }
}
