//! Mesh prims become meshes: triangulated polygons, primvars, joint influences, blend shapes.

use crate::layer::{Attribute, Prim};
use crate::transforms;
use choreo_asset::{Mesh, MorphTarget, Primitive};
use choreo_importer_kit::polygon::Triangulator;
use choreo_importer_kit::weld::Welder;
use choreo_importer_kit::{Budget, Notes, Problem, Result, smooth};
use glam::{DMat4, DVec3, Vec2, Vec3, Vec4};

/// Degrees up to which an edge is smooth, where a file has no normals.
const SMOOTHING_ANGLE_DEG: f64 = 60.0;
/// Influences of a vertex, at most.
const MAX_INFLUENCES: usize = 8;

/// The parts of a mesh to read, and the context for reading them.
pub(crate) struct MeshContext<'a> {
    pub path: &'a str,
    pub budget: &'a Budget,
    pub notes: &'a Notes,
    /// Primvar names of the first and the second texture coordinate set.
    pub uvs: [String; 2],
    pub reads_colors: bool,
    /// Names of the blend shapes, with their prims.
    pub shapes: Vec<(String, &'a Prim)>,
    /// Whether the mesh has joint influences.
    pub is_skinned: bool,
}

/// The faces of a mesh that share a material.
pub(crate) struct FaceSubset {
    /// Face indices; `None`: all faces that no other subset has.
    pub faces: Option<Vec<u32>>,
    pub material: Option<u32>,
}

/// A primvar: its values, the indices into them, and how elements map to the mesh.
struct Primvar<'a> {
    values: &'a [f64],
    width: usize,
    indices: Option<&'a [f64]>,
    interpolation: PrimvarInterpolation,
}

#[derive(Clone, Copy, PartialEq)]
enum PrimvarInterpolation {
    Constant,
    Faces,
    Vertices,
    FaceVertices,
}

impl<'a> Primvar<'a> {
    /// Reads a primvar; `None` where the prim lacks it, or, with a warning, where it has too few elements or indices out of
    /// range.
    fn of(
        prim: &'a Prim,
        name: &str,
        width: usize,
        counts: [usize; 3],
        context: &MeshContext<'_>,
    ) -> Option<Self> {
        let attribute: &'a Attribute = prim.attributes.get(name)?;
        let values = prim.numbers(name)?;
        let indices = prim.numbers(&format!("{name}:indices"));
        let [faces, vertices, face_vertices] = counts;
        let (interpolation, count) = match attribute.interpolation.as_str() {
            "uniform" => (PrimvarInterpolation::Faces, faces),
            "vertex" | "varying" => (PrimvarInterpolation::Vertices, vertices),
            "faceVarying" => (PrimvarInterpolation::FaceVertices, face_vertices),
            "constant" => (PrimvarInterpolation::Constant, 1),
            // Normals without an interpolation belong to vertices, unless their number is that of the face vertices.
            _ if name == "normals" && values.len() / width == face_vertices => {
                (PrimvarInterpolation::FaceVertices, face_vertices)
            }
            _ if name == "normals" => (PrimvarInterpolation::Vertices, vertices),
            _ => (PrimvarInterpolation::Constant, 1),
        };
        let elements = indices.map_or(values.len() / width, <[f64]>::len);
        let in_range = |index: &f64| *index >= 0.0 && (*index as usize) < values.len() / width;
        if elements < count || !indices.unwrap_or_default().iter().all(in_range) || values.len() < width {
            let what =
                format!("{name} has {elements} of {count} elements, or indices out of range; it is left out");
            context.notes.warn(context.path, what);
            return None;
        }
        Some(Primvar { values, width, indices, interpolation })
    }

    fn at(&self, face: usize, vertex: usize, face_vertex: usize) -> &'a [f64] {
        let element = match self.interpolation {
            PrimvarInterpolation::Constant => 0,
            PrimvarInterpolation::Faces => face,
            PrimvarInterpolation::Vertices => vertex,
            PrimvarInterpolation::FaceVertices => face_vertex,
        };
        let index = self.indices.map_or(element, |indices| indices[element] as usize);
        &self.values[index * self.width..][..self.width]
    }
}

