//! Adding the new steps of a source to a store that has the earlier ones.
//!
//! Only steps after the store's last one are added. With codec `vq`, a short block at the end of the store is coded again
//! together with them, from the values of the source, so that errors do not add up. The result is the store that an
//! import of all steps at once would have written, except for the rounding of variances ([`Moments::resume`]): a share of 2^-52 for each
//! append and each step added since the first. What `vq` reports as signal-to-noise depends on them.
//!
//! [`Moments::resume`]: crate::moments::Moments::resume

use super::order::ValueOrder;
use super::pass::{Pass, Target};
use super::plan::{self, Means, PlannedField};
use super::report::IngestError;
use super::stream::Job;
use super::{CodecChoice, FieldUnits, StepRange, check_cancel, same_mesh, select_steps};
use crate::codec::Quality;
use crate::error::{FileError, FileResult};
use crate::field::{Association, Component, FieldSelector, SeriesSource, TimeAxis};
use crate::short::Short;
use crate::store::{MeanWeights, ResumedField, Store, StoreLock, StoreWriter, StoredField, range_text};
use crate::task::{Cancel, Progress};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Most times listed in an error.
const TIMES_LISTED: usize = 8;

/// The steps to add, and what the store is expected to have.
#[derive(Clone, Debug, Default)]
pub struct AppendOptions {
    /// Fields that the store must have. All fields of the store are read, whatever is named here.
    pub fields: Vec<FieldSelector>,
    /// Units that fields of the store must have.
    pub units: Vec<FieldUnits>,
    /// Range of source steps; those after the store's last one are added.
    pub steps: StepRange,
    /// The codec that the store must have.
    pub codec: Option<CodecChoice>,
    /// Whether the store must have brought values of cells to the vertices.
    pub cells_to_points: bool,
}

/// What an append would do.
#[derive(Clone, Debug, Serialize)]
pub struct AppendPlan {
    /// The source.
    pub source: String,
    /// The store.
    #[serde(serialize_with = "crate::files::serialize_path")]
    pub output: PathBuf,
    /// Steps that the store has.
    pub steps_before: usize,
    /// Times of the store's first and last step.
    pub times_before: [f64; 2],
    /// Time of the last step of the source.
    pub source_last: f64,
    /// Steps to be added.
    pub steps_added: usize,
    /// Times of the first and the last added step.
    pub times_added: Option<[f64; 2]>,
    /// Steps of the store that are read and coded again: a last short block.
    pub steps_coded_again: usize,
}

/// What an append did.
#[derive(Clone, Debug, Serialize)]
pub struct AppendReport {
    /// The steps that were added.
    #[serde(flatten)]
    pub plan: AppendPlan,
    /// The fields after the append; empty if there was nothing to add.
    pub fields: Vec<AppendedField>,
    /// Bytes of values read from the source (as f32).
    pub bytes_read: u64,
    /// Bytes of the store; 0 if there was nothing to add.
    pub bytes: u64,
    /// What was skipped in the source.
    pub notes: Vec<String>,
    /// Duration in seconds.
    pub seconds: f64,
}

/// A field to which steps were added.
#[derive(Clone, Debug, Serialize)]
pub struct AppendedField {
    /// Name in the store.
    pub name: String,
    /// Least and greatest finite value of all steps.
    pub range: Option<[f32; 2]>,
    /// Number of NaN and infinite values in all steps.
    pub nonfinite: u64,
    /// Coding error over all steps; `None` if the values are exact.
    pub quality: Option<Quality>,
}

/// The mapping of source steps to store steps, and the fields to read.
struct Work {
    store: Store,
    fields: Vec<PlannedField>,
    /// Steps of the source to read, in order.
    steps: Vec<usize>,
    /// Step of the store that the first one becomes.
    first: usize,
    plan: AppendPlan,
}

