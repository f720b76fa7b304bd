//! Random meshes, tables, cameras, sizes and contrasts: cast rays have the bits of the whole image, and scheduling changes no frame.

use super::super::super::{Advance, Renderer, testing};
use super::*;
use crate::camera::{Camera, Projection};
use crate::image::Planes;
use crate::mesh::Mesh;
use crate::mesh::test_meshes::{Random, jittered, kuhn_grid_of};
use crate::node_table::{Node, NodeTable};
use crate::task::Cancel;
use glam::DVec3;
use proptest::prelude::*;
use std::cell::Cell;

/// A mesh with its view, and the contrast of its sampling.
#[derive(Clone, Debug)]
struct Scene {
    cubes: [usize; 3],
    seed: u64,
    /// Eye relative to the mesh, in diameters of the mesh.
    eye: [f64; 3],
    parallel: bool,
    size_px: (usize, usize),
    contrast: f32,
    previews: Vec<f32>,
}

prop_compose! {
    fn scenes()(
        cubes in prop::array::uniform3(1usize..4), seed in any::<u64>(), direction in prop::array::uniform3(-1.0..1.0),
        distance in prop_oneof![3 => Just(1.3), 1 => Just(0.2), 1 => Just(4.0)], parallel in any::<bool>(),
        size_px in prop_oneof![Just((1, 1)), Just((130, 70)), (1usize..20, 1usize..20), (1usize..=130, 1usize..=70)],
        contrast in prop_oneof![Just(0.0), Just(f32::MIN_POSITIVE), 0.003f32..0.3, Just(1.0)],
        previews in prop_oneof![Just(vec![]), Just(vec![0.5, 0.1, 0.02])],
    ) -> Scene {
        let eye = (DVec3::from(direction).normalize_or(DVec3::X) * distance).to_array();
        Scene { cubes, seed, eye, parallel, size_px, contrast, previews }
    }
}

impl Scene {
    /// The job that casts all rays.
    fn whole(&self) -> RenderJob {
        let mut random = Random::new(self.seed);
        let [nx, ny, nz] = self.cubes;
        let mut kept: Vec<bool> = (0..nx * ny * nz).map(|_| random.signed() > -0.3).collect();
        kept[0] = true;
        let raw = kuhn_grid_of(self.cubes, |[x, y, z]| kept[x + nx * (y + ny * z)]);
        let mesh = Arc::new(Mesh::build(jittered(raw, &mut random)).unwrap().0);
        let waves: [f64; 4] = std::array::from_fn(|_| 3.0 * random.signed());
        let scalar = |p: DVec3| ((waves[0] * p.x + waves[1]).sin() * (waves[2] * p.y + waves[3] * p.z).cos()) as f32;
        let scalars = (0..mesh.positions.local.len()).map(|v| scalar(mesh.positions.world(v))).collect();
        let (low, high) = mesh.positions.world_bounds();
        let (centre, diameter) = (0.5 * (low + high), (high - low).length());
        let aside = 0.1 * diameter * DVec3::new(random.signed(), random.signed(), random.signed());
        let parallel = Projection::Parallel { scale: 0.4 * diameter };
        let projection = if self.parallel { parallel } else { Projection::Perspective { view_angle: 45.0 } };
        let position = centre + diameter * DVec3::from(self.eye);
        let camera = Camera { position, focal_point: centre + aside, view_up: DVec3::Z, projection, near: 0.0 };
        testing::job(&mesh, scalars, &camera, self.size_px, Arc::new(Self::table(&mut random, diameter)))
    }

    /// A table of transparent, thin and opaque stretches and steps.
    fn table(random: &mut Random, diameter: f64) -> NodeTable {
        let mut scalars: Vec<f64> = (0..2 + random.below(5)).map(|_| random.signed()).collect();
        scalars.sort_by(f64::total_cmp);
        let node = |scalar| {
            let rgb = std::array::from_fn(|_| 0.5 + 0.5 * random.signed());
            let tau = [0.0, 0.3, 2.0, 80.0][random.below(4)] / diameter;
            Node { scalar, rgb, tau }
        };
        NodeTable::new(scalars.into_iter().map(node).collect()).unwrap()
    }

    /// The job with contrast-adaptive sampling.
    fn job(&self) -> RenderJob {
        let contrast = |&contrast: &f32| Contrast::new(contrast).unwrap();
        RenderJob {
            contrast: Some(contrast(&self.contrast)),
            previews: self.previews.iter().map(contrast).collect(),
            ..self.whole()
        }
    }
}

/// An image, and for each pixel whether its ray was cast.
#[derive(Clone, PartialEq)]
struct Shown {
    planes: Planes,
    cast: Vec<bool>,
}

