//! What the stages of flow leave on the GPU, for tests.

use super::SplatLists;
use crate::camera::View;
use crate::render::flow::FlowSplats;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::flow_layout::FlowLists;
use crate::render::gpu::layout::{Params, TEXELS_WIDE};
use crate::render::gpu::pipelines::{NO_RECORDS, Pipelines};
use crate::render::gpu::raycast::stage_tests::read_back;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::FLOW;
use crate::render::gpu::texels::Texel;
use std::ops::Range;
use std::sync::Arc;

/// What the stages have written.
pub(in crate::render) struct Listed {
    pub(in crate::render) params: Params,
    layout: FlowLists,
    texels: Vec<Texel>,
    /// Ends of the tiles' lists, the total, the longest list, numbers.
    bins: Vec<u32>,
    /// Bytes sent for the splats, without their sites.
    pub(in crate::render) bytes_sent: u64,
}

impl Listed {
    /// Runs the stages for splats in a view (local coordinates); lists that are too short are made longer.
    pub(in crate::render) fn of(context: &Context, flow: &Arc<FlowSplats>, view: &View) -> Self {
        let params = Params::of_view(view).unwrap();
        let mut params_buffer = GrowingBuffer::new(Resource::Params);
        params_buffer.reserve(context, size_of::<Params>() as u64).unwrap();
        params_buffer.write(context, 0, bytemuck::bytes_of(&params)).unwrap();
        let (mut lists, mut pipelines) = (SplatLists::new(), Pipelines::new());
        let before = lists.update(context, flow, &params).unwrap().1;
        lists.forget();
        let bytes_sent = lists.update(context, flow, &params).unwrap().1;
        assert!(bytes_sent < before);
        pipelines.prepare(context, NO_RECORDS, FLOW).unwrap();
        let layout = FlowLists { tiles: params.tile_count() as u64, splats: flow.ready().splats() as u64 };
        loop {
            let buffers: Vec<_> = lists.buffers().into_iter().chain([&params_buffer]).collect();
            let views: Vec<_> = lists.views().collect();
            pipelines.unbind();
            pipelines.bind(context, &buffers, &views).unwrap();
            let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            lists.record(context, &pipelines, &mut encoder).unwrap();
            context.queue.submit([encoder.finish()]);
            let bins = read_back(context, lists.bins.get(context).unwrap());
            let told = [0, 1].map(|word| bins[layout.tiles as usize + word]);
            if !lists.is_incomplete(told) {
                let texels = bytemuck::cast_slice(&texels(context, lists.texels.texture().unwrap())).to_vec();
                return Self { params, layout, texels, bins, bytes_sent };
            }
            lists.grow(context, told).unwrap();
        }
    }

    /// The number of tiles.
    pub(in crate::render) fn tiles(&self) -> usize {
        self.layout.tiles as usize
    }

    /// The texels of a splat.
    pub(in crate::render) fn splat(&self, number: usize) -> &[Texel] {
        let (texels, of_each) = (&self.texels, FlowLists::SPLAT_TEXELS as usize);
        &texels[(FlowLists::HEAD_TEXELS + self.layout.tiles) as usize + of_each * number..][..of_each]
    }

    /// The texels of the places of a tile, which follow those of the tile before it.
    pub(in crate::render) fn places(&self, tile: usize) -> &[Texel] {
        let end = |tile: usize| self.bins[tile] as usize;
        let span: Range<usize> = if tile == 0 { 0 } else { end(tile - 1) }..end(tile);
        let of_each = FlowLists::PLACE_TEXELS as usize;
        let begin = self.layout.places() as usize + of_each * span.start;
        let [high, low, count_high, count_low] = self.texels[FlowLists::HEAD_TEXELS as usize + tile];
        assert_eq!((65536.0 * high + low) as usize, begin);
        assert_eq!((65536.0 * count_high + count_low) as usize, span.len());
        &self.texels[begin..][..of_each * span.len()]
    }
}

/// The words of a texture of texels.
fn texels(context: &Context, texture: &wgpu::Texture) -> Vec<u32> {
    let bytes_per_row = (TEXELS_WIDE * size_of::<Texel>()) as u32;
    let buffer = context.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("texels under test"),
        size: u64::from(bytes_per_row) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(bytes_per_row), rows_per_image: None };
    let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    context.queue.submit([encoder.finish()]);
    read_back(context, &buffer)
}
