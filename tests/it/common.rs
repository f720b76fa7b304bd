//! What the integration tests share: sample files, and skips that cannot be overlooked.
#![allow(dead_code, reason = "helpers are used by some builds only")]

use std::io::Write;
use std::path::PathBuf;

/// Says on stderr, past the test harness's capture, that a test is skipped for want of `what` (gpu, window, python,
/// ffmpeg, samples), or fails where `TETREEL_REQUIRE` names it.
pub fn skip(what: &str, why: &str) {
    let required = std::env::var("TETREEL_REQUIRE").unwrap_or_default();
    assert!(!required.split(',').any(|r| r.trim() == what), "TETREEL_REQUIRE={required}, but {what} is missing: {why}");
    let test = std::thread::current().name().unwrap_or("a test").to_owned();
    // `eprintln!` would be captured; a write to the handle is not.
    let _ = writeln!(std::io::stderr(), "SKIPPED {test}: no {what}: {why}");
}

/// The folder of real sample series: `TETREEL_SAMPLES`, or `../shared/datasets` beside the checkout.
pub fn samples() -> Option<PathBuf> {
    let dir = std::env::var_os("TETREEL_SAMPLES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/datasets"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    skip("samples", &format!("{} is not a folder", dir.display()));
    None
}
