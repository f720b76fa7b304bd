//! Rendering: from scalars and a view to a frame.
//!
//! A [`RenderJob`] holds everything that a frame depends on; a [`Renderer`] turns it into a [`Frame`], in slices if asked to. Each
//! renderer is a [`LayerRenderer`], which draws, in a [`FrameRun`], which has the clock, the frame and all else that renderers share.
//! [`reference`](mod@reference) is the float64 ground truth; [`cpu::raycast`] the full-quality path on the CPU, [`cpu::havs`] draws all
//! or some faces, [`cpu::points`] cells one by one; [`gpu`] has all three, too. [`mod@probe`] finds the point visible at an image position.

mod adaptive;
pub mod cpu;
pub mod domain;
pub mod flow;
mod frame_run;
pub mod functions;
pub mod gpu;
mod joint;
mod layers;
mod medium;
mod optics_tables;
pub mod points;
pub mod probe;
pub mod reference;
pub mod residual;
pub mod surfaces;
#[cfg(test)]
pub(crate) mod testing;
pub mod upsampling;

use crate::camera::{Samples, View};
use crate::codec::vq::VqBlock;
use crate::field::Scalars;
pub use crate::image::Planes;
use crate::mesh::{Mesh, SourceCells};
use crate::node_table::NodeTable;
use crate::optics::OpticsKind;
use crate::stats::FrameStats;
use crate::task::{Cancel, ThreadLimit};
use crate::transfer::TransferSource;
use crate::visibility::{CellSet, Clusters, Drawn, Skip};
pub use adaptive::{BadContrast, Contrast};
use flow::FlowSplats;
pub use frame_run::{FrameRun, LayerRenderer};
use functions::FunctionScene;
pub use joint::JointScene;
pub use layers::{LayerFragment, LayerFragments};
pub use optics_tables::{OpticsTable, OpticsTables, PreparedOptics};
use points::PointScene;
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
    /// The scalars; those of active cells, or at their vertices, are finite.
    pub scalars: Scalars,
    /// The same scalars as compressed in the store, for renderers that decode them on the device.
    pub compressed: Option<CompressedScalars>,
    /// The cells to draw; all others count as outside. Holds no cell with a non-finite scalar.
    pub active: Arc<CellSet>,
    /// All cells with finite scalars, if `active` leaves out some in which nothing is visible: a renderer may traverse those as well
    /// where that is cheaper.
    pub finite: Option<Arc<CellSet>>,
    /// The faces to draw, for renderers that draw faces instead of cells.
    pub faces: Option<Arc<Drawn>>,
    /// The cells to draw, for renderers that draw cells as points.
    pub points: Option<PointScene>,
    /// The functions whose field is drawn in the active cells, which are all that are to be drawn; the scalars are their values.
    pub functions: Option<FunctionScene>,
    /// How fragments of these faces are brought into depth order.
    pub k_buffer: KBuffer,
    /// Camera and image size.
    pub view: View,
    /// Transfer function.
    pub table: Arc<NodeTable>,
    /// The transfer function, if it takes more than the scalar; `table` is then its
    /// [projection](crate::node_table::JointTable::projection), used to skip regions where nothing is visible. Segments are then
    /// integrated exactly, whatever `optics` says.
    pub joint: Option<JointScene>,
    /// Isosurfaces in the cells; `None` if there are none.
    pub surfaces: Option<SurfaceScene>,
    /// Fragments of the frame's other layers before, between and behind the cells; `None` if there are none, or if those of `flow` have
    /// not been made.
    pub fragments: Option<Arc<LayerFragments>>,
    /// The splats of flow, with the fragments of all other layers. Renderers that draw no splats themselves
    /// ([`LayerRenderer::draws_flow`]) get their fragments.
    pub flow: Option<Arc<FlowSplats>>,
    /// The surfaces around cells whose fragments are among these, for [`probe`]; renderers ignore them.
    pub shells: Vec<domain::Shell>,
    /// The source of the table, for the reference only; without it the reference integrates the table.
    pub formula: Option<Arc<TransferSource>>,
    /// How segments are integrated; the reference ignores it.
    pub optics: OpticsKind,
    /// The transfer function prepared for these optics; without it the renderer prepares it.
    pub prepared: Option<PreparedOptics>,
    /// The clusters of the mesh; without them a renderer that needs them builds its own.
    pub clusters: Option<Arc<Clusters>>,
    /// Cells or faces transformed to the view; without them a renderer on the CPU transforms them itself.
    pub placed: Option<cpu::Placed>,
    /// The contrast threshold of adaptive ray casting when the samples are all pixels; without it all rays are cast.
    pub contrast: Option<Contrast>,
    /// Falling contrasts at which previews of the image are shown; rays already cast are reused. The final frame is the same without.
    pub previews: Vec<Contrast>,
    /// The domain of contrast-adaptive sampling, if it is not the active cells.
    pub domain: Option<Arc<CellSet>>,
    /// How the image is brought to another size on the GPU that renders it, if that GPU can
    /// ([`upsampled_on_gpu`](FrameStats::upsampled_on_gpu)); otherwise the receiver of the image resizes it.
    pub enlarge: Option<Arc<Enlargement>>,
    /// What may be skipped; the image is the same.
    pub skip: Skip,
    /// Raised when the frame is no longer wanted: the job then stops within 5 ms of CPU time and stays [`Advance::Partial`].
    pub cancel: Cancel,
    /// How many threads may render at once.
    pub thread_limit: ThreadLimit,
    /// Whether the frame is for a window: if rendered on the window's GPU, it stays there as the texture of its [`Frame`].
    pub for_window: bool,
    /// Statistics of the work done before rendering (decoding); the renderer adds its own counts and times.
    pub stats: FrameStats,
}

