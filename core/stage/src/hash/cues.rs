//! Layers and their cues.

use crate::hash::stage::write_channel;
use crate::stage::clips::{Cue, Layer, LayerMode, Reference};
use crate::stage::time_remapping::Warp;
use choreo_asset::ContentHash;
use choreo_asset::hash::Writer;
use choreo_motion::{Clip, Ease, Repeat, Shape};
use std::sync::Arc;

pub(super) fn write_layer(
    w: &mut Writer,
    layer: &Layer,
    mut mask: impl FnMut(&mut Writer, &Arc<Vec<f32>>),
    mut clip: impl FnMut(&Arc<Clip>) -> ContentHash,
) {
    let Layer { mask: joints, mode, rank, weight_keys, cues } = layer;
    w.option(joints, |w, joints| mask(w, joints));
    write_layer_mode(w, mode);
    w.u32(*rank);
    w.option(weight_keys, |w, keys| write_channel(w, keys));
    w.list(cues, |w, cue| {
        w.bytes(&clip(&cue.clip));
        write_cue(w, cue);
    });
}

pub(super) fn write_cue(w: &mut Writer, cue: &Cue) {
    let Cue {
        clip: _,
        start,
        end,
        fade_in,
        fade_out,
        ease,
        speed,
        trim,
        repeat,
        weight,
        weight_keys,
        warp,
        freezes,
        in_step,
        inertial,
        root,
    } = cue;
    w.time(*start);
    w.option(end, |w, end| w.time(*end));
    for t in [fade_in, fade_out, &trim.0, &trim.1] {
        w.time(*t);
    }
    write_ease(w, ease);
    w.f64(*speed);
    w.tag(match repeat {
        Repeat::Once => 0,
        Repeat::Loop => 1,
        Repeat::PingPong => 2,
    });
    w.f32(*weight);
    w.option(weight_keys, |w, keys| write_channel(w, keys));
    w.option(warp, |w, warp| match &**warp {
        Warp::Speed(curve) => write_channel(w, &curve.keys),
        Warp::ClipTime(keys) => write_channel(w, keys),
    });
    w.list(freezes, |w, (from, to)| {
        w.time(*from);
        w.time(*to);
    });
    // All that they hold is numbers and names, which Debug writes to the last bit.
    in_step.iter().for_each(|step| w.option(step, |w, step| w.text(&format!("{step:?}"))));
    w.time(*inertial);
    w.option(root, |w, root| {
        let motion = &root.motion;
        w.u32(motion.joint());
        w.text(&format!("{:?} {:?}", motion.parts, motion.treadmill));
        w.flag(root.carries);
    });
}

pub(super) fn write_layer_mode(w: &mut Writer, mode: &LayerMode) {
    let (tag, reference) = match mode {
        LayerMode::Override => return w.tag(0),
        LayerMode::Additive(reference) => (1, reference),
        LayerMode::Subtractive(reference) => (2, reference),
    };
    w.tag(tag);
    match reference {
        Reference::FirstFrame => w.tag(0),
        Reference::Rest => w.tag(1),
        Reference::At(time) => {
            w.tag(2);
            w.time(*time);
        }
    }
}

pub(super) fn write_ease(w: &mut Writer, ease: &Ease) {
    let (tag, shape) = match ease {
        Ease::Linear => return w.tag(0),
        Ease::Smooth => return w.tag(1),
        Ease::In(shape) => (2, shape),
        Ease::Out(shape) => (3, shape),
        Ease::InOut(shape) => (4, shape),
        Ease::Bezier(points) => {
            w.tag(5);
            return points.iter().for_each(|v| w.f64(*v));
        }
    };
    w.tag(tag);
    let number = Shape::ALL.iter().position(|(_, s)| s == shape);
    w.count(number.unwrap_or(Shape::ALL.len()));
}
