//! Stages, compiled and bound: what they are made with and what they bind comes from their descriptions
//! ([`Stage::bindings`]). They are compiled when a scene first needs them. There is no `wgpu::PipelineCache`: to make one from a file is
//! `unsafe`, as are shaders without checks of bounds, which take 0.75 to 0.85 of the time on llvmpipe.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::resources::{Binding, Kind, Resource, Texel};
use super::shaders::{RecordSplit, Stage};
use crate::render::RenderError;

/// Of shaders that read no records of cells.
pub(super) const NO_RECORDS: RecordSplit = RecordSplit { parts: 1, shift: 0 };

/// A stage, compiled; copies share it.
#[derive(Clone)]
pub(super) struct Pipeline {
    stage: Stage,
    layout: wgpu::BindGroupLayout,
    compute: wgpu::ComputePipeline,
}

impl Pipeline {
    /// Compiles the shader.
    pub(super) fn new(context: &Context, stage: Stage, split: RecordSplit) -> Result<Self, RenderError> {
        let _span = tracing::info_span!("compile", stage = stage.name()).entered();
        context.create(|device| {
            let layout = bind_group_layout(device, stage);
            Self { stage, compute: compute_pipeline(device, stage, split, &layout), layout }
        })
    }

    /// A group of what it binds, which is among these.
    ///
    /// # Errors
    /// `BeyondGpu` if something is not, or has not been made.
    pub(super) fn group(
        &self,
        context: &Context,
        buffers: &[&GrowingBuffer],
        views: &[(Resource, &wgpu::TextureView)],
    ) -> Result<wgpu::BindGroup, RenderError> {
        let find = |resource: Resource| {
            if let Some(buffer) = buffers.iter().find(|buffer| buffer.resource() == Some(resource)) {
                return Ok(buffer.get(context)?.as_entire_binding());
            }
            let view = views.iter().find(|(of, _)| *of == resource);
            let missing = || context.beyond(format!("{} lacks {}", self.stage.name(), resource.name()));
            view.map(|(_, view)| wgpu::BindingResource::TextureView(view)).ok_or_else(missing)
        };
        let entry = |(number, binding): (u32, Binding)| {
            find(binding.resource()).map(|resource| wgpu::BindGroupEntry { binding: number, resource })
        };
        let entries = (0..).zip(self.stage.bindings()).map(entry).collect::<Result<Vec<_>, _>>()?;
        context.count_created(1);
        let (label, layout) = (Some(self.stage.name()), &self.layout);
        Ok(context.device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries }))
    }

    /// Has a pass go on with it, on the resources of `group`.
    pub(super) fn set(&self, group: &wgpu::BindGroup, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.compute);
        pass.set_bind_group(0, group, &[]);
    }
}

/// The stages of a renderer that there has been a need for so far, and what they bind.
pub(super) struct Pipelines {
    split: RecordSplit,
    made: Vec<(Pipeline, Option<wgpu::BindGroup>)>,
}

impl Pipelines {
    /// None yet.
    pub(super) fn new() -> Self {
        Self { split: NO_RECORDS, made: Vec::new() }
    }

    /// Compiles stages, for records that are split so, unless that has been done.
    pub(super) fn prepare(
        &mut self,
        context: &Context,
        split: RecordSplit,
        stages: impl IntoIterator<Item = Stage>,
    ) -> Result<(), RenderError> {
        if self.split != split {
            (self.split, self.made) = (split, Vec::new());
        }
        for stage in stages {
            if !self.made.iter().any(|(pipeline, _)| pipeline.stage == stage) {
                self.made.push((Pipeline::new(context, stage, split)?, None));
            }
        }
        Ok(())
    }

    /// Takes over what others have compiled for the same records; nothing of it is bound here.
    pub(super) fn share(&mut self, others: &Self) {
        if self.split == others.split {
            let is_new = |stage| !self.made.iter().any(|(pipeline, _)| pipeline.stage == stage);
            let shared = others.made.iter().filter(|(pipeline, _)| is_new(pipeline.stage));
            let shared: Vec<_> = shared.map(|(pipeline, _)| (pipeline.clone(), None)).collect();
            self.made.extend(shared);
        }
    }

