//! An asset put together from arrays: the checks that every importer of plain meshes would otherwise write again.
//!
//! Used by the example importer, by importers in a script, and by `mesh(…)` of scripts.

use choreo_motion::{Clip, Curve, Skeleton, Transform};
use choreo_stage::{Asset, Image, Material, Mesh, MeshInstance, Primitive, Skin, Topology, Warning};
use glam::{Mat4, Vec2, Vec3, Vec4};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Which array, which element, and what must hold.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct BuildError(pub String);

type Result<T> = std::result::Result<T, BuildError>;

fn fail<T>(text: String) -> Result<T> {
    Err(BuildError(text))
}

/// Joints, meshes, materials, images and clips, each known by the number that its function returned.
#[derive(Debug, Default)]
pub struct AssetBuilder {
    names: Vec<String>,
    parents: Vec<Option<u32>>,
    rest: Vec<Transform>,
    world: Vec<Mat4>,
    asset: Asset,
    clips: Vec<(String, Vec<Curve>)>,
}

/// One mesh. Only `positions` are needed; every array is flat and has as many elements as there are vertices.
#[derive(Clone, Debug, Default)]
pub struct MeshData {
    pub name: String,
    /// The joint it hangs on; without one, a joint at the origin that is added for it.
    pub joint: Option<u32>,
    /// Metres, x y z.
    pub positions: Vec<f32>,
    /// Three a triangle, counter-clockwise from outside; empty: the vertices in their order.
    pub indices: Vec<u32>,
    /// x y z, any length; empty: for each vertex the mean of its triangles' normals by area.
    pub normals: Vec<f32>,
    /// u v, v down.
    pub uvs: Vec<f32>,
    /// Linear red green blue, or red green blue alpha.
    pub colors: Vec<f32>,
    /// Numbers of joints, as many a vertex as `weights` has: 1 to 8. The mesh then follows these joints.
    pub joints: Vec<u32>,
    pub weights: Vec<f32>,
    /// joint-from-mesh matrices at bind time by joint number, 16 numbers each, column by column; empty: the mesh lies as
    /// the joints rest.
    pub inverse_bind: Vec<f32>,
    pub material: Option<u32>,
}

/// Most vertices or indices of one mesh.
pub const MOST: usize = 1 << 27;

impl AssetBuilder {
    /// A node; its parent must have been made before. `rest` is parent-from-joint.
    pub fn joint(&mut self, name: &str, parent: Option<u32>, rest: Transform) -> Result<u32> {
        let count = self.names.len();
        if let Some(parent) = parent
            && parent as usize >= count
        {
            return fail(format!(
                "joint \"{name}\": its parent is number {parent}, but there are {count} joints so far"
            ));
        }
        if !rest.is_finite() {
            return fail(format!("joint \"{name}\": its rest transform is not finite"));
        }
        let rotation = rest.rotation;
        if (rotation.length_squared() - 1.0).abs() > 1e-3 {
            return fail(format!(
                "joint \"{name}\": its rotation must be a unit quaternion, has length {}",
                rotation.length()
            ));
        }
        let rest = Transform { rotation: rotation.normalize(), ..rest };
        let local = Mat4::from_scale_rotation_translation(rest.scale, rest.rotation, rest.translation);
        self.world.push(parent.map_or(local, |p| self.world[p as usize] * local));
        self.names.push(name.to_string());
        self.parents.push(parent);
        self.rest.push(rest);
        Ok(count as u32)
    }

    pub fn joints(&self) -> &[String] {
        &self.names
    }

