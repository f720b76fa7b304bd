//! [`Look`]: the settings that frames of a field share, and the requests for them.

use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::node_table::{NodeTable, NodeTableError, TransferTable};
use crate::optics::OpticsKind;
use crate::pipeline::{
    Backend, ColorsBeside, FaceDetail, FlowLayer, FrameRequest, FrameTime, KeyedSurfaces, Layer, RenderMode,
    Representation, Series, SurfaceLook, TetDraw,
};
use crate::render::flow::{FlowStyle, FlowVolume, Icon, IconName, Thresholds};
use crate::render::functions::{FunctionForm, Normalise, SheetStyle};
use crate::render::points::PointStyle;
use crate::render::surfaces::ByField;
use crate::store::StoredField;
use crate::task::Cancel;
use crate::transfer::{
    ColorMap, ColorPoint, FirstLook, Lengths, MappedRange, OpacityKind, RangePolicy, TransferContent, TransferError,
    TransferFunction, TransferSource, build_node_table,
};
use crate::visibility::Skip;
use glam::DVec3;
use std::sync::Arc;

/// The transfer function if none is chosen: that of [`FirstLook`].
pub const DEFAULT_TF: &str = "auto";

/// The settings that frames of a field share.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Viewpoint and projection.
    pub camera: Camera,
    /// Colours and opacities over the range.
    pub tf: TransferFunction,
    /// Scalars that the transfer function covers.
    pub range: RangePolicy,
    /// How opacities are defined.
    pub opacity_kind: OpacityKind,
    /// The length that opacities refer to, and the longest path through the mesh.
    pub lengths: Lengths,
    /// Renderer for the volume.
    pub mode: RenderMode,
    /// What the reference draws; other modes draw the one that they are of.
    pub representation: Representation,
    /// Which faces a face renderer draws.
    pub faces: FaceDetail,
    /// How cells are drawn as points; the level of detail is that of `faces`.
    pub points: PointStyle,
    /// How functions at the vertices are drawn.
    pub sheets: SheetStyle,
    /// What a field of functions is.
    pub functions: FunctionForm,
    /// Device that renders.
    pub backend: Backend,
    /// How segments are integrated.
    pub optics: OpticsKind,
    /// Isosurfaces, and whether the volume is drawn.
    pub surfaces: SurfaceLook,
    /// A field of vectors within.
    pub flow: Option<FlowLook>,
    /// Which unneeded work may be skipped.
    pub skip: Skip,
    /// Which settings a project overrides, if there is one.
    pub followed: Followed,
}

/// A field of vectors within the volume.
#[derive(Clone, Debug, PartialEq)]
pub struct FlowLook {
    /// What is drawn.
    pub layer: FlowLayer,
    /// The field and the map of its colours, by name.
    pub color_by: Option<ByField>,
    /// The icons of the layer by name, if it has others than its style's.
    pub icons: Option<Thresholds<IconName>>,
    /// The time of the series a second with which it goes on while a moment is held; `None`: [`FlowMeasure::rate`](crate::pipeline::FlowMeasure::rate).
    pub rate: Option<f64>,
}

impl FlowLook {
    /// The flow of a field, in one colour, at its usual rate.
    pub fn new(field: String, style: FlowStyle) -> Self {
        Self { layer: FlowLayer::new(field, style), color_by: None, icons: None, rate: None }
    }

    /// Shows a generated icon alone.
    pub fn set_icon(&mut self, icon: Icon) {
        self.layer.style.icon = icon;
        (self.layer.icons, self.icons) = (None, None);
    }

    /// What the colours of the field that colours it mean; `None` in one colour, or if `field`, which is that field, has no finite value.
    pub fn color_bar(&self, field: &StoredField) -> Option<ColorBar> {
        let (series, step) = FrameTime::from(0).scalar_ranges(field);
        let range = RangePolicy::Series.resolve(series, step).ok()?;
        let map = colors_of(&self.layer.colors.as_ref()?.colors, &range)?;
        Some(ColorBar { title: field.titled(), map, range })
    }

    /// Checks a rate.
    ///
    /// # Errors
    /// If it is negative or not finite.
    pub fn check_rate(rate: f64) -> Result<(), String> {
        let is_right = rate >= 0.0 && rate.is_finite();
        is_right.then_some(()).ok_or_else(|| format!("flow has a rate of {rate}; it must be zero or above"))
    }
}

/// What colours mean, as a legend shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorBar {
    /// Field and unit.
    pub title: String,
    /// Colours over 0..=1, opaque. (A [`NodeTable`] has none where it is transparent.)
    pub map: ColorMap,
    /// Scalars at 0..=1.
    pub range: MappedRange,
}

