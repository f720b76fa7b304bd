//! The layers of a request, as plain data.

use super::{DrawnBy, FlowLayer, FrameRequest, TetDraw};
use crate::camera::PixelSetError;
use crate::field::Regions;
use crate::node_table::{NodeTable, TransferTable};
use crate::optics::OpticsKind;
use crate::render::domain::{self, DomainSurface};
use crate::render::functions::FunctionForm;
use crate::render::surfaces::{self, CropBox, Cut, CutError, Isosurface, SurfaceError, SurfaceShading};
use crate::transfer::TransferSource;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A layer of a frame. The set is closed, so that renderers, caches and writers know every kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layer {
    /// The cells of the mesh.
    Tets(TetLayer),
    /// A field of vectors as textured splats.
    Flow(FlowLayer),
}

impl Layer {
    /// The layer of cells; `None` for another kind.
    pub fn tets(&self) -> Option<&TetLayer> {
        match self {
            Self::Tets(layer) => Some(layer),
            Self::Flow(_) => None,
        }
    }

    /// The layer of cells, mutable.
    pub(super) fn tets_mut(&mut self) -> Option<&mut TetLayer> {
        match self {
            Self::Tets(layer) => Some(layer),
            Self::Flow(_) => None,
        }
    }

    /// The layer of flow; `None` for another kind.
    pub fn flow(&self) -> Option<&FlowLayer> {
        match self {
            Self::Flow(layer) => Some(layer),
            Self::Tets(_) => None,
        }
    }

    /// Whether both look the same at a time.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Tets(layer), Self::Tets(other)) => layer.looks_like(other),
            (Self::Flow(layer), Self::Flow(other)) => layer.looks_like(other),
            _ => false,
        }
    }

    /// Why the layer cannot be drawn, whatever the series holds.
    pub(super) fn check(&self) -> Result<(), String> {
        match self {
            Self::Tets(layer) => layer.check(),
            Self::Flow(layer) => layer.check_style(),
        }
    }
}

/// The cells of a mesh with the scalars of a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TetLayer {
    /// Name of the field, as the series has it ([`StoredField::name`](crate::store::StoredField::name)); `None`: the series' own field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Transfer function over the field's scalars.
    pub table: TransferTable,
    /// Source of the table, if known: the reference evaluates its formula, or else the table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<Arc<TransferSource>>,
    /// How ray segments are integrated; the reference has its own way.
    #[serde(default)]
    pub optics: OpticsKind,
    /// Isosurfaces in the cells.
    #[serde(default)]
    pub surfaces: Vec<Isosurface>,
    /// Planes through the cells: sections, and clips of volume, surfaces and sections.
    #[serde(default)]
    pub cuts: Vec<Cut>,
    /// Other fields of the store that colour surfaces and sections.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<ColorsBeside>,
    /// The surfaces of the domain and of regions, once for each way to draw one; of two at the same depth the first lies in front.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub domain: Vec<DomainSurface>,
    /// Numbers of the connected parts of the mesh that are shown ([`Connectivity::parts`](crate::mesh::Connectivity::parts)); empty: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<u32>,
    /// The regions of the mesh that are shown; `None`: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regions: Option<Regions>,
    /// Light on surfaces.
    #[serde(default)]
    pub shading: SurfaceShading,
    /// Whether the volume is drawn.
    #[serde(default = "volume")]
    pub volume: bool,
    /// How the cells are drawn.
    #[serde(default)]
    pub draw: TetDraw,
    /// What a field of functions is, where functions are drawn.
    #[serde(default, skip_serializing_if = "FunctionForm::is_usual")]
    pub functions: FunctionForm,
}

/// Another field of the store, and its colour table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorsBeside {
    /// Name of the field as options have it: `NAME`, `NAME:mag` or `NAME:0`.
    pub field: String,
    /// Colour table over the field's scalars.
    pub colors: Arc<NodeTable>,
}

impl TetLayer {
    /// Why it cannot be drawn, whatever the series holds.
    fn check(&self) -> Result<(), String> {
        surfaces::check(&self.surfaces, &self.shading).map_err(|error| error.to_string())?;
        surfaces::check_cuts(&self.cuts).map_err(|error| error.to_string())?;
        domain::check(&self.domain)?;
        let by = self.surfaces.iter().map(|surface| surface.by).chain(self.cuts.iter().map(|cut| cut.by)).flatten();
        if let Some(by) = by.into_iter().find(|by| usize::from(*by) >= self.beside.len()) {
            return Err(format!("a surface has the colours of field {by} beside, of {}", self.beside.len()));
        }
        match self.draw.drawn_by() {
            DrawnBy::Faces(detail) => detail.check(),
            DrawnBy::Points(style) => style.check(),
            DrawnBy::Sheets(style) => style.check(),
            DrawnBy::Raycast | DrawnBy::Reference | DrawnBy::Judge => Ok(()),
        }
    }

