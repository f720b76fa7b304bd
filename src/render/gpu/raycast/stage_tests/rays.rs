//! Rays cast and pixels filled between them: exactly as by the CPU's functions from the GPU's colours, and against the CPU's frames,
//! where contrasts may be so close to the threshold that rounding decides.

use super::*;
use crate::image::Planes;
use crate::render::adaptive::Adaptive;
use crate::render::cpu;
use crate::render::gpu::layout::RayLists;
use crate::render::{Contrast, Renderer};
use crate::stats::FrameStats;
use std::collections::BTreeSet;
use std::ops::Range;

/// A frame of the GPU, and what its stages have left there.
struct Sampled {
    job: RenderJob,
    frame: Frame,
    lists: RayLists,
    words: Vec<u32>,
}

fn with_contrast(job: &RenderJob, contrast: f32) -> RenderJob {
    RenderJob { contrast: Contrast::new(contrast), ..job.clone() }
}

fn sampled(context: &Arc<Context>, job: &RenderJob) -> Sampled {
    let mut renderer = renderer(context);
    let frame = renderer.render(job.clone()).unwrap().clone();
    let words = read_back(context, renderer.layer.layer.scene.rays.rays.get(context).unwrap());
    Sampled { job: job.clone(), frame, lists: RayLists { size_px: (job.view.width_px, job.view.height_px) }, words }
}

impl Sampled {
    fn pixels(&self) -> usize {
        self.lists.size_px.0 * self.lists.size_px.1
    }

    fn bit(&self, bits_at: u64, pixel: usize) -> bool {
        self.words[bits_at as usize + pixel / 32] >> (pixel % 32) & 1 == 1
    }

    fn has_cast(&self, pixel: usize) -> bool {
        self.bit(self.lists.listed(), pixel)
    }

    /// The states of the blocks of strides 8, 4 and 2.
    fn states(&self, level: usize) -> &[u32] {
        let ends = self.lists.states();
        &self.words[ends[level] as usize..ends[level + 1] as usize]
    }

    /// The same image by the CPU's functions, from what the rays of this one have seen: planes, which rays were cast, and counts. Boxes of faces
    /// reach so many columns further.
    fn twin(&self, contrast: f32, further: usize) -> (Planes, Vec<bool>, FrameStats) {
        let (mut adaptive, mut stats, mut cast) =
            (Adaptive::default(), FrameStats::default(), vec![false; self.pixels()]);
        let width = self.lists.size_px.0;
        adaptive.begin(self.lists.size_px, vec![contrast]);
        let reaching = cpu::raycast::Raycast::reaching(&self.job);
        let reaches = |columns: Range<usize>, rows| reaching(columns.start.saturating_sub(further)..columns.end, rows);
        loop {
            for (pixel, cast) in cast.iter_mut().enumerate() {
                let (column, row) = (pixel % width, pixel / width);
                if !adaptive.wanted.contains(column, row) {
                    continue;
                }
                assert!(!std::mem::replace(cast, true), "a ray is cast once");
                adaptive.seen.planes.color.pixels[pixel] = self.frame.planes.color.pixels[pixel];
                adaptive.seen.planes.depth.pixels[pixel] = self.frame.planes.depth.pixels[pixel];
                if self.bit(self.lists.met(), pixel) {
                    adaptive.seen.met.insert(column, row);
                }
            }
            if !adaptive.refine(reaches, |_, _| false, &mut stats) {
                break;
            }
        }
        let mut planes = Planes::default();
        planes.clear(self.lists.size_px.0, self.lists.size_px.1);
        adaptive.fill(&mut planes);
        (planes, cast, stats)
    }

    /// What differs from the twin: rays, counts of blocks, filled pixels.
    fn differences(&self, contrast: f32) -> [usize; 3] {
        self.differences_from(self.twin(contrast, 0))
    }

    fn differences_from(&self, (planes, cast, expected): (Planes, Vec<bool>, FrameStats)) -> [usize; 3] {
        let rays = (0..self.pixels()).filter(|&pixel| self.has_cast(pixel) != cast[pixel]).count();
        let counts = |stats: &FrameStats| (stats.rays_by_level, stats.blocks_split, stats.blocks_filled);
        let counts = usize::from(counts(&self.frame.stats) != counts(&expected));
        let found = &self.frame.planes;
        let is_off = |pixel: &usize| {
            let (a, b) = (found.color.pixels[*pixel], planes.color.pixels[*pixel]);
            // Three steps, each rounded twice in f32, or once by a driver that multiplies and adds at once.
            let is_far = a.iter().zip(b).any(|(a, b)| (a - b).abs() > 12.0 * 1.2e-7);
            is_far || found.depth.pixels[*pixel] != planes.depth.pixels[*pixel]
        };
        [rays, counts, (0..self.pixels()).filter(is_off).count()]
    }
}

