//! A GPU: adapter, device and queue, and their faults.

use crate::camera::Samples;
use crate::render::surfaces::SurfaceScene;
use crate::render::{RenderError, RenderJob};
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Limits that are requested of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tier {
    /// The adapter's buffer and texture sizes, and f64 if it has it.
    #[default]
    Adapter,
    /// The default limits of WebGPU, whatever the adapter has, and no f64.
    WebGpu,
}

/// Which adapter is opened, and with which limits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContextOptions {
    /// Part of the adapter's name, any case; the best adapter if empty.
    pub adapter: String,
    /// Ignores software adapters, which run on the CPU.
    pub hardware_only: bool,
    /// Limits that are requested of the device.
    pub tier: Tier,
    /// Caps the bytes of a storage binding, to test how buffers are split.
    pub binding_bytes: Option<u64>,
    /// Requests no timestamps, even if the adapter has them.
    pub no_timestamps: bool,
    /// Whether rays draw splats of flow from lists of tiles, or get their fragments from the CPU; `None`: on hardware. Software takes longer
    /// for the former.
    pub draws_flow: Option<bool>,
}

/// Name, driver and kind of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterName {
    /// Name given by the driver.
    pub name: String,
    /// API and driver.
    pub driver: String,
    /// Whether it is a GPU and not software on the CPU.
    pub is_hardware: bool,
}

impl fmt::Display for AdapterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.is_hardware { "" } else { ", software" };
        write!(f, "{} ({}{kind})", self.name, self.driver)
    }
}

/// A failure that the device reported asynchronously.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Fault {
    Lost(String),
    Failed(String),
}

/// An adapter with its device and queue; shared by all that use the GPU.
#[derive(Debug)]
pub struct Context {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    name: AdapterName,
    is_of_window: bool,
    binding_bytes: u64,
    /// Nanoseconds per tick of a timestamp; `None` without timestamps.
    timestamp_period_ns: Option<f64>,
    has_f64: bool,
    draws_flow: bool,
    fault: Arc<Mutex<Option<Fault>>>,
    created: AtomicU64,
}

/// The backends that tetreel is built with.
pub const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// A wgpu instance with [`BACKENDS`]. Builds with debug assertions enable the driver's validation layer and names of shaders and objects
/// for debuggers; `WGPU_VALIDATION` and `WGPU_DEBUG` (0 or 1) override that, as they do for a window.
pub fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    descriptor.flags = descriptor.flags.with_env();
    wgpu::Instance::new(descriptor)
}

