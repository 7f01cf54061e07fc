//! The visibility of an actor: `actor.from(time)`, `actor.until(time)`, `actor.hide_parts(names)`.

use super::joint_names::matches_wildcards;
use super::keys;
use crate::call::{ApiError, Call, Reply, api, texts, unknown};
use crate::suggest::list;
use crate::value::ActorRef;
use choreo_motion::{Interpolation, Time};
use choreo_stage::{Channel, Property};

api! {
    /// Shows the actor from this time on; before, it is hidden.
    Actor.from("time") = from;
    /// Hides the actor from this time on. A hidden actor costs nothing: it is neither posed nor drawn.
    Actor.until("time") = until;
    /// Hides parts of the model, such as the second sword of a character: the meshes of these names, or on nodes of
    /// these names, which `choreo info` lists. One name or an array; `*` stands for any letters, as in "Knight_Sword*". Further calls hide
    /// more.
    Actor.hide_parts("names") = hide_parts;
}

fn hide_parts(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let patterns = texts(&c.value(0), &c.label(0))?;
    let asset = &this.asset;
    let names: Vec<[&str; 2]> = (asset.instances.iter())
        .map(|instance| {
            let mesh = asset.meshes.get(instance.mesh as usize).map_or("", |mesh| mesh.name.as_str());
            let node = asset.skeleton.names().get(instance.joint as usize).map_or("", String::as_str);
            [node, mesh]
        })
        .collect();
    let mut hidden = Vec::new();
    for pattern in &patterns {
        let known = hidden.len();
        let named = |names: &[&str; 2]| names.iter().any(|name| matches_wildcards(pattern, name));
        hidden.extend((0..).zip(&names).filter(|(_, names)| named(names)).map(|(index, _)| index));
        if hidden.len() == known {
            return Err(unknown_part_error(pattern, &asset.name, &names));
        }
    }
    if patterns.is_empty() {
        return Err(ApiError::new("hide_parts: names must not be empty"));
    }
    c.stage_draft().actor(this.id)?.hidden_parts.extend::<Vec<u32>>(hidden);
    c.receiver()
}

/// The error that no mesh, and no node with a mesh, has a name. It suggests names that contain it.
fn unknown_part_error(pattern: &str, asset: &str, names: &[[&str; 2]]) -> ApiError {
    let mut known: Vec<&str> = names.as_flattened().iter().copied().filter(|name| !name.is_empty()).collect();
    known.sort_unstable();
    known.dedup();
    let of = format!(" of \"{asset}\"");
    let lower = pattern.trim_matches('*').to_lowercase();
    let found = known.iter().map(|name| (name, name.to_lowercase().find(&lower)));
    let Some((name, at)) = found.filter(|_| !lower.is_empty()).find_map(|(name, at)| Some((name, at?)))
    else {
        return unknown("part", pattern, &of, known);
    };
    // Letters may have another length in bytes in lower case.
    let written = name.get(at..at + lower.len()).unwrap_or(&lower);
    let matching: Vec<&str> =
        known.iter().copied().filter(|name| name.to_lowercase().contains(&lower)).collect();
    let text = format!("unknown part \"{pattern}\"{of}; did you mean \"*{written}*\"?");
    ApiError::new(text).focus(pattern).hint(format!("it matches {}", list(matching, 24)))
}

fn from(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_visibility_keys(c, |keys| {
        keys.retain(|(at, _)| *at > t);
        if t > Time::ZERO {
            keys.push((Time::ZERO, false));
        }
        keys.push((t, true));
    })
}

fn until(c: &mut Call) -> Reply {
    let t = c.time(0)?;
    change_visibility_keys(c, |keys| {
        if keys.is_empty() && t > Time::ZERO {
            keys.push((Time::ZERO, true));
        }
        keys.retain(|(at, _)| *at < t);
        keys.push((t, false));
    })
}

/// Changes the keyframes of visibility.
fn change_visibility_keys(c: &Call, change: impl FnOnce(&mut Vec<(Time, bool)>)) -> Reply {
    let this: ActorRef = c.this()?;
    {
        let mut stage_draft = c.stage_draft();
        let channels = &mut stage_draft.actor(this.id)?.actor.channels;
        let known = channels.iter().find(|channel| channel.property == Property::Visible);
        let mut all: Vec<(Time, bool)> = known.map_or_else(Vec::new, |channel| {
            channel.times.iter().copied().zip(channel.values.iter().map(|v| *v >= 0.5)).collect()
        });
        change(&mut all);
        all.sort_by_key(|(at, _)| *at);
        let channel = Channel {
            property: Property::Visible,
            interpolation: Interpolation::Step,
            times: all.iter().map(|(at, _)| *at).collect(),
            values: all.iter().map(|(_, on)| f64::from(u8::from(*on))).collect(),
        };
        keys::replace_channels(channels, vec![channel]);
    }
    c.receiver()
}
