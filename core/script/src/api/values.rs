//! Plain values of a script as data, and the names of what `Expect.count` counts.

use crate::test_data::{Count, PlanCount, Value};
use rhai::{Dynamic, Map};

pub(crate) const COUNTS: &[(&str, Count)] = &[
    ("actors", Count::Actors),
    ("cameras", Count::Cameras),
    ("cuts", Count::Cuts),
    ("lights", Count::Lights),
    ("effects", Count::Effects),
    ("layers", Count::Layers),
    ("cues", Count::Cues),
    ("callbacks", Count::Callbacks),
    ("assets", Count::Assets),
    ("joints", Count::Joints),
    ("triangles", Count::Triangles),
    ("vertices", Count::Vertices),
    ("frames", Count::Frames),
];

pub(crate) const PLAN_COUNTS: &[(&str, PlanCount)] = &[
    ("passes", PlanCount::Passes),
    ("post_passes", PlanCount::PostPasses),
    ("pipelines", PlanCount::Pipelines),
    ("draws", PlanCount::Draws),
    ("copies", PlanCount::Copies),
    ("triangles", PlanCount::Triangles),
    ("lights", PlanCount::Lights),
    ("joint_matrices", PlanCount::JointMatrices),
    ("morphs", PlanCount::Morphs),
    ("shadow_maps", PlanCount::ShadowMaps),
    ("overlay_triangles", PlanCount::OverlayTriangles),
];

/// Converts a plain value, arrays and maps of plain values included.
pub(crate) fn plain_value(v: &Dynamic, depth: usize) -> Option<Value> {
    // Maximum nesting: deeper values are not written by hand.
    const MAX_DEPTH: usize = 16;
    if depth > MAX_DEPTH {
        return None;
    }
    let v = v.flatten_clone();
    if v.is_unit() {
        return Some(Value::Nothing);
    }
    if let Ok(b) = v.as_bool() {
        return Some(Value::Bool(b));
    }
    if let Ok(n) = v.as_int() {
        return Some(Value::Int(n));
    }
    if let Ok(n) = v.as_float() {
        return Some(Value::Number(n));
    }
    if v.is_string() || v.is_char() {
        return Some(Value::Text(v.to_string()));
    }
    if let Some(array) = v.read_lock::<rhai::Array>() {
        return array.iter().map(|e| plain_value(e, depth + 1)).collect::<Option<_>>().map(Value::List);
    }
    if let Some(map) = v.read_lock::<Map>() {
        let pair = |(k, v): (&rhai::Identifier, &Dynamic)| Some((k.to_string(), plain_value(v, depth + 1)?));
        return map.iter().map(pair).collect::<Option<_>>().map(Value::Map);
    }
    None
}
