//! Finished tiles on their way back: a ring of buffers, so that the GPU works on one slice while another is read.

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::{COUNTERS, FAR, Params, RayLists, TILE_PX};
use super::target::Target;
use crate::image::Plane;
use crate::render::{Planes, RenderError};
use crate::stats::FrameStats;
use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Bytes of a tile's counters.
const COUNTER_BYTES: u64 = 4 * COUNTERS as u64;
/// Largest number of buffer words that come with a slice.
const WORDS_MAX: usize = RayLists::HEAD;
/// Number of timestamps: begin and end of transform, entries, walk, decoding.
pub(super) const TIMESTAMPS: u32 = 8;

/// How long a mapping's callback, run by another thread, may take after the slice is done.
const CALLBACK_PATIENCE: Duration = Duration::from_secs(10);

/// Where the parts of a slice are in its buffer, in bytes.
#[derive(Clone, Copy, Debug)]
struct Places {
    depth: u64,
    counters: u64,
    words: u64,
    timestamps: u64,
    end: u64,
}

impl Places {
    /// The places for all tiles of an image; without pixels if these stay on the GPU.
    fn of(size_px: (usize, usize), has_pixels: bool) -> Self {
        let (width, height) = if has_pixels { size_px } else { (0, 0) };
        let depth = row_bytes::<[f32; 4]>(width) * height as u64;
        let counters = depth + row_bytes::<f32>(width) * height as u64;
        let words = counters + Target::counter_bytes(size_px);
        // Timestamps are 8 bytes, at a multiple of that.
        let timestamps = (words + 4 * WORDS_MAX as u64).next_multiple_of(8);
        Self { depth, counters, words, timestamps, end: timestamps + 8 * u64::from(TIMESTAMPS) }
    }
}

/// Bytes of the buffer that slices of an image come back in.
pub(super) fn slice_bytes(size_px: (usize, usize), has_pixels: bool) -> u64 {
    Places::of(size_px, has_pixels).end
}

/// Bytes from one row of pixels to the next.
fn row_bytes<P>(width: usize) -> u64 {
    ((width * size_of::<P>()) as u64).next_multiple_of(u64::from(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT))
}

/// Buffers for slices on their way back: each free or under way, and allocated when none is free.
#[derive(Default)]
pub(super) struct Readback {
    free: Vec<Slot>,
}

/// A buffer, and the state of its mapping.
struct Slot {
    buffer: GrowingBuffer,
    mapped: Mapped,
}

/// A slice under way.
pub(super) struct Sent {
    slot: Slot,
    target: Arc<Target>,
    tiles: Range<usize>,
    has_pixels: bool,
    submission: wgpu::SubmissionIndex,
}

impl Readback {
    /// Submits a slice that ends with copies of counters and times of `tiles`, of their pixels if `has_pixels`, and of `words`:
    /// buffers, each with the first byte and the number of words (at most [`WORDS_MAX`] in all).
    pub(super) fn send<'a>(
        &mut self,
        context: &Context,
        mut encoder: wgpu::CommandEncoder,
        target: &Arc<Target>,
        (tiles, has_pixels): (Range<usize>, bool),
        words: impl IntoIterator<Item = (&'a wgpu::Buffer, u64, usize)>,
    ) -> Result<Sent, RenderError> {
        let new = || Slot { buffer: GrowingBuffer::readback("read-back"), mapped: Arc::default() };
        let mut slot = self.free.pop().unwrap_or_else(new);
        let places = Places::of(target.size_px, has_pixels);
        slot.buffer.reserve(context, places.end)?;
        let buffer = slot.buffer.get(context)?;
        if has_pixels {
            copy_planes(&mut encoder, target, &tiles, places, buffer);
        }
        let (from, bytes) = (COUNTER_BYTES * tiles.start as u64, COUNTER_BYTES * tiles.len() as u64);
        if bytes > 0 {
            encoder.copy_buffer_to_buffer(target.counters.get(context)?, from, buffer, places.counters + from, bytes);
        }
        let mut place = 0;
        for (from, at, count) in words {
            let count = count.min(WORDS_MAX - place);
            encoder.copy_buffer_to_buffer(from, at, buffer, places.words + 4 * place as u64, 4 * count as u64);
            place += count;
        }
        if let Some(times) = &target.times {
            encoder.resolve_query_set(&times.queries, 0..TIMESTAMPS, &times.resolved, 0);
            encoder.copy_buffer_to_buffer(&times.resolved, 0, buffer, places.timestamps, 8 * u64::from(TIMESTAMPS));
        }
        let submission = context.queue.submit([encoder.finish()]);
        map(buffer, &slot.mapped);
        context.check()?;
        Ok(Sent { slot, target: target.clone(), tiles, has_pixels, submission })
    }

