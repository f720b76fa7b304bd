//! Where frames are rendered, and by which kind of renderer.

use crate::words::words;
use serde::{Deserialize, Serialize};

/// Where a frame is rendered. Frames of both backends agree within the bounds of `docs/accuracy.md`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// On the GPU if there is one, else on the CPU, as are all frames that the GPU cannot render. A software driver counts only if it was
    /// asked for by name.
    #[default]
    Auto,
    /// On the CPU.
    Cpu,
    /// On a GPU, software drivers included; without one, rendering fails.
    Gpu,
}

words!(Backend, "there is no backend", ["auto" = Auto, "cpu" = Cpu, "gpu" = Gpu]);

/// The primitive that a renderer of both backends traverses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Primitive {
    /// Cells, from one to the next along rays.
    Cells,
    /// Faces, in depth order.
    Faces,
    /// Cells as points.
    Points,
}
