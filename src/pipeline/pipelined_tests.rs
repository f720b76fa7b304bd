//! A pipelined pipeline delivers the same frames as a sequential one.

use super::super::test_series::{jet, logged};
use super::*;
use crate::camera::{Camera, CameraError};
use crate::error::FileError;
use crate::image::PlaneSamples;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::PipelineError;
use crate::pipeline::{FrameTime, TetDraw};
use crate::render::Frame;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

const LONG: Duration = Duration::from_secs(60);

/// Requests that differ in every property.
fn requests(series: &Series) -> Vec<FrameRequest> {
    let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
    let [lo, hi] = series.field().range.unwrap().map(f64::from);
    let table = |tau: f64| {
        let node = |t: f64, tau| Node { scalar: lo + t * (hi - lo), rgb: [t, 0.5, 1.0 - t], tau };
        Arc::new(NodeTable::new(vec![node(0.0, 0.0), node(0.4, tau), node(1.0, 0.3 * tau)]).unwrap())
    };
    let tables = [table(30.0), table(3.0)];
    let steps = series.times().len();
    let mut requests = Vec::new();
    for step in 0..steps {
        for weight in [0.0, 0.25] {
            let time = FrameTime::between(step, (step + 1) % steps, weight);
            let request = FrameRequest::new(time, camera, tables[0].clone(), (24, 17));
            requests.push(request.clone());
            requests.push(FrameRequest { camera: camera.orbit(70.0, 20.0).unwrap(), ..request.clone() });
            let other = request.with_tets(|tets| tets.table = tables[1].clone().into());
            requests.push(FrameRequest { size_px: (33, 20), ..other });
        }
    }
    let judge = requests[0].clone().with_draw(TetDraw::Reference);
    requests.push(judge);
    requests
}

