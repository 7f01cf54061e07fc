//! Inertialization offsets: each inertialized cue takes over the offset from the pose before it. Offsets are computed once, in the order of
//! the cues, so that a cue that starts while an earlier offset still decays takes over what is left of it.

use crate::pose::{BlendedClip, inertialization, reset_morph_weights, sample_cue};
use crate::root_motion::track::RootMotionTrack;
use crate::stage::actor::Actor;
use crate::stage::clips::Layer;
use crate::timeline::active_clips as timeline;
use crate::timeline::active_clips::ActiveCue;
use choreo_motion::{BlendOnto, Inertialization, Pose, Time, WeightInertialization};

/// Time between the two poses whose difference gives a velocity.
const VELOCITY_INTERVAL: Time = Time(Time::TICKS_PER_SECOND / 240);

/// The inertialization offsets that one transition leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct CueInertialization {
    pub joints: Inertialization,
    /// Inertialization of morph weights, by mesh instance.
    pub morphs: Vec<WeightInertialization>,
    /// Inertialization of each expression.
    pub expressions: Vec<WeightInertialization>,
}

/// Inertialization of each cue of an actor's base layer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inertializations(Vec<Option<CueInertialization>>);

impl Inertializations {
    pub(crate) fn of(&self, cue: usize) -> Option<&CueInertialization> {
        self.0.get(cue).and_then(Option::as_ref)
    }

    /// Whether the actor has inertialized cues.
    pub(crate) fn has_any(&self) -> bool {
        !self.0.is_empty()
    }

    pub(crate) fn new(actor: &Actor, track: Option<&RootMotionTrack>) -> Inertializations {
        let Some(layer) = actor.layers.first() else { return Inertializations::default() };
        if layer.cues.iter().all(|cue| cue.inertialization <= Time::ZERO) {
            return Inertializations::default();
        }
        let mut found = Inertializations::default();
        let mut poses: [BasePose; 4] = Default::default();
        for (index, cue) in layer.cues.iter().enumerate() {
            let fits = cue.clip.joint_count() == actor.asset.skeleton.len();
            if index == 0 || cue.inertialization <= Time::ZERO || !fits {
                found.0.push(None);
                continue;
            }
            let before = Layer { cues: layer.cues[..index].to_vec(), ..Layer::default() };
            let [old, source, target, after] = &mut poses;
            old.pose_base_layer(actor, &before, cue.start - VELOCITY_INTERVAL, track, &found);
            source.pose_base_layer(actor, &before, cue.start, track, &found);
            for (body, time) in [(&mut *target, cue.start), (&mut *after, cue.start + VELOCITY_INTERVAL)] {
                let active = ActiveCue { cue: index, clip_time: cue.clip_time(time, false), weight: 1.0 };
                body.pose_cues(actor, layer, &[active], time, track, None);
            }
            found.0.push(Some(inertialization_between([old, source], [target, after], cue.inertialization)));
        }
        found
    }
}

fn inertialization_between(from: [&BasePose; 2], to: [&BasePose; 2], duration: Time) -> CueInertialization {
    let weights = |from: [&[f32]; 2], to: [&[f32]; 2]| {
        WeightInertialization::new(from, to, VELOCITY_INTERVAL, duration)
    };
    let morphs = |i: usize| weights(from.map(|b| &b.morphs[i][..]), to.map(|b| &b.morphs[i][..]));
    let face = |i: usize| weights(from.map(|b| &b.expressions[i..=i]), to.map(|b| &b.expressions[i..=i]));
    CueInertialization {
        joints: Inertialization::new(from.map(|b| &b.pose), to.map(|b| &b.pose), VELOCITY_INTERVAL, duration),
        morphs: (0..from[0].morphs.len()).map(morphs).collect(),
        expressions: (0..from[0].expressions.len()).map(face).collect(),
    }
}

/// Pose and weights of an actor by its base layer alone.
#[derive(Default)]
struct BasePose {
    pose: Pose,
    /// Morph weights by mesh instance.
    morphs: Vec<Vec<f32>>,
    expressions: Vec<f32>,
}

impl BasePose {
    fn pose_base_layer(
        &mut self,
        actor: &Actor,
        layer: &Layer,
        time: Time,
        track: Option<&RootMotionTrack>,
        found: &Inertializations,
    ) {
        let mut active_cues = Vec::new();
        timeline::base_cues(layer, time, &mut active_cues);
        active_cues.retain(|active| layer.cues[active.cue].clip.joint_count() == actor.asset.skeleton.len());
        self.pose_cues(actor, layer, &active_cues, time, track, Some(found));
    }

    fn pose_cues(
        &mut self,
        actor: &Actor,
        layer: &Layer,
        active_cues: &[ActiveCue],
        time: Time,
        track: Option<&RootMotionTrack>,
        found: Option<&Inertializations>,
    ) {
        let asset = &*actor.asset;
        let (mut over, mut weights) = (Pose::default(), Vec::new());
        self.pose.copy_from(asset.rest_pose());
        reset_morph_weights(asset, &mut self.morphs);
        self.expressions.clear();
        self.expressions.resize(asset.expressions.len(), 0.0);
        for (place, active) in active_cues.iter().enumerate() {
            over.copy_from(asset.rest_pose());
            sample_cue(actor, layer, active, time, track, found, &mut over);
            if active.weight >= 1.0 {
                self.pose.copy_from(&over);
            } else {
                BlendOnto { pose: &mut self.pose, to: &over, weight: active.weight, mask: None }.run();
            }
            let blended = BlendedClip {
                clip: &layer.cues[active.cue].clip,
                time: active.clip_time,
                weight: active.weight,
                first: place == 0,
                inertialization: inertialization(layer, active, time, found),
            };
            blended.blend_weights(asset, layer, true, &mut weights, &mut self.morphs);
            blended.blend_expressions(asset, layer, true, &mut self.expressions);
        }
    }
}
