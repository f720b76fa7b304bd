//! The face renderer at several levels of detail, and against the ray caster: `cargo bench --bench havs`.

use std::error::Error;
use std::sync::Arc;
use tetreel::bench::{Machine, Paired, Timings, paired};
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::mesh::{Mesh, NONE};
use tetreel::random::SplitMix64;
use tetreel::render::cpu::havs::Havs;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{KBuffer, RenderJob, Renderer};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::{CellSet, Drawn};

const FRAMES: usize = 9;
const CELLS: u64 = 1_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let base = scene("viridis@0:0.05,1:0.5")?;
    println!("{:?}", Machine::detect());
    println!("jet, 1M cells, 512x512, medians of {FRAMES} frames, {} threads", rayon::current_num_threads());
    let all = with_faces(&base, 1.0);
    let same = Havs::portable().render(all.clone())?.planes.color == Havs::new().render(all.clone())?.planes.color;
    assert!(same, "the two versions draw different images");
    let mut full = 0.0;
    for share in [1.0, 0.5, 0.25, 0.1, 0.0] {
        let job = with_faces(&base, share);
        let [total, place, render] = milliseconds(&mut Havs::new(), &job)?;
        let mut renderer = Havs::new();
        let stats = &renderer.render(job.clone())?.stats;
        full = if share == 1.0 { total } else { full };
        println!(
            "inner faces {:3.0} %: {total:6.1} ms (place {place:5.1}, render {render:6.1}), {:.2} of all for {:.2} of the faces, \
             {} fragments, {} out of order, {} pixels again",
            100.0 * share,
            total / full,
            stats.faces_drawn as f64 / stats.faces_total as f64,
            stats.fragments,
            stats.out_of_order,
            stats.pixels_resolved_again,
        );
    }
    for k in [2, 4, 16, 32] {
        let job = RenderJob { k_buffer: KBuffer { k, exact_order: false }, ..all.clone() };
        let [total, ..] = milliseconds(&mut Havs::new(), &job)?;
        let out_of_order = Havs::new().render(job.clone())?.stats.out_of_order;
        println!("k {k:2}, order as it comes: {total:6.1} ms, {out_of_order} out of order");
    }
    let opaque = scene("viridis@0:0.9,1:1")?;
    let opaque = with_faces(&RenderJob { mesh: base.mesh.clone(), ..opaque }, 1.0);
    println!("opaque: {:.1} ms", milliseconds(&mut Havs::new(), &opaque)?[0]);
    // A job that was rendered once cannot fail any more.
    let draw = |renderer: &mut dyn Renderer| drop(renderer.render(all.clone()));
    let (mut cells, mut faces) = (Raycast::new(), Havs::new());
    let result = paired(|| draw(&mut cells), || draw(&mut faces), FRAMES, 1);
    println!("raycast ms {:?}", result.a);
    println!("havs    ms {:?}", result.b);
    println!("ratio havs / raycast {:.3}, 95 % in {:.3?}", result.ratio, result.interval);
    let (mut portable, mut newest) = (Havs::portable(), Havs::new());
    let result = paired(|| draw(&mut portable), || draw(&mut newest), FRAMES, 1);
    println!("ratio newest / portable {:.3}, 95 % in {:.3?}", result.ratio, result.interval);
    Ok(())
}

/// Medians of the whole frame, of placing faces and of rendering, in milliseconds, after warm-up.
fn milliseconds(renderer: &mut Havs, job: &RenderJob) -> Result<[f64; 3], Box<dyn Error>> {
    renderer.render(job.clone())?;
    let mut times = [const { Vec::new() }; 3];
    for _ in 0..FRAMES {
        let stats = &renderer.render(job.clone())?.stats;
        for (times, ms) in times.iter_mut().zip([stats.ms_frame, stats.ms_place, stats.ms_render]) {
            times.push(ms);
        }
    }
    Ok(times.map(|t| Paired::of(&Timings { a: t.clone(), b: t }, 1).a.median))
}

/// All boundary faces and a random share of the others, front to back.
fn with_faces(job: &RenderJob, share: f64) -> RenderJob {
    let (topology, positions) = (&job.mesh.topology, &job.mesh.positions);
    let mut random = SplitMix64::new(1);
    let drawn = |face: &u32| random.unit() < share || topology.connectivity().face_cells[*face as usize][1] == NONE;
    let depth = |face: u32| {
        let corners = topology.connectivity().faces[face as usize].map(|v| positions.local[v as usize].as_dvec3());
        job.view.forward.dot(corners[0] + corners[1] + corners[2])
    };
    let mut faces: Vec<u32> = (0..topology.connectivity().faces.len() as u32).filter(drawn).collect();
    faces.sort_by_cached_key(|&face| (depth(face) * 1e15) as i64);
    let is_complete = faces.len() == topology.connectivity().faces.len();
    RenderJob { faces: Some(Arc::new(Drawn { ids: faces, is_complete })), ..job.clone() }
}

fn scene(tf: &str) -> Result<RenderJob, Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: CELLS, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (mesh, _) = Mesh::build(jet.mesh()?)?;
    let mut values = Vec::new();
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let bounds = mesh.positions.world_bounds();
    let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
    let tf = TransferFunction::parse(tf)?;
    let table = build_node_table(&tf, &MappedRange::new(0.0, 1.2, false)?, OpacityKind::Alpha, &lengths)?;
    let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
    let view = Camera::default_for(bounds)?.view(512, 512)?;
    Ok(RenderJob::new(Arc::new(mesh), Arc::new(scalars), active, view, Arc::new(table)))
}
