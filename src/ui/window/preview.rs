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
    shown: Option<(Arc<Picture>, TextureHandle)>,
}

impl Preview {
    /// Shows the step under the mouse, if there is one.
    pub(super) fn show(&mut self, session: &mut Session, step: Option<usize>, over: &egui::Response) {
        let Some(step) = step else {
            if self.step.take().is_some() {
                session.thumbnail(None);
                self.shown = None;
            }
            return;
        };
        self.step = Some(step);
        let picture = session.thumbnail(Some(step));
        if let Some(picture) = &picture {
            self.take(over, picture);
        }
        let shown = self.shown.as_ref().filter(|_| picture.is_some());
        let id = over.id.with("preview");
        Tooltip::always_open(over.ctx.clone(), over.layer_id, id, PopupAnchor::Pointer).show(|ui| {
            if let Some((_, texture)) = shown {
                ui.add(egui::Image::new((texture.id(), texture.size_vec2())).alt_text(ALT_TEXT));
            }
            ui.label(caption(session, step));
        });
    }

    /// Uploads a picture to the GPU, unless it is there.
    fn take(&mut self, over: &egui::Response, picture: &Arc<Picture>) {
        if self.shown.as_ref().is_some_and(|(shown, _)| Arc::ptr_eq(picture, shown)) {
            return;
        }
        let image = ColorImage::from_rgba_premultiplied(picture.size, picture.pixels.as_flattened());
        self.shown = Some((picture.clone(), over.ctx.load_texture("thumbnail", image, TextureOptions::LINEAR)));
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
