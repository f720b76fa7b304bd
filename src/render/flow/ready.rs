//! The splats of a view in the order of depths, as words that a GPU projects (`shaders/flow_project.wgsl`).
//!
//! A splat's words have what depends neither on the projection nor on its site alone; the latter a GPU has once for all frames of a mesh.

use super::kernel::ReadyKernel;
use super::mixture::Pattern;
use super::splat::{Splat, Unprojected};
use super::{FlowCounts, FlowScene};
use crate::camera::{Samples, View};
use crate::mesh::Symmetric;
use crate::render::gpu::layout::{Params, TILE_PX, two_parts};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Words of a splat, and more of one with a kernel.
pub(super) const WORDS: usize = 15;
pub(super) const KERNEL_WORDS: usize = 5;

/// Bit of the last word of a splat that has an icon; those below are the icon's number.
pub(super) const FLOWS: u32 = 1 << 31;

/// The splats of a view, sorted.
#[derive(Debug)]
pub(in crate::render) struct Ready {
    /// The words of the splats, one after the other.
    pub(in crate::render) words: Vec<u32>,
    pub(super) counts: FlowCounts,
    /// Tiles of the rendered plane that the boxes of the splats meet, summed over these; a tile more or less in both directions.
    pub(in crate::render) tiles: u64,
}

/// A splat that is to be sorted.
struct Seed {
    depth: f64,
    site: u32,
    of: Unprojected,
    kernel: Option<ReadyKernel>,
    blur: f64,
    tiles: u64,
}

impl Seed {
    /// That of a site; `None` if it has no splat in view.
    fn of(scene: &FlowScene, site: u32, view: &View) -> Option<Self> {
        let of = Unprojected::of(scene, site)?;
        let kernel = match &scene.kernels {
            Some(kernels) => Some(kernels.ready(site, scene)?),
            None => None,
        };
        let (depth, center, halves) = Splat::extent(scene, site, view)?;
        let blur = if of.flows { scene.blur(site) } else { 0.0 };
        Some(Self { depth, site, of, kernel, blur, tiles: tiles_of(view, center, halves) })
    }

    /// Writes its words; icons have these means, and depths are counted from `origin`.
    fn write(&self, scene: &FlowScene, wholes: &[f64], origin: f64, words: &mut [u32]) {
        let Unprojected { color: [r, g, b], mix, flows, .. } = self.of;
        // Where the pattern has no place it is not seen.
        let flows = flows && !self.blur.is_nan();
        let DVec3 { x, y, z } = if flows { scaled(scene.vector(self.site)) } else { DVec3::ZERO };
        let next = if mix.share > 0.0 { wholes[mix.icon + 1] } else { 0.0 };
        let whole = (1.0 - mix.share) * wholes[mix.icon] + mix.share * next;
        let [along, across] = scene.phase(self.site);
        let numbers = [x, y, z, self.blur.min(1.0), r, g, b, along, across, mix.share, whole];
        let [depth, rest] = two_parts(self.depth - origin).map(f32::to_bits);
        let others = [depth, rest, self.site, mix.icon as u32 | if flows { FLOWS } else { 0 }];
        let (of_numbers, words) = words.split_at_mut(numbers.len());
        let (of_others, of_kernel) = words.split_at_mut(others.len());
        let write = |words: &mut [u32], numbers: &[f64]| {
            words.iter_mut().zip(numbers).for_each(|(word, number)| *word = (*number as f32).to_bits());
        };
        write(of_numbers, &numbers);
        of_others.copy_from_slice(&others);
        if let Some(kernel) = &self.kernel {
            write(of_kernel, &kernel.numbers());
        }
    }
}

/// A vector other than 0 times a power of two, so that its greatest component is of the size of 1.
fn scaled(vector: DVec3) -> DVec3 {
    // Of an f32 other than 0, all of which f64 has as normal numbers.
    let exponent = vector.abs().max_element().to_bits() >> 52;
    vector * f64::from_bits((2 * 1023 - exponent) << 52)
}

/// Tiles of the rendered plane in the box of a splat.
fn tiles_of(view: &View, center: DVec2, halves: [f64; 2]) -> u64 {
    let Samples::Lattice(lattice) = view.samples else { return 0 };
    let per_tile = (TILE_PX * lattice.stride_px()) as f64;
    let along = |at: f64, half: f64, pixels: usize| {
        let [from, to] = [at - half, at + half].map(|end| end.clamp(0.0, pixels as f64) / per_tile);
        (to.floor() - from.floor()) as u64 + 1
    };
    along(center.x, halves[0], view.width_px) * along(center.y, halves[1], view.height_px)
}

