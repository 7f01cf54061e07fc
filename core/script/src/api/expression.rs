//! Facial expressions of an actor, by name.

use super::actor::change;
use crate::call::{ApiError, Call, Reply, text, unknown};
use crate::value::ActorRef;
use choreo_asset::Asset;
use choreo_stage::ActorEdit;
use rhai::Dynamic;

/// Index of the expression with a name.
pub(crate) fn find_expression(asset: &Asset, wanted: &Dynamic, label: &str) -> Result<u32, ApiError> {
    let name = text(wanted, label)?;
    if let Some(index) = asset.expressions.iter().position(|e| e.name == name) {
        return Ok(index as u32);
    }
    if asset.expressions.is_empty() {
        let error = ApiError::new(format!("{label}: \"{}\" has no expressions", asset.name)).focus(name);
        let has_morphs = asset.meshes.iter().any(|m| m.morph_targets > 0);
        return Err(if has_morphs { error.hint("use .morph for its morph targets") } else { error });
    }
    let names = asset.expressions.iter().map(|e| e.name.as_str());
    Err(unknown("expression", &name, &format!(" in \"{}\"", asset.name), names.collect::<Vec<_>>()))
}

pub(crate) fn of_actor(c: &mut Call) -> Reply {
    let this: ActorRef = c.this()?;
    let weight = c.number_in(1, 0.0, 1.0)? as f32;
    let expression = find_expression(&this.asset, &c.value(0), &c.label(0))?;
    change(c, ActorEdit::Expression { expression, weight }, |draft| {
        draft.actor.expressions.retain(|(e, _)| *e != expression);
        draft.actor.expressions.push((expression, weight));
    })
}

pub(crate) fn names(c: &mut Call) -> Reply {
    let asset = c.this_asset()?;
    c.stage_draft().mark_used(&asset);
    let names = asset.expressions.iter().map(|e| Dynamic::from(e.name.clone()));
    Ok(Dynamic::from_array(names.collect()))
}
