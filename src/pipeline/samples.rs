//! Which pixels of an image rays are cast for.

use crate::camera::Lattice;
use serde::{Deserialize, Serialize};
use std::num::NonZeroUsize;

/// The pixels of an image that rays are cast for. What a ray sees does not depend on which others are cast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
}

impl SampleSet {
    /// The set as renderers have it.
    pub fn lattice(self) -> Lattice {
        match self {
            Self::All => Lattice::ALL,
            Self::Lattice { stride_px } => Lattice::new(stride_px),
        }
    }
}
