//! Depth order of the faces of a million cells against other sorts of the same keys, and the selection of a level of detail:
//! `cargo bench --bench face_order`.

use glam::DVec3;
use rayon::prelude::*;
use std::error::Error;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use tetreel::bench::Machine;
use tetreel::field::{Component, SeriesSource};
use tetreel::lod::{Ranking, Selector, importance};
use tetreel::mesh::Mesh;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::visibility::{CellSet, DepthOrder, ascending_bits};

const ROUNDS: usize = 15;

/// Prints the median of some rounds in milliseconds; `work` gets the number of the round.
fn measure(what: &str, mut work: impl FnMut(usize)) {
    let mut ms: Vec<f64> = Vec::new();
    for round in 0..ROUNDS {
        let start = Instant::now();
        work(round);
        ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    ms.sort_by(f64::total_cmp);
    println!("{what:60} {:8.2} ms", ms[ROUNDS / 2]);
}

fn direction(round: usize) -> DVec3 {
    let angle = 0.7 + 0.05 * round as f64;
    DVec3::new(angle.cos(), 0.6 * angle.sin(), 0.8 * angle.sin())
}

fn main() -> Result<(), Box<dyn Error>> {
    let jet = generate(&SynthSpec { cells: 1_000_000, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (mesh, _) = Mesh::build(jet.mesh()?)?;
    let mut values = Vec::new();
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let scalars: Vec<f32> = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    let mesh = Arc::new(mesh);
    let topology = &mesh.topology;
    println!("{:?}", Machine::detect());
    println!(
        "jet, {} faces, {} threads, median of {ROUNDS}",
        topology.connectivity().faces.len(),
        rayon::current_num_threads()
    );

    let by_words = |words: &mut Vec<u64>, round: usize| {
        let depth: Vec<f32> = mesh.positions.local.iter().map(|p| direction(round).dot(p.as_dvec3()) as f32).collect();
        let word = |(face, vertices): (usize, &[u32; 3])| {
            let [a, b, c] = vertices.map(|v| depth[v as usize]);
            u64::from(ascending_bits(a + b + c + 0.0)) << 32 | face as u64
        };
        topology.connectivity().faces.par_iter().enumerate().with_min_len(1 << 14).map(word).collect_into_vec(words);
        words.par_sort_unstable();
    };
    let ranking = Arc::new(Ranking::by_strata(topology, &scalars));
    let all = Arc::new(CellSet::all(topology.tets.len()));
    let (mut selector, mut order) = (Selector::default(), DepthOrder::default());
    let whole = selector.select(&mesh, &ranking, 1.0, &all);
    let mut words = Vec::new();
    by_words(&mut words, 0);
    let drawn = order.order(&mesh, direction(0), &whole, &Cancel::new()).ok_or("cancelled")?;
    assert!(drawn.ids.iter().eq(words.iter().map(|&word| word as u32).collect::<Vec<_>>().iter()), "same order");
    drop(drawn);

    measure("keys and par_sort_unstable of (key, id)", |round| by_words(&mut words, round));
    for fraction in [1.0, 0.5, 0.1] {
        let part = selector.select(&mesh, &ranking, fraction, &all);
        measure(&format!("depth order, another direction, {} faces", part.ids.count()), |round| {
            black_box(order.order(&mesh, direction(round), &part, &Cancel::new()));
        });
    }
    // A third of the cells, different in each set.
    let some: Vec<Arc<CellSet>> =
        (0..ROUNDS).map(|round| Arc::new(CellSet::of(all.universe(), |cell| (cell / 64 + round) % 3 == 0))).collect();
    measure("selection, other active cells, 100 %", |round| {
        black_box(selector.select(&mesh, &ranking, 1.0, &some[round]));
    });
    measure("selection, other active cells, 50 %", |round| {
        black_box(selector.select(&mesh, &ranking, 0.5, &some[round]));
    });
    measure("selection, all cells, another fraction", |round| {
        black_box(selector.select(&mesh, &ranking, 0.5 + 1e-3 * round as f64, &all));
    });
    let parts: Vec<_> = some.iter().map(|some| selector.select(&mesh, &ranking, 0.5, some)).collect();
    order.order(&mesh, direction(0), &parts[0], &Cancel::new());
    let sorts = order.sorts();
    measure("order, same direction, other active cells", |round| {
        black_box(order.order(&mesh, direction(0), &parts[round], &Cancel::new()));
    });
    assert_eq!(order.sorts(), sorts, "the active cells cause no sort");

    let vertices: Vec<f32> = scalars.iter().map(|s| s.abs()).collect();
    measure("ranking by importance", |_| {
        black_box(Ranking::by_importance(topology, &importance(topology, &vertices)));
    });
    measure("ranking by hash", |_| drop(black_box(Ranking::by_hash(topology))));
    let by_hash = Ranking::by_hash(topology);
    measure("ranking by strata, given that by hash", |_| drop(black_box(by_hash.in_strata(topology, &scalars))));
    Ok(())
}