/// The colours of a table over a linear range.
pub(crate) fn colors_of(table: &NodeTable, range: &MappedRange) -> Option<ColorMap> {
    let inside = table.nodes().iter().filter(|node| (range.lo()..=range.hi()).contains(&node.scalar));
    let ends = [range.lo(), range.hi()].map(|scalar| table.eval(scalar));
    let all = std::iter::once(&ends[0]).chain(inside).chain([&ends[1]]);
    let points = all.map(|node| ColorPoint { position: node.scalar, rgb: node.rgb }).collect();
    ColorMap::new("colours", points, None).ok()
}

/// Which ensembles of a project are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnsembleChoice {
    /// The ensembles of the timeline, or the one that the look names.
    #[default]
    Project,
    /// The ensemble of this index (from 0), at all times.
    One(usize),
}

/// Which settings come from the project; the others are the user's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Followed {
    /// Ensembles of the project.
    pub ensembles: EnsembleChoice,
    /// Camera path of the project.
    pub camera: bool,
    /// Levels of detail of the project.
    pub lod: bool,
    /// The isovalues and cuts of its timeline.
    pub surfaces: bool,
    /// Opacities of the flow on its timeline.
    pub flow: bool,
    /// Integration of segments over time.
    pub optics: bool,
}

impl Default for Followed {
    fn default() -> Self {
        Self { ensembles: EnsembleChoice::Project, camera: true, lod: true, surfaces: true, flow: true, optics: true }
    }
}

/// Colours and extinctions of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Colors {
    /// Table over the scalar, or also over other quantities if a member of an ensemble keeps its axes.
    pub table: TransferTable,
    /// Source of the table; `None` if members are defined on more than the scalar.
    pub formula: Option<Arc<TransferSource>>,
}

/// The settings of a project at one time; `None`: not set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keyed {
    /// Colours and extinctions of the ensembles.
    pub colors: Option<Colors>,
    /// Viewpoint and projection.
    pub camera: Option<Camera>,
    /// Level of detail.
    pub lod: Option<f64>,
    /// Isovalues, opacities and positions of cuts.
    pub surfaces: KeyedSurfaces,
    /// Opacity of the flow.
    pub flow_opacity: Option<f64>,
    /// How segments are integrated.
    pub optics: Option<OpticsKind>,
}

/// The scalars that a transfer function covers at a time of a field ([`FrameTime::scalar_ranges`]).
///
/// # Errors
/// As [`RangePolicy::resolve`], and if percentiles are asked for and a step cannot be read.
pub fn mapped_range(series: &Series, policy: &RangePolicy, time: FrameTime) -> Result<MappedRange, TransferError> {
    let (all, step) = time.scalar_ranges(series.field());
    series.settled(policy)?.resolve(all, step)
}

/// Why a field beside a series has no colours.
#[derive(Debug, thiserror::Error)]
pub enum BesideError {
    /// The field cannot be opened.
    #[error(transparent)]
    File(#[from] FileError),
    /// The colour map cannot be read, or the field has no range.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The colours make no table.
    #[error(transparent)]
    Table(#[from] NodeTableError),
}

/// The colours of a field beside a series; `tf` gives its own to one without a map.
///
/// # Errors
/// If the store has no such field, or there is no such map.
pub fn colors_beside(
    series: &Series,
    tf: &TransferFunction,
    lengths: Lengths,
    by: &ByField,
) -> Result<ColorsBeside, BesideError> {
    let other = series.beside(&by.field)?;
    let function = match &by.map {
        Some(map) => TransferFunction::parse(map)?,
        None => tf.clone(),
    };
    let range = mapped_range(&other, &RangePolicy::Series, 0.into())?;
    let content = TransferContent::Function { function, range };
    let source = TransferSource { content, kind: OpacityKind::Alpha, lengths };
    Ok(ColorsBeside { field: by.field.to_string(), colors: Arc::new(source.formula()?.colors()?) })
}

impl Look {
    /// The default look: the mesh framed without parts that are far away, the range of all steps, opacities per 1 % of the diagonal of the
    /// frame.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn default_for(series: &Series, tf: TransferFunction) -> Result<Self, CameraError> {
        let mesh = series.mesh();
        let diagonal = |(lo, hi): (DVec3, DVec3)| (hi - lo).length();
        let unit = Lengths::of_diagonal(diagonal(mesh.frame())).unit_distance;
        // That of a cloud is the box of its balls.
        let whole = if mesh.is_cloud() { mesh.frame() } else { mesh.positions.world_bounds() };
        Ok(Self {
            camera: Camera::default_for(mesh.frame())?,
            tf,
            range: RangePolicy::default(),
            opacity_kind: OpacityKind::default(),
            // A mesh without extent is refused when it is built, so the diagonal is positive.
            lengths: Lengths::new(unit, diagonal(whole)),
            mode: RenderMode::default(),
            representation: Representation::default(),
            faces: FaceDetail::default(),
            points: PointStyle::usual_of(mesh),
            sheets: SheetStyle::default(),
            functions: FunctionForm::default(),
            backend: Backend::default(),
            optics: OpticsKind::default(),
            surfaces: SurfaceLook::default(),
            flow: None,
            skip: Skip::default(),
            followed: Followed::default(),
        })
    }

    /// The look with colours, opacities and a range that suit the values of the series.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn first_for(series: &Series, cancel: &Cancel) -> Result<Self, CameraError> {
        let FirstLook { tf, range, .. } = series.first_look(None, cancel);
        Ok(Self { range, ..Self::default_for(series, tf)? })
    }

