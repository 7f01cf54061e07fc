//! Content hashes of assets and their parts. Members must keep their order, so that hashes stay valid.

use crate::asset::{Asset, MeshInstance, Skin};
use crate::camera::{AssetCamera, Projection};
use crate::expression::{ColorBind, Expression, ExpressionGroup, MaterialColor, MorphBind, Override, UvBind};
use crate::eyes::{Eyes, EyesMovedBy, RangeMap};
use crate::hash::{ContentHash, Hashed, Writer, hash_of};
use crate::image_sequence::{ImageSequence, ImageStream};
use crate::light::{AssetLight, Light, LightKind};
use crate::material::{AlphaMode, FrameStrip, LineStyle, Material, Shading, Triplanar};
use crate::material_layers::MaterialLayers;
use crate::mesh::{Mesh, MorphTarget, Primitive, Topology};
use crate::panorama::Panorama;
use crate::reflection::Reflection;
use crate::texture::{Image, Sampler, TextureRef, Wrap};
use crate::toon::{Outline, Toon, UvMotion};
use crate::{hashed, written};
use choreo_motion::ik::Limit;
use choreo_motion::spring::parameters::{ColliderShape, SpringChain, SpringCollider, SpringJoint, Springs};
use choreo_motion::spring::{RigBone, SpringBone};
use choreo_motion::{
    Clip, Curve, Ease, ExpressionCurve, FrameRate, Humanoid, Interpolation, MaterialProperty, Path,
    PhaseMatchedFade, PropertyTarget, Repeat, Shape, Skeleton, Skinning, Transform,
};
use std::sync::Arc;

impl Primitive {
    /// Hash of everything drawn except the material index: equal geometry is shared whatever its material.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.hash(w))
    }
}

impl Mesh {
    /// Hash of the primitives, their material indices and the number of morph targets, without names.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.write(w))
    }

    fn write(&self, w: &mut Writer) {
        let parts: Vec<_> = self.primitives.iter().map(|primitive| (primitive, primitive.material)).collect();
        (parts, self.morph_targets).hash(w);
    }
}

impl Image {
    /// Hash of size and pixels, without the name.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| (self.width, self.height, &self.rgba).hash(w))
    }
}

impl Material {
    /// Hash of everything except the name and the textures; it does count which texture slots are used.
    pub fn hash_without_textures(&self) -> ContentHash {
        hash_of(|w| {
            w.without_textures = true;
            self.hash(w);
        })
    }
}

/// Hash of name, duration and authored curves.
pub fn clip_hash(clip: &Clip) -> ContentHash {
    hash_of(|w| {
        w.text(&clip.name);
        (clip.duration, clip.curves(), clip.expressions()).hash(w);
        let keys = |curve: &Curve| (curve.interpolation, curve.times.clone(), curve.values.clone());
        clip.properties().map(|(target, curve)| (target, keys(curve))).collect::<Vec<_>>().hash(w);
    })
}

pub(crate) fn asset_hash(asset: &Asset) -> ContentHash {
    let images: Vec<ContentHash> = asset.images.iter().map(|image| image.content_hash()).collect();
    let mut w = Writer::default();
    w.images.clone_from(&images);
    let Asset { name, skeleton, meshes, skins, instances, placements, materials, images: _, .. } = asset;
    let Asset { cameras, lights, ambient, clips, expressions, springs, eyes, front, .. } = asset;
    // The file's origin, warnings and derived data do not count.
    let Asset { origin: _, warnings: _, derived: _, .. } = asset;
    name.hash(&mut w);
    w.bytes(&skeleton_hash(skeleton));
    w.count(meshes.len());
    for mesh in meshes {
        mesh.write(&mut w);
        (&mesh.name, &mesh.morph_names).hash(&mut w);
    }
    (skins, instances).hash(&mut w);
    w.count(placements.len());
    placements.iter().for_each(|place| place.to_cols_array().as_slice().hash(&mut w));
    let named: Vec<_> = materials.iter().map(|material| (material, &material.name)).collect();
    (named, images).hash(&mut w);
    (cameras, lights, clips).hash(&mut w);
    (expressions, springs, eyes).hash(&mut w);
    // An asset without a given front writes nothing here, so that its hash stays as it was before this field existed.
    front.iter().for_each(|front| w.text(front.name()));
    if *ambient != glam::Vec3::ZERO {
        w.text("ambient");
        ambient.hash(&mut w);
    }
    w.finish()
}

