//! Blends layers of one rank so that their order does not matter: overriding layers are averaged, additive layers summed.

use crate::stage::clips::{Cue, Layer, LayerMode, Reference};
use crate::timeline::active_clips as timeline;
use crate::timeline::active_clips::ActiveCue;
use choreo_asset::{Asset, MeshInstance};
use choreo_motion::{AdditiveLayers, Pose, Sample, Time, WeightedBlend};

/// Reusable buffers; their previous contents do not matter.
#[derive(Clone, Debug, Default)]
pub(crate) struct GroupScratch {
    active_cues: Vec<ActiveCue>,
    /// (layer within the group, its cue and share)
    active: Vec<(usize, ActiveCue)>,
    mix: WeightedBlend,
    deltas: AdditiveLayers,
    over: Pose,
    reference: Pose,
    morph: Vec<f32>,
    morph_reference: Vec<f32>,
    sums: Vec<f32>,
}

/// Whether layers of one rank need [`apply_layers`]: there are several, or one of them is additive.
pub(crate) fn needs_group_blending(layers: &[Layer]) -> bool {
    layers.len() > 1 || layers.iter().any(|layer| layer.mode != LayerMode::Override)
}

/// Applies the layers of one rank to a pose, its morph weights and expressions.
pub(crate) fn apply_layers(
    layers: &[Layer],
    asset: &Asset,
    time: Time,
    scratch: &mut GroupScratch,
    pose: &mut Pose,
    morph_weights: &mut [Vec<f32>],
    expressions: &mut [f32],
) {
    scratch.active.clear();
    for (index, layer) in layers.iter().enumerate() {
        timeline::upper_cues(layer, time, &mut scratch.active_cues);
        // A clip for another skeleton is skipped; `Stage::check` reports it.
        scratch
            .active_cues
            .retain(|active| layer.cues[active.cue].clip.joint_count() == asset.skeleton.len());
        timeline::convert_weights_to_shares(&mut scratch.active_cues);
        scratch.active.extend(scratch.active_cues.iter().map(|active| (index, *active)));
    }
    override_pose(layers, scratch, pose);
    add_to_pose(layers, asset, scratch, pose);
    for (instance, weights) in asset.instances.iter().zip(morph_weights) {
        if !weights.is_empty() {
            override_morphs(layers, instance, scratch, weights);
            add_to_morphs(layers, instance, scratch, weights);
        }
    }
    blend_layer_expressions(layers, asset, scratch, expressions);
}

/// Blends expression weights like morph weights: overriding ones are averaged, additive ones summed. The mask's weight at the head applies.
fn blend_layer_expressions(layers: &[Layer], asset: &Asset, scratch: &GroupScratch, expressions: &mut [f32]) {
    for (expression, weight) in asset.expressions.iter().zip(expressions) {
        let (mut total, mut sum, mut added_up) = (0.0, 0.0, 0.0);
        for (layer, active) in &scratch.active {
            let layer = &layers[*layer];
            let share = active.weight * crate::pose::mask_weight_at_head(asset, layer);
            let cue = &layer.cues[active.cue];
            let driven = cue.clip.sample_expression(&expression.name, active.clip_time);
            match additive_sign_and_reference(layer.mode) {
                None => {
                    total += share;
                    sum += driven.unwrap_or(*weight) * share;
                }
                Some((sign, from)) => {
                    let then = reference_time(from, cue);
                    let then = then.and_then(|time| cue.clip.sample_expression(&expression.name, time));
                    added_up += sign * share * driven.map_or(0.0, |now| now - then.unwrap_or(0.0));
                }
            }
        }
        if total > 0.0 {
            *weight = (*weight * (1.0f32 - total).max(0.0) + sum) / total.max(1.0);
        }
        *weight += added_up;
    }
}

fn override_pose(layers: &[Layer], scratch: &mut GroupScratch, pose: &mut Pose) {
    let GroupScratch { active, mix, over, .. } = scratch;
    let mut has_started = false;
    for (layer, active) in active.iter().filter(|(layer, _)| layers[*layer].mode == LayerMode::Override) {
        if !has_started {
            mix.start(pose.len());
            has_started = true;
        }
        let layer = &layers[*layer];
        over.copy_from(pose);
        Sample { clip: &layer.cues[active.cue].clip, time: active.clip_time, pose: over }.run();
        mix.add(pose, over, active.weight, layer.mask.as_ref().map(|mask| mask.as_slice()));
    }
    if has_started {
        mix.finish(pose);
    }
}

