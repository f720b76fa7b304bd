//! Time ratios of frames of one renderer, on one thread.

use super::on_one_thread;
use crate::scene::{DENSE, Jet};
use std::error::Error;
use std::hint::black_box;
use tetreel::bench::paired;
use tetreel::render::cpu::havs::Havs;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{RenderJob, Renderer};

/// Median over pairs of time(second) / time(first).
fn ratio<A, B>(
    pairs: usize,
    (mut a, of_a): (A, RenderJob),
    (mut b, of_b): (B, RenderJob),
) -> Result<f64, Box<dyn Error>>
where
    A: Renderer,
    B: Renderer,
{
    on_one_thread(move || {
        // Jobs that were rendered once cannot fail any more.
        a.render(of_a.clone()).map_err(|e| e.to_string())?;
        b.render(of_b.clone()).map_err(|e| e.to_string())?;
        let draw_a = || _ = black_box(a.render(of_a.clone()).map(|frame| frame.stats.steps));
        let draw_b = || _ = black_box(b.render(of_b.clone()).map(|frame| frame.stats.steps));
        Ok(paired(draw_a, draw_b, pairs, 1).ratio)
    })
}

/// The vectorised ray caster over one ray at a time.
pub fn lanes() -> Result<f64, Box<dyn Error>> {
    let job = Jet::new(100_000, &[8])?.job(DENSE, 256)?;
    ratio(9, (Raycast::portable(), job.clone()), (Raycast::new(), job))
}

/// The face renderer with the widest registers over the portable one.
pub fn face_lanes() -> Result<f64, Box<dyn Error>> {
    let job = Jet::new(100_000, &[8])?.job_of_faces(DENSE, 256, 1.0)?;
    ratio(9, (Havs::portable(), job.clone()), (Havs::new(), job))
}

/// A tenth of the interior faces over all of them.
pub fn few_faces() -> Result<f64, Box<dyn Error>> {
    let jet = Jet::new(100_000, &[8])?;
    let [all, few] = [jet.job_of_faces(DENSE, 256, 1.0)?, jet.job_of_faces(DENSE, 256, 0.1)?];
    ratio(9, (Havs::new(), all), (Havs::new(), few))
}

/// Constant opacities on a coarse mesh, with its thick segments: the slowest over the first one. Nothing may be slower for being more
/// opaque.
pub fn opaque_rays() -> Result<f64, Box<dyn Error>> {
    let jet = Jet::new(10_000, &[8])?;
    let job = |opacity: &str| jet.job(&format!("viridis@0:{opacity},1:{opacity}"), 256);
    let mut worst = 0.0f64;
    for opacity in ["0.5", "0.9", "0.99", "0.9999", "1"] {
        worst = worst.max(ratio(5, (Raycast::new(), job("0.05")?), (Raycast::new(), job(opacity)?))?);
    }
    Ok(worst)
}

/// Frame time per cell, of a million cells over a hundred thousand.
pub fn large_meshes() -> Result<f64, Box<dyn Error>> {
    let [small, large] = [Jet::new(100_000, &[8])?, Jet::new(1_000_000, &[8])?];
    let cells = large.cells() as f64 / small.cells() as f64;
    let [of_small, of_large] = [small.job(DENSE, 256)?, large.job(DENSE, 256)?];
    Ok(ratio(9, (Raycast::new(), of_small), (Raycast::new(), of_large))? / cells)
}

/// A frame of ten thousand cells over one of a hundred thousand: rays pass half as many cells, each across more colours.
pub fn coarse_meshes() -> Result<f64, Box<dyn Error>> {
    let [coarse, fine] = [Jet::new(10_000, &[8])?, Jet::new(100_000, &[8])?];
    let [of_coarse, of_fine] = [coarse.job(DENSE, 256)?, fine.job(DENSE, 256)?];
    ratio(9, (Raycast::new(), of_fine), (Raycast::new(), of_coarse))
}
