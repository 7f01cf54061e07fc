//! The JSON of a glTF file, limited to the parts that an export writes (glTF 2.0, §5).

use serde::Serialize;
use serde_json::Value;

/// Index into one of the document's lists.
pub(crate) type Index = u32;

#[derive(Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Document {
    pub asset: Value,
    pub scene: Index,
    pub scenes: Vec<Scene>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodes: Vec<Node>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<Mesh>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skins: Vec<Skin>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub animations: Vec<Animation>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub materials: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub textures: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub images: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub samplers: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub accessors: Vec<Accessor>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub buffer_views: Vec<BufferView>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub buffers: Vec<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extensions_used: Vec<&'static str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub extensions_required: Vec<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<Value>,
}

#[derive(Default, Serialize)]
pub(crate) struct Scene {
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodes: Vec<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extras: Option<Value>,
}

#[derive(Default, Serialize)]
pub(crate) struct Node {
    pub name: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub children: Vec<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub translation: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f32; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skin: Option<Index>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub weights: Vec<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Index>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<Box<Value>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extras: Option<Box<Value>>,
}

#[derive(Clone, Serialize)]
pub(crate) struct Mesh {
    pub name: String,
    pub primitives: Vec<Primitive>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extras: Option<Value>,
}

#[derive(Clone, Serialize)]
pub(crate) struct Primitive {
    /// Accessor index by attribute name.
    pub attributes: serde_json::Map<String, Value>,
    pub indices: Index,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<Index>,
    /// 0 points, 1 lines, 4 triangles.
    pub mode: u8,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub targets: Vec<serde_json::Map<String, Value>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Skin {
    pub joints: Vec<Index>,
    pub inverse_bind_matrices: Index,
}

#[derive(Default, Serialize)]
pub(crate) struct Animation {
    pub name: String,
    pub channels: Vec<Channel>,
    pub samplers: Vec<Sampler>,
}

#[derive(Serialize)]
pub(crate) struct Channel {
    pub sampler: Index,
    pub target: Target,
}

#[derive(Serialize)]
pub(crate) struct Target {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub node: Option<Index>,
    pub path: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extensions: Option<Box<Value>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub(crate) struct Sampler {
    pub input: Index,
    pub interpolation: &'static str,
    pub output: Index,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Accessor {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub buffer_view: Option<Index>,
    #[serde(skip_serializing_if = "is_zero")]
    pub byte_offset: u64,
    pub component_type: u16,
    pub count: usize,
    #[serde(rename = "type")]
    pub shape: &'static str,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub min: Vec<f32>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub max: Vec<f32>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct BufferView {
    pub buffer: Index,
    pub byte_offset: u64,
    pub byte_length: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u16>,
}

fn is_zero(offset: &u64) -> bool {
    *offset == 0
}
