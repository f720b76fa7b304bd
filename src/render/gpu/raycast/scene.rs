//! The parts of a job in the GPU's memory: each is sent when it changes, and only then.

use super::buffers::{GpuScalars, GrowingBuffer, MeshBuffers};
use super::pipelines::{Pipelines, bind_group};
use super::target::Target;
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::optics::exact::ExactTable;
use crate::optics::table3d::Table3dParams;
use crate::optics::{OpticsKind, ScalarMap};
use crate::render::cpu::raycast::entries;
use crate::render::cpu::raycast::pre_integrated::PreIntegrated;
use crate::render::gpu::context::Context;
use crate::render::gpu::layout::{Params, flags};
use crate::render::gpu::shaders::RecordSplit;
use crate::render::{RenderError, RenderJob};
use crate::visibility::CellSet;
use std::sync::Arc;

/// Where rays enter, and the active cells.
struct Domain {
    of: Option<(Arc<Mesh>, Arc<CellSet>)>,
    /// Entry faces as cell << 2 | opposite vertex, then the cells at the eye, each followed by its sides.
    items: GrowingBuffer,
    active: GrowingBuffer,
    faces: Vec<entries::EntryFace>,
    packed: Vec<u32>,
}

/// The transfer function.
struct Table {
    of: Option<(Arc<NodeTable>, f64)>,
    exact: Option<ExactTable>,
    pre_integrated: PreIntegrated,
    /// What the buffers' contents are for.
    sent: Option<(ScalarMap, OpticsKind)>,
    buffer: GrowingBuffer,
    /// What the pre-integrated table needs beside its entries.
    parameters: GrowingBuffer,
    interval_count: u32,
}

/// Groups of what the stages bind.
pub(super) struct Groups {
    pub(super) transform: wgpu::BindGroup,
    pub(super) entries: wgpu::BindGroup,
    pub(super) walk: wgpu::BindGroup,
}

/// All that the stages read and write.
pub(super) struct Scene {
    pub(super) params: GrowingBuffer,
    pub(super) mesh: MeshBuffers,
    pub(super) scalars: GpuScalars,
    domain: Domain,
    table: Table,
    pub(super) pipelines: Option<Pipelines>,
    pub(super) target: Option<Target>,
    pub(super) groups: Option<Groups>,
    /// Bytes sent for the present job.
    pub(super) bytes_sent: u64,
}

impl Scene {
    pub(super) fn new() -> Self {
        let storage = GrowingBuffer::storage;
        Self {
            params: GrowingBuffer::uniform("parameters"),
            mesh: MeshBuffers::new(),
            scalars: GpuScalars::new(),
            domain: Domain {
                of: None,
                items: storage("entry faces"),
                active: storage("active cells"),
                faces: Vec::new(),
                packed: Vec::new(),
            },
            table: Table {
                of: None,
                exact: None,
                pre_integrated: PreIntegrated::default(),
                sent: None,
                buffer: storage("table"),
                parameters: GrowingBuffer::uniform("parameters of the table"),
                interval_count: 0,
            },
            pipelines: None,
            target: None,
            groups: None,
            bytes_sent: 0,
        }
    }

    /// Whether no scalar can be seen with the job's table.
    pub(super) fn is_clear(&mut self, job: &RenderJob) -> bool {
        let scale = job.mesh.positions.scale;
        let same = |(table, s): &(Arc<NodeTable>, f64)| Arc::ptr_eq(table, &job.table) && *s == scale;
        if !self.table.of.as_ref().is_some_and(same) {
            self.table.exact = Some(ExactTable::new(&job.table, scale));
            self.table.sent = None;
            self.table.of = Some((job.table.clone(), scale));
        }
        self.table.exact.as_ref().is_none_or(ExactTable::is_clear)
    }

