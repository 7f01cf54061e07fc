//! Binds clips to the skeleton of an actor.

use crate::build::BoundClip;
use crate::call::{ApiError, Call};
use crate::value::ClipRef;
use choreo_asset::Asset;
use choreo_motion::Clip;
use std::sync::Arc;

/// The clip of an argument, bound to the joints of `asset`.
pub(crate) fn bound_clip(c: &Call, i: usize, asset: &Arc<Asset>) -> Result<Arc<Clip>, ApiError> {
    let Some(given) = c.value(i).try_cast::<ClipRef>() else {
        return Err(c.wrong(i, "a Clip, as in asset.clip(\"name\")"));
    };
    bind_clip(c, &given, asset)
}

/// A clip bound to the joints of `asset`.
pub(crate) fn bind_clip(c: &Call, given: &ClipRef, asset: &Arc<Asset>) -> Result<Arc<Clip>, ApiError> {
    c.stage_draft().mark_used(&given.asset);
    if Arc::ptr_eq(&given.asset, asset) {
        return Ok(given.clip.clone());
    }
    let key = (Arc::as_ptr(&given.clip) as usize, Arc::as_ptr(asset) as usize);
    if let Some(bound) = c.stage_draft().bound_clips.get(&key) {
        return Ok(bound.clip.clone());
    }
    let bound = Arc::new(crate::api::clip::fit_to_skeleton(c, given, asset)?);
    c.stage_draft()
        .bound_clips
        .insert(key, BoundClip { clip: bound.clone(), _from: given.clip.clone(), _onto: asset.clone() });
    Ok(bound)
}
