//! Surfaces inside the cells: isosurfaces and the light on them, and planes that cut them.
//!
//! The scalar is linear in a cell, so an isosurface is flat there, and a ray meets it where the scalar along the ray, linear as
//! well, passes the isovalue: between successive faces, as in the dissertation (6.1.3.2). A scalar counts as above an isovalue if it is at
//! least that. A ray meets the surface where one end of its way through a cell is above and the other is not; ends are shared by
//! neighbouring cells, so that no ray slips through between two of them or meets a surface twice. A cell whose scalars all equal the
//! isovalue lies above: its border to lower cells is the surface. Where the domain or a hole ends there is no surface.
//!
//! A [`Cut`] shows the section of a plane, or clips what lies in front of it: rays pass through what is left of a segment between
//! the clips, and meet sections where they meet the plane.
//!
//! [`Isosurface`], [`Cut`] and [`SurfaceShading`] are what is asked for; [`SurfaceScene`] is that with the colours of a transfer function, and
//! [`medium`] puts it between the pieces of a segment; on the GPU `shaders/lib/surfaces.wgsl` does, but for cuts.
//!
//! On the GPU sheets are uniform, gradients of vertices lie behind the view vertices, and the renderer of faces binds the corners of cells
//! as its eighth buffer.

mod cuts;
pub(super) mod cuts_in_view;
pub(super) mod medium;
mod normals;
pub(crate) mod screen;
mod text;

use crate::node_table::NodeTable;
use crate::transfer::TransferSource;
use crate::visibility::CutPlanes;
pub use cuts::{CropBox, Cut, CutError, CutText, check_cuts, cut_planes};
use glam::DVec3;
pub use normals::VertexGradients;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
pub use text::{ByField, IsosurfaceText};

/// Isosurfaces of a frame, at most.
pub const SURFACES_MAX: usize = 32;

/// A surface on which the scalar has one value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Isosurface {
    /// The isovalue, in the unit of the field.
    pub value: f64,
    /// Colour of the side towards lower scalars, display-referred red, green and blue in 0..=1; `None`: that of the transfer function at
    /// the isovalue.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<[f64; 3]>,
    /// Colour of the side towards higher scalars; `None`: that of the front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub back: Option<[f64; 3]>,
    /// Share of the light that it takes, 0..=1.
    #[serde(default = "opaque")]
    pub opacity: f64,
    /// The place of the field beside whose colours it has on both sides, instead of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<u8>,
}

/// What a text means that does not say.
fn opaque() -> f64 {
    1.0
}

impl Isosurface {
    /// An opaque surface in the colours of the transfer function.
    pub fn new(value: f64) -> Self {
        Self { value, front: None, back: None, opacity: 1.0, by: None }
    }
}

/// Where the normals of surfaces come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Normals {
    /// From nowhere: colours are as they are.
    None,
    /// The gradient of the scalar in the cell: the normal of the piecewise linear surface, with a facet a cell.
    #[default]
    Cell,
    /// Gradients at vertices, the means of those of their cells by volume, interpolated in the cell: smooth.
    Vertex,
    /// The depths of neighbouring pixels, by central differences: of the nearest surface alone (dissertation 6.1.3.2).
    Screen,
    /// From nowhere: the farther the nearest surface, the darker (dissertation 6.1.3.2).
    Depth,
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// From the eye.
    #[default]
    Headlight,
    /// From far away in this direction, world coordinates, of any length but 0.
    From([f64; 3]),
}

/// How surfaces are lit: by the cosine between the normal, turned towards the eye, and the light (Lambert).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceShading {
    /// Where normals come from.
    #[serde(default)]
    pub normals: Normals,
    /// Where light comes from.
    #[serde(default)]
    pub light: Light,
    /// Whether the volume is lit, too: by its gradients, as isosurfaces are that would go through it there.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub volume: bool,
    /// Whether the nearest surface is darker where what lies around it hides it: ambient occlusion, found on the image.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ambient_occlusion: bool,
    /// Whether depths are smoothed first where faces were left out, for all that is found on the image.
    #[serde(default = "smooth", skip_serializing_if = "is_smooth")]
    pub smooth: bool,
}

impl Default for SurfaceShading {
    fn default() -> Self {
        Self {
            normals: Normals::default(),
            light: Light::default(),
            volume: false,
            ambient_occlusion: false,
            smooth: true,
        }
    }
}

impl SurfaceShading {
    /// Whether light is found on the image, from all of its pixels.
    pub fn is_of_screen(&self) -> bool {
        self.ambient_occlusion || matches!(self.normals, Normals::Screen | Normals::Depth)
    }
}