    /// 8 bits a channel, rows from the top: 1 (grey), 3 (RGB) or 4 (RGBA) bytes a pixel.
    pub fn image(&mut self, name: &str, width: u32, height: u32, pixels: &[u8]) -> Result<u32> {
        let count = width as usize * height as usize;
        let channels = pixels.len().checked_div(count).unwrap_or(0);
        if count == 0 || count > MOST || pixels.len() != count * channels || !matches!(channels, 1 | 3 | 4) {
            return fail(format!(
                "image \"{name}\": {width}×{height} pixels need 1, 3 or 4 bytes each, got {} bytes",
                pixels.len()
            ));
        }
        let rgba = match channels {
            4 => pixels.to_vec(),
            3 => pixels.as_chunks::<3>().0.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect(),
            _ => pixels.iter().flat_map(|v| [*v, *v, *v, 255]).collect(),
        };
        self.asset.images.push(Arc::new(Image { name: name.to_string(), width, height, rgba }));
        Ok(self.asset.images.len() as u32 - 1)
    }

    /// Its texture, where it has one, must have been made before. Normal maps need tangents and are not for here.
    pub fn material(&mut self, material: Material) -> Result<u32> {
        let textures =
            [&material.base_color_texture, &material.emissive_texture, &material.occlusion_texture];
        let images = self.asset.images.len();
        if let Some(texture) = textures.into_iter().flatten().find(|t| t.image as usize >= images) {
            return fail(format!(
                "material \"{}\": image {} does not exist, there are {images}",
                material.name, texture.image
            ));
        }
        self.asset.materials.push(material);
        Ok(self.asset.materials.len() as u32 - 1)
    }

    /// Checks the arrays and adds the mesh. The error names the array and the element.
    pub fn mesh(&mut self, data: MeshData) -> Result<u32> {
        let name = match data.name.as_str() {
            "" => format!("mesh {}", self.asset.meshes.len()),
            name => name.to_string(),
        };
        let with = |e: BuildError| BuildError(format!("mesh \"{name}\": {e}"));
        let joint = match data.joint {
            Some(joint) if joint as usize >= self.names.len() => {
                return fail(format!(
                    "mesh \"{name}\": joint {joint} does not exist, there are {}",
                    self.names.len()
                ));
            }
            Some(joint) => joint,
            None => self.joint(&name, None, Transform::IDENTITY)?,
        };
        if let Some(material) = data.material
            && material as usize >= self.asset.materials.len()
        {
            let count = self.asset.materials.len();
            return fail(format!("mesh \"{name}\": material {material} does not exist, there are {count}"));
        }
        let mut primitive = primitive(&data).map_err(with)?;
        let skin = match data.weights.is_empty() && data.joints.is_empty() {
            true => None,
            false => {
                let skin = self.skin(&data, &mut primitive, &name).map_err(with)?;
                self.asset.skins.push(skin);
                Some(self.asset.skins.len() as u32 - 1)
            }
        };
        let mesh = self.asset.meshes.len() as u32;
        self.asset.meshes.push(Arc::new(Mesh { name, primitives: vec![primitive], ..Mesh::default() }));
        self.asset.instances.push(MeshInstance { joint, mesh, skin, weights: Vec::new() });
        Ok(mesh)
    }

    /// Curves are checked when the asset is finished, when all joints are known.
    pub fn clip(&mut self, name: &str, curves: Vec<Curve>) {
        self.clips.push((name.to_string(), curves));
    }

    /// How many warnings there are so far.
    pub fn warnings(&self) -> usize {
        self.asset.warnings.len()
    }

    /// Something that was guessed or left out.
    pub fn warn(&mut self, place: &str, text: &str) {
        self.asset.warnings.push(Warning { place: place.to_string(), text: text.to_string() });
    }

    pub fn finish(mut self, name: &str) -> Result<Asset> {
        if self.names.is_empty() {
            self.joint("root", None, Transform::IDENTITY)?;
        }
        let count = self.names.len();
        for (clip_name, curves) in self.clips {
            let clip = Clip::new(clip_name.clone(), count, curves)
                .map_err(|e| BuildError(format!("clip \"{clip_name}\": {e}")))?;
            self.asset.clips.push(Arc::new(clip));
        }
        let skeleton =
            Skeleton::new(self.names, self.parents, self.rest).map_err(|e| BuildError(e.to_string()))?;
        Ok(Asset { name: name.to_string(), skeleton: Arc::new(skeleton), ..self.asset })
    }

