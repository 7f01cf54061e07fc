//! Meshes: vertex arrays, indices, morph targets.

use glam::{Vec2, Vec3, Vec4};

/// Primitives that are placed together, and share morph targets.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name in the file.
    pub name: String,
    /// The parts of the mesh, one material each.
    pub primitives: Vec<Primitive>,
    /// Number of morph targets, the same in every primitive.
    pub morph_targets: usize,
    /// Names of the morph targets; may be fewer than there are.
    pub morph_names: Vec<String>,
}

/// Type of the elements that indices form.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    /// Three indices each; counter-clockwise front faces.
    #[default]
    Triangles,
    /// Two indices each.
    Lines,
    /// One index each.
    Points,
}

/// Vertex arrays of equal length and an index list. Every index is in range (importers check).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Primitive {
    /// Type of the elements that `indices` form.
    pub topology: Topology,
    /// Vertex indices, always present: importers number the vertices of unindexed primitives.
    pub indices: Vec<u32>,
    /// Undeformed positions in mesh space, metres.
    pub positions: Vec<Vec3>,
    /// Unit normals in mesh space. Importers compute flat normals if the file has none (glTF 2.0 §3.7.2.1); empty for lines and
    /// points without normals.
    pub normals: Vec<Vec3>,
    /// Unit tangents in xyz, bitangent sign ±1 in w; present only if the material has a normal map.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates, v down; empty where there are none.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA, multiplied into the base color; empty = white.
    pub colors: Vec<Vec4>,
    /// Number of joints that influence each vertex: 0, 4 or 8.
    pub influences: usize,
    /// Indices into the skin's joint list, `influences` per vertex.
    pub joint_indices: Vec<u16>,
    /// Skinning weights, `influences` per vertex, with sum 1 (importers normalize; a vertex whose weights sum to zero gets weight
    /// 1 on its first joint, with a warning).
    pub joint_weights: Vec<f32>,
    /// Morph targets; each has as many vertices as the primitive.
    pub morphs: Vec<MorphTarget>,
    /// Index into the asset's materials; `None`: the default material.
    pub material: Option<u32>,
}

/// Offsets at weight 1; empty lists mean no change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Offsets of the positions, metres; empty where there are none.
    pub positions: Vec<Vec3>,
    /// Offsets of the normals; empty where there are none.
    pub normals: Vec<Vec3>,
    /// Offsets of the tangents; empty where there are none.
    pub tangents: Vec<Vec3>,
}
