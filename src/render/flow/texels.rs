//! What a GPU reads of icons and cells as texels (`shaders/lib/flow_splats.wgsl`), and the numbers that all splats of a view have in common.

use super::ready::Ready;
#[cfg(test)]
use super::ready::{FLOWS, KERNEL_WORDS, WORDS};
use super::{FlowFidelity, FlowSplats};
use crate::render::gpu::flow_layout::FlowParams;
use crate::render::gpu::layout::{FAR, integer_digits, two_parts};
use rayon::prelude::*;
use std::sync::Arc;

/// Four numbers.
pub(in crate::render) type Texel = [f32; 4];

impl FlowSplats {
    /// What all splats have in common.
    pub(in crate::render) fn params(&self) -> FlowParams {
        let scene = self.scene();
        let [is_cut, has_others] = [self.inside.is_some(), self.others().is_some()].map(|is| f32::from(u8::from(is)));
        let kernels = scene.kernels.is_some().then_some(scene.style.fidelity);
        FlowParams {
            head: [kernels_number(kernels), is_cut, has_others, 0.0],
            periods: two_parts(scene.period().recip()),
            size: scene.style.size as f32,
            opacity: scene.style.opacity as f32,
            fades: u32::from(scene.style.fidelity == FlowFidelity::Smooth),
            splat_count: self.ready().splats() as u32,
            splat_words: Ready::words_of_each(scene) as u32,
            ..FlowParams::default()
        }
    }

    /// Where rays are inside of the cells that are shown, as texels; depths are counted from `origin`.
    pub(in crate::render) fn inside_texels(&self, origin: f64, texels: &mut Vec<Texel>) {
        let Some(inside) = &self.inside else { return };
        let number = |depth: f64| match depth {
            f64::INFINITY => [FAR, 0.0],
            f64::NEG_INFINITY => [-FAR, 0.0],
            _ => two_parts(depth - origin),
        };
        let interval = |[near, far]: [f64; 2]| {
            let [[near, near_rest], [far, far_rest]] = [near, far].map(number);
            [near, near_rest, far, far_rest]
        };
        let first = |ray: usize| match inside.of_ray(ray) {
            [only] => interval(*only),
            _ => [FAR, 0.0, 0.0, 0.0],
        };
        texels.clear();
        texels.par_extend((0..self.pixels()).into_par_iter().map(first));
        for ray in 0..self.pixels() {
            let intervals = inside.of_ray(ray);
            if intervals.len() > 1 {
                let [high, low, ..] = integer_digits([texels.len() as u32, 0]);
                texels[ray] = [FAR, intervals.len() as f32, high, low];
                texels.extend(intervals.iter().copied().map(interval));
            }
        }
    }

    /// Where they are drawn, if it is not everywhere.
    pub(in crate::render) fn inside(&self) -> Option<&Arc<super::Inside>> {
        self.inside.as_ref()
    }

    /// The sums of the icons, as texels.
    pub(in crate::render) fn icon_texels(&self, texels: &mut Vec<Texel>) {
        texels.clear();
        self.patterns.iter().for_each(|pattern| pattern.sums().push_texels(texels));
    }
}

/// The number of what kernels are.
fn kernels_number(kernels: Option<FlowFidelity>) -> f32 {
    match kernels {
        None => 0.0,
        Some(FlowFidelity::Smooth) => 1.0,
        Some(FlowFidelity::Paper) => 2.0,
    }
}

/// Constants that shaders which draw splats have, too.
#[cfg(test)]
pub(in crate::render) fn constants_of_drawing() -> Vec<(&'static str, f64)> {
    let (texels, end) = (super::TEXELS as f64, super::END);
    vec![
        ("NO_KERNELS", kernels_number(None).into()),
        ("SMOOTH_KERNELS", kernels_number(Some(FlowFidelity::Smooth)).into()),
        ("SPLAT_END", end * end),
        ("SPLAT_LEAST", (-0.5 * end * end).exp()),
        ("ICON_ROWS", texels),
        ("ICON_LEVELS", texels.log2() + 1.0),
        ("ICON_COLUMNS", 2.0 * texels + 1.0),
        ("ICON_BEFORE", 0.5 * texels),
    ]
}

/// Constants that the shader which projects splats has, too.
#[cfg(test)]
pub(in crate::render) fn constants_of_projecting() -> Vec<(&'static str, f64)> {
    vec![
        ("KERNEL_AT", WORDS as f64),
        ("KERNEL_END", (WORDS + KERNEL_WORDS) as f64),
        ("FLOWS", f64::from(FLOWS)),
        ("END", super::END),
        ("PIXEL", super::PIXEL),
        ("COMPRESSED", super::COMPRESSED),
        ("ICON_ROWS", super::TEXELS as f64),
    ]
}
