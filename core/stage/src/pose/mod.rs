//! One actor's pose at a time: layers of clips, then edits of callbacks, then model space.

pub(crate) mod expressions;
pub(crate) mod gaze;
pub(crate) mod inertialization;
pub(crate) mod joints;
pub(crate) mod layers;
pub(crate) mod motions;
pub(crate) mod posed_mesh;
pub(crate) mod posing;

use crate::pose::inertialization::{CueInertialization, Inertializations};
use crate::pose::layers::GroupScratch;
use crate::stage::channel as channels;
use crate::stage::constraint::ConstraintKind;
use crate::stage::edits::ActorEdit;

use crate::mirroring::MirrorScratch;
use crate::root_motion::track::RootMotionTrack;
use crate::stage::actor::Actor;
use crate::stage::channel::Property;
use crate::stage::clips::Layer;
use crate::stage::root_motion::CueRootMotion;
use crate::timeline::active_clips as timeline;
use crate::timeline::active_clips::ActiveCue;
use choreo_asset::{Asset, MeshInstance, expression};
use choreo_motion::{BlendOnto, Clip, Crossfade, HumanBone, LocalToModel, Pose, Sample, Time};
use glam::{Affine3A, DAffine3, DQuat, DVec3};

/// Reusable buffers of [`pose_actor`]; their previous contents do not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct PoseScratch {
    pose: Pose,
    over: Pose,
    pair: [Pose; 2],
    active_cues: Vec<ActiveCue>,
    weights: Vec<f32>,
    expressions: Vec<f32>,
    /// Expression weights before they are resolved.
    requested: Vec<f32>,
    group: GroupScratch,
    mirror: MirrorScratch,
}

impl PoseScratch {
    /// Resets to the rest pose, with all expressions at zero.
    fn reset_to_rest(&mut self, asset: &Asset) {
        self.expressions.clear();
        self.expressions.resize(asset.expressions.len(), 0.0);
        self.pose.copy_from(asset.rest_pose());
    }

    /// Resolved weights of the expressions of the actor that was posed last.
    pub(crate) fn resolved_expressions(&self) -> &[f32] {
        &self.expressions
    }

    /// Requested expression weights of the actor that was posed last, before they are resolved.
    pub(crate) fn requested_expressions(&self) -> &[f32] {
        &self.requested
    }
}

