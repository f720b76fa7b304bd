//! The light of the rays of a tile: of each alone, or of eight side by side.

use super::super::super::layers::{Ahead, Layers};
use super::super::super::medium::Medium;
use super::super::light::RayLight;
use super::super::raster::TileRays;
use super::super::raster::fragments::PIXELS;
use super::super::tiles::TilePixel;
use super::fragment::Fragment;
use super::path::Path;
#[cfg(target_arch = "x86_64")]
pub(super) use super::side_by_side::SideBySide;
use super::tile::{FragmentsByPixel, Scene, place};
use crate::optics::Accumulator;
use crate::optics::exact::ExactTable;

/// There are no vectors.
#[cfg(not(target_arch = "x86_64"))]
pub(super) type SideBySide = ();

/// The light of rays.
pub(super) enum Lights<'a, R, A> {
    /// One ray after the other.
    Each(&'a mut [RayLight<R, A>]),
    /// Eight rays side by side.
    #[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "there are no vectors"))]
    SideBySide(&'a ExactTable, &'a mut SideBySide),
}

#[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables, reason = "there are no vectors"))]
impl<'a, R: Copy + Default, A: Ahead> Lights<'a, R, A> {
    /// Rays without light, side by side.
    pub(super) fn side_by_side(table: &'a ExactTable, lights: &'a mut SideBySide) -> Self {
        #[cfg(target_arch = "x86_64")]
        lights.begin_tile();
        Self::SideBySide(table, lights)
    }

    /// Begins a round.
    pub(super) fn begin_round(&mut self, paths: &[Path; PIXELS]) {
        #[cfg(target_arch = "x86_64")]
        if let Self::SideBySide(_, lights) = self {
            lights.begin_round(paths);
        }
    }

    /// Advances along fragments of a pixel in order. Pixels come in their order.
    #[inline(always)]
    pub(super) fn advance<M: Medium<Ray = R, Light = Accumulator>, Y: Layers>(
        &mut self,
        scene: &Scene<'_, M, Y>,
        rays: &TileRays,
        pixel: usize,
        (path, fragments): (&mut Path, &[Fragment]),
    ) {
        match self {
            Self::Each(lights) => {
                let optics = scene.optics(&rays.ray(scene.view, pixel));
                optics.advance_all(path, &mut lights[pixel], fragments);
            }
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(_, lights) => lights.advance(path, fragments, (scene.tie, scene.medium.cell_scalars())),
            #[cfg(not(target_arch = "x86_64"))]
            Self::SideBySide(..) => {}
        }
    }

    /// Advances along the fragments of a pixel in the order of their depths, up to the depth `bound`; returns the first that is left. `None`, and
    /// nothing is done, unless that is possible and their order.
    #[inline(always)]
    pub(super) fn advance_in_order<M: Medium<Ray = R, Light = Accumulator>, Y: Layers>(
        &mut self,
        scene: &Scene<'_, M, Y>,
        by_pixel: FragmentsByPixel<'_>,
        pixel: usize,
        (path, bound): (&mut Path, f64),
    ) -> Option<usize> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(_, lights) if scene.k_buffer.exact_order => {
                let range = by_pixel.range(pixel);
                let fragments = by_pixel.some(range.clone()).map(Fragment::from);
                let how = (scene.tie, bound, scene.medium.cell_scalars());
                lights.advance_in_order(path, fragments, how).map(|count| range.start + count)
            }
            _ => None,
        }
    }

    /// Ends a pixel, whether it has been advanced or not.
    #[inline(always)]
    pub(super) fn end(&mut self, pixel: usize) {
        #[cfg(target_arch = "x86_64")]
        if let Self::SideBySide(_, lights) = self {
            lights.end(pixel);
        }
    }

    /// Composites what is not composited yet; returns the number of pieces.
    pub(super) fn end_round<M, Y>(
        &mut self,
        scene: &Scene<'_, M, Y>,
        rays: &TileRays,
        pixels: &mut [TilePixel],
    ) -> u64 {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(table, lights) => {
                lights.composite((scene.view, rays), (scene.arch, table, scene.early_termination), pixels)
            }
            _ => 0,
        }
    }

    /// The path of a pixel that turned out to be opaque, if its path went on, from the fragments of this round, which `line_of` puts in order.
    pub(super) fn path_to_opaque<'f>(
        &self,
        rays: &TileRays,
        pixel: usize,
        tie: f64,
        line_of: impl FnOnce() -> &'f [Fragment],
    ) -> Option<Path> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(_, lights) => {
                let from = lights.became_opaque(pixel, place(rays, pixel))?;
                Some(lights.path_to(pixel, from, line_of(), tie))
            }
            _ => None,
        }
    }

    /// Gives the light of a ray that is composited alone to the image; returns the number of its pieces.
    pub(super) fn give(&self, rays: &TileRays, pixel: usize, pixels: &mut [TilePixel]) -> u64 {
        let Self::Each(lights) = self else { return 0 };
        pixels[place(rays, pixel)] = lights[pixel].pixel();
        u64::from(lights[pixel].segments)
    }
}
