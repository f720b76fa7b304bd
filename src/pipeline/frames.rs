//! Finished frames: their buffers are recycled, and frames of an unchanged view are cached.

use super::FrameRequest;
use super::series::Series;
use crate::image::RgbaImage;
use crate::render::Frame;
#[cfg(feature = "gpu")]
use crate::render::gpu::FrameTexture;
use crossbeam::queue::ArrayQueue;
use std::ops::Deref;
use std::sync::{Arc, Weak};

/// Most spare buffers in the pool.
const SPARES_MAX: usize = 3;

/// A shared frame. Its memory goes back to the renderer with the last reference.
#[derive(Clone, Debug)]
pub struct SharedFrame(Arc<Pooled>);

impl AsRef<RgbaImage> for SharedFrame {
    fn as_ref(&self) -> &RgbaImage {
        &self.planes.color
    }
}

impl Deref for SharedFrame {
    type Target = Frame;

    fn deref(&self) -> &Frame {
        &self.0.frame
    }
}

/// A frame and the pool that its memory goes back to.
#[derive(Debug)]
struct Pooled {
    frame: Frame,
    pool: FramePool,
}

impl Drop for Pooled {
    fn drop(&mut self) {
        // A full pool drops the buffer.
        let _ = self.pool.spares.push(std::mem::take(&mut self.frame));
    }
}

/// Pool of buffers of released frames.
#[derive(Clone, Debug)]
pub(super) struct FramePool {
    spares: Arc<ArrayQueue<Frame>>,
}

impl Default for FramePool {
    fn default() -> Self {
        Self { spares: Arc::new(ArrayQueue::new(SPARES_MAX)) }
    }
}

impl FramePool {
    /// A recycled frame, or an empty one; its pixels are unspecified.
    pub(super) fn spare(&self) -> Frame {
        self.spares.pop().unwrap_or_default()
    }

    pub(super) fn share(&self, frame: Frame) -> SharedFrame {
        SharedFrame(Arc::new(Pooled { frame, pool: self.clone() }))
    }
}

/// Bytes of the planes of a frame.
fn bytes_of(frame: &Frame) -> u64 {
    let bytes: usize = frame.planes.list().iter().map(|plane| size_of_val(plane.samples)).sum();
    #[cfg(feature = "gpu")]
    let on_gpu = frame.texture.as_ref().map_or(0, FrameTexture::bytes);
    #[cfg(not(feature = "gpu"))]
    let on_gpu = 0;
    bytes as u64 + on_gpu
}

/// Whether a frame still exists: its GPU may be lost.
#[cfg(feature = "gpu")]
fn is_there(frame: &Frame) -> bool {
    frame.texture.as_ref().is_none_or(|texture| texture.context().check().is_ok())
}

/// Bytes that caches of frames may have together: each holder of a clone has an equal share.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameBudget {
    bytes: u64,
    holders: Arc<()>,
}

impl FrameBudget {
    /// A budget in bytes.
    pub(super) fn new(bytes: u64) -> Self {
        Self { bytes, ..Self::default() }
    }

    /// What each cache may have now.
    fn share(&self) -> u64 {
        self.bytes / Arc::strong_count(&self.holders).max(1) as u64
    }
}

/// Cache of frames of one view within a budget of bytes, keyed by the whole request.
///
/// A change of the view removes all of them: it may never come back. With the budget used up no new frame is kept. In a loop that does not
/// fit, the frames kept first are hit in every round; evicting the oldest would remove each just before its turn.
#[derive(Debug, Default)]
pub(super) struct FrameCache {
    budget: FrameBudget,
    bytes: u64,
    /// Frames of the same view.
    frames: Vec<(FrameRequest, SharedFrame)>,
    /// The series of the frames.
    series: Weak<Series>,
}

impl FrameCache {
    pub(super) fn new(budget: FrameBudget) -> Self {
        Self { budget, ..Self::default() }
    }

    /// Its budget, of which a cache with a clone has a share.
    pub(super) fn budget(&self) -> FrameBudget {
        self.budget.clone()
    }

