//! Kinds of names that arguments and options accept, and where the names come from.

use crate::context::CallSite;
use crate::source::Source;
use crate::values::Value;

/// Kind of the name in a string.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Names {
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
const ARGUMENTS: &[(&str, &str, Names)] = &[
    ("load", "file", Names::Models),
    ("image", "file", Names::Images),
    ("picture", "image", Names::Images),
    ("sky", "panorama", Names::Panoramas),
    ("scene", "file", Names::Scripts),
    ("Asset.clip", "name_or_index", Names::Clips),
    ("Asset.camera", "name_or_index", Names::FileCameras),
    ("Actor.camera", "name_or_index", Names::FileCameras),
    ("Asset.texture", "material", Names::Materials),
    ("Clip.key", "joint", Names::Joints),
    ("Clip.offset", "joint", Names::Joints),
    ("Clip.travel", "joint", Names::Joints),
    ("Clip.contacts", "joints", Names::Joints),
    ("Clip.marker", "name", Names::ClipMarkers),
    ("Cue.time_of", "marker_or_time", Names::ClipMarkers),
    ("Cue.on", "joints", Names::JointPatterns),
    ("Actor.spring", "joints", Names::JointPatterns),
    ("Actor.joint", "name", Names::Joints),
    ("Actor.reach", "joint", Names::Joints),
    ("Actor.aim", "joint", Names::Joints),
    ("Actor.collider", "joint", Names::Joints),
    ("Actor.morph", "name", Names::Morphs),
    ("Actor.expression", "name", Names::Expressions),
    ("Actor.hide_parts", "names", Names::Parts),
    ("Expect.morph", "name", Names::Morphs),
    ("Expect.weight", "clip", Names::Clips),
    ("Expect.clip_time", "clip", Names::Clips),
    ("Expect.has_effect", "name", Names::Effects),
    ("Scene.actor", "name", Names::Actors),
    ("Scene.camera", "name", Names::Cameras),
    ("marker", "name", Names::Markers),
    ("effect", "name", Names::Effects),
    ("Effect.set", "parameter", Names::EffectParameters),
    ("Effect.key", "parameter", Names::EffectParameters),
];

/// Options that accept names, in any call.
const OPTIONS: &[(&str, Names)] = &[
    ("importer", Names::Importers),
    ("joint", Names::Joints),
    ("joints", Names::Joints),
    ("root", Names::Joints),
    ("center", Names::Joints),
    ("feet", Names::Joints),
    ("material", Names::Materials),
    ("font", Names::Fonts),
];

/// Kind of names that is accepted at the cursor.
pub fn names(source: &Source, site: &CallSite) -> Option<Names> {
    let entry = site.entry(source)?;
    if let Some((_, Some(key))) = site.maps.last() {
        let listed = OPTIONS.iter().find(|(option, _)| option == key).map(|(_, names)| *names);
        let is_color = || {
            let options = entry.options();
            let about = options.iter().find(|o| o.name == *key).map(|o| o.about.to_lowercase());
            key.contains("color") || about.is_some_and(|about| about.contains("a color"))
        };
        return listed.or_else(|| is_color().then_some(Names::Colors));
    }
    let argument = site.argument_name(source)?;
    if entry.full_name() == "Actor.key" && argument == "name" {
        let is_face = site.first_text(source).as_deref() == Some("expression");
        return Some(if is_face { Names::Expressions } else { Names::Morphs });
    }
    // `Cue.on` is the only call with an argument that maps joints to weights.
    if site.at_key && !site.maps.is_empty() && entry.full_name() != "Cue.on" {
        return None;
    }
    let full = entry.full_name();
    let listed = ARGUMENTS.iter().find(|(name, of, _)| *name == full && *of == argument);
    listed.map(|(.., names)| *names).or_else(|| (argument == "color").then_some(Names::Colors))
}

/// The file in which names are looked up: that of the receiver.
pub(crate) fn file_of(on: Option<&Value>) -> Option<String> {
    on.and_then(|value| value.file.clone())
}

/// Names that a script declares, as in `camera("wide")` or `.marker("top", 1.2)`: the first text in each call of a function.
pub fn declared_names(source: &Source, function: &str, arguments: usize, as_method: bool) -> Vec<String> {
    let mut found = Vec::new();
    for index in 0..source.tokens.len() {
        let is_method = matches!(source.before(index, 1), "." | "?.");
        if source.get(index) != function || source.get(index + 1) != "(" || is_method != as_method {
            continue;
        }
        let given = source.arguments(index + 1);
        if given.len() < arguments {
            continue;
        }
        found.extend(given.first().and_then(|first| source.string(first.start)));
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
    fn the_tables_name_what_the_api_has() {
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
