//! The views without a series, and while one is opened.

use super::path_field::{OpenDialog, PATH_WIDTH, PathField, TO_OPEN};
use super::preview::Upload;
use super::widgets::icon;
use crate::field::FieldSelector;
use crate::import::Format;
use crate::ui::opening::OpeningProgress;
use crate::ui::picture::Picture;
use crate::ui::settings::RecentFile;
use eframe::egui;
use egui::{Align, Layout, ProgressBar, Role, Ui, WidgetInfo};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A request of the user.
pub(super) enum Wish {
    /// Open these files.
    Open(Vec<PathBuf>),
    /// Show these data in a second view.
    Beside(Data),
    /// Cancel opening.
    Stop,
}

/// Data of a second view.
pub(super) enum Data {
    /// Those of the active one.
    Same,
    /// Another field of its store.
    Field(FieldSelector),
    /// Other files.
    Files(Vec<PathBuf>),
}

/// A box for the path of what is opened.
pub(super) struct PathBox(PathField);

impl PathBox {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self(PathField::new(open))
    }

    /// Shows the box; returns the path once entered or chosen.
    pub(super) fn show(&mut self, ui: &mut Ui) -> Option<PathBuf> {
        let hint = format!("path of a .zarr, {}", Format::common_extensions());
        let (response, is_entered) = self.0.show(ui, ("Path to open", &hint), Some("Open"), &TO_OPEN);
        // Typing goes to the box, from the first letter on.
        if !is_entered && ui.memory(|memory| memory.focused().is_none()) {
            response.request_focus();
        }
        response.on_hover_text(all_formats());
        self.0.path().filter(|_| is_entered)
    }

    /// The path that was chosen in a dialog while the box was not shown.
    pub(super) fn take_chosen(&mut self) -> Option<PathBuf> {
        self.0.take_chosen().then(|| self.0.path()).flatten()
    }
}

/// What is read beside stores, of which there is room for the common formats alone.
fn all_formats() -> String {
    format!("All that is read: {}", Format::list())
}

/// Largest length of the name of a folder; longer ones keep their end.
const FOLDER: usize = 48;

/// Recent files with their folders; returns the chosen one.
pub(super) fn recent(ui: &mut Ui, files: &[RecentFile]) -> Option<PathBuf> {
    let mut wanted = None;
    for path in files.iter().map(|file| &file.path) {
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        ui.horizontal(|ui| {
            if ui.button(name).on_hover_text(path.display().to_string()).clicked() {
                wanted = Some(path.clone());
            }
            if let Some(folder) = path.parent() {
                ui.weak(end_of(&folder.display().to_string(), FOLDER));
            }
        });
    }
    wanted
}

/// The end of a text of at most `most` characters.
fn end_of(text: &str, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    ['…'].into_iter().chain(text.chars().skip(count + 1 - most)).collect()
}

/// The view when nothing is open.
pub(super) fn show(ui: &mut Ui, path_box: &mut PathBox, files: &[RecentFile]) -> Option<Wish> {
    let mut wish = None;
    ui.with_layout(Layout::top_down(Align::Center), |ui| {
        ui.add_space(0.25 * ui.available_height());
        ui.heading("tetreel");
        ui.add_space(8.0);
        ui.label(format!("Drop a store (.zarr) or files of a simulation ({}) here,", Format::common_extensions()))
            .on_hover_text(all_formats());
        ui.label("or name one:");
        ui.add_space(8.0);
        ui.allocate_ui_with_layout(egui::vec2(PATH_WIDTH, 24.0), Layout::top_down(Align::Min), |ui| {
            wish = path_box.show(ui).map(|path| Wish::Open(vec![path]));
            if !files.is_empty() {
                ui.add_space(16.0);
                ui.label("Opened before:");
                if let Some(path) = recent(ui, files) {
                    wish = Some(Wish::Open(vec![path]));
                }
            }
        });
    });
    wish
}

/// The picture of some cells of a source that is imported.
#[derive(Default)]
pub(super) struct FirstPicture(Upload);

impl FirstPicture {
    /// Shows it as large as there is room, and says what it is.
    pub(super) fn show(&mut self, ui: &mut Ui, picture: &Arc<Picture>) {
        ui.vertical_centered(|ui| {
            ui.label("A preview: some cells of the first step, as points. The series is shown when it is imported.");
            let texture = self.0.of(ui.ctx(), "first picture", picture);
            let image = egui::Image::new((texture.id(), texture.size_vec2()));
            ui.add(image.max_size(ui.available_size()).alt_text("Preview of what is opened"));
        });
    }
}

/// Progress of opening `paths`.
pub(super) fn opening(ui: &mut Ui, paths: &[PathBuf], progress: &OpeningProgress) -> Option<Wish> {
    let mut wish = None;
    ui.horizontal(|ui| {
        if icon(ui, "×", "Stop opening", true).clicked() {
            wish = Some(Wish::Stop);
        }
        let name = paths.first().map_or(Path::new(""), PathBuf::as_path);
        let name = name.file_name().unwrap_or(name.as_os_str()).to_string_lossy();
        ui.label(format!("{name}: {}", progress.stage));
        let text = counted(progress);
        let bar = ProgressBar::new(progress.fraction as f32).desired_width(ui.available_width()).text(text.clone());
        let response = ui.add(bar);
        response.widget_info(|| WidgetInfo::labeled(Role::ProgressIndicator, true, format!("Opening: {text}")));
    });
    wish
}

/// `12 of 30 steps, 5 s left`.
fn counted(progress: &OpeningProgress) -> String {
    let OpeningProgress { done, total, unit, left, .. } = progress;
    if *total == 0 {
        return String::new();
    }
    let left = left.map_or(String::new(), |left| format!(", {} left", in_words(left)));
    format!("{done} of {total} {unit}{left}")
}

/// A time left, rounded up.
pub(super) fn in_words(time: Duration) -> String {
    let seconds = time.as_secs_f64().ceil() as u64;
    if seconds < 90 { format!("{seconds} s") } else { format!("{} min", seconds.div_ceil(60)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_folders_keep_their_end() {
        assert_eq!((end_of("/home/a", 7), end_of("/home/ab", 7)), ("/home/a".to_owned(), "…ome/ab".to_owned()));
    }

    #[test]
    fn what_is_left_is_never_said_to_be_less() {
        assert_eq!(in_words(Duration::from_millis(1)), "1 s");
        assert_eq!(in_words(Duration::from_secs(89)), "89 s");
        assert_eq!(in_words(Duration::from_secs(91)), "2 min");
    }
}
