//! What is to be shown, as somebody asks for it.

use choreo_plugin::Needs;
use choreo_script::{ImportChoice, Limits};
use std::path::{Path, PathBuf};

#[derive(Clone, Debug)]
pub struct Recipe {
    /// A script (`.rhai`), or a model.
    pub input: PathBuf,
    /// Scripts: parameters, `name=value`.
    pub set: Vec<(String, String)>,
    /// Further folders in which assets are looked for.
    pub search: Vec<PathBuf>,
    /// Further folders of plugin files.
    pub plugins: Vec<PathBuf>,
    pub limits: Limits,
    pub needs: Needs,
    /// Models: the clip to play (`None`: the first), and how the file is read.
    pub clip: Option<String>,
    pub import: ImportChoice,
    /// In place of the scene's own size, pixels.
    pub size: Option<[u32; 2]>,
    /// Where the renderer reads its shaders, to be read again when they change.
    pub shaders: Option<PathBuf>,
}

impl Recipe {
    /// As it is where nothing more is asked for.
    pub fn new(input: impl Into<PathBuf>) -> Recipe {
        Recipe {
            input: input.into(),
            set: Vec::new(),
            search: Vec::new(),
            plugins: Vec::new(),
            limits: Limits::default(),
            needs: Needs::ALL,
            clip: None,
            import: ImportChoice::default(),
            size: None,
            shaders: None,
        }
    }

    pub fn is_script(&self) -> bool {
        is_script(&self.input)
    }
}

pub fn is_script(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("rhai"))
}
