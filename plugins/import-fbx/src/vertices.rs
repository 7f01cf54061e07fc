//! Faces to triangles, face vertices to vertices: one primitive for each material of a mesh.

use crate::convert::vec3;
use crate::file::File;
use crate::geometry::Geometry;
use crate::materials::MaterialDraft;
use crate::morphs::Target;
use crate::skinning::Weights;
use choreo_asset::{MorphTarget, Primitive};
use choreo_importer_kit::text::count;
use choreo_importer_kit::weld::Welder;
use choreo_importer_kit::{Result, normals, tangents};
use glam::{Vec2, Vec3, Vec4};
use ufbx::{Face, Mesh, MeshPart, VertexVec2, VertexVec3, VertexVec4};

/// Attributes of the points of a mesh besides their positions.
#[derive(Clone, Copy)]
pub(crate) struct PointAttributes<'a> {
    pub weights: Option<&'a Weights>,
    pub targets: &'a [Target],
    pub geometry: Option<&'a Geometry>,
}

pub(crate) fn build_primitives(
    file: &File<'_>,
    mesh: &Mesh,
    slots: &[u32],
    materials: &[MaterialDraft],
    point_attributes: PointAttributes<'_>,
    place: &dyn Fn() -> String,
) -> Result<Vec<Primitive>> {
    let uv_sets = uv_sets(file, mesh, slots, materials, place);
    file.charge(mesh.num_vertices, 8, place)?;
    let mut welder = Welder::default();
    let mut out = Vec::new();
    for part in &mesh.material_parts {
        let material = slots.get(part.index as usize).copied().filter(|m| (*m as usize) < materials.len());
        let builder = PrimitiveBuilder {
            file,
            mesh,
            point_attributes,
            uv_sets: &uv_sets,
            welder: &mut welder,
            point_of_vertex: Vec::new(),
            out: Primitive { material, ..Primitive::default() },
        };
        let normal_map = material.and_then(|m| materials[m as usize].material.normal_texture.as_ref());
        if let Some(primitive) = builder.build(part, normal_map.map(|t| t.uv_set), place)? {
            out.push(primitive);
        }
    }
    Ok(out)
}

/// The two texture coordinate sets of a primitive: the mesh's first one, and the one that its materials name (by default the
/// second).
fn uv_sets<'m>(
    file: &File<'_>,
    mesh: &'m Mesh,
    slots: &[u32],
    materials: &[MaterialDraft],
    place: &dyn Fn() -> String,
) -> [Option<&'m VertexVec2>; 2] {
    let sets = mesh.uv_sets.as_ref();
    let mut named: Vec<usize> = Vec::new();
    for name in slots.iter().filter_map(|m| materials.get(*m as usize)).flat_map(|m| &m.uv_names) {
        match sets.iter().position(|set| set.name.as_ref() == name) {
            Some(set) if set > 0 && !named.contains(&set) => named.push(set),
            _ => {}
        }
    }
    if named.len() > 1 {
        let what = format!(
            "its materials use {} sets of texture coordinates; the first two are read",
            named.len() + 1
        );
        file.notes.warn(place(), what);
    }
    let second = named.first().copied().unwrap_or(1);
    [sets.first(), sets.get(second)].map(|set| set.map(|s| &s.vertex_uv).filter(|uv| uv.exists))
}

struct PrimitiveBuilder<'a, 'f> {
    file: &'a File<'f>,
    mesh: &'a Mesh,
    point_attributes: PointAttributes<'a>,
    uv_sets: &'a [Option<&'a VertexVec2>; 2],
    welder: &'a mut Welder,
    /// The point of the mesh that each vertex came from.
    point_of_vertex: Vec<u32>,
    out: Primitive,
}

/// Values of one vertex of a face, which may differ from face to face.
#[derive(Clone, Copy)]
struct FaceVertex {
    normal: Vec3,
    uv: [Vec2; 2],
    color: Vec4,
}

