//! Where rays are inside of a set of cells.
//!
//! A ray goes into the cells through each face of their boundary that it sees from outside, and comes out through each that it sees from inside. It
//! meets every such face by the exact predicate, so that beyond any depth there are as many more ways out as there are cells around that
//! point of the ray: one, or with cells that overlap several. They are counted from far, where there is nothing, so that an eye inside needs no
//! case of its own. Ways at equal depths need no order: those out are moved away by the tolerance, and those in moved nearer. A count by
//! orientation, unlike parity, bears with faces that more than two cells share, which are listed once a cell.

use super::super::raster::lists::ListedFace;
use super::super::ray::transform;
use super::super::raycast::entries::{EntryFace, collect};
use super::super::tiles::TILE_PX;
use super::tiled::{Scratch, TiledFaces};
use crate::camera::View;
use crate::field::Scalars;
use crate::mesh::{Mesh, NONE, Plane};
use crate::task::Cancel;
use crate::visibility::CellSet;
use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Weak};

/// The faces around a set of cells of a mesh.
#[derive(Debug)]
struct Boundary {
    /// Their corners (local coordinates), in the order of the mesh's vertices.
    corners: Vec<Vec3>,
    /// Corners counter-clockwise as seen from outside.
    faces: Vec<ListedFace>,
}

impl Boundary {
    /// `None` if cancelled.
    fn of(mesh: &Mesh, cells: &CellSet, cancel: &Cancel) -> Option<Self> {
        let mut found = Vec::new();
        collect(&mesh.topology, cells, cancel, &mut found);
        let mut vertices: Vec<u32> = found.par_iter().flat_map_iter(|face| face.vertices).collect();
        vertices.par_sort_unstable();
        vertices.dedup();
        let place = |vertex: u32| vertices.partition_point(|&other| other < vertex) as u32;
        let listed = |face: &EntryFace| ListedFace { ids: face.vertices.map(place), cells: [NONE; 2] };
        let faces = found.par_iter().map(listed).collect();
        let corners = vertices.par_iter().map(|&vertex| mesh.positions.local[vertex as usize]).collect();
        (!cancel.is_cancelled()).then_some(Self { corners, faces })
    }
}

/// For each ray that is cast, row by row of the image from the top left, the local depths between which it is inside of cells, and not in a half space
/// that is clipped.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Inside {
    /// Per ray, the end of its intervals; they begin where those of the previous one end.
    ends: Vec<u32>,
    /// Ascending and apart; the first of a ray may begin at minus infinity. Both ends are inside.
    intervals: Vec<[f64; 2]>,
}

impl Inside {
    /// The intervals of a ray.
    pub(in crate::render) fn of_ray(&self, ray: usize) -> &[[f64; 2]] {
        let begin = ray.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.intervals[begin as usize..self.ends[ray] as usize]
    }

    /// Whether a point of a ray is inside.
    #[cfg(test)]
    pub(in crate::render) fn has(&self, ray: usize, depth: f64) -> bool {
        let intervals = self.of_ray(ray);
        let next = intervals.partition_point(|[_, far]| *far < depth);
        intervals.get(next).is_some_and(|[near, _]| *near <= depth)
    }

    /// All of so many rays.
    #[cfg(test)]
    pub(in crate::render) fn everywhere(rays: usize) -> Self {
        let intervals = vec![[f64::NEG_INFINITY, f64::INFINITY]; rays];
        Self { ends: (1..=rays as u32).collect(), intervals }
    }

    /// What is inside of a boundary in a view (local coordinates), or outside by at most `within`; `None` if cancelled.
    fn of(boundary: &Boundary, clips: &[Plane], within: f64, view: &View, cancel: &Cancel) -> Option<Self> {
        let mut vertices = Vec::new();
        let no_scalars = Scalars::Cells(Arc::default());
        transform(view, &boundary.corners, &no_scalars, None, cancel, &mut vertices);
        let scene =
            Scene { faces: TiledFaces::of(view, &vertices, &boundary.faces, cancel), clips, within, view, cancel };
        let strips = (0..scene.faces.grid.rows).into_par_iter();
        let strips: Vec<Self> = strips.map_init(Strip::default, |strip, row| scene.strip(row, strip)).collect();
        let mut all = Self::default();
        all.ends.reserve(strips.iter().map(|strip| strip.ends.len()).sum());
        all.intervals.reserve(strips.iter().map(|strip| strip.intervals.len()).sum());
        for strip in strips {
            let before = all.intervals.len() as u32;
            all.ends.extend(strip.ends.iter().map(|end| before + end));
            all.intervals.extend(strip.intervals);
        }
        (!cancel.is_cancelled()).then_some(all)
    }
}

/// A way of a ray into the cells or out of them.
#[derive(Clone, Copy, Debug, Default)]
struct Way {
    /// Row of its strip times the image's width plus column.
    pixel: u32,
    is_out: bool,
    depth: f64,
}

/// Memory of a thread for a row of tiles.
#[derive(Default)]
struct Strip {
    scratch: Scratch,
    /// Ways in the order in which they are found, and by pixels.
    found: Vec<Way>,
    by_pixel: Vec<Way>,
    /// Per pixel, the end of its ways.
    ends: Vec<u32>,
}

impl Strip {
    /// Sorts what was found by pixels, and by falling depths, those out first.
    fn sort(&mut self, pixels: usize) {
        self.ends.clear();
        self.ends.resize(pixels, 0);
        self.found.iter().for_each(|way| self.ends[way.pixel as usize] += 1);
        let mut count = 0;
        self.ends.iter_mut().for_each(|end| {
            count += *end;
            *end = count - *end;
        });
        self.by_pixel.clear();
        self.by_pixel.resize(self.found.len(), Way::default());
        for way in &self.found {
            let next = &mut self.ends[way.pixel as usize];
            self.by_pixel[*next as usize] = *way;
            *next += 1;
        }
        for pixel in 0..pixels {
            let of_pixel = self.of_pixel(pixel);
            self.by_pixel[of_pixel].sort_unstable_by(|a, b| b.depth.total_cmp(&a.depth).then(b.is_out.cmp(&a.is_out)));
        }
    }

