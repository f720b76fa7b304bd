//! Thumbnail of the step under the mouse, over the timeline.

use super::overlay::number;
use crate::ui::Session;
use crate::ui::picture::Picture;
use eframe::egui;
use egui::{ColorImage, PopupAnchor, TextureHandle, TextureOptions, Tooltip};
use std::sync::Arc;

/// Description of the thumbnail.
const ALT_TEXT: &str = "Small picture of the step";

/// The thumbnail of the step under the mouse.
#[derive(Default)]
pub(super) struct Preview {
    step: Option<usize>,
    shown: Upload,
}

/// A picture on the GPU.
#[derive(Default)]
pub(super) struct Upload(Option<(Arc<Picture>, TextureHandle)>);

impl Upload {
    /// The texture of a picture, which is uploaded unless it is there.
    pub(super) fn of(&mut self, ctx: &egui::Context, name: &str, picture: &Arc<Picture>) -> &TextureHandle {
        let known = self.0.take().filter(|(shown, _)| Arc::ptr_eq(picture, shown));
        let upload = || {
            let image = ColorImage::from_rgba_premultiplied(picture.size, picture.pixels.as_flattened());
            (picture.clone(), ctx.load_texture(name, image, TextureOptions::LINEAR))
        };
        &self.0.insert(known.unwrap_or_else(upload)).1
    }
}

impl Preview {
    /// Shows the step under the mouse, if there is one.
    pub(super) fn show(&mut self, session: &mut Session, step: Option<usize>, over: &egui::Response) {
        let Some(step) = step else {
            if self.step.take().is_some() {
                session.thumbnail(None);
                self.shown = Upload::default();
            }
            return;
        };
        self.step = Some(step);
        let picture = session.thumbnail(Some(step));
        let shown = picture.map(|picture| self.shown.of(&over.ctx, "thumbnail", &picture));
        let id = over.id.with("preview");
        Tooltip::always_open(over.ctx.clone(), over.layer_id, id, PopupAnchor::Pointer).show(|ui| {
            if let Some(texture) = shown {
                ui.add(egui::Image::new((texture.id(), texture.size_vec2())).alt_text(ALT_TEXT));
            }
            ui.label(caption(session, step));
        });
    }
}

/// Step, time and values, as far as they are known.
fn caption(session: &Session, step: usize) -> String {
    let series = session.series();
    let time = series.times().values.get(step).map_or(String::new(), |&time| number(time));
    let mut text = format!("step {step}, t = {time}");
    if let Some([lo, hi]) = series.field().range_per_step.get(step).copied().flatten() {
        text.push_str(&format!("\n{} to {}", number(f64::from(lo)), number(f64::from(hi))));
    }
    if let Some(Some(step)) = session.survey().steps.get(step) {
        text.push_str(&format!(", mean {}", number(step.mean)));
    }
    text
}
