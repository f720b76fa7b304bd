//! Buffers, planes and stages of contrast-adaptive sampling.

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
/// Byte offset of the walk's arguments.
const WALK_ARGS: u64 = 12;

/// Buffers, planes and stages of contrast-adaptive sampling; allocated for the first job that needs them.
pub(super) struct RayScene {
    params: GrowingBuffer,
    pub(super) rays: GrowingBuffer,
    args: GrowingBuffer,
    /// Colour and depth of the rays cast, and the width and height of their image.
    pub(super) seen: Option<((usize, usize), PlanePair)>,
    pub(super) pipelines: Pipelines,
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

    /// Allocates for an image of this size, and compiles the stages; `walk` is the stage that walks listed rays.
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
            self.pipelines.unbind();
        }
        Ok(())
    }

    /// Frees planes and list if they are for an image of another size.
    pub(super) fn forget_other(&mut self, size_px: (usize, usize)) {
        if self.seen.as_ref().is_some_and(|(size, _)| *size != size_px) {
            (self.seen, self.rays) = (None, GrowingBuffer::new(Resource::Rays));
            self.pipelines.unbind();
        }
    }

    /// Makes the missing bind groups, from its own resources, `buffers` and `planes`.
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

    /// Writes the parameters for a contrast, and records the clearing of the list.
    pub(super) fn begin(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        size_px: (usize, usize),
        contrast: f32,
    ) -> Result<(), RenderError> {
        let lists = RayLists { size_px };
        self.params.write(context, 0, bytemuck::bytes_of(&RayParams::new(lists, contrast)))?;
        // Head and bits; block states are written before they are read, and the list begins empty.
        encoder.clear_buffer(self.rays.get(context)?, 0, Some(4 * lists.states()[0]));
        Ok(())
    }

    /// Goes on to another contrast with the rays cast so far. No slice may be under way.
    pub(super) fn sharpen(&self, context: &Context, size_px: (usize, usize), contrast: f32) -> Result<(), RenderError> {
        self.params.write(context, 0, bytemuck::bytes_of(&RayParams::new(RayLists { size_px }, contrast)))?;
        let anew = [0u32; RayLists::HEAD - RayLists::STEP];
        self.rays.write(context, 4 * RayLists::STEP as u64, bytemuck::cast_slice(&anew))?;
        Ok(())
    }

    /// Records all [`RayLists::STEPS`] steps, limited to `groups` workgroups of the walk; an image that needs no more is finished.
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
            self.pipelines.dispatch(context, Stage::SplitPlan, 1, pass)?;
            for stage in [Stage::SplitDecide, Stage::SplitAppend] {
                self.pipelines.set(context, stage, pass)?;
                pass.dispatch_workgroups_indirect(args, 0);
            }
            self.pipelines.dispatch(context, Stage::SplitSlice, 1, pass)?;
            self.pipelines.set(context, walk, pass)?;
            pass.dispatch_workgroups_indirect(args, WALK_ARGS);
        }
        Ok(())
    }

    /// Records the filling of `tiles` tiles.
    pub(super) fn record_fill(
        &self,
        context: &Context,
        tiles: usize,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.pipelines.dispatch(context, Stage::Fill, tiles as u32, pass)
    }
}
