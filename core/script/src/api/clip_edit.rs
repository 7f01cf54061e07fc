//! Edited and authored clips: cut, append, offset, smooth, reduce, compress, additive, keyframes.

use super::clip::clip_handle;
use super::joint_names::find_joint;
use super::keys;
use crate::call::{ApiError, Call, Reply, api, euler, point};
use crate::value::ClipRef;
use choreo_asset::Asset;
use choreo_motion::edit::reduce::KeptTimes;
use choreo_motion::{Clip, Curve, FrameRate, Interpolation, Offset, Path, Pose, Sample, Time};
use choreo_stage::{Channel, Placement, Property, Reference};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

api! {
    /// Returns an empty clip for the asset. Clip.key adds keyframes to it.
    Asset.new_clip("name") -> Clip = new_clip;
    /// Returns the clip with keyframes [[time, value], …] for a property of a joint, in place of its own. `how`,
    /// easing and tangents as in Actor.key.
    /// - Properties: "rotation" (degrees [x, y, z] about the axes of the joint, relative to the rest pose),
    ///   "position" (metres relative to the rest pose, along the axes of the model), "scale" (factor of the scale
    ///   at rest).
    Clip.key("property, joint, keys, how?") -> Clip = key;
    /// Returns the part of the clip between two times.
    Clip.cut("from, until") -> Clip = cut;
    /// Returns this clip followed by another. A joint that only one of them animates is in its rest pose during the
    /// other.
    Clip.append("clip") -> Clip = append;
    /// Returns the clip played backwards.
    Clip.reverse("") -> Clip = reverse;
    /// Returns the clip played faster by a factor. The keyframes are moved.
    Clip.speed("factor") -> Clip = speed;
    /// Returns the clip with a joint moved or rotated at all times. Options: move (metres along the axes of the
    /// model), turn (degrees [x, y, z] about the axes of the joint: x, then y, then z).
    Clip.offset("joint, options") -> Clip = offset;
    /// Returns the clip without jitter: each keyframe becomes the weighted mean of the clip in a window of that
    /// many seconds around it.
    Clip.smooth("seconds") -> Clip = smooth;
    /// Returns the clip with keyframes at a constant frame rate in place of its own (baking).
    Clip.resample("fps") -> Clip = resample;
    /// Returns the clip with fewer keyframes. The tolerance is the largest error of any joint in metres, in model space
    /// (0 to 1). Options: keep ("fewest", the default: curves keep their own keyframes, common ones or all of them,
    /// whichever takes the fewest bytes; "shared": curves keep common keyframes, which are the fastest to sample).
    Clip.reduce("tolerance, options?") -> Clip = reduce;
    /// Returns the clip compressed, in fewer bytes and as fast to sample. The tolerance is the largest error of any
    /// joint in metres, in model space (0.000001 to 0.1; 0.0001 is a good value). What would not become smaller
    /// stays as it is.
    /// - Clip.lost returns the resulting error. Compress last: editing and retargeting decompress the keyframes.
    Clip.compress("tolerance") -> Clip = compress;
    /// Returns an additive clip: the difference between this clip and a reference pose, applied to the rest pose.
    /// The reference is "first" (the first frame, the default), "rest" (the rest pose) or a time of the clip in
    /// seconds.
    /// - The result is a clip like any other, which can be edited, mirrored and retargeted. To play it as an
    ///   additive layer, use Cue.additive("rest").
    Clip.additive("reference?") -> Clip = additive;
    /// Returns the opposite of Clip.additive: as a layer it subtracts the difference.
    Clip.subtractive("reference?") -> Clip = subtractive;
    /// Returns the size of the keyframes in bytes.
    Clip.bytes("") -> "int" = byte_count;
    /// Returns the largest error of any joint that the compression caused, in metres in model space; 0 for a clip
    /// that is not compressed.
    Clip.lost("") -> "float" = compression_error;
    /// Returns the number of keyframes of all curves.
    Clip.keys("") -> "int" = key_count;
}

fn new_clip(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    let clip =
        Clip::new(c.name(0)?, asset.skeleton.len(), Vec::new()).map_err(|e| ApiError::new(e.to_string()))?;
    c.stage_draft().mark_used(&asset);
    clip_handle(c, clip, asset)
}

/// Returns the edited clip of the receiver, for the same asset.
fn make_edited<E: std::fmt::Display>(c: &Call, edit: impl FnOnce(&Clip, &Asset) -> Result<Clip, E>) -> Reply {
    let this: ClipRef = c.this()?;
    let clip = edit(&this.clip, &this.asset).map_err(|e| ApiError::new(format!("{}: {e}", c.def.name)))?;
    clip_handle(c, clip, this.asset)
}

fn cut(c: &mut Call) -> Reply {
    let (from, until) = (c.duration(0)?, c.duration(1)?);
    make_edited(c, |clip, _| clip.cut(from, until))
}

fn append(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let next = super::cue::bound_clip(c, 0, &this.asset)?;
    make_edited(c, |clip, asset| clip.joined(&next, &asset.skeleton))
}