impl Ready {
    /// The splats of a scene in a view in local coordinates.
    pub(super) fn of(scene: &FlowScene, view: &View, patterns: &[Pattern]) -> Self {
        let has_period = scene.period() > 0.0;
        let sites = if has_period { scene.sites() } else { Vec::new() };
        let seeds: Vec<Seed> = sites.into_par_iter().filter_map(|site| Seed::of(scene, site, view)).collect();
        let mut order: Vec<(f64, u32, u32)> =
            seeds.iter().zip(0..).map(|(seed, number)| (seed.depth, seed.site, number)).collect();
        order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let wholes: Vec<f64> = patterns.iter().map(|pattern| pattern.sums().whole()).collect();
        let of_each = Self::words_of_each(scene);
        let mut words = vec![0; of_each * seeds.len()];
        // Of a view that a GPU refuses, any.
        let origin = Params::of_view(view).map_or(0.0, |params| params.depth_behind_eye());
        let write = |(words, (_, _, number)): (&mut [u32], &(f64, u32, u32))| {
            seeds[*number as usize].write(scene, &wholes, origin, words);
        };
        words.par_chunks_exact_mut(of_each).zip(&order).for_each(write);
        let fast = seeds.iter().filter(|seed| FlowCounts::is_fast(seed.blur)).count() as u64;
        let counts = FlowCounts { splats: seeds.len() as u64, fast, outside: 0 };
        Self { words, counts, tiles: seeds.iter().map(|seed| seed.tiles).sum() }
    }

    /// Words of each splat of a scene.
    pub(super) fn words_of_each(scene: &FlowScene) -> usize {
        WORDS + if scene.kernels.is_some() { KERNEL_WORDS } else { 0 }
    }

    /// The number of splats.
    pub(in crate::render) fn splats(&self) -> usize {
        self.counts.splats as usize
    }
}

impl FlowScene {
    /// What a splat has of its site alone: its place as a sum of two, and the lower triangle L of L L^T, its kernel's shape. Rounded, products of
    /// L keep a needle's or a sheet's width, which sums of squares would lose.
    pub(in crate::render) fn packed_site(&self, site: usize) -> [[f32; 4]; 3] {
        let place = self.center(site as u32).to_array().map(two_parts);
        let [xx, xy, xz, yy, yz, zz] = triangle(&self.shapes.of_sites[site]).map(|number| number as f32);
        let part = |part: usize, last: f32| [place[0][part], place[1][part], place[2][part], last];
        [part(0, xx), part(1, xy), [yy, xz, yz, zz]]
    }

    /// Sites with or without a splat.
    pub(in crate::render) fn site_count(&self) -> usize {
        self.shapes.of_sites.len()
    }
}

/// The lower triangle of a symmetric matrix without negative eigenvalues: xx, yx, zx, yy, zy, zz.
fn triangle(&[xx, xy, xz, yy, yz, zz]: &Symmetric) -> Symmetric {
    let root = |square: f64| square.max(0.0).sqrt();
    let over = |number: f64, root: f64| if root > 0.0 { number / root } else { 0.0 };
    let a = root(xx);
    let [b, c] = [xy, xz].map(|number| over(number, a));
    let d = root(yy - b * b);
    let e = over(yz - b * c, d);
    [a, b, c, d, e, root(zz - c * c - e * e)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_vectors_are_of_the_size_of_1_and_keep_their_digits() {
        for size in [f32::MAX, 1.0, 0.7, f32::MIN_POSITIVE, 1e-45] {
            let vector = DVec3::new(f64::from(size), -f64::from(size) / 4.0, 0.0);
            let found = scaled(vector);
            assert!((1.0..2.0).contains(&found.x) && found.y == -found.x / 4.0, "{size}");
            assert_eq!((vector.x / found.x).log2().fract(), 0.0);
        }
    }

    #[test]
    fn triangles_have_the_squares_of_their_shapes_and_flat_ones_keep_their_height() {
        for height in [1.0, 1e-3, 1e-6, 0.0] {
            // A sheet of this height across a slanted direction.
            let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
            let n = normal.to_array();
            let at = |i: usize, j: usize| f64::from(u8::from(i == j)) - (1.0 - height * height) * n[i] * n[j];
            let shape = [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)];
            let [a, b, c, d, e, f] = triangle(&shape);
            let squares = [a * a, a * b, a * c, b * b + d * d, b * c + d * e, c * c + e * e + f * f];
            assert!(shape.iter().zip(squares).all(|(of, found)| (of - found).abs() < 1e-15), "{height}");
            // The product of the diagonal is the root of the determinant: the height. Differences near 1 are off by 1e-16.
            assert!((a * d * f - height).abs() <= 1e-15 / height.max(1e-8), "{height}: {}", a * d * f);
        }
        assert_eq!(triangle(&[0.0; 6]), [0.0; 6]);
    }
}
