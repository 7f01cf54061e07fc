//! `NAME.exporter.wasm` as a [`SceneExporter`].

use crate::WasmError;
use crate::call::{Limits, Plugin};
use crate::host::{Host, HostAnswer, HostRequest, serve};
use choreo_plugin::transfer::{ExportReply, ExportRequest, TransferredScene, snapshot_bytes, to_bytes};
use choreo_plugin::{ExportError, ExportedScene, Manifest, PluginFile, SceneExporter, SceneFiles};
use std::sync::Arc;

/// An exporter of scenes in WebAssembly. Each export runs in a memory of its own.
pub struct WasmExporter {
    plugin: Plugin,
    manifest: Manifest,
    origin: Option<PluginFile>,
}

impl WasmExporter {
    /// Compiles the plugin and asks it for its manifest.
    pub fn from_bytes(bytes: &[u8]) -> Result<WasmExporter, WasmError> {
        let plugin = Plugin::compile(bytes)?;
        let manifest = plugin.call("choreo_manifest", &[], Host::default(), Limits::FOR_MANIFEST)?;
        Ok(WasmExporter { plugin, manifest, origin: None })
    }

    /// Sets the file that the plugin was read from.
    pub fn with_file(mut self, file: PluginFile) -> WasmExporter {
        self.origin = Some(file);
        self
    }
}

impl SceneExporter for WasmExporter {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        let request = to_bytes(&ExportRequest { scene: TransferredScene::new(scene) });
        let limits = Limits::for_file(request.len());
        let mut evaluator = scene.evaluator();
        let answer = |ask| -> Result<HostAnswer, ExportError> {
            Ok(match ask {
                HostRequest::Snapshot(time) => {
                    HostAnswer::Bytes(Ok(Arc::new(snapshot_bytes(&evaluator.at(time)?))))
                }
                HostRequest::Beside(ending) => {
                    files.beside(&ending)?;
                    HostAnswer::Yes(true)
                }
                HostRequest::Write(ending, bytes) => {
                    let file = if ending.is_empty() { files.main() } else { files.beside(&ending)? };
                    file.write_all(&bytes)?;
                    HostAnswer::Yes(true)
                }
                _ => HostAnswer::Bytes(Err("an exporter reads no files".into())),
            })
        };
        match serve(&self.plugin, "choreo_export", &request, Arc::default(), limits, answer)? {
            Ok(ExportReply::Notes(notes)) => Ok(notes),
            Ok(ExportReply::Error(error)) => Err(ExportError::Format(error)),
            Err(error) => {
                Err(ExportError::Format(format!("the plugin {} has failed: {error}", self.manifest)))
            }
        }
    }
}
