//! Masks and rectangles, composited over premultiplied pixels.

use crate::image::RgbaImage;

/// Colour of lines and letters, and of the thin halo that keeps them legible over anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ink {
    /// Colour of letters, display-referred.
    pub(super) text: [f32; 3],
    /// Colour of the halo, display-referred.
    pub(super) halo: [f32; 3],
}

/// Display-referred gray whose luminance has equal WCAG contrast to black and to white: sqrt(1.05 * 0.05) - 0.05.
const EQUAL_CONTRAST_LUMINANCE: f32 = 0.179;

impl Ink {
    /// White on dark backgrounds, black on light and transparent ones: transparent images mostly end up on paper.
    pub(super) fn over(background: Option<[f32; 3]>) -> Self {
        // WCAG 2.1, "relative luminance".
        let linear = |c: f32| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        let luminance = |[r, g, b]: [f32; 3]| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
        let is_dark = background.is_some_and(|rgb| luminance(rgb) < EQUAL_CONTRAST_LUMINANCE);
        let (text, halo) = if is_dark { ([1.0; 3], [0.0; 3]) } else { ([0.0; 3], [1.0; 3]) };
        Self { text, halo }
    }
}

/// Coverage of each pixel of a rectangle, 0..=1.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mask {
    /// Left column.
    pub(super) left: i64,
    /// Top row.
    pub(super) top: i64,
    /// Pixels per row.
    pub(super) width: usize,
    /// Number of rows.
    pub(super) height: usize,
    /// Coverage by row, from the top.
    pub(super) coverage: Vec<f32>,
}

/// Pixels from (left, top) up to, but excluding, (right, bottom).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RectPx {
    pub(super) left: i64,
    pub(super) top: i64,
    pub(super) right: i64,
    pub(super) bottom: i64,
}

impl RectPx {
    /// The rectangle with `by` more pixels on each side.
    pub(super) fn grown(self, by: i64) -> Self {
        Self { left: self.left - by, top: self.top - by, right: self.right + by, bottom: self.bottom + by }
    }
}

impl Mask {
    /// A mask that covers nothing.
    pub(super) fn new(left: i64, top: i64, width: usize, height: usize) -> Self {
        Self { left, top, width, height, coverage: vec![0.0; width * height] }
    }

    /// Adds `c` to the coverage of a pixel; pixels outside are ignored.
    pub(super) fn add(&mut self, x: i64, y: i64, c: f32) {
        if let Some(i) = self.index(x, y) {
            self.coverage[i] = (self.coverage[i] + c).clamp(0.0, 1.0);
        }
    }

    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let (column, row) = (usize::try_from(x - self.left).ok()?, usize::try_from(y - self.top).ok()?);
        (column < self.width && row < self.height).then(|| row * self.width + column)
    }

    fn at(&self, x: i64, y: i64) -> f32 {
        self.index(x, y).map_or(0.0, |i| self.coverage[i])
    }

    /// This mask dilated by `radius_px`.
    fn dilated(&self, radius_px: f32) -> Mask {
        let reach = radius_px.ceil() as i64;
        let grow = 2 * reach as usize;
        let mut out = Mask::new(self.left - reach, self.top - reach, self.width + grow, self.height + grow);
        let offsets = (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
        let weight = |(dx, dy): (i64, i64)| (radius_px + 0.5 - ((dx * dx + dy * dy) as f32).sqrt()).clamp(0.0, 1.0);
        let disc: Vec<(i64, i64, f32)> =
            offsets.map(|o| (o.0, o.1, weight(o))).filter(|&(_, _, weight)| weight > 0.0).collect();
        for (i, &c) in self.coverage.iter().enumerate().filter(|(_, c)| **c > 0.0) {
            let (x, y) = (self.left + (i % self.width) as i64, self.top + (i / self.width) as i64);
            let neighbours = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            // The inside of a letter reaches no further than its edge.
            let is_inner = c == 1.0 && neighbours.iter().all(|&(x, y)| self.at(x, y) == 1.0);
            let stamp = if is_inner { &[(0, 0, 1.0)] } else { disc.as_slice() };
            for &(dx, dy, weight) in stamp {
                if let Some(i) = out.index(x + dx, y + dy) {
                    out.coverage[i] = out.coverage[i].max(c * weight);
                }
            }
        }
        out
    }

    /// Composites this mask over the image, moved by (x, y), in the ink's colour and with a halo of `halo_px`.
    pub(super) fn draw(&self, image: &mut RgbaImage, (x, y): (i64, i64), ink: Ink, halo_px: f32) {
        self.dilated(halo_px).draw_flat(image, (x, y), ink.halo);
        self.draw_flat(image, (x, y), ink.text);
    }

    fn draw_flat(&self, image: &mut RgbaImage, (x, y): (i64, i64), rgb: [f32; 3]) {
        for (i, &c) in self.coverage.iter().enumerate() {
            let (column, row) = (self.left + x + (i % self.width) as i64, self.top + y + (i / self.width) as i64);
            composite(image, column, row, rgb, c);
        }
    }
}

/// Fills a rectangle with an opaque colour.
pub(super) fn fill(image: &mut RgbaImage, rect: RectPx, rgb: [f32; 3]) {
    for y in rect.top..rect.bottom {
        for x in rect.left..rect.right {
            composite(image, x, y, rgb, 1.0);
        }
    }
}

/// Composites a colour of that opacity over one pixel (Porter and Duff, "over", premultiplied). Pixels outside of the image and zero
/// opacities are ignored.
fn composite(image: &mut RgbaImage, x: i64, y: i64, rgb: [f32; 3], alpha: f32) {
    let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
    if x >= image.width || y >= image.height || alpha <= 0.0 {
        return;
    }
    let pixel = &mut image.pixels[y * image.width + x];
    let [r, g, b] = rgb;
    for (under, over) in pixel.iter_mut().zip([r, g, b, 1.0]) {
        *under = alpha * over + (1.0 - alpha) * *under;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ink_contrasts_with_the_background() {
        for (background, text) in
            [([0.0; 3], 1.0), ([1.0; 3], 0.0), ([0.0, 0.0, 1.0], 1.0), ([1.0, 1.0, 0.0], 0.0), ([0.3; 3], 1.0)]
        {
            let ink = Ink::over(Some(background));
            assert_eq!((ink.text, ink.halo), ([text; 3], [1.0 - text; 3]), "{background:?}");
        }
        assert_eq!(Ink::over(None).text, [0.0; 3]);
    }

    #[test]
    fn half_an_ink_over_nothing_is_half_opaque() {
        let mut image = RgbaImage::new(1, 1);
        composite(&mut image, 0, 0, [1.0, 0.5, 0.0], 0.5);
        assert_eq!(image.pixels[0], [0.5, 0.25, 0.0, 0.5]);
        composite(&mut image, 0, 0, [0.0, 0.0, 1.0], 1.0);
        assert_eq!(image.pixels[0], [0.0, 0.0, 1.0, 1.0]);
        composite(&mut image, 5, -1, [1.0; 3], 1.0);
    }

    #[test]
    fn the_halo_reaches_its_radius_and_no_farther() {
        let mut dot = Mask::new(0, 0, 1, 1);
        dot.add(0, 0, 1.0);
        let halo = dot.dilated(2.0);
        for y in -4..=4 {
            for x in -4..=4 {
                let distance = ((x * x + y * y) as f32).sqrt();
                assert_eq!(halo.at(x, y) > 0.0, distance < 2.5, "{x} {y}");
                assert_eq!(halo.at(x, y) == 1.0, distance <= 1.5, "{x} {y}");
            }
        }
    }
}
