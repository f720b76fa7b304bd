//! How far a level of detail is from the whole image: the usual ranking beside subsets drawn at random, on real series.

use crate::common::samples;
use crate::render::havs::{havs, with_faces};
use crate::series::{ingested, table_for};
use std::path::Path;
use tetreel::camera::Camera;
use tetreel::import;
use tetreel::lod::Ranking;
use tetreel::moments::CovDenominator;
use tetreel::pipeline::{FrameRequest, Pipeline, Sampling};
use tetreel::render::RenderJob;
use tetreel::store::Store;
use tetreel::task::Cancel;
use tetreel::visibility::Skip;

const LEVELS: [f64; 2] = [0.05, 0.25];
const TRANSFER_FUNCTIONS: [&str; 4] = [
    "viridis@0:0.05,1:0.5",
    "inferno@0:0,1:0.5",
    "viridis@0:0,0.2:0,0.25:0.8,0.3:0,0.6:0,0.65:0.8,0.7:0,1:0",
    "viridis@0:0.5,0.45:0,0.55:0,1:0.5",
];

fn mean_square(a: &RenderJob, whole: &[[f32; 4]]) -> f64 {
    let drawn = havs(a).planes.color.pixels;
    let channels = drawn.iter().flatten().zip(whole.iter().flatten());
    channels.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (4 * whole.len()) as f64
}

/// The job with the first faces of a ranking, at a level.
fn at_level(job: &RenderJob, ranking: &[u32], level: f64) -> RenderJob {
    let mut is_drawn = vec![false; job.mesh.topology.connectivity().faces.len()];
    ranking[..(level * ranking.len() as f64).round() as usize].iter().for_each(|&face| is_drawn[face as usize] = true);
    with_faces(job, |face| is_drawn[face as usize])
}

/// The interior faces in an order by lot.
fn by_lot(ranking: &Ranking, seed: u64) -> Vec<u32> {
    let mut faces = ranking.ids().to_vec();
    faces.sort_by_cached_key(|&face| (crate::meshes::noise(seed, u64::from(face)) * 1e15) as i64);
    faces
}

/// Of each level: the geometric mean over transfer functions of error over error of random subsets, for some rankings.
fn ratios(store: &Store, field: &str, samplings: &[Sampling]) -> Vec<[f64; LEVELS.len()]> {
    let mut pipeline = Pipeline::open(store, Some(&field.parse().unwrap())).unwrap();
    let series = pipeline.series().clone();
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
    let cameras = [camera, camera.orbit(75.0, 30.0).unwrap()];
    let steps = series.times().len();
    let lots: Vec<Vec<u32>> = (1..=3).map(|seed| by_lot(&series.any_ranking(), seed)).collect();
    let mut logs = vec![[0.0; LEVELS.len()]; samplings.len()];
    for tf in TRANSFER_FUNCTIONS {
        let table = table_for(&pipeline, tf);
        let mut ours = vec![[0.0; LEVELS.len()]; samplings.len()];
        let mut random = [0.0; LEVELS.len()];
        for (step, camera) in [steps / 3, steps * 5 / 6].into_iter().flat_map(|step| cameras.map(|c| (step, c))) {
            let request = FrameRequest::new(step, camera, table.clone(), (64, 64));
            // Rankings are compared on the faces of all cells.
            let job = pipeline.prepare(&FrameRequest { skip: Skip::NONE, ..request }).unwrap();
            let whole = havs(&with_faces(&job, |_| true)).planes.color.pixels;
            for (i, &level) in LEVELS.iter().enumerate() {
                let of = |ranking: &[u32]| mean_square(&at_level(&job, ranking, level), &whole);
                random[i] += lots.iter().map(|lot| of(lot)).sum::<f64>() / lots.len() as f64;
                for (&sampling, ours) in samplings.iter().zip(&mut ours) {
                    let ranking = series.ranking(step, sampling, &Cancel::new()).unwrap().unwrap();
                    ours[i] += of(ranking.ids());
                }
            }
        }
        for (logs, ours) in logs.iter_mut().zip(&ours) {
            for i in 0..LEVELS.len() {
                // A level that shows no error at all would be 0 / 0.
                logs[i] += 0.5 * (ours[i].max(1e-30) / random[i].max(1e-30)).ln() / TRANSFER_FUNCTIONS.len() as f64;
            }
        }
    }
    logs.into_iter().map(|of| of.map(f64::exp)).collect()
}

// Long: a ratio to chance needs many images: seven series, four transfer functions, four views, two levels, five rankings.
#[test]
fn the_usual_ranking_is_no_worse_than_chance_and_mostly_better() {
    let Some(dir) = samples() else { return };
    let series = [
        ("torso_dipole/torso_dipole.xdmf", "potential", "0..359:23"),
        ("jet_flow/jet_flow.xdmf", "dye", "0..63:7"),
        ("jet_flow/jet_flow.xdmf", "pressure", "0..63:7"),
        ("spxf/spxf.pvd", "reaction_force", "0..191:13"),
        ("heart_wave/heart_wave.xdmf", "potential", "0..359:23"),
        ("natural_convection/natural_convection.xdmf", "temperature", "0..149:17"),
        ("paper_static/bluntfin.vtu", "", "0"),
    ];
    let samplings = [Sampling::default(), Sampling::Global(CovDenominator::default())];
    let (mut better, mut global_is_worse, mut all) = (0, false, 0);
    for (file, field, steps) in series {
        let out = tempfile::tempdir().unwrap();
        let store = ingested(&*import::open(Path::new(&dir.join(file))).unwrap(), &out.path().join("s.zarr"), steps);
        let field = if field.is_empty() { store.fields()[0].name.clone() } else { field.to_owned() };
        let [ours, global] = ratios(&store, &field, &samplings).try_into().unwrap();
        println!("{file} {field}: {ours:.3?} of the error of chance at levels {LEVELS:?}; global {global:.3?}");
        // Measured: 1.048 at most (jet dye at 5 %), which is within what one random subset differs from others by
        // (`docs/performance.md`, 0.90 to 1.11). By the coefficient of variation: up to 3.3, on convection.
        assert!(ours.iter().all(|&r| r <= 1.05), "{file} {field}: {ours:?}");
        better += ours.iter().filter(|&&r| r < 1.0).count();
        all += LEVELS.len();
        global_is_worse |= global.iter().any(|&r| r > 1.5);
    }
    assert!(4 * better >= 3 * all, "better in {better} of {all}");
    assert!(global_is_worse, "the comparison notices rankings that are worse");
}
