//! All plugins known to the program.

use crate::{Effect, Exporter, Files, ImportError, ImportOptions, Importer, Needs, Source};
use choreo_stage::Asset;
use std::sync::Arc;

#[derive(Clone, Default)]
pub struct Registry {
    importers: Vec<Arc<dyn Importer>>,
    exporters: Vec<Arc<dyn Exporter>>,
    effects: Vec<Arc<dyn Effect>>,
}

impl Registry {
    pub fn add_importer(&mut self, plugin: impl Importer + 'static) {
        self.importers.push(Arc::new(plugin));
    }
    pub fn add_exporter(&mut self, plugin: impl Exporter + 'static) {
        self.exporters.push(Arc::new(plugin));
    }
    pub fn add_effect(&mut self, plugin: impl Effect + 'static) {
        self.effects.push(Arc::new(plugin));
    }
    pub fn importers(&self) -> &[Arc<dyn Importer>] {
        &self.importers
    }
    pub fn exporters(&self) -> &[Arc<dyn Exporter>] {
        &self.exporters
    }
    pub fn effects(&self) -> &[Arc<dyn Effect>] {
        &self.effects
    }
    pub fn effect(&self, name: &str) -> Option<&Arc<dyn Effect>> {
        self.effects.iter().find(|e| e.manifest().name == name)
    }

    /// The exporter for an output file name, by extension.
    pub fn exporter_for(&self, file_name: &str) -> Option<&Arc<dyn Exporter>> {
        let ext = file_name.rsplit_once('.')?.1.to_ascii_lowercase();
        self.exporters.iter().find(|e| e.manifest().extensions.contains(&ext.as_str()))
    }

    /// The importer with the highest claim (the first registered of equals), or the one named.
    pub fn importer_for(
        &self,
        source: &Source,
        named: Option<&str>,
    ) -> Result<&Arc<dyn Importer>, ImportError> {
        let error = |what: String, hint: String| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what,
            hint: Some(hint),
        };
        let names = || self.importers.iter().map(|i| i.manifest().name).collect::<Vec<_>>().join(", ");
        if let Some(named) = named {
            return self.importers.iter().find(|i| i.manifest().name == named).ok_or_else(|| {
                error(format!("unknown importer \"{named}\""), format!("known importers: {}", names()))
            });
        }
        let mut best: Option<(u8, &Arc<dyn Importer>)> = None;
        for importer in &self.importers {
            let claim = importer.claim(source);
            if claim > best.map_or(0, |(c, _)| c) {
                best = Some((claim, importer));
            }
        }
        best.map(|(_, i)| i).ok_or_else(|| {
            error(
                "no importer knows this kind of file".into(),
                format!("known importers: {}; name one with #{{ importer: … }}", names()),
            )
        })
    }

    pub fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: Needs,
        options: &ImportOptions,
        named: Option<&str>,
    ) -> Result<Asset, ImportError> {
        self.importer_for(source, named)?.import(source, files, needs, options)
    }
}
