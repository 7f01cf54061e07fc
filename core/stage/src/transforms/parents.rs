//! Active parents of actors at a time, with their weights and spaces.

use crate::snapshot::ActorState;
use crate::stage::Stage;
use crate::stage::actor::{Attachment, Placement};
use crate::stage::edits::ActorEdit;
use crate::stage::fade::{apply_ease, elapsed_fraction};
use crate::stage::parenting::{ParentScale, Parenting};
use crate::transforms::world_from_attachment;
use choreo_motion::{Ease, Time};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// An active parent.
#[derive(Clone, Debug)]
pub(crate) struct ActiveParent {
    pub to: Option<Attachment>,
    pub scale: ParentScale,
    /// Keeps the world transform at the moment of change (Blender's inverse matrix).
    pub offset: DAffine3,
    /// Position and rotation in place of the actor's own.
    placement: Option<Placement>,
    /// Blend weight over the parents before it, 0..=1; 1 for the first parent.
    pub weight: f64,
    /// World transform of the space that the parent gives; written when actors are placed.
    pub world_from_parent: DAffine3,
}

impl ActiveParent {
    fn new(parent: &Parenting, offset: DAffine3, weight: f64) -> ActiveParent {
        let Parenting { to, scale, placement, .. } = parent.clone();
        ActiveParent { to, scale, offset, placement, weight, world_from_parent: DAffine3::IDENTITY }
    }

    /// Placement of the actor in this parent's space. `own`: the actor's placement with keys, edits and root motion. Edits also apply to a
    /// placement that the parent sets.
    pub(crate) fn local_placement<'e>(
        &self,
        own: &Placement,
        edits: impl Iterator<Item = &'e ActorEdit>,
    ) -> Placement {
        let Some(placed) = self.placement else { return *own };
        let mut local = placed;
        edits.for_each(|edit| edit.apply_to_placement(&mut local));
        Placement { scale: own.scale, ..local }
    }

    pub(crate) fn find_space(&mut self, stage: &Stage, actors: &[ActorState]) {
        let frame =
            self.to.map_or(DAffine3::IDENTITY, |to| world_from_parent(stage, actors, &to, self.scale));
        self.world_from_parent = frame * self.offset;
    }
}

/// The active parents of all actors; buffers.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActiveParents {
    all: Vec<ActiveParent>,
    ends: Vec<usize>,
}

impl ActiveParents {
    /// Finds the active parents of all actors. `edits`: those of the frame; the last one that attaches an actor replaces all its parents.
    pub(crate) fn find_active(
        &mut self,
        stage: &Stage,
        time: Time,
        edits: &[(usize, ActorEdit)],
        kept: &KeptTransforms,
    ) {
        self.all.clear();
        self.ends.clear();
        let kept = kept.lock();
        for actor in &stage.actors {
            let index = self.ends.len();
            let started_parents = actor.parents.iter().take_while(|p| p.has_begun(time)).count();
            let mut first = started_parents;
            // Goes back to the last parent with full weight. Before the first parent there is the world.
            while first > 0 && (first == started_parents || blend_weight(&actor.parents[first], time) < 1.0) {
                first -= 1;
            }
            if started_parents > 0 && blend_weight(&actor.parents[first], time) < 1.0 {
                self.all.push(ActiveParent::new(&Parenting::from(None, Time::MIN), DAffine3::IDENTITY, 1.0));
            }
            for (number, parent) in actor.parents[first..started_parents].iter().enumerate() {
                let known = kept.get(&(index, first + number)).filter(|_| parent.keep);
                let offset = known.copied().unwrap_or(DAffine3::IDENTITY);
                self.all.push(ActiveParent::new(parent, offset, blend_weight(parent, time)));
            }
            self.ends.push(self.all.len());
        }
        for (actor, edit) in edits {
            if let ActorEdit::Attach(parent) = edit
                && *actor < self.ends.len()
            {
                let range = self.range_of_actor(*actor);
                let removed = range.len();
                self.all.splice(range, [ActiveParent::new(parent, DAffine3::IDENTITY, 1.0)]);
                self.ends[*actor..].iter_mut().for_each(|end| *end = *end + 1 - removed);
            }
        }
    }

    /// Range of an actor's parents in `all`; empty for an actor that does not exist.
    fn range_of_actor(&self, actor: usize) -> std::ops::Range<usize> {
        let Some(end) = self.ends.get(actor) else { return 0..0 };
        actor.checked_sub(1).map_or(0, |before| self.ends[before])..*end
    }

    /// The active parents of an actor, the newest last; empty if it is in world space.
    pub(crate) fn of(&self, actor: usize) -> &[ActiveParent] {
        &self.all[self.range_of_actor(actor)]
    }

    pub(crate) fn of_mut(&mut self, actor: usize) -> &mut [ActiveParent] {
        let range = self.range_of_actor(actor);
        &mut self.all[range]
    }

    /// The actors and joints that an actor is attached to, several during a blend; links to actors that do not exist are left out.
    pub(crate) fn carriers(&self, actor: usize) -> impl Iterator<Item = Attachment> {
        let count = self.ends.len();
        self.of(actor).iter().filter_map(|parent| parent.to).filter(move |to| to.actor < count)
    }

