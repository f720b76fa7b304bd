//! Quality families may change while a frame is under way: only whole images are shown.

use super::super::Settings;
use super::super::quality::Quality;
use super::*;
use crate::camera::{Camera, Projection};
use crate::field::TimeAxis;
use crate::node_table::{Node, NodeTable};
use crate::pipeline::test_series::jet;
use crate::pipeline::{FaceDetail, Pipeline, PipelinedOptions, ResidualBase, ResidualRequest};
use crate::render::{Contrast, Planes};

/// Enough rows for the rays of one contrast to be shown before the next are ready.
const SIZE_PX: (usize, usize) = (240, 180);

/// A paused player and its request.
struct Stage {
    player: Player,
    request: FrameRequest,
    /// Frames rendered by a pipeline of their own.
    alone: Vec<(FrameRequest, Planes)>,
}

impl Stage {
    fn open() -> Self {
        let series = jet();
        let bounds = series.mesh().positions.world_bounds();
        // The middle of the mesh fills the view: a pixel without a ray is transparent, and no other one.
        let projection = Projection::Perspective { view_angle: 4.0 };
        let camera = Camera { projection, ..Camera::default_for(bounds).unwrap() };
        let [lo, hi] = series.field().range.unwrap().map(f64::from);
        let per_length = 1.0 / (bounds.1 - bounds.0).length();
        let node = |scalar, rgb, tau: f64| Node { scalar, rgb, tau: tau * per_length };
        let table = NodeTable::new(vec![node(lo, [0.1, 0.2, 1.0], 0.5), node(hi, [1.0, 0.7, 0.1], 20.0)]).unwrap();
        let request = FrameRequest::new(0, camera, Arc::new(table), SIZE_PX);
        let options = PipelinedOptions { threads: Some(1), frame_cache_bytes: 0, ..Default::default() };
        let pipelined = Pipelined::start(Pipeline::new(series.clone()), &options, || ()).unwrap();
        let values = (0..series.times().len()).map(|step| step as f64).collect();
        let clock = Clock::with_settings(TimeAxis { values }, Settings::default()).unwrap();
        Self { player: Player::new(clock, pipelined), request, alone: Vec::new() }
    }

    /// Changes the request and redraws.
    fn draw(&mut self, request: &FrameRequest) {
        self.request = request.clone();
        self.player.redraw();
    }

    /// The next image shown.
    fn next_shown(&mut self) -> Delivery {
        loop {
            let request = self.request.clone();
            let tick = self.player.tick(Duration::ZERO, &mut |time| Some(FrameRequest { time, ..request.clone() }));
            if let Some(shown) = tick.shown {
                return shown;
            }
            self.player.wait(Duration::from_millis(1));
        }
    }

    /// The planes from a pipeline that has never seen another request.
    fn alone(&mut self, request: &FrameRequest) -> &Planes {
        let at = self.alone.iter().position(|(known, _)| known == request).unwrap_or_else(|| {
            let series = self.player.pipelined().series().clone();
            let planes = Pipeline::new(series).render(request).unwrap().planes.clone();
            self.alone.push((request.clone(), planes));
            self.alone.len() - 1
        });
        &self.alone[at].1
    }
}

/// Whether an image of a view full of cells has all of its pixels.
fn is_complete(planes: &Planes, size_px: (usize, usize)) -> bool {
    let (color, depth) = (&planes.color, &planes.depth);
    let has_size = (color.width, color.height) == size_px && (depth.width, depth.height) == size_px;
    has_size && color.pixels.iter().all(|p| p[3] > 0.0) && depth.pixels.iter().all(|depth| depth.is_finite())
}

/// `exact` in full with previews, and by each family.
fn families(exact: &FrameRequest, base: ResidualBase) -> [FrameRequest; 5] {
    let contrast = |contrast| Contrast::new(contrast).unwrap();
    let of = |quality: Quality| quality.of_request(exact.clone(), FaceDetail::ALL);
    [
        FrameRequest { previews: vec![contrast(0.1), contrast(0.02), contrast(0.004)], ..exact.clone() },
        of(Quality::Rays(contrast(0.05))),
        of(Quality::Scaled(0.5)),
        FrameRequest { residual: Some(ResidualRequest { base, anew: 1..3 }), ..of(Quality::Details) },
        of(Quality::Faces(0.3)),
    ]
}

#[test]
fn a_change_of_family_never_shows_a_half_filled_image() {
    let mut stage = Stage::open();
    let exact = stage.request.clone();
    let first = stage.next_shown().frame.unwrap();
    assert!(is_complete(&first.planes, SIZE_PX), "the view is full of cells");
    let mut half = first.planes.clone();
    half.color.pixels[SIZE_PX.0 * SIZE_PX.1 / 2] = [0.0; 4];
    assert!(!is_complete(&half, SIZE_PX), "one pixel without a ray is noticed");
    let families = families(&exact, ResidualBase::exact(first));
    let (mut under_way, mut previews) = (0, 0);
    for (from, to) in families.iter().flat_map(|from| families.iter().map(move |to| (from, to))) {
        let others = families.iter().filter(|other| *other != from && *other != to);
        for (pictures, other) in others.enumerate() {
            // First another look, of which no frame is awaited; then some images of the first family, and a change.
            stage.draw(other);
            let mut shown: Vec<Delivery> = Vec::new();
            stage.draw(from);
            let is_all = |shown: &Delivery| shown.is_final && shown.request == *from;
            while shown.len() < pictures && !shown.last().is_some_and(is_all) {
                shown.push(stage.next_shown());
            }
            under_way += usize::from(shown.last().is_none_or(|last| !last.is_final));
            stage.draw(to);
            let is_end = |shown: &Delivery| shown.is_final && shown.request == *to;
            while !shown.last().is_some_and(is_end) {
                shown.push(stage.next_shown());
            }
            for Delivery { request, frame, is_final, .. } in shown {
                let planes = &frame.unwrap().planes;
                assert!(is_complete(planes, request.size_px), "{request:?}");
                assert!(planes == stage.alone(&request), "{request:?}");
                previews += usize::from(!is_final);
            }
        }
    }
    assert!(under_way > 10 && previews > 5, "{under_way} changes with a picture under way, {previews} previews");
}