/// Sign and reference pose of an additive or subtractive layer; `None` for an overriding layer.
fn additive_sign_and_reference(mode: LayerMode) -> Option<(f32, Reference)> {
    match mode {
        LayerMode::Override => None,
        LayerMode::Additive(reference) => Some((1.0, reference)),
        LayerMode::Subtractive(reference) => Some((-1.0, reference)),
    }
}

fn reference_time(reference: Reference, cue: &Cue) -> Option<Time> {
    match reference {
        Reference::FirstFrame => Some(cue.trim.0),
        Reference::At(time) => Some(time),
        Reference::Rest => None,
    }
}

fn add_to_pose(layers: &[Layer], asset: &Asset, scratch: &mut GroupScratch, pose: &mut Pose) {
    let GroupScratch { active, deltas, over, reference, .. } = scratch;
    let mut has_started = false;
    for (layer, active) in active.iter() {
        let layer = &layers[*layer];
        let Some((sign, from)) = additive_sign_and_reference(layer.mode) else { continue };
        if !has_started {
            deltas.start(pose.len());
            has_started = true;
        }
        let cue = &layer.cues[active.cue];
        reference.copy_from(asset.rest_pose());
        if let Some(time) = reference_time(from, cue) {
            Sample { clip: &cue.clip, time, pose: reference }.run();
        }
        // A joint that the clip does not animate equals the reference, and so has no difference.
        over.copy_from(reference);
        Sample { clip: &cue.clip, time: active.clip_time, pose: over }.run();
        let mask = layer.mask.as_ref().map(|mask| mask.as_slice());
        deltas.add(reference, over, sign * active.weight, mask);
    }
    if has_started {
        deltas.apply(pose);
    }
}

fn mask_weight(layer: &Layer, instance: &MeshInstance) -> f32 {
    let mask = layer.mask.as_ref();
    mask.map_or(1.0, |mask| mask.get(instance.joint as usize).copied().unwrap_or(0.0))
}

fn override_morphs(
    layers: &[Layer],
    instance: &MeshInstance,
    scratch: &mut GroupScratch,
    weights: &mut [f32],
) {
    let GroupScratch { active, morph, sums, .. } = scratch;
    sums.clear();
    sums.resize(weights.len(), 0.0);
    let mut total = 0.0;
    for (layer, active) in active.iter().filter(|(layer, _)| layers[*layer].mode == LayerMode::Override) {
        let layer = &layers[*layer];
        let share = active.weight * mask_weight(layer, instance);
        morph.clear();
        morph.extend_from_slice(weights);
        layer.cues[active.cue].clip.sample_weights(instance.joint, active.clip_time, morph);
        sums.iter_mut().zip(morph.iter()).for_each(|(sum, weight)| *sum += weight * share);
        total += share;
    }
    if total > 0.0 {
        let (left, scale) = ((1.0 - total).max(0.0), 1.0 / total.max(1.0));
        for (weight, sum) in weights.iter_mut().zip(sums.iter()) {
            *weight = (*weight * left + sum) * scale;
        }
    }
}

fn add_to_morphs(layers: &[Layer], instance: &MeshInstance, scratch: &mut GroupScratch, weights: &mut [f32]) {
    let GroupScratch { active, morph, morph_reference, sums, .. } = scratch;
    sums.clear();
    sums.resize(weights.len(), 0.0);
    for (layer, active) in active.iter() {
        let layer = &layers[*layer];
        let Some((sign, from)) = additive_sign_and_reference(layer.mode) else { continue };
        let cue = &layer.cues[active.cue];
        let share = sign * active.weight * mask_weight(layer, instance);
        morph_reference.clear();
        morph_reference.extend(crate::pose::rest_weights(instance, weights.len()));
        if let Some(time) = reference_time(from, cue) {
            cue.clip.sample_weights(instance.joint, time, morph_reference);
        }
        morph.clear();
        morph.extend_from_slice(morph_reference);
        cue.clip.sample_weights(instance.joint, active.clip_time, morph);
        for (sum, (now, then)) in sums.iter_mut().zip(morph.iter().zip(morph_reference.iter())) {
            *sum += (now - then) * share;
        }
    }
    weights.iter_mut().zip(sums.iter()).for_each(|(weight, sum)| *weight += sum);
}
