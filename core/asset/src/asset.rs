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
    /// model-from-model of every placement of the whole character, which is evaluated once for all of them. Empty: where it is cast.
    pub placements: Arc<[Affine3A]>,
    /// Materials of primitives.
    pub materials: Vec<Material>,
    /// Images of textures.
    pub images: Vec<Arc<Image>>,
    /// Cameras of the file, each on a joint.
    pub cameras: Vec<AssetCamera>,
    /// Lights of the file, each on a joint.
    pub lights: Vec<AssetLight>,
    /// Light from all sides, linear RGB: a white surface in it is as bright. It is that of the stage, unless the script gives another.
    pub ambient: Vec3,
    /// Animation clips; times begin at the clip's own 0 s.
    pub clips: Vec<Arc<Clip>>,
    /// Named faces, each name once.
    pub expressions: Vec<Expression>,
    /// Hair, skirts and tails that swing.
    pub springs: Springs,
    /// How the eyes follow a target, where the file states.
    pub eyes: Option<Eyes>,
    /// The front, if the script gives it; else [`Asset::facing`] finds it.
    pub front: Option<Front>,
    /// The file's own convention, which was converted.
    pub origin: Origin,
    /// Warnings of the importer: what it guessed or left out.
    pub warnings: Vec<Warning>,
    /// Filled when first requested (bounds, hashes); start with `Default::default()`.
    pub derived: Derived,
}

/// How the file itself states what the asset holds in choreo's convention; shown by `choreo info`, used by nothing else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// "COLLADA 1.4.1"; empty where the importer does not say.
    pub format: String,
    /// Name and version of the importer, "collada 0.1.0"; empty of assets that no file gave.
    pub importer: String,
    /// The program that wrote the file, as it calls itself; may be empty.
    pub writer: String,
    /// Metres a unit of the file; `None` where it is not known.
    pub metres_per_unit: Option<f64>,
    /// The format has no unit: the importer's option, or its guess.
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
    /// The guess or what was left out, in a sentence.
    pub text: String,
}

/// Joints that deform meshes, with their inverse bind matrices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Skeleton joint of each skin joint.
    pub joints: Vec<u32>,
    /// joint-from-mesh at bind time, one per skin joint.
    pub inverse_bind: Vec<Mat4>,
}

/// A mesh at a joint of the skeleton.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshInstance {
    /// Joint whose transform places the mesh, where no skin does.
    pub joint: u32,
    /// Index into the asset's meshes.
    pub mesh: u32,
    /// The skin. If there is one, the node's own transform is ignored (glTF 2.0 §3.7.3.3).
    pub skin: Option<u32>,
    /// Morph weights where no clip drives them; length = the mesh's `morph_targets`.
    pub weights: Vec<f32>,
    /// joint-from-mesh of every copy that is drawn (EXT_mesh_gpu_instancing): a field of grass is one instance. Empty: one, at
    /// the joint itself. Without meaning for skinned instances: `Asset::places` has one for them.
    pub copies: Arc<[Affine3A]>,
}

impl MeshInstance {
    /// joint-from-mesh of each thing drawn: of the copies, or the identity.
    pub(crate) fn joint_from_copies(&self) -> impl Iterator<Item = Affine3A> + '_ {
        let own = if self.copies.is_empty() { Some(Affine3A::IDENTITY) } else { None };
        own.into_iter().chain(self.copies.iter().copied())
    }

    /// The first N of the copies, all where there is no number; without copies the one.
    pub(crate) fn joint_from_first(&self, count: Option<u32>) -> impl Iterator<Item = Affine3A> + '_ {
        let most = count.filter(|_| !self.copies.is_empty()).map_or(usize::MAX, |n| n as usize);
        self.joint_from_copies().take(most)
    }
}