/// How a face renderer sorts the fragments of a pixel: faces come sorted by their centroids, which is nearly the depth order of their
/// fragments, and a buffer of the `k` nearest fragments corrects most of the rest (dissertation 6.1.3), or all fragments wait for their turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KBuffer {
    /// Fragments that a pixel holds back before the nearest is composited, 2..=32.
    pub k: u8,
    /// Whether the order is exact, whatever `k` is: fragments wait until none to come can be in front of them.
    pub exact_order: bool,
}

impl KBuffer {
    /// The default: k = 8, in exact order.
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
    /// The block that contains the step.
    pub block: Arc<VqBlock>,
    /// Index of the step in the block.
    pub step: usize,
}

/// Scalars as they are compressed in codec `vq`: those of a step, or a linear mixture of two.
#[derive(Clone, Debug)]
pub struct CompressedScalars {
    /// The step, or the first of the two.
    pub step: CompressedStep,
    /// The second step and its weight, in (0, 1). Both decoded values are weighted and added in f64, then rounded to f32.
    pub toward: Option<(CompressedStep, f64)>,
    /// The cells that have the values of the blocks, if several cells of the mesh are parts of one; else the mesh's vertices or cells have
    /// them.
    pub source_cells: Option<Arc<SourceCells>>,
}

impl CompressedScalars {
    /// The step, or both.
    pub fn steps(&self) -> impl Iterator<Item = &CompressedStep> + Clone {
        [&self.step].into_iter().chain(self.toward.iter().map(|(step, _)| step))
    }

    /// Whether they are as many as `scalars`.
    pub fn fit(&self, scalars: &Scalars) -> bool {
        let count = scalars.values().len();
        let values = match (&self.source_cells, scalars) {
            (None, _) => Some(count),
            (Some(cells), Scalars::Cells(_)) => (cells.cells() == count).then_some(cells.len()),
            (Some(_), Scalars::Vertices(_)) => None,
        };
        values.is_some_and(|values| self.steps().all(|step| step.block.means().len() == values))
    }
}

