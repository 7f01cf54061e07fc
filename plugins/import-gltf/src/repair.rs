//! Repairs valid glTF that the typed form (`gltf::json::Root`) refuses.

use crate::pointers::{self, Pointers};
use crate::problem::Problem;
use serde_json::Value;

/// Largest number up to which every integer is exact as f64. No index or count of a file is larger.
const MAX_WHOLE: f64 = (1u64 << 53) as f64;

/// A JSON number as an integer, where it is one. JSON does not distinguish the two, and some programs write `1.0` for 1.
pub(crate) fn as_integer(value: &Value) -> Option<u64> {
    value.as_u64().or_else(|| {
        let number = value.as_f64()?;
        (number.fract() == 0.0 && (0.0..=MAX_WHOLE).contains(&number)).then_some(number as u64)
    })
}

/// Parses a part of an extension, which the crate `gltf` keeps as JSON, into a type.
pub(crate) fn typed<T: serde::de::DeserializeOwned>(value: &Value) -> serde_json::Result<T> {
    let mut value = value.clone();
    write_whole_numbers(&mut value);
    serde_json::from_value(value)
}

/// Adds members that the specification allows files to omit, and writes integers without a fraction. Returns the pointers of
/// `KHR_animation_pointer` channels; `None` where nothing had to be changed.
pub(crate) fn repair(root: &mut Value) -> Option<Pointers> {
    let mut changed = false;
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut() {
            // glTF 2.0 §5.25: a scene without nodes is an empty one.
            scene.entry("nodes").or_insert_with(|| {
                changed = true;
                Value::Array(Vec::new())
            });
        }
    }
    changed |= write_whole_numbers(root);
    let pointers = pointers::mark_channels(root);
    (changed || pointers.is_some()).then(|| pointers.unwrap_or_default())
}

/// Writes integers without a fraction. True where any number changed. The explicit stack allows any depth that `serde_json`
/// accepts.
fn write_whole_numbers(root: &mut Value) -> bool {
    let mut changed = false;
    let mut open = vec![root];
    while let Some(value) = open.pop() {
        match value {
            Value::Array(list) => open.extend(list),
            Value::Object(map) => open.extend(map.values_mut()),
            Value::Number(number) if number.is_f64() => {
                // −0 stays, because as a float it differs from 0.
                if let Some(n) =
                    as_integer(value).filter(|_| value.as_f64().is_some_and(f64::is_sign_positive))
                {
                    *value = n.into();
                    changed = true;
                }
            }
            _ => {}
        }
    }
    changed
}

/// Refuses glTF 1.0 by name. Its elements are in objects instead of lists, which the typed form would report as an invalid type.
pub(crate) fn refuse_version_1(root: &Value) -> Result<(), Problem> {
    let version = root.get("asset").and_then(|a| a.get("version")).and_then(Value::as_str);
    match version {
        Some(version) if version.split('.').next() == Some("1") => Err(unsupported_version(version)),
        _ => Ok(()),
    }
}

/// The error for a glTF version that is not supported, with a hint.
pub(crate) fn unsupported_version(version: &str) -> Problem {
    let problem = Problem::new("asset.version", format!("glTF {version} is not supported, only 2.0"));
    problem.hint(match version.split('.').next() {
        Some("1") => CONVERT_1,
        _ => "convert the file to glTF 2.0",
    })
}

/// Hint in errors for glTF 1.0.
pub(crate) const CONVERT_1: &str =
    "convert the file to glTF 2.0, for example with `gltf-pipeline -i old.gltf -o new.glb`";

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn whole_numbers_are_parsed_in_any_notation() {
        let read = |text: &str| as_integer(&serde_json::from_str(text).unwrap());
        for (text, number) in [("1", 1), ("1.0", 1), ("1e3", 1000), ("0.0", 0), ("5126.000", 5126)] {
            assert_eq!(read(text), Some(number), "{text}");
        }
        for text in ["1.5", "-1", "-1.0", "1e300", "\"1\"", "null", "[1]"] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn repair_adds_missing_fields_and_changes_nothing_else() {
        let mut root = json!({"asset": {"version": "2.0"}, "scenes": [{}, {"nodes": [1.0]}],
            "nodes": [{"matrix": [1.0, -0.0, 0.5, 1e300]}]});
        assert_eq!(repair(&mut root), Some(Pointers::new()));
        assert_eq!(root["scenes"], json!([{"nodes": []}, {"nodes": [1]}]));
        let text = root["nodes"][0]["matrix"].to_string();
        assert_eq!(text, "[1,-0.0,0.5,1e+300]");
        assert_eq!(repair(&mut root), None, "once is enough");
    }
}
