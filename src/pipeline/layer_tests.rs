//! Requests with other layers than one volume of the series' field.

use super::*;
use crate::camera::Camera;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::{Backend, FrameRequest, Pipeline, PipelineError, Pipelined, PipelinedOptions, test_series};
use crate::render::Frame;
use crate::render::points::PointStyle;
use crate::visibility::Skip;
use std::time::Duration;

const DRAWS: [TetDraw; 5] =
    [TetDraw::Auto, TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Points(PointStyle::EXACT), TetDraw::Reference];

fn request() -> FrameRequest {
    let camera = Camera::default_for(test_series::mesh().positions.world_bounds()).unwrap();
    let table = NodeTable::new(vec![Node { scalar: 0.0, rgb: [1.0; 3], tau: 1.0 }]).unwrap();
    let request = FrameRequest::new(1, camera, Arc::new(table), (24, 17));
    FrameRequest { backend: Backend::Cpu, ..request }
}

fn is_transparent(frame: &Frame) -> bool {
    frame.planes.color.pixels.len() == 24 * 17
        && frame.planes.color.pixels.iter().all(|pixel| *pixel == [0.0; 4])
        && frame.planes.depth.pixels.iter().all(|depth| *depth == f32::INFINITY)
}

#[test]
fn a_frame_without_a_volume_is_clear_and_nothing_is_decoded_for_it() {
    let (series, log) = test_series::logged(3);
    let mut pipeline = Pipeline::new(series);
    for skip in [Skip::ALL, Skip::NONE] {
        for draw in DRAWS {
            let whole = FrameRequest { skip, ..request().with_draw(draw) };
            let without = whole.clone().with_tets(|tets| tets.volume = false);
            let empty = FrameRequest { layers: Vec::new(), ..whole.clone() };
            assert!(!whole.same_view(&without) && !whole.same_view(&empty));
            for blank in [without, empty] {
                let decoded = log.decoded();
                assert!(is_transparent(pipeline.render(&blank).unwrap()), "{draw:?}");
                assert_eq!(log.decoded(), decoded, "{draw:?}");
            }
            assert!(!is_transparent(pipeline.render(&whole).unwrap()), "the test can fail");
        }
    }
    assert!(!log.decoded().is_empty());
    let nowhere = FrameRequest { size_px: (0, 17), layers: Vec::new(), ..request() };
    assert!(matches!(pipeline.render(&nowhere), Err(PipelineError::Camera(_))), "there is no view all the same");
}

#[test]
fn a_layer_of_another_field_and_a_second_one_of_cells_are_refused_by_name() {
    let (series, log) = test_series::logged(3);
    let name = series.field().name.clone();
    let mut pipeline = Pipeline::new(series.clone());
    let mut refused = |request: &FrameRequest| pipeline.render(request).unwrap_err().to_string();
    let other = request().with_tets(|tets| tets.field = Some("pressure".to_owned()));
    let said = refused(&other);
    assert!(said.contains("'pressure'") && said.contains(&format!("'{name}'")), "{said}");
    let twice = FrameRequest { layers: [request().layers, request().layers].concat(), ..request() };
    let said = refused(&twice);
    assert!(said.contains("layers 0 and 1") && said.contains("tets"), "{said}");
    assert!(log.decoded().is_empty());
    let own = request().with_tets(|tets| tets.field = Some(name));
    assert!(!is_transparent(pipeline.render(&own).unwrap()));
    // With a thread for each stage the error is delivered in its turn, and the stages go on.
    let pipelined = Pipelined::start(Pipeline::new(series), &PipelinedOptions::default(), || ()).unwrap();
    for request in [other, own] {
        pipelined.push(request).unwrap();
    }
    let next = || pipelined.wait(Duration::from_secs(600)).unwrap().frame.map(|frame| is_transparent(&frame));
    assert!(matches!(next(), Err(PipelineError::Request(RequestError::OtherField { .. }))));
    assert!(matches!(next(), Ok(false)));
}

#[test]
fn volume_and_surfaces_take_turns_and_the_first_surface_is_made_where_it_is_asked_for() {
    let mut look = SurfaceLook::default();
    let mut layer = TetLayer::new(Arc::new(NodeTable::transparent()));
    let mut seen = Vec::new();
    for _ in 0..4 {
        layer.show(&look);
        seen.push((layer.volume, layer.surfaces.len(), layer.is_empty()));
        look.show_next(2.5);
    }
    assert_eq!(seen, [(true, 0, false), (false, 1, false), (true, 1, false), (true, 0, false)]);
    assert_eq!(look.isosurfaces, [Isosurface::new(2.5)]);
    look.move_isovalue(1.0, (-1.0, 3.0));
    assert_eq!(look.isosurfaces[0].value, 3.0, "no further than the range");
    look.move_isovalue(-0.5, (-1.0, 3.0));
    assert_eq!(look.isosurfaces[0].value, 2.5);
    look.isosurfaces.clear();
    look.shown = Shown::Surfaces;
    layer.show(&look);
    assert!(layer.is_empty());
    SurfaceLook::default().move_isovalue(1.0, (0.0, 1.0));
}
