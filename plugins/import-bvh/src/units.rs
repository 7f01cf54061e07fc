//! Guesses the unit of a BVH file, which does not state one: people are between one and two metres tall.

use crate::hierarchy::Joint;
use choreo_importer_kit::Notes;
use glam::DVec3;

/// Upper bound of the skeleton's largest extent in the file's units, metres a unit, name of the unit. A bound lies where both
/// neighboring guesses are equally far from a person's size, by ratio. The Carnegie Mellon captures have units of 1/0.45 inch.
const UNITS: [(f64, f64, &str); 5] = [
    (5.5, 1.0, "1 m"),
    (43.0, 0.0254 / 0.45, "1/0.45 inch, as in the Carnegie Mellon captures"),
    (105.0, 0.0254, "1 inch"),
    (520.0, 0.01, "1 cm"),
    (5200.0, 0.001, "1 mm"),
];

/// Guesses the metres in a unit. A warning states the guess.
pub(crate) fn guess(joints: &[Joint], notes: &Notes) -> f64 {
    let mut at: Vec<DVec3> = Vec::with_capacity(joints.len());
    for joint in joints {
        at.push(joint.parent.map_or(DVec3::ZERO, |p| at[p as usize]) + joint.offset);
    }
    let (min, max) =
        at.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), p| (min.min(*p), max.max(*p)));
    let size = (max - min).max_element();
    let (scale, text) = match UNITS.iter().find(|(bound, ..)| size < *bound) {
        _ if size <= 0.0 || !size.is_finite() => (0.01, "1 cm".to_string()),
        Some((_, scale, name)) => (*scale, name.to_string()),
        None => (1.75 / size, format!("{:.3e} m, so that it is 1.75 m", 1.75 / size)),
    };
    notes.warn(
        "HIERARCHY",
        format!("the format has no unit; taken as {text} by the skeleton's extent of {size:.4} (option scale: metres a unit)"),
    );
    scale
}
