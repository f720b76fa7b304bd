//! Surfaces around cells, drawn as a surface, as the edges of its faces, or as feature edges: that of the domain (the faces behind which
//! there is no cell with finite scalars), and those of regions (the faces between a cell of the region and any other cell, or none).
//!
//! They are not media in the cells but a layer beside them: their [fragments](crate::render::LayerFragments) are computed before the cells
//! are drawn, by any renderer. A face that two surfaces share has the same depth to the bit in both, whichever of its cells it is seen
//! from: the surface that is asked for first lies in front.

mod faces;
mod lines;
mod text;

use super::layers::LayerFragment;
use super::surfaces::{Normals, SurfaceShading, brightness};
use crate::camera::View;
use crate::field::{Regions, Scalars};
use crate::mesh::{Mesh, NONE, Plane};
use crate::node_table::NodeTable;
use crate::visibility::CellSet;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Weak};

/// How the surface of the domain is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DomainStyle {
    /// A surface.
    #[default]
    Solid,
    /// The edges of its faces.
    Wireframe,
    /// Feature edges: where the surface turns by more than 30 degrees, ends or meets itself.
    Edges,
}

/// A drawing of the surface of the domain, or of regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DomainSurface {
    /// How it is drawn.
    pub style: DomainStyle,
    /// The regions around which it is; `None`: the domain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regions: Option<Regions>,
    /// Display-referred colour, 0..=1; `None`: the transfer function's colour of the scalars.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<[f64; 3]>,
    /// Opacity, 0..=1.
    #[serde(default = "super::surfaces::opaque")]
    pub opacity: f64,
}

/// A drawing with the cells around which it is.
#[derive(Clone, Debug)]
pub struct Shell {
    /// The drawing.
    pub surface: DomainSurface,
    /// The cells: a face with one of them on one of its sides alone is on the surface.
    pub cells: Arc<CellSet>,
}

/// Checks that colours and opacities are in range.
///
/// # Errors
/// If a colour or an opacity lies outside of 0..=1.
pub fn check(domain: &[DomainSurface]) -> Result<(), String> {
    let shares = domain.iter().flat_map(|surface| surface.color.into_iter().flatten().chain([surface.opacity]));
    match shares.into_iter().find(|share| !(0.0..=1.0).contains(share)) {
        None => Ok(()),
        Some(share) => Err(format!("the domain has a colour or an opacity of {share}; both lie between 0 and 1")),
    }
}

/// Cosine of the angle between outward normals of two faces above which their edge is no feature edge.
const SMOOTH: f64 = 0.866_025_403_784_438_6;

/// The faces and edges of the surface around some cells of a mesh; cached while both are unchanged.
#[derive(Debug, Default)]
pub struct DomainFaces {
    of: Weak<Mesh>,
    cells: Weak<CellSet>,
    /// Vertices of the faces, ascending, and their cells.
    faces: Vec<([u32; 3], u32)>,
    /// Vertices of all edges, ascending, and of the feature edges, each with a cell of the surface.
    edges: Vec<([u32; 2], u32)>,
    turns: Vec<([u32; 2], u32)>,
}

impl DomainFaces {
    /// Updates the faces and edges for these cells.
    pub fn update(&mut self, mesh: &Arc<Mesh>, cells: &Arc<CellSet>) {
        if self.of.as_ptr() == Arc::as_ptr(mesh) && self.cells.as_ptr() == Arc::as_ptr(cells) {
            return;
        }
        let connectivity = mesh.topology.connectivity();
        let is_in = |cell: u32| cell != NONE && cells.contains(cell);
        // Faces with their single cell of these.
        let found: Vec<([u32; 3], u32)> = connectivity
            .faces
            .par_iter()
            .zip(&connectivity.face_cells)
            .filter_map(|(face, &[a, b])| match (is_in(a), is_in(b)) {
                (true, false) => Some((*face, a)),
                (false, true) => Some((*face, b)),
                _ => None,
            })
            .collect();
        let mut sides: Vec<([u32; 2], DVec3, u32)> = found
            .par_iter()
            .flat_map_iter(|&([a, b, c], cell)| {
                let outward = outward(mesh, [a, b, c], cell);
                [[a, b], [a, c], [b, c]].map(|edge| (edge, outward, cell))
            })
            .collect();
        sides.par_sort_by_key(|(edge, ..)| *edge);
        let of_edges = || sides.chunk_by(|a, b| a.0 == b.0);
        let is_turn = |of_edge: &&[([u32; 2], DVec3, u32)]| match of_edge {
            [(_, a, _), (_, b, _)] => a.dot(*b) < SMOOTH,
            _ => true,
        };
        let first = |of_edge: &[([u32; 2], DVec3, u32)]| (of_edge[0].0, of_edge[0].2);
        self.edges = of_edges().map(first).collect();
        self.turns = of_edges().filter(is_turn).map(first).collect();
        self.faces = found;
        (self.of, self.cells) = (Arc::downgrade(mesh), Arc::downgrade(cells));
    }

