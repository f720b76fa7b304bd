//! Cells as points beside the cell walk and the face renderer, in turn: `cargo bench --bench points -- [CELLS]`.

use std::error::Error;
use std::sync::Arc;
use tetreel::bench::{Machine, Paired, Timings};
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::lod::Ranking;
use tetreel::mesh::{Mesh, RawMesh};
use tetreel::random::SplitMix64;
use tetreel::render::cpu::havs::Havs;
use tetreel::render::cpu::points::Points;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::points::{Compositing, Footprint, PointScene, PointStyle};
use tetreel::render::{RenderJob, Renderer};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::{CellSet, DepthOrder, Drawn, Selection};

const FRAMES: usize = 15;

const SCENES: [(&str, &str); 5] = [
    ("haze", "viridis@0:0.005,1:0.01"),
    ("dense", "viridis@0:0.05,1:0.5"),
    ("three tents", "viridis@0:0,0.18:0,0.2:0.9,0.22:0,0.48:0,0.5:0.9,0.52:0,0.78:0,0.8:0.9,0.82:0,1:0"),
    ("opaque", "viridis@0:0.9,1:1"),
    ("half-opaque step", "viridis@0:0,0.5:0,0.5001:0.5,1:0.5"),
];

/// One way to draw, and its times.
struct Way {
    name: &'static str,
    renderer: Box<dyn Renderer>,
    job: RenderJob,
    times: Vec<f64>,
    rmse: f64,
    fragments: u64,
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("{:?}", Machine::detect());
    let asked: Vec<u64> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    for cells in if asked.is_empty() { vec![10_000, 100_000, 1_000_000] } else { asked } {
        let jet = generate(&SynthSpec { cells, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
        let raw = jet.mesh()?;
        let mut values = Vec::new();
        jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
        for (name, tf) in SCENES {
            compare(&format!("{name}, {cells} cells"), &job(&raw, &values, tf)?, false)?;
        }
        let (soup, of) = torn(&raw);
        let values: Vec<f32> = of.iter().map(|&v| values[v as usize]).collect();
        compare(&format!("dense, a soup of {cells} cells"), &job(&soup, &values, SCENES[1].1)?, true)?;
    }
    Ok(())
}

/// Draws a scene in all ways in turn, and prints medians, spreads and errors against the cell walk.
fn compare(scene: &str, job: &RenderJob, is_soup: bool) -> Result<(), Box<dyn Error>> {
    const EXACT: PointStyle = PointStyle::EXACT;
    let ellipse = PointStyle { footprint: Footprint::Ellipse, ..EXACT };
    let gap = PointStyle { compositing: Compositing::Gap, ..ellipse };
    let points = |name, style| (name, Box::new(Points::new()) as Box<dyn Renderer>, with_points(job, style));
    let mut ways = vec![
        ("walk", Box::new(Raycast::new()) as Box<dyn Renderer>, job.clone()),
        points("own exact", EXACT),
        points("own ellipse", ellipse),
        points("gap ellipse", gap),
        points("own ellipse, radius 0.6", PointStyle { radius: 0.6, ..ellipse }),
        points("gap ellipse, radius 0.6", PointStyle { radius: 0.6, ..gap }),
        points("own ellipse, 50 %", PointStyle { lod: 0.5, ..ellipse }),
        points("own ellipse, 25 %", PointStyle { lod: 0.25, ..ellipse }),
    ];
    if !is_soup {
        ways.insert(1, ("havs", Box::new(Havs::new()), with_faces(job)?));
    }
    let mut ways: Vec<Way> = ways
        .into_iter()
        .map(|(name, renderer, job)| Way { name, renderer, job, times: Vec::new(), rmse: 0.0, fragments: 0 })
        .collect();
    let mut truth = Vec::new();
    for way in &mut ways {
        let frame = way.renderer.render(way.job.clone())?;
        let pixels = &frame.planes.color.pixels;
        if truth.is_empty() {
            truth.clone_from(pixels);
        }
        let sum: f64 = pixels.iter().flatten().zip(truth.iter().flatten()).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (way.rmse, way.fragments) = ((sum / (4 * truth.len()) as f64).sqrt(), frame.stats.fragments);
    }
    for _ in 0..FRAMES {
        for way in &mut ways {
            let ms = way.renderer.render(way.job.clone())?.stats.ms_frame;
            way.times.push(ms);
        }
    }
    println!("{scene}");
    let median = |times: &[f64]| Paired::of(&Timings { a: times.to_vec(), b: times.to_vec() }, 1).a.median;
    let walk = median(&ways[0].times);
    for Way { name, times, rmse, fragments, .. } in &ways {
        let mut sorted = times.clone();
        sorted.sort_by(f64::total_cmp);
        let (ms, [low, .., high]) = (median(times), &sorted[..]) else { continue };
        let each = if *fragments > 0 { 1e6 * 2.0 * ms / *fragments as f64 } else { 0.0 };
        println!(
            "  {name:24} {ms:8.2} ms ({low:.2} to {high:.2}), {:.2} of the walk, RMSE {rmse:.2e}, {fragments} fragments, {each:.1} ns of a core each",
            ms / walk
        );
    }
    Ok(())
}

fn job(raw: &RawMesh, values: &[f32], tf: &str) -> Result<RenderJob, Box<dyn Error>> {
    let (mesh, _) = Mesh::build(raw.clone())?;
    let scalars: Vec<f32> = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let bounds = mesh.positions.world_bounds();
    let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
    let tf = TransferFunction::parse(tf)?;
    let table = build_node_table(&tf, &MappedRange::new(0.0, 1.2, false)?, OpacityKind::Alpha, &lengths)?;
    let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
    let view = Camera::default_for(bounds)?.view(512, 512)?;
    Ok(RenderJob::new(Arc::new(mesh), Arc::new(scalars), active, view, Arc::new(table)))
}

/// All faces, front to back.
fn with_faces(job: &RenderJob) -> Result<RenderJob, Box<dyn Error>> {
    let faces = CellSet::all(job.mesh.topology.connectivity().faces.len());
    let all = Arc::new(Selection { ids: faces, is_complete: true });
    let drawn = DepthOrder::default().order(&job.mesh, job.view.forward, &all, &Cancel::new());
    Ok(RenderJob { faces: Some(drawn.ok_or("cancelled")?), ..job.clone() })
}

fn with_points(job: &RenderJob, style: PointStyle) -> RenderJob {
    let cells = job.mesh.topology.tets.len();
    let mut ids = Ranking::of_cells(cells, 0).ids()[..style.points(cells)].to_vec();
    ids.sort_unstable();
    let cells = Arc::new(Drawn { ids, is_complete: style.lod == 1.0 });
    RenderJob { points: Some(PointScene { cells, style }), ..job.clone() }
}

/// Each cell with vertices of its own, in random order; and the vertex that each was.
fn torn(raw: &RawMesh) -> (RawMesh, Vec<u32>) {
    let mut random = SplitMix64::new(1);
    let mut tets = raw.cells.tets.clone();
    for i in (1..tets.len()).rev() {
        tets.swap(i, random.below(i + 1));
    }
    let of: Vec<u32> = tets.iter().flatten().copied().collect();
    let points = of.iter().map(|&v| raw.points[v as usize]).collect();
    let tets: Vec<[u32; 4]> = (0..tets.len() as u32).map(|cell| [0, 1, 2, 3].map(|i| 4 * cell + i)).collect();
    (RawMesh { points, cells: tets.into() }, of)
}
