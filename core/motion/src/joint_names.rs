//! Names of the same human joint in different families of skeletons: Mixamo, 3ds Max Biped (`Bip01`), VRM humanoid and KayKit.

use crate::skeleton::plain_name;

/// Joints of the middle, as each family calls them, without separators. The first name is ours.
const MIDDLE: &[&[&str]] = &[
    &["hips", "pelvis"],
    &["spine"],
    &["spine1", "chest"],
    &["spine2", "upperchest"],
    &["neck"],
    &["head"],
    &["jaw"],
];

/// Joints that are there on the left and on the right.
const SIDES: &[&[&str]] = &[
    &["shoulder", "clavicle", "collar"],
    &["arm", "upperarm", "uparm"],
    &["forearm", "lowerarm", "lowarm"],
    &["hand"],
    &["upleg", "thigh", "upperleg"],
    &["leg", "calf", "lowerleg", "lowleg", "shin"],
    &["foot"],
    &["toebase", "toe0", "toes"],
    &["eye"],
    // VRM's thumb is not in the table: 0.x and 1.0 call different bones "proximal".
    &["handthumb1", "finger0"],
    &["handthumb2", "finger01"],
    &["handthumb3", "finger02"],
    &["handindex1", "finger1", "indexproximal"],
    &["handindex2", "finger11", "indexintermediate"],
    &["handindex3", "finger12", "indexdistal"],
    &["handmiddle1", "finger2", "middleproximal"],
    &["handmiddle2", "finger21", "middleintermediate"],
    &["handmiddle3", "finger22", "middledistal"],
    &["handring1", "finger3", "ringproximal"],
    &["handring2", "finger31", "ringintermediate"],
    &["handring3", "finger32", "ringdistal"],
    &["handpinky1", "finger4", "littleproximal"],
    &["handpinky2", "finger41", "littleintermediate"],
    &["handpinky3", "finger42", "littledistal"],
];

/// One name for a joint whatever its family calls it: `mixamorig:LeftArm`, `Bip01 L UpperArm`, `leftUpperArm`, `J_Bip_L_UpperArm`
/// and `upperarm.l` are "left arm". `None` for joints that the table does not hold.
pub fn humanoid_name(name: &str) -> Option<String> {
    // Longer than any of the names, and the work stays bounded.
    if name.len() > 96 {
        return None;
    }
    let plain = plain_name(name);
    let mut words: Vec<&str> = plain.split([' ', '_', '.', '-']).filter(|w| !w.is_empty()).collect();
    let is_biped = |w: &str| w.strip_prefix("bip").is_some_and(|n| n.bytes().all(|b| b.is_ascii_digit()));
    if let ["j", "bip", ..] = words.as_slice() {
        words.drain(..2);
    } else if words.first().is_some_and(|w| is_biped(w)) {
        words.remove(0);
    }
    // What some exporters hang on every name.
    if words.last() == Some(&"armature") {
        words.pop();
    }
    let side_of = |w: &str| match w {
        "l" | "left" => Some("left"),
        "r" | "right" => Some("right"),
        _ => None,
    };
    let mut side = words.first().and_then(|w| side_of(w));
    if side.is_some() {
        words.remove(0);
    } else if let Some(last) = words.last().and_then(|w| side_of(w)) {
        side = Some(last);
        words.pop();
    } else if words.first() == Some(&"c") {
        words.remove(0);
    }
    let joined = words.concat();
    let mut base = joined.as_str();
    for word in ["left", "right"] {
        if side.is_none()
            && let Some(rest) = base.strip_prefix(word)
        {
            side = Some(word);
            base = rest;
        }
    }
    let table = if side.is_some() { SIDES } else { MIDDLE };
    let ours = table.iter().find(|names| names.contains(&base))?.first()?;
    Some(match side {
        Some(side) => format!("{side} {ours}"),
        None => ours.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_family_names_the_same_joints() {
        let rows: [&[&str]; 8] = [
            &[
                "hips",
                "mixamorig:Hips",
                "mixamorig1:Hips",
                "mixamorigHips",
                "Bip01 Pelvis",
                "hips",
                "J_Bip_C_Hips",
            ],
            &[
                "left arm",
                "mixamorig:LeftArm",
                "Bip01 L UpperArm",
                "Bip001_L_UpperArm",
                "leftUpperArm",
                "upperarm.l",
            ],
            &["right forearm", "mixamorigRightForeArm", "Bip01 R Forearm", "rightLowerArm", "lowerarm.r"],
            &["left upleg", "LeftUpLeg", "Bip01 L Thigh", "leftUpperLeg", "upperleg.l", "J_Bip_L_UpperLeg"],
            &["right leg", "RightLeg", "Bip01 R Calf", "rightLowerLeg", "lowerleg.r"],
            &["left toebase", "LeftToeBase", "Bip01 L Toe0", "leftToes", "toes.l"],
            &["spine1", "mixamorig:Spine1", "Bip01 Spine1", "chest"],
            &["right handindex2", "RightHandIndex2", "Bip01 R Finger11", "rightIndexIntermediate"],
        ];
        for row in rows {
            for name in row[1..].iter() {
                assert_eq!(humanoid_name(name).as_deref(), Some(row[0]), "{name}");
            }
        }
    }

    #[test]
    fn other_joints_are_not_guessed() {
        for name in [
            "",
            "Bip01",
            "l",
            "left",
            "Tail",
            "other_Hips",
            "handslot.l",
            "Root",
            "leftovers",
            "Bip01 L Finger5",
        ] {
            assert_eq!(humanoid_name(name), None, "{name}");
        }
    }
}