/// Appends the steps of `source` after the last step of the store at `out`.
///
/// The longer store replaces the old one in one move when all is written. After a failure, a raised `cancel` or with nothing to add, the
/// store is unchanged. Readers that have it open keep the steps that they had.
///
/// # Errors
/// If the source cannot be read, lacks a field of the store, or has another mesh; if the store cannot be read or written, or
/// does not have what `options` names; with codec `vq`, if the source no longer has the steps of the last short block.
pub fn append(
    source: &dyn SeriesSource,
    out: &Path,
    options: &AppendOptions,
    progress: &dyn Progress,
    cancel: &Cancel,
) -> Result<AppendReport, IngestError> {
    let start = Instant::now();
    // Held from before the store is read until the longer one is in place: two concurrent appends would each extend the old one.
    let _lock = StoreLock::wait(out, cancel).ok_or(IngestError::Cancelled)?;
    let Work { store, fields, steps, first, plan } = Work::of(source, out, options)?;
    let mut report =
        AppendReport { plan, fields: Vec::new(), bytes_read: 0, bytes: 0, notes: source.notes(), seconds: 0.0 };
    if report.plan.steps_added == 0 {
        return Ok(report);
    }
    let mesh = store.mesh()?;
    let raw = source.mesh().map_err(IngestError::Source)?;
    let counts = [raw.points.len(), raw.cells.len()];
    check_cancel(cancel)?;
    same_mesh::check(source, raw, &store, &mesh)?;

    let (mut writer, resumed) = StoreWriter::append(&store)?;
    let targets = targets(&fields, &store, resumed)?;
    let (order, _) = ValueOrder::new(mesh, &fields);
    let job = Job { source, fields: &fields, steps: &steps, cancel };
    let mut pass = Pass::new(job, order, counts, targets);
    pass.run("append", first, progress, &mut |_, _| Ok(()))?;

    report.bytes_read = pass.values_read * size_of::<f32>() as u64;
    report.fields = finish(pass.targets, &store)?;
    let mut times = store.times().values.clone();
    times.extend(steps.iter().rev().take(report.plan.steps_added).rev().map(|&step| source.times().values[step]));
    writer.write_times(&TimeAxis { values: times })?;
    report.notes = source.notes();
    let (origin, notes) = store.origin();
    let mut notes = notes.to_vec();
    notes.extend(report.notes.iter().filter(|note| !store.origin().1.contains(note)).cloned());
    check_cancel(cancel)?;
    report.bytes = writer.finish(origin, notes)?;
    report.seconds = start.elapsed().as_secs_f64();
    Ok(report)
}

/// Plans an [`append`]: reads the mesh of the source to compare it, and writes nothing.
///
/// # Errors
/// As [`append`], but for damage in steps other than the first.
pub fn plan_append(source: &dyn SeriesSource, out: &Path, options: &AppendOptions) -> Result<AppendPlan, IngestError> {
    let work = Work::of(source, out, options)?;
    let raw = source.mesh().map_err(IngestError::Source)?;
    same_mesh::check(source, raw, &work.store, &work.store.mesh()?)?;
    Ok(work.plan)
}

impl Work {
    fn of(source: &dyn SeriesSource, out: &Path, options: &AppendOptions) -> FileResult<Self> {
        let store = Store::open(out)?;
        check_codec(&store, options.codec.as_ref())?;
        let fields = fields_of(source, &store, options)?;
        let (times, known) = (&source.times().values, &store.times().values);
        let selected = select_steps(source, options.steps)?;
        // A store has at least one step.
        let last = known.last().copied().unwrap_or(f64::NEG_INFINITY);
        let new: Vec<usize> = selected.into_iter().filter(|&step| times[step] > last).collect();
        let settled = |field: &StoredField| field.settled_steps(known.len());
        let first = store.fields().iter().map(settled).min().unwrap_or(known.len());
        let again = if new.is_empty() { Vec::new() } else { find_again(source, &store, first)? };
        let ends = |steps: &[usize]| Some([times[*steps.first()?], times[*steps.last()?]]);
        let plan = AppendPlan {
            source: source.describe(),
            output: out.to_owned(),
            steps_before: known.len(),
            times_before: [known.first().copied().unwrap_or(last), last],
            source_last: times.last().copied().unwrap_or(last),
            steps_added: new.len(),
            times_added: ends(&new),
            steps_coded_again: again.len(),
        };
        Ok(Self { fields, steps: [again, new].concat(), first, plan, store })
    }
}

/// A planned field, with its values brought to the vertices as they were at import.
fn as_stored(field: PlannedField, store: &Store) -> PlannedField {
    let name = field.outputs.first().map(|output| &output.name);
    let means = store.fields().iter().find(|of| Some(&of.name) == name).and_then(|of| match of.values_of {
        Association::Point if of.association == Association::Cell => {
            Some(of.weights.map_or(Means::Unweighted, |MeanWeights::Volume| Means::ByVolume))
        }
        _ => None,
    });
    PlannedField { means, ..field }
}

/// Fails if values of cells are to be brought to the vertices, and those of the store were not.
fn check_values_of(store: &Store, options: &AppendOptions) -> FileResult<()> {
    let kept = store.fields().iter().find(|field| field.values_of == Association::Cell);
    match kept.filter(|_| options.cells_to_points) {
        None => Ok(()),
        Some(field) => {
            let problem = "has values of cells: a store keeps them where they are";
            let remedy = "leave --cells-to-points out, or import the series again";
            Err(FileError::invalid(store.path(), format!("field '{}'", field.name), problem).remedy(remedy))
        }
    }
}

