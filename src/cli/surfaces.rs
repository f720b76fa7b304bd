//! The options that say which surfaces are seen.

use crate::pipeline::{Shown, SurfaceLook};
use crate::project::Project;
use crate::render::surfaces::{self, IsosurfaceText, Light, Normals, SurfaceShading};
use crate::short::Short;
use crate::store::StoredField;
use anyhow::bail;

/// Surfaces in the volume, and whether that is seen.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct SurfaceArgs {
    /// Isosurface at a value of the field, once for each (at most 32): VALUE[:COLOR[/BACK]][:OPACITY], COLOR as #rrggbb (default: that of
    /// the transfer function), BACK that of the side towards higher values
    #[arg(long, value_name = "ISO", allow_hyphen_values = true)]
    iso: Vec<IsosurfaceText>,
    /// Leave the volume out and draw surfaces alone
    #[arg(long)]
    no_volume: bool,
    /// Normals of lit surfaces: cell (flat facets), vertex (smooth), or none (colours as they are)
    #[arg(long, value_name = "NORMALS", default_value = "cell")]
    shade: Normals,
    /// Where light on surfaces comes from: headlight (the eye), or a direction x,y,z towards it
    #[arg(long, value_name = "LIGHT", default_value = "headlight", allow_hyphen_values = true)]
    light: Light,
}

impl SurfaceArgs {
    /// What looks have of them.
    pub(super) fn look(&self) -> anyhow::Result<SurfaceLook> {
        let Self { iso, no_volume, shade, light } = self;
        let isosurfaces: Vec<_> = iso.iter().map(|IsosurfaceText(surface)| *surface).collect();
        let shading = SurfaceShading { normals: *shade, light: *light };
        if let Err(error) = surfaces::check(&isosurfaces, &shading) {
            bail!("--iso: {error}");
        }
        if *no_volume && isosurfaces.is_empty() {
            bail!("--no-volume leaves nothing to be seen; add --iso VALUE, or leave it out");
        }
        let shown = match (isosurfaces.is_empty(), no_volume) {
            (true, _) => Shown::Volume,
            (false, true) => Shown::Surfaces,
            (false, false) => Shown::Both,
        };
        Ok(SurfaceLook { isosurfaces, shading, shown })
    }
}

/// Whether all isosurfaces lie within the range of the whole series, that of the timeline at some time: one that does not is never
/// seen.
pub(super) fn check_range(look: &SurfaceLook, project: Option<&Project>, field: &StoredField) -> anyhow::Result<()> {
    let name = &field.name;
    let moved = project.map_or(&[][..], |project| project.timeline.isovalue.keys());
    for (surface, is_last) in
        look.isosurfaces.iter().zip(1..).map(|(surface, n)| (surface, n == look.isosurfaces.len()))
    {
        let value = Short(surface.value);
        // Between its keys it has all values in between.
        let values = moved.iter().map(|key| key.value).filter(|_| is_last);
        let [least, most] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|which| values.clone().reduce(which).unwrap_or(surface.value));
        match field.range.map(|range| range.map(f64::from)) {
            Some([lo, hi]) if most >= lo && least <= hi => {}
            Some([lo, hi]) => {
                let (lo, hi) = (Short(lo), Short(hi));
                bail!("--iso {value} is never met: field {name} goes from {lo} to {hi}; choose a value in between");
            }
            None => bail!("--iso {value} is never met: field {name} has no finite value"),
        }
    }
    Ok(())
}
