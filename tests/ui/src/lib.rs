//! What the tests of the player window have in common.

// rustdoc looks whether a window may change its thread, through all types of wgpu.
#![recursion_limit = "256"]
#![cfg(feature = "gui")]

pub mod desk;
#[cfg(target_os = "linux")]
pub mod screen;

/// Whether tests that need `what` must not be skipped: `TETREEL_REQUIRE` names it, or everything.
pub fn is_required(what: &str) -> bool {
    let required = std::env::var("TETREEL_REQUIRE").unwrap_or_default();
    required.split(',').any(|name| name == what || name == "all")
}
