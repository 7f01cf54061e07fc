//! A plugin file whose manifest is known from the start and which is compiled at its first use.

use crate::WasmError;
use choreo_asset::Asset;
use choreo_plugin::{
    Claim, ExportError, ExportedScene, Files, ImportError, ImportOptions, ImportScope, Importer, LazyPlugin,
    Manifest, PluginError, PluginFile, PluginPanic, SceneExporter, SceneFiles, Source,
};
use std::sync::Arc;

/// A WebAssembly plugin that is compiled at its first use.
pub struct OnUse<P: ?Sized> {
    manifest: Manifest,
    file: PluginFile,
    made: LazyPlugin<Arc<P>>,
}

impl<P: ?Sized + 'static> OnUse<P> {
    fn new(
        shown: String,
        manifest: Manifest,
        file: PluginFile,
        make: fn(PluginFile) -> Result<Arc<P>, WasmError>,
        manifest_of: fn(&P) -> &Manifest,
    ) -> OnUse<P> {
        let (known, own) = (manifest.clone(), file.clone());
        let make = move || {
            let files = vec![own.path.clone()];
            let made = make(own).and_then(|plugin| match *manifest_of(&plugin) == known {
                true => Ok(plugin),
                false => Err(WasmError("its manifest differs from the stored one".into())),
            });
            made.map_err(|e| PluginError { text: format!("{shown}: {e}"), files })
        };
        OnUse { manifest, file, made: LazyPlugin::new(make) }
    }

    /// The plugin, compiled now unless it is compiled already.
    pub fn get(&self) -> Result<&Arc<P>, &PluginError> {
        self.made.get()
    }
}

impl OnUse<dyn Importer> {
    /// The importer of a file with this manifest; `shown` is the file's name in messages.
    pub fn importer(shown: &str, manifest: Manifest, file: PluginFile) -> OnUse<dyn Importer> {
        OnUse::new(shown.into(), manifest, file, crate::importer, |plugin| plugin.manifest())
    }
}

impl OnUse<dyn SceneExporter> {
    /// The exporter of a file with this manifest; `shown` is the file's name in messages.
    pub fn exporter(shown: &str, manifest: Manifest, file: PluginFile) -> OnUse<dyn SceneExporter> {
        OnUse::new(shown.into(), manifest, file, crate::exporter, |plugin| plugin.manifest())
    }
}

impl Importer for OnUse<dyn Importer> {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        Some(&self.file)
    }

    /// The plugin is compiled and asked only about files that its manifest matches; it claims no others.
    fn claim(&self, source: &Source) -> Claim {
        self.checked_claim(source).unwrap_or(Claim::NotMine)
    }

    fn checked_claim(&self, source: &Source) -> Result<Claim, PluginPanic> {
        match self.manifest.claim(source) {
            Claim::NotMine => Ok(Claim::NotMine),
            claim => self.get().map_or(Ok(claim), |importer| importer.checked_claim(source)),
        }
    }

    fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: ImportScope,
        options: &ImportOptions,
    ) -> Result<Asset, ImportError> {
        let importer = self.get().map_err(|e| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what: e.text.clone(),
            hint: None,
        })?;
        importer.import(source, files, needs, options)
    }
}

impl SceneExporter for OnUse<dyn SceneExporter> {
    fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    fn file(&self) -> Option<&PluginFile> {
        Some(&self.file)
    }

    fn export(&self, scene: &ExportedScene, files: &mut dyn SceneFiles) -> Result<Vec<String>, ExportError> {
        self.get().map_err(|e| ExportError::Format(e.text.clone()))?.export(scene, files)
    }
}
