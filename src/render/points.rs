//! How cells are drawn as points: [`PointStyle`], and the cells of a job, [`PointScene`]. The renderers are [`cpu::points`](super::cpu::points)
//! and `gpu::points`.

use crate::mesh::Mesh;
use crate::moments::CovDenominator;
use crate::short::Short;
use crate::visibility::Drawn;
use crate::words::words;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The shape of a point on the image (dissertation 3.1.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Footprint {
    /// The square around the sphere about the centroid through the farthest corner.
    Square,
    /// That sphere.
    Circle,
    /// The ellipsoid of least volume around the cell.
    Ellipse,
    /// The cell itself.
    #[default]
    Exact,
}

words!(
    Footprint,
    "there is no footprint",
    ["square" = Square, "circle" = Circle, "ellipse" = Ellipse, "exact" = Exact]
);

/// How the points on a ray become light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compositing {
    /// Each cell by itself: the length of the ray in it, or what its footprint makes of that.
    #[default]
    Own,
    /// The gaps between successive points, each at the depth of its centroid with the cell's mean scalar (dissertation 3.1.3).
    Gap,
}

words!(Compositing, "there is no compositing", ["own" = Own, "gap" = Gap]);

/// How cells are drawn as points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointStyle {
    /// The shape on the image.
    pub footprint: Footprint,
    /// How points on a ray become light.
    pub compositing: Compositing,
    /// Scale of all footprints but the exact one, above 0, at most [`Self::MOST_RADIUS`]; thickness is scaled so that each cell keeps its
    /// optical depth.
    pub radius: f64,
    /// Level of detail L, the share of the fragments that is drawn, 0 to 1: of n cells L^2 n, their footprints' areas times 1 / L.
    pub lod: f64,
    /// Whether the fragments of a pixel are sorted; if not, they are in the order of their cells' centroids.
    pub exact_order: bool,
    /// Whether cells whose scalars change much over time, in this measure, are likelier among the first; without it all are alike, and only
    /// then does the mean optical depth not depend on the level of detail.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub importance: Option<CovDenominator>,
    /// Whether cells by themselves have one scalar each, the mean of their corners' (dissertation 3.1.3), where they would have that of the
    /// place in them: to measure what it costs. All but `own` *exact* and *ellipse* have it anyhow. Not on the GPU.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub constant_scalar: bool,
}

impl PointStyle {
    /// Exact footprints of all cells, each cell by itself, in exact order.
    pub const EXACT: Self = Self {
        footprint: Footprint::Exact,
        compositing: Compositing::Own,
        radius: 1.0,
        lod: 1.0,
        exact_order: true,
        importance: None,
        constant_scalar: false,
    };

    /// Balls, each by itself, of a cloud.
    pub const BALLS: Self = Self { footprint: Footprint::Circle, ..Self::EXACT };

    /// The most faithful style for a mesh.
    pub fn usual_of(mesh: &Mesh) -> Self {
        if mesh.is_cloud() { Self::BALLS } else { Self::EXACT }
    }

    /// Greatest scale of footprints.
    pub const MOST_RADIUS: f64 = 8.0;

    /// Checks radius and level of detail.
    ///
    /// # Errors
    /// If one is out of range; says what the range is.
    pub fn check(&self) -> Result<(), String> {
        if !(self.radius > 0.0 && self.radius <= Self::MOST_RADIUS) {
            let most = Self::MOST_RADIUS;
            return Err(format!("a point radius of {}; it is above 0 and at most {most}", Short(self.radius)));
        }
        if !(0.0..=1.0).contains(&self.lod) {
            return Err(format!("a level of detail of {}; it is a share, 0 to 1", Short(self.lod)));
        }
        Ok(())
    }

    /// Whether rays go through the cells themselves, all of them.
    pub fn is_exact(&self) -> bool {
        (self.footprint, self.compositing) == (Footprint::Exact, Compositing::Own) && self.lod >= 1.0
    }

    /// Number of points, out of `count` cells: L^2 of them, rounded.
    pub fn points(&self, count: usize) -> usize {
        ((self.lod * self.lod * count as f64).round() as usize).min(count)
    }
}

impl Default for PointStyle {
    fn default() -> Self {
        Self::EXACT
    }
}

/// The cells of a job that are drawn as points.
#[derive(Clone, Debug)]
pub struct PointScene {
    /// Their ids, each once; ascending by the depth of their centroids if the order of fragments is not exact.
    pub cells: Arc<Drawn>,
    /// How they are drawn.
    pub style: PointStyle,
}
