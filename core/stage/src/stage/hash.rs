//! Content hashes, which show whether a script gives the same stage again.
//!
//! Types of the stage are hashed member by member, in the order of their declaration ([`described!`](crate::stage::described)).

use crate::mirroring::Mirroring;
use crate::stage::actor::{Attachment, LookAt, Target};
use crate::stage::camera::{Cut, Rig};
use crate::stage::camera_moves::{CameraLook, CameraShake};
use crate::stage::channel::{Channel, Property};
use crate::stage::clips::{Layer, LayerMode, Reference};
use crate::stage::effects::{EffectDistance, EffectImageUse, EffectTarget, EffectUse};
use crate::stage::layers_2d::{Fit, Layer2dContent, TextOutline, TextPanel};
use crate::stage::parenting::{ParentScale, Parenting};
use crate::stage::path::{Pace, Path, PathFollowing};
use crate::stage::root_motion::CueRootMotion;
use crate::stage::springs::ActorSprings;
use crate::stage::surfaces::SurfaceRule;
use crate::stage::time_remapping::TimeRemapping;
use crate::stage::{
    Background, Cutouts, FrameCallback, Pipeline, PreSkinning, Settings, Stage, Transparency, ViewTransform,
};
use choreo_asset::hash::{ContentHash, Hashed, Writer, hash_of};
use choreo_asset::{hashed, written};

impl Stage {
    /// Hash of everything that a snapshot depends on; warnings are left out. Callbacks count by [`FrameCallback::identity`].
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| self.hash(w))
    }
}

impl Layer {
    /// Hash of all values of the layer that affect a pose.
    pub fn content_hash(&self) -> ContentHash {
        hash_of(|w| {
            self.mask.hash(w);
            self.hash_without_mask(w);
        })
    }

    fn hash_without_mask(&self, w: &mut Writer) {
        let Layer { mask: _, mode, rank, weight_keys, cues } = self;
        (mode, rank).hash(w);
        (weight_keys, cues).hash(w);
    }
}

hashed! {
    struct Stage {
        settings, actors, cameras, cuts, lights, layers_2d, sky, effects, frame_callbacks;
        without solvers, markers, warnings
    }
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
    struct Channel { property, interpolation, times, values }
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
    struct PathFollowing { path, start, pace, turns }
    enum Pace {
        0 FromRootMotion,
        1 Constant(speed),
    }
    struct SurfaceRule { material, cutouts, transparency }
    struct EffectUse { plugin, parameters, images, start, end, keys, distances, on, cameras; without off_screen }
    struct EffectDistance { parameter, target, least, most }
    struct EffectTarget { actor, material }
    struct LookAt { joint, target, start, end, fade, weight }
    struct TextOutline { color, width }
    struct TextPanel { color, padding, radius }
}

written! {
    EffectImageUse: |v, w| (&v.parameter, v.hash).hash(w);
    Layer2dContent: |v, w| match v {
        Layer2dContent::Text { words, font, size, width, align, line_height, color, outline, panel } => {
            w.tag(0);
            (words, font.hash(), size).hash(w);
            (width, *align as usize, line_height).hash(w);
            (color, outline, panel).hash(w);
        }
        Layer2dContent::Picture { hash, fit, image: _ } => {
            w.tag(1);
            (hash, fit).hash(w);
        }
        Layer2dContent::Panel { size, color } => {
            w.tag(2);
            (size, color).hash(w);
        }
        Layer2dContent::Bars { ratio, color } => {
            w.tag(3);
            (ratio, color).hash(w);
        }
    };
    Cutouts: |v, w| (*v as u32).hash(w);
    Transparency: |v, w| (*v as u32).hash(w);
    // The mirrored pairs follow from the asset.
    Mirroring: |_v, _w| ();
    dyn FrameCallback: |v, w| w.text(&v.identity());
    Path: |v, w| {
        v.points.hash(w);
        v.closed.hash(w)
    };
    TimeRemapping: |v, w| match v {
        TimeRemapping::Speed(curve) => curve.keys.hash(w),
        TimeRemapping::ClipTime(keys) => keys.hash(w),
    };
    Layer: |v, w| {
        v.mask.is_some().hash(w);
        v.mask.iter().for_each(|mask| w.once(mask, || hash_of(|w| mask.hash(w))));
        v.hash_without_mask(w)
    };
    Settings: |v, w| {
        let Settings { size, fps, length, background, ambient_up, ambient_down, samples, .. } = v;
        let Settings { cutouts, transparency, pipeline, pre_skinning, exposure, view_transform, .. } = v;
        let Settings { levels_of_detail, .. } = v;
        (size, fps, length).hash(w);
        (background, ambient_up, ambient_down).hash(w);
        samples.hash(w);
        // Default values write nothing, so that hashes from before these options existed stay the same.
        if *cutouts != Cutouts::default() || *transparency != Transparency::default() {
            cutouts.hash(w);
            transparency.hash(w);
        }
        if *pipeline != Pipeline::default() {
            w.text("pipeline");
            (*pipeline as u32).hash(w);
        }
        if *exposure != 0.0 {
            w.text("exposure");
            exposure.hash(w);
        }
        if *view_transform != ViewTransform::default() {
            w.text("view transform");
            (*view_transform as u32).hash(w);
        }
        if *pre_skinning != PreSkinning::default() {
            w.tag(1);
            (*pre_skinning as u32).hash(w);
        }
        if !*levels_of_detail {
            w.text("no levels of detail");
        }
    };
    CueRootMotion: |v, w| {
        v.motion.joint().hash(w);
        w.text(&format!("{:?} {:?}", v.motion.parts, v.motion.treadmill));
        v.carries.hash(w)
    };
    Fit: |v, w| {
        let (number, share) = match v {
            Fit::Height(share) => (0, *share),
            Fit::Width(share) => (1, *share),
            Fit::Contain => (2, 0.0),
            Fit::Cover => (3, 0.0),
        };
        w.tag(number);
        share.hash(w)
    };
    ActorSprings: |v, w| {
        (v.wind, v.pre_roll).hash(w);
        (&v.rig.ground, v.rig.bones(), v.rig.colliders()).hash(w)
    };
}
