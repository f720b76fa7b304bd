//! Depth layers on the GPU: [`crate::render::cpu::layers`] in WGSL.
//!
//! 1. **faces**, the stage of the face renderer: a thread a face of the boundary looks at the pixels of the face's box. A face with a large
//!    box is cut into pieces, one a tile (`fragments_find.wgsl`, `fragments_pieces.wgsl`). Instead of storing fragments a pixel keeps its nearest depths
//!    (`lib/layers_keep.wgsl`): each layer takes the nearer of two depths and passes the other on to the next, so that the result does not
//!    depend on their order.
//! 2. **plan**: the number of workgroups is computed on the GPU from the number of pieces. If these exceed the list, the boundary is drawn
//!    again with a longer one.
//! 3. **range** of all depths in view, and from it the **reference** plane that filters compare.
//!
//! Deviations from the CPU path:
//! 1. A depth is one f32, the sum of the two that the face renderer keeps: right to 2^-22 of the face's extent in depth, the error of
//!    f32 weights, and to 2^-24 of itself, counted from the middle of the mesh or from the eye. Geometry is always in f32.
//! 2. Rays meet faces as in the face renderer: those within rounding of the boundary's rim may hit or miss it.
//! 3. Whether a face that reaches the eye is in front of it is not decided exactly.
//!
//! Of 178,566 pixels of small images of a mesh with holes and several parts none had a layer that the CPU has not (`stage_tests.rs`).

#[cfg(test)]
pub(super) mod stage_tests;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::{
    ELEMENTS_PER_GROUP, FIRST_PIECES_PER_TILE, LayerLists, ListParams, PIECE_WORDS, Params, TILE_PIXELS, TILE_PX,
};
use super::pipelines::{NO_RECORDS, Pipelines};
use super::resources::Resource;
use super::shaders::{Element, Pass, Precision, Stage};
use super::target::OnePlane;
use crate::mesh::Mesh;
use crate::render::cpu::layers::boundary_faces;
use crate::render::{RenderError, RenderJob};
use crate::visibility::CellSet;
use std::ops::Range;
use std::sync::Arc;

const FACES: Stage = Stage::Find(Element::Face, Pass::Layers, Precision::Single);
const PIECES: Stage = Stage::FindPieces(Element::Face, Pass::Layers, Precision::Single);

/// The boundary faces of a set of cells, on the GPU.
pub(super) struct Boundary {
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    faces: u32,
    list: GrowingBuffer,
}

impl Boundary {
    pub(super) fn new() -> Self {
        Self { of: None, faces: 0, list: GrowingBuffer::new(Resource::Drawn) }
    }

    /// Uploads the boundary of a set of cells of the job's mesh unless it is there. Returns whether a buffer was made, and the bytes sent;
    /// `None` if the job is cancelled.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        cells: &Arc<CellSet>,
    ) -> Result<Option<(bool, u64)>, RenderError> {
        let mesh = &job.mesh;
        let is_there = |(of, set): &(Arc<Mesh>, Arc<CellSet>)| Arc::ptr_eq(of, mesh) && Arc::ptr_eq(set, cells);
        if self.of.as_ref().is_some_and(is_there) {
            return Ok(Some((false, 0)));
        }
        self.of = None;
        let Some(corners) = boundary_faces(job, cells) else { return Ok(None) };
        let made = self.list.reserve(context, size_of_val(corners.as_slice()) as u64)?;
        let sent = self.list.write(context, 0, bytemuck::cast_slice(&corners))?;
        (self.of, self.faces) = (Some((mesh.clone(), cells.clone())), corners.len() as u32);
        Ok(Some((made, sent)))
    }

    /// Frees the list, and drops the mesh.
    pub(super) fn release(&mut self) {
        *self = Self::new();
    }

    /// Whether it holds the boundary of another mesh.
    pub(super) fn is_of_other(&self, mesh: &Arc<Mesh>) -> bool {
        self.of.as_ref().is_some_and(|(of, _)| !Arc::ptr_eq(of, mesh))
    }

    /// Workgroups that draw it.
    pub(super) fn groups(&self) -> usize {
        self.faces.div_ceil(ELEMENTS_PER_GROUP) as usize
    }
}

