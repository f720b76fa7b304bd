//! Resolves pixels whose fragments do not follow each other from cell to cell, from all of them.

use super::super::super::layers::Layers;
use super::super::super::medium::Medium;
use super::super::raster::fragments::PIXELS;
use super::super::raster::{FACES_AT_ONCE, TileRays};
use super::super::tiles::{TileBits, TilePixel};
use super::fragment::{Fragment, sort_all};
use super::path::Path;
use super::tile::{FragmentScratch, Scene, each, place};
use crate::mesh::NONE;
use crate::optics::Accumulator;
use pulp::Scalar;

/// Pixels resolved at once: bounds the memory.
const PIXELS_AT_ONCE: u32 = 64;

/// Resolves the pixels `again` from all of their fragments; returns the number of pieces.
///
/// A complete list is followed instead of sorted: the fragments of a ray form paths from an entry through cell after cell to an exit, and
/// depths order only the paths, as in the ray caster. Few pixels come here: one program serves all processors.
#[cold]
#[inline(never)]
pub(super) fn resolve_again<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    tile: usize,
    (rays, again): (&mut TileRays, &TileBits),
    scratch: &mut FragmentScratch,
    (paths, pixels): (&mut [Path; PIXELS], &mut [TilePixel]),
) -> u64 {
    let (mut rest, mut pieces) = (*again, 0);
    while rest != TileBits::default() && !scene.cancel.is_cancelled() {
        let mut wanted = TileBits::default();
        let mut count = 0;
        for (wanted, rest) in wanted.iter_mut().zip(&mut rest) {
            if count < PIXELS_AT_ONCE {
                (*wanted, *rest) = (*rest, 0);
                count += wanted.count_ones();
            }
        }
        rays.rendered = wanted;
        collect(scene, tile, rays, scratch);
        let fragments = &mut scratch.again;
        // Stable sort: the fragments of a pixel stay in list order.
        fragments.sort_by_key(|(pixel, _)| *pixel);
        let mut of_pixel = Vec::new();
        for run in fragments.chunk_by(|a, b| a.0 == b.0) {
            let pixel = run[0].0 as usize;
            of_pixel.clear();
            of_pixel.extend(run.iter().map(|(_, fragment)| *fragment));
            sort_all(&mut of_pixel, scene.tie);
            let optics = scene.optics(&rays.ray(scene.view, pixel));
            let (mut path, mut light) = (Path::START, scene.light(rays, pixel));
            if scene.is_complete {
                for part in parts(&of_pixel) {
                    if !optics.follow(&mut path, &mut light, part) {
                        break;
                    }
                }
            } else {
                optics.advance_all(&mut path, &mut light, &of_pixel);
            }
            pieces += u64::from(light.segments);
            (paths[pixel], pixels[place(rays, pixel)]) = (path, light.pixel());
        }
    }
    pieces
}

/// All fragments of the pixels that are rendered, in list order.
fn collect<M: Medium<Light = Accumulator>, Y: Layers>(
    scene: &Scene<'_, M, Y>,
    tile: usize,
    rays: &TileRays,
    scratch: &mut FragmentScratch,
) {
    let FragmentScratch { faces, candidates, again: out, .. } = scratch;
    out.clear();
    for &cell in scene.eye_cells {
        each(&rays.rendered, |pixel| {
            let start = scene.start_at_eye(&rays.ray(scene.view, pixel), cell);
            out.extend(start.map(|start| (pixel as u32, start)));
        });
    }
    for chunk in 0..scene.bins.chunk_count() {
        for some in scene.bins.items(chunk, tile).chunks(FACES_AT_ONCE) {
            faces.set(scene.view, scene.vertices, rays, some);
            for i in 0..some.len() {
                faces.hits(Scalar, i, (scene.view, scene.vertices), rays, candidates, |pixel, hit| {
                    out.push((pixel as u32, Fragment::at(hit)));
                });
            }
        }
    }
}

/// The parts of the path of a ray through a complete list, each from an entry to an exit, in the order of their entries; `fragments` are sorted by depth.
fn parts(fragments: &[Fragment]) -> impl Iterator<Item = impl Iterator<Item = &Fragment>> {
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
