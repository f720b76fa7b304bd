//! Options for data and look, shared by the commands that render.

use super::Interrupted;
use super::flow::FlowArgs;
use super::surfaces::{self, SurfaceArgs};
use crate::camera::Camera;
use crate::codec::BlockCache;
use crate::export::run::{check_memory, parse_size};
use crate::field::FieldSelector;
use crate::look::{DEFAULT_TF, Look};
use crate::mesh::Mesh;
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, FaceDetail, Pipeline, RenderMode, Representation, Sampling, Series, TetDraw};
use crate::project::Project;
use crate::render::KBuffer;
use crate::render::functions::{FunctionDomain, FunctionForm, Normalise, SheetSpacing, SheetStyle};
#[cfg(feature = "gpu")]
use crate::render::gpu::context::ContextOptions;
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::scene::{Scene, unless_cancelled};
use crate::store::Store;
use crate::task::Cancel;
use crate::transfer::{FirstLook, Lengths, OpacityKind, RangePolicy, TransferError, TransferFunction};
use crate::visibility::Skip;
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::str::FromStr;
use std::sync::Arc;

/// Options for data and look.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct SceneArgs {
    /// Field to show: NAME, NAME:mag or NAME:0 (default: the first of the store)
    #[arg(long)]
    pub(super) field: Option<FieldSelector>,
    /// Transfer function: MAP, MAP@POSITION:OPACITY,..., a file, or auto, by the values of the series (docs/transfer-functions.md)
    #[arg(long, value_name = "TF", default_value = DEFAULT_TF)]
    pub(super) tf: OsString,
    /// Scalars that the transfer function covers: series, step, LO,HI, symmetric, percentile[:P,Q], symmetric:P,Q, log or log:LO,HI
    /// (default: series; by the values with --tf auto)
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub(super) range: Option<RangePolicy>,
    /// Meaning of opacities: alpha (of a unit distance) or extinction (ParaView's unstructured mappers)
    #[arg(long, value_name = "KIND", default_value = "alpha")]
    pub(super) opacity_kind: OpacityKind,
    /// The length that opacities refer to, in world units (default: 1 % of the bounding box's diagonal)
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, value_parser = parse_length)]
    pub(super) unit_distance: Option<f64>,
    /// "pos=x,y,z focal=x,y,z up=x,y,z angle=30" or parallel=SCALE; what is left out frames the mesh. Of a project also the name of one of
    /// its cameras
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub(super) camera: Option<String>,
    /// auto (raycast, or havs for a --lod below 1), raycast, havs (faces), points (cell by cell; docs/points.md), sheets
    /// (functions at the vertices; docs/functions.md), or reference (float64, slow)
    #[arg(long, value_name = "MODE", default_value = "auto")]
    mode: RenderMode,
    /// What the field is drawn as: cells, or vertices (functions at the vertices: by --mode sheets or reference); by default what the mode
    /// draws
    #[arg(long, value_name = "WHAT")]
    representation: Option<Representation>,
    #[command(flatten)]
    pub(super) faces: FaceArgs,
    #[command(flatten)]
    pub(super) points: PointArgs,
    #[command(flatten)]
    pub(super) sheets: SheetArgs,
    #[command(flatten)]
    flow: FlowArgs,
    /// auto (the GPU if there is one), cpu, or gpu
    #[arg(long, value_name = "BACKEND", default_value = "auto")]
    pub(super) backend: Backend,
    /// Part of the name of the GPU to use, for machines with several or for one in software (default: the best)
    #[cfg(feature = "gpu")]
    #[arg(long, value_name = "NAME", default_value = "", hide_default_value = true)]
    pub(super) adapter: String,
    /// Memory for steps that are read ahead or kept, as they are in the store: a number of bytes, or of K, M or G
    #[arg(long, value_name = "SIZE", default_value = DEFAULT_BLOCK_MEMORY)]
    pub(super) block_memory: ByteCount,
    /// Integration of a ray's segments: exact, partial (partial pre-integration) or table3d (pre-integrated table); reference has its own
    #[arg(long, value_name = "OPTICS", default_value = "exact")]
    pub(super) optics: OpticsKind,
    #[command(flatten)]
    pub(super) surfaces: SurfaceArgs,
    /// What is left out where the image does not need it: all, none, all,-NAME,... or NAME,... of transparent-cells, transparent-chunks,
    /// opaque, outside, unchanged and costly-first (docs/skipping.md); the image is the same
    #[arg(long, value_name = "WHAT", default_value = "all", allow_hyphen_values = true)]
    pub(super) skip: Skip,
}