/// Hash of joint names, hierarchy, rest pose and humanoid bones.
fn skeleton_hash(skeleton: &Skeleton) -> ContentHash {
    let tree = (skeleton.names(), skeleton.parents(), skeleton.rest());
    hash_of(|w| (tree, skeleton.humanoid()).hash(w))
}

hashed! {
    struct Primitive {
        topology, indices, positions, normals, tangents, uvs, colors, influences, joint_indices, joint_weights, morphs;
        without material
    }
    enum Topology {
        0 Triangles,
        1 Lines,
        2 Points,
    }
    struct MorphTarget { positions, normals, tangents }
    struct Skin { joints, inverse_bind }
    struct AssetCamera { name, joint, projection }
    enum Projection {
        0 Perspective { yfov, near, far },
        1 Orthographic { height, near, far },
    }
    struct AssetLight { name, joint, light }
    struct Light { kind, color, intensity, range }
    struct Material {
        shading, base_color, metallic, roughness, normal_scale, occlusion_strength, specular, shininess, emissive, specular_color,
        alpha_mode, double_sided, relief, uv_motion, sequence, triplanar, line_style, flipbook, base_color_texture,
        metallic_roughness_texture, normal_texture, occlusion_texture, emissive_texture, specular_texture, specular_color_texture,
        reflection, toon, layers;
        without name
    }
    enum Shading {
        0 MetallicRoughness,
        1 BlinnPhong,
        4 Phong,
        2 Unlit,
        3 Toon,
    }
    enum AlphaMode {
        0 Opaque,
        1 Mask(cutoff),
        2 Blend,
    }
    struct UvMotion { scroll, rotation }
    struct ImageSequence { streams, fps, once }
    struct Triplanar { middle, size, sharpness }
    struct LineStyle { width, metres, round }
    struct Sampler { wrap_u, wrap_v, mag_linear, min_linear, mip_linear }
    enum Wrap {
        0 Repeat,
        1 MirroredRepeat,
        2 ClampToEdge,
    }
    struct Reflection { color, texture, environment }
    struct Outline { width, on_screen, color, lighting_mix; without width_texture }
    struct MaterialLayers {
        clearcoat, clearcoat_roughness, clearcoat_normal_scale, sheen_roughness, transmission, thickness, ior, dispersion,
        attenuation_distance, iridescence, iridescence_ior, iridescence_thickness, anisotropy, anisotropy_rotation,
        diffuse_transmission, sheen_color, attenuation_color, diffuse_transmission_color, clearcoat_texture,
        clearcoat_roughness_texture, clearcoat_normal_texture, sheen_color_texture, sheen_roughness_texture, transmission_texture,
        thickness_texture, iridescence_texture, iridescence_thickness_texture, anisotropy_texture, diffuse_transmission_texture,
        diffuse_transmission_color_texture
    }
    struct Transform { translation, rotation, scale }
    struct Curve { joint, path, interpolation, times, values }
    struct ExpressionCurve { name, interpolation, times, values }
    enum Path {
        0 Translation,
        1 Rotation,
        2 Scale,
        3 Weights(count),
    }
    enum Interpolation {
        0 Step,
        1 Linear,
        2 CubicSpline,
    }
    enum PropertyTarget {
        0 CameraYfov(index),
        1 CameraHeight(index),
        2 LightColor(index),
        3 LightIntensity(index),
        4 BaseColor(index),
        5 LightRange(index),
        6 SpotInner(index),
        7 SpotOuter(index),
        8 Material(index, property),
    }
    struct Expression { name, binary, group, morphs, colors, uvs, over_mouth, over_blink, over_gaze }
    enum ExpressionGroup {
        0 Other,
        1 Mouth,
        2 Blink,
        3 Gaze,
    }
    struct MorphBind { instance, target, weight }
    struct ColorBind { material, color, to }
    enum Override {
        0 None,
        1 Block,
        2 Blend,
    }
    struct Springs { colliders, chains }
    struct SpringCollider { joint, shape }
    enum ColliderShape {
        0 Sphere { offset, radius, inside },
        1 Capsule { offset, tail, radius, inside },
        2 Plane { offset, normal },
    }
    struct SpringChain { name, joints, colliders, center }
    struct SpringJoint { joint, tail, gravity_direction, hit_radius, stiffness, gravity_power, drag_force }
    struct RigBone { joint, tail, spring, hit_radius, gravity, pull, center, colliders }
    struct SpringBone { stiffness, damping }
    struct Eyes { offset_from_head, moved_by, inner, outer, down, up }
    enum EyesMovedBy {
        0 Bones,
        1 Expressions,
    }
    struct RangeMap { input_max, output_scale }
    enum Limit {
        0 Free,
        1 SwingTwist { axis, swing, twist },
        2 Hinge { axis, angle },
    }
    struct FrameRate { num, den }
    enum Repeat {
        0 Once,
        1 Loop,
        2 PingPong,
    }
    enum Ease {
        0 Linear,
        1 Smooth,
        2 In(shape),
        3 Out(shape),
        4 InOut(shape),
        5 Bezier(points),
    }
}

