//! Check that a source has the mesh of a store.

use crate::error::{FileError, FileResult};
use crate::field::SeriesSource;
use crate::mesh::{ConnectivityChoice, Mesh, RawMesh, split, split_from_corners};
use crate::store::Store;
use glam::DVec3;
use std::collections::HashSet;

/// Fails unless `raw`, the mesh of `source`, has the points, bit for bit, and the cells in order that the store's mesh was built from.
/// Cells dropped by the import must be dropped again.
pub(super) fn check(source: &dyn SeriesSource, raw: RawMesh, store: &Store, mesh: &Mesh) -> FileResult<()> {
    let differs = |problem: String| {
        FileError::unsupported(
            source.describe(),
            "mesh",
            format!("is not that of {}: {problem}", store.path().display()),
        )
        .remedy("steps of a mesh that moved or was refined cannot be appended; import them to a store of their own")
    };
    let counts = [raw.points.len(), raw.cells.len()];
    if let Some([points, cells]) = store.source_counts()
        && [points, cells] != counts.map(|n| n as u64)
    {
        return Err(differs(format!("{} points and {} cells instead of {points} and {cells}", counts[0], counts[1])));
    }
    let kept = store.source_points()?;
    let expected = |vertex: usize| kept.as_ref().map_or_else(|| mesh.positions.world(vertex), |points| points[vertex]);
    // Vertices that were added follow from the others.
    let added: HashSet<u32> = mesh.split_cells.steiner.iter().map(|&[_, vertex]| vertex).collect();
    let of_source = (0u32..).zip(&mesh.vertex_source).filter(|(vertex, _)| !added.contains(vertex));
    for (vertex, &index) in of_source.map(|(vertex, index)| (vertex as usize, index)) {
        let (found, expected) = (raw.points.get(index as usize), expected(vertex));
        if found != Some(&expected) {
            let at = |p: &DVec3| format!("{:?}", p.to_array());
            let found = found.map_or("missing".to_owned(), |p| format!("at {}", at(p)));
            return Err(differs(format!("point {index} is {found} instead of at {}", at(&expected))));
        }
    }
    if mesh.is_cloud() && raw.cells.are_points() {
        return Ok(());
    }
    if mesh.is_cloud() || raw.cells.are_points() {
        return Err(differs("one is of points alone".to_owned()));
    }
    // Older versions added no vertices.
    let split = if added.is_empty() { split_from_corners } else { split }(raw.cells, &raw.points);
    for (tet, &index) in mesh.topology.tets.iter().zip(&mesh.cell_source) {
        let [a, b, c, d] = tet.map(|v| mesh.vertex_source[v as usize]);
        let found = split.of_cell(index);
        // An older store does not record the orientation; the cell is the same.
        if !found.iter().any(|found| [[a, b, c, d], [a, b, d, c]].contains(found)) {
            let found = found.first().map_or("is missing".to_owned(), |tet| format!("joins points {tet:?}"));
            return Err(differs(format!("cell {index} {found} instead of {:?}", [a, b, c, d])));
        }
    }
    if split.tets.len() == mesh.cell_source.len() {
        return Ok(());
    }
    match Mesh::build_split(raw.points, split, ConnectivityChoice::None) {
        Ok((built, _)) if built.cell_source == mesh.cell_source => Ok(()),
        _ => Err(differs("other cells are flat or duplicates".to_owned())),
    }
}
