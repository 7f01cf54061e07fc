//! Finds cues that leave a gap, freeze, hide each other or are cut off.

use super::PlacedFinding;
use crate::build::{CueDraft, StageDraft};
use crate::check::rounded_secs;
use crate::cue_times::times_of_cues;
use crate::errors::format_count;
use choreo_motion::Time;
use choreo_stage::{LayerMode, Repeat, Subject};

/// A cue with its start and end.
struct TimedCue<'a> {
    draft: &'a CueDraft,
    start: Time,
    /// `None`: the cue repeats without end.
    end: Option<Time>,
    is_layer: bool,
}

impl TimedCue<'_> {
    fn name(&self) -> &str {
        &self.draft.cue.clip.name
    }

    /// Whether the script requests that the clip plays once, so that holding the last pose is intended.
    fn plays_once(&self) -> bool {
        self.draft.repeat == Some(Repeat::Once)
    }
}

/// Finds cues of all actors that leave a gap, freeze, hide each other or are cut off.
pub(super) fn check_cues(stage_draft: &StageDraft, found: &mut Vec<PlacedFinding>) {
    let times = times_of_cues(stage_draft);
    let timed: Vec<TimedCue> = stage_draft
        .cues
        .iter()
        .zip(&times)
        .map(|(draft, (start, end))| {
            let is_layer = stage_draft.chains[draft.chain].is_layer();
            TimedCue { draft, start: *start, end: *end, is_layer }
        })
        .collect();
    let mut next_in_chain: Vec<Option<usize>> = vec![None; timed.len()];
    for (id, cue) in timed.iter().enumerate() {
        if let Some(before) = cue.draft.predecessor {
            next_in_chain[before] = Some(id);
        }
    }
    // A hold that is shorter than a frame is not visible.
    let frame = stage_draft.settings.fps.time_of(1);
    let mut cues_by_actor: Vec<Vec<&TimedCue>> = vec![Vec::new(); stage_draft.actors.len()];
    for cue in &timed {
        cues_by_actor[stage_draft.chains[cue.draft.chain].actor].push(cue);
    }
    for (actor, cues) in cues_by_actor.iter().enumerate() {
        let mut base: Vec<&TimedCue> = cues.iter().filter(|t| !t.is_layer).copied().collect();
        base.sort_by_key(|t| t.start);
        let subject = Subject::Actor(actor);
        check_base_layer(stage_draft, subject, &stage_draft.actors[actor].actor.name, &base, frame, found);
        let upper: Vec<&TimedCue> = cues.iter().filter(|t| t.is_layer).copied().collect();
        check_layers(stage_draft, &upper, found);
    }
    for (id, cue) in timed.iter().enumerate() {
        let subject = Subject::Actor(stage_draft.chains[cue.draft.chain].actor);
        check_cue(cue, subject, next_in_chain[id].map(|next| &timed[next]), found);
    }
}

/// Finds cues of an actor's base layer that leave a gap, freeze or overlap. `frame`: duration of a frame.
fn check_base_layer(
    stage_draft: &StageDraft,
    subject: Subject,
    actor: &str,
    base: &[&TimedCue],
    frame: Time,
    found: &mut Vec<PlacedFinding>,
) {
    let length = stage_draft.settings.length;
    if let Some(first) = base.first()
        && first.start >= frame
        && first.start < length
    {
        let text = format!(
            "\"{actor}\" holds the first pose of \"{}\" until {} s",
            first.name(),
            rounded_secs(first.start)
        );
        found.push(PlacedFinding::note("starts_late", &first.draft.at, text).about(subject, Time::ZERO));
    }
    for pair in base.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        let Some(end) = a.end else { continue };
        if end + frame <= b.start && end < length && !a.plays_once() {
            let text = format!(
                "nothing plays on \"{actor}\" from {} s to {} s: the last pose of \"{}\" is held",
                rounded_secs(end),
                rounded_secs(b.start.min(length)),
                a.name()
            );
            let finding = PlacedFinding::warning("gap", &a.draft.at, text).about(subject, end);
            found.push(finding.hint("leave .until out to let it play on, or add .once() if it is intended"));
        }
        // A cue that begins over the end of another is a crossfade.
        let is_cut_short = a.start < b.start && b.start + b.draft.cue.fade_in + frame <= end;
        if is_cut_short && a.draft.chain != b.draft.chain && b.start < length {
            let text = format!(
                "clip \"{}\" is to play until {} s, but \"{}\" takes over at {} s",
                a.name(),
                rounded_secs(end),
                b.name(),
                rounded_secs(b.start)
            );
            let finding = PlacedFinding::warning("cues_overlap", &b.draft.at, text).about(subject, b.start);
            found.push(finding.hint("begin later with .from, or add .on(\"Spine..\") to play both at once"));
        }
    }
    let last_end = base.last().and_then(|last| Some((last, last.end?)));
    if let Some((last, end)) = last_end
        && end + frame < length
        && end > Time::ZERO
        && !last.plays_once()
    {
        let text = format!(
            "nothing follows \"{}\" after {} s: \"{actor}\" holds its last pose until the end of the stage, {} s",
            last.name(),
            rounded_secs(end),
            rounded_secs(length)
        );
        let finding = PlacedFinding::warning("frozen_at_end", &last.draft.at, text).about(subject, end);
        found.push(
            finding.hint("leave .until out to let it play on, add .then(…), or .once() if it is intended"),
        );
    }
}