    /// The volume of the series' own field, with everything else at its default: the fastest accurate renderer, exact optics.
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
            regions: None,
            shading: SurfaceShading::default(),
            volume: true,
            draw: TetDraw::default(),
            functions: FunctionForm::default(),
        }
    }

    /// Applies a look: surfaces, volume or both, cut by planes.
    pub fn show(&mut self, look: &SurfaceLook) {
        let sides = look.crop.iter().flat_map(CropBox::cuts);
        self.cuts = look.cuts.iter().copied().chain(sides).collect();
        (self.domain, self.beside, self.parts) = (look.domain.clone(), look.beside.clone(), look.parts.clone());
        self.regions = look.regions.clone();
        self.surfaces = if look.shown == Shown::Volume { Vec::new() } else { look.isosurfaces.clone() };
        (self.shading, self.volume) = (look.shading, look.shown != Shown::Surfaces);
    }

    /// The regions that are shown, and those with surfaces.
    pub(super) fn all_regions(&self) -> impl Iterator<Item = &Regions> {
        self.regions.iter().chain(self.domain.iter().filter_map(|surface| surface.regions.as_ref()))
    }

    /// Whether it draws nothing, whatever the field.
    pub(super) fn is_empty(&self) -> bool {
        !self.volume && self.surfaces.is_empty() && self.domain.is_empty() && self.cuts.iter().all(|cut| cut.clips)
    }

    /// Whether surfaces or sections take colours of the transfer function: these come from the formula.
    pub(super) fn has_colored_surfaces(&self) -> bool {
        self.surfaces.iter().any(|surface| surface.front.is_none())
            || self.cuts.iter().any(|cut| !cut.clips)
            || self.domain.iter().any(|surface| surface.color.is_none())
    }

    /// Whether the picture depends on the formula beside the table.
    pub(super) fn needs_formula(&self) -> bool {
        self.draw.drawn_by().is_reference() || self.has_colored_surfaces()
    }

    /// Whether both look the same.
    fn looks_like(&self, other: &Self) -> bool {
        let Self { field, table, formula, optics, surfaces, cuts, beside, domain, .. } = self;
        let Self { parts, regions, shading, volume, draw, functions, .. } = self;
        (field, surfaces, cuts, domain) == (&other.field, &other.surfaces, &other.cuts, &other.domain)
            && (beside, parts, regions) == (&other.beside, &other.parts, &other.regions)
            && (*optics, *shading, *volume, *draw) == (other.optics, other.shading, other.volume, other.draw)
            && *functions == other.functions
            && *table == other.table
            && (!self.needs_formula() || *formula == other.formula)
    }
}

/// The look of a field beside colours and opacities of its volume: the part of a [`TetLayer`] that looks have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceLook {
    /// Isosurfaces in the cells.
    pub isosurfaces: Vec<Isosurface>,
    /// Planes through volume and surfaces.
    pub cuts: Vec<Cut>,
    /// The box that clips both.
    pub crop: Option<CropBox>,
    /// The surfaces of the domain and of regions.
    pub domain: Vec<DomainSurface>,
    /// Other fields that colour surfaces and sections.
    pub beside: Vec<ColorsBeside>,
    /// Names of their colour maps; `None`: that of the transfer function.
    pub maps: Vec<Option<String>>,
    /// Numbers of the parts of the mesh that are shown; empty: all.
    pub parts: Vec<u32>,
    /// The regions of the mesh that are shown; `None`: all.
    pub regions: Option<Regions>,
    /// Light on isosurfaces.
    pub shading: SurfaceShading,
    /// Whether volume, surfaces or both are drawn.
    pub shown: Shown,
}

/// A timeline's values for the surfaces of a look; `None` keeps the look's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeyedSurfaces {
    /// Isovalue of the last surface.
    pub isovalue: Option<f64>,
    /// Opacity of the last surface.
    pub opacity: Option<f64>,
    /// Offset of the last cut along its normal, world units.
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
    /// Switches to the next of volume, surfaces and both. If there is no surface, adds one at `isovalue`.
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

    /// The look with a timeline's values.
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

    /// Moves the last isovalue by `by`, clamped to a range.
    pub fn move_isovalue(&mut self, by: f64, (lo, hi): (f64, f64)) {
        if let Some(surface) = self.isosurfaces.last_mut() {
            surface.value = (surface.value + by).clamp(lo, hi);
        }
    }
}