fn reverse(c: &mut Call) -> Reply {
    make_edited(c, |clip, _| Ok::<_, String>(clip.reversed()))
}

fn speed(c: &mut Call) -> Reply {
    let factor = c.number(0)?;
    make_edited(c, |clip, _| clip.at_speed(factor))
}

fn offset(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let joint = find_joint(&this.asset, &c.text(0)?)?;
    let o = c.options(1, &["move", "turn"])?;
    let angles = o.get("turn").map(|v| point(&v, &o.label("turn"))).transpose()?;
    let by = Offset {
        moved: o.point("move")?.unwrap_or(DVec3::ZERO),
        turned: angles.map_or(DQuat::IDENTITY, euler),
    };
    make_edited(c, |clip, asset| clip.offset(joint, by, &asset.skeleton))
}

fn smooth(c: &mut Call) -> Reply {
    let window = c.duration(0)?;
    make_edited(c, |clip, _| clip.smoothed(window))
}

fn resample(c: &mut Call) -> Reply {
    let fps = c.number_in(0, 0.001, 1000.0)?;
    let rate =
        FrameRate::from_fps(fps).map_err(|why| ApiError::new(format!("resample: fps {why}, got {fps:?}")))?;
    make_edited(c, |clip, _| clip.baked(rate).map(|(clip, _)| clip))
}

fn reduce(c: &mut Call) -> Reply {
    let tolerance = c.number_in(0, 0.0, 1.0)?;
    let keep = match c.options(1, &["keep"])?.one_of("keep", &["fewest", "shared"])? {
        Some("shared") => KeptTimes::Shared,
        _ => KeptTimes::Fewest,
    };
    make_edited(c, |clip, asset| clip.reduced(&asset.skeleton, tolerance, keep).map(|(clip, _)| clip))
}

fn compress(c: &mut Call) -> Reply {
    let tolerance = c.number_in(0, 1e-6, 0.1)?;
    make_edited(c, |clip, asset| clip.compressed(&asset.skeleton, tolerance).map(|(clip, _)| clip))
}

fn additive(c: &mut Call) -> Reply {
    difference_from_reference(c, false)
}

fn subtractive(c: &mut Call) -> Reply {
    difference_from_reference(c, true)
}

fn difference_from_reference(c: &Call, subtracts: bool) -> Reply {
    let this: ClipRef = c.this()?;
    let mut pose = Pose::rest(&this.asset.skeleton);
    let time = match super::cue::reference(c, &this.clip)? {
        Reference::Rest => None,
        Reference::FirstFrame => Some(Time::ZERO),
        Reference::At(time) => Some(time),
    };
    if let Some(time) = time {
        Sample { clip: &this.clip, time, pose: &mut pose }.run();
    }
    make_edited(c, |clip, asset| clip.difference_from(&pose, &asset.skeleton, subtracts))
}

fn byte_count(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from_int(this.clip.stored_bytes() as i64))
}

fn compression_error(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from_float(this.clip.compression().map_or(0.0, |report| report.worst_m)))
}

fn key_count(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from_int(this.clip.keys() as i64))
}

fn key(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let joint = find_joint(&this.asset, &c.text(1)?)?;
    let channel = keys::channel(c, keys::named_property(c, &keys::keyed_properties::<Placement>())?, 2)?;
    make_edited(c, |clip, asset| {
        let mut curves = clip.curves().to_vec();
        let curve = curve_in_parent_space(asset, joint, &channel);
        curves.retain(|c| (c.joint, c.path) != (joint, curve.path));
        curves.push(curve);
        Clip::new(clip.name.clone(), clip.joint_count(), curves)
    })
}

/// Converts keyframes relative to the rest pose to a curve in the space of the joint's parent.
pub(crate) fn curve_in_parent_space(asset: &Asset, joint: u32, channel: &Channel) -> Curve {
    let skeleton = &asset.skeleton;
    let rest = &skeleton.rest()[joint as usize];
    let cubic = channel.interpolation == Interpolation::CubicSpline;
    let tangent = |part: usize| cubic && part % 3 != 1;
    let mut values: Vec<f32> = Vec::with_capacity(channel.values.len());
    let path = match channel.property {
        Property::Rotation => {
            let base = rest.rotation.as_dquat();
            for q in channel.values.chunks_exact(4) {
                values.extend((base * DQuat::from_slice(q)).to_array().map(|v| v as f32));
            }
            Path::Rotation
        }
        Property::Scale => {
            for (i, v) in channel.values.iter().enumerate() {
                values.push((f64::from(rest.scale.to_array()[i % 3]) * v) as f32);
            }
            Path::Scale
        }
        _ => {
            for (part, v) in channel.values.chunks_exact(3).enumerate() {
                let moved = choreo_motion::edit::offset_in_parent(skeleton, joint, DVec3::from_slice(v));
                let from = if tangent(part) { DVec3::ZERO } else { rest.translation.as_dvec3() };
                values.extend((from + moved).to_array().map(|v| v as f32));
            }
            Path::Translation
        }
    };
    let times: Vec<Time> = channel.times.clone();
    Curve { joint, path, interpolation: channel.interpolation, times: times.into(), values: values.into() }
}
