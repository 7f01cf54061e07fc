//! Automatic foot locks during fades.

use crate::build::{ActorDraft, StageDraft};
use crate::legs;
use choreo_motion::Time;
use choreo_stage::{Actor, Constraint, ConstraintKind, FootLock, Property, StandingFade};

/// A crossfade of two cues with matched phases.
pub(super) struct PhaseMatchedCues {
    pub actor: usize,
    /// Start and end of the crossfade.
    pub span: (Time, Time),
    /// Whether root motion moves the actor.
    pub has_root_motion: bool,
}

/// Locks the feet of moving actors during phase-matched crossfades. The strides of the two clips differ in length, so the feet of
/// the blend would slide.
pub(super) fn lock_feet_in_phase_matched_fades(stage_draft: &mut StageDraft, matched: Vec<PhaseMatchedCues>) {
    for PhaseMatchedCues { actor, span, has_root_motion } in matched {
        let Some(ActorDraft { actor, .. }) = stage_draft.actors.get_mut(actor) else { continue };
        let is_moving = has_root_motion || is_moved_by_channel_or_path(actor);
        let locked_spans = foot_locks(actor).next().map(|lock| &mut lock.locked_spans);
        match locked_spans {
            // The script or an earlier fade has made a foot lock.
            Some(spans) => spans.extend((!spans.is_empty()).then_some(span)),
            None if is_moving => lock_feet(actor, vec![span], Vec::new()),
            None => {}
        }
    }
}

/// Locks the feet of moving characters during fades between walking and standing, so that they step instead of sliding.
pub(super) fn lock_feet_in_standing_fades(
    stage_draft: &mut StageDraft,
    standing_fades: Vec<Vec<StandingFade>>,
) {
    for (ActorDraft { actor, walks, .. }, mut fades) in stage_draft.actors.iter_mut().zip(standing_fades) {
        // A walk of `walk_to` begins with a turn and may end with a turn; the fades then include the turns.
        for walk in walks.iter() {
            for fade in &mut fades {
                match fade.ends_standing {
                    false if fade.to == walk.full_speed_from => fade.from = walk.from,
                    true if fade.to == walk.until => fade.to = walk.turned_until,
                    _ => {}
                }
            }
        }
        let walk_spans = walks.iter().map(|walk| (walk.from, walk.turned_until));
        let spans: Vec<(Time, Time)> = fades.iter().map(|f| (f.from, f.to)).chain(walk_spans).collect();
        if spans.is_empty() {
            continue;
        }
        for lock in foot_locks(actor) {
            if !lock.locked_spans.is_empty() {
                lock.locked_spans.extend(&spans);
            }
            lock.standing_fades.clone_from(&fades);
        }
        if foot_locks(actor).next().is_none() {
            lock_feet(actor, spans, fades);
        }
    }
}

fn foot_locks(actor: &mut Actor) -> impl Iterator<Item = &mut FootLock> {
    actor.constraints.iter_mut().filter_map(|constraint| match &mut constraint.kind {
        ConstraintKind::FootLock(lock) => Some(lock),
        _ => None,
    })
}

/// Adds a foot lock to an actor that has legs. `locked_spans`: the spans in which it is active; empty: always.
fn lock_feet(actor: &mut Actor, locked_spans: Vec<(Time, Time)>, standing_fades: Vec<StandingFade>) {
    let legs = legs::legs(&actor.asset);
    if !legs.is_empty() {
        let hips = legs::hips(&actor.asset, &legs);
        let lock = FootLock { legs, hips, ground: Vec::new(), locked_spans, standing_fades };
        actor.constraints.push(Constraint::new(ConstraintKind::FootLock(lock)));
    }
}

/// Whether keyframes or a path move an actor.
pub(super) fn is_moved_by_channel_or_path(actor: &Actor) -> bool {
    actor.path_following.is_some() || actor.channels.iter().any(|c| c.property == Property::Translation)
}
