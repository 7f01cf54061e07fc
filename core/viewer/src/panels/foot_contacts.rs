//! Foot contacts of actors, from their clips, for the strip at the bottom of a row.

use choreo_motion::contacts::{Contacts, find_feet};
use choreo_motion::{Clip, Time};
use choreo_stage::{Actor, Stage};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of sampled frames; longer scenes are sampled less densely.
const MAX_SAMPLES: i64 = 2000;
/// Largest number of actors whose foot contacts are computed.
const MAX_ACTORS: usize = 64;

/// Foot contacts of one actor.
pub(super) type ActorContacts = Vec<FootSpans>;

/// Contacts of a foot with the floor: start and end of each, stage seconds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FootSpans {
    /// Short name of the foot joint.
    pub name: String,
    pub spans: Vec<(f64, f64)>,
}

/// Foot contacts of one version of the scene, computed for each actor on request.
#[derive(Clone, Default)]
pub(super) struct FootContacts {
    number: u64,
    by_actor: BTreeMap<usize, Arc<ActorContacts>>,
}

impl FootContacts {
    pub(super) fn get(&mut self, number: u64, stage: &Stage, actor: usize) -> Option<Arc<ActorContacts>> {
        if self.number != number {
            *self = FootContacts { number, by_actor: BTreeMap::new() };
        }
        if !self.by_actor.contains_key(&actor) && self.by_actor.len() >= MAX_ACTORS {
            return None;
        }
        let found = self.by_actor.entry(actor).or_insert_with(|| {
            Arc::new(
                stage.actors.get(actor).map_or_else(ActorContacts::new, |a| find_actor_contacts(stage, a)),
            )
        });
        (!found.is_empty()).then(|| found.clone())
    }
}

fn find_actor_contacts(stage: &Stage, actor: &Actor) -> ActorContacts {
    let skeleton = &actor.asset.skeleton;
    let feet = find_feet(skeleton);
    let Some(base) = actor.layers.first().filter(|_| !feet.is_empty()) else { return ActorContacts::new() };
    let contacts: Vec<Option<Contacts>> = base
        .cues
        .iter()
        .map(|cue| {
            let clip: &Clip = &cue.clip;
            Contacts::find(skeleton, clip, cue.trim, &feet)
        })
        .collect();
    if contacts.iter().all(Option::is_none) {
        return ActorContacts::new();
    }
    let settings = &stage.settings;
    let frames = settings.fps.frames_in(settings.length).max(1);
    let stride = frames / MAX_SAMPLES + 1;
    let name = |foot: &choreo_motion::contacts::Foot| {
        foot.joints.first().map_or("", |joint| skeleton.short_name(*joint as usize)).to_string()
    };
    let mut foot_spans: ActorContacts =
        feet.iter().map(|foot| FootSpans { name: name(foot), spans: Vec::new() }).collect();
    let mut frame = 0;
    while frame < frames {
        let (from, to) = (settings.fps.time_of(frame), settings.fps.time_of((frame + stride).min(frames)));
        frame += stride;
        // The clip with the largest weight decides.
        let active = actor.active_clips(from);
        let Some(strongest) =
            active.iter().filter(|clip| clip.layer == 0).max_by(|a, b| a.weight.total_cmp(&b.weight))
        else {
            continue;
        };
        let (Some(contacts), Some(cue)) =
            (contacts.get(strongest.cue).and_then(Option::as_ref), base.cues.get(strongest.cue))
        else {
            continue;
        };
        let round = cue.trim.1 - cue.trim.0;
        for (FootSpans { spans, .. }, intervals) in foot_spans.iter_mut().zip(&contacts.intervals) {
            let on = |t: Time| intervals.iter().any(|s| s.from <= t && t < s.to);
            if !on(strongest.clip_time) && !on(strongest.clip_time + round) {
                continue;
            }
            let (from, to) = (from.as_secs(), to.as_secs());
            match spans.last_mut() {
                Some(last) if (last.1 - from).abs() < 1e-9 => last.1 = to,
                _ => spans.push((from, to)),
            }
        }
    }
    foot_spans
}
