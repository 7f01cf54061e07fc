//! Draco-compressed primitives (KHR_draco_mesh_compression), decoded to the form of accessors.

use crate::accessor::Decoded;
use crate::file::File;
use crate::problem::{Problem, Result, element};
use crate::repair::as_integer;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf::json::accessor::ComponentType;
use gltf::json::mesh::Primitive;
use gltf::json::validation::Checked;
use serde_json::Value;
use std::collections::BTreeMap;

pub(crate) const NAME: &str = "KHR_draco_mesh_compression";

/// Working memory of the decoder for each triangle, bytes: its tables of edges, for each attribute with seams.
const DECODER_BYTES_PER_TRIANGLE: u64 = 200;

/// The contents of a compressed primitive.
#[derive(Default)]
pub(crate) struct Unpacked {
    /// A triangle list, whatever the mode of the primitive.
    pub indices: Option<Vec<u32>>,
    /// Decoded attribute values, by accessor index.
    pub attributes: BTreeMap<usize, Decoded>,
}

/// Decodes a primitive that has no uncompressed data. A file that does not require the extension should have such data too, which
/// is exact and costs less.
pub(crate) fn unpack(file: &File<'_>, primitive: &Primitive, place: &dyn Fn() -> String) -> Result<Unpacked> {
    let extension = primitive.extensions.as_ref().and_then(|e| e.others.get(NAME));
    let Some(extension) = extension.filter(|_| is_needed(file, primitive)) else {
        return Ok(Unpacked::default());
    };
    let place = || format!("{}.{NAME}", place());
    let number = |value: Option<&Value>| value.and_then(as_integer).and_then(|n| usize::try_from(n).ok());
    let view =
        number(extension.get("bufferView")).ok_or_else(|| Problem::new(place(), "has no bufferView"))?;
    let broken = |what: String| {
        Problem::new(place(), format!("cannot be decoded: {what}"))
            .hint("the file is damaged; fetch or export it again")
    };
    let mesh = decode(file, file.view(view, place)?.0, &broken)?;
    let mut out = Unpacked::default();
    let (points, faces) = (mesh.num_points(), mesh.num_faces());
    file.charge(faces as u64, 12).map_err(|p| p.used_by(place()))?;
    out.indices = Some(mesh.faces().iter().flatten().map(|point| point.0).collect());
    for (semantic, accessor) in &primitive.attributes {
        let Checked::Valid(semantic) = semantic else { continue };
        let name = semantic.to_string();
        let id = extension.get("attributes").and_then(|attributes| number(attributes.get(&name)));
        let Some(id) = id else { continue };
        let place = || format!("{}.{name}", place());
        let id = u32::try_from(id).unwrap_or(u32::MAX);
        let attribute = mesh
            .attribute_by_unique_id(id)
            .ok_or_else(|| Problem::new(place(), format!("is attribute {id}, which the data do not have")))?;
        let accessor = accessor.value();
        let (component, width) = accessor_type(file, accessor, &place)?;
        let packed = usize::from(attribute.num_components());
        if packed != width {
            let what = format!("has {packed} components, but accessors[{accessor}] has {width}");
            return Err(Problem::new(place(), what));
        }
        // Counts the floats that the decoder makes, and their bytes.
        file.charge(points as u64, 8 * width).map_err(|p| p.used_by(place()))?;
        let values = attribute.read_f32s(points, width);
        let decoded = Decoded { component, count: points, bytes: component_bytes(&values, component) };
        out.attributes.insert(accessor, decoded);
    }
    Ok(out)
}

/// Whether an accessor of the primitive has no data, so that the primitive must be decoded.
fn is_needed(file: &File<'_>, primitive: &Primitive) -> bool {
    let is_empty = |accessor: usize| {
        let accessor = file.root.accessors.get(accessor);
        accessor.is_some_and(|a| a.buffer_view.is_none() && a.sparse.is_none())
    };
    primitive.attributes.values().chain(&primitive.indices).any(|a| is_empty(a.value()))
}

/// Component type and number of components of an accessor.
fn accessor_type(
    file: &File<'_>,
    accessor: usize,
    place: &dyn Fn() -> String,
) -> Result<(ComponentType, usize)> {
    let json = element(&file.root.accessors, accessor, "accessors", place)?;
    match (json.component_type, json.type_) {
        (Checked::Valid(component), Checked::Valid(shape)) => Ok((component.0, shape.multiplicity())),
        _ => Err(Problem::new(format!("accessors[{accessor}]"), "has an unknown componentType or type")),
    }
}

fn decode(file: &File<'_>, data: &[u8], broken: &dyn Fn(String) -> Problem) -> Result<Mesh> {
    let left = file.budget_left();
    let limits = DecodeLimits::default()
        .with_max_faces(left / DECODER_BYTES_PER_TRIANGLE)
        .with_max_decoded_bytes(left / 4);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(data).with_limits(limits);
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| broken(e.to_string()))?;
    let points = mesh.num_points();
    match mesh.faces().iter().flatten().find(|point| point.0 as usize >= points) {
        Some(point) => {
            Err(broken(format!("a triangle has vertex {}, but the number of vertices is {points}", point.0)))
        }
        None => Ok(mesh),
    }
}

/// Values as bytes of the accessor's component type. Integers up to 2²⁴ are exact as floats.
fn component_bytes(values: &[f32], component: ComponentType) -> Vec<u8> {
    fn encode_each<const N: usize>(values: &[f32], one: impl Fn(f32) -> [u8; N]) -> Vec<u8> {
        values.iter().flat_map(|v| one(*v)).collect()
    }
    match component {
        ComponentType::F32 => encode_each(values, f32::to_le_bytes),
        ComponentType::U8 => encode_each(values, |v| [v as u8]),
        ComponentType::I8 => encode_each(values, |v| (v as i8).to_le_bytes()),
        ComponentType::U16 => encode_each(values, |v| (v as u16).to_le_bytes()),
        ComponentType::I16 => encode_each(values, |v| (v as i16).to_le_bytes()),
        ComponentType::U32 => encode_each(values, |v| (v as u32).to_le_bytes()),
    }
}
