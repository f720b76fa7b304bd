//! The surfaces of the domain and of regions: their cells and faces from request to request, and their fragments.

use super::TetLayer;
use super::in_sight::RegionCells;
use super::region_values::RegionValues;
use crate::field::Regions;
use crate::mesh::{Mesh, Plane};
use crate::node_table::NodeTable;
use crate::render::domain::{DomainFaces, DomainScene, DomainSurface, Shell};
use crate::render::surfaces::SurfaceShading;
use crate::render::{LayerFragments, RenderError, RenderJob};
use crate::visibility::{Activity, CellSet, PartCells};
use std::sync::Arc;

/// Finds the surfaces around cells from request to request.
#[derive(Debug, Default)]
pub(super) struct Shells {
    of_domain: DomainFaces,
    of_regions: Vec<RegionShell>,
    all: Arc<CellSet>,
    part_cells: PartCells,
}

/// The surface of some regions.
#[derive(Debug)]
struct RegionShell {
    regions: Regions,
    /// Whether cells without finite scalars belong to it.
    is_whole: bool,
    cells: RegionCells,
    faces: DomainFaces,
}

/// Cells that surfaces are around, and the values by which regions are chosen.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShellCells<'a> {
    /// The cells of the domain: those that are shown, with finite scalars.
    pub(super) domain: &'a Arc<CellSet>,
    /// The same of all regions, shown or not.
    pub(super) of_all_regions: &'a Arc<CellSet>,
    pub(super) region_values: &'a RegionValues,
}

impl Shells {
    /// The surfaces of a layer with their cells. The surface of a region is around its cells in the parts of the mesh that are shown,
    /// whatever regions the volume has; without a colour of its own it needs finite scalars.
    pub(super) fn update(&mut self, layer: &TetLayer, mesh: &Arc<Mesh>, of: ShellCells<'_>) -> Vec<Shell> {
        let asked = |known: &RegionShell| {
            layer.domain.iter().any(|surface| key(surface) == Some((&known.regions, known.is_whole)))
        };
        self.of_regions.retain(asked);
        let shell = |surface: &DomainSurface| Shell {
            cells: key(surface).map_or_else(|| of.domain.clone(), |key| self.cells_of(key, layer, mesh, of)),
            surface: surface.clone(),
        };
        let shells: Vec<Shell> = layer.domain.iter().map(shell).collect();
        for Shell { surface, cells } in &shells {
            self.faces_of(surface).into_iter().for_each(|faces| faces.update(mesh, cells));
        }
        shells
    }

    /// The cells of regions.
    fn cells_of(
        &mut self,
        (regions, is_whole): (&Regions, bool),
        layer: &TetLayer,
        mesh: &Arc<Mesh>,
        ShellCells { of_all_regions, region_values, .. }: ShellCells<'_>,
    ) -> Arc<CellSet> {
        let cells = if is_whole { self.all_cells(layer, mesh) } else { of_all_regions.clone() };
        let Some(values) = region_values.of(regions) else { return cells };
        let known = self.of_regions.iter().position(|known| (&known.regions, known.is_whole) == (regions, is_whole));
        let place = known.unwrap_or_else(|| {
            let (cells, faces) = Default::default();
            self.of_regions.push(RegionShell { regions: regions.clone(), is_whole, cells, faces });
            self.of_regions.len() - 1
        });
        let cells = Activity { finite: cells.clone(), active: cells, classified: 0 };
        self.of_regions[place].cells.restrict(regions, values, cells).finite
    }

    /// All cells of the parts that are shown.
    fn all_cells(&mut self, layer: &TetLayer, mesh: &Arc<Mesh>) -> Arc<CellSet> {
        let count = mesh.topology.tets.len();
        if self.all.universe() != count {
            self.all = Arc::new(CellSet::all(count));
        }
        let all = Activity { finite: self.all.clone(), active: self.all.clone(), classified: 0 };
        if layer.parts.is_empty() { all.finite } else { self.part_cells.restrict(mesh, &layer.parts, all).finite }
    }

    fn faces_of(&mut self, surface: &DomainSurface) -> Option<&mut DomainFaces> {
        let Some(key) = key(surface) else { return Some(&mut self.of_domain) };
        let found = self.of_regions.iter_mut().find(|known| (&known.regions, known.is_whole) == key);
        found.map(|known| &mut known.faces)
    }

    /// The fragments of a job's shells in its view, in the order of the shells; `None` without any. `colors` are those of scalars.
    ///
    /// # Errors
    /// If a fragment is out of range.
    pub(super) fn fragments(
        &mut self,
        job: &RenderJob,
        shading: SurfaceShading,
        colors: &NodeTable,
        clips: &[Plane],
    ) -> Result<Option<Arc<LayerFragments>>, RenderError> {
        if job.shells.is_empty() {
            return Ok(None);
        }
        let view = job.local_view();
        let (mesh, scalars) = (&*job.mesh, &job.scalars);
        let scene = DomainScene { mesh, scalars, colors, shading, view: &view, clips };
        let of_shell = |Shell { surface, .. }: &Shell| match self.faces_of(surface) {
            Some(faces) => faces.fragments(surface, &scene),
            None => Vec::new(),
        };
        let (width, height) = view.plane_px();
        let fragments = LayerFragments::new(width * height, job.shells.iter().flat_map(of_shell))?;
        Ok(Some(Arc::new(fragments)))
    }
}

/// The regions of a surface, and whether cells without finite scalars belong to it; `None` for the domain's.
fn key(surface: &DomainSurface) -> Option<(&Regions, bool)> {
    surface.regions.as_ref().map(|regions| (regions, surface.color.is_some()))
}
