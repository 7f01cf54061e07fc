//! Content hashes: did a script give the same stage again?
//!
//! Types of the stage are hashed member by member, in the order of their declaration ([`described!`](crate::stage::described)).

use crate::Limit;
use crate::mirroring::Mirroring;
use crate::stage::actor::{Attachment, LookAt, Target};
use crate::stage::camera::{Cut, Rig};
use crate::stage::camera_moves::{CameraLook, CameraShake};
use crate::stage::channel::{Channel, Property};
use crate::stage::clips::{Layer, LayerMode, Reference};
use crate::stage::effects::{EffectDistance, EffectImageUse, EffectTarget, EffectUse};
use crate::stage::layers_2d::{Align, Fit, Font, Layer2dContent, TextOutline, TextPanel};
use crate::stage::parenting::{ParentScale, Parenting};
use crate::stage::path::{Pace, Path, PathFollowing};
use crate::stage::root_motion::CueRootMotion;
use crate::stage::springs::ActorSprings;
use crate::stage::surfaces::SurfaceRule;
use crate::stage::time_remapping::TimeRemapping;
use crate::stage::{
    Background, Cutouts, FrameHook, Pipeline, Settings, SkinOnce, Stage, Transparency, ViewTransform,
};
use choreo_asset::hash::{ContentHash, Writer};
use choreo_asset::{Asset, Light, LightKind, Panorama, Projection, clip_hash};
use choreo_motion::spring::{ColliderShape, RigBone, SpringBone};
use choreo_motion::{Clip, Ease, FrameRate, Interpolation, PhaseMatchedFade, Repeat, Shape, Skinning, Time};
use glam::{Affine3A, DAffine3, DQuat, DVec2, DVec3, Vec3, Vec4};
use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

/// A [`Writer`] that hashes a clip or mask which many cues share once.
#[derive(Default)]
pub(crate) struct StageWriter {
    writer: Writer,
    /// Keyed by address; the content outlives the writer.
    shared: BTreeMap<usize, ContentHash>,
    /// Writes masks themselves instead of their hashes.
    masks_inline: bool,
}

impl Deref for StageWriter {
    type Target = Writer;
    fn deref(&self) -> &Writer {
        &self.writer
    }
}

impl DerefMut for StageWriter {
    fn deref_mut(&mut self) -> &mut Writer {
        &mut self.writer
    }
}

/// A type that is part of a content hash.
pub(crate) trait Hashed {
    fn hash(&self, w: &mut StageWriter);
}

impl Hashed for EffectImageUse {
    fn hash(&self, w: &mut StageWriter) {
        w.text(&self.parameter);
        w.bytes(&self.hash);
    }
}

pub(crate) fn hash_of(content: &(impl Hashed + ?Sized), mut w: StageWriter) -> ContentHash {
    content.hash(&mut w);
    w.writer.finish()
}

impl Stage {
    /// Hash of everything that a snapshot depends on; warnings are left out. Hooks count by [`FrameHook::identity`].
    pub fn content_hash(&self) -> ContentHash {
        hash_of(self, StageWriter::default())
    }
}

impl Layer {
    /// Hash of everything that a pose takes from it.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(self, StageWriter { masks_inline: true, ..StageWriter::default() })
    }
}

/// Hashes values by methods of the [`Writer`].
macro_rules! written {
    ($($ty:ty: |$this:ident, $w:ident| $write:expr;)*) => {
        $(impl $crate::stage::hash::Hashed for $ty {
            fn hash(&self, $w: &mut $crate::stage::hash::StageWriter) {
                let $this = self;
                $write
            }
        })*
    };
}

pub(crate) use written;

written! {
    bool: |v, w| w.flag(*v);
    u32: |v, w| w.u32(*v);
    usize: |v, w| w.count(*v);
    f32: |v, w| w.f32(*v);
    f64: |v, w| w.f64(*v);
    String: |v, w| w.text(v);
    ContentHash: |v, w| w.bytes(v);
    Time: |v, w| w.time(*v);
    Vec3: |v, w| w.vec3(*v);
    Vec4: |v, w| w.vec4(*v);
    DVec2: |v, w| v.to_array().into_iter().for_each(|v| w.f64(v));
    DVec3: |v, w| w.dvec3(*v);
    DQuat: |v, w| w.dquat(*v);
    Affine3A: |v, w| v.to_cols_array().into_iter().for_each(|v| w.f32(v));
    DAffine3: |v, w| v.to_cols_array().into_iter().for_each(|v| w.f64(v));
    // The coefficients of an attenuation.
    [f32; 3]: |v, w| w.f32s(v);
    [u32; 2]: |v, w| v.iter().for_each(|v| w.u32(*v));
    [f64; 4]: |v, w| v.iter().for_each(|v| w.f64(*v));
    Asset: |v, w| w.bytes(&v.content_hash());
    Panorama: |v, w| w.bytes(&v.hash());
    Font: |v, w| w.bytes(&v.hash());
    Align: |v, w| w.count(*v as usize);
    Shape: |v, w| w.count(Shape::ALL.iter().position(|(_, s)| s == v).unwrap_or(Shape::ALL.len()));
    Skinning: |v, w| w.flag(*v == Skinning::DualQuaternion);
    Cutouts: |v, w| w.u32(*v as u32);
    Transparency: |v, w| w.u32(*v as u32);
    // All that it holds is numbers and names, which Debug writes to the last bit; under the types' first names, so that the hashes of
    // older outputs stay valid.
    PhaseMatchedFade: |v, w| {
        w.text(&format!("{v:?}").replace("PhaseMatchedFade", "PhaseFade").replace("Footsteps", "Steps"))
    };
    // The mirrored pairs follow from the asset.
    Mirroring: |_v, _w| ();
    LightKind: |v, w| {
        let (number, parameters) = v.numbered();
        w.tag(number);
        parameters.into_iter().for_each(|v| w.f32(v));
    };
    dyn FrameHook: |v, w| w.text(&v.identity());
}

