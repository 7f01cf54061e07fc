//! Properties of a file's cameras, lights and materials that its clips animate (KHR_animation_pointer), blended like poses.

pub(crate) mod materials;

use crate::stage::actor::Actor;
use crate::stage::clips::LayerMode;
use choreo_motion::{PropertyTarget, Time};
use glam::Vec4;

/// Value of a property at a time; `None` if no cue's clip animates it. A base-layer clip that does not animate it counts as `rest`, and
/// such a clip on an upper layer changes nothing. Additive layers add their difference from `rest`. Masks apply to joints only.
pub(crate) fn property_at<const N: usize>(
    actor: &Actor,
    target: PropertyTarget,
    rest: [f32; N],
    time: Time,
) -> Option<[f32; N]> {
    let cues = || actor.layers.iter().flat_map(|layer| &layer.cues);
    // A clip of another asset refers to that asset's properties.
    let is_of_asset = |clip: &choreo_motion::Clip| clip.joint_count() == actor.asset.skeleton.len();
    if !cues().any(|cue| is_of_asset(&cue.clip) && cue.clip.properties().any(|(t, _)| t == target)) {
        return None;
    }
    let mut value = rest;
    for active in actor.active_clips(time) {
        let clip = &actor.layers[active.layer].cues[active.cue].clip;
        let mut over = rest;
        let drives = is_of_asset(clip) && clip.sample_property(target, active.clip_time, &mut over);
        if !drives && active.layer > 0 {
            continue;
        }
        let sign =
            if matches!(actor.layers[active.layer].mode, LayerMode::Subtractive(_)) { -1.0 } else { 1.0 };
        for ((value, over), rest) in value.iter_mut().zip(over).zip(rest) {
            if active.additive {
                *value += (over - rest) * active.weight * sign;
                continue;
            }
            *value = if active.weight == 1.0 { over } else { *value + (over - *value) * active.weight };
        }
    }
    Some(value)
}

/// The base color factors of an actor's materials; empty where its clips animate none.
pub(crate) fn base_colors(actor: &Actor, time: Time, out: &mut Vec<Vec4>) {
    out.clear();
    let asset = &actor.asset;
    let properties = actor.layers.iter().flat_map(|layer| &layer.cues).flat_map(|cue| cue.clip.properties());
    if !properties.into_iter().any(|(target, _)| matches!(target, PropertyTarget::BaseColor(_))) {
        return;
    }
    out.extend(asset.materials.iter().enumerate().map(|(index, material)| {
        let target = PropertyTarget::BaseColor(index as u32);
        let color = property_at(actor, target, material.base_color.to_array(), time).map(Vec4::from_array);
        // Splines overshoot.
        color.map_or(material.base_color, |c| c.max(Vec4::ZERO))
    }));
}
