//! Translates keys of the window to those of the table.

use crate::ui::Action;
use crate::ui::keys::{self, Key};
use eframe::egui;

/// Actions of newly pressed keys, unless a widget or a menu has the focus.
pub(super) fn pressed(ctx: &egui::Context) -> Vec<Action> {
    if ctx.egui_wants_keyboard_input() || egui::Popup::is_any_open(ctx) {
        return Vec::new();
    }
    let mut actions = Vec::new();
    ctx.input(|input| {
        for event in &input.events {
            if let egui::Event::Key { key, pressed: true, modifiers, repeat, .. } = event
                && !(modifiers.alt || modifiers.ctrl || modifiers.command)
                && let Some((key, shift)) = known(*key, modifiers.shift)
                && let Some(action) = keys::action(key, shift)
                && (!repeat || repeats(&action))
            {
                actions.push(action);
            }
        }
    });
    actions
}

/// Whether the action repeats while its key is held.
fn repeats(action: &Action) -> bool {
    use crate::playback::Command;
    matches!(action, Action::Play(Command::Step(_)) | Action::Faster | Action::Slower)
}

/// The table's key for a key of egui, and whether shift counts for it.
fn known(key: egui::Key, shift: bool) -> Option<(Key, bool)> {
    let key = match key {
        egui::Key::Space => Key::Space,
        egui::Key::ArrowLeft => Key::Left,
        egui::Key::ArrowRight => Key::Right,
        egui::Key::Home => Key::Home,
        egui::Key::End => Key::End,
        // On layouts where these need shift.
        egui::Key::OpenBracket => return Some((Key::Char('['), false)),
        egui::Key::CloseBracket => return Some((Key::Char(']'), false)),
        egui::Key::Questionmark => return Some((Key::Char('?'), false)),
        other => Key::Char(other.name().chars().next().filter(|_| other.name().chars().count() == 1)?),
    };
    Some((key, shift))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_of_the_table_can_be_pressed() {
        let all: Vec<(Key, bool)> =
            egui::Key::ALL.iter().flat_map(|&key| [known(key, false), known(key, true)]).flatten().collect();
        for binding in keys::bindings() {
            assert!(all.contains(&(binding.key, binding.shift)), "{}", binding.name());
        }
    }
}
