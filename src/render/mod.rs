//! From scalars and a view to a frame.
//!
//! A [`RenderJob`] is all that a frame depends on; a [`Renderer`] turns it into a [`Frame`], in slices if asked to. Each is a
//! [`LayerRenderer`], which draws, in a [`FrameRun`], which has the clock, the frame and what else all have in common.
//! [`reference`](mod@reference) is the float64 judge; [`cpu::raycast`] the full-quality path on the CPU, [`cpu::havs`]
//! draws faces, all or some of them; both are in [`gpu`] too. [`mod@probe`] says what is seen at a place in the image.

mod adaptive;
pub mod cpu;
pub mod domain;
mod frame_run;
pub mod gpu;
mod joint;
mod layers;
mod medium;
mod optics_tables;
pub mod probe;
pub mod reference;
pub mod residual;
pub mod surfaces;
#[cfg(test)]
pub(crate) mod testing;
pub mod upsampling;

use crate::camera::{Samples, View};
use crate::codec::vq::VqBlock;
pub use crate::image::Planes;
use crate::mesh::Mesh;
use crate::node_table::NodeTable;
use crate::optics::OpticsKind;
use crate::stats::FrameStats;
use crate::task::{Cancel, ThreadLimit};
use crate::transfer::TransferSource;
use crate::visibility::{CellSet, Clusters, DrawnFaces, Skip};
pub use adaptive::{BadContrast, Contrast};
pub use frame_run::{FrameRun, LayerRenderer};
pub use joint::JointScene;
pub use layers::{LayerFragment, LayerFragments};
pub use optics_tables::{OpticsTable, OpticsTables, PreparedOptics};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use surfaces::SurfaceScene;
use upsampling::Enlargement;

/// Everything that a frame depends on. Cheap to clone: the large parts are shared.
#[derive(Clone, Debug)]
pub struct RenderJob {
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// One scalar per vertex of the mesh; finite at the vertices of active cells.
    pub scalars: Arc<Vec<f32>>,
    /// The same scalars as the store has them, for renderers that decode them where they draw.
    pub compressed: Option<CompressedStep>,
    /// The cells to draw; all others count as outside. Holds no cell with a non-finite scalar.
    pub active: Arc<CellSet>,
    /// All cells with finite scalars, if `active` leaves out some in which nothing is to be seen: a renderer may go through those
    /// as well where that is cheaper.
    pub finite: Option<Arc<CellSet>>,
    /// The faces to draw, for renderers that draw faces instead of cells.
    pub faces: Option<Arc<DrawnFaces>>,
    /// How the fragments of those faces come into order.
    pub k_buffer: KBuffer,
    /// Camera and image size.
    pub view: View,
    /// Transfer function.
    pub table: Arc<NodeTable>,
    /// The transfer function, if it is of more than the scalar; `table` is then its
    /// [projection](crate::node_table::JointTable::projection), for whatever leaves out where nothing is to be seen. Segments are
    /// integrated exactly then, whatever the optics.
    pub joint: Option<JointScene>,
    /// Isosurfaces in the cells; `None` if there are none.
    pub surfaces: Option<SurfaceScene>,
    /// What other layers of the frame put before, between and behind the cells; `None` if there are none.
    pub fragments: Option<Arc<LayerFragments>>,
    /// What the table was made from, for the reference alone; without it that integrates the table.
    pub formula: Option<Arc<TransferSource>>,
    /// How segments are integrated; the reference does it in its own way.
    pub optics: OpticsKind,
    /// The transfer function prepared for these optics, if that has been done; a renderer does it itself otherwise.
    pub prepared: Option<PreparedOptics>,
    /// The clusters of the mesh, if they have been made; a renderer that needs them makes its own otherwise.
    pub clusters: Option<Arc<Clusters>>,
    /// Cells or faces in the view, if they have been placed; a renderer on the CPU does it itself otherwise.
    pub placed: Option<cpu::Placed>,
    /// The contrast that decides which rays a ray caster casts, where the samples are all pixels; all of them without.
    pub contrast: Option<Contrast>,
    /// Contrasts at which the image is shown on the way, falling, where rays that have been cast serve those that follow. The frame in the end is
    /// the same without.
    pub previews: Vec<Contrast>,
    /// The cells that decide with it, if these are not the active ones.
    pub domain: Option<Arc<CellSet>>,
    /// How the image comes to another size on the GPU that it is rendered on, if it can
    /// ([`upsampled_on_gpu`](FrameStats::upsampled_on_gpu)); elsewhere whoever has the image does that.
    pub enlarge: Option<Arc<Enlargement>>,
    /// What may be left out; the image is the same.
    pub skip: Skip,
    /// Raised by whoever does not want the frame any more: the job then stops within 5 ms of CPU time and stays
    /// [`Advance::Partial`].
    pub cancel: Cancel,
    /// How many threads may render at a time.
    pub thread_limit: ThreadLimit,
    /// Whether the frame is for a window: rendered on its GPU, it stays there as the texture of its [`Frame`].
    pub for_window: bool,
    /// What has been done for the frame so far (decoding); the renderer adds its own counts and times.
    pub stats: FrameStats,
}