    /// Whether anything is attached to a joint of an actor.
    pub(crate) fn has_children_on_joints(&self, actor: usize) -> bool {
        self.all.iter().any(|p| p.to.is_some_and(|to| to.actor == actor && to.joint.is_some()))
    }
}

/// Blend weight of a parent over those before it, 0..=1.
fn blend_weight(parent: &Parenting, time: Time) -> f64 {
    f64::from(apply_ease(Ease::Smooth, elapsed_fraction(time - parent.start, parent.blend)))
}

/// Transforms that keep actors in place when their parents change, by actor and index of the parent; shared by clones.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeptTransforms(Arc<Mutex<BTreeMap<(usize, usize), DAffine3>>>);

impl KeptTransforms {
    fn lock(&self) -> std::sync::MutexGuard<'_, BTreeMap<(usize, usize), DAffine3>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn insert(&self, actor: usize, parent: usize, transform: DAffine3) {
        self.lock().insert((actor, parent), transform);
    }

    /// Transforms that a time needs and that are not known yet, as (start, actor, index of the parent), sorted.
    pub(crate) fn missing_transforms(&self, stage: &Stage, time: Time) -> Vec<(Time, usize, usize)> {
        let mut needed = Vec::new();
        for (index, actor) in stage.actors.iter().enumerate() {
            let parents = actor.parents.iter().enumerate().take_while(|(_, p)| p.has_begun(time));
            needed.extend(parents.filter(|(_, p)| p.keep).map(|(number, p)| (p.start, index, number)));
        }
        if !needed.is_empty() {
            let known = self.lock();
            needed.retain(|(_, actor, parent)| !known.contains_key(&(*actor, *parent)));
        }
        needed.sort_unstable();
        needed
    }
}

/// Times at which an actor changes its parent, and one tick after each, sorted; the first is [`Time::MIN`].
pub(crate) fn parent_change_times(stage: &Stage) -> Vec<Time> {
    let starts = stage.actors.iter().flat_map(|actor| &actor.parents).map(|parent| parent.start);
    let mut times: Vec<Time> = starts.flat_map(|start| [start, start + Time(1)]).collect();
    times.push(Time::MIN);
    times.sort_unstable();
    times.dedup();
    times
}

/// World transform of a parent's space, without scale if children keep their size.
pub(crate) fn world_from_parent(
    stage: &Stage,
    actors: &[ActorState],
    to: &Attachment,
    scale: ParentScale,
) -> DAffine3 {
    let frame = world_from_attachment(stage, actors, to);
    match scale {
        ParentScale::Keep => DAffine3 { matrix3: nearest_rotation(frame.matrix3), ..frame },
        ParentScale::Inherit => frame,
    }
}

/// Interpolates two affine transforms after a polar decomposition of each: rotations by slerp, scale and shear linearly.
pub(crate) fn interpolate_affine(a: &DAffine3, b: &DAffine3, share: f64) -> DAffine3 {
    let parts = |m: DMat3| {
        let turned = nearest_rotation(m) * m.determinant().signum();
        (DQuat::from_mat3(&turned), turned.transpose() * m)
    };
    let ((turn_a, stretch_a), (turn_b, stretch_b)) = (parts(a.matrix3), parts(b.matrix3));
    let turn = choreo_motion::slerp(turn_a, turn_b, share);
    let stretch = stretch_a * (1.0 - share) + stretch_b * share;
    DAffine3 {
        matrix3: DMat3::from_quat(turn) * stretch,
        translation: a.translation.lerp(b.translation, share),
    }
}

/// Tolerance within which a matrix counts as a rotation and is used as it is: matrices of joints are f32 products.
const ROTATION_TOLERANCE: f64 = 1e-5;

/// Nearest rotation to a matrix, or nearest reflection if it mirrors: its polar factor (N. Higham, "Computing the polar decomposition",
/// 1986), by Newton's method. A singular matrix gives a rotation that follows its non-zero axes.
fn nearest_rotation(m: DMat3) -> DMat3 {
    let off = m.transpose() * m - DMat3::IDENTITY;
    let far = |v: DVec3| v.abs().max_element();
    if far(off.x_axis).max(far(off.y_axis)).max(far(off.z_axis)) < ROTATION_TOLERANCE {
        return m;
    }
    let size = libm::cbrt(m.determinant().abs());
    let mut turned = m * (1.0 / size);
    for _ in 0..32 {
        let next = (turned + turned.inverse().transpose()) * 0.5;
        let step = next - turned;
        turned = next;
        if far(step.x_axis).max(far(step.y_axis)).max(far(step.z_axis)) < 1e-15 {
            break;
        }
    }
    if turned.is_finite() {
        return turned;
    }
    let y = m.y_axis.try_normalize().unwrap_or(DVec3::Y);
    let level = |v: DVec3| (v - y * v.dot(y)).try_normalize();
    let x = level(m.x_axis).or_else(|| level(DVec3::X)).unwrap_or_else(|| y.any_orthonormal_vector());
    DMat3::from_cols(x, y, x.cross(y))
}
