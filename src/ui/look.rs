//! What frames look like, and the requests for them.

use crate::camera::{Camera, CameraError};
use crate::node_table::{Node, NodeTable};
use crate::optics::OpticsKind;
use crate::pipeline::{Backend, FaceDetail, FrameRequest, FrameTime, RenderMode, Series};
use crate::store::StoredField;
use crate::transfer::{MappedRange, OpacityKind, RangePolicy, TransferError, TransferFunction, build_node_table};
use crate::visibility::Skip;
use std::sync::Arc;

/// The transfer function of those who do not choose one.
pub const DEFAULT_TF: &str = "viridis";

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
    /// The length that they refer to, world units.
    pub unit_distance: f64,
    /// Which renderer.
    pub mode: RenderMode,
    /// Which faces are drawn, where faces are.
    pub faces: FaceDetail,
    /// Where it runs.
    pub backend: Backend,
    /// How segments are integrated.
    pub optics: OpticsKind,
    /// What may be left out.
    pub skip: Skip,
}

/// The scalars that a transfer function covers at a moment of a field.
///
/// Between two steps their ranges are interpolated as the scalars are: no mixed scalar lies outside, and colours do not jump
/// at a step.
///
/// # Errors
/// As [`RangePolicy::resolve`].
pub fn mapped_range(field: &StoredField, policy: &RangePolicy, time: FrameTime) -> Result<MappedRange, TransferError> {
    let nothing = (f64::NAN, f64::NAN);
    let ends = |range: Option<[f32; 2]>| range.map_or(nothing, |[lo, hi]| (f64::from(lo), f64::from(hi)));
    let series = ends(field.range);
    // A step without a finite value shows nothing, whatever the colours.
    let of = |step: usize| match field.range_per_step.get(step).copied().flatten() {
        None => series,
        range => ends(range),
    };
    let (lo, hi) = of(time.step());
    let of_step = (time.mix(lo, |next| of(next).0), time.mix(hi, |next| of(next).1));
    policy.resolve(series, of_step)
}

impl Look {
    /// A mesh framed, the range of all steps, opacities per 1 % of the diagonal of its box.
    ///
    /// # Errors
    /// If the mesh has no extent that a camera can frame.
    pub fn default_for(series: &Series, tf: TransferFunction) -> Result<Self, CameraError> {
        let bounds = series.mesh().positions.world_bounds();
        let (range, opacity_kind, mode, faces, backend, optics, skip) = Default::default();
        let camera = Camera::default_for(bounds)?;
        // A mesh without extent is refused when it is built, so the diagonal is positive.
        let unit_distance = 0.01 * (bounds.1 - bounds.0).length();
        Ok(Self { camera, tf, range, opacity_kind, unit_distance, mode, faces, backend, optics, skip })
    }

    /// The table over a range.
    ///
    /// # Errors
    /// As [`build_node_table`].
    pub fn table(&self, range: &MappedRange) -> Result<NodeTable, TransferError> {
        build_node_table(&self.tf, range, self.opacity_kind, self.unit_distance)
    }
}

/// Tables made lately: with a range for each step, as many as frames on their way.
const TABLES_KEPT: usize = 4;

/// Makes requests, and tables only when they change.
#[derive(Debug, Default)]
pub(super) struct Requests {
    /// What the tables are for.
    tables_of: Option<Look>,
    tables: Vec<(MappedRange, Arc<NodeTable>)>,
    /// Why the last table could not be made.
    pub(super) problem: Option<String>,
    /// Whether frames may stay on the GPU of the window.
    pub(super) for_window: bool,
}

impl Requests {
    /// The request for a moment. If there is no table for it, an empty one, and [`Self::problem`] says why.
    pub(super) fn make(
        &mut self,
        look: &Look,
        field: &StoredField,
        time: FrameTime,
        size: (usize, usize),
    ) -> FrameRequest {
        let table = self.table(look, field, time).unwrap_or_else(|error| {
            self.problem = Some(format!("field {}: {error}", field.name));
            Arc::new(clear())
        });
        let Look { mode, faces, optics, backend, skip, camera, .. } = *look;
        let for_window = self.for_window;
        FrameRequest { mode, faces, optics, backend, for_window, skip, ..FrameRequest::new(time, camera, table, size) }
    }

    fn table(&mut self, look: &Look, field: &StoredField, time: FrameTime) -> Result<Arc<NodeTable>, TransferError> {
        let range = mapped_range(field, &look.range, time)?;
        let is_for = |of: &Look| {
            of.tf == look.tf && of.opacity_kind == look.opacity_kind && of.unit_distance == look.unit_distance
        };
        if !self.tables_of.as_ref().is_some_and(is_for) {
            self.tables.clear();
            self.tables_of = Some(look.clone());
        }
        if let Some((_, table)) = self.tables.iter().find(|(made, _)| *made == range) {
            return Ok(table.clone());
        }
        let table = Arc::new(look.table(&range)?);
        if self.tables.len() == TABLES_KEPT {
            self.tables.remove(0);
        }
        self.tables.push((range, table.clone()));
        Ok(table)
    }
}

/// A table that shows nothing.
fn clear() -> NodeTable {
    let node = Node { scalar: 0.0, rgb: [0.0; 3], tau: 0.0 };
    NodeTable::new(vec![node]).unwrap_or_else(|_| unreachable!("one finite node is a table"))
}
