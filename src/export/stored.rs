//! A store as a source: its steps decoded, in the numbering of the file that it was imported from.
//!
//! The store has the source index of each vertex and cell. Points and cells dropped by the import (points that no cell used, flat and
//! duplicate cells) are missing; the others keep their order. Cells that were split come back by their corners: voxels as
//! hexahedra, curved cells as linear ones, polyhedra with their faces seen from one side. Cells with reversed
//! orientation are reversed back. Vertices that the import added in the middle of cells are left out. Points are those of the source, bit for bit. (A store of an older version gives them to within 2^-25 of
//! its frame, which is half the longest side of the mesh's box, rounded up to a power of two.)

use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldInfo, FieldSelector, SeriesSource, TimeAxis};
use crate::mesh::{Cells, Mesh, RawMesh, Solids, ball_volume};
use crate::store::{FieldReader, Store, StoredField};
use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};

/// Fields of a store as a [`SeriesSource`].
pub struct StoredSeries<'a> {
    store: &'a Store,
    mesh: RawMesh,
    fields: Vec<FieldInfo>,
    /// Readers of each field's components.
    readers: Vec<Vec<FieldReader>>,
    /// The store's vertex of each point of `mesh`, and its first cell of each cell.
    vertices: Vec<u32>,
    cells: Vec<u32>,
    /// Values of a step in store order.
    buffer: Mutex<Vec<f32>>,
}

impl<'a> StoredSeries<'a> {
    /// A source with the fields that `selectors` name, or all. The components of a vector that the store has completely become one field
    /// again; its magnitude is omitted unless it is selected.
    ///
    /// # Errors
    /// If the mesh cannot be read, or a field does not exist.
    pub fn new(store: &'a Store, selectors: &[FieldSelector]) -> FileResult<Self> {
        let mesh = store.mesh()?;
        let Mesh { topology, positions, vertex_source, cell_source, cell_turned, split_cells, radii, filling, .. } =
            &mesh;
        let added: HashSet<u32> = split_cells.steiner.iter().map(|&[_, vertex]| vertex).collect();
        let mut vertices = order_of(vertex_source);
        vertices.retain(|vertex| !added.contains(vertex));
        let as_read = store.source_points()?;
        let point = |v: u32| as_read.as_ref().map_or_else(|| positions.world(v as usize), |points| points[v as usize]);
        let points = vertices.iter().map(|&v| point(v)).collect();
        let mut ranks = vec![0; vertex_source.len()];
        for (rank, &vertex) in (0_u32..).zip(&vertices) {
            ranks[vertex as usize] = rank;
        }
        let by_source = order_of(cell_source);
        let mut cells = by_source.clone();
        cells.retain(|&cell| split_cells.source.binary_search(&cell_source[cell as usize]).is_err());
        let tet = |&cell: &u32| {
            let [a, b, c, d] = topology.tets[cell as usize].map(|v| ranks[v as usize]);
            if cell_turned[cell as usize] { [a, b, d, c] } else { [a, b, c, d] }
        };
        let tets: Vec<_> = cells.iter().map(tet).collect();
        let mut solids = Solids::default();
        for (solid, source) in split_cells.solids.iter().zip(&split_cells.source) {
            solids.push_renumbered(solid, |v| ranks[v as usize]);
            let first = by_source.partition_point(|&cell| cell_source[cell as usize] < *source);
            let first = by_source.get(first).filter(|&&cell| cell_source[cell as usize] == *source);
            cells.push(*first.ok_or_else(|| {
                FileError::invalid(
                    store.path(),
                    "mesh/0/split_cells",
                    format!("names cell {source}, which the mesh has not"),
                )
                .remedy("import the series again")
            })?);
        }
        let of_kind = match radii {
            // The vertex of each is at all of its corners.
            Some(radii) => {
                let radius = |&cell: &u32| positions.scale * f64::from(radii[cell as usize]);
                // In this order nothing on the way leaves f64 that the volume does not.
                let volume =
                    |cell: &u32| (0..3).fold(mesh.filling_of(*cell) * ball_volume(1.0), |v, _| v * radius(cell));
                let points = tets.into_iter().map(|[vertex, ..]| vertex).collect();
                let volumes = filling.iter().flat_map(|_| cells.iter().map(volume)).collect();
                Cells { points, radii: cells.iter().map(radius).collect(), volumes, ..Cells::default() }
            }
            None => Cells { tets, solids, ..Cells::default() },
        };
        let chosen = chosen(store, selectors)?.into_iter();
        let (fields, readers) = chosen.map(|Group { info, components }| (info, components)).unzip();
        let buffer = Mutex::new(Vec::new());
        Ok(Self { store, mesh: RawMesh { points, cells: of_kind }, fields, readers, vertices, cells, buffer })
    }
}

