//! Look-up of joints by name.

use crate::call::{ApiError, unknown_of};
use choreo_asset::Asset;

/// Index of a joint by its name, also without a prefix such as `mixamorig:`.
pub fn find_joint(asset: &Asset, name: &str) -> Result<u32, ApiError> {
    if let Some(joint) = asset.skeleton.find(name) {
        return Ok(joint as u32);
    }
    // `mixamorig:LeftHand` is found and suggested as `LeftHand`: with the prefix no misspelling would be similar.
    let bare = |full: &'_ str| -> usize {
        let tail = full.rfind([':', '|']).map_or(0, |at| at + 1);
        if asset.skeleton.find(&full[tail..]).is_some() { tail } else { 0 }
    };
    let names: Vec<&str> = asset.skeleton.names().iter().map(|n| &n[bare(n)..]).collect();
    // Short names are suggested as well: `hand.l` and `LeftHand` for `hand.l_Armature`.
    let heads = names.iter().filter_map(|full| full.rsplit_once('_')).map(|(head, _)| head);
    let short = asset.skeleton.short_names();
    let heads = heads.filter(|head| asset.skeleton.find(head).is_some());
    let taken: Vec<&str> =
        names.iter().copied().chain(short.iter().map(String::as_str)).chain(heads).collect();
    Err(unknown_of("joint", name, &format!(" in skeleton \"{}\"", asset.name), names, taken))
}
