//! All plugins known to the program.

use crate::suggest::{did_you_mean, list};
use crate::{Claim, Effect, Exporter, Files, ImportError, ImportOptions, Importer, Needs, Source};
use choreo_stage::Asset;
use std::sync::Arc;

#[derive(Clone, Default)]
pub struct Registry {
    importers: Vec<Arc<dyn Importer>>,
    exporters: Vec<Arc<dyn Exporter>>,
    effects: Vec<Arc<dyn Effect>>,
}

impl Registry {
    /// One of the same name is replaced, here and below: a plugin of the user's own comes in place of ours.
    pub fn add_importer(&mut self, plugin: impl Importer + 'static) {
        self.importers.retain(|p| p.manifest().name != plugin.manifest().name);
        self.importers.push(Arc::new(plugin));
    }
    pub fn add_exporter(&mut self, plugin: impl Exporter + 'static) {
        self.exporters.retain(|p| p.manifest().name != plugin.manifest().name);
        self.exporters.push(Arc::new(plugin));
    }
    pub fn add_effect(&mut self, plugin: impl Effect + 'static) {
        self.effects.retain(|p| p.manifest().name != plugin.manifest().name);
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
        self.exporters.iter().find(|e| e.manifest().has_extension(&ext))
    }

    /// What every importer says of a file, the one that reads it first. Greater claims come first; of equal ones those
    /// whose manifest has the file's extension; then those added later, so that a user's own plugin wins over ours.
    pub fn claims(&self, source: &Source) -> Vec<(Claim, &Arc<dyn Importer>)> {
        let extension = source.extension();
        let mut claims: Vec<_> = self.importers.iter().map(|i| (i.claim(source), i)).rev().collect();
        claims.sort_by_key(|(claim, i)| std::cmp::Reverse((*claim, i.manifest().has_extension(&extension))));
        claims
    }

    /// The importer that reads the file ([`Registry::claims`]), or the one named.
    pub fn importer_for(
        &self,
        source: &Source,
        named: Option<&str>,
    ) -> Result<&Arc<dyn Importer>, ImportError> {
        let names = || self.importers.iter().map(|i| i.manifest().name.as_str());
        let error = |what: String, hint: String| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what,
            hint: Some(hint),
        };
        if let Some(named) = named {
            return self.importers.iter().rfind(|i| i.manifest().name == named).ok_or_else(|| {
                let what = format!("unknown importer \"{named}\"{}", did_you_mean(named, names()));
                error(what, format!("importers: {}", list(names(), 30)))
            });
        }
        match self.claims(source).first() {
            Some((claim, importer)) if *claim > Claim::NotMine => Ok(importer),
            _ => Err(error(
                "no importer knows this kind of file".into(),
                format!("known importers: {}; name one with #{{ importer: … }}", list(names(), 30)),
            )),
        }
    }

    /// Imports with the importer of the file or the one named; options are checked and completed.
    pub fn import(
        &self,
        source: &Source,
        files: &dyn Files,
        needs: Needs,
        options: &ImportOptions,
        named: Option<&str>,
    ) -> Result<Asset, ImportError> {
        let importer = self.importer_for(source, named)?;
        let options = importer.manifest().complete(options).map_err(|e| ImportError {
            file: source.name.clone(),
            place: String::new(),
            what: e.message,
            hint: e.hint,
        })?;
        importer.import(source, files, needs, &options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Manifest;

    struct Says(Manifest, Claim);

    impl Importer for Says {
        fn manifest(&self) -> &Manifest {
            &self.0
        }
        fn claim(&self, _: &Source) -> Claim {
            self.1
        }
        fn import(
            &self,
            _: &Source,
            _: &dyn Files,
            _: Needs,
            _: &ImportOptions,
        ) -> Result<Asset, ImportError> {
            Ok(Asset::default())
        }
    }

    fn order(importers: &[(&str, &str, Claim)]) -> Vec<String> {
        let mut registry = Registry::default();
        for (name, extension, claim) in importers {
            registry.add_importer(Says(Manifest::new(name, "1", "").extensions([*extension]), *claim));
        }
        let source = Source { name: "a.dat".into(), bytes: Arc::default() };
        registry.claims(&source).iter().map(|(_, i)| i.manifest().name.clone()).collect()
    }

    #[test]
    fn content_counts_more_than_the_name_and_more_certain_more_than_less() {
        let all = [
            ("no", "dat", Claim::NotMine),
            ("named", "dat", Claim::Extension),
            ("likely", "x", Claim::Content(50)),
            ("sure", "x", Claim::Content(95)),
        ];
        assert_eq!(order(&all), ["sure", "likely", "named", "no"]);
    }

    #[test]
    fn equal_claims_are_settled_by_extension_then_by_who_came_last() {
        let c = Claim::Content(90);
        assert_eq!(order(&[("a", "dat", c), ("b", "x", c)]), ["a", "b"]);
        assert_eq!(order(&[("a", "x", c), ("b", "dat", c)]), ["b", "a"]);
        assert_eq!(order(&[("ours", "dat", c), ("yours", "dat", c)]), ["yours", "ours"]);
    }

    #[test]
    fn nobody_reads_what_nobody_claims() {
        let mut registry = Registry::default();
        registry.add_importer(Says(Manifest::new("gltf", "1", ""), Claim::NotMine));
        let source = Source { name: "a.dat".into(), bytes: Arc::default() };
        let error = |named| registry.importer_for(&source, named).err().unwrap();
        assert_eq!(error(None).to_string(), "a.dat: no importer knows this kind of file");
        assert_eq!(
            error(Some("glft")).to_string(),
            "a.dat: unknown importer \"glft\"; did you mean \"gltf\"?"
        );
        assert!(registry.importer_for(&source, Some("gltf")).is_ok());
    }
}
