//! Splats of flow, projected and listed by tiles on the GPU, as the walk and the faces read them (`shaders/lib/flow_layout.wgsl`).
//!
//! 1. **project** (`flow_project.wgsl`): a thread a splat, in the order of depths in which the CPU has sorted them.
//! 2. **count**, **scan**, **store** (`flow_count.wgsl`, `entries_scan.wgsl`, `flow_store.wgsl`): the numbers of the splats of each tile, as for
//!    entries of rays. If the lists are too short the frame is begun again with longer ones.
//! 3. **sort** (`flow_sort.wgsl`): a workgroup a tile puts its numbers in order, whatever the scheduling of threads, and writes where each splat
//!    is in the tile's middle.

#[cfg(test)]
pub(in crate::render) mod stages;

use crate::render::RenderError;
use crate::render::flow::{FlowSplats, Shapes};
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::flow_layout::{FlowLists, FlowParams};
use crate::render::gpu::layout::{Params, TEXELS_WIDE};
use crate::render::gpu::pipelines::Pipelines;
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{FLOW, Stage};
use crate::render::gpu::texels::TexelList;
use std::sync::{Arc, Weak};

/// Most splats: f32 has their numbers.
const MOST_SPLATS: usize = 1 << 24;

/// Most places in tiles: 1 GiB.
const MOST_PLACES: u64 = 1 << 25;

/// Most tiles that the boxes of splats meet, summed over these: the time that a GPU takes to count them.
const MOST_TILES: u64 = 1 << 28;

/// Places per splat for which there is room at first: often enough, and corrected if not.
const FIRST_PLACES: u64 = 8;

/// Splats by tiles in the GPU's memory.
pub(in crate::render::gpu) struct SplatLists {
    /// The splats that have been sent.
    of: Option<Weak<FlowSplats>>,
    /// The sites that have been sent.
    sites_of: Weak<Shapes>,
    layout: FlowLists,
    pub(in crate::render::gpu) params: FlowParams,
    params_buffer: GrowingBuffer,
    sites: GrowingBuffer,
    ready: GrowingBuffer,
    pub(in crate::render::gpu) records: GrowingBuffer,
    /// Ends of the tiles' lists, their sum, the length of the longest, the lists.
    pub(in crate::render::gpu) bins: GrowingBuffer,
    pub(in crate::render::gpu) texels: TexelList,
}

impl SplatLists {
    pub(in crate::render::gpu) fn new() -> Self {
        Self {
            of: None,
            sites_of: Weak::new(),
            layout: FlowLists { tiles: 0, splats: 0 },
            params: FlowParams::default(),
            params_buffer: GrowingBuffer::new(Resource::FlowParams),
            sites: GrowingBuffer::new(Resource::FlowSites),
            ready: GrowingBuffer::new(Resource::FlowReady),
            records: GrowingBuffer::new(Resource::FlowRecords),
            bins: GrowingBuffer::new(Resource::FlowBins),
            texels: TexelList::written(Resource::FlowLists),
        }
    }

    /// The buffers, as stages bind them.
    pub(in crate::render::gpu) fn buffers(&self) -> [&GrowingBuffer; 5] {
        [&self.params_buffer, &self.sites, &self.ready, &self.records, &self.bins]
    }

    /// The texture, as some stages write and others read it.
    pub(in crate::render::gpu) fn views(&self) -> impl Iterator<Item = (Resource, &wgpu::TextureView)> {
        self.texels.view().into_iter().flat_map(|(list, view)| [(list, view), (Resource::FlowPlane, view)])
    }

    /// Uploads splats, unless they are there, and makes room for their lists. Returns whether a buffer or a texture was made, and the bytes sent.
    pub(in crate::render::gpu) fn update(
        &mut self,
        context: &Context,
        flow: &Arc<FlowSplats>,
        params: &Params,
    ) -> Result<(bool, u64), RenderError> {
        let ready = flow.ready();
        if ready.splats() > MOST_SPLATS || ready.tiles > MOST_TILES {
            let (splats, tiles) = (ready.splats(), ready.tiles);
            return Err(context.beyond(format!("{splats} splats of flow in {tiles} places in tiles are too many")));
        }
        let is_there = self.of.take().is_some_and(|of| of.as_ptr() == Arc::as_ptr(flow));
        self.layout = FlowLists { tiles: params.tile_count() as u64, splats: ready.splats() as u64 };
        let (mut made, mut sent) = self.update_sites(context, flow)?;
        made |= self.params_buffer.reserve(context, size_of::<FlowParams>() as u64)?;
        let ready_made = self.ready.reserve(context, size_of_val(ready.words.as_slice()) as u64)?;
        if ready_made || !is_there {
            sent += self.ready.write(context, 0, bytemuck::cast_slice(&ready.words))?;
        }
        made |= self.records.reserve(context, FlowLists::RECORD_BYTES * self.layout.splats)?;
        self.params = flow.params();
        let places = ready.tiles.min(FIRST_PLACES * self.layout.splats + self.layout.tiles);
        made |= self.reserve(context, places.min(self.most_places(context)?))?;
        sent += size_of::<FlowParams>() as u64;
        self.of = Some(Arc::downgrade(flow));
        Ok((made | ready_made, sent))
    }