/// Maximum number of earlier layers with which a layer is compared. Scripts written by hand have fewer.
const MAX_COMPARED_LAYERS: usize = 32;

/// Finds pairs of layers that move the same joints at the same time.
fn check_layers(stage_draft: &StageDraft, upper: &[&TimedCue], found: &mut Vec<PlacedFinding>) {
    for (i, b) in upper.iter().enumerate() {
        for a in &upper[i.saturating_sub(MAX_COMPARED_LAYERS)..i] {
            let chains = [a, b].map(|t| &stage_draft.chains[t.draft.chain]);
            // Additive layers share joints with the layers below by design, and so do layers of equal priority.
            let is_intended = chains.iter().any(|chain| chain.mode != LayerMode::Override)
                || chains[0].priority.is_some() && chains[0].priority == chains[1].priority;
            if a.draft.chain == b.draft.chain || is_intended {
                continue;
            }
            let joints = stage_draft.actors[chains[0].actor].actor.asset.skeleton.len();
            let masks = chains.map(|chain| chain.mask.as_deref());
            let moves = |mask: Option<&[f32]>, joint: usize| mask.is_none_or(|m| m[joint] > 0.0);
            let shared_joints = (0..joints).filter(|j| masks.iter().all(|mask| moves(*mask, *j))).count();
            let from = a.start.max(b.start);
            let to =
                a.end.unwrap_or(Time::MAX).min(b.end.unwrap_or(Time::MAX)).min(stage_draft.settings.length);
            if shared_joints > 0 && from < to {
                let text = format!(
                    "\"{}\" and \"{}\" both move {} from {} s to {} s: the {} layer wins",
                    a.name(),
                    b.name(),
                    format_count(shared_joints, "joint"),
                    rounded_secs(from),
                    rounded_secs(to),
                    if chains[0].priority == chains[1].priority { "later" } else { "higher" },
                );
                found.push(PlacedFinding::note("layers_overlap", &b.draft.at, text));
            }
        }
    }
}

/// Finds a cue that is never visible, never reaches full weight or is cut off. `next`: the next cue of its chain.
fn check_cue(cue: &TimedCue, subject: Subject, next: Option<&TimedCue>, found: &mut Vec<PlacedFinding>) {
    let TimedCue { draft, start, end, is_layer } = cue;
    let (name, place) = (cue.name(), &draft.at);
    let length = draft.length();
    if !draft.has_weight() {
        let text = format!("clip \"{name}\" is never seen: its weight is 0");
        found.push(PlacedFinding::warning("weight_zero", place, text).about(subject, *start));
    }
    let Some(end) = *end else { return };
    if end <= Time::ZERO && (*is_layer || next.is_some()) {
        let text = format!(
            "clip \"{name}\" is never seen: it is over at {} s, before the stage begins",
            rounded_secs(end)
        );
        found.push(PlacedFinding::warning("before_start", place, text).about(subject, *start));
        return;
    }
    let cue_length = end - *start;
    let fade_out = draft.fade_out.unwrap_or(draft.cue.fade_in);
    let fades_meet = draft.cue.fade_in <= cue_length && draft.cue.fade_in + fade_out > cue_length;
    if *is_layer && next.is_none() && fades_meet {
        let text = format!(
            "clip \"{name}\" fades in over {} s and out over {} s, but its cue lasts {} s: it never reaches full weight",
            rounded_secs(draft.cue.fade_in),
            rounded_secs(fade_out),
            rounded_secs(cue_length)
        );
        found.push(PlacedFinding::warning("fades_meet", place, text).about(subject, *start));
    }
    // The cue is still visible while the next cue fades in over it.
    let visible_length = cue_length + next.map_or(Time::ZERO, |n| n.draft.cue.fade_in);
    let is_cut_off = cue_length > Time::ZERO && visible_length < length;
    if draft.until.is_some() && is_cut_off && draft.trim.is_none() {
        let text = format!(
            "clip \"{name}\" takes {} s, its cue {} s: its end is cut off",
            rounded_secs(length),
            rounded_secs(cue_length)
        );
        found.push(PlacedFinding::note("cut_off", place, text));
    }
}