struct Faces<'a> {
    points: &'a [f64],
    counts: &'a [f64],
    indices: &'a [f64],
    left_handed: bool,
}

impl<'a> Faces<'a> {
    fn of(prim: &'a Prim, path: &str) -> Result<Option<Faces<'a>>> {
        let list = |name: &str| prim.numbers(name).unwrap_or_default();
        let (points, counts, indices) = (list("points"), list("faceVertexCounts"), list("faceVertexIndices"));
        if points.is_empty() || counts.is_empty() {
            return Ok(None);
        }
        let all: f64 = counts.iter().sum();
        let vertices = (points.len() / 3) as f64;
        if counts.iter().any(|n| *n < 0.0) || all > indices.len() as f64 {
            let what = format!("has faces with {all} vertices, but {} faceVertexIndices", indices.len());
            return Err(Problem::new(path, what));
        }
        if let Some(beyond) = indices.iter().find(|i| !(0.0..vertices).contains(*i)) {
            return Err(Problem::new(path, format!("refers to point {beyond} of {vertices}")));
        }
        if points.iter().any(|v| !(*v as f32).is_finite()) {
            return Err(Problem::new(path, "has points that are not finite"));
        }
        let left_handed = prim.text("orientation") == "leftHanded";
        Ok(Some(Faces { points, counts, indices, left_handed }))
    }

    fn point(&self, vertex: usize) -> DVec3 {
        DVec3::from_slice(&self.points[3 * vertex..][..3])
    }
}

/// The mesh of a prim; `None` where it has no faces.
pub(crate) fn read_mesh(
    prim: &Prim,
    parts: &[FaceSubset],
    context: &MeshContext<'_>,
    triangulator: &mut Triangulator,
) -> Result<Option<Mesh>> {
    let Some(faces) = Faces::of(prim, context.path)? else { return Ok(None) };
    let counts = [faces.counts.len(), faces.points.len() / 3, faces.indices.len()];
    // Memory of vertices, indices and their attributes, for each face vertex.
    context.budget.charge(counts[2] as u64, 160)?;
    let mut taken = vec![false; counts[0]];
    for part in parts.iter().filter_map(|part| part.faces.as_ref()) {
        part.iter()
            .filter(|face| (**face as usize) < counts[0])
            .for_each(|face| taken[*face as usize] = true);
    }
    let mut starts = Vec::with_capacity(counts[0]);
    let mut next = 0;
    for count in faces.counts {
        starts.push(next);
        next += *count as usize;
    }
    let primvars = Primvars::of(prim, counts, context);
    let influences = context.is_skinned.then(|| Influences::of(prim, counts[1], context)).flatten();
    let mut out = Mesh { name: prim.name.clone(), ..Mesh::default() };
    out.morph_targets = context.shapes.len();
    out.morph_names = context.shapes.iter().map(|(name, _)| name.clone()).collect();
    let shapes: Vec<Shape> = context.shapes.iter().map(|(_, shape)| Shape::of(shape, counts[1])).collect();
    let mut welder = Welder::default();
    for part in parts {
        let of_part: Vec<u32> = match &part.faces {
            Some(list) => list.iter().copied().filter(|face| (*face as usize) < counts[0]).collect(),
            None => (0..counts[0] as u32).filter(|face| !taken[*face as usize]).collect(),
        };
        let mut builder = Builder { material: part.material, ..Builder::default() };
        welder.start(counts[1]);
        for face in of_part {
            builder.add_face(
                &faces,
                (face as usize, starts[face as usize]),
                &primvars,
                (&mut welder, triangulator),
            );
        }
        if !builder.indices.is_empty() {
            out.primitives.push(builder.finish(&faces, &primvars, influences.as_ref(), &shapes));
        }
    }
    Ok((!out.primitives.is_empty()).then_some(out))
}

struct Primvars<'a> {
    normals: Option<Primvar<'a>>,
    uvs: [Option<Primvar<'a>>; 2],
    colors: Option<Primvar<'a>>,
    opacities: Option<Primvar<'a>>,
}

impl<'a> Primvars<'a> {
    fn of(prim: &'a Prim, counts: [usize; 3], context: &MeshContext<'_>) -> Primvars<'a> {
        let find = |name: &str, width| Primvar::of(prim, name, width, counts, context);
        let uv = |name: &String| find(&format!("primvars:{name}"), 2).filter(|_| !name.is_empty());
        Primvars {
            normals: find("primvars:normals", 3).or_else(|| find("normals", 3)),
            uvs: [uv(&context.uvs[0]), uv(&context.uvs[1])],
            colors: find("primvars:displayColor", 3).filter(|_| context.reads_colors),
            opacities: find("primvars:displayOpacity", 1).filter(|_| context.reads_colors),
        }
    }
}

