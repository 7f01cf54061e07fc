//! Thick lines and points as screen triangles; see [`crate::scene_resources::thick_lines`].

use super::setup::{PrimitiveAssembly, Triangle};
use super::vertex::Vertex;
use crate::plan::{Features, PipelineKey, TopologyKey};
use crate::scene_resources::thick_lines::{ThickLineExpander, thick_mesh};
use choreo_asset::Primitive;
use glam::Mat4;

/// Screen triangles of a primitive's lines or points. `vertices`: the vertices of the primitive, which the triangles index.
pub(super) fn thick_line_triangles(
    primitive: &Primitive,
    vertices: &[Vertex],
    pipeline: PipelineKey,
    width: f32,
    clip_from_relative: &Mat4,
    size: [u32; 2],
) -> Vec<Triangle> {
    let wide = thick_mesh(primitive, pipeline.features.has(Features::ROUND_LINES));
    let expander = ThickLineExpander::new(clip_from_relative, size);
    let expanded_vertex = |i: usize| {
        let [own, other] = [wide.source_vertices[i], wide.other_ends[i]].map(|v| &vertices[v as usize]);
        Vertex { clip: expander.expand_vertex(own.clip, other.clip, wide.offsets[i], width), ..*own }
    };
    let expanded_vertices: Vec<Vertex> = (0..wide.source_vertices.len()).map(expanded_vertex).collect();
    let pipeline = PipelineKey { topology: TopologyKey::Triangles, ..pipeline };
    let mut out =
        PrimitiveAssembly { vertices: &expanded_vertices, indices: &wide.indices, pipeline, size }.run();
    // All triangle vertices at one end of a line share the interpolated values of that end.
    out.iter_mut().for_each(|t| t.vertices = t.vertices.map(|i| wide.source_vertices[i as usize]));
    out
}
