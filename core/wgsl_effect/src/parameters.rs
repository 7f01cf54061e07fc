//! Reads the manifest from the header comment of an effect: name, description and parameters.

use crate::header::comment_lines;
use crate::header_error::{HeaderError, HeaderMistake};
use choreo_plugin::parameters::{MAX_CURVE_KEYS, MAX_PARAMETER_NUMBERS, is_curve};
use choreo_plugin::suggest::closest;
use choreo_plugin::{MAX_COLOR, Manifest};

/// Largest whole number of a parameter: f32 holds all whole numbers up to it exactly.
const MAX_WHOLE_NUMBER: f64 = 16_777_216.0;

pub(crate) fn parse_manifest(text: &str) -> Result<Manifest, HeaderError> {
    let mut manifest = Manifest { version: "1".into(), ..Manifest::default() };
    for (i, line) in comment_lines(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let at = |mistake: HeaderMistake| mistake.at(i);
        if let Some(name) = line.strip_prefix("effect:") {
            manifest.name = parse_identifier(name.trim()).map_err(at)?.to_string();
        } else if let Some(about) = line.strip_prefix("about:") {
            manifest.about = about.trim().to_string();
        } else if let Some(version) = line.strip_prefix("version:") {
            manifest.version = version.trim().to_string();
        } else if let Some(param) = line.strip_prefix("param ") {
            manifest = parse_parameter(manifest, param).map_err(at)?;
        } else if let Some(error) = misspelt_keyword(line) {
            return Err(at(error));
        }
    }
    if manifest.name.is_empty() {
        let meant = |(i, line): (usize, &str)| {
            let (word, _) = line.trim().trim_start_matches('/').trim().split_once(':')?;
            Some(misspelling(word.trim(), &["effect"])?.at(i))
        };
        if let Some(error) = comment_lines(text).find_map(meant) {
            return Err(error);
        }
        return Err(HeaderMistake::NoName.at(0));
    }
    Ok(manifest)
}

/// The mistake of a line with a misspelt first word: `parm amount = 0.1 in 0..1: how strong`.
fn misspelt_keyword(line: &str) -> Option<HeaderMistake> {
    let (word, rest) = line.split_once(' ')?;
    let (_, value) = rest.split_once('=')?;
    value.contains(':').then(|| misspelling(word, &["param", "texture", "joint", "pass"])).flatten()
}

fn misspelling(word: &str, known: &[&str]) -> Option<HeaderMistake> {
    let meant = closest(word, known.iter().copied()).filter(|meant| word != *meant)?;
    let near = meant.len().abs_diff(word.len()) <= 2;
    near.then(|| HeaderMistake::Misspelled { word: word.into(), meant: meant.into() })
}

/// Reads a parameter: `amount = 0.1 m in 0..1: how strong`.
fn parse_parameter(manifest: Manifest, text: &str) -> Result<Manifest, HeaderMistake> {
    const PARAMETER_SYNTAX: HeaderMistake = HeaderMistake::ExpectedSyntax(
        "param NAME = 0.5 in 0..1: ABOUT, or = 0.5 m in 0..1 (with a unit), = int(3) in 1..9, = false, = A of A|B, = color(gold), \
         = rgb(1, 1, 1), = vec2(0, 1) in -1..1, = curve(0 0, 1 1) in 0..1, = texture(FILE), = texture()",
    );
    let (name, rest) = text.split_once('=').ok_or(PARAMETER_SYNTAX)?;
    let name = parse_identifier(name.trim())?;
    if manifest.options.iter().any(|o| o.name == name || o.number_names().any(|number| number == name)) {
        return Err(HeaderMistake::Twice(name.into()));
    }
    let (value, about) = rest.split_once(':').ok_or(PARAMETER_SYNTAX)?;
    let (value, about) = (value.trim(), about.trim());
    let manifest = if let Ok(flag) = value.parse::<bool>() {
        manifest.flag(name, about, flag)
    } else if let Some((first, all)) = value.split_once(" of ") {
        parse_choice(manifest, [name, about], first.trim(), all)?
    } else if let Some(color) = call_argument(value, "rgb") {
        let parts = color.split(',').map(|part| parse_number(name, part)).collect::<Result<Vec<f64>, _>>()?;
        let color = <[f64; 3]>::try_from(parts).map_err(|_| PARAMETER_SYNTAX)?;
        if !color.iter().all(|c| (0.0..=MAX_COLOR).contains(c)) {
            return Err(HeaderMistake::Color(name.into()));
        }
        manifest.color(name, about, color)
    } else if let Some(color) = call_argument(value, "color") {
        let color = choreo_plugin::color::parse(color.trim());
        let color = color.map_err(|e| HeaderMistake::NoColor { name: name.into(), why: e.message })?;
        manifest.color(name, about, color.truncate().to_array().map(f64::from))
    } else if let Some(image) = call_argument(value, "texture") {
        let (file, srgb) = parse_image(image);
        manifest.texture(name, about, file, srgb)
    } else {
        parse_ranged_value(manifest, [name, about], value)?.ok_or(PARAMETER_SYNTAX)?
    };
    match manifest.options.iter().map(|o| o.number_count()).sum::<usize>() {
        0..=MAX_PARAMETER_NUMBERS => Ok(manifest),
        _ => Err(HeaderMistake::TooManyNumbers { most: MAX_PARAMETER_NUMBERS }),
    }
}