impl Context {
    /// Opens the GPU that `options` ask for: hardware before software, discrete before integrated.
    ///
    /// # Errors
    /// `NoGpu` if there is no adapter, none of that name, or it gives no device.
    pub fn new(options: &ContextOptions) -> Result<Self, RenderError> {
        let adapters = pollster::block_on(instance().enumerate_adapters(BACKENDS));
        let adapter = best(&adapters, options)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor(adapter, options)))
            .map_err(|e| RenderError::NoGpu(format!("{} gives no device: {e}", name_of(&adapter.get_info()))))?;
        Ok(Self::of_device(adapter, device, queue, options))
    }

    /// The GPU of a window: a device that was requested with [`descriptor`]. Frames for the window stay on it.
    pub fn of_window(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { is_of_window: true, ..Self::of_device(adapter, device, queue, &ContextOptions::default()) }
    }

    fn of_device(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue, options: &ContextOptions) -> Self {
        let has_timestamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let fault = Arc::new(Mutex::new(None));
        let keep = |fault: &Arc<Mutex<Option<Fault>>>| {
            let fault = fault.clone();
            // The first fault is the cause, the others follow from it; a loss outranks them.
            move |new: Fault| {
                let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
                if fault.is_none() || matches!((&*fault, &new), (Some(Fault::Failed(_)), Fault::Lost(_))) {
                    *fault = Some(new);
                }
            }
        };
        let lost = keep(&fault);
        device.set_device_lost_callback(move |reason, message| {
            let text = if message.is_empty() { format!("{reason:?}") } else { message };
            lost(Fault::Lost(text));
        });
        let failed = keep(&fault);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| failed(Fault::Failed(error.to_string()))));
        let limits = device.limits();
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let name = name_of(&adapter.get_info());
        Self {
            draws_flow: options.draws_flow.unwrap_or(name.is_hardware),
            name,
            is_of_window: false,
            binding_bytes: options.binding_bytes.map_or(binding, |bytes| bytes.min(binding)),
            timestamp_period_ns: has_timestamps.then(|| f64::from(queue.get_timestamp_period())),
            has_f64: device.features().contains(wgpu::Features::SHADER_F64),
            fault,
            created: AtomicU64::new(0),
            device,
            queue,
        }
    }

    /// Whether its device is a window's.
    pub fn is_of_window(&self) -> bool {
        self.is_of_window
    }

    /// The adapter.
    pub fn adapter(&self) -> &AdapterName {
        &self.name
    }

    /// Largest storage binding in bytes.
    pub fn binding_bytes(&self) -> u64 {
        self.binding_bytes
    }

    /// Nanoseconds per tick of a timestamp; `None` without timestamps.
    pub fn timestamp_period_ns(&self) -> Option<f64> {
        self.timestamp_period_ns
    }

    /// Whether its shaders may compute in f64.
    pub fn has_f64(&self) -> bool {
        self.has_f64
    }

    /// Whether rays draw splats of flow from lists of tiles.
    pub fn draws_flow(&self) -> bool {
        self.draws_flow
    }

    /// Buffers, textures and bind groups made so far: a steady frame makes none.
    pub fn resources_created(&self) -> u64 {
        self.created.load(Ordering::Relaxed)
    }

    /// Adds `n` to [`Self::resources_created`].
    pub(super) fn count_created(&self, n: u64) {
        self.created.fetch_add(n, Ordering::Relaxed);
    }

    /// Checks that the device and queue still work.
    ///
    /// # Errors
    /// `DeviceLost` once it is lost, `Gpu` after any other failure.
    pub fn check(&self) -> Result<(), RenderError> {
        let adapter = || self.name.name.clone();
        let fault = || self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let mut found = fault();
        if matches!(found, Some(Fault::Failed(_))) {
            // Failures that follow from a loss may be reported before it: losses wait for the next poll.
            let _ = self.device.poll(wgpu::PollType::Poll);
            found = fault();
        }
        match &found {
            None => Ok(()),
            Some(Fault::Lost(reason)) => Err(RenderError::DeviceLost { adapter: adapter(), reason: reason.clone() }),
            Some(Fault::Failed(problem)) => Err(RenderError::Gpu { adapter: adapter(), problem: problem.clone() }),
        }
    }

    /// As [`Self::check`]; also `BeyondGpu` if a job has features without shaders.
    pub(super) fn check_job(&self, job: &RenderJob) -> Result<(), RenderError> {
        self.check()?;
        let of_cells = job.scalars.of_cells().is_some();
        let surfaces_are = |so: fn(&SurfaceScene) -> bool| job.surfaces.as_ref().is_some_and(so);
        let lacking = [
            (
                job.has_other_layers() && !job.contrasts().is_empty(),
                "rays chosen by contrast, together with fragments of other layers",
            ),
            (surfaces_are(|scene| !scene.planes().is_empty()), "cuts"),
            (surfaces_are(SurfaceScene::lights_volume), "light on the volume"),
            (surfaces_are(SurfaceScene::has_beside), "colours of another field"),
            (matches!(job.view.samples, Samples::Pixels(_)), "a list of pixels"),
            (of_cells && job.surfaces.is_some(), "surfaces among scalars of cells"),
        ];
        let feature = lacking.into_iter().find_map(|(is_asked_for, feature)| is_asked_for.then_some(feature));
        feature.map_or(Ok(()), |feature| Err(self.beyond(feature.to_owned())))
    }

    /// Makes resources; running out of memory becomes an error instead of a fault.
    ///
    /// # Errors
    /// `BeyondGpu` if the device runs out of memory or refuses.
    pub(super) fn create<T>(&self, make: impl FnOnce(&wgpu::Device) -> T) -> Result<T, RenderError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make(&self.device);
        let refused = pollster::block_on(validation.pop());
        let exhausted = pollster::block_on(memory.pop());
        self.check()?;
        match exhausted.or(refused) {
            None => Ok(made),
            Some(error) => Err(self.beyond(format!("it has no room: {error}"))),
        }
    }

    /// The error of a job that the device cannot do.
    pub(super) fn beyond(&self, problem: String) -> RenderError {
        RenderError::BeyondGpu { adapter: self.name.name.clone(), problem }
    }

    /// Loses the device, as a driver reset would: everything under way fails from here on.
    pub fn lose(&self) {
        // A reset is reported at once; a destroyed device only when its queue is empty, after the failures that follow from it.
        let lost = Fault::Lost("it was given up".to_owned());
        *self.fault.lock().unwrap_or_else(PoisonError::into_inner) = Some(lost);
        self.device.destroy();
    }
}

