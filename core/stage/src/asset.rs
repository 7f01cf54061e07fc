//! What an importer makes of a file: a node tree with meshes, materials, images, cameras, lights, clips.
//!
//! Everything is in choreo's convention: metres, +Y up, right-handed, counter-clockwise front faces,
//! texture v pointing down (glTF). Colours are linear unless a field says sRGB.

use crate::{Expression, Eyes, MaterialLayers, Sequence, Toon, UvMotion};
use choreo_motion::spring::parameters::Springs;
use choreo_motion::{Clip, Skeleton, Time};
use glam::{Affine2, Affine3A, Mat4, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// One imported file, shared by every actor cast from it.
#[derive(Clone, Debug, Default)]
pub struct Asset {
    /// As the script wrote it: `knight.glb`.
    pub name: String,
    /// All nodes of the file, parents first. "Joint" indices everywhere else refer to it.
    pub skeleton: Arc<Skeleton>,
    pub meshes: Vec<Arc<Mesh>>,
    pub skins: Vec<Skin>,
    /// Which mesh hangs on which node, with which skin.
    pub instances: Vec<MeshInstance>,
    /// model-from-model of every place at which the whole body stands, posed once for all of them. Empty: where it is cast.
    pub places: Arc<[Affine3A]>,
    pub materials: Vec<Material>,
    pub images: Vec<Arc<Image>>,
    pub cameras: Vec<AssetCamera>,
    pub lights: Vec<AssetLight>,
    pub clips: Vec<Arc<Clip>>,
    /// Named faces, each name once.
    pub expressions: Vec<Expression>,
    /// Hair, skirts and tails that swing.
    pub springs: Springs,
    /// How the eyes follow a target, where the file says.
    pub eyes: Option<Eyes>,
    /// The file's own convention, which was converted.
    pub origin: Origin,
    /// What the importer had to guess or leave.
    pub warnings: Vec<Warning>,
    /// Filled when first asked for (bounds, hashes); start with `Default::default()`.
    pub derived: crate::Derived,
}

/// How the file itself says what the asset holds in choreo's convention; shown by `choreo info`, used by nothing else.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    /// "COLLADA 1.4.1"; empty where the importer does not say.
    pub format: String,
    /// The program that wrote the file, as it calls itself; may be empty.
    pub writer: String,
    /// Metres a unit of the file; `None` where it is not known.
    pub metres_per_unit: Option<f64>,
    /// The format has no unit: the importer's option, or its guess.
    pub unit_is_assumed: bool,
    /// The file's upward axis: "+Y", "+Z"; may be empty.
    pub up: String,
    /// What else the file says of itself, as label and text: title, authors, licence.
    pub about: Vec<(String, String)>,
}

/// Something an importer guessed or left out; `place` is an element path or byte offset ("materials[2]").
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    pub place: String,
    pub text: String,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Skeleton joint of each skin joint.
    pub joints: Vec<u32>,
    /// joint-from-mesh at bind time, one per skin joint.
    pub inverse_bind: Vec<Mat4>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshInstance {
    pub joint: u32,
    pub mesh: u32,
    /// With a skin, the node's own transform is ignored (glTF 2.0 §3.7.3.3).
    pub skin: Option<u32>,
    /// Morph weights where no clip drives them; length = the mesh's `morph_targets`.
    pub weights: Vec<f32>,
    /// joint-from-mesh of every copy that is drawn (EXT_mesh_gpu_instancing): a field of grass is one instance. Empty: one, at
    /// the joint itself. Without meaning for skinned instances: [`Asset::places`] has one for them.
    pub copies: Arc<[Affine3A]>,
}

impl MeshInstance {
    /// joint-from-mesh of each thing drawn: of the copies, or the identity.
    pub fn joint_from_copies(&self) -> impl Iterator<Item = Affine3A> + '_ {
        let own = if self.copies.is_empty() { Some(Affine3A::IDENTITY) } else { None };
        own.into_iter().chain(self.copies.iter().copied())
    }

    /// The first so many of the copies, all where there is no number; without copies the one.
    pub fn joint_from_first(&self, count: Option<u32>) -> impl Iterator<Item = Affine3A> + '_ {
        let most = count.filter(|_| !self.copies.is_empty()).map_or(usize::MAX, |n| n as usize);
        self.joint_from_copies().take(most)
    }
}

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub name: String,
    pub primitives: Vec<Primitive>,
    /// Number of morph targets, the same in every primitive.
    pub morph_targets: usize,
    pub morph_names: Vec<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Topology {
    #[default]
    Triangles,
    Lines,
    Points,
}

