//! WGSL modules → SPIR-V: a line-preserving `@if` preprocessor, and naga. Does not use Vulkan, so that every combination of
//! features that a plan can request is validated without a GPU.

pub mod switches;
pub mod uniforms;

mod compile;
mod preprocess;
mod surface;
mod textures;
mod variant;

pub use compile::{Entry, compile, parse};
pub use preprocess::{PreprocessError, preprocess};
pub use surface::{ParameterRows, SceneEffect, surface_files};
pub use switches::switches;
pub(crate) use textures::POST_TEXTURES;
pub use textures::{pass_functions, texture_bytes, texture_functions};
pub use variant::{DeferredPass, InputTargets, LightLoop, PeelPass, SceneVariant, entry_points};

use crate::error::RenderError;
use choreo_files::Folder;
use choreo_shaders::MODULES;
use std::path::{Path, PathBuf};

/// Texts of the shader modules: built in, or from a folder for live editing, whose files take precedence. Texts are a snapshot of
/// the folder: a file that is being edited changes nothing until all are read again.
#[derive(Clone, Debug, Default)]
pub struct ShaderSources {
    pub folder: Option<PathBuf>,
    texts: Vec<SourceFile>,
}

/// Name of the module generated from the table of features: the bindings of material textures.
const MATERIAL_TEXTURES: &str = "material_textures.wgsl";
/// Name of the module with the table of [`crate::dither`].
const DITHER_RANKS: &str = "dither_ranks.wgsl";

/// Files that make up a shader module, in order.
pub const SCENE: [&str; 22] = [
    "frame.wgsl",
    "lights.wgsl",
    MATERIAL_TEXTURES,
    "view.wgsl",
    "sky.wgsl",
    "brdf.wgsl",
    "reflection.wgsl",
    "toon.wgsl",
    "displace.wgsl",
    "thick_lines.wgsl",
    "pose.wgsl",
    "vertex.wgsl",
    "triplanar.wgsl",
    "layers.wgsl",
    "refraction.wgsl",
    "shadow.wgsl",
    "peel.wgsl",
    "deferred.wgsl",
    "effect_faults.wgsl",
    "surface.wgsl",
    "inputs.wgsl",
    "scene.wgsl",
];
pub const PRESKIN: [&str; 4] = ["frame.wgsl", "brdf.wgsl", "pose.wgsl", "preskin.wgsl"];
pub const OVERLAY: [&str; 2] = ["frame.wgsl", "overlay.wgsl"];
pub const BACKGROUND: [&str; 6] =
    ["frame.wgsl", "effect_faults.wgsl", "surface.wgsl", DITHER_RANKS, "dither.wgsl", "background.wgsl"];
pub const LAYERS_BEHIND: [&str; 5] =
    ["frame.wgsl", "effect_faults.wgsl", "surface.wgsl", "background.wgsl", "layers_behind.wgsl"];
/// Files of a sky module, with the switch `SKY_BACKGROUND`.
pub const SKY: [&str; 8] = [
    "frame.wgsl",
    "effect_faults.wgsl",
    "surface.wgsl",
    DITHER_RANKS,
    "dither.wgsl",
    "background.wgsl",
    "view.wgsl",
    "sky.wgsl",
];

/// One file's text, before preprocessing.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceFile {
    pub name: String,
    pub text: String,
}

impl ShaderSources {
    /// Reads the folder's modules.
    pub fn read(folder: Option<PathBuf>) -> Result<ShaderSources, RenderError> {
        /// Largest size of a module.
        const MOST_BYTES: u64 = 4 << 20;
        let mut texts = Vec::new();
        if let Some(folder) = &folder {
            // A missing folder holds no modules.
            let opened = Folder::open(folder).ok();
            for (module, _) in MODULES {
                let Some(opened) = &opened else { break };
                let name = folder.join(module).display().to_string();
                let failed = |why: String| RenderError::Shader { file: name.clone(), text: why };
                let bytes = match opened.read(Path::new(module), MOST_BYTES) {
                    Ok(bytes) => bytes,
                    // A folder may hold only the modules that are being edited.
                    Err(e) if e.is_missing() => continue,
                    Err(e) => return Err(failed(format!("cannot read: {e}"))),
                };
                let text = String::from_utf8(bytes).map_err(|_| failed("it is not UTF-8 text".into()))?;
                let text = text.strip_prefix('\u{feff}').map(str::to_string).unwrap_or(text);
                texts.push(SourceFile { name, text });
            }
        }
        Ok(ShaderSources { folder, texts })
    }

    pub fn file(&self, name: &str) -> Result<SourceFile, RenderError> {
        if let Some(folder) = &self.folder {
            let path = folder.join(name).display().to_string();
            if let Some(file) = self.texts.iter().find(|file| file.name == path) {
                return Ok(file.clone());
            }
        }
        if name == MATERIAL_TEXTURES {
            return Ok(SourceFile {
                name: "table of shader features".into(),
                text: switches::texture_bindings(),
            });
        }
        if name == DITHER_RANKS {
            return Ok(SourceFile {
                name: "table of dither ranks".into(),
                text: crate::dither::wgsl_table(),
            });
        }
        let (_, text) = MODULES.iter().find(|(n, _)| *n == name).ok_or_else(|| RenderError::Shader {
            file: name.into(),
            text: "no such module in the program".into(),
        })?;
        Ok(SourceFile { name: format!("shaders/{name}"), text: (*text).into() })
    }

    pub fn files(&self, names: &[&str]) -> Result<Vec<SourceFile>, RenderError> {
        names.iter().map(|n| self.file(n)).collect()
    }

    /// The text that a full-screen effect is compiled from: the template, then the plugin's function. Uses the switch `TEXTURES`
    /// if the effect reads textures. `faults`: index of the effect's first fault record.
    pub fn post(
        &self,
        effect: &str,
        wgsl: &str,
        [number, faults]: [u32; 2],
        parameters: ParameterRows,
        textures: bool,
    ) -> Result<Vec<SourceFile>, RenderError> {
        let files = ["post.wgsl", "effect_faults.wgsl", DITHER_RANKS, "dither.wgsl"];
        let mut files = self.files(&files)?;
        if textures {
            files.push(self.file("textures.wgsl")?);
        }
        files.push(SourceFile { name: format!("effect \"{effect}\""), text: wgsl.into() });
        let run = format!(
            "const post_run: u32 = {number}u;\nconst post_faults: u32 = {faults}u;\nconst post_rows: u32 = {}u;\n{}{}",
            parameters.end(),
            parameters.function("post_parameters", "post.parameters"),
            parameters.frame_functions("post.parameters")
        );
        files.push(SourceFile { name: "number of the run".into(), text: run });
        Ok(files)
    }
}