/// Images within a block, of one pixel in a direction, with and without a rest behind the last tile or block.
const SIZES: [(usize, usize); 9] = [(130, 70), (53, 41), (1, 1), (1, 40), (64, 1), (8, 9), (9, 8), (33, 17), (2, 3)];

const CONTRASTS: [f32; 3] = [1e-3, 0.05, 0.3];

fn scenes(sizes: &[(usize, usize)]) -> Vec<(String, RenderJob)> {
    let mut scenes = Vec::new();
    for missing in [0, 3] {
        let mesh = mesh(5, missing, DVec3::ZERO);
        for (name, camera) in cameras(DVec3::ZERO) {
            for &size in sizes {
                scenes.push((format!("{name}, missing {missing}, {size:?}"), job(&mesh, &camera, size)));
            }
        }
    }
    scenes
}

#[test]
fn blocks_are_split_and_filled_as_by_the_cpu_from_what_rays_have_seen() {
    let Some(context) = context() else { return };
    let (mut by_reason, mut by_level, mut filled) = ([0; 4], [0; 4], 0);
    for (name, job) in scenes(&SIZES) {
        for contrast in CONTRASTS {
            let found = sampled(&context, &with_contrast(&job, contrast));
            assert_eq!(found.differences(contrast), [0; 3], "{name}, contrast {contrast}");
            // Each place of the list is another ray.
            let listed = found.words[RayLists::LISTED] as usize;
            let list = &found.words[found.lists.list() as usize..][..listed];
            assert_eq!(list.iter().collect::<BTreeSet<_>>().len(), listed, "{name}");
            assert_eq!((0..found.pixels()).filter(|&pixel| found.has_cast(pixel)).count(), listed, "{name}");
            assert_eq!(found.frame.stats.rays_by_level.iter().sum::<u64>() as usize, listed, "{name}");
            by_reason.iter_mut().zip(found.frame.stats.blocks_split).for_each(|(sum, count)| *sum += count);
            by_level.iter_mut().zip(found.frame.stats.rays_by_level).for_each(|(sum, count)| *sum += count);
            filled += found.frame.stats.blocks_filled;
        }
    }
    assert!(
        by_reason.into_iter().chain(by_level).chain([filled]).all(|count| count > 20),
        "{by_reason:?}, {by_level:?}"
    );
}

#[test]
fn the_comparison_notices_another_contrast_a_lost_face_and_a_moved_pixel() {
    let Some(context) = context() else { return };
    let (_, job) = scenes(&SIZES[..1]).swap_remove(5);
    let found = sampled(&context, &with_contrast(&job, 0.05));
    assert_eq!(found.differences(0.05), [0; 3]);
    let [rays, counts, _] = found.differences(0.06);
    assert!(rays > 0 && counts > 0);
    let [rays, counts, _] = found.differences_from(found.twin(0.05, 2));
    assert!(rays > 0 && counts > 0, "a box two pixels wider");
    let Sampled { job, mut frame, lists, mut words } = found;
    let cast = (0..130 * 70).rfind(|&pixel| words[lists.listed() as usize + pixel / 32] >> (pixel % 32) & 1 == 0);
    frame.planes.color.pixels[cast.unwrap()][1] += 1e-5;
    let mut found = Sampled { job, frame, lists, words: words.clone() };
    assert_eq!(found.differences(0.05), [0, 0, 1]);
    words[lists.met() as usize..lists.states()[0] as usize].fill(0);
    found.words = words;
    assert!(found.differences(0.05)[0] > 0);
}

/// How the decisions of the two differ: blocks that one of them splits of its own for a contrast that is close to the threshold; those that
/// follow from such; others.
#[derive(Debug, Default, PartialEq)]
struct Decided {
    blocks: usize,
    close: usize,
    following: usize,
    unexplained: usize,
}

/// Bits of a block's state, the same on CPU and GPU.
const OPEN: u32 = 1;
const OF_ITS_OWN: u32 = 14;

