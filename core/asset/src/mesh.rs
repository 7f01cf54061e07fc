//! Meshes: vertex arrays, indices, morph targets.

use glam::{Vec2, Vec3, Vec4};

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub name: String,
    pub primitives: Vec<Primitive>,
    /// Number of morph targets, the same in every primitive.
    pub morph_targets: usize,
    pub morph_names: Vec<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    #[default]
    Triangles,
    Lines,
    Points,
}

/// Vertex arrays of equal length and an index list. Every index is in range (importers check).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Primitive {
    pub topology: Topology,
    /// Always present: importers number the vertices of unindexed primitives.
    pub indices: Vec<u32>,
    pub positions: Vec<Vec3>,
    /// Unit length. Importers compute flat normals where the file has none (glTF 2.0 §3.7.2.1); empty for lines and points without.
    pub normals: Vec<Vec3>,
    /// xyz unit, w = ±1 bitangent sign; present only where the material has a normal map.
    pub tangents: Vec<Vec4>,
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA, multiplied into the base color; empty = white.
    pub colors: Vec<Vec4>,
    /// Indices into the skin's joint list, `influences` a vertex; 0, 4 or 8.
    pub influences: usize,
    pub joint_indices: Vec<u16>,
    /// Sum 1 per vertex (importers normalise; a vertex whose weights sum to zero gets weight 1 on its first joint, with a warning).
    pub joint_weights: Vec<f32>,
    pub morphs: Vec<MorphTarget>,
    pub material: Option<u32>,
}

/// Offsets at weight 1; empty lists mean no change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}
