//! Colors in a script, for the editor's swatches and color picker.

use crate::context::call_around;
use crate::names::{self, NameKind};
use crate::source::is_string;
use crate::view::View;
use choreo_plugin::color;
use serde_json::{Value, json};

/// All strings that are colors: `"#rrggbb"` anywhere, color names only where a color is expected.
pub(crate) fn colors(view: &View) -> Value {
    let source = view.source;
    let mut found = Vec::new();
    for token in 0..source.tokens.len() {
        let Some(text) = is_string(source.get(token)).then(|| source.string_value(token)).flatten() else {
            continue;
        };
        let Some(rgba) = color::bytes(&text) else { continue };
        let expected = || {
            let site = call_around(view.types(), source.tokens[token].start + 1);
            site.is_some_and(|site| {
                names::accepted_names(source, &site) == Some(NameKind::Colors) || site.maps.len() > 1
            })
        };
        if text.starts_with('#') || expected() {
            let part = |i: usize| f64::from(rgba[i]) / 255.0;
            found.push(json!({
                "range": source.range(&source.tokens[token]),
                "color": { "red": part(0), "green": part(1), "blue": part(2), "alpha": part(3) },
            }));
        }
    }
    found.into()
}

/// Spellings of a picked color: `"#rrggbb"`, and its name if it has one.
pub(crate) fn presentations(color: &Value) -> Value {
    let byte = |name: &str| (color[name].as_f64().unwrap_or(1.0).clamp(0.0, 1.0) * 255.0).round() as u32;
    let (r, g, b, a) = (byte("red"), byte("green"), byte("blue"), byte("alpha"));
    let rgb = (r << 16) | (g << 8) | b;
    let hex = if a < 255 { format!("\"#{rgb:06x}{a:02x}\"") } else { format!("\"#{rgb:06x}\"") };
    let mut labels = vec![json!({ "label": hex })];
    let named = color::NAMES.iter().find(|(_, known)| *known == rgb && a == 255);
    labels.extend(named.map(|(name, _)| json!({ "label": format!("\"{name}\"") })));
    labels.into()
}