    /// Brings everything to the GPU that is not there yet, and completes the parameters. [`Self::is_clear`] has been asked.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        eye_cells: &[[u32; 2]],
        params: &mut Params,
    ) -> Result<(), RenderError> {
        let updated = self.update_parts(context, job, eye_cells, params);
        if updated.is_err() {
            // Buffers may have been made anew before one was refused: the groups bind the old ones.
            self.groups = None;
        }
        updated
    }

    fn update_parts(
        &mut self,
        context: &Context,
        job: &RenderJob,
        eye_cells: &[[u32; 2]],
        params: &mut Params,
    ) -> Result<(), RenderError> {
        self.bytes_sent = 0;
        let cells = job.mesh.topology.tets.len();
        let split = RecordSplit::new(cells, context.binding_bytes());
        let split = split.ok_or_else(|| context.beyond(format!("a mesh of {cells} cells is too large for it")))?;
        let mut stale = self.params.reserve(context, size_of::<Params>() as u64)?;
        if self.pipelines.as_ref().is_none_or(|p| p.split != split) {
            self.pipelines = Some(Pipelines::new(context, split)?);
            stale = true;
        }
        if let Some(pipelines) = &mut self.pipelines {
            pipelines.prepare_walk(context, job.optics)?;
        }
        let (made, sent) = self.mesh.upload(context, &job.mesh, split)?;
        if made {
            self.scalars.forget();
        }
        stale |= made;
        self.bytes_sent += sent;
        let (prescale, sent) = self.scalars.scalars_to_gpu(context, job, &self.mesh.scalars)?;
        self.bytes_sent += sent;
        stale |= self.update_table(context, job, prescale, params)?;
        stale |= self.update_domain(context, job, eye_cells)?;
        let size_px = (params.size_px[0] as usize, params.size_px[1] as usize);
        if self.target.as_ref().is_none_or(|t| t.size_px != size_px) {
            self.target = None;
            self.target = Some(Target::new(context, size_px)?);
            stale = true;
        }
        params.vertex_count = job.mesh.positions.local.len() as u32;
        params.face_count = self.domain.faces.len() as u32;
        params.eye_count = eye_cells.len() as u32;
        params.item_count = params.face_count + params.eye_count;
        if job.early_termination {
            params.flags |= flags::EARLY_TERMINATION;
        }
        if job.active.count() == job.active.universe() {
            params.flags |= flags::ALL_ACTIVE;
        }
        if let Some(target) = &mut self.target {
            // Every face in two tiles, every cell at the eye in all: often enough, and corrected if not.
            let tiles = target.tile_count() as u64;
            let pairs = 2 * u64::from(params.face_count) + tiles * (eye_cells.len() as u64 + 1);
            if target.bins.bytes() == 0 {
                target.reserve_pairs(context, pairs)?;
                stale = true;
            }
            params.pair_capacity = target.pair_capacity();
        }
        if stale || self.groups.is_none() {
            self.make_groups(context)?;
        }
        Ok(())
    }

    /// Room for more pairs of tile and item than there was.
    pub(super) fn grow_lists(&mut self, context: &Context, pairs: u64, params: &mut Params) -> Result<(), RenderError> {
        if let Some(target) = &mut self.target {
            target.reserve_pairs(context, pairs + pairs / 4)?;
            params.pair_capacity = target.pair_capacity();
        }
        self.make_groups(context)
    }

    /// The table of the job's optics, seen through the map of its scalars.
    fn update_table(
        &mut self,
        context: &Context,
        job: &RenderJob,
        prescale: f64,
        params: &mut Params,
    ) -> Result<bool, RenderError> {
        let table = &mut self.table;
        let map = ScalarMap::of_table(&job.table, prescale);
        (params.scalar_offset, params.scalar_scale) = (map.offset as f32, map.scale as f32);
        let mut made = table.parameters.reserve(context, size_of::<Table3dParams>() as u64)?;
        if made || table.sent != Some((map, job.optics)) {
            table.sent = None;
            let pre_integrated;
            let packed;
            let words: &[[f32; 4]] = match (job.optics, &table.exact) {
                (OpticsKind::Table3d, _) => {
                    pre_integrated = table.pre_integrated.get(job);
                    let of_shader = pre_integrated.params(map);
                    self.bytes_sent += table.parameters.write(context, 0, bytemuck::bytes_of(&of_shader))?;
                    bytemuck::cast_slice(pre_integrated.entries())
                }
                (OpticsKind::Exact, Some(exact)) => {
                    packed = exact.packed(map);
                    table.interval_count = (packed.len() / 3) as u32;
                    &packed
                }
                (OpticsKind::Exact, None) => &[],
            };
            made |= table.buffer.reserve(context, size_of_val(words) as u64)?;
            self.bytes_sent += table.buffer.write(context, 0, bytemuck::cast_slice(words))?;
            // A table whose integration was cancelled is not one.
            table.sent = (!job.cancel.is_cancelled()).then_some((map, job.optics));
        }
        params.interval_count = table.interval_count;
        Ok(made)
    }

    fn update_domain(
        &mut self,
        context: &Context,
        job: &RenderJob,
        eye_cells: &[[u32; 2]],
    ) -> Result<bool, RenderError> {
        let domain = &mut self.domain;
        let same = |(mesh, active): &(Arc<Mesh>, Arc<CellSet>)| {
            Arc::ptr_eq(mesh, &job.mesh) && Arc::ptr_eq(active, &job.active)
        };
        let changed = !domain.of.as_ref().is_some_and(same);
        if changed {
            domain.of = None;
            entries::collect(&job.mesh.topology, &job.active, &job.cancel, &mut domain.faces);
            domain.packed.clear();
            domain.packed.extend(domain.faces.iter().map(|f| f.cell << 2 | f.opposite));
        }
        let faces = domain.packed.len();
        let mut made = domain.items.reserve(context, 4 * (faces + 2 * eye_cells.len()) as u64)?;
        if made || changed {
            self.bytes_sent += domain.items.write(context, 0, bytemuck::cast_slice(&domain.packed))?;
        }
        self.bytes_sent += domain.items.write(context, 4 * faces as u64, bytemuck::cast_slice(eye_cells))?;
        if changed {
            let words = job.active.words();
            made |= domain.active.reserve(context, size_of_val(words) as u64)?;
            // Words of 64 bits as pairs of 32, lower first: the same bits on a little-endian GPU, as all are.
            let halves: Vec<u32> = words.iter().flat_map(|&w| [w as u32, (w >> 32) as u32]).collect();
            self.bytes_sent += domain.active.write(context, 0, bytemuck::cast_slice(&halves))?;
            let is_complete = !job.cancel.is_cancelled();
            domain.of = is_complete.then(|| (job.mesh.clone(), job.active.clone()));
        }
        Ok(made)
    }

    fn make_groups(&mut self, context: &Context) -> Result<(), RenderError> {
        let (Some(pipelines), Some(target)) = (&self.pipelines, &self.target) else { return Ok(()) };
        let get = |buffer: &GrowingBuffer| buffer.get(context).cloned();
        let (params, vertices) = (get(&self.params)?, get(&self.mesh.vertices)?);
        let [first, second, third] = &self.mesh.records;
        let records = [get(first)?, get(second)?, get(third)?];
        let bins = get(&target.bins)?;
        let group = |label: &str, layout: &wgpu::BindGroupLayout, resources: &[wgpu::BindingResource<'_>]| {
            bind_group(context, label, layout, resources)
        };
        let (positions, scalars) = (get(&self.mesh.positions)?, get(&self.mesh.scalars)?);
        let (items, active) = (get(&self.domain.items)?, get(&self.domain.active)?);
        let (table, counters) = (get(&self.table.buffer)?, get(&target.counters)?);
        let table_parameters = get(&self.table.parameters)?;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (color, depth) = (view(&target.color), view(&target.depth));
        let whole = wgpu::Buffer::as_entire_binding;
        let [r0, r1, r2] = [whole(&records[0]), whole(&records[1]), whole(&records[2])];
        let of_entries =
            [whole(&params), whole(&vertices), r0.clone(), r1.clone(), r2.clone(), whole(&items), whole(&bins)];
        let of_walk = [
            whole(&params),
            whole(&vertices),
            r0,
            r1,
            r2,
            whole(&active),
            whole(&bins),
            whole(&table),
            whole(&counters),
            wgpu::BindingResource::TextureView(&color),
            wgpu::BindingResource::TextureView(&depth),
            whole(&table_parameters),
        ];
        let of_transform = [whole(&params), whole(&positions), whole(&scalars), whole(&vertices)];
        self.groups = Some(Groups {
            transform: group("transform", &pipelines.transform_layout, &of_transform),
            entries: group("entries", &pipelines.entries_layout, &of_entries),
            walk: group("walk", &pipelines.walk_layout, &of_walk),
        });
        context.check()
    }
}
