//! Renders one line of text to pixel coverage, in the font that comes with the program.
//!
//! The font is not hinted, so widths are proportional to the size; its digits are all equally wide.

use super::canvas::Mask;
use ab_glyph::{Font, FontRef, GlyphId, OutlinedGlyph, PxScale, ScaleFont, point};
use std::sync::LazyLock;

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    let bytes = include_bytes!("../../../data/fonts/DejaVuSans-subset.ttf");
    FontRef::try_from_slice(bytes).expect("the font is part of the program, and a test reads it")
});

/// End of a shortened text.
const ELLIPSIS: char = '…';

/// Font size in ems per height of a capital letter or digit.
pub(super) const CAPITAL_HEIGHT_EM: f32 = 0.73;

/// The scale at which one em is `size_px` high; `ab_glyph` counts from ascent to descent.
fn scale(size_px: f32) -> PxScale {
    let em = FONT.units_per_em().unwrap_or(1000.0);
    PxScale::from(size_px * FONT.height_unscaled() / em)
}

/// The glyphs of a text and their pen positions, in pixels; the last number is the total width.
fn place(text: &str, size_px: f32) -> (Vec<(GlyphId, f32)>, f32) {
    let font = FONT.as_scaled(scale(size_px));
    let mut glyphs: Vec<(GlyphId, f32)> = Vec::new();
    let mut pen = 0.0;
    for c in text.chars() {
        // A character that the font lacks is glyph 0, a box; control characters become spaces.
        let glyph = font.glyph_id(if c.is_control() { ' ' } else { c });
        if let Some(&(before, _)) = glyphs.last() {
            pen += font.kern(before, glyph);
        }
        glyphs.push((glyph, pen));
        pen += font.h_advance(glyph);
    }
    (glyphs, pen)
}

/// Width of a line in pixels, at `size_px` per em.
pub(super) fn width_px(text: &str, size_px: f32) -> f32 {
    place(text, size_px).1
}

/// The text, or its longest beginning that fits `most_px` with an ellipsis; `None` if not even two letters fit.
pub(super) fn shorten(text: &str, size_px: f32, most_px: f32) -> Option<String> {
    if width_px(text, size_px) <= most_px {
        return Some(text.to_owned());
    }
    let shortened = |chars: usize| {
        let mut head: String = text.chars().take(chars).collect();
        head.truncate(head.trim_end().len());
        head.push(ELLIPSIS);
        head
    };
    // Bisection: the width grows with the number of characters (kerning takes back less than a letter adds).
    let (mut fits, mut too_many) = (1, text.chars().count());
    while too_many - fits > 1 {
        let middle = fits + (too_many - fits) / 2;
        if width_px(&shortened(middle), size_px) <= most_px { fits = middle } else { too_many = middle }
    }
    (fits > 1).then(|| shortened(fits))
}

/// Coverage of a line whose pen starts at (0, 0) on the baseline.
pub(super) fn coverage(text: &str, size_px: f32) -> Mask {
    let scale = scale(size_px);
    let outline = |(glyph, pen): (GlyphId, f32)| -> Option<OutlinedGlyph> {
        FONT.outline_glyph(glyph.with_scale_and_position(scale, point(pen, 0.0)))
    };
    let outlines: Vec<OutlinedGlyph> = place(text, size_px).0.into_iter().filter_map(outline).collect();
    let bounds = outlines.iter().map(OutlinedGlyph::px_bounds).reduce(|a, b| ab_glyph::Rect {
        min: point(a.min.x.min(b.min.x), a.min.y.min(b.min.y)),
        max: point(a.max.x.max(b.max.x), a.max.y.max(b.max.y)),
    });
    let Some(bounds) = bounds else { return Mask::default() };
    let (left, top) = (bounds.min.x as i64, bounds.min.y as i64);
    let mut mask = Mask::new(left, top, bounds.width() as usize, bounds.height() as usize);
    for outlined in outlines {
        let at = outlined.px_bounds().min;
        outlined.draw(|x, y, c| mask.add(at.x as i64 + i64::from(x), at.y as i64 + i64::from(y), c));
    }
    mask
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_the_letters_of_units() {
        for c in "AZaz09 µμ°²³⁻⁰¹⁴⁵⁶⁷⁸⁹·×−αβγρωΩΔ∂∇…ÅéßЖ√±≤".chars() {
            assert_ne!(FONT.glyph_id(c), GlyphId(0), "{c}");
        }
    }

    #[test]
    fn digits_are_equally_wide() {
        for c in '1'..='9' {
            assert_eq!(width_px(&c.to_string(), 17.0), width_px("0", 17.0));
        }
    }

    #[test]
    fn a_character_that_the_font_lacks_is_a_box() {
        let unknown = coverage("\u{1F600}", 40.0);
        assert_eq!(unknown, coverage("漢", 40.0), "all are the same box");
        assert!(unknown.width > 10 && unknown.height > 20);
        let middle = unknown.coverage[unknown.height / 2 * unknown.width + unknown.width / 2];
        let inked: f32 = unknown.coverage.iter().sum();
        assert!(inked > 50.0 && middle == 0.0, "a hollow box, {inked} {middle}");
    }

    #[test]
    fn text_without_ink_is_an_empty_mask() {
        for text in ["", " ", "\n\t"] {
            assert_eq!(coverage(text, 20.0).coverage.len(), 0, "{text:?}");
        }
    }

    #[test]
    fn a_text_that_is_too_long_ends_with_an_ellipsis_and_fits() {
        let text = "temperature of the upper mantle";
        assert_eq!(shorten(text, 10.0, 1000.0).as_deref(), Some(text));
        let mut lengths = Vec::new();
        for most in [30.0, 60.0, 120.0] {
            let short = shorten(text, 10.0, most).unwrap();
            assert!(short.ends_with(ELLIPSIS) && width_px(&short, 10.0) <= most, "{short}");
            lengths.push(short.chars().count());
        }
        assert!(lengths.is_sorted() && lengths[0] < lengths[2]);
        assert_eq!(shorten(text, 10.0, 12.0), None);
        assert_eq!(shorten("x", 10.0, 1.0), None);
    }
}
