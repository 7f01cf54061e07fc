//! Layers: mask, weight, priority and blend mode.

use crate::api::joint_names::joints_of_pattern;
use crate::api::keys;
use crate::build::Chain;
use crate::call::{ApiError, Call, Reply, describe};
use crate::value::CueRef;
use choreo_asset::Asset;
use choreo_motion::{Clip, Interpolation, Time};
use choreo_stage::{Channel, LayerMode, Property, Reference};
use rhai::{Dynamic, Map};
use std::sync::Arc;

/// Maximum depth in joints of the soft edge of a mask. Skeletons are less deep in practice.
const MAX_SOFT_JOINTS: f64 = 100.0;

/// Changes the layer (chain of cues) of this cue.
fn change(c: &Call, change: impl FnOnce(&mut Chain) -> Result<(), ApiError>) -> Reply {
    let this: CueRef = c.this()?;
    let mut stage_draft = c.stage_draft();
    let chain = stage_draft.cue(this.0)?.chain;
    change(&mut stage_draft.chains[chain])?;
    c.receiver()
}

pub(crate) fn on(c: &mut Call) -> Reply {
    let this: CueRef = c.this()?;
    let weights = patterns(c)?;
    let o = c.options(1, &["soft"])?;
    let soft = o.number_in("soft", 0.0, MAX_SOFT_JOINTS)?.unwrap_or(0.0);
    let asset = {
        let mut stage_draft = c.stage_draft();
        let chain = stage_draft.cue(this.0)?.chain;
        let actor = stage_draft.chains[chain].actor;
        stage_draft.actor(actor)?.actor.asset.clone()
    };
    let mut mask = mask(&asset, &weights)?;
    soften(&asset, &mut mask, soft);
    change(c, |chain| {
        chain.mask = Some(mask);
        Ok(())
    })
}

pub(crate) fn additive(c: &mut Call) -> Reply {
    let mode = LayerMode::Additive(reference_of_cue(c)?);
    change(c, |chain| {
        chain.mode = mode;
        Ok(())
    })
}

pub(crate) fn subtractive(c: &mut Call) -> Reply {
    let mode = LayerMode::Subtractive(reference_of_cue(c)?);
    change(c, |chain| {
        chain.mode = mode;
        Ok(())
    })
}

fn reference_of_cue(c: &Call) -> Result<Reference, ApiError> {
    let this: CueRef = c.this()?;
    let clip = c.stage_draft().cue(this.0)?.cue.clip.clone();
    reference(c, &clip)
}

/// The reference pose of an additive clip, read from the first argument.
pub(crate) fn reference(c: &Call, clip: &Clip) -> Result<Reference, ApiError> {
    if c.len() == 0 {
        return Ok(Reference::FirstFrame);
    }
    let value = c.value(0);
    if value.is_string() {
        return Ok(match crate::call::one_of(&value, &c.label(0), &["first", "rest"])? {
            "rest" => Reference::Rest,
            _ => Reference::FirstFrame,
        });
    }
    let time = crate::call::duration(&value, &c.label(0))?;
    if time > clip.duration {
        let (at, end) = (time.as_secs(), clip.duration.as_secs());
        let text = format!("{} at {at} s is after the end of clip \"{}\", {end} s", c.label(0), clip.name);
        return Err(ApiError::new(text));
    }
    Ok(Reference::At(time))
}

pub(crate) fn layer_weight(c: &mut Call) -> Reply {
    let how = keys::read_interpolation(c, 1)?;
    let within = |v: &Dynamic, label: &str| crate::call::number_in(v, label, 0.0, 1.0);
    let value = c.value(0);
    let weights = match value.is_array() {
        true => keys::scalar_channel(c, &value, "layer_weight", how, Property::Weight, &within)?,
        false => Channel {
            property: Property::Weight,
            interpolation: Interpolation::Step,
            times: vec![Time::ZERO],
            values: vec![c.number_in(0, 0.0, 1.0)?],
        },
    };
    change(c, |chain| {
        chain.weight_keys = Some(Arc::new(weights));
        Ok(())
    })
}

pub(crate) fn priority(c: &mut Call) -> Reply {
    let value = c.value(0);
    let number = value.as_int().ok().filter(|n| (0..=1000).contains(n));
    let number = number.ok_or_else(|| c.wrong(0, "a whole number from 0 to 1000"))? as u32;
    change(c, |chain| {
        chain.priority = Some(number);
        Ok(())
    })
}

/// The reason why a mask does not fit the joints of an asset. `written`: the arguments of `on` as in a script. `None` if the mask
/// fits, or if the text is not a constant expression.
pub fn mask_problem(asset: &Asset, written: &str) -> Option<String> {
    let mut engine = choreo_sandbox::engine();
    engine.set_max_operations(MAX_STEPS);
    let arguments: rhai::Array = engine.eval_expression(&format!("[{written}]")).ok()?;
    let error = patterns_of(arguments.first()?, "on").and_then(|patterns| mask(asset, &patterns)).err()?;
    let has_suggestion = error.message.contains("did you mean");
    let hint = error.hint.filter(|_| !has_suggestion).map(|hint| format!("; {hint}")).unwrap_or_default();
    Some(format!("{}{hint}", error.message))
}

/// Interpreter steps that evaluating the text of a mask may take.
const MAX_STEPS: u64 = 10_000;

/// Reads joint patterns with their weights.
fn patterns(c: &Call) -> Result<Vec<(String, f32)>, ApiError> {
    patterns_of(&c.value(0), &c.label(0))
}

