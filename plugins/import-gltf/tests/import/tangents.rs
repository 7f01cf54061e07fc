//! Tangents made here against those that other programs wrote into files, and against a byte-exact port
//! of the MikkTSpace program.

use crate::common;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use choreo_asset::{Asset, Primitive};
use choreo_plugin::{ImportOptions, ImportScope, Importer};
use glam::Vec4;
use import_gltf::GltfImporter;
use serde_json::{Value, json};
use std::path::Path;

/// Imports with a normal map on every material, with or without the file's own tangents.
fn import(path: &Path, keep_tangents: bool) -> Asset {
    let edit = |json: &mut Value| {
        for material in json["materials"].as_array_mut().unwrap() {
            material["normalTexture"] = json!({ "index": 0 });
        }
        for mesh in json["meshes"].as_array_mut().unwrap() {
            for primitive in mesh["primitives"].as_array_mut().unwrap() {
                if !keep_tangents {
                    primitive["attributes"].as_object_mut().unwrap().remove("TANGENT");
                }
            }
        }
    };
    let bytes = std::fs::read(path).unwrap();
    let bytes = if bytes.starts_with(b"glTF") {
        common::edited(&bytes, |json, _| edit(json))
    } else {
        let mut json = serde_json::from_slice(&bytes).unwrap();
        edit(&mut json);
        serde_json::to_vec(&json).unwrap()
    };
    let source = common::source("edited.glb", bytes);
    let folder = common::Companions::in_folder(path.parent().unwrap().to_path_buf());
    GltfImporter::new().import(&source, &folder, ImportScope::ALL, &ImportOptions::default()).unwrap()
}

/// Difference between two lists of tangents, one for each face vertex.
#[derive(Debug, Default)]
struct Difference {
    face_vertices: usize,
    other_sign: usize,
    above_one_degree: usize,
    worst_degrees: f32,
}

fn difference(ours: impl Iterator<Item = Vec4>, theirs: impl Iterator<Item = Vec4>) -> Difference {
    let mut out = Difference::default();
    for (a, b) in ours.zip(theirs) {
        let degrees = a.truncate().dot(b.truncate()).clamp(-1.0, 1.0).acos().to_degrees();
        out.face_vertices += 1;
        out.other_sign += usize::from(a.w != b.w);
        out.above_one_degree += usize::from(degrees > 1.0);
        out.worst_degrees = out.worst_degrees.max(degrees);
    }
    out
}

fn face_vertices(p: &Primitive) -> impl Iterator<Item = Vec4> + '_ {
    p.indices.iter().map(|i| p.tangents[*i as usize])
}

/// Files whose tangents come from MikkTSpace. (Suzanne's are flat and left-handed; those of chest_gold and
/// of the second mesh of VertexColorTest lie on uv triangles without area, where anything goes.)
#[test]
fn tangents_are_close_to_those_of_other_programs() {
    let Some(folder) = common::assets(2) else { return };
    let mut compared = 0;
    for (name, meshes) in [("AlphaBlendModeTest.glb", 9), ("VertexColorTest.glb", 1)] {
        let path = folder.join("gltf").join(name);
        let (theirs, ours) = (import(&path, true), import(&path, false));
        for (a, b) in ours.meshes.iter().zip(&theirs.meshes).take(meshes) {
            for (p, q) in a.primitives.iter().zip(&b.primitives) {
                let d = difference(face_vertices(p), face_vertices(q));
                assert!(d.other_sign == 0 && d.worst_degrees < 0.05, "{name}: {d:?}");
                compared += d.face_vertices;
                let flipped = difference(
                    face_vertices(p).map(|t| t * Vec4::new(1.0, 1.0, 1.0, -1.0)),
                    face_vertices(q),
                );
                assert_eq!(flipped.other_sign, d.face_vertices, "a flipped bitangent must be seen");
            }
        }
    }
    assert_eq!(compared, 183 + 36);
}

struct Mikk<'a> {
    primitive: &'a Primitive,
    out: Vec<Option<Vec4>>,
}

impl Mikk<'_> {
    fn vertex(&self, face: usize, face_vertex: usize) -> usize {
        self.primitive.indices[face * 3 + face_vertex] as usize
    }
}

impl Geometry for Mikk<'_> {
    fn num_faces(&self) -> usize {
        self.primitive.indices.len() / 3
    }
    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }
    fn position(&self, face: usize, face_vertex: usize) -> [f32; 3] {
        self.primitive.positions[self.vertex(face, face_vertex)].to_array()
    }
    fn normal(&self, face: usize, face_vertex: usize) -> [f32; 3] {
        self.primitive.normals[self.vertex(face, face_vertex)].to_array()
    }
    /// glTF's v points down, MikkTSpace's up.
    fn tex_coord(&self, face: usize, face_vertex: usize) -> [f32; 2] {
        let uv = self.primitive.uvs[0][self.vertex(face, face_vertex)];
        [uv.x, -uv.y]
    }
    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, face_vertex: usize) {
        self.out[face * 3 + face_vertex] = tangent.map(|t| Vec4::from(t.tangent_encoded()));
    }
}

/// uv area and 3D area of a face vertex's triangle are well above rounding.
fn well_shaped(p: &Primitive, face_vertex: usize) -> bool {
    let t = [0, 1, 2].map(|k| p.indices[face_vertex / 3 * 3 + k] as usize);
    let [a, b, c] = t.map(|v| p.positions[v]);
    let [u, v, w] = t.map(|i| p.uvs[0][i]);
    let sides = (v - u).length() * (w - u).length();
    (v - u).perp_dot(w - u).abs() > 1e-5 * sides.max(1e-6) && (b - a).cross(c - a).length() > 1e-9
}

#[test]
fn tangents_equal_those_of_mikktspace() {
    // Knight takes its colors from points of a palette: many of its uv triangles are slivers, where the C
    // program pairs edges of more than two triangles by chance of order, and all are joined here.
    let files = [
        ("gltf/CesiumMan.glb", 0),
        ("gltf/Fox.glb", 0),
        ("gltf/Knight.glb", 5),
        ("gltf/NormalTangentTest.glb", 0),
        ("gltf/Suzanne/Suzanne.gltf", 0),
    ];
    let Some(folder) = common::assets(files.len()) else { return };
    for (name, per_mille) in files {
        let asset = import(&folder.join(name), false);
        let mut total = Difference::default();
        let mut left_out = 0;
        for p in asset.meshes.iter().flat_map(|m| &m.primitives) {
            let mut mikk = Mikk { primitive: p, out: vec![None; p.indices.len()] };
            generate_tangents(&mut mikk).unwrap();
            let pairs: Vec<(Vec4, Vec4)> = face_vertices(p)
                .zip(&mikk.out)
                .enumerate()
                .filter(|(face_vertex, _)| well_shaped(p, *face_vertex))
                .filter_map(|(_, (ours, theirs))| Some((ours, (*theirs)?)))
                .collect();
            left_out += p.indices.len() - pairs.len();
            let d = difference(pairs.iter().map(|p| p.0), pairs.iter().map(|p| p.1));
            total.face_vertices += d.face_vertices;
            total.other_sign += d.other_sign;
            total.above_one_degree += d.above_one_degree;
            total.worst_degrees = total.worst_degrees.max(d.worst_degrees);
        }
        println!("{name}: {total:?}, {left_out} face_vertices of triangles without area left out");
        assert_eq!(total.other_sign, 0, "{name}");
        assert!(total.face_vertices > left_out, "{name}");
        assert!(total.above_one_degree * 1000 <= total.face_vertices * per_mille, "{name}: {total:?}");
    }
}
