//! Files in the folders of a script: their names, and the contents of models, which are read in the background and cached until size or
//! modification time change.

use crate::Project;
use choreo_asset::Asset;
use choreo_plugin::ImportScope;
use choreo_script::{
    AssetCache, BUILT_IN, Folders, Import, ImportChoice, LoadError, Loader, built_in_assets,
};
use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Time that a request waits for a file that is being read; after that it is answered without the file.
const FILE_WAIT_TIME: Duration = Duration::from_millis(150);
/// Largest number of files and folders that are visited, and largest depth of folders.
const MAX_NAMES: usize = 4000;
const MAX_FOLDER_DEPTH: usize = 6;

/// Contents of a file, as far as they are known.
#[derive(Clone)]
pub(crate) enum Contents {
    Loaded(Arc<Asset>),
    /// The file is being read.
    Reading,
    Unreadable(String),
}

/// Contents of files, by script folder and name.
pub(crate) struct Files {
    pub cache: AssetCache,
    reads: BTreeMap<(PathBuf, String), Read>,
}

struct Read {
    stamp: Option<(u64, SystemTime)>,
    import: Arc<Import>,
    /// Kept alive because imports end when their loader is dropped.
    _loader: Arc<Loader>,
}

impl Files {
    pub(crate) fn new() -> Files {
        Files { cache: AssetCache::comparing_file_times(), reads: BTreeMap::new() }
    }

