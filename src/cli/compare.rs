//! `tetreel compare`: how far two images are apart.

use super::{Outcome, print_result};
use crate::export::still::Background;
use crate::image::{self, ImageMetrics};
use std::fmt;
use std::path::PathBuf;

/// Compare two images of equal size: max, RMSE, PSNR, SSIM, FLIP
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tetreel compare a.png b.png --fail-above 1e-3")]
pub(super) struct Args {
    /// An image (.png)
    a: PathBuf,
    /// The image to judge it by
    b: PathBuf,
    /// Print JSON: {max, rmse, psnr, ssim, flip}; psnr is null for equal images
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
    let metrics = image::compare(&image::read_png(&args.a)?, &image::read_png(&args.b)?, background)
        .map_err(|e| anyhow::anyhow!("{} and {}: {e}", args.a.display(), args.b.display()))?;
    print_result(args.json, &metrics, &Text(&metrics))?;
    let failed = args.fail_above.is_some_and(|bound| bound.is_nan() || metrics.max > bound);
    Ok(if failed { Outcome::CheckFailed } else { Outcome::Done })
}

struct Text<'a>(&'a ImageMetrics);

impl fmt::Display for Text<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let m = self.0;
        writeln!(
            f,
            "max {:.3e}  rmse {:.3e}  psnr {:.2} dB  ssim {:.5}  flip {:.5}",
            m.max, m.rmse, m.psnr, m.ssim, m.flip
        )
    }
}