    /// Waits for a slice and hands its bytes to `read`.
    pub(super) fn collect<T>(
        &mut self,
        context: &Context,
        sent: Sent,
        read: impl FnOnce(&SliceData<'_>) -> T,
    ) -> Result<T, RenderError> {
        let Sent { slot, target, tiles, has_pixels, submission } = sent;
        wait_for(context, submission)?;
        if !has_been_mapped(&slot.mapped) {
            return Err(failed(context, "an image could not be read back".to_owned()));
        }
        let buffer = slot.buffer.get(context)?;
        let result = {
            let bytes = buffer.get_mapped_range(..).map_err(|e| failed(context, e.to_string()))?;
            read(&SliceData { bytes: &bytes, places: Places::of(target.size_px, has_pixels), target: &target, tiles })
        };
        buffer.unmap();
        self.free.push(slot);
        Ok(result)
    }

    /// Waits for slices under way and drops them.
    pub(super) fn abandon(
        &mut self,
        context: &Context,
        under_way: impl Iterator<Item = Sent>,
    ) -> Result<(), RenderError> {
        under_way.fold(context.check(), |came_back, sent| came_back.and_then(|()| self.collect(context, sent, |_| ())))
    }
}

/// Appends copies of the rows that the tiles touch.
fn copy_planes(
    encoder: &mut wgpu::CommandEncoder,
    target: &Target,
    tiles: &Range<usize>,
    places: Places,
    buffer: &wgpu::Buffer,
) {
    let (width, height) = target.size_px;
    let rows = target.rows_of(tiles);
    let planes = [
        (&target.planes.color, 0, row_bytes::<[f32; 4]>(width)),
        (&target.planes.depth, places.depth, row_bytes::<f32>(width)),
    ];
    for (texture, at, bytes_per_row) in planes {
        let origin = wgpu::Origin3d { x: 0, y: rows.start as u32, z: 0 };
        let source = wgpu::TexelCopyTextureInfo { texture, mip_level: 0, origin, aspect: wgpu::TextureAspect::All };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: at + bytes_per_row * rows.start as u64,
            bytes_per_row: Some(bytes_per_row as u32),
            rows_per_image: Some(height as u32),
        };
        let size = wgpu::Extent3d { width: width as u32, height: rows.len() as u32, depth_or_array_layers: 1 };
        encoder.copy_texture_to_buffer(source, wgpu::TexelCopyBufferInfo { buffer, layout }, size);
    }
}

fn failed(context: &Context, problem: String) -> RenderError {
    RenderError::Gpu { adapter: context.adapter().name.clone(), problem }
}

/// Waits until a submission is done.
///
/// # Errors
/// If the device is lost or fails.
pub(super) fn wait_for(context: &Context, submission: wgpu::SubmissionIndex) -> Result<(), RenderError> {
    let waited = context.device.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None });
    context.check()?;
    waited.map_err(|e| failed(context, e.to_string()))?;
    Ok(())
}

/// Reads a few words of a buffer, blocking.
pub(super) struct Words {
    buffer: GrowingBuffer,
}

impl Words {
    pub(super) fn new() -> Self {
        Self { buffer: GrowingBuffer::readback("words read back") }
    }

    /// Waits for all work under way, and fills `out` from word `at` of a buffer on.
    pub(super) fn read(
        &mut self,
        context: &Context,
        from: &wgpu::Buffer,
        at: u64,
        out: &mut [u32],
    ) -> Result<(), RenderError> {
        let bytes = size_of_val(out) as u64;
        self.buffer.reserve(context, bytes)?;
        let buffer = self.buffer.get(context)?;
        let mut encoder = context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(from, 4 * at, buffer, 0, bytes);
        let submission = context.queue.submit([encoder.finish()]);
        let mapped: Mapped = Arc::default();
        map(buffer, &mapped);
        wait_for(context, submission)?;
        if !has_been_mapped(&mapped) {
            return Err(failed(context, "counts could not be read back".to_owned()));
        }
        {
            let read = buffer.get_mapped_range(..bytes).map_err(|e| failed(context, e.to_string()))?;
            for (word, bytes) in out.iter_mut().zip(read.chunks_exact(4)) {
                *word = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            }
        }
        buffer.unmap();
        Ok(())
    }
}

/// Whether a mapping worked; `None` until its callback, which may run on another thread that waits for the device.
type Mapped = Arc<(Mutex<Option<bool>>, Condvar)>;

/// Maps a buffer once all submitted work is done.
fn map(buffer: &wgpu::Buffer, mapped: &Mapped) {
    *mapped.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    let mapped = mapped.clone();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        let (state, changed) = &*mapped;
        *state.lock().unwrap_or_else(PoisonError::into_inner) = Some(result.is_ok());
        changed.notify_all();
    });
}

