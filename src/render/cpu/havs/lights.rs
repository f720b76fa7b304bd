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
use super::tile::{FragmentsByPixel, Scene, has, place};
use crate::optics::Accumulator;
use crate::optics::exact::ExactTable;

/// There are no vectors.
#[cfg(not(target_arch = "x86_64"))]
pub(super) type SideBySide = ();

/// The light of rays.
pub(super) enum Lights<'a, R, A> {
    /// One ray after the other.
    Each(Box<[RayLight<R, A>]>),
    /// Eight rays side by side.
    SideBySide(&'a ExactTable, &'a mut SideBySide),
}

impl<'a, R: Copy + Default, A: Ahead> Lights<'a, R, A> {
    /// The rays that are cast, one after the other.
    pub(super) fn each<M, Y>(scene: &'a Scene<'_, M, Y>, rays: &TileRays) -> Self
    where
        M: Medium<Ray = R, Light = Accumulator>,
        Y: Layers<Ahead<'a> = A> + 'a,
    {
        let unused = RayLight::new(scene.view.near_depth(), A::NONE);
        let light = |pixel| if has(&rays.rendered, pixel) { scene.light(rays, pixel) } else { unused };
        Self::Each((0..PIXELS).map(light).collect())
    }

    /// Rays without light, side by side.
    pub(super) fn side_by_side(table: &'a ExactTable, lights: &'a mut SideBySide) -> Self {
        #[cfg(target_arch = "x86_64")]
        lights.begin_tile();
        Self::SideBySide(table, lights)
    }

    /// Begins a round.
    pub(super) fn begin_round(&mut self, _paths: &[Path; PIXELS]) {
        #[cfg(target_arch = "x86_64")]
        if let Self::SideBySide(_, lights) = self {
            lights.begin_round(_paths);
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
        _scene: &Scene<'_, M, Y>,
        _by_pixel: FragmentsByPixel<'_>,
        _pixel: usize,
        (_path, _bound): (&mut Path, f64),
    ) -> Option<usize> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(_, lights) if _scene.k_buffer.exact_order => {
                let range = _by_pixel.range(_pixel);
                let fragments = _by_pixel.some(range.clone()).map(Fragment::from);
                let how = (_scene.tie, _bound, _scene.medium.cell_scalars());
                lights.advance_in_order(_path, fragments, how).map(|count| range.start + count)
            }
            _ => None,
        }
    }

    /// Ends a pixel, whether it has been advanced or not.
    #[inline(always)]
    pub(super) fn end(&mut self, _pixel: usize) {
        #[cfg(target_arch = "x86_64")]
        if let Self::SideBySide(_, lights) = self {
            lights.end(_pixel);
        }
    }

    /// Composites what is not composited yet; returns the number of pieces.
    pub(super) fn end_round<M, Y>(
        &mut self,
        _scene: &Scene<'_, M, Y>,
        _rays: &TileRays,
        _pixels: &mut [TilePixel],
    ) -> u64 {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(table, lights) => {
                lights.composite((_scene.view, _rays), (_scene.arch, table, _scene.early_termination), _pixels)
            }
            _ => 0,
        }
    }

    /// The path of a pixel that turned out to be opaque, if its path went on, from the fragments of this round, which `line_of` puts in order.
    pub(super) fn path_to_opaque<'f>(
        &self,
        _rays: &TileRays,
        _pixel: usize,
        _tie: f64,
        _line_of: impl FnOnce() -> &'f [Fragment],
    ) -> Option<Path> {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::SideBySide(_, lights) => {
                let from = lights.became_opaque(_pixel, place(_rays, _pixel))?;
                Some(lights.path_to(_pixel, from, _line_of(), _tie))
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
