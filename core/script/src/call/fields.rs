//! Fields of stage types as options and methods of scripts. Reading, setting and documenting them follows from [`Described`].

use super::read::{color, duration, number_in, numbers, point, wrong};
use super::{ApiError, Call, Options};
use choreo_stage::{Described, Field, FieldType, FieldValue};
use glam::DVec2;
use rhai::Dynamic;

/// Reads the value of a field.
fn value(c: &Call, v: &Dynamic, label: &str, field_type: FieldType) -> Result<FieldValue, ApiError> {
    Ok(match field_type {
        FieldType::Number(low, high, _) => FieldValue::Number(number_in(v, label, low, high)?),
        FieldType::Degrees(low, high) => FieldValue::Number(number_in(v, label, low, high)?.to_radians()),
        FieldType::Time => FieldValue::Time(c.stage_time(v, label)?),
        FieldType::Duration => FieldValue::Time(duration(v, label)?),
        FieldType::Flag => FieldValue::Flag(v.as_bool().map_err(|_| wrong(v, label, "true or false"))?),
        FieldType::Color => FieldValue::Color(color(v, label)?),
        FieldType::Kelvin => {
            let (low, high) = crate::color::KELVIN_RANGE;
            FieldValue::Color(crate::color::black_body_color(number_in(v, label, low, high)?).extend(1.0))
        }
        FieldType::Direction => {
            FieldValue::Vector(Call::direction(v, label)?.as_vec3().normalize().as_dvec3())
        }
        FieldType::Pair => FieldValue::Pair(pair(v, label)?),
        FieldType::Point | FieldType::Rotation | FieldType::Scale => FieldValue::Vector(point(v, label)?),
    })
}

/// Two numbers, such as a position in the image.
pub(crate) fn pair(v: &Dynamic, label: &str) -> Result<DVec2, ApiError> {
    let two = numbers(v).filter(|n| n.len() == 2 && n.iter().all(|n| n.abs() <= 1e6));
    two.map(|n| DVec2::new(n[0], n[1])).ok_or_else(|| wrong(v, label, "[x, y]"))
}

/// Sets the fields that are keys of an option map.
pub(crate) fn fill<T: Described>(c: &Call, o: &Options, of: &mut T) -> Result<(), ApiError> {
    for field in T::FIELDS {
        if let Some(given) = o.get(field.name) {
            (field.set)(of, value(c, &given, &o.label(field.name), field.field_type)?);
        }
    }
    Ok(())
}

/// The field with the name of the called method, and the value that the first argument gives it.
pub(crate) fn field_and_value<T: Described>(c: &Call) -> Result<(&'static Field<T>, FieldValue), ApiError> {
    let field = T::field(c.def.name).ok_or_else(|| ApiError::new(format!("{} is no field", c.def.name)))?;
    let given = match field.field_type {
        FieldType::Flag if c.len() == 0 => FieldValue::Flag(true),
        FieldType::Point if c.len() > 1 => FieldValue::Vector(c.point(0)?),
        field_type => value(c, &c.value(0), &c.label(0), field_type)?,
    };
    Ok((field, given))
}

/// Fields of a type that apply to a value, except those in `without`.
fn options<T: Described>(of: &T, without: &[&str]) -> impl Iterator<Item = &'static Field<T>> {
    T::FIELDS.iter().filter(|field| (field.missing_reason)(of).is_none() && !without.contains(&field.name))
}

/// Names of the fields that are options of a value.
pub(crate) fn names<T: Described>(of: &T, without: &[&str]) -> Vec<&'static str> {
    options(of, without).map(|field| field.name).collect()
}

/// Description of the options for the reference: `intensity (0 to 1000000000, default 3), …`.
pub(crate) fn describe_options<T: Described>(of: &T, without: &[&str]) -> String {
    let one = |field: &Field<T>| {
        let mut parts = vec![field.about()];
        match field.field_type {
            FieldType::Number(low, high, unit) => parts.extend([unit.into(), format!("{low} to {high}")]),
            FieldType::Degrees(low, high) => parts.extend(["degrees".into(), format!("{low} to {high}")]),
            FieldType::Kelvin => {
                let (low, high) = crate::color::KELVIN_RANGE;
                parts.push(format!("{low} to {high}, in place of color"));
            }
            FieldType::Duration => parts.push("seconds".into()),
            FieldType::Color => parts.push("a color".into()),
            _ => {}
        }
        let default = match field.field_type {
            // The stored value differs from the script's: directions are normalized, colors linear.
            FieldType::Direction | FieldType::Color => None,
            _ => field.shown(of),
        };
        parts.extend(default.map(|value| format!("default {value}")));
        parts.retain(|part| !part.is_empty());
        match parts.is_empty() {
            true => field.name.to_string(),
            false => format!("{} ({})", field.name, parts.join(", ")),
        }
    };
    options(of, without).map(one).collect::<Vec<_>>().join(", ")
}
