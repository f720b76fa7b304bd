//! Writing a store: mesh, times, then the fields side by side, then into place at once.

use super::MAGNITUDE_CODEC;
use super::array::write_metadata;
use super::blocks;
use super::folder::{FolderSink, walk};
use super::importance;
use super::layout::{
    self, CHECKSUM_PER_STEP, ERRORS_PER_STEP, ERRORS_PER_VERTEX, FieldAttributes, FieldsAttributes, MeanWeights,
    RootAttributes, TIME, fields_of, moments_array,
};
use super::mesh::{self, ArrayWriter, column};
use super::names::FolderNames;
use super::refresh::Stamp;
use super::source_points::SourcePoints;
use super::staging::Staging;
use crate::codec::{ChunkSink, Encoded, Encoder, Quality, chunk_key, to_bytes};
use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, TimeAxis};
use crate::mesh::{Mesh, Positions, RepairReport};
use crate::moments::{Moments, VertexStatistics};
use serde_json::Map;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Description of a field of a new store.
#[derive(Clone, Debug)]
pub struct FieldDescription {
    /// Name as the user selects it; unique in the store.
    pub name: String,
    /// Association of the values in the source.
    pub association: Association,
    /// What has the values that are written: vertices or cells.
    pub values_of: Association,
    /// How those of cells were brought to vertices, if they were.
    pub weights: Option<MeanWeights>,
    /// Unit of the values, if known.
    pub units: Option<String>,
}

/// Writes a new store. Its target is untouched before [`StoreWriter::finish`]; dropped earlier, it leaves no files.
#[derive(Debug)]
pub struct StoreWriter {
    pub(super) staging: Staging,
    names: FolderNames,
    pub(super) folders: Vec<(Association, String)>,
    /// Number of appends.
    pub(super) revision: u64,
    /// The store that is being continued, with its state: it must not have changed meanwhile.
    pub(super) replaces: Option<(PathBuf, Stamp)>,
}

impl StoreWriter {
    /// Begins a store at `target`.
    ///
    /// # Errors
    /// If something exists there and is no tetreel store or `overwrite` is not set, or its folder cannot be written.
    pub fn create(target: &Path, overwrite: bool) -> FileResult<Self> {
        let staging = Staging::begin(target, overwrite)?;
        let writer = Self::at(staging);
        writer.write_groups()?;
        Ok(writer)
    }

    /// Writes the groups that have no attributes.
    pub(super) fn write_groups(&self) -> FileResult<()> {
        layout::write_group(self.staging.path(), "mesh", &Map::new())
    }

    pub(super) fn at(staging: Staging) -> Self {
        Self { staging, names: FolderNames::new(), folders: Vec::new(), revision: 0, replaces: None }
    }

