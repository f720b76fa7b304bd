//! A lattice of pixels, or a list: what is rendered of it is what a whole image has there.

use super::formula::{field, function, job_of};
use super::havs::{havs, with_all_faces, with_buffer, with_some_faces};
use super::joint::{LAYERS, ROWS, SCALARS, noisy, with_joint_table};
use super::*;
use crate::meshes::{noise, sample};
use std::num::NonZeroUsize;
use tetreel::camera::{Lattice, PixelSet, Samples};
use tetreel::image::Planes;
use tetreel::optics::OpticsKind;
use tetreel::render::{LayerFragment, LayerFragments};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind};
use tetreel::visibility::{CellSet, Skip};

fn lattice(stride: usize) -> Lattice {
    Lattice::new(NonZeroUsize::new(stride).unwrap())
}

/// The pixels of a whole image that a lattice has.
fn of_lattice(whole: &Planes, stride: usize) -> Planes {
    let (width, height) = (whole.color.width, whole.color.height);
    let has = |at: usize, pixels: usize| at.is_multiple_of(stride) || at == pixels - 1;
    let at: Vec<usize> = (0..width * height).filter(|&i| has(i % width, width) && has(i / width, height)).collect();
    at_pixels(whole, &at, ((width - 1).div_ceil(stride) + 1, (height - 1).div_ceil(stride) + 1))
}

/// Some pixels of a whole image as planes of another size.
fn at_pixels(whole: &Planes, at: &[usize], (columns, rows): (usize, usize)) -> Planes {
    let mut planes = Planes::default();
    planes.clear(columns, rows);
    for (place, &pixel) in at.iter().enumerate() {
        planes.color.pixels[place] = whole.color.pixels[pixel];
        planes.depth.pixels[place] = whole.depth.pixels[pixel];
    }
    assert_eq!(at.len(), planes.color.pixels.len());
    planes
}

fn with_lattice(job: &RenderJob, stride: usize) -> RenderJob {
    let mut job = job.clone();
    job.view.samples = Samples::Lattice(lattice(stride));
    job
}

/// About one in `every` pixels of an image, as they come: neither in order nor evenly.
fn some_pixels(job: &RenderJob, every: u64, seed: u64) -> Vec<usize> {
    let all = job.view.width_px * job.view.height_px;
    let mut pixels: Vec<usize> = (0..all).filter(|&i| noise(seed, i as u64).abs() * every as f64 <= 1.0).collect();
    pixels.sort_by(|&a, &b| noise(seed + 1, a as u64).total_cmp(&noise(seed + 1, b as u64)));
    pixels
}

fn with_pixels(job: &RenderJob, pixels: &[usize]) -> RenderJob {
    let mut job = job.clone();
    let listed: Vec<u32> = pixels.iter().map(|&pixel| pixel as u32).collect();
    let set = PixelSet::new((job.view.width_px, job.view.height_px), &listed).unwrap();
    job.view.samples = Samples::Pixels(Arc::new(set));
    job
}

/// The pixels of a whole image that a list has.
fn of_pixels(whole: &Planes, pixels: &[usize]) -> Planes {
    at_pixels(whole, pixels, (pixels.len(), 1))
}

fn cpu(name: &str, job: &RenderJob) -> Planes {
    match name {
        "raycast" => Raycast::new().render(job.clone()).unwrap().planes.clone(),
        "portable" => Raycast::portable().render(job.clone()).unwrap().planes.clone(),
        "faces" => havs(&with_all_faces(job)).planes,
        "some faces" => havs(&with_buffer(&with_some_faces(job, 0.3, 1), 3, false)).planes,
        _ => Reference::new().render(job.clone()).unwrap().planes.clone(),
    }
}

const CPU: [&str; 5] = ["raycast", "portable", "faces", "some faces", "reference"];
const PERSPECTIVE: Projection = Projection::Perspective { view_angle: 35.0 };

/// Scenes with the eye outside, in the mesh and far behind its near plane; opaque, transparent in places, by formula, joint; sizes that are
/// no multiple of a tile.
pub fn scenes() -> Vec<(&'static str, RenderJob)> {
    let outside = DVec3::new(3.0, 2.0, 2.5);
    let (mesh, scalars) = field(5);
    let range = MappedRange::new(0.0, 1.0, false).unwrap();
    let source = function("viridis@0:0,0.4:0.2,0.7:0,1:0.3", range, OpacityKind::Alpha, Lengths::of_diagonal(3.5));
    let formula = job_of(&mesh, scalars.clone(), &camera(outside, PERSPECTIVE), (61, 37), source);
    let parallel = Projection::Parallel { scale: 1.6 };
    let parallel = job(&mesh, scalars.clone(), &camera(outside, parallel), (48, 33), dense());
    let eye = DVec3::new(0.31, 0.22, -0.17);
    let inside =
        job(&mesh, scalars.clone(), &camera(eye, Projection::Perspective { view_angle: 80.0 }), (40, 40), dense());
    let opaque = table(&[(0.0, [1.0, 0.5, 0.1], 0.0), (0.5, [0.2, 0.5, 1.0], 0.0), (0.6, [0.1, 0.9, 0.3], 400.0)]);
    let mut opaque = job(&mesh, scalars, &camera(outside, PERSPECTIVE), (50, 50), opaque);
    opaque.skip = Skip::ALL;
    let joint = super::joint::scene(4, PERSPECTIVE);
    let vertex = sample(&joint.mesh, |p| 0.3 * p.x + 0.5 * p.y);
    let cell = (0..joint.mesh.topology.tets.len() as u64).map(|i| noise(7, i) as f32).collect();
    let joint = with_joint_table(&joint, noisy(&SCALARS, &ROWS, &LAYERS, 3), Some(vertex), Some(cell));
    vec![("formula", formula), ("parallel", parallel), ("inside", inside), ("opaque", opaque), ("joint", joint)]
}