impl PrimitiveBuilder<'_, '_> {
    fn build(
        mut self,
        part: &MeshPart,
        normal_map: Option<u8>,
        place: &dyn Fn() -> String,
    ) -> Result<Option<Primitive>> {
        if part.num_triangles == 0 || self.mesh.num_vertices == 0 {
            return Ok(None);
        }
        self.welder.start(self.mesh.num_vertices);
        // An upper bound: no vertices are shared, and 120 bytes hold a vertex without skin and morphs.
        let skin = self.point_attributes.weights.map_or(0, |w| w.influences * 6);
        let morphs: usize =
            self.point_attributes.targets.iter().map(|t| if t.normals.is_empty() { 12 } else { 24 }).sum();
        self.file.charge(part.num_triangles, 12, place)?;
        self.add_triangles(part);
        self.file.charge(self.out.positions.len(), 120 + skin + morphs, place)?;
        if self.out.positions.is_empty() {
            return Ok(None);
        }
        self.repair_attributes(place);
        self.add_skin_weights();
        self.add_morph_targets();
        let mut out = self.out;
        if let Some(set) = normal_map {
            let uvs = &out.uvs[usize::from(set).min(1)];
            if uvs.is_empty() {
                self.file
                    .notes
                    .warn(place(), "its material has a normal map, but it has no texture coordinates");
            } else {
                self.file.charge(out.indices.len(), 72 + skin + morphs, place)?;
                tangents::add(&mut out, usize::from(set).min(1));
            }
        }
        Ok(Some(out))
    }

    fn add_triangles(&mut self, part: &MeshPart) {
        let mesh = self.mesh;
        let mut face_vertices: Vec<u32> = Vec::new();
        let holes = mesh.face_hole.as_ref();
        for face_index in part.face_indices.as_ref() {
            let Some(&Face { index_begin, num_indices }) = mesh.faces.as_ref().get(*face_index as usize)
            else {
                continue;
            };
            if num_indices < 3 || holes.get(*face_index as usize) == Some(&true) {
                continue;
            }
            if num_indices == 3 {
                (index_begin..index_begin + 3).for_each(|face_vertex| self.add_face_vertex(face_vertex));
                continue;
            }
            face_vertices.clear();
            face_vertices.resize((num_indices as usize - 2) * 3, 0);
            let count = mesh.triangulate_face(&mut face_vertices, Face { index_begin, num_indices });
            face_vertices
                .iter()
                .take(count as usize * 3)
                .for_each(|face_vertex| self.add_face_vertex(*face_vertex));
        }
        if self.point_attributes.geometry.is_some_and(|g| g.mirrors) {
            self.out.indices.chunks_exact_mut(3).for_each(|t| t.swap(1, 2));
        }
        // Triangles are always complete: `add_face_vertex` skips no single vertex of a face.
        debug_assert!(self.out.indices.len().is_multiple_of(3));
    }

    fn add_face_vertex(&mut self, index: u32) {
        let mesh = self.mesh;
        let at = index as usize;
        // ufbx has clamped the indices to the valid range.
        let point =
            mesh.vertex_indices.as_ref().get(at).copied().unwrap_or(0).min(mesh.num_vertices as u32 - 1);
        let values = FaceVertex {
            normal: vec3_at(&mesh.vertex_normal, at).map_or(Vec3::ZERO, |n| {
                match self.point_attributes.geometry {
                    Some(geometry) => geometry.normal(n),
                    None => vec3(n),
                }
            }),
            uv: self.uv_sets.map(|set| {
                // FBX has v pointing up; here it points down.
                set.and_then(|s| vec2_at(s, at))
                    .map_or(Vec2::ZERO, |v| Vec2::new(v.x as f32, (1.0 - v.y) as f32))
            }),
            color: match self.file.vertex_colors {
                true => vec4_at(&mesh.vertex_color, at)
                    .map_or(Vec4::ONE, |c| Vec4::new(c.x as f32, c.y as f32, c.z as f32, c.w as f32)),
                false => Vec4::ONE,
            },
        };
        let (out, uv_sets) = (&self.out, self.uv_sets);
        let (vertex, new) = self.welder.vertex(point, |vertex| {
            let at = vertex as usize;
            out.normals[at] == values.normal
                && (0..2).all(|set| uv_sets[set].is_none() || out.uvs[set][at] == values.uv[set])
                && out.colors.get(at).is_none_or(|color| *color == values.color)
        });
        if new {
            self.push_vertex(point, values);
        }
        self.out.indices.push(vertex);
    }

