//! Shaders and bind group layouts that several renderers use, and what they are made with.

use super::FrameTexture;
use super::context::Context;
use super::shaders::{RecordSplit, Stage};
use crate::render::RenderError;

/// Of shaders that read no records of cells.
pub(super) const NO_RECORDS: RecordSplit = RecordSplit { parts: 1, shift: 0 };

/// The view transform: parameters, positions, scalars, view vertices.
pub(super) struct Transform {
    layout: wgpu::BindGroupLayout,
    pub(super) pipeline: wgpu::ComputePipeline,
}

impl Transform {
    /// Compiles the shader.
    pub(super) fn new(context: &Context) -> Result<Self, RenderError> {
        context.create(|device| {
            let layout = bind_group_layout(device, "transform", &[UNIFORM, READ, READ, WRITE]);
            let pipeline = pipeline(device, Stage::ViewTransform, NO_RECORDS, &layout);
            Self { layout, pipeline }
        })
    }

    /// A group of what it binds.
    pub(super) fn group(&self, context: &Context, resources: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        bind_group(context, "transform", &self.layout, resources)
    }
}

/// The decoder of codec `vq`: parameters, block, scalars.
pub(super) struct Decode {
    layout: wgpu::BindGroupLayout,
    pub(super) pipeline: wgpu::ComputePipeline,
}

impl Decode {
    /// Compiles the shader.
    pub(super) fn new(context: &Context) -> Result<Self, RenderError> {
        context.create(|device| {
            let layout = bind_group_layout(device, "decode", &[UNIFORM, READ, WRITE]);
            let pipeline = pipeline(device, Stage::DecodeVq, NO_RECORDS, &layout);
            Self { layout, pipeline }
        })
    }

    /// A group of what it binds.
    pub(super) fn group(&self, context: &Context, resources: &[wgpu::BindingResource<'_>]) -> wgpu::BindGroup {
        bind_group(context, "decode", &self.layout, resources)
    }
}

/// What brings finished colours to the texture that a window samples.
pub(super) struct Present {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

impl Present {
    /// Compiles the shader.
    pub(super) fn new(context: &Context) -> Result<Self, RenderError> {
        context.create(|device| {
            let layout = bind_group_layout(device, "present", &[SAMPLED, plane(FrameTexture::FORMAT)]);
            let pipeline = pipeline(device, Stage::Present, NO_RECORDS, &layout);
            Self { layout, pipeline }
        })
    }

    /// Submits the copy of `color` to `frame`, which is as large.
    pub(super) fn submit(&self, context: &Context, color: &wgpu::Texture, frame: &mut FrameTexture) {
        if frame.source.as_ref().is_none_or(|(source, _)| source != color) {
            let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
            let (from, to) = (view(color), view(frame.texture()));
            let views = [wgpu::BindingResource::TextureView(&from), wgpu::BindingResource::TextureView(&to)];
            frame.source = Some((color.clone(), bind_group(context, "present", &self.layout, &views)));
        }
        let Some((_, group)) = &frame.source else { return };
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(color.width().div_ceil(8), color.height().div_ceil(8), 1);
        }
        context.queue.submit([encoder.finish()]);
    }
}

/// Binds resources in the order of their numbers.
pub(super) fn bind_group(
    context: &Context,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let numbered = (0..).zip(resources);
    let entries: Vec<_> = numbered.map(|(binding, r)| wgpu::BindGroupEntry { binding, resource: r.clone() }).collect();
    context.count_created(1);
    context.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}

/// Parameters.
pub(super) const UNIFORM: wgpu::BindingType = buffer(wgpu::BufferBindingType::Uniform);
/// Storage that is read.
pub(super) const READ: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: true });
/// Storage that is written.
pub(super) const WRITE: wgpu::BindingType = buffer(wgpu::BufferBindingType::Storage { read_only: false });

const SAMPLED: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D2,
    multisampled: false,
};

const fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

/// A plane of the image, to be written.
pub(super) fn plane(format: wgpu::TextureFormat) -> wgpu::BindingType {
    wgpu::BindingType::StorageTexture {
        access: wgpu::StorageTextureAccess::WriteOnly,
        format,
        view_dimension: wgpu::TextureViewDimension::D2,
    }
}

/// A layout whose bindings are numbered in order.
pub(super) fn bind_group_layout(
    device: &wgpu::Device,
    label: &str,
    types: &[wgpu::BindingType],
) -> wgpu::BindGroupLayout {
    let entry = |(binding, &ty): (u32, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    };
    let entries: Vec<_> = (0..).zip(types).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// The pipeline of a stage.
pub(super) fn pipeline(
    device: &wgpu::Device,
    stage: Stage,
    split: RecordSplit,
    layout: &wgpu::BindGroupLayout,
) -> wgpu::ComputePipeline {
    let name = stage.name();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(stage.source(split).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(name),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: Some(&layout),
        module: &module,
        entry_point: Some(name),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}
