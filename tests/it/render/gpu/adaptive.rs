//! Contrast-adaptive sampling on the GPU: against all rays, and against the CPU.

use super::super::lattice::scenes;
use super::*;
use std::time::Duration;
use tetreel::image::Planes;
use tetreel::mesh::RawMesh;
use tetreel::render::Advance;
use tetreel::render::gpu::context::Tier;
use tetreel::visibility::CellSet;

fn with_contrast(job: &RenderJob, contrast: f32) -> RenderJob {
    RenderJob { contrast: Some(contrast.try_into().unwrap()), ..job.clone() }
}

fn frame_of(context: &Arc<Context>, job: &RenderJob) -> Frame {
    GpuRaycast::new(context.clone()).render(job.clone()).unwrap().clone()
}

fn cpu(job: &RenderJob) -> Frame {
    Raycast::new().render(job.clone()).unwrap().clone()
}

fn rays(frame: &Frame) -> u64 {
    frame.stats.rays_by_level.iter().sum()
}

/// Advances in the smallest steps.
fn in_slices(renderer: &mut GpuRaycast, job: &RenderJob) -> Frame {
    renderer.begin(job.clone()).unwrap();
    loop {
        if let Advance::Done(frame) = renderer.advance(Duration::ZERO).unwrap() {
            return frame.clone();
        }
    }
}

#[test]
fn without_contrast_the_image_is_the_whole_one() {
    for (name, job) in scenes() {
        let Some(whole) = render(&job) else { return };
        let at_zero = render(&with_contrast(&job, 0.0)).unwrap();
        assert!(at_zero.planes == whole.planes, "{name}");
        let all = [0, 0, 0, whole.planes.color.pixels.len() as u64];
        assert_eq!([whole.stats.rays_by_level, at_zero.stats.rays_by_level], [all; 2], "{name}");
        // The least there is casts rays wherever something is to be seen: the list is another shader than the tiles, with the same lines.
        let frame = render(&with_contrast(&job, f32::MIN_POSITIVE)).unwrap();
        let (rmse, max) = difference(&frame.planes.color, &whole.planes.color);
        assert!(rmse <= 1e-6 && frame.stats.rays_by_level[3] > 0, "{name}: {rmse:.1e}, {max:.1e}");
        assert_eq!(frame.stats.broken_paths, 0, "{name}");
    }
}

#[test]
fn no_frame_depends_on_how_it_was_drawn_and_the_cpu_draws_the_same() {
    let (mut left_out, mut equal, mut others) = (0, 0, 0);
    for (name, job) in scenes() {
        for contrast in [0.01, 0.1, 1.0] {
            let job = with_contrast(&job, contrast);
            let Some(frame) = render(&job) else { return };
            let pixels = frame.planes.color.pixels.len() as u64;
            assert!(frame.stats.on_gpu && rays(&frame) > 0 && rays(&frame) <= pixels, "{name}, {contrast}");
            left_out += pixels - rays(&frame);
            let mut renderer = GpuRaycast::new(context().unwrap());
            let sliced = in_slices(&mut renderer, &job);
            assert!(sliced.planes == frame.planes, "{name}, {contrast}, in slices");
            let counts = |f: &Frame| (f.stats.steps, f.stats.rays_hit, f.stats.rays_by_level, f.stats.blocks_split);
            assert_eq!(counts(&sliced), counts(&frame), "{name}, {contrast}");
            // Another image before, and one that was given up.
            renderer.begin(with_contrast(&job, 0.003)).unwrap();
            let _ = renderer.advance(Duration::ZERO).unwrap();
            assert!(renderer.render(job.clone()).unwrap().planes == frame.planes, "{name}, after another");
            // Where rounding decides nothing, the same rays have been cast, and others at few places.
            let on_cpu = cpu(&job);
            let (rmse, max) = difference(&frame.planes.color, &on_cpu.planes.color);
            let counts = |f: &Frame| (f.stats.rays_by_level, f.stats.blocks_split, f.stats.blocks_filled);
            if counts(&frame) == counts(&on_cpu) {
                assert_within(&format!("{name}, {contrast}"), &frame.planes.color, &on_cpu.planes.color);
                equal += 1;
            } else {
                assert!(
                    rays(&frame).abs_diff(rays(&on_cpu)) * 50 <= pixels,
                    "{name}, {contrast}: {rmse:.1e}, {max:.1e}"
                );
                others += 1;
            }
        }
    }
    assert!(left_out > 1000, "{left_out} rays were left out");
    assert!(equal >= 4 * others, "{equal} frames of the same rays, {others} of others");
}

