//! The functions of a job in its view: boxes in tiles, and the boundary of the mesh.

use super::super::raster::boxes::{self, BoxSource, ScreenPoint};
use super::super::raster::lists::{Bins, ListedFace, SeenItem};
use super::super::ray::{self, ViewVertex};
use super::super::raycast::entry_faces::EntryFaces;
use super::super::tiles::TileGrid;
use super::kernel::{Extent, Kernel};
use super::slabs::Depths;
use crate::camera::View;
use crate::render::functions::{FunctionScene, Normalise};
use crate::render::{RenderError, RenderJob};
use crate::stats::FrameStats;
use crate::visibility::Pool;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

/// What a function is in a view, whatever the tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ListedFunction {
    /// Least and greatest depth, f32 away from each other: all of the function is between.
    pub(super) depths: [f32; 2],
    /// 1 / its least width along the rays that meet it.
    pub(super) per_width: f32,
    /// Greatest difference of the values of functions near it.
    pub(super) difference: f32,
    /// Whether it takes an exponential on each sheet.
    pub(super) is_thin: bool,
}

/// Functions in a view, in recycled memory.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct FunctionsInView {
    pub(super) vertices: Vec<ViewVertex>,
    /// Ids of the functions in tiles, ascending.
    pub(super) bins: Bins<u32>,
    /// By id; those without a pixel are as they may be.
    pub(super) functions: Vec<ListedFunction>,
    /// The faces around the cells where the field is, corners counter-clockwise as seen from outside.
    pub(super) boundary: Bins<ListedFace>,
    /// Number of these faces.
    pub(super) faces: u64,
    /// Whether they are those of the frame before.
    pub(super) faces_kept: bool,
    /// Functions with a pixel.
    pub(super) drawn: u64,
    /// Those of them that are wider than they were, so that they reach a pixel.
    pub(super) widened: u64,
    /// The depths of the sheets.
    pub(super) depths: Depths,
    /// Number of entries in all lists of functions.
    listed: u64,
}

impl FunctionsInView {
    /// Largest number of entries in all lists of functions: 1.5 GiB.
    pub(super) const MOST_LISTED: u64 = 1 << 27;

    /// Checks that the lists have room for all functions; they are empty else.
    ///
    /// # Errors
    /// If they have not.
    pub(super) fn check(&self) -> Result<(), RenderError> {
        if self.listed <= Self::MOST_LISTED {
            return Ok(());
        }
        let (listed, most) = (self.listed, Self::MOST_LISTED);
        Err(RenderError::BadFunctions(format!(
            "the functions in all tiles are {listed}, and lists have {most}; make the picture smaller, move the eye back, or draw the cells"
        )))
    }
}

/// Places the functions of successive jobs.
#[derive(Debug, Default)]
pub(in crate::render::cpu) struct FunctionPlacer {
    screen: Vec<ScreenPoint>,
    entry_faces: EntryFaces,
    /// The same, one after the other.
    faces: Vec<ListedFace>,
    near: NearValues,
    pool: Pool<FunctionsInView>,
}

impl FunctionPlacer {
    /// Places the functions of a job in its local view, only some of them if it is cancelled; adds the time to the statistics.
    pub(in crate::render::cpu) fn place(
        &mut self,
        job: &RenderJob,
        functions: &FunctionScene,
        view: &View,
        stats: &mut FrameStats,
    ) -> Arc<FunctionsInView> {
        let _span = tracing::info_span!("place").entered();
        let started = Instant::now();
        let Self { screen, entry_faces, faces, near, pool } = self;
        let placed = pool.make(|placed| {
            let FunctionsInView {
                vertices,
                bins,
                functions: seen_functions,
                boundary,
                drawn,
                widened,
                listed,
                depths,
                ..
            } = placed;
            let grid = TileGrid::of(view);
            let within = functions.domain.within();
            let mut are_kept = false;
            let around: &mut [ListedFace] = match within {
                Some(_) => &mut [],
                None => {
                    ray::transform(view, &job.mesh.positions.local, &job.scalars, None, &job.cancel, vertices);
                    boxes::project(view, vertices, None, &job.cancel, screen);
                    are_kept = entry_faces.update(&job.mesh, &job.active, job.skip.unchanged, &job.cancel).all;
                    if !are_kept {
                        faces.clear();
                        faces.extend(entry_faces.clusters.iter().flatten());
                    }
                    faces
                }
            };
            let source = BoxSource { view, vertices, screen };
            boundary.fill(grid, around, |lists, seen, _, faces| {
                lists.sort(grid, seen, faces.iter().filter_map(|face| source.seen(face)))
            });
            let values = job.scalars.values();
            near.find(&job.mesh.topology.tets, values);
            let near = &*near;
            seen_functions.resize(functions.kernels.len(), ListedFunction::default());
            let [count, wider, entries] = [0, 0, 0].map(AtomicU64::new);
            bins.fill(grid, seen_functions, |lists, seen, first, here| {
                lists.begin(grid);
                seen.clear();
                let here = if job.cancel.is_cancelled() { &mut [] } else { here };
                let (mut widened_here, mut listed_here) = (0, 0);
                let mut nearest = f32::INFINITY;
                for (id, listed) in (first as u32..).zip(here) {
                    let Some(extent) = extent_of(view, functions, values, id) else { continue };
                    *listed = ListedFunction::new(&extent, near.difference(id, functions.normalise));
                    let item = SeenItem { item: id, bounds: extent.bounds, nearest: extent.depths[0] as f32 };
                    nearest = nearest.min(item.nearest);
                    widened_here += u64::from(extent.is_widened);
                    listed_here += lists.count(item.bounds);
                    seen.push(item);
                }
                count.fetch_add(seen.len() as u64, Relaxed);
                wider.fetch_add(widened_here, Relaxed);
                // What is left out is not drawn: the number of all entries is the same, whatever the order.
                if entries.fetch_add(listed_here, Relaxed) + listed_here > FunctionsInView::MOST_LISTED {
                    lists.begin(grid);
                    seen.clear();
                }
                lists.store(seen);
                nearest
            });
            [*drawn, *widened, *listed] = [count, wider, entries].map(AtomicU64::into_inner);
            let [near, far] = within.map_or_else(|| depths_of(vertices), |within| depths_of_box(view, within));
            let ends = [near.max(view.near_depth()), far];
            *depths = Depths::new(ends, far - near, functions);
            (placed.faces, placed.faces_kept) = (around.len() as u64, are_kept);
        });
        stats.ms_place += started.elapsed().as_secs_f64() * 1e3;
        placed
    }
}

