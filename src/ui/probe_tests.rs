//! Points under the mouse, and curves of points.

use super::super::worker::tests::{counted, wait_for};
use super::*;
use crate::camera::Camera;
use crate::functions::value_at;
use crate::functions::vertices::VertexFunctions;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::test_series::{jet, logged};
use crate::pipeline::{FlowLayer, FrameTime, Layer};
use crate::render::flow::FlowStyle;
use crate::render::functions::SheetStyle;
use std::sync::atomic::Ordering;

/// A frame in which all values between the least and the greatest are visible.
fn frame(series: &Series, time: impl Into<FrameTime>) -> FrameRequest {
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
    let node = |scalar, tau| Node { scalar, rgb: [1.0, 0.5, 0.0], tau };
    let table = NodeTable::new(vec![node(-1e3, 0.5), node(1e3, 1.5)]).unwrap();
    FrameRequest::new(time, camera, Arc::new(table), (40, 30))
}

fn at_middle(series: &Arc<Series>, time: impl Into<FrameTime>) -> HoverRequest {
    HoverRequest { series: series.clone(), request: frame(series, time), at_px: (20.2, 15.1) }
}

fn silent() -> Prober {
    Prober::start(Arc::new(|| ())).unwrap()
}

fn answer(prober: &Prober) -> Hover {
    wait_for("answer", || prober.take_hover())
}

fn whole_curve(prober: &Prober) -> Arc<Curve> {
    wait_for("curve", || prober.curve().filter(|curve| curve.is_over))
}

#[test]
fn the_point_found_is_that_of_the_frame_and_says_what_was_asked() {
    let (series, (woken, wake)) = (jet(), counted());
    let prober = Prober::start(wake).unwrap();
    for time in [2.into(), FrameTime::between(1, 2, 0.3), 0.into()] {
        let asked = at_middle(&series, time);
        let job = Pipeline::new(series.clone()).prepare(&asked.request).unwrap();
        let expected = probe(&job, asked.at_px).unwrap();
        assert!(expected.is_some());
        prober.hover(Some(asked.clone()));
        let found = answer(&prober);
        assert_eq!(found.found, Ok(expected), "{time:?}");
        assert_eq!((found.asked.request, found.asked.at_px), (asked.request, asked.at_px));
    }
    wait_for("three calls", || (woken.load(Ordering::SeqCst) == 3).then_some(()));
    assert!(prober.take_hover().is_none(), "each answer comes once");
}

#[test]
fn in_a_frame_of_functions_the_value_is_theirs_at_the_point_of_the_cells() {
    let (series, prober) = (jet(), silent());
    // What is seen is the jet, not what is around it.
    let node = |scalar, tau| Node { scalar, rgb: [1.0, 0.5, 0.0], tau };
    let table = Arc::new(NodeTable::new(vec![node(0.1, 0.0), node(1.0, 2.0)]).unwrap());
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
    let request = FrameRequest::new(2, camera, table, (40, 30));
    let of_cells = HoverRequest { request, ..at_middle(&series, 2) };
    let sheets = TetDraw::Sheets(SheetStyle::default());
    let asked = HoverRequest { request: of_cells.request.clone().with_draw(sheets), ..of_cells.clone() };
    prober.hover(Some(asked));
    let found = answer(&prober);
    let (point, functions) = (found.found.unwrap().unwrap(), found.functions.unwrap());
    let mut values = vec![0.0; series.scalar_count()];
    assert!(series.decode_step(2, &mut values, &Cancel::new()).unwrap());
    let positions = &series.mesh().positions;
    let kernels = VertexFunctions::default().of(series.mesh()).unwrap().kernels;
    let value = |world| value_at(&kernels, &values, positions.local_from_world(world)).unwrap();
    assert_eq!(functions.value, value(point.position));
    assert!(functions.value != point.scalar && functions.reached > 1, "{functions:?} {point:?}");
    // Differences of float64 values, over a ten-thousandth of the mesh: second order, where functions end between, first.
    let step = 1e-4 * positions.scale;
    let along =
        |axis: DVec3| (value(point.position + step * axis) - value(point.position - step * axis)) / (2.0 * step);
    let gradient = DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
    assert!((functions.gradient - gradient).length() < 1e-2 * gradient.length(), "{functions:?} {gradient}");
    prober.hover(Some(of_cells));
    assert!(answer(&prober).functions.is_none());
}

