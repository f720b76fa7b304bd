//! Surfaces of real series: places, normals and numbers against the judge, on the CPU; and light that is found on the image.

use crate::common::samples;
use crate::render::difference;
use crate::series::{cameras, colors_for};
use crate::skipping::{SAMPLES, sample};
use std::num::NonZeroUsize;
use tetreel::image::{PlaneMetrics, Planes, compare_depth, compare_ids, compare_normals};
use tetreel::pipeline::{Backend, FaceDetail, FrameRequest, Pipeline, SampleSet, Sampling, TetDraw};
use tetreel::render::surfaces::{Cut, Isosurface, Normals};
use tetreel::visibility::Skip;

/// Two isosurfaces and the section of a plane through the middle, of a step of a series, with planes of normals and numbers.
fn request(pipeline: &Pipeline, step: usize, camera: usize, normals: Normals) -> FrameRequest {
    let (table, formula) = colors_for(pipeline, "viridis@0:0,0.5:0,1:0.3");
    let range = pipeline.field().range_per_step[step].unwrap();
    let [lo, hi] = range.map(f64::from);
    let (a, b) = pipeline.mesh().positions.world_bounds();
    let value = |share: f64| lo + share * (hi - lo);
    let surface = |share, opacity| Isosurface { opacity, ..Isosurface::new(value(share)) };
    let cut = Cut { point: (0.5 * (a + b)).to_array(), normal: [0.3, -0.2, 1.0], clips: false, by: None };
    let request = FrameRequest::new(step, cameras((a, b))[camera % 4], table, (96, 80));
    let request = request.with_tets(|tets| {
        (tets.surfaces, tets.cuts) = (vec![surface(0.37, 0.6), surface(0.71, 1.0)], vec![cut]);
        (tets.shading.normals, tets.volume, tets.formula) = (normals, false, Some(formula));
    });
    FrameRequest { backend: Backend::Cpu, guides: true, ..request }
}

fn planes(pipeline: &mut Pipeline, request: &FrameRequest, draw: TetDraw) -> Planes {
    pipeline.render(&request.clone().with_draw(draw)).unwrap().planes.clone()
}

/// Pixels next to one that shows another surface, or none.
fn edges(planes: &Planes) -> Vec<bool> {
    let (width, id) = (planes.id.width, &planes.id.pixels);
    let differs = |a: usize, b: usize| id.get(b).is_some_and(|other| *other != id[a]);
    let is_edge = |i: usize| {
        let (right, left) = (!(i + 1).is_multiple_of(width) && differs(i, i + 1), i % width >= 1 && differs(i, i - 1));
        right || left || differs(i, i + width) || i >= width && differs(i, i - width)
    };
    (0..id.len()).map(is_edge).collect()
}

/// Pixels whose numbers differ, those among pixels at edges, and those at edges; the farthest depth and normal of the others.
fn apart(a: &Planes, b: &Planes) -> (usize, usize, f64, f64) {
    let different = a.id.pixels.iter().zip(&b.id.pixels).filter(|(a, b)| a != b).count();
    let at_edges = edges(b).into_iter().filter(|is_edge| *is_edge).count();
    let mut a = a.clone();
    for i in 0..a.id.pixels.len() {
        if a.id.pixels[i] != b.id.pixels[i] {
            (a.depth.pixels[i], a.normal.pixels[i]) = (b.depth.pixels[i], b.normal.pixels[i]);
        }
    }
    let PlaneMetrics { max, unmatched, .. } = compare_depth(&a.depth, &b.depth).unwrap();
    assert_eq!(unmatched, 0);
    (different, at_edges, max, compare_normals(&a.normal, &b.normal).unwrap().max)
}

