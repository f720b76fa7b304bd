//! Commands that take a store also take a SOURCE, which is imported to a cache first.

use super::progress::Terminal;
pub(super) use crate::files::name_of;
use crate::ingest::{CacheEvent, ImportCache, Origin};
use crate::store::Store;
use std::path::Path;

/// Opens a store, or imports a foreign file to the cache ([`ImportCache`]) and opens that.
pub(super) fn open(path: &Path, terminal: &Terminal) -> anyhow::Result<Store> {
    let mut announce = |event: CacheEvent<'_>| match event {
        CacheEvent::Waiting(cached) => {
            terminal.say(&format!("waiting for another import of {} to {}", path.display(), cached.display()));
        }
        CacheEvent::Importing(cached) => {
            terminal.say(&format!("importing {} to {}", path.display(), cached.display()));
        }
        CacheEvent::Read(_) => {}
    };
    let cache = ImportCache::of_user();
    let (store, origin) = cache.open_or_import(&[path.to_owned()], &mut announce, terminal, &terminal.cancel)?;
    match origin {
        Origin::Store => {}
        Origin::Cached => {
            terminal.detail(&format!("{}: imported before to {}", path.display(), store.path().display()));
        }
        Origin::Imported(report) => terminal.detail(&report.to_string()),
    }
    Ok(store)
}