/// Name, size and bits of each plane.
type PlaneBits = Vec<(&'static str, (usize, usize), Vec<u32>)>;

fn bits(frame: &Frame) -> PlaneBits {
    let of = |plane: &PlaneSamples<'_>| plane.samples.iter().map(|v| v.to_bits()).collect();
    frame.planes.list().iter().map(|plane| (plane.name, plane.size_px, of(plane))).collect()
}

/// Frames of the requests, each rendered by a new pipeline.
fn rendered_alone(series: &Arc<Series>, requests: &[FrameRequest]) -> Vec<PlaneBits> {
    requests.iter().map(|request| bits(Pipeline::new(series.clone()).render(request).unwrap())).collect()
}

fn options(threads: usize, frame_cache_bytes: u64) -> PipelinedOptions {
    PipelinedOptions { threads: Some(threads), frame_cache_bytes, ..Default::default() }
}

fn start(series: &Arc<Series>, options: &PipelinedOptions) -> Pipelined {
    Pipelined::start(Pipeline::new(series.clone()), options, || ()).unwrap()
}

/// A request for a step of a fake series.
fn step(series: &Series, step: usize) -> FrameRequest {
    FrameRequest { time: step.into(), ..requests(series)[0].clone() }
}

#[derive(Clone, Copy, Debug)]
enum Act {
    Push(usize),
    Replace(usize),
    Seek(usize),
    Clear,
    Take,
    Wait,
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let which = any::<prop::sample::Index>().prop_map(|i| i.index(1000));
    let act = prop_oneof![
        4 => which.clone().prop_map(Act::Push),
        2 => which.clone().prop_map(Act::Replace),
        1 => which.prop_map(Act::Seek),
        1 => Just(Act::Clear),
        2 => Just(Act::Take),
        3 => Just(Act::Wait),
    ];
    prop::collection::vec(act, 1..40)
}

/// Model of the wanted requests, by the rules alone: requests in order, with their ids.
#[derive(Default)]
struct Model {
    wanted: Vec<(FrameId, usize)>,
}

impl Model {
    /// Checks a delivered frame: it must be the next wanted one, but `replace` may have dropped some.
    fn delivered(&mut self, id: FrameId) -> usize {
        let at = self.wanted.iter().position(|(wanted, _)| *wanted == id).expect("a frame that nobody wants");
        self.wanted.drain(..=at).next_back().unwrap().1
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn every_frame_is_bit_for_bit_that_of_its_request_whatever_was_asked_before(
        acts in acts(), threads in 1usize..=4, keeps in any::<bool>(),
    ) {
        static ALONE: std::sync::OnceLock<Alone> = std::sync::OnceLock::new();
        type Alone = (Arc<Series>, Vec<FrameRequest>, Vec<PlaneBits>);
        let (series, requests, alone) = ALONE.get_or_init(|| {
            let series = jet();
            let requests = requests(&series);
            let alone = rendered_alone(&series, &requests);
            assert!(alone.iter().any(|frame| *frame != alone[0]), "frames of another request would not be seen");
            (series, requests, alone)
        });
        let pipelined = start(series, &options(threads, if keeps { 1 << 20 } else { 0 }));
        let mut model = Model::default();
        let check = |model: &mut Model, delivery: Delivery| {
            let which = model.delivered(delivery.id);
            assert_eq!(delivery.request, requests[which]);
            assert!(bits(&delivery.frame.unwrap()) == alone[which], "request {which}");
        };
        for act in acts {
            match act {
                Act::Push(which) => {
                    let which = which % requests.len();
                    model.wanted.push((pipelined.push(requests[which].clone()).unwrap(), which));
                }
                Act::Replace(which) => {
                    let which = which % requests.len();
                    model.wanted.push((pipelined.replace(requests[which].clone()).unwrap(), which));
                }
                Act::Seek(which) => {
                    let which = which % requests.len();
                    model.wanted = vec![(pipelined.seek(requests[which].clone()).unwrap(), which)];
                }
                Act::Clear => {
                    pipelined.clear();
                    model.wanted.clear();
                    prop_assert_eq!(pipelined.wanted(), 0);
                }
                Act::Take => {
                    if let Some(delivery) = pipelined.take() {
                        check(&mut model, delivery);
                    }
                }
                Act::Wait => {
                    let is_something_wanted = pipelined.wanted() > 0;
                    let delivery = pipelined.wait(LONG);
                    prop_assert_eq!(delivery.is_some(), is_something_wanted);
                    if let Some(delivery) = delivery {
                        check(&mut model, delivery);
                    }
                }
            }
            prop_assert!(pipelined.preparations().most <= PREPARATIONS);
        }
        // The last request is delivered in any case.
        let last = model.wanted.last().copied();
        let mut delivered = None;
        while let Some(delivery) = pipelined.wait(LONG) {
            delivered = Some(delivery.id);
            check(&mut model, delivery);
        }
        prop_assert_eq!(delivered, last.map(|(id, _)| id));
    }
}

#[test]
fn frames_that_were_pushed_come_once_each_and_in_order() {
    let (series, log) = logged(100);
    let pipelined = start(&series, &options(2, 0));
    let mut asked = 0;
    let mut shown = Vec::new();
    while shown.len() < 100 {
        while asked < 100 && pipelined.push(step(&series, asked)).is_some() {
            asked += 1;
        }
        let delivery = pipelined.wait(LONG).unwrap();
        assert!(!delivery.is_kept && delivery.frame.is_ok());
        shown.push(delivery.request.time.step());
    }
    assert_eq!(shown, (0..100).collect::<Vec<_>>());
    assert_eq!(log.decoded(), shown, "each step is decoded once");
    assert_eq!(pipelined.wanted(), 0);
    assert!(pipelined.wait(LONG).is_none(), "nothing is wanted, so nothing is waited for");
}

#[test]
fn a_full_queue_takes_no_more_until_something_is_taken() {
    let (series, log) = logged(500);
    let pipelined = start(&series, &options(1, 0));
    log.hang(true);
    let accepted = (0..500).take_while(|&s| pipelined.push(step(&series, s)).is_some()).count();
    assert!((64..=64 + PREPARATIONS + 1).contains(&accepted), "{accepted}");
    log.hang(false);
    for expected in 0..accepted {
        assert_eq!(pipelined.wait(LONG).unwrap().request.time, expected.into());
    }
}

#[test]
fn a_storm_of_seeks_ends_on_the_last_one_with_two_preparations_at_most() {
    let series = jet();
    let requests = requests(&series);
    for threads in 1..=4 {
        let pipelined = start(&series, &options(threads, 1 << 20));
        let mut last = None;
        for seek in 0..1000 {
            let which = seek * 7 % requests.len();
            last = Some((pipelined.seek(requests[which].clone()).unwrap(), which));
            assert_eq!(pipelined.wanted(), 1);
            if seek % 3 == 0
                && let Some(delivery) = pipelined.take()
            {
                assert_eq!(Some(delivery.id), last.map(|(id, _)| id), "only the newest may be seen");
            }
        }
        let (id, which) = last.unwrap();
        if let Some(delivery) = pipelined.wait(LONG) {
            assert_eq!((delivery.id, &delivery.request), (id, &requests[which]));
            let alone = rendered_alone(&series, &requests[which..=which]);
            assert!(bits(&delivery.frame.unwrap()) == alone[0]);
        } else {
            assert_eq!(pipelined.wanted(), 0, "it was taken in the storm");
        }
        assert!(pipelined.preparations().most <= PREPARATIONS);
        assert!(pipelined.take().is_none());
        assert!(pipelined.stop().decode.buffers() <= 6);
    }
}

#[test]
fn a_step_that_cannot_be_read_is_an_error_of_its_frame_in_its_place() {
    let (series, log) = logged(6);
    log.fail_at(2);
    let pipelined = start(&series, &options(2, 0));
    for s in 0..5 {
        pipelined.push(step(&series, s)).unwrap();
    }
    for s in 0..5 {
        let delivery = pipelined.wait(LONG).unwrap();
        assert_eq!(delivery.request.time, s.into());
        match delivery.frame {
            Ok(_) => assert_ne!(s, 2),
            Err(PipelineError::File(FileError { place, .. })) => assert_eq!((s, place.as_str()), (2, "step 2")),
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn what_fails_or_panics_is_an_error_of_its_frame_and_the_next_one_is_right() {
    let (series, log) = logged(6);
    log.panic_at(1);
    let pipelined = start(&series, &options(2, 1 << 20));
    // More pixels than allowed, for the second stage.
    let too_large = FrameRequest { size_px: (1 << 31, 1 << 31), ..step(&series, 2) };
    let asked = [step(&series, 0), step(&series, 1), step(&series, 2), too_large, step(&series, 3)];
    for request in &asked {
        pipelined.push(request.clone()).unwrap();
    }
    let mut results = Vec::new();
    for _ in &asked {
        results.push(pipelined.wait(LONG).unwrap().frame);
    }
    let expected = rendered_alone(&series, &[asked[0].clone(), asked[2].clone(), asked[4].clone()]);
    for (result, alone) in [&results[0], &results[2], &results[4]].into_iter().zip(&expected) {
        assert!(bits(result.as_ref().unwrap()) == *alone);
    }
    assert!(
        matches!(&results[1], Err(PipelineError::Panicked { stage: "decode", message }) if message.contains("step 1"))
    );
    assert!(
        matches!(&results[3], Err(PipelineError::Camera(CameraError::TooManyPixels(_, height))) if *height == 1 << 31)
    );
    let said = results[1].as_ref().unwrap_err().to_string();
    assert!(said.contains("decode") && said.contains("report"), "{said}");
}

#[test]
fn what_hangs_is_cancelled_by_a_seek_and_by_the_end() {
    let (series, log) = logged(6);
    let pipelined = start(&series, &options(1, 0));
    log.hang(true);
    for s in 0..4 {
        pipelined.push(step(&series, s)).unwrap();
    }
    while pipelined.preparations().now == 0 {
        std::thread::yield_now();
    }
    pipelined.seek(step(&series, 5)).unwrap();
    // The first decoding has been cancelled, and the new one hangs now.
    log.hang(false);
    assert_eq!(pipelined.wait(LONG).unwrap().request.time, 5.into());
    log.hang(true);
    pipelined.push(step(&series, 1)).unwrap();
    drop(pipelined);
    // A render thread that waits for its frame to be taken ends, too.
    log.hang(false);
    let pipelined = start(&series, &options(1, 0));
    for s in 0..6 {
        pipelined.push(step(&series, s)).unwrap();
    }
    while pipelined.preparations().now < PREPARATIONS {
        std::thread::yield_now();
    }
    drop(pipelined);
}

#[test]
fn a_loop_over_an_unchanged_view_renders_nothing_in_its_second_round() {
    let series = jet();
    let steps = series.times().len();
    let ask = |pipelined: &Pipelined, s: usize| {
        pipelined.push(step(&series, s)).unwrap();
        let delivery = pipelined.wait(LONG).unwrap();
        (delivery.is_kept, bits(&delivery.frame.unwrap()))
    };
    let pipelined = start(&series, &options(2, 1 << 20));
    let first: Vec<_> = (0..steps).map(|s| ask(&pipelined, s)).collect();
    let second: Vec<_> = (0..steps).map(|s| ask(&pipelined, s)).collect();
    assert!(first.iter().all(|(is_kept, _)| !is_kept) && second.iter().all(|(is_kept, _)| *is_kept));
    assert!(first.iter().zip(&second).all(|(a, b)| a.1 == b.1));
    // Also without a budget, and for two equal requests on their way.
    let pipelined = start(&series, &options(2, 0));
    let again: Vec<_> = (0..2 * steps).map(|s| ask(&pipelined, s % steps)).collect();
    assert!(again.iter().zip(first.iter().chain(&first)).all(|(a, b)| !a.0 && a.1 == b.1));
}

#[test]
fn memory_of_frames_and_steps_goes_round() {
    let (series, _) = logged(400);
    let pipelined = start(&series, &options(2, 0));
    let mut places = BTreeMap::new();
    for s in 0..400 {
        pipelined.push(step(&series, s)).unwrap();
        if s >= 3 {
            let frame = pipelined.wait(LONG).unwrap().frame.unwrap();
            *places.entry(frame.planes.color.pixels.as_ptr().addr()).or_insert(0) += 1;
        }
    }
    // One being rendered, one delivered, one that waits for its turn, one taken.
    assert!(places.len() <= 4, "{places:?}");
    while pipelined.wait(LONG).is_some() {}
    assert!(pipelined.stop().decode.buffers() <= 5);
}

#[test]
fn the_owner_is_told_of_each_frame_and_the_pipeline_can_be_started_again() {
    let series = jet();
    let told = Arc::new(AtomicUsize::new(0));
    let mut pipeline = Pipeline::new(series.clone());
    for round in 1..=2 {
        let counter = told.clone();
        let count = move || {
            counter.fetch_add(1, Ordering::Relaxed);
        };
        let pipelined = Pipelined::start(pipeline, &PipelinedOptions::default(), count).unwrap();
        for s in 0..4 {
            pipelined.push(step(&series, s)).unwrap();
        }
        while pipelined.wait(LONG).is_some() {}
        pipeline = pipelined.stop();
        assert_eq!(told.load(Ordering::Relaxed), 4 * round);
    }
    assert!(pipeline.render(&step(&series, 1)).is_ok());
}
