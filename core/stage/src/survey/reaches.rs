//! Findings about hands that never reach their targets.

use crate::constraints::solve::{current_target_and_pole, joint_world_position};
use crate::snapshot::Snapshot;
use crate::stage::Stage;
use crate::stage::actor::Actor;
use crate::stage::constraint::{Constraint, ConstraintKind, ReachConstraint};
use crate::survey::{Finding, Subject};
use choreo_motion::Time;
use glam::DAffine3;

/// Distance from its target at which a hand has reached it: a share of the limb's length, because a soft reach stops short, plus metres.
const NEAR_SHARE: f64 = 0.05;
const NEAR_METRES: f64 = 0.01;

/// The nearest that a joint has come to the target of one constraint.
#[derive(Clone, Copy, Debug)]
struct NearestDistance {
    metres: f64,
    time: Time,
    reached: bool,
}

/// Nearest approach of all constraints, by actor; `None` for a constraint that was never fully active, or is no reach.
#[derive(Debug)]
pub(super) struct ReachDistances(Vec<Vec<Option<NearestDistance>>>);

impl ReachDistances {
    pub(super) fn new(stage: &Stage) -> ReachDistances {
        ReachDistances(stage.actors.iter().map(|actor| vec![None; actor.constraints.len()]).collect())
    }

    pub(super) fn record(&mut self, stage: &Stage, snapshot: &Snapshot, time: Time) {
        for (index, actor) in stage.actors.iter().enumerate() {
            for (constraint, nearest) in actor.constraints.iter().zip(&mut self.0[index]) {
                let Some(now) = target_distance(stage, snapshot, (actor, index), constraint, time) else {
                    continue;
                };
                if nearest.is_none_or(|before| now.metres < before.metres) {
                    *nearest = Some(now);
                }
            }
        }
    }

    /// Whether another time could still remove a finding.
    pub(super) fn may_change(&self, stage: &Stage) -> bool {
        let all = stage.actors.iter().zip(&self.0).flat_map(|(a, found)| a.constraints.iter().zip(found));
        all.filter(|(c, _)| matches!(c.kind, ConstraintKind::Reach(_)) && c.weight > FULL_WEIGHT)
            .any(|(_, nearest)| nearest.is_none_or(|n| !n.reached))
    }

    /// The findings of one actor. `times_note`: text that states how many times were evaluated, if not all.
    pub(super) fn findings(&self, stage: &Stage, index: usize, times_note: &str) -> Vec<Finding> {
        let actor = &stage.actors[index];
        let missed = |(number, nearest): (usize, &Option<NearestDistance>)| {
            let nearest = nearest.filter(|nearest| !nearest.reached)?;
            let ConstraintKind::Reach(reach) = &actor.constraints[number].kind else { return None };
            let end = *reach.joints.last()? as usize;
            let joint = actor.asset.skeleton.names().get(end).map_or("", String::as_str);
            let text = format!(
                "\"{joint}\" of \"{}\" never reaches its target: it is {:.2} m short at {:.2} s, where it comes nearest{times_note}",
                actor.name,
                nearest.metres,
                nearest.time.as_secs()
            );
            let hint = "move the target or the actor nearer, or let more joints bend: #{ root: \"Spine\" }";
            let subject = Subject::Constraint { actor: index, constraint: number };
            Some(Finding { rule: "reach_too_far", note: false, subject, text, hint: Some(hint.into()) })
        };
        self.0[index].iter().enumerate().filter_map(missed).collect()
    }
}

/// A constraint with a weight above this counts as fully active.
const FULL_WEIGHT: f32 = 0.999;

/// Distance from the end of a reach to its target; `None` if the constraint is not fully active, or one of the positions is unknown.
fn target_distance(
    stage: &Stage,
    snapshot: &Snapshot,
    (actor, index): (&Actor, usize),
    constraint: &Constraint,
    time: Time,
) -> Option<NearestDistance> {
    let ConstraintKind::Reach(reach) = &constraint.kind else { return None };
    let state = &snapshot.actors[index];
    if constraint.weight_at(time) < f64::from(FULL_WEIGHT)
        || state.model_from_joint.len() != actor.asset.skeleton.len()
    {
        return None;
    }
    let (target, _) = current_target_and_pole(stage, &snapshot.actors, constraint)?;
    let joints = &state.model_from_joint;
    let end = joint_world_position(&state.world_from_model, joints.get(*reach.joints.last()? as usize)?);
    let metres = (end - target).length();
    let near = NEAR_SHARE * limb_length(reach, joints, &state.world_from_model) + NEAR_METRES;
    metres.is_finite().then_some(NearestDistance { metres, time, reached: metres <= near })
}

/// Length of a limb along its joints, metres.
fn limb_length(reach: &ReachConstraint, joints: &[glam::Affine3A], world_from_model: &DAffine3) -> f64 {
    let place =
        |joint: &u32| joints.get(*joint as usize).map(|joint| joint_world_position(world_from_model, joint));
    let bone = |pair: &[u32]| Some((place(&pair[1])? - place(&pair[0])?).length());
    reach.joints.windows(2).filter_map(bone).sum()
}
