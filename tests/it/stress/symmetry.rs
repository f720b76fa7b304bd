//! What an image does not depend on: the number of threads, left and right, where tiles and bands end.

use super::cameras::oblique;
use super::*;
use crate::meshes::{build, grid, sample};
use crate::render::{difference, reference};
use glam::DVec3;
use tetreel::image::RgbaImage;

/// A mesh with a hole seen obliquely, over several tiles in both directions.
fn case() -> Case {
    let mesh = Arc::new(build(grid(8, 0.16, 1, |c| c.length() > 0.4)));
    Case { cameras: oblique(), size: (83, 67), ..Case::new("hole", &mesh, sample(&mesh, wave), dense()) }
}

#[test]
fn any_number_of_threads_draws_the_same_bits() {
    let jobs = case().jobs();
    let images = || -> Vec<Frame> {
        let on_cpu = paths().into_iter().filter(|path| !path.on_gpu);
        on_cpu.flat_map(|path| jobs.iter().map(move |job| (path.render)(job).unwrap())).collect()
    };
    let judged = || -> Vec<RgbaImage> { jobs.iter().map(reference).collect() };
    let (expected, expected_judged) = (images(), judged());
    assert!(expected_judged.iter().all(|image| image.pixels.iter().any(|p| p[3] > 0.0)), "empty images prove nothing");
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        for (frame, expected) in pool.install(images).iter().zip(&expected) {
            assert_eq!(
                (&frame.planes.color, &frame.planes.depth),
                (&expected.planes.color, &expected.planes.depth),
                "{threads} threads"
            );
        }
        assert_eq!(pool.install(judged), expected_judged, "{threads} threads");
    }
}

/// The job in a mirror at x = 0.
fn mirrored(job: &RenderJob, scalars_at: impl Fn(DVec3) -> f64) -> RenderJob {
    let flip = |p: DVec3| DVec3::new(-p.x, p.y, p.z);
    let mut mesh = grid(8, 0.16, 1, |c| c.length() > 0.4);
    mesh.points.iter_mut().for_each(|p| *p = flip(*p));
    let mesh = Arc::new(build(mesh));
    let scalars = sample(&mesh, |p| scalars_at(flip(p)));
    let mut view = job.view.clone();
    // Of a mirrored frame right is left: columns count the other way.
    (view.eye, view.forward, view.up, view.right) =
        (flip(view.eye), flip(view.forward), flip(view.up), -flip(view.right));
    let active = tetreel::visibility::finite_cells(&mesh.topology, &scalars);
    RenderJob { mesh, scalars: Arc::new(scalars).into(), active: Arc::new(active), view, ..job.clone() }
}

fn flipped(image: &RgbaImage) -> RgbaImage {
    let mut image = image.clone();
    let width = image.width;
    image.pixels.chunks_exact_mut(width).for_each(<[_]>::reverse);
    image
}

/// What a mirror may change: the project's bound of the root mean square, for single pixels. Measured on the CPU: nothing.
const MIRROR_BOUND: f64 = 1e-5;
/// On the CPU: cells come in another order, which may round an f32 by a unit or two.
const MIRROR_BOUND_ON_CPU: f64 = 2.4e-7;

/// The mesh is jittered and the views are oblique: no ray meets a vertex or an edge, where the mirror would decide otherwise.
#[test]
fn a_scene_in_a_mirror_has_the_mirrored_image() {
    let jobs = case().jobs();
    for path in paths() {
        let mut worst = 0f64;
        for job in &jobs {
            let (Some(image), Some(other)) = ((path.render)(job), (path.render)(&mirrored(job, wave))) else {
                continue;
            };
            let (_, max) = difference(&image.planes.color, &flipped(&other.planes.color));
            let bound = if path.on_gpu { MIRROR_BOUND } else { MIRROR_BOUND_ON_CPU };
            assert!(max <= bound, "{}: {max:.1e}", path.name);
            worst = worst.max(max);
            // A mirror with a flaw is noticed, and so is an image that is not turned round.
            let flaw = mirrored(job, |p| wave(p) + 1e-3 * p.y);
            let (_, max) = difference(&image.planes.color, &flipped(&(path.render)(&flaw).unwrap().planes.color));
            assert!(max > MIRROR_BOUND, "{}: {max:.1e} with another field", path.name);
            let (_, max) = difference(&image.planes.color, &other.planes.color);
            assert!(max > MIRROR_BOUND, "{}: {max:.1e} of the unflipped image", path.name);
        }
        eprintln!("mirror | {} | max {worst:.1e}", path.name);
    }
}

/// The job without `margin` pixels at each side; the same rays, but tiles end elsewhere.
fn cropped(job: &RenderJob, margin: usize) -> RenderJob {
    let mut view = job.view.clone();
    let (width, height) = (view.width_px - 2 * margin, view.height_px - 2 * margin);
    view.half_width *= width as f64 / view.width_px as f64;
    view.half_height *= height as f64 / view.height_px as f64;
    (view.width_px, view.height_px) = (width, height);
    RenderJob { view, ..job.clone() }
}