/// Why a job cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// The number of scalars does not match the mesh.
    #[error("{scalars} scalars for a mesh of {expected} {of}")]
    ScalarCount {
        /// Scalars given.
        scalars: usize,
        /// Vertices or cells.
        of: &'static str,
        /// Vertices or cells of the mesh.
        expected: usize,
    },
    /// The set of active cells does not match the mesh.
    #[error("a set over {set} cells for a mesh of {cells} cells")]
    CellCount {
        /// Cells in the set's universe.
        set: usize,
        /// Cells of the mesh.
        cells: usize,
    },
    /// The number of values beside the scalar does not match the mesh.
    #[error("{given} values beside the scalar for a mesh of {expected} {of}")]
    JointValueCount {
        /// Values given.
        given: usize,
        /// Vertices or cells.
        of: &'static str,
        /// Vertices or cells of the mesh.
        expected: usize,
    },
    /// Vertices have the rows of a joint table and cells the scalars, or the other way round.
    #[error("the rows of a joint table must be of vertices if the scalars are, and of cells if these are")]
    JointAssociation,
    /// A fragment of another layer is out of range.
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
    /// Listed pixels do not match the image.
    #[error("pixels of an image of {} x {} pixels for one of {} x {}", given.0, given.1, expected.0, expected.1)]
    SampleSize {
        /// Columns and rows of the image that the pixels index.
        given: (usize, usize),
        /// Columns and rows of the image to be rendered.
        expected: (usize, usize),
    },
    /// An enlargement does not match the image.
    #[error("to be enlarged is an image of {} x {} pixels, and the job is about {} x {}", expected.0, expected.1, given.0, given.1)]
    EnlargedSize {
        /// Columns and rows of the view at fault, or of its plane of rays where the two differ.
        given: (usize, usize),
        /// Columns and rows in the enlargement: of the small image for the job's view, of the full image for the frame's.
        expected: (usize, usize),
    },
    /// Fragments of other layers do not match the image.
    #[error("fragments of other layers for {given} pixels in an image of {expected}")]
    LayerPixels {
        /// Pixels that have fragment lists.
        given: usize,
        /// Pixels of the image.
        expected: usize,
    },
    /// The source of the transfer function cannot be evaluated.
    #[error("the transfer function cannot be evaluated by its formula: {0}")]
    NoFormula(String),
    /// A face renderer has been given no faces.
    #[error("no faces were chosen for a renderer that draws faces")]
    NoFaces,
    /// A face to draw is not in the mesh.
    #[error("face {face} was to be drawn of a mesh of {faces} faces")]
    NoSuchFace {
        /// Id of the face.
        face: u32,
        /// Faces of the mesh.
        faces: usize,
    },
    /// A point renderer has been given no cells.
    #[error("no cells were chosen for a renderer that draws cells as points")]
    NoPoints,
    /// A cell to draw is not in the mesh.
    #[error("cell {cell} was to be drawn of a mesh of {cells} cells")]
    NoSuchCell {
        /// Id of the cell.
        cell: u32,
        /// Cells of the mesh.
        cells: usize,
    },
    /// A setting of points is out of range.
    #[error("{0}")]
    BadPoints(String),
    /// Splats of flow cover too many pixels.
    #[error(
        "the splats of flow cover {fragments} pixels in all, of which {most} fit in memory; choose fewer splats, a smaller size of them or of the image"
    )]
    TooMuchFlow {
        /// Pixels of splats.
        fragments: u64,
        /// How many there may be.
        most: u64,
    },
    /// The functions of a job cannot be drawn.
    #[error("the functions: {0}")]
    BadFunctions(String),
    /// The size of the k-buffer is out of range.
    #[error("a buffer of {0} fragments; choose 2 to 32")]
    BadK(u8),
    /// There is no GPU to render on.
    #[error("no GPU: {0}")]
    NoGpu(String),
    /// The job exceeds this GPU or is not supported by it; a renderer on the CPU can do it.
    #[error("{adapter} cannot render this: {problem}; the CPU can (backend cpu)")]
    BeyondGpu {
        /// Name of the adapter.
        adapter: String,
        /// The limit or feature at fault.
        problem: String,
    },
    /// The driver reset the device, or the device is gone.
    #[error("the GPU {adapter} was lost: {reason}")]
    DeviceLost {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The device reported an error.
    #[error("the GPU {adapter} failed: {problem}")]
    Gpu {
        /// Name of the adapter.
        adapter: String,
        /// The driver's message.
        problem: String,
    },
}

