//! The options that say what is seen and how, shared by the commands that render.

use super::Interrupted;
use super::progress::unless_interrupted;
use super::render::sampling_of;
use super::surfaces::{self, SurfaceArgs};
use crate::camera::Camera;
use crate::codec::BlockCache;
use crate::export::still::FrameAttributes;
use crate::field::FieldSelector;
use crate::node_table::{NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::pipeline::{
    Backend, FaceDetail, FrameRequest, FrameTime, Pipeline, RenderMode, SampleSet, Sampling, Series, TetDraw,
    Upsampling,
};
use crate::project::{Animation, Project};
use crate::render::KBuffer;
#[cfg(feature = "gpu")]
use crate::render::gpu::context::ContextOptions;
use crate::store::Store;
use crate::task::Cancel;
use crate::transfer::{
    ColorMap, ColorPoint, FirstLook, Lengths, MappedRange, OpacityKind, RangePolicy, TransferError, TransferFunction,
    TransferSource,
};
use crate::ui::{DEFAULT_TF, Look, mapped_range};
use crate::visibility::Skip;
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::str::FromStr;
use std::sync::Arc;

/// What is seen and how.
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
    /// "pos=x,y,z focal=x,y,z up=x,y,z angle=30" or parallel=SCALE; what is left out frames the mesh
    #[arg(long, value_name = "CAMERA", allow_hyphen_values = true)]
    pub(super) camera: Option<String>,
    /// auto (raycast, or havs for a --lod below 1), raycast, havs (faces through a k-buffer), or reference (float64, slow)
    #[arg(long, value_name = "MODE", default_value = "auto")]
    pub(super) mode: RenderMode,
    #[command(flatten)]
    pub(super) faces: FaceArgs,
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
    /// What is left out where the image does not need it: all, none, all,-NAME,... or NAME,... of clear-cells, clear-chunks,
    /// opaque, outside, unchanged and costly-first (docs/skipping.md); the image is the same
    #[arg(long, value_name = "WHAT", default_value = "all", allow_hyphen_values = true)]
    pub(super) skip: Skip,
}

/// Which faces are drawn, and how they come into order.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct FaceArgs {
    /// Level of detail: the share of interior faces that is drawn, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "1", allow_hyphen_values = true, value_parser = parse_lod)]
    lod: f64,
    /// Which faces havs draws first: error (by chance, more of those that would be missed), random, global (those that change
    /// most over time), plain (the same by the dissertation's formula), or regular, logarithmic, greedy (strata of scalars in
    /// each interval; :N intervals, 6 if not said)
    #[arg(long, value_name = "SAMPLING", default_value = "error")]
    sampling: Sampling,
    /// Fragments that havs keeps in order at a time, 2 to 32
    #[arg(long, value_name = "K", default_value_t = KBuffer::default().k, value_parser = clap::value_parser!(u8).range(2..=32))]
    k: u8,
    /// Leave pixels whose fragments came out of order as they are (havs)
    #[arg(long)]
    inexact_order: bool,
}

impl Default for FaceArgs {
    fn default() -> Self {
        let FaceDetail { lod, sampling, k_buffer: KBuffer { k, exact_order } } = FaceDetail::default();
        Self { lod, sampling, k, inexact_order: !exact_order }
    }
}

impl FaceArgs {
    pub(super) fn detail(&self) -> FaceDetail {
        let k_buffer = KBuffer { k: self.k, exact_order: !self.inexact_order };
        FaceDetail { lod: self.lod, sampling: self.sampling, k_buffer }
    }
}

/// How large its images are.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct SizeArgs {
    /// Image size in pixels
    #[arg(long, value_name = "WxH", default_value = "1024x768")]
    pub(super) size: SizePx,
}

/// [`Series::BLOCK_BYTES`] as a user writes it.
const DEFAULT_BLOCK_MEMORY: &str = "256M";

/// A number of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ByteCount(pub(super) u64);

impl Default for ByteCount {
    fn default() -> Self {
        Self(Series::BLOCK_BYTES)
    }
}

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

/// Largest width or height: 32768 squared pixels of 16 bytes are 16 GiB.
const SIZE_MAX_PX: usize = 32_768;

