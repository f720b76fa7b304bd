//! Settings that a window keeps between runs: `settings.json` in the user's folder for settings.
//!
//! The file is JSON with a version. It is replaced whole or not at all; a damaged one is renamed to `settings.json.bad`, and its readable
//! parts are kept. Problems never stop a window: they are reported as notices. Of two windows that write, the last one wins, except that
//! recent files and looks of both are kept.

use super::{IMAGE_SCALES, TARGET_FPS};
use crate::camera::Camera;
use crate::error::{FileError, FileResult};
use crate::files;
use crate::look::Look;
use crate::pipeline::PipelinedOptions;
use crate::playback::quality::Family;
use crate::transfer::{RangePolicy, TransferFunction};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf, absolute};
use std::time::{SystemTime, UNIX_EPOCH};

/// Files that are listed as recent.
pub const RECENT_MAX: usize = 10;
/// Stores whose looks are remembered.
pub const LOOKS_MAX: usize = 20;
/// The version of the file that is written.
const VERSION: u64 = 1;
/// Longer files are refused.
const BYTES_MAX: u64 = 4 << 20;
/// Smallest and largest width or height of a window, points.
const WINDOW_SIDE: [f32; 2] = [320.0, 16384.0];
/// Parts of the side panel that are remembered.
const SECTIONS_MAX: usize = 50;
/// Largest size of the frame cache, bytes.
const FRAME_CACHE_MAX: u64 = 64 << 30;

/// A file that was opened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecentFile {
    /// Absolute path.
    pub path: PathBuf,
    /// Time of the last opening, milliseconds since 1970.
    pub opened_ms: u64,
}

/// Look of a store when it was closed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedLook {
    /// The store or source, absolute.
    pub path: PathBuf,
    /// Time of the last use, milliseconds since 1970.
    pub used_ms: u64,
    /// The field.
    pub field: String,
    /// Viewpoint and projection.
    pub camera: Camera,
    /// Colours and opacities.
    pub tf: TransferFunction,
    /// Scalars that the transfer function covers.
    pub range: RangePolicy,
}

impl SavedLook {
    /// Gives a look its camera, colours and range.
    pub fn apply_to(&self, look: &mut Look) {
        (look.camera, look.range) = (self.camera, self.range);
        look.tf = self.tf.clone();
    }

    /// Whether the look can be shown and written.
    fn is_sound(&self) -> bool {
        self.camera.view(1, 1).is_ok()
            && self.range.to_string().parse().is_ok_and(|range: RangePolicy| range == self.range)
    }
}

/// The settings. Fields may have any value; reading and writing clamp them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Files that were opened, newest first.
    pub recent: Vec<RecentFile>,
    /// Looks of stores, newest first.
    pub looks: Vec<SavedLook>,
    /// Width and height of the window, points.
    pub window_size: [f32; 2],
    /// Whether the side panel is shown.
    pub shows_side: bool,
    /// Display-referred colour behind the volume.
    pub background: [f32; 3],
    /// Pixels of the image per pixel of the screen, along a side.
    pub image_scale: f64,
    /// Target frame rate while something moves; 0: all frames are drawn in full.
    pub target_rate: f64,
    /// Family of lower qualities for that; `None`: the one with the least error.
    pub gives_up: Option<Family>,
    /// Size of the frame cache, bytes.
    pub frame_cache_bytes: u64,
    /// Folder of the last screenshot.
    pub screenshot_folder: Option<PathBuf>,
    /// Parts of the side panel by title that the user opened or closed.
    pub open_sections: BTreeMap<String, bool>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            recent: Vec::new(),
            looks: Vec::new(),
            window_size: [1280.0, 800.0],
            shows_side: true,
            // #16181d
            background: [22.0 / 255.0, 24.0 / 255.0, 29.0 / 255.0],
            image_scale: 1.0,
            target_rate: 25.0,
            gives_up: None,
            frame_cache_bytes: PipelinedOptions::default().frame_cache_bytes,
            screenshot_folder: None,
            open_sections: BTreeMap::new(),
        }
    }
}

