//! The manifest in the head comment of an effect: its name, what it is, its parameters.

use crate::head::comment;
use crate::head_error::{HeadError, HeadMistake};
use choreo_plugin::Manifest;
use choreo_plugin::suggest::closest;

/// Size of the shader's array of parameters.
const MOST: usize = 8;

pub fn manifest(text: &str) -> Result<Manifest, HeadError> {
    let mut manifest = Manifest { version: "1".into(), ..Manifest::default() };
    for (i, line) in comment(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let at = |mistake: HeadMistake| mistake.at(i);
        if let Some(name) = line.strip_prefix("effect:") {
            manifest.name = identifier(name.trim()).map_err(at)?.to_string();
        } else if let Some(about) = line.strip_prefix("about:") {
            manifest.about = about.trim().to_string();
        } else if let Some(version) = line.strip_prefix("version:") {
            manifest.version = version.trim().to_string();
        } else if let Some(param) = line.strip_prefix("param ") {
            manifest = parameter(manifest, param).map_err(at)?;
        } else if let Some(error) = misspelt(line) {
            return Err(at(error));
        }
    }
    if manifest.name.is_empty() {
        let meant = |(i, line): (usize, &str)| {
            let (word, _) = line.trim().trim_start_matches('/').trim().split_once(':')?;
            Some(slip(word.trim(), &["effect"])?.at(i))
        };
        if let Some(error) = comment(text).find_map(meant) {
            return Err(error);
        }
        return Err(HeadMistake::NoName.at(0));
    }
    Ok(manifest)
}

/// A line that was meant to declare something: `parm amount = 0.1 in 0..1: how strong`.
fn misspelt(line: &str) -> Option<HeadMistake> {
    let (word, rest) = line.split_once(' ')?;
    let (_, value) = rest.split_once('=')?;
    value.contains(':').then(|| slip(word, &["param", "texture", "joint"])).flatten()
}

fn slip(word: &str, known: &[&str]) -> Option<HeadMistake> {
    let meant = closest(word, known.iter().copied()).filter(|meant| word != *meant)?;
    let near = meant.len().abs_diff(word.len()) <= 2;
    near.then(|| HeadMistake::Misspelt { word: word.into(), meant: meant.into() })
}

/// `amount = 0.1 in 0..1: how strong`
fn parameter(manifest: Manifest, text: &str) -> Result<Manifest, HeadMistake> {
    const FORM: HeadMistake = HeadMistake::Form(
        "param NAME = 0.5 in 0..1: ABOUT, or = false: ABOUT, or = A of A|B: ABOUT, or = rgb(1, 1, 1): ABOUT",
    );
    let (name, rest) = text.split_once('=').ok_or(FORM)?;
    let name = identifier(name.trim())?;
    if manifest.options.iter().any(|o| o.name == name) {
        return Err(HeadMistake::Twice(name.into()));
    }
    if manifest.options.len() == MOST {
        return Err(HeadMistake::TooMany { most: MOST, what: "parameters" });
    }
    let (value, about) = rest.split_once(':').ok_or(FORM)?;
    let (value, about) = (value.trim(), about.trim());
    if let Ok(flag) = value.parse::<bool>() {
        return Ok(manifest.flag(name, about, flag));
    }
    if let Some((first, all)) = value.split_once(" of ") {
        let all: Vec<&str> = all.split('|').map(str::trim).filter(|a| !a.is_empty()).collect();
        let first = first.trim();
        return match all.contains(&first) {
            true => Ok(manifest.text(name, about, first, &all)),
            false => {
                Err(HeadMistake::NoChoice { name: name.into(), value: first.into(), choices: all.join(", ") })
            }
        };
    }
    let number = |text: &str| {
        let text = text.trim();
        text.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| HeadMistake::NoNumber { name: name.into(), value: text.into() })
    };
    if let Some(color) = value.strip_prefix("rgb(").and_then(|rest| rest.strip_suffix(')')) {
        let parts = color.split(',').map(number).collect::<Result<Vec<f64>, _>>()?;
        let color = <[f64; 3]>::try_from(parts).map_err(|_| FORM)?;
        return match manifest.options.len() + 3 <= MOST && color.iter().all(|c| (0.0..=100.0).contains(c)) {
            true => Ok(manifest.color(name, about, color)),
            false => Err(HeadMistake::Color { name: name.into(), most: MOST }),
        };
    }
    let (value, range) = value.split_once(" in ").ok_or(FORM)?;
    let (min, max) = range.split_once("..").ok_or(FORM)?;
    let (value, min, max) = (number(value)?, number(min)?, number(max)?);
    if !(min..=max).contains(&value) {
        return Err(HeadMistake::OutOfRange { name: name.into(), value, min, max });
    }
    Ok(manifest.number(name, about, value, min..=max))
}

pub fn identifier(name: &str) -> Result<&str, HeadMistake> {
    let mut chars = name.chars();
    let good = chars.next().is_some_and(|c| c.is_ascii_lowercase())
        && chars.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.len() <= 40;
    match good {
        true => Ok(name),
        false => Err(HeadMistake::Name(name.into())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_comment_is_a_manifest() {
        let m = manifest(
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
    fn mistakes_have_their_line() {
        let error = |text: &str| manifest(text).map_err(|e| (e.line, e.mistake.to_string())).unwrap_err();
        assert_eq!(error("fn effect() {}").1, "the head comment must name the effect: // effect: NAME");
        assert_eq!(error("// effect: a\n// param x = 2 in 0..1: y"), (2, "x: 2 is not within 0..1".into()));
        assert_eq!(error("// effect: a\n// param x = k of l|m: y"), (2, "x: \"k\" is none of l, m".into()));
        assert_eq!(error("// effect: A b").0, 1);
        assert!(error("// effect: a\n// param x").1.starts_with("write // param NAME"));
        let slip =
            |wrong: &str, meant: &str| (2, format!("unknown word \"{wrong}\"; did you mean \"{meant}\"?"));
        assert_eq!(error("// effect: a\n// parm x = 1 in 0..1: y"), slip("parm", "param"));
        assert_eq!(error("// effect: a\n// textur x = y.png: z"), slip("textur", "texture"));
        assert_eq!(error("// about: b\n// efect: a"), slip("efect", "effect"));
        assert!(manifest("// effect: a\n// parts of it = all: a note\n// effects: many").is_ok());
        let many: String = (0..9).map(|i| format!("// param x{i} = 0 in 0..1: y\n")).collect();
        assert_eq!(error(&format!("// effect: a\n{many}")).1, "an effect has at most 8 parameters");
    }
}