    /// The skin's joints are those that the mesh uses, in the order of the skeleton.
    fn skin(&mut self, data: &MeshData, primitive: &mut Primitive, name: &str) -> Result<Skin> {
        let vertices = primitive.positions.len();
        let each = data.weights.len() / vertices.max(1);
        if data.weights.len() != each * vertices
            || data.joints.len() != data.weights.len()
            || !(1..=8).contains(&each)
        {
            return fail(format!(
                "joints and weights must have 1 to 8 numbers for each of the {vertices} vertices, have {} and {}",
                data.joints.len(),
                data.weights.len()
            ));
        }
        let count = self.names.len();
        if let Some(at) = data.joints.iter().position(|j| *j as usize >= count) {
            return fail(format!("joints[{at}] is {}, but there are {count} joints", data.joints[at]));
        }
        if let Some(at) = data.weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
            return fail(format!("weights[{at}] is {}, must not be negative", data.weights[at]));
        }
        if !data.inverse_bind.is_empty() && data.inverse_bind.len() != 16 * count {
            return fail(format!(
                "inverse_bind must have 16 numbers for each of the {count} joints, has {}",
                data.inverse_bind.len()
            ));
        }
        let mut number: BTreeMap<u32, u16> = data.joints.iter().map(|j| (*j, 0)).collect();
        if number.len() > usize::from(u16::MAX) {
            return fail(format!("it follows {} joints, at most 65535", number.len()));
        }
        for (i, slot) in number.values_mut().enumerate() {
            *slot = i as u16;
        }
        primitive.influences = if each <= 4 { 4 } else { 8 };
        let mut weightless = 0usize;
        for (joints, weights) in data.joints.chunks_exact(each).zip(data.weights.chunks_exact(each)) {
            let sum: f32 = weights.iter().sum();
            weightless += usize::from(sum <= 0.0);
            for slot in 0..primitive.influences {
                let joint = joints.get(slot).or(joints.first()).and_then(|j| number.get(j)).copied();
                primitive.joint_indices.push(joint.unwrap_or(0));
                let weight = match weights.get(slot) {
                    _ if sum <= 0.0 => f32::from(u8::from(slot == 0)),
                    Some(w) => w / sum,
                    None => 0.0,
                };
                primitive.joint_weights.push(weight);
            }
        }
        if weightless > 0 {
            self.warn(name, &format!("{weightless} vertices without a weight follow their first joint"));
        }
        let inverse_bind = |joint: &u32| match data.inverse_bind.as_chunks::<16>().0.get(*joint as usize) {
            Some(matrix) => Mat4::from_cols_array(matrix),
            None => self.world[*joint as usize].inverse(),
        };
        let inverse_bind: Vec<Mat4> = number.keys().map(inverse_bind).collect();
        if inverse_bind.iter().any(|m| !m.is_finite()) {
            return fail("a joint's bind matrix is not finite; is its scale 0?".into());
        }
        Ok(Skin { joints: number.into_keys().collect(), inverse_bind })
    }
}