impl Settings {
    /// Puts a file first in the recent ones. A path that is not Unicode cannot be written to the file, and is left out.
    pub fn remember_file(&mut self, path: &Path) {
        let path = absolute(path).unwrap_or_else(|_| path.to_owned());
        let newest = self.recent.iter().map(|file| file.opened_ms).max().map_or(0, |ms| ms.saturating_add(1));
        self.recent.insert(0, RecentFile { path, opened_ms: now_ms().max(newest) });
        *self = std::mem::take(self).within_bounds();
    }

    /// Saves the look of a field of a store or source.
    pub fn remember_look(&mut self, path: &Path, field: &str, look: &Look) {
        let path = absolute(path).unwrap_or_else(|_| path.to_owned());
        let newest = self.looks.iter().map(|look| look.used_ms).max().map_or(0, |ms| ms.saturating_add(1));
        let Look { camera, range, .. } = *look;
        let (field, tf, used_ms) = (field.to_owned(), look.tf.clone(), now_ms().max(newest));
        self.looks.insert(0, SavedLook { path, used_ms, field, camera, tf, range });
        *self = std::mem::take(self).within_bounds();
    }

    /// The saved look of a store or source.
    pub fn look_of(&self, path: &Path) -> Option<&SavedLook> {
        let path = absolute(path).unwrap_or_else(|_| path.to_owned());
        self.looks.iter().find(|look| look.path == path)
    }

    /// Settings with every value clamped to its range, and lists checked, sorted and cut to their longest.
    #[must_use]
    pub fn within_bounds(mut self) -> Self {
        let default = Self::default();
        let is_text = |path: &Path| path.to_str().is_some() && path.is_absolute();
        self.recent.retain(|file| is_text(&file.path));
        self.recent.sort_by_key(|file| std::cmp::Reverse(file.opened_ms));
        retain_first_of(&mut self.recent, |file| &file.path);
        self.recent.truncate(RECENT_MAX);
        self.looks.retain(|look| is_text(&look.path) && look.is_sound());
        self.looks.sort_by_key(|look| std::cmp::Reverse(look.used_ms));
        retain_first_of(&mut self.looks, |look| &look.path);
        self.looks.truncate(LOOKS_MAX);
        let finite = |x: f64, default: f64| if x.is_finite() { x } else { default };
        for (side, default) in self.window_size.iter_mut().zip(default.window_size) {
            *side = if side.is_finite() { *side } else { default }.clamp(WINDOW_SIDE[0], WINDOW_SIDE[1]);
        }
        for (channel, default) in self.background.iter_mut().zip(default.background) {
            *channel = if channel.is_finite() { *channel } else { default }.clamp(0.0, 1.0);
        }
        let scale = finite(self.image_scale, default.image_scale);
        self.image_scale = scale.clamp(*IMAGE_SCALES.start(), *IMAGE_SCALES.end());
        let rate = finite(self.target_rate, default.target_rate);
        self.target_rate = if rate <= 0.0 { 0.0 } else { rate.clamp(*TARGET_FPS.start(), *TARGET_FPS.end()) };
        self.frame_cache_bytes = self.frame_cache_bytes.min(FRAME_CACHE_MAX);
        self.screenshot_folder = self.screenshot_folder.filter(|folder| is_text(folder));
        while self.open_sections.len() > SECTIONS_MAX {
            self.open_sections.pop_last();
        }
        self
    }

    /// Settings from the keys of a file; unreadable ones keep their defaults, and are named.
    fn read(map: &Map<String, Value>) -> (Self, Vec<String>) {
        let mut settings = Self::default();
        let mut wrong = Vec::new();
        take(map, "recent", &mut settings.recent, &mut wrong);
        take(map, "looks", &mut settings.looks, &mut wrong);
        take(map, "window_size", &mut settings.window_size, &mut wrong);
        take(map, "shows_side", &mut settings.shows_side, &mut wrong);
        take(map, "background", &mut settings.background, &mut wrong);
        take(map, "image_scale", &mut settings.image_scale, &mut wrong);
        take(map, "target_rate", &mut settings.target_rate, &mut wrong);
        take(map, "gives_up", &mut settings.gives_up, &mut wrong);
        take(map, "frame_cache_bytes", &mut settings.frame_cache_bytes, &mut wrong);
        take(map, "screenshot_folder", &mut settings.screenshot_folder, &mut wrong);
        take(map, "open_sections", &mut settings.open_sections, &mut wrong);
        (settings.within_bounds(), wrong)
    }
}

