//! Look-up of joints by name.

use crate::call::{ApiError, unknown_of};
use crate::suggest::list;
use choreo_asset::Asset;

/// Index of a joint by its name, also without a prefix such as `mixamorig:`.
pub(super) fn find_joint(asset: &Asset, name: &str) -> Result<u32, ApiError> {
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

/// The joints that a pattern selects, a name or a text with `*`, and whether it ends in `..`, which adds all joints below them.
pub(super) fn joints_of_pattern(asset: &Asset, pattern: &str) -> Result<(Vec<u32>, bool), ApiError> {
    let (name, includes_subtree) = pattern.strip_suffix("..").map_or((pattern, false), |name| (name, true));
    if !name.contains('*') {
        let joint = find_joint(asset, name).map_err(|e| e.focus(pattern))?;
        return Ok((vec![joint], includes_subtree));
    }
    let names = asset.skeleton.names();
    let matching = (0..).zip(names).filter(|(_, given)| matches_wildcards(name, given));
    let joints: Vec<u32> = matching.map(|(joint, _)| joint).collect();
    if joints.is_empty() {
        let error = format!("no joint of skeleton \"{}\" matches \"{pattern}\"", asset.name);
        let names = list(names.iter().map(String::as_str), 24);
        return Err(ApiError::new(error).focus(pattern).hint(format!("joints: {names}")));
    }
    Ok((joints, includes_subtree))
}

/// Whether a pattern of `*` (any characters) and plain letters matches the whole text, ignoring ASCII case. Greedy with
/// backtracking to the last `*`, so the time is at most the product of the lengths.
pub(super) fn matches_wildcards(pattern: &str, text: &str) -> bool {
    let (pattern, text) = (pattern.as_bytes(), text.as_bytes());
    let (mut p, mut t, mut star) = (0, 0, None);
    while t < text.len() {
        if p < pattern.len() && pattern[p] == b'*' {
            star = Some((p, t));
            p += 1;
        } else if p < pattern.len() && pattern[p].eq_ignore_ascii_case(&text[t]) {
            p += 1;
            t += 1;
        } else if let Some((at, from)) = star {
            star = Some((at, from + 1));
            p = at + 1;
            t = from + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == b'*')
}

#[cfg(test)]
mod tests {
    use super::matches_wildcards;

    #[test]
    fn patterns_match_the_whole_name_in_any_case() {
        for (pattern, text) in [
            ("*Arm*", "LeftForeArm"),
            ("left*", "LeftForeArm"),
            ("*", ""),
            ("*hair*", "hair_front_1"),
            ("hair*", "hair"),
            ("t*3", "tail3"),
            ("ab*ba", "abba"),
        ] {
            assert!(matches_wildcards(pattern, text), "{pattern} {text}");
        }
        for (pattern, text) in
            [("*Arm", "LeftArmTwist"), ("a*b*c", "abbd"), ("*hair*", "head"), ("ab*ba", "aba")]
        {
            assert!(!matches_wildcards(pattern, text), "{pattern} {text}");
        }
    }
}
