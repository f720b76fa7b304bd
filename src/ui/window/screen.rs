//! What is on the screen: a frame that was converted and sent there, or one that is on the window's GPU already.

use crate::pipeline::{FrameTime, SharedFrame, WindowGpu};
use crate::render::gpu::context::Context;
use crate::ui::Session;
use crate::ui::picture::{Picture, PictureMaker};
use eframe::egui;
use eframe::egui_wgpu::{RenderState, wgpu};
use egui::{Color32, ColorImage, TextureHandle, TextureId, TextureOptions, Vec2, vec2};
use std::io;
use std::sync::Arc;

/// The GPU of the window, where frames can be shown from.
struct WindowScreen {
    render_state: RenderState,
    context: Arc<Context>,
    id: Option<TextureId>,
}

/// Which frame a picture is of.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    /// Frames are counted as they come.
    number: u64,
    /// [`Session::turns`] when it came.
    turns: u64,
    time: FrameTime,
}

/// The picture that is on the screen.
enum Shown {
    OfCpu(FrameTime),
    /// Held until another is bound: its memory must not be rendered to while it is painted.
    OfGpu(FrameTime, SharedFrame),
}

/// The screen.
pub(super) struct Screen {
    pictures: PictureMaker<Source, ColorImage>,
    cpu: Option<TextureHandle>,
    gpu: Option<WindowScreen>,
    shown: Option<Shown>,
    /// What this pass was still laid out with.
    retired: Option<Shown>,
    newest: u64,
    /// The number of the picture that was taken over last.
    taken: u64,
    /// What the newest picture was made over.
    background: [f32; 3],
}

/// A picture to be painted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Painted {
    pub(super) texture: TextureId,
    pub(super) size: Vec2,
    /// What it shows.
    pub(super) time: FrameTime,
}

impl Screen {
    /// An empty screen; `made` is called when there is something to take over.
    pub(super) fn start(made: impl Fn() + Send + 'static) -> io::Result<Self> {
        let form = |Picture { size, pixels }: Picture| {
            ColorImage::new(size, pixels.into_iter().map(|[r, g, b, _]| Color32::from_rgb(r, g, b)).collect())
        };
        let pictures = PictureMaker::start(form, made)?;
        Ok(Self {
            pictures,
            cpu: None,
            gpu: None,
            shown: None,
            retired: None,
            newest: 0,
            taken: 0,
            background: [0.0; 3],
        })
    }

    /// The window has this GPU: frames that are rendered on it are shown from where they are.
    pub(super) fn attach(&mut self, render_state: &RenderState, gpu: &WindowGpu) {
        let RenderState { adapter, device, queue, .. } = render_state;
        let context = Arc::new(Context::of_window(adapter, device.clone(), queue.clone()));
        gpu.set(context.clone());
        self.detach();
        self.gpu = Some(WindowScreen { render_state: render_state.clone(), context, id: None });
    }

    /// The window is gone, and what was on its GPU.
    pub(super) fn detach(&mut self) {
        (self.cpu, self.gpu, self.shown) = (None, None, None);
    }

    /// Shows nothing until something else comes.
    pub(super) fn forget(&mut self) {
        self.shown = None;
        self.newest += 1;
        self.taken = self.newest;
    }

    /// The window's GPU.
    pub(super) fn context(&self) -> Option<&Arc<Context>> {
        self.gpu.as_ref().map(|gpu| &gpu.context)
    }

    /// Whether no picture is on its way.
    pub(super) fn is_up_to_date(&self) -> bool {
        self.taken == self.newest
    }

    /// What is to be painted.
    pub(super) fn painted(&self) -> Option<Painted> {
        match self.shown.as_ref()? {
            Shown::OfCpu(time) => {
                let texture = self.cpu.as_ref()?;
                Some(Painted { texture: texture.id(), size: texture.size_vec2(), time: *time })
            }
            Shown::OfGpu(time, frame) => {
                let size = frame.texture.as_ref()?.texture().size();
                let size = vec2(size.width as f32, size.height as f32);
                Some(Painted { texture: self.gpu.as_ref()?.id?, size, time: *time })
            }
        }
    }

    /// Takes over what a session shows, after it has followed the user and before this pass is painted: no frame from before
    /// a command that goes elsewhere gets here after it. `is_new`: the session shows another frame than before. Returns whether
    /// the frame is to be asked for again: it is on a GPU that is not, or no longer, the window's.
    pub(super) fn update(&mut self, ctx: &egui::Context, session: &Session, is_new: bool) -> bool {
        // It was painted for the last time in the last pass.
        self.retired = None;
        let before = self.painted();
        let Some(shown) = session.shown() else {
            self.retired = self.shown.take();
            return false;
        };
        // A picture that was made meanwhile, before another is asked for: where every pass brings a frame, the picture of the
        // last one is shown while that of the next is made.
        if let Some((source, image)) = self.pictures.take()
            && source.number > self.taken
            && (source.turns == session.turns() || session.state().frame == Some(source.time))
        {
            self.upload(ctx, image);
            self.taken = source.number;
            self.shown = Some(Shown::OfCpu(source.time));
        }
        let mut is_elsewhere = false;
        let background = session.background();
        if is_new || (background != self.background && matches!(self.shown, Some(Shown::OfCpu(_)))) {
            self.newest += 1;
            let source = Source { number: self.newest, turns: session.turns(), time: shown.request.time };
            if self.bind(&shown.frame, source.time) {
                self.taken = self.newest;
            } else if shown.frame.texture.is_some() {
                is_elsewhere = true;
            } else {
                self.pictures.make(source, shown.frame.clone(), background);
            }
        }
        self.background = background;
        if before != self.painted() {
            // What is written over it was laid out for another picture.
            ctx.request_discard("another picture");
        }
        is_elsewhere
    }

    /// Shows a frame from where it is, if that is the window's GPU.
    fn bind(&mut self, frame: &SharedFrame, time: FrameTime) -> bool {
        let Some(texture) = &frame.texture else { return false };
        let Some(gpu) = self.gpu.as_mut().filter(|gpu| Arc::ptr_eq(&gpu.context, texture.context())) else {
            return false;
        };
        let view = texture.texture().create_view(&wgpu::TextureViewDescriptor::default());
        let mut renderer = gpu.render_state.renderer.write();
        let (device, filter) = (&gpu.render_state.device, wgpu::FilterMode::Linear);
        match gpu.id {
            Some(id) => renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, id),
            None => gpu.id = Some(renderer.register_native_texture(device, &view, filter)),
        }
        drop(renderer);
        self.shown = Some(Shown::OfGpu(time, frame.clone()));
        true
    }

    fn upload(&mut self, ctx: &egui::Context, image: ColorImage) {
        match &mut self.cpu {
            Some(texture) => texture.set(image, TextureOptions::LINEAR),
            None => self.cpu = Some(ctx.load_texture("frame", image, TextureOptions::LINEAR)),
        }
    }
}
