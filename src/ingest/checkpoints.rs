//! Checkpoints of an import, and going on from the last one.
//!
//! At the end of a block nothing waits in an encoder, so that statistics and a few numbers are all that a run needs to go on bit for bit
//! where another one was. They are some 20 bytes a vertex and field (`vq`: 28), a handful of steps, and everything before them must reach
//! the medium first; so they are written after so many seconds of work, and each is followed by at least 19 times as much work as it took.
//!
//! Source, mesh, fields, codec and the steps so far must be the same as before. The last of these steps is read again, and must have the
//! same values; others are not.

use super::pass::Target;
use super::plan::{Means, PlannedField};
use super::{CodecChoice, IngestError};
use crate::error::FileResult;
use crate::field::{Component, SeriesSource};
use crate::mesh::{Mesh, RawMesh};
use crate::store::{CheckpointReader, CheckpointWriter, StoreWriter, store_version};
use crate::task::Progress;
use std::time::{Duration, Instant};

/// How often an import keeps its state, so that an interrupted one can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checkpoints {
    /// Least time between two. Zero: at the end of each block, whatever that costs.
    pub pause: Duration,
}

/// Part of the time from one checkpoint to the end of the next that one may take: one in so many.
const COST_SHARE: u32 = 20;

/// What decides the result beside the values: subjects, each with some lines.
type Recipe = Vec<(String, Vec<String>)>;

/// The recipe of an import. Called before any step is read.
pub(super) fn recipe(
    source: &dyn SeriesSource,
    fields: &[PlannedField],
    codec: &CodecChoice,
    points: &str,
    mesh: &Mesh,
) -> Recipe {
    let checksum = |bytes: &[u8]| format!("{:08x}", crc32c::crc32c(bytes));
    let checksums = [
        checksum(bytemuck::cast_slice(&mesh.topology.tets)),
        checksum(bytemuck::cast_slice(&mesh.vertex_source)),
        checksum(bytemuck::cast_slice(&mesh.cell_source)),
    ];
    let without = match &mesh.radii {
        Some(radii) => {
            let of = |sizes: &[f32]| checksum(bytemuck::cast_slice(sizes));
            let filling = mesh.filling.as_ref().map_or(String::new(), |filling| format!(", filling {}", of(filling)));
            format!(", radii {}{filling}", of(radii))
        }
        None if mesh.is_connected => String::new(),
        None => ", without connectivity".to_owned(),
    };
    let subject = |name: &str, lines: Vec<String>| (name.to_owned(), lines);
    vec![
        subject("version", vec![format!("tetreel {}, store {}", env!("CARGO_PKG_VERSION"), store_version())]),
        subject("source", vec![source.describe()]),
        subject("mesh", vec![format!("{points}, cells {}{without}", checksums.join(" "))]),
        // Formulas of calculated fields, and what was skipped.
        subject("note", source.notes()),
        subject("field", fields.iter().flat_map(lines_of).collect()),
        subject("codec", vec![codec.to_string()]),
    ]
}

/// The points and cells of a source in a line of the recipe.
pub(super) fn line_of(raw: &RawMesh) -> String {
    let checksum = crc32c::crc32c(bytemuck::cast_slice(&raw.points));
    format!("{} points {checksum:08x}, {} cells", raw.points.len(), raw.cells.len())
}

/// A line for each field of the store.
fn lines_of(field: &PlannedField) -> Vec<String> {
    let means = match field.means {
        None => "",
        Some(Means::Unweighted) => ", averaged to vertices",
        Some(Means::ByVolume) => ", averaged to vertices by volume",
    };
    let line = |output: &super::plan::Output| {
        let of = match output.component {
            Component::Index(index) => format!("component {index}"),
            Component::Magnitude if output.virtual_ => "magnitude of what is stored".to_owned(),
            Component::Magnitude => "magnitude".to_owned(),
        };
        let unit = output.units.as_ref().map_or(String::new(), |unit| format!(", unit '{unit}'"));
        format!("{}: {of} of {} per {:?}{means}{unit}", output.name, field.info.name, field.info.association)
    };
    field.outputs.iter().map(line).collect()
}

/// The state of an earlier run that fits this one.
pub(super) struct Resumed {
    from: CheckpointReader,
    /// Steps that are done, at least one.
    done: usize,
}

impl Resumed {
    /// Compares the beginning of a checkpoint with this import, and gives the source its counts.
    pub(super) fn of(
        mut from: CheckpointReader,
        recipe: &Recipe,
        source: &dyn SeriesSource,
        steps: &[usize],
    ) -> FileResult<Self> {
        let before: Recipe = serde_json::from_slice(&from.take::<u8>()?).map_err(|_| from.damaged())?;
        let (numbers, times) = (from.take::<u64>()?, from.take::<f64>()?);
        let counted = serde_json::from_slice(&from.take::<u8>()?).map_err(|_| from.damaged())?;
        if numbers.is_empty() || numbers.len() != times.len() {
            return Err(from.damaged());
        }
        if let Some((subject, before, now)) = difference(&before, recipe) {
            return Err(from.differs(format!("was begun with another {subject}: '{before}' instead of '{now}'")));
        }
        if steps.len() < numbers.len() {
            return Err(from.differs(format!(
                "has {} steps already, more than the {} asked for",
                numbers.len(),
                steps.len()
            )));
        }
        for ((step, number), time) in steps.iter().zip(&numbers).zip(&times) {
            let now = source.times().values[*step];
            if *step as u64 != *number || now.to_bits() != time.to_bits() {
                let problem = format!("was begun with other steps: {number} at time {time} instead of {step} at {now}");
                return Err(from.differs(problem));
            }
        }
        source.count_on(&counted);
        Ok(Self { from, done: numbers.len() })
    }

