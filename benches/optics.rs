//! Cost and error of the pre-integrated table, by resolution: `cargo bench --bench optics`.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;
use tetreel::bench::Machine;
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::image::compare;
use tetreel::mesh::Mesh;
use tetreel::node_table::{Node, NodeTable};
use tetreel::optics::OpticsKind;
use tetreel::optics::table3d::{Table3d, Table3dResolution};
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{RenderJob, Renderer};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::CellSet;

const TRANSFER_FUNCTIONS: [(&str, &str); 4] = [
    ("smooth", "viridis@0:0.05,1:0.5"),
    ("tents", "viridis@0:0,0.28:0,0.3:0.4,0.32:0,0.58:0,0.6:0.6,0.62:0,1:0"),
    // Steps at the ends of the nodes' range, and one within.
    ("slab", "gray@0:0,0.3:0,0.3:0.5,0.6:0.5,0.6:0,1:0"),
    ("step", "gray@0:0.02,0.5:0.02,0.5:0.5,1:0.5"),
];

fn main() -> Result<(), Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: 100_000, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (mesh, _) = Mesh::build(jet.mesh()?)?;
    let mut values = Vec::new();
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let scalars: Vec<f32> = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let bounds = mesh.positions.world_bounds();
    let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
    let (mesh, scalars) = (Arc::new(mesh), Arc::new(scalars));
    println!("{:?}, {} threads; jet, 100k cells, 256x256", Machine::detect(), rayon::current_num_threads());
    println!("table    nodes  scalars lengths      MB  build ms  frame ms (exact)      rmse       max");
    for (name, text) in TRANSFER_FUNCTIONS {
        let tf = TransferFunction::parse(text)?;
        let table = build_node_table(&tf, &MappedRange::new(0.0, 1.2, false)?, OpacityKind::Alpha, &lengths)?;
        let nodes = table.nodes().len();
        let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
        let view = Camera::default_for(bounds)?.view(256, 256)?;
        let job = RenderJob::new(mesh.clone(), scalars.clone(), active, view, Arc::new(table));
        let mut exact = Raycast::new();
        exact.render(job.clone())?;
        let judge = exact.render(job.clone())?.clone();
        let partial = RenderJob { optics: OpticsKind::Partial, ..job.clone() };
        let mut renderer = Raycast::new();
        renderer.render(partial.clone())?;
        let frame = renderer.render(partial)?;
        let error = compare(&frame.planes.color, &judge.planes.color, [0.0; 3])?;
        let (ms, of_exact) = (frame.stats.ms_frame, judge.stats.ms_frame);
        println!("{name:8} {nodes:5}  partial {ms:41.1} {of_exact:7.1}  {:8.1e}  {:8.1e}", error.rmse, error.max);
        rebuild(&job.table, mesh.positions.scale)?;
        for (scalars, lengths) in [64, 128, 256].into_iter().flat_map(|s| [16, 32, 64].map(|l| (s, l))) {
            let resolution = Table3dResolution { scalars, lengths };
            let started = Instant::now();
            // As the renderer builds it, except for the length, which does not affect the time.
            drop(Table3d::new(&job.table, Table3d::range_of(&job.table), 0.1, mesh.positions.scale, resolution));
            let build_ms = started.elapsed().as_secs_f64() * 1e3;
            let job = RenderJob { optics: OpticsKind::Table3d, ..job.clone() };
            let mut renderer = Raycast::with_table3d_resolution(resolution);
            renderer.render(job.clone())?;
            let frame = renderer.render(job)?;
            let error = compare(&frame.planes.color, &judge.planes.color, [0.0; 3])?;
            println!(
                "{name:8} {nodes:5}  {scalars:7} {lengths:7}  {:6.1}  {build_ms:8.0}  {:8.1} {:7.1}  {:8.1e}  {:8.1e}",
                resolution.bytes() as f64 / 1e6,
                frame.stats.ms_frame,
                judge.stats.ms_frame,
                error.rmse,
                error.max
            );
        }
    }
    Ok(())
}

/// Milliseconds to build a table, and to update it after an edit of one node.
fn rebuild(table: &NodeTable, scale: f64) -> Result<(), Box<dyn std::error::Error>> {
    let (range, resolution) = (Table3d::range_of(table), Table3dResolution::default());
    let build = |last: Option<&Table3d>, table: &NodeTable| {
        let started = Instant::now();
        let built = Table3d::changed(last, table, range, 0.1, scale, resolution, &Cancel::new());
        (started.elapsed().as_secs_f64() * 1e3, built)
    };
    let (_, old) = build(None, table);
    for tenths in [1, 3, 5, 7, 9] {
        let mut nodes = table.nodes().to_vec();
        let at = (nodes.len() * tenths / 10).clamp(1, nodes.len().saturating_sub(2));
        nodes[at] = Node { tau: 0.5 * nodes[at].tau + 0.1, ..nodes[at] };
        let edited = NodeTable::new(nodes)?;
        let ((whole, new), (part, changed)) = (build(None, &edited), build(Some(&old), &edited));
        assert!(new.entries() == changed.entries());
        let share = changed.entries_built() as f64 / new.entries_built() as f64;
        println!("  node {at}: whole {whole:.1} ms, changed {part:.1} ms, {:.0} % of the entries", 100.0 * share);
    }
    Ok(())
}
