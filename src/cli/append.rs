//! `tetreel import --append`: adds new steps, once or repeatedly.

use super::import::{Args, source};
use super::progress::Terminal;
use super::{Outcome, print_result, steps};
use crate::field::FieldSelector;
use crate::import;
use crate::ingest::{
    AppendOptions, AppendReport, CodecChoice, IngestError, IngestOptions, IngestReport, StepRange, append, ingest,
    plan_append,
};
use crate::store::Store;
use crate::task::Progress;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Interval between checks for Ctrl-C during a pause.
const TICK: Duration = Duration::from_millis(50);

/// An append to a store.
pub(super) struct Job<'a> {
    pub(super) args: &'a Args,
    /// The store.
    pub(super) output: &'a Path,
    /// The codec, if one is named.
    pub(super) codec: Option<CodecChoice>,
}

/// Report of a store created or appended to.
enum Done {
    Created(Box<IngestReport>),
    Appended(Box<AppendReport>),
}

impl Job<'_> {
    /// Prints what would be added.
    pub(super) fn plan(&self, terminal: &Terminal) -> anyhow::Result<Outcome> {
        let series = source(self.args, &self.stored())?;
        let steps = steps::within_series(self.args.steps, series.times().len(), terminal);
        let plan = plan_append(&*series, self.output, &self.append_options(steps))?;
        print_result(self.args.json, &plan, &format!("{plan}\nnothing was written"))?;
        Ok(Outcome::Done)
    }

    /// Adds new steps.
    pub(super) fn once(&self, terminal: &Terminal) -> anyhow::Result<Outcome> {
        let done = self.look(steps::within_series, terminal)?;
        self.print(&done)?;
        Ok(Outcome::Done)
    }

    /// Adds new steps as they come, until Ctrl-C.
    pub(super) fn follow(&self, pause: Duration, terminal: &Terminal) -> anyhow::Result<Outcome> {
        let mut seen = None;
        let mut complained_of: Option<PathBuf> = None;
        let source = self.args.sources.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
        terminal.say(&format!("following {source}; Ctrl-C ends it"));
        loop {
            let now = fingerprint(&self.args.sources);
            if now.is_none() || now != seen {
                // Steps that the source lacks now may come later.
                match self.look(|steps, count, _| steps.within(count), terminal) {
                    Ok(done) => {
                        complained_of = None;
                        if !matches!(&done, Done::Appended(report) if report.plan.steps_added == 0) {
                            self.print(&done)?;
                        }
                    }
                    Err(error) if error.may_be_half_written() => {
                        // Reported once per file: at the next check another byte of it may be the last one.
                        let path = error.path().map(Path::to_owned);
                        if complained_of != path {
                            terminal.say(&format!("not yet: {error}"));
                            complained_of = path;
                        }
                    }
                    Err(error) => return Err(error.into()),
                }
                seen = now;
            }
            let end = Instant::now() + pause;
            loop {
                terminal.check_interrupted()?;
                let left = end.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                std::thread::sleep(left.min(TICK));
            }
        }
    }

    /// Adds new steps; `cut` limits the range to the steps that the source has.
    fn look(
        &self,
        cut: impl FnOnce(StepRange, usize, &Terminal) -> StepRange,
        terminal: &Terminal,
    ) -> Result<Done, IngestError> {
        let series = source(self.args, &self.stored()).map_err(IngestError::Source)?;
        let steps = cut(self.args.steps, series.times().len(), terminal);
        let exists = || self.output.symlink_metadata().is_ok();
        let add = || {
            append(&*series, self.output, &self.append_options(steps), terminal, &terminal.cancel)
                .map(|report| Done::Appended(Box::new(report)))
        };
        let result = if exists() {
            add()
        } else {
            let (fields, units) = (self.args.fields.to_vec(), self.args.units.to_vec());
            let codec = self.codec.clone().unwrap_or_default();
            let Args { cells_to_points, connectivity, radius, volume, .. } = *self.args;
            let options = IngestOptions {
                fields,
                units,
                steps,
                codec,
                cells_to_points,
                connectivity,
                radius,
                volume,
                ..Default::default()
            };
            let created = ingest(&*series, self.output, &options, terminal, &terminal.cancel);
            match created {
                // Another process has created the store.
                Err(_) if exists() && !terminal.cancel.is_cancelled() => add(),
                created => created.map(|report| Done::Created(Box::new(report))),
            }
        };
        if result.is_err() {
            terminal.end();
        }
        result
    }

    /// The fields of the store, if there is one: quantities among them are calculated again.
    fn stored(&self) -> Vec<FieldSelector> {
        let store = Store::open(self.output).ok();
        let names = store.iter().flat_map(|store| store.fields()).map(|field| field.name.parse());
        names.filter_map(Result::ok).collect()
    }

    fn append_options(&self, steps: StepRange) -> AppendOptions {
        let (fields, units) = (self.args.fields.to_vec(), self.args.units.to_vec());
        let cells_to_points = self.args.cells_to_points;
        AppendOptions { fields, units, steps, codec: self.codec.clone(), cells_to_points }
    }

    fn print(&self, done: &Done) -> anyhow::Result<()> {
        match done {
            Done::Created(report) => print_result(self.args.json, report, report),
            Done::Appended(report) => print_result(self.args.json, report, report),
        }
    }
}

/// Size and modification time of every file of the sources; `None` if unknown, or if a file was written so recently that another change
/// might have the same time.
fn fingerprint(sources: &[PathBuf]) -> Option<Vec<(PathBuf, u64, SystemTime)>> {
    /// Coarser than the clocks of file systems are (2 s on FAT).
    const SETTLED: Duration = Duration::from_secs(3);
    let mut files = Vec::new();
    for source in sources {
        for path in import::files(source).ok()? {
            let metadata = path.metadata().ok()?;
            let changed = metadata.modified().ok()?;
            if changed.elapsed().map_or(true, |age| age < SETTLED) {
                return None;
            }
            files.push((path, metadata.len(), changed));
        }
    }
    Some(files)
}
