//! The command line that exports the same.

use crate::export::run::{RunOptions, Target};
use crate::export::still::{Background, StillFormat};
use crate::project::Output;
use std::ffi::{OsStr, OsString};
use std::path::Path;

/// Options of `render` that write the same files as a run, whatever the project's output settings are. `file` is the path or pattern of the
/// files. What the options cannot say is `note`d.
pub(super) fn words(file: &Path, options: &RunOptions, output: &Output, note: &mut Vec<String>) -> Vec<OsString> {
    let mut words = vec!["-o".into(), file.as_os_str().to_owned()];
    let mut say = |option: &str, value: String| words.extend([format!("--{option}").into(), OsString::from(value)]);
    let RunOptions { times, size_px: (width, height), .. } = options;
    let still = StillFormat::of(&options.target.path(0)).filter(|_| matches!(options.target, Target::Images(_)));
    say("size", format!("{width}x{height}"));
    say("steps", times.steps.to_string());
    if let Some((from, to)) = times.range {
        let end = |time: f64| if time.is_finite() { time.to_string() } else { String::new() };
        say("times", format!("{}..{}", end(from), end(to)));
    } else if output.times.is_some() {
        say("times", "..".to_owned());
    }
    if let Some(duration) = times.duration_s {
        say("duration", duration.to_string());
    }
    if still.is_none() || times.duration_s.is_some() {
        say("fps", times.rate().to_string());
    }
    if times.turntable_deg.is_some() || output.turntable.is_some() {
        say("turntable", times.turntable_deg.unwrap_or_default().to_string());
    }
    if still != Some(StillFormat::Exr) {
        say("background", color_word(options.background));
    }
    if options.annotations.is_some() || output.annotate.is_some() {
        say("annotate", options.annotations.clone().unwrap_or_default().to_string());
    }
    if still.is_some() && (options.bit_depth.is_some() || output.bit_depth.is_some()) {
        let usual = if still == Some(StillFormat::Exr) { "32" } else { "8" };
        say("bit-depth", options.bit_depth.clone().unwrap_or_else(|| usual.to_owned()));
    }
    if still == Some(StillFormat::Exr) {
        if options.exr.is_some() || output.exr.is_some() {
            say("exr", options.exr.unwrap_or_default().name().to_owned());
        }
        if options.exr_compression.is_some() || output.exr_compression.is_some() {
            say("exr-compression", options.exr_compression.unwrap_or_default().to_string());
        }
    }
    if output.rays.is_some() {
        say("rays", "exact".to_owned());
    }
    let of_scale = [output.image_scale.is_some(), output.upsample.is_some(), output.kernel.is_some()];
    if of_scale.contains(&true) || output.sigma_depth.is_some() || output.layers.is_some() {
        say("image-scale", "1".to_owned());
    }
    let interpolates = output.interpolate == Some(true);
    if times.interpolate {
        words.push("--interpolate".into());
    } else if interpolates && times.duration_s.is_some() {
        note.push("interpolate = true has no opposite option: leave it out of the project's [output]".to_owned());
    }
    if options.resume {
        words.push("--resume".into());
    }
    words
}

/// A colour as `--background` takes it.
fn color_word(background: Background) -> String {
    background.color().map_or_else(
        || "none".to_owned(),
        |rgb| {
            let [r, g, b] = rgb.map(|c| (255.0 * c).round() as u8);
            format!("#{r:02x}{g:02x}{b:02x}")
        },
    )
}

/// Words as a line for a shell.
pub(super) fn line(words: &[OsString]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// A word in single quotes, unless it needs none.
fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+%@".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.into_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_a_shell_would_take_apart_are_quoted() {
        let words = ["a", "/b/c_%04d.png", "#ffffff", "pos=1,2,3 up=0,0,1", "it's", ""].map(OsString::from);
        assert_eq!(line(&words), r"a /b/c_%04d.png '#ffffff' 'pos=1,2,3 up=0,0,1' 'it'\''s' ''");
    }
}