    /// Puts the fields into the state in which the earlier run left them, and removes what it wrote after that. Returns the number of steps
    /// that are done.
    pub(super) fn restore(
        mut self,
        targets: &mut [Vec<Target>],
        codec: &CodecChoice,
        writer: &StoreWriter,
    ) -> FileResult<usize> {
        for target in targets.iter_mut().flatten() {
            let size = [self.done, target.moments.vertex_count()];
            target.moments = target.writer.go_on(codec.encoding(), size, &mut self.from)?;
            target.first_step = self.done;
        }
        writer.discard_unsettled(targets.iter().flatten().map(|target| &target.writer))?;
        Ok(self.done)
    }
}

/// The first subject of two recipes that differs, with its first other line.
fn difference<'a>(before: &'a Recipe, now: &'a Recipe) -> Option<(&'a str, &'a str, &'a str)> {
    let line = |of: &'a Recipe, subject: &str, at: usize| {
        let lines = of.iter().find(|(name, _)| name == subject).map(|(_, lines)| lines);
        lines.and_then(|lines| lines.get(at)).map(String::as_str)
    };
    now.iter().find_map(|(subject, _)| {
        let most =
            [before, now].map(|of| of.iter().filter(|(name, _)| name == subject).map(|(_, lines)| lines.len()).sum());
        let pairs =
            (0..most.into_iter().max().unwrap_or(0usize)).map(|at| (line(before, subject, at), line(now, subject, at)));
        let (a, b) = pairs.into_iter().find(|(a, b)| a != b)?;
        Some((subject.as_str(), a.unwrap_or("none"), b.unwrap_or("none")))
    })
}

/// Keeps the state of an import from time to time.
pub(super) struct Keeper<'a> {
    source: &'a dyn SeriesSource,
    writer: &'a StoreWriter,
    recipe: Recipe,
    steps: &'a [usize],
    /// Steps of a block of the codec.
    block: usize,
    pause: Duration,
    /// When the last checkpoint was complete, and how long it took.
    last: (Instant, Duration),
    /// Steps that the last checkpoint has.
    kept: usize,
}

impl<'a> Keeper<'a> {
    /// A keeper behind the first `kept` steps.
    pub(super) fn new(
        (source, writer): (&'a dyn SeriesSource, &'a StoreWriter),
        recipe: Recipe,
        steps: &'a [usize],
        (codec, checkpoints): (&CodecChoice, Checkpoints),
        kept: usize,
    ) -> Self {
        let block = codec.encoding().codec().block_steps;
        let last = (Instant::now(), Duration::ZERO);
        Self { source, writer, recipe, steps, block, pause: checkpoints.pause, last, kept }
    }

    /// Keeps the state after the first `done` steps, if it is time.
    pub(super) fn after(&mut self, done: usize, targets: &[Vec<Target>]) -> FileResult<()> {
        let (since, cost) = self.last;
        let wait = if self.pause.is_zero() { self.pause } else { self.pause.max(cost * (COST_SHARE - 1)) };
        // After the last step the store itself follows.
        let is_time = done.is_multiple_of(self.block) && (self.kept + 1..self.steps.len()).contains(&done);
        if !is_time || since.elapsed() < wait {
            return Ok(());
        }
        let start = Instant::now();
        self.writer.keep(|to| self.fill(done, targets, to))?;
        self.last = (Instant::now(), start.elapsed());
        self.kept = done;
        Ok(())
    }

    fn fill(&self, done: usize, targets: &[Vec<Target>], to: &mut CheckpointWriter) -> FileResult<()> {
        let steps = &self.steps[..done];
        let numbers: Vec<u64> = steps.iter().map(|&step| step as u64).collect();
        let times: Vec<f64> = steps.iter().map(|&step| self.source.times().values[step]).collect();
        to.put(serde_json::json!(self.recipe).to_string().as_bytes())?;
        to.put(&numbers)?;
        to.put(&times)?;
        to.put(self.source.counted(steps.last().copied().unwrap_or(0)).to_string().as_bytes())?;
        targets.iter().flatten().try_for_each(|target| target.writer.keep(&target.moments, to))
    }

    /// Says what is there to go on from, after an import that has ended early.
    pub(super) fn say(&self, error: &IngestError, progress: &dyn Progress) {
        let Some(folder) = self.writer.partial().filter(|_| self.kept > 0) else { return };
        let why = if matches!(error, IngestError::Cancelled) { "interrupted" } else { "failed" };
        let (kept, all) = (self.kept, self.steps.len());
        progress.say(&format!("{why}; {} has {kept} of {all} steps, kept for --resume", folder.display()));
    }
}
