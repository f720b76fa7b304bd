//! What is lost when functions take the place of cells.
//!
//! 1. Samples: vertices, and one random point in each of some cells, apart for cells at the boundary (with a vertex on it), where functions
//!    are on one side only. Where there are more than [`Samples::PER_GROUP`] of a group, one of each of so many equal stretches of their
//!    order is chosen by chance; cells lie along a curve that fills space. Points inside cells are held out: no fit sees them.
//! 2. At each, the sum of all functions in float64, as [`super::value_at`] has it to the bit: of what adds up, only functions are passed
//!    over whose box, enlarged by a millionth, the sample is not in, which are zero there.
//! 3. The error is the distance from what the cells say there, the mean of a cell's corners by barycentric coordinates, as a share of the
//!    field's range over the series.
//!
//! Samples whose cell has a corner without a finite value are holes: counted, and no part of the errors.

use super::{Kernels, Placed};
use crate::mesh::Mesh;
use crate::random::{SplitMix64, hash};
use crate::short::Short;
use crate::task::Cancel;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The errors of functions that stand for a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The field.
    pub field: String,
    /// Least and greatest value of the field over the series; errors are shares of their difference.
    pub range: Option<[f32; 2]>,
    /// Whether they are: where the range is 0 they are in the field's unit.
    pub is_share_of_range: bool,
    /// The seed of the samples.
    pub seed: u64,
    /// Number of steps that the series had.
    pub steps_of_series: usize,
    /// The errors of all steps below together.
    pub series: GroupErrors,
    /// The errors of steps of the series.
    pub steps: Vec<StepErrors>,
}

/// The errors of one step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepErrors {
    /// The step.
    pub step: usize,
    /// Its errors.
    #[serde(flatten)]
    pub errors: GroupErrors,
}

/// The errors of each group of samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GroupErrors {
    /// At vertices.
    pub vertices: Errors,
    /// In cells without a vertex on the boundary.
    pub interior: Errors,
    /// In the other cells.
    pub boundary: Errors,
}

/// Errors of a group of samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Number of samples that were judged.
    pub samples: u64,
    /// Number of samples that are holes.
    pub holes: u64,
    /// Number of samples that no function reaches: they have no error.
    pub unreached: u64,
    /// Mean error.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// The least that 99 % of the errors do not exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
    /// Where the largest is; the first if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<Worst>,
}

/// The place of the largest error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Worst {
    /// The point in world coordinates.
    pub point: [f64; 3],
    /// The source's number of the cell that it is in, if it was sampled inside a cell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<u32>,
    /// The source's number of the vertex that it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vertex: Option<u32>,
    /// The step.
    pub step: usize,
}

impl Report {
    /// An error in words.
    fn text(&self, error: f64) -> String {
        if self.is_share_of_range { format!("{:.3} %", 100.0 * error) } else { format!("{error:.3e}") }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = if self.is_share_of_range { "shares of its range" } else { "in its unit, as its range is 0" };
        let Self { field, steps, steps_of_series, .. } = self;
        write!(f, "errors   {field}, {unit}, {} of {steps_of_series} steps", steps.len())?;
        let GroupErrors { vertices, interior, boundary } = &self.series;
        for (name, errors) in [("vertices", vertices), ("interior cells", interior), ("boundary cells", boundary)] {
            let [mean, rms, p99, max] = [errors.mean, errors.rms, errors.p99, errors.max].map(|error| self.text(error));
            write!(f, "\n         {name}: ")?;
            match &errors.at {
                None => write!(f, "no sample")?,
                Some(Worst { point, step, .. }) => {
                    let [x, y, z] = point.map(|x| Short(x as f32));
                    write!(
                        f,
                        "mean {mean}, RMS {rms}, 99 % up to {p99}, largest {max} at {x}, {y}, {z} in step {step}"
                    )?;
                    write!(f, " ({} samples)", errors.samples)?;
                }
            }
            for (count, what) in [(errors.holes, "holes"), (errors.unreached, "that no function reaches")] {
                if count > 0 {
                    write!(f, ", {count} {what}")?;
                }
            }
        }
        Ok(())
    }
}

/// What a sample is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Group {
    Vertices,
    Interior,
    Boundary,
}

impl Group {
    const ALL: [Self; 3] = [Self::Vertices, Self::Interior, Self::Boundary];
}

/// A place where functions are compared with cells.
#[derive(Clone, Copy, Debug)]
struct Sample {
    group: Group,
    /// The vertex or cell of the mesh.
    of: u32,
    /// The vertices, and their shares of the value.
    corners: [u32; 4],
    shares: [f64; 4],
    /// Local coordinates.
    at: DVec3,
}