/// How a renderer that draws faces brings the fragments of a pixel into order: faces come sorted by their centroids, which
/// is nearly the order of their fragments, and a buffer of the `k` nearest of them does the rest (dissertation 6.1.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KBuffer {
    /// Fragments that a pixel holds back before the nearest is composited, 2..=32.
    pub k: u8,
    /// Whether pixels for which that was not enough are resolved again by sorting all of their fragments.
    pub exact_order: bool,
}

impl KBuffer {
    /// As by default.
    pub const USUAL: Self = Self { k: 8, exact_order: true };
}

impl Default for KBuffer {
    fn default() -> Self {
        Self::USUAL
    }
}

/// A step of a series in codec `vq`.
#[derive(Clone, Debug)]
pub struct CompressedStep {
    /// The block that it is in.
    pub block: Arc<VqBlock>,
    /// Which step of the block.
    pub step: usize,
}

/// Why a job cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// Scalars and mesh do not belong together.
    #[error("{scalars} scalars for a mesh of {vertices} vertices")]
    ScalarCount {
        /// Scalars given.
        scalars: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// Active cells and mesh do not belong together.
    #[error("a set over {set} cells for a mesh of {cells} cells")]
    CellCount {
        /// Cells that the set knows of.
        set: usize,
        /// Cells of the mesh.
        cells: usize,
    },
    /// Quantities beside the scalar and mesh do not belong together.
    #[error("{given} values beside the scalar for a mesh of {expected} {of}")]
    JointValueCount {
        /// Values given.
        given: usize,
        /// Vertices or cells.
        of: &'static str,
        /// How many of them the mesh has.
        expected: usize,
    },
    /// A fragment of another layer is not one.
    #[error(
        "a fragment of pixel {pixel} at depth {depth} with light {rgba:?}: depths are finite, light is not negative, opacity at most 1"
    )]
    BadLayerFragment {
        /// Number of the pixel.
        pixel: u32,
        /// Depth given.
        depth: f64,
        /// Colour and opacity given.
        rgba: [f32; 4],
    },
    /// Listed pixels and image do not belong together.
    #[error("pixels of an image of {} x {} pixels for one of {} x {}", given.0, given.1, expected.0, expected.1)]
    SampleSize {
        /// Columns and rows of the image that they are of.
        given: (usize, usize),
        /// Those of the image to be rendered.
        expected: (usize, usize),
    },
    /// An image and how it comes to another size do not belong together.
    #[error("to be enlarged is an image of {} x {} pixels, and the job is about {} x {}", expected.0, expected.1, given.0, given.1)]
    EnlargedSize {
        /// Columns and rows of the job's view; of the rays that are cast, where these are other ones.
        given: (usize, usize),
        /// Those that are enlarged; of the full image, where the view of that is at fault.
        expected: (usize, usize),
    },
    /// Fragments of other layers and image do not belong together.
    #[error("fragments of other layers for {given} pixels in an image of {expected}")]
    LayerPixels {
        /// Pixels that they are for.
        given: usize,
        /// Pixels of the image.
        expected: usize,
    },
    /// The source of the transfer function is at fault.
    #[error("the transfer function cannot be evaluated by its formula: {0}")]
    NoFormula(String),
    /// A renderer that draws faces has been given none.
    #[error("no faces were chosen for a renderer that draws faces")]
    NoFaces,
    /// Faces to draw and mesh do not belong together.
    #[error("face {face} was to be drawn of a mesh of {faces} faces")]
    NoSuchFace {
        /// Id of the face.
        face: u32,
        /// Faces of the mesh.
        faces: usize,
    },
    /// The buffer that puts fragments in order cannot have this size.
    #[error("a buffer of {0} fragments; choose 2 to 32")]
    BadK(u8),
    /// There is no GPU to render on.
    #[error("no GPU: {0}")]
    NoGpu(String),
    /// The job is too much for this GPU, or not made for it; a renderer on the CPU can do it.
    #[error("{adapter} cannot render this: {problem}; the CPU can (backend cpu)")]
    BeyondGpu {
        /// Name of the adapter.
        adapter: String,
        /// What is too much.
        problem: String,
    },
    /// The driver reset the device, or it is gone.
    #[error("the GPU {adapter} was lost: {reason}")]
    DeviceLost {
        /// Name of the adapter.
        adapter: String,
        /// What the driver says.
        reason: String,
    },
    /// The device failed.
    #[error("the GPU {adapter} failed: {problem}")]
    Gpu {
        /// Name of the adapter.
        adapter: String,
        /// What the driver says.
        problem: String,
    },
}

