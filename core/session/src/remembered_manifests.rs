//! Cache of the manifests of WebAssembly plugins. Every command needs the manifest of each installed plugin; the cache in the user's cache folder,
//! keyed by the hash of the plugin, avoids compiling the plugin to get it. Compiled code is not cached: anyone who can write to that folder could
//! have it executed.

use choreo_plugin::Manifest;
use choreo_plugin::guest::ABI;
use choreo_plugin::transfer::{from_bytes, to_bytes};
use choreo_wasm_plugin::WasmError;
use std::path::{Path, PathBuf};

/// Largest manifest file that is read, bytes.
const MAX_BYTES: u64 = 64 << 10;

/// The manifest of a plugin. Compiles the plugin only if the cache has no manifest for its hash. A manifest that was tampered with is detected when
/// the plugin is used.
pub(crate) fn manifest(plugin: &[u8]) -> Result<Manifest, WasmError> {
    choreo_wasm_plugin::check()?;
    let Some(folder) = folder() else { return choreo_wasm_plugin::manifest(plugin) };
    let name = PathBuf::from(format!("{}-{ABI}", blake3::hash(plugin).to_hex()));
    remembered(&folder, &name).map_or_else(
        || {
            let manifest = choreo_wasm_plugin::manifest(plugin)?;
            // If writing fails, the plugin is compiled again the next time.
            let _ = std::fs::create_dir_all(&folder);
            let _ = choreo_files::write_whole(&folder.join(name), &to_bytes(&manifest));
            Ok(manifest)
        },
        Ok,
    )
}

fn remembered(folder: &Path, name: &Path) -> Option<Manifest> {
    let bytes = choreo_files::Folder::open(folder).ok()?.read(name, MAX_BYTES).ok()?;
    from_bytes(&bytes).ok()
}

fn folder() -> Option<PathBuf> {
    Some(choreo_files::user_folder("XDG_CACHE_HOME", ".cache")?.join("choreo/plugin-manifests"))
}
