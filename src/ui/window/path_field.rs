//! A box for a path: typed, or chosen in the system's dialog where it has one.

use super::widgets::labelled;
use crossbeam::channel::{Receiver, bounded};
use eframe::egui;
use egui::{Key, Response, TextEdit, Ui};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a dialog asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// A file that exists.
    File,
    /// A folder that exists: a store is one.
    Folder,
    /// A file to be written.
    Save,
}

/// Opens a dialog of the system, called on the window's thread; what it returns waits for the user, on another one. `None`: no path was
/// chosen, or there is no dialog.
pub type OpenDialog = Arc<dyn Fn(Choice, Option<&Path>) -> Answer + Send + Sync>;

/// Waits for the path that the user chooses.
pub type Answer = Box<dyn FnOnce() -> Option<PathBuf> + Send>;

/// The dialogs of the system: its portal for files, or else the program `zenity`, on Linux.
pub fn system_dialogs() -> OpenDialog {
    Arc::new(|choice, folder| {
        let dialog = rfd::AsyncFileDialog::new();
        let dialog = match folder {
            Some(folder) => dialog.set_directory(folder),
            None => dialog,
        };
        let handle: std::pin::Pin<Box<dyn Future<Output = Option<rfd::FileHandle>> + Send>> = match choice {
            Choice::File => Box::pin(dialog.pick_file()),
            Choice::Folder => Box::pin(dialog.pick_folder()),
            Choice::Save => Box::pin(dialog.save_file()),
        };
        Box::new(move || pollster::block_on(handle).map(|handle| handle.path().to_owned()))
    })
}

/// Width of the box, points.
pub(super) const PATH_WIDTH: f32 = 320.0;

/// The box, and the dialog while it is open.
pub(super) struct PathField {
    /// What was typed or chosen.
    pub(super) text: String,
    open: OpenDialog,
    dialog: Option<Receiver<Option<PathBuf>>>,
    /// Why nothing was chosen.
    problem: Option<&'static str>,
}

impl PathField {
    pub(super) fn new(open: &OpenDialog) -> Self {
        Self { text: String::new(), open: open.clone(), dialog: None, problem: None }
    }

    /// The path, without the quotes that a file manager's "copy path" adds; `None` if there is none.
    pub(super) fn path(&self) -> Option<PathBuf> {
        let text = self.text.trim().trim_matches(['"', '\'']);
        (!text.is_empty()).then(|| PathBuf::from(text))
    }

    /// Takes over the path of a dialog that was closed; returns whether there was one.
    pub(super) fn take_chosen(&mut self) -> bool {
        let Some(answer) = self.dialog.as_ref().and_then(|dialog| dialog.try_recv().ok()) else { return false };
        self.dialog = None;
        self.problem = answer.is_none().then_some("nothing was chosen; where no dialog opens, type the path");
        if let Some(path) = &answer {
            self.text = path.display().to_string();
        }
        answer.is_some()
    }

    /// Shows the box, named `name`, below it the button `enter`, if there is one, and buttons that open dialogs. Returns the box, and whether
    /// its path was entered or chosen.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        (name, hint): (&str, &str),
        enter: Option<&str>,
        choices: &[(Choice, &str)],
    ) -> (Response, bool) {
        let is_chosen = self.take_chosen();
        let edit = TextEdit::singleline(&mut self.text).hint_text(hint).desired_width(PATH_WIDTH);
        let response = labelled(ui.add(edit), name);
        let mut is_entered = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
        ui.horizontal(|ui| {
            is_entered |= enter.is_some_and(|text| ui.button(text).clicked());
            for (choice, text) in choices {
                if ui.add_enabled(self.dialog.is_none(), egui::Button::new(*text)).clicked() {
                    self.ask(ui.ctx(), *choice);
                }
            }
            if let Some(problem) = self.problem {
                ui.weak(problem);
            }
        });
        (response, is_entered || is_chosen)
    }

    /// Opens a dialog.
    fn ask(&mut self, ctx: &egui::Context, choice: Choice) {
        let path = self.path();
        let folder = path.as_deref().and_then(|path| if path.is_dir() { Some(path) } else { path.parent() });
        let answer = (self.open)(choice, folder.filter(|folder| folder.is_dir()));
        let (to, from) = bounded(1);
        let ctx = ctx.clone();
        let thread = std::thread::Builder::new().name("file dialog".to_owned()).spawn(move || {
            // The window may be closed by then.
            let _ = to.send(answer());
            ctx.request_repaint();
        });
        match thread {
            Ok(_) => self.dialog = Some(from),
            Err(_) => self.problem = Some("the system gives no thread; type the path"),
        }
    }
}

/// Both kinds of what can be opened.
pub(super) const TO_OPEN: [(Choice, &str); 2] = [(Choice::File, "Choose file"), (Choice::Folder, "Choose folder")];