/// Depth layers of one view.
pub(super) struct DepthLayers {
    params_buffer: GrowingBuffer,
    list_params_buffer: GrowingBuffer,
    /// Pieces of large faces: [`LayerLists`].
    lists: GrowingBuffer,
    args: GrowingBuffer,
    pub(super) depths: GrowingBuffer,
    /// The plane of depth layers, 0 to 1, that filters compare.
    reference: Option<OnePlane>,
    pub(super) pipelines: Pipelines,
    pub(super) params: Params,
    list_params: ListParams,
    places: LayerLists,
}

impl DepthLayers {
    pub(super) fn new() -> Self {
        Self {
            params_buffer: GrowingBuffer::new(Resource::Params),
            list_params_buffer: GrowingBuffer::new(Resource::ListParams),
            lists: GrowingBuffer::new(Resource::Lists),
            args: GrowingBuffer::new(Resource::Args),
            depths: GrowingBuffer::new(Resource::Depths),
            reference: None,
            pipelines: Pipelines::new(),
            params: Params::default(),
            list_params: ListParams::default(),
            places: LayerLists { tiles: 0, layers: 0 },
        }
    }

    /// Bytes of the largest binding for an image, without the boundary and without pieces beyond the initial capacity.
    pub(super) fn binding_bytes((width, height): (usize, usize), layers: usize) -> u64 {
        let tiles = (width.div_ceil(TILE_PX) * height.div_ceil(TILE_PX)) as u64;
        let pieces = LayerLists::HEAD + PIECE_WORDS * FIRST_PIECES_PER_TILE * tiles;
        4 * pieces.max(LayerLists { tiles, layers: layers as u64 }.depths())
    }

    /// Allocates `layers` depth layers for a view of a boundary, and compiles the stages. Returns whether a buffer or plane was made.
    pub(super) fn update(
        &mut self,
        context: &Context,
        params: Params,
        layers: usize,
        boundary: &Boundary,
    ) -> Result<bool, RenderError> {
        let stages = [FACES, PIECES, Stage::LayersPlan, Stage::LayersRange, Stage::LayersReference];
        self.pipelines.prepare(context, NO_RECORDS, stages)?;
        let size_px = params.size_px.map(|px| px as usize).into();
        self.places = LayerLists { tiles: params.tile_count() as u64, layers: layers as u64 };
        let mut made = self.params_buffer.reserve(context, size_of::<Params>() as u64)?;
        made |= self.list_params_buffer.reserve(context, size_of::<ListParams>() as u64)?;
        made |= self.args.reserve(context, 12)?;
        made |= self.depths.reserve(context, 4 * self.places.depths())?;
        let pieces = FIRST_PIECES_PER_TILE * self.places.tiles;
        made |= self.lists.reserve_list(context, LayerLists::HEAD, PIECE_WORDS, pieces)?;
        made |= OnePlane::keep(&mut self.reference, context, Resource::ReferencePlane, size_px)?;
        self.params = params;
        self.list_params = ListParams {
            drawn_count: boundary.faces,
            end_pixel: TILE_PIXELS as u32,
            end_tile: self.places.tiles as u32,
            k: layers as u32,
            piece_capacity: self.piece_capacity(),
            ..ListParams::default()
        };
        Ok(made)
    }

    /// Frees buffers and plane; compiled stages stay.
    pub(super) fn release(&mut self) {
        let Self { params_buffer, list_params_buffer, lists, args, depths, reference, pipelines, .. } = self;
        pipelines.unbind();
        *reference = None;
        [params_buffer, list_params_buffer, lists, args, depths].into_iter().for_each(GrowingBuffer::release);
    }

    /// View of the reference plane, if it is allocated.
    pub(super) fn reference(&self) -> Option<&wgpu::TextureView> {
        self.reference.as_ref().map(|plane| &plane.view)
    }

    /// The reference plane, to be read back.
    #[cfg(test)]
    pub(super) fn plane(&self) -> Option<&OnePlane> {
        self.reference.as_ref()
    }

