//! Frame cost of ensembles on a million cells: `cargo bench --bench ensembles`.
//!
//! *Steady*: the same ensemble frame after frame, against a transfer function with the same table. *Blend*: another table in each frame, as
//! between two keys or during an edit, against a frame that keeps the previous table. Both with the series playing (each frame another
//! step) and at rest. The eye always moves, but so little that neighbouring frames, which are compared, show nearly the same. Frame times
//! include all stages, run sequentially: ensemble, decode, order, render.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use tetreel::bench::Machine;
use tetreel::camera::Camera;
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::pipeline::{FrameRequest, Pipeline};
use tetreel::project::{Animation, Data, Project};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::timeline::{Key, Keyframed, Transition};
use tetreel::transfer::{
    Blend, Ensemble, Function, Lengths, Member, OpacityKind, Rectangle, Reduction, Space, TransferFunction, Widget,
};

const ROUNDS: usize = 31;
/// Degrees that the eye turns per frame.
const TURN: f64 = 0.02;
const STEPS: usize = 6;
const SIZE: (usize, usize) = (512, 512);

fn tf(text: &str) -> Result<Member, Box<dyn Error>> {
    Ok(Member::new(text, Function::TransferFunction(TransferFunction::parse(text)?)))
}

fn rectangle(x: [f64; 2], rgb: [f64; 3], opacity: [f64; 2]) -> Function {
    Function::Widgets(vec![Widget::Rectangle(Rectangle { x, y: [0.3, 0.8], rgb, opacity })])
}

/// One member; three members; three with one over gradient magnitudes.
fn ensembles() -> Result<[Ensemble; 3], Box<dyn Error>> {
    let named = |name: &str, members| Ensemble { name: name.into(), colors: Default::default(), members };
    let one = tf("viridis@0:0,0.2:0,0.5:0.1,1:0.4")?;
    let two = Member { blend: Blend::Add, ..tf("inferno@0:0,0.3:0.05,0.6:0,1:0.2")? };
    let three = Member { blend: Blend::Add, ..Member::new("box", rectangle([0.4, 0.7], [0.9, 0.2, 0.1], [0.05, 0.2])) };
    let over_gradients = Member { space: Space::ScalarGradient, reduction: Reduction::Keep, ..three.clone() };
    Ok([
        named("one", vec![one.clone()]),
        named("three", vec![one.clone(), two.clone(), three]),
        named("grid", vec![one, two, over_gradients]),
    ])
}

/// State of a benchmark.
struct Run {
    pipeline: Pipeline,
    camera: Camera,
    frames: usize,
}

impl Run {
    /// Milliseconds of a frame of an animation, at a step and a time.
    fn frame(&mut self, animation: &mut Animation, step: usize, at: f64) -> Result<f64, Box<dyn Error>> {
        self.frames += 1;
        let camera = self.camera.orbit(TURN * self.frames as f64, 0.0)?;
        let started = Instant::now();
        let said = animation.at(step.into(), at, &Cancel::new())?;
        let table = said.colors.ok_or("a project with ensembles")?.table;
        self.pipeline.render(&FrameRequest::new(step, camera, table, SIZE))?;
        Ok(started.elapsed().as_secs_f64() * 1e3)
    }
}

/// Prints median and quartiles.
fn show(name: &str, mut ms: Vec<f64>) {
    ms.sort_by(f64::total_cmp);
    let at = |share: usize| ms[(ms.len() - 1) * share / 4];
    println!("{name:34} {:8.2} ms  ({:.2} to {:.2})", at(2), at(1), at(3));
}

/// Prints two kinds of frames, and what the second takes beyond the first beside it.
fn show_both(names: [&str; 2], ms: [Vec<f64>; 2]) {
    let more = ms[0].iter().zip(&ms[1]).map(|(one, other)| other - one).collect();
    names.iter().zip(ms).for_each(|(name, ms)| show(&format!("  {name}"), ms));
    show("    more", more);
}