fn patterns_of(value: &Dynamic, label: &str) -> Result<Vec<(String, f32)>, ApiError> {
    if value.is_string() {
        return Ok(vec![(crate::call::text(value, label)?, 1.0)]);
    }
    if let Some(array) = value.read_lock::<rhai::Array>() {
        return array.iter().map(|v| Ok((crate::call::text(v, label)?, 1.0))).collect();
    }
    if let Some(map) = value.read_lock::<Map>() {
        let weight = |(name, v): (&rhai::Identifier, &Dynamic)| {
            let weight = crate::call::number_in(v, &format!("{label}: \"{name}\""), 0.0, 1.0)?;
            Ok((name.to_string(), weight as f32))
        };
        return map.iter().map(weight).collect();
    }
    let text = format!(
        "{label} must be text like \"Spine..\", an array of such texts, or an object map from them to weights, got {}",
        describe(value)
    );
    let hint = ".on(actor) is for effects; a clip is played by the actor on which play was called";
    Err(ApiError::new(text).hint(hint))
}

/// Specificity of a joint pattern, ascending. If several patterns match a joint, the most specific one determines its weight.
#[derive(Clone, Copy, PartialEq, PartialOrd)]
enum PatternSpecificity {
    /// A pattern with `*`.
    Wildcard,
    /// A joint and all joints below it, with the depth of that joint in the skeleton.
    Subtree(usize),
    /// The name of one joint.
    Name,
}

/// The mask: the weight of each joint is that of the most specific pattern that matches, and the largest of equally
/// specific ones.
fn mask(asset: &Asset, patterns: &[(String, f32)]) -> Result<Vec<f32>, ApiError> {
    let skeleton = &asset.skeleton;
    let mut best: Vec<Option<(PatternSpecificity, f32)>> = vec![None; skeleton.len()];
    let mut depths: Vec<usize> = Vec::with_capacity(skeleton.len());
    for parent in skeleton.parents() {
        depths.push(parent.map_or(0, |p| depths[p as usize] + 1));
    }
    for (pattern, weight) in patterns {
        let (joints, includes_subtree) = joints_of_pattern(asset, pattern)?;
        let mut hit: Vec<Option<PatternSpecificity>> = vec![None; skeleton.len()];
        for joint in joints {
            hit[joint as usize] = Some(match includes_subtree {
                _ if pattern.contains('*') => PatternSpecificity::Wildcard,
                true => PatternSpecificity::Subtree(depths[joint as usize]),
                false => PatternSpecificity::Name,
            });
        }
        if includes_subtree {
            for joint in 0..skeleton.len() {
                hit[joint] = hit[joint].or(skeleton.parents()[joint].and_then(|p| hit[p as usize]));
            }
        }
        for (best, hit) in best.iter_mut().zip(hit) {
            if let Some(specificity) = hit {
                let is_better = best.is_none_or(|(before, largest)| {
                    specificity > before || specificity == before && *weight > largest
                });
                if is_better {
                    *best = Some((specificity, *weight));
                }
            }
        }
    }
    Ok(best.into_iter().map(|best| best.map_or(0.0, |(_, weight)| weight)).collect())
}

/// Softens the edge of a mask: the `soft` joints above each masked joint get a part of its weight. With `soft` = 2 the parent gets
/// two thirds and the grandparent one third.
fn soften(asset: &Asset, mask: &mut [f32], soft: f64) {
    let parents = asset.skeleton.parents();
    let hard = mask.to_vec();
    for (joint, weight) in hard.iter().enumerate() {
        let mut above = parents[joint];
        let mut steps = 1.0;
        while let Some(parent) = above
            && steps <= soft
            && *weight > 0.0
        {
            // A joint that is masked itself keeps its weight, and a soft edge of its own begins above it.
            if hard[parent as usize] > 0.0 {
                break;
            }
            let share = *weight * (1.0 - steps / (soft + 1.0)) as f32;
            mask[parent as usize] = mask[parent as usize].max(share);
            above = parents[parent as usize];
            steps += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::mask_problem;
    use choreo_asset::Asset;
    use choreo_motion::{Skeleton, Transform};
    use std::sync::Arc;

    #[test]
    fn mask_problem_names_unknown_joints_and_the_nearest_known_one() {
        let rest = vec![Transform::IDENTITY; 3];
        let names = ["Hips", "Spine", "Head"].map(String::from).to_vec();
        let skeleton = Skeleton::new(names, vec![None, Some(0), Some(1)], rest).unwrap();
        let asset = Asset { name: "ada".into(), skeleton: Arc::new(skeleton), ..Asset::default() };
        for written in [
            "\"Spine..\"",
            "[\"Head\", \"*ip*\"]",
            "#{ Head: 0.5 }, #{ soft: 1 }",
            "joints",
            "\"Spi",
            "f(1)",
            "",
        ] {
            assert_eq!(mask_problem(&asset, written), None, "{written}");
        }
        for (written, why) in [
            ("\"Spien..\"", "unknown joint \"Spien\" in skeleton \"ada\"; did you mean \"Spine\"?"),
            ("[\"Head\", \"Hipps\"]", "unknown joint \"Hipps\" in skeleton \"ada\"; did you mean \"Hips\"?"),
            ("#{ Tail: 1.0 }", "unknown joint \"Tail\" in skeleton \"ada\"; known: Hips, Spine, Head"),
            ("\"*Wing*\"", "no joint of skeleton \"ada\" matches \"*Wing*\"; joints: Hips, Spine, Head"),
        ] {
            assert_eq!(mask_problem(&asset, written).as_deref(), Some(why));
        }
        assert!(mask_problem(&asset, "3").unwrap().starts_with("on must be text like \"Spine..\""));
    }
}
