//! Options for surfaces.

use crate::field::{Association, Blocks, Regions};
use crate::look::colors_beside;
use crate::mesh::Mesh;
use crate::pipeline::{ColorsBeside, RequestError, Series, Shown, SurfaceLook};
use crate::project::Project;
use crate::render::domain::DomainSurface;
use crate::render::surfaces::{
    self, ByField, CropBox, Cut, CutText, Isosurface, IsosurfaceText, Light, Normals, SurfaceShading, cut_planes,
};
use crate::short::Short;
use crate::store::StoredField;
use crate::transfer::{Lengths, TransferFunction};
use anyhow::{Context, bail};

/// Surfaces in the volume, and whether the volume is shown.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct SurfaceArgs {
    /// Isosurface at a value of the field, once for each (at most 32): VALUE[:COLOR[/BACK]][:OPACITY], COLOR as #rrggbb (default: that of
    /// the transfer function), BACK that of the side towards higher values; VALUE:by=FIELD[@MAP[:OPACITY]] has the colours of another field
    #[arg(long, value_name = "ISO", allow_hyphen_values = true)]
    iso: Vec<IsosurfaceText>,
    /// Plane through the cells, once for each: "point=x,y,z normal=x,y,z" shows its section in the colours of the transfer function, or
    /// with field=NAME[@MAP] behind it of another field; with clip what lies on the side that the normal points to is cut away
    #[arg(long, value_name = "CUT")]
    cut: Vec<CutText>,
    /// Cut away what lies outside of a box: "min=x,y,z max=x,y,z"
    #[arg(long, value_name = "BOX")]
    crop: Option<CropBox>,
    /// Draw the surface of the domain, once for each: solid, wireframe or edges[:COLOR][:OPACITY], in the colours of the transfer function
    /// where none is given; or that of regions, whatever --regions shows: solid:FIELD=VALUE,FROM..TO[:COLOR][:OPACITY]
    #[arg(long, value_name = "SURFACE")]
    surface: Vec<DomainSurface>,
    /// Show these connected parts of the mesh alone, by their numbers: 0 has most cells
    #[arg(long, value_name = "0,2,..", value_delimiter = ',')]
    parts: Vec<u32>,
    /// Show the cells alone in which a field of cells has these values, as those of blocks or materials: FIELD=VALUE,FROM..TO
    #[arg(long, value_name = "REGIONS", allow_hyphen_values = true)]
    regions: Option<Regions>,
    /// Leave the volume out and draw surfaces and sections alone
    #[arg(long)]
    no_volume: bool,
    /// Light on isosurfaces: cell (a facet a cell), vertex (smooth), screen (normals from the depths of neighbouring pixels), depth (the
    /// farther the darker), or none (colours as they are)
    #[arg(long, value_name = "NORMALS", default_value = "cell")]
    shade: Normals,
    /// Light the volume by its gradients as well
    #[arg(long)]
    shade_volume: bool,
    /// Where light on surfaces comes from: headlight (the eye), or a direction x,y,z towards it
    #[arg(long, value_name = "LIGHT", default_value = "headlight", allow_hyphen_values = true)]
    light: Light,
    /// Darken surfaces that are hidden by what is around them (ambient occlusion, found on the image)
    #[arg(long)]
    ao: bool,
    /// Leave depths as they are where faces are left out (--lod); otherwise they are smoothed for --shade screen, depth and --ao
    #[arg(long)]
    no_smoothing: bool,
}

impl SurfaceArgs {
    /// Whether there is an isosurface.
    pub(super) fn has_isosurfaces(&self) -> bool {
        !self.iso.is_empty()
    }

    /// Whether lighting of surfaces needs the whole image.
    pub(super) fn needs_whole_image(&self) -> bool {
        let is_of_screen = self.ao || matches!(self.shade, Normals::Screen | Normals::Depth);
        is_of_screen && !(self.iso.is_empty() && self.cut.iter().all(|of| of.cut.clips))
    }

