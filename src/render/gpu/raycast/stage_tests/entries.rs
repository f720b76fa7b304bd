//! The tiles' lists against every pixel and every face.

use super::*;
use crate::render::gpu::layout::TILE_PX;
use std::collections::{BTreeMap, BTreeSet};

/// As in `shaders/lib/frame.wgsl`.
const EYE_CELL: u32 = 0x10000;
const SIDES_SHIFT: u32 = 17;

/// An entry face as (cell, opposite vertex), or a cell at the eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Item {
    Face(u32, u32),
    EyeCell(u32),
}

/// First and last pixel, inclusive: x, y, x, y.
type PixelBox = [usize; 4];

/// The lists: for each tile its items with their boxes in pixels of the image.
#[derive(Clone)]
struct Lists {
    columns: usize,
    tiles: Vec<Vec<(Item, PixelBox)>>,
}

impl Lists {
    /// Unpacks the lists; the ends of the tiles rise to their sum, and there is room for all.
    fn read(prepared: &Prepared) -> Self {
        let Prepared { params, bins, .. } = prepared;
        let tile_count = params.tile_count();
        let columns = params.tiles[0] as usize;
        let total = bins[tile_count];
        assert_eq!(bins[tile_count - 1], total, "the last list ends where all end");
        assert!(total <= params.pair_capacity);
        let mut tiles = Vec::new();
        for tile in 0..tile_count {
            let first = if tile == 0 { 0 } else { bins[tile - 1] };
            assert!(first <= bins[tile]);
            let corner = [tile % columns * TILE_PX, tile / columns * TILE_PX];
            let unpacked = (first..bins[tile]).map(|i| {
                let at = tile_count + 1 + 2 * i as usize;
                let (word, bounds) = (bins[at], bins[at + 1]);
                let item = if bounds & EYE_CELL != 0 { Item::EyeCell(word) } else { Item::Face(word >> 2, word & 3) };
                assert!(bounds & EYE_CELL != 0 || bounds >> SIDES_SHIFT == 0);
                let nibble = |shift: u32| (bounds >> shift & 15) as usize;
                let [x, y] = corner;
                (item, [x + nibble(0), y + nibble(8), x + nibble(4), y + nibble(12)])
            });
            tiles.push(unpacked.collect());
        }
        Self { columns, tiles }
    }

    /// Whether an item is listed for a pixel.
    fn has(&self, item: Item, (i, j): (usize, usize)) -> bool {
        let tile = j / TILE_PX * self.columns + i / TILE_PX;
        let inside = |b: &PixelBox| i >= b[0] && i <= b[2] && j >= b[1] && j <= b[3];
        self.tiles[tile].iter().any(|(other, bounds)| *other == item && inside(bounds))
    }
}

/// What rays need and the lists lack, and how many pairs of pixel and item have been looked at.
fn missing(lists: &Lists, job: &RenderJob, view: &View) -> (usize, usize) {
    let cells = active_cells(job);
    let at_eye: BTreeSet<u32> =
        lists.tiles[0].iter().filter_map(|(i, _)| if let Item::EyeCell(c) = i { Some(*c) } else { None }).collect();
    let mut needed = Vec::new();
    for &cell in &cells {
        if at_eye.contains(&cell) || has_eye(job, view, cell) {
            needed.push((Item::EyeCell(cell), None));
            continue;
        }
        for opposite in (0..4).filter(|&o| is_open(job, cell, o)) {
            needed.push((Item::Face(cell, opposite as u32), Some(face(job, view, cell, opposite))));
        }
    }
    let (mut missing, mut looked_at) = (0, 0);
    for pixel in (0..view.height_px).flat_map(|j| (0..view.width_px).map(move |i| (i, j))) {
        for &(item, corners) in &needed {
            let is_needed = corners.is_none_or(|corners| match meet(view, pixel, corners) {
                Meeting::Front(depth) => depth > 0.0 || !view.perspective,
                Meeting::None | Meeting::Doubtful => false,
            });
            if is_needed {
                looked_at += 1;
                missing += usize::from(!lists.has(item, pixel));
            }
        }
    }
    (missing, looked_at)
}

fn scenes() -> Vec<(String, RenderJob)> {
    let mut scenes = Vec::new();
    for missing in [0, 5] {
        let mesh = mesh(3, missing, DVec3::ZERO);
        for (name, camera) in cameras(DVec3::ZERO) {
            // Neither width nor height is a multiple of a tile.
            scenes.push((format!("{name}, missing {missing}"), job(&mesh, &camera, (53, 41))));
        }
    }
    scenes
}

#[test]
fn every_face_that_a_ray_enters_is_in_the_list_of_its_tile() {
    let Some(context) = context() else { return };
    for (name, job) in scenes() {
        let view = job.local_view();
        let lists = Lists::read(&prepare(&context, &job));
        let (missing, looked_at) = missing(&lists, &job, &view);
        assert_eq!(missing, 0, "{name}: of {looked_at}");
        assert!(looked_at > 1000, "{name}: {looked_at} entries prove little");
        let eye_cells = lists.tiles[0].iter().filter(|(item, _)| matches!(item, Item::EyeCell(_))).count();
        let must_be = active_cells(&job).iter().filter(|&&cell| has_eye(&job, &view, cell)).count();
        // One, unless the eye is within rounding of a face.
        assert_eq!((eye_cells, must_be > 0), (must_be, name.starts_with("inside")), "{name}: cells at the eye");
    }
}

