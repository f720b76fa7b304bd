use super::*;
use crate::render::gpu::context::{Context, ContextOptions};
use crate::render::gpu::test_common;
use egui::{ColorImage, Event, PointerButton, Rect, TextureHandle, TextureOptions, Vec2, pos2, vec2};
use proptest::prelude::RngExt;
use proptest::test_runner::TestRng;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const GRID: PixelGrid = PixelGrid { size: [410, 300], pixels_per_point: 1.25 };

fn gpu() -> Option<Context> {
    let opened = Context::new(&ContextOptions::default());
    opened.map_err(|error| test_common::skip("gpu", &error.to_string())).ok()
}

/// All kinds of widgets: popups, shadows, text that is cut off, images, pictures.
struct Widgets {
    ticked: bool,
    share: f32,
    text: String,
    choice: usize,
    image: Option<TextureHandle>,
    picture: Option<Shape>,
}

impl Widgets {
    fn show(&mut self, ui: &mut egui::Ui) {
        let picture = self.picture.clone().unwrap_or(Shape::Noop);
        ui.painter().add(picture);
        egui::Panel::right("side").show(ui, |ui| {
            ui.checkbox(&mut self.ticked, "a box to tick").on_hover_text("a tip with a shadow");
            ui.add(egui::Slider::new(&mut self.share, 0.0..=1.0));
            ui.text_edit_singleline(&mut self.text);
            egui::ComboBox::from_label("one of").selected_text(self.choice.to_string()).show_ui(ui, |ui| {
                (0..4).for_each(|n| drop(ui.selectable_value(&mut self.choice, n, format!("number {n}"))));
            });
            ui.collapsing("more", |ui| ui.hyperlink_to("underlined", "nowhere"));
            egui::ScrollArea::vertical().max_height(80.0).show(ui, |ui| {
                (0..30).for_each(|n| drop(ui.label(format!("line {n} of what is scrolled"))));
            });
            if let Some(image) = &self.image {
                ui.image((image.id(), vec2(40.0, 20.0)));
            }
        });
        egui::Window::new("floating").default_pos([20.0, 30.0]).show(ui.ctx(), |ui| ui.label("drag me"));
    }
}

/// Bytes of a texture, rows from the top.
fn bytes(gpu: &Context, texture: &wgpu::Texture) -> Vec<u8> {
    let [width, height] = GRID.size;
    let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let copy = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), copy, texture.size());
    gpu.queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |result| result.unwrap());
    gpu.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).unwrap();
    gpu.check().unwrap();
    staging
        .get_mapped_range(..)
        .unwrap()
        .chunks(row as usize)
        .flat_map(|row| row[..4 * width as usize].to_vec())
        .collect()
}

/// The user's next event.
fn event(rng: &mut TestRng, at: &mut egui::Pos2) -> Vec<Event> {
    let modifiers = Default::default();
    let button = |pressed, pos| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
    match rng.random_range(0..10) {
        0..4 => {
            *at = pos2(rng.random_range(0.0..328.0), rng.random_range(0.0..240.0));
            vec![Event::PointerMoved(*at)]
        }
        4 => vec![Event::Text(rng.random_range('a'..='z').to_string())],
        5 => {
            let delta = Vec2::Y * rng.random_range(-40.0..40.0);
            let (phase, source) = (egui::TouchPhase::Move, egui::MouseWheelSource::Unknown);
            vec![Event::MouseWheel { unit: egui::MouseWheelUnit::Point, delta, phase, source, modifiers }]
        }
        6 => vec![button(true, *at)],
        7 => vec![button(false, *at)],
        _ => vec![button(true, *at), button(false, *at)],
    }
}

/// A picture of one colour at a place, painted by a callback.
fn picture(painter: &Painter, rng: &mut TestRng) -> Shape {
    let (texture, group) = painter.target(GRID);
    let color = std::array::from_fn(|_| rng.random_range(0.0..1.0));
    let [r, g, b]: [f64; 3] = color;
    let view = texture.create_view(&Default::default());
    let mut encoder = painter.device.create_command_encoder(&Default::default());
    drop(encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &view,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                store: wgpu::StoreOp::Store,
            },
            depth_slice: None,
        })],
        ..Default::default()
    }));
    painter.queue.submit([encoder.finish()]);
    let place = Rect::from_min_max(pos2(8.0, 16.0), pos2(160.0, 200.0));
    Shape::Callback(egui_wgpu::Callback::new_paint_callback(place, Shown { copy: painter.copy.clone(), group }))
}

