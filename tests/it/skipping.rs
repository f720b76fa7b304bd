//! What is left out does not change the image: series from files and generators, all switches, all renderers.

use crate::common::samples;
use crate::render::difference;
use crate::series::{TRANSFER_FUNCTIONS, cameras, ingested, table_for};
use std::path::Path;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::codec::vq::VqOptions;
use tetreel::image::RgbaImage;
use tetreel::import;
use tetreel::ingest::{CodecChoice, IngestOptions, ingest};
use tetreel::lod::select;
use tetreel::mesh::Topology;
use tetreel::node_table::{Node, NodeTable};
use tetreel::optics::OpticsKind;
use tetreel::pipeline::{Backend, FrameRequest, FrameTime, Pipeline, Sampling, TetDraw};
use tetreel::render::cpu::havs::Havs;
use tetreel::render::surfaces::{Cut, Isosurface, Normals};
use tetreel::render::{Frame, RenderJob, Renderer};
use tetreel::stats::FrameStats;
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::visibility::{CellSet, DepthOrder, IdSet, Selection, Skip};

/// The bound for renderers that sum in another order when something is left out: roundings of f32 sums below 1 (6e-8). Measured: none
/// on the CPU, 1.1e-7 on a GPU.
const RMSE_MAX: f64 = 1e-6;

/// Each sample that is a tetrahedral mesh, with a field (the first if there is no name) and three steps of it.
pub(crate) const SAMPLES: [(&str, &str, &str); 7] = [
    ("heart_wave/heart_wave.xdmf", "potential", "100..300:100"),
    ("jet_flow/jet_flow.xdmf", "dye", "20..60:20"),
    ("natural_convection/natural_convection.xdmf", "temperature", "40..140:50"),
    ("torso_dipole/torso_dipole.xdmf", "potential", "10..210:100"),
    ("spxf/spxf.pvd", "reaction_force", "5..185:90"),
    ("paper_static/spx.vtu", "", "0"),
    ("paper_static/bluntfin.vtu", "", "0"),
];

pub(crate) fn sample(dir: &Path, (file, field, steps): (&str, &str, &str)) -> (tempfile::TempDir, Pipeline) {
    let out = tempfile::tempdir().unwrap();
    let store = ingested(&*import::open(&dir.join(file)).unwrap(), &out.path().join("s.zarr"), steps);
    let name = if field.is_empty() { store.fields()[0].name.clone() } else { field.to_owned() };
    let pipeline = Pipeline::open(&store, Some(&name.parse().unwrap())).unwrap();
    (out, pipeline)
}

/// Planes of a frame that are equal to the last bit.
pub(crate) fn bits(frame: &Frame) -> (Vec<[u32; 4]>, Vec<u32>) {
    let color = frame.planes.color.pixels.iter().map(|p| p.map(f32::to_bits)).collect();
    (color, frame.planes.depth.pixels.iter().map(|d| d.to_bits()).collect())
}

pub(crate) fn with(request: &FrameRequest, draw: TetDraw, skip: Skip) -> FrameRequest {
    FrameRequest { skip, backend: Backend::Cpu, ..request.clone().with_draw(draw) }
}

/// The same request with a thousandth more extinction: what comparisons with `RMSE_MAX` have to notice.
fn thicker(request: &FrameRequest) -> FrameRequest {
    let nodes = request
        .tets()
        .unwrap()
        .table
        .over_scalars()
        .nodes()
        .iter()
        .map(|n| Node { tau: 1.001 * n.tau, ..*n })
        .collect();
    request.clone().with_tets(|tets| tets.table = Arc::new(NodeTable::new(nodes).unwrap()).into())
}

/// All switches but one, for each of them.
fn all_but_one() -> impl Iterator<Item = Skip> {
    Skip::SWITCHES.iter().map(|(_, switch)| {
        let mut skip = Skip::ALL;
        *switch(&mut skip) = false;
        skip
    })
}

