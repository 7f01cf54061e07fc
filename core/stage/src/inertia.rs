//! What inertialized cues take over from those before them: found once, in the order of the cues, so that one that follows
//! another at once takes over what is still dying down.

use crate::pose::sample_voice;
use crate::timeline::{self, Voice};
use crate::travel::Travel;
use crate::{Actor, Layer};
use choreo_motion::{BlendOnto, Inertia, Pose, Time};

/// How far apart the poses are whose difference is a velocity.
const STEP: Time = Time(Time::TICKS_PER_SECOND / 240);

/// By cue of an actor's base layer.
#[derive(Clone, Debug, Default)]
pub(crate) struct Inertias(Vec<Option<Inertia>>);

impl Inertias {
    pub fn of(&self, cue: usize) -> Option<&Inertia> {
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
        let mut poses: [Pose; 4] = Default::default();
        for (index, cue) in layer.cues.iter().enumerate() {
            let fits = cue.clip.joint_count() == actor.asset.skeleton.len();
            if index == 0 || cue.inertial <= Time::ZERO || !fits {
                found.0.push(None);
                continue;
            }
            let before = Layer { cues: layer.cues[..index].to_vec(), ..Layer::default() };
            let [old, source, target, after] = &mut poses;
            base_pose(actor, &before, cue.start - STEP, travel, &found, old);
            base_pose(actor, &before, cue.start, travel, &found, source);
            for (pose, time) in [(&mut *target, cue.start), (&mut *after, cue.start + STEP)] {
                let voice = Voice { cue: index, clip_time: cue.clip_time(time, false), weight: 1.0 };
                pose.copy_from(actor.asset.rest_pose());
                sample_voice(actor, layer, &voice, time, travel, None, pose);
            }
            found.0.push(Some(Inertia::new([old, source], [target, after], STEP, cue.inertial)));
        }
        found
    }
}

/// The pose of a base layer alone.
fn base_pose(
    actor: &Actor,
    layer: &Layer,
    time: Time,
    travel: Option<&Travel>,
    found: &Inertias,
    pose: &mut Pose,
) {
    let (mut voices, mut over) = (Vec::new(), Pose::default());
    timeline::base_voices(layer, time, &mut voices);
    voices.retain(|voice| layer.cues[voice.cue].clip.joint_count() == actor.asset.skeleton.len());
    pose.copy_from(actor.asset.rest_pose());
    for voice in &voices {
        over.copy_from(actor.asset.rest_pose());
        sample_voice(actor, layer, voice, time, travel, Some(found), &mut over);
        BlendOnto { pose, to: &over, weight: voice.weight, mask: None }.run();
    }
}