#[test]
fn what_is_kept_has_the_bits_of_what_is_painted_anew() {
    let Some(gpu) = gpu() else { return };
    let mut rng = TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha);
    let [mut kept, mut anew] = [(); 2].map(|()| Painter::new(&gpu.device, &gpu.queue, FORMAT));
    let ctx = egui::Context::default();
    let mut widgets = Widgets { ticked: false, share: 0.3, text: String::new(), choice: 0, image: None, picture: None };
    let (mut at, mut painted, mut passes) = (pos2(0.0, 0.0), 0.0, 0);
    let mut last = Vec::new();
    for pass in 0..120 {
        if pass % 7 == 3 {
            let pixels = ColorImage::filled([4, 2], egui::Color32::from_gray(rng.random()));
            match &mut widgets.image {
                Some(image) => image.set(pixels, TextureOptions::LINEAR),
                None => widgets.image = Some(ctx.load_texture("image", pixels, TextureOptions::LINEAR)),
            }
        }
        if pass % 5 == 1 {
            widgets.picture = Some(picture(&kept, &mut rng));
        }
        let mut input = egui::RawInput { time: Some(0.1 * f64::from(pass)), ..Default::default() };
        input.screen_rect = Some(GRID.points());
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point =
            Some(GRID.pixels_per_point);
        input.events = event(&mut rng, &mut at);
        let output = ctx.run_ui(input, |ui| widgets.show(ui));
        assert_eq!(output.pixels_per_point, GRID.pixels_per_point);
        let mut textures = [output.textures_delta.clone(), output.textures_delta];
        if let Some(before) = &kept.kept {
            let after = damage::flattened(output.shapes.clone());
            let damage = damage::between(&before.shapes, &after, &[], &GRID);
            (painted, passes) = (painted + damage.iter().map(|rect| rect.area()).sum::<f32>(), passes + 1);
        }
        let _ = kept.paint(&ctx, output.shapes.clone(), &mut textures[0], GRID);
        anew.kept = None;
        let _ = anew.paint(&ctx, output.shapes, &mut textures[1], GRID);
        let [kept, anew] = [&kept, &anew].map(|painter| bytes(&gpu, &painter.kept.as_ref().unwrap().texture));
        assert!(kept == anew, "pass {pass}");
        last = kept;
    }
    let share = painted / (passes as f32 * GRID.points().area());
    assert!(share < 0.5, "{share} of the pixels were painted");
    // The comparison notices damage that is left out.
    let mut output = ctx.run_ui(Default::default(), |ui| drop(ui.label("something else")));
    kept.kept.as_mut().unwrap().shapes = damage::flattened(output.shapes.clone());
    let _ = kept.paint(&ctx, output.shapes.clone(), &mut output.textures_delta.clone(), GRID);
    anew.kept = None;
    let _ = anew.paint(&ctx, output.shapes, &mut output.textures_delta, GRID);
    let [kept, anew] = [&kept, &anew].map(|painter| bytes(&gpu, &painter.kept.as_ref().unwrap().texture));
    assert!(kept == last && kept != anew);
}

#[test]
fn passes_that_are_discarded_are_not_painted_and_their_textures_are_kept() {
    let Some(gpu) = gpu() else { return };
    let ctx = egui::Context::default();
    let owner = Owner::default();
    owner.paint(&ctx, &gpu.device, &gpu.queue, FORMAT);
    let is_painted = || lock(&owner.0).as_ref().unwrap().kept.is_some();
    let (mut before, mut image) = (Vec::new(), None);
    let input = egui::RawInput { screen_rect: Some(GRID.points()), ..Default::default() };
    let output = ctx.run_ui(input, |ui| {
        let pass = ui.ctx().current_pass_index();
        before.push((pass, is_painted()));
        if pass == 0 {
            let pixels = ColorImage::filled([4, 2], Color32::RED);
            image = Some(ui.ctx().load_texture("image", pixels, TextureOptions::LINEAR));
            ui.ctx().request_discard("to be laid out again");
        }
        let image = image.as_ref().unwrap();
        ui.image((image.id(), vec2(40.0, 20.0)));
    });
    assert_eq!(before, [(0, false), (1, false)]);
    assert!(is_painted() && output.textures_delta.is_empty());
    assert_eq!(output.shapes.len(), 1);
    let painter = lock(&owner.0).take().unwrap();
    let red = bytes(&gpu, &painter.kept.as_ref().unwrap().texture).chunks(4).filter(|p| p[..3] == [255, 0, 0]).count();
    // 40 x 20 pixels, of which those on the border may be covered in part.
    assert!((38 * 18..=40 * 20).contains(&red), "{red}");
}

#[test]
fn a_context_outlives_its_window_without_objects_of_the_gpu() {
    let Some(gpu) = gpu() else { return };
    let (ctx, owner) = (egui::Context::default(), Owner::default());
    owner.paint(&ctx, &gpu.device, &gpu.queue, FORMAT);
    let pass = || {
        let input = egui::RawInput { screen_rect: Some(GRID.points()), ..Default::default() };
        ctx.run_ui(input, |ui| drop(ui.label("text")))
    };
    assert_eq!(pass().shapes.len(), 1);
    let painter = owner.0.clone();
    assert!(lock(&painter).as_ref().is_some_and(|painter| painter.kept.is_some()));
    drop(owner);
    assert!(lock(&painter).is_none());
    let output = pass();
    assert!(output.shapes.is_empty() && output.textures_delta.is_empty());
}

#[test]
fn another_size_and_another_atlas_are_painted_as_a_whole() {
    let Some(gpu) = gpu() else { return };
    let mut painter = Painter::new(&gpu.device, &gpu.queue, FORMAT);
    let ctx = egui::Context::default();
    let mut paint = |size: [u32; 2], textures: &mut TexturesDelta| {
        let grid = PixelGrid { size, ..GRID };
        let input = egui::RawInput { screen_rect: Some(grid.points()), ..Default::default() };
        let output = ctx.run_ui(input, |ui| drop(ui.label("text")));
        textures.append(output.textures_delta);
        let _ = painter.paint(&ctx, output.shapes, textures, grid);
        let size = painter.kept.as_ref().unwrap().texture.size();
        assert_eq!([size.width, size.height], grid.size);
        assert!(textures.is_empty());
    };
    for size in [[410, 300], [1, 1], [500, 300]] {
        paint(size, &mut TexturesDelta::default());
    }
    gpu.check().unwrap();
}

#[test]
fn the_shader_is_valid() {
    let module = naga::front::wgsl::parse_str(include_str!("../../../shaders/retained.wgsl")).unwrap();
    let flags = naga::valid::ValidationFlags::all();
    naga::valid::Validator::new(flags, Default::default()).validate(&module).unwrap();
}
