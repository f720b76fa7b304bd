//! What a frame shows, layer by layer, as plain data.

use super::text::shared;
use super::{FrameRequest, TetDraw};
use crate::camera::PixelSetError;
use crate::node_table::{NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::render::domain::{self, DomainSurface};
use crate::render::surfaces::{self, CropBox, Cut, CutError, Isosurface, SurfaceError, SurfaceShading};
use crate::transfer::TransferSource;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A layer of a frame: a closed set, so that whoever draws, keeps or writes frames knows all that can be asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// The cells of the mesh.
    Tets(TetLayer),
}

impl Layer {
    /// The layer of cells, if it is that.
    pub fn tets(&self) -> Option<&TetLayer> {
        let Self::Tets(layer) = self;
        Some(layer)
    }

    /// The layer of cells, to be changed.
    pub(super) fn tets_mut(&mut self) -> Option<&mut TetLayer> {
        let Self::Tets(layer) = self;
        Some(layer)
    }

    /// Whether both show the same.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        let (Self::Tets(layer), Self::Tets(other)) = (self, other);
        layer.looks_like(other)
    }

    /// Why it cannot be drawn, whatever the series holds.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self::Tets(layer) = self;
        surfaces::check(&layer.surfaces, &layer.shading).map_err(|error| error.to_string())?;
        surfaces::check_cuts(&layer.cuts).map_err(|error| error.to_string())?;
        domain::check(&layer.domain)?;
        let by = layer.surfaces.iter().map(|surface| surface.by).chain(layer.cuts.iter().map(|cut| cut.by)).flatten();
        if let Some(by) = by.into_iter().find(|by| usize::from(*by) >= layer.beside.len()) {
            return Err(format!("a surface has the colours of field {by} beside, of {}", layer.beside.len()));
        }
        layer.draw.drawn_by().faces().map_or(Ok(()), |detail| detail.check())
    }
}

/// The cells of a mesh with the scalars of a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TetLayer {
    /// Name of the field, as the series has it ([`StoredField::name`](crate::store::StoredField::name)); `None`: that of the series,
    /// whichever it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Transfer function over the field's scalars.
    pub table: TransferTable,
    /// What the table was made from, if that is known: the reference evaluates it by its formula, and the table without it.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "shared")]
    pub formula: Option<Arc<TransferSource>>,
    /// How segments are integrated; the reference does it in its own way.
    #[serde(default)]
    pub optics: OpticsKind,
    /// Isosurfaces in the cells.
    #[serde(default)]
    pub surfaces: Vec<Isosurface>,
    /// Planes through the cells: sections, and clips of volume, surfaces and sections.
    #[serde(default)]
    pub cuts: Vec<Cut>,
    /// Other fields of the store, whose colours surfaces and sections have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<ColorsBeside>,
    /// The surface of the domain, once for each way to draw it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub domain: Vec<DomainSurface>,
    /// The connected parts of the mesh that are shown, by their numbers ([`Topology::parts`](crate::mesh::Topology::parts)); all if there is none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<u32>,
    /// Light on surfaces.
    #[serde(default)]
    pub shading: SurfaceShading,
    /// Whether the volume is drawn.
    #[serde(default = "volume")]
    pub volume: bool,
    /// How the cells are drawn.
    #[serde(default)]
    pub draw: TetDraw,
}

/// Another field of the store, and its colours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorsBeside {
    /// Name of the field as options have it: `NAME`, `NAME:mag` or `NAME:0`.
    pub field: String,
    /// A table of colours over its scalars.
    #[serde(with = "whole")]
    pub colors: Arc<NodeTable>,
}

/// A shared table by what is in it.
mod whole {
    use crate::node_table::NodeTable;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub(super) fn serialize<S: Serializer>(table: &Arc<NodeTable>, serializer: S) -> Result<S::Ok, S::Error> {
        table.as_ref().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(data: D) -> Result<Arc<NodeTable>, D::Error> {
        Ok(Arc::new(NodeTable::deserialize(data)?))
    }
}

impl TetLayer {
    /// The volume of the series' own field, with everything else as by default: the fastest accurate renderer, exact optics.
    pub fn new(table: impl Into<TransferTable>) -> Self {
        Self {
            field: None,
            table: table.into(),
            formula: None,
            optics: OpticsKind::default(),
            surfaces: Vec::new(),
            cuts: Vec::new(),
            beside: Vec::new(),
            domain: Vec::new(),
            parts: Vec::new(),
            shading: SurfaceShading::default(),
            volume: true,
            draw: TetDraw::default(),
        }
    }

    /// Shows these surfaces, or the volume, or both, cut by planes.
    pub fn show(&mut self, look: &SurfaceLook) {
        let sides = look.crop.iter().flat_map(CropBox::cuts);
        self.cuts = look.cuts.iter().copied().chain(sides).collect();
        (self.domain, self.beside, self.parts) = (look.domain.clone(), look.beside.clone(), look.parts.clone());
        self.surfaces = if look.shown == Shown::Volume { Vec::new() } else { look.isosurfaces.clone() };
        (self.shading, self.volume) = (look.shading, look.shown != Shown::Surfaces);
    }

    /// Whether nothing of it is to be seen, whatever the field.
    pub(super) fn is_empty(&self) -> bool {
        !self.volume && self.surfaces.is_empty() && self.domain.is_empty() && self.cuts.iter().all(|cut| cut.clips)
    }

    /// Whether it shows something in the colours of its transfer function beside the volume: these come from the formula.
    pub(super) fn has_colored_surfaces(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.front.is_none())
            || self.cuts.iter().any(|cut| !cut.clips)
            || self.domain.iter().any(|surface| surface.color.is_none())
    }

