use super::*;
use egui::epaint::{Mesh, PaintCallback, TextShape};
use egui::{Color32, Stroke, vec2};
use std::sync::Arc;

const GRID: PixelGrid = PixelGrid { size: [800, 600], pixels_per_point: 1.0 };

fn window() -> Rect {
    GRID.points()
}

fn filled(x: f32, y: f32, color: Color32) -> ClippedShape {
    ClippedShape::new(window(), Shape::rect_filled(Rect::from_min_size(pos2(x, y), vec2(10.0, 10.0)), 0.0, color))
}

/// Twelve by nine rectangles.
fn many() -> Vec<ClippedShape> {
    (0..108).map(|n| filled((n % 12 * 60) as f32, (n / 12 * 60) as f32, Color32::from_gray(n as u8))).collect()
}

fn damage(old: &[ClippedShape], new: &[ClippedShape]) -> Vec<Rect> {
    between(old, new, &[], &GRID)
}

/// The pixels of a rectangle of 10 x 10, with what antialiasing may reach.
fn around(x: f32, y: f32) -> Rect {
    Rect::from_min_size(pos2(x, y), vec2(10.0, 10.0)).expand(REACH).intersect(window())
}

#[test]
fn what_is_the_same_is_no_damage() {
    assert_eq!(damage(&many(), &many()), []);
    assert_eq!(damage(&[], &[]), []);
}

#[test]
fn changes_far_from_each_other_are_rectangles_of_their_own() {
    let (old, mut new) = (many(), many());
    new[0] = filled(0.0, 0.0, Color32::RED);
    new[107] = filled(660.0, 480.0, Color32::RED);
    assert_eq!(damage(&old, &new), [around(0.0, 0.0), around(660.0, 480.0)]);
}

#[test]
fn a_shape_that_moves_damages_where_it_was_and_where_it_is() {
    let (old, mut new) = (many(), many());
    new[50] = filled(700.0, 500.0, Color32::from_gray(50));
    assert_eq!(damage(&old, &new), [around(120.0, 240.0), around(700.0, 500.0)]);
}

#[test]
fn what_comes_and_goes_leaves_the_others_as_they_are() {
    let (old, mut new) = (many(), many());
    new.insert(30, filled(345.0, 345.0, Color32::RED));
    new.remove(90);
    let expected = [around(345.0, 345.0), around(300.0, 420.0)];
    assert_eq!(damage(&old, &new), expected);
    assert_eq!(damage(&new, &old), expected);
    // A popup of more shapes than the matching looks ahead.
    let more = (0..200).map(|_| filled(400.0, 300.0, Color32::BLUE));
    let with_popup: Vec<_> = new.iter().cloned().chain(more).collect();
    assert_eq!(damage(&new, &with_popup), [around(400.0, 300.0)]);
}

#[test]
fn another_order_is_damage_though_the_shapes_are_the_same() {
    let [below, above] = [Color32::RED, Color32::BLUE].map(|color| filled(100.0, 100.0, color));
    assert_eq!(damage(&[below.clone(), above.clone()], &[above, below]), [around(100.0, 100.0)]);
}

#[test]
fn a_texture_of_other_contents_damages_the_shapes_that_use_it() {
    let [a, b] = [TextureId::Managed(1), TextureId::Managed(2)];
    let image = |texture, x| {
        let mut mesh = Mesh::with_texture(texture);
        let uv = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        mesh.add_rect_with_uv(Rect::from_min_size(pos2(x, 50.0), vec2(10.0, 10.0)), uv, Color32::WHITE);
        ClippedShape::new(window(), Shape::Mesh(Arc::new(mesh)))
    };
    let shapes = [image(a, 50.0), image(b, 500.0)];
    assert_eq!(between(&shapes, &shapes, &[b], &GRID), [around(500.0, 50.0)]);
}

#[test]
fn a_callback_is_damage_if_it_is_another() {
    let rect = Rect::from_min_size(pos2(100.0, 100.0), vec2(10.0, 10.0));
    let callback = || Shape::Callback(PaintCallback { rect, callback: Arc::new(()) });
    let shapes = [ClippedShape::new(window(), callback())];
    assert_eq!(damage(&shapes, &shapes.clone()), []);
    assert_eq!(damage(&shapes, &[ClippedShape::new(window(), callback())]), [around(100.0, 100.0)]);
}

#[test]
fn clips_limit_damage_and_outside_of_the_window_there_is_none() {
    let clip = Rect::from_min_max(pos2(0.0, 0.0), pos2(105.0, 600.0));
    let clipped = ClippedShape { clip_rect: clip, ..filled(100.0, 100.0, Color32::RED) };
    assert_eq!(damage(&[], &[clipped])[0].right(), 106.0);
    assert_eq!(damage(&[], &[filled(-50.0, 100.0, Color32::RED)]), []);
    let nowhere = filled(f32::NAN, f32::NAN, Color32::RED);
    assert_eq!(damage(&[], &[nowhere]), [window()], "no place that is known");
}

#[test]
fn underlines_belong_to_their_text() {
    let ctx = egui::Context::default();
    let mut text = None;
    let mut output = ctx.run_ui(Default::default(), |ui| {
        let galley = ui.painter().layout_no_wrap("x".to_owned(), egui::FontId::monospace(12.0), Color32::WHITE);
        text = Some(TextShape::new(pos2(100.0, 100.0), galley, Color32::WHITE));
    });
    output.textures_delta.clear();
    let text = text.unwrap().with_underline(Stroke::new(3.0, Color32::WHITE));
    let bottom = 100.0 + text.galley.rect.bottom();
    let reached = GRID.reached(&ClippedShape::new(window(), text));
    assert!(reached.bottom() >= bottom + 3.0);
}

#[test]
fn many_rectangles_become_few() {
    let mut new = many();
    new.iter_mut().for_each(|shape| shape.clip_rect = window().expand(1.0));
    let damage = damage(&many(), &new);
    assert!(damage.len() <= APART);
    let covered = |x: f32, y: f32| damage.iter().any(|rect| rect.contains_rect(around(x, y)));
    assert!((0..108).all(|n| covered((n % 12 * 60) as f32, (n / 12 * 60) as f32)));
}

#[test]
fn nested_shapes_are_laid_flat_in_their_order() {
    let rect = |x| Shape::rect_filled(Rect::from_min_size(pos2(x, 0.0), vec2(1.0, 1.0)), 0.0, Color32::RED);
    let nested = Shape::Vec(vec![rect(1.0), Shape::Vec(vec![rect(2.0), Shape::Noop]), rect(3.0)]);
    let flat = flattened(vec![ClippedShape::new(window(), nested), ClippedShape::new(window(), rect(4.0))]);
    let expected: Vec<_> = [1.0, 2.0, 3.0, 4.0].map(|x| ClippedShape::new(window(), rect(x))).into();
    assert_eq!(flat, expected);
}
