//! Importing a source into a store in one streamed pass.
//!
//! One thread reads step n + 1 while step n is brought into the mesh's vertex order, reduced into ranges and moments,
//! encoded and written. No more than two steps of the source, one of the mesh, and what the codec holds (`vq`: a block of
//! 64 steps of each field) are in memory. The result does not depend on the number of threads. [`append()`] adds the new steps of
//! a source that has grown; with [`Checkpoints`] an interrupted import goes on where it was; [`ImportCache`] opens a source as if it were a
//! store.

mod append;
mod cached;
mod checkpoints;
mod compression;
mod first_step;
mod options;
mod order;
mod pass;
mod plan;
mod report;
mod same_mesh;
mod stream;

pub use crate::codec::CodecChoice;
pub use append::{AppendOptions, AppendPlan, AppendReport, AppendedField, append, plan_append};
pub use cached::{CacheError, CacheEvent, ImportCache, Origin};
pub use checkpoints::Checkpoints;
pub use compression::CompressionReport;
pub use first_step::{FirstStep, ReadMesh};
pub use options::{FieldUnits, IngestOptions, StepRange, StepRangeError};
pub use report::{FieldReport, IngestError, IngestReport, StageSeconds};

use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo, RADIUS, SeriesSource, TimeAxis, VOLUME};
use crate::mesh::{Mesh, RawMesh, RepairReport};
use crate::moments::Moments;
use crate::store::{FieldDescription, FieldWriter, MeanWeights, SourcePoints, StoreWriter};
use crate::task::{Cancel, Progress};
use checkpoints::{Keeper, Resumed};
use order::ValueOrder;
use pass::{Pass, Target};
use plan::{Output, PlannedField};
use std::path::Path;
use std::time::Instant;
use stream::Job;