/// The source steps that match the store's steps from `first` on.
fn find_again(source: &dyn SeriesSource, store: &Store, first: usize) -> FileResult<Vec<usize>> {
    let times = &source.times().values;
    let find = |time: &f64| times.binary_search_by(|t| t.total_cmp(time)).map_err(|_| *time);
    let (found, missing): (Vec<_>, Vec<_>) = store.times().values[first..].iter().map(find).partition(Result::is_ok);
    if missing.is_empty() {
        return Ok(found.into_iter().flatten().collect());
    }
    let listed: Vec<String> =
        missing.iter().take(TIMES_LISTED).filter_map(|t| t.as_ref().err()).map(|t| t.to_string()).collect();
    let more = match missing.len().saturating_sub(TIMES_LISTED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let problem = format!(
        "lacks steps that {} has, at {}{more}: codec vq codes its last block of 64 steps again when it is short, and that from \
         the source",
        store.path().display(),
        listed.join(", ")
    );
    let remedy = "name a source that has these steps as well; a store of codec raw has no such need";
    Err(FileError::invalid(source.describe(), "time", problem).remedy(remedy))
}

/// Fails if another codec than the store's is asked for.
fn check_codec(store: &Store, asked: Option<&CodecChoice>) -> FileResult<()> {
    let Some(asked) = asked else { return Ok(()) };
    for field in store.fields().iter().filter(|field| field.magnitude_of.is_empty()) {
        // Stores of an older version are skipped here: appending to them gives the error.
        let Some(kept) = field.coding().and_then(|coding| coding.choice()) else { continue };
        if kept != *asked {
            let problem = format!("is coded as {kept}, not as {asked}: a store keeps its codec");
            let remedy = "leave --codec and its options out, or name those that it has";
            return Err(FileError::invalid(store.path(), format!("field '{}'", field.name), problem).remedy(remedy));
        }
    }
    Ok(())
}

/// The source fields to read for the fields of the store, and no others.
fn fields_of(source: &dyn SeriesSource, store: &Store, options: &AppendOptions) -> FileResult<Vec<PlannedField>> {
    let invalid = |problem: String| FileError::invalid(source.describe(), "fields", problem);
    // The store has its units already: those of the source do not count.
    let plan = |selectors: &[FieldSelector], units: &[FieldUnits]| plan::plan(source.fields(), selectors, units, &[]);
    let stored = |name: &str| store.fields().iter().find(|f| f.name == name);
    let names = || store.fields().iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
    if !options.fields.is_empty() {
        let asked = plan(&options.fields, &[]).map_err(invalid)?;
        if let Some(output) = asked.iter().flat_map(|f| &f.outputs).find(|output| stored(&output.name).is_none()) {
            let problem = format!("there is no field '{}'; the fields are: {}", output.name, names());
            let remedy = "steps are added to the fields that there are; import the series again for others";
            return Err(FileError::invalid(store.path(), "fields", problem).remedy(remedy));
        }
    }
    let all = plan(&[], &[]).map_err(invalid)?;
    let selectors: Vec<FieldSelector> =
        if is_that_of(&all, store) { Vec::new() } else { store.fields().iter().map(selector).collect() };
    let gives = |selector: &FieldSelector, name: &str| {
        let planned = plan(std::slice::from_ref(selector), &[]);
        planned.is_ok_and(|fields| fields.iter().flat_map(|f| &f.outputs).any(|output| output.name == name))
    };
    let missing = selectors.iter().zip(store.fields()).filter(|(selector, field)| !gives(selector, &field.name));
    let missing: Vec<String> = missing.map(|(_, field)| format!("'{}'", field.name)).collect();
    if !missing.is_empty() {
        let have: Vec<&str> = source.fields().iter().map(|f| f.name.as_str()).collect();
        let problem =
            format!("lacks what {} has: {}; it has: {}", store.path().display(), missing.join(", "), have.join(", "));
        return Err(invalid(problem).remedy(
            "import as before: with --define for fields that were calculated, with --fixed-points for points that move",
        ));
    }
    let planned = plan(&selectors, &options.units).map_err(invalid)?;
    let planned: Vec<PlannedField> = planned.into_iter().map(|field| as_stored(field, store)).collect();
    check_values_of(store, options)?;
    if !is_that_of(&planned, store) {
        let problem =
            format!("are not those of {} (per point or per cell, components): {}", store.path().display(), names());
        return Err(invalid(problem));
    }
    for output in planned.iter().flat_map(|f| &f.outputs) {
        let before = stored(&output.name).and_then(|f| f.units.as_deref());
        if let Some(units) = output.units.as_deref().filter(|units| Some(*units) != before) {
            let before = before.map_or("no unit".to_owned(), |units| format!("the unit '{units}'"));
            let problem = format!("has {before}, not '{units}': a store keeps its units");
            return Err(FileError::invalid(store.path(), format!("field '{}'", output.name), problem)
                .remedy("leave --units out, or name those that it has"));
        }
    }
    Ok(planned)
}

/// The selector of a store's field; a computed magnitude selects its whole vector.
fn selector(field: &StoredField) -> FieldSelector {
    // The parser accepts any text.
    let Ok(selector) = field.name.parse::<FieldSelector>();
    match selector.component {
        Some(Component::Magnitude) if !field.magnitude_of.is_empty() => {
            FieldSelector { name: selector.name, component: None }
        }
        _ => selector,
    }
}

/// Whether a plan yields exactly the fields of the store.
fn is_that_of(planned: &[PlannedField], store: &Store) -> bool {
    let outputs = planned.iter().flat_map(|f| f.outputs.iter().map(move |output| (output, f.info.association)));
    let mut planned: Vec<_> =
        outputs.map(|(o, association)| (o.name.as_str(), o.virtual_, association as u8)).collect();
    let of = |f: &StoredField| !f.magnitude_of.is_empty();
    let mut stored: Vec<_> = store.fields().iter().map(|f| (f.name.as_str(), of(f), f.association as u8)).collect();
    planned.sort_unstable();
    stored.sort_unstable();
    planned == stored
}

/// The continued fields, in the order of the plan.
fn targets(fields: &[PlannedField], store: &Store, resumed: Vec<ResumedField>) -> FileResult<Vec<Vec<Target>>> {
    let mut resumed: Vec<Option<ResumedField>> = resumed.into_iter().map(Some).collect();
    let mut take =
        |name: &str| resumed.iter_mut().find(|f| f.as_ref().is_some_and(|f| f.writer.name() == name))?.take();
    let mut of = |field: &PlannedField| -> FileResult<Vec<Target>> {
        let target = |name: &str| {
            let missing = || FileError::invalid(store.path(), "fields", format!("there is no field '{name}'"));
            let ResumedField { writer, moments, first_step } = take(name).ok_or_else(missing)?;
            let (association, values_of) = (field.info.association, field.values_of());
            Ok(Target { writer, moments, association, values_of, first_step })
        };
        field.outputs.iter().map(|output| output.name.as_str()).map(target).collect()
    };
    fields.iter().map(&mut of).collect()
}

/// Finishes the fields; reports them in store order.
fn finish(targets: Vec<Vec<Target>>, store: &Store) -> FileResult<Vec<AppendedField>> {
    let one = |target: Target| {
        let series = target.moments.series();
        let name = target.writer.name().to_owned();
        let quality = target.writer.finish(&target.moments)?.quality;
        Ok(AppendedField { name, range: series.range, nonfinite: series.nonfinite, quality })
    };
    let mut fields = targets.into_iter().flatten().map(one).collect::<FileResult<Vec<_>>>()?;
    fields.sort_by_key(|field| store.fields().iter().position(|f| f.name == field.name));
    Ok(fields)
}

impl fmt::Display for AppendPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps_before, times_before: [first, last], .. } = self;
        writeln!(f, "{} -> {}", self.source, self.output.display())?;
        write!(f, "the store has {steps_before} steps, time {} to {}; ", Short(first), Short(last))?;
        match self.times_added {
            None => write!(f, "nothing new: the source ends at {}", Short(self.source_last))?,
            Some([first, last]) => {
                write!(f, "new: {} steps, time {} to {}", self.steps_added, Short(first), Short(last))?;
            }
        }
        match self.steps_coded_again {
            0 => Ok(()),
            n => write!(f, "\n{n} steps before them are coded again: their block of 64 steps was short"),
        }
    }
}

impl fmt::Display for AppendReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.plan)?;
        for AppendedField { name, range, nonfinite, quality } in &self.fields {
            write!(f, "field {name}: {}", range_text(*range))?;
            if let Some(quality) = quality {
                write!(f, ", errors up to {:.3e}", quality.max_error)?;
            }
            if *nonfinite > 0 {
                write!(f, ", {nonfinite} values not finite")?;
            }
            writeln!(f)?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        if self.plan.steps_added == 0 {
            return write!(f, "nothing was written");
        }
        let [read, size] = [self.bytes_read, self.bytes].map(|bytes| bytes as f64 / 1e6);
        write!(f, "{read:.1} MB read, the store has {size:.1} MB, {:.2} s", self.seconds)
    }
}