/// What a text means that does not say.
fn smooth() -> bool {
    true
}

/// Whether that need not be said.
fn is_smooth(smooth: &bool) -> bool {
    *smooth
}

impl SurfaceShading {
    /// Towards the light, world coordinates, of length 1; `None`: from the eye.
    pub(in crate::render) fn towards_light(&self) -> Option<DVec3> {
        match self.light {
            Light::Headlight => None,
            // Squares of very long and very short vectors leave the range of numbers.
            Light::From(direction) => {
                let direction = DVec3::from(direction);
                Some((direction / direction.abs().max_element()).normalize())
            }
        }
    }
}

/// Why there are no such surfaces.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// More than [`SURFACES_MAX`].
    #[error("{0} isosurfaces; a frame has at most {SURFACES_MAX}")]
    TooMany(usize),
    /// An isovalue that is not finite.
    #[error("isosurface {place} at {value}: isovalues are finite")]
    Value {
        /// Zero-based place in the list.
        place: usize,
        /// Value given.
        value: f64,
    },
    /// A colour or an opacity outside of 0..=1.
    #[error("isosurface {place} has a colour or an opacity of {value}; both lie between 0 and 1")]
    Share {
        /// Zero-based place in the list.
        place: usize,
        /// Value given.
        value: f64,
    },
    /// A light that comes from nowhere.
    #[error("light from {0:?}; a direction is three finite numbers, not all 0")]
    Light([f64; 3]),
}

/// Whether there can be such surfaces.
///
/// # Errors
/// If there are too many, or a value is not finite or outside of its range.
pub fn check(surfaces: &[Isosurface], shading: &SurfaceShading) -> Result<(), SurfaceError> {
    if surfaces.len() > SURFACES_MAX {
        return Err(SurfaceError::TooMany(surfaces.len()));
    }
    for (place, surface) in surfaces.iter().enumerate() {
        let Isosurface { value, front, back, opacity, .. } = *surface;
        if !value.is_finite() {
            return Err(SurfaceError::Value { place, value });
        }
        let shares = front.into_iter().chain(back).flatten().chain([opacity]);
        if let Some(value) = shares.into_iter().find(|share| !(0.0..=1.0).contains(share)) {
            return Err(SurfaceError::Share { place, value });
        }
    }
    match shading.light {
        Light::From(direction) if !DVec3::from(direction).is_finite() || direction == [0.0; 3] => {
            Err(SurfaceError::Light(direction))
        }
        _ => Ok(()),
    }
}

/// A surface with its colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sheet {
    /// Its place among those asked for, from 1.
    pub(super) number: u32,
    /// The isovalue.
    pub(super) value: f64,
    pub(super) front: [f64; 3],
    pub(super) back: [f64; 3],
    pub(super) opacity: f64,
    /// The place of the field beside whose colours it has.
    pub(super) by: Option<u8>,
}

/// A field beside that of the job.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldBeside {
    /// One scalar per vertex of the mesh.
    pub scalars: Arc<Vec<f32>>,
    /// Its colours.
    pub colors: Arc<NodeTable>,
}

/// Where a field beside has no finite value.
const NO_VALUE: [f64; 3] = [0.5; 3];

impl FieldBeside {
    /// The colour at a place in a cell, by barycentric coordinates.
    pub(super) fn color(&self, tet: [u32; 4], weights: [f64; 4]) -> [f64; 3] {
        let scalar: f64 = (0..4).map(|i| weights[i] * f64::from(self.scalars[tet[i] as usize])).sum();
        if scalar.is_finite() { self.colors.eval(scalar).rgb } else { NO_VALUE }
    }
}

/// The surfaces of a job. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceScene {
    /// By isovalue; those of one value in the order in which they were asked for.
    sheets: Arc<[Sheet]>,
    shading: SurfaceShading,
    /// One vector a vertex of the mesh along the gradient of the scalar, of any length, local coordinates; for [`Normals::Vertex`].
    gradients: Option<Arc<Vec<[f32; 3]>>>,
    /// Planes that cut the cells.
    planes: CutPlanes,
    /// For each section the place of the field beside whose colours it has.
    section_by: Arc<[Option<u8>]>,
    /// Fields beside that of the job.
    beside: Arc<[FieldBeside]>,
    /// The transfer function whose colours sections have.
    colors: Arc<NodeTable>,
    /// What these come from, for the judge.
    source: Option<Arc<TransferSource>>,
    /// Whether the nearest surface shows its normal and its number instead of its colour and opacity.
    guides: bool,
}

