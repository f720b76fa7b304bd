//! Shaders and bind group layouts of the face renderer.

use crate::optics::OpticsKind;
use crate::render::RenderError;
use crate::render::gpu::context::Context;
use crate::render::gpu::pipelines::{NO_RECORDS, READ, UNIFORM, WRITE, bind_group_layout, pipeline, plane};
use crate::render::gpu::shaders::{Pass, Stage};

/// The stages that find fragments.
pub(super) struct Finding {
    pub(super) faces: wgpu::ComputePipeline,
    pub(super) pieces: wgpu::ComputePipeline,
    pub(super) starts: wgpu::ComputePipeline,
}

/// A compute pipeline for each stage, and the layouts of what they bind.
pub(super) struct Pipelines {
    pub(super) count_layout: wgpu::BindGroupLayout,
    pub(super) scan_layout: wgpu::BindGroupLayout,
    pub(super) store_layout: wgpu::BindGroupLayout,
    pub(super) resolve_layout: wgpu::BindGroupLayout,
    pub(super) count: Finding,
    pub(super) scan: wgpu::ComputePipeline,
    pub(super) store: Finding,
    /// For the optics that have been asked for so far.
    resolves: Vec<(OpticsKind, wgpu::ComputePipeline)>,
}

impl Pipelines {
    /// Compiles the shaders.
    pub(super) fn new(context: &Context) -> Result<Self, RenderError> {
        context.create(|device| {
            let layout = |label, entries: &[wgpu::BindingType]| bind_group_layout(device, label, entries);
            let find = [UNIFORM, UNIFORM, WRITE, READ, READ, READ, READ, READ, WRITE, WRITE];
            let count_layout = layout("count fragments", &find[..8]);
            let scan_layout = layout("scan fragments", &find[..3]);
            let store_layout = layout("store fragments", &find);
            let (color, depth) = (plane(wgpu::TextureFormat::Rgba32Float), plane(wgpu::TextureFormat::R32Float));
            let resolve_layout = layout(
                "resolve fragments",
                &[UNIFORM, UNIFORM, READ, WRITE, WRITE, READ, READ, WRITE, color, depth, UNIFORM],
            );
            let stage = |stage: Stage, layout: &wgpu::BindGroupLayout| pipeline(device, stage, NO_RECORDS, layout);
            let finding = |pass: Pass, layout: &wgpu::BindGroupLayout| Finding {
                faces: stage(Stage::Faces(pass), layout),
                pieces: stage(Stage::FacePieces(pass), layout),
                starts: stage(Stage::FaceStarts(pass), layout),
            };
            Self {
                count: finding(Pass::Count, &count_layout),
                scan: stage(Stage::FaceScan, &scan_layout),
                store: finding(Pass::Store, &store_layout),
                resolves: Vec::new(),
                count_layout,
                scan_layout,
                store_layout,
                resolve_layout,
            }
        })
    }

    /// Compiles the last stage for `optics` unless that has been done.
    pub(super) fn prepare_resolve(&mut self, context: &Context, optics: OpticsKind) -> Result<(), RenderError> {
        if self.resolve(optics).is_none() {
            let stage = Stage::FaceResolve(optics);
            let made = context.create(|device| pipeline(device, stage, NO_RECORDS, &self.resolve_layout))?;
            self.resolves.push((optics, made));
        }
        Ok(())
    }

    /// The last stage for `optics`, if it has been prepared.
    pub(super) fn resolve(&self, optics: OpticsKind) -> Option<&wgpu::ComputePipeline> {
        self.resolves.iter().find(|(kind, _)| *kind == optics).map(|(_, pipeline)| pipeline)
    }
}