#[test]
fn surfaces_of_real_series_are_where_the_judge_has_them() {
    let Some(dir) = samples() else { return };
    let (mut different, mut at_edges, mut worst) = (0, 0, (0.0_f64, 0.0_f64));
    for of in SAMPLES {
        let (_out, mut pipeline) = sample(&dir, of);
        let (a, b) = pipeline.mesh().positions.world_bounds();
        let scene = (b - a).length();
        for step in 0..pipeline.times().len() {
            for (camera, normals) in [(step, Normals::Cell), (step + 1, Normals::Vertex)] {
                let request = request(&pipeline, step, camera, normals);
                let judge = planes(&mut pipeline, &request, TetDraw::Reference);
                assert!(judge.id.pixels.iter().filter(|id| **id != 0).count() > 30, "{of:?}, {step}");
                for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
                    let found = planes(&mut pipeline, &request, draw);
                    let (others, edge, depth, angle) = apart(&found, &judge);
                    (different, at_edges) = (different + others, at_edges + edge);
                    worst = (worst.0.max(depth / scene), worst.1.max(angle));
                    let said = format!("{of:?}, step {step}, {normals}, {draw:?}: {depth:.1e} of {scene}, {angle:.1e}");
                    assert!(depth <= 1e-5 * scene && angle <= 0.1, "{said}");
                    assert!(difference(&found.color, &judge.color).0 <= 2e-3, "{said}: edges");
                }
            }
        }
        // A surface elsewhere is noticed.
        let wanted = request(&pipeline, 0, 0, Normals::Cell);
        let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
        let by = 0.01 * (hi - lo);
        let moved = wanted.clone().with_tets(|tets| tets.surfaces.iter_mut().for_each(|surface| surface.value += by));
        let [wanted, moved] = [wanted, moved].map(|request| planes(&mut pipeline, &request, TetDraw::Raycast));
        let (others, _, depth, angle) = apart(&moved, &wanted);
        assert!(others > 0 || depth > 1e-5 * scene || angle > 0.1, "{of:?}");
    }
    eprintln!("surfaces: {different} of {at_edges} edge pixels differ, depth {:.1e}, {:.1e} degrees", worst.0, worst.1);
    assert!(different * 1000 < at_edges, "{different} of {at_edges} pixels at edges");
}

/// A jet in a store, of so many cells.
fn jet(dir: &std::path::Path, cells: u64) -> Pipeline {
    use tetreel::synth::{SeriesName, SynthSpec, generate};
    let series = generate(&SynthSpec { cells, steps: 3, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    Pipeline::open(&crate::series::ingested(&series, &dir.join("jet.zarr"), "0..2"), None).unwrap()
}

#[test]
fn cuts_and_normals_are_alike_with_and_without_skipping() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 12_000);
    let clip = |request: FrameRequest| {
        request.with_tets(|tets| {
            let middle = tets.cuts[0].point;
            tets.cuts.push(Cut { point: middle, normal: [-1.0, 0.4, 0.1], clips: true, by: None });
            tets.volume = true;
        })
    };
    for camera in 0..4 {
        let request = clip(request(&pipeline, 2, camera, Normals::Vertex));
        for draw in [TetDraw::Raycast, TetDraw::ALL_FACES] {
            let mut with = |skip: Skip| {
                let frame = pipeline.render(&FrameRequest { skip, ..request.clone().with_draw(draw) }).unwrap();
                (frame.planes.clone(), frame.stats.clone())
            };
            let (off, off_stats) = with(Skip::NONE);
            let (on, on_stats) = with(Skip::ALL);
            assert!(on_stats.cells_clipped > 100 && on_stats.cells_active < off_stats.cells_active, "{on_stats:?}");
            assert_eq!(off_stats.cells_clipped, 0);
            for (_, switch) in Skip::SWITCHES {
                let mut skip = Skip::ALL;
                *switch(&mut skip) = false;
                let (some, _) = with(skip);
                if draw == TetDraw::Raycast {
                    assert!(some == off, "camera {camera}, {skip}");
                }
            }
            if draw == TetDraw::Raycast {
                assert!(on == off, "camera {camera}");
            } else {
                assert!(difference(&on.color, &off.color).0 < 1e-6);
                assert_eq!(compare_ids(&on.id, &off.id).unwrap().different, 0);
            }
        }
    }
}