// Long: a series, a transfer function and the optics all decide what is skipped: every combination is drawn both ways.
#[test]
fn real_series_are_drawn_alike_with_and_without_skipping() {
    let Some(dir) = samples() else { return };
    for of in SAMPLES {
        let (_out, mut pipeline) = sample(&dir, of);
        let (mut skipped, mut differ, mut drawn, mut noticed) = (0, 0, 0.0f32, 0);
        for tf in TRANSFER_FUNCTIONS {
            let table = table_for(&pipeline, tf);
            for (step, camera) in (0..pipeline.times().len()).zip(cameras(pipeline.mesh().positions.world_bounds())) {
                for optics in OpticsKind::ALL {
                    let request = FrameRequest::new(step, camera, table.clone(), (96, 80));
                    let request = request.with_tets(|tets| tets.optics = optics);
                    let name = format!("{of:?}, {tf}, step {step}, {optics}");
                    let off = pipeline.render(&with(&request, TetDraw::Raycast, Skip::NONE)).unwrap().clone();
                    let on = pipeline.render(&with(&request, TetDraw::Raycast, Skip::ALL)).unwrap().clone();
                    assert!(bits(&on) == bits(&off), "{name}: {:?}", difference(&on.planes.color, &off.planes.color));
                    skipped += off.stats.cells_active - on.stats.cells_active;
                    drawn = off.planes.color.pixels.iter().fold(drawn, |most, p| most.max(p[3]));
                    if optics == OpticsKind::Exact {
                        let off = pipeline
                            .render(&with(&request, TetDraw::ALL_FACES, Skip::NONE))
                            .unwrap()
                            .planes
                            .color
                            .clone();
                        let on = pipeline
                            .render(&with(&request, TetDraw::ALL_FACES, Skip::ALL))
                            .unwrap()
                            .planes
                            .color
                            .clone();
                        let (rmse, _) = difference(&on, &off);
                        assert!(rmse <= RMSE_MAX, "{name}: faces {rmse:.2e}");
                        if step == 0 {
                            let thicker = with(&thicker(&request), TetDraw::ALL_FACES, Skip::ALL);
                            let (rmse, _) = difference(&pipeline.render(&thicker).unwrap().planes.color, &off);
                            noticed += usize::from(rmse > RMSE_MAX);
                        }
                        differ += usize::from(leaving_out_a_visible_cell_is_noticed(&mut pipeline, &request));
                    }
                }
            }
        }
        assert!(skipped > 0 && drawn > 0.1, "{of:?}: {skipped} cells skipped, opacity {drawn}");
        assert!(differ > 0 && noticed > 0, "{of:?}: no cell that can be seen was missed, or no extinction");
    }
}

#[test]
fn surfaces_are_drawn_alike_with_and_without_skipping() {
    let out = tempfile::tempdir().unwrap();
    for (name, shares) in [(SeriesName::Jet, [0.3, 0.6]), (SeriesName::Dipole, [-0.004, 0.01])] {
        let source = generate(&SynthSpec { cells: 12_000, steps: 3, ..SynthSpec::new(name) }).unwrap();
        let path = out.path().join(format!("{name}.zarr"));
        ingest(&source, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        let mut pipeline = Pipeline::open(&Store::open(&path).unwrap(), None).unwrap();
        let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
        // Shares of the range, or where a field has both signs of its greatest value.
        let value = |share: f64| if lo < -0.1 * hi { share * hi } else { lo + share * (hi - lo) };
        let surfaces = shares.map(|share| Isosurface { opacity: 0.7, ..Isosurface::new(value(share)) });
        let bounds = pipeline.mesh().positions.world_bounds();
        for (tf, camera) in ["viridis@0:0,0.5:0,1:0.3", "inferno@0:0.01,1:0.02"].into_iter().zip(cameras(bounds)) {
            let table = table_for(&pipeline, tf);
            for (normals, volume) in [(Normals::Cell, false), (Normals::Vertex, false), (Normals::Vertex, true)] {
                let request = FrameRequest::new(2, camera, table.clone(), (96, 80)).with_tets(|tets| {
                    (tets.surfaces, tets.volume) = (surfaces.to_vec(), volume);
                    tets.shading.normals = normals;
                });
                for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
                    let off = pipeline.render(&with(&request, draw, Skip::NONE)).unwrap().clone();
                    assert!(off.planes.color.pixels.iter().filter(|p| p[3] >= 0.7).count() > 100, "{name}, {tf}");
                    for skip in all_but_one().chain([Skip::ALL]) {
                        let on = pipeline.render(&with(&request, draw, skip)).unwrap().clone();
                        let said = format!("{name}, {tf}, {normals}, volume {volume}, {draw:?}, {skip}");
                        if draw == TetDraw::Raycast {
                            assert!(bits(&on) == bits(&off), "{said}");
                        } else {
                            let (rmse, _) = difference(&on.planes.color, &off.planes.color);
                            assert!(rmse <= RMSE_MAX, "{said}: {rmse:.2e}");
                        }
                        // Cells without a surface show nothing where there is no volume.
                        let fewer = on.stats.cells_active < off.stats.cells_active / 2;
                        assert!(fewer || volume || !skip.transparent_cells, "{said}: {} cells", on.stats.cells_active);
                    }
                }
                assert!(leaving_out_a_visible_cell_is_noticed(&mut pipeline, &request));
            }
        }
    }
}