/// Waits for a mapping, for [`CALLBACK_PATIENCE`] at most. Returns whether it worked.
fn has_been_mapped(mapped: &Mapped) -> bool {
    let (state, changed) = &**mapped;
    let state = state.lock().unwrap_or_else(PoisonError::into_inner);
    let waiting = changed.wait_timeout_while(state, CALLBACK_PATIENCE, |state| state.is_none());
    waiting.unwrap_or_else(PoisonError::into_inner).0.take() == Some(true)
}

/// Sums of counters as statistics, in the order of shaders/lib/counters.wgsl.
pub(super) fn counted(sum: [u64; COUNTERS]) -> FrameStats {
    let [steps, segments, entries, rays_hit, rays_stopped_early, out_of_order, broken_paths, drawn, outside] = sum;
    FrameStats {
        steps,
        segments,
        entries,
        rays_hit,
        rays_stopped_early,
        out_of_order,
        broken_paths,
        flow_fragments: drawn,
        flow_outside: outside,
        ..FrameStats::default()
    }
}

/// A slice that has come back.
pub(super) struct SliceData<'a> {
    bytes: &'a [u8],
    places: Places,
    target: &'a Target,
    pub(super) tiles: Range<usize>,
}

impl SliceData<'_> {
    fn word(&self, at: u64) -> u32 {
        let at = at as usize;
        u32::from_le_bytes([self.bytes[at], self.bytes[at + 1], self.bytes[at + 2], self.bytes[at + 3]])
    }

    /// Word `i` of those that came with the slice.
    pub(super) fn word_sent(&self, i: usize) -> u32 {
        self.word(self.places.words + 4 * i as u64)
    }

    /// Sums of the tiles' counters.
    pub(super) fn counts(&self) -> FrameStats {
        counted(std::array::from_fn(|i| self.counter(i)))
    }

    /// Sum of counter `i` over the tiles.
    pub(super) fn counter(&self, i: usize) -> u64 {
        let at = |tile: usize| self.places.counters + COUNTER_BYTES * tile as u64 + 4 * i as u64;
        self.tiles.clone().map(|tile| u64::from(self.word(at(tile)))).sum()
    }

    /// Milliseconds of transform, entries, walk and decoding, if there are timestamps.
    pub(super) fn milliseconds(&self, context: &Context) -> Option<[f64; 4]> {
        let period_ns = context.timestamp_period_ns()?;
        let stamp = |i: u64| {
            let at = self.places.timestamps + 8 * i;
            u64::from(self.word(at)) | u64::from(self.word(at + 4)) << 32
        };
        Some([0, 2, 4, 6].map(|i| stamp(i + 1).saturating_sub(stamp(i)) as f64 * period_ns * 1e-6))
    }

    /// Adds times to a frame's. Returns the milliseconds of the slice's entries and of its walk, if there are timestamps.
    pub(super) fn add_times_to(&self, stats: &mut FrameStats, context: &Context) -> Option<[f64; 2]> {
        let [transform, entries, walk, decode] = self.milliseconds(context)?;
        if stats.vertices_decoded_on_gpu > 0 {
            stats.ms_gpu_decode = Some(decode);
        }
        stats.ms_gpu_transform = Some(transform);
        *stats.ms_gpu_walk.get_or_insert(0.0) += walk;
        Some([entries, walk])
    }

    /// Copies the pixels of the slice's tiles. Depths are converted from local units, as shaders count them, to world units: `scale`
    /// is the world length of a local unit.
    pub(super) fn copy_pixels(&self, planes: &mut Planes, params: &Params, scale: f64) {
        let origin = params.depth_behind_eye();
        self.copy_plane(&mut planes.color, 0, |_| ());
        self.copy_plane(&mut planes.depth, self.places.depth, |depths| {
            for depth in depths {
                *depth = if *depth >= FAR { f32::INFINITY } else { ((f64::from(*depth) + origin) * scale) as f32 };
            }
        });
    }

    /// Copies a plane that begins at byte `at`, and calls `finished` on each copied piece of a row.
    fn copy_plane<P: bytemuck::Pod>(&self, plane: &mut Plane<P>, at: u64, finished: impl Fn(&mut [P])) {
        let (width, _) = self.target.size_px;
        for row in self.target.rows_of(&self.tiles) {
            let columns = self.target.columns_of(&self.tiles, row / TILE_PX);
            let from = (at + row_bytes::<P>(width) * row as u64) as usize + size_of::<P>() * columns.start;
            let pixels = &mut plane.pixels[row * width..][columns];
            let bytes = bytemuck::cast_slice_mut::<_, u8>(pixels);
            bytes.copy_from_slice(&self.bytes[from..from + bytes.len()]);
            finished(pixels);
        }
    }
}
