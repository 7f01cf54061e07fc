//! Easings in scripts: names and Bézier curves.

use crate::call::{ApiError, numbers, wrong};
use crate::suggest::{did_you_mean, list};
use choreo_motion::{Ease, Shape};
use rhai::Dynamic;

/// The names of all easings, as scripts write them.
pub fn easing_names() -> Vec<String> {
    let ways = ["in_out_", "in_", "out_"];
    let shaped = ways.iter().flat_map(|way| Shape::ALL.iter().map(move |(name, _)| format!("{way}{name}")));
    ["linear", "smooth"].into_iter().map(str::to_string).chain(shaped).collect()
}

/// Reads an easing: a name, `in_out_cubic`, or the control points of a Bézier curve, `[x1, y1, x2, y2]`.
pub(crate) fn ease_of(value: &Dynamic, label: &str) -> Result<Ease, ApiError> {
    if let Some(points) = numbers(value) {
        let bezier = <[f64; 4]>::try_from(points).ok().filter(|p| p.iter().all(|v| (0.0..=1.0).contains(v)));
        return bezier
            .map(Ease::Bezier)
            .ok_or_else(|| wrong(value, label, "[x1, y1, x2, y2] with numbers from 0 to 1"));
    }
    let name = crate::call::text(value, label)?;
    match name.as_str() {
        "linear" => return Ok(Ease::Linear),
        "smooth" => return Ok(Ease::Smooth),
        _ => {}
    }
    type Way = fn(Shape) -> Ease;
    let ways: [(&str, Way); 3] = [("in_out_", Ease::InOut), ("in_", Ease::In), ("out_", Ease::Out)];
    for (prefix, way) in ways {
        let shape = name.strip_prefix(prefix).and_then(|rest| Shape::ALL.iter().find(|(n, _)| *n == rest));
        if let Some((_, shape)) = shape {
            return Ok(way(*shape));
        }
    }
    let names = easing_names();
    let names = names.iter().map(String::as_str);
    Err(ApiError::new(format!("{label}: unknown ease \"{name}\"{}", did_you_mean(&name, names.clone())))
        .focus(name.clone())
        .hint(format!("known: {}, or a Bézier curve, [x1, y1, x2, y2]", list(names, 30))))
}
