//! WGSL modules → SPIR-V: a line-preserving `@if` preprocessor, and naga. No Vulkan here, so that every combination
//! of features a plan can ask for is validated without a GPU.

pub mod uniforms;

mod compile;
mod preprocess;
mod surface;
mod textures;

pub use compile::{Entry, compile, parse};
pub use preprocess::{PreprocessError, preprocess};
pub use surface::{SceneEffect, surface_files};
pub use textures::{texture_bytes, texture_functions};

use crate::error::RenderError;
use crate::plan::{Features, Glass, PipelineKey};
use choreo_files::Folder;
use std::path::{Path, PathBuf};

/// Source of a module's text: the program itself, or a folder for live editing (whose files win), as it was when
/// it was read: a file that is being edited changes nothing before it is read again as a whole.
#[derive(Clone, Debug, Default)]
pub struct ShaderSources {
    pub folder: Option<PathBuf>,
    texts: Vec<SourceFile>,
}

/// (file name, text built into the program).
const EMBEDDED: [(&str, &str); 23] = [
    ("frame.wgsl", include_str!("../../../../shaders/frame.wgsl")),
    ("under.wgsl", include_str!("../../../../shaders/under.wgsl")),
    ("peel.wgsl", include_str!("../../../../shaders/peel.wgsl")),
    ("deferred.wgsl", include_str!("../../../../shaders/deferred.wgsl")),
    ("sky.wgsl", include_str!("../../../../shaders/sky.wgsl")),
    ("brdf.wgsl", include_str!("../../../../shaders/brdf.wgsl")),
    ("reflection.wgsl", include_str!("../../../../shaders/reflection.wgsl")),
    ("toon.wgsl", include_str!("../../../../shaders/toon.wgsl")),
    ("layers.wgsl", include_str!("../../../../shaders/layers.wgsl")),
    ("refraction.wgsl", include_str!("../../../../shaders/refraction.wgsl")),
    ("shadow.wgsl", include_str!("../../../../shaders/shadow.wgsl")),
    ("displace.wgsl", include_str!("../../../../shaders/displace.wgsl")),
    ("wide.wgsl", include_str!("../../../../shaders/wide.wgsl")),
    ("triplanar.wgsl", include_str!("../../../../shaders/triplanar.wgsl")),
    ("pose.wgsl", include_str!("../../../../shaders/pose.wgsl")),
    ("posed.wgsl", include_str!("../../../../shaders/posed.wgsl")),
    ("vertex.wgsl", include_str!("../../../../shaders/vertex.wgsl")),
    ("scene.wgsl", include_str!("../../../../shaders/scene.wgsl")),
    ("surface.wgsl", include_str!("../../../../shaders/surface.wgsl")),
    ("background.wgsl", include_str!("../../../../shaders/background.wgsl")),
    ("overlay.wgsl", include_str!("../../../../shaders/overlay.wgsl")),
    ("textures.wgsl", include_str!("../../../../shaders/textures.wgsl")),
    ("post.wgsl", include_str!("../../../../shaders/post.wgsl")),
];

/// Files that make up a shader module, in order.
pub const SCENE: [&str; 17] = [
    "frame.wgsl",
    "sky.wgsl",
    "brdf.wgsl",
    "reflection.wgsl",
    "toon.wgsl",
    "displace.wgsl",
    "wide.wgsl",
    "pose.wgsl",
    "vertex.wgsl",
    "triplanar.wgsl",
    "layers.wgsl",
    "refraction.wgsl",
    "shadow.wgsl",
    "peel.wgsl",
    "deferred.wgsl",
    "surface.wgsl",
    "scene.wgsl",
];
pub const POSED: [&str; 4] = ["frame.wgsl", "brdf.wgsl", "pose.wgsl", "posed.wgsl"];
pub const OVERLAY: [&str; 2] = ["frame.wgsl", "overlay.wgsl"];
pub const BACKGROUND: [&str; 3] = ["frame.wgsl", "surface.wgsl", "background.wgsl"];
pub const UNDER: [&str; 4] = ["frame.wgsl", "surface.wgsl", "background.wgsl", "under.wgsl"];
/// Modules with the switch `SKY_BACKGROUND`.
pub const SKY: [&str; 4] = ["frame.wgsl", "surface.wgsl", "background.wgsl", "sky.wgsl"];

/// One file's text, before preprocessing.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceFile {
    pub name: String,
    pub text: String,
}