/// Default of `volume` in a request's text.
fn volume() -> bool {
    true
}

/// Why a request cannot become a frame, whatever the series holds, or a text not a request.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// The request has two layers of cells.
    #[error("layers {first} and {second} of the request are both of cells (tets); a frame has one of them")]
    TwoOfCells {
        /// Index of the first layer.
        first: usize,
        /// Index of the second layer.
        second: usize,
    },
    /// The request has two layers of flow.
    #[error("layers {first} and {second} of the request are both of flow; a frame has one of them")]
    TwoOfFlow {
        /// Index of the first layer.
        first: usize,
        /// Index of the second layer.
        second: usize,
    },
    /// The vectors of a layer of flow cannot be shown.
    #[error("flow: {0}")]
    Flow(String),
    /// The field asked for is not the one played.
    #[error("the request is for the field '{asked}', but the series is of '{played}'; ask for that, or open the other")]
    OtherField {
        /// Name of the field asked for.
        asked: String,
        /// Name of the field that the series is of.
        played: String,
    },
    /// A listed pixel is outside the image, or listed twice, or the list is empty.
    #[error("the pixels of the request: {0}")]
    Pixels(#[from] PixelSetError),
    /// A surface is invalid.
    #[error("the surfaces of the request: {0}")]
    Surfaces(#[from] SurfaceError),
    /// Screen-space light needs the whole image, and some rays are left out.
    #[error(
        "shading by screen, by depth and ambient occlusion need the rays of all pixels; leave them out, or cast all rays"
    )]
    ScreenOfSome,
    /// Contrast-adaptive rays need the cell walk.
    #[error(
        "rays that contrast asks for go from cell to cell, and {0} draws otherwise; choose raycast or auto, or cast all rays"
    )]
    AdaptiveBy(&'static str),
    /// The details of an earlier frame do not fit.
    #[error("details of an earlier frame cannot be used here: {0}; ask for the frame without them")]
    Details(&'static str),
    /// An enlarged image needs all rays and cannot be drawn by the reference.
    #[error("an image that is enlarged needs all of its rays, and is drawn by any renderer but the reference; {0}")]
    Upsampling(String),
    /// Isosurfaces of a field of cells.
    #[error(
        "'{0}' has values of cells, constant in each, and so no isosurfaces; import the series with --cells-to-points, or leave them out"
    )]
    IsosurfacesOfCells(String),
    /// Isosurfaces in points that are not the cells themselves.
    #[error(
        "isosurfaces lie in cells, and points are the cells themselves only with footprint exact, compositing own and all of them drawn; choose these, another mode, or leave the isosurfaces out"
    )]
    IsosurfacesOfPoints,
    /// Cells without connectivity cannot be drawn like that.
    #[error(
        "{0} go from cell to cell, and the mesh was imported without connectivity; import the series again with --connectivity full, or choose --mode points without them"
    )]
    Unconnected(&'static str),
    /// Points without cells cannot be drawn like that.
    #[error(
        "{0} need cells, and the series is of points alone; choose --mode points with footprint square, circle or ellipse, without them"
    )]
    OfPoints(&'static str),
    /// Functions at the vertices cannot be drawn like that.
    #[error("functions at the vertices (--representation vertices, --mode sheets) are drawn without cells: {0}")]
    OfFunctions(String),
    /// The store has no field of that name beside the one shown.
    #[error("the field beside {0}")]
    NoFieldBeside(String),
    /// Regions are of no field of cells.
    #[error("the regions of the request: {0}")]
    NoRegions(String),
    /// A plane is invalid.
    #[error("the cuts of the request: {0}")]
    Cuts(#[from] CutError),
    /// The version of the text is unknown.
    #[error("version {0} of a request's text is not known; this program reads {known}", known = FrameRequest::TEXT_VERSION)]
    Version(u32),
    /// The text is malformed; names line and column.
    #[error("the text of the request: {0}")]
    BadText(String),
    /// The request has no text that could be read back.
    #[error("the request has no text: {0}")]
    NoText(String),
}

#[cfg(test)]
#[path = "layer_tests.rs"]
mod tests;