impl<T: Hashed + ?Sized> Hashed for Arc<T> {
    fn hash(&self, w: &mut StageWriter) {
        (**self).hash(w);
    }
}

impl<T: Hashed> Hashed for Option<T> {
    fn hash(&self, w: &mut StageWriter) {
        w.flag(self.is_some());
        self.iter().for_each(|v| v.hash(w));
    }
}

impl<T: Hashed> Hashed for [T] {
    fn hash(&self, w: &mut StageWriter) {
        w.count(self.len());
        self.iter().for_each(|v| v.hash(w));
    }
}

impl<T: Hashed> Hashed for Vec<T> {
    fn hash(&self, w: &mut StageWriter) {
        self.as_slice().hash(w);
    }
}

impl<A: Hashed, B: Hashed> Hashed for (A, B) {
    fn hash(&self, w: &mut StageWriter) {
        self.0.hash(w);
        self.1.hash(w);
    }
}

impl<A: Hashed, B: Hashed, C: Hashed> Hashed for (A, B, C) {
    fn hash(&self, w: &mut StageWriter) {
        self.0.hash(w);
        self.1.hash(w);
        self.2.hash(w);
    }
}

impl StageWriter {
    /// Writes the hash of content that many share, which is computed once.
    fn once<T: ?Sized>(&mut self, content: &Arc<T>, hash: impl FnOnce() -> ContentHash) {
        let address = Arc::as_ptr(content).cast::<()>() as usize;
        let hash = *self.shared.entry(address).or_insert_with(hash);
        self.bytes(&hash);
    }

    /// Writes the joint weights of a layer.
    fn mask(&mut self, mask: &Option<Arc<Vec<f32>>>) {
        self.flag(mask.is_some());
        match mask {
            Some(mask) if self.masks_inline => self.f32s(mask),
            Some(mask) => self.once(mask, || choreo_asset::hash::hash_of(|w| w.f32s(mask))),
            None => {}
        }
    }
}

/// Hashes structs member by member and enums by number and members. The numbers stay, so that hashes do.
macro_rules! hashed {
    (@one struct $name:ident { $($member:ident),* $(; without $($skipped:ident),*)? }) => {
        impl $crate::stage::hash::Hashed for $name {
            fn hash(&self, w: &mut $crate::stage::hash::StageWriter) {
                let $name { $($member,)* $($($skipped: _),*)? } = self;
                $($crate::stage::hash::Hashed::hash($member, w);)*
            }
        }
    };
    (@one enum $name:ident {
        $($number:literal $variant:ident $(($only:ident))? $({ $($member:ident),* $(; without $($skipped:ident),*)? })?,)*
    }) => {
        impl $crate::stage::hash::Hashed for $name {
            fn hash(&self, w: &mut $crate::stage::hash::StageWriter) {
                match self {
                    $($name::$variant $(($only))? $({ $($member,)* $($($skipped: _),*)? })? => {
                        w.tag($number);
                        $($crate::stage::hash::Hashed::hash($only, w);)?
                        $($($crate::stage::hash::Hashed::hash($member, w);)*)?
                    })*
                }
            }
        }
    };
    ($($what:ident $name:ident { $($body:tt)* })*) => {
        $($crate::stage::hash::hashed!(@one $what $name { $($body)* });)*
    };
}

pub(crate) use hashed;