    /// The surfaces of a look: `series` is the field shown, beside which others are opened; `tf` gives its colours to surfaces without
    /// their own, and with flow there is something to be seen without them.
    pub(super) fn look(
        &self,
        series: &Series,
        tf: &TransferFunction,
        lengths: Lengths,
        has_flow: bool,
    ) -> anyhow::Result<SurfaceLook> {
        let Self { iso, cut, crop, surface, parts, regions, no_volume, .. } = self;
        let Self { shade, shade_volume, light, ao, no_smoothing, .. } = self;
        let mut beside = Beside { series, tf, lengths, found: Vec::new(), colors: Vec::new() };
        let mut isosurfaces = Vec::with_capacity(iso.len());
        for IsosurfaceText { surface, by } in iso {
            isosurfaces.push(Isosurface { by: beside.place(by.as_ref())?, ..*surface });
        }
        let mut cuts = Vec::with_capacity(cut.len());
        for CutText { cut, by } in cut {
            cuts.push(Cut { by: beside.place(by.as_ref())?, ..*cut });
        }
        let maps = beside.found.into_iter().map(|by| by.map).collect();
        let beside = beside.colors;
        let shading = SurfaceShading {
            normals: *shade,
            light: *light,
            volume: *shade_volume,
            ambient_occlusion: *ao,
            smooth: !no_smoothing,
        };
        if let Err(error) = surfaces::check(&isosurfaces, &shading) {
            bail!("--iso: {error}");
        }
        if *no_volume && !has_flow && isosurfaces.is_empty() && surface.is_empty() && cuts.iter().all(|cut| cut.clips) {
            bail!(
                "--no-volume leaves nothing to be seen; add --iso VALUE, a --cut, --surface or --flow, or leave it out"
            );
        }
        let shown = match (isosurfaces.is_empty(), no_volume) {
            (true, false) => Shown::Volume,
            (_, true) => Shown::Surfaces,
            (false, false) => Shown::Both,
        };
        Ok(SurfaceLook {
            isosurfaces,
            cuts,
            crop: *crop,
            domain: surface.clone(),
            beside,
            maps,
            parts: parts.clone(),
            regions: regions.clone(),
            shading,
            shown,
        })
    }
}

/// Fields opened beside a series.
struct Beside<'a> {
    series: &'a Series,
    tf: &'a TransferFunction,
    lengths: Lengths,
    found: Vec<ByField>,
    colors: Vec<ColorsBeside>,
}

impl Beside<'_> {
    /// The index of a field, which is added if new.
    fn place(&mut self, by: Option<&ByField>) -> anyhow::Result<Option<u8>> {
        let Some(by) = by else { return Ok(None) };
        let place = match self.found.iter().position(|found| found == by) {
            Some(place) => place,
            None => {
                let colors = colors_beside(self.series, self.tf, self.lengths, by);
                self.colors.push(colors.with_context(|| format!("colours by '{by}'"))?);
                self.found.push(by.clone());
                self.found.len() - 1
            }
        };
        Ok(Some(u8::try_from(place).context("surfaces have the colours of 256 other fields at most")?))
    }
}

/// Checks that all surfaces are visible in a series: [`check_range`] and [`check_cuts`].
pub(super) fn check(look: &SurfaceLook, project: Option<&Project>, series: &Series) -> anyhow::Result<()> {
    check_parts(look, series.mesh())?;
    if let Some(regions) = &look.regions {
        check_regions("--regions ", regions, series)?;
    }
    for surface in &look.domain {
        if let Some(regions) = &surface.regions {
            check_regions(&format!("--surface {}:", surface.style), regions, series)?;
        }
    }
    check_range(look, project, series.field())?;
    check_cuts(look, project, series.mesh())
}

/// Checks that the mesh has the chosen parts.
fn check_parts(look: &SurfaceLook, mesh: &Mesh) -> anyhow::Result<()> {
    if look.parts.is_empty() {
        return Ok(());
    }
    if !mesh.is_connected {
        return Err(RequestError::Unconnected("connected parts").into());
    }
    let (_, sizes) = mesh.topology.connectivity().parts();
    if let Some(part) = look.parts.iter().find(|part| **part as usize >= sizes.len()) {
        let cells: Vec<String> = sizes.iter().take(10).map(ToString::to_string).collect();
        let more = if sizes.len() > 10 { ", .." } else { "" };
        let count = if sizes.len() == 1 { "1 part".to_owned() } else { format!("{} parts", sizes.len()) };
        bail!("--parts {part}: the mesh has {count}, counted from 0, of {}{more} cells", cells.join(", "));
    }
    Ok(())
}

