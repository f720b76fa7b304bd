//! What is on the screen: a frame that was converted and sent there, or one that is on the window's GPU already.

use super::blit::{Backdrop, Blit, BoundPicture};
use super::viewport;
use crate::pipeline::{FrameTime, SharedFrame, WindowGpu};
use crate::render::gpu::context::Context;
use crate::ui::Session;
use crate::ui::picture::{Picture, PictureMaker};
use eframe::egui;
use eframe::egui_wgpu::{RenderState, wgpu};
use egui::{Shape, Vec2, vec2};
use std::io;
use std::sync::Arc;

/// The GPU of the window, where frames can be shown from.
struct WindowScreen {
    render_state: RenderState,
    context: Arc<Context>,
    blit: Arc<Blit>,
    /// Where pictures of frames of the CPU go.
    cpu: Option<wgpu::Texture>,
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
struct Shown {
    painted: Painted,
    picture: BoundPicture,
    /// One that is on the GPU is held until another is bound: its memory must not be rendered to while it is painted.
    frame: Option<SharedFrame>,
}

/// The screen.
pub(super) struct Screen {
    pictures: PictureMaker<Source, Picture>,
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
    /// In pixels of its own.
    pub(super) size: Vec2,
    /// What it shows.
    pub(super) time: FrameTime,
}

impl Screen {
    /// An empty screen; `made` is called when there is something to take over.
    pub(super) fn start(made: impl Fn() + Send + 'static) -> io::Result<Self> {
        let pictures = PictureMaker::start(|picture| picture, made)?;
        Ok(Self { pictures, gpu: None, shown: None, retired: None, newest: 0, taken: 0, background: [0.0; 3] })
    }

    /// The window has this GPU: frames that are rendered on it are shown from where they are.
    pub(super) fn attach(&mut self, render_state: &RenderState, gpu: &WindowGpu) {
        let RenderState { adapter, device, queue, .. } = render_state;
        let context = Arc::new(Context::of_window(adapter, device.clone(), queue.clone()));
        gpu.set(context.clone());
        self.detach();
        let blit = Arc::new(Blit::new(render_state));
        self.gpu = Some(WindowScreen { render_state: render_state.clone(), context, blit, cpu: None });
    }

    /// The window is gone, and what was on its GPU.
    pub(super) fn detach(&mut self) {
        (self.gpu, self.shown) = (None, None);
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
        self.shown.as_ref().map(|shown| shown.painted)
    }

    /// What is painted behind the widgets.
    pub(super) fn behind(&self, backdrop: &Backdrop) -> Shape {
        let Backdrop { window, viewport, background, panels } = *backdrop;
        match &self.shown {
            Some(shown) if viewport.is_positive() => {
                let place = viewport::placed(viewport, shown.painted.size);
                Shape::Callback(shown.picture.clone().paint(backdrop, place))
            }
            _ => {
                let fills = [(window, panels), (viewport, background)];
                Shape::Vec(fills.map(|(rect, color)| Shape::rect_filled(rect, 0.0, color)).into())
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
            self.taken = source.number;
            self.shown = self.gpu.as_mut().map(|gpu| gpu.upload(&image, source.time));
        }
        let mut is_elsewhere = false;
        let background = session.background();
        if is_new || (background != self.background && self.shown.as_ref().is_some_and(|s| s.frame.is_none())) {
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
        let Some(gpu) = self.gpu.as_ref().filter(|gpu| Arc::ptr_eq(&gpu.context, texture.context())) else {
            return false;
        };
        self.shown = Some(gpu.bound(texture.texture(), time, Some(frame.clone())));
        true
    }
}

impl WindowScreen {
    fn bound(&self, texture: &wgpu::Texture, time: FrameTime, frame: Option<SharedFrame>) -> Shown {
        let size = texture.size();
        let painted = Painted { size: vec2(size.width as f32, size.height as f32), time };
        Shown { painted, picture: self.blit.bind(&self.render_state.device, texture), frame }
    }

    /// Sends a picture to the GPU, in the memory of the last one if it is as large.
    fn upload(&mut self, picture: &Picture, time: FrameTime) -> Shown {
        let [width, height] = picture.size.map(|n| n as u32);
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let RenderState { device, queue, .. } = &self.render_state;
        let texture = self.cpu.take().filter(|texture| texture.size() == size).unwrap_or_else(|| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size,
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * width), rows_per_image: None };
        queue.write_texture(texture.as_image_copy(), picture.pixels.as_flattened(), layout, size);
        let shown = self.bound(&texture, time, None);
        self.cpu = Some(texture);
        shown
    }
}