    /// Writes the mesh and what was repaired in it.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_mesh(&mut self, mesh: &Mesh, report: &RepairReport) -> FileResult<()> {
        mesh::write(self.staging.path(), mesh, report).map(drop)
    }

    /// Writes the blocks of the source that the cells of a mesh are from; `cell_source` has the source's cell of each.
    ///
    /// # Errors
    /// If a file cannot be written, or a cell is of no block.
    pub fn write_blocks(&mut self, of_source: &Blocks, cell_source: &[u32]) -> FileResult<()> {
        blocks::write(self.staging.path(), of_source, cell_source)
    }

    /// Writes the points that a mesh was built from, if its vertices at `positions` do not give them back bit for bit; `vertex_source` has the
    /// point of each vertex. Vertices that are numbered beyond the points, as added ones are, have their positions.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_source_points(
        &mut self,
        positions: &Positions,
        vertex_source: &[u32],
        points: &SourcePoints,
    ) -> FileResult<()> {
        points.write(self.staging.path(), positions, vertex_source)
    }

    /// Writes the times of the steps, all of which use mesh 0.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write_times(&mut self, times: &TimeAxis) -> FileResult<()> {
        layout::write_group(self.staging.path(), TIME, &Map::new())?;
        let mut to = ArrayWriter::new(self.staging.path(), TIME);
        to.write("values", column(&times.values), ["step", ""], Map::new())?;
        to.write("mesh_index", column(&vec![0u32; times.len()]), ["step", ""], Map::new())
    }

    /// Begins a field whose values `encoder` encodes.
    pub fn begin_field(&mut self, description: FieldDescription, encoder: Box<dyn Encoder>) -> FieldWriter {
        self.field(description, Content::Encoded(encoder))
    }

    /// Begins a field that is the norm of others and has no values of its own.
    pub fn begin_magnitude(&mut self, description: FieldDescription, components: &[&FieldWriter]) -> FieldWriter {
        let folders = components.iter().map(|c| c.folder.clone()).collect();
        self.field(description, Content::MagnitudeOf(folders))
    }

    fn field(&mut self, description: FieldDescription, content: Content) -> FieldWriter {
        let folder = self.names.give(&description.name);
        self.folders.push((description.values_of, folder.clone()));
        let root = self.staging.path().to_owned();
        let sink = FolderSink::new(root.join(fields_of(description.values_of)).join(&folder));
        let checksums = Some(Vec::new());
        FieldWriter { root, folder, description, content, checksums, sink }
    }

    /// Writes the attributes, makes everything durable and moves the store to its place. Returns the bytes on disk.
    /// `source` says what the series was read from, `notes` what was skipped.
    ///
    /// # Errors
    /// If a file cannot be written, the target was taken, or the continued store was changed meanwhile.
    pub fn finish(self, source: &str, notes: Vec<String>) -> FileResult<u64> {
        let root = self.staging.path();
        for of in [Association::Point, Association::Cell] {
            let folders = self.folders.iter().filter(|(values_of, _)| *values_of == of);
            let folders: Vec<String> = folders.map(|(_, folder)| folder.clone()).collect();
            if of == Association::Point || !folders.is_empty() {
                layout::write_group(root, fields_of(of), &FieldsAttributes { folders })?;
            }
        }
        let kind = mesh::kind_of(root);
        let attributes = RootAttributes {
            tetreel_store: layout::version_with(kind, &layout::read_group(root, layout::MESH)?),
            kind,
            tetreel: env!("CARGO_PKG_VERSION").to_owned(),
            source: source.to_owned(),
            notes,
            revision: self.revision,
        };
        layout::write_group(root, "", &attributes)?;
        let bytes = bytes_on_disk(root)?;
        if let Some((path, stamp)) = &self.replaces
            && Stamp::of(path) != *stamp
        {
            let problem = "was changed by somebody else meanwhile; it is left like that";
            return Err(FileError::invalid(path, "", problem).remedy("run the command again"));
        }
        self.staging.commit()?;
        Ok(bytes)
    }
}

/// Where the values of a field come from.
pub(super) enum Content {
    Encoded(Box<dyn Encoder>),
    MagnitudeOf(Vec<String>),
}

/// Sizes and error of a written field.
#[derive(Clone, Copy, Debug)]
pub struct WrittenField {
    /// Bytes of its chunks.
    pub bytes: u64,
    /// Bytes of its encoded values, included in `bytes`.
    pub value_bytes: u64,
    /// Error measured after coding; `None` if it is exact.
    pub quality: Option<Quality>,
}

/// Writes one field of a new store.
pub struct FieldWriter {
    pub(super) root: PathBuf,
    pub(super) folder: String,
    pub(super) description: FieldDescription,
    pub(super) content: Content,
    /// CRC-32C of each step so far; `None` if those of the continued store are not known.
    pub(super) checksums: Option<Vec<u32>>,
    pub(super) sink: FolderSink,
}

impl FieldWriter {
    /// Name of the field.
    pub fn name(&self) -> &str {
        &self.description.name
    }

    /// Its group below the root.
    pub(super) fn group(&self) -> String {
        format!("{}/{}", fields_of(self.description.values_of), self.folder)
    }

    /// The checksum of a step's values.
    pub(super) fn checksum(values: &[f32]) -> u32 {
        crc32c::crc32c(&to_bytes(values))
    }