impl Decided {
    fn compare(&mut self, contrast: f32, gpu: &Sampled, cpu: &cpu::raycast::Raycast, seen: &Planes) {
        let (width, height) = gpu.lists.size_px;
        for (level, stride) in [8, 4, 2].into_iter().enumerate() {
            let (columns, rows) = gpu.lists.blocks(stride);
            let on_cpu: Vec<u32> = cpu.adaptive().states(level).iter().map(|&state| u32::from(state)).collect();
            let on_gpu = gpu.states(level);
            assert_eq!(on_cpu.len(), on_gpu.len());
            let differ = |at: usize| on_cpu[at] & (OPEN | OF_ITS_OWN) != on_gpu[at] & (OPEN | OF_ITS_OWN);
            for at in 0..on_gpu.len() {
                let (a, b) = (on_cpu[at], on_gpu[at]);
                self.blocks += usize::from(a != 0);
                if a == b {
                    continue;
                }
                let (i, j) = (at % columns, at / columns);
                if (a ^ b) & OPEN != 0 {
                    self.following += 1;
                    continue;
                }
                if (a ^ b) & OF_ITS_OWN == 0 {
                    let beside = |n: usize, of: usize| n.saturating_sub(1)..(n + 2).min(of);
                    let has_cause = beside(j, rows).any(|j| beside(i, columns).any(|i| differ(j * columns + i)));
                    (self.following, self.unexplained) =
                        (self.following + usize::from(has_cause), self.unexplained + usize::from(!has_cause));
                    continue;
                }
                let ends = |n: usize, pixels: usize| [n * stride, ((n + 1) * stride).min(pixels - 1)];
                let ([x0, x1], [y0, y1]) = (ends(i, width), ends(j, height));
                let corners = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| seen.color.pixels[y * width + x]);
                let most = (0..4).map(|channel| {
                    let of = corners.map(|color| color[channel]);
                    of.into_iter().fold(of[0], f32::max) - of.into_iter().fold(of[0], f32::min)
                });
                let most = most.fold(0.0, f32::max);
                if (most - contrast).abs() <= 1e-4 {
                    self.close += 1;
                } else {
                    self.unexplained += 1;
                }
            }
        }
    }
}

#[test]
fn decisions_differ_from_those_of_the_cpu_only_where_it_is_close() {
    let Some(context) = context() else { return };
    let mut decided = Decided::default();
    let (mut sum, mut values, mut most) = (0.0, 0, 0.0f64);
    let mut noticed = Decided::default();
    for (name, job) in scenes(&[(130, 70), (53, 41), (5, 100)]) {
        for contrast in [1e-3, 0.02, 0.05, 0.3] {
            let job = with_contrast(&job, contrast);
            let gpu = sampled(&context, &job);
            let mut cpu = cpu::raycast::Raycast::new();
            let seen = cpu.render(job.clone()).unwrap().planes.clone();
            decided.compare(contrast, &gpu, &cpu, &seen);
            assert_eq!(decided.unexplained, 0, "{name}, contrast {contrast}: {decided:?}");
            let width = gpu.lists.size_px.0;
            let both = |pixel: &usize| gpu.has_cast(*pixel) && cpu.adaptive().has_cast(pixel % width, pixel / width);
            for pixel in (0..gpu.pixels()).filter(both) {
                let pair = seen.color.pixels[pixel].into_iter().zip(gpu.frame.planes.color.pixels[pixel]);
                for difference in pair.map(|(a, b)| (f64::from(a) - f64::from(b)).abs()) {
                    (sum, values, most) = (sum + difference * difference, values + 1, most.max(difference));
                }
            }
            // Decisions of another threshold are not close to this one.
            let other = sampled(&context, &with_contrast(&job, 1.2 * contrast));
            noticed.compare(contrast, &other, &cpu, &seen);
        }
    }
    println!("{decided:?}; rays differ by {:.1e}, at most {most:.1e}", (sum / f64::from(values)).sqrt());
    // The project's bounds between GPU and CPU (`tests/it/render/mod.rs`).
    assert!((sum / f64::from(values)).sqrt() <= 1e-5 && most <= 1e-3);
    assert!(decided.blocks > 100_000 && decided.close * 1000 < decided.blocks, "{decided:?}");
    assert!(noticed.unexplained > 100, "{noticed:?}");
}

#[test]
fn slices_of_one_workgroup_go_through_all_steps() {
    let Some(context) = context() else { return };
    let (_, job) = scenes(&[(130, 70)]).swap_remove(5);
    let job = with_contrast(&job, 0.05);
    let whole = sampled(&context, &job);
    let mut renderer = renderer(&context);
    renderer.begin(job).unwrap();
    let mut slices = 0;
    let sliced = loop {
        slices += 1;
        match renderer.advance(std::time::Duration::ZERO).unwrap() {
            crate::render::Advance::Done(frame) => break frame.clone(),
            other => assert!(matches!(other, crate::render::Advance::Partial(_))),
        }
    };
    // A workgroup each, tiles of the filling included.
    let rays = whole.words[RayLists::LISTED] as usize;
    assert!(slices > rays / RayLists::GROUP_RAYS + 30, "{slices} slices of {rays} rays");
    assert!(sliced.planes == whole.frame.planes);
    assert_eq!(sliced.stats.rays_by_level, whole.frame.stats.rays_by_level);
    assert_eq!((sliced.stats.steps, sliced.stats.rays_hit), (whole.frame.stats.steps, whole.frame.stats.rays_hit));
}