/// Whether the image changes if a part of the active cells is left out as well.
fn leaving_out_a_visible_cell_is_noticed(pipeline: &mut Pipeline, request: &FrameRequest) -> bool {
    let job = pipeline.prepare(&with(request, TetDraw::Raycast, Skip::ALL)).unwrap();
    let fewer = CellSet::of(job.active.universe(), |cell| job.active.contains(cell as u32) && cell % 16 != 0);
    let fewer = RenderJob { active: Arc::new(fewer), finite: None, ..job.clone() };
    crate::render::raycast(&fewer) != crate::render::raycast(&job)
}

#[cfg(feature = "gpu")]
#[test]
fn real_series_are_drawn_alike_on_the_gpu_with_and_without_skipping() {
    use crate::render::{gpu, havs};
    let Some(dir) = samples() else { return };
    if gpu::context().is_none() {
        return;
    }
    for of in SAMPLES {
        let (_out, mut pipeline) = sample(&dir, of);
        for (tf, at) in TRANSFER_FUNCTIONS.iter().zip(0..) {
            let table = table_for(&pipeline, tf);
            let bounds = pipeline.mesh().positions.world_bounds();
            let step = at % pipeline.times().len();
            let request = FrameRequest::new(step, cameras(bounds)[at % 4], table.clone(), (48, 40));
            let mut job =
                |request: &FrameRequest, skip| pipeline.prepare(&with(request, TetDraw::ALL_FACES, skip)).unwrap();
            let (off, on, thicker) =
                (job(&request, Skip::NONE), job(&request, Skip::ALL), job(&thicker(&request), Skip::ALL));
            for (name, draw) in
                [("raycast", gpu::render as fn(&RenderJob) -> Option<Frame>), ("havs", havs::gpu::render)]
            {
                let (off, on) = (draw(&off).unwrap(), draw(&on).unwrap());
                let (rmse, max) = difference(&on.planes.color, &off.planes.color);
                assert!(rmse <= RMSE_MAX, "{of:?}, {tf}, {name}: {rmse:.2e}, {max:.2e}");
                // The densest of the transfer functions, in which all cells are seen.
                if at == 0 {
                    let (rmse, _) = difference(&draw(&thicker).unwrap().planes.color, &off.planes.color);
                    assert!(rmse > RMSE_MAX, "{of:?}, {name}: a thousandth more extinction makes {rmse:.2e}");
                }
            }
        }
    }
}

/// A generated series with tents in its transfer function, stored with a codec.
fn stored(name: SeriesName, cells: u64, codec: CodecChoice) -> (tempfile::TempDir, Store) {
    let out = tempfile::tempdir().unwrap();
    let series = generate(&SynthSpec { cells, steps: 6, ..SynthSpec::new(name) }).unwrap();
    let path = out.path().join("s.zarr");
    ingest(&series, &path, &IngestOptions { codec, ..Default::default() }, &Silent, &Cancel::new()).unwrap();
    (out, Store::open(path).unwrap())
}

