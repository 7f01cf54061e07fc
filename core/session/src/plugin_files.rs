//! Plugins that are files: `NAME.importer.rhai` and `NAME.exporter.rhai`, both also as `.wasm`, and `NAME.wgsl`. They are searched in the folder of
//! the script and its subfolder `plugins`, in the folders given with `--plugins`, and in the folders of the environment variable CHOREO_PLUGINS or,
//! if it is not set, in the user's plugin folder ([`user_folder`]). No other folder is read. All of these but the script's own folder can also hold
//! packages: folders with a `plugin.toml`. The script's folder may contain WGSL of any kind, so only files that begin like an effect count as
//! plugins there.

use crate::package::{
    DESCRIPTION, FILE_ENDINGS, MAX_DESCRIPTION_BYTES, Package, PackagedKind, PackagedPlugin,
};
use crate::remembered_manifests;
use choreo_files::{FileError, Folder, containing_folder};
use choreo_importer_kit::images::{Encoded, Formats};
use choreo_plugin::{
    BesideFile, Effect, Importer, LazyEffect, Manifest, PluginError, PluginFile, Registry, SceneExporter,
};
use choreo_rhai_importer::{EXPORTER_ENDING, LazyImporter, RhaiExporter, RhaiImporter, ScriptError};
use choreo_wasm_plugin::OnUse;
use choreo_wgsl_effect::{TextureImage, WgslEffect};
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use thiserror::Error;

/// Environment variable with a list of folders, separated like those in PATH.
pub(crate) const FOLDERS_VARIABLE: &str = "CHOREO_PLUGINS";
/// Plugin folder next to a script.
const PLUGINS_SUBFOLDER: &str = "plugins";

/// Limits: bytes of a plugin's text, bytes of a WebAssembly plugin, and number of files in one folder.
const MAX_BYTES: u64 = 4 << 20;
const MAX_WASM_BYTES: u64 = 64 << 20;
const MAX_FILES: usize = 10_000;
/// Number of bytes of an effect's text that are searched for its name.
const EFFECT_HEAD_BYTES: u64 = 64 << 10;
/// Largest file that a plugin reads, bytes.
const MAX_TEXTURE_BYTES: u64 = 32 << 20;

/// A plugin folder that cannot be used at all.
#[derive(Debug, Error)]
pub enum FolderError {
    #[error("{flag} {}: no such folder", folder.display())]
    Missing { flag: &'static str, folder: PathBuf },
    #[error("{}: cannot read: {error}", folder.display())]
    Unreadable { folder: PathBuf, error: FileError },
    #[error(
        "{}: it is a symbolic link that leads out of the script's folder; to use the plugins there, name their folder with --plugins",
        folder.display()
    )]
    Link { folder: PathBuf },
}

/// The plugin files that were found. Only the name of an effect and the manifest of an importer are read; the rest is read and compiled on first
/// use.
pub struct Listing {
    /// The given plugins and those of the files. Later folders override earlier ones, in this order: the user's folder or those of CHOREO_PLUGINS,
    /// the named folders, then the inputs' own folders and the `plugins` folders in them. Packages of a folder come after its files.
    pub registry: Registry,
    entries: Vec<Entry>,
    /// All folders that are searched for plugin files; the `plugins` folder of an input need not exist.
    pub folders: Vec<PathBuf>,
    /// One sentence for each plugin file whose plugin replaced another one of the same name.
    pub replacement_notes: Vec<String>,
    /// Number of compiled plugin files, including those of earlier listings.
    compiled: Arc<AtomicU64>,
}

/// One plugin file.
struct Entry {
    source: Source,
    plugin: Plugin,
    /// Result of reading the file; set when the plugin is compiled.
    read_result: Arc<OnceLock<Result<PluginFile, ReadError>>>,
}

/// Error of a plugin file, with the name of the file.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{0}")]
struct ReadError(String);

#[derive(Clone)]
enum Plugin {
    Effect(Arc<LazyEffect>),
    Importer(Arc<LazyImporter>),
    WasmImporter(Arc<OnUse<dyn Importer>>),
    WasmExporter(Arc<OnUse<dyn SceneExporter>>),
    /// Compiled when it is found: only `choreo export` and `choreo plugins` list exporters, and their text is short.
    Exporter(Arc<RhaiExporter>),
    /// A file whose plugin cannot be loaded and has no name to be used by; the text says why.
    Faulty(String),
}

