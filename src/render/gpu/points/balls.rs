//! The balls of a cloud in the GPU's memory.

use crate::mesh::Mesh;
use crate::render::RenderError;
use crate::render::gpu::buffers::GrowingBuffer;
use crate::render::gpu::context::Context;
use crate::render::gpu::resources::Resource;
use crate::render::points::{Compositing, PointStyle};
use rayon::prelude::*;
use std::sync::Arc;

/// Greatest thickness of a ball, local units: what it is multiplied with then stays within f32, whose greatest number is 3e38. Such a ball is
/// one of a volume of its own that is far above that of its radius.
const MOST_THICK: f64 = 1e30;

/// Radius of each point of a cloud, and half of its thickness at the middle: the radius times V / V_ball; both in local units.
pub(super) struct BallBuffer {
    of: Option<Arc<Mesh>>,
    /// A mesh, and the greatest thickness of its balls.
    thickest: Option<(Arc<Mesh>, f64)>,
    pub(super) buffer: GrowingBuffer,
}

/// Half of the thickness of a ball at its middle, local units.
fn half_thickness(mesh: &Mesh, point: usize, radius: f32) -> f64 {
    f64::from(radius) * mesh.filling_of(point as u32)
}

impl BallBuffer {
    pub(super) fn new() -> Self {
        Self { of: None, thickest: None, buffer: GrowingBuffer::new(Resource::Balls) }
    }

    /// Checks that the thicknesses of a cloud's points are within f32.
    ///
    /// # Errors
    /// `BeyondGpu` if they are not.
    pub(super) fn check(&mut self, context: &Context, mesh: &Arc<Mesh>, style: PointStyle) -> Result<(), RenderError> {
        let Some(radii) = &mesh.radii else { return Ok(()) };
        // Gaps have none.
        if style.compositing == Compositing::Gap || style.lod <= 0.0 {
            return Ok(());
        }
        let thickest = match &self.thickest {
            Some((of, thickest)) if Arc::ptr_eq(of, mesh) => *thickest,
            _ => {
                let halves = radii.par_iter().enumerate().map(|(point, &radius)| half_thickness(mesh, point, radius));
                let thickest = 2.0 * halves.reduce(|| 0.0, f64::max);
                self.thickest = Some((mesh.clone(), thickest));
                thickest
            }
        };
        // A share L of the points, each enlarged, stands for all (`render::cpu::points`).
        if thickest / (style.lod * style.radius * style.radius) > MOST_THICK {
            let problem = "the volumes of the points are beyond single precision beside their radii";
            return Err(context.beyond(problem.to_owned()));
        }
        Ok(())
    }

    /// Uploads the balls of a cloud unless they are there. Returns whether the buffer was made, and the bytes sent.
    pub(super) fn upload(&mut self, context: &Context, mesh: &Arc<Mesh>) -> Result<(bool, u64), RenderError> {
        let Some(radii) = &mesh.radii else { return Ok((self.buffer.reserve(context, 0)?, 0)) };
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, mesh)) {
            return Ok((false, 0));
        }
        self.of = None;
        let pack = |point: usize| [radii[point], half_thickness(mesh, point, radii[point]) as f32];
        let uploaded = self.buffer.upload_packed(context, 0..radii.len(), pack)?;
        self.of = Some(mesh.clone());
        Ok(uploaded)
    }
}