impl RenderJob {
    /// A job with nothing but what every job has: exact optics, all left out that may be, nothing done before, and nobody who
    /// cancels it.
    pub fn new(
        mesh: Arc<Mesh>,
        scalars: Arc<Vec<f32>>,
        active: Arc<CellSet>,
        view: View,
        table: Arc<NodeTable>,
    ) -> Self {
        Self {
            mesh,
            scalars,
            compressed: None,
            active,
            finite: None,
            faces: None,
            k_buffer: KBuffer::default(),
            view,
            table,
            joint: None,
            surfaces: None,
            fragments: None,
            formula: None,
            optics: OpticsKind::default(),
            prepared: None,
            clusters: None,
            placed: None,
            contrast: None,
            previews: Vec::new(),
            domain: None,
            enlarge: None,
            skip: Skip::default(),
            cancel: Cancel::default(),
            thread_limit: ThreadLimit::default(),
            for_window: false,
            stats: FrameStats::default(),
        }
    }

    /// Checks that the parts belong together.
    ///
    /// # Errors
    /// If scalars, active cells or quantities beside the scalar are of another mesh, or pixels, fragments or another size of another image.
    pub fn check(&self) -> Result<(), RenderError> {
        let (vertices, cells) = (self.mesh.positions.local.len(), self.mesh.topology.tets.len());
        if self.scalars.len() != vertices {
            return Err(RenderError::ScalarCount { scalars: self.scalars.len(), vertices });
        }
        let of_edges = self.enlarge.as_ref().map(|enlargement| &enlargement.domain);
        let sets = [Some(&self.active), self.finite.as_ref(), self.domain.as_ref(), of_edges];
        if let Some(set) = sets.into_iter().flatten().map(|set| set.universe()).find(|&set| set != cells) {
            return Err(RenderError::CellCount { set, cells });
        }
        let size_px = (self.view.width_px, self.view.height_px);
        match &self.view.samples {
            Samples::Pixels(pixels) if pixels.size_px() != size_px => {
                return Err(RenderError::SampleSize { given: pixels.size_px(), expected: size_px });
            }
            _ => {}
        }
        if let Some(Enlargement { enlarging, view, .. }) = self.enlarge.as_deref() {
            let sizes = |view: &View| [(view.width_px, view.height_px), view.plane_px()];
            let given = sizes(&self.view).map(|given| (given, enlarging.small));
            let of_frame = sizes(view).map(|given| (given, enlarging.full));
            if let Some((given, expected)) = given.into_iter().chain(of_frame).find(|(given, is)| given != is) {
                return Err(RenderError::EnlargedSize { given, expected });
            }
        }
        let (columns, rows) = self.view.plane_px();
        let expected = columns * rows;
        match self.fragments.as_ref().map(|fragments| fragments.pixels()) {
            Some(given) if given != expected => return Err(RenderError::LayerPixels { given, expected }),
            _ => {}
        }
        self.joint.as_ref().map_or(Ok(()), |joint| joint.check(&self.mesh))
    }

    /// The job with the optics that it is rendered with: exact ones for a joint table.
    fn with_optics_of_joint_table(mut self) -> Self {
        if self.joint.is_some() {
            self.optics = OpticsKind::Exact;
        }
        self
    }

    /// The view in the mesh's local coordinates: eye subtracted and scaled in f64, so that the offset of the mesh in the
    /// world costs no accuracy. Depths and lengths in it are local: world lengths divided by the scale.
    pub fn local_view(&self) -> View {
        let positions = &self.mesh.positions;
        let per_scale = 1.0 / positions.scale;
        let mut view = self.view.clone();
        view.eye = (view.eye - positions.origin) * per_scale;
        view.near *= per_scale;
        if !view.perspective {
            view.half_width *= per_scale;
            view.half_height *= per_scale;
        }
        view
    }
}

impl RenderJob {
    /// The contrasts by which it is decided which rays are cast, one after the other, 0 for all rays; none if all are cast at once.
    pub(crate) fn contrasts(&self) -> Vec<f32> {
        if self.view.samples != Samples::ALL {
            return Vec::new();
        }
        let last = self.contrast.map_or(0.0, Contrast::get);
        let mut contrasts: Vec<f32> = Vec::new();
        for preview in self.previews.iter().map(|preview| preview.get()) {
            if preview > last && contrasts.last().is_none_or(|&before| preview < before) {
                contrasts.push(preview);
            }
        }
        if last > 0.0 || !contrasts.is_empty() {
            contrasts.push(last);
        }
        contrasts
    }