#[test]
fn the_planes_of_normals_and_numbers_are_there_if_they_are_asked_for_and_change_nothing_else() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 6000);
    let with = request(&pipeline, 1, 0, Normals::Cell);
    let without = FrameRequest { guides: false, ..with.clone() };
    let [with, without] = [with, without].map(|request| planes(&mut pipeline, &request, TetDraw::Raycast));
    assert_eq!((&with.color, &with.depth), (&without.color, &without.depth));
    assert_eq!(without.id.pixels.len() + without.normal.pixels.len(), 0);
    assert!([1, 3].iter().all(|number| with.id.pixels.contains(number)) && with.id.pixels.iter().all(|id| *id < 4));
    for (pixel, (normal, id)) in with.normal.pixels.iter().zip(&with.id.pixels).enumerate() {
        let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((length - if *id == 0 { 0.0 } else { 1.0 }).abs() < 1e-6, "pixel {pixel}: {length}");
        assert_eq!(*id != 0, with.depth.pixels[pixel].is_finite());
    }
}

/// An opaque isosurface alone, white.
fn opaque(pipeline: &Pipeline, share: f64, normals: Normals) -> FrameRequest {
    let mut request = request(pipeline, 2, 0, normals);
    let [lo, hi] = pipeline.field().range.unwrap().map(f64::from);
    let surface = Isosurface { front: Some([1.0; 3]), ..Isosurface::new(lo + share * (hi - lo)) };
    request.size_px = (160, 120);
    request.with_tets(|tets| (tets.surfaces, tets.cuts) = (vec![surface], Vec::new()))
}

#[test]
fn normals_of_the_screen_are_those_of_the_cells_where_neighbours_see_the_same_facet() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 1500);
    let [by_screen, by_cell] = [Normals::Screen, Normals::Cell].map(|normals| opaque(&pipeline, 0.4, normals));
    let [by_screen, by_cell] = [by_screen, by_cell].map(|request| planes(&mut pipeline, &request, TetDraw::Raycast));
    assert_eq!((&by_screen.depth, &by_screen.id), (&by_cell.depth, &by_cell.id));
    let (mut compared, mut most) = (0, 0.0_f32);
    let normal = &by_cell.normal.pixels;
    for row in 1..119 {
        for column in 1..159 {
            let at = row * 160 + column;
            let around = [at - 1, at + 1, at - 160, at + 160];
            if by_cell.id.pixels[at] == 0 || around.iter().any(|n| normal[*n] != normal[at]) {
                continue;
            }
            let cosine: f32 = normal[at].iter().zip(by_screen.normal.pixels[at]).map(|(a, b)| a * b).sum();
            most = most.max((1.0 - cosine).abs());
            compared += 1;
            let light = by_screen.color.pixels[at][0] - by_cell.color.pixels[at][0];
            assert!(light.abs() < 2e-2, "{light}");
        }
    }
    // A difference of two depths of 2^-24 each over two pixels, of some hundredth of the distance: 2e-3 of a right angle at worst.
    assert!(compared > 200 && most < 1e-3, "{compared} pixels, {most}");
    // The smooth ones are another thing.
    let smooth = opaque(&pipeline, 0.4, Normals::Vertex);
    let smooth = planes(&mut pipeline, &smooth, TetDraw::Raycast);
    assert!(difference(&smooth.color, &by_screen.color).0 > 1e-3);
}

