//! Parameters of effects as numbers: an effect receives all of them in one array, each as one number or several.
//!
//! | type | numbers | names of the numbers |
//! |---|---|---|
//! | number, integer | 1 | `NAME` |
//! | true or false | 1: 0 or 1 | `NAME` |
//! | text | 1: index among the allowed texts | `NAME` |
//! | color | 3, linear | `NAME_r`, `NAME_g`, `NAME_b` |
//! | vector | 2 to 4 | `NAME_x`, `NAME_y`, `NAME_z`, `NAME_w` |
//! | curve | 16 samples, [`curve_table`] | `NAME_0` to `NAME_15` |
//! | texture | none | |

use crate::{Manifest, OptionKind, OptionSpec};

/// Largest number of numbers that the parameters of one effect take together.
pub const MAX_PARAMETER_NUMBERS: usize = 64;

/// Samples of a curve, at x = 0, 1/15, … 1.
pub const CURVE_SAMPLES: usize = 16;

/// Largest number of keys of a curve.
pub const MAX_CURVE_KEYS: usize = 64;

const COLOR_SUFFIXES: [&str; 3] = ["_r", "_g", "_b"];
const VECTOR_SUFFIXES: [&str; 4] = ["_x", "_y", "_z", "_w"];
const CURVE_SUFFIXES: [&str; CURVE_SAMPLES] =
    ["_0", "_1", "_2", "_3", "_4", "_5", "_6", "_7", "_8", "_9", "_10", "_11", "_12", "_13", "_14", "_15"];

/// Whether keys `[x, y]` are a curve: 1 to [`MAX_CURVE_KEYS`] of them, x from 0 to 1 and growing, y finite.
///
/// ```
/// use choreo_plugin::parameters::is_curve;
/// assert!(is_curve(&[[0.0, 5.0], [1.0, -5.0]]) && !is_curve(&[[1.0, 0.0], [0.5, 0.0]]) && !is_curve(&[]));
/// ```
pub fn is_curve(keys: &[[f64; 2]]) -> bool {
    (1..=MAX_CURVE_KEYS).contains(&keys.len())
        && keys.iter().all(|[x, y]| (0.0..=1.0).contains(x) && y.is_finite())
        && keys.windows(2).all(|pair| pair[0][0] < pair[1][0])
}

