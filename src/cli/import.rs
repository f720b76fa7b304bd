//! `tetreel import`: a foreign series into a store.

use super::append::Job;
use super::progress::Terminal;
use super::{Outcome, print_result, steps};
use crate::calculator::{Definition, calculated};
use crate::codec::vq::MAX_ENTRIES;
use crate::codec::{CODECS, codec_of};
use crate::error::FileResult;
use crate::field::{Association, FieldInfo, FieldSelector, SeriesSource};
use crate::import::{self, Format};
use crate::ingest::{Checkpoints, CodecChoice, FieldUnits, IngestOptions, StepRange, check_fields, ingest, mesh_of};
use crate::mesh::{ConnectivityChoice, RepairReport, SourceCells};
use anyhow::bail;
use clap::builder::PossibleValuesParser;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

/// Shortest and longest pause between two checks of a followed source, in seconds.
const FOLLOW_MIN: f64 = 0.01;
const FOLLOW_MAX: f64 = 86_400.0;

#[derive(Debug, clap::Args)]
#[command(
    about = "Import a series of files of a simulation into a store",
    after_help = "Example:\n  tetreel import run/case.pvd -o case.zarr --field T --field velocity:mag --units T=K\n  \
tetreel import run/case.pvd -o small.zarr --codec vq --entries 1024\n  \
tetreel import run/case.pvd -o case.zarr --define 'ke = 0.5*rho*mag(u)^2' --field ke --field u:vorticity\n  \
tetreel import run/case.pvd -o case.zarr --append --follow    # while the simulation runs; Ctrl-C ends it"
)]
pub(super) struct Args {
    #[arg(required = true, value_name = "SOURCE")]
    #[arg(help = format!("A file or folder of a series ({}), or several files that are a step each, in the natural order of their \
        names, or have other fields each (.xdmf)", Format::extensions()))]
    pub(super) sources: Vec<PathBuf>,
    /// The store to write
    #[arg(short, long, value_name = "NAME.zarr", required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    /// Field to import: NAME, NAME:mag or NAME:0, or a quantity of it: NAME:mises, :principal, :trace or :det of a tensor, NAME:divergence,
    /// :vorticity or :q of a vector, NAME:gradient (again for more; default: all)
    #[arg(long = "field", value_name = "FIELD")]
    pub(super) fields: Vec<FieldSelector>,
    /// Field to calculate, from others and those before it: NAME = EXPRESSION with + - * / ^, u[0], functions as in mag(u), coords, time
    /// and pi; names with other characters in double quotes (again for more)
    #[arg(long = "define", value_name = "NAME = EXPRESSION")]
    pub(super) definitions: Vec<Definition>,
    /// Unit of a field, shown by info and on legends, if it is not the one that the files say; that of a vector is also that of its
    /// components and magnitude (again for more)
    #[arg(long, value_name = "FIELD=UNIT")]
    pub(super) units: Vec<FieldUnits>,
    /// Steps A..B:S, zero-based, both ends included
    #[arg(long, value_name = "A..B:S", default_value = "0..")]
    pub(super) steps: StepRange,
    #[arg(long, value_parser = PossibleValuesParser::new(CODECS.iter().map(|codec| codec.name)), help = codec_help())]
    codec: Option<String>,
    /// Entries of each codebook of vq: more are larger and closer to the truth [default: 256]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=MAX_ENTRIES as i64))]
    entries: Option<u32>,
    /// How vq finds its codebooks: fast, or exact (much slower, a little closer) [default: fast]
    #[arg(long, value_name = "HOW", value_parser = ["fast", "exact"])]
    search: Option<String>,
    /// Let vq err relative to each vertex's own variation, for values over many orders of magnitude
    #[arg(long)]
    relative: bool,
    /// Import the cells of this block alone, by its name or number (again for more; info SOURCE lists them)
    #[arg(long = "block", value_name = "NAME")]
    pub(super) blocks: Vec<String>,
    /// Let points move: show all steps on the points of the first, and keep the displacement as a field
    #[arg(long)]
    pub(super) fixed_points: bool,
    /// Bring values of cells to the vertices, for isosurfaces and smooth pictures: the mean of the cells around each, weighted by
    /// their volumes; without it they stay constant in their cells
    #[arg(long)]
    pub(super) cells_to_points: bool,
    /// Whether to find which cells are beside each other: full; none, to draw them as points alone; or auto: full unless more than half of
    /// the cells' faces have no partner (of 64 cells at least)
    #[arg(long, value_name = "HOW", default_value = "auto")]
    pub(super) connectivity: ConnectivityChoice,
    /// Radius of the points of a cloud, in place of what the source has (the field or array radius) or of half the distance to the fourth
    /// nearest point
    #[arg(long, value_name = "R", allow_hyphen_values = true, value_parser = size)]
    pub(super) radius: Option<f64>,
    /// Volume of the points of a cloud, in place of what the source has (the field or array volume) or of that of the balls: the thickness
    /// of a point is its chord times the ratio
    #[arg(long, value_name = "V", allow_hyphen_values = true, value_parser = size)]
    pub(super) volume: Option<f64>,
    /// Check the mesh and the fields of every step, and say what would be imported; write nothing
    #[arg(long)]
    dry_run: bool,
    /// Replace a store that exists
    #[arg(long)]
    overwrite: bool,
    /// Add the steps after the last one of the store, whose mesh, fields and codec stay; without a store, write one
    #[arg(long, conflicts_with = "overwrite", requires = "output")]
    append: bool,
    /// Look again every so many seconds, until Ctrl-C, and add what has come [default: 2]
    #[arg(long, requires = "append", conflicts_with = "dry_run", value_name = "SECONDS", num_args = 0..=1)]
    #[arg(default_missing_value = "2", value_parser = seconds)]
    follow: Option<f64>,
    /// Keep what is done in NAME.zarr.partial every so many seconds (0: at every chance), and go on from there if an import of the same
    /// was interrupted; the store is that of one import without a break [default: 10]
    #[arg(long, conflicts_with_all = ["append", "dry_run"], value_name = "SECONDS", num_args = 0..=1, require_equals = true)]
    #[arg(default_missing_value = "10", value_parser = pause)]
    resume: Option<f64>,
    /// Print the report as JSON
    #[arg(long)]
    pub(super) json: bool,
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let codec = codec(args)?;
    if let (true, Some(output)) = (args.append, &args.output) {
        let job = Job { args, output, codec: args.codec.as_ref().map(|_| codec.clone()) };
        return match (args.follow, args.dry_run && output.symlink_metadata().is_ok()) {
            (Some(seconds), _) => job.follow(Duration::from_secs_f64(seconds), terminal),
            (None, true) => job.plan(terminal),
            (None, false) if args.dry_run => import(args, codec, terminal),
            (None, false) => job.once(terminal),
        };
    }
    import(args, codec, terminal)
}

