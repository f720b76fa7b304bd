//! A window without a screen, and a user who finds things by their names.

use egui::{Key, Modifiers, Pos2, Rect};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use egui_kittest::wgpu::{WgpuTestRenderer, create_render_state};
use egui_wgpu::RenderState;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};
use tetreel::ingest::{ImportCache, IngestOptions, ingest};
use tetreel::look::Look;
use tetreel::pipeline::{Backend, PipelinedOptions, Series};
use tetreel::project::Project;
use tetreel::render::gpu::context;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, TransferFunction};
use tetreel::ui::Session;
use tetreel::ui::opening::OpeningOptions;
use tetreel::ui::settings::SettingsFile;
use tetreel::ui::window::{Dressed, PlayerWindow, ReadProject, Start, WindowOptions};

/// Steps of its series.
pub const STEPS: usize = 6;
/// Behind the volume.
pub const BACKGROUND: [f32; 3] = [0.125, 0.25, 0.5];

/// A window on a small series, in a folder of its own.
pub struct Desk {
    /// The window, and the hands of the user.
    pub harness: Harness<'static, App>,
    /// Where its files are, and images go.
    pub folder: tempfile::TempDir,
    /// Given back after the window, which lies before it.
    _turn: MutexGuard<'static, ()>,
}

/// Only one window of a process is open at a time, as in the program: drivers and layers of Vulkan are made and given back by one thread
/// after the other.
static TURN: Mutex<()> = Mutex::new(());

/// Why there is no GPU, if there is none. Looked for once.
fn gpu_problem() -> Option<&'static str> {
    static PROBLEM: OnceLock<Option<String>> = OnceLock::new();
    let problem = || context::Context::new(&Default::default()).err().map(|error| error.to_string());
    PROBLEM.get_or_init(problem).as_deref()
}

/// The window as its frame has it.
pub struct App(pub PlayerWindow);

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        self.0.show(ui);
    }
}

/// A store of a small series in a folder.
pub fn store(folder: &Path) -> PathBuf {
    let path = folder.join("tornado.zarr");
    let series = generate(&SynthSpec { cells: 2000, steps: STEPS, ..SynthSpec::new(SeriesName::Tornado) }).unwrap();
    ingest(&series, &path, &IngestOptions::default(), &Silent, &Cancel::new()).unwrap();
    path
}

/// Options of a window that writes nowhere but to this folder.
pub fn options(folder: &Path, start: Start) -> WindowOptions {
    WindowOptions {
        start,
        dress: Arc::new(dress),
        projects: Arc::new(read_project),
        restores: false,
        beside: None,
        follows: false,
        plays: false,
        opening: OpeningOptions { cache: ImportCache::at(folder.join("cache")), ..Default::default() },
        threads: PipelinedOptions { threads: Some(1), frame_cache_bytes: 0, ..Default::default() },
        background: Some(BACKGROUND),
        size: Some([1280.0, 800.0]),
        screenshot_folder: folder.to_owned(),
        gpu: Default::default(),
        settings: SettingsFile::at(folder.join("settings")),
        // The dialogs of the system would wait for a user.
        dialogs: Arc::new(|_, _| Box::new(|| None)),
    }
}

fn dress(series: &Series) -> Result<Dressed, String> {
    let look = Look::default_for(series, TransferFunction::parse("viridis@0:0.1,1:0.6").unwrap()).unwrap();
    let lengths = Lengths { unit_distance: 5.0 * look.lengths.unit_distance, ..look.lengths };
    Ok(Look { lengths, backend: Backend::Cpu, ..look }.into())
}

/// Reads the project and its field; what else it says of the look is the command line's.
fn read_project(path: &Path) -> Result<ReadProject, String> {
    let project = Arc::new(Project::read(path).map_err(|error| error.to_string())?);
    let (source, field) = (path.parent().unwrap().join(&project.data.source), project.data.field.clone());
    let file = path.to_owned();
    let dressed = move |series: &Series| {
        let (project, file) = (Some(project.clone()), Some(file.clone()));
        Ok(Dressed { project, file, ..dress(series)? })
    };
    Ok(ReadProject { source, field, dress: Arc::new(dressed) })
}

/// The GPU of the window, as a real one has it.
pub fn gpu() -> RenderState {
    let mut setup = egui_wgpu::WgpuSetupCreateNew::without_display_handle();
    setup.instance_descriptor.backends = context::BACKENDS;
    setup.native_adapter_selector = Some(Arc::new(|adapters, _| {
        context::best(adapters, &Default::default()).cloned().map_err(|error| error.to_string())
    }));
    setup.device_descriptor = Arc::new(|adapter| context::descriptor(adapter, &Default::default()));
    create_render_state(setup.into(), egui_wgpu::RendererOptions::PREDICTABLE)
}