/// Imports a series into a new store at `out`.
///
/// # Errors
/// If the source cannot be read or lacks what was asked for, its mesh cannot be built, the store cannot be written, or `cancel` was raised.
/// No files are then left behind, but for those of [`IngestOptions::checkpoints`], and an existing store at `out` is unchanged. With
/// checkpoints also if another import writes them now, or those that are there are damaged or of an import of something else.
pub fn ingest(
    source: &dyn SeriesSource,
    out: &Path,
    options: &IngestOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<IngestReport, IngestError> {
    ingest_and_tell(source, out, options, progress, cancel, &mut |_| ())
}

/// [`ingest`]; `read` is told of the points and cells before the mesh is built.
fn ingest_and_tell(
    source: &dyn SeriesSource,
    out: &Path,
    options: &IngestOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
    read: &mut dyn FnMut(ReadMesh<'_>),
) -> Result<IngestReport, IngestError> {
    let start = Instant::now();
    let steps = select_steps(source, options.steps)?;
    let times = steps.iter().map(|&step| source.times().values[step]).collect();
    let fields = plan_fields(source, options)?;
    let (mut writer, checkpoint) = match options.checkpoints {
        None => (StoreWriter::create(out, options.overwrite)?, None),
        Some(_) => StoreWriter::go_on(out, options.overwrite)?,
    };

    let built = BuiltMesh::of(source, options, cancel, read)?;
    let (counts, cells, repair) = (built.counts, built.mesh.topology.tets.len(), built.repair.clone());
    let recipe = checkpoints::recipe(source, &fields, &options.codec, &built.line, &built.mesh);
    let resumed = checkpoint.map(|from| Resumed::of(from, &recipe, source, &steps)).transpose()?;
    let order = built.write(source, &fields, &mut writer)?;
    writer.write_times(&TimeAxis { values: times })?;
    let mesh_seconds = start.elapsed().as_secs_f64();

    let [vertices, of_cells] = [Association::Point, Association::Cell].map(|of| order.count(of));
    let mut targets: Vec<Vec<Target>> =
        fields.iter().map(|f| targets(f, order.count(f.values_of()), &options.codec, &mut writer)).collect();
    let done = resumed.map_or(Ok(0), |resumed| resumed.restore(&mut targets, &options.codec, &writer))?;
    if done > 0 {
        let folder = writer.partial().unwrap_or(out).display();
        progress.say(&format!("{folder}: goes on at step {} of {}", done + 1, steps.len()));
    }
    // The last step that was done is read again, to compare it.
    let first = done.saturating_sub(1);
    let job = Job { source, fields: &fields, steps: &steps[first..], cancel };
    let mut pass = Pass::new(job, order, counts, targets);
    pass.if_changed = writer.remedy().unwrap_or(pass.if_changed);
    let keeper = options.checkpoints.map(|checkpoints| (&options.codec, checkpoints));
    let mut keeper = keeper.map(|how| Keeper::new((source, &writer), recipe, &steps, how, done));
    let mut after = |done: usize, targets: &[Vec<Target>]| keeper.as_mut().map_or(Ok(()), |k| k.after(done, targets));
    let read_time = pass.run("import", first, progress, &mut after);
    let read_time = read_time.inspect_err(|error| keeper.iter().for_each(|k| k.say(error, progress)))?;

    let finish = Instant::now();
    let mut seconds = pass.seconds;
    let values = pass.values_read;
    let counts = [vertices, of_cells, cells, steps.len()].map(|n| n as u64);
    let fields = reports(pass.targets, counts, &options.codec)?;
    let notes = source.notes();
    let bytes_written = writer.finish(&source.describe(), notes.clone())?;
    seconds.mesh = mesh_seconds;
    seconds.read = read_time.as_secs_f64();
    seconds.finish = finish.elapsed().as_secs_f64();
    seconds.total = start.elapsed().as_secs_f64();
    let bytes_read = values * size_of::<f32>() as u64;
    let time_of = |step: Option<&usize>| step.map_or(0.0, |&step| source.times().values[step]);
    Ok(IngestReport {
        source: source.describe(),
        output: out.to_owned(),
        repair,
        steps: steps.len(),
        times: [time_of(steps.first()), time_of(steps.last())],
        fields,
        bytes_read,
        bytes_written,
        notes,
        seconds,
        megabytes_per_second: bytes_read as f64 / 1e6 / seconds.total.max(f64::MIN_POSITIVE),
    })
}

/// The mesh of a source, repaired.
struct BuiltMesh {
    mesh: Mesh,
    repair: RepairReport,
    /// Number of points and of cells in the source.
    counts: [usize; 2],
    /// The points of the source.
    points: SourcePoints,
    /// What checkpoints compare of points and cells.
    line: String,
}

impl BuiltMesh {
    fn of(
        source: &dyn SeriesSource,
        options: &IngestOptions,
        cancel: &Cancel,
        read: &mut dyn FnMut(ReadMesh<'_>),
    ) -> Result<Self, IngestError> {
        let raw = source.mesh().map_err(IngestError::Source)?;
        let raw = sized(source, raw, options)?;
        read(ReadMesh { source, raw: &raw });
        let counts = [raw.points.len(), raw.cells.len()];
        let (points, line) = (SourcePoints::of(&raw.points), checkpoints::line_of(&raw));
        check_cancel(cancel)?;
        let (mesh, repair) = built(source, raw, options)?;
        let repair = repair.with_cell_numbers(|cell| source.cell_number(cell));
        Ok(Self { mesh, repair, counts, points, line })
    }

    /// Writes the mesh and all about it; returns the order of values in the store.
    fn write(
        self,
        source: &dyn SeriesSource,
        fields: &[PlannedField],
        writer: &mut StoreWriter,
    ) -> Result<ValueOrder, IngestError> {
        writer.write_mesh(&self.mesh, &self.repair)?;
        if let Some(blocks) = source.blocks().map_err(IngestError::Source)? {
            writer.write_blocks(&blocks, &self.mesh.cell_source)?;
        }
        let (order, positions) = ValueOrder::new(self.mesh, fields);
        writer.write_source_points(&positions, order.vertex_source(), &self.points)?;
        Ok(order)
    }
}

/// The mesh of a source from its points and cells; a cloud has the radii and volumes of the options, else those of the source.
///
/// # Errors
/// If the points and cells make no mesh, or radii or volumes cannot be read, or there is one for a mesh of cells.
pub fn mesh_of(
    source: &dyn SeriesSource,
    raw: RawMesh,
    options: &IngestOptions,
) -> Result<(Mesh, RepairReport), IngestError> {
    built(source, sized(source, raw, options)?, options)
}

/// The points and cells of a source; those of a cloud with the radii and volumes of the options, else of the source, if these have some.
fn sized(source: &dyn SeriesSource, mut raw: RawMesh, options: &IngestOptions) -> Result<RawMesh, IngestError> {
    if !raw.cells.are_points() {
        for (name, size) in [(RADIUS, options.radius), (VOLUME, options.volume)] {
            if size.is_some() {
                let problem = format!("is a mesh of cells, and a {name} is of points alone");
                let remedy = format!("leave --{name} out");
                return Err(FileError::unsupported(source.describe(), "", problem).remedy(remedy).into());
            }
        }
        return Ok(raw);
    }
    let cells = &mut raw.cells;
    for (name, size, sizes) in
        [(RADIUS, options.radius, &mut cells.radii), (VOLUME, options.volume, &mut cells.volumes)]
    {
        if let Some(size) = size {
            *sizes = vec![size; cells.points.len()];
        } else if sizes.is_empty() {
            *sizes = sizes_of(source, name, &cells.points).map_err(IngestError::Source)?;
        }
    }
    Ok(raw)
}

/// The mesh of points and cells that have their sizes.
fn built(
    source: &dyn SeriesSource,
    raw: RawMesh,
    options: &IngestOptions,
) -> Result<(Mesh, RepairReport), IngestError> {
    let mesh = if raw.cells.are_points() { Mesh::build_cloud(&raw) } else { Mesh::build_as(raw, options.connectivity) };
    mesh.map_err(|error| IngestError::Mesh { source_name: source.describe(), error })
}

/// The values of the field of points of that name at points, in the first step; none if there is no such field.
fn sizes_of(source: &dyn SeriesSource, name: &str, points: &[u32]) -> FileResult<Vec<f64>> {
    let is_of_points = |field: &&FieldInfo| (field.association, field.components) == (Association::Point, 1);
    let Some(field) = source.fields().iter().filter(is_of_points).find(|field| field.name == name) else {
        return Ok(Vec::new());
    };
    let mut of_points = Vec::new();
    source.read_f64(field, 0, 0, &mut of_points)?;
    Ok(points.iter().map(|&point| of_points.get(point as usize).copied().unwrap_or(f64::NAN)).collect())
}

/// Checks that the source has the fields and units that `options` names; reads and writes nothing.
///
/// # Errors
/// The errors of [`ingest`] that these options cause.
pub fn check_fields(source: &dyn SeriesSource, options: &IngestOptions) -> FileResult<()> {
    plan_fields(source, options).map(|_| ())
}

fn plan_fields(source: &dyn SeriesSource, options: &IngestOptions) -> FileResult<Vec<PlannedField>> {
    let fields = source.fields();
    if fields.is_empty() {
        let problem = format!("there is no field ({})", source.notes().join("; "));
        return Err(FileError::invalid(source.describe(), "fields", problem));
    }
    let of_source: Vec<Option<String>> = fields.iter().map(|field| source.unit(field)).collect();
    let planned = plan::plan(fields, &options.fields, &options.units, &of_source)
        .map_err(|problem| FileError::invalid(source.describe(), "fields", problem))?;
    let to_points = |field: PlannedField| if options.cells_to_points { field.into_points() } else { field };
    Ok(planned.into_iter().map(to_points).collect())
}

fn check_cancel(cancel: &Cancel) -> Result<(), IngestError> {
    if cancel.is_cancelled() { Err(IngestError::Cancelled) } else { Ok(()) }
}

/// Indices of the selected steps; fails if the time axis is not valid.
fn select_steps(source: &dyn SeriesSource, range: StepRange) -> FileResult<Vec<usize>> {
    let times = &source.times().values;
    let invalid = |problem: String| FileError::invalid(source.describe(), "time", problem);
    if times.is_empty() {
        return Err(invalid("there is no step".to_owned()));
    }
    if let Some(step) = times.iter().position(|t| !t.is_finite()) {
        return Err(invalid(format!("the time of step {step} is not finite")));
    }
    if let Some(step) = times.windows(2).position(|pair| pair[0] >= pair[1]) {
        let [a, b] = [times[step], times[step + 1]];
        return Err(invalid(format!("times do not increase: step {step} is at {a}, step {} at {b}", step + 1)));
    }
    range.select(times.len()).map_err(|e| invalid(e.to_string()))
}

/// Begins the store fields for a field of the source.
fn targets(field: &PlannedField, count: usize, codec: &CodecChoice, writer: &mut StoreWriter) -> Vec<Target> {
    let association = field.info.association;
    let mut targets: Vec<Target> = Vec::new();
    for Output { name, virtual_, units, .. } in &field.outputs {
        let weights = field.means.map(|_| MeanWeights::Volume);
        let values_of = field.values_of();
        let description =
            FieldDescription { name: name.clone(), association, values_of, weights, units: units.clone() };
        let writer = if *virtual_ {
            let components: Vec<&FieldWriter> = targets.iter().map(|t| &t.writer).collect();
            writer.begin_magnitude(description, &components)
        } else {
            writer.begin_field(description, codec.encoding().encoder(count))
        };
        targets.push(Target { writer, moments: Moments::new(count), association, values_of, first_step: 0 });
    }
    targets
}

/// Finishes the fields. `counts` are vertices, cells of the source, cells and steps.
fn reports(
    targets: Vec<Vec<Target>>,
    [vertices, of_cells, cells, steps]: [u64; 4],
    codec: &CodecChoice,
) -> FileResult<Vec<FieldReport>> {
    let report = |target: Target| {
        let series = target.moments.series();
        let name = target.writer.name().to_owned();
        let counts = target.moments.steps().iter().enumerate().map(|(step, summary)| (step, summary.nonfinite));
        let nonfinite_steps = counts.filter(|(_, count)| *count > 0).collect();
        let written = target.writer.finish(&target.moments)?;
        let values = if target.values_of == Association::Cell { of_cells } else { vertices };
        let counts = [values, cells, steps];
        let compressed = |quality| CompressionReport::new(codec.encoding(), counts, written.value_bytes, quality);
        let compression = written.quality.and_then(compressed);
        Ok(FieldReport {
            name,
            association: target.association,
            values_of: target.values_of,
            range: series.range,
            nonfinite: series.nonfinite,
            nonfinite_steps,
            bytes: written.bytes,
            compression,
        })
    };
    targets.into_iter().flatten().map(report).collect()
}