fn import(args: &Args, codec: CodecChoice, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let series = source(args, &[])?;
    let (fields, units) = (args.fields.clone(), args.units.clone());
    let steps = steps::within_series(args.steps, series.times().len(), terminal);
    let (overwrite, cells_to_points, connectivity) = (args.overwrite, args.cells_to_points, args.connectivity);
    let (radius, volume) = (args.radius, args.volume);
    let checkpoints = args.resume.map(|pause| Checkpoints { pause: Duration::from_secs_f64(pause) });
    let options = IngestOptions {
        fields,
        units,
        steps,
        overwrite,
        codec,
        cells_to_points,
        connectivity,
        radius,
        volume,
        checkpoints,
    };
    let (false, Some(output)) = (args.dry_run, &args.output) else {
        check_fields(&*series, &options)?;
        let plan = Plan::of(&*series, args, &options, terminal)?;
        print_result(args.json, &plan, &plan)?;
        return Ok(Outcome::Done);
    };
    let report = ingest(&*series, output, &options, terminal, &terminal.cancel)?;
    print_result(args.json, &report, &report)?;
    Ok(Outcome::Done)
}

/// The series of the arguments, with the fields that they define, and the quantities that these and `stored` fields are.
pub(super) fn source(args: &Args, stored: &[FieldSelector]) -> FileResult<Box<dyn SeriesSource>> {
    let mut source = import::open_many(&args.sources)?;
    if args.fixed_points {
        source.fix_points()?;
    }
    let source = import::choose_blocks(source, &args.blocks)?;
    calculated(source, &args.definitions, &[&args.fields[..], stored].concat())
}

