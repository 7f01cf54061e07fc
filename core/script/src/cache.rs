//! Cache of assets shared between runs: two hundred test sections may read the same file, but it is imported once.

use choreo_asset::Asset;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

/// Cache of imported assets. Clones share one store. An entry is reused while its file and all files that the importer requested
/// have the same bytes, and is replaced otherwise.
#[derive(Clone, Debug, Default)]
pub struct AssetCache(Arc<Store>);

#[derive(Debug, Default)]
struct Store {
    slots: Mutex<BTreeMap<CacheKey, Slot>>,
    imports: AtomicU64,
    /// Assets whose files count as unchanged while size and modification time are the same; `None`: every file is read each time.
    stamped: Option<Mutex<BTreeMap<(PathBuf, String), StampedAsset>>>,
}

/// An asset, and the files that it was made of with their stamps and hashes.
#[derive(Clone, Debug)]
pub(crate) struct StampedAsset {
    pub files: Vec<(PathBuf, FileStamp, [u8; 32])>,
    pub asset: Arc<Asset>,
}

/// Size and modification time of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FileStamp {
    size: u64,
    modified: SystemTime,
}

impl FileStamp {
    pub(crate) fn of(path: &Path) -> Option<FileStamp> {
        let data = std::fs::metadata(path).ok()?;
        Some(FileStamp { size: data.len(), modified: data.modified().ok()? })
    }
}

/// An entry of the cache, locked while its asset is made.
pub(crate) type Slot = Arc<Mutex<Option<CachedImport>>>;

/// Everything except file contents that determines an imported asset.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CacheKey {
    /// Canonical path, or the name of a built-in asset.
    pub path: PathBuf,
    /// The name by which the file is loaded, which the asset contains.
    pub name: String,
    pub importer: String,
    pub options: String,
    /// The requested parts of the file (`ImportScope`) as text.
    pub requested_parts: String,
}

/// A cached asset, and the hashes of the files that it was made of.
#[derive(Debug)]
pub(crate) struct CachedImport {
    /// BLAKE3 hash of the file.
    pub source: [u8; 32],
    pub side_files: Vec<SideFile>,
    pub asset: Arc<Asset>,
}

/// A file beside the source, by the name that the importer used.
#[derive(Debug)]
pub(crate) struct SideFile {
    pub name: String,
    /// BLAKE3 hash of the file; `None`: it could not be read.
    pub content: Option<[u8; 32]>,
}

impl AssetCache {
    /// A cache that compares files by size and modification time instead of content, for editors, which check a script after
    /// every keystroke.
    pub fn comparing_file_times() -> AssetCache {
        AssetCache(Arc::new(Store { stamped: Some(Mutex::default()), ..Store::default() }))
    }

    /// The asset of an earlier request, if size and modification time of its files are unchanged.
    pub(crate) fn unchanged_asset(&self, key: &(PathBuf, String)) -> Option<StampedAsset> {
        let stamped = self.0.stamped.as_ref()?.lock().unwrap_or_else(PoisonError::into_inner);
        let known = stamped.get(key)?.clone();
        known.files.iter().all(|(path, stamp, _)| FileStamp::of(path) == Some(*stamp)).then_some(known)
    }

    /// Whether the cache compares files by size and modification time.
    pub(crate) fn compares_file_times(&self) -> bool {
        self.0.stamped.is_some()
    }

    /// Stores an asset with the stamps of its files. Does nothing in a cache that compares content.
    pub(crate) fn insert_stamped(&self, key: (PathBuf, String), made: StampedAsset) {
        if let Some(stamped) = &self.0.stamped {
            stamped.lock().unwrap_or_else(PoisonError::into_inner).insert(key, made);
        }
    }

    /// The slot of a request, made if there is none yet.
    pub(crate) fn slot(&self, key: CacheKey) -> Slot {
        self.0.slots.lock().unwrap_or_else(PoisonError::into_inner).entry(key).or_default().clone()
    }

    /// The slot of an earlier request.
    pub(crate) fn existing_slot(&self, key: &CacheKey) -> Option<Slot> {
        self.0.slots.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned()
    }

    pub(crate) fn count_import(&self) {
        self.0.imports.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of imports so far.
    pub fn imports(&self) -> u64 {
        self.0.imports.load(Ordering::Relaxed)
    }

    /// Drops assets that nothing outside the cache holds, for callers that run an edited script again and again.
    pub fn drop_unused(&self) {
        if let Some(stamped) = &self.0.stamped {
            // One reference is held here and one by the slot.
            let is_used = |made: &StampedAsset| Arc::strong_count(&made.asset) > 2;
            stamped.lock().unwrap_or_else(PoisonError::into_inner).retain(|_, made| is_used(made));
        }
        let mut slots = self.0.slots.lock().unwrap_or_else(PoisonError::into_inner);
        slots.retain(|_, slot| match slot.try_lock() {
            Ok(made) => made.as_ref().is_some_and(|made| Arc::strong_count(&made.asset) > 1),
            // The asset is being made.
            Err(_) => true,
        });
    }
}

/// Caches are equal if they share one store.
impl PartialEq for AssetCache {
    fn eq(&self, other: &AssetCache) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
