//! Fields of functions, splatted onto sheets (Neophytou and Mueller 2006): values first, then transfer functions.
//!
//! ```text
//! for each function, in parallel:       tiles that its box meets                              place
//! for each tile, in parallel:
//!   where each ray is in the field's domain                                                   domain
//!   for each slab of depths, nearest first, halved until 16 sheets or fewer are enough:       slabs
//!     sums of v phi and of phi on each sheet                                                  sheets
//!     where the field is lit, those of their slopes                                           slopes
//!     light between each two sheets, the scalar linear there, in the domain                   tile
//! ```
//!
//! **Sheets** are planes of equal depth. On the ray of a pixel, with depth w and the centre's depth w_0,
//!
//! ```text
//! L^-1 (x(w) - mu) = a + (w - w_0) b,    d^2 = |a + (w - w_0) b|^2
//! ```
//!
//! a being linear in the pixel's position, b constant in parallel projection and linear in perspective: the sections of an ellipsoid with all
//! sheets follow from six vectors, exactly, in perspective too (docs/functions.md: as conics, and what the paper has).
//!
//! **On a row** of a tile x(w) lies in a plane through the eye: the function ends between two depths there, roots of a quadratic. Only the
//! sheets between them get a part of it.
//!
//! **From sheet to sheet**, D apart, exp(-d^2 / 2) is multiplied by m, and m by exp(-|b|^2 D^2): two products in place of an exponential. It
//! begins afresh in each slab, after at most [`sheets::AT_ONCE`] sheets. Where d^2 exceeds [`kernel::MOST`] in the box of a function (needles
//! at an angle) products could leave f32's range: such a function takes an exponential for each sheet.
//!
//! **Between two sheets** [`optics`](crate::optics) integrates the scalar as in a cell: the pre-integrated slab that the paper wishes for.
//!
//! **How far apart.** Between sheets the scalar is off by D^2 / 8 |f''| at most, and for a function of width s (along the ray) and height v,
//! |f''| is at most v / s^2. f is a weighted mean of the values, so that only their differences count: sheets of a slab of a tile are
//! D = s sqrt(8 e R / delta) apart at most for each function there, e R the error asked for and delta the greatest difference of values up to
//! two cells away, or in the slab if that is less; and c s, the function's reach, so that none is missed. s counts as half a pixel at least. A
//! slab is halved at most 12 times, to a 65,536th of the depth between sheets.
//!
//! **Smaller than a pixel.** A function is widened across its ray until it has half a pixel's diagonal to both sides, on the screen, with its
//! extent along the ray as it was ([`Ellipsoid::widened`](super::splat::ellipsoid::Ellipsoid::widened)): so a ray meets it. The judge does
//! the same.
//!
//! **Where no function reaches either sheet** but the ray is inside the mesh between them, as in a corner of it, the field is that in the middle
//! of the ray's part there.
//!
//! **Light** (--shade-volume) is by the gradient of the sum, as the judge has it, linear between two sheets; what is between them has the light
//! of its middle. Neophytou and Mueller take differences of three sheets and within them (section 4); here the slopes of functions are summed
//! as they are, so that there is nothing to choose a distance for, and no tile needs its neighbours' pixels.
//!
//! **Domain.** The field is inside the mesh, in the box of the centres, or by coverage ([`crate::functions::coverage`]) in the box that
//! functions reach. Coverage is linear between two sheets, and multiplies the optical depth there. By one function alone its second derivative
//! is at most 1.5 / s^2; sheets are no farther apart than it allows for that, and what is off as it rises comes back as it falls.
//!
//! **What is skipped.** In a slab of a tile f is between v_min and v_max, to which it is clamped (by eq. 20, zero is among them): if nothing of
//! that interval is visible, or no ray is in the domain there, it is not halved, and nothing is projected. Slabs, and what is decided for each,
//! depend on tile and view, not on the rays that are cast: a pixel has the same bits in any sample set.

mod domain;
#[cfg(test)]
mod domain_tests;
#[cfg(test)]
mod field_tests;
mod kernel;
mod place;
mod sheets;
mod slabs;
mod slopes;
#[cfg(test)]
mod tests;
mod tile;

