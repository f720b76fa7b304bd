//! Resources that depend on the size of the image: planes, counters, timestamps.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::{COUNTERS, TILE_PX};
use super::pipelines::format;
use super::readback::TIMESTAMPS;
use super::resources::{Kind, Resource};
use crate::render::RenderError;
use std::ops::Range;
use std::sync::Arc;

/// Query set and buffer of the stages' timestamps.
pub(super) struct Times {
    pub(super) queries: wgpu::QuerySet,
    pub(super) resolved: wgpu::Buffer,
}

/// Accumulators and depths of an image, which some stages write and others read.
pub(super) struct PlanePair {
    pub(super) color: wgpu::Texture,
    pub(super) depth: wgpu::Texture,
    pub(super) views: [wgpu::TextureView; 2],
}

impl PlanePair {
    pub(super) fn new(context: &Context, size_px: (usize, usize)) -> Result<Self, RenderError> {
        let [color, depth] =
            [plane(context, Resource::ColorPlane, size_px)?, plane(context, Resource::DepthPlane, size_px)?];
        let views = [&color, &depth].map(|plane| plane.create_view(&wgpu::TextureViewDescriptor::default()));
        Ok(Self { color, depth, views })
    }
}

/// A plane that some stages write and others read.
pub(super) struct OnePlane {
    pub(super) texture: wgpu::Texture,
    pub(super) view: wgpu::TextureView,
}

impl OnePlane {
    /// Replaces the kept plane, unless it has this size, by a new one that stages write as `of`. Returns whether it is new.
    pub(super) fn keep(
        kept: &mut Option<Self>,
        context: &Context,
        of: Resource,
        size_px: (usize, usize),
    ) -> Result<bool, RenderError> {
        let has_size = |plane: &Self| (plane.texture.width() as usize, plane.texture.height() as usize) == size_px;
        if kept.as_ref().is_some_and(has_size) {
            return Ok(false);
        }
        // The old plane is freed first: two large ones may not fit.
        *kept = None;
        let texture = plane(context, of, size_px)?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        *kept = Some(Self { texture, view });
        Ok(true)
    }
}

/// A texture that stages write as `of`, which is a plane, and others read.
fn plane(context: &Context, of: Resource, size_px: (usize, usize)) -> Result<wgpu::Texture, RenderError> {
    let most = context.device.limits().max_texture_dimension_2d as usize;
    if size_px.0.max(size_px.1) > most {
        return Err(context.beyond(format!("an image has at most {most} pixels in a row or column")));
    }
    texture(context, of, size_px, wgpu::TextureUsages::COPY_SRC)
}

/// A texture that stages write as `of`, and that is sampled or read; for other uses, too, if there are `more`.
pub(super) fn texture(
    context: &Context,
    of: Resource,
    (width, height): (usize, usize),
    more: wgpu::TextureUsages,
) -> Result<wgpu::Texture, RenderError> {
    let format = match of.kind() {
        Kind::Plane(texel) => format(texel),
        _ => return Err(context.beyond(format!("{} is no plane", of.label()))),
    };
    let descriptor = wgpu::TextureDescriptor {
        label: Some(of.label()),
        size: wgpu::Extent3d { width: width as u32, height: height as u32, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING | more,
        view_formats: &[],
    };
    let texture = context.create(|device| device.create_texture(&descriptor))?;
    context.count_created(1);
    Ok(texture)
}

/// Planes and buffers for an image of one size.
pub(super) struct Target {
    /// Width and height.
    pub(super) size_px: (usize, usize),
    pub(super) planes: PlanePair,
    pub(super) counters: GrowingBuffer,
    pub(super) times: Option<Times>,
}

impl Target {
    /// Returns the kept target, replaced by a new one unless it has this size, and whether it is new.
    pub(super) fn kept(
        kept: &mut Option<Arc<Self>>,
        context: &Context,
        size_px: (usize, usize),
    ) -> Result<(Arc<Self>, bool), RenderError> {
        // The old target is freed first: two large ones may not fit.
        let same = kept.take().filter(|target| target.size_px == size_px);
        let is_new = same.is_none();
        let target = match same {
            Some(target) => target,
            None => Arc::new(Self::new(context, size_px)?),
        };
        *kept = Some(target.clone());
        Ok((target, is_new))
    }

    fn new(context: &Context, size_px: (usize, usize)) -> Result<Self, RenderError> {
        let planes = PlanePair::new(context, size_px)?;
        let times = context.create(|device| {
            context.timestamp_period_ns().map(|_| Times {
                queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("stages"),
                    ty: wgpu::QueryType::Timestamp,
                    count: TIMESTAMPS,
                }),
                resolved: device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("timestamps"),
                    size: 8 * u64::from(TIMESTAMPS),
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                }),
            })
        })?;
        let mut counters = GrowingBuffer::new(Resource::Counters);
        counters.reserve(context, Self::counter_bytes(size_px))?;
        Ok(Self { size_px, planes, counters, times })
    }

    /// Bytes of the counters of all tiles of an image.
    pub(super) fn counter_bytes((width, height): (usize, usize)) -> u64 {
        4 * (COUNTERS * width.div_ceil(TILE_PX) * height.div_ceil(TILE_PX)) as u64
    }

    /// The planes with the resources that they are bound as.
    pub(super) fn planes(&self) -> [(Resource, &wgpu::TextureView); 2] {
        let [color, depth] = &self.planes.views;
        [(Resource::ColorPlane, color), (Resource::DepthPlane, depth)]
    }

    pub(super) fn columns(&self) -> usize {
        self.size_px.0.div_ceil(TILE_PX)
    }

    pub(super) fn tile_count(&self) -> usize {
        self.columns() * self.size_px.1.div_ceil(TILE_PX)
    }

    /// Begins a pass, whose begin and end go to timestamps `first` and `first + 1` if there are timestamps.
    pub(super) fn pass<'a>(
        &self,
        encoder: &'a mut wgpu::CommandEncoder,
        label: &str,
        first: Option<u32>,
    ) -> wgpu::ComputePass<'a> {
        let timestamp_writes = self.times.as_ref().zip(first).map(|(times, first)| wgpu::ComputePassTimestampWrites {
            query_set: &times.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        });
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes })
    }

    /// Rows of pixels that the tiles touch.
    pub(super) fn rows_of(&self, tiles: &Range<usize>) -> Range<usize> {
        let columns = self.columns();
        tiles.start / columns * TILE_PX..(tiles.end.div_ceil(columns) * TILE_PX).min(self.size_px.1)
    }

    /// Columns of pixels that `tiles` cover in row `tile_row` of tiles.
    pub(super) fn columns_of(&self, tiles: &Range<usize>, tile_row: usize) -> Range<usize> {
        let columns = self.columns();
        let row = tile_row * columns..(tile_row + 1) * columns;
        let (from, to) = (tiles.start.max(row.start) - row.start, tiles.end.min(row.end) - row.start);
        from * TILE_PX..(to * TILE_PX).min(self.size_px.0)
    }
}
