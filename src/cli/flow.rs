//! Options of flow.

use crate::field::FieldSelector;
use crate::look::{FlowLook, colors_beside};
use crate::pipeline::{FlowLayer, Series};
use crate::render::flow::{FlowFidelity, FlowStyle, FlowVolume, IconName, Thresholds};
use crate::render::surfaces::ByField;
use crate::task::Cancel;
use crate::transfer::{Lengths, TransferFunction};
use anyhow::{Context, anyhow, bail};
use std::path::absolute;

/// Options for a field of vectors as textured splats.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct FlowArgs {
    /// Show the flow of a field of vectors in motion, as textured splats within the volume (docs/flow.md)
    #[arg(long, value_name = "FIELD")]
    flow: Option<String>,
    /// Pattern along the flow: strokes, lines, particles, arrows, or FILE.png, grey and periodic. Several by a value: ICON,ICON@FROM,..., each
    /// further one from its value on, cross-faded around it
    #[arg(long, value_name = "ICON", default_value = "strokes")]
    flow_icon: Thresholds<IconName>,
    /// Field by which one of several patterns is chosen (default: the length of the vectors)
    #[arg(long, value_name = "FIELD")]
    flow_by: Option<FieldSelector>,
    /// Number of splats, evenly through the volume (default: one at each vertex, or in each cell if the vectors are of cells)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    flow_splats: Option<u32>,
    /// Width of a splat, in edges of the cells around
    #[arg(long, value_name = "C", default_value_t = FlowStyle::default().size, allow_hyphen_values = true)]
    flow_size: f64,
    /// Length of a period of the pattern, in world units (default: four edges of the mesh)
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    flow_length: Option<f64>,
    /// Opacity of the pattern, 0 to 1
    #[arg(long, value_name = "A", default_value_t = FlowStyle::default().opacity, allow_hyphen_values = true)]
    flow_opacity: f64,
    /// World length that a vector of length 1 moves in a unit of the series' time
    #[arg(long, value_name = "F", default_value_t = FlowStyle::default().speed, allow_hyphen_values = true)]
    flow_speed: f64,
    /// Time of the series a second with which the flow goes on while a step is held (default: nine tenths of the volume move by less than a
    /// quarter of a period a frame)
    #[arg(long, value_name = "R", allow_hyphen_values = true)]
    flow_rate: Option<f64>,
    /// Patterns of vectors nearly along the ray: smooth (they fade), or paper (compressed by three at most, as printed: they spin)
    #[arg(long, value_name = "FIDELITY", default_value = "smooth")]
    flow_fidelity: FlowFidelity,
    /// What shows the scalars: exact (the cells), splats (their kernels, as in the paper), or none
    #[arg(long, value_name = "VOLUME", default_value = "exact")]
    flow_volume: FlowVolume,
    /// Colours of the pattern by a field: NAME[@MAP] (default: orange)
    #[arg(long, value_name = "FIELD")]
    flow_color: Option<ByField>,
}

impl FlowArgs {
    /// Whether there is flow.
    pub(super) fn is_some(&self) -> bool {
        self.flow.is_some()
    }

    /// The flow of a look, if there is some; `tf` gives its colours to a field without a map.
    pub(super) fn look(
        &self,
        series: &Series,
        tf: &TransferFunction,
        lengths: Lengths,
    ) -> anyhow::Result<Option<FlowLook>> {
        let style = FlowStyle {
            icon: self.flow_icon.generated().unwrap_or_default(),
            size: self.flow_size,
            length: self.flow_length,
            opacity: self.flow_opacity,
            speed: self.flow_speed,
            splats: self.flow_splats,
            fidelity: self.flow_fidelity,
            volume: self.flow_volume,
        };
        let Some(field) = self.flow.clone() else {
            let has_icons = self.flow_icon.generated().is_none() || self.flow_by.is_some();
            let has_more = has_icons || self.flow_rate.is_some() || self.flow_color.is_some();
            if style != FlowStyle::default() || has_more {
                bail!(
                    "the options --flow-... are about a field of vectors; name it by --flow FIELD, or leave them out"
                );
            }
            return Ok(None);
        };
        style.check().map_err(|problem| anyhow!("--flow: {problem}"))?;
        self.flow_rate.map_or(Ok(()), FlowLook::check_rate).map_err(|problem| anyhow!("--flow: {problem}"))?;
        let by = self.flow_color.as_ref();
        let colors = by.map(|by| colors_beside(series, tf, lengths, by)).transpose().context("--flow-color")?;
        let layer = FlowLayer { colors, ..FlowLayer::new(field, style) };
        layer.check(series).map_err(|error| anyhow!("--{error}"))?;
        let (layer, icons) = self.with_icons(layer, series)?;
        Ok(Some(FlowLook { layer, color_by: self.flow_color.clone(), icons, rate: self.flow_rate }))
    }

    /// The layer with the icons of the options, and their names, unless it has a generated one alone.
    fn with_icons(
        &self,
        layer: FlowLayer,
        series: &Series,
    ) -> anyhow::Result<(FlowLayer, Option<Thresholds<IconName>>)> {
        if self.flow_by.is_some() && self.flow_icon.further.is_empty() {
            bail!(
                "--flow-by chooses among several icons; add one by --flow-icon {},arrows@FROM, or leave it out",
                self.flow_icon
            );
        }
        if self.flow_icon.generated().is_some() {
            return Ok((layer, None));
        }
        let names = self.flow_icon.clone().with_paths(|file| absolute(&file).unwrap_or(file));
        let icons = names.try_map(IconName::read).context("--flow-icon")?;
        let option = if self.flow_by.is_some() { "--flow-by" } else { "--flow-icon" };
        let layer = layer.with_icons(series, icons, self.flow_by.as_ref(), &Cancel::new()).context(option)?;
        Ok((layer, Some(names)))
    }
}
