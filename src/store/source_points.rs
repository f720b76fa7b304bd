//! The coordinates of the source, beside those that are drawn.
//!
//! A mesh is drawn from f32 coordinates in a local frame (see [`Positions`]). Shifting rounds, so shifting back gives the source's
//! coordinates to within 2^-25 of the frame, not bit for bit. Where it does not reproduce all of them, a store keeps the source's, for
//! export only.

use super::array::StoredArray;
use super::layout::MESH;
use super::mesh::ArrayWriter;
use crate::codec::{Chunking, ElementType, ReadRange};
use crate::error::FileResult;
use crate::mesh::Positions;
use glam::{DVec3, Vec3};
use serde_json::Map;
use std::path::Path;

/// Name of the array: f32 if that is exact for the source's points, else f64; one row per vertex of the store.
const NAME: &str = "source_points";

/// Points of a source before they were rounded, in source order.
#[derive(Clone, Debug, PartialEq)]
pub struct SourcePoints(Points);

#[derive(Clone, Debug, PartialEq)]
enum Points {
    Single(Vec<[f32; 3]>),
    Double(Vec<[f64; 3]>),
}

impl SourcePoints {
    /// Copies points, in half the memory if f32 is exact for all of them.
    pub fn of(points: &[DVec3]) -> Self {
        let is_single = |p: &DVec3| p.as_vec3().as_dvec3() == *p;
        Self(match points.iter().all(is_single) {
            true => Points::Single(points.iter().map(|p| p.as_vec3().to_array()).collect()),
            false => Points::Double(points.iter().map(|p| p.to_array()).collect()),
        })
    }

    /// `None` beyond the points of the source: vertices that were added are numbered on from them.
    fn get(&self, index: u32) -> Option<DVec3> {
        match &self.0 {
            Points::Single(points) => points.get(index as usize).map(|&p| Vec3::from_array(p).as_dvec3()),
            Points::Double(points) => points.get(index as usize).map(|&p| DVec3::from_array(p)),
        }
    }

    /// Writes the points of the vertices, unless the positions give them back bit for bit. Vertices that were added have their positions.
    pub(super) fn write(&self, root: &Path, positions: &Positions, vertex_source: &[u32]) -> FileResult<()> {
        let is_given = |(vertex, &source)| self.get(source).is_none_or(|point| positions.world(vertex) == point);
        if vertex_source.iter().enumerate().all(is_given) {
            return Ok(());
        }
        let world = |vertex: usize| positions.world(vertex);
        let mut to = ArrayWriter::new(root, MESH);
        let axes = ["vertex", "axis"];
        match &self.0 {
            Points::Single(points) => {
                let points = gather(points, vertex_source, |vertex| world(vertex).as_vec3().to_array());
                to.write(NAME, &points, axes, Map::new())
            }
            Points::Double(points) => {
                to.write(NAME, &gather(points, vertex_source, |vertex| world(vertex).to_array()), axes, Map::new())
            }
        }
    }
}

fn gather<T: Copy>(points: &[T], vertex_source: &[u32], added: impl Fn(usize) -> T) -> Vec<T> {
    let point =
        |(vertex, &source): (usize, &u32)| points.get(source as usize).copied().unwrap_or_else(|| added(vertex));
    vertex_source.iter().enumerate().map(point).collect()
}

/// The source's point of each vertex; `None` if the positions give them back, or the store is older.
pub(super) fn read(root: &Path, source: &dyn ReadRange, vertices: u64) -> FileResult<Option<Vec<DVec3>>> {
    if !root.join(MESH).join(NAME).join("zarr.json").exists() {
        return Ok(None);
    }
    let open = |element| {
        let array = StoredArray::open(root, &format!("{MESH}/{NAME}"), element, Chunking::Whole, 2)?;
        array.expect_shape(&[vertices, 3])
    };
    let error = match open(ElementType::F32) {
        Ok(array) => {
            let points = array.read::<f32, 3>(source)?;
            return Ok(Some(points.into_iter().map(|p| Vec3::from_array(p).as_dvec3()).collect()));
        }
        Err(error) => error,
    };
    let Ok(array) = open(ElementType::F64) else { return Err(error) };
    Ok(Some(array.read::<f64, 3>(source)?.into_iter().map(DVec3::from_array).collect()))
}
