//! `tetreel info`: contents of a store, or of the files of a simulation.

use super::progress::Terminal;
use super::{Outcome, print_result};
use crate::field::{Association, FieldInfo, SeriesSource};
use crate::import::{self, Format};
use crate::short::Short;
use crate::store::{BlockInfo, Store, TimeInfo, is_store};
use glam::DVec3;
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Show what a store holds, or files of a simulation: mesh, times, fields
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel info case.zarr --json\n  tetreel info run/case.pvd")]
pub(super) struct Args {
    #[arg(required = true, value_name = "NAME.zarr|SOURCE")]
    #[arg(help = format!("A store, or files to import ({}), of which the first step is read and the times of all", Format::extensions()))]
    paths: Vec<PathBuf>,
    /// Print JSON: {mesh, time, fields, bytes, version} of a store, {source, mesh, time, fields, notes} of files
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args, _: &Terminal) -> anyhow::Result<Outcome> {
    match &args.paths[..] {
        [path] if is_store(path) || path.extension().is_some_and(|extension| extension == "zarr") => {
            let info = Store::open(path)?.info()?;
            print_result(args.json, &info, &info)?;
        }
        paths => {
            let info = SourceInfo::of(&*import::open_many(paths)?)?;
            print_result(args.json, &info, &info)?;
        }
    }
    Ok(Outcome::Done)
}

/// What files hold that are not imported.
#[derive(Serialize)]
struct SourceInfo {
    source: String,
    mesh: SourceMesh,
    time: TimeInfo,
    fields: Vec<SourceField>,
    notes: Vec<String>,
}

/// A field, and its unit where the files say it.
#[derive(Serialize)]
struct SourceField {
    #[serde(flatten)]
    info: FieldInfo,
    #[serde(skip_serializing_if = "Option::is_none")]
    units: Option<String>,
}

/// The mesh of the first step as it is in the files; cells without volume are left out.
#[derive(Serialize)]
struct SourceMesh {
    points: usize,
    cells: usize,
    /// Cells that are tetrahedra.
    tetrahedra: usize,
    /// Corners of the box around all finite points; `None` without any.
    bounds: Option<[[f64; 3]; 2]>,
    /// The blocks, which import chooses by name or number.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    blocks: Vec<BlockInfo>,
}

impl SourceInfo {
    fn of(series: &dyn SeriesSource) -> anyhow::Result<Self> {
        let mesh = series.mesh()?;
        let mut finite = mesh.points.iter().copied().filter(|point| point.is_finite());
        let first = finite.next();
        let bounds = first.map(|first| {
            let grow = |[low, high]: [DVec3; 2], point: DVec3| [low.min(point), high.max(point)];
            finite.fold([first; 2], grow).map(|corner| corner.to_array())
        });
        let blocks = series.blocks()?.as_ref().map_or(Vec::new(), BlockInfo::all);
        let times = &series.times().values;
        let [first, last] = [times.first(), times.last()].map(|time| time.copied().unwrap_or_default());
        let field = |info: &FieldInfo| SourceField { info: info.clone(), units: series.unit(info) };
        Ok(Self {
            source: series.describe(),
            mesh: SourceMesh {
                points: mesh.points.len(),
                cells: mesh.cells.len(),
                tetrahedra: mesh.cells.tets.len(),
                bounds,
                blocks,
            },
            time: TimeInfo { steps: times.len(), first, last },
            fields: series.fields().iter().map(field).collect(),
            notes: series.notes(),
        })
    }
}

impl fmt::Display for SourceInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "source   {}", self.source)?;
        let SourceMesh { points, cells, tetrahedra, bounds, blocks } = &self.mesh;
        writeln!(f, "mesh     {cells} cells ({tetrahedra} tetrahedra), {points} points")?;
        if let Some([low, high]) = bounds {
            writeln!(f, "bounds   {low:?} to {high:?}")?;
        }
        blocks.iter().try_for_each(|block| writeln!(f, "{block}"))?;
        let [first, last] = [self.time.first, self.time.last].map(Short);
        writeln!(f, "time     {} steps, {first} to {last}", self.time.steps)?;
        for SourceField { info: FieldInfo { name, components, association }, units } in &self.fields {
            let of = if *association == Association::Cell { "cells" } else { "points" };
            let count = if *components == 1 { String::new() } else { format!(", {components} components") };
            let units = units.as_ref().map_or(String::new(), |units| format!(", {units}"));
            writeln!(f, "field    {name} (of {of}{count}{units})")?;
        }
        for note in &self.notes {
            writeln!(f, "note     {note}")?;
        }
        write!(f, "read     the first step alone; import --dry-run reads all")
    }
}
