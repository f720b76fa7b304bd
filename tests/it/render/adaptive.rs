//! Contrast-adaptive sampling: rays that are cast have the bits of the whole image, however the work is cut.

use super::lattice::scenes;
use super::*;
use crate::common::samples;
use crate::meshes::{build, grid, sample};
use crate::series::{cameras, table_for};
use crate::skipping::{SAMPLES, sample as sample_series};
use std::num::NonZeroUsize;
use std::time::Duration;
use tetreel::camera::{Lattice, Samples};
use tetreel::image::Planes;
use tetreel::mesh::RawMesh;
use tetreel::pipeline::{Backend, FrameRequest, SampleSet, TetDraw};
use tetreel::render::{Advance, Frame, LayerFragment, LayerFragments};
use tetreel::visibility::CellSet;

fn with_contrast(job: &RenderJob, contrast: f32) -> RenderJob {
    RenderJob { contrast: Some(contrast.try_into().unwrap()), ..job.clone() }
}

/// In as many slices as there are tiles.
fn in_slices(renderer: &mut Raycast, job: &RenderJob) -> Frame {
    renderer.begin(job.clone()).unwrap();
    loop {
        if let Advance::Done(frame) = renderer.advance(Duration::ZERO).unwrap() {
            return frame.clone();
        }
    }
}

/// Pixels of two images with the same bits.
fn same(a: &Planes, b: &Planes) -> u64 {
    let colors = a.color.pixels.iter().zip(&b.color.pixels).map(|(a, b)| a == b);
    let depths = a.depth.pixels.iter().zip(&b.depth.pixels).map(|(a, b)| a == b);
    colors.zip(depths).filter(|(color, depth)| *color && *depth).count() as u64
}

/// Whether all planes are the same.
fn is_same(a: &Planes, b: &Planes) -> bool {
    a == b
}

/// All planes, with one ray off by its last bit, somewhere in the middle.
fn planes_off(planes: &Planes) -> Planes {
    Planes { color: one_ray_off(&planes.color, planes.color.pixels.len() / 2), ..planes.clone() }
}

#[test]
fn without_contrast_the_image_is_the_whole_one() {
    for (name, job) in scenes() {
        let exact = Raycast::new().render(job.clone()).unwrap().clone();
        let whole = exact.planes;
        let at_zero = Raycast::new().render(with_contrast(&job, 0.0)).unwrap().clone();
        assert!(is_same(&at_zero.planes, &whole), "{name}");
        assert!(!is_same(&planes_off(&at_zero.planes), &whole), "{name}: one ray is noticed");
        // All rays are of one stride, with contrast or without; of a lattice, its own.
        let all = [0, 0, 0, whole.color.pixels.len() as u64];
        assert_eq!([exact.stats.rays_by_level, at_zero.stats.rays_by_level], [all; 2], "{name}");
        let mut some = job.clone();
        some.view.samples = Samples::Lattice(Lattice::new(NonZeroUsize::new(4).unwrap()));
        let some = Raycast::new().render(some).unwrap().clone();
        assert_eq!(some.stats.rays_by_level, [0, 0, 0, some.planes.color.pixels.len() as u64], "{name}");
        // The least there is casts rays wherever something is to be seen.
        let frame = Raycast::new().render(with_contrast(&job, f32::MIN_POSITIVE)).unwrap().clone();
        let rays: u64 = frame.stats.rays_by_level.iter().sum();
        assert!(same(&frame.planes, &whole) >= rays, "{name}");
        assert_eq!(same(&planes_off(&frame.planes), &frame.planes) + 1, all[3], "{name}: one ray is noticed");
        assert!(frame.stats.rays_by_level[3] > 0, "{name}");
    }
}

