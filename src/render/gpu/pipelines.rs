//! Compute pipelines and bind groups of the stages, from their descriptions ([`Stage::bindings`]). Pipelines are compiled when a scene first
//! needs them. There is no `wgpu::PipelineCache`: to make one from a file is `unsafe`, as are shaders without checks of bounds, which take
//! 0.75 to 0.85 of the time on llvmpipe.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::resources::{Binding, Kind, Resource, Texel};
use super::shaders::{RecordSplit, Stage};
use super::slices::GROUPS_MAX;
use crate::render::RenderError;

/// The split for shaders without cell records.
pub(super) const NO_RECORDS: RecordSplit = RecordSplit { parts: 1, shift: 0 };

/// A compiled stage; clones share the pipeline.
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

    /// A bind group of the stage's resources, found among `buffers` and `views`.
    ///
    /// # Errors
    /// `BeyondGpu` if a resource is missing or not allocated.
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

    /// Sets pipeline and bind group of a pass.
    pub(super) fn set(&self, group: &wgpu::BindGroup, pass: &mut wgpu::ComputePass<'_>) {
        pass.set_pipeline(&self.compute);
        pass.set_bind_group(0, group, &[]);
    }
}

/// The stages that a renderer has needed so far, each with its bind group.
pub(super) struct Pipelines {
    split: RecordSplit,
    made: Vec<(Pipeline, Option<wgpu::BindGroup>)>,
}

impl Pipelines {
    /// No stages.
    pub(super) fn new() -> Self {
        Self { split: NO_RECORDS, made: Vec::new() }
    }

    /// Compiles stages for `split` unless that has been done.
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

    /// Shares the stages that `others` has compiled for the same split, without bind groups.
    pub(super) fn share(&mut self, others: &Self) {
        if self.split == others.split {
            let is_new = |stage| !self.made.iter().any(|(pipeline, _)| pipeline.stage == stage);
            let shared = others.made.iter().filter(|(pipeline, _)| is_new(pipeline.stage));
            let shared: Vec<_> = shared.map(|(pipeline, _)| (pipeline.clone(), None)).collect();
            self.made.extend(shared);
        }
    }

    /// Drops all bind groups: bound buffers have been reallocated.
    pub(super) fn unbind(&mut self) {
        self.made.iter_mut().for_each(|(_, group)| *group = None);
    }

    /// Makes the bind groups that are missing, from `buffers` and `views`.
    ///
    /// # Errors
    /// `BeyondGpu` if a resource is missing or not allocated.
    pub(super) fn bind(
        &mut self,
        context: &Context,
        buffers: &[&GrowingBuffer],
        views: &[(Resource, &wgpu::TextureView)],
    ) -> Result<(), RenderError> {
        self.bind_those(context, |_| true, buffers, views)
    }

    /// As [`Self::bind`], for the stages of which `are_meant` is true.
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

    /// Sets the pipeline and bind group of a stage in a pass.
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

    /// Dispatches at least `workgroups` workgroups of a stage, in rows of at most [`GROUPS_MAX`].
    ///
    /// # Errors
    /// As [`Self::set`].
    pub(super) fn dispatch(
        &self,
        context: &Context,
        stage: Stage,
        workgroups: u32,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.set(context, stage, pass)?;
        let rows = workgroups.div_ceil(GROUPS_MAX).max(1);
        pass.dispatch_workgroups(workgroups.div_ceil(rows), rows, 1);
        Ok(())
    }
}

/// The texture format of a texel.
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