#[test]
fn a_lattice_has_the_bits_of_the_whole_image_on_the_cpu() {
    for (name, job) in scenes() {
        for path in CPU {
            let whole = cpu(path, &job);
            assert!(whole.color.pixels.iter().any(|p| p[3] > 0.1), "{name}, {path}");
            for stride in [1, 2, 3, 5, 16, 17, 36, 1000, usize::MAX] {
                let found = cpu(path, &with_lattice(&job, stride));
                let expected = of_lattice(&whole, stride);
                assert!(found == expected, "{name}, {path}, every {stride}th pixel");
            }
            // Other pixels are other ones.
            let shifted = of_lattice(&cpu(path, &stretched(&job)), 3);
            assert!(cpu(path, &with_lattice(&job, 3)) != shifted, "{name}, {path}");
        }
    }
}

#[test]
fn listed_pixels_have_the_bits_of_the_whole_image_on_the_cpu() {
    for (name, job) in scenes() {
        let all = job.view.width_px * job.view.height_px;
        let lists = [
            some_pixels(&job, 1, 3),
            some_pixels(&job, 7, 4),
            some_pixels(&job, 200, 5),
            vec![0],
            vec![all - 1, 0, all / 2],
            (0..all).rev().collect(),
        ];
        for path in CPU {
            let whole = cpu(path, &job);
            for pixels in &lists {
                assert!(!pixels.is_empty(), "{name}");
                let found = cpu(path, &with_pixels(&job, pixels));
                assert!(found == of_pixels(&whole, pixels), "{name}, {path}, {} pixels", pixels.len());
            }
            // Other pixels are other ones.
            let mut shifted = lists[1].clone();
            shifted.rotate_left(1);
            assert!(cpu(path, &with_pixels(&job, &lists[1])) != of_pixels(&whole, &shifted), "{name}, {path}");
        }
    }
}

#[test]
fn listed_pixels_are_clear_where_nothing_is_to_be_seen() {
    let (_, job) = scenes().swap_remove(0);
    let nothing = Arc::new(CellSet::none(job.active.universe()));
    let job = RenderJob { active: nothing, ..with_pixels(&job, &[0, 2000, 77]) };
    for path in CPU {
        let planes = cpu(path, &job);
        assert!(planes.color.pixels == [[0.0; 4]; 3] && planes.depth.pixels == [f32::INFINITY; 3], "{path}");
    }
}

#[test]
fn a_list_of_pixels_of_another_image_is_refused() {
    let (_, mut job) = scenes().swap_remove(0);
    job.view.samples = Samples::Pixels(Arc::new(PixelSet::new((61, 36), &[5]).unwrap()));
    let error = Raycast::new().begin(job).unwrap_err();
    assert_eq!(error.to_string(), "pixels of an image of 61 x 36 pixels for one of 61 x 37");
}

