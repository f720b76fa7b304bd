//! Bands: parts of the image whose fragments are in memory at a time.

use crate::render::RenderError;
use crate::render::gpu::layout::TILE_PIXELS;
use std::ops::Range;

/// Tiles, or some pixels of one tile, that are resolved before the next fragments are stored.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::render::gpu) struct Band {
    pub(in crate::render::gpu) tiles: Range<usize>,
    /// Pixels of each tile; fewer than all only if one tile alone exceeds the memory.
    pub(in crate::render::gpu) pixels: Range<usize>,
    pub(in crate::render::gpu) fragments: u32,
    /// Largest number of fragments of a pixel.
    pub(in crate::render::gpu) deepest: u32,
    /// Fragments of the tile's pixels before `pixels`.
    pub(in crate::render::gpu) skipped: u32,
}

impl Band {
    /// Whether it contains the last pixels of its tiles.
    pub(in crate::render::gpu) fn ends_tiles(&self) -> bool {
        self.pixels.end == TILE_PIXELS
    }
}

/// Index of each pixel's first fragment within its tile.
pub(in crate::render::gpu) type Places = [u32; TILE_PIXELS];

/// Groups tiles into the longest bands of at most `capacity` fragments. `sums` has the fragments of each tile, `deepest` those of its
/// deepest pixel. `places` reads the places in a tile that exceeds `capacity`; `refused` makes the error for a pixel that does.
pub(in crate::render::gpu) fn bands(
    sums: &[u32],
    deepest: &[u32],
    capacity: u32,
    mut places: impl FnMut(usize) -> Result<Places, RenderError>,
    refused: impl Fn(u32) -> RenderError,
    out: &mut Vec<Band>,
) -> Result<(), RenderError> {
    out.clear();
    let from = |tile: usize| Band { tiles: tile..tile, pixels: 0..TILE_PIXELS, ..Band::default() };
    let mut band = from(0);
    for (tile, (&sum, &deepest)) in sums.iter().zip(deepest).enumerate() {
        if u64::from(band.fragments) + u64::from(sum) <= u64::from(capacity) {
            band.fragments += sum;
            band.deepest = band.deepest.max(deepest);
            band.tiles.end = tile + 1;
            continue;
        }
        if !band.tiles.is_empty() {
            out.push(band);
        }
        if sum > capacity {
            split(tile, sum, capacity, &places(tile)?, &refused, out)?;
            band = from(tile + 1);
        } else {
            band = Band { tiles: tile..tile + 1, fragments: sum, deepest, ..from(tile) };
        }
    }
    if !band.tiles.is_empty() {
        out.push(band);
    }
    Ok(())
}

/// Divides one tile into bands.
fn split(
    tile: usize,
    sum: u32,
    capacity: u32,
    places: &Places,
    refused: &impl Fn(u32) -> RenderError,
    out: &mut Vec<Band>,
) -> Result<(), RenderError> {
    if sum == u32::MAX {
        // The sum has saturated.
        return Err(refused(sum));
    }
    let end_of = |pixel: usize| places.get(pixel + 1).copied().unwrap_or(sum);
    let (mut first, mut deepest) = (0, 0);
    for pixel in 0..TILE_PIXELS {
        let count = end_of(pixel) - places[pixel];
        deepest = deepest.max(count);
        if count > capacity {
            return Err(refused(count));
        }
        let is_last = pixel + 1 == TILE_PIXELS;
        if is_last || end_of(pixel + 1) - places[first] > capacity {
            let fragments = end_of(pixel) - places[first];
            out.push(Band {
                tiles: tile..tile + 1,
                pixels: first..pixel + 1,
                fragments,
                deepest,
                skipped: places[first],
            });
            (first, deepest) = (pixel + 1, 0);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(count: u32) -> RenderError {
        RenderError::NoGpu(count.to_string())
    }

    fn bands_of(counts: &[Places], capacity: u32) -> Result<Vec<Band>, RenderError> {
        let sums: Vec<u32> = counts.iter().map(|tile| tile.iter().sum()).collect();
        let deepest: Vec<u32> = counts.iter().map(|tile| tile.iter().copied().max().unwrap_or(0)).collect();
        let places = |tile: usize| {
            let mut sum = 0;
            Ok(counts[tile].map(|count| {
                sum += count;
                sum - count
            }))
        };
        let mut out = Vec::new();
        bands(&sums, &deepest, capacity, places, refused, &mut out)?;
        Ok(out)
    }

    #[test]
    fn bands_cover_all_pixels_once_and_hold_no_more_than_there_is_room_for() {
        let counts: Vec<Places> = (0..20u32)
            .map(|tile| std::array::from_fn(|pixel| if tile == 7 { pixel as u32 } else { tile % 3 }))
            .collect();
        for capacity in [255, 300, 512, 1000, 5000, 100_000] {
            let found = bands_of(&counts, capacity).unwrap();
            let mut next = (0, 0);
            for band in &found {
                assert!(band.fragments <= capacity, "{band:?}");
                assert_eq!((band.tiles.start, band.pixels.start), next);
                let here = counts[band.tiles.clone()].iter().flat_map(|tile| &tile[band.pixels.clone()]);
                assert_eq!(here.clone().max().copied().unwrap_or(0), band.deepest);
                assert_eq!(here.sum::<u32>(), band.fragments);
                assert_eq!(counts[band.tiles.start][..band.pixels.start].iter().sum::<u32>(), band.skipped);
                next = if band.ends_tiles() { (band.tiles.end, 0) } else { (band.tiles.start, band.pixels.end) };
            }
            assert_eq!(next, (20, 0), "capacity {capacity}");
            assert_eq!(found.len() == 1, capacity == 100_000);
        }
    }

    #[test]
    fn an_image_without_fragments_is_one_band_and_a_pixel_with_too_many_is_refused() {
        let empty = [[0; TILE_PIXELS]; 3];
        assert_eq!(bands_of(&empty, 10).unwrap().len(), 1);
        let mut one = empty;
        one[1][200] = 11;
        assert_eq!(bands_of(&one, 10), Err(refused(11)));
        assert_eq!(bands_of(&one, 11).unwrap().len(), 1);
    }
}
