//! Surfaces inside the cells: isosurfaces and their lighting, and cutting planes.
//!
//! The scalar is linear in a cell, so an isosurface is flat there, and a ray meets it where the scalar along the ray, linear as well,
//! passes the isovalue: between successive faces, as in the dissertation (6.1.3.2). A scalar counts as above an isovalue if it is at
//! least that. A ray meets the surface if one end of its segment in a cell is above and the other is not; ends are shared by neighbouring
//! cells, so that no ray slips through between two of them or meets a surface twice. A cell whose scalars all equal the isovalue lies
//! above: its faces towards lower cells are the surface. At the boundary of the domain or of a hole there is no surface.
//!
//! A [`Cut`] shows the section of a plane, or clips everything in front of it: rays pass through the parts of segments between the clips,
//! and meet sections where they meet the plane.
//!
//! [`Isosurface`], [`Cut`] and [`SurfaceShading`] are the request; [`SurfaceScene`] adds the colours of a transfer function, and
//! [`medium`] inserts the surfaces into segments; on the GPU `shaders/lib/surfaces.wgsl` does, except for cuts.
//!
//! On the GPU sheets are uniforms, gradients of vertices lie behind the view vertices, and the face renderer binds the corners of cells
//! as its eighth buffer.

mod cuts;
pub(super) mod cuts_in_view;
pub(super) mod medium;
mod normals;
pub(crate) mod screen;
mod text;

use crate::field::Scalars;
use crate::node_table::NodeTable;
use crate::transfer::TransferSource;
use crate::visibility::CutPlanes;
pub use cuts::{CropBox, Cut, CutError, CutText, check_cuts, cut_planes};
use glam::DVec3;
pub use normals::VertexGradients;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
pub use text::{ByField, IsosurfaceText};

/// Maximum number of isosurfaces in a frame.
pub const SURFACES_MAX: usize = 32;

/// A surface on which the scalar has one value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Isosurface {
    /// The isovalue, in the unit of the field.
    pub value: f64,
    /// Colour of the side towards lower scalars, display-referred red, green and blue in 0..=1; `None`: the transfer function's colour at
    /// the isovalue.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub front: Option<[f64; 3]>,
    /// Colour of the side towards higher scalars; `None`: the colour of the front.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub back: Option<[f64; 3]>,
    /// Opacity, 0..=1.
    #[serde(default = "opaque")]
    pub opacity: f64,
    /// Index of the field beside whose colours it has on both sides, instead of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<u8>,
}

/// Default if the field is missing.
pub(super) fn opaque() -> f64 {
    1.0
}

impl Isosurface {
    /// An opaque surface in the colours of the transfer function.
    pub fn new(value: f64) -> Self {
        Self { value, front: None, back: None, opacity: 1.0, by: None }
    }
}

/// Source of the normals of surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Normals {
    /// No normals: colours are unlit.
    None,
    /// The gradient of the scalar in the cell: the normal of the piecewise linear surface, with a facet a cell.
    #[default]
    Cell,
    /// Volume-weighted mean gradients at vertices, interpolated in the cell: smooth.
    Vertex,
    /// Central differences of neighbouring pixels' depths, for the nearest surface alone (dissertation 6.1.3.2).
    Screen,
    /// No normals: the farther the nearest surface, the darker (dissertation 6.1.3.2).
    Depth,
}

/// Direction of the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// Light from the eye.
    #[default]
    Headlight,
    /// Distant light from this direction, world coordinates, of any length but 0.
    From([f64; 3]),
}