/// A curve through keys `[x, y]`: straight between two keys, level before the first and after the last; 0 without keys.
///
/// ```
/// use choreo_plugin::parameters::curve_at;
/// assert_eq!(curve_at(&[[0.0, 1.0], [0.5, 3.0]], 0.25), 2.0);
/// ```
pub fn curve_at(keys: &[[f64; 2]], x: f64) -> f64 {
    let after = keys.partition_point(|key| key[0] <= x);
    match (after.checked_sub(1).map(|i| keys[i]), keys.get(after)) {
        (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * ((x - x0) / (x1 - x0)),
        (Some([_, y]), None) | (None, Some(&[_, y])) => y,
        (None, None) => 0.0,
    }
}

/// Samples of [`curve_at`] at x = 0, 1/15, … 1. Effects read straight lines between them: a key whose slope changes by `d` is off by
/// at most `d` / 60, and by nothing where its x is a multiple of 1/15.
///
/// ```
/// use choreo_plugin::parameters::curve_table;
/// let table = curve_table(&[[0.0, 0.0], [1.0, 30.0]]);
/// assert_eq!((table[0], table[1], table[15]), (0.0, 2.0, 30.0));
/// ```
pub fn curve_table(keys: &[[f64; 2]]) -> [f64; CURVE_SAMPLES] {
    std::array::from_fn(|i| curve_at(keys, i as f64 / (CURVE_SAMPLES - 1) as f64))
}

impl OptionSpec {
    /// Suffixes of the names of the option's numbers; one empty suffix for a single number.
    fn suffixes(&self) -> &'static [&'static str] {
        match &self.kind {
            OptionKind::Color { .. } => &COLOR_SUFFIXES,
            OptionKind::Vector { default, .. } => {
                &VECTOR_SUFFIXES[..default.len().min(VECTOR_SUFFIXES.len())]
            }
            OptionKind::Curve { .. } => &CURVE_SUFFIXES,
            OptionKind::Texture { .. } => &[],
            _ => &[""],
        }
    }

    /// Names of the numbers that an effect receives for the option.
    ///
    /// ```
    /// let manifest = choreo_plugin::Manifest::new("glow", "1", "").color("tint", "its color", [1.0, 0.5, 0.0]);
    /// assert!(manifest.options[0].number_names().eq(["tint_r", "tint_g", "tint_b"]));
    /// ```
    pub fn number_names(&self) -> impl Iterator<Item = String> {
        self.suffixes().iter().map(|ending| format!("{}{ending}", self.name))
    }

    /// Number of numbers that an effect receives for the option.
    pub fn number_count(&self) -> usize {
        self.suffixes().len()
    }

    /// Index of the number with this name among the option's numbers.
    pub fn number_of(&self, name: &str) -> Option<usize> {
        let ending = name.strip_prefix(self.name.as_str())?;
        self.suffixes().iter().position(|e| *e == ending)
    }

    /// Smallest and largest value of the option's numbers; `None` for flags, texts and textures.
    pub fn bounds(&self) -> Option<[f64; 2]> {
        match &self.kind {
            OptionKind::Number { min, max, .. }
            | OptionKind::Vector { min, max, .. }
            | OptionKind::Curve { min, max, .. } => Some([*min, *max]),
            OptionKind::Integer { min, max, .. } => Some([*min as f64, *max as f64]),
            OptionKind::Color { .. } => Some([0.0, crate::manifest::MAX_COLOR]),
            OptionKind::Bool { .. } | OptionKind::Text { .. } | OptionKind::Texture { .. } => None,
        }
    }

    /// Default of one of the option's numbers, as an effect receives it.
    fn default_number(&self, index: usize) -> f64 {
        match &self.kind {
            OptionKind::Number { default, .. } => *default,
            OptionKind::Integer { default, .. } => *default as f64,
            OptionKind::Bool { default } => f64::from(u8::from(*default)),
            OptionKind::Text { default, one_of } => {
                one_of.iter().position(|o| o == default).unwrap_or(0) as f64
            }
            OptionKind::Color { default } => default[index],
            OptionKind::Vector { default, .. } => default[index],
            OptionKind::Curve { default, .. } => curve_at(default, index as f64 / (CURVE_SAMPLES - 1) as f64),
            // A texture has no numbers.
            OptionKind::Texture { .. } => 0.0,
        }
    }
}

impl Manifest {
    /// Length of the array in which an effect receives its parameters: 8, or the count of their numbers, rounded up to a multiple of 4.
    /// Unused numbers are 0.
    pub fn parameter_length(&self) -> usize {
        let count: usize = self.options.iter().map(OptionSpec::number_count).sum();
        count.next_multiple_of(4).max(8)
    }

    /// The index of a parameter's first number in that array.
    pub fn first_number(&self, index: usize) -> usize {
        self.options.iter().take(index).map(OptionSpec::number_count).sum()
    }

    /// An effect's parameters in the order of the manifest, clamped to their ranges. `given` holds values by the names of numbers, where
    /// the last one of a name counts; all other numbers have their defaults.
    ///
    /// ```
    /// use choreo_plugin::Manifest;
    /// let manifest = Manifest::new("glow", "1", "").number("size", "pixels", 4.0, 0.0..=9.0).flag("on", "", true);
    /// assert_eq!(manifest.parameters(&[("size".into(), 12.0)])[..3], [9.0, 1.0, 0.0]);
    /// ```
    pub fn parameters(&self, given: &[(String, f64)]) -> Vec<f32> {
        let mut all = Vec::with_capacity(self.parameter_length());
        for option in &self.options {
            for (index, ending) in option.suffixes().iter().enumerate() {
                let is_it = |name: &str| name.strip_prefix(option.name.as_str()) == Some(ending);
                let value = given.iter().rev().find(|(name, _)| is_it(name)).map(|(_, value)| *value);
                let value = match (value, option.bounds()) {
                    // A spline between keys may leave the range.
                    (Some(value), Some([min, max])) => value.clamp(min, max),
                    (Some(value), None) => value,
                    (None, _) => option.default_number(index),
                };
                let is_whole = matches!(option.kind, OptionKind::Integer { .. });
                all.push(if is_whole { libm::round(value) as f32 } else { value as f32 });
            }
        }
        all.resize(self.parameter_length(), 0.0);
        all
    }

