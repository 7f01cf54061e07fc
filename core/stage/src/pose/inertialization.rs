//! What inertialized cues take over from those before them: found once, in the order of the cues, so that one that follows
//! another at once takes over what is still dying down.

use crate::pose::{BlendedVoice, dying, sample_voice, start_weights};
use crate::root_motion::travel::Travel;
use crate::stage::actor::Actor;
use crate::stage::clips::Layer;
use crate::timeline::active_clips as timeline;
use crate::timeline::active_clips::Voice;
use choreo_motion::{BlendOnto, Inertialization, Pose, Time, WeightInertialization};

/// How far apart the poses are whose difference is a velocity.
const STEP: Time = Time(Time::TICKS_PER_SECOND / 240);

/// What one switch leaves to die down.
#[derive(Clone, Debug, Default)]
pub(crate) struct Switch {
    pub joints: Inertialization,
    /// Inertialization of morph weights, by mesh instance.
    pub morphs: Vec<WeightInertialization>,
    /// Inertialization of each expression.
    pub expressions: Vec<WeightInertialization>,
}

/// Inertialization of each cue of an actor's base layer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inertias(Vec<Option<Switch>>);

impl Inertias {
    pub fn of(&self, cue: usize) -> Option<&Switch> {
        self.0.get(cue).and_then(Option::as_ref)
    }

    /// Whether the actor has any.
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }

    pub fn new(actor: &Actor, travel: Option<&Travel>) -> Inertias {
        let Some(layer) = actor.layers.first() else { return Inertias::default() };
        if layer.cues.iter().all(|cue| cue.inertial <= Time::ZERO) {
            return Inertias::default();
        }
        let mut found = Inertias::default();
        let mut bodies: [Body; 4] = Default::default();
        for (index, cue) in layer.cues.iter().enumerate() {
            let fits = cue.clip.joint_count() == actor.asset.skeleton.len();
            if index == 0 || cue.inertial <= Time::ZERO || !fits {
                found.0.push(None);
                continue;
            }
            let before = Layer { cues: layer.cues[..index].to_vec(), ..Layer::default() };
            let [old, source, target, after] = &mut bodies;
            old.base(actor, &before, cue.start - STEP, travel, &found);
            source.base(actor, &before, cue.start, travel, &found);
            for (body, time) in [(&mut *target, cue.start), (&mut *after, cue.start + STEP)] {
                let voice = Voice { cue: index, clip_time: cue.clip_time(time, false), weight: 1.0 };
                body.play(actor, layer, &[voice], time, travel, None);
            }
            found.0.push(Some(switch([old, source], [target, after], cue.inertial)));
        }
        found
    }
}

fn switch(from: [&Body; 2], to: [&Body; 2], duration: Time) -> Switch {
    let weights = |from: [&[f32]; 2], to: [&[f32]; 2]| WeightInertialization::new(from, to, STEP, duration);
    let morphs = |i: usize| weights(from.map(|b| &b.morphs[i][..]), to.map(|b| &b.morphs[i][..]));
    let face = |i: usize| weights(from.map(|b| &b.expressions[i..=i]), to.map(|b| &b.expressions[i..=i]));
    Switch {
        joints: Inertialization::new(from.map(|b| &b.pose), to.map(|b| &b.pose), STEP, duration),
        morphs: (0..from[0].morphs.len()).map(morphs).collect(),
        expressions: (0..from[0].expressions.len()).map(face).collect(),
    }
}

/// What a base layer alone makes of a body.
#[derive(Default)]
struct Body {
    pose: Pose,
    /// Morph weights by mesh instance.
    morphs: Vec<Vec<f32>>,
    expressions: Vec<f32>,
}

impl Body {
    fn base(&mut self, actor: &Actor, layer: &Layer, time: Time, travel: Option<&Travel>, found: &Inertias) {
        let mut voices = Vec::new();
        timeline::base_voices(layer, time, &mut voices);
        voices.retain(|voice| layer.cues[voice.cue].clip.joint_count() == actor.asset.skeleton.len());
        self.play(actor, layer, &voices, time, travel, Some(found));
    }

    fn play(
        &mut self,
        actor: &Actor,
        layer: &Layer,
        voices: &[Voice],
        time: Time,
        travel: Option<&Travel>,
        found: Option<&Inertias>,
    ) {
        let asset = &*actor.asset;
        let (mut over, mut weights) = (Pose::default(), Vec::new());
        self.pose.copy_from(asset.rest_pose());
        start_weights(asset, &mut self.morphs);
        self.expressions.clear();
        self.expressions.resize(asset.expressions.len(), 0.0);
        for (place, voice) in voices.iter().enumerate() {
            over.copy_from(asset.rest_pose());
            sample_voice(actor, layer, voice, time, travel, found, &mut over);
            if voice.weight >= 1.0 {
                self.pose.copy_from(&over);
            } else {
                BlendOnto { pose: &mut self.pose, to: &over, weight: voice.weight, mask: None }.run();
            }
            let blended = BlendedVoice {
                clip: &layer.cues[voice.cue].clip,
                time: voice.clip_time,
                weight: voice.weight,
                first: place == 0,
                dying: dying(layer, voice, time, found),
            };
            blended.blend_weights(asset, layer, true, &mut weights, &mut self.morphs);
            blended.blend_expressions(asset, layer, true, &mut self.expressions);
        }
    }
}