impl ShaderSources {
    /// Reads the folder's modules.
    pub fn read(folder: Option<PathBuf>) -> Result<ShaderSources, RenderError> {
        /// More than any module has.
        const MOST_BYTES: u64 = 4 << 20;
        let mut texts = Vec::new();
        if let Some(folder) = &folder {
            // One that is not there holds no module.
            let opened = Folder::open(folder).ok();
            for (module, _) in EMBEDDED {
                let Some(opened) = &opened else { break };
                let name = folder.join(module).display().to_string();
                let failed = |why: String| RenderError::Shader { file: name.clone(), text: why };
                let bytes = match opened.read(Path::new(module), MOST_BYTES) {
                    Ok(bytes) => bytes,
                    // A folder may hold only the modules that somebody is editing.
                    Err(e) if e.is_missing() => continue,
                    Err(e) => return Err(failed(format!("cannot read: {e}"))),
                };
                let text = String::from_utf8(bytes).map_err(|_| failed("it is no UTF-8 text".into()))?;
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
        let (_, text) = EMBEDDED.iter().find(|(n, _)| *n == name).ok_or_else(|| RenderError::Shader {
            file: name.into(),
            text: "no such module in the program".into(),
        })?;
        Ok(SourceFile { name: format!("shaders/{name}"), text: (*text).into() })
    }

    pub fn files(&self, names: &[&str]) -> Result<Vec<SourceFile>, RenderError> {
        names.iter().map(|n| self.file(n)).collect()
    }

    /// The text that a full-screen effect is compiled from: our template, then the plugin's function. With the switch
    /// `TEXTURES`, where it reads any.
    pub fn post(
        &self,
        effect: &str,
        wgsl: &str,
        number: u32,
        textures: bool,
    ) -> Result<Vec<SourceFile>, RenderError> {
        let mut files = vec![self.file("post.wgsl")?];
        if textures {
            files.push(self.file("textures.wgsl")?);
        }
        files.push(SourceFile { name: format!("effect \"{effect}\""), text: wgsl.into() });
        let run = format!("const post_run: u32 = {number}u;\n");
        files.push(SourceFile { name: "number of the run".into(), text: run });
        Ok(files)
    }
}

/// Which lights a lit pixel asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LightLoop {
    /// The only one.
    One,
    All,
    /// Those of [`crate::plan::light_clusters`].
    Lists,
}

/// What a scene shader is compiled for: the plan's key and what the recording found out beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneVariant {
    pub key: PipelineKey,
    /// Some instance has a tint other than white.
    pub tint: bool,
    /// All joint matrices fit a uniform buffer, which is read faster than a storage buffer.
    pub joints_uniform: bool,
    /// Exactly one light shines.
    pub lights: LightLoop,
    /// Depth alone, into a shadow map.
    pub shadow_pass: bool,
    pub peel: PeelPass,
    pub deferred: DeferredPass,
}

/// Finds the depths of a layer of transparent surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PeelPass {
    #[default]
    No,
    /// One sample per pixel.
    One,
    /// Several samples: each is a fragment of its own.
    Several,
}

/// Which half of deferred shading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum DeferredPass {
    /// Forward: both at once.
    #[default]
    No,
    /// What light needs of the nearest surface is kept.
    Geometry,
    /// What was kept is lit.
    Light,
}