/// Reads a file name, and whether its colors are sRGB: `paper.png` or `bumps.png as data`. White has no file name, or only `data`.
pub(crate) fn parse_image(text: &str) -> (&str, bool) {
    let text = text.trim();
    match text.strip_suffix("data").map(str::trim_end) {
        Some("") => ("", false),
        Some(file) => file.strip_suffix(" as").map_or((text, true), |file| (file.trim(), false)),
        None => (text, true),
    }
}

/// The text between the brackets of `word(…)`.
pub(crate) fn call_argument<'a>(value: &'a str, word: &str) -> Option<&'a str> {
    value.strip_prefix(word)?.strip_prefix('(')?.strip_suffix(')')
}

fn parse_number(name: &str, text: &str) -> Result<f64, HeaderMistake> {
    let text = text.trim();
    let number = text.parse::<f64>().ok().filter(|v| v.is_finite());
    number.ok_or_else(|| HeaderMistake::NoNumber { name: name.into(), value: text.into() })
}

/// Reads a choice: `soft of soft|hard`.
fn parse_choice(
    manifest: Manifest,
    [name, about]: [&str; 2],
    first: &str,
    all: &str,
) -> Result<Manifest, HeaderMistake> {
    let all: Vec<&str> = all.split('|').map(str::trim).filter(|a| !a.is_empty()).collect();
    match all.contains(&first) {
        true => Ok(manifest.text(name, about, first, &all)),
        false => {
            Err(HeaderMistake::NoChoice { name: name.into(), value: first.into(), choices: all.join(", ") })
        }
    }
}

/// Reads a value with a range, `VALUE UNIT in MIN..MAX`; `None` if the text has another form.
fn parse_ranged_value(
    manifest: Manifest,
    [name, about]: [&str; 2],
    text: &str,
) -> Result<Option<Manifest>, HeaderMistake> {
    let Some((given, range)) = text.rsplit_once(" in ") else { return Ok(None) };
    let Some((min, max)) = range.split_once("..") else { return Ok(None) };
    let (min, max) = (parse_number(name, min)?, parse_number(name, max)?);
    let within = |value: f64| match (min..=max).contains(&value) {
        true => Ok(value),
        false => Err(HeaderMistake::OutOfRange { name: name.into(), value, min, max }),
    };
    let given = given.trim();
    // The unit follows the bracket, or the number.
    let end = given.find(')').map(|at| at + 1).or_else(|| given.find(' ')).unwrap_or(given.len());
    let (value, unit) = (&given[..end], given[end..].trim());
    if unit.contains(char::is_whitespace) || unit.len() > 16 {
        return Ok(None);
    }
    let numbers = |text: &str, separator: char| {
        text.split(separator)
            .filter(|part| !part.trim().is_empty())
            .map(|part| parse_number(name, part))
            .collect()
    };
    let vector =
        ["vec2", "vec3", "vec4"].iter().zip(2..).find_map(|(word, n)| Some((call_argument(value, word)?, n)));
    let made = if let Some(whole) = call_argument(value, "int") {
        let value = within(parse_number(name, whole)?)?;
        let is_whole = |v: f64| v.fract() == 0.0 && v.abs() <= MAX_WHOLE_NUMBER;
        if ![value, min, max].into_iter().all(is_whole) {
            return Err(HeaderMistake::NoWhole { name: name.into(), most: MAX_WHOLE_NUMBER });
        }
        manifest.integer(name, about, value as i64, min as i64..=max as i64)
    } else if let Some((parts, count)) = vector {
        let parts: Vec<f64> = numbers(parts, ',')?;
        if parts.len() != count {
            return Err(HeaderMistake::Components { name: name.into(), count, given: parts.len() });
        }
        parts.iter().try_for_each(|part| within(*part).map(drop))?;
        manifest.vector(name, about, &parts, min..=max)
    } else if let Some(keys) = call_argument(value, "curve") {
        let keys: Result<Vec<Vec<f64>>, _> = keys.split(',').map(|key| numbers(key, ' ')).collect();
        let keys: Vec<[f64; 2]> = keys?.into_iter().filter_map(|key| key.try_into().ok()).collect();
        if !is_curve(&keys) || keys.len() != value.split(',').count() {
            return Err(HeaderMistake::Curve { name: name.into(), most: MAX_CURVE_KEYS });
        }
        keys.iter().try_for_each(|key| within(key[1]).map(drop))?;
        manifest.curve(name, about, &keys, min..=max)
    } else {
        manifest.number(name, about, within(parse_number(name, value)?)?, min..=max)
    };
    Ok(Some(made.unit(unit)))
}

