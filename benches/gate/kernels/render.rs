//! Kernels of the CPU renderers: [`Renderer::begin`] and [`Renderer::advance`] separately.

use super::Work;
use crate::scene::{DENSE, Jet, TENTS};
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tetreel::render::cpu::havs::Havs;
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{RenderJob, Renderer};
use tetreel::visibility::{CellSet, Skip};

/// Renders the tiles of a frame.
fn tiles(mut renderer: impl Renderer + 'static, job: RenderJob) -> Result<Work, Box<dyn Error>> {
    renderer.begin(job)?;
    Ok(Box::new(move || {
        black_box(renderer.advance(Duration::MAX)?);
        Ok(())
    }))
}

/// Prepares frames up to the tiles, for some jobs in turn.
fn begins(mut renderer: impl Renderer + 'static, jobs: Vec<RenderJob>) -> Result<Work, Box<dyn Error>> {
    Ok(Box::new(move || {
        for job in &jobs {
            renderer.begin(job.clone())?;
        }
        Ok(())
    }))
}

/// The ray caster in AVX2 lanes.
pub fn walk(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Raycast::new(), Jet::new(20_000, &[8])?.job(DENSE, 96)?)
}

/// The ray caster one ray at a time.
pub fn walk_portable(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Raycast::portable(), Jet::new(20_000, &[8])?.job(DENSE, 64)?)
}

/// View transform, entry faces, and their binning into tiles, for active cells in layers; nothing is kept between frames.
pub fn entries(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(20_000, &[8])?;
    let job = jet.job(TENTS, 96)?;
    let skip = Skip { unchanged: false, ..Skip::ALL };
    let layers = |shift: usize| Arc::new(CellSet::of(jet.cells(), |cell| (cell / 64 + shift).is_multiple_of(3)));
    begins(Raycast::new(), (0..10).map(|shift| RenderJob { active: layers(shift), skip, ..job.clone() }).collect())
}

/// View transform, and binning of faces into tiles; the list differs each time, so that its faces are looked up.
pub fn raster(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(20_000, &[8])?;
    let shares = [1.0, 0.75, 0.5];
    begins(Havs::new(), shares.iter().map(|&share| jet.job_of_faces(DENSE, 96, share)).collect::<Result<_, _>>()?)
}

/// Fragments of faces, put in order and composited.
pub fn faces(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Havs::new(), Jet::new(10_000, &[8])?.job_of_faces(DENSE, 64, 1.0)?)
}
