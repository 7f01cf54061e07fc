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
//! // texture paper = paper.png: what it is printed on
//! // texture bumps = bumps.png as data: heights
//! ```
//!
//! Of `hook: vertex` also `reach: METRES or PARAMETER` and `space: model`, of `hook: picture` `passes: 2` and `history: 3`.

use choreo_plugin::suggest::closest;
use choreo_plugin::{Hook, Manifest};

/// Line from 1, and what is wrong with it.
pub type HeadError = (usize, String);

/// As many as the shader's array of parameters holds.
const MOST: usize = 8;
pub const MOST_TEXTURES: usize = 4;
const MOST_PASSES: u32 = 16;
/// Frames back; each is one more to draw for every frame.
const MOST_HISTORY: u32 = 16;

/// Where the effect takes hold, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    pub hook: Hook,
    /// A surface makes alpha.
    pub see_through: bool,
    /// An effect on surfaces changes the background too.
    pub background: bool,
    /// Corners are moved along the mesh's own axes.
    pub along_model: bool,
    pub reach: Reach,
    pub passes: u32,
    pub history: u32,
    pub textures: Vec<TextureLine>,
}

/// How far corners are moved at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    Metres(f32),
    /// As a parameter says, by its place.
    Parameter(usize),
}

/// A picture that the functions read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureLine {
    pub name: String,
    /// Beside the effect's own file.
    pub file: String,
    /// Its numbers are colors, encoded as sRGB.
    pub srgb: bool,
    /// From 1.
    pub line: usize,
}

/// What comes after the name of a field, by line.
fn fields(text: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    comment(text).filter_map(|(i, line)| {
        let (name, value) = line.trim().trim_start_matches('/').trim().split_once(':')?;
        Some((i + 1, name.trim(), value.trim()))
    })
}

/// Files that the head names, whatever else is wrong with it.
pub fn files(text: &str) -> Vec<String> {
    let lines = comment(text).filter_map(|(_, line)| {
        let rest = line.trim().trim_start_matches('/').trim().strip_prefix("texture ")?;
        let (file, _) = rest.split_once('=')?.1.split_once(':')?;
        let file = file.trim();
        Some(file.strip_suffix(" as data").unwrap_or(file).trim().to_string())
    });
    lines.take(MOST_TEXTURES).collect()
}

pub fn head(text: &str, manifest: &Manifest) -> Result<Head, HeadError> {
    let mut head = Head {
        hook: Hook::Pixel,
        see_through: false,
        background: false,
        along_model: false,
        reach: Reach::Metres(0.0),
        passes: 1,
        history: 0,
        textures: textures(text, manifest)?,
    };
    let mut hook_line = 1;
    for (line, name, value) in fields(text).filter(|(_, name, _)| *name == "hook") {
        hook_line = line;
        head.hook = match value {
            "pixel" => Hook::Pixel,
            "picture" => Hook::Picture,
            "surface" => Hook::Surface,
            "vertex" => Hook::Vertex,
            "lighting" => Hook::Lighting,
            other => {
                let known = "pixel, picture, surface, vertex or lighting";
                return Err((line, format!("{name} is {known}, not \"{other}\" (others need a crate)")));
            }
        };
    }
    let mut reaches = false;
    for (line, name, value) in fields(text) {
        let flag = || value.parse::<bool>().map_err(|_| (line, format!("{name} is true or false")));
        let count = |most: u32| {
            let number = value.parse().ok().filter(|n| (1..=most).contains(n));
            number.ok_or_else(|| (line, format!("{name} is a whole number from 1 to {most}")))
        };
        let of = match name {
            "see_through" => {
                head.see_through = flag()?;
                Hook::Surface
            }
            "background" => {
                head.background = flag()?;
                Hook::Surface
            }
            "space" => {
                head.along_model = match value {
                    "world" => false,
                    "model" => true,
                    _ => return Err((line, "space is world or model".into())),
                };
                Hook::Vertex
            }
            "reach" => {
                reaches = true;
                head.reach = reach(value, manifest).map_err(|message| (line, message))?;
                Hook::Vertex
            }
            "passes" => {
                head.passes = count(MOST_PASSES)?;
                Hook::Picture
            }
            "history" => {
                head.history = count(MOST_HISTORY)?;
                Hook::Picture
            }
            _ => {
                slip(name).map_or(Ok(()), |meant| {
                    Err((line, format!("unknown word \"{name}\"; did you mean \"{meant}\"?")))
                })?;
                continue;
            }
        };
        if head.hook != of {
            return Err((line, format!("{name} is of effects with hook: {}", named(of))));
        }
    }
    match head.hook {
        Hook::Vertex if !reaches => Err((
            hook_line,
            "an effect that moves surfaces says how far at most: // reach: METRES, or the name of a parameter".into(),
        )),
        _ => Ok(head),
    }
}

const WORDS: [&str; 10] = [
    "effect",
    "about",
    "version",
    "hook",
    "see_through",
    "background",
    "space",
    "reach",
    "passes",
    "history",
];

/// The word that a slip of the hand stands for. Other words are the author's own.
fn slip(name: &str) -> Option<&'static str> {
    if WORDS.contains(&name) || name.contains(char::is_whitespace) {
        return None;
    }
    closest(name, WORDS).filter(|word| word.len().abs_diff(name.len()) <= 2)
}

fn named(hook: Hook) -> &'static str {
    match hook {
        Hook::Surface => "surface",
        Hook::Vertex => "vertex",
        Hook::Picture => "picture",
        _ => "pixel",
    }
}