#[test]
fn over_a_still_frame_a_step_is_decoded_once() {
    let (series, log) = logged(8);
    let prober = silent();
    let ask = |time: FrameTime, x_px: f64| {
        prober.hover(Some(HoverRequest { at_px: (x_px, 15.0), ..at_middle(&series, time) }));
        answer(&prober).found.unwrap()
    };
    for x in 0..10 {
        let found = ask(3.into(), 15.0 + f64::from(x)).unwrap();
        assert_eq!(found.scalar, 3.0);
    }
    assert_eq!(log.decoded(), [3]);
    for x in 0..10 {
        let found = ask(FrameTime::between(3, 4, 0.25), 15.0 + f64::from(x)).unwrap();
        assert_eq!(found.scalar, 3.25);
    }
    assert_eq!(log.decoded(), [3, 4]);
}

#[test]
fn the_newest_place_is_answered_last() {
    let (series, log) = logged(100);
    let prober = silent();
    log.hang(true);
    (0..100).for_each(|step| prober.hover(Some(at_middle(&series, step))));
    log.hang(false);
    wait_for("last answer", || prober.take_hover().filter(|hover| hover.asked.request.time == 99.into()));
    // The request in progress is finished; those between are never begun.
    assert!(log.decoded().len() <= 2 && log.decoded().last() == Some(&99), "{:?}", log.decoded());
}

#[test]
fn after_none_no_answer_comes() {
    let (series, log) = logged(10);
    let prober = silent();
    log.hang(true);
    prober.hover(Some(at_middle(&series, 5)));
    prober.hover(None);
    // The thread is done with the dropped request when it answers the next one.
    log.hang(false);
    prober.hover(Some(at_middle(&series, 7)));
    assert_eq!(answer(&prober).asked.request.time, 7.into());
    assert_eq!(log.decoded(), [7]);
}

#[test]
fn a_step_that_fails_or_panics_is_an_answer_and_the_next_one_works() {
    let (series, log) = logged(5);
    log.fail_at(1);
    log.panic_at(2);
    let prober = silent();
    let ask = |step: usize| {
        prober.hover(Some(at_middle(&series, step)));
        answer(&prober).found
    };
    let (damaged, panicked) = (ask(1).unwrap_err(), ask(2).unwrap_err());
    assert!(damaged.contains("damaged"), "{damaged}");
    assert!(panicked.contains("not meant") && panicked.contains("report"), "{panicked}");
    assert_eq!(ask(3).unwrap().unwrap().scalar, 3.0);
}

#[test]
fn a_curve_is_each_step_decoded_whole_and_mixed_in_f64() {
    let series = jet();
    let (prober, weights) = (silent(), [0.125, 0.5, 0.3, 0.075]);
    let mut changing = 0;
    for cell in (0..series.mesh().topology.tets.len() as u32).step_by(97) {
        prober.pick(series.clone(), cell, weights, None);
        let curve = whole_curve(&prober);
        assert_eq!((curve.cell, curve.weights, curve.done, curve.failed), (cell, weights, 4, 0));
        let corner = series.mesh().topology.tets[cell as usize];
        for (step, value) in curve.values.iter().enumerate() {
            let mut whole = vec![0.0; series.scalar_count()];
            assert!(series.decode_step(step, &mut whole, &Cancel::new()).unwrap());
            let [a, b, c, d] = corner.map(|v| f64::from(whole[v as usize]));
            let by_hand = a + (weights[1] * (b - a) + weights[2] * (c - a) + weights[3] * (d - a));
            assert_eq!(value.to_bits(), (by_hand as f32).to_bits(), "cell {cell}, step {step}");
        }
        changing += usize::from(curve.values[0].to_bits() != curve.values[3].to_bits());
    }
    assert!(changing > 0, "the test can fail");
}

#[test]
fn steps_that_cannot_be_read_are_nan_and_counted() {
    let (series, log) = logged(6);
    log.fail_at(2);
    let prober = silent();
    prober.pick(series.clone(), 3, [0.25; 4], None);
    let curve = whole_curve(&prober);
    assert_eq!((curve.done, curve.failed), (6, 1));
    assert!(curve.problem.as_ref().unwrap().contains("damaged"));
    assert!(curve.values[2].is_nan());
    assert_eq!([0, 1, 3, 4, 5].map(|step| curve.values[step]), [0.0, 1.0, 3.0, 4.0, 5.0]);
    log.panic_at(4);
    prober.pick(series.clone(), 3, [0.25; 4], None);
    let curve = whole_curve(&prober);
    assert!(curve.problem.as_ref().unwrap().contains("not meant"), "{curve:?}");
    prober.pick(series, u32::MAX, [0.25; 4], None);
    let curve = whole_curve(&prober);
    assert!(curve.problem.as_ref().unwrap().contains("no cell") && curve.done == 0, "{curve:?}");
}