#[test]
fn sampled_pixels_have_their_bits_and_no_frame_depends_on_how_it_was_drawn() {
    let mut left_out = 0;
    for (name, job) in scenes() {
        let whole = Raycast::new().render(job.clone()).unwrap().planes.clone();
        for contrast in [0.01, 0.1, 1.0] {
            let job = with_contrast(&job, contrast);
            let mut renderer = Raycast::new();
            let frame = renderer.render(job.clone()).unwrap().clone();
            let rays: u64 = frame.stats.rays_by_level.iter().sum();
            let pixels = whole.color.pixels.len() as u64;
            assert!(rays > 0 && rays <= pixels && same(&frame.planes, &whole) >= rays, "{name}, {contrast}");
            left_out += pixels - rays;
            let (width, height) = (whole.color.width, whole.color.height);
            let coarsest = |at: &usize| (at % width).is_multiple_of(8) && (at / width).is_multiple_of(8);
            let coarsest = || (0..width * height).filter(coarsest);
            assert!(is_same_at(&frame.planes.color, &whole.color, coarsest()), "{name}, {contrast}");
            let off = one_ray_off(&frame.planes.color, coarsest().next_back().unwrap());
            assert!(!is_same_at(&off, &whole.color, coarsest()), "{name}, {contrast}: one ray is noticed");
            let is_frame = |planes: &Planes| is_same(planes, &frame.planes);
            assert!(!is_frame(&planes_off(&frame.planes)), "{name}, {contrast}: one ray is noticed");
            assert!(is_frame(&in_slices(&mut renderer, &job).planes), "{name}, {contrast}, in slices");
            assert!(is_frame(&Raycast::portable().render(job.clone()).unwrap().planes), "{name}, one by one");
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let planes = pool.install(|| Raycast::new().render(job.clone()).unwrap().planes.clone());
                assert!(is_frame(&planes), "{name}, {contrast}, {threads} threads");
            }
            // Another image before, and one that was given up.
            renderer.begin(with_contrast(&job, 0.003)).unwrap();
            let _ = renderer.advance(Duration::ZERO).unwrap();
            assert!(is_frame(&renderer.render(job.clone()).unwrap().planes), "{name}, after another");
        }
    }
    assert!(left_out > 1000, "{left_out} rays were left out");
}

/// What is shown on the way to an image: at each contrast that of a request for it, and in the end the one without.
#[test]
fn previews_are_the_images_of_their_contrasts_and_change_nothing_in_the_end() {
    let contrasts = [0.1, 0.02, 0.02, 0.3, 0.005];
    let mut shown = 0;
    for (name, job) in scenes() {
        for last in [0.0, 0.01] {
            let mut previewed = with_contrast(&job, last);
            let direct = Raycast::new().render(previewed.clone()).unwrap().clone();
            previewed.previews = contrasts.iter().map(|&c: &f32| c.try_into().unwrap()).collect();
            // Contrasts that do not fall, and those below the last one, are no previews.
            let expected = if last == 0.0 { vec![0.1, 0.02, 0.005] } else { vec![0.1, 0.02] };
            let at = |contrast| Raycast::new().render(with_contrast(&job, contrast)).unwrap().planes.clone();
            let mut expected: Vec<Planes> = expected.into_iter().map(at).collect();
            // What no more rays are cast for is shown once.
            expected.push(direct.planes.clone());
            expected.dedup();
            let mut planes = Vec::new();
            let mut renderer = Raycast::new();
            let mut preview = |frame: &Frame, _| planes.push(frame.planes.clone());
            let frame = renderer.render_with_previews(previewed.clone(), &mut preview).unwrap().unwrap().clone();
            assert!(is_same(&frame.planes, &direct.planes), "{name}, {last}");
            assert!(!is_same(&planes_off(&frame.planes), &direct.planes), "{name}, {last}: one ray is noticed");
            shown += planes.len();
            let is_whole_at_once = planes.is_empty();
            planes.push(frame.planes.clone());
            planes.dedup();
            let are_same = |planes: &[Planes]| {
                planes.len() == expected.len() && planes.iter().zip(&expected).all(|(a, b)| is_same(a, b))
            };
            assert!(are_same(&planes), "{name}, {last}: {} previews of {}", planes.len(), expected.len());
            let mut off = planes.clone();
            off[0] = planes_off(&off[0]);
            assert!(!are_same(&off), "{name}, {last}: one ray is noticed");
            let rays: u64 = frame.stats.rays_by_level.iter().sum();
            if last == 0.0 && !is_whole_at_once {
                assert_eq!(rays, frame.planes.color.pixels.len() as u64, "{name}: each ray once");
                assert_eq!((frame.stats.blocks_filled, frame.stats.blocks_split), (0, [0; 5]), "{name}");
            } else if last > 0.0 {
                assert_eq!(frame.stats.blocks_filled, direct.stats.blocks_filled, "{name}");
                assert_eq!(rays, direct.stats.rays_by_level.iter().sum::<u64>(), "{name}");
            }
            let sliced = in_slices(&mut renderer, &previewed);
            assert!(is_same(&sliced.planes, &direct.planes), "{name}, {last}, in slices");
            let one_by_one = Raycast::portable().render(previewed).unwrap().planes.clone();
            assert!(is_same(&one_by_one, &direct.planes), "{name}, one by one");
        }
    }
    assert!(shown > 10, "{shown} previews");
}

