//! Buffers in the GPU's memory, and the upload of vertices and scalars.

use super::context::Context;
use super::decode::BlockDecoder;
use super::joint::RowValues;
use super::layout::VIEW_VERTEX_BYTES;
use super::resources::{Kind, Resource};
use crate::mesh::Mesh;
use crate::render::surfaces::SurfaceScene;
use crate::render::{RenderError, RenderJob};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Weak};

/// Cells or faces that are packed and sent at a time.
const ELEMENTS_PER_PIECE: usize = 1 << 18;

/// Numbers in the space of a view vertex, where some lie behind these.
pub(super) const NUMBERS_PER_VERTEX: usize = VIEW_VERTEX_BYTES as usize / size_of::<f32>();

/// A buffer that is reallocated only when it is too small.
#[derive(Debug)]
pub struct GrowingBuffer {
    /// The resource that it is bound as; `None` for read-back.
    resource: Option<Resource>,
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl GrowingBuffer {
    /// An empty buffer that stages bind as `resource`; storage is a source of copies, too.
    pub(super) fn new(resource: Resource) -> Self {
        let usage = match resource.kind() {
            Kind::Uniform(_) => wgpu::BufferUsages::UNIFORM,
            _ if resource == Resource::Args => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT,
            _ => wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        };
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self { resource: Some(resource), label: resource.label(), usage, buffer: None }
    }

    /// An empty buffer that the CPU reads.
    pub(super) fn readback(label: &'static str) -> Self {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Self { resource: None, label, usage, buffer: None }
    }

    /// The resource that it is bound as, if stages bind it.
    pub(super) fn resource(&self) -> Option<Resource> {
        self.resource
    }

    /// Makes room for `bytes`. Returns whether the buffer was reallocated, which discards its contents.
    pub(super) fn reserve(&mut self, context: &Context, bytes: u64) -> Result<bool, RenderError> {
        // Bindings must not be empty, sizes are multiples of 16.
        let bytes = bytes.max(16).next_multiple_of(16);
        if self.buffer.as_ref().is_some_and(|b| b.size() >= bytes) {
            return Ok(false);
        }
        let limits = context.device.limits();
        let is_storage = self.usage.contains(wgpu::BufferUsages::STORAGE);
        let most = if is_storage { context.binding_bytes() } else { limits.max_buffer_size };
        if bytes > most {
            return Err(context.beyond(format!("{} takes {bytes} bytes, a buffer has at most {most}", self.label)));
        }
        // The old buffer is freed first: two large ones may not fit.
        self.buffer = None;
        let descriptor = wgpu::BufferDescriptor {
            label: Some(self.label),
            size: bytes,
            usage: self.usage,
            mapped_at_creation: false,
        };
        self.buffer = Some(context.create(|device| device.create_buffer(&descriptor))?);
        context.count_created(1);
        Ok(true)
    }

    /// As [`Self::reserve`], for `count` entries of `entry_words` words each behind the first `head_words` words.
    pub(super) fn reserve_list(
        &mut self,
        context: &Context,
        head_words: u64,
        entry_words: u64,
        count: u64,
    ) -> Result<bool, RenderError> {
        self.reserve(context, 4 * (head_words + entry_words * count))
    }

    /// The number of entries for which there is room behind the first `head_words` words.
    pub(super) fn list_capacity(&self, head_words: u64, entry_words: u64) -> u32 {
        let words = (self.bytes() / 4).saturating_sub(head_words);
        u32::try_from(words / entry_words).unwrap_or(u32::MAX)
    }

    /// Makes room for the packed elements of a range and sends them, in pieces, so that no second copy of a large mesh is held. Returns
    /// whether the buffer was reallocated, and the bytes sent.
    pub(super) fn upload_packed<T: bytemuck::Pod + Send>(
        &mut self,
        context: &Context,
        range: Range<usize>,
        pack: impl Fn(usize) -> T + Sync,
    ) -> Result<(bool, u64), RenderError> {
        let made = self.reserve(context, (size_of::<T>() * range.len()) as u64)?;
        let (mut piece, mut sent) = (Vec::new(), 0);
        for from in range.clone().step_by(ELEMENTS_PER_PIECE) {
            let to = (from + ELEMENTS_PER_PIECE).min(range.end);
            (from..to).into_par_iter().map(&pack).collect_into_vec(&mut piece);
            sent += self.write(context, sent, bytemuck::cast_slice(&piece))?;
            // Frees the staging memory of the piece before the next.
            context.queue.submit([]);
        }
        Ok((made, sent))
    }

    /// Frees the buffer.
    pub(super) fn release(&mut self) {
        self.buffer = None;
    }

    /// The buffer; the caller has reserved it.
    pub(super) fn get(&self, context: &Context) -> Result<&wgpu::Buffer, RenderError> {
        self.buffer.as_ref().ok_or_else(|| context.beyond(format!("{} has not been made", self.label)))
    }

    /// Capacity in bytes; 0 if not allocated.
    pub(super) fn bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, wgpu::Buffer::size)
    }

    /// Writes `data` at byte `offset` (a multiple of 4); returns the bytes sent.
    pub(super) fn write(&self, context: &Context, offset: u64, data: &[u8]) -> Result<u64, RenderError> {
        if !data.is_empty() {
            context.queue.write_buffer(self.get(context)?, offset, data);
        }
        Ok(data.len() as u64)
    }
}

