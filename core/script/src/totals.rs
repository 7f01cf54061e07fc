//! Limits on totals over all actors, which no single call can check.

use crate::api_error::{ApiError, Place};
use crate::build::StageDraft;
use crate::limits::{Limits, raise_hint};
use choreo_asset::{Asset, Image};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The error that a total over all actors exceeds its limit, at the place of the first actor with which it does.
pub(crate) fn error_of_totals(stage_draft: &StageDraft, limits: &Limits) -> Option<(Place, ApiError)> {
    let mut sums = [
        ("joints", limits.joints, 0u64),
        ("instances", limits.instances, 0),
        ("vertices", limits.vertices, 0),
        ("texels", limits.texels, 0),
    ];
    let mut seen: BTreeSet<*const Image> = BTreeSet::new();
    for draft in &stage_draft.actors {
        let asset = &draft.actor.asset;
        let more = [
            asset.skeleton.len() as u64,
            asset.instances.iter().map(|i| asset.times(i) as u64).fold(0, u64::saturating_add),
            vertices(asset),
            asset.images.iter().filter(|i| seen.insert(Arc::as_ptr(i))).map(|i| texels(i)).sum(),
        ];
        for ((name, limit, sum), more) in sums.iter_mut().zip(more) {
            *sum = sum.saturating_add(more);
            if *sum > *limit {
                let error = ApiError::new(format!(
                    "the actors up to \"{}\" have too many {}, {sum} together",
                    draft.actor.name,
                    display_name(name)
                ));
                return Some((draft.at.clone(), error.hint(raise_hint(name, limit))));
            }
        }
    }
    None
}

/// Name of a limit in messages.
fn display_name(name: &str) -> &str {
    match name {
        "instances" => "meshes",
        "texels" => "pixels in textures",
        other => other,
    }
}

fn vertices(asset: &Asset) -> u64 {
    let of_mesh = |mesh: u32| -> u64 {
        let primitives = asset.meshes.get(mesh as usize).map_or(&[][..], |m| &m.primitives);
        primitives.iter().map(|p| p.positions.len() as u64).sum()
    };
    asset
        .instances
        .iter()
        .map(|i| of_mesh(i.mesh).saturating_mul(asset.times(i) as u64))
        .fold(0, u64::saturating_add)
}

/// Number of pixels of an image.
pub(crate) fn texels(image: &Image) -> u64 {
    u64::from(image.width) * u64::from(image.height)
}
