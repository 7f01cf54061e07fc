//! Tangents of meshes whose material has a normal map.

use crate::Notes;
use choreo_asset::{Material, Primitive, Topology};
pub use choreo_plugin::build::tangents::{add, triangle_tangents};

/// Adds tangents to triangles whose material has a normal map; warns of those without texture coordinates.
pub fn add_for_normal_map(p: &mut Primitive, materials: &[Material], notes: &Notes) {
    let material = p.material.and_then(|m| materials.get(m as usize));
    let Some((material, map)) = material.and_then(|m| Some((m, m.normal_texture.as_ref()?))) else { return };
    if p.topology != Topology::Triangles {
        return;
    }
    if p.uvs[usize::from(map.uv_set)].is_empty() {
        let what = "has a normal map, but faces without texture coordinates use it; it has no effect there";
        notes.warn(format!("material \"{}\"", material.name), what);
        return;
    }
    add(p, usize::from(map.uv_set));
}
