//! Details of earlier frames of a view that only time changes.

use crate::pipeline::{FrameRequest, ResidualBase, ResidualRequest, SharedFrame};
use crate::render::residual::Details;
use std::sync::Arc;

/// Details of a view, from the last frame of all rays and later frames with details.
#[derive(Clone, Debug)]
pub(super) struct Still {
    view: FrameRequest,
    base: ResidualBase,
    /// For each group of bands that are renewed together, the number of the frame that last renewed it.
    renewed: Vec<u64>,
    /// Number of frames with details, and of requests for them, of which some may be dropped.
    frames: u64,
    asked: u64,
}

impl Still {
    /// Details of a frame of all rays, whose pixels are on the CPU.
    pub(super) fn of(request: &FrameRequest, frame: &SharedFrame) -> Self {
        let mut still = Self {
            view: request.clone(),
            base: ResidualBase::exact(frame.clone()),
            renewed: Vec::new(),
            frames: 0,
            asked: 0,
        };
        still.renewed = vec![0; still.bands().div_ceil(still.group())];
        still
    }

    fn bands(&self) -> usize {
        Details::count(self.view.size_px)
    }

    /// Number of bands that are renewed together.
    fn group(&self) -> usize {
        Details::per_frame(self.view.size_px)
    }

    /// Whether a request is for this view, at any time.
    pub(super) fn is_of(&self, request: &FrameRequest) -> bool {
        self.view.same_view(request)
    }

    /// Details for the next frame, and the bands that it renews: a group of the half not renewed for longest.
    pub(super) fn next(&mut self) -> ResidualRequest {
        // Requests may be dropped, every other one, say. Multiples of the golden ratio are evenly distributed, and so are every other one
        // of them.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let mut oldest: Vec<usize> = (0..self.renewed.len()).collect();
        oldest.sort_by_key(|&group| self.renewed[group]);
        oldest.truncate(oldest.len().div_ceil(2));
        self.asked += 1;
        let place = (GOLDEN * self.asked as f64).fract() * oldest.len() as f64;
        let first = oldest.get(place as usize).map_or(0, |oldest| oldest * self.group());
        ResidualRequest { base: self.base.clone(), anew: first..(first + self.group()).min(self.bands()) }
    }

    /// Takes over the bands that a frame of this view has renewed.
    pub(super) fn renew(&mut self, request: &FrameRequest, frame: &SharedFrame) {
        let (Some(residual), Some(details)) = (&request.residual, &frame.details) else { return };
        if !self.is_of(request) {
            return;
        }
        self.frames += 1;
        let group = self.group();
        if let Some(renewed) = self.renewed.get_mut(residual.anew.start / group) {
            *renewed = self.frames;
        }
        match &mut self.base {
            ResidualBase::Details(ours) => Arc::make_mut(ours).take_over(residual.anew.clone(), details),
            // Details of all rays at one time, and of some rays at another.
            base @ ResidualBase::Exact(_) if residual.base == *base => *base = ResidualBase::Details(details.clone()),
            ResidualBase::Exact(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::playback::quality::{Family, Quality};
    use crate::playback::{Command, Loop};
    use crate::ui::Action;
    use crate::ui::desk::{Desk, slow, store};
    use glam::DVec2;
    use std::path::Path;
    use std::sync::Arc;

    /// A session on which a frame in full seems to take 160 ms, of 40 available.
    fn desk() -> Desk {
        let series = crate::pipeline::Series::open(store(), None).unwrap();
        let mut desk = Desk::of(Arc::new(series), Path::new("."));
        desk.session.set_viewport(120, 90);
        desk.settle();
        desk.act(Action::TargetRate(Some(25.0)));
        desk.act(Action::GiveUp(Some(Family::Details)));
        desk.act(Action::Play(Command::Loop(Loop::All)));
        slow(&mut desk, 160.0);
        desk
    }

    #[test]
    fn while_time_alone_moves_frames_have_details_of_earlier_steps_and_a_pause_shows_all() {
        let mut desk = desk();
        let whole = desk.shown().frame.planes.clone();
        let exact = |desk: &Desk| {
            let request = crate::pipeline::FrameRequest { residual: None, ..desk.shown().request.clone() };
            let mut pipeline = crate::pipeline::Pipeline::new(desk.session.series().clone());
            pipeline.render(&request).unwrap().planes.color.clone()
        };
        desk.act(Action::Play(Command::Play));
        let mut anew = Vec::new();
        for _ in 0..40 {
            slow(&mut desk, 160.0);
            desk.later(1000);
            desk.settle();
            let shown = desk.shown().clone();
            assert_eq!(shown.quality, Quality::Details);
            assert!(desk.session.lacks().is_some_and(|lacks| lacks.contains("details")));
            assert!(shown.frame.details.is_some() && shown.frame.stats.pixels_anew > 0);
            anew.push(shown.request.residual.as_ref().unwrap().anew.clone());
            let exact = exact(&desk);
            let off = crate::image::compare_raw(&shown.frame.planes.color, &exact).unwrap();
            let rows = anew.last().unwrap();
            let pixels = 120 * 16 * rows.start..(120 * 16 * rows.end).min(exact.pixels.len());
            assert_eq!(shown.frame.planes.color.pixels[pixels.clone()], exact.pixels[pixels]);
            assert!(off.max < 1.0);
        }
        // Six bands, of which half are eligible.
        let last = &anew[anew.len() - 20..];
        assert!((0..6).all(|band| last.contains(&(band..band + 1))), "{anew:?}");
        desk.act(Action::Play(Command::Pause));
        desk.later(1000);
        desk.settle();
        assert_eq!((desk.shown().quality, desk.session.lacks()), (Quality::Exact, None));
        assert!(desk.shown().request.residual.is_none() && desk.shown().frame.planes.color == exact(&desk));
        assert_eq!(desk.session.tick(desk.now), (false, None), "nothing more is asked for");
        assert!(desk.shown().frame.planes.color.pixels.len() == whole.color.pixels.len());
    }

    #[test]
    fn any_change_but_time_clears_details() {
        let changes: [fn(&mut Desk); 3] = [
            |desk| desk.act(Action::Orbit(DVec2::new(0.1, 0.0))),
            |desk| desk.session.set_viewport(100, 90),
            |desk| desk.act(Action::Optics(crate::optics::OpticsKind::Partial)),
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut desk = desk();
            desk.act(Action::Play(Command::Play));
            desk.later(1000);
            desk.settle();
            assert_eq!(desk.shown().quality, Quality::Details);
            change(&mut desk);
            slow(&mut desk, 160.0);
            desk.later(1000);
            desk.settle();
            assert_ne!(desk.shown().quality, Quality::Details, "change {number}");
            assert!(desk.shown().request.residual.is_none());
        }
    }
}