    /// The cached frame of a request, if there is one.
    pub(super) fn get(&mut self, series: &Arc<Series>, request: &FrameRequest) -> Option<SharedFrame> {
        if request.holds_flow() {
            return None;
        }
        self.turn_to(series, request);
        if !request.skip.unchanged {
            return None;
        }
        #[cfg(feature = "gpu")]
        if self.frames.iter().any(|(_, frame)| !is_there(frame)) {
            self.frames.clear();
            self.bytes = 0;
        }
        self.frames.iter().find(|(kept, _)| kept.same_moment(request)).map(|(_, frame)| frame.clone())
    }

    /// Caches a frame if it is new, fits, depends on no other frame, and may come again.
    pub(super) fn put(&mut self, series: &Arc<Series>, request: &FrameRequest, frame: &SharedFrame) {
        if request.residual.is_some() || request.holds_flow() {
            return;
        }
        self.turn_to(series, request);
        let bytes = bytes_of(frame);
        if self.bytes.saturating_add(bytes) <= self.budget.share() {
            self.bytes += bytes;
            self.frames.push((request.clone(), frame.clone()));
        }
    }

    /// Removes the frames of another view, and all if the share was larger when they were kept.
    fn turn_to(&mut self, series: &Arc<Series>, request: &FrameRequest) {
        let is_other_view = self.frames.first().is_some_and(|(kept, _)| !kept.same_view(request));
        let are_too_many = self.bytes > self.budget.share();
        if is_other_view || are_too_many || self.series.as_ptr() != Arc::as_ptr(series) {
            self.frames.clear();
            (self.bytes, self.series) = (0, Arc::downgrade(series));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FlowLayer, Layer, test_series};
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::render::flow::FlowStyle;
    use glam::DVec3;

    fn request(step: usize) -> FrameRequest {
        let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
        let node = |scalar| Node { scalar, rgb: [1.0; 3], tau: 1.0 };
        let table = NodeTable::new(vec![node(0.0), node(1.0)]).unwrap();
        FrameRequest::new(step, camera, Arc::new(table), (10, 10))
    }

    fn nodes_of(request: &FrameRequest) -> Vec<Node> {
        request.tets().unwrap().table.over_scalars().nodes().to_vec()
    }

    fn with_nodes(request: &FrameRequest, nodes: Vec<Node>) -> FrameRequest {
        request.clone().with_tets(|tets| tets.table = Arc::new(NodeTable::new(nodes).unwrap()).into())
    }

    #[test]
    fn memory_of_a_frame_comes_back_with_its_last_holder() {
        let pool = FramePool::default();
        let mut frame = Frame::default();
        frame.planes.color.pixels = vec![[1.0; 4]; 100];
        let place = frame.planes.color.pixels.as_ptr();
        let first = pool.share(frame);
        let second = first.clone();
        drop(first);
        assert!(pool.spare().planes.color.pixels.is_empty());
        assert_eq!(second.planes.color.pixels.len(), 100);
        drop(second);
        assert_eq!(pool.spare().planes.color.pixels.as_ptr(), place);
        for _ in 0..2 * SPARES_MAX {
            drop(pool.share(Frame::default()));
        }
        assert_eq!(pool.spares.len(), SPARES_MAX);
    }

    #[test]
    fn a_loop_that_does_not_fit_finds_the_frames_that_were_first_in_every_round() {
        let pool = FramePool::default();
        let (series, _) = test_series::logged(5);
        let frame = || {
            let mut frame = Frame::default();
            (frame.planes.color.pixels, frame.planes.depth.pixels) = (vec![[0.0; 4]; 100], vec![0.0; 100]);
            frame
        };
        let mut cache = FrameCache::new(FrameBudget::new(3 * 100 * 20));
        for round in 0..3 {
            let mut found = Vec::new();
            for step in 0..5 {
                match cache.get(&series, &request(step)) {
                    Some(_) => found.push(step),
                    None => cache.put(&series, &request(step), &pool.share(frame())),
                }
            }
            assert_eq!(found, if round == 0 { vec![] } else { vec![0, 1, 2] });
        }
    }

    #[test]
    fn a_cache_beside_another_has_half_of_its_budget_until_that_one_ends() {
        let (pool, (series, _)) = (FramePool::default(), test_series::logged(5));
        let frame = || {
            let mut frame = Frame::default();
            frame.planes.color.pixels = vec![[0.0; 4]; 100];
            pool.share(frame)
        };
        let kept = |cache: &mut FrameCache| {
            (0..5).for_each(|step| {
                if cache.get(&series, &request(step)).is_none() {
                    cache.put(&series, &request(step), &frame());
                }
            });
            (0..5).filter(|&step| cache.get(&series, &request(step)).is_some()).count()
        };
        let budget = FrameBudget::new(4 * 100 * 16);
        let mut cache = FrameCache::new(budget.clone());
        drop(budget);
        assert_eq!(kept(&mut cache), 4);
        let beside = FrameCache::new(cache.budget.clone());
        assert_eq!(kept(&mut cache), 2, "of those kept before none is left, and two fit");
        drop(beside);
        assert_eq!(kept(&mut cache), 4);
    }

    #[test]
    fn a_moment_whose_flow_goes_on_is_not_kept_and_removes_nothing() {
        let (pool, (series, _)) = (FramePool::default(), test_series::logged(5));
        let flow = FlowLayer::new("velocity".to_owned(), FlowStyle::default());
        let mut moment = request(2);
        moment.layers.push(Layer::Flow(flow));
        let held = moment.clone().holding(0.5, 0.1);
        let mut cache = FrameCache::new(FrameBudget::new(1 << 20));
        cache.put(&series, &moment, &pool.share(Frame::default()));
        cache.put(&series, &held, &pool.share(Frame::default()));
        assert!(cache.get(&series, &held).is_none() && cache.get(&series, &moment).is_some());
    }

    #[test]
    fn frames_of_a_series_that_plays_are_kept_each_with_its_shutter() {
        let (pool, (series, _)) = (FramePool::default(), test_series::logged(5));
        let flow = FlowLayer::new("velocity".to_owned(), FlowStyle::default());
        let at = |step: usize, shutter: f64| {
            let mut request = request(step);
            request.layers.push(Layer::Flow(flow.clone()));
            request.with_shutter(shutter)
        };
        let mut cache = FrameCache::new(FrameBudget::new(1 << 20));
        // The times of the series are not uniform.
        let played = [at(0, 0.1), at(1, 0.3), at(2, 0.2)];
        played.iter().for_each(|request| cache.put(&series, request, &pool.share(Frame::default())));
        assert!(played.iter().all(|request| cache.get(&series, request).is_some()));
        assert!(cache.get(&series, &at(1, 0.0)).is_none(), "the same step at rest");
        assert!(cache.get(&series, &at(0, 0.3)).is_none());
    }

    #[test]
    fn another_view_or_another_series_finds_nothing_and_leaves_nothing() {
        let pool = FramePool::default();
        let (series, other_series) = (test_series::jet(), test_series::jet());
        let others: [fn(&mut FrameRequest); 5] = [
            |r| r.camera.position.x += 1e-9,
            |r| r.size_px.0 += 1,
            |r| r.samples = crate::pipeline::SampleSet::Lattice { stride_px: std::num::NonZeroUsize::MIN },
            |r| *r = r.clone().with_draw(crate::pipeline::TetDraw::Reference),
            |r| {
                let mut nodes = nodes_of(r);
                nodes[1].tau = 2.0;
                *r = with_nodes(r, nodes);
            },
        ];
        for change in others {
            let mut cache = FrameCache::new(FrameBudget::new(u64::MAX));
            assert!(cache.get(&series, &request(0)).is_none());
            cache.put(&series, &request(0), &pool.share(Frame::default()));
            let same = with_nodes(&request(0), nodes_of(&request(0)));
            assert!(cache.get(&series, &same).is_some(), "an equal table elsewhere is the same");
            let mut other = request(0);
            change(&mut other);
            assert!(cache.get(&series, &other).is_none());
            assert!(cache.get(&series, &request(0)).is_none() && cache.bytes == 0);
            cache.put(&series, &request(0), &pool.share(Frame::default()));
            assert!(cache.get(&other_series, &request(0)).is_none());
        }
    }
}