impl FromStr for SizePx {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        match parts {
            Some((w, h)) if (1..=SIZE_MAX_PX).contains(&w) && (1..=SIZE_MAX_PX).contains(&h) => Ok(Self(w, h)),
            Some(_) => Err(format!("width and height must be 1 to {SIZE_MAX_PX}")),
            None => Err("write WIDTHxHEIGHT, as in 1024x768".to_owned()),
        }
    }
}

fn parse_lod(text: &str) -> Result<f64, String> {
    let is_share = |lod: &f64| (0.0..=1.0).contains(lod);
    text.parse().ok().filter(is_share).ok_or_else(|| "a level of detail is a number from 0 to 1".to_owned())
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
    /// Its name, once it was needed.
    pub(super) adapter: Option<String>,
    /// Why the last frame that it should have rendered was rendered elsewhere.
    pub(super) problem: Option<String>,
}

/// A series, ready to be asked for frames.
pub(super) struct Scene {
    pub(super) pipeline: Pipeline,
    /// What all its frames have in common.
    pub(super) look: Look,
    /// The transfer function as the user wrote it.
    tf_text: String,
    size: SizePx,
    #[cfg(feature = "gpu")]
    pub(super) gpu: ContextOptions,
    /// Those of the last request.
    colors: Option<Colors>,
    /// Whether frames have planes of normals and numbers of surfaces.
    pub(super) guides: bool,
    /// The pixels that rays are cast for.
    pub(super) samples: SampleSet,
    /// The image that is rendered in place of each frame, if there is one.
    pub(super) upsampling: Option<Upsampling>,
    /// What a project says, in place of the look.
    animation: Option<Animation>,
    /// Ends what takes long.
    cancel: Cancel,
}

/// Colours and extinctions of a request.
struct Colors {
    /// What they are for; `None` if the field has no finite value.
    range: Option<MappedRange>,
    table: Arc<NodeTable>,
    /// What the table was made from.
    formula: Option<Arc<TransferSource>>,
    /// Whether they are those of ensembles, not of the look.
    of_project: bool,
}

impl SceneArgs {
    /// What frames of a series look like, in images of this size.
    #[cfg(feature = "gui")]
    pub(super) fn look(&self, series: &Series, size: SizePx) -> anyhow::Result<Look> {
        let first = self.first_look(series, &Cancel::new());
        let (tf, range) = match first {
            Some(first) => (Ok(first.tf), Some(first.range)),
            None => (TransferFunction::parse(&self.tf), None),
        };
        self.look_with(tf, range, series, size)
    }

    /// What the values of the series suggest, if no transfer function is named.
    fn first_look(&self, series: &Series, cancel: &Cancel) -> Option<FirstLook> {
        (self.tf == DEFAULT_TF).then(|| series.first_look(self.range, cancel))
    }

    /// The same with the transfer function that the options name, and this range if they name none.
    fn look_with(
        &self,
        tf: Result<TransferFunction, TransferError>,
        range: Option<RangePolicy>,
        series: &Series,
        size: SizePx,
    ) -> anyhow::Result<Look> {
        let tf = tf.with_context(|| format!("--tf '{}'", self.tf.display()))?;
        let faces = self.faces.detail();
        let draws_faces = matches!(TetDraw::chosen(self.mode, faces), TetDraw::Faces(_));
        if self.mode == RenderMode::Reference && self.backend == Backend::Gpu {
            bail!("--mode reference is rendered on the CPU only; leave --backend gpu out");
        }
        if !draws_faces && faces != FaceDetail::default() {
            bail!("--lod, --sampling, --k and --inexact-order are about faces; add --mode havs");
        }
        // A field of vectors is shown by its magnitude; a surface asks for more thought.
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
            mode: self.mode,
            faces,
            backend: self.backend,
            optics: self.optics,
            surfaces: self.surfaces.look(series, &look.tf, look.lengths)?,
            skip: self.skip,
            ..look
        })
    }

    /// Refuses a GPU by name where none renders. (A window is painted on one all the same.)
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

    /// The field of a store.
    pub(super) fn series(&self, store: &Store) -> anyhow::Result<Arc<Series>> {
        let blocks = Arc::new(BlockCache::new(self.block_memory.0));
        Ok(Arc::new(Series::open_with(store, self.field.as_ref(), blocks)?))
    }

    /// The GPU.
    #[cfg(feature = "gpu")]
    pub(super) fn gpu(&self) -> ContextOptions {
        ContextOptions { adapter: self.adapter.clone(), ..Default::default() }
    }
}

