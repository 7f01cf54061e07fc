//! Options of plugins as text, and plugins in files.

pub mod plugin_files;

use choreo_plugin::{Manifest, OptionKind, OptionSpec, OptionValue};

/// One line for each option of a plugin.
pub(crate) fn option_rows(m: &Manifest) -> String {
    m.options.iter().map(|o| format!("      {:<14} {} ({})\n", o.name, o.about, range(o))).collect()
}

fn range(option: &OptionSpec) -> String {
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
            format!("{}, default {}", option.allowed(), choreo_plugin::color::written(*default))
        }
        _ => format!("{}, default {default}", option.allowed()),
    }
}
