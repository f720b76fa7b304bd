//! How a frame in motion is drawn, and how far that is from the image in full.

use crate::image::upsample::{Enlarging, bilinear};
use crate::image::{RawDifference, RgbaImage, compare_raw};
use crate::pipeline::RenderMode;
use crate::playback::quality::{Family, Quality, Wanted};

/// Inputs of the choice of quality for a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drawing {
    /// The chosen renderer.
    pub(super) mode: RenderMode,
    /// Largest share of faces; of points, that at rest.
    pub(super) lod: f64,
    /// Whether contrast may decide which rays are cast.
    pub(super) has_rays: bool,
    /// Whether there are details of an earlier frame of the same view.
    pub(super) has_details: bool,
    /// Whether some of the points may be left out.
    pub(super) has_points: bool,
}

impl Drawing {
    /// The requirements for the quality control.
    pub(super) fn wanted(self, family: Option<Family>, target_ms: Option<f64>) -> Wanted {
        let Self { mode, lod, has_rays, has_details, has_points } = self;
        let lod = if lod.is_nan() { 1.0 } else { lod.clamp(0.0, 1.0) };
        let are_faces = mode == RenderMode::Havs || mode == RenderMode::Auto && lod < 1.0;
        let has_faces = has_points || matches!(mode, RenderMode::Auto | RenderMode::Havs);
        let family = family.filter(|&family| family != Family::Faces || has_faces);
        let faces = are_faces.then_some(lod);
        Wanted { target_ms, family, has_rays, has_details, faces, has_points, or_exact: mode == RenderMode::Auto }
    }

    /// Quality at rest, whatever its cost.
    pub(super) fn at_rest(self) -> Quality {
        self.wanted(None, None).faces.map_or(Quality::Exact, Quality::Faces)
    }
}

/// Error and cost of the last picture of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionError {
    /// Quality of the picture.
    pub quality: Quality,
    /// Milliseconds of all stages.
    pub ms: f64,
    /// Share of the rays that was cast, with adaptive rays.
    pub rays: Option<f64>,
    /// Difference from the image in full, after enlarging; `None` if one of them is on the GPU.
    pub error: Option<RawDifference>,
}

impl MotionError {
    /// The difference of an image, enlarged if smaller, from the one in full; `None` if one of them is on the GPU.
    pub(super) fn between(image: &RgbaImage, exact: &RgbaImage) -> Option<RawDifference> {
        if image.pixels.is_empty() || exact.pixels.is_empty() {
            return None;
        }
        let (small, full) = ((image.width, image.height), (exact.width, exact.height));
        if small == full {
            return compare_raw(image, exact).ok();
        }
        compare_raw(&bilinear(image, &Enlarging::between(small, full)), exact).ok()
    }
}