/// The values near each function: at its vertex, at those that this shares a cell with, and at those that these do.
#[derive(Debug, Default)]
struct NearValues {
    one_cell_away: Vec<[f32; 2]>,
    two_cells_away: Vec<[f32; 2]>,
}

impl NearValues {
    /// Finds the least and the greatest value near each vertex; those that are not finite count nowhere.
    fn find(&mut self, tets: &[[u32; 4]], values: &[f32]) {
        let Self { one_cell_away, two_cells_away } = self;
        let own = |vertex: u32| {
            let value = values[vertex as usize];
            if value.is_finite() { [value; 2] } else { NONE }
        };
        spread(tets, values.len(), own, one_cell_away);
        let near = &*one_cell_away;
        spread(tets, values.len(), |vertex| near[vertex as usize], two_cells_away);
    }

    /// Greatest difference of the values near a function; without a limit if it is in no cell.
    fn difference(&self, id: u32, normalise: Normalise) -> f32 {
        let near = self.two_cells_away[id as usize];
        let [least, most] = if near == NONE { near } else { normalise.values(near) };
        if most >= least { most - least } else { f32::INFINITY }
    }
}

const NONE: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// Makes, for each vertex, one interval of those that the corners of its cells have.
fn spread(tets: &[[u32; 4]], count: usize, of: impl Fn(u32) -> [f32; 2], out: &mut Vec<[f32; 2]>) {
    out.clear();
    out.resize(count, NONE);
    let union = |[a, b]: [f32; 2], [c, d]: [f32; 2]| [a.min(c), b.max(d)];
    for tet in tets {
        let all = tet.map(&of).into_iter().fold(NONE, union);
        tet.iter().for_each(|&vertex| out[vertex as usize] = union(out[vertex as usize], all));
    }
}

/// Depths of the nearest and of the farthest vertex.
fn depths_of(vertices: &[ViewVertex]) -> [f64; 2] {
    let ends = vertices.par_iter().map(|v| [v.w, v.w]);
    ends.reduce(|| [f64::INFINITY, f64::NEG_INFINITY], |[near, far], [w, z]| [near.min(w), far.max(z)])
}

/// Least and greatest depth of a box.
fn depths_of_box(view: &View, within: [DVec3; 2]) -> [f64; 2] {
    let corners = (0..8).map(|corner: usize| {
        view.to_view(DVec3::new(within[corner & 1].x, within[corner >> 1 & 1].y, within[corner >> 2].z)).z
    });
    corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[near, far], w| [near.min(w), far.max(w)])
}

/// Where a function with a finite value is in the image.
fn extent_of(view: &View, functions: &FunctionScene, values: &[f32], id: u32) -> Option<Extent> {
    if !values[id as usize].is_finite() {
        return None;
    }
    Kernel::extent(view, &functions.kernels.get(id as usize)?, functions.kernels.cut())
}

impl ListedFunction {
    /// A function with this extent, and this greatest difference of values near it.
    fn new(extent: &Extent, difference: f32) -> Self {
        let [near, far] = extent.depths;
        let depths = [(near as f32).next_down(), (far as f32).next_up()];
        // Rounded up: sheets are rather too close.
        let per_width = (extent.per_width as f32).next_up();
        Self { depths, per_width, difference, is_thin: extent.is_thin }
    }
}
