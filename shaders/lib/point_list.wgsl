// Cells as points: their parameters and corners. The Rust twin of the parameters is in src/render/gpu/point_params.rs; CPU twin:
// render/cpu/points/shape.rs.

struct PointParams {
    // L^-1/2, by which shapes are enlarged at level of detail L; that times the point radius, and the radius.
    enlarged_by: f32,
    scale: f32,
    radius: f32,
    // Number of cells that a point stands for: L^-2.
    stands_for: f32,
    // Least half width of a shape on the image plane; 0 if rays decide.
    least: f32,
    flags: u32,
    unused: vec2<u32>,
}

// Flags of `PointParams`: squares; balls; slabs of one scalar that add up; gaps between points; rays decide, and points are the cells.
const SQUARE: u32 = 1u;
const BALL: u32 = 2u;
const SLABS: u32 = 4u;
const GAPS: u32 = 8u;
const AS_CELLS: u32 = 16u;

fn point_is(flag: u32) -> bool {
    return (point_params.flags & flag) != 0u;
}