fn pause(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| (0.0..=FOLLOW_MAX).contains(s));
    seconds.ok_or_else(|| format!("'{text}' is no number of seconds from 0 to {FOLLOW_MAX}"))
}

fn size(text: &str) -> Result<f64, String> {
    let size = text.parse().ok().filter(|size: &f64| *size > 0.0 && size.is_finite());
    size.ok_or_else(|| format!("'{text}' is no number above 0"))
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| (FOLLOW_MIN..=FOLLOW_MAX).contains(s));
    seconds.ok_or_else(|| format!("'{text}' is no number of seconds from {FOLLOW_MIN} to {FOLLOW_MAX}"))
}

/// Help text of the codecs.
fn codec_help() -> String {
    let all: Vec<String> = CODECS.iter().map(|codec| format!("{}, {}", codec.name, codec.about)).collect();
    let first = CODECS[0].name;
    format!("How values are stored: {} [default: {first}, or that of the store with --append]", all.join("; "))
}

/// The codec named by the options; by default the first.
fn codec(args: &Args) -> anyhow::Result<CodecChoice> {
    let entries = args.entries.map(|entries| entries.to_string());
    let relative = args.relative.then_some("true");
    let given = [("entries", entries.as_deref()), ("search", args.search.as_deref()), ("relative", relative)];
    let given: Vec<(&str, &str)> = given.into_iter().filter_map(|(name, value)| Some((name, value?))).collect();
    let Some(codec) = args.codec.as_deref().map_or(Some(CODECS[0]), codec_of) else {
        bail!("--codec is none of those that there are");
    };
    if let Some((option, _)) = given.iter().find(|(option, _)| !codec.options.contains(option)) {
        let others = CODECS.iter().filter(|other| other.options.contains(option));
        let others: Vec<String> = others.map(|other| format!("--codec {}", other.name)).collect();
        bail!("--{option} is of {}: say so, or leave it out", others.join(" and "));
    }
    (codec.choose)(&given).map_err(anyhow::Error::msg)
}

/// Report of `--dry-run`.
#[derive(Serialize)]
struct Plan {
    source: String,
    repair: RepairReport,
    steps: usize,
    fields: Vec<FieldInfo>,
    bytes: u64,
    notes: Vec<String>,
}

impl Plan {
    fn of(
        series: &dyn SeriesSource,
        args: &Args,
        options: &IngestOptions,
        terminal: &Terminal,
    ) -> anyhow::Result<Self> {
        let (mesh, repair) = mesh_of(series, series.mesh()?, options)?;
        let selected = options.steps.select(series.times().len())?;
        for &step in &selected {
            terminal.check_interrupted()?;
            series.check(step)?;
        }
        let steps = selected.len();
        let wanted = |f: &&FieldInfo| args.fields.is_empty() || args.fields.iter().any(|s| s.name == f.name);
        let fields: Vec<FieldInfo> = series.fields().iter().filter(wanted).cloned().collect();
        let source_cells = SourceCells::of(&mesh.cell_source).len();
        let values = |field: &FieldInfo| match field.association {
            Association::Cell if !args.cells_to_points => source_cells,
            _ => mesh.positions.local.len(),
        };
        let numbers: usize = if args.fields.is_empty() {
            fields.iter().map(|f| f.components * values(f)).sum()
        } else {
            let of = |s: &FieldSelector| {
                let of_name = fields.iter().filter(|f| f.name == s.name).take(1);
                of_name.map(|f| values(f) * if s.component.is_some() { 1 } else { f.components }).sum::<usize>()
            };
            args.fields.iter().map(of).sum()
        };
        let bytes = (numbers * size_of::<f32>() * steps) as u64;
        let repair = repair.with_cell_numbers(|cell| series.cell_number(cell));
        Ok(Self { source: series.describe(), repair, steps, fields, bytes, notes: series.notes() })
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.source)?;
        writeln!(f, "mesh: {}", self.repair)?;
        writeln!(f, "steps: {}", self.steps)?;
        for field in &self.fields {
            writeln!(f, "field {}: {} component(s) per {:?}", field.name, field.components, field.association)?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        writeln!(f, "values: {:.1} MB; nothing was written", self.bytes as f64 / 1e6)
    }
}
