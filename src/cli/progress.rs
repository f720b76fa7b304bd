//! Progress bars and messages on stderr, and interruption by Ctrl-C.

use super::Interrupted;
use crate::task::{Cancel, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::{Mutex, PoisonError};

/// Terminal of a command: bars and messages on stderr, and the flag that Ctrl-C raises.
pub(super) struct Terminal {
    quiet: bool,
    verbose: bool,
    bar: Mutex<Option<ProgressBar>>,
    /// Raised by Ctrl-C; checked between two units of work.
    pub(super) cancel: Cancel,
}

impl Terminal {
    /// Installs the Ctrl-C handler: the first one raises the flag, so that temporary files are removed.
    pub(super) fn new(quiet: bool, verbose: bool) -> Self {
        let cancel = Cancel::new();
        let flag = cancel.clone();
        // Without a handler Ctrl-C leaves temporary files: reported, but not fatal. A second Ctrl-C ends the process at once.
        let on_signal = move || {
            if flag.is_cancelled() {
                std::process::exit(i32::from(super::EXIT_INTERRUPTED));
            }
            flag.cancel();
        };
        if let Err(error) = ctrlc::set_handler(on_signal) {
            eprintln!("warning: Ctrl-C will not clean up: {error}");
        }
        Self { quiet, verbose, bar: Mutex::new(None), cancel }
    }

    /// A terminal that says nothing and is not interrupted.
    #[cfg(test)]
    pub(super) fn silent() -> Self {
        Self { quiet: true, verbose: false, bar: Mutex::new(None), cancel: Cancel::new() }
    }

    /// Prints a line, unless `--quiet`.
    pub(super) fn say(&self, line: &str) {
        if !self.quiet {
            self.above_bar(line);
        }
    }

    /// Prints a line with `--verbose`.
    pub(super) fn detail(&self, line: &str) {
        if self.verbose {
            self.above_bar(line);
        }
    }

    fn above_bar(&self, line: &str) {
        match &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(bar) => bar.suspend(|| eprintln!("{line}")),
            None => eprintln!("{line}"),
        }
    }

    /// Fails if Ctrl-C was pressed.
    pub(super) fn check_interrupted(&self) -> Result<(), Interrupted> {
        if self.cancel.is_cancelled() { Err(Interrupted) } else { Ok(()) }
    }
}

impl Progress for Terminal {
    fn begin(&self, stage: &str, total: u64, unit: &str) {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let template = format!("{{msg}} [{{bar:30}}] {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::with_draw_target(Some(total), target).with_style(style.progress_chars("=> "));
        bar.set_message(stage.to_owned());
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
    }

    fn advance(&self, n: u64) {
        if let Some(bar) = &*self.bar.lock().unwrap_or_else(PoisonError::into_inner) {
            bar.inc(n);
        }
    }

    fn end(&self) {
        if let Some(bar) = self.bar.lock().unwrap_or_else(PoisonError::into_inner).take() {
            bar.finish_and_clear();
        }
    }

    fn say(&self, line: &str) {
        Terminal::say(self, line);
    }
}
