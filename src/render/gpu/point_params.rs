//! The parameters of cells as points, in the layout of `shaders/lib/point_list.wgsl`.

use crate::camera::View;
use crate::render::cpu::splat::ellipsoid::half_pixel;
use crate::render::points::{Compositing, Footprint, PointStyle};
use bytemuck::{Pod, Zeroable};

/// Bits of [`PointParams::flags`].
pub mod point_flags {
    /// Shapes are squares.
    pub const SQUARE: u32 = 1;
    /// Shapes are balls.
    pub const BALL: u32 = 2;
    /// Points are slabs of one scalar, which add up.
    pub const SLABS: u32 = 4;
    /// Light is that of the gaps between points.
    pub const GAPS: u32 = 8;
    /// Points are the cells themselves.
    pub const AS_CELLS: u32 = 16;
}

/// Parameters of cells as points (`shaders/lib/point_list.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PointParams {
    /// L^-1/2, by which shapes are enlarged at level of detail L.
    pub enlarged_by: f32,
    /// That times the point radius.
    pub scale: f32,
    /// The point radius.
    pub radius: f32,
    /// Number of cells that a point stands for: L^-2.
    pub stands_for: f32,
    /// Least half width of a shape on the image plane; 0 if rays decide.
    pub least: f32,
    /// Bits of [`point_flags`].
    pub flags: u32,
    /// Padding.
    pub unused: [u32; 2],
}

impl PointParams {
    /// The parameters of a style in a view in local coordinates, of cells or of a cloud.
    pub fn new(style: PointStyle, view: &View, is_cloud: bool) -> Self {
        let enlarged_by = style.lod.powf(-0.5);
        let of_footprint = match style.footprint {
            Footprint::Square => point_flags::SQUARE,
            Footprint::Circle => point_flags::BALL,
            Footprint::Ellipse if is_cloud => point_flags::BALL,
            Footprint::Ellipse | Footprint::Exact => 0,
        };
        let of_compositing = match (style.compositing, style.footprint) {
            (Compositing::Gap, _) => point_flags::GAPS,
            (Compositing::Own, Footprint::Exact) => 0,
            (Compositing::Own, _) => point_flags::SLABS,
        };
        let of_cells = if style.is_exact() { point_flags::AS_CELLS } else { 0 };
        Self {
            enlarged_by: enlarged_by as f32,
            scale: (style.radius * enlarged_by) as f32,
            radius: style.radius as f32,
            stands_for: style.lod.powi(-2) as f32,
            least: if style.is_exact() { 0.0 } else { half_pixel(view) as f32 },
            flags: of_footprint | of_compositing | of_cells,
            unused: [0; 2],
        }
    }
}