impl RenderJob {
    /// A job with the required parts only: exact optics, everything skipped that may be, empty statistics, never cancelled.
    pub fn new(
        mesh: Arc<Mesh>,
        scalars: impl Into<Scalars>,
        active: Arc<CellSet>,
        view: View,
        table: Arc<NodeTable>,
    ) -> Self {
        Self {
            mesh,
            scalars: scalars.into(),
            compressed: None,
            active,
            finite: None,
            faces: None,
            points: None,
            functions: None,
            k_buffer: KBuffer::default(),
            view,
            table,
            joint: None,
            surfaces: None,
            fragments: None,
            flow: None,
            shells: Vec::new(),
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

    /// Checks that the parts match.
    ///
    /// # Errors
    /// If scalars, active cells or values beside the scalar do not match the mesh, or pixels, fragments or an enlargement the image.
    pub fn check(&self) -> Result<(), RenderError> {
        let (vertices, cells) = (self.mesh.positions.local.len(), self.mesh.topology.tets.len());
        let (of, expected) = match self.scalars {
            Scalars::Vertices(_) => ("vertices", vertices),
            Scalars::Cells(_) => ("cells", cells),
        };
        if self.scalars.values().len() != expected {
            return Err(RenderError::ScalarCount { scalars: self.scalars.values().len(), of, expected });
        }
        let of_edges = self.enlarge.as_ref().map(|enlargement| &enlargement.domain);
        let sets = [Some(&self.active), self.finite.as_ref(), self.domain.as_ref(), of_edges];
        let of_shells = self.shells.iter().map(|shell| &shell.cells);
        if let Some(set) =
            sets.into_iter().flatten().chain(of_shells).map(|set| set.universe()).find(|&set| set != cells)
        {
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
        let of_layers = [self.fragments.as_ref().map(|of| of.pixels()), self.flow.as_ref().map(|of| of.pixels())];
        if let Some(given) = of_layers.into_iter().flatten().find(|given| *given != expected) {
            return Err(RenderError::LayerPixels { given, expected });
        }
        self.joint.as_ref().map_or(Ok(()), |joint| joint.check(&self.mesh, &self.scalars))
    }

    /// The job with its effective optics: exact for a joint table.
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
    /// The contrasts of adaptive sampling in falling order, 0 for all rays; empty if all rays are cast at once.
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

    /// The job that renders guides: the normal (world coordinates, towards the eye) of the nearest surface or section as colour, its
    /// number as opacity, and its depth; `None` without surfaces.
    pub(crate) fn of_guides(&self) -> Option<Self> {
        let surfaces = Some(self.surfaces.clone()?.into_guides());
        Some(Self {
            compressed: None,
            table: Arc::new(NodeTable::transparent()),
            joint: None,
            surfaces,
            fragments: None,
            flow: None,
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

/// A rendered image and its cost.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Colour, depth, normal and surface number of each pixel.
    pub planes: Planes,
    /// The frame of a window's job, on that window's GPU: `planes` are empty then.
    #[cfg(feature = "gpu")]
    pub texture: Option<gpu::FrameTexture>,
    /// Details to add to later frames of few rays; set if this frame had such details itself.
    pub details: Option<Arc<residual::Details>>,
    /// Counts and times.
    pub stats: FrameStats,
}

impl Frame {
    /// Makes all pixels transparent, keeping the memory.
    fn clear(&mut self, (width_px, height_px): (usize, usize)) {
        #[cfg(feature = "gpu")]
        {
            self.texture = None;
        }
        self.planes.clear(width_px, height_px);
    }
}

/// Progress of a renderer.
#[derive(Clone, Copy, Debug)]
pub enum Advance<'a> {
    /// Some pixels are final, the others still transparent.
    Partial(&'a Frame),
    /// All pixels have the value of the image at this contrast, and better ones follow ([`RenderJob::previews`]).
    Preview(&'a Frame, Contrast),
    /// All pixels are final.
    Done(&'a Frame),
}

impl<'a> Advance<'a> {
    /// The frame in its present state.
    pub fn frame(self) -> &'a Frame {
        match self {
            Self::Partial(frame) | Self::Preview(frame, _) | Self::Done(frame) => frame,
        }
    }
}

/// Renders one job at a time, in slices. Keeps its buffers from job to job: those that grow with the mesh or the image are allocated by
/// the first frame only.
pub trait Renderer: Send {
    /// Starts a job; a job under way is dropped.
    ///
    /// # Errors
    /// If the parts of the job do not match.
    fn begin(&mut self, job: RenderJob) -> Result<(), RenderError>;

    /// Works on the job for about `budget` (at least one tile) and returns the progress; does nothing once the job is cancelled. Without
    /// a job the last frame is done.
    ///
    /// # Errors
    /// If the device is lost or fails; the job is then dropped.
    fn advance(&mut self, budget: Duration) -> Result<Advance<'_>, RenderError>;

    /// Takes the last frame out, so that it can be kept while the next one is rendered into the memory of `replacement`, whose pixels are
    /// ignored.
    fn take_frame(&mut self, replacement: Frame) -> Frame;

    /// The last frame, for post-processing of the whole image.
    fn frame_mut(&mut self) -> &mut Frame;

    /// The longest budget for one [`Self::advance`] with which a cancelled job stops in time; unlimited for a renderer that checks the
    /// flag while it works.
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

    /// Renders a whole frame as [`Self::render_unless_cancelled`]; `previewed` is called with each preview that the job asks for.
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