fn main() -> Result<(), Box<dyn Error>> {
    let temp = tempfile::tempdir()?;
    let path = temp.path().join("jet.zarr");
    let jet = generate(&SynthSpec { cells: 1_000_000, steps: STEPS, ..SynthSpec::new(SeriesName::Jet) })?;
    ingest(&jet, &path, &IngestOptions::default(), &Silent, &Cancel::new())?;
    let pipeline = Pipeline::open(&Store::open(&path)?, None)?;
    let series = pipeline.series().clone();
    let (lo, hi) = series.mesh().positions.world_bounds();
    let (unit_distance, camera) = (0.01 * (hi - lo).length(), Camera::default_for((lo, hi))?);
    let cells = series.mesh().topology.tets.len();
    println!("{:?}, {} threads; jet, {cells} cells, {SIZE:?}", Machine::detect(), rayon::current_num_threads());
    let mut run = Run { pipeline, camera, frames: 0 };
    let [one, three, grid] = ensembles()?;
    let animation = |ensembles: Vec<Ensemble>| -> Result<Animation, Box<dyn Error>> {
        let mut project = Project::new(Data { source: path.clone(), field: None });
        let keys = ensembles.iter().enumerate();
        let key =
            |(i, e): (usize, &Ensemble)| Key { time: i as f64, transition: Transition::Linear, value: e.name.clone() };
        project.timeline.ensembles = Keyframed::try_from(keys.map(key).collect::<Vec<_>>())?;
        project.ensembles = ensembles;
        Ok(Animation::new(
            Arc::new(project),
            series.clone(),
            OpacityKind::Alpha,
            Lengths::of_unit_distance(unit_distance),
        ))
    };
    steady(&mut run, &three, animation(vec![three.clone()])?)?;
    println!("blend of one and three");
    blend(&mut run, animation(vec![one.clone(), three])?)?;
    println!("blend of one and the grid");
    blend(&mut run, animation(vec![one, grid])?)
}

/// Compares frames of an ensemble with frames of its table.
fn steady(run: &mut Run, ensemble: &Ensemble, mut animation: Animation) -> Result<(), Box<dyn Error>> {
    let table = animation.at(0.into(), 0.0, &Cancel::new())?.colors.ok_or("an ensemble has colours")?.table;
    let mut ms = [Vec::new(), Vec::new()];
    for round in 0..ROUNDS + 2 {
        for case in [round % 2, 1 - round % 2] {
            let step = round % STEPS;
            let took = if case == 0 {
                run.frames += 1;
                let camera = run.camera.orbit(TURN * run.frames as f64, 0.0)?;
                let started = Instant::now();
                run.pipeline.render(&FrameRequest::new(step, camera, table.clone(), SIZE))?;
                started.elapsed().as_secs_f64() * 1e3
            } else {
                run.frame(&mut animation, step, 0.0)?
            };
            if round > 1 {
                ms[case].push(took);
            }
        }
    }
    println!("steady, {} members, {} nodes", ensemble.members.len(), table.over_scalars().nodes().len());
    show_both(["transfer function", "ensemble"], ms);
    Ok(())
}

/// Compares frames with a new table and frames with the previous one.
fn blend(run: &mut Run, mut animation: Animation) -> Result<(), Box<dyn Error>> {
    let mut ms: [Vec<f64>; 4] = Default::default();
    let mut tables = Vec::new();
    for round in 0..ROUNDS + 2 {
        let at = |part: usize| (2 * round + part) as f64 / (2 * ROUNDS + 6) as f64;
        // The table does not follow the step, so that their effects are separate.
        let (step, next) = (round % STEPS, (round + 1) % STEPS);
        let started = Instant::now();
        animation.at(step.into(), at(0) + 1e-3, &Cancel::new())?;
        tables.push(started.elapsed().as_secs_f64() * 1e3);
        let plays_new = run.frame(&mut animation, step, at(0))?;
        run.frame(&mut animation, next, at(0))?;
        let took = [
            plays_new,
            run.frame(&mut animation, step, at(0))?,
            run.frame(&mut animation, step, at(1))?,
            run.frame(&mut animation, step, at(1))?,
        ];
        if round > 1 {
            ms.iter_mut().zip(took).for_each(|(all, one)| all.push(one));
        }
    }
    let [plays_new, plays_same, stands_new, stands_same] = ms;
    show("  the table alone", tables);
    show_both(["plays, the same table", "plays, another table"], [plays_same, plays_new]);
    show_both(["stands, the same table", "stands, another table"], [stands_same, stands_new]);
    Ok(())
}
