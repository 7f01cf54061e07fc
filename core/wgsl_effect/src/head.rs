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
//! Of `hook: vertex` also `reach: METRES or PARAMETER` and `space: model`, of `hook: picture` `passes: 2` and `history: 3`, of
//! `hook: overlay` `count: NUMBER or PARAMETER`, `over: true or PARAMETER`, `of: scene`, `history: 64` and
//! `joint hand = RightHand|hand.r: where it burns`.

use crate::parameters::identifier;
use choreo_plugin::suggest::{closest, did_you_mean};
use choreo_plugin::{Hook, Manifest, OptionKind, Overlay};

/// Line from 1, and what is wrong with it.
pub type HeadError = (usize, String);

pub const MOST_TEXTURES: usize = 4;
const MOST_JOINTS: usize = 16;
const MOST_PASSES: u32 = 16;
/// Frames back; each is one more to draw for every frame.
const MOST_HISTORY: u32 = 16;
/// Frames back of an overlay; each is one more to pose.
const MOST_POSES: u32 = 64;

/// Hook of the effect, and its options.
#[derive(Clone, Debug, PartialEq)]
pub struct Head {
    pub hook: Hook,
    /// A surface makes alpha.
    pub see_through: bool,
    /// An effect on surfaces changes the background too.
    pub background: bool,
    /// Vertices are moved along the mesh's own axes.
    pub along_model: bool,
    /// How far corners are moved at most, metres.
    pub reach: Amount,
    pub passes: u32,
    pub history: u32,
    /// Lines or triangles of its own, around each body.
    pub count: Amount,
    /// Not 0: drawn over everything.
    pub over: Amount,
    /// They are made once for the scene, not around each body.
    pub of_scene: bool,
    pub joints: Vec<JointLine>,
    pub textures: Vec<TextureLine>,
}

/// A number in the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    Number(f32),
    /// As a parameter says, by its place.
    Parameter(usize),
}

impl Amount {
    pub fn of(self, parameters: &[f32; 8]) -> f32 {
        match self {
            Amount::Number(number) => number,
            Amount::Parameter(place) => parameters.get(place).copied().unwrap_or(0.0),
        }
    }
}

/// A picture that the functions read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureLine {
    pub name: String,
    /// File beside the effect's own file.
    pub file: String,
    /// Its numbers are colors, encoded as sRGB.
    pub srgb: bool,
    /// Line number from 1.
    pub line: usize,
}

/// A joint that an overlay asks for by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointLine {
    pub name: String,
    /// The first of these that a body has.
    pub of: Vec<String>,
    /// Line number from 1.
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
    let lines = comment(without_mark(text)).filter_map(|(_, line)| {
        let rest = line.trim().trim_start_matches('/').trim().strip_prefix("texture ")?;
        let (file, _) = rest.split_once('=')?.1.split_once(':')?;
        let file = file.trim();
        Some(file.strip_suffix(" as data").unwrap_or(file).trim().to_string())
    });
    lines.take(MOST_TEXTURES).collect()
}

/// Whether a text is meant as an effect: its head has a line `// effect: NAME`, right or wrong.
pub fn is_meant(text: &str) -> bool {
    fields(without_mark(text)).any(|(_, name, _)| name == "effect")
}

/// The effect's name, whatever else is wrong with its head. `None`: it cannot be used by any name.
pub fn name(text: &str) -> Option<String> {
    // As in the manifest, the last one counts.
    let named = fields(without_mark(text)).filter(|(_, name, _)| *name == "effect").last();
    named.and_then(|(_, _, value)| Some(identifier(value).ok()?.to_string()))
}

/// A text without the byte order mark that some editors put before it.
pub fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

