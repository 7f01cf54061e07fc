//! One imported file: a node tree with meshes, materials, images, cameras, lights, clips.

use crate::camera::AssetCamera;
use crate::derived::Derived;
use crate::expression::Expression;
use crate::eyes::Eyes;
use crate::light::AssetLight;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::texture::Image;
use choreo_motion::spring::parameters::Springs;
use choreo_motion::{Clip, Front, Skeleton};
use glam::{Affine3A, Mat4, Vec3};
use std::sync::Arc;

/// One imported file, shared by every actor cast from it.
#[derive(Clone, Debug, Default)]
pub struct Asset {
    /// The path as the script wrote it: `knight.glb`.
    pub name: String,
    /// All nodes of the file, parents first. "Joint" indices everywhere else refer to it.
    pub skeleton: Arc<Skeleton>,
    /// Meshes, which `instances` place; several may show the same one.
    pub meshes: Vec<Arc<Mesh>>,
    /// Skins of `instances`.
    pub skins: Vec<Skin>,
    /// Mesh instances: the mesh, its node and its skin.
    pub instances: Vec<MeshInstance>,
    /// Placements of the whole character, model-from-model: the pose is evaluated once for all of them. Empty: one placement, the
    /// identity.
    pub placements: Arc<[Affine3A]>,
    /// Materials of primitives.
    pub materials: Vec<Material>,
    /// Images of textures.
    pub images: Vec<Arc<Image>>,
    /// Cameras of the file, each on a joint.
    pub cameras: Vec<AssetCamera>,
    /// Lights of the file, each on a joint.
    pub lights: Vec<AssetLight>,
    /// Ambient light, linear RGB: the brightness of a white surface in it. The stage takes it over, unless the script sets
    /// another.
    pub ambient: Vec3,
    /// Animation clips; times begin at the clip's own 0 s.
    pub clips: Vec<Arc<Clip>>,
    /// Facial expressions; names are unique.
    pub expressions: Vec<Expression>,
    /// Spring bones: hair, skirts, tails.
    pub springs: Springs,
    /// How the eyes follow a target, if the file specifies it.
    pub eyes: Option<Eyes>,
    /// Front of the character, if the script gives it; otherwise [`Asset::facing`] detects it.
    pub front: Option<Front>,
    /// Format, unit and axes of the file before conversion.
    pub origin: Origin,
    /// Warnings of the importer: what it guessed or left out.
    pub warnings: Vec<Warning>,
    /// Filled when first requested (bounds, hashes); start with `Default::default()`.
    pub derived: Derived,
}

/// Format, unit and axes of the file before conversion to choreo's convention; shown by `choreo info`, used by nothing else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// Format and version of the file, such as "COLLADA 1.4.1"; empty if the importer does not state it.
    pub format: String,
    /// Name and version of the importer, such as "collada 0.1.0"; empty for assets that no file gave.
    pub importer: String,
    /// The program that wrote the file, as it calls itself; may be empty.
    pub writer: String,
    /// Length of the file's unit in metres; `None` if unknown.
    pub metres_per_unit: Option<f64>,
    /// Whether the file states no unit, so that `metres_per_unit` is an option of the importer or its guess.
    pub unit_is_assumed: bool,
    /// The file's upward axis: "+Y", "+Z"; may be empty.
    pub up: String,
    /// Other statements of the file about itself, as label and text: title, authors, license.
    pub about: Vec<(String, String)>,
}

/// Something an importer guessed or left out; `place` is an element path or byte offset (`materials[2]`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Element path or byte offset in the file; may be empty.
    pub place: String,
    /// The guess or the omission, as a sentence.
    pub text: String,
}

/// Joints that deform meshes, with their inverse bind matrices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Skeleton joint of each skin joint.
    pub joints: Vec<u32>,
    /// Inverse bind matrices: joint-from-mesh in the bind pose, one per skin joint.
    pub inverse_bind: Vec<Mat4>,
}

/// A mesh at a joint of the skeleton.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshInstance {
    /// Joint whose transform places the mesh, unless it is skinned.
    pub joint: u32,
    /// Index into the asset's meshes.
    pub mesh: u32,
    /// The skin. If there is one, the node's own transform is ignored (glTF 2.0 §3.7.3.3).
    pub skin: Option<u32>,
    /// Morph weights that apply where no clip drives them; length = the mesh's `morph_targets`.
    pub weights: Vec<f32>,
    /// Copies of the mesh, joint-from-mesh (EXT_mesh_gpu_instancing): a field of grass is one instance. Empty: one copy, at the
    /// joint itself. Not meant for skinned instances, for which there is [`Asset::placements`].
    pub copies: Arc<[Affine3A]>,
}

impl MeshInstance {
    /// joint-from-mesh of each copy; the identity if there are no copies.
    pub(crate) fn joint_from_copies(&self) -> impl Iterator<Item = Affine3A> + '_ {
        let identity = if self.copies.is_empty() { Some(Affine3A::IDENTITY) } else { None };
        identity.into_iter().chain(self.copies.iter().copied())
    }

    /// joint-from-mesh of the first `count` copies (`None`: all); the identity if there are no copies.
    pub(crate) fn joint_from_first(&self, count: Option<u32>) -> impl Iterator<Item = Affine3A> + '_ {
        let limit = count.filter(|_| !self.copies.is_empty()).map_or(usize::MAX, |n| n as usize);
        self.joint_from_copies().take(limit)
    }
}
