//! The mesh in a store: points, tets, both permutations, and the arrays derived from them.

use super::array::{StoredArray, write_metadata};
use super::folder::{Folder, FolderSink};
use super::layout::{self, DERIVED_ATTRIBUTE, DERIVED_VERSION, MESH, MeshAttributes, StoredConnectivity, StoredKind};
use super::split_cells;
use crate::codec::{ArraySpec, ChunkSink, Chunking, Element, ElementType, ReadRange, chunk_key, to_bytes};
use crate::error::{FileError, FileResult};
use crate::field::Association;
use crate::mesh::{CellNeighbour, Connectivity, Mesh, MeshError, Positions, RepairReport, SourceCells, Topology};
use glam::{DVec3, Vec3};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Name of the array that flags the cells whose orientation the import reversed; absent if there are none.
const TURNED: &str = "cell_turned";

/// Name of the array of radii, in local units, which a cloud has in place of tets.
const RADII: &str = "radii";

/// Name of the array of the volumes of a cloud's points over those of their balls; absent if it has no volumes.
const FILLING: &str = "filling";

/// What the mesh that was written to a store is of.
pub(super) fn kind_of(root: &Path) -> StoredKind {
    if root.join(MESH).join(RADII).exists() { StoredKind::Points } else { StoredKind::Cells }
}

/// Writes the arrays of one group, each as one chunk.
pub(super) struct ArrayWriter<'a> {
    pub(super) root: &'a Path,
    pub(super) group: &'a str,
    pub(super) sink: FolderSink,
}

impl<'a> ArrayWriter<'a> {
    pub(super) fn new(root: &'a Path, group: &'a str) -> Self {
        Self { root, group, sink: FolderSink::new(root.join(group)) }
    }

    /// Writes `values` as rows of N; a one-dimensional array for N = 1.
    pub(super) fn write<T: Element, const N: usize>(
        &mut self,
        name: &str,
        values: &[[T; N]],
        axes: [&'static str; 2],
        attributes: Map<String, Value>,
    ) -> FileResult<()> {
        let rank = if N == 1 { 1 } else { 2 };
        let spec = ArraySpec {
            name: name.to_owned(),
            element: T::TYPE,
            shape: [values.len() as u64, N as u64][..rank].to_vec(),
            chunking: Chunking::Whole,
            axes: axes[..rank].to_vec(),
        };
        write_metadata(self.root, self.group, &spec, attributes)?;
        if values.is_empty() {
            return Ok(());
        }
        self.sink.put(&chunk_key(name, 0, rank), &to_bytes(values.as_flattened()))
    }
}

/// The attribute of a derived array.
pub(super) fn derived() -> Map<String, Value> {
    Map::from_iter([(DERIVED_ATTRIBUTE.to_owned(), DERIVED_VERSION.into())])
}

/// Whether a derived array has this version.
pub(super) fn is_current(array: &StoredArray) -> bool {
    array.attributes.get(DERIVED_ATTRIBUTE).and_then(Value::as_u64) == Some(DERIVED_VERSION)
}

/// Values as rows of one, for a one-dimensional array.
pub(super) fn column<T: Element>(values: &[T]) -> &[[T; 1]] {
    bytemuck::cast_slice(values)
}

/// Writes a mesh; returns the bytes of its chunks.
pub(super) fn write(root: &Path, mesh: &Mesh, report: &RepairReport) -> FileResult<u64> {
    let (lo, hi) = mesh.positions.world_bounds();
    let repair = serde_json::to_value(report).map_err(|e| FileError::invalid(root, MESH, e.to_string()))?;
    let parts = SourceCells::of(&mesh.cell_source);
    let source_cells = (!parts.are_whole()).then(|| parts.len() as u64);
    let frame = mesh.without_far_parts.map(|(lo, hi)| [lo.to_array(), hi.to_array()]);
    let is_full = mesh.is_connected || mesh.is_cloud();
    let connectivity = if is_full { StoredConnectivity::Full } else { StoredConnectivity::None };
    let bounds = Some([lo.to_array(), hi.to_array()]);
    let has_volumes = mesh.filling.is_some();
    let attributes = MeshAttributes { repair, bounds, frame, source_cells, connectivity, has_volumes };
    layout::write_group(root, MESH, &attributes)?;

    let Positions { origin, scale, local } = &mesh.positions;
    let frame = Map::from_iter([("origin".to_owned(), json!(origin.to_array())), ("scale".to_owned(), json!(scale))]);
    let topology = &mesh.topology;
    let mut to = ArrayWriter::new(root, MESH);
    to.write::<f32, 3>("points", bytemuck::cast_slice(local), ["vertex", "axis"], frame)?;
    match &mesh.radii {
        Some(radii) => to.write(RADII, column(radii), ["vertex", ""], Map::new())?,
        None => to.write("tets", &topology.tets, ["cell", "corner"], Map::new())?,
    }
    if let Some(filling) = &mesh.filling {
        to.write(FILLING, column(filling), ["vertex", ""], Map::new())?;
    }
    if mesh.is_connected {
        let Connectivity { neighbours, faces, face_cells } = topology.connectivity();
        to.write("faces", faces, ["face", "corner"], derived())?;
        to.write("face_cells", face_cells, ["face", "side"], derived())?;
        to.write::<u32, 4>("neighbours", bytemuck::cast_slice(neighbours), ["cell", "face"], derived())?;
    }
    to.write("vertex_permutation", column(&mesh.vertex_source), ["vertex", ""], Map::new())?;
    to.write("cell_permutation", column(&mesh.cell_source), ["cell", ""], Map::new())?;
    if mesh.cell_turned.contains(&true) {
        let turned: Vec<u8> = mesh.cell_turned.iter().map(|&turned| turned.into()).collect();
        to.write(TURNED, column(&turned), ["cell", ""], Map::new())?;
    }
    Ok(to.sink.bytes + split_cells::write(root, &mesh.split_cells)?)
}

/// The mesh of a store whose metadata has been checked.
#[derive(Clone, Debug)]
pub(super) struct StoredMesh {
    points: StoredArray,
    /// Radii of a cloud, else tets.
    cells_array: StoredArray,
    pub(super) kind: StoredKind,
    pub(super) vertices: u64,
    pub(super) cells: u64,
    pub(super) attributes: MeshAttributes,
}

impl StoredMesh {
    /// Reads the metadata and checks it against the sizes of the chunks, so that no count is trusted unchecked.
    pub(super) fn open(root: &Path, source: &Folder) -> FileResult<Self> {
        let attributes = layout::read_group(root, MESH)?;
        let points = open_array(root, "points", ElementType::F32, 2)?;
        let kind = layout::read_root(root)?.kind;
        let vertices = points.rows::<3>()?;
        points.check_size::<f32, 3>(source)?;
        let (cells_array, cells) = match kind {
            StoredKind::Cells => {
                let tets = open_array(root, "tets", ElementType::U32, 2)?;
                tets.check_size::<u32, 4>(source)?;
                let cells = tets.rows::<4>()?;
                (tets, cells)
            }
            StoredKind::Points => {
                let radii = open_array(root, RADII, ElementType::F32, 1)?.expect_shape(&[vertices])?;
                radii.check_size::<f32, 1>(source)?;
                (radii, vertices)
            }
        };
        Ok(Self { points, cells_array, kind, vertices, cells, attributes })
    }

