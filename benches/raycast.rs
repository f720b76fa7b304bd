//! The ray caster's version for newer processors against the portable one, interleaved: `cargo bench --bench raycast`.

use std::error::Error;
use std::sync::Arc;
use tetreel::bench::{Machine, paired};
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::mesh::Mesh;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{RenderJob, Renderer};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::CellSet;

const PAIRS: usize = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: 1_000_000, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (mesh, _) = Mesh::build(jet.mesh()?)?;
    let mut values = Vec::new();
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let bounds = mesh.positions.world_bounds();
    let tf = TransferFunction::parse("viridis@0:0.05,1:0.5")?;
    let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
    let table = build_node_table(&tf, &MappedRange::new(0.0, 1.2, false)?, OpacityKind::Alpha, &lengths)?;
    let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
    let view = Camera::default_for(bounds)?.view(512, 512)?;
    let job = RenderJob::new(Arc::new(mesh), Arc::new(scalars), active, view, Arc::new(table));
    let (mut portable, mut newest) = (Raycast::portable(), Raycast::new());
    let same = portable.render(job.clone())?.planes.color == newest.render(job.clone())?.planes.color;
    assert!(same, "the two versions draw different images");
    // A job that was rendered once cannot fail any more.
    let draw = |renderer: &mut Raycast| drop(renderer.render(job.clone()));
    let result = paired(|| draw(&mut portable), || draw(&mut newest), PAIRS, 1);
    println!("{:?}", Machine::detect());
    println!("jet, 1M cells, 512x512, {PAIRS} pairs, {} threads", rayon::current_num_threads());
    println!("portable ms {:?}", result.a);
    println!("newest   ms {:?}", result.b);
    println!("ratio newest / portable {:.3}, 95 % in {:.3?}", result.ratio, result.interval);
    Ok(())
}