/// Values of a face vertex, by which vertices at the same point differ.
#[derive(Clone, Copy, PartialEq)]
struct FaceVertex {
    normal: Vec3,
    uvs: [Vec2; 2],
    color: Vec4,
}

#[derive(Default)]
struct Builder {
    material: Option<u32>,
    indices: Vec<u32>,
    /// Point and values of each vertex.
    vertices: Vec<(u32, FaceVertex)>,
}

impl Builder {
    fn add_face(
        &mut self,
        faces: &Faces<'_>,
        (face, start): (usize, usize),
        primvars: &Primvars<'_>,
        (welder, triangulator): (&mut Welder, &mut Triangulator),
    ) {
        let count = faces.counts[face] as usize;
        let point = |i: usize| faces.indices[start + i] as usize;
        let vector = |list: &[f64]| DVec3::from_slice(list).as_vec3();
        let mut face_vertices = Vec::with_capacity(count);
        for i in 0..count {
            let at = |primvar: &Option<Primvar<'_>>| {
                primvar.as_ref().map(|primvar| primvar.at(face, point(i), start + i).to_vec())
            };
            // USD has the origin of texture coordinates at the bottom; here it is at the top.
            let uv = |primvar| {
                at(primvar).map_or(Vec2::ZERO, |v| finite_or_zero(Vec2::new(v[0] as f32, 1.0 - v[1] as f32)))
            };
            let color = at(&primvars.colors).map_or(Vec3::ONE, |v| vector(&v));
            let opacity = at(&primvars.opacities).map_or(1.0, |v| v[0] as f32);
            let normal = at(&primvars.normals).map_or(Vec3::ZERO, |v| vector(&v).normalize_or_zero());
            let face_vertex = FaceVertex {
                normal,
                uvs: [uv(&primvars.uvs[0]), uv(&primvars.uvs[1])],
                color: color.extend(opacity),
            };
            let point = point(i) as u32;
            let (vertex, new) = welder.vertex(point, |known| self.vertices[known as usize].1 == face_vertex);
            if new {
                self.vertices.push((point, face_vertex));
            }
            face_vertices.push(vertex);
        }
        triangulator.triangulate(
            count,
            |i| faces.point(point(i)),
            |[a, b, c]| {
                let triangle = if faces.left_handed { [a, c, b] } else { [a, b, c] };
                self.indices.extend(triangle.map(|i| face_vertices[i as usize]));
            },
        );
    }

    fn finish(
        self,
        faces: &Faces<'_>,
        primvars: &Primvars<'_>,
        influences: Option<&Influences>,
        shapes: &[Shape],
    ) -> Primitive {
        let list = |has: bool| if has { self.vertices.as_slice() } else { &[] };
        let uvs = [0, 1]
            .map(|set| list(primvars.uvs[set].is_some()).iter().map(|(_, values)| values.uvs[set]).collect());
        let has_normals = primvars.normals.is_some();
        let has_colors = primvars.colors.is_some() || primvars.opacities.is_some();
        let mut out = Primitive {
            positions: self.vertices.iter().map(|(p, _)| faces.point(*p as usize).as_vec3()).collect(),
            normals: list(has_normals).iter().map(|(_, values)| values.normal).collect(),
            uvs,
            colors: list(has_colors).iter().map(|(_, values)| values.color).collect(),
            material: self.material,
            indices: self.indices,
            ..Primitive::default()
        };
        if let Some(of) = influences {
            out.influences = of.size;
            for (point, _) in &self.vertices {
                let range = *point as usize * of.size..(*point as usize + 1) * of.size;
                out.joint_indices.extend_from_slice(&of.joints[range.clone()]);
                out.joint_weights.extend_from_slice(&of.weights[range]);
            }
        }
        for shape in shapes {
            let offsets = |list: &[Vec3]| -> Vec<Vec3> {
                if list.is_empty() {
                    Vec::new()
                } else {
                    self.vertices.iter().map(|(p, _)| list[*p as usize]).collect()
                }
            };
            let (positions, normals) = (offsets(&shape.offsets), offsets(&shape.normals));
            let normals = if has_normals { normals } else { Vec::new() };
            out.morphs.push(MorphTarget { positions, normals, ..MorphTarget::default() });
        }
        match has_normals {
            true => choreo_plugin::build::normals::replace_zero(&mut out),
            false => smooth::normals(&mut out, SMOOTHING_ANGLE_DEG.to_radians(), None),
        }
        out
    }
}

