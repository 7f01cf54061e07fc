//! What a plugin says of itself, as data: `choreo plugins`, `--help` and the script read it from here.

use crate::OptionValue;

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

impl Manifest {
    /// Reads `text` as a value of the option `name`; the error says what is allowed.
    pub fn parse_option(&self, name: &str, text: &str) -> Result<OptionValue, String> {
        let Some(spec) = self.options.iter().find(|o| o.name == name) else {
            let known: Vec<&str> = self.options.iter().map(|o| o.name).collect();
            return Err(match known.is_empty() {
                true => format!("{} has no options, so no \"{name}\"", self.name),
                false => format!("{} has no option \"{name}\"; it knows {}", self.name, known.join(", ")),
            });
        };
        match &spec.kind {
            OptionKind::Number { min, max, .. } => match text.parse::<f64>() {
                Ok(v) if (*min..=*max).contains(&v) => Ok(OptionValue::Number(v)),
                _ => Err(format!("{name} is a number from {min} to {max}, not \"{text}\"")),
            },
            OptionKind::Bool { .. } => match text {
                "true" => Ok(OptionValue::Bool(true)),
                "false" => Ok(OptionValue::Bool(false)),
                _ => Err(format!("{name} is true or false, not \"{text}\"")),
            },
            OptionKind::Text { one_of, .. } if one_of.is_empty() || one_of.contains(&text) => {
                Ok(OptionValue::Text(text.to_string()))
            }
            OptionKind::Text { one_of, .. } => {
                Err(format!("{name} is one of {}, not \"{text}\"", one_of.join(", ")))
            }
        }
    }
}