written! {
    Asset: |v, w| w.bytes(&v.content_hash());
    Panorama: |v, w| w.bytes(&v.hash());
    Arc<Clip>: |v, w| w.once(v, || clip_hash(v));
    MeshInstance: |v, w| {
        (v.joint, v.mesh, v.skin).hash(w);
        v.weights.hash(w);
        w.count(v.copies.len());
        v.copies.iter().for_each(|copy| copy.to_cols_array().as_slice().hash(w))
    };
    LightKind: |v, w| {
        let (number, parameters) = v.numbered();
        w.tag(number);
        f32::hash_all(&parameters, w)
    };
    FrameStrip: |v, w| {
        [v.columns, v.rows, v.count].iter().for_each(|n| f64::from(*n).hash(w));
        (v.fps, v.once).hash(w)
    };
    ImageStream: |v, w| (v.slot as u8, &v.hashes).hash(w);
    TextureRef: |v, w| {
        if w.without_textures {
            return;
        }
        match w.images.get(v.image as usize).copied() {
            Some(hash) => hash.hash(w),
            None => v.image.hash(w),
        }
        (v.sampler, v.uv_set, v.uv_transform).hash(w)
    };
    Toon: |v, w| {
        let Toon { shade_color, shading_shift, shading_shift_scale, shading_toony, gi_equalization, matcap, .. } = v;
        let Toon { rim_color, rim_fresnel_power, rim_lift, rim_lighting_mix, outline, uv_motion, uv_moved, .. } = v;
        // Textures are hashed as a list below.
        let Toon { shade_texture: _, shading_shift_texture: _, matcap_texture: _, rim_texture: _, uv_mask: _, .. } = v;
        let motion = |m: &UvMotion| vec![m.scroll.x, m.scroll.y, m.rotation];
        uv_motion.as_ref().map(motion).hash(w);
        [*shade_color, *matcap, *rim_color, *uv_moved].hash(w);
        [*shading_shift, *shading_shift_scale, *shading_toony, *gi_equalization].hash(w);
        (rim_fresnel_power, rim_lift, rim_lighting_mix).hash(w);
        v.textures().iter().for_each(|texture| texture.hash(w));
        outline.hash(w)
    };
    MaterialProperty: |v, w| {
        let (kind, slot) = match *v {
            MaterialProperty::Emissive => (0, 0),
            MaterialProperty::EmissiveStrength => (1, 0),
            MaterialProperty::Metallic => (2, 0),
            MaterialProperty::Roughness => (3, 0),
            MaterialProperty::AlphaCutoff => (4, 0),
            MaterialProperty::NormalScale => (5, 0),
            MaterialProperty::OcclusionStrength => (6, 0),
            MaterialProperty::UvOffset(slot) => (7, slot),
            MaterialProperty::UvRotation(slot) => (8, slot),
            MaterialProperty::UvScale(slot) => (9, slot),
        };
        [kind, slot].hash(w)
    };
    Humanoid: |v, w| {
        v.bones().flat_map(|(bone, joint)| [bone as u32, joint]).collect::<Vec<_>>().hash(w);
        v.t_pose().hash(w)
    };
    MaterialColor: |v, w| w.tag(*v as u8);
    UvBind: |v, w| {
        v.material.hash(w);
        [v.offset.x, v.offset.y, v.scale.x, v.scale.y].as_slice().hash(w)
    };
    Shape: |v, w| w.count(Shape::ALL.iter().position(|(_, s)| s == v).unwrap_or(Shape::ALL.len()));
    Skinning: |v, w| (*v == Skinning::DualQuaternion).hash(w);
    // Debug writes these numbers and names without loss. The types appear under their former names, so that the hashes of older
    // outputs stay valid.
    PhaseMatchedFade: |v, w| {
        w.text(&format!("{v:?}").replace("PhaseMatchedFade", "PhaseFade").replace("Footsteps", "Steps"))
    };
}