    fn of_pixel(&self, pixel: usize) -> Range<usize> {
        let begin = pixel.checked_sub(1).map_or(0, |before| self.ends[before]);
        begin as usize..self.ends[pixel] as usize
    }
}

/// What all rows of tiles need.
struct Scene<'a> {
    faces: TiledFaces<'a>,
    clips: &'a [Plane],
    within: f64,
    view: &'a View,
    cancel: &'a Cancel,
}

impl Scene<'_> {
    /// The intervals of a row of tiles.
    fn strip(&self, row: usize, strip: &mut Strip) -> Inside {
        let Self { faces, view, .. } = self;
        let width = view.width_px;
        strip.found.clear();
        for tile in row * faces.grid.columns..(row + 1) * faces.grid.columns {
            if self.cancel.is_cancelled() {
                return Inside::default();
            }
            let first = faces.grid.rect(tile).x;
            faces.draw(tile, &mut strip.scratch, |pixel, hit| {
                let pixel = (pixel / TILE_PX * width + first + pixel % TILE_PX) as u32;
                let depth = if hit.is_turned { hit.depth + self.within } else { hit.depth - self.within };
                strip.found.push(Way { pixel, is_out: hit.is_turned, depth });
            });
        }
        let rows = row * TILE_PX..view.height_px.min((row + 1) * TILE_PX);
        strip.sort(rows.len() * width);
        let mut inside = Inside::default();
        for (at, y) in rows.enumerate() {
            for (column, _) in view.rendered_in(y, 0..width) {
                let left = self.left_by_clips(view.ray(column, y));
                let ways = &strip.by_pixel[strip.of_pixel(at * width + column)];
                push_intervals(ways, left, &mut inside.intervals);
                inside.ends.push(inside.intervals.len() as u32);
            }
        }
        inside
    }

    /// The depths between which a ray is in no half space that is clipped.
    fn left_by_clips(&self, (px, py): (f64, f64)) -> [f64; 2] {
        let View { eye, right, up, forward, perspective, .. } = *self.view;
        let beside = px * right + py * up;
        let (from, per_depth) = if perspective { (eye, beside + forward) } else { (eye + beside, forward) };
        let [mut near, mut far] = [f64::NEG_INFINITY, f64::INFINITY];
        for clip in self.clips {
            let (beyond, rise) = (clip.distance(from) - self.within, clip.normal.dot(per_depth));
            if rise > 0.0 {
                far = far.min(-beyond / rise);
            } else if rise < 0.0 {
                near = near.max(-beyond / rise);
            } else if beyond > 0.0 {
                return [f64::INFINITY, f64::NEG_INFINITY];
            }
        }
        [near, far]
    }
}

/// Appends the intervals inside by the ways of a ray, of falling depths, as far as they are within others, in ascending order.
fn push_intervals(ways: &[Way], [least, most]: [f64; 2], intervals: &mut Vec<[f64; 2]>) {
    let first = intervals.len();
    let mut push = |near: f64, far: f64| {
        let [near, far] = [near.max(least), far.min(most)];
        if near <= far {
            intervals.push([near, far]);
        }
    };
    let (mut around, mut far) = (0i32, f64::NEG_INFINITY);
    for way in ways {
        if way.is_out {
            far = if around == 0 { way.depth } else { far };
            around += 1;
        } else {
            around -= 1;
            if around == 0 {
                push(way.depth, far);
            }
        }
    }
    // Without a way in, the eye is inside.
    if around > 0 {
        push(f64::NEG_INFINITY, far);
    }
    intervals[first..].reverse();
}

/// Finds where rays are inside of cells, and keeps from request to request what has not changed.
#[derive(Debug, Default)]
pub(crate) struct InsideFinder {
    of: (Weak<Mesh>, Weak<CellSet>),
    boundary: Option<Boundary>,
    found: Option<(View, Vec<Plane>, Arc<Inside>)>,
}

impl InsideFinder {
    /// Where the rays of a view (local coordinates) are inside of cells, or outside by at most `within`, and not in the half spaces that
    /// `clips` remove; `None` if cancelled. `within` is the same at all times.
    pub(in crate::render) fn find(
        &mut self,
        (mesh, cells): (&Arc<Mesh>, &Arc<CellSet>),
        clips: &[Plane],
        within: f64,
        view: &View,
        cancel: &Cancel,
    ) -> Option<Arc<Inside>> {
        let (of_mesh, of_cells) = &self.of;
        if of_mesh.as_ptr() != Arc::as_ptr(mesh) || of_cells.as_ptr() != Arc::as_ptr(cells) {
            *self = Self { of: (Arc::downgrade(mesh), Arc::downgrade(cells)), ..Self::default() };
        }
        if let Some((of_view, of_clips, found)) = &self.found
            && of_view == view
            && of_clips == clips
        {
            return Some(found.clone());
        }
        if self.boundary.is_none() {
            self.boundary = Some(Boundary::of(mesh, cells, cancel)?);
        }
        let found = Arc::new(Inside::of(self.boundary.as_ref()?, clips, within, view, cancel)?);
        self.found = Some((view.clone(), clips.to_vec(), found.clone()));
        Some(found)
    }
}

#[cfg(test)]
#[path = "inside_tests.rs"]
mod tests;
