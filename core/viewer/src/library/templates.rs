//! Templates for new scripts.

/// A template for a new script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Template {
    pub name: &'static str,
    /// Description in one sentence.
    pub about: &'static str,
    pub text: &'static str,
}

pub const TEMPLATES: [Template; 4] = [
    Template {
        name: "Empty stage",
        about: "A ground, a sun and a camera; drop models onto it.",
        text: include_str!("templates/empty.rhai"),
    },
    Template {
        name: "One character",
        about: "The built-in character, who walks and then waves.",
        text: include_str!("templates/character.rhai"),
    },
    Template {
        name: "Dialogue",
        about: "Two characters who face each other, with a camera for each and cuts between them.",
        text: include_str!("templates/dialogue.rhai"),
    },
    Template {
        name: "Turntable",
        about: "A camera that circles the object in the middle, under studio light.",
        text: include_str!("templates/turntable.rhai"),
    },
];