/// Fills `model_from_joint` and `morph_weights` of an actor. A function of the actor, the time and the edits alone: actors can
/// be posed in any order and on any threads. `edits` are those of this actor, in order.
pub(crate) fn pose_actor<'e>(
    actor: &Actor,
    time: Time,
    (track, inertializations): (Option<&RootMotionTrack>, Option<&Inertializations>),
    edits: impl Iterator<Item = &'e ActorEdit> + Clone,
    scratch: &mut PoseScratch,
    model_from_joint: &mut Vec<Affine3A>,
    morph_weights: &mut Vec<Vec<f32>>,
) {
    let asset = &*actor.asset;
    let joints = asset.skeleton.len();
    model_from_joint.clear();
    model_from_joint.resize(joints, Affine3A::IDENTITY);
    reset_morph_weights(asset, morph_weights);
    scratch.reset_to_rest(asset);
    let turned = edits.clone().any(|edit| matches!(edit, ActorEdit::TurnJoint { .. }));
    let mirrored = actor
        .constraints
        .iter()
        .any(|g| matches!(g.kind, ConstraintKind::Mirror(_)) && g.weight_at(time) > 0.0);
    let mut in_model_space = false;
    let mut next = 0;
    while next < actor.layers.len() {
        let index = next;
        let layer = &actor.layers[index];
        let base = index == 0;
        next += 1;
        if !base {
            next += actor.layers[next..].iter().take_while(|l| l.rank == layer.rank).count();
            let equal = &actor.layers[index..next];
            if layers::needs_group_blending(equal) {
                let (group, pose, expressions) =
                    (&mut scratch.group, &mut scratch.pose, &mut scratch.expressions);
                layers::apply_layers(equal, asset, time, group, pose, morph_weights, expressions);
                continue;
            }
        }
        if base {
            timeline::base_cues(layer, time, &mut scratch.active_cues);
        } else {
            timeline::upper_cues(layer, time, &mut scratch.active_cues);
        }
        // A clip for another skeleton is skipped; `Stage::check` reports it.
        scratch.active_cues.retain(|active| layer.cues[active.cue].clip.joint_count() == joints);
        let blended = |(place, active): (usize, &ActiveCue)| BlendedClip {
            clip: &layer.cues[active.cue].clip,
            time: active.clip_time,
            weight: active.weight,
            first: base && place == 0,
            inertialization: inertialization(layer, active, time, inertializations.filter(|_| base)),
        };
        // Root motion and inertialization offsets change the clips' poses before they are blended.
        let blends_plain_clips = !base
            || track.is_none() && inertializations.is_none_or(|inertializations| !inertializations.has_any());
        if !blends_plain_clips {
            blend_clips_with_offsets(actor, layer, time, track, inertializations, scratch);
        } else if let [from, to] = &scratch.active_cues[..]
            && base
            && actor.layers.len() == 1
            && layer.mask.is_none()
            && !turned
            && !mirrored
        {
            // Most frames with more than one clip are a crossfade and nothing else, which is one fused step.
            let [from, to] = [blended((0, from)), blended((1, to))];
            crossfade(asset, &from, &to, &mut scratch.pair, model_from_joint);
            in_model_space = true;
        } else {
            for active in scratch.active_cues.iter().enumerate().map(blended) {
                active.blend_pose(asset, layer, base, &mut scratch.pose, &mut scratch.over);
            }
        }
        for active in scratch.active_cues.iter().enumerate().map(blended) {
            active.blend_weights(asset, layer, base, &mut scratch.weights, morph_weights);
            active.blend_expressions(asset, layer, base, &mut scratch.expressions);
        }
    }
    apply_edits(actor, time, edits, mirrored, scratch, morph_weights);
    if !in_model_space {
        LocalToModel { skeleton: &asset.skeleton, pose: &scratch.pose, model_from_joint }.run();
    }
}

/// Blends the clips of a base layer that root motion or inertialization offsets change.
fn blend_clips_with_offsets(
    actor: &Actor,
    layer: &Layer,
    time: Time,
    track: Option<&RootMotionTrack>,
    inertializations: Option<&Inertializations>,
    scratch: &mut PoseScratch,
) {
    let mask = layer.mask.as_ref().map(|mask| mask.as_slice());
    for (place, active) in scratch.active_cues.iter().enumerate() {
        let first = place == 0 && mask.is_none();
        let pose = if first { &mut scratch.pose } else { &mut scratch.over };
        pose.copy_from(actor.asset.rest_pose());
        sample_cue(actor, layer, active, time, track, inertializations, pose);
        if !first {
            let (pose, to) = (&mut scratch.pose, &scratch.over);
            BlendOnto { pose, to, weight: active.weight, mask }.run();
        }
    }
}

