//! The picture on the screen: a frame that was converted and uploaded, or one already on the window's GPU.

use super::blit::{Backdrop, Blit, BoundPicture};
use super::painted::Painted;
use super::viewport;
use crate::pipeline::{FrameTime, SharedFrame};
use crate::render::gpu::context::Context;
use crate::ui::Session;
use crate::ui::picture::{Picture, PictureMaker};
use eframe::egui;
use eframe::egui_wgpu::{RenderState, wgpu};
use egui::{PaintCallback, Shape, vec2};
use std::cell::RefCell;
use std::io;
use std::sync::Arc;

/// The GPU of the window.
struct WindowScreen {
    render_state: RenderState,
    context: Arc<Context>,
    blit: Arc<Blit>,
    /// Texture for pictures of CPU frames.
    cpu: Option<wgpu::Texture>,
}

/// The frame of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    /// Number of the frame, in order of arrival.
    number: u64,
    /// [`Session::turns`] at its arrival.
    turns: u64,
    time: FrameTime,
}

/// The picture on the screen.
struct Shown {
    painted: Painted,
    picture: BoundPicture,
    /// The shape that was painted last, and what behind it: as long as it is the same one, nothing has changed.
    shape: RefCell<Option<(Backdrop, PaintCallback)>>,
    /// A frame on the GPU is held until another is bound: its memory must not be rendered to while it is painted.
    frame: Option<SharedFrame>,
}

/// The window's GPU, for renderers.
pub(super) fn context_of(render_state: &RenderState) -> Context {
    let RenderState { adapter, device, queue, .. } = render_state;
    Context::of_window(adapter, device.clone(), queue.clone())
}

/// The screen.
pub(super) struct Screen {
    pictures: PictureMaker<Source>,
    gpu: Option<WindowScreen>,
    shown: Option<Shown>,
    /// The picture that this pass was laid out with.
    retired: Option<Shown>,
    newest: u64,
    /// Number of the last picture taken over.
    taken: u64,
    /// Background of the newest picture.
    background: [f32; 3],
}

impl Screen {
    /// An empty screen; `made` is called when there is a picture to take over.
    pub(super) fn start(made: impl Fn() + Send + 'static) -> io::Result<Self> {
        let pictures = PictureMaker::start(made)?;
        Ok(Self { pictures, gpu: None, shown: None, retired: None, newest: 0, taken: 0, background: [0.0; 3] })
    }

    /// Sets the window's GPU: frames rendered on it are shown without a copy.
    pub(super) fn attach(&mut self, render_state: &RenderState, context: &Arc<Context>) {
        self.detach();
        let blit = Arc::new(Blit::new(render_state));
        self.gpu = Some(WindowScreen { render_state: render_state.clone(), context: context.clone(), blit, cpu: None });
    }

    /// Drops the window's GPU and its pictures.
    pub(super) fn detach(&mut self) {
        (self.gpu, self.shown) = (None, None);
    }

    /// Shows nothing until another frame comes.
    pub(super) fn forget(&mut self) {
        self.shown = None;
        self.newest += 1;
        self.taken = self.newest;
    }

    /// The window's GPU.
    pub(super) fn context(&self) -> Option<&Arc<Context>> {
        self.gpu.as_ref().map(|gpu| &gpu.context)
    }

    /// Whether no picture is pending.
    pub(super) fn is_up_to_date(&self) -> bool {
        self.taken == self.newest
    }

    /// The picture to be painted.
    pub(super) fn painted(&self) -> Option<Painted> {
        self.shown.as_ref().map(|shown| shown.painted)
    }

    /// The shape painted behind the widgets of the viewport.
    pub(super) fn behind(&self, backdrop: &Backdrop) -> Shape {
        let Backdrop { viewport, background } = *backdrop;
        match &self.shown {
            Some(shown) if viewport.is_positive() => Shape::Callback(shown.shape(backdrop)),
            _ => Shape::rect_filled(viewport, 0.0, background),
        }
    }

    /// Takes over the session's frame, after user actions are applied and before this pass is painted: no frame from before a jump in time
    /// gets here after it. `is_new`: the session shows another frame than before. Returns whether the frame must be requested again: it is
    /// on a GPU that is not, or no longer, the window's.
    pub(super) fn update(&mut self, ctx: &egui::Context, session: &Session, is_new: bool) -> bool {
        // Last painted in the last pass.
        self.retired = None;
        let before = self.painted();
        let Some(shown) = session.shown() else {
            self.retired = self.shown.take();
            return false;
        };
        // A picture finished meanwhile is taken before another is requested: where every pass brings a frame, the picture of the last one
        // is shown while that of the next is made.
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
            // Text over it was laid out for another picture.
            ctx.request_discard("another picture");
        }
        is_elsewhere
    }

    /// Shows a frame without a copy, if it is on the window's GPU.
    fn bind(&mut self, frame: &SharedFrame, time: FrameTime) -> bool {
        let Some(texture) = &frame.texture else { return false };
        let Some(gpu) = self.gpu.as_ref().filter(|gpu| Arc::ptr_eq(&gpu.context, texture.context())) else {
            return false;
        };
        self.shown = Some(gpu.bound(texture.texture(), time, Some(frame.clone())));
        true
    }
}

impl Shown {
    fn shape(&self, backdrop: &Backdrop) -> PaintCallback {
        let mut last = self.shape.borrow_mut();
        match &*last {
            Some((behind, shape)) if behind == backdrop => shape.clone(),
            _ => {
                let place = viewport::placed(backdrop.viewport, self.painted.size);
                let shape = self.picture.clone().paint(backdrop, place);
                last.insert((*backdrop, shape)).1.clone()
            }
        }
    }
}

impl WindowScreen {
    fn bound(&self, texture: &wgpu::Texture, time: FrameTime, frame: Option<SharedFrame>) -> Shown {
        let size = texture.size();
        let painted = Painted { size: vec2(size.width as f32, size.height as f32), time };
        Shown { painted, picture: self.blit.bind(&self.render_state.device, texture), shape: RefCell::new(None), frame }
    }

    /// Uploads a picture to the GPU, reusing the last texture if it has the same size.
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