/// Time and camera in turn, twice around, between steps, and back; the table changes on the way.
fn journey(pipeline: &Pipeline) -> Vec<FrameRequest> {
    let tents = ["inferno@0:0,0.3:0,0.4:0.9,0.5:0,1:0", "inferno@0:0,0.3:0,0.4:0.9,0.5:0,0.9:0,0.95:1,1:1"];
    let tables = tents.map(|tf| table_for(pipeline, tf));
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    let between = FrameTime::between(2, 3, 0.4);
    let times = [0.into(), 1.into(), 1.into(), 2.into(), 3.into(), between, 2.into(), 5.into(), 0.into(), 1.into()];
    let at = |(i, time): (usize, FrameTime)| {
        let camera = if i % 4 == 1 { camera.orbit(20.0 * i as f64, 5.0).unwrap() } else { camera };
        FrameRequest::new(time, camera, tables[i / 6].clone(), (64, 50))
    };
    times.into_iter().enumerate().map(at).collect()
}

// Long: every switch has a pipeline of its own through the whole journey.
#[test]
fn every_switch_leaves_the_frames_of_a_journey_as_they_are() {
    for (name, codec) in [
        (SeriesName::Jet, CodecChoice::default()),
        (SeriesName::Tornado, CodecChoice::new(VqOptions { entries: 64, ..VqOptions::default() })),
    ] {
        let (_out, store) = stored(name, 40_000, codec);
        let open = || Pipeline::open(&store, None).unwrap();
        let (mut plain, mut others) = (open(), Vec::new());
        for skip in all_but_one().chain([Skip::ALL]) {
            others.push((skip, open()));
        }
        let (mut seen, mut noticed) = (0.0f32, 0);
        for (i, request) in journey(&plain).iter().enumerate() {
            for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
                let off = plain.render(&with(request, draw, Skip::NONE)).unwrap().clone();
                seen = off.planes.color.pixels.iter().fold(seen, |most, p| most.max(p[3]));
                if draw == TetDraw::ALL_FACES {
                    let thicker = plain.render(&with(&thicker(request), draw, Skip::NONE)).unwrap();
                    noticed += usize::from(difference(&thicker.planes.color, &off.planes.color).0 > RMSE_MAX);
                }
                for (skip, pipeline) in &mut others {
                    let on = pipeline.render(&with(request, draw, *skip)).unwrap();
                    let (rmse, max) = difference(&on.planes.color, &off.planes.color);
                    let is_same = if draw == TetDraw::Raycast { bits(on) == bits(&off) } else { rmse <= RMSE_MAX };
                    assert!(is_same, "{name} {i}, {draw:?}, {skip}: {rmse:.2e}, {max:.2e}");
                }
            }
        }
        assert!(
            seen > 0.5 && noticed > 2,
            "{name}: opacity {seen}, {noticed} of 10 frames with more extinction noticed"
        );
    }
}

#[test]
fn no_switch_changes_which_rays_contrast_asks_for() {
    let (_out, store) = stored(SeriesName::Jet, 40_000, CodecChoice::default());
    let open = || Pipeline::open(&store, None).unwrap();
    let mut plain = open();
    let (a, b) = plain.mesh().positions.world_bounds();
    let clip = Cut { point: (0.5 * (a + b)).to_array(), normal: [0.3, -0.2, 1.0], clips: true, by: None };
    let requests: Vec<FrameRequest> = journey(&plain)
        .into_iter()
        .map(|request| FrameRequest { samples: "adaptive:0.03".parse().unwrap(), size_px: (150, 110), ..request })
        .enumerate()
        .map(|(i, request)| match i % 3 {
            1 => request.with_tets(|tets| tets.cuts = vec![clip]),
            2 => request.with_tets(|tets| tets.domain = vec!["edges:#ffffff".parse().unwrap()]),
            _ => request,
        })
        .collect();
    let off: Vec<Frame> = requests
        .iter()
        .map(|request| plain.render(&with(request, TetDraw::Raycast, Skip::NONE)).unwrap().clone())
        .collect();
    let reasons = off.iter().fold([0; 5], |sum, frame| std::array::from_fn(|i| sum[i] + frame.stats.blocks_split[i]));
    assert!(reasons.iter().all(|&count| count > 0), "{reasons:?}");
    let mut sampled = 0;
    for skip in all_but_one().chain([Skip::ALL]) {
        let mut pipeline = open();
        for (i, (request, off)) in requests.iter().zip(&off).enumerate() {
            let on = pipeline.render(&with(request, TetDraw::Raycast, skip)).unwrap();
            // Where nothing is to be seen, that may be known without a ray.
            if on.stats.rays_by_level != [0; 4] {
                assert_eq!(on.stats.rays_by_level, off.stats.rays_by_level, "{i}, {skip}");
                assert_eq!(on.stats.blocks_split, off.stats.blocks_split, "{i}, {skip}");
                sampled += 1;
            }
            assert!(bits(on) == bits(off), "{i}, {skip}");
        }
    }
    assert!(sampled > 20, "{sampled} frames");
    // Another contrast is seen.
    let differs = |(request, off): (&FrameRequest, &Frame)| {
        let other = FrameRequest { samples: "adaptive:0.3".parse().unwrap(), ..request.clone() };
        bits(plain.render(&with(&other, TetDraw::Raycast, Skip::ALL)).unwrap()) != bits(off)
    };
    assert!(requests.iter().zip(&off).any(differs));
}