pub fn head(text: &str, manifest: &Manifest) -> Result<Head, HeadError> {
    let mut head = Head {
        hook: Hook::Pixel,
        see_through: false,
        background: false,
        along_model: false,
        reach: Amount::Number(0.0),
        passes: 1,
        history: 0,
        count: Amount::Number(0.0),
        over: Amount::Number(0.0),
        of_scene: false,
        joints: joints(text, manifest)?,
        textures: textures(text, manifest)?,
    };
    let mut hook_line = 1;
    for (line, _, value) in fields(text).filter(|(_, name, _)| *name == "hook") {
        hook_line = line;
        head.hook = match value {
            "pixel" => Hook::Pixel,
            "picture" => Hook::Picture,
            "surface" => Hook::Surface,
            "vertex" => Hook::Vertex,
            "lighting" => Hook::Lighting,
            "shell" => Hook::Shell,
            "overlay" => Hook::Overlay,
            other => {
                let near = did_you_mean(other, HOOKS);
                let known = HOOKS.join(", ");
                return Err((
                    line,
                    format!("hook is one of {known}, not \"{other}\"{near} (the shutter needs a crate)"),
                ));
            }
        };
    }
    let (mut reaches, mut counts) = (false, false);
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
                let poses = head.hook == Hook::Overlay;
                head.history = count(if poses { MOST_POSES } else { MOST_HISTORY })?;
                if poses { Hook::Overlay } else { Hook::Picture }
            }
            "count" => {
                counts = true;
                head.count = things(value, manifest).map_err(|message| (line, message))?;
                Hook::Overlay
            }
            "over" => {
                head.over = truth(value, manifest).map_err(|message| (line, message))?;
                Hook::Overlay
            }
            "of" => {
                head.of_scene = match value {
                    "actors" => false,
                    "scene" => true,
                    _ => return Err((line, "of is actors or scene".into())),
                };
                Hook::Overlay
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
    if let Some(joint) = head.joints.first().filter(|_| head.hook != Hook::Overlay) {
        return Err((joint.line, "joint is of effects with hook: overlay".into()));
    }
    match head.hook {
        Hook::Vertex if !reaches => Err((
            hook_line,
            "an effect that moves surfaces says how far at most: // reach: METRES, or the name of a parameter".into(),
        )),
        Hook::Overlay if !counts => Err((
            hook_line,
            "an overlay says how many lines or triangles it has: // count: NUMBER, or the name of a parameter".into(),
        )),
        _ => Ok(head),
    }
}

const HOOKS: [&str; 7] = ["pixel", "picture", "surface", "vertex", "lighting", "shell", "overlay"];

const WORDS: [&str; 13] = [
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
    "count",
    "over",
    "of",
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
        Hook::Overlay => "overlay",
        _ => "pixel",
    }
}

fn reach(value: &str, manifest: &Manifest) -> Result<Amount, String> {
    if let Some(place) = manifest.options.iter().position(|o| o.name == value) {
        return Ok(Amount::Parameter(place));
    }
    let metres = value.parse::<f32>().ok().filter(|m| (0.0..=1e6).contains(m));
    metres.map(Amount::Number).ok_or_else(|| {
        let near = near(value, manifest);
        format!("reach is metres, 0 to 1000000, or the name of a parameter, not \"{value}\"{near}")
    })
}

fn things(value: &str, manifest: &Manifest) -> Result<Amount, String> {
    let most = Overlay::MOST;
    if let Some(place) = manifest.options.iter().position(|o| o.name == value) {
        return match manifest.options[place].kind {
            OptionKind::Number { min, max, .. } if min >= 0.0 && max <= most as f64 => {
                Ok(Amount::Parameter(place))
            }
            _ => Err(format!("count: the parameter {value} must be a number within 0..{most}")),
        };
    }
    let number = value.parse::<u32>().ok().filter(|n| (1..=most as u32).contains(n));
    number.map(|n| Amount::Number(n as f32)).ok_or_else(|| {
        let near = near(value, manifest);
        format!("count is a whole number from 1 to {most}, or the name of a parameter, not \"{value}\"{near}")
    })
}

fn truth(value: &str, manifest: &Manifest) -> Result<Amount, String> {
    if let Ok(flag) = value.parse::<bool>() {
        return Ok(Amount::Number(f32::from(u8::from(flag))));
    }
    let is_flag = |kind: &OptionKind| matches!(kind, OptionKind::Bool { .. });
    let place = manifest.options.iter().position(|o| o.name == value && is_flag(&o.kind));
    place.map(Amount::Parameter).ok_or_else(|| {
        let near = near(value, manifest);
        format!("over is true, false, or the name of a parameter that is, not \"{value}\"{near}")
    })
}