/// What was found at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    Hole,
    Unreached,
    /// The distance from what the cells say, in the field's unit.
    Error(f64),
}

/// The samples of a mesh.
#[derive(Clone, Debug)]
pub struct Samples {
    samples: Vec<Sample>,
    seed: u64,
}

/// Errors found so far, sample by sample.
#[derive(Clone, Debug, Default)]
pub struct Judged {
    /// For each step, what was found at the samples.
    steps: Vec<(usize, Vec<Found>)>,
}

impl Samples {
    /// Most samples of each group.
    pub const PER_GROUP: usize = 4096;

    /// At most `most` samples of each group; the same for the same seed.
    pub fn of(mesh: &Mesh, most: usize, seed: u64) -> Self {
        let tets = &mesh.topology.tets;
        let is_at_boundary = at_boundary(mesh);
        let touches = |cell: &u32| tets[*cell as usize].iter().any(|&vertex| is_at_boundary[vertex as usize]);
        let (boundary, interior): (Vec<u32>, Vec<u32>) = (0..tets.len() as u32).partition(touches);
        let vertices: Vec<u32> = (0..mesh.positions.local.len() as u32).collect();
        let mut samples = Vec::new();
        for (group, of) in Group::ALL.into_iter().zip([vertices, interior, boundary]) {
            let count = of.len().min(most);
            for stretch in 0..count {
                let mut random = SplitMix64::new(hash(hash(seed, group as u64), stretch as u64));
                let (first, end) = (stretch * of.len() / count, (stretch + 1) * of.len() / count);
                let of = of[first + random.below(end - first)];
                let (corners, shares) = match group {
                    Group::Vertices => ([of; 4], [1.0, 0.0, 0.0, 0.0]),
                    _ => (tets[of as usize], inside(&mut random)),
                };
                let place = |(&vertex, share): (&u32, f64)| share * mesh.positions.local[vertex as usize].as_dvec3();
                let at = corners.iter().zip(shares).map(place).sum();
                samples.push(Sample { group, of, corners, shares, at });
            }
        }
        Self { samples, seed }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Adds steps, each with its number and one value per function, to what was found; whether that came to its end before `cancel` was
    /// raised.
    ///
    /// # Panics
    /// If a step does not have one value per function.
    pub fn judge(&self, kernels: &Kernels, steps: &[(usize, Vec<f32>)], to: &mut Judged, cancel: &Cancel) -> bool {
        /// Samples that are near each other: a function is compared with the box of all of them first.
        const TOGETHER: usize = 32;
        assert!(steps.iter().all(|(_, values)| values.len() == kernels.len()), "one value a function");
        let reaches = Reach::of_all(kernels);
        let found: Vec<Vec<Found>> = self
            .samples
            .par_chunks(TOGETHER)
            .map(|samples| if cancel.is_cancelled() { vec![] } else { judge(samples, kernels, &reaches, steps) })
            .collect();
        if cancel.is_cancelled() {
            return false;
        }
        for (i, (step, _)) in steps.iter().enumerate() {
            let of_step = |found: &Vec<Found>| found.iter().skip(i).step_by(steps.len()).copied().collect::<Vec<_>>();
            to.steps.push((*step, found.iter().flat_map(of_step).collect()));
        }
        true
    }

    /// The report on what was found, of a field with this range in a series of so many steps.
    pub fn report(
        &self,
        mesh: &Mesh,
        judged: &Judged,
        (field, range): (&str, Option<[f32; 2]>),
        steps_of_series: usize,
    ) -> Report {
        let width = range.map_or(0.0, |[lo, hi]| f64::from(hi) - f64::from(lo));
        let is_share_of_range = width > 0.0;
        let unit = if is_share_of_range { width } else { 1.0 };
        let errors = |steps: &[(usize, Vec<Found>)]| {
            let [vertices, interior, boundary] = Group::ALL.map(|group| self.errors(mesh, group, steps, unit));
            GroupErrors { vertices, interior, boundary }
        };
        let of_step =
            |found: &(usize, Vec<Found>)| StepErrors { step: found.0, errors: errors(std::slice::from_ref(found)) };
        Report {
            field: field.to_owned(),
            range,
            is_share_of_range,
            seed: self.seed,
            steps_of_series,
            series: errors(&judged.steps),
            steps: judged.steps.iter().map(of_step).collect(),
        }
    }

    /// The errors of a group over steps.
    fn errors(&self, mesh: &Mesh, group: Group, steps: &[(usize, Vec<Found>)], unit: f64) -> Errors {
        let mut errors = Errors::default();
        let mut all = Vec::new();
        for (step, found) in steps {
            for (sample, found) in self.samples.iter().zip(found).filter(|(sample, _)| sample.group == group) {
                match found {
                    Found::Hole => errors.holes += 1,
                    Found::Unreached => errors.unreached += 1,
                    Found::Error(error) => {
                        let error = error / unit;
                        if errors.at.is_none() || error > errors.max {
                            (errors.max, errors.at) = (error, Some(sample.worst(mesh, *step)));
                        }
                        all.push(error);
                    }
                }
            }
        }
        let Some(count) = std::num::NonZeroUsize::new(all.len()).map(|count| count.get() as f64) else { return errors };
        errors.samples = all.len() as u64;
        errors.mean = all.iter().sum::<f64>() / count;
        errors.rms = (all.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
        all.sort_unstable_by(f64::total_cmp);
        errors.p99 = all[(all.len() * 99).div_ceil(100) - 1];
        errors
    }
}

impl Sample {
    fn worst(&self, mesh: &Mesh, step: usize) -> Worst {
        let point = (mesh.positions.origin + mesh.positions.scale * self.at).to_array();
        let (cell, vertex) = match self.group {
            Group::Vertices => (None, mesh.vertex_source.get(self.of as usize).copied()),
            _ => (mesh.cell_source.get(self.of as usize).copied(), None),
        };
        Worst { point, cell, vertex, step }
    }

    /// What the cells say there; `None` for a hole.
    fn truth(&self, values: &[f32]) -> Option<f64> {
        let corners = self.corners.map(|vertex| f64::from(values[vertex as usize]));
        let value = corners.iter().zip(self.shares).map(|(value, share)| share * value).sum::<f64>();
        corners.iter().all(|value| value.is_finite()).then_some(value)
    }
}

/// Whether each vertex is on a face with a cell on one side only.
fn at_boundary(mesh: &Mesh) -> Vec<bool> {
    let mut found = vec![false; mesh.positions.local.len()];
    let connectivity = mesh.topology.connectivity();
    for face in connectivity.boundary_faces() {
        connectivity.faces[face as usize].iter().for_each(|&vertex| found[vertex as usize] = true);
    }
    found
}

/// Barycentric coordinates of a random point in a cell, all places as likely: the lengths into which three points cut a unit length.
fn inside(random: &mut SplitMix64) -> [f64; 4] {
    let mut cuts = [random.unit(), random.unit(), random.unit()];
    cuts.sort_unstable_by(f64::total_cmp);
    let [a, b, c] = cuts;
    [a, b - a, c - b, 1.0 - c]
}

/// A function, and a box that it does not leave.
struct Reach {
    id: usize,
    function: Placed,
    lo: DVec3,
    hi: DVec3,
}

impl Reach {
    fn of_all(kernels: &Kernels) -> Vec<Self> {
        /// More than what rounding moves the surface of an ellipsoid by.
        const MARGIN: f64 = 1e-6;
        let of = |id| {
            let function: Placed = kernels.get(id)?;
            let [lo, hi] = function.bounds((1.0 + MARGIN) * kernels.cut());
            Some(Self { id, function, lo, hi })
        };
        (0..kernels.len()).filter_map(of).collect()
    }

    fn meets(&self, lo: DVec3, hi: DVec3) -> bool {
        self.lo.cmple(hi).all() && self.hi.cmpge(lo).all()
    }
}

/// What is found at samples: for each, one after the other, in the steps.
fn judge(samples: &[Sample], kernels: &Kernels, reaches: &[Reach], steps: &[(usize, Vec<f32>)]) -> Vec<Found> {
    let grow = |(lo, hi): (DVec3, DVec3), sample: &Sample| (lo.min(sample.at), hi.max(sample.at));
    let (lo, hi) = samples.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), grow);
    // Sums of weighted values, and of weights.
    let mut sums = vec![[0.0f64; 2]; samples.len() * steps.len()];
    for reach in reaches.iter().filter(|reach| reach.meets(lo, hi)) {
        for (sample, sums) in samples.iter().zip(sums.chunks_mut(steps.len())) {
            if !reach.meets(sample.at, sample.at) {
                continue;
            }
            let from_center = sample.at - reach.function.center;
            let weight = kernels.weight(reach.function.unscaled(from_center).length_squared());
            for ([sum, weights], (_, values)) in sums.iter_mut().zip(steps) {
                let value = values[reach.id];
                if value.is_finite() {
                    (*sum, *weights) = (*sum + weight * f64::from(value), *weights + weight);
                }
            }
        }
    }
    let found = |(i, [sum, weights]): (usize, [f64; 2])| {
        let Some(truth) = samples[i / steps.len()].truth(&steps[i % steps.len()].1) else { return Found::Hole };
        if weights > 0.0 { Found::Error((sum / weights - truth).abs()) } else { Found::Unreached }
    };
    sums.into_iter().enumerate().map(found).collect()
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
