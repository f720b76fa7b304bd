//! Shaders and bind group layouts of the face renderer.

use crate::render::RenderError;
use crate::render::RenderJob;
use crate::render::gpu::context::Context;
use crate::render::gpu::pipelines::{NO_RECORDS, READ, UNIFORM, WRITE, bind_group_layout, pipeline, plane};
use crate::render::gpu::shaders::{FragmentKind, Gathering, Pass, Precision, Stage};

/// The stages that find fragments, for a pass and in a precision.
pub(super) struct Finding {
    of: (Pass, Precision),
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
    pub(super) scan: wgpu::ComputePipeline,
    /// For the kinds of fragments that there have been so far; they bind what the last stage does.
    sorts: Vec<(FragmentKind, wgpu::ComputePipeline)>,
    /// For the precisions that have been asked for so far.
    findings: Vec<Finding>,
    /// For the optics and the precisions that have been asked for so far.
    resolves: Vec<((Gathering, Precision), wgpu::ComputePipeline)>,
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
            Self {
                scan: pipeline(device, Stage::FaceScan, NO_RECORDS, &scan_layout),
                sorts: Vec::new(),
                findings: Vec::new(),
                resolves: Vec::new(),
                count_layout,
                scan_layout,
                store_layout,
                resolve_layout,
            }
        })
    }

    /// Compiles what a job needs in a precision unless that has been done.
    pub(super) fn prepare(
        &mut self,
        context: &Context,
        job: &RenderJob,
        precision: Precision,
    ) -> Result<(), RenderError> {
        let (how, kind) = (Gathering::of(job), FragmentKind::of(job));
        if self.sort(kind).is_none() {
            let stage = Stage::FaceSort(kind);
            let made = context.create(|device| pipeline(device, stage, NO_RECORDS, &self.resolve_layout))?;
            self.sorts.push((kind, made));
        }
        for pass in [Pass::Count, Pass::Store(kind)] {
            if self.finding(pass, precision).is_none() {
                let made = context.create(|device| self.make_finding(device, pass, precision))?;
                self.findings.push(made);
            }
        }
        if self.resolve(how, precision).is_none() {
            let stage = Stage::FaceResolve(how, precision);
            let made = context.create(|device| pipeline(device, stage, NO_RECORDS, &self.resolve_layout))?;
            self.resolves.push(((how, precision), made));
        }
        Ok(())
    }

    fn make_finding(&self, device: &wgpu::Device, pass: Pass, precision: Precision) -> Finding {
        let layout = match pass {
            Pass::Count => &self.count_layout,
            Pass::Store(_) => &self.store_layout,
        };
        let stage = |stage: Stage| pipeline(device, stage, NO_RECORDS, layout);
        Finding {
            of: (pass, precision),
            faces: stage(Stage::Faces(pass, precision)),
            pieces: stage(Stage::FacePieces(pass, precision)),
            starts: stage(Stage::FaceStarts(pass, precision)),
        }
    }

    /// What finds fragments, if it has been prepared.
    pub(super) fn finding(&self, pass: Pass, precision: Precision) -> Option<&Finding> {
        self.findings.iter().find(|finding| finding.of == (pass, precision))
    }

    /// What sorts fragments of this kind, if it has been prepared.
    pub(super) fn sort(&self, kind: FragmentKind) -> Option<&wgpu::ComputePipeline> {
        self.sorts.iter().find(|(of, _)| *of == kind).map(|(_, pipeline)| pipeline)
    }

    /// The last stage that integrates so, if it has been prepared.
    pub(super) fn resolve(&self, how: Gathering, precision: Precision) -> Option<&wgpu::ComputePipeline> {
        self.resolves.iter().find(|(of, _)| *of == (how, precision)).map(|(_, pipeline)| pipeline)
    }
}