    fn update_sites(&mut self, context: &Context, flow: &FlowSplats) -> Result<(bool, u64), RenderError> {
        let scene = flow.scene();
        if self.sites_of.as_ptr() == Arc::as_ptr(&scene.shapes) {
            return Ok((false, 0));
        }
        self.sites_of = Weak::new();
        let uploaded = self.sites.upload_packed(context, 0..scene.site_count(), |site| scene.packed_site(site))?;
        self.sites_of = Arc::downgrade(&scene.shapes);
        Ok(uploaded)
    }

    /// Most places that the texture has room for.
    fn most_places(&self, context: &Context) -> Result<u64, RenderError> {
        let texels = (TexelList::most(context) as u64).checked_sub(self.layout.places());
        let texels = texels.ok_or_else(|| context.beyond("splats of flow are more than a texture has".to_owned()))?;
        Ok((texels / FlowLists::PLACE_TEXELS).min(MOST_PLACES))
    }

    /// Makes room for places in tiles, and sends the parameters. Returns whether a buffer or the texture was made.
    fn reserve(&mut self, context: &Context, places: u64) -> Result<bool, RenderError> {
        let texels = self.layout.places() + FlowLists::PLACE_TEXELS * places;
        let mut made = self.texels.reserve(context, texels.div_ceil(TEXELS_WIDE as u64) as usize)?;
        made |= self.bins.reserve_list(context, self.layout.numbers(), 1, places)?;
        let in_texels = (self.texels.capacity() - self.layout.places()) / FlowLists::PLACE_TEXELS;
        let in_bins = self.bins.list_capacity(self.layout.numbers(), 1);
        self.params.place_capacity = u32::try_from(in_texels).map_or(in_bins, |in_texels| in_texels.min(in_bins));
        self.params_buffer.write(context, 0, bytemuck::bytes_of(&self.params))?;
        Ok(made)
    }

    /// Frees what splats need, but for what stages are bound to still. Returns whether a buffer or a texture was made.
    pub(in crate::render::gpu) fn release(&mut self, context: &Context) -> Result<bool, RenderError> {
        if self.of.take().is_none() {
            return Ok(false);
        }
        self.sites_of = Weak::new();
        for buffer in [&mut self.sites, &mut self.ready, &mut self.records, &mut self.bins] {
            buffer.release();
            buffer.reserve(context, 0)?;
        }
        self.texels.release(context, false)?;
        Ok(true)
    }

    /// Sends the splats of the next job whatever they are; not the sites.
    #[cfg(test)]
    pub(in crate::render::gpu) fn forget(&mut self) {
        self.of = None;
    }

    /// Records the stages, if there are splats.
    pub(in crate::render::gpu) fn record(
        &self,
        context: &Context,
        pipelines: &Pipelines,
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<(), RenderError> {
        if self.of.is_none() {
            return Ok(());
        }
        encoder.clear_buffer(self.bins.get(context)?, 0, Some(4 * self.layout.numbers()));
        let label = Some("flow");
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
        for stage in FLOW {
            let groups = match stage {
                Stage::FlowScan => 1,
                Stage::FlowSort => self.layout.tiles as u32,
                // The head is written even so.
                _ => (self.layout.splats as u32).div_ceil(64).max(1),
            };
            pipelines.dispatch(context, stage, groups, &mut pass)?;
        }
        Ok(())
    }

    /// The words of the lists that tell how many places there are, and the longest list.
    pub(in crate::render::gpu) fn told(
        &self,
        context: &Context,
    ) -> Result<Option<(&wgpu::Buffer, u64, usize)>, RenderError> {
        if self.of.is_none() {
            return Ok(None);
        }
        Ok(Some((self.bins.get(context)?, 4 * self.layout.tiles, FlowLists::BINS_HEAD as usize)))
    }

    /// Whether the lists are not what rays may read.
    pub(in crate::render::gpu) fn is_incomplete(&self, [places, longest]: [u32; 2]) -> bool {
        self.of.is_some() && (places > self.params.place_capacity || longest > FlowLists::LONGEST)
    }

    /// Makes room for what was told, and a quarter more, if the lists are too short; stages are then to be bound anew.
    pub(in crate::render::gpu) fn grow(
        &mut self,
        context: &Context,
        [places, longest]: [u32; 2],
    ) -> Result<(), RenderError> {
        if !self.is_incomplete([places, longest]) {
            return Ok(());
        }
        let (needed, most) = (u64::from(places), self.most_places(context)?);
        if needed > most {
            return Err(context.beyond("splats of flow have more places in tiles than a texture".to_owned()));
        }
        if needed <= u64::from(self.params.place_capacity) {
            let most = FlowLists::LONGEST;
            return Err(context.beyond(format!("{longest} splats of flow reach a tile of pixels, of at most {most}")));
        }
        self.reserve(context, (needed + needed / 4).min(most)).map(|_| ())
    }
}