#[test]
fn images_of_any_size_nothing_in_view_and_no_cells_are_as_on_the_cpu() {
    if context().is_none() {
        return;
    }
    let mesh = Arc::new(build(grid(4, 0.15, 4, |c| c.length() > 0.3)));
    let scalars = sample(&mesh, wave);
    let outside = camera(DVec3::new(3.0, 2.0, 2.5), Projection::Perspective { view_angle: 35.0 });
    let mut others = 0;
    for size in [(1, 1), (2, 2), (1, 30), (30, 1), (8, 8), (9, 9), (7, 5), (17, 16), (16, 33), (100, 3), (121, 95)] {
        let job = with_contrast(&job(&mesh, scalars.clone(), &outside, size, dense()), 0.05);
        let (found, expected) = (render(&job).unwrap(), cpu(&job));
        // Boxes of faces are a little wider on the GPU, which may split a block more.
        let more = rays(&found).checked_sub(rays(&expected));
        assert!(more.is_some_and(|more| more * 50 <= (size.0 * size.1) as u64), "{size:?}: {more:?} rays more");
        if more != Some(0) {
            others += 1;
            continue;
        }
        assert_eq!(found.stats.rays_by_level, expected.stats.rays_by_level, "{size:?}");
        assert_within(&format!("{size:?}"), &found.planes.color, &expected.planes.color);
        let depths = found.planes.depth.pixels.iter().zip(&expected.planes.depth.pixels);
        // Of f32 depths around 4, after a walk in f32.
        let is_off = |(a, b): &(&f32, &f32)| a != b && (**a - **b).abs() > 1e-5;
        assert_eq!(depths.filter(is_off).count(), 0, "{size:?}");
    }
    assert!(others <= 2, "{others} images of other rays");
    // All rays miss: the coarsest rays, and nothing else.
    let away = Camera { focal_point: DVec3::new(6.0, 4.0, 5.0), ..outside };
    let missed = with_contrast(&job(&mesh, scalars.clone(), &away, (60, 40), dense()), 0.05);
    let (found, expected) = (render(&missed).unwrap(), cpu(&missed));
    assert_eq!((found.stats.rays_by_level, found.stats.rays_hit), ([9 * 6, 0, 0, 0], 0));
    assert_eq!(expected.stats.rays_by_level, found.stats.rays_by_level);
    assert!(found.planes == expected.planes);
    // No cells, or none that decide.
    let seen = with_contrast(&job(&mesh, scalars, &outside, (60, 40), dense()), 0.05);
    let none = Arc::new(CellSet::none(seen.active.universe()));
    let empty = RenderJob { active: none.clone(), ..seen.clone() };
    assert!(render(&empty).unwrap().planes == cpu(&empty).planes);
    let domain = render(&RenderJob { domain: Some(none), ..seen }).unwrap();
    assert!(domain.planes.color.pixels.iter().all(|p| *p == [0.0; 4]));
}

/// Three tets behind each other whose faces fill the image: twelve faces, of which three are in every tile.
fn layers(size: (usize, usize)) -> RenderJob {
    let mut raw = RawMesh::default();
    for z in [-0.5, 0.1, 0.7] {
        let first = raw.points.len() as u32;
        raw.points.extend([[-3.0, -3.0, z], [3.0, -3.0, z], [0.0, 3.0, z], [0.0, 0.0, z - 0.4]].map(DVec3::from_array));
        raw.cells.tets.push([first, first + 1, first + 2, first + 3]);
    }
    let mesh = Arc::new(build(raw));
    job(&mesh, sample(&mesh, wave), &camera(DVec3::new(0.12, 0.07, 4.0), PERSPECTIVE), size, dense())
}

