//! `tetreel compare`: the difference of two images.

use super::progress::Terminal;
use super::{Outcome, print_result};
use crate::export::still::Background;
use crate::files;
use crate::image::{self, IdMetrics, ImageMetrics, MetricsError, Plane, PlaneMetrics, PngDepth};
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
    /// Print JSON: {max, rmse, psnr, ssim, flip}; psnr is null for equal images. Two EXRs with such planes: also depth
    /// and normal (degrees) {max, rmse, compared, unmatched}, id {different, compared}
    #[arg(long)]
    json: bool,
    /// Colour behind transparent pixels for SSIM and FLIP: #rrggbb, black, white or gray
    #[arg(long, value_name = "COLOR", default_value = "black")]
    background: Background,
    /// Exit with 1 if the largest difference is above this
    #[arg(long, value_name = "MAX", allow_hyphen_values = true)]
    fail_above: Option<f64>,
    /// Write a PNG with the first image, the second, and what differs, side by side
    #[arg(long, value_name = "FILE.png")]
    sheet: Option<PathBuf>,
    /// Factor of the differences on the sheet (default: as much as the largest one allows)
    #[arg(long, value_name = "FACTOR", requires = "sheet", value_parser = parse_factor)]
    amplify: Option<f32>,
}

fn parse_factor(text: &str) -> Result<f32, String> {
    let parsed = text.parse().ok().filter(|f: &f32| *f > 0.0 && f.is_finite());
    parsed.ok_or_else(|| "a factor is a positive number".to_owned())
}

pub(super) fn run(args: &Args, terminal: &Terminal) -> anyhow::Result<Outcome> {
    if let Some(path) = &args.sheet {
        files::check_place(path)?;
    }
    let background = args.background.color().unwrap_or([0.0; 3]);
    let (a, b) = (image::read_image(&args.a)?, image::read_image(&args.b)?);
    let named = |e| anyhow::anyhow!("{} and {}: {e}", args.a.display(), args.b.display());
    let metrics = image::compare(&a.color, &b.color, background).map_err(named)?;
    let depth = of_both(&a.depth, &b.depth, image::compare_depth).map_err(named)?;
    let normal = of_both(&a.normal, &b.normal, image::compare_normals).map_err(named)?;
    let id = of_both(&a.id, &b.id, image::compare_ids).map_err(named)?;
    let (comparison, a, b) = (Comparison { metrics, depth, normal, id }, a.color, b.color);
    if let Some(path) = &args.sheet {
        let (differences, factor) = image::amplified_difference(&a, &b, background, args.amplify).map_err(named)?;
        let sheet = image::contact_sheet(&[a, b, differences], 3, 2, background);
        image::write_png(path, &sheet, None, PngDepth::Eight)?;
        terminal.say(&format!("wrote {}: first, second, difference times {factor}", path.display()));
    }
    print_result(args.json, &comparison, &comparison)?;
    let failed = args.fail_above.is_some_and(|bound| bound.is_nan() || metrics.max > bound);
    Ok(if failed { Outcome::CheckFailed } else { Outcome::Done })
}

/// Compares planes that both images have.
fn of_both<P, M>(
    a: &Plane<P>,
    b: &Plane<P>,
    compare: impl FnOnce(&Plane<P>, &Plane<P>) -> Result<M, MetricsError>,
) -> Result<Option<M>, MetricsError> {
    let are_there = !a.pixels.is_empty() && !b.pixels.is_empty();
    are_there.then(|| compare(a, b)).transpose()
}

#[derive(Serialize)]
struct Comparison {
    #[serde(flatten)]
    metrics: ImageMetrics,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<PlaneMetrics>,
    #[serde(skip_serializing_if = "Option::is_none")]
    normal: Option<PlaneMetrics>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<IdMetrics>,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let m = &self.metrics;
        writeln!(
            f,
            "max {:.3e}  rmse {:.3e}  psnr {:.2} dB  ssim {:.5}  flip {:.5}",
            m.max, m.rmse, m.psnr, m.ssim, m.flip
        )?;
        for (plane, unit, metrics) in [("depth", "", &self.depth), ("normal", " degrees", &self.normal)] {
            let Some(PlaneMetrics { max, rmse, compared, unmatched }) = metrics else { continue };
            writeln!(
                f,
                "{plane}: max {max:.3e}{unit}  rmse {rmse:.3e}  over {compared} pixels; {unmatched} in one image only"
            )?;
        }
        match &self.id {
            Some(IdMetrics { different, compared }) => writeln!(f, "id: {different} of {compared} pixels differ"),
            None => Ok(()),
        }
    }
}