#[test]
fn what_is_far_is_darker_by_depth_and_what_is_in_a_corner_by_occlusion() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 6000);
    let by_depth = opaque(&pipeline, 0.4, Normals::Depth);
    let by_depth = planes(&mut pipeline, &by_depth, TetDraw::Raycast);
    let mut seen: Vec<(f32, f32)> =
        by_depth.depth.pixels.iter().zip(&by_depth.color.pixels).map(|(d, c)| (*d, c[0])).collect();
    seen.retain(|(depth, _)| depth.is_finite());
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(seen.len() > 500 && seen.windows(2).all(|pair| pair[0].1 >= pair[1].1 - 1e-6));
    assert!(seen[0].1 - seen[seen.len() - 1].1 > 0.05);
    let plain = opaque(&pipeline, 0.4, Normals::Cell);
    let occluded = plain.clone().with_tets(|tets| tets.shading.ambient_occlusion = true);
    let [plain, occluded] = [plain, occluded].map(|request| planes(&mut pipeline, &request, TetDraw::Raycast));
    let darker = plain.color.pixels.iter().zip(&occluded.color.pixels).filter(|(a, b)| b[0] < 0.95 * a[0]).count();
    assert!(darker > 50, "{darker} pixels are darker");
    assert!(plain.color.pixels.iter().zip(&occluded.color.pixels).all(|(a, b)| b[0] <= a[0] && a[3] == b[3]));
    // On a plane nothing is hidden.
    let flat = |occlusion: bool| {
        let request = opaque(&pipeline, 0.4, Normals::Cell).with_tets(|tets| {
            let middle = pipeline.mesh().positions.world_bounds();
            let middle = 0.5 * (middle.0 + middle.1);
            tets.cuts = vec![Cut { point: middle.to_array(), normal: [0.0, 0.0, 1.0], clips: false, by: None }];
            (tets.shading.ambient_occlusion, tets.surfaces) = (occlusion, Vec::new());
        });
        FrameRequest { guides: false, ..request }
    };
    let [plain, occluded] = [false, true].map(flat);
    let [plain, occluded] = [plain, occluded].map(|request| planes(&mut pipeline, &request, TetDraw::Raycast));
    assert!(difference(&plain.color, &occluded.color).1 < 1e-6);
}

#[test]
fn no_light_that_is_found_on_the_image_falls_on_sections() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 6000);
    let [plain, screen, depth, occluded] =
        [(Normals::None, false), (Normals::Screen, false), (Normals::Depth, false), (Normals::None, true)].map(
            |(normals, occlusion)| {
                let request = request(&pipeline, 2, 0, normals);
                let request = request.with_tets(|tets| tets.shading.ambient_occlusion = occlusion);
                planes(&mut pipeline, &request, TetDraw::Raycast)
            },
        );
    for lit in [&screen, &depth, &occluded] {
        let mut changed = [0, 0];
        for (pixel, id) in plain.id.pixels.iter().enumerate().filter(|(_, id)| **id != 0) {
            changed[usize::from(*id == 3)] += usize::from(plain.color.pixels[pixel] != lit.color.pixels[pixel]);
        }
        assert!(changed[0] > 20 && changed[1] == 0, "{changed:?}");
    }
}

#[test]
fn smoothing_closes_holes_where_faces_are_left_out_and_does_nothing_where_none_are() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 60_000);
    let at = |lod: f64, smooth: bool| {
        let faces = TetDraw::Faces(FaceDetail { lod, sampling: Sampling::Error, ..FaceDetail::default() });
        opaque(&pipeline, 0.4, Normals::Screen).with_tets(|tets| {
            tets.shading.smooth = smooth;
            tets.draw = faces;
        })
    };
    let requests = [1.0, 0.5, 0.25, 0.1].map(|lod| [false, true].map(|smooth| at(lod, smooth)));
    let found = requests.map(|pair| pair.map(|request| pipeline.render(&request).unwrap().planes.clone()));
    let whole = found[0][0].clone();
    assert!(found[0][0] == found[0][1], "all faces are there");
    for (pair, lod) in found.iter().zip([100, 50, 25, 10]) {
        let [(holes, angle), (closed, smoothed)] = [0, 1].map(|i| {
            let holes = whole.id.pixels.iter().zip(&pair[i].id.pixels).filter(|(a, b)| **a != 0 && **b == 0).count();
            (holes, compare_normals(&pair[i].normal, &whole.normal).unwrap().rmse)
        });
        eprintln!("{lod} %: {holes} holes and {angle:.1} degrees, smoothed {closed} and {smoothed:.1}");
        assert!(closed <= holes && (lod == 100 || smoothed != angle), "{lod} %");
    }
}

