//! A session without a window, for tests: a small series, and a clock that the test moves.

use super::worker::tests::wait_for;
use super::{Action, Session, SessionOptions, Shown};
use crate::camera::Camera;
use crate::ingest::{IngestOptions, ingest};
use crate::look::Look;
use crate::pipeline::test_series::{Log, logged};
use crate::pipeline::{Backend, Pipeline, Pipelined, PipelinedOptions, Series};
use crate::playback::quality::Quality;
use crate::playback::{Clock, Player};
use crate::project::Project;
use crate::store::Store;
use crate::synth::{SeriesName, SynthSpec, generate};
use crate::task::{Cancel, Silent};
use crate::transfer::{Lengths, RangePolicy, TransferFunction};
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Longer than anything takes.
pub(super) const LONG: Duration = Duration::from_secs(60);

/// A store of four steps.
pub(crate) fn store() -> &'static Arc<Store> {
    static STORE: OnceLock<(tempfile::TempDir, Arc<Store>)> = OnceLock::new();
    let (_, store) = STORE.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let series = generate(&SynthSpec { cells: 600, steps: 4, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
        let path = dir.path().join("tornado.zarr");
        ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
        (dir, Arc::new(Store::open(path).unwrap()))
    });
    store
}

/// A session and its clock.
pub(crate) struct Desk {
    pub(crate) session: Session,
    pub(crate) now: Duration,
}

impl Desk {
    pub(super) fn of(series: Arc<Series>, folder: &Path) -> Self {
        Self::with(series, folder, None)
    }

    pub(super) fn with(series: Arc<Series>, folder: &Path, project: Option<Arc<Project>>) -> Self {
        let camera = Camera::default_for(series.mesh().positions.world_bounds()).unwrap();
        let look = Look {
            surfaces: Default::default(),
            camera,
            tf: TransferFunction::parse("viridis").unwrap(),
            range: RangePolicy::Series,
            opacity_kind: Default::default(),
            lengths: Lengths::of_unit_distance(0.01),
            mode: Default::default(),
            representation: Default::default(),
            faces: Default::default(),
            points: Default::default(),
            sheets: Default::default(),
            functions: Default::default(),
            flow: None,
            backend: Backend::Cpu,
            optics: Default::default(),
            skip: Default::default(),
            followed: Default::default(),
        };
        Self::with_look(series, folder, look, project)
    }

    pub(crate) fn with_look(series: Arc<Series>, folder: &Path, look: Look, project: Option<Arc<Project>>) -> Self {
        let options = PipelinedOptions { threads: Some(1), frame_cache_bytes: 0, ..Default::default() };
        let clock = Clock::new(series.times().clone());
        let pipelined = Pipelined::start(Pipeline::new(series), &options, || ()).unwrap();
        let options = SessionOptions {
            store: store().clone(),
            source: store().path().to_owned(),
            look,
            project,
            file: None,
            camera_is_chosen: false,
            background: [0.0; 3],
            image_scale: 1.0,
            target_fps: None,
            family: None,
            screenshot_folder: folder.to_owned(),
        };
        let mut session = Session::new(Player::new(clock, pipelined), options, Arc::new(|| ())).unwrap();
        session.set_viewport(40, 20);
        Self { session, now: Duration::ZERO }
    }

    pub(super) fn open() -> Self {
        Self::of(Arc::new(Series::open(store(), None).unwrap()), Path::new("."))
    }

    pub(super) fn fake(steps: usize) -> (Self, Log) {
        let (series, log) = logged(steps);
        (Self::of(series, Path::new(".")), log)
    }

    pub(crate) fn act(&mut self, action: Action) {
        self.session.act(action, self.now);
    }

    /// Ticks until no more frames come without time passing; returns how many new frames were shown.
    pub(crate) fn settle(&mut self) -> usize {
        let (mut shown, begun) = (0, Instant::now());
        loop {
            assert!(begun.elapsed() < 3 * LONG, "it does not come to rest");
            let (is_new, _) = self.session.tick(self.now);
            shown += usize::from(is_new);
            if !is_new && !self.session.player.wait(LONG) {
                if !self.session.is_waiting() {
                    return shown;
                }
                // A result of the project is pending.
                std::thread::sleep(Duration::from_millis(1));
            }
        }
    }

    pub(super) fn later(&mut self, ms: u64) {
        self.now += Duration::from_millis(ms);
    }

    /// Ticks until a field that opens is there.
    pub(super) fn wait_for_field(&mut self) {
        wait_for("field", || {
            self.session.tick(self.now);
            (!self.session.opens_field()).then_some(())
        });
    }

    pub(super) fn step(&self) -> usize {
        self.session.state().frame.unwrap().step()
    }

    pub(super) fn shown(&self) -> &Shown {
        self.session.shown().unwrap()
    }
}

/// Simulates a machine on which a frame in full takes `ms`.
pub(super) fn slow(desk: &mut Desk, ms: f64) {
    desk.session.quality.forget_all();
    // The first view replaces the initial one.
    desk.session.quality.set_view(40 * 20, desk.session.camera().half_height_at_focus().unwrap());
    (0..3).for_each(|_| desk.session.quality.measured(Quality::Exact, ms));
}
