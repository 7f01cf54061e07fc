//! The key of a scene shader: the plan's pipeline key, and properties that only the recording knows.

use crate::plan::PipelineKey;
use naga::ShaderStage;

/// The lights that a lit pixel evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LightLoop {
    /// The only light of the frame, without a loop.
    One,
    All,
    /// The lights of the pixel's light cluster.
    Clusters,
}

/// Everything that a scene shader is compiled for: the plan's key, and properties that only the recording knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneVariant {
    pub key: PipelineKey,
    /// Whether some instance has a tint other than white.
    pub tint: bool,
    /// Whether all joint matrices fit a uniform buffer, which is read faster than a storage buffer.
    pub joints_uniform: bool,
    pub lights: LightLoop,
    /// Whether only depth is drawn, into a shadow map.
    pub shadow_pass: bool,
    pub peel: PeelPass,
    pub deferred: DeferredPass,
    pub inputs: InputTargets,
}

impl SceneVariant {
    /// Forward shading with a key, without tint, by all lights.
    pub const fn of(key: PipelineKey) -> SceneVariant {
        SceneVariant {
            key,
            tint: false,
            joints_uniform: false,
            lights: LightLoop::All,
            shadow_pass: false,
            peel: PeelPass::No,
            deferred: DeferredPass::No,
            inputs: InputTargets::No,
        }
    }
}

/// Entry points of a scene shader with these switches.
pub fn entry_points(on: &[&str]) -> Vec<(&'static str, ShaderStage)> {
    let has = |name: &str| on.contains(&name);
    let vertex = if has("LIGHT_PASS") { "light_vs" } else { "vs" };
    let fragment = match has("SHADOW_PASS") {
        _ if has("PEEL_PASS") => Some("peel_fs"),
        _ if has("INPUT_PASS") => Some("inputs_fs"),
        // Only cut-outs need a fragment shader in a shadow map.
        true => has("ALPHA_MASK").then_some("shadow_fs"),
        false => Some("fs"),
    };
    let fragment = fragment.map(|name| (name, ShaderStage::Fragment));
    [(vertex, ShaderStage::Vertex)].into_iter().chain(fragment).collect()
}

/// Kind of depth pass that finds a peeled layer, if any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PeelPass {
    #[default]
    No,
    /// One sample per pixel.
    One,
    /// Several samples per pixel: each is a fragment of its own.
    Several,
}

/// The part of deferred shading that a shader does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum DeferredPass {
    /// Forward shading: surface and lighting at once.
    #[default]
    No,
    /// Renders to the G-buffer.
    Geometry,
    /// Lights the G-buffer.
    Light,
}

/// Kind of pass that draws the inputs of effects on images, if any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum InputTargets {
    #[default]
    No,
    /// Normals and depth.
    Surface,
    /// Motion vectors and actors too.
    Motion,
}
