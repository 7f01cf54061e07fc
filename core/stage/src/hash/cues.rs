//! Layers and their cues.

use super::ContentHash;
use super::writer::Writer;
use crate::*;
use choreo_motion::{Clip, Shape};
use std::sync::Arc;

impl Writer {
    pub(super) fn layer(
        &mut self,
        layer: &Layer,
        mut mask: impl FnMut(&mut Writer, &Arc<Vec<f32>>),
        mut clip: impl FnMut(&Arc<Clip>) -> ContentHash,
    ) {
        let Layer { mask: joints, mode, rank, weight_keys, cues } = layer;
        self.option(joints, |w, joints| mask(w, joints));
        self.layer_mode(mode);
        self.u32(*rank);
        self.option(weight_keys, |w, keys| w.channel(keys));
        self.list(cues, |w, cue| {
            w.bytes(&clip(&cue.clip));
            w.cue(cue);
        });
    }

    fn cue(&mut self, cue: &Cue) {
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
        self.time(*start);
        self.option(end, |w, end| w.time(*end));
        for t in [fade_in, fade_out, &trim.0, &trim.1] {
            self.time(*t);
        }
        self.ease(ease);
        self.f64(*speed);
        self.tag(match repeat {
            Repeat::Once => 0,
            Repeat::Loop => 1,
            Repeat::PingPong => 2,
        });
        self.f32(*weight);
        self.option(weight_keys, |w, keys| w.channel(keys));
        self.option(warp, |w, warp| match &**warp {
            Warp::Speed(curve) => w.channel(&curve.keys),
            Warp::ClipTime(keys) => w.channel(keys),
        });
        self.list(freezes, |w, (from, to)| {
            w.time(*from);
            w.time(*to);
        });
        // All that they hold is numbers and names, which Debug writes to the last bit.
        in_step.iter().for_each(|step| self.option(step, |w, step| w.text(&format!("{step:?}"))));
        self.time(*inertial);
        self.option(root, |w, root| {
            let motion = &root.motion;
            w.u32(motion.joint());
            w.text(&format!("{:?} {:?}", motion.parts, motion.treadmill));
            w.flag(root.carries);
        });
    }

    fn layer_mode(&mut self, mode: &LayerMode) {
        let (tag, reference) = match mode {
            LayerMode::Override => return self.tag(0),
            LayerMode::Additive(reference) => (1, reference),
            LayerMode::Subtractive(reference) => (2, reference),
        };
        self.tag(tag);
        match reference {
            Reference::FirstFrame => self.tag(0),
            Reference::Rest => self.tag(1),
            Reference::At(time) => {
                self.tag(2);
                self.time(*time);
            }
        }
    }

    fn ease(&mut self, ease: &Ease) {
        let (tag, shape) = match ease {
            Ease::Linear => return self.tag(0),
            Ease::Smooth => return self.tag(1),
            Ease::In(shape) => (2, shape),
            Ease::Out(shape) => (3, shape),
            Ease::InOut(shape) => (4, shape),
            Ease::Bezier(points) => {
                self.tag(5);
                return points.iter().for_each(|v| self.f64(*v));
            }
        };
        self.tag(tag);
        let number = Shape::ALL.iter().position(|(_, s)| s == shape);
        self.count(number.unwrap_or(Shape::ALL.len()));
    }
}
