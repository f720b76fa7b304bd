//! The pixels of an image that rays are cast for.

use super::RequestError;
use crate::camera::{Lattice, PixelSet, Samples};
use crate::render::Contrast;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::str::FromStr;
use std::sync::Arc;

/// The pixels of an image that rays are cast for. The result of a ray does not depend on other rays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum SampleSet {
    /// All pixels.
    #[default]
    All,
    /// Pixels whose column and whose row are multiples of the stride, or the last: a plane of ceil((w - 1) / stride) + 1 by ceil((h - 1) /
    /// stride) + 1 pixels. A stride beyond the image size leaves its corners.
    Lattice {
        /// Pixels from one to the next.
        stride_px: NonZeroUsize,
    },
    /// Listed pixels, row times image width plus column, in any order and each once: a plane of one row, in this order. Rendered on the
    /// CPU.
    Pixels(Arc<[u32]>),
    /// Pixels chosen by contrast; the others are interpolated, so that the planes have all pixels. With rays from cell to cell. A contrast
    /// of 0 chooses all.
    Adaptive {
        /// How much neighbouring rays may differ.
        contrast: Contrast,
    },
}

impl SampleSet {
    /// The set in the renderers' form, for an image of this width and height.
    ///
    /// # Errors
    /// If a listed pixel is outside the image or listed twice, or the list is empty.
    pub fn samples(&self, size_px: (usize, usize)) -> Result<Samples, RequestError> {
        Ok(match self {
            Self::All | Self::Adaptive { .. } => Samples::ALL,
            Self::Lattice { stride_px } => Samples::Lattice(Lattice::new(*stride_px)),
            Self::Pixels(pixels) => Samples::Pixels(Arc::new(PixelSet::new(size_px, pixels)?)),
        })
    }

    /// The contrast that decides which rays are cast; `None` for other sets.
    pub fn contrast(&self) -> Option<Contrast> {
        match self {
            Self::Adaptive { contrast } => Some(*contrast),
            Self::All | Self::Lattice { .. } | Self::Pixels(_) => None,
        }
    }
}

/// Parses the value of `--rays`: `exact`, or `adaptive` with a contrast behind a colon.
impl FromStr for SampleSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "exact" => Ok(Self::All),
            None if text == "adaptive" => Ok(Self::Adaptive { contrast: Contrast::default() }),
            Some(("adaptive", contrast)) => Ok(Self::Adaptive { contrast: contrast.parse()? }),
            _ => Err(format!(
                "there are no rays '{text}'; write exact, adaptive or adaptive:CONTRAST, as in adaptive:0.02"
            )),
        }
    }
}
