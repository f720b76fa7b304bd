//! `tetreel export`: the steps of a store, or surfaces of them, as files that other programs read.

use super::progress::Terminal;
use super::{Outcome, print_result, source, steps};
use crate::export::StoredSeries;
use crate::export::surface::{self, Shape, SurfaceOptions};
use crate::export::vtu::{self, VtuOptions};
use crate::field::FieldSelector;
use crate::ingest::StepRange;
use crate::render::surfaces::Cut;
use anyhow::bail;
use std::path::PathBuf;

/// Write the steps of a store, or surfaces of them, as files that other programs read
#[derive(Debug, clap::Args)]
#[command(after_help = "Without a surface: case.pvd, and the folder case beside it with case_0000.vtu and so on.\n\
                  With one (docs/surfaces.md): -o case.pvd makes case/case_0000.vtp and so on, -o case_%04d.vtp or case_%04d.ply\n\
                  a file for each step, -o case.vtp or case.ply the file of a single step.\n\n\
                  Example:\n  tetreel export case.zarr -o case.pvd --field T --steps 0..99:10\n  \
                  tetreel export case.zarr -o case_%04d.ply --field T --iso 0.25 --iso -0.25\n  \
                  tetreel export case.zarr -o cut.pvd --slice \"point=0,0,1 normal=0,0,1\"")]
pub(super) struct Args {
    /// A store, or a source to import to the cache first
    #[arg(value_name = "NAME.zarr")]
    store: PathBuf,
    /// The collection to write, its files go to a folder of that name beside it; or the files of surfaces, %04d for their number
    #[arg(short, long, value_name = "OUT.pvd")]
    output: PathBuf,
    /// Field to write: NAME (a vector with all its components), NAME:mag or NAME:0 (again for more; default: all)
    #[arg(long = "field", value_name = "FIELD")]
    fields: Vec<FieldSelector>,
    /// Steps A..B:S, zero-based, both ends included
    #[arg(long, value_name = "A..B:S", default_value = "0..")]
    steps: StepRange,
    #[command(flatten)]
    surface: SurfaceArgs,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Options of surfaces.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
struct SurfaceArgs {
    /// Write the isosurface at a value of the one field instead (again for more, in the same files)
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, value_parser = isovalue)]
    iso: Vec<f64>,
    /// Write the section of a plane with all fields instead: point=x,y,z normal=x,y,z
    #[arg(long, value_name = "PLANE", value_parser = plane)]
    slice: Option<Cut>,
    /// Write the boundary of the mesh with all fields instead
    #[arg(long)]
    surface: bool,
}

fn isovalue(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| "an isovalue is a finite number".to_owned())
}

fn plane(text: &str) -> Result<Cut, String> {
    let cut: Cut = text.parse()?;
    if cut.clips { Err("a slice clips nothing; leave 'clip' out".to_owned()) } else { Ok(cut) }
}

impl SurfaceArgs {
    /// The surface, if requested.
    fn shape(&self) -> anyhow::Result<Option<Shape>> {
        if let Some(twice) = self.iso.iter().enumerate().find_map(|(i, v)| self.iso[..i].contains(v).then_some(v)) {
            bail!("--iso {twice} is there twice; leave one out");
        }
        Ok(match (self.iso.is_empty(), self.slice, self.surface) {
            (false, ..) => Some(Shape::Isovalues(self.iso.clone())),
            (true, Some(plane), _) => Some(Shape::Plane(plane)),
            (true, None, true) => Some(Shape::Boundary),
            (true, None, false) => None,
        })
    }
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    let shape = args.surface.shape()?;
    let is_surface_file =
        args.output.extension().is_some_and(|e| ["vtp", "ply"].iter().any(|s| e.eq_ignore_ascii_case(s)));
    if shape.is_none() && is_surface_file {
        bail!("{}: such a file holds a surface; add --iso, --slice or --surface", args.output.display());
    }
    let store = source::open(&args.store, terminal)?;
    let count = store.times().len();
    let steps = Some(steps::within_series(args.steps, count, terminal).select(count)?);
    match shape {
        Some(shape) => {
            let options = SurfaceOptions { shape, fields: args.fields.clone(), steps };
            let report = surface::write_surfaces(&store, &args.output, &options, terminal, &terminal.cancel)?;
            print_result(args.json, &report, &report)?;
        }
        None => {
            let series = StoredSeries::new(&store, &args.fields)?;
            let options = VtuOptions { steps, ..VtuOptions::default() };
            let report = vtu::write_collection(&series, &args.output, &options, terminal, &terminal.cancel)?;
            print_result(args.json, &report, &report)?;
        }
    }
    Ok(Outcome::Done)
}
