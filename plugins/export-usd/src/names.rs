//! Names as identifiers (letters, digits and underscores) that are unique among siblings.

use std::collections::BTreeSet;

/// The name as an identifier: an underscore for each disallowed character, the code point for each letter of another script.
pub(crate) fn identifier(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        match c {
            'a'..='z' | 'A'..='Z' | '_' => out.push(c),
            '0'..='9' => {
                if out.is_empty() {
                    out.push('_');
                }
                out.push(c);
            }
            c if c.is_alphabetic() => out.push_str(&format!("u{:04x}", u32::from(c))),
            _ => out.push('_'),
        }
    }
    if out.is_empty() { "_".into() } else { out }
}

/// The identifiers that siblings have taken.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names(BTreeSet<String>);

impl Names {
    /// An identifier that no sibling has yet; it is taken from then on.
    pub(crate) fn add_unique(&mut self, name: &str) -> String {
        let bare = identifier(name);
        let mut name = bare.clone();
        let mut number = 2;
        while !self.0.insert(name.clone()) {
            name = format!("{bare}_{number}");
            number += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_unique_identifiers() {
        assert_eq!(identifier("mixamorig:Hips"), "mixamorig_Hips");
        assert_eq!(identifier("2 feet"), "_2_feet");
        assert_eq!(identifier("骨"), "u9aa8");
        let mut names = Names::default();
        assert_eq!(
            [names.add_unique("a b"), names.add_unique("a_b"), names.add_unique("")],
            ["a_b", "a_b_2", "_"]
        );
    }
}
