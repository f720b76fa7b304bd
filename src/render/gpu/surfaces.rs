//! Isosurfaces in the GPU's memory.
//!
//! Sheets are in a uniform buffer. Gradients of vertices lie behind the view vertices ([`VertexBuffers`](super::buffers::VertexBuffers)),
//! so that stages keep within eight storage buffers; the walk reads the vertices of cells from their records, renderers with lists from
//! [`CornerBuffer`].

use super::buffers::GrowingBuffer;
use super::context::Context;
use super::layout::{SheetParams, SurfaceParams};
use super::resources::Resource;
use crate::mesh::Mesh;
use crate::optics::ScalarMap;
use crate::render::surfaces::{Normals, Sheet, SurfaceScene};
use crate::render::{RenderError, RenderJob};
use std::sync::Arc;

/// Base-2 logarithm of the bound on mapped scalars in frames without a volume: far below the clamp at 1e30, and large enough that small
/// scalars keep their digits.
const EXPONENT_WITHOUT_VOLUME: i32 = 60;

/// The map of a job's scalars, which are multiplied by `prescale` before it and have magnitudes of at most `largest` before that.
///
/// The map's range includes the isovalues: scalars near them differ by less than themselves from the offset, if there is one, so that
/// the difference is exact, and a scalar below an isovalue is mapped below it. (Denormal numbers among much larger ones count as 0.)
pub(super) fn scalar_map(job: &RenderJob, prescale: f64, largest: f32) -> ScalarMap {
    let of_cells = job.scalars.of_cells().is_some();
    let of_table = ScalarMap { of_cells, ..ScalarMap::of_table(&job.table, prescale) };
    let sheets = job.surfaces.as_ref().map_or(&[][..], SurfaceScene::sheets);
    let ([first, ..], [.., last]) = (sheets, sheets) else { return of_table };
    let nodes = job.table.nodes();
    if nodes.iter().any(|node| node.tau > 0.0) {
        let (lo, hi) = (nodes[0].scalar, nodes[nodes.len() - 1].scalar);
        return ScalarMap::of_range(lo.min(first.value), hi.max(last.value), prescale);
    }
    let map = ScalarMap::of_range(first.value, last.value, prescale);
    let reach = f64::from(largest) * prescale + map.offset.abs();
    let exponent = if reach > 0.0 { EXPONENT_WITHOUT_VOLUME - reach.log2().ceil() as i32 } else { 0 };
    ScalarMap { scale: 2f64.powi(exponent.clamp(-100, 100)), ..map }
}

/// The buffer of a frame's sheets, and its contents.
pub(super) struct SurfaceBuffer {
    pub(super) buffer: GrowingBuffer,
    sent: Option<SurfaceParams>,
}

impl SurfaceBuffer {
    pub(super) fn new() -> Self {
        Self { buffer: GrowingBuffer::new(Resource::Surfaces), sent: None }
    }

    /// Uploads the surfaces of a job, if any, unless they are there; `gradients` is the index of the first gradient component. Returns
    /// whether the buffer was made, and the bytes sent.
    pub(super) fn update(
        &mut self,
        context: &Context,
        job: &RenderJob,
        map: ScalarMap,
        gradients: u32,
        has_volume: bool,
    ) -> Result<(bool, u64), RenderError> {
        let made = self.buffer.reserve(context, size_of::<SurfaceParams>() as u64)?;
        let Some(scene) = &job.surfaces else { return Ok((made, 0)) };
        let wanted = SurfaceParams { gradients, has_volume: u32::from(has_volume), ..params(scene, job, map) };
        if !made && self.sent == Some(wanted) {
            return Ok((false, 0));
        }
        self.sent = None;
        let sent = self.buffer.write(context, 0, bytemuck::bytes_of(&wanted))?;
        self.sent = Some(wanted);
        Ok((made, sent))
    }
}

/// The surface parameters that depend on scene, view and map alone.
fn params(scene: &SurfaceScene, job: &RenderJob, map: ScalarMap) -> SurfaceParams {
    let (shading, view) = (scene.shading(), &job.view);
    let towards = shading.towards_light();
    let in_view = towards.map_or([0.0; 3], |light| [view.right, view.up, view.forward].map(|axis| axis.dot(light)));
    let mut params = SurfaceParams {
        light: in_view.map(|c| c as f32),
        count: scene.sheets().len() as u32,
        normals: match shading.normals {
            // Normals from the image, or none.
            Normals::None | Normals::Screen | Normals::Depth => 0,
            Normals::Vertex if scene.gradients().is_some() => 2,
            Normals::Cell | Normals::Vertex => 1,
        },
        is_headlight: u32::from(towards.is_none()),
        ..SurfaceParams::default()
    };
    for (params, sheet) in params.sheets.iter_mut().zip(scene.sheets()) {
        let Sheet { value, front, back, opacity, .. } = *sheet;
        let color = |[r, g, b]: [f64; 3], last: f32| [r as f32, g as f32, b as f32, last];
        *params = SheetParams { front: color(front, map.threshold(value)), back: color(back, opacity as f32) };
    }
    params
}

/// The buffer of the cells' vertices.
pub(super) struct CornerBuffer {
    of: Option<Arc<Mesh>>,
    pub(super) buffer: GrowingBuffer,
}

impl CornerBuffer {
    pub(super) fn new() -> Self {
        Self { of: None, buffer: GrowingBuffer::new(Resource::Corners) }
    }