/// How surfaces are lit: by the cosine between the normal, turned towards the eye, and the light (Lambert).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceShading {
    /// Source of the normals.
    pub normals: Normals,
    /// Direction of the light.
    pub light: Light,
    /// Whether the volume is lit, too, by its gradients, like isosurfaces through the same points.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub volume: bool,
    /// Whether to darken the nearest surface where its surroundings hide it: ambient occlusion in image space.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub ambient_occlusion: bool,
    /// Whether depths are smoothed where faces were left out, before any lighting in image space.
    #[serde(skip_serializing_if = "is_smooth")]
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
    /// Whether lighting works in image space, on all pixels.
    pub fn is_of_screen(&self) -> bool {
        self.ambient_occlusion || matches!(self.normals, Normals::Screen | Normals::Depth)
    }

    /// Whether the volume is lit: not if nothing has a normal in space.
    pub(crate) fn lights_volume(&self) -> bool {
        self.volume && matches!(self.normals, Normals::Cell | Normals::Vertex)
    }

    /// Unit vector towards the light, world coordinates; `None` for a light at the eye.
    pub(crate) fn towards_light(&self) -> Option<DVec3> {
        match self.light {
            Light::Headlight => None,
            // Squares of very long and very short vectors overflow or underflow.
            Light::From(direction) => {
                let direction = DVec3::from(direction);
                Some((direction / direction.abs().max_element()).normalize())
            }
        }
    }
}

/// Whether the value is the default, and not written.
fn is_smooth(smooth: &bool) -> bool {
    *smooth
}

/// Brightness of a surface: the cosine between its normal, turned towards the eye, and the light, from a direction or, without one, from
/// the eye. `along`: the direction of the ray. 1 without a normal.
#[inline]
pub(super) fn brightness(normal: DVec3, along: DVec3, towards_light: Option<DVec3>) -> f64 {
    let (Some(normal), Some(along)) = (normal.try_normalize(), along.try_normalize()) else { return 1.0 };
    let facing = -normal.dot(along);
    match towards_light {
        None => facing.abs(),
        Some(light) => (normal.dot(light) * facing.signum()).max(0.0),
    }
}

/// Why surfaces are invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// More than [`SURFACES_MAX`].
    #[error("{0} isosurfaces; a frame has at most {SURFACES_MAX}")]
    TooMany(usize),
    /// An isovalue that is not finite.
    #[error("isosurface {place} at {value}: isovalues are finite")]
    Value {
        /// Zero-based index in the list.
        place: usize,
        /// Value given.
        value: f64,
    },
    /// A colour or an opacity outside of 0..=1.
    #[error("isosurface {place} has a colour or an opacity of {value}; both lie between 0 and 1")]
    Share {
        /// Zero-based index in the list.
        place: usize,
        /// Value given.
        value: f64,
    },
    /// A light without a direction.
    #[error("light from {0:?}; a direction is three finite numbers, not all 0")]
    Light([f64; 3]),
}

/// Checks that surfaces and shading are valid.
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

/// An isosurface with its colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sheet {
    /// Number in the request, from 1.
    pub(super) number: u32,
    /// The isovalue.
    pub(super) value: f64,
    pub(super) front: [f64; 3],
    pub(super) back: [f64; 3],
    pub(super) opacity: f64,
    /// Index of the field beside whose colours it has.
    pub(super) by: Option<u8>,
}

/// A further field beside that of the job, as a source of colours.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldBeside {
    /// Its scalars.
    pub scalars: Scalars,
    /// Colours by scalar.
    pub colors: Arc<NodeTable>,
}

/// Colour where a field beside is not finite.
const NO_VALUE: [f64; 3] = [0.5; 3];

impl FieldBeside {
    /// The colour at a point of a cell, by barycentric coordinates.
    pub(super) fn color(&self, cell: u32, tet: [u32; 4], weights: [f64; 4]) -> [f64; 3] {
        let scalars = self.scalars.at_corners(cell, tet);
        let scalar: f64 = (0..4).map(|i| weights[i] * f64::from(scalars[i])).sum();
        if scalar.is_finite() { self.colors.eval(scalar).rgb } else { NO_VALUE }
    }
}

