//! Assets shared between runs: a file that two hundred sections load is read anew by each, but imported once.

use choreo_asset::Asset;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Assets by what they were made of. Clones share one store. An entry is used while the bytes of its file, and of all that the
/// importer requested beside it, are the same, and is replaced when they are not.
#[derive(Clone, Debug, Default)]
pub struct AssetCache(Arc<Store>);

#[derive(Debug, Default)]
struct Store {
    slots: Mutex<BTreeMap<Key, Slot>>,
    imports: AtomicU64,
}

/// Locked while its asset is made.
pub(crate) type Slot = Arc<Mutex<Option<Made>>>;

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// Canonical, or a built-in name.
    pub path: PathBuf,
    pub name: String,
    pub importer: String,
    pub options: String,
    pub needs: String,
}

#[derive(Debug)]
pub(crate) struct Made {
    /// BLAKE3 of the file.
    pub source: [u8; 32],
    pub side_files: Vec<SideFile>,
    pub asset: Arc<Asset>,
}

/// A file beside the source, by the name that the importer used.
#[derive(Debug)]
pub(crate) struct SideFile {
    pub name: String,
    /// `None`: it could not be read.
    pub content: Option<[u8; 32]>,
}

impl AssetCache {
    pub(crate) fn slot(&self, key: Key) -> Slot {
        self.0.slots.lock().unwrap_or_else(PoisonError::into_inner).entry(key).or_default().clone()
    }

    /// The slot of an earlier request.
    pub(crate) fn made(&self, key: &Key) -> Option<Slot> {
        self.0.slots.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned()
    }

    pub(crate) fn count_import(&self) {
        self.0.imports.fetch_add(1, Ordering::Relaxed);
    }

    /// How many assets were imported into it so far.
    pub fn imports(&self) -> u64 {
        self.0.imports.load(Ordering::Relaxed)
    }

    /// Drops the assets that nothing else holds, for callers that run a changing script again and again.
    pub fn drop_unused(&self) {
        let mut slots = self.0.slots.lock().unwrap_or_else(PoisonError::into_inner);
        slots.retain(|_, slot| match slot.try_lock() {
            Ok(made) => made.as_ref().is_some_and(|made| Arc::strong_count(&made.asset) > 1),
            // Being made.
            Err(_) => true,
        });
    }
}

/// The same store.
impl PartialEq for AssetCache {
    fn eq(&self, other: &AssetCache) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