#[test]
fn the_newest_pick_replaces_others_and_one_that_is_forgotten_shows_nothing() {
    let (series, log) = logged(10);
    let prober = silent();
    log.hang(true);
    (0..20).for_each(|cell| prober.pick(series.clone(), cell, [0.25; 4], None));
    log.hang(false);
    assert_eq!(whole_curve(&prober).cell, 19);
    assert_eq!(log.decoded(), [0, 1, 2, 3, 4, 5, 6, 7, 8, 9], "those before were cancelled");
    log.hang(true);
    prober.pick(series, 4, [0.25; 4], None);
    wait_for("begin", || prober.curve().filter(|curve| curve.cell == 4 && curve.done == 0));
    prober.forget_pick();
    assert!(prober.curve().is_none());
}

#[test]
fn a_curve_is_shown_while_it_grows() {
    let (series, log) = logged(200);
    log.take(Duration::from_millis(2));
    let (woken, wake) = counted();
    let prober = Prober::start(wake).unwrap();
    prober.pick(series, 0, [0.25; 4], None);
    let part = wait_for("part", || prober.curve().filter(|curve| curve.done > 0));
    assert!(part.done < 200 && !part.is_over, "{part:?}");
    for (step, &value) in part.values.iter().enumerate() {
        let expected = if step < part.done { step as f32 } else { f32::NAN };
        assert!(value == expected || (value.is_nan() && expected.is_nan()), "{step}");
    }
    whole_curve(&prober);
    // Calls come at the beginning, at least once on the way, and at the end, right after the curve is complete.
    wait_for("three calls", || (woken.load(Ordering::SeqCst) >= 3).then_some(()));
}

#[test]
fn the_threads_end_with_the_prober_whatever_they_are_at() {
    let (series, log) = logged(10);
    log.hang(true);
    let prober = silent();
    prober.hover(Some(at_middle(&series, 1)));
    prober.pick(series.clone(), 0, [0.25; 4], None);
    wait_for("begin", || prober.curve());
    drop(prober);
    wait_for("end", || (Arc::strong_count(&series) == 1).then_some(()));
}

#[test]
fn with_flow_the_vector_is_linear_in_the_cell_and_in_time_at_the_point_and_over_the_series() {
    let series = Arc::new(Series::open(crate::ui::desk::store(), None).unwrap());
    let prober = silent();
    let mut components = [0, 1, 2].map(|index| {
        let field = format!("velocity:{index}").parse().unwrap();
        let of = Series::open(crate::ui::desk::store(), Some(&field)).unwrap();
        [1, 2].map(|step| {
            let mut values = vec![0.0; of.scalar_count()];
            assert!(of.decode_step(step, &mut values, &Cancel::new()).unwrap());
            values
        })
    });
    let flow = Layer::Flow(FlowLayer::new("velocity".to_owned(), FlowStyle { opacity: 0.0, ..FlowStyle::default() }));
    let mut asked = at_middle(&series, FrameTime::between(1, 2, 0.25));
    prober.hover(Some(asked.clone()));
    assert_eq!(answer(&prober).vector, None);
    asked.request.layers.push(flow);
    prober.hover(Some(asked));
    let hover = answer(&prober);
    let point = hover.found.unwrap().unwrap();
    let tet = series.mesh().topology.tets[point.cell as usize];
    let at = |values: &[f32]| -> f64 { (0..4).map(|i| point.weights[i] * f64::from(values[tet[i] as usize])).sum() };
    let expected = components.each_mut().map(|[a, b]| 0.75 * at(a) + 0.25 * at(b));
    let vector = hover.vector.unwrap();
    // A mixture of two steps is rounded to f32.
    let slack = f64::from(f32::EPSILON) * DVec3::from(expected).length();
    assert!((vector - DVec3::from(expected)).length() <= slack && slack > 0.0, "{vector} {expected:?}");
    prober.pick(series.clone(), point.cell, point.weights, Some("velocity".to_owned()));
    let of = whole_curve(&prober).vectors.clone().unwrap();
    let expected = components.each_ref().map(|[a, _]| at(a) as f32);
    let off = (DVec3::from(of.values[1].map(f64::from)) - DVec3::from(expected.map(f64::from))).length();
    assert!(off <= slack && of.values.len() == 4 && of.values[0] != of.values[3], "{of:?} {expected:?}");
    prober.pick(series, point.cell, point.weights, Some("wind".to_owned()));
    let curve = whole_curve(&prober);
    assert!(curve.problem.as_ref().unwrap().contains("'wind'") && curve.values[1].is_finite(), "{curve:?}");
}