#[test]
fn contrast_says_nothing_where_samples_are_named_and_another_mesh_does_not_decide() {
    for (name, job) in scenes() {
        let mut some = job.clone();
        some.view.samples = Samples::Lattice(Lattice::new(NonZeroUsize::new(3).unwrap()));
        let expected = Raycast::new().render(some.clone()).unwrap().planes.clone();
        let found = Raycast::new().render(with_contrast(&some, 0.05)).unwrap().planes.clone();
        assert!(is_same(&found, &expected) && !is_same(&planes_off(&found), &expected), "{name}");
        let wrong = Arc::new(CellSet::all(job.active.universe() + 1));
        assert!(Raycast::new().render(RenderJob { domain: Some(wrong), ..job }).is_err(), "{name}");
    }
}

/// Fragments beside the cells: a line one pixel wide, and half of the image behind a pane.
fn with_layers(job: &RenderJob) -> RenderJob {
    let (width, height) = (job.view.width_px, job.view.height_px);
    let line = |pixel: usize| 3 * (pixel % width) + 5 == 2 * (pixel / width) + width;
    let fragment = |depth: f64, light: f32| LayerFragment { depth, rgba: [light, 0.2 * light, 0.0, light] };
    let lines = (0..width * height).filter(|&pixel| line(pixel)).map(|pixel| (pixel as u32, fragment(4.0, 0.5)));
    let behind_pane = (0..width * height).filter(|pixel| pixel % width > width / 2);
    let pane = behind_pane.map(|pixel| (pixel as u32, fragment(1.0, 0.01)));
    let fragments = LayerFragments::new(width * height, lines.chain(pane)).unwrap();
    RenderJob { fragments: Some(Arc::new(fragments)), ..job.clone() }
}

/// The largest threshold hides neither lines nor ends of layers, and casts few rays else.
#[test]
fn pixels_where_layers_begin_and_end_are_those_of_the_whole_image() {
    let (mut left_out, mut lines) = (0, 0);
    for (name, job) in scenes() {
        let (width, height) = (job.view.width_px, job.view.height_px);
        let without = Raycast::new().render(job.clone()).unwrap().planes.clone();
        let job = with_layers(&job);
        let whole = Raycast::new().render(job.clone()).unwrap().planes.clone();
        assert!(is_same(&Raycast::new().render(with_contrast(&job, 0.0)).unwrap().planes, &whole), "{name}");
        let job = with_contrast(&job, 1.0);
        let mut renderer = Raycast::new();
        let frame = renderer.render(job.clone()).unwrap().clone();
        let is_frame = |planes: &Planes| is_same(planes, &frame.planes);
        assert!(is_frame(&in_slices(&mut renderer, &job).planes), "{name}, in slices");
        assert!(is_frame(&Raycast::portable().render(job.clone()).unwrap().planes), "{name}, one by one");
        assert!(!is_frame(&planes_off(&frame.planes)), "{name}: one ray is noticed");
        let fragments = job.fragments.as_ref().unwrap();
        let count = |pixel: usize| fragments.of_pixel(pixel).len();
        let ends = |pixel: &usize| pixel % width + 1 < width && count(*pixel) != count(pixel + 1);
        let ends: Vec<usize> = (0..width * height).filter(ends).collect();
        let beside = || ends.iter().flat_map(|&pixel| [pixel, pixel + 1]);
        assert!(is_same_at(&frame.planes.color, &whole.color, beside()), "{name}");
        let off = one_ray_off(&frame.planes.color, beside().last().unwrap());
        assert!(!is_same_at(&off, &whole.color, beside()), "{name}: one ray is noticed");
        lines += ends.iter().filter(|&&pixel| whole.color.pixels[pixel] != without.color.pixels[pixel]).count();
        let rays: u64 = frame.stats.rays_by_level.iter().sum();
        left_out += if rays > 0 { (width * height) as u64 - rays } else { 0 };
        assert!(rays == 0 || width < 9 || height < 9 || frame.stats.blocks_split[4] > 0, "{name}: {:?}", frame.stats);
    }
    assert!(left_out > 1000 && lines > 100, "{left_out} rays left out, {lines} ends seen");
}

