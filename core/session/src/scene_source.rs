//! The files and options that a scene is built from.

use choreo_plugin::ImportScope;
use choreo_script::{AssetCache, ImportChoice, Limits, ScriptOptions};
use std::path::{Path, PathBuf};

#[derive(Clone, Debug)]
pub struct SceneSource {
    /// A script (`.rhai`), or a model.
    pub input: PathBuf,
    /// Models: further ones, shown to the right of it.
    pub beside: Vec<PathBuf>,
    /// Scripts: parameters, `name=value`.
    pub set: Vec<(String, String)>,
    /// Further folders in which assets are looked for.
    pub search: Vec<PathBuf>,
    /// Further folders of plugin files.
    pub plugins: Vec<PathBuf>,
    pub limits: Limits,
    pub needs: ImportScope,
    /// Models: the clip to play (`None`: the first), and how the file is read.
    pub clip: Option<String>,
    pub import: ImportChoice,
    /// Size in pixels that replaces the scene's own.
    pub size: Option<[u32; 2]>,
    /// Folder from which the renderer reads its shaders, to be read again when they change.
    pub shaders: Option<PathBuf>,
}

impl SceneSource {
    /// An input with default options.
    pub fn new(input: impl Into<PathBuf>) -> SceneSource {
        SceneSource {
            input: input.into(),
            beside: Vec::new(),
            set: Vec::new(),
            search: Vec::new(),
            plugins: Vec::new(),
            limits: Limits::default(),
            needs: ImportScope::ALL,
            clip: None,
            import: ImportChoice::default(),
            size: None,
            shaders: None,
        }
    }

    /// The options with which its script runs.
    pub fn script_options(&self, assets: &AssetCache) -> ScriptOptions {
        ScriptOptions {
            search_paths: self.search.clone(),
            set: self.set.clone(),
            limits: self.limits.clone(),
            needs: self.needs,
            assets: assets.clone(),
            // The inspector shows them all.
            played_clips_only: false,
            ..ScriptOptions::default()
        }
    }

    /// The recipe for files that were chosen together, like another recipe: models side by side, or one script. With it, what is left out, in
    /// words. `None` for no file.
    pub fn of_models(files: Vec<PathBuf>, like: &SceneSource) -> Option<(SceneSource, Option<String>)> {
        let (scripts, models): (Vec<PathBuf>, Vec<PathBuf>) = files.into_iter().partition(|f| is_script(f));
        let (shown, left_out) = match models.is_empty() {
            true => scripts.split_at(scripts.len().min(1)),
            false => (&models[..], &scripts[..]),
        };
        let names = left_out.iter().filter_map(|f| Some(f.file_name()?.to_string_lossy().into_owned()));
        let names: Vec<String> = names.collect();
        let note = (!names.is_empty()).then(|| format!("{}: a script is shown alone", names.join(", ")));
        let (input, beside) = shown.split_first()?;
        let (input, beside) = (input.clone(), beside.to_vec());
        let source = SceneSource { input, beside, set: Vec::new(), clip: None, ..like.clone() };
        Some((source, note))
    }

    pub fn is_script(&self) -> bool {
        is_script(&self.input)
    }
}

pub fn is_script(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"))
}
