//! Upper bounds of an actor's morph weights at any time, for bounding volumes that hold without a pose.

use crate::pose::rest_weights;
use crate::stage::Stage;
use crate::stage::actor::Actor;
use crate::stage::channel::Property;
use crate::stage::clips::LayerMode;
use choreo_motion::{Curve, Interpolation, Path};

/// The largest magnitude of each morph weight of a mesh instance; `None` if no bound is known in advance: splines overshoot, and callbacks
/// may set any weight.
pub(crate) fn largest_morph_weights(stage: &Stage, actor: &Actor, index: usize) -> Option<Vec<f64>> {
    let instance = actor.asset.instances.get(index)?;
    let count = actor.asset.meshes.get(instance.mesh as usize)?.morph_targets;
    if !stage.frame_callbacks.is_empty() {
        return None;
    }
    let mut largest: Vec<f64> = rest_weights(instance, count).map(|weight| f64::from(weight.abs())).collect();
    let mut added = vec![0.0; count];
    for layer in &actor.layers {
        for cue in &layer.cues {
            let is_of_this = |c: &&Curve| c.joint == instance.joint && matches!(c.path, Path::Weights(_));
            for curve in cue.clip.curves().iter().filter(is_of_this) {
                if curve.interpolation == Interpolation::CubicSpline {
                    return None;
                }
                let targets = curve.path.width().max(1);
                let most = |target: usize| {
                    let keys = curve.values.iter().skip(target).step_by(targets);
                    keys.fold(0.0f64, |most, weight| most.max(f64::from(weight.abs())))
                };
                let all = largest.iter_mut().zip(&mut added).take(targets).enumerate();
                all.for_each(|(target, (largest, added))| match layer.mode {
                    LayerMode::Override => *largest = largest.max(most(target)),
                    // An additive clip adds the difference of two of its values, or of a value and the weight at rest.
                    _ => *added += 2.0 * most(target).max(*largest),
                });
            }
        }
    }
    let of_this = |instance: u32, target: u32| instance as usize == index && (target as usize) < count;
    for (instance, target, weight) in &actor.morphs {
        if of_this(*instance, *target) {
            let largest = &mut largest[*target as usize];
            *largest = largest.max(f64::from(weight.abs()));
        }
    }
    for channel in &actor.channels {
        let Property::Morph { instance, target } = channel.property else { continue };
        if !of_this(instance, target) {
            continue;
        }
        if channel.interpolation == Interpolation::CubicSpline {
            return None;
        }
        let largest = &mut largest[target as usize];
        *largest = channel.values.iter().fold(*largest, |most, weight| most.max(weight.abs()));
    }
    // Settled weights of expressions are between 0 and 1.
    for bind in actor.asset.expressions.iter().flat_map(|expression| &expression.morphs) {
        if of_this(bind.instance, bind.target) {
            added[bind.target as usize] += f64::from(bind.weight.abs());
        }
    }
    largest.iter_mut().zip(added).for_each(|(largest, added)| *largest += added);
    Some(largest)
}
