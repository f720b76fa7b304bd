//! Pipelines whose GPU fails.

use super::super::backend::Renderers;
use super::*;
use crate::camera::{Camera, Projection};
use crate::mesh::RawMesh;
use crate::mesh::test_meshes::cloud;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::DrawnBy;
use crate::pipeline::preparation::Ordered;
use crate::render::gpu::test_common as common;
use crate::render::points::Compositing;
use crate::render::testing;
use glam::DVec3;

fn one_tet() -> Ordered {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let (mesh, _) = Mesh::build(RawMesh { points, cells: vec![[0, 1, 2, 3]].into() }).unwrap();
    let camera = Camera {
        position: DVec3::new(3.0, 2.0, 2.5),
        focal_point: DVec3::splat(0.25),
        view_up: DVec3::Z,
        projection: Projection::Perspective { view_angle: 30.0 },
        near: 0.0,
    };
    let node = |scalar| Node { scalar, rgb: [1.0, 0.5, 0.0], tau: 3.0 };
    let table = Arc::new(NodeTable::new(vec![node(0.0), node(1.0)]).unwrap());
    let job = testing::job(&Arc::new(mesh), vec![0.5; 4], &camera, (32, 24), table);
    Ordered { job, by: DrawnBy::Raycast, on_image: None, enlarge: None, add_details: None }
}

/// A device that is lost before it does anything.
fn open_and_lose(options: &ContextOptions) -> Result<Context, RenderError> {
    let context = Context::new(options)?;
    context.lose();
    Ok(context)
}

#[test]
fn a_gpu_that_is_lost_again_and_again_is_an_error_or_leaves_the_frame_to_the_cpu() {
    let context = match Context::new(&ContextOptions::default()) {
        Ok(context) => context,
        Err(why) => return common::skip("gpu", &why.to_string()),
    };
    let mut renderers = Renderers::default();
    renderers.gpu.open = open_and_lose;
    let refused = renderers.render(one_tet(), Backend::Gpu).map(|_| ());
    assert!(matches!(refused, Err(RenderError::DeviceLost { .. })), "{refused:?}");

    renderers.gpu.choose(ContextOptions { adapter: context.adapter().name.clone(), ..Default::default() });
    for _ in 0..2 {
        let drawn = renderers.render(one_tet(), Backend::Auto);
        let frame = drawn.unwrap().unwrap();
        assert!(!frame.stats.on_gpu && frame.planes.color.pixels.iter().any(|p| p[3] > 0.1));
        assert!(matches!(renderers.gpu.problem(), Some(RenderError::DeviceLost { .. })));
    }
    assert!(renderers.gpu.context().is_none());
}

#[test]
fn rays_that_contrast_asks_for_beyond_the_gpu_do_not_keep_all_rays_from_it() {
    let context = match Context::new(&ContextOptions::default()) {
        Ok(context) => context,
        Err(why) => return common::skip("gpu", &why.to_string()),
    };
    let mut renderers = Renderers::default();
    // A list of all pixels takes 4 bytes each, and what the other stages bind for one tet a few hundred.
    let adapter = context.adapter().name.clone();
    renderers.gpu.choose(ContextOptions { adapter, binding_bytes: Some(2048), ..Default::default() });
    let exact = one_tet();
    let mut fewer = one_tet();
    (fewer.job.mesh, fewer.job.active) = (exact.job.mesh.clone(), exact.job.active.clone());
    fewer.job.contrast = Contrast::new(0.1);
    assert!(!renderers.render(fewer, Backend::Auto).unwrap().unwrap().stats.on_gpu);
    assert!(matches!(renderers.gpu.problem(), Some(RenderError::BeyondGpu { .. })));
    assert!(renderers.render(exact, Backend::Auto).unwrap().unwrap().stats.on_gpu);
    assert!(renderers.gpu.problem().is_none());
}

#[test]
fn a_cloud_beyond_the_gpu_in_one_style_is_drawn_there_in_another() {
    let context = match Context::new(&ContextOptions::default()) {
        Ok(context) => context,
        Err(why) => return common::skip("gpu", &why.to_string()),
    };
    let mut renderers = Renderers::default();
    renderers.gpu.choose(ContextOptions { adapter: context.adapter().name.clone(), ..Default::default() });
    let Ordered { job, .. } = one_tet();
    // Volumes of 1e36 times those of the balls: f32 has no such thickness.
    let mesh = cloud(&[(DVec3::ZERO, 0.3), (DVec3::splat(0.5), 0.3)], &[1e35; 2]);
    let camera = Camera::default_for(mesh.frame()).unwrap();
    let job = testing::job(&mesh, vec![0.5; 2], &camera, (32, 24), job.table);
    let of = |compositing| {
        let style = PointStyle { compositing, ..PointStyle::BALLS };
        let (job, by) = (testing::with_points(&job, style), DrawnBy::Points(style));
        Ordered { job, by, on_image: None, enlarge: None, add_details: None }
    };
    let own = renderers.render(of(Compositing::Own), Backend::Auto).unwrap().unwrap();
    assert!(!own.stats.on_gpu && own.planes.color.pixels.iter().any(|p| p[3] > 0.9));
    assert!(matches!(renderers.gpu.problem(), Some(RenderError::BeyondGpu { .. })));
    let refused = renderers.render(of(Compositing::Own), Backend::Gpu).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("backend cpu"), "{refused}");
    assert!(renderers.render(of(Compositing::Gap), Backend::Gpu).unwrap().unwrap().stats.on_gpu);
}