    /// Reads the mesh; faces and neighbours are derived when they are asked for if they are missing, damaged or of another version.
    pub(super) fn read(&self, root: &Path, source: &dyn ReadRange) -> FileResult<Mesh> {
        let positions = self.read_positions(root, source)?;
        if !self.kind.is_cells() {
            return self.read_cloud(root, source, positions);
        }
        let stored = self.attributes.connectivity.is_full().then(|| self.cells_array.read(source)).transpose()?;
        let topology = match stored.and_then(|tets| self.read_derived(root, source, tets)) {
            Some(topology) => topology,
            None => self.without_derived(root, source, &positions)?,
        };
        let vertex_source = read_permutation(root, source, "vertex_permutation", self.vertices)?;
        let cell_source = read_permutation(root, source, "cell_permutation", self.cells)?;
        let cell_turned = self.read_turned(root, source)?;
        let split_cells = split_cells::read(root, source, self.vertices)?;
        let without_far_parts = self.attributes.frame.map(|corners| corners.map(DVec3::from_array).into());
        let mut mesh = Mesh::of_parts(topology, positions, [vertex_source, cell_source], cell_turned, split_cells);
        (mesh.without_far_parts, mesh.is_connected) = (without_far_parts, self.attributes.connectivity.is_full());
        Ok(mesh)
    }

    /// The mesh of a store of points.
    fn read_cloud(&self, root: &Path, source: &dyn ReadRange, positions: Positions) -> FileResult<Mesh> {
        // A ball lies within the frame.
        let radii = sizes(root, RADII, self.cells_array.read::<f32, 1>(source)?, 1.0)?;
        let filling = if self.attributes.has_volumes {
            let array = open_array(root, FILLING, ElementType::F32, 1)?.expect_shape(&[self.vertices])?;
            Some(sizes(root, FILLING, array.read::<f32, 1>(source)?, f32::MAX)?)
        } else {
            None
        };
        let sources = [
            read_permutation(root, source, "vertex_permutation", self.vertices)?,
            read_permutation(root, source, "cell_permutation", self.cells)?,
        ];
        Mesh::of_cloud(positions, sources, (radii, filling)).map_err(|e| mesh_error(root, &e))
    }

    /// Number of values that fields of vertices, or of cells, have in a step.
    pub(super) fn count(&self, values_of: Association) -> u64 {
        match values_of {
            Association::Point => self.vertices,
            Association::Cell => self.attributes.source_cells.unwrap_or(self.cells),
        }
    }