    /// Uploads the vertices of a job's cells, if they are needed, unless they are there. Returns whether the buffer was made, and the
    /// bytes sent.
    pub(super) fn upload(
        &mut self,
        context: &Context,
        job: &RenderJob,
        are_needed: bool,
    ) -> Result<(bool, u64), RenderError> {
        if !are_needed {
            return Ok((self.buffer.reserve(context, 0)?, 0));
        }
        if self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, &job.mesh)) {
            return Ok((false, 0));
        }
        self.of = None;
        let tets = &job.mesh.topology.tets;
        let made = self.buffer.reserve(context, size_of_val(&tets[..]) as u64)?;
        let sent = self.buffer.write(context, 0, bytemuck::cast_slice(tets))?;
        self.of = Some(job.mesh.clone());
        Ok((made, sent))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node_table::{Node, NodeTable};
    use crate::render::surfaces::{Isosurface, SurfaceShading};
    use crate::render::testing;

    /// A scalar as `view_transform.wgsl` sees it.
    fn seen(scalar: f32, map: ScalarMap) -> f32 {
        ((scalar * map.prescale as f32 - map.offset as f32) * map.scale as f32).clamp(-1e30, 1e30)
    }

    fn job(isovalues: &[f64], nodes: [f64; 2], tau: f64) -> RenderJob {
        use crate::camera::{Camera, Projection};
        use crate::mesh::test_meshes::kuhn_grid;
        let mesh = Arc::new(Mesh::build(kuhn_grid([1; 3])).unwrap().0);
        let camera = Camera {
            position: glam::DVec3::new(5.0, 4.0, 3.0),
            focal_point: glam::DVec3::ZERO,
            view_up: glam::DVec3::Z,
            projection: Projection::Parallel { scale: 1.0 },
            near: 0.0,
        };
        let node = |scalar: f64| Node { scalar, rgb: [1.0; 3], tau };
        let table = Arc::new(NodeTable::new(nodes.map(node).to_vec()).unwrap());
        let surfaces: Vec<_> = isovalues.iter().map(|&value| Isosurface::new(value)).collect();
        let scene = SurfaceScene::new(&surfaces, SurfaceShading::default(), &table).unwrap();
        let vertices = mesh.positions.local.len();
        RenderJob { surfaces: Some(scene), ..testing::job(&mesh, vec![0.0; vertices], &camera, (4, 4), table) }
    }

    /// Isovalues, nodes, the largest scalar.
    const CASES: [([f64; 2], [f64; 2], f32); 9] = [
        ([0.1, 0.7], [0.0, 1.0], 1.0),
        ([300.1, 300.2], [300.0, 300.5], 300.5),
        // An offset that the table alone would have, and one that the isovalues alone would.
        ([0.1, 300.2], [300.0, 300.5], 300.5),
        ([300.1, 300.2], [-1.0, 1.0], 400.0),
        ([1e-30, 2.5e-30], [0.0, 3e-30], 3e-30),
        ([-1e37, 3e37], [-1e38, 1e38], 1e38),
        ([0.0, 0.0], [5.0, 6.0], 1e35),
        ([f64::MAX, f64::MAX], [0.0, 1.0], 1.0),
        ([f64::MIN, 0.1], [0.0, 1.0], 1.0),
    ];

    #[test]
    fn scalars_next_to_an_isovalue_are_on_the_sides_that_they_have_on_the_cpu() {
        for (isovalues, nodes, largest) in CASES {
            for tau in [0.0, 1.0] {
                let job = job(&isovalues, nodes, tau);
                let map = scalar_map(&job, 1.0, largest);
                for isovalue in isovalues {
                    let near = isovalue as f32;
                    let near = [near.next_down().next_down(), near.next_down(), near, near.next_up()];
                    let scalars = near.into_iter().chain([0.0, largest, -largest]);
                    for scalar in scalars.filter(|s| s.abs() <= largest && (s.is_normal() || *s == 0.0)) {
                        let is_above = seen(scalar, map) >= map.threshold(isovalue);
                        assert_eq!(is_above, f64::from(scalar) >= isovalue, "{scalar:e} of {isovalue:e}: {map:?}");
                    }
                }
                assert!(tau > 0.0 || seen(largest, map).abs() < 1e30, "{map:?}");
            }
        }
    }

    #[test]
    fn the_nearest_number_to_an_isovalue_is_not_enough() {
        // Below the isovalue, and would count as above.
        let map = scalar_map(&job(&[0.7, 0.7], [0.0, 1.0], 1.0), 1.0, 1.0);
        let below = 0.7f64 as f32;
        assert!(f64::from(below) < 0.7 && seen(below, map) >= map.apply(0.7) as f32);
        assert!(seen(below, map) < map.threshold(0.7));
    }

    #[test]
    fn denormal_scalars_come_multiplied_and_have_the_same_sides() {
        let prescale = 2f64.powi(100);
        let isovalue = 3.3e-42;
        let map = scalar_map(&job(&[isovalue; 2], [0.0, 1.0], 0.0), prescale, 1e-41);
        for bits in (isovalue as f32).to_bits() - 2..(isovalue as f32).to_bits() + 3 {
            let scalar = f32::from_bits(bits);
            assert_eq!(seen(scalar, map) >= map.threshold(isovalue), f64::from(scalar) >= isovalue);
        }
    }
}