/// The first pixel whose ray was cast but whose bits differ from the whole image.
fn first_wrong(shown: &Shown, whole: &Planes) -> Option<usize> {
    let bits = |planes: &Planes, at: usize| {
        let color = planes.color.pixels[at].map(f32::to_bits);
        (color, planes.depth.pixels[at].to_bits())
    };
    assert_eq!(
        (shown.cast.len(), shown.planes.color.pixels.len()),
        (whole.color.pixels.len(), whole.color.pixels.len())
    );
    (0..shown.cast.len()).find(|&at| shown.cast[at] && bits(&shown.planes, at) != bits(whole, at))
}

/// All previews of a job and its final image. Without adaptive sampling all rays count as cast.
fn images(renderer: &mut Raycast, job: &RenderJob, budget: Duration) -> Vec<Shown> {
    renderer.begin(job.clone()).unwrap();
    let width = job.view.width_px;
    let mut shown = Vec::new();
    loop {
        let (planes, is_done) = match renderer.advance(budget).unwrap() {
            Advance::Partial(_) => continue,
            Advance::Preview(frame, _) => (frame.planes.clone(), false),
            Advance::Done(frame) => (frame.planes.clone(), true),
        };
        let is_sampled = !job.contrasts().is_empty() && renderer.frame_mut().stats.rays_by_level != [0; 4];
        let is_cast = |at: usize| !is_sampled || renderer.adaptive().has_cast(at % width, at / width);
        let cast = (0..planes.color.pixels.len()).map(is_cast).collect();
        shown.push(Shown { planes, cast });
        if is_done {
            return shown;
        }
    }
}

/// Begins a job and cancels it after this many of the smallest slices; true if it was still under way.
fn give_up(renderer: &mut Raycast, job: &RenderJob, slices: usize) -> bool {
    let cancel = Cancel::new();
    renderer.begin(RenderJob { cancel: cancel.clone(), ..job.clone() }).unwrap();
    for _ in 0..slices {
        if let Advance::Done(_) = renderer.advance(Duration::ZERO).unwrap() {
            return false;
        }
    }
    cancel.cancel();
    assert!(matches!(renderer.advance(Duration::MAX).unwrap(), Advance::Partial(_)));
    true
}

#[test]
fn rays_that_are_cast_have_the_bits_of_the_whole_image_and_no_way_to_work_changes_a_frame() {
    let pools = [1, 3].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    let [left_out, on_the_way, given_up, noticed] = [(); 4].map(|()| Cell::new(0));
    let add = |count: &Cell<usize>, more: usize| count.set(count.get() + more);
    proptest!(ProptestConfig::with_cases(64), |(scene in scenes(), at in any::<prop::sample::Index>(), slices in 0usize..12)| {
        let whole = Raycast::new().render(scene.whole()).unwrap().planes.clone();
        let job = scene.job();
        let mut renderer = Raycast::new();
        let shown = images(&mut renderer, &job, Duration::MAX);
        for shown in &shown {
            prop_assert_eq!(first_wrong(shown, &whole), None);
        }
        let last = &shown[shown.len() - 1];
        let cast: Vec<usize> = (0..last.cast.len()).filter(|&at| last.cast[at]).collect();
        prop_assert!(scene.contrast > 0.0 || cast.len() == last.cast.len() && last.planes == whole);
        add(&left_out, last.cast.len() - cast.len());
        add(&on_the_way, shown.len() - 1);
        // A ray whose last bit is wrong is noticed.
        let at = cast[at.index(cast.len())];
        let mut other = last.clone();
        let bits = &mut other.planes.color.pixels[at][at % 4];
        *bits = f32::from_bits(bits.to_bits() ^ 1);
        prop_assert_eq!(first_wrong(&other, &whole), Some(at));
        prop_assert!(other != *last);
        other.planes = last.planes.clone();
        other.planes.depth.pixels[at] = -1.0;
        prop_assert_eq!(first_wrong(&other, &whole), Some(at));
        add(&noticed, 2);
        // Slices, tile order, number of threads and earlier jobs change nothing.
        prop_assert!(images(&mut renderer, &job, Duration::ZERO) == shown, "in the smallest slices");
        prop_assert!(images(&mut Raycast::portable(), &job, Duration::MAX) == shown, "one ray after the other");
        let mut in_order = job.clone();
        in_order.skip.costly_first = false;
        prop_assert!(images(&mut renderer, &in_order, Duration::MAX) == shown, "tiles as they come");
        for (pool, mut renderer) in pools.iter().zip([Raycast::new(), Raycast::portable()]) {
            let (was_given_up, found) = pool.install(|| {
                let was_given_up = give_up(&mut renderer, &job, slices);
                let budget = if scene.seed % 2 == 0 { Duration::ZERO } else { Duration::MAX };
                (was_given_up, images(&mut renderer, &job, budget))
            });
            add(&given_up, usize::from(was_given_up));
            prop_assert!(found == shown, "{} threads, after one that was given up", pool.current_num_threads());
        }
    });
    let counts = [left_out, on_the_way, given_up, noticed].map(Cell::into_inner);
    assert!(counts[0] > 1000 && counts[1] > 5 && counts[2] > 20 && counts[3] > 100, "{counts:?}");
}