/// Figure 6.4 of the dissertation, lower row: an isosurface of the torso at four levels of detail, light from depths of neighbours. Normals are
/// compared with those of all faces, and with smooth ones of all cells.
#[test]
fn an_isosurface_of_the_torso_has_fewer_holes_at_low_levels_of_detail_if_depths_are_smoothed() {
    let Some(dir) = samples() else { return };
    let (_out, mut pipeline) = sample(&dir, ("torso_dipole/torso_dipole.xdmf", "potential", "10..210:100"));
    let request = |draw: TetDraw, normals: Normals, smooth: bool, pipeline: &Pipeline| {
        let request = opaque(pipeline, 0.5, normals);
        let camera = request.camera.zoom(2.0).unwrap();
        FrameRequest { camera, size_px: (320, 240), ..request }.with_tets(|tets| {
            tets.shading.smooth = smooth;
            tets.draw = draw;
        })
    };
    let faces =
        |lod: f64| TetDraw::Faces(FaceDetail { lod, sampling: "global".parse().unwrap(), ..FaceDetail::default() });
    let whole = pipeline.render(&request(faces(1.0), Normals::Screen, true, &pipeline)).unwrap().planes.clone();
    let rounded = pipeline.render(&request(TetDraw::Raycast, Normals::Vertex, true, &pipeline)).unwrap().planes.clone();
    let mut all_holes = [0, 0];
    for (lod, percent) in [(1.0, 100), (0.5, 50), (0.25, 25), (0.1, 10)] {
        let found = [false, true].map(|smooth| {
            let found = &pipeline.render(&request(faces(lod), Normals::Screen, smooth, &pipeline)).unwrap().planes;
            let holes = whole.id.pixels.iter().zip(&found.id.pixels).filter(|(a, b)| **a != 0 && **b == 0).count();
            let angle = |to: &Planes| compare_normals(&found.normal, &to.normal).unwrap().rmse;
            (holes, angle(&whole), angle(&rounded))
        });
        let [(holes, flat, round), (closed, smoothed_flat, smoothed_round)] = found;
        eprintln!(
            "torso, {percent} %: {holes} holes, {flat:.1} degrees from facets, {round:.1} from smooth normals; with the \
             smoothing pass {closed}, {smoothed_flat:.1}, {smoothed_round:.1}"
        );
        assert!(closed <= holes && (percent < 100 || found[0] == found[1] && holes == 0), "{percent} %");
        (all_holes[0], all_holes[1]) = (all_holes[0] + holes, all_holes[1] + closed);
    }
    assert!(all_holes[1] < all_holes[0], "{all_holes:?}");
}

#[test]
fn light_of_the_image_needs_all_of_it() {
    let temp = tempfile::tempdir().unwrap();
    let mut pipeline = jet(temp.path(), 2000);
    let samples = SampleSet::Lattice { stride_px: NonZeroUsize::new(3).unwrap() };
    for (normals, occlusion) in [(Normals::Screen, false), (Normals::Depth, false), (Normals::Cell, true)] {
        let request = opaque(&pipeline, 0.4, normals).with_tets(|tets| tets.shading.ambient_occlusion = occlusion);
        let refused = pipeline.render(&FrameRequest { samples: samples.clone(), ..request }).unwrap_err();
        assert!(refused.to_string().contains("need the rays of all pixels"), "{refused}");
    }
    let cells = FrameRequest { samples, guides: true, ..opaque(&pipeline, 0.4, Normals::Cell) };
    assert_eq!(planes(&mut pipeline, &cells, TetDraw::Raycast).id.width, 54);
    // What is found on the image has a time of its own.
    assert!(pipeline.render(&cells).unwrap().stats.ms_guides > 0.0);
    let without = FrameRequest { guides: false, ..cells };
    assert_eq!(pipeline.render(&without).unwrap().stats.ms_guides, 0.0);
}