/// Options for faces and their order.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct FaceArgs {
    /// Level of detail: the share of interior faces, or of the fragments of points, that is drawn, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "1", allow_hyphen_values = true, value_parser = parse_lod)]
    lod: f64,
    /// Which faces havs draws first: error (by chance, more of those that would be missed), random, global (those that change
    /// most over time), plain (the same by the dissertation's formula), or regular, logarithmic, greedy (strata of scalars in
    /// each interval; :N intervals, 6 if not said). Of points, error and random are by chance, all alike; global and plain make half of
    /// them likelier by this measure
    #[arg(long, value_name = "SAMPLING", default_value = "error")]
    sampling: Sampling,
    /// Fragments that havs keeps in order at a time with --inexact-order, 2 to 32
    #[arg(long, value_name = "K", default_value_t = KBuffer::default().k, value_parser = clap::value_parser!(u8).range(2..=32))]
    k: u8,
    /// Order fragments by a buffer of --k (havs), or fragments in the order of centroids (points)
    #[arg(long)]
    inexact_order: bool,
}

impl FaceArgs {
    pub(super) fn detail(&self) -> FaceDetail {
        let k_buffer = KBuffer { k: self.k, exact_order: !self.inexact_order };
        FaceDetail { lod: self.lod, sampling: self.sampling, k_buffer }
    }
}

/// Options for cells as points.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PointArgs {
    /// Shape of cells drawn as points: square, circle, ellipse or exact (default); points without cells have no exact one (default: circle)
    #[arg(long, value_name = "SHAPE")]
    footprint: Option<Footprint>,
    /// Light of points on a ray: own (each cell by itself) or gap (between successive points, as in the dissertation)
    #[arg(long, value_name = "HOW", default_value = "own")]
    compositing: Compositing,
    /// Scale of square, circle and ellipse, above 0, at most 8
    #[arg(long, value_name = "R", default_value = "1", allow_hyphen_values = true, value_parser = parse_radius)]
    point_radius: f64,
}

/// Options for functions.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct SheetArgs {
    /// Number of sheets through the whole mesh, evenly (--mode sheets)
    #[arg(long, value_name = "N", conflicts_with = "sampling_error", value_parser = clap::value_parser!(u32).range(2..=i64::from(SheetStyle::MOST_SHEETS)))]
    sheets: Option<u32>,
    /// Error of the scalar between two sheets, a share of the field's range: sheets are closer where the field changes more (default: 0.001)
    #[arg(long, value_name = "E", allow_hyphen_values = true, value_parser = parse_sampling_error)]
    sampling_error: Option<f64>,
    /// Where a field of functions is: mesh, box (of their centres, wherever one reaches) or coverage (where they are dense) (default: mesh;
    /// coverage of points without cells)
    #[arg(long, value_name = "DOMAIN")]
    domain: Option<FunctionDomain>,
    /// What the sum of values of functions is divided by: sum (of their weights) or eq20 (that or 1, if more, as in the paper; draws values
    /// that are not there)
    #[arg(long, value_name = "BY", default_value = "sum")]
    normalise: Normalise,
}

impl SheetArgs {
    pub(super) fn style(&self) -> SheetStyle {
        let count = self.sheets.map(SheetSpacing::Count);
        let spacing = count.or(self.sampling_error.map(SheetSpacing::Error));
        spacing.map_or_else(SheetStyle::default, |spacing| SheetStyle { spacing })
    }

    fn form(&self) -> FunctionForm {
        FunctionForm { domain: self.domain, normalise: self.normalise }
    }
}

impl SceneArgs {
    /// How cells are drawn as points.
    fn point_style(&self) -> PointStyle {
        let PointArgs { footprint, compositing, point_radius } = self.points;
        let FaceDetail { lod, k_buffer, .. } = self.faces.detail();
        let (footprint, exact_order) = (footprint.unwrap_or_default(), k_buffer.exact_order);
        PointStyle { footprint, compositing, radius: point_radius, lod, exact_order, ..PointStyle::EXACT }
    }

