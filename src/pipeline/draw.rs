//! How the cells of a frame are drawn: the user's mode, the request's setting, and the renderer that they select.

use super::Sampling;
use super::text::FaceText;
use crate::mesh::Mesh;
use crate::render::points::{Compositing, PointStyle};
use crate::render::{KBuffer, RenderError};
use crate::short::Short;
use crate::words::words;
use serde::{Deserialize, Serialize};

/// The renderer, as options and project files name it; with a level of detail, [`TetDraw::chosen`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RenderMode {
    /// The fastest within the accuracy bounds: the ray caster for all cells, faces for a [`FaceDetail::lod`] below 1; points where there is no
    /// connectivity.
    #[default]
    Auto,
    /// Cell walk, [`crate::render::cpu::raycast`].
    Raycast,
    /// Faces through a k-buffer, [`crate::render::cpu::havs`], at any level of detail.
    Havs,
    /// Cells as points, [`crate::render::cpu::points`].
    Points,
    /// Float64 reference, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
}

words!(
    RenderMode,
    "there is no mode",
    ["auto" = Auto, "raycast" = Raycast, "havs" = Havs, "points" = Points, "reference" = Reference]
);

impl RenderMode {
    /// The mode for a mesh: [`Self::Auto`] is [`Self::Points`] where there is no connectivity.
    #[must_use]
    pub fn on(self, mesh: &Mesh) -> Self {
        if self == Self::Auto && !mesh.is_connected { Self::Points } else { self }
    }
}

/// Which faces are drawn, and how they are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "FaceText")]
pub struct FaceDetail {
    /// Level of detail: the share of the interior faces of the active cells that is drawn, 0 to 1. Faces on the surface of the active cells
    /// are all drawn.
    pub lod: f64,
    /// Which faces come first.
    pub sampling: Sampling,
    /// How the fragments of faces are sorted.
    pub k_buffer: KBuffer,
}

impl FaceDetail {
    /// All faces: the default.
    pub const ALL: Self = Self { lod: 1.0, sampling: Sampling::Error, k_buffer: KBuffer::USUAL };

    /// Checks that the level of detail is in 0 to 1 and the k-buffer within its bounds.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { lod, k_buffer, .. } = self;
        if lod.is_finite() && !(0.0..=1.0).contains(lod) {
            return Err(format!("a level of detail of {}; it is a share, 0 to 1", Short(*lod)));
        }
        if !(2..=32).contains(&k_buffer.k) {
            return Err(RenderError::BadK(k_buffer.k).to_string());
        }
        Ok(())
    }
}

impl Default for FaceDetail {
    fn default() -> Self {
        Self::ALL
    }
}

/// How the cells of a layer are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TetDraw {
    /// All cells, by the fastest renderer within the accuracy bounds; as points where there is no connectivity.
    #[default]
    Auto,
    /// All cells, by rays from cell to cell: [`crate::render::cpu::raycast`].
    Raycast,
    /// Faces of the cells, all or some, through a k-buffer: [`crate::render::cpu::havs`].
    Faces(FaceDetail),
    /// Cells as points, all or some: [`crate::render::cpu::points`].
    Points(PointStyle),
    /// All cells, by the float64 reference, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
}

impl TetDraw {
    /// All faces, in their usual order.
    pub const ALL_FACES: Self = Self::Faces(FaceDetail::ALL);

    /// The setting for a user's mode. A level of detail applies to faces: [`RenderMode::Auto`] becomes these faces if it leaves some out,
    /// else [`Self::Auto`], which therefore holds no face settings. Points have the level of detail of `faces`, and their
    /// measure of importance.
    pub fn chosen(mode: RenderMode, faces: FaceDetail, points: PointStyle) -> Self {
        match mode {
            RenderMode::Auto if faces.lod < 1.0 => Self::Faces(faces),
            RenderMode::Auto => Self::Auto,
            RenderMode::Raycast => Self::Raycast,
            RenderMode::Havs => Self::Faces(faces),
            RenderMode::Points => {
                Self::Points(PointStyle { lod: faces.lod, importance: faces.sampling.importance(), ..points })
            }
            RenderMode::Reference => Self::Reference,
        }
    }