fn crop(image: &RgbaImage, margin: usize) -> RgbaImage {
    let (width, height) = (image.width - 2 * margin, image.height - 2 * margin);
    let row = |j: usize| &image.pixels[(j + margin) * image.width + margin..][..width];
    RgbaImage { width, height, pixels: (0..height).flat_map(row).copied().collect() }
}

/// Rays of a cropped view are the same but for the rounding of their pixel's place: 2^-53, which moves an f32 by one unit at most, and
/// sums of about a hundred by a few. Bands of the reference have 8 rows, bands of faces on the GPU any number of tiles.
const CROP_BOUND: f64 = 1e-6;

// Long: every path draws its jobs with seven margins.
#[test]
fn where_tiles_and_bands_end_does_not_show() {
    let jobs = case().jobs();
    for path in paths() {
        let (mut worst, mut seen) = (0f64, 0);
        for job in &jobs {
            let Some(whole) = (path.render)(job) else { continue };
            for margin in [1, 3, 5, 7, 11] {
                let part = (path.render)(&cropped(job, margin)).unwrap().planes.color;
                let (_, max) = difference(&part, &crop(&whole.planes.color, margin));
                assert!(max <= CROP_BOUND, "{}, margin {margin}: {max:.1e}", path.name);
                worst = worst.max(max);
                seen += part.pixels.iter().filter(|p| p[3] > 0.0).count();
            }
            // A hundredth of a pixel is noticed.
            let mut shifted = cropped(job, 3);
            shifted.view.half_width *= 1.0 + 0.02 / shifted.view.width_px as f64;
            let (_, max) = difference(&(path.render)(&shifted).unwrap().planes.color, &crop(&whole.planes.color, 3));
            assert!(max > CROP_BOUND, "{}: {max:.1e} a hundredth of a pixel off", path.name);
        }
        eprintln!("crops | {} | max {worst:.1e} | {seen} pixels", path.name);
    }
    for job in &jobs {
        for margin in [1, 3] {
            let (_, max) = difference(&reference(&cropped(job, margin)), &crop(&reference(job), margin));
            assert!(max <= CROP_BOUND, "reference, margin {margin}: {max:.1e}");
        }
    }
}

/// Width of a tile on every path.
const TILE_PX: usize = 16;

fn is_at_border(image: &RgbaImage, pixel: usize) -> bool {
    [pixel % image.width, pixel / image.width].iter().any(|place| [0, TILE_PX - 1].contains(&(place % TILE_PX)))
}

/// Mean absolute errors of pixels that see the mesh: at borders, elsewhere.
fn mean_errors(pairs: &[(RgbaImage, RgbaImage)]) -> [f64; 2] {
    let mut sums = [(0.0, 0usize); 2];
    for (image, judge) in pairs {
        for (pixel, (a, b)) in image.pixels.iter().zip(&judge.pixels).enumerate() {
            let error: f64 = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum();
            let sum = &mut sums[usize::from(!is_at_border(judge, pixel))];
            *sum = (sum.0 + error, sum.1 + usize::from(b[3] > 0.0));
        }
    }
    assert!(sums.iter().all(|s| s.1 > 5000), "{sums:?}");
    sums.map(|(sum, count)| sum / count as f64)
}

/// How much larger errors at borders may be than elsewhere: what chance makes of single pixels next to steps, of thousands of pixels
/// each. Measured on the CPU: 1.1; of the images with a flaw, 120.
const BORDER_RATIO: f64 = 1.25;

#[test]
fn pixels_at_the_borders_of_tiles_are_as_right_as_others() {
    let judged: Vec<(RenderJob, RgbaImage)> =
        case().jobs().into_iter().map(|job| (job.clone(), reference(&job))).collect();
    for path in paths() {
        let pairs = judged.iter().filter_map(|(job, judge)| Some(((path.render)(job)?.planes.color, judge.clone())));
        let mut pairs: Vec<_> = pairs.collect();
        if pairs.is_empty() {
            continue;
        }
        let [border, inner] = mean_errors(&pairs);
        eprintln!("mean error | {} | at borders {border:.1e} | elsewhere {inner:.1e}", path.name);
        assert!(border <= BORDER_RATIO * inner, "{}: {border:.1e} against {inner:.1e}", path.name);
        // One in a hundred thousand of light lost at borders is noticed.
        for (image, _) in &mut pairs {
            for pixel in 0..image.pixels.len() {
                if is_at_border(image, pixel) {
                    image.pixels[pixel] = image.pixels[pixel].map(|v| v * (1.0 - 1e-5));
                }
            }
        }
        let [border, inner] = mean_errors(&pairs);
        assert!(border > BORDER_RATIO * inner, "{}: {border:.1e} against {inner:.1e}", path.name);
    }
}