    /// The same, for a mesh.
    ///
    /// # Errors
    /// If it is of points and the footprint is that of cells.
    fn point_style_of(&self, mesh: &Mesh) -> anyhow::Result<PointStyle> {
        let style = self.point_style();
        if mesh.is_cloud() && self.points.footprint == Some(Footprint::Exact) {
            bail!(
                "--footprint exact is the shape of a cell, and the series is of points alone; choose square, circle or ellipse"
            );
        }
        let footprint = self.points.footprint.unwrap_or(PointStyle::usual_of(mesh).footprint);
        Ok(PointStyle { footprint, ..style })
    }

    /// The mode, by the representation where it is left to that.
    pub(super) fn mode(&self) -> RenderMode {
        // What does not fit is refused by `check_mode`.
        self.mode.of(self.representation).unwrap_or(self.mode)
    }

    /// The representation that was asked for.
    pub(super) fn representation(&self) -> Option<Representation> {
        self.representation
    }

    /// What the reference draws.
    fn judged(&self) -> Representation {
        self.representation.filter(|_| self.mode == RenderMode::Reference).unwrap_or_default()
    }

    /// How cells are drawn.
    pub(super) fn draw(&self) -> TetDraw {
        let draw = TetDraw::chosen(self.mode(), self.faces.detail(), self.point_style());
        draw.of(self.judged()).with_sheets(self.sheets.style())
    }

    /// Refuses options of other modes than the chosen one.
    fn check_mode(&self, mesh: &Mesh) -> anyhow::Result<()> {
        let (draw, faces, style) = (self.draw(), self.faces.detail(), self.point_style_of(mesh)?);
        if let Err(problem) = self.mode.of(self.representation) {
            bail!("--mode {} {problem}", self.mode);
        }
        if self.mode() != RenderMode::Sheets && (self.sheets.sheets.is_some() || self.sheets.sampling_error.is_some()) {
            bail!("--sheets and --sampling-error are about functions on sheets; add --mode sheets");
        }
        if !draw.drawn_by().is_of_functions() && !self.sheets.form().is_usual() {
            bail!("--domain and --normalise are about functions; add --representation vertices");
        }
        if self.mode() == RenderMode::Sheets && self.backend == Backend::Gpu {
            bail!("functions on sheets are rendered on the CPU only; leave --backend gpu out");
        }
        if let TetDraw::Points(_) = draw {
            if let Sampling::Local(_) = faces.sampling {
                bail!("--sampling {} is about faces; points have error, random, global and plain", faces.sampling);
            }
            if faces.k_buffer.k != KBuffer::USUAL.k {
                bail!("--k is about faces; leave it out, or choose --mode havs");
            }
            if style.footprint == Footprint::Exact && style.radius != 1.0 {
                bail!("--point-radius {} scales square, circle and ellipse; choose one with --footprint", style.radius);
            }
            return Ok(());
        }
        if self.mode == RenderMode::Reference && self.backend == Backend::Gpu {
            bail!("--mode reference is rendered on the CPU only; leave --backend gpu out");
        }
        if !matches!(draw, TetDraw::Faces(_)) && faces != FaceDetail::default() {
            bail!("--lod, --sampling, --k and --inexact-order are about faces; add --mode havs");
        }
        let PointStyle { footprint, compositing, radius, .. } = style;
        let usual = PointStyle::usual_of(mesh);
        if (footprint, compositing, radius) != (usual.footprint, usual.compositing, usual.radius) {
            bail!("--footprint, --compositing and --point-radius are about points; add --mode points");
        }
        Ok(())
    }
}

/// Size of images.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct SizeArgs {
    /// Image size in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x768")]
    pub(super) size: SizePx,
}

/// [`Series::BLOCK_BYTES`] as an option's text.
const DEFAULT_BLOCK_MEMORY: &str = "256M";

/// A number of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ByteCount(pub(super) u64);

impl FromStr for ByteCount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = text.trim_end_matches(['K', 'k', 'M', 'm', 'G', 'g']);
        let shift = match text[number.len()..].to_ascii_uppercase().as_str() {
            "" => Some(0),
            "K" => Some(10),
            "M" => Some(20),
            "G" => Some(30),
            _ => None,
        };
        let bytes = shift.and_then(|shift| number.parse::<u64>().ok()?.checked_mul(1 << shift));
        bytes.map(Self).ok_or_else(|| "write a number of bytes, or of K, M or G, as in 256M".to_owned())
    }
}

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SizePx(pub(super) usize, pub(super) usize);