/// A tet around a place, of twice this size in each direction: along z it is a square.
fn tet_around(place: DVec3, half_size: f64) -> [DVec3; 4] {
    [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)]
        .map(|corner| place + half_size * corner)
}

/// A part far from the other one that is smaller than a pixel, at all pixels of a block of the coarsest rays and places in them.
#[test]
fn a_part_of_one_pixel_with_nothing_before_or_behind_it_is_never_missed() {
    const SIZE: (usize, usize) = (81, 41);
    const OFF_CENTRE: [[f64; 2]; 4] = [[0.0, 0.0], [-0.4, 0.3], [0.42, 0.42], [0.1, -0.44]];
    let pixel = 2.0 / SIZE.1 as f64;
    // At a distance of 10, both see the same.
    let view_angle = 2.0 * 0.1f64.atan().to_degrees();
    let projections = [Projection::Parallel { scale: 1.0 }, Projection::Perspective { view_angle }];
    let (mut renderer, mut between_rays) = (Raycast::new(), 0);
    for (column, row) in (16..24).flat_map(|row| (40..48).map(move |column| (column, row))) {
        for ([right, down], projection) in OFF_CENTRE.into_iter().flat_map(|off| projections.map(|of| (off, of))) {
            let x = (column as f64 + 0.5 + right - 0.5 * SIZE.0 as f64) * pixel;
            let y = (0.5 * SIZE.1 as f64 - row as f64 - 0.5 - down) * pixel;
            let small = tet_around(DVec3::new(x, y, 0.0), 0.45 * pixel);
            let points = [tet_around(DVec3::new(-1.4, 0.0, 0.0), 0.4), small].concat();
            let mesh = Arc::new(build(RawMesh { points, cells: vec![[0, 1, 2, 3], [4, 5, 6, 7]].into() }));
            let scalars = vec![0.5; mesh.positions.local.len()];
            let table = table(&[(0.0, [1.0, 0.6, 0.2], 40.0), (1.0, [1.0, 0.6, 0.2], 40.0)]);
            let job = job(&mesh, scalars, &camera(DVec3::new(0.0, 0.0, 10.0), projection), SIZE, table);
            let whole = renderer.render(job.clone()).unwrap().planes.clone();
            let name = format!("{column}, {row} and {right}, {down}, {projection:?}");
            let right_half = (0..SIZE.0 * SIZE.1).filter(|at| at % SIZE.0 > SIZE.0 / 2 - 8);
            let seen: Vec<usize> = right_half.clone().filter(|&at| whole.color.pixels[at][3] > 0.0).collect();
            assert_eq!(seen, [row * SIZE.0 + column], "{name}");
            for contrast in [0.05, 1.0] {
                let frame = renderer.render(with_contrast(&job, contrast)).unwrap();
                assert!(is_same_at(&frame.planes.color, &whole.color, right_half.clone()), "{name}, {contrast}");
                assert_eq!(frame.planes.depth.pixels[seen[0]], whole.depth.pixels[seen[0]], "{name}, {contrast}");
                let off = one_ray_off(&frame.planes.color, seen[0]);
                assert!(!is_same_at(&off, &whole.color, right_half.clone()), "{name}, {contrast}: noticed");
                let [coarsest, .., last] = frame.stats.rays_by_level;
                assert!(coarsest == 11 * 6 && last < (SIZE.0 * SIZE.1 / 4) as u64, "{name}, {contrast}");
                between_rays += usize::from(frame.stats.blocks_split[2] > 0);
            }
        }
    }
    assert!(between_rays > 900, "{between_rays} images in which the part lies between rays");
}