    fn push_vertex(&mut self, point: u32, values: FaceVertex) {
        let place = |p: &ufbx::Vec3| self.point_attributes.geometry.map_or_else(|| vec3(p), |g| g.point(p));
        let position = self.mesh.vertices.as_ref().get(point as usize).map_or(Vec3::ZERO, place);
        self.out.positions.push(position);
        self.out.normals.push(values.normal);
        for set in 0..2 {
            if self.uv_sets[set].is_some() {
                self.out.uvs[set].push(values.uv[set]);
            }
        }
        if self.file.vertex_colors && self.mesh.vertex_color.exists {
            self.out.colors.push(values.color);
        }
        self.point_of_vertex.push(point);
    }

    fn repair_attributes(&mut self, place: &dyn Fn() -> String) {
        for color in &mut self.out.colors {
            let finite =
                if color.is_finite() { color.clamp(Vec4::ZERO, Vec4::splat(1e4)) } else { Vec4::ONE };
            let rgb = finite.truncate().to_array().map(choreo_asset::linear_from_srgb_f32);
            *color = Vec3::from(rgb).extend(finite.w.min(1.0));
        }
        for uv in self.out.uvs.iter_mut().flatten().filter(|uv| !uv.is_finite()) {
            *uv = Vec2::ZERO;
        }
        let mut zero = 0;
        for normal in &mut self.out.normals {
            *normal = normals::unit(*normal).unwrap_or_else(|| {
                zero += 1;
                Vec3::Y
            });
        }
        if zero > 0 {
            self.file.notes.warn(place(), format!("{} of length 0; +Y is used", count(zero, "normal")));
        }
    }

    fn add_skin_weights(&mut self) {
        let Some(weights) = self.point_attributes.weights else { return };
        let n = weights.influences;
        self.out.influences = n;
        self.out.joint_indices.reserve(self.point_of_vertex.len() * n);
        self.out.joint_weights.reserve(self.point_of_vertex.len() * n);
        for point in &self.point_of_vertex {
            let range = *point as usize * n..(*point as usize + 1) * n;
            self.out.joint_indices.extend_from_slice(&weights.joints[range.clone()]);
            self.out.joint_weights.extend_from_slice(&weights.weights[range]);
        }
    }

    fn add_morph_targets(&mut self) {
        for target in self.point_attributes.targets {
            let moves = |offsets: &[Vec3]| -> Vec<Vec3> {
                let get = |p: &u32| offsets.get(*p as usize).copied().unwrap_or(Vec3::ZERO);
                match self.point_of_vertex.iter().any(|p| get(p) != Vec3::ZERO) {
                    true => self.point_of_vertex.iter().map(get).collect(),
                    false => Vec::new(),
                }
            };
            self.out.morphs.push(MorphTarget {
                positions: moves(&target.positions),
                normals: moves(&target.normals),
                tangents: Vec::new(),
            });
        }
    }
}

fn vec2_at(a: &VertexVec2, index: usize) -> Option<&ufbx::Vec2> {
    a.values.as_ref().get(*a.indices.as_ref().get(index)? as usize)
}

fn vec3_at(a: &VertexVec3, index: usize) -> Option<&ufbx::Vec3> {
    a.values.as_ref().get(*a.indices.as_ref().get(index)? as usize)
}

fn vec4_at(a: &VertexVec4, index: usize) -> Option<&ufbx::Vec4> {
    a.values.as_ref().get(*a.indices.as_ref().get(index)? as usize)
}
