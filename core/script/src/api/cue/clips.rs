//! Clips for an actor: bound to the joints of its own skeleton.

use crate::build::Bound;
use crate::call::{ApiError, Call};
use crate::diagnostic::Severity;
use crate::suggest::list;
use crate::value::ClipRef;
use choreo_motion::{Clip, bind_clip};
use choreo_stage::Asset;
use std::sync::Arc;

/// The clip of an argument, bound to the joints of `asset`.
pub fn bound_clip(c: &Call, i: usize, asset: &Arc<Asset>) -> Result<Arc<Clip>, ApiError> {
    let Some(given) = c.value(i).try_cast::<ClipRef>() else {
        return Err(c.wrong(i, "a Clip, as in asset.clip(\"name\")"));
    };
    c.build().used(&given.asset);
    if Arc::ptr_eq(&given.asset, asset) {
        return Ok(given.clip);
    }
    let key = (Arc::as_ptr(&given.clip) as usize, Arc::as_ptr(asset) as usize);
    if let Some(bound) = c.build().bound.get(&key) {
        return Ok(bound.clip.clone());
    }
    let (bound, missing) = bind_clip(&given.clip, &given.asset.skeleton, &asset.skeleton);
    let what = || format!("clip \"{}\" of \"{}\" on \"{}\"", given.clip.name, given.asset.name, asset.name);
    if bound.curves().is_empty() && bound.expressions().is_empty() && !given.clip.curves().is_empty() {
        let names = asset.skeleton.names().iter().map(String::as_str);
        return Err(ApiError::new(format!("{}: no joint has the same name", what()))
            .focus(given.clip.name.clone())
            .hint(format!(
                "animated: {}; on the actor: {}",
                list(missing.iter().map(String::as_str), 12),
                list(names, 12)
            )));
    }
    if !missing.is_empty() {
        let names = list(missing.iter().map(String::as_str), 12);
        let text = format!(
            "{}: {} animated joints have no partner of the same name: {names}",
            what(),
            missing.len()
        );
        c.shared.note(Severity::Warning, &c.place, &ApiError::new(text));
    }
    let bound = Arc::new(bound);
    c.build().bound.insert(key, Bound { clip: bound.clone(), _from: given.clip, _onto: asset.clone() });
    Ok(bound)
}