pub(crate) fn parse_identifier(name: &str) -> Result<&str, HeaderMistake> {
    let mut chars = name.chars();
    let good = chars.next().is_some_and(|c| c.is_ascii_lowercase())
        && chars.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.len() <= 40;
    match good {
        true => Ok(name),
        false => Err(HeaderMistake::Name(name.into())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_comment_is_read_as_a_manifest() {
        let m = parse_manifest(
            "// effect: grain\n// about: film grain\n//\n// param amount = 0.1 in 0..1: how strong\n\
             // param colored = false: each its own\n// param curve = soft of soft|hard: how\nfn x() {}\n// param no = 1",
        )
        .unwrap();
        let expected = Manifest::new("grain", "1", "film grain")
            .number("amount", "how strong", 0.1, 0.0..=1.0)
            .flag("colored", "each its own", false)
            .text("curve", "how", "soft", &["soft", "hard"]);
        assert_eq!(m, expected);
    }

    #[test]
    fn errors_name_their_line() {
        let error =
            |text: &str| parse_manifest(text).map_err(|e| (e.line, e.mistake.to_string())).unwrap_err();
        assert_eq!(error("fn effect() {}").1, "the header comment must name the effect: // effect: NAME");
        assert_eq!(error("// effect: a\n// param x = 2 in 0..1: y"), (2, "x: 2 is not within 0..1".into()));
        assert_eq!(error("// effect: a\n// param x = k of l|m: y"), (2, "x: \"k\" is none of l, m".into()));
        assert_eq!(error("// effect: A b").0, 1);
        assert!(error("// effect: a\n// param x").1.starts_with("write // param NAME"));
        let slip =
            |wrong: &str, meant: &str| (2, format!("unknown word \"{wrong}\"; did you mean \"{meant}\"?"));
        assert_eq!(error("// effect: a\n// parm x = 1 in 0..1: y"), slip("parm", "param"));
        assert_eq!(error("// effect: a\n// textur x = y.png: z"), slip("textur", "texture"));
        assert_eq!(error("// about: b\n// efect: a"), slip("efect", "effect"));
        assert!(parse_manifest("// effect: a\n// parts of it = all: a note\n// effects: many").is_ok());
        let many: String = (0..65).map(|i| format!("// param x{i} = 0 in 0..1: y\n")).collect();
        let most = "the parameters of an effect are at most 64 numbers: a color is 3 of them, a vector 2 to 4, a curve 16";
        assert_eq!(error(&format!("// effect: a\n{many}")), (66, most.into()));
        let colors: String = (0..22).map(|i| format!("// param x{i} = color(gold): y\n")).collect();
        assert_eq!(error(&format!("// effect: a\n{colors}")), (23, most.into()));
        let of = |param: &str| error(&format!("// effect: a\n// param x = {param}: y")).1;
        assert_eq!(of("int(2.5) in 0..9"), "x: a whole number and its range lie within ±16777216");
        assert_eq!(of("int(0) in 0..20000000"), "x: a whole number and its range lie within ±16777216");
        assert_eq!(of("int(12) in 0..9"), "x: 12 is not within 0..9");
        assert_eq!(of("color(rde)"), "x: unknown color \"rde\"; did you mean \"red\"?");
        assert_eq!(of("rgb(1, 2, 101)"), "x: the three numbers of a color are from 0 to 100");
        assert_eq!(of("vec3(0, 1) in 0..1"), "x: vec3 has 3 numbers, not 2");
        assert_eq!(of("vec2(0, 2) in 0..1"), "x: 2 is not within 0..1");
        let curve =
            "x: a curve is 1 to 64 keys x y, as in curve(0 0, 0.5 0.8, 1 1), with growing x from 0 to 1";
        assert_eq!(of("curve(0 0, 0 1) in 0..1"), curve);
        assert_eq!(of("curve(0 0, 1) in 0..1"), curve);
        assert_eq!(of("curve(0 2) in 0..1"), "x: 2 is not within 0..1");
        assert!(of("1 metres long in 0..1").starts_with("write // param NAME"));
        assert_eq!(
            error("// effect: a\n// param t = color(red): y\n// param t_r = 0 in 0..1: y"),
            (3, "t_r is declared twice".into())
        );
    }

    #[test]
    fn a_parameter_has_a_type_a_unit_and_a_range() {
        let m = parse_manifest(
            "// effect: all\n// param reach = 0.5 m in 0..2: how far\n// param count = int(3) px in 1..9: how many\n\
             // param axis = vec3(0, 1, 0) in -1..1: which way\n// param tint = color(#f00): its color\n\
             // param fall = curve(0 0, 0.5 2, 1 1) stops in 0..4: how it falls",
        )
        .unwrap();
        let expected = Manifest::new("all", "1", "")
            .number("reach", "how far", 0.5, 0.0..=2.0)
            .unit("m")
            .integer("count", "how many", 3, 1..=9)
            .unit("px")
            .vector("axis", "which way", &[0.0, 1.0, 0.0], -1.0..=1.0)
            .color("tint", "its color", [1.0, 0.0, 0.0])
            .curve("fall", "how it falls", &[[0.0, 0.0], [0.5, 2.0], [1.0, 1.0]], 0.0..=4.0)
            .unit("stops");
        assert_eq!(m, expected);
    }
}
