//! All faces of real series in exact order: the ray caster's image. Skipped, with a word, where the samples are absent.

use super::*;
use crate::common::samples;
use crate::series::{TRANSFER_FUNCTIONS, cameras};
use std::path::Path;
use tetreel::field::Component;
use tetreel::import;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::CellSet;

/// Every sample that is a tetrahedral mesh, a field of it, and two steps.
const SERIES: [(&str, &str, &[usize]); 7] = [
    ("heart_wave/heart_wave.xdmf", "potential", &[40, 200]),
    ("jet_flow/jet_flow.xdmf", "velocity", &[20, 63]),
    ("natural_convection/natural_convection.xdmf", "temperature", &[5, 120]),
    ("torso_dipole/torso_dipole.xdmf", "potential", &[0, 100]),
    ("spxf/spxf.pvd", "reaction_force", &[30, 150]),
    ("paper_static/spx.vtu", "density", &[0]),
    ("paper_static/bluntfin.vtu", "density", &[0]),
];

const SIZE: (usize, usize) = (64, 60);

/// One step of a series.
struct Step {
    mesh: Arc<Mesh>,
    scalars: Vec<f32>,
    range: [f64; 2],
}

/// Steps of one field: its value, or the length of the vector.
fn steps(path: &Path, field: &str, wanted: &[usize]) -> Vec<Step> {
    let source = import::open(path).unwrap();
    let mesh = Arc::new(Mesh::build(source.mesh().unwrap()).unwrap().0);
    let field = source.fields().iter().find(|f| f.name == field).unwrap();
    let component = if field.components == 1 { Component::Index(0) } else { Component::Magnitude };
    let mut values = Vec::new();
    let read = |step: &usize| {
        source.read(field, component, *step, &mut values).unwrap();
        let scalars: Vec<f32> = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
        let finite = || scalars.iter().filter(|s| s.is_finite()).map(|s| f64::from(*s));
        let range = [finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max)];
        Step { mesh: mesh.clone(), scalars, range }
    };
    wanted.iter().map(read).collect()
}

impl Step {
    /// The frame of a camera and a transfer function; cells that have no extinction at their corners and between are not active.
    fn job(&self, camera: &Camera, tf: &str) -> RenderJob {
        let (a, b) = self.mesh.positions.world_bounds();
        let [lo, hi] = self.range;
        let range = MappedRange::new(lo, if hi > lo { hi } else { lo + 1.0 }, false).unwrap();
        let unit = 0.01 * (b - a).length();
        let tf = TransferFunction::parse(tf).unwrap();
        let table = build_node_table(&tf, &range, OpacityKind::Alpha, &Lengths::of_unit_distance(unit)).unwrap();
        let mut job = job(&self.mesh, self.scalars.clone(), camera, SIZE, table);
        let (tets, finite) = (&self.mesh.topology.tets, job.active.clone());
        job.active = Arc::new(CellSet::of(tets.len(), |cell| {
            let s = tets[cell].map(|v| f64::from(self.scalars[v as usize]));
            let (lo, hi) = (s.into_iter().fold(s[0], f64::min), s.into_iter().fold(s[0], f64::max));
            finite.contains(cell as u32)
                && (0..=8).any(|i| job.table.eval(lo + f64::from(i) / 8.0 * (hi - lo)).tau > 0.0)
        }));
        job
    }
}

/// Errors and counts of the frames of a series.
#[derive(Default)]
struct Row {
    frames: usize,
    rmse: f64,
    max: f64,
    fragments: u64,
    again: u64,
    /// With a buffer of two, and of 32, as the fragments come.
    out_of_order: [u64; 2],
    /// The most opaque pixel.
    opacity: f32,
}

impl Row {
    fn add(&mut self, name: &str, job: &RenderJob) {
        let judge = raycast(job);
        let all = with_all_faces(job);
        let frame = havs(&with_buffer(&all, 8, true));
        assert_within(name, &frame.planes.color, &judge);
        let (rmse, max) = difference(&frame.planes.color, &judge);
        self.frames += 1;
        (self.rmse, self.max) = (self.rmse.max(rmse), self.max.max(max));
        self.fragments += frame.stats.fragments;
        self.again += frame.stats.pixels_resolved_again;
        self.opacity = judge.pixels.iter().fold(self.opacity, |most, p| most.max(p[3]));
        for (k, out_of_order) in [2, 32].into_iter().zip(&mut self.out_of_order) {
            *out_of_order += havs(&with_buffer(&all, k, false)).stats.out_of_order;
        }
    }
}

// Long: every series is drawn in ten ways from every camera.
#[test]
fn all_faces_of_real_series_in_exact_order_are_the_ray_casters_image() {
    let Some(dir) = samples() else { return };
    eprintln!("series | frames | rmse | max | fragments | again (k 8) | out of order as they come: k 2 | k 32");
    for (file, field, wanted) in SERIES {
        let mut row = Row::default();
        for (step, at) in steps(&dir.join(file), field, wanted).iter().zip(wanted) {
            for (i, camera) in cameras(step.mesh.positions.world_bounds()).iter().enumerate() {
                // Each transfer function from two cameras, each camera with two transfer functions.
                for tf in [TRANSFER_FUNCTIONS[i], TRANSFER_FUNCTIONS[(i + 1) % 4]] {
                    row.add(&format!("{file} {field}, step {at}, camera {i}, {tf}"), &step.job(camera, tf));
                }
            }
        }
        let Row { frames, rmse, max, fragments, again, out_of_order: [two, many], opacity } = row;
        eprintln!("{file} | {frames} | {rmse:.1e} | {max:.1e} | {fragments} | {again} | {two} | {many}");
        assert!(opacity > 0.5 && fragments > 100_000, "{file}: an empty image proves nothing");
        assert!(many <= two, "{file}: a larger buffer sets more right");
    }
}

#[test]
fn the_comparison_of_real_series_notices_missing_faces_and_a_wrong_order() {
    let Some(dir) = samples() else { return };
    let steps = steps(&dir.join("paper_static/bluntfin.vtu"), "density", &[0]);
    let mut worst = [(0.0f64, 0.0f64); 2];
    for camera in cameras(steps[0].mesh.positions.world_bounds()) {
        let job = steps[0].job(&camera, TRANSFER_FUNCTIONS[0]);
        let judge = raycast(&job);
        let missing = havs(&with_some_faces(&job, 0.9, 1)).planes.color;
        let disordered = havs(&with_buffer(&with_all_faces(&job), 2, false)).planes.color;
        for (image, worst) in [missing, disordered].iter().zip(&mut worst) {
            let (rmse, max) = difference(image, &judge);
            *worst = (worst.0.max(rmse), worst.1.max(max));
        }
    }
    eprintln!("a tenth of the faces missing, and a buffer of two: rmse and max {worst:?}");
    assert!(worst.iter().all(|&(rmse, max)| rmse > BOUND_RMSE && max > BOUND_MAX), "{worst:?}");
}
