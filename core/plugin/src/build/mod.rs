//! An asset put together from arrays: the checks that every importer of plain meshes would otherwise write again.
//!
//! Used by the example importer, by importers in a script, and by `mesh(…)`, `lines(…)`, `points(…)` and `image(…)` of scripts.

mod arrays;

pub use arrays::primitive;
use choreo_asset::{Asset, Image, Material, Mesh, MeshInstance, Primitive, Skin, Topology, Warning};
use choreo_motion::{Clip, Curve, Skeleton, Transform};
use glam::Mat4;
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Error of an array: its name, the element, and the condition that must hold.
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
    /// Name of the mesh; empty: `mesh N`.
    pub name: String,
    /// The joint it hangs on; without one, a joint at the origin that is added for it.
    pub joint: Option<u32>,
    /// Metres, x y z.
    pub positions: Vec<f32>,
    /// Topology of the indices: triangles by default.
    pub topology: Topology,
    /// Three a triangle, counter-clockwise from outside; two a line; one a point. Empty: the vertices in their order.
    pub indices: Vec<u32>,
    /// x y z, any length; empty: for each vertex the mean of its triangles' normals by area. Lines and points without are not lit.
    pub normals: Vec<f32>,
    /// u v, v down.
    pub uvs: Vec<f32>,
    /// Linear red green blue, or red green blue alpha.
    pub colors: Vec<f32>,
    /// Numbers of joints, as many a vertex as `weights` has: 1 to 8. The mesh then follows these joints.
    pub joints: Vec<u32>,
    /// Weights of the joints, not negative; they need not add up to 1.
    pub weights: Vec<f32>,
    /// joint-from-mesh matrices at bind time by joint number, 16 numbers each, column by column; empty: the mesh lies as
    /// the joints rest.
    pub inverse_bind: Vec<f32>,
    /// Number of its material; without one, the default material.
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

    /// Names of the joints so far, by number.
    pub fn joints(&self) -> &[String] {
        &self.names
    }

    /// 8 bits a channel, rows from the top: 1 (gray), 3 (RGB) or 4 (RGBA) bytes a pixel.
    pub fn image(&mut self, name: &str, width: u32, height: u32, pixels: &[u8]) -> Result<u32> {
        let image = image(name, width, height, pixels)?;
        self.asset.images.push(Arc::new(image));
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
        self.asset.instances.push(MeshInstance { joint, mesh, skin, ..Default::default() });
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

    /// Adds a warning about something that was guessed or left out.
    pub fn warn(&mut self, place: &str, text: &str) {
        self.asset.warnings.push(Warning { place: place.to_string(), text: text.to_string() });
    }

    /// Checks the skeleton and the clips, and gives the asset.
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

/// 8 bits a channel, rows from the top: 1 (gray), 3 (RGB) or 4 (RGBA) bytes a pixel.
pub fn image(name: &str, width: u32, height: u32, pixels: &[u8]) -> Result<Image> {
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
    Ok(Image { name: name.to_string(), width, height, rgba })
}

#[cfg(test)]
mod tests;
