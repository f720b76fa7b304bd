//! Meshes of points alone, each a ball of its own: clouds, as of particles.
//!
//! ```text
//! keep      points of finite positive radius and volume, each once       the others are counted
//! place     box of their balls -> f64 origin, power-of-two scale; positions and radii rounded to f32
//! order     by Hilbert index, as the vertices of a mesh are: cell i is vertex i
//! ```
//! Every ball lies within [-1, 1]^3, so that no radius is too large. One below 2^-149 of the box has no extent in f32 and is left out.
//! A volume is kept as its ratio to that of the ball, the filling: light in the ball has the chord times that to go.
//!
//! In memory, cell i has vertex i at each of its corners, so that what goes by cells, as sets of active ones, their order and levels of
//! detail, needs no other path. It has no volume, and no faces: what looks into cells is refused before it gets here.

use super::curve::{curve_index, sort_along_curve};
use super::geometry::filling;
use super::positions::LocalFrame;
use super::repair::{check_counts, check_indices};
use super::{Mesh, MeshError, Positions, RawMesh, RepairReport, SplitCells, Topology};
use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

/// What is particular to a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CloudReport {
    /// The least and the greatest radius, in world units.
    pub radius: [f64; 2],
    /// The least and the greatest volume, in world units, if the source has some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<[f64; 2]>,
    /// Whether radii are half the distances to the fourth nearest neighbours, as the source has none.
    pub estimated: bool,
    /// Points left out as their radius is not above zero, or not finite, or below 2^-149 of the box.
    pub without_radius: u64,
    /// Points left out as their volume is not above zero, or not finite, or its ratio to that of the ball is beyond f32.
    pub without_volume: u64,
}

/// A point that is kept.
#[derive(Clone, Copy)]
struct Ball {
    /// Its index as a cell, and as a point, in the source.
    cell: u32,
    vertex: u32,
    /// World units.
    radius: f64,
    filling: f32,
}

impl Mesh {
    /// A cloud of the points that are cells of `raw`. Points without a radius or volume, or named again, are dropped and counted. Where no
    /// radii are known, each is half the distance to the fourth nearest point, or to the farthest of fewer.
    ///
    /// # Errors
    /// If there are too many points, one is missing or not finite, lengths differ, or none with a radius remains.
    pub fn build_cloud(raw: &RawMesh) -> Result<(Mesh, RepairReport), MeshError> {
        let (all, cells) = (&raw.points, &raw.cells.points);
        check_counts(cells.len(), all.len())?;
        check_indices(&cells.iter().map(|&vertex| [vertex; 4]).collect::<Vec<_>>(), all.len())?;
        if cells.is_empty() {
            return Err(MeshError::NoCells);
        }
        if let Some(&point) = cells.iter().find(|&&vertex| !all[vertex as usize].is_finite()) {
            return Err(MeshError::NotFinite { point: point as usize, position: all[point as usize] });
        }
        let estimated = raw.cells.radii.is_empty();
        let radii = if estimated { estimated_radii(all, cells)? } else { raw.cells.radii.clone() };
        super::topology::check_length("radii", radii.len(), cells.len())?;
        let volumes = Some(&raw.cells.volumes[..]).filter(|volumes| !volumes.is_empty());
        volumes.map_or(Ok(()), |volumes| super::topology::check_length("volumes", volumes.len(), cells.len()))?;

        let mut is_met = vec![false; all.len()];
        let mut kept = Vec::with_capacity(cells.len());
        let (mut duplicates, mut without_radius, mut without_volume) = (0, 0, 0);
        let is_size = |size: f64| size > 0.0 && size.is_finite();
        for (cell, (&vertex, &radius)) in (0u32..).zip(cells.iter().zip(&radii)) {
            if std::mem::replace(&mut is_met[vertex as usize], true) {
                duplicates += 1;
            } else if !is_size(radius) {
                without_radius += 1;
            } else if volumes.is_some_and(|volumes| !is_size(volumes[cell as usize])) {
                without_volume += 1;
            } else {
                kept.push(Ball { cell, vertex, radius, filling: 1.0 });
            }
        }
        let frame_of = |kept: &[Ball]| frame_of(kept.iter().map(|ball| (all[ball.vertex as usize], ball.radius)));
        let frame = frame_of(&kept)?;
        let local_radius = |frame: &LocalFrame, ball: &Ball| (ball.radius / frame.scale) as f32;
        kept.iter_mut().for_each(|ball| {
            ball.radius = frame.scale * f64::from(local_radius(&frame, ball));
            let filling = |volumes: &[f64]| filling(volumes[ball.cell as usize], ball.radius) as f32;
            ball.filling = volumes.map_or(1.0, filling);
        });
        let before = kept.len();
        kept.retain(|ball| ball.radius > 0.0);
        without_radius += (before - kept.len()) as u64;
        let before = kept.len();
        kept.retain(|ball| is_size(ball.filling.into()));
        without_volume += (before - kept.len()) as u64;
        if kept.is_empty() {
            let all = cells.len();
            return Err(if without_volume > 0 { MeshError::NoVolumes(all) } else { MeshError::NoRadii(all) });
        }
        // By the radii that are kept, so that a cloud of these has the same frame.
        let frame = frame_of(&kept)?;
        let key =
            |(at, ball): (usize, &Ball)| (curve_index(frame.local(all[ball.vertex as usize]).as_dvec3()), at as u32);
        let order = sort_along_curve(kept.par_iter().enumerate().map(key).collect());
        let kept: Vec<Ball> = order.into_iter().map(|(_, at)| kept[at as usize]).collect();

        let range = |sizes: &[f64]| {
            let sizes = kept.iter().map(|ball| sizes[ball.cell as usize]);
            sizes.fold([f64::INFINITY, 0.0f64], |[lo, hi], size| [lo.min(size), hi.max(size)])
        };
        let (radius, volume) = (range(&radii), volumes.map(range));
        let local = kept.iter().map(|ball| frame.local(all[ball.vertex as usize])).collect();
        let positions = Positions { origin: frame.origin, scale: frame.scale, local };
        let sources = [kept.iter().map(|ball| ball.vertex).collect(), kept.iter().map(|ball| ball.cell).collect()];
        let local_radii = kept.iter().map(|ball| local_radius(&frame, ball)).collect();
        let filling = volumes.map(|_| kept.iter().map(|ball| ball.filling).collect());
        let mesh = Self::of_cloud(positions, sources, (local_radii, filling))?;
        let count = kept.len() as u64;
        let report = RepairReport {
            cells_in: cells.len() as u64,
            vertices_in: all.len() as u64,
            cells_out: count,
            vertices_out: count,
            duplicate_cells: duplicates,
            unreferenced_vertices: is_met.iter().filter(|is_met| !**is_met).count() as u64,
            cloud: Some(CloudReport { radius, volume, estimated, without_radius, without_volume }),
            ..RepairReport::default()
        };
        Ok((mesh, report))
    }

