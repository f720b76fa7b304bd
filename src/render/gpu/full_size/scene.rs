//! The buffers, planes and stages that enlarge an image.

use super::ImageLeft;
use crate::image::upsample::{Enlarging, log2_per_square};
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::eye;
use crate::render::gpu::layers::{Boundary, DepthLayers};
use crate::render::gpu::layout::{Params, UpsampleParams};
use crate::render::gpu::pipelines::{NO_RECORDS, Pipelines};
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{Stage, Toward};
use crate::render::gpu::target::{OnePlane, Target};
use crate::render::upsampling::{Enlargement, UpsampleFilter};
use crate::render::{RenderError, RenderJob};
use std::sync::Arc;

/// All that the stages read and write, except what [`ImageLeft`] has.
pub(super) struct Scene {
    pub(super) boundary: Boundary,
    /// Depth layers at the pixels of the full image, and at the samples of the small one.
    pub(super) layers: [DepthLayers; 2],
    /// The range of depths in the full image.
    pub(super) range: GrowingBuffer,
    params: GrowingBuffer,
    upsample_params: GrowingBuffer,
    pub(super) target: Option<Arc<Target>>,
    /// The bilinear image that the joint filter reads.
    enlarged: Option<OnePlane>,
    pipelines: Pipelines,
    /// The renderer's target and view vertices that are bound.
    bound: Option<(Arc<Target>, wgpu::Buffer)>,
}

/// The stage that writes the full image.
pub(super) fn last_stage(filter: UpsampleFilter) -> Stage {
    match filter {
        UpsampleFilter::Nearest => Stage::UpsampleNearest,
        UpsampleFilter::Bilinear => Stage::UpsampleBilinear(Toward::Image),
        UpsampleFilter::Joint { .. } => Stage::UpsampleJoint,
        UpsampleFilter::Joint2x2 { .. } => Stage::UpsampleJoint2x2,
    }
}

/// The stage before the joint filter.
pub(super) const BEFORE_JOINT: Stage = Stage::UpsampleBilinear(Toward::Filter);

/// The parameters of a filter.
fn upsample_params(filter: UpsampleFilter, enlarging: &Enlarging) -> UpsampleParams {
    let (width, height) = enlarging.small;
    let kernel_px = if let UpsampleFilter::Joint { kernel_px, .. } = filter { kernel_px } else { 1 };
    UpsampleParams {
        small_px: [width as u32, height as u32],
        samples_per_pixel: (1.0 / enlarging.per_sample) as f32,
        half_px: (kernel_px / 2) as i32,
        domain_per_square: log2_per_square(0.5 * kernel_px as f64),
        reference_per_square: filter.edges().map_or(0.0, |edges| log2_per_square(edges.sigma_depth)),
        unused: [0; 2],
    }
}

impl Scene {
    pub(super) fn new() -> Self {
        Self {
            boundary: Boundary::new(),
            layers: [DepthLayers::new(), DepthLayers::new()],
            range: GrowingBuffer::new(Resource::DepthRange),
            params: GrowingBuffer::new(Resource::Params),
            upsample_params: GrowingBuffer::new(Resource::UpsampleParams),
            target: None,
            enlarged: None,
            pipelines: Pipelines::new(),
            bound: None,
        }
    }