    /// Makes the missing bind groups, with the boundary, its view vertices and the buffer of the depth range.
    pub(super) fn bind(
        &mut self,
        context: &Context,
        boundary: &Boundary,
        vertices: &GrowingBuffer,
        range: &GrowingBuffer,
    ) -> Result<(), RenderError> {
        let own = [&self.params_buffer, &self.list_params_buffer, &self.lists, &self.args, &self.depths];
        let buffers = [&own[..], &[&boundary.list, vertices, range]].concat();
        let planes: Vec<_> = self.reference.iter().map(|plane| (Resource::ReferencePlane, &plane.view)).collect();
        self.pipelines.bind(context, &buffers, &planes)
    }

    /// Writes the parameters and records the clearing of depths and pieces.
    pub(super) fn begin(&self, context: &Context, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        self.params_buffer.write(context, 0, bytemuck::bytes_of(&self.params))?;
        encoder.clear_buffer(self.depths.get(context)?, 0, Some(4 * self.places.depths()));
        encoder.clear_buffer(self.lists.get(context)?, 0, Some(4 * LayerLists::HEAD));
        Ok(())
    }

    /// Records the faces of some workgroups.
    pub(super) fn record_faces(
        &mut self,
        context: &Context,
        groups: &Range<usize>,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        let face = |group: usize| (group as u32).saturating_mul(ELEMENTS_PER_GROUP).min(self.list_params.drawn_count);
        (self.list_params.first, self.list_params.end) = (face(groups.start), face(groups.end));
        self.list_params_buffer.write(context, 0, bytemuck::bytes_of(&self.list_params))?;
        self.pipelines.dispatch(context, FACES, groups.len() as u32, pass)
    }

    /// Records the next pieces of large faces, at most `most`.
    pub(super) fn record_pieces(
        &mut self,
        context: &Context,
        most: usize,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.list_params.end = most as u32;
        self.list_params_buffer.write(context, 0, bytemuck::bytes_of(&self.list_params))?;
        self.pipelines.dispatch(context, Stage::LayersPlan, 1, pass)?;
        self.pipelines.set(context, PIECES, pass)?;
        pass.dispatch_workgroups_indirect(self.args.get(context)?, 0);
        Ok(())
    }

    /// The buffer whose first [`LayerLists::HEAD`] words hold the progress of the pieces.
    pub(super) fn head(&self, context: &Context) -> Result<&wgpu::Buffer, RenderError> {
        self.lists.get(context)
    }

    /// Capacity in pieces.
    pub(super) fn piece_capacity(&self) -> u32 {
        self.lists.list_capacity(LayerLists::HEAD, PIECE_WORDS)
    }

    /// Makes room for `pieces`, and a quarter more if a binding may hold them. Unbinds all; the boundary must be drawn again.
    pub(super) fn grow_pieces(&mut self, context: &Context, pieces: u64) -> Result<(), RenderError> {
        // Bind groups would keep the old list alive beside the new one.
        self.pipelines.unbind();
        let most = (context.binding_bytes() / 4).saturating_sub(LayerLists::HEAD) / PIECE_WORDS;
        // A buffer is a multiple of 16 bytes.
        let most = most - most % 2;
        let pieces = (pieces + pieces / 4).min(most).max(pieces);
        self.lists.reserve_list(context, LayerLists::HEAD, PIECE_WORDS, pieces)?;
        self.list_params.piece_capacity = self.piece_capacity();
        Ok(())
    }

    /// Records the range of all depths.
    pub(super) fn record_range(&self, context: &Context, pass: &mut wgpu::ComputePass<'_>) -> Result<(), RenderError> {
        self.pipelines.dispatch(context, Stage::LayersRange, 1, pass)
    }

    /// Records the reference plane of some tiles.
    pub(super) fn record_reference(
        &mut self,
        context: &Context,
        tiles: &Range<usize>,
        pass: &mut wgpu::ComputePass<'_>,
    ) -> Result<(), RenderError> {
        self.params.first_tile = tiles.start as u32;
        self.params_buffer.write(context, 0, bytemuck::bytes_of(&self.params))?;
        self.pipelines.dispatch(context, Stage::LayersReference, tiles.len() as u32, pass)
    }
}