    /// Whether the picture depends on the formula, and not on the table alone.
    pub(super) fn needs_formula(&self) -> bool {
        self.draw == TetDraw::Reference || self.has_colored_surfaces()
    }

    /// Whether both show the same.
    fn looks_like(&self, other: &Self) -> bool {
        let Self { field, table, formula, optics, surfaces, cuts, beside, domain, parts, shading, volume, draw } = self;
        (field, surfaces, cuts, domain) == (&other.field, &other.surfaces, &other.cuts, &other.domain)
            && (beside, parts) == (&other.beside, &other.parts)
            && (*optics, *shading, *volume, *draw) == (other.optics, other.shading, other.volume, other.draw)
            && *table == other.table
            && (!self.needs_formula() || *formula == other.formula)
    }
}

/// What is to be seen of a field beside colours and opacities of its volume: the part of a [`TetLayer`] that looks have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceLook {
    /// Isosurfaces in the cells.
    pub isosurfaces: Vec<Isosurface>,
    /// Planes through volume and surfaces.
    pub cuts: Vec<Cut>,
    /// The box that is left of both.
    pub crop: Option<CropBox>,
    /// The surface of the domain.
    pub domain: Vec<DomainSurface>,
    /// Other fields, whose colours surfaces and sections have.
    pub beside: Vec<ColorsBeside>,
    /// The parts of the mesh that are shown; all if there is none.
    pub parts: Vec<u32>,
    /// Light on isosurfaces.
    pub shading: SurfaceShading,
    /// Which of the two are drawn.
    pub shown: Shown,
}

/// What a timeline says of the surfaces of a look; `None`: nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeyedSurfaces {
    /// Isovalue of the last surface.
    pub isovalue: Option<f64>,
    /// Its opacity.
    pub opacity: Option<f64>,
    /// How far the last cut is moved along its normal, world units.
    pub cut: Option<f64>,
}

/// Which of the volume and the surfaces in it are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shown {
    /// The volume alone.
    #[default]
    Volume,
    /// Surfaces alone.
    Surfaces,
    /// Both.
    Both,
}

impl SurfaceLook {
    /// The next of volume, surfaces and both. If there is no surface, one at `isovalue`.
    pub fn show_next(&mut self, isovalue: f64) {
        self.shown = match self.shown {
            Shown::Volume => Shown::Surfaces,
            Shown::Surfaces => Shown::Both,
            Shown::Both => Shown::Volume,
        };
        if self.shown != Shown::Volume && self.isosurfaces.is_empty() {
            self.isosurfaces.push(Isosurface::new(isovalue));
        }
    }

    /// The surfaces as they are at a moment.
    #[must_use]
    pub fn at(&self, moment: KeyedSurfaces) -> Self {
        let mut look = self.clone();
        if let Some(surface) = look.isosurfaces.last_mut() {
            surface.value = moment.isovalue.unwrap_or(surface.value);
            surface.opacity = moment.opacity.unwrap_or(surface.opacity);
        }
        if let (Some(cut), Some(by)) = (look.cuts.last_mut(), moment.cut) {
            *cut = cut.moved(by);
        }
        look
    }

    /// Moves the last surface by `by`, no further than the ends of a range.
    pub fn move_isovalue(&mut self, by: f64, (lo, hi): (f64, f64)) {
        if let Some(surface) = self.isosurfaces.last_mut() {
            surface.value = (surface.value + by).clamp(lo, hi);
        }
    }
}

/// What a text means that does not say.
fn volume() -> bool {
    true
}

/// Why there is no frame of a request, whatever the series holds, or no request of a text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// Two layers of cells.
    #[error("layers {first} and {second} of the request are both of cells (tets); a frame has one of them")]
    TwoOfCells {
        /// Place of the first of them.
        first: usize,
        /// Place of the next one.
        second: usize,
    },
    /// A field that is not played.
    #[error("the request is for the field '{asked}', but the series is of '{played}'; ask for that, or open the other")]
    OtherField {
        /// Name of the field asked for.
        asked: String,
        /// Name of the field that the series is of.
        played: String,
    },
    /// Listed pixels that are none of the image's.
    #[error("the pixels of the request: {0}")]
    Pixels(#[from] PixelSetError),
    /// Surfaces that there cannot be.
    #[error("the surfaces of the request: {0}")]
    Surfaces(#[from] SurfaceError),
    /// Light that is found on an image of which not all is there.
    #[error(
        "shading by screen, by depth and ambient occlusion need the rays of all pixels; leave them out, or cast all rays"
    )]
    ScreenOfSome,
    /// Contrast decides which rays are cast, and no rays go from cell to cell.
    #[error(
        "rays that contrast asks for go from cell to cell, and {0} draws otherwise; choose raycast or auto, or cast all rays"
    )]
    AdaptiveBy(&'static str),
    /// Details of another moment that do not fit.
    #[error("details of an earlier frame cannot be used here: {0}; ask for the frame without them")]
    Details(&'static str),
    /// An image that is brought to full size, and that is not all there or judged.
    #[error("an image that is enlarged needs all of its rays, and is drawn by any renderer but the reference; {0}")]
    Upsampling(String),
    /// No field of that name beside the one that is shown.
    #[error("the field beside {0}")]
    NoFieldBeside(String),
    /// Planes that there cannot be.
    #[error("the cuts of the request: {0}")]
    Cuts(#[from] CutError),
    /// A text that this program does not know.
    #[error("version {0} of a request's text is not known; this program reads {known}", known = FrameRequest::TEXT_VERSION)]
    Version(u32),
    /// A text that is none, with its place.
    #[error("the text of the request: {0}")]
    BadText(String),
    /// A request that has no text that could be read.
    #[error("the request has no text: {0}")]
    NoText(String),
}

#[cfg(test)]
#[path = "layer_tests.rs"]
mod tests;