/// Buffers of a mesh's vertices: positions, scalars, view coordinates.
#[derive(Debug)]
pub(super) struct VertexBuffers {
    of: Option<Arc<Mesh>>,
    pub(super) positions: GrowingBuffer,
    pub(super) scalars: GrowingBuffer,
    /// View vertices. Behind them lie, of vertices, the values of a joint table's rows, then gradients (with smooth surfaces); or, of cells,
    /// scalars, which the view transform maps there, then the values of the rows.
    pub(super) vertices: GrowingBuffer,
    rows: Option<RowValues>,
    gradients: Option<GradientsSent>,
}

/// The gradients of vertices that have been sent.
#[derive(Debug)]
struct GradientsSent {
    of: Weak<Vec<[f32; 3]>>,
    /// Index of their first number behind the view vertices.
    first: usize,
}

impl VertexBuffers {
    pub(super) fn new() -> Self {
        Self {
            of: None,
            positions: GrowingBuffer::new(Resource::Positions),
            scalars: GrowingBuffer::new(Resource::Scalars),
            vertices: GrowingBuffer::new(Resource::Vertices),
            rows: None,
            gradients: None,
        }
    }

    /// The three buffers, to be bound.
    pub(super) fn buffers(&self) -> [&GrowingBuffer; 3] {
        [&self.positions, &self.scalars, &self.vertices]
    }

    /// Uploads the vertices of a mesh unless they are on the GPU. Returns whether a buffer was made, and the bytes sent.
    pub(super) fn upload(&mut self, context: &Context, mesh: &Arc<Mesh>) -> Result<(bool, u64), RenderError> {
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return Ok((false, 0));
        }
        (self.of, self.rows, self.gradients) = (None, None, None);
        let vertices = mesh.positions.local.len() as u64;
        let mut made = self.positions.reserve(context, 12 * vertices)?;
        made |= self.scalars.reserve(context, 4 * vertices)?;
        made |= self.vertices.reserve(context, VIEW_VERTEX_BYTES * vertices)?;
        let sent = self.positions.write(context, 0, bytemuck::cast_slice(&mesh.positions.local))?;
        self.of = Some(mesh.clone());
        Ok((made, sent))
    }

    /// Makes room for as many scalars. Returns whether the buffer was reallocated.
    pub(super) fn reserve_scalars(&mut self, context: &Context, count: usize) -> Result<bool, RenderError> {
        self.scalars.reserve(context, 4 * count as u64).inspect_err(|_| self.of = None)
    }

    /// Index of the first gradient component among the numbers behind the view vertices.
    pub(super) fn first_gradient(job: &RenderJob) -> usize {
        if job.joint.is_some() { job.mesh.positions.local.len() } else { 0 }
    }

    /// Uploads the values of the job's rows and gradients, if any, unless they are on the GPU, and makes room for scalars of cells; after
    /// [`Self::upload`]. Returns whether the buffer was made, and the bytes sent.
    pub(super) fn upload_values(&mut self, context: &Context, job: &RenderJob) -> Result<(bool, u64), RenderError> {
        let gradients = job.surfaces.as_ref().and_then(SurfaceScene::gradients);
        // Scalars of cells, whole view vertices of them, come first.
        let first_row = job.scalars.of_cells().map_or(0, |scalars| scalars.len().next_multiple_of(NUMBERS_PER_VERTEX));
        let rows = job.joint.as_ref().map_or(0, |_| job.scalars.values().len());
        let numbers = first_row + rows + gradients.map_or(0, |gradients| 3 * gradients.len());
        if numbers == 0 {
            return Ok((false, 0));
        }
        let begin = VIEW_VERTEX_BYTES * job.mesh.positions.local.len() as u64;
        // Rounded up to whole view vertices: shaders see an array of them.
        let bytes = (4 * numbers as u64).next_multiple_of(VIEW_VERTEX_BYTES);
        let made = self.vertices.reserve(context, begin + bytes).inspect_err(|_| self.of = None)?;
        if made {
            (self.rows, self.gradients) = (None, None);
        }
        if first_row > 0 {
            // The scalars may overwrite what lay there.
            self.gradients = None;
            self.rows.take_if(|rows| rows.first() < first_row);
        }
        let mut sent = 0;
        if let Some(scene) = &job.joint
            && !self.rows.as_ref().is_some_and(|rows| rows.are_of(scene, first_row))
        {
            // Gradients may have lain there.
            (self.rows, self.gradients) = (None, None);
            let (rows, words) = RowValues::of(scene, &job.scalars, first_row);
            sent += self.vertices.write(context, begin + 4 * first_row as u64, bytemuck::cast_slice(&words))?;
            self.rows = Some(rows);
        }
        if let Some(gradients) = gradients {
            sent += self.upload_gradients(context, gradients, begin, Self::first_gradient(job))?;
        }
        Ok((made, sent))
    }

    /// Uploads gradients behind the first `first` numbers, which begin at byte `begin`, unless they are there.
    fn upload_gradients(
        &mut self,
        context: &Context,
        gradients: &Arc<Vec<[f32; 3]>>,
        begin: u64,
        first: usize,
    ) -> Result<u64, RenderError> {
        let is_there = |sent: &GradientsSent| sent.of.as_ptr() == Arc::as_ptr(gradients) && sent.first == first;
        if self.gradients.as_ref().is_some_and(is_there) {
            return Ok(0);
        }
        self.gradients = None;
        // Values of rows may have lain there.
        self.rows.take_if(|rows| first == 0 || rows.first() > 0);
        let sent = self.vertices.write(context, begin + 4 * first as u64, bytemuck::cast_slice(gradients))?;
        self.gradients = Some(GradientsSent { of: Arc::downgrade(gradients), first });
        Ok(sent)
    }
}

