//! Left and right joints, by their names.

use crate::skeleton::joint_names::humanoid_name;

/// A side of the body, from the character's own view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// The character's left.
    Left,
    /// The character's right.
    Right,
}

impl Side {
    /// The opposite side.
    pub fn other(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        }
    }
}

/// The side of a joint and its name without it: `mixamorig:LeftArm`, `Bip01 L UpperArm`, `upperarm.l`, `J_Bip_L_UpperArm`, `lShldr`
/// and `arm_joint_L_1` are left. The first word that is `l`, `left`, `r` or `right` counts; words end at punctuation, at
/// digits and where capitals begin. `None` for central joints, and for names of more than 96 bytes.
pub fn side_of(name: &str) -> Option<(Side, String)> {
    if name.len() > 96 {
        return None;
    }
    let words = split_words(name);
    let side = |word: &str| match word {
        "l" | "left" => Some(Side::Left),
        "r" | "right" => Some(Side::Right),
        _ => None,
    };
    if let Some((at, side)) = words.iter().enumerate().find_map(|(i, w)| side(w).map(|s| (i, s))) {
        let rest: Vec<&str> =
            words.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, w)| w.as_str()).collect();
        return (!rest.is_empty()).then(|| (side, rest.join(" ")));
    }
    // `leftarm` in lower case is a left joint only if the rest is a known joint.
    let human = humanoid_name(name)?;
    let (side_word, rest) = human.split_once(' ')?;
    Some((side(side_word)?, rest.to_string()))
}

/// Splits a name into words in lower case; `UpperArm01.L` is `upper`, `arm`, `01`, `l`.
pub(crate) fn split_words(name: &str) -> Vec<String> {
    #[derive(PartialEq)]
    enum CharacterClass {
        Upper,
        Lower,
        Digit,
    }
    let mut words = Vec::new();
    let mut word = String::new();
    let mut before: Option<CharacterClass> = None;
    let mut letters = name.chars().peekable();
    while let Some(c) = letters.next() {
        if !c.is_alphanumeric() {
            words.push(std::mem::take(&mut word));
            before = None;
            continue;
        }
        let kind = if c.is_numeric() {
            CharacterClass::Digit
        } else if c.is_uppercase() {
            CharacterClass::Upper
        } else {
            CharacterClass::Lower
        };
        let next_is_small = letters.peek().is_some_and(|n| n.is_lowercase());
        let ends = match (&before, &kind) {
            (None, _) => false,
            // `HTMLText`: the last capital begins the next word.
            (Some(CharacterClass::Upper), CharacterClass::Upper) => next_is_small,
            (Some(CharacterClass::Upper), CharacterClass::Lower) => false,
            (Some(before), kind) => before != kind,
        };
        if ends {
            words.push(std::mem::take(&mut word));
        }
        word.extend(c.to_lowercase());
        before = Some(kind);
    }
    words.push(word);
    words.retain(|w| !w.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_recognized_in_every_naming_family() {
        for (left, right) in [
            ("mixamorig:LeftHandThumb1", "mixamorig:RightHandThumb1"),
            ("mixamorigLeftArm", "mixamorigRightArm"),
            ("Bip01 L UpperArm", "Bip01 R UpperArm"),
            ("upperarm.l", "upperarm.r"),
            ("UpperArm_L", "UpperArm_R"),
            ("Arm.L_12", "Arm.R_12"),
            ("J_Bip_L_UpperArm", "J_Bip_R_UpperArm"),
            ("leftUpperArm", "rightUpperArm"),
            ("lShldr", "rShldr"),
            ("LHipJoint", "RHipJoint"),
            ("leg_joint_L_1", "leg_joint_R_1"),
            ("leftarm", "rightarm"),
            ("control-toe-roll.l", "control-toe-roll.r"),
        ] {
            let (l, r) = (side_of(left), side_of(right));
            assert_eq!(l.as_ref().map(|s| s.0), Some(Side::Left), "{left}");
            assert_eq!(r.as_ref().map(|s| s.0), Some(Side::Right), "{right}");
            assert_eq!(l.map(|s| s.1), r.map(|s| s.1));
        }
        for middle in ["", "l", "R", "Hips", "leftovers", "Bip01 Spine", "Brightness", "lefthanded", "Tail"] {
            assert_eq!(side_of(middle), None, "{middle}");
        }
    }
}
