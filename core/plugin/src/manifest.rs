//! What a plugin says of itself, as data: `choreo plugins`, `--help` and the script read it from here.

/// Borrowed from the plugin's own static text.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifest {
    /// As in `load(…, #{ importer: NAME })`, `effect(NAME)`: "gltf", "vignette", "png".
    pub name: &'static str,
    pub version: &'static str,
    /// One line.
    pub about: &'static str,
    /// Lower case, without the dot. Empty for effects.
    pub extensions: &'static [&'static str],
    /// First bytes of files that are certainly this format.
    pub magic: &'static [&'static [u8]],
    pub options: &'static [OptionSpec],
}

/// One option or effect parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct OptionSpec {
    pub name: &'static str,
    pub about: &'static str,
    pub kind: OptionKind,
}

#[derive(Clone, Debug, PartialEq)]
pub enum OptionKind {
    Number { default: f64, min: f64, max: f64 },
    Bool { default: bool },
    Text { default: &'static str, one_of: &'static [&'static str] },
}