/// Removes later elements with the same path.
fn retain_first_of<T>(list: &mut Vec<T>, path: impl Fn(&T) -> &PathBuf) {
    let mut seen = std::collections::BTreeSet::new();
    list.retain(|item| seen.insert(path(item).clone()));
}

fn take<T: DeserializeOwned>(map: &Map<String, Value>, key: &str, to: &mut T, wrong: &mut Vec<String>) {
    match map.get(key).map(T::deserialize) {
        Some(Ok(value)) => *to = value,
        Some(Err(_)) => wrong.push(key.to_owned()),
        None => {}
    }
}

fn now_ms() -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(now.as_millis()).unwrap_or(u64::MAX)
}

/// The settings file. Reading and writing access the disk: not for the thread of a window.
#[derive(Debug, Default)]
pub struct SettingsFile {
    folder: Option<PathBuf>,
    /// Recent files in the file when last read or written here: those missing since were removed by the user.
    known: Vec<RecentFile>,
    /// Problems reported since the last successful write.
    complaints: Vec<String>,
    /// Whether the file is of a newer program, and left alone.
    is_frozen: bool,
}

impl SettingsFile {
    /// The user's file: in `$TETREEL_CONFIG`, else `$XDG_CONFIG_HOME/tetreel`, else `~/.config/tetreel` (on macOS `~/Library/Application
    /// Support/tetreel`, on Windows `%APPDATA%\tetreel`).
    pub fn of_user() -> Self {
        Self { folder: folder_from(std::env::consts::OS, |name| std::env::var_os(name)), ..Self::default() }
    }

    /// No file: nothing is kept or reported.
    pub fn nowhere() -> Self {
        Self { is_frozen: true, ..Self::default() }
    }

