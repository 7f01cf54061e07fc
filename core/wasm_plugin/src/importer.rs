//! `NAME.importer.wasm` as an [`Importer`].

use crate::WasmError;
use crate::call::{Limits, Plugin};
use crate::host::{Host, HostAnswer, HostRequest, serve};
use choreo_asset::Asset;
use choreo_plugin::transfer::{ImportReply, ImportRequest, to_bytes};
use choreo_plugin::{
    Claim, Files, ImportError, ImportOptions, ImportScope, Importer, Manifest, PluginFile, PluginPanic,
    Source,
};
use std::convert::Infallible;

/// An importer in WebAssembly. Each import runs in a memory of its own.
pub struct WasmImporter {
    plugin: Plugin,
    manifest: Manifest,
    has_claim: bool,
    origin: Option<PluginFile>,
    /// Limits in place of those for the size of the file.
    limits: Option<Limits>,
}

impl WasmImporter {
    /// Compiles the plugin and asks it for its manifest.
    pub fn from_bytes(bytes: &[u8]) -> Result<WasmImporter, WasmError> {
        let plugin = Plugin::compile(bytes)?;
        let manifest = plugin.call("choreo_manifest", &[], Host::default(), Limits::FOR_MANIFEST)?;
        let has_claim = plugin.exports("choreo_claim");
        Ok(WasmImporter { plugin, manifest, has_claim, origin: None, limits: None })
    }

    /// Sets the file that the plugin was read from.
    pub fn with_file(mut self, file: PluginFile) -> WasmImporter {
        self.origin = Some(file);
        self
    }

    /// Sets limits in place of those for the size of the file.
    pub fn with_limits(mut self, limits: Limits) -> WasmImporter {
        self.limits = Some(limits);
        self
    }

    fn request(source: &Source, needs: ImportScope, options: &ImportOptions) -> Vec<u8> {
        let (name, options, length) = (source.name.clone(), options.clone(), source.bytes.len());
        to_bytes(&ImportRequest { name, needs, options, length })
    }
}

impl Importer for WasmImporter {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        self.origin.as_ref()
    }

    /// A plugin whose claim fails claims nothing.
    fn claim(&self, source: &Source) -> Claim {
        self.checked_claim(source).unwrap_or(Claim::NotMine)
    }

    fn checked_claim(&self, source: &Source) -> Result<Claim, PluginPanic> {
        if !self.has_claim {
            return Ok(self.manifest.claim(source));
        }
        let request = WasmImporter::request(source, ImportScope::ALL, &ImportOptions::default());
        let limits = Limits { time: Limits::FOR_MANIFEST.time, ..Limits::for_file(source.bytes.len()) };
        let host = Host::with_file(source.bytes.clone());
        let claim = self.plugin.call("choreo_claim", &request, host, limits);
        claim.map_err(|error| PluginPanic::new(&self.manifest, &error.to_string()))
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let request = WasmImporter::request(source, needs, options);
        let limits = self.limits.unwrap_or(Limits::for_file(source.bytes.len()));
        let answer = |ask| -> Result<HostAnswer, Infallible> {
            Ok(match ask {
                HostRequest::Read(name) => HostAnswer::Bytes(files.read(&name)),
                HostRequest::Progress(part) => HostAnswer::Yes(files.progress(part)),
                HostRequest::WantsClip(index, name) => HostAnswer::Yes(files.wants_clip(index, &name)),
                _ => HostAnswer::Bytes(Err("an importer writes no files".into())),
            })
        };
        let served = serve(&self.plugin, "choreo_import", &request, source.bytes.clone(), limits, answer);
        let result = match served {
            Ok(result) => result,
            Err(never) => match never {},
        };
        match result {
            Ok(ImportReply::Asset(asset)) => Ok(*asset),
            Ok(ImportReply::Error(error)) => Err(error),
            Err(error) => Err(ImportError {
                file: source.name.clone(),
                place: String::new(),
                what: format!("the plugin {} has failed: {error}", self.manifest),
                hint: Some(
                    "this is a fault of the plugin; please report it to its author with the file".into(),
                ),
            }),
        }
    }
}