impl Scene {
    /// The scene of the options, or with a project that of the project's timeline. What takes long, then and later, ends when
    /// `cancel` is raised.
    pub(super) fn open(
        store: &Store,
        args: &SceneArgs,
        size: SizePx,
        project: Option<&Arc<Project>>,
        cancel: &Cancel,
    ) -> anyhow::Result<Self> {
        let mut pipeline = Pipeline::new(args.series(store)?);
        let (tf, range, tf_text) = match args.first_look(pipeline.series(), cancel) {
            Some(first) => (Ok(first.tf), Some(first.range), first.text),
            None => {
                let text = args.tf.clone();
                let tf = unless_interrupted(cancel, move || TransferFunction::parse(&text))?;
                (tf, None, args.tf.to_string_lossy().into_owned())
            }
        };
        let look = args.look_with(tf, range, pipeline.series(), size)?;
        #[cfg(feature = "gpu")]
        pipeline.choose_gpu(args.gpu());
        if let Err(problem) = pipeline.check_backend(args.backend) {
            bail!("{problem}; --backend cpu renders without one");
        }
        let mut scene = Self {
            pipeline,
            look,
            tf_text,
            size,
            #[cfg(feature = "gpu")]
            gpu: args.gpu(),
            colors: None,
            guides: false,
            samples: SampleSet::All,
            upsampling: None,
            animation: None,
            cancel: cancel.clone(),
        };
        let Look { opacity_kind, lengths, .. } = scene.look;
        scene.animation = project
            .map(|project| Animation::new(project.clone(), scene.pipeline.series().clone(), opacity_kind, lengths));
        surfaces::check(&scene.look.surfaces, project.map(|project| &**project), scene.pipeline.series())?;
        // What cannot work fails here, before anything is rendered.
        if !scene.pipeline.times().is_empty() {
            for at in project.map(|project| project.timeline.places()).unwrap_or_default() {
                scene.request_at(0.into(), at)?;
            }
            scene.request(0)?;
            scene.look.camera.view(size.0, size.1)?;
        }
        Ok(scene)
    }

    /// Another pipeline of the same series, set up alike.
    pub(super) fn new_pipeline(&self) -> Pipeline {
        #[cfg_attr(not(feature = "gpu"), expect(unused_mut))]
        let mut pipeline = Pipeline::new(self.pipeline.series().clone());
        #[cfg(feature = "gpu")]
        pipeline.choose_gpu(self.gpu.clone());
        pipeline
    }

    /// The request for a step, or for a moment between two.
    pub(super) fn request(&mut self, time: impl Into<FrameTime>) -> anyhow::Result<FrameRequest> {
        let time = time.into();
        self.request_at(time, time.time(self.pipeline.times()))
    }

    /// The request for a moment of the series at a time of the project's timeline.
    pub(super) fn request_at(&mut self, moment: FrameTime, at: f64) -> anyhow::Result<FrameRequest> {
        let cancel = &self.cancel;
        let said = self.animation.as_mut().map(|animation| animation.at(moment, at, cancel));
        if cancel.is_cancelled() {
            return Err(Interrupted.into());
        }
        let said = said.transpose()?.unwrap_or_default();
        let (table, formula) = match said.table {
            Some(table) => (self.keep(table), said.formula),
            None => {
                let (table, formula) = self.table(moment)?;
                (table.into(), formula)
            }
        };
        let Look { camera, mode, faces, optics, backend, skip, .. } = self.look;
        let camera = said.camera.unwrap_or(camera);
        let draw = TetDraw::chosen(mode, FaceDetail { lod: said.lod.unwrap_or(faces.lod), ..faces });
        let request = FrameRequest::new(moment, camera, table, (self.size.0, self.size.1));
        let optics = said.optics.unwrap_or(optics);
        let request = request.with_tets(|tets| {
            (tets.draw, tets.optics, tets.formula) = (draw, optics, formula);
            tets.show(&self.look.surfaces.at(said.surfaces));
        });
        let has_surfaces = request.tets().is_some_and(|tets| !tets.surfaces.is_empty() || !tets.cuts.is_empty());
        let (guides, samples, upsampling) = (self.guides && has_surfaces, self.samples.clone(), self.upsampling);
        Ok(FrameRequest { backend, skip, guides, samples, upsampling, ..request })
    }

