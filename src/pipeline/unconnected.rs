//! What cannot be drawn of cells without connectivity, and of points without cells.

use super::{DrawnBy, FrameRequest, RequestError, TetLayer};
use crate::mesh::Mesh;
use crate::render::points::Footprint;

/// Refuses what goes from cell to cell of a mesh without connectivity, and what needs cells of a cloud.
///
/// # Errors
/// The first of these that the layer or the request has.
pub(super) fn check(mesh: &Mesh, layer: &TetLayer, by: DrawnBy, request: &FrameRequest) -> Result<(), RequestError> {
    if mesh.is_connected {
        return Ok(());
    }
    if mesh.is_cloud() {
        return first(&of_cells(layer, by), RequestError::OfPoints)
            .and_then(|()| first(&of_neighbours(mesh, layer, by, request), RequestError::OfPoints));
    }
    first(&of_neighbours(mesh, layer, by, request), RequestError::Unconnected)
}

fn first(needs: &[(bool, &'static str)], error: fn(&'static str) -> RequestError) -> Result<(), RequestError> {
    needs.iter().find(|(is_there, _)| *is_there).map_or(Ok(()), |(_, what)| Err(error(what)))
}

/// What goes from cell to cell, and whether it is asked for.
fn of_neighbours(mesh: &Mesh, layer: &TetLayer, by: DrawnBy, request: &FrameRequest) -> [(bool, &'static str); 8] {
    let has_edges = request.upsampling.is_some_and(|upsampling| upsampling.filter.edges().is_some());
    [
        (by == DrawnBy::Raycast, "the rays of raycast"),
        (by.faces().is_some(), "the faces of havs"),
        (by.is_of_functions() && !mesh.is_cloud(), "functions at the vertices"),
        (request.samples.contrast().is_some(), "rays that contrast asks for"),
        (!layer.parts.is_empty(), "connected parts"),
        (!layer.domain.is_empty(), "surfaces of the domain and of regions"),
        (has_edges, "edges of an image that is enlarged"),
        (request.residual.is_some(), "details of earlier frames"),
    ]
}

/// What looks into cells, and whether it is asked for.
fn of_cells(layer: &TetLayer, by: DrawnBy) -> [(bool, &'static str); 5] {
    let is_exact = by.points().is_some_and(|style| style.footprint == Footprint::Exact);
    [
        (by == DrawnBy::Reference, "segments of the reference"),
        (is_exact, "exact footprints"),
        (!layer.surfaces.is_empty(), "isosurfaces"),
        (layer.cuts.iter().any(|cut| !cut.clips), "sections"),
        (layer.shading.volume || layer.table.joint().is_some(), "gradients"),
    ]
}