impl FromStr for SizePx {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        parse_size(text).map(|(width, height)| Self(width, height))
    }
}

impl SizePx {
    /// Refuses this many images if they exceed the free memory.
    pub(super) fn check_memory(self, frames: usize) -> anyhow::Result<()> {
        check_memory((self.0, self.1), frames).map_err(anyhow::Error::msg)
    }
}

fn parse_lod(text: &str) -> Result<f64, String> {
    let is_share = |lod: &f64| (0.0..=1.0).contains(lod);
    text.parse().ok().filter(is_share).ok_or_else(|| "a level of detail is a number from 0 to 1".to_owned())
}

fn parse_radius(text: &str) -> Result<f64, String> {
    let most = PointStyle::MOST_RADIUS;
    let is_within = |radius: &f64| *radius > 0.0 && *radius <= most;
    text.parse().ok().filter(is_within).ok_or_else(|| format!("a point radius is above 0 and at most {most}"))
}

fn parse_sampling_error(text: &str) -> Result<f64, String> {
    let style = |error| SheetStyle { spacing: SheetSpacing::Error(error) };
    let error: f64 = text.parse().map_err(|_| "an error is a number, a share of the field's range".to_owned())?;
    style(error).check().map(|()| error)
}

fn parse_length(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|l: &f64| *l > 0.0 && l.is_finite())
        .ok_or_else(|| "a length is a positive number".to_owned())
}

/// The GPU of a scene.
#[derive(Debug, Default)]
pub(super) struct GpuReport {
    /// Name, once a GPU was needed.
    pub(super) adapter: Option<String>,
    /// Why the last frame meant for the GPU was rendered elsewhere.
    pub(super) problem: Option<String>,
}

impl SceneArgs {
    /// The look of a series, in images of this size.
    #[cfg(feature = "gui")]
    pub(super) fn look(&self, series: &Series, size: SizePx) -> anyhow::Result<Look> {
        let first = self.first_look(series, &Cancel::new());
        let (tf, range) = match first {
            Some(first) => (Ok(first.tf), Some(first.range)),
            None => (TransferFunction::parse(&self.tf), None),
        };
        self.look_with(tf, range, series, size)
    }

    /// The automatic look of the series, if no transfer function is named.
    fn first_look(&self, series: &Series, cancel: &Cancel) -> Option<FirstLook> {
        (self.tf == DEFAULT_TF).then(|| series.first_look(self.range, cancel))
    }

    /// The look with the options' transfer function, and this range if they name none.
    fn look_with(
        &self,
        tf: Result<TransferFunction, TransferError>,
        range: Option<RangePolicy>,
        series: &Series,
        size: SizePx,
    ) -> anyhow::Result<Look> {
        let tf = tf.with_context(|| format!("--tf '{}'", self.tf.display()))?;
        let faces = self.faces.detail();
        self.check_mode(series.mesh())?;
        // A vector field is shown by its magnitude; for surfaces the user must choose.
        if let Some(FieldSelector { name, component: None }) = &self.field
            && self.surfaces.has_isosurfaces()
            && series.field().name != *name
        {
            bail!("--iso is of a scalar, and {name} is a field of vectors; add --field {name}:mag, or {name}:0");
        }
        let look = Look::default_for(series, tf)?;
        let framing = look.camera.fit_to_aspect(size.0, size.1);
        let camera = match &self.camera {
            Some(text) => Camera::parse(text, &framing).with_context(|| format!("--camera '{text}'"))?,
            None => framing,
        };
        Ok(Look {
            camera,
            range: self.range.or(range).unwrap_or_default(),
            opacity_kind: self.opacity_kind,
            lengths: Lengths {
                unit_distance: self.unit_distance.unwrap_or(look.lengths.unit_distance),
                ..look.lengths
            },
            mode: self.mode().on(series.mesh()),
            representation: self.judged(),
            faces,
            // Its level of detail is that of the faces.
            points: PointStyle { lod: 1.0, ..self.point_style_of(series.mesh())? },
            sheets: self.sheets.style(),
            functions: self.sheets.form(),
            backend: self.backend,
            optics: self.optics,
            surfaces: self.surfaces.look(series, &look.tf, look.lengths, self.flow.is_some())?,
            flow: self.flow.look(series, &look.tf, look.lengths)?,
            skip: self.skip,
            ..look
        })
    }