    /// The source's cells that the values of cells are of; `None` if those are whole cells of the mesh.
    pub(super) fn parts(&self, root: &Path, source: &dyn ReadRange) -> FileResult<Option<SourceCells>> {
        let Some(expected) = self.attributes.source_cells else { return Ok(None) };
        let parts = SourceCells::of(&read_permutation(root, source, "cell_permutation", self.cells)?);
        if parts.len() as u64 == expected {
            return Ok(Some(parts));
        }
        let problem = format!("is of {} cells instead of {expected}", parts.len());
        Err(FileError::invalid(root.join(MESH).join("cell_permutation"), "array", problem)
            .remedy("import the series again"))
    }

    /// The cells whose orientation the import reversed: none if there is no such array.
    fn read_turned(&self, root: &Path, source: &dyn ReadRange) -> FileResult<Vec<bool>> {
        if root.join(MESH).join(TURNED).exists() {
            let array = open_array(root, TURNED, ElementType::U8, 1)?.expect_shape(&[self.cells])?;
            return Ok(array.read::<u8, 1>(source)?.into_iter().map(|[turned]| turned != 0).collect());
        }
        // The topology has this many cells.
        Ok(vec![false; usize::try_from(self.cells).unwrap_or_default()])
    }

    fn read_positions(&self, root: &Path, source: &dyn ReadRange) -> FileResult<Positions> {
        let path = root.join(MESH).join("points/zarr.json");
        let number = |value: Option<&Value>, name: &str| {
            let missing = || FileError::invalid(&path, format!("attribute '{name}'"), "is missing or not a number");
            value.and_then(Value::as_f64).ok_or_else(missing)
        };
        let attributes = &self.points.attributes;
        let axis = |i: usize| number(attributes.get("origin").and_then(|o| o.get(i)), "origin");
        let origin = DVec3::new(axis(0)?, axis(1)?, axis(2)?);
        let scale = number(attributes.get("scale"), "scale")?;
        let local = self.points.read::<f32, 3>(source)?.into_iter().map(Vec3::from_array).collect();
        Positions::from_parts(origin, scale, local).map_err(|e| mesh_error(root, &e))
    }

    /// The topology with the derived arrays of the store; `None` if any of them cannot be used.
    fn read_derived(&self, root: &Path, source: &dyn ReadRange, tets: Vec<[u32; 4]>) -> Option<Topology> {
        let vertices = u32::try_from(self.vertices).ok()?;
        let faces = read_current(root, source, "faces")?;
        let face_cells = read_current(root, source, "face_cells")?;
        let neighbours = read_current(root, source, "neighbours")?;
        let neighbours = neighbours.into_iter().map(|sides| sides.map(CellNeighbour)).collect();
        Topology::from_parts(vertices, tets, Connectivity { neighbours, faces, face_cells }).ok()
    }

    fn without_derived(&self, root: &Path, source: &dyn ReadRange, positions: &Positions) -> FileResult<Topology> {
        let vertices = u32::try_from(self.vertices).map_err(|_| {
            FileError::unsupported(root, MESH, format!("has {} vertices: more than can be numbered", self.vertices))
        })?;
        let tets = self.cells_array.read::<u32, 4>(source)?;
        Topology::from_tets(vertices, tets, positions).map_err(|e| mesh_error(root, &e))
    }
}

/// The sizes of a cloud's points that an array has, checked.
fn sizes(root: &Path, name: &str, rows: Vec<[f32; 1]>, most: f32) -> FileResult<Vec<f32>> {
    let sizes = rows.into_flattened();
    match sizes.iter().position(|&size| !(size > 0.0 && size <= most)) {
        None => Ok(sizes),
        Some(point) => {
            let problem = format!("{} of point {point} is not above 0 and at most {most:e}", sizes[point]);
            let place = root.join(MESH).join(name);
            Err(FileError::invalid(place, "array", problem).remedy("import the series again"))
        }
    }
}

fn mesh_error(root: &Path, error: &MeshError) -> FileError {
    FileError::invalid(root, MESH, error.to_string()).remedy("import the series again")
}

/// Reads the sources of the mesh's vertices or cells.
fn read_permutation(root: &Path, source: &dyn ReadRange, name: &str, rows: u64) -> FileResult<Vec<u32>> {
    let array = open_array(root, name, ElementType::U32, 1)?.expect_shape(&[rows])?;
    Ok(array.read::<u32, 1>(source)?.into_flattened())
}

/// Reads a derived array of the mesh; `None` if it is missing, damaged or of another version.
fn read_current<const N: usize>(root: &Path, source: &dyn ReadRange, name: &str) -> Option<Vec<[u32; N]>> {
    open_array(root, name, ElementType::U32, 2).ok().filter(is_current)?.read(source).ok()
}

/// Opens an array of the mesh that is one chunk.
fn open_array(root: &Path, name: &str, element: ElementType, rank: usize) -> FileResult<StoredArray> {
    StoredArray::open(root, &format!("{MESH}/{name}"), element, Chunking::Whole, rank)
}
