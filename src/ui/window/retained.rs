//! Paints what changed since the last pass, and keeps the rest.
//!
//! eframe paints all shapes of a window in each pass, which is costly where a CPU emulates the GPU. This plugin takes shapes and textures out
//! of a pass's output, paints the damaged rectangles (`damage.rs`) to a texture that has the window's last pixels, and leaves eframe one
//! shape that copies the texture to the window (`shaders/retained.wgsl`). The texture has at all times the bits that painting everything
//! would give.
//!
//! Threads that wake the window keep its context, and may drop it last, while the program ends: the painter's GPU objects belong to whoever
//! opened the window, not to the context.

use super::blit;
use super::damage::{self, PixelGrid};
use crate::ui::worker::lock;
use eframe::egui;
use eframe::egui_wgpu::{self, CallbackResources, CallbackTrait, RendererOptions, ScreenDescriptor, wgpu};
use egui::epaint::textures::TexturesDelta;
use egui::epaint::{ClippedPrimitive, ClippedShape};
use egui::{Color32, FullOutput, PaintCallbackInfo, Shape, TextureId};
use std::sync::{Arc, Mutex};

/// Options of the painter of widgets: colours stay as computed.
const OPTIONS: RendererOptions = RendererOptions {
    msaa_samples: 0,
    depth_stencil_format: None,
    dithering: false,
    predictable_texture_filtering: false,
};

/// The owner of a window's painter, which is dropped with it. Clones of it are plugins' access.
#[derive(Default)]
pub(super) struct Owner(Arc<Mutex<Option<Painter>>>);

impl Owner {
    /// Has the windows of this context and format painted.
    pub(super) fn paint(
        &self,
        ctx: &egui::Context,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        format: wgpu::TextureFormat,
    ) {
        *lock(&self.0) = Some(Painter::new(device, queue, format));
        ctx.add_plugin(Retained { painter: self.0.clone(), pending: TexturesDelta::default() });
    }

    /// Drops the painter: nothing is painted from now on.
    pub(super) fn close(&self) {
        *lock(&self.0) = None;
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.close();
    }
}

/// The plugin. Without other painters of the same context: it has all textures.
struct Retained {
    painter: Arc<Mutex<Option<Painter>>>,
    /// Textures of discarded passes, which are not painted.
    pending: TexturesDelta,
}

/// Paints to what it keeps.
struct Painter {
    device: wgpu::Device,
    queue: wgpu::Queue,
    format: wgpu::TextureFormat,
    painter: egui_wgpu::Renderer,
    copy: wgpu::RenderPipeline,
    kept: Option<Kept>,
}

/// What was painted last.
struct Kept {
    grid: PixelGrid,
    texture: wgpu::Texture,
    group: wgpu::BindGroup,
    /// The shapes in the texture, flat.
    shapes: Vec<ClippedShape>,
}