/// The adapter that `options` ask for: hardware before software, discrete before integrated, else the driver's order.
///
/// # Errors
/// `NoGpu` if there is none, or none of that name.
pub fn best<'a>(adapters: &'a [wgpu::Adapter], options: &ContextOptions) -> Result<&'a wgpu::Adapter, RenderError> {
    let wanted = options.adapter.to_lowercase();
    let fits = |info: wgpu::AdapterInfo| {
        info.name.to_lowercase().contains(&wanted) && (name_of(&info).is_hardware || !options.hardware_only)
    };
    let fitting = adapters.iter().filter(|a| fits(a.get_info()));
    // Of equals `min_by_key` takes the first.
    let best = fitting.min_by_key(|a| preference(a.get_info().device_type));
    best.ok_or_else(|| RenderError::NoGpu(nothing_found(options, adapters)))
}

/// The device requested of an adapter: its sizes, and timestamps and f64 if it has them.
pub fn descriptor(adapter: &wgpu::Adapter, options: &ContextOptions) -> wgpu::DeviceDescriptor<'static> {
    let mut wanted = wgpu::Features::empty();
    wanted.set(wgpu::Features::TIMESTAMP_QUERY, !options.no_timestamps);
    wanted.set(wgpu::Features::SHADER_F64, options.tier == Tier::Adapter);
    wgpu::DeviceDescriptor {
        label: Some("tetreel"),
        required_features: wanted & adapter.features(),
        required_limits: limits(&adapter.limits(), options.tier),
        ..Default::default()
    }
}

/// Rank of an adapter's type; the least is preferred.
fn preference(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn name_of(info: &wgpu::AdapterInfo) -> AdapterName {
    let driver = format!("{} {} {}", info.backend, info.driver, info.driver_info);
    AdapterName {
        name: info.name.clone(),
        driver: driver.split_whitespace().collect::<Vec<_>>().join(" "),
        is_hardware: info.device_type != wgpu::DeviceType::Cpu,
    }
}

/// WebGPU's default limits, raised to the adapter's sizes in tier `Adapter`.
fn limits(adapter: &wgpu::Limits, tier: Tier) -> wgpu::Limits {
    let defaults = wgpu::Limits::default();
    if tier == Tier::WebGpu {
        return defaults;
    }
    wgpu::Limits {
        max_buffer_size: defaults.max_buffer_size.max(adapter.max_buffer_size),
        max_storage_buffer_binding_size: defaults
            .max_storage_buffer_binding_size
            .max(adapter.max_storage_buffer_binding_size),
        max_texture_dimension_2d: defaults.max_texture_dimension_2d.max(adapter.max_texture_dimension_2d),
        ..defaults
    }
}

fn nothing_found(options: &ContextOptions, adapters: &[wgpu::Adapter]) -> String {
    let names: Vec<_> = adapters.iter().map(|a| name_of(&a.get_info()).to_string()).collect();
    let wanted = &options.adapter;
    match (names.is_empty(), wanted.is_empty()) {
        (true, _) => "no Vulkan, Metal or Direct3D 12 driver offers an adapter".to_owned(),
        (false, true) => format!("software only: {}", names.join(", ")),
        (false, false) => format!("no adapter's name contains '{wanted}'; there are: {}", names.join(", ")),
    }
}
