//! Kernels: splats that show the scalars in place of the cells (Xue and Crawfis 2004, section 2; docs/flow.md).
//!
//! A kernel is a Gaussian cloud around its site with the colour and the extinction of the site's scalar, composited after it was classified.

use super::FlowFidelity;
#[cfg(feature = "gpu")]
use super::FlowScene;
use super::splat::END;
use crate::field::Scalars;
use crate::node_table::{Node, NodeTable};
use crate::words::words;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::Arc;

/// What shows the scalars behind and in front of the splats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FlowVolume {
    /// The cells.
    #[default]
    Exact,
    /// The kernels of the splats, in place of the cells.
    Splats,
    /// Nothing.
    None,
}

words!(FlowVolume, "there is no volume of flow", ["exact" = Exact, "splats" = Splats, "none" = None]);

impl FlowVolume {
    pub(super) fn is_usual(&self) -> bool {
        *self == Self::default()
    }
}

/// What the kernels of a frame show.
#[derive(Clone, Debug)]
pub(crate) struct Kernels {
    /// The scalars of the sites.
    pub(crate) scalars: Scalars,
    pub(crate) table: Arc<NodeTable>,
    /// The volume that each site stands for, in local units.
    pub(crate) volumes: Arc<Vec<f64>>,
}

impl Kernels {
    /// Colour and extinction of a site; `None` if its scalar is not finite.
    pub(in crate::render) fn node(&self, site: u32) -> Option<Node> {
        let scalar = f64::from(self.scalars.values()[site as usize]);
        scalar.is_finite().then(|| self.table.eval(scalar))
    }
}

/// The kernel of a splat before it is projected.
#[cfg(feature = "gpu")]
#[derive(Clone, Copy, Debug)]
pub(super) struct ReadyKernel {
    color: [f64; 3],
    /// Optical depth of the ray through its centre, per local unit that its site's shape is wide there.
    thickness: f64,
    /// Optical depth at which it stands for its site's volume, times the root of its covariance's determinant in square local units.
    depth: f64,
}

#[cfg(feature = "gpu")]
impl ReadyKernel {
    /// Its colour, and its optical depths.
    pub(super) fn numbers(&self) -> [f64; 5] {
        let [r, g, b] = self.color;
        [r, g, b, self.thickness, self.depth]
    }
}

#[cfg(feature = "gpu")]
impl Kernels {
    /// The kernel of a site of a scene; `None` without extinction.
    pub(super) fn ready(&self, site: u32, scene: &FlowScene) -> Option<ReadyKernel> {
        let Node { rgb, tau, .. } = self.node(site).filter(|node| node.tau > 0.0)?;
        let tau = tau * scene.mesh.positions.scale;
        let depth = tau * self.volumes[site as usize] / (TAU * window_mass());
        Some(ReadyKernel { color: rgb, thickness: tau * TAU.sqrt() * scene.style.size, depth })
    }
}

/// The kernel of a splat on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kernel {
    color: [f64; 3],
    /// Optical depth of the ray through its centre, at which it stands for its site's volume.
    depth: f64,
    /// Opacity of the ray through the centre of a cloud of the site's extinction.
    opacity: f64,
    fidelity: FlowFidelity,
}

/// How a kernel lies on the screen.
pub(super) struct OnScreen {
    /// World length of its width along the ray.
    pub(super) width: f64,
    /// Root of the determinant of its covariance on the screen, in square pixels.
    pub(super) area: f64,
    /// World length times square pixels that a ray bundle through the site's volume has: its volume on the screen.
    pub(super) volume: f64,
}

impl Kernel {
    pub(super) fn of(Node { rgb, tau, .. }: Node, on_screen: &OnScreen, fidelity: FlowFidelity) -> Self {
        let opacity = -(-tau * TAU.sqrt() * on_screen.width).exp_m1();
        // All light that the site's volume takes, spread over the window.
        let depth = tau * on_screen.volume / (TAU * on_screen.area * window_mass());
        Self { color: rgb, depth, opacity, fidelity }
    }

    /// Its colour, its optical depth, and its opacity.
    #[cfg(all(test, feature = "gpu"))]
    pub(super) fn numbers(&self) -> ([f64; 3], f64, f64) {
        (self.color, self.depth, self.opacity)
    }

    /// Premultiplied colour, and opacity, where the window and the icon have these values.
    #[inline(always)]
    pub(super) fn light(&self, window: f64, icon: f64, icon_color: [f64; 3]) -> [f64; 4] {
        let (front, behind, alpha) = match self.fidelity {
            // The icon lies over the kernel.
            FlowFidelity::Smooth => {
                let (front, behind) = (self.opacity * icon, (1.0 - icon) * -(-self.depth * window).exp_m1());
                (front, behind, front + behind)
            }
            // RGB = RGB_pri (1 - A1) + RGB_sec A1, A = A_pri ((1 - A1) A0 + A1).
            FlowFidelity::Paper => {
                let alpha = self.opacity * ((1.0 - icon) * window + icon);
                (alpha * icon, alpha * (1.0 - icon), alpha)
            }
        };
        let [r, g, b] = std::array::from_fn(|c| front * icon_color[c] + behind * self.color[c]);
        [r, g, b, alpha]
    }
}

/// The integral of the window over the plane, of which that of a Gaussian without an end is 1.
fn window_mass() -> f64 {
    let least = (-0.5 * END * END).exp();
    1.0 - least * 0.5 * END * END / (1.0 - least)
}