/// What is not sampled lies between what is: on these scenes the largest error stays below twice the threshold.
#[test]
fn errors_stay_near_the_contrast() {
    let mesh = Arc::new(build(grid(10, 0.15, 4, |_| true)));
    let scalars = sample(&mesh, wave);
    for position in [DVec3::new(3.0, 2.0, 2.5), DVec3::new(-1.0, 4.0, 0.5)] {
        let camera = camera(position, Projection::Perspective { view_angle: 35.0 });
        let job = job(&mesh, scalars.clone(), &camera, (130, 70), dense());
        let whole = Raycast::new().render(job.clone()).unwrap().planes.clone();
        for contrast in [0.02, 0.05, 0.1] {
            let frame = Raycast::new().render(with_contrast(&job, contrast)).unwrap().clone();
            let (rmse, max) = difference(&frame.planes.color, &whole.color);
            let share = frame.stats.rays_by_level.iter().sum::<u64>() as f64 / (130.0 * 70.0);
            assert!(max <= f64::from(2.0 * contrast) && share < 1.0, "{contrast}: {rmse:.1e}, {max:.1e}, {share}");
        }
        let coarse = Raycast::new().render(with_contrast(&job, 1.0)).unwrap().planes.clone();
        assert!(difference(&coarse.color, &whole.color).1 > 0.2, "the bound can be missed");
    }
}

/// Real series, seen from two sides: the largest error stays below twice the contrast in most images, and which ones it does
/// not is printed.
#[test]
fn errors_of_real_series_stay_below_twice_the_contrast_in_most_images() {
    const CONTRASTS: [f32; 5] = [0.01, 0.02, 0.05, 0.1, 0.2];
    const FUNCTIONS: [&str; 3] =
        ["viridis@0:0.01,1:0.1", "viridis@0:0.9,1:1", "inferno@0:0,0.6:0,0.7:0.1,0.75:0,0.85:0,0.95:0.3,1:0.3"];
    let Some(dir) = samples() else { return };
    let (mut images, mut beyond, mut worst, mut coarse) = (0, 0, 0.0f64, 0);
    for of in SAMPLES {
        let (_out, mut pipeline) = sample_series(&dir, of);
        for tf in FUNCTIONS {
            let table = table_for(&pipeline, tf);
            for camera in &cameras(pipeline.mesh().positions.world_bounds())[..2] {
                let exact = FrameRequest::new(0, *camera, table.clone(), (480, 400));
                let exact = FrameRequest { backend: Backend::Cpu, ..exact.with_draw(TetDraw::Raycast) };
                let whole = pipeline.render(&exact).unwrap().planes.clone();
                let mut error = |contrast: f32| {
                    let samples = SampleSet::Adaptive { contrast: contrast.try_into().unwrap() };
                    let request = FrameRequest { samples, ..exact.clone() };
                    difference(&pipeline.render(&request).unwrap().planes.color, &whole.color)
                };
                for contrast in CONTRASTS {
                    let (rmse, max) = error(contrast);
                    let share = max / f64::from(contrast);
                    (images, worst) = (images + 1, worst.max(share));
                    if share > 2.0 {
                        beyond += 1;
                        println!("{of:?}, {tf}: {share:.2} times a contrast of {contrast}, RMSE {rmse:.1e}");
                    }
                }
                coarse += usize::from(error(1.0).1 > 0.4);
            }
        }
    }
    println!("{beyond} of {images} images beyond twice the contrast, at most {worst:.2} times");
    assert_eq!(images, 5 * 2 * 3 * SAMPLES.len());
    assert!(20 * beyond <= images, "{beyond} of {images}");
    assert!(coarse > 0, "no image is beyond twice the largest of the contrasts without it");
}