/// Vertex arrays of equal length and an index list. Every index is in range (importers check).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Primitive {
    pub topology: Topology,
    /// Always present: importers number the vertices of unindexed primitives.
    pub indices: Vec<u32>,
    pub positions: Vec<Vec3>,
    /// Unit length. Importers compute flat normals where the file has none (glTF 2.0 §3.7.2.1); empty for lines and points without.
    pub normals: Vec<Vec3>,
    /// xyz unit, w = ±1 bitangent sign; present only where the material has a normal map.
    pub tangents: Vec<Vec4>,
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA, multiplied into the base colour; empty = white.
    pub colors: Vec<Vec4>,
    /// Indices into the skin's joint list, `influences` a vertex; 0, 4 or 8.
    pub influences: usize,
    pub joint_indices: Vec<u16>,
    /// Sum 1 per vertex (importers normalise; a vertex whose weights sum to zero gets weight 1 on its first joint, with a warning).
    pub joint_weights: Vec<f32>,
    pub morphs: Vec<MorphTarget>,
    pub material: Option<u32>,
}

/// Offsets at weight 1; empty lists mean no change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub tangents: Vec<Vec3>,
}

/// 8 bits a channel, RGBA, rows from the top. Whether the colour channels are sRGB depends on the use.
#[derive(Clone, Default, PartialEq)]
pub struct Image {
    pub name: String,
    pub width: u32,
    pub height: u32,
    pub rgba: Vec<u8>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({:?}, {}x{})", self.name, self.width, self.height)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    #[default]
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    pub wrap_u: Wrap,
    pub wrap_v: Wrap,
    pub mag_linear: bool,
    pub min_linear: bool,
    /// None: no mipmaps; Some(false): nearest level; Some(true): blend two levels.
    pub mip_linear: Option<bool>,
}

impl Default for Sampler {
    fn default() -> Self {
        Sampler {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            mag_linear: true,
            min_linear: true,
            mip_linear: Some(true),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into `Asset::images`.
    pub image: u32,
    pub sampler: Sampler,
    /// Which of the primitive's uv lists: 0 or 1.
    pub uv_set: u8,
    /// texture-from-mesh uv (KHR_texture_transform); identity = none.
    pub uv_transform: Affine2,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    #[default]
    Opaque,
    /// Fragments with alpha below the cutoff are discarded.
    Mask(f32),
    /// Source-over blending, sorted back to front.
    Blend,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Shading {
    /// glTF 2.0 Appendix B (GGX, Smith, Schlick), with KHR_materials_specular.
    #[default]
    MetallicRoughness,
    /// Lambert + normalised Blinn–Phong with `specular_color` and `shininess`.
    BlinnPhong,
    /// As Blinn–Phong, but the highlight falls off from the mirrored light's direction (Phong 1975).
    Phong,
    Unlit,
    /// Two colours with a boundary between: [`Toon`]. Vertex colours do not count.
    Toon,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    pub shading: Shading,
    /// Linear RGBA factor.
    pub base_color: Vec4,
    /// sRGB colour, linear alpha.
    pub base_color_texture: Option<TextureRef>,
    pub metallic: f32,
    pub roughness: f32,
    /// G roughness, B metallic, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    pub normal_texture: Option<TextureRef>,
    pub normal_scale: f32,
    /// How deep the surface lies where the normal texture's alpha is 0, in widths of the texture; 0: that alpha means nothing.
    pub relief: f32,
    /// R, linear.
    pub occlusion_texture: Option<TextureRef>,
    pub occlusion_strength: f32,
    /// Linear, emissive strength already multiplied in.
    pub emissive: Vec3,
    /// sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// KHR_materials_specular factor; A of the texture.
    pub specular: f32,
    pub specular_texture: Option<TextureRef>,
    /// KHR_materials_specular colour, or the Blinn–Phong specular colour.
    pub specular_color: Vec3,
    /// sRGB.
    pub specular_color_texture: Option<TextureRef>,
    /// Blinn–Phong exponent.
    pub shininess: f32,
    /// Of Blinn–Phong and Phong only; `None`: mirrors nothing.
    pub reflection: Option<Box<crate::Reflection>>,
    /// Read where the shading is [`Shading::Toon`]; defaults where it is missing.
    pub toon: Option<Arc<Toon>>,
    pub alpha_mode: AlphaMode,
    pub double_sided: bool,
    /// All its textures move, of every shading but [`Shading::Toon`], which has a motion of its own.
    pub uv_motion: Option<UvMotion>,
    /// All its textures are frames side by side, of which one is seen at a time.
    pub strip: Option<FrameStrip>,
    /// Some of its textures are the first of pictures that follow each other.
    pub sequence: Option<Arc<Sequence>>,
    /// Clearcoat, sheen, transmission; of metallic-roughness surfaces only.
    pub layers: Option<Box<MaterialLayers>>,
    /// How wide lines and points are; `None`: a pixel. Without meaning for triangles, and for what has a skin or morphs.
    pub pen: Option<Pen>,
    /// Base colour, normals and specular colour are laid on from three sides, whatever texture coordinates there are; normals
    /// need tangents, each at a right angle to its normal.
    pub triplanar: Option<Triplanar>,
}

/// How textures are laid on a surface from the sides along x, y and z of its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triplanar {
    /// Where the pictures' middles lie, mesh space.
    pub middle: Vec3,
    /// Metres that a picture is wide.
    pub size: f32,
    /// Power of the normal by which sides are mixed; the higher, the narrower the seams.
    pub sharpness: f32,
}

/// What lines and points are drawn with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Across; nothing is drawn at 0, and never less than a pixel otherwise.
    pub width: f32,
    /// Metres of the model, else pixels at any distance.
    pub metres: bool,
    /// Points are discs and lines have round ends; else squares along the picture's edges, and ends that are cut off.
    pub round: bool,
}

/// Frames of a texture in columns and rows, from the top left, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStrip {
    pub columns: u32,
    pub rows: u32,
    /// How many of them there are; at most columns · rows.
    pub count: u32,
    /// Frames a second; after the last comes the first,
    pub fps: f32,
    /// or the last stays.
    pub once: bool,
}

