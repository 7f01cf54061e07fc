//! Plugins in WebAssembly: `NAME.importer.wasm` and `NAME.exporter.wasm`, compiled from a crate that implements
//! `choreo_plugin::Importer` or `choreo_plugin::SceneExporter` and names it in `choreo_plugin::wasm_importer!` or `wasm_exporter!`.
//!
//! ```text
//! file's bytes ─► importer.wasm (a memory of its own; limits of time and memory) ─► bytes of an asset ─► Asset
//! ExportedScene ─► bytes ─► exporter.wasm ─► bytes of files; asks for the snapshot at a time
//! ```
//! The plugin can read its input and files beside the source, and nothing else: no clock, no randomness, no network, no other
//! file. Without the feature `engine` plugins cannot run, and every use is an error.
//!
//! | exported by the plugin | |
//! |---|---|
//! | `memory` | its memory |
//! | `choreo_abi() → u32` | [`choreo_plugin::guest::ABI`], checked before anything else is called |
//! | `choreo_argument(length) → place` | room for the argument of the next call |
//! | `choreo_manifest() → place and length` | a `Manifest`; the place is in the upper 32 bits |
//! | `choreo_claim() → place and length` | optional: of an `ImportRequest`, a `Claim` |
//! | `choreo_import() → place and length` | of an `ImportRequest`, an `ImportReply` |
//! | `choreo_export() → place and length` | of an `ExportRequest`, an `ExportReply` |
//!
//! The host functions that a plugin may call are declared in `choreo_plugin::guest`, the encoding of the bytes in
//! `choreo_plugin::transfer`.

#[cfg(feature = "engine")]
mod call;
#[cfg(feature = "engine")]
mod exporter;
#[cfg(feature = "engine")]
mod host;
#[cfg(feature = "engine")]
mod importer;

mod on_use;

#[cfg(feature = "engine")]
pub use call::Limits;
#[cfg(feature = "engine")]
pub use exporter::WasmExporter;
#[cfg(feature = "engine")]
pub use importer::WasmImporter;
pub use on_use::OnUse;

use choreo_plugin::{Importer, Manifest, PluginFile, SceneExporter};
use std::sync::Arc;
use thiserror::Error;

/// File name ending of importer plugins.
pub const IMPORTER_ENDING: &str = ".importer.wasm";

/// File name ending of exporter plugins.
pub const EXPORTER_ENDING: &str = ".exporter.wasm";

/// Why a WebAssembly plugin cannot be used. The message does not name the plugin.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct WasmError(pub String);

/// Checks that this program can run WebAssembly plugins. Error: it was built without the feature `engine`.
pub fn check() -> Result<(), WasmError> {
    match cfg!(feature = "engine") {
        true => Ok(()),
        false => Err(WasmError(NO_WEBASSEMBLY.into())),
    }
}

const NO_WEBASSEMBLY: &str =
    "this choreo was built without WebAssembly; build it with: cargo build --release --features wasm";

/// Compiles a plugin and returns its manifest.
#[cfg(feature = "engine")]
pub fn manifest(bytes: &[u8]) -> Result<Manifest, WasmError> {
    Ok(importer::WasmImporter::from_bytes(bytes)?.manifest().clone())
}

/// Compiles the importer in a plugin file.
#[cfg(feature = "engine")]
pub fn importer(file: PluginFile) -> Result<Arc<dyn Importer>, WasmError> {
    Ok(Arc::new(WasmImporter::from_bytes(&file.bytes)?.with_file(file)))
}

/// Compiles the scene exporter in a plugin file.
#[cfg(feature = "engine")]
pub fn exporter(file: PluginFile) -> Result<Arc<dyn SceneExporter>, WasmError> {
    Ok(Arc::new(WasmExporter::from_bytes(&file.bytes)?.with_file(file)))
}

/// Always an error, because this build cannot run plugins.
#[cfg(not(feature = "engine"))]
pub fn manifest(_: &[u8]) -> Result<Manifest, WasmError> {
    Err(WasmError(NO_WEBASSEMBLY.into()))
}

/// Always an error, because this build cannot run plugins.
#[cfg(not(feature = "engine"))]
pub fn importer(_: PluginFile) -> Result<Arc<dyn Importer>, WasmError> {
    Err(WasmError(NO_WEBASSEMBLY.into()))
}

/// Always an error, because this build cannot run plugins.
#[cfg(not(feature = "engine"))]
pub fn exporter(_: PluginFile) -> Result<Arc<dyn SceneExporter>, WasmError> {
    Err(WasmError(NO_WEBASSEMBLY.into()))
}