    /// Takes the values of the next step, one per vertex or cell of the source. A magnitude's values are not stored.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn push(&mut self, values: &[f32]) -> FileResult<()> {
        if let Some(checksums) = &mut self.checksums {
            checksums.push(Self::checksum(values));
        }
        match &mut self.content {
            Content::Encoded(encoder) => encoder.push(values, &mut self.sink),
            Content::MagnitudeOf(_) => Ok(()),
        }
    }

    /// Writes buffered values, and the statistics of all steps.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(mut self, moments: &Moments) -> FileResult<WrittenField> {
        let group = self.group();
        let (codec, magnitude_of, encoded) = match self.content {
            Content::Encoded(encoder) => (encoder.name(), Vec::new(), encoder.finish(&mut self.sink)?),
            Content::MagnitudeOf(components) => {
                let parameters = serde_json::json!({});
                let nothing = Encoded { arrays: Vec::new(), parameters, errors: None, settled_errors: None };
                (MAGNITUDE_CODEC, components, nothing)
            }
        };
        let series = moments.series();
        let statistics = moments.vertex_statistics();
        let quality = encoded.errors.as_ref().map(|errors| errors.quality(&statistics));
        let attributes = FieldAttributes {
            name: self.description.name,
            association: self.description.association,
            weights: self.description.weights,
            units: self.description.units,
            codec: codec.to_owned(),
            codec_parameters: encoded.parameters,
            magnitude_of,
            quality,
            range: series.range,
            nonfinite: series.nonfinite,
        };
        layout::write_group(&self.root, &group, &attributes)?;
        let groups: BTreeSet<&str> = encoded.arrays.iter().filter_map(|a| Some(a.name.split_once('/')?.0)).collect();
        for name in groups {
            layout::write_group(&self.root, &format!("{group}/{name}"), &Map::new())?;
        }
        for array in &encoded.arrays {
            write_metadata(&self.root, &group, array, Map::new())?;
        }
        let mut to = ArrayWriter::new(&self.root, &group);
        let ranges: Vec<[f32; 2]> = moments.steps().iter().map(|s| s.range.unwrap_or([f32::NAN; 2])).collect();
        to.write("range_per_step", &ranges, ["step", "bound"], Map::new())?;
        if let Some(checksums) = &self.checksums {
            to.write(CHECKSUM_PER_STEP, column(checksums), ["step", ""], Map::new())?;
        }
        if let Some(errors) = &encoded.settled_errors {
            let (steps, vertices) = errors.parts();
            to.write(ERRORS_PER_STEP, &steps, ["step", "squares_count_largest"], mesh::derived())?;
            to.write(ERRORS_PER_VERTEX, column(vertices), ["vertex", ""], mesh::derived())?;
        }
        let bytes = self.sink.bytes + to.sink.bytes + write_moments(&self.root, &group, &statistics)?;
        let bytes = bytes + importance::write(&self.root, &self.folder, moments, &statistics)?;
        Ok(WrittenField { bytes, value_bytes: self.sink.bytes, quality })
    }
}

fn write_moments(root: &Path, group: &str, statistics: &VertexStatistics) -> FileResult<u64> {
    let spec = moments_array(statistics.mean.len() as u64);
    write_metadata(root, group, &spec, mesh::derived())?;
    let mut sink = FolderSink::new(root.join(group));
    for (row, values) in (0..).zip([&statistics.mean, &statistics.variance, &statistics.finite_count]) {
        sink.put(&chunk_key(&spec.name, row, 2), &to_bytes(values))?;
    }
    Ok(sink.bytes)
}

/// Sum of the lengths of all files of a store.
pub(super) fn bytes_on_disk(root: &Path) -> FileResult<u64> {
    let mut bytes = 0u64;
    walk(root, &mut |_, metadata| {
        if metadata.is_file() {
            bytes = bytes.checked_add(metadata.len()).ok_or_else(|| FileError::invalid(root, "", "sizes overflow"))?;
        }
        Ok(())
    })?;
    Ok(bytes)
}
