//! The files and options that a scene is built from.

use choreo_plugin::ImportScope;
use choreo_script::{AssetCache, ImportChoice, Limits, ScriptOptions};
use std::path::{Path, PathBuf};

#[derive(Clone, Debug)]
pub struct SceneSource {
    /// A script (`.rhai`), or a model.
    pub input: PathBuf,
    /// Models: more models, shown to the right of `input`.
    pub more_models: Vec<PathBuf>,
    /// Scripts: parameters, `name=value`.
    pub set_parameters: Vec<(String, String)>,
    /// Additional folders to search for assets.
    pub search_folders: Vec<PathBuf>,
    /// Additional folders of plugin files.
    pub plugin_folders: Vec<PathBuf>,
    pub limits: Limits,
    pub requested_parts: ImportScope,
    /// Models: the clip to play (`None`: the first), and how the file is read.
    pub clip: Option<String>,
    pub import: ImportChoice,
    /// Size in pixels that overrides the size of the scene.
    pub size: Option<[u32; 2]>,
    /// Folder that the renderer loads shaders from; changed shaders are loaded again.
    pub shader_folder: Option<PathBuf>,
}

impl SceneSource {
    /// A source with default options.
    pub fn new(input: impl Into<PathBuf>) -> SceneSource {
        SceneSource {
            input: input.into(),
            more_models: Vec::new(),
            set_parameters: Vec::new(),
            search_folders: Vec::new(),
            plugin_folders: Vec::new(),
            limits: Limits::default(),
            requested_parts: ImportScope::ALL,
            clip: None,
            import: ImportChoice::default(),
            size: None,
            shader_folder: None,
        }
    }

    /// Options to run the script with.
    pub fn script_options(&self, assets: &AssetCache) -> ScriptOptions {
        ScriptOptions {
            search_paths: self.search_folders.clone(),
            set_parameters: self.set_parameters.clone(),
            limits: self.limits.clone(),
            requested_parts: self.requested_parts,
            assets: assets.clone(),
            // The inspector lists all clips.
            played_clips_only: false,
            ..ScriptOptions::default()
        }
    }

    /// The source for files that were chosen together: the models side by side, or the first script if there are no models. Other options are those
    /// of `like`. Also returns a note that names the files that are left out. `None` if there are no files.
    pub fn of_models(files: Vec<PathBuf>, like: &SceneSource) -> Option<(SceneSource, Option<String>)> {
        let (scripts, models): (Vec<PathBuf>, Vec<PathBuf>) = files.into_iter().partition(|f| is_script(f));
        let (shown, left_out) = match models.is_empty() {
            true => scripts.split_at(scripts.len().min(1)),
            false => (&models[..], &scripts[..]),
        };
        let names = left_out.iter().filter_map(|f| Some(f.file_name()?.to_string_lossy().into_owned()));
        let names: Vec<String> = names.collect();
        let note =
            (!names.is_empty()).then(|| format!("{} left out: a script is shown alone", names.join(", ")));
        let (input, beside) = shown.split_first()?;
        let (input, beside) = (input.clone(), beside.to_vec());
        let source = SceneSource {
            input,
            more_models: beside,
            set_parameters: Vec::new(),
            clip: None,
            ..like.clone()
        };
        Some((source, note))
    }

    pub fn is_script(&self) -> bool {
        is_script(&self.input)
    }
}

pub(crate) fn is_script(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"))
}