impl SurfaceScene {
    /// Surfaces in a field in the colours of this transfer function.
    ///
    /// # Errors
    /// As [`check`].
    pub fn new(surfaces: &[Isosurface], shading: SurfaceShading, table: &Arc<NodeTable>) -> Result<Self, SurfaceError> {
        check(surfaces, &shading)?;
        let mut sheets: Vec<Sheet> = surfaces
            .iter()
            .zip(1..)
            .map(|(&Isosurface { value, front, back, opacity, by }, number)| {
                let front = front.unwrap_or_else(|| table.eval(value).rgb);
                Sheet { number, value, front, back: back.unwrap_or(front), opacity, by }
            })
            .collect();
        sheets.sort_by(|a, b| a.value.total_cmp(&b.value));
        Ok(Self {
            sheets: sheets.into(),
            shading,
            gradients: None,
            planes: CutPlanes::default(),
            section_by: Arc::default(),
            beside: Arc::default(),
            colors: table.clone(),
            source: None,
            guides: false,
        })
    }

    /// The same with gradients at vertices, for smooth normals: one vector a vertex of the mesh, of any length, local coordinates.
    #[must_use]
    pub fn with_gradients(self, gradients: Arc<Vec<[f32; 3]>>) -> Self {
        Self { gradients: Some(gradients), ..self }
    }

    /// The same cut by planes, local coordinates of the mesh.
    #[must_use]
    pub fn with_planes(self, planes: CutPlanes) -> Self {
        Self { planes, ..self }
    }

    /// The same for the reference, which finds the colours of sections by their definition.
    #[must_use]
    pub fn with_source(self, source: Option<Arc<TransferSource>>) -> Self {
        Self { source, ..self }
    }

    /// The same surfaces, of which the nearest shows its normal (world coordinates, towards the eye) and its number in place of colour and
    /// opacity, and hides the others.
    #[must_use]
    pub(super) fn into_guides(self) -> Self {
        Self { guides: true, ..self }
    }

    /// Whether they do so.
    pub(super) fn shows_guides(&self) -> bool {
        self.guides
    }

    /// What the colours come from, if that is known.
    pub(super) fn source(&self) -> Option<&Arc<TransferSource>> {
        self.source.as_ref()
    }

    /// The same with fields beside that of the job, one of them for some of the sections.
    #[must_use]
    pub fn with_beside(self, beside: Vec<FieldBeside>, section_by: Vec<Option<u8>>) -> Self {
        Self { beside: beside.into(), section_by: section_by.into(), ..self }
    }

    /// The field beside at a place, if there is one.
    pub(super) fn beside(&self, by: Option<u8>) -> Option<&FieldBeside> {
        self.beside.get(usize::from(by?))
    }

    /// The field beside whose colours a section has (number from 1), if it has such.
    pub(super) fn beside_section(&self, number: usize) -> Option<&FieldBeside> {
        self.beside(*self.section_by.get(number - 1)?)
    }

    /// Whether some have colours of another field.
    pub fn has_beside(&self) -> bool {
        !self.beside.is_empty()
    }

    /// The planes that cut the cells.
    pub fn planes(&self) -> &CutPlanes {
        &self.planes
    }

    /// The colour of a section where the field has this scalar.
    pub(super) fn section_color(&self, scalar: f64) -> [f64; 3] {
        self.colors.eval(scalar).rgb
    }

    /// Whether gradients at vertices are needed and not there.
    pub fn lacks_gradients(&self) -> bool {
        let are_of_use = !self.sheets.is_empty() || self.shading.volume;
        self.shading.normals == Normals::Vertex && are_of_use && self.gradients.is_none()
    }

    /// The gradients at vertices, if it has them.
    pub(super) fn gradients(&self) -> Option<&Arc<Vec<[f32; 3]>>> {
        self.gradients.as_ref()
    }

    /// Whether the volume is lit, too.
    pub fn lights_volume(&self) -> bool {
        self.shading.volume
    }

    /// Whether there is neither a surface nor a section.
    pub(crate) fn is_empty(&self) -> bool {
        self.sheets.is_empty() && self.planes.sections.is_empty()
    }

    /// The surfaces by isovalue.
    pub(super) fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// Number of isosurfaces.
    pub(crate) fn isosurfaces(&self) -> u32 {
        self.sheets.len() as u32
    }

    /// How they are lit.
    pub(super) fn shading(&self) -> SurfaceShading {
        self.shading
    }
}
