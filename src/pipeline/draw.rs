//! How the cells of a frame are drawn: the user's mode, the request's setting, and the renderer that they select.

use super::Sampling;
use super::text::FaceText;
use crate::mesh::Mesh;
use crate::render::functions::SheetStyle;
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
    /// Faces sorted by depth, [`crate::render::cpu::havs`], at any level of detail.
    Havs,
    /// Cells as points, [`crate::render::cpu::points`].
    Points,
    /// The field as a sum of functions at the vertices, splatted onto sheets, [`crate::render::cpu::functions`]; on the CPU.
    Sheets,
    /// Float64 reference, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
}

words!(
    RenderMode,
    "there is no mode",
    ["auto" = Auto, "raycast" = Raycast, "havs" = Havs, "points" = Points, "sheets" = Sheets, "reference" = Reference]
);

/// What a field is drawn as, as options and project files name it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// Linear in the cells of the mesh, or constant.
    #[default]
    Cells,
    /// A sum of functions at the vertices, [`crate::functions`].
    Vertices,
}

words!(Representation, "there is no representation", ["cells" = Cells, "vertices" = Vertices]);

impl RenderMode {
    /// The mode that draws a representation, if one is asked for: [`Self::Auto`] is [`Self::Sheets`] for functions.
    ///
    /// # Errors
    /// If the mode draws another one; says which modes draw this.
    pub fn of(self, representation: Option<Representation>) -> Result<Self, String> {
        match (self, representation) {
            (Self::Auto, Some(Representation::Vertices)) => Ok(Self::Sheets),
            (Self::Sheets, Some(Representation::Cells)) => {
                Err("draws functions at the vertices; choose raycast, havs, points or reference, or --representation vertices".to_owned())
            }
            (Self::Raycast | Self::Havs | Self::Points, Some(Representation::Vertices)) => {
                Err("draws cells; choose sheets or reference, or --representation cells".to_owned())
            }
            _ => Ok(self),
        }
    }

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
    /// Faces of the cells, all or some, sorted by depth: [`crate::render::cpu::havs`].
    Faces(FaceDetail),
    /// Cells as points, all or some: [`crate::render::cpu::points`].
    Points(PointStyle),
    /// Functions at the vertices, on sheets: [`crate::render::cpu::functions`].
    Sheets(SheetStyle),
    /// All cells, by the float64 reference, [`mod@crate::render::reference`]; on the CPU whatever the backend.
    Reference,
    /// Functions at the vertices, by the float64 reference.
    Judge,
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
            RenderMode::Sheets => Self::Sheets(SheetStyle::default()),
            RenderMode::Reference => Self::Reference,
        }
    }

    /// The setting with sheets in this style, if it draws some.
    #[must_use]
    pub fn with_sheets(self, style: SheetStyle) -> Self {
        if let Self::Sheets(_) = self { Self::Sheets(style) } else { self }
    }

    /// The setting for a representation: the reference is that of functions, if these are asked for.
    #[must_use]
    pub fn of(self, representation: Representation) -> Self {
        match (self, representation) {
            (Self::Reference, Representation::Vertices) => Self::Judge,
            _ => self,
        }
    }

    /// The float64 reference of what the setting draws.
    #[must_use]
    pub fn judge(self) -> Self {
        match self {
            Self::Sheets(_) | Self::Judge => Self::Judge,
            Self::Auto | Self::Raycast | Self::Faces(_) | Self::Points(_) | Self::Reference => Self::Reference,
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
            Self::Sheets(style) => DrawnBy::Sheets(style),
            Self::Reference => DrawnBy::Reference,
            Self::Judge => DrawnBy::Judge,
        }
    }

    /// The share of the interior faces, or of the fragments of points, that is drawn; 1 where whole cells are.
    pub fn lod(self) -> f64 {
        match self.drawn_by() {
            DrawnBy::Faces(detail) => detail.lod,
            DrawnBy::Points(style) => style.lod,
            DrawnBy::Raycast | DrawnBy::Sheets(_) | DrawnBy::Reference | DrawnBy::Judge => 1.0,
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
    /// The renderer of functions.
    Sheets(SheetStyle),
    /// The float64 reference, of cells.
    Reference,
    /// The float64 reference, of functions.
    Judge,
}

impl DrawnBy {
    /// The name of the [`RenderMode`] that chooses it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raycast => "raycast",
            Self::Faces(_) => "havs",
            Self::Points(_) => "points",
            Self::Sheets(_) => "sheets",
            Self::Reference | Self::Judge => "reference",
        }
    }

    /// The faces that it draws; `None` if it draws cells.
    pub fn faces(self) -> Option<FaceDetail> {
        match self {
            Self::Faces(detail) => Some(detail),
            Self::Raycast | Self::Points(_) | Self::Sheets(_) | Self::Reference | Self::Judge => None,
        }
    }

    /// Whether cells that show nothing must be drawn as well: the reference skips nothing, functions reach into the cells around, and gaps
    /// lie between points of any cells.
    pub(super) fn needs_all_cells(self) -> bool {
        matches!(self, Self::Reference | Self::Judge | Self::Sheets(_))
            || self.points().is_some_and(|style| style.compositing == Compositing::Gap)
    }

    /// Whether it is the float64 reference, which needs no device and no tables.
    pub fn is_reference(self) -> bool {
        matches!(self, Self::Reference | Self::Judge)
    }

    /// Whether functions are drawn.
    pub fn is_of_functions(self) -> bool {
        matches!(self, Self::Sheets(_) | Self::Judge)
    }

    /// How cells are drawn as points; `None` if they are not.
    pub fn points(self) -> Option<PointStyle> {
        match self {
            Self::Points(style) => Some(style),
            Self::Raycast | Self::Faces(_) | Self::Sheets(_) | Self::Reference | Self::Judge => None,
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
            (RenderMode::Sheets, half, DrawnBy::Sheets(SheetStyle::default())),
            (RenderMode::Reference, half, DrawnBy::Reference),
        ] {
            assert_eq!(comes_to(mode, faces), expected, "{mode}");
            let is_whole =
                faces == all || matches!(expected, DrawnBy::Raycast | DrawnBy::Sheets(_) | DrawnBy::Reference);
            assert_eq!(TetDraw::chosen(mode, faces, points).lod() == 1.0, is_whole, "{mode}");
        }
        assert_eq!(TetDraw::default(), TetDraw::chosen(RenderMode::default(), all, points));
    }

    #[test]
    fn a_mode_draws_one_representation_and_the_reference_both() {
        let [cells, vertices] = Representation::ALL;
        for mode in RenderMode::ALL {
            assert_eq!(mode.of(None), Ok(mode));
            let is_of = |representation| mode.of(Some(representation)).is_ok();
            let expected = match mode {
                RenderMode::Auto | RenderMode::Reference => [true, true],
                RenderMode::Sheets => [false, true],
                RenderMode::Raycast | RenderMode::Havs | RenderMode::Points => [true, false],
            };
            assert_eq!([is_of(cells), is_of(vertices)], expected, "{mode}");
        }
        assert_eq!(RenderMode::Auto.of(Some(vertices)), Ok(RenderMode::Sheets));
        let sheets = TetDraw::Sheets(SheetStyle::default());
        let judges = [(sheets, TetDraw::Judge), (TetDraw::Judge, TetDraw::Judge), (TetDraw::Auto, TetDraw::Reference)];
        for (draw, judge) in judges {
            assert_eq!((draw.judge(), judge.drawn_by().is_reference()), (judge, true));
        }
        assert_eq!([cells, vertices].map(|of| TetDraw::Reference.of(of)), [TetDraw::Reference, TetDraw::Judge]);
    }
}