    /// Scales the numbers whose unit is "px" within their ranges, for an image that is `scale` times as large as intended. Whole numbers
    /// stay whole.
    ///
    /// ```
    /// use choreo_plugin::Manifest;
    /// let manifest = Manifest::new("line", "1", "").number("width", "", 4.0, 0.0..=9.0).unit("px").flag("on", "", true);
    /// let mut parameters = manifest.parameters(&[]);
    /// manifest.scale_pixels(&mut parameters, 0.25);
    /// assert_eq!(parameters[..2], [1.0, 1.0]);
    /// ```
    pub fn scale_pixels(&self, parameters: &mut [f32], scale: f64) {
        if scale == 1.0 {
            return;
        }
        let mut rest = parameters;
        for option in &self.options {
            let Some((own, after)) = rest.split_at_mut_checked(option.suffixes().len()) else { return };
            rest = after;
            let Some([min, max]) = option.bounds().filter(|_| option.unit == "px") else { continue };
            for value in own {
                let scaled = (f64::from(*value) * scale).clamp(min, max);
                let is_whole = matches!(option.kind, OptionKind::Integer { .. });
                *value = if is_whole { libm::round(scaled) } else { scaled } as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest() -> Manifest {
        Manifest::new("all", "1", "every type")
            .number("amount", "", 0.5, 0.0..=1.0)
            .integer("count", "", 3, 1..=9)
            .flag("on", "", true)
            .text("mode", "", "hard", &["soft", "hard"])
            .color("tint", "", [1.0, 0.5, 0.25])
            .vector("axis", "", &[0.0, 1.0], -1.0..=1.0)
            .curve("fall", "", &[[0.0, 0.0], [1.0, 15.0]], 0.0..=20.0)
    }

    #[test]
    fn parameters_are_numbers_in_the_order_of_the_manifest() {
        let manifest = manifest();
        assert_eq!(manifest.parameter_length(), 28);
        let all = manifest.parameters(&[]);
        assert_eq!(all[..9], [0.5, 3.0, 1.0, 1.0, 1.0, 0.5, 0.25, 0.0, 1.0]);
        assert_eq!((all[9], all[10], all[24], all[25], all.len()), (0.0, 1.0, 15.0, 0.0, 28));
        assert_eq!(manifest.first_number(6), 9);
        let given = [("count", 4.6), ("tint_g", 0.75), ("axis_x", -3.0), ("fall_15", 21.0), ("mode", 0.0)];
        let all = manifest.parameters(&given.map(|(name, value)| (name.to_string(), value)));
        assert_eq!((all[1], all[5], all[7], all[24], all[3]), (5.0, 0.75, -1.0, 20.0, 0.0));
        assert_eq!(Manifest::new("none", "1", "").parameters(&[]), [0.0; 8]);
    }

    #[test]
    fn the_error_of_a_curve_table_is_a_sixtieth_of_the_slope_change() {
        for x0 in [0.1, 0.5, 8.0 / 15.0] {
            // The slope changes from 1 to −3 at x0.
            let keys = [[0.0, 0.0], [x0, x0], [1.0, x0 - 3.0 * (1.0 - x0)]];
            let table = curve_table(&keys);
            let read = |x: f64| {
                let cell = ((x * 15.0) as usize).min(14);
                let t = x * 15.0 - cell as f64;
                table[cell] * (1.0 - t) + table[cell + 1] * t
            };
            let worst =
                (0..=3000).map(|i| f64::from(i) / 3000.0).map(|x| (read(x) - curve_at(&keys, x)).abs());
            let worst = worst.fold(0.0, f64::max);
            let cell = x0 * 15.0 - (x0 * 15.0 + 1e-9).floor();
            // The closed form of the distance between a kink and the straight line over its cell.
            let expected = 4.0 * cell * (1.0 - cell) / 15.0;
            assert!(
                (worst - expected).abs() < 1e-3 && worst <= 4.0 / 60.0 + 1e-9,
                "{x0}: {worst} {expected}"
            );
        }
        assert!(is_curve(&[[0.0, 1.0]]) && !is_curve(&[]) && !is_curve(&[[0.5, 1.0], [0.5, 2.0]]));
        assert!(!is_curve(&[[-0.1, 1.0]]) && !is_curve(&[[0.0, f64::NAN]]));
    }
}
