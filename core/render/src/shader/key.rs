//! What a scene shader is compiled for: the pipeline key that a plan gives a draw, and what the recording adds to it.

use super::features::Features;
use choreo_asset::Topology;
use naga::ShaderStage;

/// Selects a pipeline. A scene needs as few different ones as possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PipelineKey {
    pub features: Features,
    pub topology: TopologyKey,
    /// Both faces are drawn (double-sided material).
    pub double_sided: bool,
    /// The transform mirrors: front faces are clockwise.
    pub mirrored: bool,
    /// Blended by alpha.
    pub blend: bool,
    /// Alpha to coverage: cut-outs keep samples instead of whole pixels.
    pub coverage: bool,
    /// Depth-peeled: blended in its layer of `Plan::peel`.
    pub peeled: bool,
    pub glass: Glass,
    /// Bits of the effects of `Plan::surface` that change the surface's color.
    pub surface: u8,
    /// Bits of those that move its vertices.
    pub displaced: u8,
    /// Bits of those that decide what light does on it.
    pub lighting: u8,
}

impl PipelineKey {
    /// Opaque triangles seen from the front, with these features and no effect.
    pub const fn of(features: Features) -> PipelineKey {
        PipelineKey {
            features,
            topology: TopologyKey::Triangles,
            double_sided: false,
            mirrored: false,
            blend: false,
            coverage: false,
            peeled: false,
            glass: Glass::No,
            surface: 0,
            displaced: 0,
            lighting: 0,
        }
    }

    /// Whether it is transparent: drawn back to front after everything opaque.
    pub fn is_see_through(&self) -> bool {
        self.blend || self.glass != Glass::No
    }

    /// Without lighting effects where they do not count: on unlit surfaces and on MToon, which has its own lighting.
    pub fn of_lit(self) -> PipelineKey {
        let lit = self.features.is_lit() && !self.features.has(Features::TOON);
        PipelineKey { lighting: if lit { self.lighting } else { 0 }, ..self }
    }

    /// All effects of `Plan::surface` that its shader calls.
    pub fn effects(&self) -> u8 {
        self.surface | self.displaced | self.lighting
    }

    /// Blended surfaces leave the depth as it is.
    pub fn writes_depth(&self) -> bool {
        !self.blend && matches!(self.glass, Glass::No | Glass::Refract)
    }
}

/// How light passes through a surface. Thin glass is drawn twice, `Filter` before `Light`; refracting glass once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Glass {
    #[default]
    No,
    /// The scene behind is multiplied by the color that the glass transmits.
    Filter,
    /// The light of the surface itself is added.
    Light,
    /// Shows itself and, through itself, the scene color copy.
    Refract,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TopologyKey {
    Triangles,
    Lines,
    Points,
}

impl From<Topology> for TopologyKey {
    fn from(t: Topology) -> Self {
        match t {
            Topology::Triangles => TopologyKey::Triangles,
            Topology::Lines => TopologyKey::Lines,
            Topology::Points => TopologyKey::Points,
        }
    }
}

/// The lights that a lit pixel evaluates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LightLoop {
    /// The only one.
    One,
    All,
    /// Those of the pixel's light cluster.
    Lists,
}

/// All that a scene shader is compiled for: the plan's key, and what the recording knows beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneVariant {
    pub key: PipelineKey,
    /// Some instance has a tint other than white.
    pub tint: bool,
    /// All joint matrices fit a uniform buffer, which is read faster than a storage buffer.
    pub joints_uniform: bool,
    pub lights: LightLoop,
    /// Depth alone, into a shadow map.
    pub shadow_pass: bool,
    pub peel: PeelPass,
    pub deferred: DeferredPass,
}

impl SceneVariant {
    /// Forward shading of a key, without tint, by all lights.
    pub const fn of(key: PipelineKey) -> SceneVariant {
        SceneVariant {
            key,
            tint: false,
            joints_uniform: false,
            lights: LightLoop::All,
            shadow_pass: false,
            peel: PeelPass::No,
            deferred: DeferredPass::No,
        }
    }
}

/// Entry points of a scene shader with these switches.
pub fn entry_points(on: &[&str]) -> Vec<(&'static str, ShaderStage)> {
    let has = |name: &str| on.contains(&name);
    let vertex = if has("LIGHT_PASS") { "light_vs" } else { "vs" };
    let fragment = match has("SHADOW_PASS") {
        _ if has("PEEL_PASS") => Some("peel_fs"),
        // Only cut-outs need a fragment shader in a shadow map.
        true => has("ALPHA_MASK").then_some("shadow_fs"),
        false => Some("fs"),
    };
    let fragment = fragment.map(|name| (name, ShaderStage::Fragment));
    [(vertex, ShaderStage::Vertex)].into_iter().chain(fragment).collect()
}

/// Whether a pass finds the depths of a peeled layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PeelPass {
    #[default]
    No,
    /// With one sample a pixel.
    One,
    /// With several: each is a fragment of its own.
    Several,
}

/// Which half of deferred shading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum DeferredPass {
    /// Forward: both at once.
    #[default]
    No,
    /// Renders to the G-buffer.
    Geometry,
    /// Lights the G-buffer.
    Light,
}