#[test]
fn the_comparison_notices_a_lost_pair_and_a_moved_image() {
    let Some(context) = context() else { return };
    let (_, job) = scenes().swap_remove(0);
    let view = job.local_view();
    let lists = Lists::read(&prepare(&context, &job));
    let middle = lists.tiles.iter().position(|t| t.len() > 20).unwrap();
    let lost = (0..lists.tiles[middle].len()).filter(|&i| {
        let mut cut = lists.clone();
        cut.tiles[middle].swap_remove(i);
        missing(&cut, &job, &view).0 > 0
    });
    // Of faces seen at a flat angle or from the side no pixel needs their pair.
    assert!(lost.count() > lists.tiles[middle].len() / 4);
    let wider = View { half_width: view.half_width * 1.1, ..view.clone() };
    assert!(missing(&lists, &job, &wider).0 > 0);
    let mut shrunk = lists;
    shrunk.tiles.iter_mut().flatten().for_each(|(_, b)| b[2] = b[2].saturating_sub(1).max(b[0]));
    assert!(missing(&shrunk, &job, &view).0 > 0);
}

/// Columns and rows of the pixels of each item, and the pairs' pixels added up.
fn extents(lists: &Lists) -> BTreeMap<Item, (PixelBox, usize)> {
    let mut extents = BTreeMap::new();
    for (item, b) in lists.tiles.iter().flatten() {
        let pixels = (b[2] + 1 - b[0]) * (b[3] + 1 - b[1]);
        let entry = extents.entry(*item).or_insert((*b, 0));
        let e = entry.0;
        entry.0 = [e[0].min(b[0]), e[1].min(b[1]), e[2].max(b[2]), e[3].max(b[3])];
        entry.1 += pixels;
    }
    extents
}

#[test]
fn counting_and_storing_agree_on_whole_rectangles_without_gaps_or_doubles() {
    let Some(context) = context() else { return };
    for (name, job) in scenes() {
        let lists = Lists::read(&prepare(&context, &job));
        for (tile, list) in lists.tiles.iter().enumerate() {
            let items: BTreeSet<_> = list.iter().map(|(item, _)| *item).collect();
            assert_eq!(items.len(), list.len(), "{name}, tile {tile}: an item twice");
        }
        for (item, (b, pixels)) in extents(&lists) {
            // No pixel twice and none left out: the boxes in the tiles make up the rectangle around them.
            assert_eq!(pixels, (b[2] + 1 - b[0]) * (b[3] + 1 - b[1]), "{name}, {item:?}");
            match item {
                Item::Face(cell, opposite) => {
                    assert!(job.active.contains(cell) && is_open(&job, cell, opposite as usize), "{name}, {item:?}");
                }
                Item::EyeCell(cell) => {
                    assert!(job.active.contains(cell));
                    assert_eq!(b, [0, 0, job.view.width_px - 1, job.view.height_px - 1], "{name}: seen everywhere");
                }
            }
        }
    }
}

/// Items whose rectangle is larger than their triangle's by more than `pad` pixels, or that are seen from behind.
fn oversized(lists: &Lists, job: &RenderJob, view: &View, pad: f64) -> usize {
    let column = |x: f64| (x / view.half_width + 1.0) * 0.5 * view.width_px as f64 - 0.5;
    let row = |y: f64| (1.0 - y / view.half_height) * 0.5 * view.height_px as f64 - 0.5;
    let too_large = |item: Item, b: PixelBox| {
        let Item::Face(cell, opposite) = item else { return false };
        let corners = face(job, view, cell, opposite as usize);
        if view.perspective && corners.iter().any(|v| v.z <= 0.0) {
            return false;
        }
        let on_plane = corners.map(|v| if view.perspective { v / v.z } else { v });
        let [columns, rows] = [on_plane.map(|v| column(v.x)), on_plane.map(|v| row(v.y))];
        let least = |v: [f64; 3]| v[0].min(v[1]).min(v[2]) - pad;
        let most = |v: [f64; 3]| v[0].max(v[1]).max(v[2]) + pad;
        let beyond = [b[0] as f64, b[1] as f64];
        let before = [b[2] as f64, b[3] as f64];
        beyond[0] < least(columns) || beyond[1] < least(rows) || before[0] > most(columns) || before[1] > most(rows)
    };
    extents(lists).into_iter().filter(|&(item, (b, _))| too_large(item, b)).count()
}

#[test]
fn lists_are_hardly_longer_than_they_must_be() {
    let Some(context) = context() else { return };
    for (name, job) in scenes() {
        let view = job.local_view();
        let lists = Lists::read(&prepare(&context, &job));
        // The pad of `face_box` is 1/16 of a pixel; its f32 is right to 2^-20 of the image, far below the rest of this.
        assert_eq!(oversized(&lists, &job, &view, 0.07), 0, "{name}");
        // The comparison notices boxes that are larger than asked for; from inside, most faces reach behind the eye.
        assert!(oversized(&lists, &job, &view, -0.07) > 0 || name.starts_with("inside"), "{name}");
        let faces = active_cells(&job).iter().map(|&c| (0..4).filter(|&o| is_open(&job, c, o)).count()).sum::<usize>();
        let listed = extents(&lists).len();
        // Of a closed surface seen from outside, the back is not listed.
        assert!(listed < faces * 3 / 4 || name.starts_with("inside"), "{name}: {listed} of {faces} faces");
    }
}
