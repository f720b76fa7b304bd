//! The table of keys: actions and help texts.

use super::Action;
use super::camera_history::CameraTurn;
use super::exporting::ExportAction;
use crate::camera::Axis;
use crate::look::EnsembleChoice;
use crate::playback::Command;
use crate::ui::tracks::KeyAction;
use crate::ui::views::ViewAction;

/// One line of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Binding {
    /// The key as written: an upper-case letter, another character that needs no shift, or a name as `Left`.
    pub key: &'static str,
    /// Whether Ctrl (on macOS Command) is held.
    pub ctrl: bool,
    /// Whether shift is held.
    pub shift: bool,
    /// Its action.
    pub action: Action,
    /// Help text; bindings with the same text share a line.
    pub help: &'static str,
}

/// Steps moved with shift.
pub const MANY_STEPS: i64 = 10;

/// All keys.
pub fn bindings() -> Vec<Binding> {
    let plain = |key, action, help| Binding { key, ctrl: false, shift: false, action, help };
    let shifted = |key, action, help| Binding { shift: true, ..plain(key, action, help) };
    let ctrl = |key, shift, action, help| Binding { ctrl: true, shift, ..plain(key, action, help) };
    let along = |axis, from_positive| Action::ViewAlong { axis, from_positive };
    let ensemble = |(index, digit)| {
        plain(digit, Action::Ensembles(EnsembleChoice::One(index)), "an ensemble of the project, at all times")
    };
    let (axes, other_side) = ("look along an axis", "the same from the other side");
    let mut all = vec![
        plain("Space", Action::Play(Command::Toggle), "play or pause"),
        plain("Left", Action::Play(Command::Step(-1)), "one step back or on"),
        plain("Right", Action::Play(Command::Step(1)), "one step back or on"),
        shifted("Left", Action::Play(Command::Step(-MANY_STEPS)), MANY_STEPS_HELP),
        shifted("Right", Action::Play(Command::Step(MANY_STEPS)), MANY_STEPS_HELP),
        plain("Home", Action::Play(Command::SeekStep(0)), "first or last step"),
        plain("End", Action::Play(Command::SeekStep(usize::MAX)), "first or last step"),
        plain("B", Action::Play(Command::Reverse), "turn round"),
        plain("[", Action::Slower, "slower or faster"),
        plain("]", Action::Faster, "slower or faster"),
        plain("L", Action::NextLoop, "loop: off, all, range"),
        plain("P", Action::TogglePingPong, "ping-pong"),
        plain("I", Action::RangeFromHere, "play from here or up to here only"),
        plain("O", Action::RangeToHere, "play from here or up to here only"),
        plain("A", Action::ToggleDropping, "real time, dropping frames, or every step"),
        plain("D", Action::LessQuality, QUALITY_HELP),
        plain("E", Action::MoreQuality, QUALITY_HELP),
        plain("R", Action::ResetView, "the whole mesh again"),
        plain("X", along(Axis::X, false), axes),
        plain("Y", along(Axis::Y, false), axes),
        plain("Z", along(Axis::Z, false), axes),
        shifted("X", along(Axis::X, true), other_side),
        shifted("Y", along(Axis::Y, true), other_side),
        shifted("Z", along(Axis::Z, true), other_side),
        plain("Backspace", Action::TurnCamera(CameraTurn::Back), "the view before the last movement"),
        shifted("Backspace", Action::TurnCamera(CameraTurn::On), "on to the view after it"),
        plain("V", Action::OtherProjection, "perspective or parallel"),
        plain("M", Action::NextShown, "volume, isosurfaces, or both"),
        plain("F", Action::ToggleFlow, "flow, or none"),
        plain("G", Action::NextIcon, "the next icon of flow"),
        plain("J", Action::MoveIsovalue(-1.0), ISOVALUE_HELP),
        plain("K", Action::MoveIsovalue(1.0), ISOVALUE_HELP),
    ];
    all.extend(["1", "2", "3", "4", "5", "6", "7", "8", "9"].into_iter().enumerate().map(ensemble));
    all.extend([
        plain("0", Action::Ensembles(EnsembleChoice::Project), "the project's timeline again, with its ensembles"),
        plain("C", Action::CameraPath(true), "the project's camera path again"),
        ctrl("Z", false, Action::Undo, "undo a change of what is shown"),
        ctrl("Z", true, Action::Redo, "do it again"),
        plain("Delete", Action::Keys(KeyAction::Remove), "remove the selected key of the timeline"),
        ctrl("C", false, Action::Keys(KeyAction::Copy), "copy it"),
        ctrl("V", false, Action::Keys(KeyAction::Paste), "insert the copy at the moment shown"),
        ctrl("S", false, Action::SaveProject { to: None, may_replace: false }, "save the project"),
        ctrl("E", false, Action::Export(ExportAction::Dialog), "export images or a movie"),
        plain("S", Action::Screenshot, "save the picture as a PNG file here"),
        plain("T", Action::View(ViewAction::Turn), "the other one of two views"),
        plain("F11", Action::Fullscreen, "the whole screen, or the window again"),
        plain("Escape", Action::Close, "close the help, a message, the followed point"),
        plain("H", Action::Help, "this help"),
        plain("?", Action::Help, "this help"),
    ]);
    all
}