#[test]
fn lists_of_entries_that_are_too_short_are_made_longer_and_rays_cast_again() {
    let Some(context) = context() else { return };
    let job = with_contrast(&layers((256, 256)), 0.02);
    for slices in [false, true] {
        let mut renderer = GpuRaycast::new(context.clone());
        let mut draw = |job: &RenderJob| {
            if slices { in_slices(&mut renderer, job) } else { renderer.render(job.clone()).unwrap().clone() }
        };
        let first = draw(&job);
        assert!(first.stats.entry_retries > 0, "the lists were long enough: nothing tested");
        let second = draw(&job);
        assert_eq!(second.stats.entry_retries, 0, "the room stays");
        assert!(first.planes == second.planes);
        assert_eq!((first.stats.steps, rays(&first)), (second.stats.steps, rays(&second)));
        let (_, max) = difference(&first.planes.color, &cpu(&job).planes.color);
        assert!(max <= 0.02 && rays(&first) < 256 * 256, "{max:.1e}");
    }
}

#[test]
fn the_limits_of_webgpu_are_enough_and_records_may_be_in_parts() {
    let Some(context) = context() else { return };
    let web = own_context(&ContextOptions { tier: Tier::WebGpu, ..Default::default() }).unwrap();
    let split = own_context(&ContextOptions { binding_bytes: Some(1 << 14), ..Default::default() }).unwrap();
    for (name, job) in scenes().into_iter().filter(|(name, _)| ["formula", "joint"].contains(name)) {
        let job = with_contrast(&job, 0.05);
        let whole = frame_of(&context, &job);
        assert!(whole.planes.color.pixels.iter().any(|p| p[3] > 0.1), "{name}");
        assert!(frame_of(&web, &job).planes == whole.planes, "{name}");
        match GpuRaycast::new(split.clone()).render(job) {
            Ok(frame) => assert!(frame.planes == whole.planes, "{name}, in parts"),
            // Not all fits so small a binding.
            Err(refused) => assert!(refused.to_string().contains("bytes"), "{name}: {refused}"),
        }
    }
}

#[test]
fn steady_frames_make_no_resources_and_images_of_all_rays_come_between() {
    let Some(context) = own_context(&ContextOptions::default()) else { return };
    let (_, base) = scenes().swap_remove(0);
    let job = with_contrast(&base, 0.05);
    let mut renderer = GpuRaycast::new(context.clone());
    let expected = [in_slices(&mut renderer, &job), in_slices(&mut renderer, &base)];
    renderer.render(job.clone()).unwrap();
    let before = context.resources_created();
    for i in 0..6 {
        let found = renderer.render([&job, &base][i % 2].clone()).unwrap();
        assert!(found.planes == expected[i % 2].planes, "frame {i}");
    }
    assert_eq!(context.resources_created(), before);
    let mut larger = job.clone();
    larger.view.width_px += 16;
    renderer.render(larger).unwrap();
    assert!(context.resources_created() > before);
    // Of another size and all rays: what was for the list is freed, and made again.
    renderer.render(base).unwrap();
    assert!(renderer.render(job).unwrap().planes == expected[0].planes);
}

/// What is shown on the way to an image: at each contrast that of a job for it, and in the end the one without.
#[test]
fn previews_are_the_images_of_their_contrasts_and_change_nothing_in_the_end() {
    let mut shown = 0;
    for (name, job) in scenes() {
        for last in [0.0, 0.01] {
            let mut previewed = with_contrast(&job, last);
            let Some(direct) = render(&previewed) else { return };
            previewed.previews = [0.1, 0.02, 0.02, 0.3, 0.005].map(|c: f32| c.try_into().unwrap()).to_vec();
            let expected = if last == 0.0 { vec![0.1, 0.02, 0.005] } else { vec![0.1, 0.02] };
            let expected: Vec<Planes> =
                expected.into_iter().map(|c| render(&with_contrast(&job, c)).unwrap().planes).collect();
            let mut planes = Vec::new();
            let mut renderer = GpuRaycast::new(context().unwrap());
            let mut preview = |frame: &Frame, _| planes.push(frame.planes.clone());
            let frame = renderer.render_with_previews(previewed.clone(), &mut preview).unwrap().unwrap().clone();
            assert!(frame.planes == direct.planes, "{name}, {last}");
            assert!(planes == expected, "{name}, {last}: {} previews", planes.len());
            shown += planes.len();
            let counts = |f: &Frame| (rays(f), f.stats.blocks_split, f.stats.blocks_filled);
            assert_eq!(counts(&frame), counts(&direct), "{name}, {last}");
            assert!(in_slices(&mut renderer, &previewed).planes == direct.planes, "{name}, {last}, in slices");
        }
    }
    assert!(shown > 10, "{shown} previews");
}