/// Names of the switches that are on, as the modules write them.
pub fn switches(variant: &SceneVariant) -> Vec<&'static str> {
    let names: [(&'static str, Features); 60] = [
        ("SKIN", Features::SKIN),
        ("SKIN_8", Features::SKIN_8),
        ("SKIN_DUAL", Features::SKIN_DUAL),
        ("SKIN_PLACED", Features::SKIN_PLACED),
        ("MORPH", Features::MORPH),
        ("POSED", Features::POSED),
        ("VERTEX_COLOR", Features::VERTEX_COLOR),
        ("UV0", Features::UV0),
        ("UV1", Features::UV1),
        ("METALLIC_ROUGHNESS", Features::METALLIC_ROUGHNESS),
        ("BLINN_PHONG", Features::BLINN_PHONG),
        ("TOON", Features::TOON),
        ("BASE_COLOR_TEXTURE", Features::BASE_COLOR_TEXTURE),
        ("METALLIC_ROUGHNESS_TEXTURE", Features::METALLIC_ROUGHNESS_TEXTURE),
        ("NORMAL_TEXTURE", Features::NORMAL_TEXTURE),
        ("OCCLUSION_TEXTURE", Features::OCCLUSION_TEXTURE),
        ("EMISSIVE", Features::EMISSIVE),
        ("EMISSIVE_TEXTURE", Features::EMISSIVE_TEXTURE),
        ("SPECULAR_TEXTURE", Features::SPECULAR_TEXTURE),
        ("SPECULAR_COLOR_TEXTURE", Features::SPECULAR_COLOR_TEXTURE),
        ("ALPHA_MASK", Features::ALPHA_MASK),
        ("UV_TRANSFORM", Features::UV_TRANSFORM),
        ("LOCAL_LIGHTS", Features::LOCAL_LIGHTS),
        ("SHADOW", Features::SHADOW),
        ("SKY", Features::SKY),
        ("PHONG", Features::PHONG),
        ("REFLECTION", Features::REFLECTION),
        ("POLYNOMIAL", Features::POLYNOMIAL),
        ("LAYERS", Features::LAYERS),
        ("CLEARCOAT", Features::CLEARCOAT),
        ("CLEARCOAT_TEXTURE", Features::CLEARCOAT_TEXTURE),
        ("CLEARCOAT_ROUGHNESS_TEXTURE", Features::CLEARCOAT_ROUGHNESS_TEXTURE),
        ("CLEARCOAT_NORMAL_TEXTURE", Features::CLEARCOAT_NORMAL_TEXTURE),
        ("SHEEN", Features::SHEEN),
        ("SHEEN_COLOR_TEXTURE", Features::SHEEN_COLOR_TEXTURE),
        ("SHEEN_ROUGHNESS_TEXTURE", Features::SHEEN_ROUGHNESS_TEXTURE),
        ("TRANSMISSION", Features::TRANSMISSION),
        ("TRANSMISSION_TEXTURE", Features::TRANSMISSION_TEXTURE),
        ("VOLUME", Features::VOLUME),
        ("THICKNESS_TEXTURE", Features::THICKNESS_TEXTURE),
        ("REFRACTION", Features::REFRACTION),
        ("DISPERSION", Features::DISPERSION),
        ("RELIEF", Features::RELIEF),
        ("SHELL", Features::SHELL),
        ("EDGES", Features::EDGES),
        ("WIDE", Features::WIDE),
        ("TRIPLANAR", Features::TRIPLANAR),
        ("SEEN_NORMALS", Features::SEEN_NORMALS),
        ("SEEN_JOINTS", Features::SEEN_JOINTS),
        ("SEEN_SHADOW", Features::SEEN_SHADOW),
        ("OUTLINE_WIDTH_TEXTURE", Features::OUTLINE_WIDTH_TEXTURE),
        ("UV_MASK", Features::UV_MASK),
        ("IRIDESCENCE", Features::IRIDESCENCE),
        ("IRIDESCENCE_TEXTURE", Features::IRIDESCENCE_TEXTURE),
        ("IRIDESCENCE_THICKNESS_TEXTURE", Features::IRIDESCENCE_THICKNESS_TEXTURE),
        ("ANISOTROPY", Features::ANISOTROPY),
        ("ANISOTROPY_TEXTURE", Features::ANISOTROPY_TEXTURE),
        ("DIFFUSE_TRANSMISSION", Features::DIFFUSE_TRANSMISSION),
        ("DIFFUSE_TRANSMISSION_TEXTURE", Features::DIFFUSE_TRANSMISSION_TEXTURE),
        ("DIFFUSE_TRANSMISSION_COLOR_TEXTURE", Features::DIFFUSE_TRANSMISSION_COLOR_TEXTURE),
    ];
    let key = &variant.key;
    let mut on: Vec<&'static str> =
        names.iter().filter(|(_, f)| key.features.has(*f)).map(|(n, _)| *n).collect();
    let extra = [
        ("LIT", key.features.is_lit()),
        ("NORMAL", key.features.has_normals()),
        ("TANGENT", key.features.has_tangents()),
        ("SURFACE", key.surface != 0),
        ("DISPLACED", key.displaced != 0),
        ("LIGHTING", key.lighting != 0),
        ("EFFECTS", key.effects() != 0),
        ("PLACE", key.features.is_lit() || key.surface != 0),
        ("NORMAL_OUT", key.features.is_lit() || key.features.has(Features::SEEN_NORMALS)),
        ("GLASS", matches!(key.glass, Glass::Filter | Glass::Light)),
        ("GLASS_FILTER", key.glass == Glass::Filter),
        ("GLASS_LIGHT", key.glass == Glass::Light),
        ("BLEND", key.blend),
        ("COVERAGE", key.coverage),
        ("DOUBLE_SIDED", key.double_sided),
        ("TINT", variant.tint),
        ("JOINTS_UNIFORM", variant.joints_uniform),
        ("SHADOW_PASS", variant.shadow_pass),
        ("PEELED", key.peeled),
        ("GEOMETRY", variant.deferred == DeferredPass::Geometry),
        ("LIGHT_PASS", variant.deferred == DeferredPass::Light),
        ("PEEL_PASS", variant.peel != PeelPass::No),
        ("MULTISAMPLED", variant.peel == PeelPass::Several),
        ("ONE_LIGHT", variant.lights == LightLoop::One && key.features.is_lit()),
        ("LIGHT_LISTS", variant.lights == LightLoop::Lists && key.features.is_lit()),
    ];
    on.extend(extra.iter().filter(|(_, is_on)| *is_on).map(|(n, _)| *n));
    on
}
