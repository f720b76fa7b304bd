//! [`Look`]: what frames of a field have in common, and the requests for them.

use crate::camera::{Camera, CameraError};
use crate::node_table::{NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::pipeline::{
    Backend, FaceDetail, FrameRequest, FrameTime, KeyedSurfaces, RenderMode, Series, SurfaceLook, TetDraw,
};
use crate::task::Cancel;
use crate::transfer::{
    FirstLook, Lengths, MappedRange, OpacityKind, RangePolicy, TransferContent, TransferError, TransferFunction,
    TransferSource, build_node_table,
};
use crate::visibility::Skip;
use std::sync::Arc;

/// The transfer function of those who do not choose one: that of [`FirstLook`].
pub const DEFAULT_TF: &str = "auto";

/// All that frames of a field have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Where from.
    pub camera: Camera,
    /// Colours and opacities.
    pub tf: TransferFunction,
    /// Scalars that they cover.
    pub range: RangePolicy,
    /// What opacities mean.
    pub opacity_kind: OpacityKind,
    /// The length that they refer to, and that of the longest path.
    pub lengths: Lengths,
    /// Which renderer.
    pub mode: RenderMode,
    /// Which faces are drawn, where faces are.
    pub faces: FaceDetail,
    /// Where it runs.
    pub backend: Backend,
    /// How segments are integrated.
    pub optics: OpticsKind,
    /// Isosurfaces, and whether the volume is drawn.
    pub surfaces: SurfaceLook,
    /// What may be left out.
    pub skip: Skip,
    /// What a project says instead, if there is one.
    pub followed: Followed,
}

/// Which ensembles of a project are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EnsembleChoice {
    /// The ensembles of the timeline, or the one that the look names.
    #[default]
    Project,
    /// This one, counted from 0, at all times.
    One(usize),
    /// None: the user's own colours and opacities.
    Own,
}

/// What is shown as a project has it; of the rest, the user's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Followed {
    /// Which of its ensembles.
    pub ensembles: EnsembleChoice,
    /// The path of its camera.
    pub camera: bool,
    /// Its levels of detail.
    pub lod: bool,
    /// The isovalues and cuts of its timeline.
    pub surfaces: bool,
    /// Its changes of how segments are integrated.
    pub optics: bool,
}

impl Default for Followed {
    fn default() -> Self {
        Self { ensembles: EnsembleChoice::Project, camera: true, lod: true, surfaces: true, optics: true }
    }
}

/// Colours and extinctions of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Colors {
    /// Over the scalar, or over other quantities, too, if a member of an ensemble keeps its axes.
    pub table: TransferTable,
    /// What the table was made from, unless members are of more than the scalar.
    pub formula: Option<Arc<TransferSource>>,
}

/// What a project says of a moment; `None`: nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keyed {
    /// Colours and extinctions of its ensembles.
    pub colors: Option<Colors>,
    /// Where from.
    pub camera: Option<Camera>,
    /// Level of detail.
    pub lod: Option<f64>,
    /// Where surfaces and cuts are.
    pub surfaces: KeyedSurfaces,
    /// How segments are integrated.
    pub optics: Option<OpticsKind>,
}

/// The scalars that a transfer function covers at a moment of a field ([`FrameTime::scalar_ranges`]).
///
/// # Errors
/// As [`RangePolicy::resolve`], and if percentiles are asked for and a step cannot be read.
pub fn mapped_range(series: &Series, policy: &RangePolicy, time: FrameTime) -> Result<MappedRange, TransferError> {
    let (all, step) = time.scalar_ranges(series.field());
    series.settled(policy)?.resolve(all, step)
}

impl Look {
    /// A mesh framed, the range of all steps, opacities per 1 % of the diagonal of its box.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn default_for(series: &Series, tf: TransferFunction) -> Result<Self, CameraError> {
        let bounds = series.mesh().positions.world_bounds();
        Ok(Self {
            camera: Camera::default_for(bounds)?,
            tf,
            range: RangePolicy::default(),
            opacity_kind: OpacityKind::default(),
            // A mesh without extent is refused when it is built, so the diagonal is positive.
            lengths: Lengths::of_diagonal((bounds.1 - bounds.0).length()),
            mode: RenderMode::default(),
            faces: FaceDetail::default(),
            backend: Backend::default(),
            optics: OpticsKind::default(),
            surfaces: SurfaceLook::default(),
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

    /// Whether colours, opacities and range are those.
    pub fn is_first(&self, first: &FirstLook) -> bool {
        (self.range, &self.tf) == (first.range, &first.tf)
    }

    /// What the table over a range is made from.
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

    /// The level of detail at a moment of a project.
    pub fn lod_at(&self, keyed: &Keyed) -> f64 {
        keyed.lod.filter(|_| self.followed.lod).unwrap_or(self.faces.lod)
    }

    /// The request for a frame of `size_px` pixels: what a project says of the moment comes before the look where the look follows it.
    /// `own` makes the look's own colours, and is asked only if the moment has none.
    ///
    /// # Errors
    /// That of `own`.
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
        let request = FrameRequest::new(time, camera, table, size_px).with_tets(|tets| {
            tets.draw = TetDraw::chosen(self.mode, FaceDetail { lod: self.lod_at(keyed), ..self.faces });
            (tets.optics, tets.formula) = (optics, formula);
            tets.show(&self.surfaces.at(surfaces));
        });
        Ok(FrameRequest { backend: self.backend, skip: self.skip, ..request })
    }
}