hashed! {
    struct Stage { settings, actors, cameras, cuts, lights, layers_2d, sky, effects, hooks; without solvers, markers, warnings }
    struct FrameRate { num, den }
    enum Background {
        0 Color(color),
        1 Gradient { top, bottom },
    }
    struct Attachment { actor, joint }
    struct Parenting { to, start, blend, keep, scale, placement }
    enum ParentScale {
        0 Keep,
        1 Inherit,
    }
    enum Target {
        0 Point(point),
        1 Actor(actor),
        2 Joint { actor, joint },
    }
    enum Reference {
        0 FirstFrame,
        1 Rest,
        2 At(time),
    }
    enum LayerMode {
        0 Override,
        1 Additive(reference),
        2 Subtractive(reference),
    }
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
    struct Channel { property, interpolation, times, values }
    enum Interpolation {
        0 Step,
        1 Linear,
        2 CubicSpline,
    }
    enum Property {
        0 Translation,
        1 Rotation,
        2 Scale,
        3 Visible,
        4 Tint,
        5 Morph { instance, target },
        6 FieldOfView,
        7 Intensity,
        8 Color,
        9 Expression { expression },
        10 Weight,
        11 Speed,
        12 ClipTime,
        13 Parameter,
        14 Turn,
        15 Opacity,
        16 Range,
        17 Cone,
        18 LineWidth,
        19 Copies,
        20 FocalLength,
    }
    struct Cut { at, camera, dissolve }
    struct CameraLook { target, start, blend }
    struct CameraShake { start, end, fade, angle, shift, frequency, seed }
    enum Rig {
        0 Fixed { position, rotation, look_at },
        1 Follow { target, offset },
        2 Orbit { target, distance, elevation, azimuth, speed },
        3 File { actor, camera },
        4 Frame { azimuth, elevation },
    }
    enum Projection {
        0 Perspective { yfov, near, far },
        1 Orthographic { height, near, far },
    }
    struct Light { kind, color, intensity, range }
    struct PathFollowing { path, start, pace, turns }
    enum Pace {
        0 OfClips,
        1 Constant(speed),
    }
    struct SurfaceRule { material, cutouts, transparency }
    struct EffectUse { plugin, parameters, images, start, end, keys, distances, on, cameras; without off_screen }
    struct EffectDistance { parameter, target, least, most }
    struct EffectTarget { actor, material }
    struct LookAt { joint, target, start, end, fade, weight }
    enum Limit {
        0 Free,
        1 SwingTwist { axis, swing, twist },
        2 Hinge { axis, angle },
    }
    struct RigBone { joint, tail, spring, hit_radius, gravity, pull, center, colliders }
    struct SpringBone { stiffness, damping }
    enum ColliderShape {
        0 Sphere { offset, radius, inside },
        1 Capsule { offset, tail, radius, inside },
        2 Plane { offset, normal },
    }
    struct TextOutline { color, width }
    struct TextPanel { color, padding, radius }
    enum Layer2dContent {
        0 Text { words, font, size, width, align, line_height, color, outline, panel },
        1 Picture { hash, fit; without image },
        2 Panel { size, color },
        3 Bars { ratio, color },
    }
}

written! {
    Path: |v, w| {
        v.points.hash(w);
        w.flag(v.closed)
    };
    TimeRemapping: |v, w| match v {
        TimeRemapping::Speed(curve) => curve.keys.hash(w),
        TimeRemapping::ClipTime(keys) => keys.hash(w),
    };
    [Option<Arc<PhaseMatchedFade>>; 2]: |v, w| v.iter().for_each(|step| step.hash(w));
    Arc<Clip>: |v, w| w.once(v, || clip_hash(v));
    Layer: |v, w| {
        let Layer { mask, mode, rank, weight_keys, cues } = v;
        w.mask(mask);
        mode.hash(w);
        w.u32(*rank);
        weight_keys.hash(w);
        cues.hash(w)
    };
    Settings: |v, w| {
        let Settings { size, fps, length, background, ambient_up, ambient_down, samples, .. } = v;
        let Settings { cutouts, transparency, pipeline, skin_once, exposure, view_transform, .. } = v;
        let Settings { levels_of_detail, .. } = v;
        size.hash(w);
        fps.hash(w);
        w.time(*length);
        background.hash(w);
        w.vec3(*ambient_up);
        w.vec3(*ambient_down);
        samples.hash(w);
        // The usual choices write nothing: the hashes of stages before there were others stay.
        if *cutouts != Cutouts::default() || *transparency != Transparency::default() {
            cutouts.hash(w);
            transparency.hash(w);
        }
        if *pipeline != Pipeline::default() {
            w.text("pipeline");
            w.u32(*pipeline as u32);
        }
        if *exposure != 0.0 {
            w.text("exposure");
            w.f32(*exposure);
        }
        if *view_transform != ViewTransform::default() {
            w.text("view transform");
            w.u32(*view_transform as u32);
        }
        if *skin_once != SkinOnce::default() {
            w.tag(1);
            w.u32(*skin_once as u32);
        }
        if !*levels_of_detail {
            w.text("no levels of detail");
        }
    };
    CueRootMotion: |v, w| {
        w.u32(v.motion.joint());
        w.text(&format!("{:?} {:?}", v.motion.parts, v.motion.treadmill));
        w.flag(v.carries)
    };
    Fit: |v, w| {
        let (number, share) = match v {
            Fit::Height(share) => (0, *share),
            Fit::Width(share) => (1, *share),
            Fit::Contain => (2, 0.0),
            Fit::Cover => (3, 0.0),
        };
        w.tag(number);
        w.f64(share)
    };
    ActorSprings: |v, w| {
        w.dvec3(v.wind);
        w.time(v.pre_roll);
        v.rig.ground.hash(w);
        v.rig.bones().hash(w);
        w.count(v.rig.colliders().len());
        for collider in v.rig.colliders() {
            w.u32(collider.joint);
            collider.shape.hash(w);
        }
    };
}