/// The surfaces of a job. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceScene {
    /// Isosurfaces by isovalue; equal values in the order of the request.
    sheets: Arc<[Sheet]>,
    shading: SurfaceShading,
    /// One vector per vertex of the mesh along the gradient of the scalar, of any length, local coordinates; for [`Normals::Vertex`].
    gradients: Option<Arc<Vec<[f32; 3]>>>,
    /// Planes that cut the cells.
    planes: CutPlanes,
    /// For each section the index of the field beside whose colours it has.
    section_by: Arc<[Option<u8>]>,
    /// Fields beside that of the job.
    beside: Arc<[FieldBeside]>,
    /// The transfer function that colours sections.
    colors: Arc<NodeTable>,
    /// The source of these colours, for the reference.
    source: Option<Arc<TransferSource>>,
    /// Whether the nearest surface shows its normal and its number instead of its colour and opacity.
    guides: bool,
}

impl SurfaceScene {
    /// Isosurfaces coloured by this transfer function.
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

    /// Adds gradients at vertices for smooth normals: one vector per vertex of the mesh, of any length, local coordinates.
    #[must_use]
    pub fn with_gradients(self, gradients: Arc<Vec<[f32; 3]>>) -> Self {
        Self { gradients: Some(gradients), ..self }
    }

    /// Adds planes that cut the cells, local coordinates of the mesh.
    #[must_use]
    pub fn with_planes(self, planes: CutPlanes) -> Self {
        Self { planes, ..self }
    }

    /// Adds the source of the colours, with which the reference colours sections by their definition.
    #[must_use]
    pub fn with_source(self, source: Option<Arc<TransferSource>>) -> Self {
        Self { source, ..self }
    }

    /// Turns the scene into guides: the nearest surface shows its normal (world coordinates, towards the eye) and its number in place of
    /// colour and opacity, and hides the others.
    #[must_use]
    pub(super) fn into_guides(self) -> Self {
        Self { guides: true, ..self }
    }

    /// Whether the scene shows guides.
    pub(super) fn shows_guides(&self) -> bool {
        self.guides
    }

    /// The source of the colours, if known.
    pub(super) fn source(&self) -> Option<&Arc<TransferSource>> {
        self.source.as_ref()
    }

    /// Adds fields beside that of the job, and the index that each section has among them.
    #[must_use]
    pub fn with_beside(self, beside: Vec<FieldBeside>, section_by: Vec<Option<u8>>) -> Self {
        Self { beside: beside.into(), section_by: section_by.into(), ..self }
    }

    /// The field beside at an index, if there is one.
    pub(super) fn beside(&self, by: Option<u8>) -> Option<&FieldBeside> {
        self.beside.get(usize::from(by?))
    }

    /// The field beside whose colours a section has (number from 1), if any.
    pub(super) fn beside_section(&self, number: usize) -> Option<&FieldBeside> {
        self.beside(*self.section_by.get(number - 1)?)
    }

    /// Whether any colours come from another field.
    pub fn has_beside(&self) -> bool {
        !self.beside.is_empty()
    }

    /// The planes that cut the cells.
    pub fn planes(&self) -> &CutPlanes {
        &self.planes
    }

    /// The colour of a section at this scalar.
    pub(super) fn section_color(&self, scalar: f64) -> [f64; 3] {
        self.colors.eval(scalar).rgb
    }

    /// Whether gradients at vertices are needed but missing.
    pub fn lacks_gradients(&self) -> bool {
        let are_of_use = !self.sheets.is_empty() || self.shading.volume;
        self.shading.normals == Normals::Vertex && are_of_use && self.gradients.is_none()
    }

    /// The gradients at vertices, if present.
    pub(super) fn gradients(&self) -> Option<&Arc<Vec<[f32; 3]>>> {
        self.gradients.as_ref()
    }

    /// Whether the volume is lit, too.
    pub fn lights_volume(&self) -> bool {
        self.shading.volume
    }

    /// Whether there are neither isosurfaces nor sections.
    pub(crate) fn is_empty(&self) -> bool {
        self.sheets.is_empty() && self.planes.sections.is_empty()
    }

    /// The isosurfaces by isovalue.
    pub(super) fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// Number of isosurfaces.
    pub(crate) fn isosurfaces(&self) -> u32 {
        self.sheets.len() as u32
    }

    /// How surfaces are lit.
    pub(super) fn shading(&self) -> SurfaceShading {
        self.shading
    }
}
