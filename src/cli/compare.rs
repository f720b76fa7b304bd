//! `tetreel compare`: how far two images are apart.

use super::{Outcome, print_result};
use crate::export::still::Background;
use crate::image::{self, DepthMetrics, ImageMetrics};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// Compare two images of equal size: max, RMSE, PSNR, SSIM, FLIP
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Colours are compared as premultiplied, display-referred values: those of EXR files unrounded, those of PNG \
files as far as 8 or 16 bits have them. An EXR that holds linear light is converted.\n\n\
Example:\n  tetreel compare a.png b.png --fail-above 1e-3"
)]
pub(super) struct Args {
    /// An image (.png or .exr)
    a: PathBuf,
    /// The image to judge it by
    b: PathBuf,
    /// Print JSON: {max, rmse, psnr, ssim, flip}; psnr is null for equal images. Two EXRs with depth: also depth {max,
    /// rmse, compared, unmatched}
    #[arg(long)]
    json: bool,
    /// Colour behind transparent pixels for SSIM and FLIP: #rrggbb, black, white or gray
    #[arg(long, value_name = "COLOR", default_value = "black")]
    background: Background,
    /// Exit with 1 if the largest difference is above this
    #[arg(long, value_name = "MAX", allow_hyphen_values = true)]
    fail_above: Option<f64>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let background = args.background.color().unwrap_or([0.0; 3]);
    let ((a, a_depth), (b, b_depth)) = (image::read_image(&args.a)?, image::read_image(&args.b)?);
    let named = |e| anyhow::anyhow!("{} and {}: {e}", args.a.display(), args.b.display());
    let metrics = image::compare(&a, &b, background).map_err(named)?;
    let depth = a_depth.zip(b_depth).map(|(a, b)| image::compare_depth(&a, &b)).transpose().map_err(named)?;
    let comparison = Comparison { metrics, depth };
    print_result(args.json, &comparison, &Text(&comparison))?;
    let failed = args.fail_above.is_some_and(|bound| bound.is_nan() || metrics.max > bound);
    Ok(if failed { Outcome::CheckFailed } else { Outcome::Done })
}

#[derive(Serialize)]
struct Comparison {
    #[serde(flatten)]
    metrics: ImageMetrics,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<DepthMetrics>,
}

struct Text<'a>(&'a Comparison);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let m = &self.0.metrics;
        writeln!(
            f,
            "max {:.3e}  rmse {:.3e}  psnr {:.2} dB  ssim {:.5}  flip {:.5}",
            m.max, m.rmse, m.psnr, m.ssim, m.flip
        )?;
        let Some(d) = &self.0.depth else { return Ok(()) };
        writeln!(
            f,
            "depth: max {:.3e}  rmse {:.3e}  over {} pixels; {} in one image only",
            d.max, d.rmse, d.compared, d.unmatched
        )
    }
}
