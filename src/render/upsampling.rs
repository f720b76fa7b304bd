//! The size that a frame is rendered at, and how it is enlarged to full size.

use crate::camera::View;
use crate::image::upsample::{Enlarging, JointKernel, MAX_KERNEL_PX};
use crate::render::cpu::layers::MAX_LAYERS;
use crate::short::Short;
use crate::visibility::CellSet;
use crate::words::words;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How many pixels of the frame one pixel of the rendered image covers in each direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ImageScale {
    /// One pixel: the image is only filtered.
    #[default]
    #[serde(rename = "1")]
    Full = 1,
    /// Two.
    #[serde(rename = "1/2")]
    Half = 2,
    /// Four.
    #[serde(rename = "1/4")]
    Quarter = 4,
    /// Eight.
    #[serde(rename = "1/8")]
    Eighth = 8,
}

words!(ImageScale, "there is no image scale", ["1" = Full, "1/2" = Half, "1/4" = Quarter, "1/8" = Eighth]);

impl ImageScale {
    /// Frame pixels per image pixel in each direction.
    pub fn factor(self) -> usize {
        self as usize
    }
}

/// How edges are detected: by depths of the domain's boundary ([`crate::render::cpu::layers`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthEdges {
    /// Standard deviation of the Gaussian of depth differences, where the range of depths in view is 1. Finite, above 0.
    pub sigma_depth: f64,
    /// Depth layers, 1 to [`MAX_LAYERS`].
    pub layers: usize,
}

impl DepthEdges {
    /// The sigma of section 4.1.3 of the dissertation, and all depth layers.
    pub const USUAL: Self = Self { sigma_depth: 0.01, layers: MAX_LAYERS };

    fn check(&self) -> Result<(), String> {
        if !(self.sigma_depth > 0.0 && self.sigma_depth.is_finite()) {
            return Err(format!("a sigma of depth of {}; choose a finite one above 0", Short(self.sigma_depth)));
        }
        if !(1..=MAX_LAYERS).contains(&self.layers) {
            return Err(format!("{} layers of depth; choose 1 to {MAX_LAYERS}", self.layers));
        }
        Ok(())
    }
}

/// How a small image is enlarged ([`crate::image::upsample`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpsampleFilter {
    /// The nearest sample.
    Nearest,
    /// Bilinear interpolation of the four samples around a pixel.
    Bilinear,
    /// Bilinear, then the joint bilateral filter.
    Joint {
        /// Omega: kernel size in pixels of the full image, 1 to [`MAX_KERNEL_PX`].
        kernel_px: usize,
        /// The edges that it keeps.
        edges: DepthEdges,
    },
    /// Bilinear interpolation of those of the four samples that are on the pixel's side of an edge.
    Joint2x2 {
        /// The edges that it keeps.
        edges: DepthEdges,
    },
}

impl UpsampleFilter {
    /// The kind of filter, without numbers.
    pub fn kind(&self) -> UpsampleKind {
        match self {
            Self::Nearest => UpsampleKind::Nearest,
            Self::Bilinear => UpsampleKind::Bilinear,
            Self::Joint { .. } => UpsampleKind::Joint,
            Self::Joint2x2 { .. } => UpsampleKind::Joint2x2,
        }
    }

    /// How edges are detected, if the filter keeps edges.
    pub fn edges(&self) -> Option<DepthEdges> {
        match *self {
            Self::Nearest | Self::Bilinear => None,
            Self::Joint { edges, .. } | Self::Joint2x2 { edges } => Some(edges),
        }
    }
}

/// A filter without its numbers, as named in options and project files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpsampleKind {
    /// [`UpsampleFilter::Nearest`].
    Nearest,
    /// [`UpsampleFilter::Bilinear`].
    #[default]
    Bilinear,
    /// [`UpsampleFilter::Joint`].
    Joint,
    /// [`UpsampleFilter::Joint2x2`].
    Joint2x2,
}

words!(
    UpsampleKind,
    "there is no filter",
    ["nearest" = Nearest, "bilinear" = Bilinear, "joint" = Joint, "joint2x2" = Joint2x2]
);

impl UpsampleKind {
    /// The filter with the numbers of section 4.1.3 of the dissertation.
    pub fn usual(self, scale: ImageScale) -> UpsampleFilter {
        let edges = DepthEdges::USUAL;
        match self {
            Self::Nearest => UpsampleFilter::Nearest,
            Self::Bilinear => UpsampleFilter::Bilinear,
            Self::Joint => UpsampleFilter::Joint { kernel_px: JointKernel::of_factor(scale.factor()).kernel_px, edges },
            Self::Joint2x2 => UpsampleFilter::Joint2x2 { edges },
        }
    }
}

/// A smaller image that is rendered instead of the frame and enlarged to its size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked")]
pub struct Upsampling {
    /// Size of the image: ceil(w / factor) x ceil(h / factor) pixels, which cover at least those of the frame, around the same middle.
    pub scale: ImageScale,
    /// How the image is enlarged.
    pub filter: UpsampleFilter,
}

/// [`Upsampling`] before validation.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Unchecked {
    scale: ImageScale,
    filter: UpsampleFilter,
}

impl TryFrom<Unchecked> for Upsampling {
    type Error = String;

    fn try_from(Unchecked { scale, filter }: Unchecked) -> Result<Self, String> {
        let upsampling = Self { scale, filter };
        upsampling.check().map(|()| upsampling)
    }
}

impl Upsampling {
    /// The positions of the image's pixels in a frame of this size in pixels.
    pub fn enlarging(&self, size_px: (usize, usize)) -> Enlarging {
        Enlarging::by(self.scale.factor(), size_px)
    }

    /// Checks that the numbers are in range.
    pub(crate) fn check(&self) -> Result<(), String> {
        if let Some(edges) = self.filter.edges() {
            edges.check()?;
        }
        match self.filter {
            UpsampleFilter::Joint { kernel_px, .. } if !(1..=MAX_KERNEL_PX).contains(&kernel_px) => {
                Err(format!("a kernel of {kernel_px} pixels; choose 1 to {MAX_KERNEL_PX}"))
            }
            _ => Ok(()),
        }
    }
}

/// The view of the small image that is enlarged to `view`: its own pixels around the same middle.
pub(crate) fn small_view(enlarging: &Enlarging, view: &View) -> View {
    let (width_px, height_px) = enlarging.small;
    let covers = |small: usize, full: usize| enlarging.per_sample * small as f64 / full as f64;
    View {
        half_width: view.half_width * covers(width_px, view.width_px),
        half_height: view.half_height * covers(height_px, view.height_px),
        width_px,
        height_px,
        ..view.clone()
    }
}

/// How a job's image is enlarged to its frame, on the device that renders it ([`RenderJob::enlarge`](crate::render::RenderJob::enlarge)).
#[derive(Clone, Debug, PartialEq)]
pub struct Enlargement {
    /// The filter.
    pub filter: UpsampleFilter,
    /// The positions of the image's pixels in the frame.
    pub enlarging: Enlarging,
    /// The view of the frame.
    pub view: View,
    /// The cells whose boundary defines edges, whatever is skipped.
    pub domain: Arc<CellSet>,
}