fn primitive(data: &MeshData) -> Result<Primitive> {
    let positions = vectors::<3>(&data.positions, "positions", None)?;
    let vertices = positions.len();
    if vertices > MOST || data.indices.len() > MOST {
        return fail(format!(
            "it has {vertices} vertices and {} indices, at most {MOST} each",
            data.indices.len()
        ));
    }
    let indices: Vec<u32> = match data.indices.is_empty() {
        true => (0..vertices as u32).collect(),
        false => data.indices.clone(),
    };
    let what = if data.indices.is_empty() { "vertices" } else { "indices" };
    if !indices.len().is_multiple_of(3) {
        return fail(format!("{what} must be three for each triangle, got {}", indices.len()));
    }
    if let Some(at) = indices.iter().position(|i| *i as usize >= vertices) {
        return fail(format!("indices[{at}] is {}, but there are {vertices} vertices", indices[at]));
    }
    let positions: Vec<Vec3> = positions.iter().copied().map(Vec3::from_array).collect();
    let normals = match data.normals.is_empty() {
        true => normals(&positions, &indices),
        false => {
            let given = vectors::<3>(&data.normals, "normals", Some(vertices))?;
            given.iter().map(|n| Vec3::from_array(*n).normalize_or(Vec3::Y)).collect()
        }
    };
    let uvs = match data.uvs.is_empty() {
        true => Vec::new(),
        false => {
            vectors::<2>(&data.uvs, "uvs", Some(vertices))?.iter().copied().map(Vec2::from_array).collect()
        }
    };
    let colors = match data.colors.len() {
        0 => Vec::new(),
        n if n == 3 * vertices => {
            let given = vectors::<3>(&data.colors, "colors", Some(vertices))?;
            given.iter().map(|c| Vec3::from_array(*c).extend(1.0)).collect()
        }
        _ => vectors::<4>(&data.colors, "colors", Some(vertices))?
            .iter()
            .copied()
            .map(Vec4::from_array)
            .collect(),
    };
    Ok(Primitive {
        topology: Topology::Triangles,
        indices,
        positions,
        normals,
        uvs: [uvs, Vec::new()],
        colors,
        material: data.material,
        ..Primitive::default()
    })
}

/// Finite vectors of `N` numbers, as many as there are vertices.
fn vectors<'a, const N: usize>(
    flat: &'a [f32],
    what: &str,
    vertices: Option<usize>,
) -> Result<&'a [[f32; N]]> {
    let (vectors, rest) = flat.as_chunks::<N>();
    let count = flat.len();
    match vertices {
        Some(v) if count != N * v => {
            return fail(format!("{what} must have {N} numbers for each of the {v} vertices, has {count}"));
        }
        None if !rest.is_empty() || count == 0 => {
            return fail(format!("{what} must have {N} numbers for each vertex, has {count}"));
        }
        _ => {}
    }
    match flat.iter().position(|v| !v.is_finite()) {
        Some(at) => fail(format!("{what}[{at}] is {}, must be finite", flat[at])),
        None => Ok(vectors),
    }
}

