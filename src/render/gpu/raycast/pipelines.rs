//! Shaders and bind group layouts of the ray caster: made once for a device and a split of the records.

use crate::render::RenderError;
use crate::render::gpu::context::Context;
use crate::render::gpu::pipelines::{READ, UNIFORM, WRITE, bind_group_layout, pipeline, plane};
use crate::render::gpu::shaders::{Gathering, Precision, RecordSplit, Stage};

/// A compute pipeline for each stage, and the layouts of what they bind.
pub(super) struct Pipelines {
    pub(super) split: RecordSplit,
    pub(super) entries_layout: wgpu::BindGroupLayout,
    pub(super) walk_layout: wgpu::BindGroupLayout,
    pub(super) entries_count: wgpu::ComputePipeline,
    pub(super) entries_scan: wgpu::ComputePipeline,
    pub(super) entries_store: wgpu::ComputePipeline,
    /// For the optics and the precisions that have been asked for so far.
    walks: Vec<((Gathering, Precision), wgpu::ComputePipeline)>,
}

impl Pipelines {
    /// Compiles the shaders.
    pub(super) fn new(context: &Context, split: RecordSplit) -> Result<Self, RenderError> {
        context.create(|device| {
            let layout = |label, entries: &[wgpu::BindingType]| bind_group_layout(device, label, entries);
            let entries_layout = layout("entries", &[UNIFORM, READ, READ, READ, READ, READ, WRITE]);
            let (color, depth) = (plane(wgpu::TextureFormat::Rgba32Float), plane(wgpu::TextureFormat::R32Float));
            let walk_layout =
                layout("walk", &[UNIFORM, READ, READ, READ, READ, READ, READ, READ, WRITE, color, depth, UNIFORM]);
            let stage = |stage: Stage, layout: &wgpu::BindGroupLayout| pipeline(device, stage, split, layout);
            Self {
                split,
                entries_count: stage(Stage::EntriesCount, &entries_layout),
                entries_scan: stage(Stage::EntriesScan, &entries_layout),
                entries_store: stage(Stage::EntriesStore, &entries_layout),
                walks: Vec::new(),
                entries_layout,
                walk_layout,
            }
        })
    }

    /// Compiles the walk that integrates so in a precision unless that has been done.
    pub(super) fn prepare_walk(
        &mut self,
        context: &Context,
        how: Gathering,
        precision: Precision,
    ) -> Result<(), RenderError> {
        if self.walk(how, precision).is_none() {
            let stage = Stage::Walk(how, precision);
            let made = context.create(|device| pipeline(device, stage, self.split, &self.walk_layout))?;
            self.walks.push(((how, precision), made));
        }
        Ok(())
    }

    /// The walk that integrates so in a precision, if it has been prepared.
    pub(super) fn walk(&self, how: Gathering, precision: Precision) -> Option<&wgpu::ComputePipeline> {
        self.walks.iter().find(|(of, _)| *of == (how, precision)).map(|(_, pipeline)| pipeline)
    }
}
