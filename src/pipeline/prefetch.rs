//! Reading ahead: blocks are loaded before the frames that need them are asked for.

use super::series::Series;
use crate::task::Cancel;
use crossbeam::channel::{Sender, bounded};
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

/// A thread that loads the expected blocks that are not in memory, in the order in which they will be needed.
pub(super) struct Prefetcher {
    /// The newest series to read ahead.
    wanted: Arc<Mutex<Option<Arc<Series>>>>,
    wake: Option<Sender<()>>,
    cancel: Cancel,
    thread: Option<JoinHandle<()>>,
}

impl Prefetcher {
    pub(super) fn start() -> io::Result<Self> {
        let (wake, woken) = bounded::<()>(1);
        let wanted: Arc<Mutex<Option<Arc<Series>>>> = Arc::default();
        let cancel = Cancel::new();
        let thread = Builder::new().name("read ahead".to_owned()).spawn({
            let (wanted, cancel) = (wanted.clone(), cancel.clone());
            move || {
                for () in woken {
                    let series = wanted.lock().unwrap_or_else(PoisonError::into_inner).take();
                    let Some(series) = series else { continue };
                    // A read error is reported by the frame that needs the block.
                    while !cancel.is_cancelled() && prefetch(&series, &cancel) {}
                }
            }
        })?;
        Ok(Self { wanted, wake: Some(wake), cancel, thread: Some(thread) })
    }

    /// The steps that will be shown, in their order.
    pub(super) fn expect(&self, series: &Arc<Series>, upcoming: &[usize]) {
        series.source.expect(upcoming);
        *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = Some(series.clone());
        if let Some(wake) = &self.wake {
            // A full channel means that the thread will look anyway.
            let _ = wake.try_send(());
        }
    }

    /// Ends the thread.
    pub(super) fn stop(&mut self) {
        self.cancel.cancel();
        self.wake = None;
        if let Some(thread) = self.thread.take() {
            // The thread returns nothing, and a panic has been reported.
            let _ = thread.join();
        }
    }
}

/// Loads one block; whether there may be more to load.
fn prefetch(series: &Series, cancel: &Cancel) -> bool {
    let _span = tracing::info_span!("read ahead").entered();
    // An unreadable block is skipped: those behind it may be readable.
    series.source.prefetch(cancel).unwrap_or(true)
}

impl Drop for Prefetcher {
    fn drop(&mut self) {
        self.stop();
    }
}
