//! The parts of a job in the GPU's memory, each sent only when it changes.

use super::Elements;
use super::drawn::DrawnBuffer;
use super::steps::Stages;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{FIRST_PIECES_PER_TILE, FRAGMENT_BYTES, ListParams, Lists, PIECE_WORDS, Params};
use crate::render::gpu::pipelines::{NO_RECORDS, Pipelines};
use crate::render::gpu::resources::Resource;
use crate::render::gpu::shaders::{FLOW, FragmentKind, Stage};
use crate::render::gpu::shared_scene::SharedScene;
use crate::render::gpu::target::Target;
use crate::render::{RenderError, RenderJob};
use crate::visibility::Drawn;
use std::sync::Arc;

/// Least capacity for fragments.
const FRAGMENTS_MIN: u32 = 1 << 16;

/// All that the stages read and write.
pub(in crate::render::gpu) struct Scene<E> {
    pub(in crate::render::gpu) shared: SharedScene,
    pub(in crate::render::gpu) elements: E,
    pub(in crate::render::gpu) list_params: GrowingBuffer,
    drawn: DrawnBuffer,
    /// Counts, places and pieces: [`Lists`].
    pub(in crate::render::gpu) lists: GrowingBuffer,
    pub(in crate::render::gpu) fragments: [GrowingBuffer; 2],
    pub(in crate::render::gpu) pipelines: Pipelines,
}

impl<E: Elements> Scene<E> {
    pub(super) fn new() -> Self {
        Self {
            shared: SharedScene::new(),
            elements: E::default(),
            list_params: GrowingBuffer::new(Resource::ListParams),
            drawn: DrawnBuffer::new(),
            lists: GrowingBuffer::new(Resource::Lists),
            fragments: Resource::FRAGMENTS.map(GrowingBuffer::new),
            pipelines: Pipelines::new(),
        }
    }

    /// Uploads what is not on the GPU yet, completes the parameters, and returns the target. The caller has asked
    /// [`Table::is_transparent`](crate::render::gpu::table::Table::is_transparent).
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<Drawn>,
        params: &mut Params,
        list_params: &mut ListParams,
    ) -> Result<Arc<Target>, RenderError> {
        let target = self.update_buffers(context, job, drawn, params, list_params);
        // Buffers may have been reallocated before one was refused: the old ones are bound.
        if target.is_err() || self.shared.made {
            self.pipelines.unbind();
        }
        let target = target?;
        self.bind(context)?;
        Ok(target)
    }

    /// Compiles a job's stages unless that has been done; before [`Self::update`].
    pub(super) fn make_pipelines(
        &mut self,
        context: &Context,
        stages: Stages,
        has_flow: bool,
    ) -> Result<(), RenderError> {
        let flow = if has_flow { &FLOW[..] } else { &[] };
        let stages = [Stage::ViewTransform].into_iter().chain(stages.all()).chain(flow.iter().copied());
        self.pipelines.prepare(context, NO_RECORDS, stages)
    }

    fn update_buffers(
        &mut self,
        context: &Context,
        job: &RenderJob,
        drawn: &Arc<Drawn>,
        params: &mut Params,
        list_params: &mut ListParams,
    ) -> Result<Arc<Target>, RenderError> {
        self.shared.upload(context, job, params)?;
        self.shared.made |= self.list_params.reserve(context, size_of::<ListParams>() as u64)?;
        let uploaded = self.elements.upload(context, job, list_params)?;
        self.shared.note(uploaded);
        self.shared.note(self.drawn.upload(context, drawn, self.elements.behind_list())?);
        self.shared.upload_active(context, job)?;
        let (target, _) = self.shared.resize(context, params)?;
        let lists = Lists { tiles: params.tile_count() as u64 };
        let pieces = FIRST_PIECES_PER_TILE * lists.tiles;
        self.shared.made |= self.lists.reserve_list(context, lists.pieces(), PIECE_WORDS, pieces)?;
        for fragments in &mut self.fragments {
            self.shared.made |= fragments.reserve(context, FRAGMENT_BYTES)?;
        }
        list_params.piece_capacity = self.lists.list_capacity(lists.pieces(), PIECE_WORDS);
        Ok(target)
    }

    /// Makes room for more pieces, and for what was told of splats, and a quarter more, as far as it does not fit.
    pub(super) fn grow(
        &mut self,
        context: &Context,
        lists: Lists,
        (pieces, told): (u32, [u32; 2]),
        list_params: &mut ListParams,
    ) -> Result<(), RenderError> {
        if pieces > list_params.piece_capacity {
            let pieces = u64::from(pieces);
            self.lists.reserve_list(context, lists.pieces(), PIECE_WORDS, pieces + pieces / 4)?;
            list_params.piece_capacity = self.lists.list_capacity(lists.pieces(), PIECE_WORDS);
        }
        self.shared.grow_flow(context, told)?;
        self.pipelines.unbind();
        self.bind(context)
    }

    /// Largest number of fragments within `bytes` and two bindings.
    pub(super) fn fragment_capacity(context: &Context, kind: FragmentKind, bytes: u64) -> u32 {
        let both = 2 * (context.binding_bytes() / kind.bytes());
        u32::try_from((bytes / kind.bytes()).min(both)).unwrap_or(u32::MAX).max(1)
    }

    /// Makes room for `fragments`, at most `capacity`.
    pub(super) fn reserve_fragments(
        &mut self,
        context: &Context,
        kind: FragmentKind,
        fragments: u32,
        capacity: u32,
        list_params: &mut ListParams,
    ) -> Result<(), RenderError> {
        let room = |buffer: &GrowingBuffer| buffer.bytes() / kind.bytes();
        let [first, second] = &self.fragments;
        if room(first) + room(second) < u64::from(fragments) {
            // Powers of two, so that a moving camera seldom reallocates.
            let wanted = fragments.checked_next_power_of_two().unwrap_or(capacity);
            let wanted = u64::from(wanted.max(FRAGMENTS_MIN).min(capacity));
            let in_first = wanted.min(context.binding_bytes() / kind.bytes());
            let [first, second] = &mut self.fragments;
            let mut made = first.reserve(context, kind.bytes() * in_first)?;
            made |= second.reserve(context, kind.bytes() * (wanted - in_first))?;
            if made {
                self.pipelines.unbind();
                self.bind(context)?;
            }
        }
        list_params.fragment_part = u32::try_from(room(&self.fragments[0])).unwrap_or(u32::MAX);
        Ok(())
    }

    /// Makes the bind groups that are missing.
    fn bind(&mut self, context: &Context) -> Result<(), RenderError> {
        let (mut buffers, planes) = (self.shared.buffers(), self.shared.planes());
        buffers.extend([&self.list_params, &self.lists, &self.drawn.buffer]);
        buffers.extend(self.elements.buffers());
        buffers.extend(&self.fragments);
        self.pipelines.bind(context, &buffers, &planes)
    }
}
