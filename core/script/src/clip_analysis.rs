//! What is found out about clips when the stage is settled: root motion and steps, once for all actors that play them.

use crate::api_error::ApiError;
use crate::build::{Build, CueDraft, RootDraft, RootUse};
use choreo_asset::Asset;
use choreo_motion::contacts::{Contacts, find_feet};
use choreo_motion::{Clip, Footsteps, PhaseMatchedFade, RootMotion, RootParts, Time};
use choreo_stage::{Cue, CueRootMotion, Pace, Repeat};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The part of a clip on a skeleton, by address: the build keeps them alive.
type ClipRange = (usize, usize, Time, Time);

/// What was asked of a part, and what it has.
type Asked = (RootDraft, Option<Arc<CueRootMotion>>);

#[derive(Default)]
pub struct AnalyzedClips {
    roots: BTreeMap<ClipRange, Vec<Asked>>,
    steps: BTreeMap<ClipRange, Option<Arc<Footsteps>>>,
}

fn part(asset: &Asset, clip: &Arc<Clip>, trim: (Time, Time)) -> ClipRange {
    (Arc::as_ptr(&asset.skeleton) as usize, Arc::as_ptr(clip) as usize, trim.0, trim.1)
}

/// The root motion of a cue on the base layer, as it or its actor asks for it.
pub fn root(build: &Build, draft: &CueDraft, found: &mut AnalyzedClips) -> Option<Arc<CueRootMotion>> {
    let actor = &build.actors[build.chains[draft.chain].actor];
    // An actor on a path that moves as fast as the clips walk has root motion without asking.
    let paced = actor
        .actor
        .path_following
        .as_ref()
        .is_some_and(|path_following| path_following.pace == Pace::OfClips);
    let own = RootDraft { joint: None, parts: RootParts::default(), used: RootUse::Carries };
    let asked = draft.root.or(actor.root).or(paced.then_some(own))?;
    let asset = &actor.actor.asset;
    let trim = draft.part();
    let all = found.roots.entry(part(asset, &draft.cue.clip, trim)).or_default();
    if let Some((_, root)) = all.iter().find(|(known, _)| *known == asked) {
        return root.clone();
    }
    let motion = RootMotion::new(&asset.skeleton, &draft.cue.clip, asked.joint, asked.parts, trim);
    let carries = asked.used == RootUse::Carries;
    let root = motion.map(|motion| Arc::new(CueRootMotion { motion, carries }));
    all.push((asked, root.clone()));
    root
}

fn steps(build: &Build, draft: &CueDraft, found: &mut AnalyzedClips) -> Option<Arc<Footsteps>> {
    let trim = draft.part();
    if let Some(times) = build.notes_of(&draft.cue.clip).and_then(|notes| notes.steps.as_ref()) {
        return Footsteps::given(times, trim).map(Arc::new);
    }
    let asset = &build.actors[build.chains[draft.chain].actor].actor.asset;
    let entry = found.steps.entry(part(asset, &draft.cue.clip, trim));
    let find = || {
        let feet = find_feet(&asset.skeleton);
        let contacts = Contacts::find(&asset.skeleton, &draft.cue.clip, trim, &feet)?;
        Footsteps::of(&contacts, trim).map(Arc::new)
    };
    entry.or_insert_with(find).clone()
}

/// The fade in which two clips keep step, or why they cannot.
pub fn in_step(
    build: &Build,
    drafts: [usize; 2],
    cues: [&Cue; 2],
    found: &mut AnalyzedClips,
) -> Result<PhaseMatchedFade, ApiError> {
    let drafts = drafts.map(|id| &build.cues[id]);
    for (draft, cue) in drafts.iter().zip(cues) {
        if cue.repeat != Repeat::Loop || !draft.is_even() || cue.speed <= 0.0 {
            let text = format!("\"{}\" must loop, forwards and at one speed", draft.cue.clip.name);
            return Err(ApiError::new(text));
        }
    }
    if cues[1].fade_in <= Time::ZERO {
        return Err(ApiError::new("there is no fade to keep step in"));
    }
    let mut of = |draft: &CueDraft| {
        let hint = "clip.steps([…]) says when its feet come down";
        let name = &draft.cue.clip.name;
        let missing = || ApiError::new(format!("no steps are found in \"{name}\"; {hint}"));
        steps(build, draft, found).ok_or_else(missing)
    };
    let steps = [of(drafts[0])?, of(drafts[1])?];
    let played = cues[0].played(cues[1].start);
    let speeds = cues.map(|cue| cue.speed);
    PhaseMatchedFade::new(
        [&steps[0], &steps[1]],
        speeds,
        played,
        cues[1].start,
        cues[1].fade_in,
        cues[1].ease,
    )
    .ok_or_else(|| ApiError::new(format!("\"{}\" takes other steps", drafts[0].cue.clip.name)))
}
