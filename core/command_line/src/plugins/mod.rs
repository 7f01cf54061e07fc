//! Descriptions of plugin options as text, and loading of plugin files.

pub(crate) mod plugin_files;

use choreo_plugin::{Manifest, OptionKind, OptionSpec, OptionValue};

/// One line for each option of a plugin.
pub(crate) fn option_rows(m: &Manifest) -> String {
    m.options
        .iter()
        .map(|o| format!("      {:<14} {} ({})\n", o.name, o.about, value_range_and_default(o)))
        .collect()
}

fn value_range_and_default(option: &OptionSpec) -> String {
    let default = option.default();
    match (&option.kind, &default) {
        (OptionKind::Number { min, max, .. }, _) => {
            let unit = if option.unit.is_empty() { String::new() } else { format!(" {}", option.unit) };
            format!("{min} to {max}{unit}, default {default}")
        }
        (OptionKind::Text { one_of, .. }, OptionValue::Text(default)) if !one_of.is_empty() => {
            format!("{}, default {default}", one_of.join(" | "))
        }
        (OptionKind::Color { default }, _) => {
            format!("{}, default {}", option.allowed(), format_color(*default))
        }
        (OptionKind::Curve { default, .. }, _) => {
            let keys: Vec<String> = default.iter().map(|[x, y]| format!("[{x}, {y}]")).collect();
            format!("{}, default [{}]", option.allowed(), keys.join(", "))
        }
        _ => format!("{}, default {default}", option.allowed()),
    }
}

/// A color as authors write it: sRGB in hexadecimal with its CSS name, or linear numbers that eight bits do not hold.
fn format_color(linear: [f64; 3]) -> String {
    match choreo_plugin::color::hex(linear) {
        Some((hex, Some(name))) => format!("{hex} ({name})"),
        Some((hex, None)) => hex,
        None => format!("rgb({}, {}, {}), linear", linear[0], linear[1], linear[2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_and_curves_are_printed_as_they_are_written() {
        let linear =
            |text: &str| choreo_plugin::color::parse(text).unwrap().truncate().to_array().map(f64::from);
        let m = Manifest::new("m", "1", "")
            .color("tint", "of it", linear("tomato"))
            .color("dark", "of it", linear("#123456"))
            .color("light", "of it", [2.0, 0.5, 0.0])
            .curve("fall", "over x", &[[0.0, 0.0], [0.5, 0.8], [1.0, 1.0]], 0.0..=1.0);
        let rows = option_rows(&m);
        let rows: Vec<&str> = rows.lines().map(|row| row.rsplit(", default ").next().unwrap()).collect();
        let expected =
            ["#ff6347 (tomato))", "#123456)", "rgb(2, 0.5, 0), linear)", "[[0, 0], [0.5, 0.8], [1, 1]])"];
        assert_eq!(rows, expected);
    }
}
