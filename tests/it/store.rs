//! Ingest and store: what goes in comes out, and nothing else happens to the disk.
#![allow(clippy::unwrap_used, reason = "helpers of tests, which may")]

mod append;
mod blocks;
mod cells;
mod damage;
mod growing;
mod histograms;
mod interop;
mod properties;
mod replace;
mod resume;
mod round_trip;
mod vq;

use glam::DVec3;
use std::path::Path;
use tetreel::error::{FileError, FileResult};
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::ingest::{IngestError, IngestOptions, IngestReport, ingest};
use tetreel::mesh::RawMesh;
use tetreel::task::{Cancel, Silent};

/// Value of (field name, component, step, point or cell).
type Formula = Box<dyn Fn(&str, usize, usize, usize) -> f32 + Send + Sync>;

/// A series by formula, that can fail or be cancelled at a step.
struct Formulas {
    mesh: RawMesh,
    times: TimeAxis,
    fields: Vec<FieldInfo>,
    value: Formula,
    fail_at: Option<usize>,
    cancel_at: Option<(usize, Cancel)>,
    /// Values too many in this step.
    long_at: Option<usize>,
}

impl SeriesSource for Formulas {
    fn describe(&self) -> String {
        "formulas".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        if self.fail_at == Some(step) {
            return Err(FileError::invalid("formulas", format!("step {step}"), "fails on purpose"));
        }
        if let Some((at, cancel)) = &self.cancel_at
            && *at == step
        {
            cancel.cancel();
        }
        let Component::Index(component) = component else { panic!("ingest reads components") };
        let mut count = match field.association {
            Association::Point => self.mesh.points.len(),
            Association::Cell => self.mesh.cells.tets.len(),
        };
        if self.long_at == Some(step) {
            count += 1;
        }
        out.clear();
        out.extend((0..count).map(|i| (self.value)(&field.name, component, step, i)));
        Ok(())
    }

    fn notes(&self) -> Vec<String> {
        vec!["3 lines skipped".to_owned()]
    }
}

/// n^3 cubes of six tets each in shuffled order, with a point that nothing uses first, a flat cell and a duplicate.
fn dirty_grid(n: u32) -> RawMesh {
    let at = |x: u32, y: u32, z: u32| 1 + x + (n + 1) * (y + (n + 1) * z);
    let mut points = vec![DVec3::splat(-77.0)];
    for z in 0..=n {
        for y in 0..=n {
            points.extend((0..=n).map(|x| DVec3::new(1e6 + f64::from(x), f64::from(y), 0.5 * f64::from(z))));
        }
    }
    let mut tets = Vec::new();
    for (x, y, z) in (0..n * n * n).map(|i| (i % n, i / n % n, i / n / n)) {
        for path in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut corner = [x, y, z];
            let mut tet = [at(x, y, z); 4];
            for (vertex, axis) in tet[1..].iter_mut().zip(path) {
                corner[axis] += 1;
                *vertex = at(corner[0], corner[1], corner[2]);
            }
            tets.push(tet);
        }
    }
    // 7 is prime to the number of cells 6 n^3 for the sizes used here.
    let mut tets: Vec<[u32; 4]> = (0..tets.len()).map(|i| tets[i * 7 % tets.len()]).collect();
    tets.push([at(0, 0, 0), at(1, 0, 0), at(0, 1, 0), at(1, 1, 0)]);
    tets.push(tets[0]);
    RawMesh { points, cells: tets.into() }
}

/// Distinct values for every field, component, step and index.
fn distinct(name: &str, component: usize, step: usize, index: usize) -> f32 {
    let name: usize = name.bytes().map(usize::from).sum();
    (index as f32 * 0.37).sin() + (10 * component + 100 * step + name) as f32
}

fn field(name: &str, components: usize, association: Association) -> FieldInfo {
    FieldInfo { name: name.to_owned(), components, association }
}

/// A scalar and a vector per point, a scalar and a vector per cell, over `steps` steps.
fn sample(steps: usize) -> Formulas {
    Formulas {
        mesh: dirty_grid(3),
        times: TimeAxis { values: (0..steps).map(|i| 0.1 * i as f64).collect() },
        fields: vec![
            field("T", 1, Association::Point),
            field("velocity", 3, Association::Point),
            field("p", 1, Association::Cell),
            field("flux/area", 3, Association::Cell),
        ],
        value: Box::new(distinct),
        fail_at: None,
        cancel_at: None,
        long_at: None,
    }
}

fn import(source: &Formulas, out: &Path, options: &IngestOptions) -> Result<IngestReport, IngestError> {
    let cancel = source.cancel_at.as_ref().map_or_else(Cancel::new, |(_, cancel)| cancel.clone());
    ingest(source, out, options, &Silent, &cancel)
}

/// Names in a folder, sorted.
fn list(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Relative path and content of every file below a folder, sorted.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for name in list(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            files.extend(contents(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            files.push((name, std::fs::read(&path).unwrap()));
        }
    }
    files
}