impl FrameStrip {
    /// What of the texture is seen at a time, over its whole.
    pub fn cell(&self, time: Time) -> Affine2 {
        let (columns, rows) = (self.columns.max(1), self.rows.max(1));
        let count = self.count.clamp(1, columns * rows) as usize;
        let frame = crate::sequence::frame(time, self.fps, count, self.once) as u32;
        let scale = Vec2::new(1.0 / columns as f32, 1.0 / rows as f32);
        let at = Vec2::new((frame % columns) as f32, (frame / columns) as f32);
        Affine2::from_scale_angle_translation(scale, 0.0, at * scale)
    }
}

impl Default for Material {
    /// glTF's default material: white, metallic 1, roughness 1.
    fn default() -> Self {
        Material {
            name: String::new(),
            shading: Shading::MetallicRoughness,
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            relief: 0.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            shininess: 32.0,
            reflection: None,
            toon: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            uv_motion: None,
            strip: None,
            sequence: None,
            layers: None,
            pen: None,
            triplanar: None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// `yfov` in radians, full vertical angle; no far plane where `far` is `None`.
    Perspective { yfov: f32, near: f32, far: Option<f32> },
    /// `height` in metres, full vertical extent of the view.
    Orthographic { height: f32, near: f32, far: f32 },
}

impl Default for Projection {
    fn default() -> Self {
        Projection::Perspective { yfov: 0.7, near: 0.05, far: None }
    }
}

/// A camera of the file: looks along its joint's −Z with +Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetCamera {
    pub name: String,
    pub joint: u32,
    pub projection: Projection,
}

/// A light of the file: shines along its joint's −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetLight {
    pub name: String,
    pub joint: u32,
    pub light: Light,
}

/// KHR_lights_punctual: colour is linear and multiplied by intensity
/// (lux for directional, candela for point and spot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    pub kind: LightKind,
    pub color: Vec3,
    pub intensity: f32,
    /// Metres; `None` = unlimited. Point and spot only.
    pub range: Option<f32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    Directional,
    Point,
    /// Half angles in radians, `0 ≤ inner < outer ≤ π/2`.
    Spot {
        inner: f32,
        outer: f32,
    },
}