/// Changes the pose and the weights after the clips: mirroring, keys and the edits of callbacks.
fn apply_edits<'e>(
    actor: &Actor,
    time: Time,
    edits: impl Iterator<Item = &'e ActorEdit> + Clone,
    mirrored: bool,
    scratch: &mut PoseScratch,
    morph_weights: &mut [Vec<f32>],
) {
    let asset = &*actor.asset;
    for constraint in actor.constraints.iter().filter(|_| mirrored) {
        if let (ConstraintKind::Mirror(mirroring), share @ f64::MIN_POSITIVE..) =
            (&constraint.kind, constraint.weight_at(time))
        {
            let PoseScratch { pose, mirror, expressions, .. } = &mut *scratch;
            mirroring.apply(share as f32, mirror, pose, morph_weights, expressions);
        }
    }
    override_morph_weights(actor, time, edits.clone(), morph_weights);
    if !asset.expressions.is_empty() {
        override_expression_weights(actor, time, edits.clone(), &mut scratch.expressions);
        scratch.requested.clone_from(&scratch.expressions);
        expression::resolve_weights(&asset.expressions, &mut scratch.expressions);
        expression::add(&asset.expressions, &scratch.expressions, morph_weights);
    }
    for edit in edits {
        if let ActorEdit::TurnJoint { joint, rotation } = edit
            && (*joint as usize) < asset.skeleton.len()
        {
            let mut transform = scratch.pose.get(*joint as usize);
            transform.rotation = (transform.rotation * *rotation).normalize();
            scratch.pose.set(*joint as usize, transform);
        }
    }
}

/// Samples a cue of a base layer over the rest pose, moves its root to the root-motion anchor, and applies what is left of its
/// inertialization offset.
pub(crate) fn sample_cue(
    actor: &Actor,
    layer: &Layer,
    active: &ActiveCue,
    time: Time,
    track: Option<&RootMotionTrack>,
    inertializations: Option<&Inertializations>,
    pose: &mut Pose,
) {
    let cue = &layer.cues[active.cue];
    Sample { clip: &cue.clip, time: active.clip_time, pose }.run();
    if let (Some(track), Some(root)) = (track, cue.root.as_deref())
        && let Some(back) = track.back_to_anchor(root, cue, active.clip_time)
    {
        move_root(actor, root, back.rotation(), back.translation, pose);
    }
    if let Some((switch, since)) = inertialization(layer, active, time, inertializations) {
        switch.joints.apply(since, pose);
    }
}

/// Inertialization offset of a cue, and the time since the start of the cue; `None` if it is not inertialized.
pub(crate) fn inertialization<'a>(
    layer: &Layer,
    active: &ActiveCue,
    time: Time,
    inertializations: Option<&'a Inertializations>,
) -> Option<(&'a CueInertialization, Time)> {
    let switch = inertializations.and_then(|inertializations| inertializations.of(active.cue))?;
    Some((switch, time - layer.cues[active.cue].start))
}

/// Moves the root joint, and all joints below it, in model space.
fn move_root(actor: &Actor, root: &CueRootMotion, rotation: DQuat, translation: DVec3, pose: &mut Pose) {
    let parents = actor.asset.skeleton.parents();
    let joint = root.motion.joint() as usize;
    if joint >= pose.len() || joint >= parents.len() {
        return;
    }
    let (mut model, mut turned) = (DAffine3::IDENTITY, DQuat::IDENTITY);
    let mut next = parents[joint];
    while let Some(parent) = next {
        let local = pose.get(parent as usize);
        let (t, r, s) = (local.translation.as_dvec3(), local.rotation.as_dquat(), local.scale.as_dvec3());
        model = DAffine3::from_scale_rotation_translation(s, r, t) * model;
        turned = r * turned;
        next = parents[parent as usize];
    }
    let mut local = pose.get(joint);
    let place = model.transform_point3(local.translation.as_dvec3());
    let moved = model.inverse().transform_point3(rotation * place + translation);
    let turned = turned.normalize();
    local.rotation =
        (turned.conjugate() * rotation * turned * local.rotation.as_dquat()).normalize().as_quat();
    local.translation = moved.as_vec3();
    if local.is_finite() {
        pose.set(joint, local);
    }
}

fn crossfade(
    asset: &Asset,
    from: &BlendedClip,
    to: &BlendedClip,
    scratch: &mut [Pose; 2],
    model_from_joint: &mut [Affine3A],
) {
    for pose in scratch.iter_mut().filter(|pose| pose.len() != asset.skeleton.len()) {
        pose.copy_from(asset.rest_pose());
    }
    Crossfade {
        skeleton: &asset.skeleton,
        rest: asset.rest_pose(),
        from: from.clip,
        from_time: from.time,
        to: to.clip,
        to_time: to.time,
        weight: to.weight,
        scratch,
        model_from_joint,
    }
    .run();
}

