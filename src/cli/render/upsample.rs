//! Options for images rendered at another size than written.

use crate::image::upsample::MAX_KERNEL_PX;
use crate::pipeline::{DepthEdges, ImageScale, UpsampleFilter, UpsampleKind, Upsampling};
use crate::render::cpu::layers::MAX_LAYERS;
use anyhow::bail;

/// Options of upsampling.
#[derive(Debug, Clone, Default, clap::Args)]
pub(super) struct UpsampleArgs {
    /// Size of the image that is rendered and then brought to full size, in each direction: 1, 1/2, 1/4 or 1/8 (docs/sampling.md)
    #[arg(long, value_name = "SCALE", default_value = "1", allow_hyphen_values = true)]
    image_scale: ImageScale,
    /// How a small image comes to full size: nearest, bilinear, or by depths of the domain's boundary joint or joint2x2 (default: bilinear);
    /// with --lod also joint alone
    #[arg(long, value_name = "FILTER")]
    upsample: Option<UpsampleKind>,
    /// Width of joint in pixels, 1 to 64 (default: 4, 8 and 16 for 1/2, 1/4 and 1/8; 8 at full size)
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true, value_parser = clap::value_parser!(u64).range(1..=MAX_KERNEL_PX as u64))]
    kernel: Option<u64>,
    /// Differences of depth that joint and joint2x2 take for an edge, as a share of the range of depths in view (default: 0.01)
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, value_parser = parse_sigma)]
    sigma_depth: Option<f64>,
    /// Layers of depth that joint and joint2x2 compare, 1 to 3 (default: 3)
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true, value_parser = clap::value_parser!(u64).range(1..=MAX_LAYERS as u64))]
    layers: Option<u64>,
}

fn parse_sigma(text: &str) -> Result<f64, String> {
    let sigma = text.parse().ok().filter(|sigma: &f64| *sigma > 0.0 && sigma.is_finite());
    sigma.ok_or_else(|| format!("'{text}' is no finite number above 0; try 0.01"))
}

impl UpsampleArgs {
    /// The upsampling of these options; `leaves_faces_out`: whether some frame omits faces.
    pub(super) fn upsampling(&self, leaves_faces_out: bool) -> anyhow::Result<Option<Upsampling>> {
        let Self { image_scale: scale, kernel, sigma_depth, layers, .. } = *self;
        let kind = match self.upsample {
            None if scale == ImageScale::Full => None,
            Some(kind) if scale == ImageScale::Full && !(leaves_faces_out && kind == UpsampleKind::Joint) => bail!(
                "--upsample {kind} has nothing to do at full size; choose an --image-scale of 1/2, 1/4 or 1/8, or --lod with --upsample joint"
            ),
            kind => Some(kind.unwrap_or_default()),
        };
        self.refuse_numbers(kind)?;
        let Some(kind) = kind else { return Ok(None) };
        let mut filter = kind.usual(scale);
        match &mut filter {
            UpsampleFilter::Joint { kernel_px, edges } => {
                *kernel_px = kernel.map_or(*kernel_px, |kernel| kernel as usize);
                set(edges, sigma_depth, layers);
            }
            UpsampleFilter::Joint2x2 { edges } => set(edges, sigma_depth, layers),
            UpsampleFilter::Nearest | UpsampleFilter::Bilinear => {}
        }
        Ok(Some(Upsampling { scale, filter }))
    }

    /// Refuses parameters of filters that are not chosen.
    fn refuse_numbers(&self, kind: Option<UpsampleKind>) -> anyhow::Result<()> {
        let of_edges = [UpsampleKind::Joint, UpsampleKind::Joint2x2];
        for (option, is_given, takers) in [
            ("--kernel", self.kernel.is_some(), &of_edges[..1]),
            ("--sigma-depth", self.sigma_depth.is_some(), &of_edges[..]),
            ("--layers", self.layers.is_some(), &of_edges[..]),
        ] {
            if is_given && kind.is_none_or(|kind| !takers.contains(&kind)) {
                let takers: Vec<String> = takers.iter().map(|kind| format!("--upsample {kind}")).collect();
                bail!("{option} is for {}; choose that, or leave {option} out", takers.join(" and "));
            }
        }
        Ok(())
    }
}

fn set(edges: &mut DepthEdges, sigma_depth: Option<f64>, layers: Option<u64>) {
    edges.sigma_depth = sigma_depth.unwrap_or(edges.sigma_depth);
    edges.layers = layers.map_or(edges.layers, |layers| layers as usize);
}