fn reach(value: &str, manifest: &Manifest) -> Result<Reach, String> {
    if let Some(place) = manifest.options.iter().position(|o| o.name == value) {
        return Ok(Reach::Parameter(place));
    }
    let metres = value.parse::<f32>().ok().filter(|m| (0.0..=1e6).contains(m));
    metres
        .map(Reach::Metres)
        .ok_or_else(|| format!("reach is metres, 0 to 1000000, or the name of a parameter, not \"{value}\""))
}

/// `// texture paper = paper.png as data: what it is printed on`
fn textures(text: &str, manifest: &Manifest) -> Result<Vec<TextureLine>, HeadError> {
    const FORM: &str = "write // texture NAME = FILE: ABOUT, or = FILE as data: ABOUT";
    let mut all: Vec<TextureLine> = Vec::new();
    for (i, line) in comment(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let Some(rest) = line.strip_prefix("texture ") else { continue };
        let at = |message: String| (i + 1, message);
        let form = || at(FORM.to_string());
        let (name, rest) = rest.split_once('=').ok_or_else(form)?;
        let name = identifier(name.trim()).map_err(at)?;
        // The about is for who reads the file.
        let (file, _) = rest.split_once(':').ok_or_else(form)?;
        let (file, srgb) = match file.trim().strip_suffix(" as data") {
            Some(file) => (file.trim(), false),
            None => (file.trim(), true),
        };
        if file.is_empty() {
            return Err(form());
        }
        if all.iter().any(|t| t.name == name) || manifest.options.iter().any(|o| o.name == name) {
            return Err(at(format!("{name} is declared twice")));
        }
        if all.len() == MOST_TEXTURES {
            return Err(at(format!("an effect has at most {MOST_TEXTURES} textures")));
        }
        all.push(TextureLine { name: name.into(), file: file.into(), srgb, line: i + 1 });
    }
    Ok(all)
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

    fn head_of(text: &str) -> Result<Head, HeadError> {
        head(text, &manifest(&format!("// effect: a\n// param high = 0.5 in 0..2: y\n{text}")).unwrap())
    }

    #[test]
    fn hooks_have_names() {
        let hook = |text: &str| head_of(text).map(|h| (h.hook, h.see_through, h.background));
        assert_eq!(hook("// effect: a"), Ok((Hook::Pixel, false, false)));
        assert_eq!(hook("// hook: surface\n// see_through: true"), Ok((Hook::Surface, true, false)));
        assert_eq!(hook("// background: true\n// hook: surface"), Ok((Hook::Surface, false, true)));
        assert_eq!(hook("// hook: lighting"), Ok((Hook::Lighting, false, false)));
        let error = |text: &str| head_of(text).unwrap_err();
        let unknown =
            "hook is pixel, picture, surface, vertex or lighting, not \"shell\" (others need a crate)";
        assert_eq!(error("// effect: a\n// hook: shell"), (2, unknown.into()));
        assert_eq!(error("// see_through: true").1, "see_through is of effects with hook: surface");
        assert_eq!(error("// background: true").1, "background is of effects with hook: surface");
        assert_eq!(error("// hook: surface\n// see_through: much").0, 2);
        let slip = "unknown word \"histroy\"; did you mean \"history\"?";
        assert_eq!(error("// hook: picture\n// histroy: 2"), (2, slip.into()));
        assert!(head_of("// see: another one\n// author: me\n// note of hooks: none").is_ok());
        assert_eq!(error("// hook: surface\n// background: much").1, "background is true or false");
    }

    #[test]
    fn what_moves_surfaces_says_how_far() {
        let reach =
            |text: &str| head_of(&format!("// hook: vertex\n{text}")).map(|h| (h.reach, h.along_model));
        assert_eq!(reach("// reach: 0.25\n// space: model"), Ok((Reach::Metres(0.25), true)));
        assert_eq!(reach("// reach: high"), Ok((Reach::Parameter(0), false)));
        assert!(reach("").unwrap_err().1.starts_with("an effect that moves surfaces says how far at most"));
        assert_eq!(reach("// reach: low").unwrap_err().0, 2);
        assert_eq!(reach("// reach: -1").unwrap_err().0, 2);
        assert_eq!(reach("// reach: 1\n// space: joint").unwrap_err(), (3, "space is world or model".into()));
    }

    #[test]
    fn pictures_have_passes_a_history_and_textures() {
        let made = head_of(
            "// hook: picture\n// passes: 2\n// history: 3\n// texture paper = a b.png: rough: very\n\
             // texture bumps = bumps.png as data: heights",
        )
        .unwrap();
        assert_eq!((made.passes, made.history), (2, 3));
        let texture = |name: &str, file: &str, srgb, line| TextureLine {
            name: name.into(),
            file: file.into(),
            srgb,
            line,
        };
        let files = [texture("paper", "a b.png", true, 4), texture("bumps", "bumps.png", false, 5)];
        assert_eq!(made.textures, files);
        let error = |text: &str| head_of(text).unwrap_err();
        assert_eq!(error("// history: 1"), (1, "history is of effects with hook: picture".into()));
        assert_eq!(error("// hook: picture\n// history: 17").1, "history is a whole number from 1 to 16");
        assert_eq!(error("// texture high = x.png: y"), (1, "high is declared twice".into()));
        assert!(error("// texture paper").1.starts_with("write // texture NAME"));
        let many: String = (0..5).map(|i| format!("// texture t{i} = x.png: y\n")).collect();
        assert_eq!(error(&many), (5, "an effect has at most 4 textures".into()));
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
