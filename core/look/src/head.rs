//! The head comment of an effect:
//!
//! ```text
//! // effect: grain
//! // about: film grain, the same in every frame
//! // version: 1
//! // hook: surface
//! // see_through: true
//! // background: true
//! // param amount = 0.1 in 0..1: how strong it is
//! // param coloured = false: another grain for each colour
//! // param curve = soft of soft|hard: how it fades in the lights
//! ```

use choreo_plugin::{Hook, Manifest};

/// Line from 1, and what is wrong with it.
pub type HeadError = (usize, String);

/// As many as the shader's array of parameters holds.
const MOST: usize = 8;

/// Where it takes hold, and whether a surface makes alpha; of one pixel where the head says nothing.
pub fn hook(text: &str) -> Result<(Hook, bool), HeadError> {
    let (mut hook, mut see_through) = (Hook::Pixel, None);
    for (i, line) in comment(text) {
        let line = line.trim().trim_start_matches('/').trim();
        if let Some(word) = line.strip_prefix("hook:") {
            hook = match word.trim() {
                "pixel" => Hook::Pixel,
                "surface" => Hook::Surface,
                other => {
                    return Err((
                        i + 1,
                        format!("hook is pixel or surface, not \"{other}\" (others need a crate)"),
                    ));
                }
            };
        } else if let Some(word) = line.strip_prefix("see_through:") {
            let flag = word.trim().parse::<bool>();
            let flag = flag.map_err(|_| (i + 1, "see_through is true or false".to_string()))?;
            see_through = Some((i + 1, flag));
        }
    }
    match see_through {
        Some((line, _)) if hook != Hook::Surface => {
            Err((line, "see_through is of effects with hook: surface".into()))
        }
        _ => Ok((hook, see_through.is_some_and(|(_, flag)| flag))),
    }
}

/// Whether an effect on surfaces changes the background too.
pub fn background(text: &str, hook: Hook) -> Result<bool, HeadError> {
    let mut on = false;
    for (i, line) in comment(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let Some(word) = line.strip_prefix("background:") else { continue };
        let flag = word.trim().parse::<bool>();
        on = flag.map_err(|_| (i + 1, "background is true or false".to_string()))?;
        if hook != Hook::Surface {
            return Err((i + 1, "background is of effects with hook: surface".into()));
        }
    }
    Ok(on)
}

/// Its lines, from 0.
fn comment(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().take_while(|(_, l)| l.trim().is_empty() || l.trim_start().starts_with("//"))
}

pub fn manifest(text: &str) -> Result<Manifest, HeadError> {
    let mut manifest = Manifest { version: "1".into(), ..Manifest::default() };
    for (i, line) in comment(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let at = |message: String| (i + 1, message);
        if let Some(name) = line.strip_prefix("effect:") {
            manifest.name = identifier(name.trim()).map_err(at)?.to_string();
        } else if let Some(about) = line.strip_prefix("about:") {
            manifest.about = about.trim().to_string();
        } else if let Some(version) = line.strip_prefix("version:") {
            manifest.version = version.trim().to_string();
        } else if let Some(param) = line.strip_prefix("param ") {
            manifest = parameter(manifest, param).map_err(at)?;
        }
    }
    if manifest.name.is_empty() {
        return Err((1, "the head comment must name the effect: // effect: NAME".into()));
    }
    Ok(manifest)
}

/// `amount = 0.1 in 0..1: how strong`
fn parameter(manifest: Manifest, text: &str) -> Result<Manifest, String> {
    const FORM: &str = "write // param NAME = 0.5 in 0..1: ABOUT, or = false: ABOUT, or = A of A|B: ABOUT";
    let (name, rest) = text.split_once('=').ok_or(FORM)?;
    let name = identifier(name.trim())?;
    if manifest.options.iter().any(|o| o.name == name) {
        return Err(format!("the parameter {name} is declared twice"));
    }
    if manifest.options.len() == MOST {
        return Err(format!("an effect has at most {MOST} parameters"));
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
            false => Err(format!("{name}: \"{first}\" is none of {}", all.join(", "))),
        };
    }
    let (value, range) = value.split_once(" in ").ok_or(FORM)?;
    let (min, max) = range.split_once("..").ok_or(FORM)?;
    let number = |text: &str| {
        let text = text.trim();
        text.parse::<f64>()
            .ok()
            .filter(|v| v.is_finite())
            .ok_or_else(|| format!("{name}: \"{text}\" is no number"))
    };
    let (value, min, max) = (number(value)?, number(min)?, number(max)?);
    if !(min..=max).contains(&value) {
        return Err(format!("{name}: {value} is not within {min}..{max}"));
    }
    Ok(manifest.number(name, about, value, min..=max))
}

fn identifier(name: &str) -> Result<&str, String> {
    let mut chars = name.chars();
    let good = chars.next().is_some_and(|c| c.is_ascii_lowercase())
        && chars.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && name.len() <= 40;
    match good {
        true => Ok(name),
        false => Err(format!("\"{name}\" must be a name of lower-case letters, digits and _, at most 40")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_comment_is_a_manifest() {
        let m = manifest(
            "// effect: grain\n// about: film grain\n//\n// param amount = 0.1 in 0..1: how strong\n\
             // param coloured = false: each its own\n// param curve = soft of soft|hard: how\nfn x() {}\n// param no = 1",
        )
        .unwrap();
        let expected = Manifest::new("grain", "1", "film grain")
            .number("amount", "how strong", 0.1, 0.0..=1.0)
            .flag("coloured", "each its own", false)
            .text("curve", "how", "soft", &["soft", "hard"]);
        assert_eq!(m, expected);
    }

    #[test]
    fn hooks_have_names() {
        assert_eq!(hook("// effect: a"), Ok((Hook::Pixel, false)));
        assert_eq!(hook("// effect: a\n// hook: surface\n// see_through: true"), Ok((Hook::Surface, true)));
        let error = |text: &str| hook(text).unwrap_err();
        let unknown = "hook is pixel or surface, not \"vertex\" (others need a crate)";
        assert_eq!(error("// effect: a\n// hook: vertex"), (2, unknown.into()));
        assert_eq!(error("// see_through: true").1, "see_through is of effects with hook: surface");
        assert_eq!(error("// hook: surface\n// see_through: much").0, 2);
    }

    #[test]
    fn the_background_is_for_surfaces() {
        assert_eq!(background("// effect: a\n// background: true", Hook::Surface), Ok(true));
        assert_eq!(background("// effect: a", Hook::Surface), Ok(false));
        let error = (1, "background is of effects with hook: surface".to_string());
        assert_eq!(background("// background: true", Hook::Pixel), Err(error));
        assert_eq!(background("// effect: a\n// background: much", Hook::Surface).unwrap_err().0, 2);
    }

    #[test]
    fn mistakes_have_their_line() {
        let error = |text: &str| manifest(text).unwrap_err();
        assert_eq!(error("fn effect() {}").1, "the head comment must name the effect: // effect: NAME");
        assert_eq!(error("// effect: a\n// param x = 2 in 0..1: y"), (2, "x: 2 is not within 0..1".into()));
        assert_eq!(error("// effect: a\n// param x = k of l|m: y"), (2, "x: \"k\" is none of l, m".into()));
        assert_eq!(error("// effect: A b").0, 1);
        assert!(error("// effect: a\n// param x").1.starts_with("write // param NAME"));
        let many: String = (0..9).map(|i| format!("// param x{i} = 0 in 0..1: y\n")).collect();
        assert_eq!(error(&format!("// effect: a\n{many}")).1, "an effect has at most 8 parameters");
    }
}
