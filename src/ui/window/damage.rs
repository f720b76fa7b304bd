//! Which rectangles of a window look otherwise than in the last pass: those of the shapes that came, went or changed.
//!
//! 1. Both lists of shapes are matched in order. A pixel outside of all unmatched shapes is painted by the same shapes in the same order, and
//!    keeps its colour.
//! 2. Each unmatched shape is a rectangle in whole pixels; rectangles are joined where that paints little more.
//! 3. Painting a rectangle means clearing it and painting what reaches into it, clipped by it. Rectangles may therefore overlap.

use eframe::egui;
use egui::epaint::{ClippedShape, emath::TSTransform};
use egui::{Rect, Shape, TextureId, pos2};

/// Number of shapes that may come or go in one place before the matching goes on.
const LOOK_AHEAD: usize = 48;

/// Pixels that antialiasing may reach beyond a shape: feathering is one pixel wide, and text is rounded to whole pixels.
const REACH: f32 = 2.0;

/// Number of rectangles that are kept apart.
const APART: usize = 16;

/// Pixels that cost as much as a further rectangle.
const RECTANGLE: f32 = 4096.0;

/// Shapes without nesting, each with its clip rectangle.
pub(super) fn flattened(shapes: Vec<ClippedShape>) -> Vec<ClippedShape> {
    fn add(shape: ClippedShape, flat: &mut Vec<ClippedShape>) {
        let ClippedShape { clip_rect, shape, transform_after_tessellation } = shape;
        match shape {
            Shape::Noop => {}
            Shape::Vec(shapes) => {
                for shape in shapes {
                    add(ClippedShape { clip_rect, shape, transform_after_tessellation }, flat);
                }
            }
            shape => flat.push(ClippedShape { clip_rect, shape, transform_after_tessellation }),
        }
    }
    let mut flat = Vec::with_capacity(shapes.len());
    shapes.into_iter().for_each(|shape| add(shape, &mut flat));
    flat
}

/// The rectangles, in points, that differ between two lists of flat shapes; `textures` have other contents now.
pub(super) fn between(
    old: &[ClippedShape],
    new: &[ClippedShape],
    textures: &[TextureId],
    grid: &PixelGrid,
) -> Vec<Rect> {
    let mut damage = Damage { grid: *grid, rectangles: Vec::new() };
    let (mut i, mut j) = (0, 0);
    while i < old.len() || j < new.len() {
        if i < old.len() && j < new.len() && old[i] == new[j] {
            if textures.contains(&new[j].shape.texture_id()) {
                damage.add(&new[j]);
            }
            (i, j) = (i + 1, j + 1);
            continue;
        }
        let (gone, come) = next_match(&old[i..], &new[j..]);
        old[i..i + gone].iter().chain(&new[j..j + come]).for_each(|shape| damage.add(shape));
        (i, j) = (i + gone, j + come);
    }
    damage.rectangles.into_iter().map(|rect| rect / grid.pixels_per_point).collect()
}

/// Numbers of shapes before the next one that both lists have, with as few as possible left out.
fn next_match(old: &[ClippedShape], new: &[ClippedShape]) -> (usize, usize) {
    for left_out in 1..=LOOK_AHEAD {
        for gone in 0..=left_out {
            let come = left_out - gone;
            if let (Some(old), Some(new)) = (old.get(gone), new.get(come))
                && old == new
            {
                return (gone, come);
            }
        }
    }
    (old.len().min(LOOK_AHEAD), new.len().min(LOOK_AHEAD))
}

/// The pixels of a window, (0, 0) at the upper left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PixelGrid {
    /// Width and height in pixels.
    pub(super) size: [u32; 2],
    pub(super) pixels_per_point: f32,
}

impl PixelGrid {
    /// The whole window, in pixels.
    fn whole(&self) -> Rect {
        Rect::from_min_max(pos2(0.0, 0.0), pos2(self.size[0] as f32, self.size[1] as f32))
    }

    /// The whole window, in points.
    pub(super) fn points(&self) -> Rect {
        self.whole() / self.pixels_per_point
    }

    /// The pixels that a shape may reach.
    fn reached(&self, shape: &ClippedShape) -> Rect {
        let mut bounds = shape.shape.visual_bounding_rect();
        if let Shape::Text(text) = &shape.shape {
            // Underlines lie outside of the letters.
            bounds |= text.galley.rect.translate(text.pos.to_vec2()).expand(text.underline.width);
        }
        if shape.transform_after_tessellation != TSTransform::IDENTITY {
            bounds = shape.transform_after_tessellation * bounds;
        }
        let whole = self.whole();
        let pixels = |rect: Rect| rect * self.pixels_per_point;
        let reached = pixels(bounds).expand(REACH).intersect(pixels(shape.clip_rect).expand(1.0));
        if reached.any_nan() {
            return whole;
        }
        Rect::from_min_max(reached.min.floor(), reached.max.ceil()).intersect(whole)
    }

    /// The shapes that reach into a rectangle of points, clipped by it, in their order.
    pub(super) fn within(&self, rect: Rect, shapes: &[ClippedShape]) -> Vec<ClippedShape> {
        let pixels = rect * self.pixels_per_point;
        let reaching = shapes.iter().filter(|shape| self.reached(shape).intersect(pixels).is_positive());
        reaching.map(|shape| ClippedShape { clip_rect: shape.clip_rect.intersect(rect), ..shape.clone() }).collect()
    }
}

/// Rectangles to be painted, in whole pixels.
struct Damage {
    grid: PixelGrid,
    rectangles: Vec<Rect>,
}

impl Damage {
    fn add(&mut self, shape: &ClippedShape) {
        let mut new = self.grid.reached(shape);
        if !new.is_positive() {
            return;
        }
        // A rectangle that has grown may meet those before it.
        while let Some(at) = self.rectangles.iter().position(|&other| is_better_joined(other, new)) {
            new |= self.rectangles.swap_remove(at);
        }
        if self.rectangles.len() == APART {
            new = self.rectangles.drain(..).fold(new, |all, rect| all | rect);
        }
        self.rectangles.push(new);
    }
}

fn is_better_joined(a: Rect, b: Rect) -> bool {
    (a | b).area() <= a.area() + b.area() + RECTANGLE
}

#[cfg(test)]
#[path = "damage_tests.rs"]
mod tests;
