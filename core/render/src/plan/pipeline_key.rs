//! The key that selects a pipeline. A scene needs as few different keys as possible.

use crate::plan::Features;
use choreo_asset::Topology;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PipelineKey {
    pub features: Features,
    pub topology: TopologyKey,
    /// Whether no faces are culled (double-sided material).
    pub double_sided: bool,
    /// Whether the transform mirrors, so that front faces are clockwise.
    pub mirrored: bool,
    /// Whether the surface is blended over the image by its alpha.
    pub blend: bool,
    /// Whether cut-outs use alpha to coverage, which keeps samples instead of whole pixels.
    pub coverage: bool,
    /// Whether the surface is blended in its depth-peeling layer ([`crate::plan::Plan::depth_peeling`]).
    pub peeled: bool,
    pub glass: Glass,
    /// Bits of the effects in `Plan::scene_effects` that change the surface's color.
    pub surface: u8,
    /// Bits of the effects that displace vertices.
    pub displaced: u8,
    /// Bits of the effects that replace the lighting.
    pub lighting: u8,
}

impl PipelineKey {
    /// Opaque, single-sided triangles with these features and no effect.
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

    /// Whether the surface is transparent, and so drawn back to front after all opaque ones.
    pub fn is_transparent(&self) -> bool {
        self.blend || self.glass != Glass::No
    }

    /// The key without lighting effects if the surface is unlit or toon-shaded.
    pub(crate) fn of_lit(self) -> PipelineKey {
        let lit = self.features.is_lit() && !self.features.has(Features::TOON);
        PipelineKey { lighting: if lit { self.lighting } else { 0 }, ..self }
    }

    /// Bits of all effects that the shader calls.
    pub fn effects(&self) -> u8 {
        self.surface | self.displaced | self.lighting
    }

    /// Whether the surface writes depth. Blended surfaces do not.
    pub(crate) fn writes_depth(&self) -> bool {
        !self.blend && matches!(self.glass, Glass::No | Glass::Refract)
    }
}

/// How a surface transmits light. Thin surfaces are drawn twice, `Filter` before `Light`; refracting ones once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Glass {
    #[default]
    No,
    /// Multiplies the image behind by the transmitted color.
    Filter,
    /// Adds the light that the surface reflects and emits.
    Light,
    /// Draws the surface with [`crate::plan::Plan::scene_color_copy`] refracted in it.
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