/// Did it mean a parameter?
fn near(value: &str, manifest: &Manifest) -> String {
    did_you_mean(value, manifest.options.iter().map(|o| o.name.as_str()).filter(|name| *name != value))
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
        // The description is for readers of the file.
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

/// `// joint hand = RightHand|hand.r: where it burns`
fn joints(text: &str, manifest: &Manifest) -> Result<Vec<JointLine>, HeadError> {
    const FORM: &str = "write // joint NAME = JOINT: ABOUT, or = JOINT|OTHER: ABOUT";
    let mut all: Vec<JointLine> = Vec::new();
    for (i, line) in comment(text) {
        let Some(rest) = line.trim().trim_start_matches('/').trim().strip_prefix("joint ") else { continue };
        let at = |message: String| (i + 1, message);
        let (name, rest) = rest.split_once('=').ok_or_else(|| at(FORM.into()))?;
        let name = identifier(name.trim()).map_err(at)?;
        // Names of joints have colons too.
        let (of, _) = rest.split_once(": ").ok_or_else(|| at(FORM.into()))?;
        let of: Vec<String> =
            of.split('|').map(|joint| joint.trim().to_string()).filter(|joint| !joint.is_empty()).collect();
        if of.is_empty() {
            return Err(at(FORM.into()));
        }
        if all.iter().any(|j| j.name == name) || manifest.options.iter().any(|o| o.name == name) {
            return Err(at(format!("{name} is declared twice")));
        }
        if all.len() == MOST_JOINTS {
            return Err(at(format!("an effect names at most {MOST_JOINTS} joints")));
        }
        all.push(JointLine { name: name.into(), of, line: i + 1 });
    }
    Ok(all)
}

/// Its lines, from 0.
pub fn comment(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().take_while(|(_, l)| l.trim().is_empty() || l.trim_start().starts_with("//"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::manifest;

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
        let known = "hook is one of pixel, picture, surface, vertex, lighting, shell, overlay, not ";
        let unknown = format!("{known}\"overlai\"; did you mean \"overlay\"? (the shutter needs a crate)");
        assert_eq!(error("// effect: a\n// hook: overlai"), (2, unknown));
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
        assert_eq!(reach("// reach: 0.25\n// space: model"), Ok((Amount::Number(0.25), true)));
        assert_eq!(reach("// reach: high"), Ok((Amount::Parameter(0), false)));
        assert!(reach("").unwrap_err().1.starts_with("an effect that moves surfaces says how far at most"));
        assert_eq!(reach("// reach: low").unwrap_err().0, 2);
        assert_eq!(reach("// reach: -1").unwrap_err().0, 2);
        assert_eq!(reach("// reach: 1\n// space: joint").unwrap_err(), (3, "space is world or model".into()));
    }

    #[test]
    fn overlays_say_how_many() {
        let overlay = |text: &str| {
            head_of(&format!(
                "// param n = 9 in 0..50: count\n// param thru = false: over\n// hook: overlay\n{text}"
            ))
            .map(|h| (h.hook, h.count, h.over, h.of_scene))
        };
        let (number, parameter) = (Amount::Number, Amount::Parameter);
        assert_eq!(overlay("// count: 64"), Ok((Hook::Overlay, number(64.0), number(0.0), false)));
        let all = overlay("// count: n\n// over: thru\n// of: scene");
        assert_eq!(all, Ok((Hook::Overlay, parameter(1), parameter(2), true)));
        let error = |text: &str| overlay(text).unwrap_err();
        assert_eq!(error("").0, 3);
        assert!(error("").1.starts_with("an overlay says how many lines or triangles it has"));
        let not = |what: &str| {
            format!("count is a whole number from 1 to 100000, or the name of a parameter, not {what}")
        };
        assert_eq!(error("// count: 0"), (4, not("\"0\"")));
        assert_eq!(error("// count: hihg"), (4, not("\"hihg\"; did you mean \"high\"?")));
        assert_eq!(error("// count: thru").1, "count: the parameter thru must be a number within 0..100000");
        assert_eq!(error("// count: 1\n// of: actor"), (5, "of is actors or scene".into()));
        let over =
            "over is true, false, or the name of a parameter that is, not \"thr\"; did you mean \"thru\"?";
        assert_eq!(error("// count: 1\n// over: thr"), (5, over.into()));
        let joints =
            |text: &str| head_of(&format!("// hook: overlay\n// count: 1\n{text}")).map(|h| h.joints);
        let of = ["mixamorig:RightHand", "hand.r"].map(String::from).to_vec();
        let hand = JointLine { name: "hand".into(), of, line: 3 };
        assert_eq!(joints("// joint hand = mixamorig:RightHand | hand.r: where: here"), Ok(vec![hand]));
        assert_eq!(joints("// joint high = Hand: x"), Err((3, "high is declared twice".into())));
        assert!(joints("// joint hand = : x").unwrap_err().1.starts_with("write // joint NAME"));
        assert_eq!(
            head_of("// joint hand = Hand: x").unwrap_err().1,
            "joint is of effects with hook: overlay"
        );
        assert_eq!(head_of("// count: 3").unwrap_err().1, "count is of effects with hook: overlay");
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
}