    /// The fragments of a surface in a view (local coordinates), each with its pixel's index in the plane.
    pub(crate) fn fragments(&self, surface: &DomainSurface, scene: &DomainScene<'_>) -> Fragments {
        let of_edge = |&(edge, cell): &([u32; 2], u32)| lines::fragments(edge, cell, surface, scene);
        match surface.style {
            DomainStyle::Solid => {
                let of_face = |&(face, cell): &([u32; 3], u32)| faces::fragments(face, cell, surface, scene);
                self.faces.par_iter().flat_map_iter(of_face).collect()
            }
            DomainStyle::Wireframe => self.edges.par_iter().flat_map_iter(of_edge).collect(),
            DomainStyle::Edges => self.turns.par_iter().flat_map_iter(of_edge).collect(),
        }
    }
}

/// Fragments, each with its pixel's index in the plane.
type Fragments = Vec<(u32, LayerFragment)>;

/// The outward unit normal of a face; 0 if the face is degenerate.
fn outward(mesh: &Mesh, face: [u32; 3], cell: u32) -> DVec3 {
    let at = |vertex: u32| mesh.positions.local[vertex as usize].as_dvec3();
    let [a, b, c] = face.map(at);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let behind = mesh.topology.tets[cell as usize].into_iter().find(|vertex| !face.contains(vertex));
    if behind.is_some_and(|vertex| normal.dot(at(vertex) - a) > 0.0) { -normal } else { normal }
}

/// Scene data from which the surface of the domain is drawn.
pub(crate) struct DomainScene<'a> {
    pub(crate) mesh: &'a Mesh,
    pub(crate) scalars: &'a Scalars,
    /// Colours by scalar.
    pub(crate) colors: &'a NodeTable,
    pub(crate) shading: SurfaceShading,
    /// The view in local coordinates.
    pub(crate) view: &'a View,
    pub(crate) clips: &'a [Plane],
}

impl DomainScene<'_> {
    /// View coordinates of a vertex.
    fn in_view(&self, vertex: u32) -> DVec3 {
        self.view.to_view(self.mesh.positions.local[vertex as usize].as_dvec3())
    }

    /// The scalar at a vertex of a cell.
    fn scalar(&self, cell: u32, vertex: u32) -> f64 {
        f64::from(match self.scalars {
            Scalars::Vertices(scalars) => scalars[vertex as usize],
            Scalars::Cells(scalars) => scalars[cell as usize],
        })
    }

    /// The fragment at a point (view coordinates) with a scalar, unless it is clipped; `light` scales its colour.
    fn fragment(
        &self,
        surface: &DomainSurface,
        at: DVec3,
        scalar: f64,
        light: f64,
        opacity: f64,
    ) -> Option<LayerFragment> {
        let View { eye, right, up, forward, .. } = *self.view;
        let local = eye + at.x * right + at.y * up + at.z * forward;
        if self.clips.iter().any(|clip| clip.distance(local) > 0.0) {
            return None;
        }
        let rgb = surface.color.unwrap_or_else(|| self.colors.eval(scalar).rgb);
        let [r, g, b] = rgb.map(|c| (c * light * opacity) as f32);
        Some(LayerFragment { depth: at.z * self.mesh.positions.scale, rgba: [r, g, b, opacity as f32] })
    }

    /// The cosine between a normal (view coordinates), turned towards the eye at a point, and the light; 1 without a normal.
    fn light_on(&self, normal: DVec3, at: DVec3) -> f64 {
        let View { right, up, forward, perspective, .. } = *self.view;
        if self.shading.normals == Normals::None {
            return 1.0;
        }
        let in_view = |light| DVec3::new(right.dot(light), up.dot(light), forward.dot(light));
        brightness(normal, if perspective { at } else { DVec3::Z }, self.shading.towards_light().map(in_view))
    }
}

#[cfg(test)]
mod tests;
