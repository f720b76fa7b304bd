//! Translates keys of the window to those of the table.

use crate::ui::Action;
use crate::ui::keys;
use crate::ui::tracks::KeyAction;
use eframe::egui;

/// Actions of newly pressed keys, unless a widget or a menu has the focus. `has_key`: whether a key of the timeline is selected, of which a
/// copy takes the clipboard.
pub(super) fn pressed(ctx: &egui::Context, has_key: bool) -> Vec<Action> {
    if ctx.egui_wants_keyboard_input() || egui::Popup::is_any_open(ctx) {
        return Vec::new();
    }
    let mut actions = Vec::new();
    ctx.input(|input| {
        for event in &input.events {
            if let egui::Event::Key { key, pressed: true, modifiers, repeat, .. } = event
                && !modifiers.alt
            {
                let (key, shift) = known(*key, modifiers.shift);
                let ctrl = modifiers.ctrl || modifiers.command;
                actions.extend(keys::action(key, [ctrl, shift]).filter(|action| !repeat || repeats(action)));
            }
            // The system's keys for these come as events of their own.
            match event {
                egui::Event::Copy => actions.extend(keys::action("C", [true, false])),
                egui::Event::Paste(_) => actions.extend(keys::action("V", [true, false])),
                _ => {}
            }
        }
    });
    if has_key && actions.contains(&Action::Keys(KeyAction::Copy)) {
        // Without a text on the clipboard nothing is pasted.
        ctx.copy_text(CLIPBOARD.to_owned());
    }
    actions
}

/// What the clipboard has while a key of the timeline is copied.
const CLIPBOARD: &str = "a key of tetreel's timeline";

/// Whether the action repeats while its key is held.
fn repeats(action: &Action) -> bool {
    use crate::playback::Command;
    matches!(
        action,
        Action::Play(Command::Step(_))
            | Action::Faster
            | Action::Slower
            | Action::LessQuality
            | Action::MoreQuality
            | Action::TurnCamera(_)
            | Action::Undo
            | Action::Redo
    )
}

/// The table's key for a key of egui, and whether shift counts for it.
fn known(key: egui::Key, shift: bool) -> (&'static str, bool) {
    match key {
        // On layouts where these need shift.
        egui::Key::OpenBracket | egui::Key::CloseBracket | egui::Key::Questionmark => (key.symbol_or_name(), false),
        other => (other.name(), shift),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_of_the_table_can_be_pressed() {
        let all: Vec<(&str, bool)> =
            egui::Key::ALL.iter().flat_map(|&key| [known(key, false), known(key, true)]).collect();
        for binding in keys::bindings() {
            assert!(all.contains(&(binding.key, binding.shift)), "{}", binding.name());
        }
    }
}
