//! Which pixels of an image rays are cast for.

use super::RequestError;
use crate::camera::{Lattice, PixelSet, Samples};
use crate::render::Contrast;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;
use std::str::FromStr;
use std::sync::Arc;

/// The pixels of an image that rays are cast for. What a ray sees does not depend on which others are cast.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum SampleSet {
    /// All of them.
    #[default]
    All,
    /// Those whose column and whose row are multiples of the stride, or the last: a plane of ceil((w - 1) / stride) + 1 by
    /// ceil((h - 1) / stride) + 1 pixels. A stride beyond the size of the image leaves its corners.
    Lattice {
        /// Pixels from one to the next.
        stride_px: NonZeroUsize,
    },
    /// These, row times the width of the image plus column, in any order and each once: a plane of one row, which has their order.
    /// Rendered on the CPU.
    Pixels(#[serde(with = "pixels")] Arc<[u32]>),
    /// Those that contrast asks for; the others are filled in between, so that the planes have all pixels. By rays from cell to cell. At a
    /// contrast of 0 these are all of them.
    Adaptive {
        /// How much neighbouring rays may differ.
        contrast: Contrast,
    },
}

impl SampleSet {
    /// The set as renderers have it, for an image of this width and height.
    ///
    /// # Errors
    /// If pixels are listed that the image does not have, one twice, or none.
    pub fn samples(&self, size_px: (usize, usize)) -> Result<Samples, RequestError> {
        Ok(match self {
            Self::All | Self::Adaptive { .. } => Samples::ALL,
            Self::Lattice { stride_px } => Samples::Lattice(Lattice::new(*stride_px)),
            Self::Pixels(pixels) => Samples::Pixels(Arc::new(PixelSet::new(size_px, pixels)?)),
        })
    }

    /// The contrast that decides which rays are cast, if that is what decides.
    pub fn contrast(&self) -> Option<Contrast> {
        match self {
            Self::Adaptive { contrast } => Some(*contrast),
            Self::All | Self::Lattice { .. } | Self::Pixels(_) => None,
        }
    }
}

/// Parses what `--rays` takes: `exact`, or `adaptive` with a contrast behind a colon.
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

/// A shared list by what is in it.
mod pixels {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub(super) fn serialize<S: Serializer>(pixels: &Arc<[u32]>, serializer: S) -> Result<S::Ok, S::Error> {
        pixels.as_ref().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(data: D) -> Result<Arc<[u32]>, D::Error> {
        Ok(Vec::deserialize(data)?.into())
    }
}
