//! [`Contrast`]: by how much neighbouring rays may differ.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The largest difference between neighbouring rays, in a channel of raw accumulators, at which no more rays are cast between them,
/// in 0..=1. At 0 all rays are cast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "f32", into = "f32")]
pub struct Contrast(f32);

/// A number that is not a contrast.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a contrast of {0}; it is a difference of colour or opacity between neighbouring rays, 0 to 1")]
pub struct BadContrast(f32);

impl Contrast {
    /// A contrast from 0 to 1; `None` for any other number.
    pub const fn new(contrast: f32) -> Option<Self> {
        // -0 becomes 0.
        if contrast >= 0.0 && contrast <= 1.0 { Some(Self(contrast.abs())) } else { None }
    }

    /// The number.
    pub const fn get(self) -> f32 {
        self.0
    }
}

impl Default for Contrast {
    fn default() -> Self {
        Self(0.05)
    }
}

impl TryFrom<f32> for Contrast {
    type Error = BadContrast;

    fn try_from(contrast: f32) -> Result<Self, BadContrast> {
        Self::new(contrast).ok_or(BadContrast(contrast))
    }
}

impl From<Contrast> for f32 {
    fn from(contrast: Contrast) -> Self {
        contrast.0
    }
}

impl FromStr for Contrast {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number: f32 = text.parse().map_err(|_| format!("'{text}' is no contrast; give a number from 0 to 1"))?;
        number.try_into().map_err(|error: BadContrast| error.to_string())
    }
}

impl fmt::Display for Contrast {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.0)
    }
}