    /// The job whose image has the normal (world coordinates, towards the eye) of the nearest surface or section as colour, its number in place of
    /// opacity, and its depth; `None` if there is none.
    pub(crate) fn of_guides(&self) -> Option<Self> {
        let surfaces = Some(self.surfaces.clone()?.into_guides());
        Some(Self {
            compressed: None,
            table: Arc::new(NodeTable::transparent()),
            joint: None,
            surfaces,
            fragments: None,
            formula: None,
            optics: OpticsKind::Exact,
            prepared: None,
            contrast: None,
            previews: Vec::new(),
            for_window: false,
            stats: FrameStats::default(),
            ..self.clone()
        })
    }
}

/// A rendered image, and what it cost.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// What is known of each pixel.
    pub planes: Planes,
    /// The frame of a job for a window, on that window's GPU: the planes above are empty then.
    #[cfg(feature = "gpu")]
    pub texture: Option<gpu::FrameTexture>,
    /// What its rays would lack if they were few, of a frame that had such details itself.
    pub details: Option<Arc<residual::Details>>,
    /// Counts and times.
    pub stats: FrameStats,
}

impl Frame {
    /// Makes all pixels transparent, in the memory that there is.
    fn clear(&mut self, (width_px, height_px): (usize, usize)) {
        #[cfg(feature = "gpu")]
        {
            self.texture = None;
        }
        self.planes.clear(width_px, height_px);
    }
}

/// How far a renderer has come.
#[derive(Clone, Copy, Debug)]
pub enum Advance<'a> {
    /// Some pixels are final, the others still transparent.
    Partial(&'a Frame),
    /// All pixels have a value, that of the image at this contrast, and better ones follow ([`RenderJob::previews`]).
    Preview(&'a Frame, Contrast),
    /// All pixels are final.
    Done(&'a Frame),
}

impl<'a> Advance<'a> {
    /// The frame as it is.
    pub fn frame(self) -> &'a Frame {
        match self {
            Self::Partial(frame) | Self::Preview(frame, _) | Self::Done(frame) => frame,
        }
    }
}

/// Renders one job at a time, in slices. Keeps its buffers from job to job: what grows with the mesh or the image is
/// allocated by the first frame only.
pub trait Renderer: Send {
    /// Starts a job; one that was under way is dropped.
    ///
    /// # Errors
    /// If the parts of the job do not belong together.
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError>;

    /// Works on the job for about `budget` (at least one tile) and shows what there is; does nothing once the job is
    /// cancelled. Without a job the last frame is done.
    ///
    /// # Errors
    /// If the device is lost or fails; the job is then dropped.
    fn advance(&mut self, budget: Duration) -> Result<Advance<'_>, RenderError>;

    /// Takes the last frame out, so that it can be kept while the next one is rendered to the memory of `replacement`,
    /// whose pixels count for nothing.
    fn take_frame(&mut self, replacement: Frame) -> Frame;

    /// The last frame, for what is found on the whole image.
    fn frame_mut(&mut self) -> &mut Frame;

    /// The longest that [`Self::advance`] should work at once for a cancelled job to stop in time: a renderer that looks at
    /// the flag while it works needs no slices.
    fn slice(&self) -> Duration {
        Duration::MAX
    }

    /// Renders a whole frame; `None` if the job was cancelled before it was done.
    ///
    /// # Errors
    /// As [`Self::begin`] and [`Self::advance`].
    fn render_unless_cancelled(&mut self, job: RenderJob) -> Result<Option<&Frame>, RenderError> {
        self.render_with_previews(job, &mut |_, _| ())
    }

    /// The same; `previewed` sees the frame on the way, as often as the job says.
    ///
    /// # Errors
    /// As [`Self::begin`] and [`Self::advance`].
    fn render_with_previews(
        &mut self,
        job: RenderJob,
        previewed: &mut dyn FnMut(&Frame, Contrast),
    ) -> Result<Option<&Frame>, RenderError> {
        let cancel = job.cancel.clone();
        let slice = self.slice();
        self.begin(job)?;
        loop {
            match self.advance(slice)? {
                Advance::Done(_) => break,
                _ if cancel.is_cancelled() => return Ok(None),
                Advance::Preview(frame, contrast) => previewed(frame, contrast),
                Advance::Partial(_) => {}
            }
        }
        // Without a job, the last frame.
        Ok(Some(self.advance(Duration::ZERO)?.frame()))
    }

    /// Renders a whole frame of a job that nobody cancels.
    ///
    /// # Errors
    /// As [`Self::begin`] and [`Self::advance`].
    fn render(&mut self, job: RenderJob) -> Result<&Frame, RenderError> {
        self.begin(job)?;
        while let Advance::Preview(..) = self.advance(Duration::MAX)? {}
        Ok(self.advance(Duration::ZERO)?.frame())
    }
}
