//! What cannot be drawn of cells without connectivity.

use super::{DrawnBy, FrameRequest, RequestError, TetLayer};
use crate::mesh::Mesh;

/// Refuses what goes from cell to cell of a mesh without connectivity.
///
/// # Errors
/// The first of these that the layer or the request has.
pub(super) fn check(mesh: &Mesh, layer: &TetLayer, by: DrawnBy, request: &FrameRequest) -> Result<(), RequestError> {
    if mesh.is_connected {
        return Ok(());
    }
    first(&of_neighbours(layer, by, request), RequestError::Unconnected)
}

fn first(needs: &[(bool, &'static str)], error: fn(&'static str) -> RequestError) -> Result<(), RequestError> {
    needs.iter().find(|(is_there, _)| *is_there).map_or(Ok(()), |(_, what)| Err(error(what)))
}

/// What goes from cell to cell, and whether it is asked for.
fn of_neighbours(layer: &TetLayer, by: DrawnBy, request: &FrameRequest) -> [(bool, &'static str); 7] {
    let has_edges = request.upsampling.is_some_and(|upsampling| upsampling.filter.edges().is_some());
    [
        (by == DrawnBy::Raycast, "the rays of raycast"),
        (by.faces().is_some(), "the faces of havs"),
        (request.samples.contrast().is_some(), "rays that contrast asks for"),
        (!layer.parts.is_empty(), "connected parts"),
        (!layer.domain.is_empty(), "surfaces of the domain and of regions"),
        (has_edges, "edges of an image that is enlarged"),
        (request.residual.is_some(), "details of earlier frames"),
    ]
}
