//! Ambient light as the script states it: by a call of its own, else as an option of the stage.

use super::{EditError, FieldChange};
use crate::app::Viewer;
use choreo_asset::srgb_from_linear;
use choreo_session::edit::{NewValueSyntax, ScriptObject, TypedNumber, expression};
use glam::Vec3;

/// Ambient light: sRGB colors from above and from below, and the strength.
#[derive(Clone, Debug, PartialEq)]
pub struct Ambient {
    pub up: [u8; 3],
    pub down: [u8; 3],
    pub strength: TypedNumber,
}

impl Viewer {
    /// The ambient light of the stage, with the strength as the script writes it.
    pub fn ambient(&self) -> Option<Ambient> {
        let settings = &self.scene.as_ref()?.stage.settings;
        let strength = parse_strength(&self.ambient_source().unwrap_or_default());
        let color = |linear: Vec3| {
            let one = linear / strength.value.max(1e-9) as f32;
            one.to_array().map(|v| (srgb_from_linear(f64::from(v.clamp(0.0, 1.0))) * 255.0).round() as u8)
        };
        Some(Ambient { up: color(settings.ambient_up), down: color(settings.ambient_down), strength })
    }

    /// Line of the call that states the ambient light. `None` if it is an option of the stage.
    pub fn ambient_line(&self) -> Option<usize> {
        self.scene.as_ref()?.places.ambient.as_ref().map(|place| place.line)
    }

    fn ambient_source(&self) -> Option<String> {
        let place = self.scene.as_ref()?.places.ambient.clone();
        match place {
            Some(place) => self.read_object(&place, 1, |object| Some(object.all_arguments().to_string())),
            None => self.written_stage_values().remove("ambient"),
        }
    }

    /// Changes the ambient light where the script states it, else as an option of the stage.
    ///
    /// # Errors
    /// The edit is refused, with a text for the user; the script does not change.
    pub fn set_ambient(&mut self, to: Ambient) -> Result<(), EditError> {
        let place = self.scene.as_ref().ok_or(EditError::NothingShown)?.places.ambient.clone();
        let (from, written) = (self.ambient(), self.ambient_source().unwrap_or_default());
        let same_color = from.is_some_and(|from| from.up == to.up && from.down == to.down);
        let hex = |[r, g, b]: [u8; 3]| format!("\"#{r:02x}{g:02x}{b:02x}\"");
        let (even, is_one) = (to.up == to.down, to.strength.value == 1.0);
        let strength = to.strength.text;
        let white = even && to.up == [255; 3];
        let map = |colors: String| match is_one {
            true => format!("#{{ {colors} }}"),
            false => format!("#{{ {colors}, strength: {strength} }}"),
        };
        let value = match (&place, even) {
            _ if white && (place.is_none() || expression::evaluate(&written, 1.0).is_some()) => strength,
            (_, false) => map(format!("up: {}, down: {}", hex(to.up), hex(to.down))),
            (None, true) if is_one => hex(to.up),
            (None, true) => map(format!("color: {}", hex(to.up))),
            (Some(_), true) => {
                let first =
                    split_arguments(&written).first().filter(|first| same_color && is_color(first)).copied();
                let color = first.map_or_else(|| hex(to.up), str::to_string);
                if is_one { color } else { format!("{color}, {strength}") }
            }
        };
        match place {
            Some(place) => self.edit_call(&place, 1, |text| {
                ScriptObject::at(text, place.line, place.column)?.set_arguments(&value)
            }),
            None => self.change_stage(&FieldChange::Value("ambient", value, NewValueSyntax::Option)),
        }
    }
}

/// Source text of each argument of a call.
fn split_arguments(written: &str) -> Vec<&str> {
    let (mut depth, mut from, mut all) = (0usize, 0, Vec::new());
    for (at, c) in written.char_indices() {
        match c {
            '[' | '{' | '(' => depth += 1,
            ']' | '}' | ')' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                all.push(written[from..at].trim());
                from = at + 1;
            }
            _ => {}
        }
    }
    all.push(written[from..].trim());
    all
}

fn is_color(argument: &str) -> bool {
    argument.starts_with(['"', '['])
}

/// The strength that is written after the colors; 1 if there is none.
fn parse_strength(written: &str) -> TypedNumber {
    let in_map = written.trim().strip_prefix("#{").and_then(|map| map.split_once("strength:"));
    let text = match in_map {
        Some((_, rest)) => rest.split([',', '}']).next(),
        None => split_arguments(written).last().copied(),
    };
    let typed = |text: &str| {
        Some(TypedNumber { value: expression::evaluate(text, 1.0)?, text: text.trim().to_string() })
    };
    text.and_then(typed).filter(|typed| typed.value > 0.0).unwrap_or_else(|| TypedNumber::from(1.0))
}

#[cfg(test)]
mod tests {
    use super::parse_strength;

    #[test]
    fn the_ambient_strength_is_read_in_each_syntax() {
        for (written, strength) in [
            ("", 1.0),
            ("\"white\"", 1.0),
            ("\"white\", 0.4", 0.4),
            ("[0.1, 0.2, 0.3]", 1.0),
            ("[0.1, 0.2, 0.3], 2", 2.0),
            ("0.5", 0.5),
            ("\"white\", 1.0 / 4.0", 0.25),
            ("#{ up: \"white\", down: \"black\", strength: 0.25 }", 0.25),
            ("#{ up: \"white\" }", 1.0),
        ] {
            assert_eq!(parse_strength(written).value, strength, "{written}");
        }
    }
}
