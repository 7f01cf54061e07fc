//! Kinds of names that arguments and options accept, and where the names come from.

use crate::context::CallSite;
use crate::source::Source;
use crate::values::ScriptValue;

/// Kind of the name in a string.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NameKind {
    /// Models and clips, built-in ones included.
    Models,
    Images,
    Panoramas,
    Scripts,
    Fonts,
    /// Clips in the file of the receiver or of an argument.
    Clips,
    Joints,
    /// Joints followed by `..`, and patterns with `*`.
    JointPatterns,
    Morphs,
    Expressions,
    Materials,
    FileCameras,
    /// Meshes, and nodes that show a mesh.
    Parts,
    Effects,
    EffectParameters,
    /// Named times of the stage.
    Markers,
    ClipMarkers,
    Actors,
    Cameras,
    Importers,
    Colors,
}

/// Arguments that accept names: method or function, argument, kind of names.
const ARGUMENTS: &[(&str, &str, NameKind)] = &[
    ("load", "file", NameKind::Models),
    ("image", "file", NameKind::Images),
    ("picture", "image", NameKind::Images),
    ("sky", "panorama", NameKind::Panoramas),
    ("scene", "file", NameKind::Scripts),
    ("Asset.clip", "name_or_index", NameKind::Clips),
    ("Asset.camera", "name_or_index", NameKind::FileCameras),
    ("Actor.camera", "name_or_index", NameKind::FileCameras),
    ("Asset.texture", "material", NameKind::Materials),
    ("Clip.key", "joint", NameKind::Joints),
    ("Clip.offset", "joint", NameKind::Joints),
    ("Clip.travel", "joint", NameKind::Joints),
    ("Clip.contacts", "joints", NameKind::Joints),
    ("Clip.marker", "name", NameKind::ClipMarkers),
    ("Cue.time_of", "marker_or_time", NameKind::ClipMarkers),
    ("Cue.on", "joints", NameKind::JointPatterns),
    ("Actor.spring", "joints", NameKind::JointPatterns),
    ("Actor.joint", "name", NameKind::Joints),
    ("Actor.reach", "joint", NameKind::Joints),
    ("Actor.aim", "joint", NameKind::Joints),
    ("Actor.collider", "joint", NameKind::Joints),
    ("Actor.morph", "name", NameKind::Morphs),
    ("Actor.expression", "name", NameKind::Expressions),
    ("Actor.hide_parts", "names", NameKind::Parts),
    ("Expect.morph", "name", NameKind::Morphs),
    ("Expect.weight", "clip", NameKind::Clips),
    ("Expect.clip_time", "clip", NameKind::Clips),
    ("Expect.has_effect", "name", NameKind::Effects),
    ("Scene.actor", "name", NameKind::Actors),
    ("Scene.camera", "name", NameKind::Cameras),
    ("marker", "name", NameKind::Markers),
    ("effect", "name", NameKind::Effects),
    ("Effect.set", "parameter", NameKind::EffectParameters),
    ("Effect.key", "parameter", NameKind::EffectParameters),
];

/// Options that accept names, in any call.
const OPTIONS: &[(&str, NameKind)] = &[
    ("importer", NameKind::Importers),
    ("joint", NameKind::Joints),
    ("joints", NameKind::Joints),
    ("root", NameKind::Joints),
    ("center", NameKind::Joints),
    ("feet", NameKind::Joints),
    ("material", NameKind::Materials),
    ("font", NameKind::Fonts),
];

/// Kind of names that is accepted at the cursor.
pub(crate) fn accepted_names(source: &Source, site: &CallSite) -> Option<NameKind> {
    let entry = site.entry(source)?;
    if let Some((_, Some(key))) = site.maps.last() {
        let listed = OPTIONS.iter().find(|(option, _)| option == key).map(|(_, names)| *names);
        let is_color = || {
            let options = entry.options();
            let about = options.iter().find(|o| o.name == *key).map(|o| o.about.to_lowercase());
            key.contains("color") || about.is_some_and(|about| about.contains("a color"))
        };
        return listed.or_else(|| is_color().then_some(NameKind::Colors));
    }
    let argument = site.argument_name(source)?;
    if entry.full_name() == "Actor.key" && argument == "name" {
        let is_face = site.first_argument_text(source).as_deref() == Some("expression");
        return Some(if is_face { NameKind::Expressions } else { NameKind::Morphs });
    }
    // `Cue.on` is the only call with an argument that maps joints to weights.
    if site.at_key && !site.maps.is_empty() && entry.full_name() != "Cue.on" {
        return None;
    }
    let full = entry.full_name();
    let listed = ARGUMENTS.iter().find(|(name, of, _)| *name == full && *of == argument);
    listed.map(|(.., names)| *names).or_else(|| (argument == "color").then_some(NameKind::Colors))
}

/// The file that the receiver of a method comes from, in which names are looked up.
pub(crate) fn receiver_file(receiver: Option<&ScriptValue>) -> Option<String> {
    receiver.and_then(|value| value.file.clone())
}

/// Names that a script declares, as in `camera("wide")` or `.marker("top", 1.2)`: the first text in each call of a function.
pub(crate) fn declared_names(
    source: &Source,
    function: &str,
    arguments: usize,
    as_method: bool,
) -> Vec<String> {
    let mut found = Vec::new();
    for index in 0..source.tokens.len() {
        let is_method = matches!(source.token_before(index, 1), "." | "?.");
        if source.get(index) != function || source.get(index + 1) != "(" || is_method != as_method {
            continue;
        }
        let given = source.arguments(index + 1);
        if given.len() < arguments {
            continue;
        }
        found.extend(given.first().and_then(|first| source.string_value(first.start)));
    }
    found.sort();
    found.dedup();
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_script::describe;

    /// Each row names an argument or option that the API has.
    #[test]
    fn every_listed_argument_and_option_exists_in_the_api() {
        for (name, argument, _) in ARGUMENTS {
            let (on, short) = name.split_once('.').unwrap_or(("", name));
            let entry = describe::entry(on, short).unwrap_or_else(|| panic!("{name}"));
            assert!(entry.forms.iter().flatten().any(|known| known == argument), "{name}: {argument}");
        }
        for (option, _) in OPTIONS {
            let all = describe::entries().iter().flat_map(|entry| entry.options());
            assert!(all.into_iter().any(|known| known.name == *option), "{option}");
        }
    }
}
