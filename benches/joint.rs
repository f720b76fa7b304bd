//! Transfer functions of several variables against those of the scalar alone, interleaved, on every renderer: `cargo bench --bench joint`.

use std::error::Error;
use std::sync::Arc;
use tetreel::bench::{Machine, paired};
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::mesh::Mesh;
use tetreel::node_table::JointTable;
use tetreel::render::cpu::{havs::Havs, raycast::Raycast};
use tetreel::render::{JointScene, RenderJob, Renderer};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::{CellSet, Drawn};

const CELLS: u64 = 200_000;
const PAIRS: usize = 11;

fn main() -> Result<(), Box<dyn Error>> {
    let plain = scene()?;
    let mut renderers: Vec<(&str, Box<dyn Renderer>)> = vec![
        ("raycast, CPU", Box::new(Raycast::new())),
        ("raycast without vectors, CPU", Box::new(Raycast::portable())),
        ("havs, CPU", Box::new(Havs::new())),
    ];
    add_gpu(&mut renderers);
    println!("{:?}", Machine::detect());
    println!("jet, {CELLS} cells, 512x512, {PAIRS} pairs, {} threads", rayon::current_num_threads());
    for (name, renderer) in &mut renderers {
        for (what, rows, layers) in [("1 x 1", 1, 1), ("8 rows", 8, 1), ("8 layers", 1, 8), ("8 x 8", 8, 8)] {
            let grid = with_joint_table(&plain, rows, layers)?;
            let images =
                [&plain, &grid].map(|job| renderer.render(job.clone()).map(|frame| frame.planes.color.clone()));
            let [of_plain, of_joint] = images;
            assert!(of_plain? != of_joint?, "{name}, {what}: a table with other values gives the same image");
            let shared = std::cell::RefCell::new(&mut *renderer);
            // Jobs that were rendered once cannot fail any more.
            let draw = |job: &RenderJob| drop(shared.borrow_mut().render(job.clone()));
            let result = paired(|| draw(&plain), || draw(&grid), PAIRS, 1);
            let [low, high] = result.interval;
            println!(
                "{name}: {what}: plain {:.1} ms, grid {:.1} ms, ratio {:.2}, 95 % in {low:.2}..{high:.2}",
                result.a.median, result.b.median, result.ratio
            );
        }
    }
    Ok(())
}

#[cfg(feature = "gpu")]
fn add_gpu(renderers: &mut Vec<(&'static str, Box<dyn Renderer>)>) {
    use tetreel::render::gpu::context::{Context, ContextOptions};
    match Context::new(&ContextOptions::default()) {
        Ok(context) => {
            println!("{}", context.adapter());
            let context = Arc::new(context);
            let walk = tetreel::render::gpu::raycast::Raycast::new(context.clone());
            renderers.push(("raycast, GPU", Box::new(walk)));
            renderers.push(("havs, GPU", Box::new(tetreel::render::gpu::havs::Havs::new(context))));
        }
        Err(why) => println!("no GPU: {why}"),
    }
}

#[cfg(not(feature = "gpu"))]
fn add_gpu(_: &mut Vec<(&'static str, Box<dyn Renderer>)>) {}

/// The job with its table spread over rows (by a coordinate of the vertices) and table layers (random), with 0.5 to 1.5 times the
/// extinctions.
fn with_joint_table(job: &RenderJob, rows: usize, layers: usize) -> Result<RenderJob, Box<dyn Error>> {
    let nodes = job.table.nodes();
    let axis = |count: usize| (0..count).map(|i| (i as f64 + 0.5) / count as f64).collect::<Vec<_>>();
    let (row_places, layer_places) = (axis(rows), axis(layers));
    let mut values = Vec::new();
    for layer in &layer_places {
        for row in &row_places {
            let factor = (0.5 + row) * (0.5 + layer) * 0.99;
            values.extend(nodes.iter().map(|n| [n.rgb[0], n.rgb[1], n.rgb[2], n.tau * factor].map(|x| x as f32)));
        }
    }
    let table = JointTable::new(nodes.iter().map(|n| n.scalar).collect(), row_places, layer_places, values)?;
    let row_values: Vec<f32> = job.mesh.positions.local.iter().map(|p| 0.5 + 0.5 * p.y).collect();
    let lot = |cell: usize| (cell.wrapping_mul(2_654_435_761) >> 8 & 0xffff) as f32 / 65_536.0;
    let cell_values = (0..job.mesh.topology.tets.len()).map(lot).collect();
    let projection = table.projection().clone();
    let scene = JointScene {
        table: Arc::new(table),
        row_values: Some(Arc::new(row_values).into()),
        cell_values: Some(Arc::new(cell_values)),
    };
    Ok(RenderJob { table: projection, joint: Some(scene), ..job.clone() })
}

fn scene() -> Result<RenderJob, Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: CELLS, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (mesh, _) = Mesh::build(jet.mesh()?)?;
    let mut values = Vec::new();
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let bounds = mesh.positions.world_bounds();
    let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
    let tf = TransferFunction::parse("viridis@0:0.02,1:0.2")?;
    let table = build_node_table(&tf, &MappedRange::new(0.0, 1.2, false)?, OpacityKind::Alpha, &lengths)?;
    let view = Camera::default_for(bounds)?.view(512, 512)?;
    let depth = |face: &u32| {
        let corners =
            mesh.topology.connectivity().faces[*face as usize].map(|v| mesh.positions.local[v as usize].as_dvec3());
        (view.forward.dot(corners[0] + corners[1] + corners[2]) * 1e15) as i64
    };
    let mut faces: Vec<u32> = (0..mesh.topology.connectivity().faces.len() as u32).collect();
    faces.sort_by_cached_key(depth);
    let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
    Ok(RenderJob {
        faces: Some(Arc::new(Drawn { ids: faces, is_complete: true })),
        ..RenderJob::new(Arc::new(mesh), Arc::new(scalars), active, view, Arc::new(table))
    })
}
