//! Clips made from a clip, or from nothing: cut, put together, offset, cleaned, keyed.

use super::actor::{euler, find_joint};
use super::clip::made;
use super::keys;
use crate::call::{ApiError, Call, Def, Gives, Reply, point};
use crate::value::*;
use choreo_motion::reduce::Keep;
use choreo_motion::{Clip, Curve, FrameRate, Interpolation, Offset, Path, Pose, Sample, Time};
use choreo_stage::{Asset, Channel, Property, Reference};
use glam::{DQuat, DVec3};
use rhai::Dynamic;

const CLIP: Gives = Gives::A(Kind::Clip);

pub const DEFS: &[Def] = &[
    Def::new(
        Kind::Asset,
        "new_clip",
        "name",
        CLIP,
        "An empty clip of the asset, to be filled with .key.",
        new_clip,
    ),
    Def::new(
        Kind::Clip,
        "key",
        "property, joint, keys, how?",
        CLIP,
        "With keys [[time, value], …] of a joint, in place of any that it had: \"rotation\" (degrees [x, y, z] about its own axes, from rest), \"position\" (metres from rest, along the model's axes) or \"scale\" (times that at rest); how, as for actors' keys.",
        key,
    ),
    Def::new(Kind::Clip, "cut", "from, until", CLIP, "The part between two times of the clip.", cut),
    Def::new(
        Kind::Clip,
        "append",
        "clip",
        CLIP,
        "This clip, then another; what only one of them moves is at rest in the other.",
        append,
    ),
    Def::new(Kind::Clip, "reverse", "", CLIP, "The clip backwards.", reverse),
    Def::new(Kind::Clip, "speed", "factor", CLIP, "The clip so many times as fast, its keys moved.", speed),
    Def::new(
        Kind::Clip,
        "offset",
        "joint, options",
        CLIP,
        "With a joint moved or turned at all times; options: move (metres along the model's axes), turn (degrees about its own x, then y, then z axis).",
        offset,
    ),
    Def::new(
        Kind::Clip,
        "smooth",
        "seconds",
        CLIP,
        "Without jitter: each key is the weighted mean of the clip around it, over so many seconds.",
        smooth,
    ),
    Def::new(Kind::Clip, "resample", "fps", CLIP, "With keys at an even rate in place of its own.", resample),
    Def::new(
        Kind::Clip,
        "reduce",
        "tolerance, options?",
        CLIP,
        "With fewer keys: no joint is farther off than so many metres, measured in the model; options: keep (\"own\": each curve keeps its own keys, fewest bytes; \"shared\": curves keep the same, sampled fastest).",
        reduce,
    ),
    Def::new(
        Kind::Clip,
        "compress",
        "tolerance",
        CLIP,
        "In fewer bytes, sampled as fast: no joint is farther off than so many metres (0.0001 is good), measured in the model; what would not become smaller stays as it is. .lost() tells the error. Best done last: edits, and other bodies, take the keys out again.",
        compress,
    ),
    Def::new(
        Kind::Clip,
        "additive",
        "reference?",
        CLIP,
        "What the clip does beyond a pose, over the rest pose: its \"first\" frame (left out), the \"rest\" pose, or the clip at a time in seconds. A clip like any other, to be edited, mirrored, retargeted; as a layer, .additive(\"rest\").",
        additive,
    ),
    Def::new(
        Kind::Clip,
        "subtractive",
        "reference?",
        CLIP,
        "As additive, the other way: it takes that away.",
        subtractive,
    ),
    Def::new(Kind::Clip, "bytes", "", Gives::Value("int"), "How many bytes its keys take.", byte_count),
    Def::new(
        Kind::Clip,
        "lost",
        "",
        Gives::Value("float"),
        "How many metres its compression moved any joint at most, measured in the model; 0 where it is not compressed.",
        lost,
    ),
    Def::new(Kind::Clip, "keys", "", Gives::Value("int"), "How many keys its curves have.", key_count),
];

fn new_clip(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    let clip =
        Clip::new(c.name(0)?, asset.skeleton.len(), Vec::new()).map_err(|e| ApiError::new(e.to_string()))?;
    c.build().used(&asset);
    made(c, clip, asset)
}

