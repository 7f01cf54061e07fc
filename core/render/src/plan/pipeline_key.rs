//! The key that selects a pipeline: as few different ones as the scene needs.

use crate::plan::Features;
use choreo_asset::Topology;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PipelineKey {
    pub features: Features,
    pub topology: TopologyKey,
    /// No faces are culled (double-sided material).
    pub double_sided: bool,
    /// The transform mirrors, so front faces are clockwise.
    pub mirrored: bool,
    /// Blended over what is behind it by its alpha.
    pub blend: bool,
    /// Alpha to coverage: cut-outs keep samples instead of whole pixels.
    pub coverage: bool,
    /// Blended in its depth-peeling layer ([`crate::plan::Plan::depth_peeling`]).
    pub peeled: bool,
    pub glass: Glass,
    /// Bits of the effects among `Plan::scene_effects` that change its color.
    pub surface: u8,
    /// Bits of the effects that displace its vertices.
    pub displaced: u8,
    /// Bits of the effects that replace its lighting.
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

    /// Whether it is transparent: drawn back to front after everything opaque.
    pub fn is_transparent(&self) -> bool {
        self.blend || self.glass != Glass::No
    }

    /// The key without lighting effects if no light reaches the surface, or if toon shading has its own.
    pub(crate) fn of_lit(self) -> PipelineKey {
        let lit = self.features.is_lit() && !self.features.has(Features::TOON);
        PipelineKey { lighting: if lit { self.lighting } else { 0 }, ..self }
    }

    /// Bits of all effects that its shader calls.
    pub fn effects(&self) -> u8 {
        self.surface | self.displaced | self.lighting
    }

    /// Blended surfaces leave the depth buffer as it is.
    pub(crate) fn writes_depth(&self) -> bool {
        !self.blend && matches!(self.glass, Glass::No | Glass::Refract)
    }
}

/// How a surface transmits light. Thin surfaces are drawn twice, `Filter` before `Light`; refracting ones once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Glass {
    #[default]
    No,
    /// Multiplies what is behind by the transmitted color.
    Filter,
    /// Adds what the surface itself reflects and emits.
    Light,
    /// Shows itself and, refracted, [`crate::plan::Plan::scene_color_copy`].
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
