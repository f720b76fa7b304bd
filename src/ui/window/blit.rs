//! Paints the picture of a step and the background around it (`shaders/picture.wgsl`).
//!
//! The painter of the widgets could do it as well, but its one general shader is costly where a CPU emulates the GPU, and most pixels of the
//! window are these: this way a window of 1280 x 720 is painted in a third of the time there (25 to 35 ms a pass instead of 83, llvmpipe on
//! two cores of a Xeon, build for development).

use eframe::egui;
use eframe::egui_wgpu::{self, CallbackResources, CallbackTrait, RenderState, ScreenDescriptor, wgpu};
use egui::{Color32, PaintCallback, PaintCallbackInfo, Rect};
use std::sync::Arc;

/// The shader's uniforms, in its layout.
type Place = [[f32; 4]; 2];

/// The pipeline that paints pictures on one device.
pub(super) struct Blit {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    place: wgpu::Buffer,
}

/// The area of a picture, which may be cut off or smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Backdrop {
    /// In points.
    pub(super) viewport: Rect,
    /// Colour of the viewport outside of the picture.
    pub(super) background: Color32,
}

/// One picture, ready to be painted.
#[derive(Clone)]
pub(super) struct BoundPicture {
    blit: Arc<Blit>,
    group: wgpu::BindGroup,
}

/// The pipeline of a module that paints one triangle over the viewport, without vertices and without blending.
pub(super) fn painting(
    device: &wgpu::Device,
    label: &str,
    module: &wgpu::ShaderModule,
    constants: &[(&str, f64)],
    format: wgpu::TextureFormat,
) -> wgpu::RenderPipeline {
    let compilation_options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: None,
        vertex: wgpu::VertexState {
            module,
            entry_point: None,
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: None,
            compilation_options,
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

impl Blit {
    pub(super) fn new(render_state: &RenderState) -> Self {
        let RenderState { device, target_format, .. } = render_state;
        let module = device.create_shader_module(wgpu::include_wgsl!("../../../shaders/picture.wgsl"));
        let linear = f64::from(u8::from(target_format.is_srgb()));
        let pipeline = painting(device, "picture", &module, &[("LINEAR", linear)], *target_format);
        let filter = wgpu::FilterMode::Linear;
        let sampler = wgpu::SamplerDescriptor { mag_filter: filter, min_filter: filter, ..Default::default() };
        let place = wgpu::BufferDescriptor {
            label: Some("place of the picture"),
            size: size_of::<Place>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        };
        Self {
            layout: pipeline.get_bind_group_layout(0),
            pipeline,
            sampler: device.create_sampler(&sampler),
            place: device.create_buffer(&place),
        }
    }

    /// Binds a texture for painting: opaque, or premultiplied.
    pub(super) fn bind(self: &Arc<Self>, device: &wgpu::Device, texture: &wgpu::Texture) -> BoundPicture {
        let view = texture.create_view(&Default::default());
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("picture"),
            layout: &self.layout,
            entries: &[
                entry(0, self.place.as_entire_binding()),
                entry(1, wgpu::BindingResource::TextureView(&view)),
                entry(2, wgpu::BindingResource::Sampler(&self.sampler)),
            ],
        });
        BoundPicture { blit: self.clone(), group }
    }
}

impl BoundPicture {
    /// Paints the picture at `place`.
    pub(super) fn paint(self, backdrop: &Backdrop, place: Rect) -> PaintCallback {
        let Backdrop { viewport, background } = *backdrop;
        let at = |corner: egui::Pos2| (corner - place.min) / place.size();
        let (min, max) = (at(viewport.min), at(viewport.max));
        let place = [background.to_normalized_gamma_f32(), [min.x, min.y, max.x, max.y]];
        egui_wgpu::Callback::new_paint_callback(viewport, Placed { picture: self, place })
    }
}

struct Placed {
    picture: BoundPicture,
    place: Place,
}

impl CallbackTrait for Placed {
    fn prepare(
        &self,
        _: &wgpu::Device,
        queue: &wgpu::Queue,
        _: &ScreenDescriptor,
        _: &mut wgpu::CommandEncoder,
        _: &mut CallbackResources,
    ) -> Vec<wgpu::CommandBuffer> {
        queue.write_buffer(&self.picture.blit.place, 0, bytemuck::bytes_of(&self.place));
        Vec::new()
    }

    fn paint(&self, _: PaintCallbackInfo, pass: &mut wgpu::RenderPass<'static>, _: &CallbackResources) {
        pass.set_pipeline(&self.picture.blit.pipeline);
        pass.set_bind_group(0, &self.picture.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_shader_is_valid() {
        let module = naga::front::wgsl::parse_str(include_str!("../../../shaders/picture.wgsl")).unwrap();
        let flags = naga::valid::ValidationFlags::all();
        let validated = naga::valid::Validator::new(flags, Default::default()).validate(&module);
        validated.unwrap();
    }
}