    /// The file in this folder, which is created at the first write.
    pub fn at(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()), ..Self::default() }
    }

    /// Path of the file, which may not exist yet; `None` without a folder.
    pub fn path(&self) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join("settings.json"))
    }

    /// The settings, and a message for the user. A missing file is no problem.
    pub fn load(&mut self) -> (Settings, Option<String>) {
        let Some(path) = self.path() else { return (Settings::default(), None) };
        let (map, notice) = self.read_map(&path);
        let (settings, _) = Settings::read(&map);
        self.known.clone_from(&settings.recent);
        (settings, notice)
    }

    /// Writes the settings, merged with those written by other windows since; `settings` then has their recent files and looks, too.
    /// Returns a message for the user: each problem once.
    pub fn save(&mut self, settings: &mut Settings) -> Option<String> {
        let Some(path) = self.path() else {
            if self.is_frozen {
                return None;
            }
            return self
                .complain("settings are not kept: no variable says where; set TETREEL_CONFIG to a folder".to_owned());
        };
        let (map, notice) = self.read_map(&path);
        if self.is_frozen {
            return notice;
        }
        let merged = self.merge(std::mem::take(settings), &Settings::read(&map).0);
        *settings = merged;
        match write(&path, settings, map) {
            Ok(()) => {
                self.known.clone_from(&settings.recent);
                self.complaints.clear();
                notice
            }
            Err(error) => {
                let error = error.remedy("set TETREEL_CONFIG to a folder that you may write to");
                self.complain(format!("settings are not kept: {error}")).or(notice)
            }
        }
    }

    fn complain(&mut self, text: String) -> Option<String> {
        if self.complaints.contains(&text) {
            return None;
        }
        self.complaints.push(text.clone());
        Some(text)
    }

    /// Adds recent files and looks of other windows.
    fn merge(&self, mut ours: Settings, theirs: &Settings) -> Settings {
        // A known file missing from ours was removed here.
        let is_new = |file: &&RecentFile| !self.known.contains(file);
        ours.recent.extend(theirs.recent.iter().filter(is_new).cloned());
        ours.looks.extend(theirs.looks.iter().cloned());
        ours.within_bounds()
    }

    /// The keys of the file; none if there is no file. A damaged file is moved aside, as is one with invalid values.
    fn read_map(&mut self, path: &Path) -> (Map<String, Value>, Option<String>) {
        let (map, problem) = match read_text(path) {
            Ok(None) => return (Map::new(), None),
            Ok(Some(bytes)) => match serde_json::from_slice::<Map<String, Value>>(&bytes) {
                Ok(map) => {
                    let version = map.get("version").and_then(Value::as_u64).unwrap_or(VERSION);
                    if version > VERSION {
                        self.is_frozen = true;
                        let text = format!(
                            "{}: is of a newer tetreel (version {version}); what changes now is not kept",
                            path.display()
                        );
                        return (map, self.complain(text));
                    }
                    let wrong = Settings::read(&map).1;
                    if wrong.is_empty() {
                        return (map, None);
                    }
                    (map, format!("the values of {} make no sense", wrong.join(", ")))
                }
                Err(error) => (Map::new(), format!("is damaged: {error}")),
            },
            Err(error) => {
                return (Map::new(), self.complain(format!("settings are not read: {error}")));
            }
        };
        let bad = path.with_extension("json.bad");
        let aside = match std::fs::rename(path, &bad) {
            Ok(()) => format!("it is now {}; what could be read is kept, the rest is as at first", bad.display()),
            // Then it cannot be written either, which is another notice.
            Err(error) => format!("it cannot be renamed: {error}; remove it"),
        };
        let text = format!("{}: {problem}; {aside}", path.display());
        (map, self.complain(text))
    }
}

/// The bytes of the file; `None` if there is none.
fn read_text(path: &Path) -> FileResult<Option<Vec<u8>>> {
    let io = |error: std::io::Error| FileError::io(path, "read", &error);
    let metadata = match std::fs::metadata(path) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
        metadata => metadata.map_err(io)?,
    };
    if !metadata.is_file() || metadata.len() > BYTES_MAX {
        return Err(FileError::invalid(path, "", "is no file of settings").remedy("remove it"));
    }
    std::fs::read(path).map(Some).map_err(io)
}

/// Writes settings, and those keys of `map` that are not known here.
fn write(path: &Path, settings: &Settings, mut map: Map<String, Value>) -> FileResult<()> {
    let json = |error: serde_json::Error| FileError::invalid(path, "", error.to_string());
    let Value::Object(known) = serde_json::to_value(settings).map_err(json)? else {
        return Err(FileError::invalid(path, "", "settings are no object"));
    };
    map.insert("version".to_owned(), VERSION.into());
    map.extend(known);
    let text = serde_json::to_string_pretty(&map).map_err(json)? + "\n";
    let folder = files::parent_of(path);
    std::fs::create_dir_all(folder).map_err(|error| FileError::io(folder, "make the folder", &error))?;
    // A symbolic link stays: its target is replaced.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    files::replace(&path, |file| {
        let written = std::io::Write::write_all(file, text.as_bytes()).and_then(|()| file.sync_all());
        written.map_err(|error| FileError::io(&path, "write", &error))
    })
}

/// The user's folder for settings on a system, from these variables.
fn folder_from(system: &str, variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let variable = |name: &str| variable(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let home = || match system {
        "windows" => variable("APPDATA"),
        "macos" => variable("HOME").map(|home| home.join("Library").join("Application Support")),
        _ => variable("HOME").map(|home| home.join(".config")),
    };
    variable("TETREEL_CONFIG")
        .or_else(|| variable("XDG_CONFIG_HOME").or_else(home).map(|folder| folder.join("tetreel")))
}

#[cfg(test)]
#[path = "settings_tests.rs"]
mod tests;
