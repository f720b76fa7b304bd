//! The renderers on the CPU: what [`Renderer::begin`] does and what [`Renderer::advance`] does, apart.

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

/// The tiles of a frame.
fn tiles(mut renderer: impl Renderer + 'static, job: RenderJob) -> Result<Work, Box<dyn Error>> {
    renderer.begin(job)?;
    Ok(Box::new(move || {
        black_box(renderer.advance(Duration::MAX)?);
        Ok(())
    }))
}

/// What comes before the tiles, for some jobs in turn.
fn begins(mut renderer: impl Renderer + 'static, jobs: Vec<RenderJob>) -> Result<Work, Box<dyn Error>> {
    Ok(Box::new(move || {
        for job in &jobs {
            renderer.begin(job.clone())?;
        }
        Ok(())
    }))
}

/// Rays in the lanes of AVX2.
pub fn walk(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Raycast::new(), Jet::new(20_000, &[8])?.job(DENSE, 96)?)
}

/// One ray after the other.
pub fn walk_portable(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Raycast::portable(), Jet::new(20_000, &[8])?.job(DENSE, 64)?)
}

/// View transform, entry faces, and entry faces into tiles, of cells that are active in layers; nothing is kept from frame to frame.
pub fn entries(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(20_000, &[8])?;
    let job = jet.job(TENTS, 96)?;
    let skip = Skip { unchanged: false, ..Skip::ALL };
    let layers = |shift: usize| Arc::new(CellSet::of(jet.cells(), |cell| (cell / 64 + shift).is_multiple_of(3)));
    begins(Raycast::new(), (0..10).map(|shift| RenderJob { active: layers(shift), skip, ..job.clone() }).collect())
}

/// View transform, and faces into tiles; the list is another one each time, so that its faces are looked up.
pub fn raster(_: &Path) -> Result<Work, Box<dyn Error>> {
    let jet = Jet::new(20_000, &[8])?;
    let shares = [1.0, 0.75, 0.5];
    begins(Havs::new(), shares.iter().map(|&share| jet.job_of_faces(DENSE, 96, share)).collect::<Result<_, _>>()?)
}

/// Fragments through buffers of eight, composited.
pub fn k_buffer(_: &Path) -> Result<Work, Box<dyn Error>> {
    tiles(Havs::new(), Jet::new(10_000, &[8])?.job_of_faces(DENSE, 64, 1.0)?)
}
