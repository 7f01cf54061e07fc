//! The idle clip that a character plays by default.

use choreo_asset::Asset;

/// Words in the names of idle clips, in order of preference.
const IDLE_WORDS: [&str; 3] = ["idle", "stand", "rest"];

/// Name of the idle clip, else of the first clip.
pub(super) fn idle_clip_name(asset: &Asset) -> Option<&str> {
    best_idle_name(asset.clips.iter().map(|clip| clip.name.as_str()))
}

/// The best name: one that ends with such a word and has the fewest other words, else one that contains such a word, else the first.
fn best_idle_name<'n>(names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    names.min_by_key(|name| {
        // Exporters prepend the armature: `Armature|Idle`.
        let own = name.rsplit(['|', ':', '/']).find(|part| !part.trim().is_empty()).unwrap_or(name);
        let words = split_words(own);
        let ends = IDLE_WORDS.iter().position(|word| words.last().is_some_and(|last| last == word));
        let contains = IDLE_WORDS.iter().position(|word| own.to_lowercase().contains(word));
        match (ends, contains) {
            (Some(word), _) => (0, words.len(), word),
            (None, Some(word)) => (1, 0, word),
            (None, None) => (2, 0, 0),
        }
    })
}

/// Lowercase words of a name without digits: `h`, `melee`, `idle` for `2H_Melee_Idle`; `sword`, `idle` for `SwordIdle`.
fn split_words(name: &str) -> Vec<String> {
    let (mut all, mut word, mut was_small) = (Vec::new(), String::new(), false);
    for c in name.chars().chain([' ']) {
        if !c.is_alphabetic() || (c.is_uppercase() && was_small) {
            all.extend((!word.is_empty()).then(|| std::mem::take(&mut word)));
        }
        if c.is_alphabetic() {
            word.extend(c.to_lowercase());
        }
        was_small = c.is_lowercase();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplest_idle_clip_is_chosen() {
        for (names, expected) in [
            (&["1H_Melee", "2H_Melee_Idle", "Idle", "Unarmed_Idle"][..], Some("Idle")),
            (&["Walk", "Armature|Sword_Idle", "Armature|IDLE"], Some("Armature|IDLE")),
            (&["Idle_Attack", "Sword Melee Idle", "SwordIdle"], Some("SwordIdle")),
            (&["Walk", "Idle_Attack", "idle.001"], Some("idle.001")),
            (&["Walk", "IdleAttack"], Some("IdleAttack")),
            (&["Rest", "Idle"], Some("Idle")),
            (&["Run", "Walk"], Some("Run")),
            (&[], None),
        ] {
            assert_eq!(best_idle_name(names.iter().copied()), expected, "{names:?}");
        }
    }
}