/// Offsets of a blend shape for all points of the mesh.
struct Shape {
    offsets: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Shape {
    fn of(prim: &Prim, points: usize) -> Shape {
        let indices = prim.numbers("pointIndices");
        let all = |name: &str| -> Vec<Vec3> {
            let Some(list) = prim.numbers(name) else { return Vec::new() };
            let mut out = vec![Vec3::ZERO; points];
            for (number, offset) in list.chunks_exact(3).enumerate() {
                let index = match indices {
                    Some(indices) => indices.get(number).map_or(usize::MAX, |i| *i as usize),
                    None => number,
                };
                let offset = DVec3::from_slice(offset).as_vec3();
                if let Some(own) = out.get_mut(index).filter(|_| offset.is_finite()) {
                    *own = offset;
                }
            }
            out
        };
        Shape { offsets: all("offsets"), normals: all("normalOffsets") }
    }
}

/// Joint influences, 4 or 8 for each point.
struct Influences {
    size: usize,
    joints: Vec<u16>,
    weights: Vec<f32>,
}

impl Influences {
    fn of(prim: &Prim, points: usize, context: &MeshContext<'_>) -> Option<Influences> {
        let joints = prim.numbers("primvars:skel:jointIndices")?;
        let weights = prim.numbers("primvars:skel:jointWeights")?;
        let attribute = prim.attributes.get("primvars:skel:jointIndices")?;
        let constant = attribute.interpolation == "constant";
        let per_point = if constant { joints.len() } else { joints.len() / points.max(1) };
        let size = if attribute.element_size > 0 { attribute.element_size } else { per_point };
        let needed = if constant { size } else { points.saturating_mul(size) };
        if size == 0 || joints.len() < needed || weights.len() < needed {
            context.notes.warn(context.path, "has fewer influences of joints than points; they are left out");
            return None;
        }
        let kept = if size <= 4 { 4 } else { MAX_INFLUENCES };
        let mut out = Influences { size: kept, joints: Vec::new(), weights: Vec::new() };
        let mut row: Vec<(u16, f64)> = Vec::new();
        for point in 0..points {
            let from = if constant { 0 } else { point * size };
            row.clear();
            row.extend(
                (from..from + size)
                    .map(|i| (joints[i].clamp(0.0, 65_535.0) as u16, weights[i].clamp(0.0, 1e6))),
            );
            row.sort_by(|a, b| b.1.total_cmp(&a.1));
            row.resize(kept, (0, 0.0));
            let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
            if sum <= 0.0 {
                row[0].1 = 1.0;
            }
            let sum = if sum > 0.0 { sum } else { 1.0 };
            out.joints.extend(row.iter().map(|(joint, weight)| if *weight > 0.0 { *joint } else { 0 }));
            out.weights.extend(row.iter().map(|(_, weight)| (weight / sum) as f32));
        }
        Some(out)
    }
}

/// Geometry bind transform: from mesh space to skeleton space at bind time.
pub(crate) fn geometry_bind_transform(prim: &Prim) -> DMat4 {
    prim.numbers("primvars:skel:geomBindTransform").map_or(DMat4::IDENTITY, transforms::matrix)
}

fn finite_or_zero(uv: Vec2) -> Vec2 {
    if uv.is_finite() { uv } else { Vec2::ZERO }
}