    /// A table of the timeline, over the range of the series: what a legend shows.
    fn keep(&mut self, table: TransferTable) -> TransferTable {
        let range = mapped_range(self.pipeline.series(), &RangePolicy::Series, 0.into()).ok();
        let over_scalars = table.over_scalars().clone();
        self.colors = Some(Colors { range, table: over_scalars, formula: None, of_project: true });
        table
    }

    /// What ends that which takes long.
    pub(super) fn cancel(&self) -> &Cancel {
        &self.cancel
    }

    /// What is known of the GPU by now.
    pub(super) fn gpu_report(&self) -> GpuReport {
        #[cfg(feature = "gpu")]
        return GpuReport {
            adapter: self.pipeline.gpu().map(|gpu| gpu.adapter().to_string()),
            problem: self.pipeline.gpu_problem().map(ToString::to_string),
        };
        #[cfg(not(feature = "gpu"))]
        GpuReport::default()
    }

    /// What the colours of the last request mean.
    pub(super) fn color_scale(&self) -> Option<(ColorMap, MappedRange)> {
        let Colors { range, table, of_project, .. } = self.colors.as_ref()?;
        let range = (*range)?;
        let map = if *of_project { colors_of(table, &range)? } else { self.look.tf.color_map().clone() };
        Some((map, range))
    }

    /// What gives the last request its colours, in words.
    pub(super) fn transfer_function(&self) -> String {
        let of_project = self.colors.as_ref().is_some_and(|colors| colors.of_project);
        match self.animation.as_ref().filter(|_| of_project).map(|animation| animation.project().ensembles.len()) {
            Some(1) => "an ensemble".to_owned(),
            Some(count) => format!("{count} ensembles on a timeline"),
            None => self.tf_text.clone(),
        }
    }

    /// What the frame of the last `request` shows, as frame number `frame` of the run.
    pub(super) fn attributes(&self, request: &FrameRequest, frame: usize) -> FrameAttributes {
        let field = self.pipeline.field();
        FrameAttributes {
            time: request.time.time(self.pipeline.times()),
            step: request.time.step(),
            frame,
            field: field.name.clone(),
            units: field.units.clone(),
            camera: request.camera.to_string(),
            transfer_function: self.transfer_function(),
            range: self.colors.as_ref().and_then(|colors| colors.range),
            opacity_kind: self.look.opacity_kind,
            unit_distance: self.look.lengths.unit_distance,
            software: FrameAttributes::SOFTWARE.to_owned(),
            extras: sampling_of(request),
        }
    }

    /// The table for a moment; made anew only if the range has changed.
    fn table(&mut self, time: FrameTime) -> anyhow::Result<(Arc<NodeTable>, Option<Arc<TransferSource>>)> {
        let field = self.pipeline.field();
        let range = mapped_range(self.pipeline.series(), &self.look.range, time)
            .map_err(|e| anyhow::anyhow!("field {}: {e}", field.name))?;
        if let Some(last) = &self.colors
            && (last.range, last.of_project) == (Some(range), false)
        {
            return Ok((last.table.clone(), last.formula.clone()));
        }
        let formula = Some(Arc::new(self.look.source(&range)));
        let look = self.look.clone();
        let table = Arc::new(unless_interrupted(&self.cancel, move || look.table(&range))??);
        self.colors =
            Some(Colors { range: Some(range), table: table.clone(), formula: formula.clone(), of_project: false });
        Ok((table, formula))
    }
}

/// The colours of a table over a linear range.
fn colors_of(table: &NodeTable, range: &MappedRange) -> Option<ColorMap> {
    let inside = table.nodes().iter().filter(|node| (range.lo()..=range.hi()).contains(&node.scalar));
    let ends = [range.lo(), range.hi()].map(|scalar| table.eval(scalar));
    let all = std::iter::once(&ends[0]).chain(inside).chain([&ends[1]]);
    let points = all.map(|node| ColorPoint { position: node.scalar, rgb: node.rgb }).collect();
    ColorMap::new("ensemble", points, None).ok()
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
        assert_eq!(DEFAULT_BLOCK_MEMORY.parse(), Ok(ByteCount::default()));
        assert_eq!([bytes(""), bytes("M"), bytes("1KK"), bytes("-1"), bytes("1e3"), bytes("99999999999G")], [None; 6]);
    }
}