    /// Uploads what is not on the GPU yet. Returns the parameters of the full image, its target, and the bytes sent; `None` if the job is
    /// cancelled. `job` is at full size.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        enlargement: &Enlargement,
        left: &ImageLeft<'_>,
    ) -> Result<Option<(Params, Arc<Target>, u64)>, RenderError> {
        let updated = self.update_parts(context, job, enlargement, left);
        match &updated {
            Ok(Some(_)) => {}
            // Bound buffers may have been reallocated.
            Ok(None) => self.unbind(),
            // The buffers may belong to different jobs.
            Err(_) => self.release(),
        }
        updated
    }

    fn update_parts(
        &mut self,
        context: &Context,
        job: &RenderJob,
        enlargement: &Enlargement,
        left: &ImageLeft<'_>,
    ) -> Result<Option<(Params, Arc<Target>, u64)>, RenderError> {
        let Enlargement { filter, enlarging, domain, .. } = enlargement;
        let params = eye::params(context, &job.local_view())?;
        let size_px = enlarging.full;
        let is_joint = matches!(filter, UpsampleFilter::Joint { .. });
        self.pipelines.prepare(context, NO_RECORDS, [last_stage(*filter)])?;
        if self.target.as_ref().is_some_and(|target| target.size_px != size_px) {
            // Bind groups would keep the old planes alive beside the new ones.
            self.unbind();
        }
        let (target, mut stale) = Target::kept(&mut self.target, context, size_px)?;
        stale |= self.params.reserve(context, size_of::<Params>() as u64)?;
        stale |= self.upsample_params.reserve(context, size_of::<UpsampleParams>() as u64)?;
        stale |= self.range.reserve(context, 8)?;
        let mut sent = 0;
        if let Some(edges) = filter.edges() {
            let Some((made, bytes)) = self.boundary.update(context, job, domain)? else { return Ok(None) };
            stale |= made;
            sent += bytes;
            let [at_pixels, at_samples] = &mut self.layers;
            stale |= at_pixels.update(context, params, edges.layers, &self.boundary)?;
            if !is_joint {
                at_samples.pipelines.share(&at_pixels.pipelines);
                stale |= at_samples.update(context, *left.params, edges.layers, &self.boundary)?;
            }
        }
        if is_joint {
            self.pipelines.prepare(context, NO_RECORDS, [BEFORE_JOINT])?;
            stale |= OnePlane::keep(&mut self.enlarged, context, Resource::EnlargedPlane, size_px)?;
        }
        let bound = (left.target.clone(), left.vertices.get(context)?.clone());
        let is_bound =
            |(target, vertices): &(Arc<Target>, wgpu::Buffer)| Arc::ptr_eq(target, &bound.0) && *vertices == bound.1;
        if stale || !self.bound.as_ref().is_some_and(is_bound) {
            self.unbind();
        }
        self.bind(context, *filter, left)?;
        self.bound = Some(bound);
        let upsample_params = upsample_params(*filter, enlarging);
        self.upsample_params.write(context, 0, bytemuck::bytes_of(&upsample_params))?;
        Ok(Some((params, target, sent)))
    }

    /// Frees buffers and planes; compiled stages stay.
    pub(super) fn release(&mut self) {
        self.unbind();
        self.boundary.release();
        self.layers.iter_mut().for_each(DepthLayers::release);
        [&mut self.range, &mut self.params, &mut self.upsample_params].into_iter().for_each(GrowingBuffer::release);
        (self.target, self.enlarged) = (None, None);
    }

    /// Unbinds a renderer's target and vertices that `small` will not use, before the renderer allocates new ones: both may not fit.
    pub(super) fn let_go(&mut self, small: &RenderJob) {
        let is_of_other_size = |(target, _): &(Arc<Target>, wgpu::Buffer)| target.size_px != small.view.plane_px();
        let is_of_other_mesh = self.boundary.is_of_other(&small.mesh);
        if is_of_other_mesh {
            self.boundary.release();
        }
        if is_of_other_mesh || self.bound.as_ref().is_some_and(is_of_other_size) {
            self.unbind();
        }
    }

    /// Drops the bind groups: bound buffers have been reallocated.
    fn unbind(&mut self) {
        self.bound = None;
        self.pipelines.unbind();
        self.layers.iter_mut().for_each(|layers| layers.pipelines.unbind());
    }

    /// Makes the bind groups that are missing.
    pub(super) fn bind(
        &mut self,
        context: &Context,
        filter: UpsampleFilter,
        left: &ImageLeft<'_>,
    ) -> Result<(), RenderError> {
        let views = match filter {
            UpsampleFilter::Nearest | UpsampleFilter::Bilinear => 0,
            UpsampleFilter::Joint { .. } => 1,
            UpsampleFilter::Joint2x2 { .. } => 2,
        };
        for layers in &mut self.layers[..views] {
            layers.bind(context, &self.boundary, left.vertices, &self.range)?;
        }
        let mut buffers = vec![&self.params, &self.upsample_params];
        buffers.extend(self.target.iter().map(|target| &target.counters));
        let mut planes: Vec<_> = self.target.iter().flat_map(|target| target.planes()).collect();
        let [color, depth] = &left.target.planes.views;
        planes.extend([(Resource::SmallColor, color), (Resource::SmallDepth, depth)]);
        let enlarged = self.enlarged.iter().map(|plane| &plane.view);
        planes.extend(enlarged.flat_map(|at| [(Resource::EnlargedPlane, at), (Resource::Enlarged, at)]));
        let [at_pixels, at_samples] = &self.layers;
        planes.extend(at_pixels.reference().map(|at| (Resource::Reference, at)));
        planes.extend(at_samples.reference().map(|at| (Resource::SmallReference, at)));
        let is_joint = matches!(filter, UpsampleFilter::Joint { .. });
        // Stages of other filters may bind resources that this one lacks.
        let is_meant = |stage| stage == last_stage(filter) || is_joint && stage == BEFORE_JOINT;
        self.pipelines.bind_those(context, is_meant, &buffers, &planes)
    }

    /// Records a stage that enlarges the image, for `tiles` tiles from the first one of `params` on.
    pub(super) fn record(
        &self,
        context: &Context,
        stage: Stage,
        params: &Params,
        tiles: usize,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.params.write(context, 0, bytemuck::bytes_of(params))?;
        self.pipelines.dispatch(context, stage, tiles as u32, pass)
    }
}