impl Desk {
    /// Opens the series and waits for its first picture; `None` where there is no GPU, be it in software, which is said aloud,
    /// and fails where `TETREEL_REQUIRE` names `gpu`.
    pub fn open() -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let start = Start::Open(vec![store(folder.path())]);
        let mut desk = Self::with([1280.0, 800.0], 1.0, options(folder.path(), start), folder)?;
        desk.begin();
        Some(desk)
    }

    /// A window of so many points on a screen with so many pixels per point.
    pub fn with(
        size: [f32; 2],
        pixels_per_point: f32,
        options: WindowOptions,
        folder: tempfile::TempDir,
    ) -> Option<Self> {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(why) = gpu_problem() {
            eprintln!("SKIPPED (gpu): {why}");
            assert!(!crate::is_required("gpu"), "this test may not be skipped here");
            return None;
        }
        let window = PlayerWindow::open(options).unwrap();
        let renderer = WgpuTestRenderer::from_render_state(gpu());
        let builder = Harness::builder().with_size(size).with_pixels_per_point(pixels_per_point);
        let builder = builder.with_theme(egui::Theme::Dark).renderer(renderer);
        let shown = |cc: &mut eframe::CreationContext<'_>| {
            let mut window = window;
            window.attach(&cc.egui_ctx, cc.wgpu_render_state.as_ref());
            App(window)
        };
        Some(Self { harness: builder.build_eframe(shown), folder, _turn: turn })
    }

    /// Closes the window and leaves its folder.
    pub fn close(self) -> tempfile::TempDir {
        self.folder
    }

    /// What is played.
    pub fn session(&self) -> &Session {
        self.window().session().expect("a series is played")
    }

    /// The window.
    pub fn window(&self) -> &PlayerWindow {
        &self.harness.state().0
    }

    /// Paints until there is a picture.
    pub fn begin(&mut self) {
        let begin = Instant::now();
        while self.window().session().is_none_or(|session| session.shown().is_none()) {
            self.harness.step();
            assert!(begin.elapsed() < Duration::from_secs(60), "no picture; {:?}", self.window().notices());
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Paints until something holds.
    pub fn until(&mut self, what: &str, holds: impl Fn(&Session) -> bool) {
        let begin = Instant::now();
        loop {
            self.harness.step();
            if holds(self.session()) {
                return;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "in vain: {what}; {:?}", self.session().notices());
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Paints until nothing wants to be painted any more, and no frame is on its way.
    pub fn settle(&mut self) {
        let begin = Instant::now();
        let mut still = 0;
        while still < 5 {
            self.harness.step();
            let delay = self.harness.output().viewport_output[&egui::ViewportId::ROOT].repaint_delay;
            let is_done = self.window().session().is_none() || self.window().is_up_to_date();
            // A message that goes away later is no unrest.
            still = if delay > Duration::from_secs(1) && is_done { still + 1 } else { 0 };
            assert!(begin.elapsed() < Duration::from_secs(60), "it never comes to rest");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Paints until there is something that is called so.
    pub fn until_there(&mut self, label: &str) {
        let begin = Instant::now();
        while self.harness.query_by_label(label).is_none() {
            self.harness.step();
            assert!(begin.elapsed() < Duration::from_secs(60), "in vain: {label}");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Clicks what is called so; what lies beyond an end of the side panel is scrolled to first.
    pub fn click(&mut self, label: &str) {
        let timeline = self.harness.query_by_label("Step slider").map(|slider| slider.rect().top());
        let node = self.harness.get_by_label(label);
        if timeline.is_some_and(|top| node.rect().bottom() > top || node.rect().top() < 0.0) {
            node.scroll_to_me();
            (0..3).for_each(|_| self.harness.step());
        }
        self.harness.get_by_label(label).click();
        self.harness.step();
        self.harness.step();
    }

    /// Presses a key.
    pub fn press(&mut self, key: Key) {
        self.press_with(Modifiers::NONE, key);
    }

    /// Presses a key while others are held.
    pub fn press_with(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.harness.step();
    }

    /// The step that is or should be on the screen.
    pub fn step(&self) -> usize {
        self.session().state().frame.unwrap().step()
    }

    /// Where the thing is that is called so.
    pub fn place_of(&self, label: &str) -> Rect {
        self.harness.get_by_label(label).rect()
    }

    /// Where the thing is whose name begins so.
    pub fn place(&self, label_part: &str) -> Rect {
        self.harness.get_by(|node| node.label().is_some_and(|label| label.starts_with(label_part))).rect()
    }

    /// Drags with the left button.
    pub fn drag(&mut self, from: Pos2, to: Pos2) {
        self.harness.hover_at(from);
        self.harness.step();
        self.harness.drag_at(from);
        self.harness.step();
        for i in 1..=4 {
            self.harness.hover_at(from.lerp(to, i as f32 / 4.0));
            self.harness.step();
        }
        self.harness.drop_at(to);
        self.harness.step();
    }

    /// Clicks twice with the left button. Each event takes a quarter of a second here: the hand is allowed more time.
    pub fn double_click(&mut self, at: Pos2) {
        self.harness.ctx.options_mut(|options| options.input_options.max_double_click_delay = 2.0);
        self.harness.hover_at(at);
        self.harness.step();
        for _ in 0..2 {
            self.harness.drag_at(at);
            self.harness.drop_at(at);
            self.harness.step();
        }
    }

    /// For those who want to look at it.
    pub fn save(&mut self, name: &str) {
        if let Some(folder) = std::env::var_os("TETREEL_UI_PICTURES") {
            self.harness.render().unwrap().save(Path::new(&folder).join(name)).unwrap();
        }
    }
}
