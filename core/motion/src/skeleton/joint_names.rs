//! Names of the same human joint in different families of skeletons.

use crate::skeleton::sides::split_words;
use crate::skeleton::without_rig_prefix;

/// Central joints with their names in each family, in lower case without separators. The first name is choreo's.
const CENTRAL_JOINT_NAMES: &[&[&str]] = &[
    &["hips", "pelvis", "hip"],
    &["spine", "spine01", "abdomen", "abdomenlower", "lowerback"],
    &["spine1", "chest", "spine02", "chestlower", "upperback"],
    &["spine2", "upperchest", "spine03", "chestupper", "thorax"],
    &["neck", "neck01", "necklower", "lowerneck", "necktwist01"],
    &["head"],
    &["jaw"],
];

/// Joints that exist on the left and on the right, with their names without the side.
const PAIRED_JOINT_NAMES: &[&[&str]] = &[
    &["shoulder", "clavicle", "collar", "collarbone"],
    &["arm", "upperarm", "uparm", "armupper", "shldr", "shldrbend", "humerus"],
    &["forearm", "lowerarm", "lowarm", "armlower", "forearmbend", "radius"],
    &["hand"],
    &["upleg", "thigh", "upperleg", "legupper", "thighbend", "femur"],
    &["leg", "calf", "lowerleg", "lowleg", "leglower", "shin", "tibia"],
    &["foot"],
    &["toebase", "toe0", "toes", "toe", "ball"],
    &["eye"],
    // VRM's thumb is not in the table: 0.x and 1.0 call different bones "proximal".
    &["handthumb1", "finger0", "thumb01", "thumb1"],
    &["handthumb2", "finger01", "thumb02", "thumb2"],
    &["handthumb3", "finger02", "thumb03", "thumb3"],
    &["handindex1", "finger1", "indexproximal", "index01", "index1", "findex01"],
    &["handindex2", "finger11", "indexintermediate", "index02", "index2", "findex02"],
    &["handindex3", "finger12", "indexdistal", "index03", "index3", "findex03"],
    &["handmiddle1", "finger2", "middleproximal", "middle01", "middle1", "mid1", "fmiddle01"],
    &["handmiddle2", "finger21", "middleintermediate", "middle02", "middle2", "mid2", "fmiddle02"],
    &["handmiddle3", "finger22", "middledistal", "middle03", "middle3", "mid3", "fmiddle03"],
    &["handring1", "finger3", "ringproximal", "ring01", "ring1", "fring01"],
    &["handring2", "finger31", "ringintermediate", "ring02", "ring2", "fring02"],
    &["handring3", "finger32", "ringdistal", "ring03", "ring3", "fring03"],
    &["handpinky1", "finger4", "littleproximal", "pinky01", "pinky1", "little1", "fpinky01"],
    &["handpinky2", "finger41", "littleintermediate", "pinky02", "pinky2", "little2", "fpinky02"],
    &["handpinky3", "finger42", "littledistal", "pinky03", "pinky3", "little3", "fpinky03"],
];

/// Words that a family puts before all of its joints: Source engine, VRoid, Character Creator, Rigify.
const FAMILY_PREFIXES: &[&[&str]] = &[&["valve", "biped"], &["j", "bip"], &["cc", "base"], &["def"]];

/// Choreo's name of a joint for its name in any family: `mixamorig:LeftArm`, `Bip01 L UpperArm`, `leftUpperArm`, `J_Bip_L_UpperArm`,
/// `upperarm.l`, `armUpper_L`, `DEF-upper_arm.L`, `lShldr` and `lhumerus` are "left arm". `None` for joints that the table does
/// not hold. The tests list the names of each family.
pub(crate) fn humanoid_name(name: &str) -> Option<String> {
    // All known names are shorter, and the work stays bounded.
    if name.len() > 96 {
        return None;
    }
    let owned = split_words(without_rig_prefix(name));
    let mut words: Vec<&str> = owned.iter().map(String::as_str).collect();
    for prefix in FAMILY_PREFIXES {
        if words.starts_with(prefix) {
            words.drain(..prefix.len());
        }
    }
    // 3ds Max Biped, with or without the number of the figure.
    if words.first() == Some(&"bip") {
        let number = words.get(1).is_some_and(|w| w.bytes().all(|b| b.is_ascii_digit()));
        words.drain(..1 + usize::from(number));
    }
    // Some exporters append this word to every name.
    if words.last() == Some(&"armature") {
        words.pop();
    }
    let side_word = |w: &str| match w {
        "l" | "left" => Some("left"),
        "r" | "right" => Some("right"),
        _ => None,
    };
    let side = words.iter().enumerate().find_map(|(at, w)| Some((at, side_word(w)?)));
    if let Some((at, side)) = side {
        words.remove(at);
        return choreo_name_with_side(side, &words.concat());
    }
    if words.first() == Some(&"c") {
        words.remove(0);
    }
    let base = words.concat();
    // Lower case throughout: "leftarm", "lhumerus".
    choreo_name(CENTRAL_JOINT_NAMES, &base).map(str::to_string).or_else(|| {
        let sides = [("left", "left"), ("right", "right"), ("l", "left"), ("r", "right")];
        sides.iter().find_map(|(prefix, side)| choreo_name_with_side(side, base.strip_prefix(prefix)?))
    })
}

fn choreo_name(table: &[&[&'static str]], base: &str) -> Option<&'static str> {
    table.iter().find(|names| names.contains(&base))?.first().copied()
}

fn choreo_name_with_side(side: &str, base: &str) -> Option<String> {
    Some(format!("{side} {}", choreo_name(PAIRED_JOINT_NAMES, base)?))
}

#[cfg(test)]
mod tests;