    /// Whether there is flow.
    pub(super) fn has_flow(&self) -> bool {
        self.flow.is_some()
    }

    /// Refuses the name of a GPU if none renders. (A window is painted on one even then.)
    pub(super) fn check_adapter(&self) -> anyhow::Result<()> {
        #[cfg(feature = "gpu")]
        for (on_cpu, option) in
            [(self.backend == Backend::Cpu, "--backend cpu"), (self.mode == RenderMode::Reference, "--mode reference")]
        {
            if on_cpu && !self.adapter.is_empty() {
                bail!("--adapter names a GPU, which {option} does not use; leave one of the two out");
            }
        }
        Ok(())
    }

    /// The chosen field of a store.
    pub(super) fn series(&self, store: &Store) -> anyhow::Result<Arc<Series>> {
        let blocks = Arc::new(BlockCache::new(self.block_memory.0));
        Ok(Arc::new(Series::open_with(store, self.field.as_ref(), blocks)?))
    }

    /// Options of the GPU.
    #[cfg(feature = "gpu")]
    pub(super) fn gpu(&self) -> ContextOptions {
        ContextOptions { adapter: self.adapter.clone(), ..Default::default() }
    }

    /// The scene of the options, or of the project's timeline, rendered on the chosen GPU. Raising `cancel` ends long operations, then and
    /// later.
    pub(super) fn open(
        &self,
        store: &Store,
        size: SizePx,
        project: Option<&Arc<Project>>,
        cancel: &Cancel,
    ) -> anyhow::Result<Scene> {
        let mut pipeline = Pipeline::new(self.series(store)?);
        let (tf, range, tf_text) = match self.first_look(pipeline.series(), cancel) {
            Some(first) => (Ok(first.tf), Some(first.range), first.text),
            None => {
                let text = self.tf.clone();
                let tf = unless_cancelled(cancel, move || TransferFunction::parse(&text)).ok_or(Interrupted)?;
                (tf, None, self.tf.to_string_lossy().into_owned())
            }
        };
        let look = self.look_with(tf, range, pipeline.series(), size)?;
        #[cfg(feature = "gpu")]
        pipeline.choose_gpu(self.gpu());
        if let Err(problem) = pipeline.check_backend(self.backend) {
            bail!("{problem}; --backend cpu renders without one");
        }
        let mut scene = Scene::new(pipeline, look, cancel);
        (scene.tf_text, scene.size_px) = (tf_text, (size.0, size.1));
        if let Some(project) = project {
            scene.set_project(project.clone());
        }
        surfaces::check(&scene.look.surfaces, project.map(|project| &**project), scene.pipeline.series())?;
        // Invalid options fail here, before rendering.
        scene.check()?;
        Ok(scene)
    }

    /// Another pipeline of the same series, with the same options.
    pub(super) fn new_pipeline(&self, series: &Arc<Series>) -> Pipeline {
        #[cfg_attr(not(feature = "gpu"), expect(unused_mut))]
        let mut pipeline = Pipeline::new(series.clone());
        #[cfg(feature = "gpu")]
        pipeline.choose_gpu(self.gpu());
        pipeline
    }
}

/// The GPU used so far.
pub(super) fn gpu_report(pipeline: &Pipeline) -> GpuReport {
    #[cfg(feature = "gpu")]
    return GpuReport {
        adapter: pipeline.gpu().map(|gpu| gpu.adapter().to_string()),
        problem: pipeline.gpu_problem().map(ToString::to_string),
    };
    #[cfg(not(feature = "gpu"))]
    {
        let _ = pipeline;
        GpuReport::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_of_memory_have_units() {
        let bytes = |text: &str| text.parse::<ByteCount>().map(|b| b.0).ok();
        assert_eq!(
            [bytes("0"), bytes("3k"), bytes("64M"), bytes("2G")],
            [Some(0), Some(3072), Some(64 << 20), Some(2 << 30)]
        );
        assert_eq!(DEFAULT_BLOCK_MEMORY.parse(), Ok(ByteCount(Series::BLOCK_BYTES)));
        assert_eq!([bytes(""), bytes("M"), bytes("1KK"), bytes("-1"), bytes("1e3"), bytes("99999999999G")], [None; 6]);
    }
}
