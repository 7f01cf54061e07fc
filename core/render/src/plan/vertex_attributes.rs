//! Vertex attributes that shader features read.

use crate::plan::Features;
use crate::scene_resources::vertex_layout::VertexLayout;

impl VertexLayout {
    /// The attributes that vertex.wgsl declares for these features.
    pub fn of(features: Features) -> VertexLayout {
        let posed = features.has(Features::PRE_SKINNED);
        let on = [
            !posed,
            features.has_normals() && !posed,
            features.has_tangents() && !posed,
            features.has(Features::UV0),
            features.has(Features::UV1),
            features.has(Features::VERTEX_COLOR),
            features.has(Features::SKIN),
            features.has(Features::SKIN),
            features.has(Features::SKIN_8),
            features.has(Features::SKIN_8),
            features.has(Features::THICK_LINES),
            features.has(Features::THICK_LINES),
        ];
        let flags = [
            (features.has(Features::OUTLINE) && !posed, Self::WELDED),
            (features.has(Features::WIREFRAME), Self::EDGES),
            (features.has(Features::THICK_LINES.with(Features::ROUND_LINES)), Self::ROUND),
        ];
        let attributes = on.iter().enumerate().map(|(i, on)| u16::from(*on) << i);
        VertexLayout(attributes.chain(flags.iter().map(|(on, flag)| if *on { *flag } else { 0 })).sum())
    }
}