    /// Contents of a file, as a script in a folder loads it. Starts reading the file if necessary, and waits a moment. Tests may read
    /// everything below a root.
    pub(crate) fn contents(
        &mut self,
        project: &Project,
        folder: &Path,
        tests_root: Option<&Path>,
        name: &str,
    ) -> Contents {
        let import = match self.start_import(project, folder, tests_root, name) {
            Ok(import) => import,
            Err(error) => return Contents::Unreadable(error.message),
        };
        let until = Instant::now() + FILE_WAIT_TIME;
        loop {
            match import.result() {
                Some(Ok(asset)) => return Contents::Loaded(asset),
                Some(Err(error)) => return Contents::Unreadable(error.message),
                None if Instant::now() > until => return Contents::Reading,
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        }
    }

    /// Starts reading a file that has not been read, or has changed.
    fn start_import(
        &mut self,
        project: &Project,
        folder: &Path,
        tests_root: Option<&Path>,
        name: &str,
    ) -> Result<Arc<Import>, LoadError> {
        let folders = folders(project, folder, tests_root)?;
        let stamp = match name.starts_with(BUILT_IN) {
            true => None,
            false => {
                let found = folders.find(None, name)?;
                std::fs::metadata(found.path).ok().and_then(|data| Some((data.len(), data.modified().ok()?)))
            }
        };
        let key = (folder.to_path_buf(), name.to_string());
        if let Some(read) = self.reads.get(&key).filter(|read| read.stamp == stamp) {
            return Ok(read.import.clone());
        }
        let loader = Loader::new(&project.registry, folders, ImportScope::NO_PIXELS).with_cache(&self.cache);
        let loader = Arc::new(loader);
        let import = loader.start(None, name, &ImportChoice::default())?;
        self.reads.insert(key, Read { stamp, import: import.clone(), _loader: loader });
        Ok(import)
    }
}

fn folders(project: &Project, folder: &Path, tests_root: Option<&Path>) -> Result<Folders, LoadError> {
    let folders = Folders::new(folder, &project.search, project.limits.file)?;
    match tests_root {
        Some(root) => folders.with_root(root),
        None => Ok(folders),
    }
}

/// Names of files with the given extensions (all files if there are none) in the folder of a script and on the search paths, relative to
/// these folders, with `/`. Hidden files and links to folders are left out.
pub(crate) fn find_files(project: &Project, folder: &Path, extensions: &[String]) -> Vec<String> {
    let mut found = Vec::new();
    let mut seen = 0;
    for root in std::iter::once(folder).chain(project.search.iter().map(PathBuf::as_path)) {
        // Breadth first, so that nearby files are found even in a folder with too many files.
        let mut open = std::collections::VecDeque::from([root.to_path_buf()]);
        while let Some(here) = open.pop_front() {
            for entry in std::fs::read_dir(&here).into_iter().flatten().flatten() {
                seen += 1;
                if seen > MAX_NAMES {
                    return sorted_by_depth(found);
                }
                let (path, kind) = (entry.path(), entry.file_type());
                let hidden = entry.file_name().to_string_lossy().starts_with('.');
                let below = path.strip_prefix(root).unwrap_or(&path).components().count();
                match kind {
                    Ok(kind) if kind.is_dir() && !hidden && below < MAX_FOLDER_DEPTH => open.push_back(path),
                    Ok(kind) if !kind.is_dir() && !hidden && has_extension(&path, extensions) => {
                        found.extend(path.strip_prefix(root).ok().and_then(with_slashes));
                    }
                    _ => {}
                }
            }
        }
    }
    sorted_by_depth(found)
}

/// Whether a file was written by `choreo export`: glTF and USD files state that in their first bytes.
pub(crate) fn is_exported(project: &Project, folder: &Path, name: &str) -> bool {
    const MARK: &[u8] = b"choreo export-";
    let mut roots = std::iter::once(folder).chain(project.search.iter().map(PathBuf::as_path));
    let file = roots.find_map(|root| choreo_files::open_file(&root.join(name)).ok());
    let mut head = Vec::new();
    let read = file.is_some_and(|file| file.take(4096).read_to_end(&mut head).is_ok());
    read && head.windows(MARK.len()).any(|bytes| bytes == MARK)
}

fn sorted_by_depth(mut names: Vec<String>) -> Vec<String> {
    names.sort_by_key(|name| (name.matches('/').count(), name.clone()));
    names.dedup();
    names
}

fn has_extension(path: &Path, extensions: &[String]) -> bool {
    let own = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    extensions.is_empty() || own.is_some_and(|own| extensions.contains(&own))
}

/// A relative path with `/` between its parts; `None` if it has other components or is not UTF-8.
fn with_slashes(path: &Path) -> Option<String> {
    let parts = path.components().map(|part| match part {
        Component::Normal(part) => part.to_str(),
        _ => None,
    });
    Some(parts.collect::<Option<Vec<_>>>()?.join("/"))
}

/// Names of built-in assets, such as `choreo:mannequin`.
pub(crate) fn built_in_names(project: &Project) -> Vec<String> {
    built_in_assets(&project.registry).map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Registry;
    use choreo_script::Limits;

    #[test]
    fn only_files_inside_the_folders_of_a_script_are_listed_and_read() {
        let root = std::env::temp_dir().join(format!("choreo-names-{}", std::process::id()));
        let scene = root.join("scene");
        std::fs::create_dir_all(scene.join("models/.git")).unwrap();
        for name in ["a.glb", "models/b.GLB", "models/c.txt", "models/.git/d.glb", ".e.glb"] {
            std::fs::write(scene.join(name), "x").unwrap();
        }
        std::fs::write(root.join("outside.glb"), "x").unwrap();
        let project = Project {
            registry: Registry::default(),
            search: Vec::new(),
            root: None,
            limits: Limits::default(),
        };
        assert_eq!(find_files(&project, &scene, &["glb".into()]), ["a.glb", "models/b.GLB"]);
        assert_eq!(find_files(&project, &scene, &[]), ["a.glb", "models/b.GLB", "models/c.txt"]);
        let mut files = Files::new();
        let outside = files.contents(&project, &scene, None, "../outside.glb");
        assert!(matches!(outside, Contents::Unreadable(why) if why.contains("leads out of the folders")));
        std::fs::remove_dir_all(root).unwrap();
    }
}