    /// Forgets what is bound: some of it has been made anew.
    pub(super) fn unbind(&mut self) {
        self.made.iter_mut().for_each(|(_, group)| *group = None);
    }

    /// Binds what the stages name, which is among these, wherever nothing is bound.
    ///
    /// # Errors
    /// `BeyondGpu` if something is not, or has not been made.
    pub(super) fn bind(
        &mut self,
        context: &Context,
        buffers: &[&GrowingBuffer],
        views: &[(Resource, &wgpu::TextureView)],
    ) -> Result<(), RenderError> {
        self.bind_those(context, |_| true, buffers, views)
    }

    /// The same of some stages alone.
    ///
    /// # Errors
    /// As [`Self::bind`].
    pub(super) fn bind_those(
        &mut self,
        context: &Context,
        are_meant: impl Fn(Stage) -> bool,
        buffers: &[&GrowingBuffer],
        views: &[(Resource, &wgpu::TextureView)],
    ) -> Result<(), RenderError> {
        for (pipeline, group) in &mut self.made {
            if group.is_none() && are_meant(pipeline.stage) {
                *group = Some(pipeline.group(context, buffers, views)?);
            }
        }
        context.check()
    }

    /// Has a pass go on with a stage.
    ///
    /// # Errors
    /// `BeyondGpu` if it has not been prepared and bound.
    pub(super) fn set(
        &self,
        context: &Context,
        stage: Stage,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        let found = self.made.iter().find(|(pipeline, _)| pipeline.stage == stage);
        let Some((pipeline, Some(group))) = found else {
            return Err(context.beyond(format!("{} has not been prepared", stage.name())));
        };
        pipeline.set(group, pass);
        Ok(())
    }
}

/// What a texture of such pixels is made of.
pub(super) fn format(texel: Texel) -> wgpu::TextureFormat {
    match texel {
        Texel::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
        Texel::R32Float => wgpu::TextureFormat::R32Float,
        Texel::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
    }
}

fn binding_type(binding: Binding) -> wgpu::BindingType {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let view_dimension = wgpu::TextureViewDimension::D2;
    match binding.resource().kind() {
        Kind::Uniform(_) => buffer(wgpu::BufferBindingType::Uniform),
        Kind::Storage(_) => buffer(wgpu::BufferBindingType::Storage { read_only: matches!(binding, Binding::Read(_)) }),
        Kind::Texture => wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension,
            multisampled: false,
        },
        Kind::Plane(texel) => wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: format(texel),
            view_dimension,
        },
    }
}

fn bind_group_layout(device: &wgpu::Device, stage: Stage) -> wgpu::BindGroupLayout {
    let entry = |(number, binding): (u32, Binding)| wgpu::BindGroupLayoutEntry {
        binding: number,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: binding_type(binding),
        count: None,
    };
    let entries: Vec<_> = (0..).zip(stage.bindings()).map(entry).collect();
    let label = Some(stage.name());
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries })
}

fn compute_pipeline(
    device: &wgpu::Device,
    stage: Stage,
    split: RecordSplit,
    layout: &wgpu::BindGroupLayout,
) -> wgpu::ComputePipeline {
    let label = Some(stage.name());
    let source = wgpu::ShaderSource::Wgsl(stage.source(split).into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&layout),
        module: &module,
        entry_point: label,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::gpu::raycast::stage_tests::context;
    use crate::render::gpu::shaders::{Precision, stages};
    use std::time::Instant;

    #[test]
    fn every_stage_compiles() {
        let Some(context) = context() else { return };
        eprintln!("milliseconds on {}", context.adapter());
        for stage in stages().filter(|stage| context.has_f64() || stage.precision() == Precision::Single) {
            let begin = Instant::now();
            // The name comes before the time: of one that does not end, too.
            eprint!("{stage:?}");
            Pipeline::new(&context, stage, NO_RECORDS).unwrap();
            eprintln!(" {:.0}", begin.elapsed().as_secs_f64() * 1e3);
        }
    }
}