impl Painter {
    /// A painter for windows of this format.
    fn new(device: &wgpu::Device, queue: &wgpu::Queue, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("../../../shaders/retained.wgsl"));
        let copy = blit::painting(device, "retained", &module, &[], format);
        let painter = egui_wgpu::Renderer::new(device, format, OPTIONS);
        Self { device: device.clone(), queue: queue.clone(), format, painter, copy, kept: None }
    }

    /// Paints the shapes of a pass; `textures` are taken over. Returns the shape that shows what is painted.
    fn paint(
        &mut self,
        ctx: &egui::Context,
        shapes: Vec<ClippedShape>,
        textures: &mut TexturesDelta,
        grid: PixelGrid,
    ) -> Shape {
        let shapes = damage::flattened(shapes);
        let changed = self.take_textures(textures);
        let whole = grid.points();
        let before = self.kept.take().filter(|kept| kept.grid == grid);
        let damage = match &before {
            // Letters lie elsewhere in an atlas that is made anew.
            Some(kept) if !changed.contains(&TextureId::default()) => {
                damage::between(&kept.shapes, &shapes, &changed, &grid)
            }
            _ => vec![whole],
        };
        let (texture, group) = match before {
            Some(kept) => (kept.texture, kept.group),
            None => self.target(grid),
        };
        if !damage.is_empty() {
            let clipped = damage.iter().flat_map(|&rect| {
                let cleared = ClippedShape::new(rect, Shape::rect_filled(rect.expand(1.0), 0.0, Color32::BLACK));
                std::iter::once(cleared).chain(grid.within(rect, &shapes))
            });
            let primitives = ctx.tessellate(clipped.collect(), grid.pixels_per_point);
            self.draw(&texture, &primitives, grid);
        }
        for id in textures.free.drain() {
            self.painter.free_texture(&id);
        }
        let shown = Shown { copy: self.copy.clone(), group: group.clone() };
        self.kept = Some(Kept { grid, texture, group, shapes });
        Shape::Callback(egui_wgpu::Callback::new_paint_callback(whole, shown))
    }

    /// Uploads textures. Returns those whose contents changed where shapes may use them: letters are added to their atlas beside the others.
    fn take_textures(&mut self, textures: &mut TexturesDelta) -> Vec<TextureId> {
        let mut changed = Vec::new();
        for (id, deltas) in textures.set.drain() {
            if id != TextureId::default() || deltas.iter().any(|delta| delta.is_whole()) {
                changed.push(id);
            }
            for delta in deltas {
                self.painter.update_texture(&self.device, &self.queue, id, &delta);
            }
        }
        changed
    }

    /// A texture of the window's size, with the group that copies from it.
    fn target(&self, grid: PixelGrid) -> (wgpu::Texture, wgpu::BindGroup) {
        let [width, height] = grid.size;
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("retained"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: self.format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("retained"),
            layout: &self.copy.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        });
        (texture, group)
    }

    /// Draws over a texture.
    fn draw(&mut self, texture: &wgpu::Texture, primitives: &[ClippedPrimitive], grid: PixelGrid) {
        let descriptor = ScreenDescriptor { size_in_pixels: grid.size, pixels_per_point: grid.pixels_per_point };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let before = self.painter.update_buffers(&self.device, &self.queue, &mut encoder, primitives, &descriptor);
        let view = texture.create_view(&Default::default());
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("retained"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                depth_slice: None,
            })],
            ..Default::default()
        });
        self.painter.render(&mut pass.forget_lifetime(), primitives, &descriptor);
        self.queue.submit(before.into_iter().chain([encoder.finish()]));
    }
}

impl egui::Plugin for Retained {
    fn debug_name(&self) -> &'static str {
        "retained painting"
    }

    fn output_hook(&mut self, ctx: &egui::Context, output: &mut FullOutput) {
        self.pending.append(std::mem::take(&mut output.textures_delta));
        let passes = &output.platform_output;
        if passes.requested_discard() && passes.num_completed_passes < ctx.options(|options| options.max_passes.get()) {
            return;
        }
        let pixels_per_point = output.pixels_per_point;
        let size = ctx.viewport_rect().size() * pixels_per_point;
        // A window without an area has textures nevertheless.
        let grid = PixelGrid { size: [size.x, size.y].map(|n| n.round().max(1.0) as u32), pixels_per_point };
        let shapes = std::mem::take(&mut output.shapes);
        let mut textures = std::mem::take(&mut self.pending);
        let Some(painter) = &mut *lock(&self.painter) else { return };
        let shown = painter.paint(ctx, shapes, &mut textures, grid);
        output.shapes = vec![ClippedShape::new(grid.points(), shown)];
    }
}

/// Copies the texture to the window.
struct Shown {
    copy: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
}

impl CallbackTrait for Shown {
    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, _: &CallbackResources) {
        pass.set_pipeline(&self.copy);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

#[cfg(test)]
#[path = "retained_tests.rs"]
mod tests;