/// A field to write, with its components.
pub(super) struct Group {
    pub info: FieldInfo,
    /// A reader per component.
    pub components: Vec<FieldReader>,
}

/// The selected fields, each once, or all.
pub(super) fn chosen(store: &Store, selectors: &[FieldSelector]) -> FileResult<Vec<Group>> {
    let all = grouped(store.fields());
    let mut names: Vec<(String, Vec<String>)> = Vec::new();
    for selector in selectors {
        let text = selector.to_string();
        let group = match all.iter().find(|(name, _)| *name == text) {
            Some(group) => group.clone(),
            None => {
                let field = store.field(selector)?.info().name.clone();
                (field.clone(), vec![field])
            }
        };
        if !names.contains(&group) {
            names.push(group);
        }
    }
    let names = if selectors.is_empty() { all } else { names };
    let reader = |name: &String| {
        let whole = FieldSelector { name: name.clone(), component: None };
        store.field(&whole)
    };
    let group = |(name, components): (String, Vec<String>)| {
        let readers: Vec<FieldReader> = components.iter().map(reader).collect::<FileResult<_>>()?;
        let association = readers.first().map_or(Association::Point, |reader| reader.info().values_of);
        let info = FieldInfo { name, components: components.len(), association };
        Ok(Group { info, components: readers })
    };
    names.into_iter().map(group).collect()
}

/// Names of all fields, each with the names of its components in the store. `U:0`, `U:1`, `U:2` and their norm `U:mag` are one field `U`.
fn grouped(fields: &[StoredField]) -> Vec<(String, Vec<String>)> {
    let vector_of = |magnitude: &StoredField| {
        let name = magnitude.name.strip_suffix(":mag")?;
        let expected = |(i, component): (usize, &String)| *component == format!("{name}:{i}");
        let is_whole = !magnitude.magnitude_of.is_empty() && magnitude.magnitude_of.iter().enumerate().all(expected);
        is_whole.then(|| (name.to_owned(), magnitude.magnitude_of.clone()))
    };
    let vectors: Vec<_> = fields.iter().filter_map(vector_of).collect();
    let mut groups: Vec<(String, Vec<String>)> = Vec::new();
    for field in fields {
        let of_vector = vectors.iter().find(|(_, components)| components.contains(&field.name));
        let group = match of_vector.or_else(|| vectors.iter().find(|(name, _)| field.name == format!("{name}:mag"))) {
            Some(vector) => vector.clone(),
            None => (field.name.clone(), vec![field.name.clone()]),
        };
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    groups
}

/// Indices sorted by their sources.
fn order_of(sources: &[u32]) -> Vec<u32> {
    let mut order: Vec<u32> = (0_u32..).take(sources.len()).collect();
    order.sort_by_key(|&i| sources[i as usize]);
    order
}

impl SeriesSource for StoredSeries<'_> {
    fn describe(&self) -> String {
        self.store.path().display().to_string()
    }

    fn times(&self) -> &TimeAxis {
        self.store.times()
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn unit(&self, field: &FieldInfo) -> Option<String> {
        let readers = self.readers.get(self.fields.iter().position(|known| known == field)?)?;
        readers.first()?.info().units.clone()
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let missing = || {
            let what = FieldSelector { name: field.name.clone(), component: Some(component) };
            FileError::invalid(self.store.path(), format!("field '{what}'"), "is not among those to export")
        };
        let Component::Index(index) = component else { return Err(missing()) };
        let readers = self.fields.iter().position(|f| f == field).map(|i| &self.readers[i]);
        let reader = readers.and_then(|readers| readers.get(index)).ok_or_else(missing)?;
        let mut values = self.buffer.lock().unwrap_or_else(PoisonError::into_inner);
        values.resize(reader.value_count(), 0.0);
        reader.decode_step(step, &mut values)?;
        out.clear();
        let places = match field.association {
            Association::Point => &self.vertices,
            Association::Cell => &self.cells,
        };
        out.extend(places.iter().map(|&place| values[place as usize]));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_put_in_order_and_gaps_closed() {
        assert_eq!(order_of(&[7, 0, 9, 3]), [1, 3, 0, 2]);
        assert_eq!(order_of(&[]), [0_u32; 0]);
    }
}