pub(crate) struct BlendedClip<'a> {
    pub clip: &'a Clip,
    pub time: Time,
    pub weight: f32,
    /// Whether this is the first clip of the base layer: only the rest pose is below it.
    pub first: bool,
    /// See [`inertialization()`].
    pub inertialization: Option<(&'a CueInertialization, Time)>,
}

impl BlendedClip<'_> {
    /// Blends the clip's pose over the layers below. Joints that the clip does not animate are at rest on the base layer, and unchanged on
    /// upper layers.
    fn blend_pose(&self, asset: &Asset, layer: &Layer, base: bool, pose: &mut Pose, over: &mut Pose) {
        let mask = layer.mask.as_ref().map(|mask| mask.as_slice());
        if self.first && mask.is_none() {
            Sample { clip: self.clip, time: self.time, pose }.run();
            return;
        }
        over.copy_from(if base { asset.rest_pose() } else { pose });
        Sample { clip: self.clip, time: self.time, pose: over }.run();
        BlendOnto { pose, to: over, weight: self.weight, mask }.run();
    }

    pub(crate) fn blend_weights(
        &self,
        asset: &Asset,
        layer: &Layer,
        base: bool,
        over: &mut Vec<f32>,
        weights: &mut [Vec<f32>],
    ) {
        for (index, (instance, weights)) in asset.instances.iter().zip(weights).enumerate() {
            if weights.is_empty() {
                continue;
            }
            over.clear();
            if base {
                over.extend(rest_weights(instance, weights.len()));
            } else {
                over.extend_from_slice(weights);
            }
            self.clip.sample_weights(instance.joint, self.time, over);
            if let Some((switch, since)) = self.inertialization
                && let Some(morphs) = switch.morphs.get(index)
            {
                morphs.apply(since, over);
            }
            let mask = layer.mask.as_ref();
            let masked = mask.map_or(1.0, |m| m.get(instance.joint as usize).copied().unwrap_or(0.0));
            let share = self.weight * masked;
            for (weight, over) in weights.iter_mut().zip(over.iter()) {
                *weight = if share == 1.0 { *over } else { *weight + (*over - *weight) * share };
            }
        }
    }

    /// Blends the clip's expressions over the weights below. An expression that the clip does not animate is 0 on the base layer, and
    /// unchanged on upper layers. The mask's weight at the head applies.
    pub(crate) fn blend_expressions(&self, asset: &Asset, layer: &Layer, base: bool, weights: &mut [f32]) {
        if weights.is_empty() || (self.clip.expressions().is_empty() && !base) {
            return;
        }
        let share = self.weight * mask_weight_at_head(asset, layer);
        for (index, (expression, weight)) in asset.expressions.iter().zip(weights).enumerate() {
            let driven = self.clip.sample_expression(&expression.name, self.time);
            let mut over = [driven.unwrap_or(if base { 0.0 } else { *weight })];
            if let Some((switch, since)) = self.inertialization
                && let Some(face) = switch.expressions.get(index)
            {
                face.apply(since, &mut over);
            }
            let [over] = over;
            *weight = if share == 1.0 { over } else { *weight + (over - *weight) * share };
        }
    }
}

/// Weight of a layer's mask at the head.
pub(crate) fn mask_weight_at_head(asset: &Asset, layer: &Layer) -> f32 {
    let head = || {
        let humanoid = asset.skeleton.humanoid();
        humanoid.and_then(|h| h.joint(HumanBone::Head)).or(asset.skeleton.find("Head").map(|j| j as u32))
    };
    let mask = layer.mask.as_ref();
    mask.map_or(1.0, |m| head().and_then(|j| m.get(j as usize).copied()).unwrap_or(0.0))
}

