//! `API.md` lists what is registered, in the words that users search for.

use choreo_script::help::{answer, search};

#[test]
fn the_reference_is_up_to_date() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/API.md");
    let expected = choreo_script::reference();
    if std::env::var_os("CHOREO_ACCEPT").is_some() {
        std::fs::write(path, &expected).unwrap();
    }
    let got = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        got == expected,
        "API.md is out of date; CHOREO_ACCEPT=1 cargo test --workspace --test reference writes it anew"
    );
}

/// Terms of Blender, Unity, Unreal and glTF for what a script can do, one line per topic.
const SEARCH_WORDS: &str = "
    inverse kinematics, (IK), foot locking, foot sliding, pole target
    keyframe, easing, Bézier, interpolation, NLA strip, timeline
    crossfade, fade-in, transition, phase matching, inertialized
    additive layer, mask, weight, blend
    root motion, in place, path following
    retarget, rest pose, bind pose, T-pose
    morph target, blend shape, shape key, viseme
    spring bone, jiggle, secondary motion, collider
    parent constraint, Child Of, look-at constraint, aim constraint
    field of view, focal length, dolly, crane, camera shake, orbit, follow, cut
    HDRI, image-based lighting, environment map, ambient occlusion, ambient light, shadow map
    tone mapping, exposure, bloom, motion blur, post-processing
    instancing, level of detail, (LOD), crowd, terrain, swarm
    depth peeling, multisample antialiasing, G-buffer, pre-skinning, parallax mapping
    marker, event, golden image, title
";

#[test]
fn search_words_lead_to_a_heading_or_an_entry() {
    let text = choreo_script::reference().to_lowercase();
    // "motion_blur" and "tone mapping" are one word each in code and in prose.
    let found = |word: &str| text.contains(word) || text.contains(&word.replace(' ', "_"));
    let words = SEARCH_WORDS.split([',', '\n']).map(|word| word.trim().to_lowercase());
    let missing: Vec<String> = words.filter(|word| !word.is_empty() && !found(word)).collect();
    assert!(missing.is_empty(), "the reference does not mention {missing:?}");
}

/// `choreo help TERM` answers each of the words, too: by a topic, an entry of that name, or entries that mention it.
#[test]
fn search_words_are_answered() {
    let words = SEARCH_WORDS.split([',', '\n']).map(|word| word.trim().trim_matches(['(', ')']));
    let known = |word: &str| !answer(word).calls.is_empty() || !search(word).calls.is_empty();
    let missing: Vec<&str> = words.filter(|word| !word.is_empty() && !known(word)).collect();
    assert!(missing.is_empty(), "without an answer: {missing:?}");
    assert!(!known("quaggaflux"));
}

/// `entries.txt` lists each function and method with its options: what is documented once stays.
#[test]
fn no_entry_and_no_option_is_lost() {
    let text = choreo_script::reference();
    let mut entries: Vec<String> = Vec::new();
    for line in text.lines() {
        match (line.starts_with("- `"), entries.last_mut()) {
            (false, Some(entry)) if line.starts_with("  - ") => entry.push_str(line),
            _ => entries.push(line.to_string()),
        }
    }
    let mut lost = Vec::new();
    for line in include_str!("entries.txt").lines() {
        let (name, options) = line.split_once(": ").unwrap_or((line, ""));
        let entry = entries.iter().find(|entry| entry.starts_with(&format!("- `{name}(")));
        match entry {
            None => lost.push(name.to_string()),
            Some(entry) => {
                let missing = options.split_whitespace().filter(|option| !entry.contains(option));
                lost.extend(missing.map(|option| format!("{name}: {option}")));
            }
        }
    }
    assert!(lost.is_empty(), "the reference lacks {lost:?}");
    assert!(!entries.iter().any(|entry| entry.contains("{}")), "options are not documented");
}