/// Checks that regions are of a field of cells, and that some value of it is among those chosen; `option` is what they are behind.
fn check_regions(option: &str, regions: &Regions, series: &Series) -> anyhow::Result<()> {
    let named = || format!("{option}{regions}");
    let of = match series.beside(&regions.field.parse().map_err(anyhow::Error::msg)?) {
        Ok(of) => of,
        Err(error) if regions.field == Blocks::FIELD => {
            let numbers = series.block_numbers().map_err(|_| error).with_context(named)?;
            if !numbers.iter().any(|&number| regions.show(number)) {
                bail!("{}: no cell is of such a block", named());
            }
            return Ok(());
        }
        Err(error) => return Err(error).with_context(named),
    };
    if of.values_of() == Association::Point {
        bail!("{}: '{}' has values of vertices; regions are chosen by a field of cells", named(), regions.field);
    }
    match of.field().range {
        Some(range) if !regions.meet(range) => {
            bail!(
                "{}: no cell has such a value; those of '{}' go from {} to {}",
                named(),
                regions.field,
                Short(range[0]),
                Short(range[1])
            )
        }
        _ => Ok(()),
    }
}

/// Checks that all isosurfaces lie within the range of the whole series, that of the timeline at some time: others are never visible.
fn check_range(look: &SurfaceLook, project: Option<&Project>, field: &StoredField) -> anyhow::Result<()> {
    let name = &field.name;
    let moved = project.map_or(&[][..], |project| project.timeline.isovalue.keys());
    for (surface, is_last) in
        look.isosurfaces.iter().zip(1..).map(|(surface, n)| (surface, n == look.isosurfaces.len()))
    {
        let value = Short(surface.value);
        // Between keys all values in between occur.
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

/// Checks that cuts leave something of the mesh, at some time if the timeline moves one, and that all sections meet the rest.
fn check_cuts(look: &SurfaceLook, project: Option<&Project>, mesh: &Mesh) -> anyhow::Result<()> {
    let keys = project.map_or(&[][..], |project| project.timeline.cut.keys());
    // Between keys the last cut has all positions in between.
    let [least, most] = [f64::min as fn(f64, f64) -> f64, f64::max]
        .map(|which| keys.iter().map(|key| key.value).reduce(which).unwrap_or(0.0));
    let places = look.cuts.iter().enumerate().map(|(at, cut)| match at + 1 == look.cuts.len() {
        true => [cut.moved(least), cut.moved(most)],
        false => [*cut; 2],
    });
    let (clips, sections): (Vec<[Cut; 2]>, Vec<[Cut; 2]>) = places.partition(|[cut, _]| cut.clips);
    // The farther along its normal a clip is, the more is left.
    let mut clips: Vec<Cut> = clips.into_iter().map(|[_, most]| most).collect();
    clips.extend(look.crop.iter().flat_map(CropBox::cuts));
    let leave_something = |cuts: &[Cut]| -> anyhow::Result<bool> {
        let planes = cut_planes(cuts, &mesh.positions).map_err(|error| anyhow::anyhow!("--cut: {error}"))?;
        Ok(planes.leave_something_of(mesh))
    };
    let (lo, hi) = mesh.positions.world_bounds();
    let corner = |p: glam::DVec3| format!("{},{},{}", Short(p.x), Short(p.y), Short(p.z));
    let bounds = format!("the mesh goes from {} to {}", corner(lo), corner(hi));
    if !leave_something(&clips)? {
        let options = if look.cuts.is_empty() { "--crop leaves" } else { "--cut and --crop leave" };
        bail!("{options} nothing: {bounds}; move a plane, or turn its normal around");
    }
    for [least, most] in sections {
        // The part neither before all of its positions nor behind them.
        let turned = Cut { normal: least.normal.map(|x| -x), ..least };
        let between = [most, turned].map(|cut| Cut { clips: true, ..cut });
        if !leave_something(&[&clips[..], &between].concat())? {
            bail!("--cut \"{least}\" meets nothing: {bounds}; choose a point in what is left");
        }
    }
    Ok(())
}