pub(crate) fn rest_weights(instance: &MeshInstance, count: usize) -> impl Iterator<Item = f32> + '_ {
    instance.weights.iter().copied().chain(std::iter::repeat(0.0)).take(count)
}

pub(crate) fn reset_morph_weights(asset: &Asset, morph_weights: &mut Vec<Vec<f32>>) {
    morph_weights.resize_with(asset.instances.len(), Vec::new);
    for (instance, weights) in asset.instances.iter().zip(morph_weights) {
        let count = asset.meshes.get(instance.mesh as usize).map_or(0, |mesh| mesh.morph_targets);
        weights.clear();
        weights.extend(rest_weights(instance, count));
    }
}

/// Overrides the clips' weights: the script's fixed weights, then keyed ones, then those of callbacks.
fn override_morph_weights<'e>(
    actor: &Actor,
    time: Time,
    edits: impl Iterator<Item = &'e ActorEdit>,
    morph_weights: &mut [Vec<f32>],
) {
    let mut set = |instance: u32, target: u32, weight: f32| {
        let weights = morph_weights.get_mut(instance as usize);
        if let Some(slot) = weights.and_then(|w| w.get_mut(target as usize)) {
            *slot = weight;
        }
    };
    for (instance, target, weight) in &actor.morphs {
        set(*instance, *target, *weight);
    }
    for channel in &actor.channels {
        if let Property::Morph { instance, target } = channel.property
            && let Some(v) = channel.at(time)
        {
            set(instance, target, v[0] as f32);
        }
    }
    for edit in edits {
        if let ActorEdit::Morph { instance, target, weight } = edit {
            set(*instance, *target, *weight);
        }
    }
}

/// Overrides the clips' expressions: the script's fixed weights, then keyed ones, then those of callbacks.
fn override_expression_weights<'e>(
    actor: &Actor,
    time: Time,
    edits: impl Iterator<Item = &'e ActorEdit>,
    weights: &mut [f32],
) {
    let mut set = |expression: u32, weight: f32| {
        if let Some(slot) = weights.get_mut(expression as usize) {
            *slot = weight;
        }
    };
    for (expression, weight) in &actor.expressions {
        set(*expression, *weight);
    }
    for channel in &actor.channels {
        if let Property::Expression { expression } = channel.property
            && let Some(v) = channel.at(time)
        {
            set(expression, v[0] as f32);
        }
    }
    for edit in edits {
        if let ActorEdit::Expression { expression, weight } = edit {
            set(*expression, *weight);
        }
    }
}

/// Keyed placement of an actor, before callbacks, and the parts of its state that need no pose.
pub(crate) fn keyed_placement(
    actor: &Actor,
    time: Time,
    state: &mut crate::snapshot::ActorState,
) -> crate::stage::actor::Placement {
    let mut placement = actor.transform;
    (state.visible, state.tint) = (actor.visible, actor.tint);
    (state.line_width, state.copies) = (actor.line_width, actor.copies);
    for channel in &actor.channels {
        let Some(v) = channel.at(time) else { continue };
        match channel.property {
            Property::Translation => placement.translation = channels::vec3(v),
            Property::Rotation => placement.rotation = glam::DQuat::from_array(v),
            Property::Scale => placement.scale = channels::vec3(v),
            Property::Visible => state.visible = v[0] >= 0.5,
            Property::Tint => state.tint = glam::DVec4::from_array(v).as_vec4(),
            // A value keyed from 3 to 4 reaches 4 at the end, in spite of rounding errors.
            Property::Copies => state.copies = Some((v[0] + 1e-9).max(0.0) as u32),
            Property::LineWidth => state.line_width = Some(v[0].max(0.0) as f32),
            _ => {}
        }
    }
    placement
}
