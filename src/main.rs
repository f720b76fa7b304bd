//! The `tetreel` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    let run = || tetreel::cli::run(tetreel::cli::Cli::of(std::env::args_os()));
    #[cfg(feature = "gpu")]
    if asks_wayland_in_vain() {
        return temp_env::with_var("NODEVICE_SELECT", Some("1"), run);
    }
    run()
}

/// Whether Mesa's device-select layer would look for a Wayland session where there is none, and libwayland report that on standard error at
/// each GPU enumeration. tetreel chooses its adapter itself (`--adapter`).
#[cfg(feature = "gpu")]
fn asks_wayland_in_vain() -> bool {
    let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !is_set("XDG_RUNTIME_DIR") && !is_set("MESA_VK_DEVICE_SELECT")
}