/// Scalars below this may be denormal for a GPU.
const SMALL: f32 = 1.0 / (1u64 << 63) as f32;
/// Brings the least denormal (2^-149) into the range of normal numbers.
const PRESCALE: f32 = (1u128 << 100) as f32;

/// Uploads a job's scalars.
pub(super) struct GpuScalars {
    /// The scalars in the buffer; weak, since their owner may decode the next step into them once no job has them.
    of: Weak<Vec<f32>>,
    prescale: f32,
    largest: f32,
    converted: Vec<f32>,
    /// Decodes compressed scalars on the GPU.
    pub(super) decoder: BlockDecoder,
}

impl GpuScalars {
    pub(super) fn new() -> Self {
        Self { of: Weak::new(), prescale: 1.0, largest: 0.0, converted: Vec::new(), decoder: BlockDecoder::new() }
    }

    /// The largest magnitude of the finite scalars of the last job.
    pub(super) fn largest(&self) -> f32 {
        self.largest
    }

    /// The only upload of scalars: sent to `buffer`, or decoded into it by the frame if compressed, unless they are there. Returns the
    /// factor that keeps them from being denormal, and the bytes sent. Non-finite values are sent as 0 (no active cell has one), so that
    /// shaders see finite scalars only. The caller has [reserved](VertexBuffers::reserve_scalars) the buffer.
    pub(super) fn scalars_to_gpu(
        &mut self,
        context: &Context,
        job: &RenderJob,
        buffer: &GrowingBuffer,
    ) -> Result<(f64, u64), RenderError> {
        let scalars = job.scalars.values();
        if Weak::as_ptr(&self.of) == Arc::as_ptr(scalars) {
            return Ok((f64::from(self.prescale), 0));
        }
        self.forget();
        let finite = |s: f32| if s.is_finite() { s } else { 0.0 };
        let (largest, all_finite) = scalars
            .iter()
            .fold((0f32, true), |(largest, all), &s| (largest.max(finite(s).abs()), all && s.is_finite()));
        self.largest = largest;
        self.prescale = if largest < SMALL { PRESCALE } else { 1.0 };
        let compressed = job.compressed.as_ref().filter(|c| c.fit(&job.scalars) && self.prescale == 1.0);
        if let Some(compressed) = compressed
            && let Some(sent) = self.decoder.prepare(context, compressed, scalars.len(), buffer)?
        {
            self.of = Arc::downgrade(scalars);
            return Ok((1.0, sent));
        }
        let sent = if all_finite && self.prescale == 1.0 {
            buffer.write(context, 0, bytemuck::cast_slice(scalars))?
        } else {
            self.converted.clear();
            self.converted.extend(scalars.iter().map(|&s| finite(s) * self.prescale));
            buffer.write(context, 0, bytemuck::cast_slice(&self.converted))?
        };
        self.of = Arc::downgrade(scalars);
        Ok((f64::from(self.prescale), sent))
    }

    /// Marks the buffer's contents as unknown: the next job sends its scalars again.
    pub(super) fn forget(&mut self) {
        self.decoder.forget();
        self.of = Weak::new();
    }
}