const QUALITY_HELP: &str = "less or more quality while something moves";

const ISOVALUE_HELP: &str = "the isovalue a hundredth of the range down or up";

const MANY_STEPS_HELP: &str = "ten steps back or on";

/// Mouse actions in the picture, for the help.
pub const MOUSE: [(&str, &str); 7] = [
    ("drag", "turn"),
    ("middle drag, Shift drag", "shift"),
    ("wheel", "zoom to the cursor"),
    ("right drag", "zoom"),
    ("Ctrl drag", "move the last cut along its normal"),
    ("click", "follow the point over time"),
    ("double click", "the whole mesh again"),
];

impl Binding {
    /// The keys as written: `Ctrl Shift Z`.
    pub fn name(&self) -> String {
        let held =
            [(self.ctrl, "Ctrl "), (self.shift, "Shift ")].map(|(is_held, name)| if is_held { name } else { "" });
        held.concat() + self.key
    }
}

/// The lines of the help: keys and help texts.
pub fn help() -> Vec<(String, &'static str)> {
    let mut lines: Vec<(String, &str)> = Vec::new();
    for binding in bindings() {
        match lines.iter_mut().find(|(_, help)| *help == binding.help) {
            Some((keys, _)) => {
                keys.push_str(", ");
                keys.push_str(&binding.name());
            }
            None => lines.push((binding.name(), binding.help)),
        }
    }
    lines
}

/// The action of a key with Ctrl and shift held or not.
pub fn action(key: &str, [ctrl, shift]: [bool; 2]) -> Option<Action> {
    let found = bindings().into_iter().find(|b| (b.key, b.ctrl, b.shift) == (key, ctrl, shift));
    found.map(|binding| binding.action)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn no_key_does_two_things() {
        let keys: Vec<(&str, [bool; 2])> = bindings().iter().map(|b| (b.key, [b.ctrl, b.shift])).collect();
        assert_eq!(keys.iter().collect::<HashSet<_>>().len(), keys.len());
    }

    #[test]
    fn the_help_names_every_key_once() {
        let help = help();
        for binding in bindings() {
            let lines = help.iter().filter(|(keys, _)| keys.split(", ").any(|key| key == binding.name()));
            assert_eq!(lines.map(|(_, text)| *text).collect::<Vec<_>>(), [binding.help]);
        }
        assert!(help.contains(&("Left, Right".to_owned(), "one step back or on")));
        assert!(MANY_STEPS == 10 && MANY_STEPS_HELP.starts_with("ten"), "the text is that of the constant");
    }

    #[test]
    fn the_guide_has_the_same_table() {
        let guide = include_str!("../../docs/guide.md");
        let mouse = MOUSE.map(|(what, does)| (what.to_owned(), does));
        let lines: Vec<_> =
            help().into_iter().chain(mouse).map(|(what, does)| format!("| {what} | {does} |")).collect();
        for line in &lines {
            assert!(guide.contains(line.as_str()), "docs/guide.md does not have the line {line}");
        }
        // Two tables, each with a header of two lines.
        let rows = guide.lines().filter(|line| line.starts_with('|')).count();
        assert_eq!(rows, lines.len() + 4, "docs/guide.md has keys that are not in the table");
    }

    #[test]
    fn keys_do_what_they_say() {
        assert_eq!(action("Space", [false; 2]), Some(Action::Play(Command::Toggle)));
        assert_eq!(action("Left", [false, true]), Some(Action::Play(Command::Step(-10))));
        assert_eq!(action("Q", [false; 2]), None);
        assert_eq!(action("Z", [true, false]), Some(Action::Undo));
    }
}
