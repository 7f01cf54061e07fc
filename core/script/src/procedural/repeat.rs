//! Instancing: `asset.repeat(places)`.

use crate::call::{ApiError, Call, Reply, describe, euler, numbers, wrong};
use crate::limits::raise_hint;
use crate::value::AssetRef;
use choreo_asset::{Asset, widen};
use glam::{Affine3A, DAffine3, DQuat, DVec3};
use rhai::{Array, Dynamic, Map};
use std::sync::Arc;

/// Runs `asset.repeat(places)`: makes an asset with one instance at each place.
pub(crate) fn repeat(c: &mut Call) -> Reply {
    let source = c.this_asset()?;
    let asset = &source;
    let places = c.value(0);
    let Some(array) = places.read_lock::<Array>() else {
        return Err(c.wrong(0, "an array of places, like [[0, 0, 0], [1, 0, 0]]"));
    };
    if array.is_empty() {
        return Err(ApiError::new("repeat: places is an empty array").hint("to show none, use count(0)"));
    }
    if asset.instances.is_empty() {
        return Err(ApiError::new(format!("repeat: {} has no meshes", asset.name)));
    }
    let limit = c.context.limits.instances;
    let all = array.len() as u64 * asset.placements.len().max(1) as u64;
    if all > limit {
        let text = format!("repeat: too many instances, {all}");
        return Err(ApiError::new(text).hint(raise_hint("instances", limit)));
    }
    let model_from_place: Vec<DAffine3> =
        array.iter().enumerate().map(|(i, v)| read_place(v, i)).collect::<Result<_, _>>()?;
    let own: Vec<DAffine3> = asset.first_placements(None).map(|place| widen(&place)).collect();
    let places = model_from_place.iter().flat_map(|p| own.iter().map(move |own| to_f32(*p * *own)));
    let placements = places.collect();
    let asset = Asset { placements, derived: Default::default(), ..Asset::clone(asset) };
    c.stage_draft().mark_used(&source);
    let load = c.stage_draft().add_procedural_load(&Arc::new(asset), &c.place);
    Ok(Dynamic::from(AssetRef { load, dead: false }))
}

/// The transform of place `i`, which is a point or an object map.
fn read_place(v: &Dynamic, i: usize) -> Result<DAffine3, ApiError> {
    let point = |v: &Dynamic| match numbers(v).as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|n| n.is_finite()) => Some(DVec3::new(*x, *y, *z)),
        _ => None,
    };
    if let Some(at) = point(v) {
        return Ok(DAffine3::from_translation(at));
    }
    let label = format!("repeat: places[{i}]");
    let Some(map) = v.read_lock::<Map>() else {
        return Err(wrong(v, &label, "a point [x, y, z] or #{ at, turn, scale }"));
    };
    let (mut at, mut turn, mut scale) = (DVec3::ZERO, DQuat::IDENTITY, DVec3::ONE);
    for (key, value) in map.iter() {
        let label = format!("{label}.{key}");
        match key.as_str() {
            "at" => at = point(value).ok_or_else(|| wrong(value, &label, "a point [x, y, z]"))?,
            "turn" => {
                turn = match point(value) {
                    Some(angles) => euler(angles),
                    None => DQuat::from_rotation_y(crate::call::number(value, &label)?.to_radians()),
                }
            }
            "scale" => {
                scale =
                    point(value).map_or_else(|| crate::call::number(value, &label).map(DVec3::splat), Ok)?
            }
            _ => {
                let text =
                    format!("{label} is unknown, got {}; a place has at, turn and scale", describe(value));
                return Err(ApiError::new(text).focus(key.to_string()));
            }
        }
    }
    let placed = DAffine3::from_scale_rotation_translation(scale, turn, at);
    if !placed.is_finite() {
        return Err(ApiError::new(format!("{label} must be finite")));
    }
    Ok(placed)
}

fn to_f32(a: DAffine3) -> Affine3A {
    Affine3A::from_cols_array(&a.to_cols_array().map(|v| v as f32))
}
