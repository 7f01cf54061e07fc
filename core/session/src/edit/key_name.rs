//! Names of keyed properties, and the calls that state their keys.

use super::key_list::arguments;
use super::scan::{Call, Source};
use choreo_script::quoted;
use choreo_stage::Cue;

/// Methods of a cue and of its layer that state keys.
fn keyed_methods() -> impl Iterator<Item = &'static str> {
    Cue::keyed_options().map(|(name, _)| name).chain(["layer_weight"])
}

/// Whether copied text holds keys of a cue, which a method of the cue states.
pub fn are_keys_of_cue(text: &str) -> bool {
    keyed_methods().any(|method| starts_with_call(text, method))
}

/// Whether copied text holds keys.
pub fn are_keys(text: &str) -> bool {
    are_keys_of_cue(text) || ["key", "joint"].iter().any(|method| starts_with_call(text, method))
}

/// Whether a text starts with `.method(`.
fn starts_with_call(text: &str, method: &str) -> bool {
    text.strip_prefix('.')
        .and_then(|text| text.strip_prefix(method))
        .is_some_and(|rest| rest.starts_with('('))
}

/// A keyed property, parsed from its name: `position`, `morph:smile`, `joint:Head:rotation`, or `.weight` for a method of a cue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum KeyName<'p> {
    Property(&'p str),
    /// Weight of a morph target or an expression.
    Weight {
        of: &'p str,
        name: &'p str,
    },
    Joint {
        joint: &'p str,
        property: &'p str,
    },
    Method(&'p str),
}

impl<'p> KeyName<'p> {
    pub(super) fn of(name: &'p str) -> KeyName<'p> {
        if let Some(method) = name.strip_prefix('.') {
            return KeyName::Method(method);
        }
        match name.split_once(':') {
            Some(("joint", rest)) => match rest.rsplit_once(':') {
                Some((joint, property)) => KeyName::Joint { joint, property },
                None => KeyName::Property(name),
            },
            Some((of, name)) => KeyName::Weight { of, name },
            None => KeyName::Property(name),
        }
    }

    /// Number of arguments before the list of keys.
    pub(super) fn leading_argument_count(self) -> usize {
        match self {
            KeyName::Method(_) => 0,
            KeyName::Property(_) | KeyName::Joint { .. } => 1,
            KeyName::Weight { .. } => 2,
        }
    }

    /// Text of the call up to the list of keys.
    pub(super) fn call_opening(self) -> String {
        match self {
            KeyName::Property(property) => format!("key({}, ", quoted(property)),
            KeyName::Weight { of, name } => format!("key({}, {}, ", quoted(of), quoted(name)),
            KeyName::Joint { joint, property } => {
                format!("joint({}).key({}, ", quoted(joint), quoted(property))
            }
            KeyName::Method(method) => format!("{method}("),
        }
    }

    /// Name of the property in messages.
    pub(super) fn display_name(self) -> String {
        match self {
            KeyName::Property(name) => name.to_string(),
            KeyName::Method(name) => name.replace('_', " "),
            KeyName::Weight { of, name } => format!("{of}:{name}"),
            KeyName::Joint { joint, property } => format!("{joint} {property}"),
        }
    }
}

/// Content of an argument that is a string literal.
fn string_argument(text: &Source, call: &Call, index: usize) -> Option<String> {
    let arguments = arguments(text, call);
    let argument = text[arguments.get(index)?.clone()].trim();
    Some(argument.strip_prefix('"')?.strip_suffix('"')?.replace("\\\"", "\"").replace("\\\\", "\\"))
}

/// Property of a `.key(…)`, prefixed by `morph:` or `expression:` for a weight.
pub(super) fn property_of(text: &Source, call: &Call) -> Option<String> {
    let property = string_argument(text, call, 0)?;
    match property.as_str() {
        "morph" | "expression" => Some(format!("{property}:{}", string_argument(text, call, 1)?)),
        _ => Some(property),
    }
}

/// Whether a call states keys as a method of a cue: `.weight([[…]])`.
pub(super) fn is_keyed_method(text: &Source, call: &Call, method: &str) -> bool {
    text[call.name.clone()] == *method && text[text.next_token_start(call.inside.start)..].starts_with('[')
}

/// The call in copied text that holds the keys, and the name of its property.
pub(super) fn copied_call(text: &Source) -> Option<(Call, String)> {
    let call = text.starts_with('.').then(|| text.call_from(0)).flatten()?;
    match &text[call.name.clone()] {
        "key" => property_of(text, &call).map(|property| (call, property)),
        "joint" => {
            let joint = string_argument(text, &call, 0)?;
            let call = text.call_from(call.end).filter(|call| text[call.name.clone()] == *"key")?;
            let property = property_of(text, &call)?;
            Some((call, format!("joint:{joint}:{property}")))
        }
        method if keyed_methods().any(|keyed| keyed == method) => {
            let name = format!(".{method}");
            Some((call, name))
        }
        _ => None,
    }
}

/// A `.key(…)` of a joint.
#[derive(Clone)]
pub(super) struct JointKey {
    /// Name of the joint as in the script.
    pub joint: String,
    pub call: Call,
    /// The `joint(…)` call directly before `.key(…)`. `None` after another key or on a variable.
    pub of: Option<Call>,
}

/// Keys of a joint in an actor's chain that begins at a byte, including those on the variable that holds the joint.
pub(super) fn joint_keys(text: &Source, at: usize, chain: &[Call]) -> Vec<JointKey> {
    let Some(index) = chain.iter().position(|call| text[call.name.clone()] == *"joint") else {
        return Vec::new();
    };
    let Some(joint) = string_argument(text, &chain[index], 0) else { return Vec::new() };
    let of = |chain: &[Call], before: Option<&Call>| -> Vec<JointKey> {
        let keys = chain.iter().filter(|call| text[call.name.clone()] == *"key");
        let is_next = |call: &Call| before.filter(|of| text[of.end..call.name.start].trim() == ".").cloned();
        keys.map(|call| JointKey { joint: joint.clone(), call: call.clone(), of: is_next(call) }).collect()
    };
    let mut all = of(&chain[index + 1..], Some(&chain[index]));
    if let Some(variable) = text.variable_before(at) {
        let later = text.chains_of(variable, at).into_iter().filter(|(later, _)| *later > at);
        all.extend(later.flat_map(|(_, chain)| of(&chain, None)));
    }
    all
}
