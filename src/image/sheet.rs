//! Contact sheets of many frames, and amplified difference images.

use super::metrics::check_sizes;
use super::{MetricsError, RgbaImage};

/// Frames in rows of `columns`, top left first, with `gap` pixels between and around them, over an opaque `background`.
/// Frames of different sizes are centred in cells of the largest width and height. Without frames the sheet is empty.
pub fn contact_sheet(frames: &[RgbaImage], columns: usize, gap: usize, background: [f32; 3]) -> RgbaImage {
    let cell_width = frames.iter().map(|f| f.width).max().unwrap_or(0);
    let cell_height = frames.iter().map(|f| f.height).max().unwrap_or(0);
    if cell_width == 0 || cell_height == 0 {
        return RgbaImage::default();
    }
    let columns = columns.clamp(1, frames.len());
    let rows = frames.len().div_ceil(columns);
    let [r, g, b] = background;
    let mut sheet = RgbaImage::new(columns * (cell_width + gap) + gap, rows * (cell_height + gap) + gap);
    sheet.pixels.fill([r, g, b, 1.0]);
    for (i, frame) in frames.iter().enumerate().filter(|(_, f)| f.width > 0) {
        let left = gap + (i % columns) * (cell_width + gap) + (cell_width - frame.width) / 2;
        let top = gap + (i / columns) * (cell_height + gap) + (cell_height - frame.height) / 2;
        for (j, row) in frame.over(background).chunks_exact(frame.width).enumerate() {
            let start = (top + j) * sheet.width + left;
            for (pixel, &[r, g, b]) in sheet.pixels[start..start + frame.width].iter_mut().zip(row) {
                *pixel = [r, g, b, 1.0];
            }
        }
    }
    sheet
}

/// Absolute differences of two images over a `background`, times `factor`, clamped to 1: opaque, black for equal pixels. The default factor
/// is the largest power of ten that clamps nothing (1 for equal images). Returns the factor too.
///
/// # Errors
/// If sizes differ or there are no pixels.
pub fn amplified_difference(
    a: &RgbaImage,
    b: &RgbaImage,
    background: [f32; 3],
    factor: Option<f32>,
) -> Result<(RgbaImage, f32), MetricsError> {
    check_sizes(a, b)?;
    let pairs = a.over(background).into_iter().zip(b.over(background));
    let differences: Vec<[f32; 3]> =
        pairs.map(|(a, b)| std::array::from_fn(|channel| (a[channel] - b[channel]).abs())).collect();
    let largest = differences.iter().flatten().fold(0.0f32, |most, &d| most.max(d));
    let factor = factor.unwrap_or(if largest > 0.0 { 10f32.powf((1.0 / largest).log10().floor()) } else { 1.0 });
    let pixels = differences.iter().map(|d| [d[0], d[1], d[2]].map(|d| (d * factor).min(1.0)));
    let pixels = pixels.map(|[r, g, b]| [r, g, b, 1.0]).collect();
    Ok((RgbaImage { width: a.width, height: a.height, pixels }, factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(width: usize, height: usize, pixel: [f32; 4]) -> RgbaImage {
        RgbaImage { width, height, pixels: vec![pixel; width * height] }
    }

    #[test]
    fn frames_stand_in_rows_with_gaps_over_the_background() {
        let frames = [filled(2, 1, [1.0; 4]), filled(2, 1, [0.0; 4]), filled(2, 1, [0.25, 0.0, 0.0, 0.5])];
        let sheet = contact_sheet(&frames, 2, 1, [0.5, 0.5, 0.5]);
        assert_eq!((sheet.width, sheet.height), (7, 5));
        let at = |i: usize, j: usize| sheet.pixels[j * 7 + i];
        let gray = [0.5, 0.5, 0.5, 1.0];
        assert_eq!((at(0, 0), at(1, 1), at(2, 1), at(3, 1)), (gray, [1.0; 4], [1.0; 4], gray));
        assert_eq!((at(4, 1), at(1, 3), at(4, 3)), (gray, [0.5, 0.25, 0.25, 1.0], gray));
    }

    #[test]
    fn frames_of_other_sizes_are_centred() {
        let sheet = contact_sheet(&[filled(3, 3, [1.0; 4]), filled(1, 1, [1.0; 4])], 9, 0, [0.0; 3]);
        assert_eq!((sheet.width, sheet.height), (6, 3));
        let white: Vec<usize> = (0..18).filter(|&i| sheet.pixels[i][0] == 1.0).collect();
        assert_eq!(white, [0, 1, 2, 6, 7, 8, 10, 12, 13, 14]);
    }

    #[test]
    fn differences_are_amplified_by_a_power_of_ten_that_clamps_nothing_or_as_asked() {
        let (a, b) = (filled(2, 1, [0.5, 0.25, 0.0, 1.0]), filled(2, 1, [0.53, 0.25, 0.0, 1.0]));
        let (image, factor) = amplified_difference(&a, &b, [0.0; 3], None).unwrap();
        assert_eq!(factor, 10.0);
        // 0.53 is an f32, up to 3e-8 off, times 10.
        assert!((image.pixels[1][0] - 0.3).abs() < 4e-7 && image.pixels[1][1..] == [0.0, 0.0, 1.0]);
        let (image, factor) = amplified_difference(&a, &b, [0.0; 3], Some(100.0)).unwrap();
        assert_eq!((factor, image.pixels[0]), (100.0, [1.0, 0.0, 0.0, 1.0]));
        assert_eq!(amplified_difference(&a, &a, [1.0; 3], None).unwrap(), (filled(2, 1, [0.0, 0.0, 0.0, 1.0]), 1.0));
        assert!(amplified_difference(&a, &filled(1, 1, [0.0; 4]), [0.0; 3], None).is_err());
        assert!(amplified_difference(&filled(0, 0, [0.0; 4]), &filled(0, 0, [0.0; 4]), [0.0; 3], None).is_err());
    }

    #[test]
    fn no_frames_and_no_columns_are_no_trouble() {
        assert_eq!(contact_sheet(&[], 3, 2, [0.0; 3]), RgbaImage::default());
        assert_eq!(contact_sheet(&[RgbaImage::new(0, 0)], 3, 2, [0.0; 3]), RgbaImage::default());
        assert_eq!(contact_sheet(&[filled(2, 2, [1.0; 4])], 0, 0, [0.0; 3]).height, 2);
    }
}