use super::super::functions::FunctionScene;
use super::super::layers::Layers;
use super::super::medium::Medium;
use super::super::{Frame, FrameRun, LayerRenderer, OpticsTables, RenderError, RenderJob};
use super::tiles::Tiles;
use super::{RenderTiles, TileJob};
use crate::optics::Accumulator;
pub(in crate::render::cpu) use place::{FunctionPlacer, FunctionsInView};
use pulp::{Arch, Scalar, Simd};
use std::sync::Arc;
use std::time::Duration;
use tile::{RenderTile, Scene, TileScratch};

/// The renderer of functions on the CPU.
pub type Sheets = FrameRun<SheetTiles>;

/// Splats functions onto sheets tile by tile on the CPU.
#[derive(Default)]
pub struct SheetTiles {
    placer: FunctionPlacer,
    tiles: Tiles<TileScratch>,
    /// Tables for jobs without prepared optics.
    tables: OpticsTables,
    /// Whether it uses no vectors.
    portable: bool,
}

/// A job of [`SheetTiles`].
pub struct SheetJob {
    tiles: TileJob,
    functions: FunctionScene,
    in_view: Arc<FunctionsInView>,
}

impl Sheets {
    /// A renderer without a job.
    pub fn new() -> Self {
        Self::default()
    }

    /// A renderer without vectors; images are the same.
    pub fn portable() -> Self {
        Self::of(SheetTiles { portable: true, ..SheetTiles::default() })
    }
}

impl LayerRenderer for SheetTiles {
    type Job = SheetJob;

    fn begin(&mut self, job: RenderJob, frame: &mut Frame) -> Result<Option<SheetJob>, RenderError> {
        let functions = FunctionScene::of_job(&job)?;
        let tiles = TileJob::new(job, &mut self.tables, frame);
        let TileJob { job, view, .. } = &tiles;
        frame.stats.functions_total = functions.kernels.len() as u64;
        let mut in_view = Arc::default();
        if !tiles.is_transparent() {
            in_view = match job.placed.as_ref().and_then(|placed| placed.functions(job)) {
                Some(placed) => placed,
                None => self.placer.place(job, &functions, view, &mut frame.stats),
            };
            in_view.check()?;
            frame.stats.functions_drawn = in_view.drawn;
            frame.stats.functions_widened = in_view.widened;
            frame.stats.entry_faces = in_view.faces;
            frame.stats.entry_lists_kept = u64::from(in_view.faces_kept);
        }
        self.tiles.begin(in_view.bins.grid, job.skip.costly_first);
        Ok(Some(SheetJob { tiles, functions, in_view }))
    }

    fn advance(&mut self, budget: Duration, job: &mut SheetJob, frame: &mut Frame) -> Result<bool, RenderError> {
        Ok(self.render(job, budget, frame))
    }
}

impl RenderTiles for SheetTiles {
    fn tile_job(job: &SheetJob) -> &TileJob {
        &job.tiles
    }

    /// A [`FunctionScene`] of a job has neither surfaces nor values beside the scalar.
    fn render_with<L: Layers>(&mut self, job: &SheetJob, layers: &L, budget: Duration, frame: &mut Frame) -> bool {
        self.render_scalars(job, layers, budget, frame)
    }

    /// Its scalars are of vertices.
    fn render_in<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        job: &SheetJob,
        in_cells_and_beside: (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        self.render_tiles(job, in_cells_and_beside, budget, frame)
    }

    fn render_tiles<M: Medium<Light = Accumulator>, L: Layers>(
        &mut self,
        SheetJob { tiles: TileJob { job, view, .. }, functions, in_view }: &SheetJob,
        (medium, layers): (&M, &L),
        budget: Duration,
        frame: &mut Frame,
    ) -> bool {
        let scene = Scene {
            functions,
            in_view,
            values: job.scalars.values(),
            view,
            table: &job.table,
            medium,
            layers,
            skip: job.skip,
            cancel: &job.cancel,
        };
        let portable = self.portable;
        self.tiles.render(job, budget, frame, |tile, scratch, pixels| {
            match if portable { Arch::Scalar } else { Arch::new() } {
                #[cfg(target_arch = "x86_64")]
                Arch::V4(lanes) => lanes.vectorize(RenderTile { lanes, scene: &scene, tile, scratch, pixels }),
                #[cfg(target_arch = "x86_64")]
                Arch::V3(lanes) => lanes.vectorize(RenderTile { lanes, scene: &scene, tile, scratch, pixels }),
                _ => Scalar.vectorize(RenderTile { lanes: Scalar, scene: &scene, tile, scratch, pixels }),
            }
        })
    }
}