/// A clip made from the receiver, of the same asset.
fn edit<E: std::fmt::Display>(c: &Call, edit: impl FnOnce(&Clip, &Asset) -> Result<Clip, E>) -> Reply {
    let this: ClipRef = c.this()?;
    let clip = edit(&this.clip, &this.asset).map_err(|e| ApiError::new(format!("{}: {e}", c.def.name)))?;
    made(c, clip, this.asset)
}

fn cut(c: &mut Call) -> Reply {
    let (from, until) = (c.duration(0)?, c.duration(1)?);
    edit(c, |clip, _| clip.cut(from, until))
}

fn append(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    let next = super::cue::bound_clip(c, 0, &this.asset)?;
    edit(c, |clip, asset| clip.joined(&next, &asset.skeleton))
}

fn reverse(c: &mut Call) -> Reply {
    edit(c, |clip, _| Ok::<_, String>(clip.reversed()))
}

fn speed(c: &mut Call) -> Reply {
    let factor = c.number(0)?;
    edit(c, |clip, _| clip.at_speed(factor))
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
    edit(c, |clip, asset| clip.offset(joint, by, &asset.skeleton))
}

fn smooth(c: &mut Call) -> Reply {
    let window = c.duration(0)?;
    edit(c, |clip, _| clip.smoothed(window))
}

fn resample(c: &mut Call) -> Reply {
    let fps = c.number_in(0, 0.001, 1000.0)?;
    let rate = FrameRate::from_fps(fps).ok_or_else(|| c.wrong(0, "frames a second, from 0.001 to 1000"))?;
    edit(c, |clip, _| clip.baked(rate).map(|(clip, _)| clip))
}

fn reduce(c: &mut Call) -> Reply {
    let tolerance = c.number_in(0, 0.0, 1.0)?;
    let keep = match c.options(1, &["keep"])?.one_of("keep", &["own", "shared"])? {
        Some("shared") => Keep::Shared,
        _ => Keep::Own,
    };
    edit(c, |clip, asset| clip.reduced(&asset.skeleton, tolerance, keep).map(|(clip, _)| clip))
}

fn compress(c: &mut Call) -> Reply {
    let tolerance = c.number_in(0, 1e-6, 0.1)?;
    edit(c, |clip, asset| clip.compressed(&asset.skeleton, tolerance).map(|(clip, _)| clip))
}

fn additive(c: &mut Call) -> Reply {
    beyond(c, false)
}

fn subtractive(c: &mut Call) -> Reply {
    beyond(c, true)
}

fn beyond(c: &Call, taken_away: bool) -> Reply {
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
    edit(c, |clip, asset| clip.beyond(&pose, &asset.skeleton, taken_away))
}

fn byte_count(c: &mut Call) -> Reply {
    let this: ClipRef = c.this()?;
    Ok(Dynamic::from_int(this.clip.stored_bytes() as i64))
}

fn lost(c: &mut Call) -> Reply {
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
    let channels = keys::read(c, keys::Owner::JointOfClip)?;
    edit(c, |clip, asset| {
        let mut curves = clip.curves().to_vec();
        for channel in channels {
            let curve = curve(asset, joint, &channel);
            curves.retain(|c| (c.joint, c.path) != (joint, curve.path));
            curves.push(curve);
        }
        Clip::new(clip.name.clone(), clip.joint_count(), curves)
    })
}

/// Keys from rest, as a curve in the joint's own terms.
pub fn curve(asset: &Asset, joint: u32, channel: &Channel) -> Curve {
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
                let moved = choreo_motion::edit::in_parent(skeleton, joint, DVec3::from_slice(v));
                let from = if tangent(part) { DVec3::ZERO } else { rest.translation.as_dvec3() };
                values.extend((from + moved).to_array().map(|v| v as f32));
            }
            Path::Translation
        }
    };
    let times: Vec<Time> = channel.times.clone();
    Curve { joint, path, interpolation: channel.interpolation, times: times.into(), values: values.into() }
}
