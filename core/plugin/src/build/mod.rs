//! Builds an asset from flat arrays, with the checks that every importer of plain meshes would otherwise repeat.
//!
//! Used by the example importer, by importers in a script, and by `mesh(…)`, `lines(…)`, `points(…)` and `image(…)` of scripts.

mod arrays;
pub mod normals;
mod parts;
pub mod tangents;

use crate::ImportError;
pub use arrays::primitive;
use choreo_asset::{
    Asset, AssetCamera, AssetLight, Image, Light, Material, Mesh, MeshInstance, Primitive, Projection, Skin,
    Topology, Warning,
};
use choreo_motion::{Clip, Curve, Skeleton, Transform};
use glam::Mat4;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Error of an array: its name, the element, and the condition that must hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BuildError(pub String);

choreo_motion::error_texts! { BuildError:
    Self(text) => "{text}";
}

impl BuildError {
    /// Converts this error to the [`ImportError`] of the file with this name.
    ///
    /// ```
    /// let error = choreo_plugin::BuildError("mesh \"leaf\": no positions".into());
    /// assert_eq!(error.of_file("a.tree").to_string(), "a.tree: mesh \"leaf\": no positions");
    /// ```
    pub fn of_file(self, name: &str) -> ImportError {
        ImportError { file: name.to_string(), place: String::new(), what: self.0, hint: None }
    }
}

type Result<T> = std::result::Result<T, BuildError>;

fn fail<T>(text: String) -> Result<T> {
    Err(BuildError(text))
}

/// Builder of an [`Asset`]: joints, meshes, materials, images, cameras, lights and clips. Each is referred to by the number that its method
/// returned.
///
/// ```
/// use choreo_plugin::asset::{Material, Topology};
/// use choreo_plugin::motion::Transform;
/// use choreo_plugin::{AssetBuilder, BuildError, MeshData, MeshPart, MorphData};
///
/// let mut builder = AssetBuilder::default();
/// let hips = builder.joint("hips", None, Transform::IDENTITY)?;
/// let [red, blue] = ["red", "blue"].map(|name| Material { name: name.into(), ..Material::default() });
/// let (red, blue) = (builder.material(red)?, builder.material(blue)?);
/// builder.mesh(MeshData {
///     joint: Some(hips),
///     positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0],
///     parts: vec![
///         MeshPart { indices: vec![0, 1, 2], material: Some(red) },
///         MeshPart { indices: vec![2, 1, 3], material: Some(blue) },
///     ],
///     morphs: vec![MorphData { name: "wide".into(), positions: vec![0.5; 12], normals: vec![] }],
///     ..MeshData::default()
/// })?;
/// let asset = builder.finish("square")?;
/// assert_eq!(asset.meshes[0].primitives.len(), 2);
/// # Ok::<(), BuildError>(())
/// ```
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
    /// Joint that the mesh is attached to; `None` adds a joint at the origin for it.
    pub joint: Option<u32>,
    /// Vertex positions, x y z in metres.
    pub positions: Vec<f32>,
    /// Topology of the indices: triangles by default.
    pub topology: Topology,
    /// Vertex indices: three per triangle, counter-clockwise seen from outside; two per line; one per point. Empty: the vertices in their
    /// order.
    pub indices: Vec<u32>,
    /// Vertex normals, x y z of any length. Empty: the mean of the normals of a vertex's triangles, weighted by area; lines and points
    /// without normals are unlit.
    pub normals: Vec<f32>,
    /// Texture coordinates u v; v points down.
    pub uvs: Vec<f32>,
    /// Vertex colors: linear RGB, or RGBA.
    pub colors: Vec<f32>,
    /// Joint numbers of the skin: 1 to 8 per vertex, one for each of `weights`. The mesh then follows these joints, and `joint` has no
    /// effect. Without `inverse_bind`, `positions` are in model space at rest. A file with +Z up then needs two rotations: of a root joint
    /// above all others, and of the vertices and normals.
    pub joints: Vec<u32>,
    /// Weights of the joints, not negative; they need not add up to 1.
    pub weights: Vec<f32>,
    /// Inverse bind matrices (joint from mesh) by joint number: 16 numbers each, column-major. Empty: the bind pose is the rest pose.
    pub inverse_bind: Vec<f32>,
    /// Number of the material; `None`: the default material.
    pub material: Option<u32>,
    /// Parts with a material each, in place of `indices` and `material`.
    pub parts: Vec<MeshPart>,
    /// Morph targets (blend shapes), with weight 0 at rest.
    pub morphs: Vec<MorphData>,
}