/// Location of a plugin file.
#[derive(Clone)]
struct Source {
    /// Symbolic links must stay within this folder.
    folder: Arc<Folder>,
    /// Relative to the folder.
    name: PathBuf,
    /// Path in messages.
    display_path: String,
    /// Canonical path, except for broken links.
    path: PathBuf,
    /// The package's entry for the file and the version of the package, or the reason why `plugin.toml` is refused. `None` outside packages.
    package_entry: Option<Result<(PackagedPlugin, String), ReadError>>,
}

/// A folder that is searched for plugin files.
struct PluginFolder {
    /// Path as the user wrote it. Symbolic links must stay within this folder.
    root: PathBuf,
    /// The searched folder, relative to `root`.
    subfolder: PathBuf,
    kind: FolderKind,
}

impl PluginFolder {
    fn new(root: &Path, subfolder: impl Into<PathBuf>, kind: FolderKind) -> PluginFolder {
        PluginFolder { root: root.to_path_buf(), subfolder: subfolder.into(), kind }
    }

    /// Path of the searched folder, as the user wrote it.
    fn path(&self) -> PathBuf {
        match self.subfolder.as_os_str().is_empty() {
            true => self.root.clone(),
            false => self.root.join(&self.subfolder),
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum FolderKind {
    Named,
    /// The folder of an input, which may contain other WGSL files.
    Own,
    /// The folder `plugins` in the folder of an input.
    Beside,
    /// A package: only files that its description lists are plugins.
    Package,
}

/// Finds the plugin files, in order of increasing priority. `earlier`: an earlier listing, whose compiled plugins are reused if their files have not
/// changed.
pub fn list_plugin_files(
    plugins: &Registry,
    named: &[PathBuf],
    inputs: &[&Path],
    earlier: Option<&Listing>,
) -> Result<Listing, FolderError> {
    list_folders(plugins, folders_to_search(named, inputs)?, earlier)
}

/// Lists the plugins of one package, whose folder has a description, in addition to the given ones.
pub fn list_package(plugins: &Registry, folder: &Path) -> Result<Listing, FolderError> {
    list_folders(plugins, vec![PluginFolder::new(folder, "", FolderKind::Package)], None)
}

fn list_folders(
    plugins: &Registry,
    places: Vec<PluginFolder>,
    earlier: Option<&Listing>,
) -> Result<Listing, FolderError> {
    let mut listing = Listing {
        registry: plugins.clone(),
        entries: Vec::new(),
        folders: Vec::new(),
        replacement_notes: Vec::new(),
        compiled: earlier.map(|b| b.compiled.clone()).unwrap_or_default(),
    };
    for place in places.iter().filter(|p| p.path().is_dir()) {
        for source in sources_in(place)? {
            let shown = source.display_path.clone();
            match listing.make_entry(source, place.kind, earlier) {
                Some(entry) => listing.add(entry),
                None => listing.registry.add_faulty(shown, "it has no line // effect: NAME"),
            }
        }
    }
    listing.folders = places.iter().map(PluginFolder::path).collect();
    Ok(listing)
}

/// The folder that packages are installed in: the first one in CHOREO_PLUGINS, else one in the user's data folder. `None` if the system has no data
/// folder, or if CHOREO_PLUGINS is empty.
pub fn user_folder() -> Option<PathBuf> {
    user_folders().into_iter().next().map(|(folder, _)| folder)
}

/// Folders of plugin files and packages that are searched for every input: the existing folders of the user, then the named ones.
pub fn named_folders(named: &[PathBuf]) -> Vec<PathBuf> {
    let users = user_folders().into_iter().map(|(folder, _)| folder).filter(|folder| folder.is_dir());
    users.chain(named.iter().cloned()).collect()
}

/// The folders that the environment gives, and whether each must exist.
fn user_folders() -> Vec<(PathBuf, bool)> {
    if let Some(variable) = std::env::var_os(FOLDERS_VARIABLE) {
        let folders = std::env::split_paths(&variable).filter(|f| !f.as_os_str().is_empty());
        return folders.map(|folder| (folder, true)).collect();
    }
    let data = choreo_files::user_folder("XDG_DATA_HOME", ".local/share");
    data.map(|data| (data.join("choreo/plugins"), false)).into_iter().collect()
}

/// Names of the packages in a folder, sorted. Folders that begin with a dot are skipped, since an unfinished installation is in such a folder.
pub fn packages_in(folder: &Path) -> Vec<PathBuf> {
    let Ok(open) = Folder::open(folder) else { return Vec::new() };
    let names = open.names(MAX_FILES).unwrap_or_default();
    let is_package = |name: &PathBuf| {
        !name.to_string_lossy().starts_with('.') && open.metadata(&name.join(DESCRIPTION)).is_some()
    };
    names.into_iter().map(PathBuf::from).filter(is_package).collect()
}

/// The folders to search in order of increasing priority, each once.
fn folders_to_search(named: &[PathBuf], inputs: &[&Path]) -> Result<Vec<PluginFolder>, FolderError> {
    let mut places: Vec<PluginFolder> = Vec::new();
    let users = user_folders().into_iter().map(|(folder, must_exist)| (folder, FOLDERS_VARIABLE, must_exist));
    for (folder, flag, must_exist) in users.chain(named.iter().map(|f| (f.clone(), "--plugins", true))) {
        match folder.is_dir() {
            true => {}
            false if must_exist => return Err(FolderError::Missing { flag, folder }),
            // The folder need not exist if no plugins are installed, and its parent is not watched.
            false => continue,
        }
        places.push(PluginFolder::new(&folder, "", FolderKind::Named));
        let package = |name| PluginFolder::new(&folder, name, FolderKind::Package);
        places.extend(packages_in(&folder).into_iter().map(package));
    }
    for input in inputs {
        let folder = if input.is_dir() { input } else { input.parent().unwrap_or(Path::new("")) };
        let own = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for (subfolder, kind) in [("", FolderKind::Own), (PLUGINS_SUBFOLDER, FolderKind::Beside)] {
            let place = match kind {
                FolderKind::Own => PluginFolder::new(own, subfolder, kind),
                _ => PluginFolder::new(folder, subfolder, kind),
            };
            if !places.iter().any(|known| is_same_folder(&known.path(), &place.path())) {
                places.push(place);
            }
        }
        let beside = folder.join(PLUGINS_SUBFOLDER);
        for package in packages_in(&beside) {
            let place =
                PluginFolder::new(folder, Path::new(PLUGINS_SUBFOLDER).join(package), FolderKind::Package);
            if !places.iter().any(|known| is_same_folder(&known.path(), &place.path())) {
                places.push(place);
            }
        }
    }
    Ok(places)
}

fn is_same_folder(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Plugin files of a folder, sorted by name, so that the order is the same on every machine.
fn sources_in(place: &PluginFolder) -> Result<Vec<Source>, FolderError> {
    let unreadable = |error: FileError| FolderError::Unreadable { folder: place.path(), error };
    let root = if place.root.as_os_str().is_empty() { Path::new(".") } else { place.root.as_path() };
    let opened = Folder::open(root).map_err(FileError::Io).and_then(|folder| {
        let names = match place.subfolder.as_os_str().is_empty() {
            true => folder.names(MAX_FILES)?,
            false => folder.folder(&place.subfolder)?.names(MAX_FILES)?,
        };
        Ok((folder, names))
    });
    let (folder, names) = match opened {
        Ok(opened) => opened,
        Err(FileError::Outside) => return Err(FolderError::Link { folder: place.path() }),
        // A script may stand in a folder that cannot be listed.
        Err(_) if place.kind == FolderKind::Own => return Ok(Vec::new()),
        Err(error) => return Err(unreadable(error)),
    };
    let folder = Arc::new(folder);
    let canonical = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
    let source = |name: PathBuf| {
        let shown = place.path().join(&name).display().to_string();
        let name = place.subfolder.join(&name);
        let path = canonical.join(folder.resolve(&name).unwrap_or_else(|_| name.clone()));
        Source { folder: folder.clone(), name, display_path: shown, path, package_entry: None }
    };
    if place.kind == FolderKind::Package {
        let description = source(DESCRIPTION.into());
        return Ok(match description.read_package() {
            Err(fault) => vec![Source { package_entry: Some(Err(fault)), ..description }],
            Ok(package) => {
                let package_entry = |plugin: PackagedPlugin| Some(Ok((plugin, package.version.to_string())));
                let plugins = package.plugins.clone().into_iter();
                plugins
                    .map(|p| Source { package_entry: package_entry(p.clone()), ..source(p.file.into()) })
                    .collect()
            }
        });
    }
    let is_plugin = |name: &str| FILE_ENDINGS.iter().any(|e| name.ends_with(e)) && !name.starts_with('.');
    let names = names.into_iter().filter(|name| is_plugin(&name.to_string_lossy()));
    Ok(names.map(|name| source(name.into())).filter(|source| !source.path.is_dir()).collect())
}

impl Listing {
    /// Registers the plugin of a file, and notes whether it replaces another one.
    fn add(&mut self, entry: Entry) {
        let replaced_count = self.registry.replaced().len();
        match &entry.plugin {
            Plugin::Effect(effect) => self.registry.add_lazy_effect(effect.clone()),
            Plugin::Importer(importer) => self.registry.add_shared_importer(importer.clone()),
            Plugin::WasmImporter(importer) => self.registry.add_shared_importer(importer.clone()),
            Plugin::WasmExporter(exporter) => self.registry.add_shared_scene_exporter(exporter.clone()),
            Plugin::Exporter(exporter) => self.registry.add_shared_scene_exporter(exporter.clone()),
            Plugin::Faulty(why) => self.registry.add_faulty(entry.source.display_path.clone(), why),
        }
        let other = self.entries.iter().rfind(|other| entry.is_named_as(other));
        let of = other.map(|other| format!(", that of {}", other.source.display_path)).unwrap_or_default();
        let replaced = &self.registry.replaced()[replaced_count..];
        self.replacement_notes
            .extend(replaced.iter().map(|text| format!("{}: {text}{of}", entry.source.display_path)));
        self.entries.push(entry);
    }

    /// One sentence for each plugin of this listing that has the name of one in another listing, with both files.
    pub fn name_conflicts_with(&self, other: &Listing) -> Vec<String> {
        let both = |entry: &Entry| {
            let theirs = other.entries.iter().find(|theirs| theirs.is_named_as(entry))?;
            let (kind, name) = entry.kind_and_name()?;
            let (ours, theirs) = (&entry.source.display_path, &theirs.source.display_path);
            Some(format!("the {} {name} of {ours} is also in {theirs}", kind.word()))
        };
        self.entries.iter().filter_map(both).collect()
    }

    /// The plugin of a file. `None` if the file is not a plugin.
    fn make_entry(&self, source: Source, kind: FolderKind, earlier: Option<&Listing>) -> Option<Entry> {
        let is_it = |e: &&Entry| e.read_result.get().is_some() && e.source.path == source.path;
        let known = earlier.and_then(|b| b.entries.iter().find(is_it));
        if let Some(known) = known.filter(|k| k.source.display_path == source.display_path)
            && known.read_result.get().is_some_and(|read| *read == source.read())
        {
            let (plugin, read) = (known.plugin.clone(), known.read_result.clone());
            return Some(Entry { source, plugin, read_result: read });
        }
        let read = Arc::new(OnceLock::new());
        if let Some(Err(fault)) = &source.package_entry {
            let plugin = Plugin::Faulty(fault.to_string());
            return Some(Entry { source, plugin, read_result: read });
        }
        let (of, slot, compiled) = (source.clone(), read.clone(), self.compiled.clone());
        let reading = move || {
            compiled.fetch_add(1, Ordering::Relaxed);
            let file = of.read();
            // The slot is empty, since this function runs once.
            let _ = slot.set(file.clone());
            let text = |e: ReadError| PluginError { text: e.0, files: vec![of.path.clone()] };
            file.map_err(text).map(|file| (of.display_path.clone(), file))
        };
        let plugin = if source.is_wgsl() {
            let head = match source.read_head() {
                Ok(head) => head,
                Err(e) => return Some(Entry { source, plugin: Plugin::Faulty(e.0), read_result: read }),
            };
            if kind == FolderKind::Own && !choreo_wgsl_effect::declares_effect(&head) {
                return None;
            }
            match choreo_wgsl_effect::effect_name(&head) {
                Some(name) => {
                    let make = move || reading().and_then(|(shown, file)| compile_effect(&shown, file));
                    Plugin::Effect(Arc::new(LazyEffect::new(&name, make)))
                }
                None => Plugin::Faulty(source.effect_error()),
            }
        } else if source.is_wasm() {
            let made = reading().and_then(|(shown, file)| wasm_plugin(&shown, file));
            made.unwrap_or_else(|e| Plugin::Faulty(e.text))
        } else if source.display_path.ends_with(EXPORTER_ENDING) {
            let made = reading().and_then(|(shown, file)| compile_exporter(&shown, file));
            made.map_or_else(|e| Plugin::Faulty(e.text), |made| Plugin::Exporter(Arc::new(made)))
        } else {
            let make = move || reading().and_then(|(shown, file)| compile_importer(&shown, file));
            let listed = source.read_text().map_err(|e| e.0).and_then(|text| {
                LazyImporter::new(&source.display_path, &text, make).map_err(|e: ScriptError| e.to_string())
            });
            listed.map_or_else(Plugin::Faulty, |importer| Plugin::Importer(Arc::new(importer)))
        };
        Some(Entry { source, plugin, read_result: read })
    }

    /// Compiles all plugin files, and returns their errors with positions.
    pub fn problems(&self) -> Vec<String> {
        let fault = |entry: &Entry| match &entry.plugin {
            Plugin::Effect(effect) => effect.get().err().map(|fault| fault.text.clone()),
            Plugin::Importer(importer) => importer.get().err().map(|fault| fault.text.clone()),
            Plugin::WasmImporter(importer) => importer.get().err().map(|fault| fault.text.clone()),
            Plugin::WasmExporter(exporter) => exporter.get().err().map(|fault| fault.text.clone()),
            Plugin::Exporter(_) => None,
            Plugin::Faulty(text) => Some(text.clone()),
        };
        self.entries.iter().filter_map(|entry| fault(entry).or_else(|| entry.contradiction())).collect()
    }

    /// Kinds and names of the working plugin files.
    pub fn names(&self) -> Vec<(PackagedKind, String)> {
        let name = |entry: &Entry| Some((entry.kind()?, entry.manifest()?.name.clone()));
        self.entries.iter().filter_map(name).collect()
    }

    /// Names of the effects in files that were not used so far.
    pub fn unused_effects(&self) -> Vec<String> {
        let unused = self.entries.iter().filter(|entry| entry.read_result.get().is_none());
        let name = |entry: &Entry| match &entry.plugin {
            Plugin::Effect(effect) => Some(effect.name().to_string()),
            _ => None,
        };
        unused.filter_map(name).collect()
    }

    /// Canonical paths of the plugin files.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.entries.iter().map(|entry| entry.source.path.as_path())
    }

    /// Canonical paths of the files of plugins that were used so far: their own, those that they read, and the descriptions of their packages.
    pub fn used_files(&self) -> impl Iterator<Item = PathBuf> {
        let used = self.entries.iter().filter_map(|entry| {
            let file = entry.read_result.get()?.as_ref().ok()?;
            let description =
                entry.source.package_entry.as_ref().map(|_| file.path.with_file_name(DESCRIPTION));
            let beside = file.beside.iter().filter(|beside| beside.bytes.is_ok());
            let beside = beside.map(|beside| beside.path.clone());
            Some(std::iter::once(file.path.clone()).chain(beside).chain(description))
        });
        used.flatten()
    }

    /// Number of plugin files that were compiled so far.
    pub fn compiled_count(&self) -> u64 {
        self.compiled.load(Ordering::Relaxed)
    }
}

impl Entry {
    /// Kind and name of the plugin, without compiling it. `None` for a faulty file.
    fn kind_and_name(&self) -> Option<(PackagedKind, &str)> {
        let name = match &self.plugin {
            Plugin::Effect(effect) => effect.name(),
            Plugin::Importer(importer) => &importer.manifest().name,
            Plugin::Exporter(exporter) => &exporter.manifest().name,
            Plugin::WasmImporter(importer) => &importer.manifest().name,
            Plugin::WasmExporter(exporter) => &exporter.manifest().name,
            Plugin::Faulty(_) => return None,
        };
        Some((self.kind()?, name))
    }

    /// Whether two plugins have the same kind and name.
    fn is_named_as(&self, other: &Entry) -> bool {
        self.kind_and_name().is_some_and(|named| other.kind_and_name() == Some(named))
    }

    /// Manifest of a working plugin. An effect is compiled to get it.
    fn manifest(&self) -> Option<&Manifest> {
        match &self.plugin {
            Plugin::Effect(effect) => effect.get().ok().map(|effect| effect.manifest()),
            Plugin::Importer(importer) => Some(importer.manifest()),
            Plugin::WasmImporter(importer) => Some(importer.manifest()),
            Plugin::WasmExporter(exporter) => Some(exporter.manifest()),
            Plugin::Exporter(exporter) => Some(exporter.manifest()),
            Plugin::Faulty(_) => None,
        }
    }

    fn kind(&self) -> Option<PackagedKind> {
        match &self.plugin {
            Plugin::Effect(_) => Some(PackagedKind::Effect),
            Plugin::Importer(_) | Plugin::WasmImporter(_) => Some(PackagedKind::Importer),
            Plugin::Exporter(_) | Plugin::WasmExporter(_) => Some(PackagedKind::Exporter),
            Plugin::Faulty(_) => None,
        }
    }

    /// Error if the description of the package contradicts the plugin: its version, since rendered output records the plugin's own, or its hook.
    fn contradiction(&self) -> Option<String> {
        let Some(Ok((package_entry, version))) = &self.source.package_entry else { return None };
        let (shown, own) = (&self.source.display_path, &self.manifest()?.version);
        if own != version {
            return Some(format!(
                "{shown}: the plugin states version {own}, {DESCRIPTION} {version}; write the same in both"
            ));
        }
        let Plugin::Effect(effect) = &self.plugin else { return None };
        let (own, hook) = (effect.get().ok()?.hook(), package_entry.hook.as_ref()?);
        (choreo_wgsl_effect::hook_named(hook) != Some(own)).then(|| {
            let own = choreo_wgsl_effect::hook_word(own);
            format!(
                "{shown}: the effect has the hook {own}, {DESCRIPTION} states {hook}; write the same in both"
            )
        })
    }
}

impl Source {
    /// Reads the description of a package.
    fn read_package(&self) -> Result<Package, ReadError> {
        let bytes = self.folder.read(&self.name, MAX_DESCRIPTION_BYTES).map_err(|e| self.read_error(&e))?;
        let text = String::from_utf8(bytes)
            .map_err(|_| ReadError(format!("{}: it is not UTF-8 text", self.display_path)))?;
        Package::parse(&self.display_path, &text).map_err(|e| ReadError(e.to_string()))
    }

    fn is_wgsl(&self) -> bool {
        self.display_path.ends_with(choreo_wgsl_effect::FILE_ENDING)
    }

    fn is_wasm(&self) -> bool {
        self.display_path.ends_with(".wasm")
    }

    fn read_error(&self, error: &FileError) -> ReadError {
        let shown = &self.display_path;
        ReadError(match error {
            FileError::TooLarge(most) => format!("{shown}: a plugin of more than {most} bytes"),
            FileError::Outside => {
                format!(
                    "{shown}: cannot read: it is a link that leads out of {}",
                    self.folder.path().display()
                )
            }
            error => format!("{shown}: cannot read: {error}"),
        })
    }

    /// Beginning of the text; invalid UTF-8 is left for the compiler to report.
    fn read_head(&self) -> Result<String, ReadError> {
        let file = self.folder.open_file(&self.name).map_err(|e| self.read_error(&e))?;
        let mut bytes = Vec::new();
        let read = file.take(EFFECT_HEAD_BYTES).read_to_end(&mut bytes);
        read.map_err(|e| self.read_error(&FileError::Io(e)))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    fn read_bytes(&self) -> Result<Vec<u8>, ReadError> {
        let most = if self.is_wasm() { MAX_WASM_BYTES } else { MAX_BYTES };
        self.folder.read(&self.name, most).map_err(|e| self.read_error(&e))
    }

    fn read_text(&self) -> Result<String, ReadError> {
        String::from_utf8(self.read_bytes()?).map_err(|e| {
            ReadError(format!(
                "{}: byte {} is no UTF-8 text",
                self.display_path,
                e.utf8_error().valid_up_to()
            ))
        })
    }

    /// Reads the file and the files that an effect refers to.
    fn read(&self) -> Result<PluginFile, ReadError> {
        let path = self.path.clone();
        if self.is_wasm() {
            return Ok(PluginFile { path, bytes: self.read_bytes()?.into(), beside: Vec::new() });
        }
        let text = self.read_text()?;
        let named = if self.is_wgsl() { choreo_wgsl_effect::texture_files(&text) } else { Vec::new() };
        let beside = named.into_iter().map(|name| self.read_beside(name)).collect();
        Ok(PluginFile { path, bytes: text.into_bytes().into(), beside })
    }

    /// Reads a file in the plugin's own folder or below.
    fn read_beside(&self, name: String) -> BesideFile {
        let path = self.path.with_file_name(&name);
        let refused = || "a plugin reads files of its own folder only".to_string();
        let bytes = (|| {
            if !Path::new(&name).components().all(|c| matches!(c, Component::Normal(_))) {
                return Err(refused());
            }
            let inside = self.folder.resolve(&self.name).map_err(|e| e.to_string())?;
            let parent = containing_folder(&inside);
            let own = self.folder.folder(parent).map_err(|e| e.to_string())?;
            own.read(Path::new(&name), MAX_TEXTURE_BYTES).map(Arc::from).map_err(|error| match error {
                FileError::Outside => refused(),
                error => error.to_string(),
            })
        })();
        BesideFile { name, path, bytes }
    }

    /// Error of an effect without a name.
    fn effect_error(&self) -> String {
        let compiled = self.read_text().map_err(|e| e.0).and_then(|text| {
            WgslEffect::from_text(&self.display_path, &text).map(|_| String::new()).map_err(|e| e.to_string())
        });
        compiled.unwrap_or_else(|text| text)
    }
}

/// Decodes an image file that an effect refers to.
fn decode_texture(file: &PluginFile, name: &str) -> Result<TextureImage, String> {
    let found = file.beside.iter().find(|b| b.name == name);
    let found = found.ok_or_else(|| "it was not read".to_string())?;
    let bytes = found.bytes.clone()?;
    let place = found.path.display().to_string();
    let decoded = Encoded::examine(place, name.to_string(), bytes, Formats::All)
        .and_then(|encoded| encoded.decode())
        .map_err(|problem| problem.what)?;
    Ok(TextureImage {
        size: [decoded.width, decoded.height],
        rgba: decoded.rgba.clone(),
        file: Some(found.path.clone()),
    })
}

/// Text of a plugin file, which was checked to be UTF-8 when it was read.
fn plugin_text(file: &PluginFile) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(&file.bytes)
}

fn compile_effect(display_path: &str, file: PluginFile) -> Result<Effect, PluginError> {
    let compiled =
        WgslEffect::with_textures(display_path, &plugin_text(&file), |name| decode_texture(&file, name));
    match compiled {
        Ok(effect) => Ok(effect.with_file(file).into()),
        Err(error) => {
            let beside = file.beside.into_iter().map(|b| b.path);
            let files = std::iter::once(file.path).chain(beside).collect();
            Err(PluginError { text: error.to_string(), files })
        }
    }
}

fn compile_exporter(display_path: &str, file: PluginFile) -> Result<RhaiExporter, PluginError> {
    match RhaiExporter::from_text(display_path, &plugin_text(&file)) {
        Ok(exporter) => Ok(exporter.with_file(file)),
        Err(error) => Err(PluginError { text: error.to_string(), files: vec![file.path] }),
    }
}

fn compile_importer(display_path: &str, file: PluginFile) -> Result<RhaiImporter, PluginError> {
    match RhaiImporter::from_text(display_path, &plugin_text(&file)) {
        Ok(importer) => Ok(importer.with_file(file)),
        Err(error) => Err(PluginError { text: error.to_string(), files: vec![file.path] }),
    }
}

/// A WebAssembly plugin that is compiled on first use; only its manifest is known.
fn wasm_plugin(display_path: &str, file: PluginFile) -> Result<Plugin, PluginError> {
    let manifest = remembered_manifests::manifest(&file.bytes).map_err(|error| PluginError {
        text: format!("{display_path}: {error}"),
        files: vec![file.path.clone()],
    })?;
    Ok(match display_path.ends_with(choreo_wasm_plugin::EXPORTER_ENDING) {
        true => Plugin::WasmExporter(Arc::new(OnUse::exporter(display_path, manifest, file))),
        false => Plugin::WasmImporter(Arc::new(OnUse::importer(display_path, manifest, file))),
    })
}