    /// Whether the range and transfer function are those of `first`.
    pub fn is_first(&self, first: &FirstLook) -> bool {
        (self.range, &self.tf) == (first.range, &first.tf)
    }

    /// The source of the table over a range.
    pub fn source(&self, range: &MappedRange) -> TransferSource {
        let content = TransferContent::Function { function: self.tf.clone(), range: *range };
        TransferSource { content, kind: self.opacity_kind, lengths: self.lengths }
    }

    /// The table over a range.
    ///
    /// # Errors
    /// As [`build_node_table`].
    pub fn table(&self, range: &MappedRange) -> Result<NodeTable, TransferError> {
        build_node_table(&self.tf, range, self.opacity_kind, &self.lengths)
    }

    /// Colours and extinctions of the look itself over a range.
    ///
    /// # Errors
    /// As [`build_node_table`].
    pub fn colors(&self, range: &MappedRange) -> Result<Colors, TransferError> {
        Ok(Colors { table: Arc::new(self.table(range)?).into(), formula: Some(Arc::new(self.source(range))) })
    }

    /// How cells are drawn in a mode, with these faces and the look's points and sheets.
    pub fn draw(&self, mode: RenderMode, faces: FaceDetail) -> TetDraw {
        TetDraw::chosen(mode, faces, self.points).of(self.representation).with_sheets(self.sheets)
    }

    /// Whether values of functions fall towards zero where these are thin: pictures show values that are not in the data.
    pub fn draws_eq20(&self) -> bool {
        let draw = self.draw(self.mode, self.faces);
        draw.drawn_by().is_of_functions() && self.functions.normalise == Normalise::Eq20
    }

    /// The level of detail: the project's if it is set and followed, else the look's.
    pub fn lod_at(&self, keyed: &Keyed) -> f64 {
        keyed.lod.filter(|_| self.followed.lod).unwrap_or(self.faces.lod)
    }

    /// The request for a frame of `size_px` pixels: the project's settings replace those of the look where the look follows them. `own`
    /// makes the look's own colours, and is called only if the project sets none.
    ///
    /// # Errors
    /// The error of `own`.
    pub fn request<E>(
        &self,
        time: FrameTime,
        size_px: (usize, usize),
        keyed: &Keyed,
        own: impl FnOnce() -> Result<Colors, E>,
    ) -> Result<FrameRequest, E> {
        let Colors { table, formula } = keyed.colors.clone().map_or_else(own, Ok)?;
        let followed = self.followed;
        let camera = keyed.camera.filter(|_| followed.camera).unwrap_or(self.camera);
        let optics = keyed.optics.filter(|_| followed.optics).unwrap_or(self.optics);
        let surfaces = if followed.surfaces { keyed.surfaces } else { KeyedSurfaces::default() };
        let mut request = FrameRequest::new(time, camera, table, size_px).with_tets(|tets| {
            let faces = FaceDetail { lod: self.lod_at(keyed), ..self.faces };
            tets.draw = self.draw(self.mode, faces);
            tets.functions =
                if tets.draw.drawn_by().is_of_functions() { self.functions } else { FunctionForm::default() };
            (tets.optics, tets.formula) = (optics, formula);
            tets.show(&self.surfaces.at(surfaces));
            // Splats may take the place of the cells.
            tets.volume &= self.flow.as_ref().is_none_or(|flow| flow.layer.style.volume == FlowVolume::Exact);
        });
        request.layers.extend(self.flow.as_ref().map(|flow| {
            let mut layer = flow.layer.clone();
            layer.style.opacity = keyed.flow_opacity.filter(|_| followed.flow).unwrap_or(layer.style.opacity);
            Layer::Flow(layer)
        }));
        Ok(FrameRequest { backend: self.backend, skip: self.skip, ..request })
    }
}