/// For each vertex the mean of its triangles' normals, weighted by area: flat where triangles share no vertices.
fn normals(positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in indices.as_chunks::<3>().0 {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let normal = (b - a).cross(c - a);
        for i in triangle {
            sums[*i as usize] += normal;
        }
    }
    sums.iter().map(|n| n.normalize_or(Vec3::Y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> MeshData {
        MeshData { positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], ..MeshData::default() }
    }

    fn refused(data: MeshData) -> String {
        let mut b = AssetBuilder::default();
        b.joint("root", None, Transform::IDENTITY).unwrap();
        b.mesh(MeshData { name: "m".into(), ..data }).unwrap_err().to_string()
    }

    #[test]
    fn a_triangle_gets_indices_a_normal_and_a_joint() {
        let mut b = AssetBuilder::default();
        b.mesh(triangle()).unwrap();
        let asset = b.finish("t").unwrap();
        let p = &asset.meshes[0].primitives[0];
        assert_eq!(
            (p.indices.as_slice(), p.normals.as_slice()),
            ([0, 1, 2].as_slice(), [Vec3::Z; 3].as_slice())
        );
        assert_eq!(asset.skeleton.names(), ["mesh 0"]);
    }

    #[test]
    fn normals_of_a_shared_edge_are_the_mean_by_area() {
        // Two triangles at a right angle, the second with twice the area.
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z * 2.0];
        let n = normals(&p, &[0, 1, 2, 0, 2, 3]);
        assert_eq!(n[1], Vec3::Z);
        assert_eq!(n[3], Vec3::X);
        assert!(n[0].abs_diff_eq(Vec3::new(2.0, 0.0, 1.0).normalize(), 1e-6));
    }

    #[test]
    fn what_does_not_fit_is_named_with_its_place() {
        let t = triangle;
        let cases = [
            (
                MeshData { positions: vec![0.0; 4], ..t() },
                "positions must have 3 numbers for each vertex, has 4",
            ),
            (MeshData { positions: vec![], ..t() }, "positions must have 3 numbers for each vertex, has 0"),
            (MeshData { positions: vec![f32::NAN; 9], ..t() }, "positions[0] is NaN, must be finite"),
            (MeshData { indices: vec![0, 1], ..t() }, "indices must be three for each triangle, got 2"),
            (MeshData { indices: vec![0, 1, 3], ..t() }, "indices[2] is 3, but there are 3 vertices"),
            (MeshData { positions: vec![0.0; 12], ..t() }, "vertices must be three for each triangle, got 4"),
            (
                MeshData { normals: vec![0.0; 6], ..t() },
                "normals must have 3 numbers for each of the 3 vertices, has 6",
            ),
            (
                MeshData { uvs: vec![0.0; 3], ..t() },
                "uvs must have 2 numbers for each of the 3 vertices, has 3",
            ),
            (
                MeshData { colors: vec![0.0; 5], ..t() },
                "colors must have 4 numbers for each of the 3 vertices, has 5",
            ),
            (MeshData { joint: Some(4), ..t() }, "joint 4 does not exist, there are 1"),
            (MeshData { material: Some(0), ..t() }, "material 0 does not exist, there are 0"),
            (
                MeshData { weights: vec![1.0; 3], ..t() },
                "joints and weights must have 1 to 8 numbers for each of the 3 vertices, have 0 and 3",
            ),
            (
                MeshData { weights: vec![1.0; 3], joints: vec![0, 0, 7], ..t() },
                "joints[2] is 7, but there are 2 joints",
            ),
            (
                MeshData { weights: vec![1.0, -1.0, 1.0], joints: vec![0; 3], ..t() },
                "weights[1] is -1, must not be negative",
            ),
        ];
        for (data, expected) in cases {
            assert_eq!(refused(data), format!("mesh \"m\": {expected}"));
        }
    }

    #[test]
    fn a_skinned_mesh_lies_at_rest_as_it_was_given() {
        let mut b = AssetBuilder::default();
        let hip = Transform { translation: Vec3::Y, ..Transform::IDENTITY };
        let root = b.joint("root", None, Transform::IDENTITY).unwrap();
        let hip = b.joint("hip", Some(root), hip).unwrap();
        let weights = vec![2.0, 2.0, 0.0, 0.0, 1.0, 0.0];
        let joints = vec![root, hip, hip, root, hip, root];
        b.mesh(MeshData { joints, weights, joint: Some(root), ..triangle() }).unwrap();
        let asset = b.finish("t").unwrap();
        let p = &asset.meshes[0].primitives[0];
        assert_eq!(p.influences, 4);
        assert_eq!(p.joint_weights, [0.5, 0.5, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
        assert_eq!(&p.joint_indices[..8], [0, 1, 0, 0, 1, 0, 1, 1]);
        assert_eq!(asset.warnings[0].text, "1 vertices without a weight follow their first joint");
        // joint-from-mesh undoes the joint's rest.
        assert_eq!(asset.skins[0].inverse_bind[1].transform_point3(Vec3::Y), Vec3::ZERO);
    }

    #[test]
    fn images_of_grey_rgb_and_rgba() {
        let mut b = AssetBuilder::default();
        b.image("a", 1, 2, &[7, 9]).unwrap();
        b.image("b", 1, 1, &[1, 2, 3]).unwrap();
        assert_eq!(
            b.image("c", 2, 2, &[0; 7]).unwrap_err().to_string(),
            "image \"c\": 2×2 pixels need 1, 3 or 4 bytes each, got 7 bytes"
        );
        assert!(b.image("d", 0, 2, &[]).is_err() && b.image("e", u32::MAX, u32::MAX, &[1]).is_err());
        let asset = b.finish("t").unwrap();
        assert_eq!(asset.images[0].rgba, [7, 7, 7, 255, 9, 9, 9, 255]);
        assert_eq!(asset.images[1].rgba, [1, 2, 3, 255]);
    }
}
