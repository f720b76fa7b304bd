//! What the rays that contrast asks for need in the GPU's memory, and their stages.

use crate::render::RenderError;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{RayLists, RayParams};
use crate::render::gpu::pipelines::Pipelines;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{RecordSplit, Stage};
use crate::render::gpu::target::PlanePair;

/// Bytes of the arguments of two dispatches.
const ARGS_BYTES: u64 = 24;
/// Where the second ones begin.
const WALK_ARGS: u64 = 12;

/// Buffers, planes and stages; made for the first job that needs them.
pub(super) struct RayScene {
    params: GrowingBuffer,
    pub(super) rays: GrowingBuffer,
    args: GrowingBuffer,
    /// What rays have seen, for an image of a width and height.
    pub(super) seen: Option<((usize, usize), PlanePair)>,
    pipelines: Pipelines,
}

impl RayScene {
    pub(super) fn new() -> Self {
        Self {
            params: GrowingBuffer::new(Resource::RayParams),
            rays: GrowingBuffer::new(Resource::Rays),
            args: GrowingBuffer::new(Resource::Args),
            seen: None,
            pipelines: Pipelines::new(),
        }
    }

    /// Room for an image of this width and height, and the stages; `walk` is the one of rays in a list.
    pub(super) fn update(
        &mut self,
        context: &Context,
        size_px: (usize, usize),
        walk: Stage,
        split: RecordSplit,
    ) -> Result<(), RenderError> {
        let stages = [Stage::SplitPlan, Stage::SplitDecide, Stage::SplitAppend, Stage::SplitSlice, walk, Stage::Fill];
        self.pipelines.prepare(context, split, stages)?;
        let mut stale = self.params.reserve(context, size_of::<RayParams>() as u64)?;
        stale |= self.args.reserve(context, ARGS_BYTES)?;
        stale |= self.rays.reserve(context, 4 * RayLists { size_px }.end())?;
        if self.seen.as_ref().is_none_or(|(size, _)| *size != size_px) {
            self.seen = None;
            self.seen = Some((size_px, PlanePair::new(context, size_px)?));
            stale = true;
        }
        if stale {
            self.unbind();
        }
        Ok(())
    }

    /// Frees what is for an image of another width and height.
    pub(super) fn forget_other(&mut self, size_px: (usize, usize)) {
        if self.seen.as_ref().is_some_and(|(size, _)| *size != size_px) {
            (self.seen, self.rays) = (None, GrowingBuffer::new(Resource::Rays));
            self.unbind();
        }
    }

    /// Forgets what is bound: some of it has been made anew.
    pub(super) fn unbind(&mut self) {
        self.pipelines.unbind();
    }

    /// Binds what the stages name, which is here or among these, wherever nothing is bound.
    pub(super) fn bind(
        &mut self,
        context: &Context,
        buffers: &[&GrowingBuffer],
        planes: &[(Resource, &wgpu::TextureView)],
    ) -> Result<(), RenderError> {
        let buffers = [buffers, &[&self.params, &self.rays, &self.args]].concat();
        let mut views = planes.to_vec();
        if let Some((_, PlanePair { views: [color, depth], .. })) = &self.seen {
            views.extend([(Resource::SeenColorPlane, color), (Resource::SeenDepthPlane, depth)]);
            views.extend([(Resource::SeenColor, color), (Resource::SeenDepth, depth)]);
        }
        self.pipelines.bind(context, &buffers, &views)
    }

    /// Begins an image without a ray, for a contrast; the clearing is recorded.
    pub(super) fn begin(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        size_px: (usize, usize),
        contrast: f32,
    ) -> Result<(), RenderError> {
        let lists = RayLists { size_px };
        self.params.write(context, 0, bytemuck::bytes_of(&RayParams::new(lists, contrast)))?;
        // Head and bits; states are written before they are read, and the list begins empty.
        encoder.clear_buffer(self.rays.get(context)?, 0, Some(4 * lists.states()[0]));
        Ok(())
    }

    /// Goes on to another contrast, at which the rays serve that have been cast. Nothing is under way.
    pub(super) fn sharpen(&self, context: &Context, size_px: (usize, usize), contrast: f32) -> Result<(), RenderError> {
        self.params.write(context, 0, bytemuck::bytes_of(&RayParams::new(RayLists { size_px }, contrast)))?;
        let anew = [0u32; RayLists::HEAD - RayLists::STEP];
        self.rays.write(context, 4 * RayLists::STEP as u64, bytemuck::cast_slice(&anew))?;
        Ok(())
    }

    /// Records the next steps, as far as `groups` workgroups of the walk go: if that is all, the last ray of the image is among them.
    pub(super) fn record(
        &self,
        context: &Context,
        walk: Stage,
        groups: usize,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        let left_and_done = [groups as u32, 0];
        self.rays.write(context, 4 * RayLists::GROUPS_LEFT as u64, bytemuck::cast_slice(&left_and_done))?;
        let args = self.args.get(context)?;
        for _ in 0..RayLists::STEPS {
            self.pipelines.set(context, Stage::SplitPlan, pass)?;
            pass.dispatch_workgroups(1, 1, 1);
            for stage in [Stage::SplitDecide, Stage::SplitAppend] {
                self.pipelines.set(context, stage, pass)?;
                pass.dispatch_workgroups_indirect(args, 0);
            }
            self.pipelines.set(context, Stage::SplitSlice, pass)?;
            pass.dispatch_workgroups(1, 1, 1);
            self.pipelines.set(context, walk, pass)?;
            pass.dispatch_workgroups_indirect(args, WALK_ARGS);
        }
        Ok(())
    }

    /// Records the filling of so many tiles.
    pub(super) fn record_fill(
        &self,
        context: &Context,
        tiles: usize,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.pipelines.set(context, Stage::Fill, pass)?;
        pass.dispatch_workgroups(tiles as u32, 1, 1);
        Ok(())
    }
}