#[test]
fn every_counter_fires_and_none_without_its_switch() {
    let (_out, store) =
        stored(SeriesName::Jet, 200_000, CodecChoice::new(VqOptions { entries: 64, ..VqOptions::default() }));
    let counts = |skip: Skip, draw: TetDraw| {
        let mut pipeline = Pipeline::open(&store, None).unwrap();
        let requests = journey(&pipeline);
        let frames = requests.iter().map(|request| pipeline.render(&with(request, draw, skip)).unwrap().stats.clone());
        frames.collect::<Vec<FrameStats>>()
    };
    let sum = |frames: &[FrameStats], of: fn(&FrameStats) -> u64| frames.iter().map(of).sum::<u64>();
    let (on, off) = (counts(Skip::ALL, TetDraw::Raycast), counts(Skip::NONE, TetDraw::Raycast));
    let both = |of: fn(&FrameStats) -> u64| (sum(&on, of), sum(&off, of));
    let (active, all) = both(|s| s.cells_active);
    assert!(active < all / 2, "{active} of {all} cells");
    let (steps, all_steps) = both(|s| s.steps);
    assert!(steps < all_steps / 2, "{steps} of {all_steps}");
    let (decoded, all_decoded) = both(|s| s.vertices_decoded);
    assert!(decoded < all_decoded, "{decoded} of {all_decoded}");
    for (name, of) in [
        ("chunks skipped", (|s| s.chunks_skipped) as fn(&FrameStats) -> u64),
        ("decodes skipped", |s| s.decodes_skipped),
        ("entry lists kept", |s| s.entry_lists_kept),
        ("entry faces kept", |s| s.entry_faces_kept),
        ("vertices not transformed", |s| s.vertices_not_transformed),
    ] {
        let (on, off) = both(of);
        assert!(on > 0 && off == 0, "{name}: {on} with, {off} without");
    }
    // Time stands still between two frames: nothing is classified; nor is everything when time moves.
    assert_eq!(on[2].cells_classified, 0);
    assert!(on.iter().all(|s| s.cells_classified <= s.cells_total));
    let (on, off) = (counts(Skip::ALL, TetDraw::ALL_FACES), counts(Skip::NONE, TetDraw::ALL_FACES));
    assert!(sum(&on, |s| s.face_sorts_skipped) > 0 && sum(&off, |s| s.face_sorts_skipped) == 0);
    assert!(sum(&on, |s| s.faces_drawn) < sum(&off, |s| s.faces_drawn) / 2);
}

#[test]
fn a_spike_narrower_than_a_bin_of_any_table_is_drawn() {
    let (_out, store) = stored(SeriesName::Jet, 40_000, CodecChoice::default());
    let mut pipeline = Pipeline::open(&store, None).unwrap();
    let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
    let camera = Camera::default_for(pipeline.mesh().positions.world_bounds()).unwrap();
    for share in [1.0 / 4096.0, 1.0 / 100_000.0] {
        let (middle, half) = (lo + 0.311 * (hi - lo), 0.5 * share * (hi - lo));
        let node = |scalar, tau| Node { scalar, rgb: [1.0, 0.5, 0.2], tau };
        // As much opacity in total, however narrow.
        let nodes = vec![node(middle - half, 0.0), node(middle, 300.0 / share / 4096.0), node(middle + half, 0.0)];
        let table = Arc::new(NodeTable::new(nodes).unwrap());
        let request = FrameRequest::new(3, camera, table, (64, 64));
        let off = pipeline.render(&with(&request, TetDraw::Raycast, Skip::NONE)).unwrap().clone();
        let on = pipeline.render(&with(&request, TetDraw::Raycast, Skip::ALL)).unwrap().clone();
        let hit = off.planes.color.pixels.iter().filter(|p| p[3] > 0.05).count();
        assert!(hit > 100 && bits(&on) == bits(&off), "{share}: {hit} pixels");
        assert!(on.stats.cells_active < on.stats.cells_total / 4, "{} cells", on.stats.cells_active);
    }
}