    /// The setting for a mesh: [`Self::Auto`] draws points where there is no connectivity.
    #[must_use]
    pub fn on(self, mesh: &Mesh) -> Self {
        if self == Self::Auto && !mesh.is_connected { Self::Points(PointStyle::usual_of(mesh)) } else { self }
    }

    /// The renderer; the one place that resolves [`Self::Auto`], for a mesh with connectivity.
    pub fn drawn_by(self) -> DrawnBy {
        match self {
            Self::Auto | Self::Raycast => DrawnBy::Raycast,
            Self::Faces(detail) => DrawnBy::Faces(detail),
            Self::Points(style) => DrawnBy::Points(style),
            Self::Reference => DrawnBy::Reference,
        }
    }

    /// The share of the interior faces, or of the fragments of points, that is drawn; 1 where whole cells are.
    pub fn lod(self) -> f64 {
        match self.drawn_by() {
            DrawnBy::Faces(detail) => detail.lod,
            DrawnBy::Points(style) => style.lod,
            DrawnBy::Raycast | DrawnBy::Reference => 1.0,
        }
    }
}

/// The renderer that draws a layer of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrawnBy {
    /// The ray caster.
    Raycast,
    /// The face renderer.
    Faces(FaceDetail),
    /// The point renderer.
    Points(PointStyle),
    /// The float64 reference.
    Reference,
}

impl DrawnBy {
    /// The name of the [`RenderMode`] that chooses it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raycast => "raycast",
            Self::Faces(_) => "havs",
            Self::Points(_) => "points",
            Self::Reference => "reference",
        }
    }

    /// The faces that it draws; `None` if it draws cells.
    pub fn faces(self) -> Option<FaceDetail> {
        match self {
            Self::Faces(detail) => Some(detail),
            Self::Raycast | Self::Points(_) | Self::Reference => None,
        }
    }

    /// Whether cells that show nothing must be drawn as well: the reference skips nothing, and gaps lie between points of any cells.
    pub(super) fn needs_all_cells(self) -> bool {
        self == Self::Reference || self.points().is_some_and(|style| style.compositing == Compositing::Gap)
    }

    /// How cells are drawn as points; `None` if they are not.
    pub fn points(self) -> Option<PointStyle> {
        match self {
            Self::Points(style) => Some(style),
            Self::Raycast | Self::Faces(_) | Self::Reference => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_leaves_faces_out_only_where_that_was_asked_for() {
        let (all, half) = (FaceDetail::ALL, FaceDetail { lod: 0.5, ..FaceDetail::ALL });
        let points = PointStyle::EXACT;
        let comes_to = |mode: RenderMode, faces| TetDraw::chosen(mode, faces, points).drawn_by();
        for (mode, faces, expected) in [
            (RenderMode::Auto, all, DrawnBy::Raycast),
            (RenderMode::Auto, half, DrawnBy::Faces(half)),
            (RenderMode::Raycast, half, DrawnBy::Raycast),
            (RenderMode::Havs, all, DrawnBy::Faces(all)),
            (RenderMode::Havs, half, DrawnBy::Faces(half)),
            (RenderMode::Points, all, DrawnBy::Points(points)),
            (RenderMode::Points, half, DrawnBy::Points(PointStyle { lod: 0.5, ..points })),
            (RenderMode::Reference, half, DrawnBy::Reference),
        ] {
            assert_eq!(comes_to(mode, faces), expected, "{mode}");
            let is_whole = faces == all || matches!(expected, DrawnBy::Raycast | DrawnBy::Reference);
            assert_eq!(TetDraw::chosen(mode, faces, points).lod() == 1.0, is_whole, "{mode}");
        }
        assert_eq!(TetDraw::default(), TetDraw::chosen(RenderMode::default(), all, points));
    }
}
