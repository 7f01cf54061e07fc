//! Context of a request about a position in a script: the text, its types, the project and its files.

use crate::Project;
use crate::context::CallSite;
use crate::document::Document;
use crate::files::{self, Contents, Files};
use crate::source::Source;
use crate::values::{Budget, Modules, Types};
use choreo_plugin::OptionSpec;
use choreo_script::{BUILT_IN, Folders};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

pub(crate) struct View<'v> {
    pub source: &'v Source,
    pub project: &'v Project,
    /// Folder of the script.
    pub folder: Option<&'v Path>,
    /// Folder that a script with tests may read completely.
    pub tests_root: Option<&'v Path>,
    pub files: &'v RefCell<Files>,
    pub modules: &'v dyn Modules,
    pub budget: Budget,
    /// Frame rate of the stage in frames per second.
    pub fps: f64,
    /// Whether the client supports snippets with placeholders.
    pub snippets: bool,
}

impl View<'_> {
    /// The same context for another text.
    pub(crate) fn with_source<'s>(&'s self, source: &'s Source) -> View<'s> {
        let View { project, folder, tests_root, files, modules, fps, snippets, .. } = *self;
        View { source, project, folder, tests_root, files, modules, budget: Budget::default(), fps, snippets }
    }

    pub(crate) fn types(&self) -> Types<'_> {
        Types::new(self.source, self.modules, &self.budget)
    }

    /// Contents of a file, if the script has a folder.
    pub(crate) fn contents(&self, name: &str) -> Option<Contents> {
        Some(self.files.borrow_mut().contents(self.project, self.folder?, self.tests_root, name))
    }

    /// Names of files that the script may read.
    pub(crate) fn files_named(&self, extensions: &[String]) -> Vec<String> {
        self.folder.map(|folder| files::find_files(self.project, folder, extensions)).unwrap_or_default()
    }

    /// Whether a file was written by `choreo export`.
    pub(crate) fn is_exported(&self, name: &str) -> bool {
        self.folder.is_some_and(|folder| files::is_exported(self.project, folder, name))
    }

    /// Extensions of the files that the importers read.
    pub(crate) fn model_extensions(&self) -> Vec<String> {
        let importers = self.project.registry.importers().iter();
        importers.flat_map(|importer| importer.manifest().extensions.clone()).collect()
    }

    /// File of the first argument whose value comes from a file.
    pub(crate) fn file_of_arguments(&self, site: &CallSite) -> Option<String> {
        let arguments = self.source.arguments(site.open).into_iter();
        arguments.map(|argument| self.types().value(argument)).find_map(|value| value.file)
    }

    /// Options of the plugin that a call uses: the parameters of an effect, or the options of a file's importer.
    pub(crate) fn plugin_options(&self, site: &CallSite) -> Vec<OptionSpec> {
        let registry = &self.project.registry;
        let name = self.source.get(site.name);
        let of_effect = |effect: &str| match registry.use_effect(effect) {
            Ok(Some(effect)) => effect.manifest().options.clone(),
            _ => Vec::new(),
        };
        match &site.receiver {
            Some(on) if on.kind == "Effect" && matches!(name, "set" | "key") => {
                on.name.as_deref().map(of_effect).unwrap_or_default()
            }
            None if name == "effect" => {
                site.first_argument_text(self.source).as_deref().map(of_effect).unwrap_or_default()
            }
            None if name == "load" => {
                let Some(file) = site.first_argument_text(self.source) else { return Vec::new() };
                let extension = file.rsplit('.').next().unwrap_or_default().to_lowercase();
                let built_in = file.strip_prefix(BUILT_IN);
                let importer = registry.importers().iter().find(|importer| {
                    let manifest = importer.manifest();
                    built_in.map_or_else(
                        || manifest.extensions.contains(&extension),
                        |name| manifest.name == name,
                    )
                });
                importer.map(|importer| importer.manifest().options.clone()).unwrap_or_default()
            }
            _ => Vec::new(),
        }
    }
}

/// Modules of a script: the text in the editor if they are open, else the text of their files.
pub(crate) struct OpenModules<'m> {
    pub documents: &'m BTreeMap<String, Document>,
    pub folder: Option<&'m Path>,
    /// Folder that a script with tests may read completely.
    pub tests_root: Option<&'m Path>,
    pub cache: &'m RefCell<ModuleFiles>,
}

/// Modules that were read from files, with their modification times.
pub(crate) type ModuleFiles = BTreeMap<PathBuf, (Option<SystemTime>, Arc<Source>)>;

impl Modules for OpenModules<'_> {
    /// Path of a module. Only the folder of the script and the root of tests are searched, not the search paths of the project.
    fn path(&self, name: &str) -> Option<PathBuf> {
        /// Largest script in bytes.
        const MAX_SCRIPT_BYTES: u64 = 4 << 20;
        let name = if name.ends_with(".rhai") { name.to_string() } else { format!("{name}.rhai") };
        let mut folders = Folders::new(self.folder?, &[], MAX_SCRIPT_BYTES).ok()?;
        if let Some(root) = self.tests_root {
            folders = folders.with_root(root).ok()?;
        }
        folders.find(None, &name).ok().map(|found| found.path)
    }

    fn module(&self, name: &str) -> Option<Arc<Source>> {
        let path = self.path(name)?;
        if let Some(open) = self.documents.values().find(|document| document.path.as_ref() == Some(&path)) {
            return Some(open.source.clone());
        }
        let changed = std::fs::metadata(&path).ok().and_then(|data| data.modified().ok());
        if let Some((_, known)) = self.cache.borrow().get(&path).filter(|(at, _)| *at == changed) {
            return Some(known.clone());
        }
        let source = Arc::new(Source::new(&std::fs::read_to_string(&path).ok()?));
        self.cache.borrow_mut().insert(path, (changed, source.clone()));
        Some(source)
    }
}
