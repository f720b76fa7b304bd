//! Resolves pixels for which a buffer of k fragments was too small, from all of their fragments.

use super::super::super::layers::Layers;
use super::super::super::medium::Medium;
use super::super::raster::{FACES_AT_ONCE, TileRays};
use super::TILE_PX;
use super::fragment::{Fragment, sort_all};
use super::light::FragmentRay;
use super::tile::{Scene, TileScratch};
use crate::mesh::NONE;
use crate::optics::Accumulator;
use pulp::Scalar;

/// Pixels resolved at once: bounds the memory.
const PIXELS_AT_ONCE: u32 = 64;

/// Resolves the pixels `again` (a bit per column for each row) from all of their fragments.
///
/// A complete list is followed instead of sorted: the fragments of a ray form paths from an entry through cell after cell to an exit, and
/// depths order only the paths, as in the ray caster. Few pixels come here: one program serves all processors.
#[cold]
#[inline(never)]
pub(super) fn resolve_again<'s, M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &'s Scene<'_, M, Y>,
    tile: usize,
    rays: &TileRays,
    again: &[u32; TILE_PX],
    scratch: &mut TileScratch,
    lights: &mut [FragmentRay<M::Ray, Y::Ahead<'s>>; TILE_PX * TILE_PX],
) {
    let mut rest = *again;
    while rest != [0; TILE_PX] && !scene.cancel.is_cancelled() {
        let mut wanted = [0; TILE_PX];
        let mut count = 0;
        for (wanted, rest) in wanted.iter_mut().zip(&mut rest) {
            if count < PIXELS_AT_ONCE {
                (*wanted, *rest) = (*rest, 0);
                count += wanted.count_ones();
            }
        }
        collect(scene, tile, rays, &wanted, scratch);
        let fragments = &mut scratch.again;
        // Stable sort: the fragments of a pixel stay in list order.
        fragments.sort_by_key(|(pixel, _)| *pixel);
        let mut of_pixel = Vec::new();
        for run in fragments.chunk_by(|a, b| a.0 == b.0) {
            let pixel = run[0].0 as usize;
            of_pixel.clear();
            of_pixel.extend(run.iter().map(|(_, fragment)| *fragment));
            sort_all(&mut of_pixel, scene.tie);
            let (column, row) = (rays.bounds.x0 + pixel % TILE_PX, rays.bounds.y0 + pixel / TILE_PX);
            let optics = scene.optics(&rays.ray(scene.view, pixel));
            let mut light = scene.ray(column, row);
            if scene.is_complete {
                for path in paths(&of_pixel) {
                    if !light.follow(&optics, path) {
                        break;
                    }
                }
            } else {
                of_pixel.iter().for_each(|fragment| light.advance(&optics, fragment));
            }
            lights[pixel] = light;
        }
    }
}

/// All fragments of the pixels `wanted`, in list order.
fn collect<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    tile: usize,
    rays: &TileRays,
    wanted: &[u32; TILE_PX],
    scratch: &mut TileScratch,
) {
    let TileScratch { faces, candidates, again: out, .. } = scratch;
    out.clear();
    let is_wanted = |pixel: usize| wanted[pixel / TILE_PX] >> (pixel % TILE_PX) & 1 == 1;
    for &cell in scene.eye_cells {
        for pixel in (0..TILE_PX * TILE_PX).filter(|&pixel| is_wanted(pixel)) {
            let start = scene.start_at_eye(&rays.ray(scene.view, pixel), cell);
            out.extend(start.map(|start| (pixel as u32, start)));
        }
    }
    for chunk in 0..scene.bins.chunk_count() {
        for some in scene.bins.items(chunk, tile).chunks(FACES_AT_ONCE) {
            faces.set(scene.view, scene.vertices, rays, some);
            for i in 0..some.len() {
                faces.hits(Scalar, i, (scene.view, scene.vertices), rays, candidates, |pixel, hit| {
                    if is_wanted(pixel) {
                        out.push((pixel as u32, Fragment::at(hit)));
                    }
                });
            }
        }
    }
}

/// The paths of a ray through a complete list, in the order of their entries; `fragments` are sorted by depth.
fn paths(fragments: &[Fragment]) -> impl Iterator<Item = impl Iterator<Item = &Fragment>> {
    let mut by_near: Vec<&Fragment> = fragments.iter().filter(|f| f.near != NONE).collect();
    by_near.sort_by_key(|f| f.near);
    fragments.iter().filter(|f| f.near == NONE && f.far != NONE).map(move |start| {
        let by_near = by_near.clone();
        let next = move |here: &&Fragment| {
            let found = by_near.binary_search_by_key(&here.far, |f| f.near).ok().filter(|_| here.far != NONE)?;
            Some(by_near[found])
        };
        // Bounded by the number of fragments, in case the cells form a cycle.
        std::iter::successors(Some(start), next).take(fragments.len())
    })
}