/// A part of a mesh with a material of its own.
#[derive(Clone, Debug, Default)]
pub struct MeshPart {
    /// Vertex indices of the whole mesh, as in [`MeshData::indices`]; not empty.
    pub indices: Vec<u32>,
    /// Number of the material; `None`: the default material.
    pub material: Option<u32>,
}

/// A morph target of a mesh.
#[derive(Clone, Debug, Default)]
pub struct MorphData {
    /// Name in scripts (`actor.morph(NAME, …)`).
    pub name: String,
    /// Offsets at weight 1 in metres, x y z for each vertex; empty: none.
    pub positions: Vec<f32>,
    /// Offsets of the normals at weight 1, x y z for each vertex; empty: none.
    pub normals: Vec<f32>,
}

/// Largest number of vertices, and of indices, of one mesh.
pub const MOST: usize = 1 << 27;

impl AssetBuilder {
    /// Adds a joint and returns its number. The parent must have been added before. `rest` is the parent-from-joint transform at rest.
    ///
    /// # Errors
    /// A parent that does not exist yet, a transform that is not finite, a rotation whose length is not 1.
    ///
    /// ```
    /// use choreo_plugin::motion::Transform;
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let hips = builder.joint("hips", None, Transform::IDENTITY)?;
    /// let spine = builder.joint("spine", Some(hips), Transform { translation: [0.0, 0.4, 0.0].into(), ..Transform::IDENTITY })?;
    /// assert_eq!((hips, spine, builder.joints()), (0, 1, &["hips".to_string(), "spine".to_string()][..]));
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn joint(&mut self, name: &str, parent: Option<u32>, rest: Transform) -> Result<u32> {
        let count = self.names.len();
        if let Some(parent) = parent
            && parent as usize >= count
        {
            return fail(format!(
                "joint \"{name}\": its parent is number {parent}, but the number of joints so far is {count}"
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

    /// Adds an image with 8 bits per channel, rows from the top, and 1 (gray), 3 (RGB) or 4 (RGBA) bytes per pixel. Returns its number.
    ///
    /// # Errors
    /// The number of bytes does not fit the size, or there are no pixels.
    ///
    /// ```
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let gray = builder.image("checker", 2, 1, &[0, 255])?;
    /// let error = builder.image("checker", 2, 1, &[0, 255, 0]).unwrap_err();
    /// assert_eq!(error.to_string(), "image \"checker\": 2×1 pixels need 1, 3 or 4 bytes each, got 3 bytes");
    /// # assert_eq!(gray, 0);
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn image(&mut self, name: &str, width: u32, height: u32, pixels: &[u8]) -> Result<u32> {
        Ok(self.decoded_image(Arc::new(image(name, width, height, pixels)?)))
    }

    /// Adds an image that is already decoded, with its file where [`ImportScope::image_files`](crate::ImportScope::image_files) asks for
    /// it. Returns its number.
    ///
    /// ```
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// use choreo_plugin::asset::{Image, ImageFile, ImageFileFormat};
    /// # let bytes = Vec::new();
    /// let file = ImageFile { format: ImageFileFormat::Png, bytes: std::sync::Arc::new(bytes) };
    /// let image = Image { name: "red".into(), width: 1, height: 1, rgba: vec![255, 0, 0, 255], file: Some(file) };
    /// assert_eq!(builder.decoded_image(image.into()), 0);
    /// ```
    pub fn decoded_image(&mut self, image: Arc<Image>) -> u32 {
        self.asset.images.push(image);
        self.asset.images.len() as u32 - 1
    }

    /// Adds a material and returns its number. Its images must have been added before. Meshes whose material has a normal map get tangents.
    ///
    /// # Errors
    /// A texture of an image that does not exist yet.
    ///
    /// ```
    /// use choreo_plugin::asset::{Material, Sampler, TextureRef};
    /// use choreo_plugin::glam::Affine2;
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let image = builder.image("bricks", 1, 1, &[150, 70, 60])?;
    /// let uv_transform = Affine2::IDENTITY;
    /// let texture = Some(TextureRef { image, sampler: Sampler::default(), uv_set: 0, uv_transform });
    /// let bricks = builder.material(Material { name: "bricks".into(), base_color_texture: texture, ..Material::default() })?;
    /// # assert_eq!(bricks, 0);
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn material(&mut self, material: Material) -> Result<u32> {
        let textures = [
            &material.base_color_texture,
            &material.metallic_roughness_texture,
            &material.normal_texture,
            &material.occlusion_texture,
            &material.emissive_texture,
            &material.specular_texture,
            &material.specular_color_texture,
        ];
        let images = self.asset.images.len();
        if let Some(texture) = textures.into_iter().flatten().find(|t| t.image as usize >= images) {
            return fail(format!(
                "material \"{}\": image {} does not exist (count: {images})",
                material.name, texture.image
            ));
        }
        self.asset.materials.push(material);
        Ok(self.asset.materials.len() as u32 - 1)
    }

    /// Checks the arrays, adds the mesh and returns its number. The error names the array and the element.
    ///
    /// # Errors
    /// An array of the wrong length, a number that is not finite, an index, joint or material that does not exist.
    ///
    /// ```
    /// use choreo_plugin::MeshData;
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let positions = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, f32::NAN];
    /// let error = builder.mesh(MeshData { name: "leaf".into(), positions, ..MeshData::default() }).unwrap_err();
    /// assert!(error.to_string().starts_with("mesh \"leaf\": positions"), "{error}");
    /// ```
    pub fn mesh(&mut self, mut data: MeshData) -> Result<u32> {
        let name = match data.name.as_str() {
            "" => format!("mesh {}", self.asset.meshes.len()),
            name => name.to_string(),
        };
        let with = |e: BuildError| BuildError(format!("mesh \"{name}\": {e}"));
        let joint = self.joint_of(&format!("mesh \"{name}\""), &name, data.joint)?;
        if let Some(material) = data.material
            && material as usize >= self.asset.materials.len()
        {
            let count = self.asset.materials.len();
            return fail(format!("mesh \"{name}\": material {material} does not exist (count: {count})"));
        }
        let mut primitive = arrays::take_primitive(&mut data).map_err(with)?;
        let skin = match data.weights.is_empty() && data.joints.is_empty() {
            true => None,
            false => {
                let skin = self.skin(&data, &mut primitive, &name).map_err(with)?;
                self.asset.skins.push(skin);
                Some(self.asset.skins.len() as u32 - 1)
            }
        };
        let mut primitives =
            parts::split_into_parts(primitive, &data.parts, self.asset.materials.len()).map_err(with)?;
        primitives.iter_mut().for_each(|primitive| self.add_tangents(primitive));
        let mesh = self.asset.meshes.len() as u32;
        let morph_names: Vec<String> = data.morphs.iter().map(|morph| morph.name.clone()).collect();
        let weights = vec![0.0; morph_names.len()];
        let morph_targets = morph_names.len();
        self.asset.meshes.push(Arc::new(Mesh { name, primitives, morph_targets, morph_names }));
        self.asset.instances.push(MeshInstance { joint, mesh, skin, weights, ..Default::default() });
        Ok(mesh)
    }

    /// Returns `joint`, which must exist; for `None` adds a joint at the origin.
    fn joint_of(&mut self, what: &str, name: &str, joint: Option<u32>) -> Result<u32> {
        let count = self.names.len();
        match joint {
            Some(joint) if joint as usize >= count => {
                fail(format!("{what}: joint {joint} does not exist (count: {count})"))
            }
            Some(joint) => Ok(joint),
            None => self.joint(name, None, Transform::IDENTITY),
        }
    }

    /// Adds tangents if the primitive's material has a normal map, or a warning if the primitive then has no texture coordinates.
    fn add_tangents(&mut self, primitive: &mut Primitive) {
        let material = primitive.material.and_then(|m| self.asset.materials.get(m as usize));
        let Some((material, map)) = material.and_then(|m| Some((m, m.normal_texture.as_ref()?))) else {
            return;
        };
        let uv_set = usize::from(map.uv_set.min(1));
        if primitive.topology == Topology::Triangles && !primitive.uvs[uv_set].is_empty() {
            tangents::add(primitive, uv_set);
        } else {
            let place = format!("material \"{}\"", material.name);
            self.warn(&place, "it has a normal map, but a mesh without uvs uses it; it has no effect there");
        }
    }

    /// Adds a camera that looks along −Z of its joint, +Y up. `None` adds a joint at the origin for it.
    ///
    /// # Errors
    /// A joint that does not exist.
    ///
    /// ```
    /// use choreo_plugin::asset::Projection;
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// builder.camera("close", None, Projection::default())?;
    /// assert_eq!(builder.finish("set")?.cameras[0].name, "close");
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn camera(&mut self, name: &str, joint: Option<u32>, projection: Projection) -> Result<u32> {
        let joint = self.joint_of(&format!("camera \"{name}\""), name, joint)?;
        self.asset.cameras.push(AssetCamera { name: name.to_string(), joint, projection });
        Ok(self.asset.cameras.len() as u32 - 1)
    }

    /// Adds a light that shines along −Z of its joint. `None` adds a joint at the origin for it.
    ///
    /// # Errors
    /// A joint that does not exist, or a cone or an intensity that no light can have.
    ///
    /// ```
    /// use choreo_plugin::asset::{Light, LightKind};
    /// use choreo_plugin::glam::Vec3;
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let lamp = Light { kind: LightKind::Point, color: Vec3::ONE, intensity: 100.0, range: None };
    /// builder.light("lamp", None, lamp)?;
    /// let error = builder.light("hole", None, Light { intensity: -1.0, ..lamp }).unwrap_err();
    /// assert!(error.to_string().starts_with("light \"hole\": color and intensity"));
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn light(&mut self, name: &str, joint: Option<u32>, light: Light) -> Result<u32> {
        let what = format!("light \"{name}\"");
        if let Some(problem) = light.kind.problem() {
            return fail(format!("{what}: {problem}"));
        }
        let finite = light.color.is_finite() && light.intensity.is_finite() && light.intensity >= 0.0;
        if !finite || light.range.is_some_and(|range| range.is_nan() || range <= 0.0) {
            return fail(format!(
                "{what}: color and intensity must be finite, not negative, its range positive"
            ));
        }
        let joint = self.joint_of(&what, name, joint)?;
        self.asset.lights.push(AssetLight { name: name.to_string(), joint, light });
        Ok(self.asset.lights.len() as u32 - 1)
    }

    /// Adds an animation clip. Its curves are checked in [`AssetBuilder::finish`], when all joints are known.
    ///
    /// ```
    /// use choreo_plugin::motion::{Curve, Interpolation, Path, Time, Transform};
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let hips = builder.joint("hips", None, Transform::IDENTITY)?;
    /// builder.clip("rise", vec![Curve {
    ///     joint: hips,
    ///     path: Path::Translation,
    ///     interpolation: Interpolation::Linear,
    ///     times: [0.0, 2.0].map(Time::from_secs).into(),
    ///     values: [0.0, 0.0, 0.0, 0.0, 1.0, 0.0].into(),
    /// }]);
    /// assert_eq!(builder.finish("lift")?.clips[0].duration, Time::from_secs(2.0));
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn clip(&mut self, name: &str, curves: Vec<Curve>) {
        self.clips.push((name.to_string(), curves));
    }

    /// Number of warnings so far.
    pub fn warnings(&self) -> usize {
        self.asset.warnings.len()
    }

    /// Adds a warning about something that was guessed or left out.
    ///
    /// ```
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// builder.warn("chunk 7", "it is of an unknown kind, and left out");
    /// assert_eq!((builder.warnings(), builder.finish("a")?.warnings[0].place.as_str()), (1, "chunk 7"));
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
    pub fn warn(&mut self, place: &str, text: &str) {
        self.asset.warnings.push(Warning { place: place.to_string(), text: text.to_string() });
    }

    /// Checks the skeleton and the clips, and returns the asset.
    ///
    /// # Errors
    /// A clip whose curves do not fit the joints, or keys that are not finite or out of order.
    ///
    /// ```
    /// # let mut builder = choreo_plugin::AssetBuilder::default();
    /// let asset = builder.finish("nothing")?;
    /// assert_eq!((asset.skeleton.len(), asset.meshes.len()), (1, 0));
    /// # Ok::<(), choreo_plugin::BuildError>(())
    /// ```
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

    /// Makes the skin of a mesh. Its joints are those that the mesh uses, in the order of the skeleton.
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
            return fail(format!("joints[{at}] is {}, but the number of joints is {count}", data.joints[at]));
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
            self.warn(
                name,
                &format!("vertices without a weight: {weightless}; they follow their first joint"),
            );
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

/// Makes an image with 8 bits per channel, rows from the top, and 1 (gray), 3 (RGB) or 4 (RGBA) bytes per pixel.
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
    Ok(Image { name: name.to_string(), width, height, rgba, file: None })
}

#[cfg(test)]
mod tests;