#[test]
fn sampled_tables_and_fragments_of_other_layers_are_those_of_the_whole_image() {
    let (_, base) = scenes().swap_remove(1);
    for optics in [OpticsKind::Table3d, OpticsKind::Partial] {
        let job = RenderJob { optics, ..base.clone() };
        for path in ["raycast", "faces"] {
            assert!(cpu(path, &with_lattice(&job, 4)) == of_lattice(&cpu(path, &job), 4), "{path}, {optics}");
        }
    }
    // A fragment in every third pixel of the image, at other depths and in other colours.
    let (width, height) = (base.view.width_px, base.view.height_px);
    let fragment = |pixel: usize| {
        let of = |k: u64| 0.5 + 0.5 * noise(5, 3 * pixel as u64 + k);
        let opacity = of(0) as f32;
        LayerFragment { depth: 2.5 + 3.0 * of(1), rgba: [opacity * of(2) as f32, 0.0, 0.0, opacity] }
    };
    let pixels: Vec<usize> = (0..width * height).collect();
    let fragments = |pixels: &[usize]| {
        let some = pixels.iter().enumerate().filter(|(_, pixel)| pixel.is_multiple_of(3));
        let found = some.map(|(place, &pixel)| (place as u32, fragment(pixel)));
        Some(Arc::new(LayerFragments::new(pixels.len(), found).unwrap()))
    };
    let whole = RenderJob { fragments: fragments(&pixels), ..base.clone() };
    let has = |at: usize, of: usize| at.is_multiple_of(4) || at == of - 1;
    let some: Vec<usize> = pixels.iter().copied().filter(|i| has(i % width, width) && has(i / width, height)).collect();
    let job = RenderJob { fragments: fragments(&some), ..with_lattice(&base, 4) };
    for path in CPU {
        assert!(cpu(path, &job) == of_lattice(&cpu(path, &whole), 4), "{path}");
        assert!(cpu(path, &job) != of_lattice(&cpu(path, &base), 4), "{path}");
    }
    let listed = some_pixels(&base, 5, 9);
    let job = RenderJob { fragments: fragments(&listed), ..with_pixels(&base, &listed) };
    for path in CPU {
        assert!(cpu(path, &job) == of_pixels(&cpu(path, &whole), &listed), "{path}");
    }
    // Those of the whole image are too many.
    let error = Raycast::new().begin(with_lattice(&whole, 4)).unwrap_err();
    assert_eq!(error.to_string(), "fragments of other layers for 1584 pixels in an image of 117");
}

#[test]
fn images_of_a_pixel_a_row_or_a_column_have_lattices() {
    let (mesh, scalars) = field(3);
    for size in [(1, 1), (1, 40), (35, 1), (2, 2)] {
        let job = job(&mesh, scalars.clone(), &camera(DVec3::new(3.0, 2.0, 2.5), PERSPECTIVE), size, dense());
        for path in CPU {
            let whole = cpu(path, &job);
            for stride in [1, 2, 7, 100] {
                assert!(cpu(path, &with_lattice(&job, stride)) == of_lattice(&whole, stride), "{size:?}, {path}");
            }
        }
    }
}

#[test]
fn rays_that_are_not_cast_cost_nothing() {
    let (_, job) = scenes().swap_remove(0);
    let count = |stride: usize| Raycast::new().render(with_lattice(&job, stride)).unwrap().stats.clone();
    let (all, some) = (count(1), count(4));
    assert!(12 * some.steps < all.steps && 12 * some.rays_hit < all.rays_hit, "{} of {}", some.steps, all.steps);
    let fragments = |stride: usize| havs(&with_all_faces(&with_lattice(&job, stride))).stats.fragments;
    assert!(12 * fragments(4) < fragments(1));
    let listed = with_pixels(&job, &some_pixels(&job, 16, 2));
    let some = Raycast::new().render(listed.clone()).unwrap().stats.clone();
    assert!(10 * some.steps < all.steps && 10 * some.rays_hit < all.rays_hit, "{} of {}", some.steps, all.steps);
    assert!(10 * havs(&with_all_faces(&listed)).stats.fragments < fragments(1));
}

#[cfg(feature = "gpu")]
#[test]
fn a_list_of_pixels_is_beyond_the_gpu_and_said_so() {
    let (_, job) = scenes().swap_remove(0);
    let Some(context) = gpu::context() else { return };
    let listed = with_pixels(&job, &[7, 3]);
    let errors = [
        tetreel::render::gpu::raycast::Raycast::new(context.clone()).begin(listed.clone()).unwrap_err(),
        tetreel::render::gpu::havs::Havs::new(context).begin(with_all_faces(&listed)).unwrap_err(),
    ];
    for error in errors.map(|error| error.to_string()) {
        assert!(error.contains("cannot render this: a list of pixels; the CPU can (backend cpu)"), "{error}");
    }
}

#[cfg(feature = "gpu")]
#[test]
fn a_lattice_on_the_gpu_is_within_a_millionth_of_the_whole_image() {
    for (name, job) in scenes() {
        let faces = with_all_faces(&job);
        let (Some(walked), Some(drawn)) = (gpu::render(&job), super::havs::gpu::render(&faces)) else { return };
        for stride in [2, 3, 17, 1000] {
            let check = |path: &str, whole: &Planes, found: Planes| {
                let expected = of_lattice(whole, stride);
                let (rmse, max) = difference(&found.color, &expected.color);
                assert!(rmse <= 1e-6, "{name}, {path}, every {stride}th pixel: rmse {rmse:.1e}, max {max:.1e}");
                assert_eq!(found.depth.pixels.len(), expected.depth.pixels.len());
            };
            check("walk", &walked.planes, gpu::render(&with_lattice(&job, stride)).unwrap().planes);
            let found = super::havs::gpu::render(&with_lattice(&faces, stride)).unwrap().planes;
            check("faces", &drawn.planes, found);
        }
        let shifted = of_lattice(&gpu::render(&stretched(&job)).unwrap().planes, 3);
        let found = gpu::render(&with_lattice(&job, 3)).unwrap().planes;
        assert!(difference(&found.color, &shifted.color).0 > 1e-6, "{name}");
    }
}