    /// A cloud of parts that fit: what [`Self::build_cloud`] makes, and a store has.
    ///
    /// # Errors
    /// If there are too many points.
    pub(crate) fn of_cloud(
        positions: Positions,
        sources: [Vec<u32>; 2],
        (radii, filling): (Vec<f32>, Option<Vec<f32>>),
    ) -> Result<Self, MeshError> {
        check_counts(radii.len(), radii.len())?;
        let count = radii.len() as u32;
        let topology = Topology::of_cells(count, (0..count).map(|vertex| [vertex; 4]).collect());
        let cell_turned = vec![false; radii.len()];
        let mut mesh = Self::of_parts(topology, positions, sources, cell_turned, SplitCells::default());
        mesh.without_far_parts = Some(mesh.box_of_balls(&radii));
        (mesh.is_connected, mesh.radii, mesh.filling) = (false, Some(radii), filling);
        Ok(mesh)
    }

    /// The box of all balls, in world coordinates.
    fn box_of_balls(&self, radii: &[f32]) -> (DVec3, DVec3) {
        let balls = (0..radii.len()).map(|at| (self.positions.world(at), self.positions.scale * f64::from(radii[at])));
        box_of(balls)
    }

    /// Whether the mesh is of points alone.
    pub fn is_cloud(&self) -> bool {
        self.radii.is_some()
    }
}

pub(super) fn box_of(balls: impl Iterator<Item = (DVec3, f64)>) -> (DVec3, DVec3) {
    let ends = balls.map(|(center, radius)| (center - radius, center + radius));
    ends.reduce(|(lo, hi), (a, b)| (lo.min(a), hi.max(b))).unwrap_or_default()
}

/// The frame around balls.
///
/// # Errors
/// If it is too large for f64.
fn frame_of(balls: impl Iterator<Item = (DVec3, f64)>) -> Result<LocalFrame, MeshError> {
    let (lo, hi) = box_of(balls);
    if !(lo.is_finite() && hi.is_finite()) {
        return Err(MeshError::TooLarge(f64::INFINITY));
    }
    LocalFrame::around(lo, hi)
}

/// The radii of points that have none.
#[cfg(feature = "clouds")]
fn estimated_radii(points: &[DVec3], cells: &[u32]) -> Result<Vec<f64>, MeshError> {
    Ok(super::cloud_radii::estimated_radii(points, cells))
}

/// A build without the feature `clouds` has no search for neighbours.
#[cfg(not(feature = "clouds"))]
fn estimated_radii(_: &[DVec3], _: &[u32]) -> Result<Vec<f64>, MeshError> {
    Err(MeshError::NoNeighbours)
}
