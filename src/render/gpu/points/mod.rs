//! Cells as points on the GPU: what [`crate::render::cpu::points`] does, in WGSL, with lists of all fragments ([`super::lists`]).
//!
//! A fragment is depth (of the entry into a cell; of the middle of another shape; of the centroid, for gaps), the scalars where the ray
//! enters and leaves, rank (place in the list of cells) and thickness in depth: 24 bytes, 32 with values of a joint table. Depth is a sum of
//! two f32, 4 bytes more than one would take: thin cells keep their order, and a cell's exit is the next one's entry to the bit.
//!
//! Shapes are computed from the corners where they are looked at, when fragments are counted and again when they are stored
//! (`lib/point_shape.wgsl`, `lib/tet_hits.wgsl`, `lib/slab_of_cell.wgsl`, `lib/slab_hits.wgsl`, `lib/ellipsoid.wgsl`); nothing is kept but
//! the corners of the cells, 16 bytes each. Points without cells have radius and thickness instead, 8 bytes each
//! (`lib/slab_of_ball.wgsl`).
//!
//! Order: the fragments of a pixel are sorted by depth, thickness and scalars, ties by rank; without exact order by rank, which is that of
//! the cells' centroids. Sums over corners go by their coordinates, so that an image does not depend on how cells are joined.
//!
//! Deviations from the CPU path:
//! 1. Edge functions are in f32, with the rounding errors of their products where they cancel (in f64 with thin, visible cells), as in
//!    [`super::raycast`]; shapes other than the cells themselves are in f32.
//! 2. Boxes of ellipsoids around the eye are those of the tets around them, which are larger.
//! 3. Fragments behind the place where a ray has become opaque are stored and sorted all the same, but not integrated.

mod balls;
#[cfg(test)]
mod cloud_tests;
#[cfg(test)]
mod tests;

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::eye;
use super::full_size::AtFullSize;
use super::layout::{ListParams, POINT_EYE_WORDS, TILE_PIXELS, flags};
use super::lists::steps::Stages;
use super::lists::{Elements, FragmentLists, Plan};
use super::point_params::PointParams;
use super::resources::Resource;
use super::shaders::{Along, Element, FragmentKind, Gathering, Inside, Pass, Precision, Stage};
use super::surfaces::CornerBuffer;
use crate::camera::View;
use crate::render::cpu::points::checked_points;
use crate::render::points::{Compositing, Footprint, PointStyle};
use crate::render::{FrameRun, RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::Drawn;
use balls::BallBuffer;
use std::sync::Arc;

/// The point renderer.
pub type Points = FrameRun<AtFullSize<FragmentLists<PointList>>>;

/// The cells of a job that are drawn as points.
pub struct PointList {
    corners: CornerBuffer,
    balls: BallBuffer,
    params_buffer: GrowingBuffer,
    params: PointParams,
    style: PointStyle,
    /// Of points that are the cells themselves, those in which the eye may be, ascending, in the layout of `shaders/lib/list_params.wgsl`.
    eye_cells: Vec<[u32; POINT_EYE_WORDS]>,
}

impl Default for PointList {
    fn default() -> Self {
        Self {
            corners: CornerBuffer::new(),
            balls: BallBuffer::new(),
            params_buffer: GrowingBuffer::new(Resource::PointParams),
            params: PointParams::default(),
            style: PointStyle::EXACT,
            eye_cells: Vec::new(),
        }
    }
}

/// What rays meet in points: gaps lie between cells, and have the scalars of points.
fn inside_of(job: &RenderJob, style: PointStyle) -> Inside {
    match Inside::of(job) {
        Inside::Cells if style.compositing == Compositing::Gap => Inside::Volume,
        inside => inside,
    }
}

impl Elements for PointList {
    fn check(&mut self, context: &Context, job: &RenderJob, stats: &mut FrameStats) -> Result<Arc<Drawn>, RenderError> {
        let points = checked_points(job)?;
        stats.points_total = job.active.count() as u64;
        self.style = points.style;
        self.balls.check(context, &job.mesh, points.style)?;
        if job.surfaces.is_some() && !points.style.is_exact() {
            return Err(context.beyond("isosurfaces among points that are not the cells".to_owned()));
        }
        if job.has_other_layers() {
            return Err(context.beyond("points together with fragments of other layers".to_owned()));
        }
        if points.style.constant_scalar {
            return Err(context.beyond("one scalar in each cell of points".to_owned()));
        }
        Ok(points.cells)
    }

    fn plan(&mut self, job: &RenderJob, drawn: &Drawn, view: &View, precision: Precision) -> Plan {
        let style = self.style;
        let element = match style.footprint {
            _ if job.mesh.is_cloud() => Element::Ball,
            Footprint::Exact => Element::Tet,
            Footprint::Square | Footprint::Circle | Footprint::Ellipse => Element::Slab,
        };
        let (how, inside, precision) = (Gathering::of(job), inside_of(job, style), element.precision(precision));
        let kind = FragmentKind::integrated(how, inside);
        let passes = [Pass::Count, Pass::Store(kind, element.inside_of_fragments(inside))];
        let stages = Stages {
            find: passes.map(|pass| Stage::Find(element, pass, precision)),
            pieces: passes.map(|pass| Stage::FindPieces(element, pass, precision)),
            starts: None,
            sort: Stage::FragmentSort(element.resolved_as(), kind),
            resolve: Stage::Resolve(element.resolved_as(), Along::cells(how, inside), precision),
        };
        self.params = PointParams::new(style, view, job.mesh.is_cloud());
        let eye_cells = if style.is_exact() { eye::cells(job, view) } else { Vec::new() };
        self.eye_cells = eye_cells.into_iter().map(|cell| [cell, eye::sides(job, view, cell)]).collect();
        let list_params = ListParams {
            drawn_count: drawn.ids.len() as u32,
            eye_count: self.eye_cells.len() as u32,
            end_pixel: TILE_PIXELS as u32,
            flags: if style.exact_order { flags::EXACT_ORDER } else { 0 },
            ..ListParams::default()
        };
        Plan { stages, kind, precision, list_params }
    }

    fn upload(&mut self, context: &Context, job: &RenderJob, _: &mut ListParams) -> Result<(bool, u64), RenderError> {
        let new = self.params_buffer.reserve(context, size_of::<PointParams>() as u64)?;
        self.params_buffer.write(context, 0, bytemuck::bytes_of(&self.params))?;
        let corners = self.corners.upload(context, job, !job.mesh.is_cloud())?;
        let balls = self.balls.upload(context, &job.mesh)?;
        Ok((new | corners.0 | balls.0, corners.1 + balls.1))
    }

    fn behind_list(&self) -> &[u8] {
        bytemuck::cast_slice(&self.eye_cells)
    }

    fn buffers(&self) -> Vec<&GrowingBuffer> {
        vec![&self.corners.buffer, &self.balls.buffer, &self.params_buffer]
    }

    fn count(stats: &mut FrameStats, drawn: u64, culled: u32, enlarged: u32) {
        stats.points_drawn = drawn;
        (stats.points_culled, stats.points_enlarged) = (u64::from(culled), u64::from(enlarged));
    }
}