/// The faces of a selection in the order of their depths.
fn drawn(job: &RenderJob, selection: Selection, active: Arc<CellSet>) -> RgbaImage {
    let (selection, cancel) = (Arc::new(selection), Cancel::new());
    let faces = DepthOrder::default().order(&job.mesh, job.view.forward, &selection, &cancel).unwrap();
    let job = RenderJob { faces: Some(faces), active, finite: None, ..job.clone() };
    Havs::new().render(job).unwrap().planes.color.clone()
}

/// Faces at which a set of cells ends, and faces between two of its cells.
fn count_faces(topology: &Topology, cells: &CellSet) -> (usize, usize) {
    let (mut surface, mut inner) = (IdSet::default(), IdSet::default());
    surface.set_boundary_of(cells, &topology.connectivity().face_cells, &mut inner);
    (surface.count(), inner.count())
}

/// With as many faces drawn, an image whose transparent cells are left out is no further from the whole one than with them.
// Long: errors are sums over series, transfer functions, steps and levels.
#[test]
fn at_an_equal_number_of_faces_skipping_costs_no_accuracy() {
    let Some(dir) = samples() else { return };
    for of in SAMPLES {
        let (_out, mut pipeline) = sample(&dir, of);
        let (mut with_skipping, mut without, mut compared) = (0.0, 0.0, 0);
        for tf in TRANSFER_FUNCTIONS {
            let table = table_for(&pipeline, tf);
            for (step, camera) in (0..pipeline.times().len()).zip(cameras(pipeline.mesh().positions.world_bounds())) {
                let request = FrameRequest::new(step, camera, table.clone(), (64, 60));
                // With all scalars there, since all cells are drawn as well.
                let skip = Skip { transparent_chunks: false, ..Skip::ALL };
                let job = pipeline.prepare(&with(&request, TetDraw::ALL_FACES, skip)).unwrap();
                let Some(finite) = job.finite.clone() else { continue };
                let topology = &job.mesh.topology;
                let ranking = pipeline.series().ranking(step, Sampling::default(), &Cancel::new()).unwrap().unwrap();
                let (few, many) = (count_faces(topology, &job.active), count_faces(topology, &finite));
                let whole =
                    pipeline.render(&with(&request, TetDraw::Raycast, Skip::NONE)).unwrap().planes.color.clone();
                for lod in [0.05, 0.25, 0.6] {
                    // As many as this level draws of all cells; with skipping fewer, if the active cells have fewer.
                    let count = (many.0 + (lod * many.1 as f64) as usize).max(few.0);
                    let level = |(surface, inner): (usize, usize)| (count - surface) as f64 / inner.max(1) as f64;
                    let on = select(topology, &ranking, level(few).min(1.0), &job.active);
                    let off = select(topology, &ranking, level(many).min(1.0), &finite);
                    assert!(on.ids.count() <= off.ids.count() + 1, "{} and {} faces", on.ids.count(), off.ids.count());
                    with_skipping += difference(&drawn(&job, on, job.active.clone()), &whole).0.powi(2);
                    without += difference(&drawn(&job, off, finite.clone()), &whole).0.powi(2);
                    compared += 1;
                }
            }
        }
        println!(
            "{of:?}: {:.2e} with skipping, {:.2e} without, {compared} pairs",
            with_skipping.sqrt(),
            without.sqrt()
        );
        assert!(with_skipping <= without, "{of:?}: {with_skipping:.3e} with skipping, {without:.3e} without");
        assert!(compared > 0, "{of:?}");
    }
}
