//! The header comment of an effect:
//!
//! ```text
//! // effect: grain
//! // about: film grain, the same in every frame
//! // version: 1
//! // hook: surface
//! // see_through: true
//! // background: true
//! // inputs: normals
//! // off: amount = 0
//! // param amount = 0.1 in 0..1: how strong it is
//! // param size = 1.5 px in 1..32: with a unit
//! // param count = int(3) in 1..9: a whole number
//! // param colored = false: another grain for each color
//! // param tint = color(gold): its color; or rgb(1, 0.5, 0), linear
//! // param drift = vec2(0, 1) in -1..1: 2 to 4 numbers
//! // param mode = soft of soft|hard: how it fades in the lights
//! // param fall = curve(0 0, 0.5 0.8, 1 1) in 0..1: keys x y of a curve
//! // texture paper = paper.png: what it is printed on
//! // texture bumps = bumps.png as data: heights
//! ```
//!
//! Further words: `hook: vertex` has `reach: METRES or PARAMETER` and `space: model`; `hook: image` has `passes: 2`, `halve: radius to 8`
//! and `history: 3`, or `pass bright = 1/2: ABOUT` for passes with textures (`passes.rs`); `hook: overlay` has
//! `count: NUMBER or PARAMETER`, `over: true or PARAMETER`, `of: scene`, `history: 64` and `joint hand = RightHand|hand.r: where it burns`.

use crate::header_error::{HeaderError, HeaderMistake};
use crate::parameters::{call_argument, parse_identifier, parse_image};
use crate::passes::{self, MAX_PASSES, PassLine, Scale};
use crate::signature::{NAMED_PASS, Signature, signature};
use choreo_plugin::suggest::{closest, did_you_mean};
use choreo_plugin::{Hook, Manifest, OptionKind, OptionSpec, Overlay, SurfaceInputs, ViewOrder};

pub(crate) const MAX_TEXTURES: usize = 4;
const MAX_JOINTS: usize = 16;
/// Largest number of previous frames; each is drawn again for every frame.
const MAX_HISTORY: u32 = 16;
/// Largest number of previous frames of an overlay; each is posed again for every frame.
const MAX_OVERLAY_HISTORY: u32 = 64;

/// The hook of an effect, and the settings of its header comment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Header {
    pub hook: Hook,
    /// The effect on surfaces returns alpha.
    pub see_through: bool,
    /// Whether an effect on surfaces also changes the background: if the value is above 0.5.
    pub background: Amount,
    /// Inputs of a surface in addition to those that the text names.
    pub inputs: SurfaceInputs,
    /// A text parameter whose choices name inputs: only the chosen input is read.
    pub chosen_input: Option<(usize, Vec<String>)>,
    /// Vertices are displaced in model space.
    pub in_model_space: bool,
    /// The largest displacement, metres.
    pub reach: Amount,
    /// Scale of the passes before the last, if they have no textures of their own.
    pub shrink: Option<Scale>,
    /// The parameter value with which the effect changes nothing.
    pub off: Option<OffCondition>,
    pub passes: u32,
    /// The passes before the last, if they have textures of their own.
    pub pass_lines: Vec<PassLine>,
    /// Whether an effect on images runs before, after or in place of the view transform.
    pub view: ViewOrder,
    pub history: u32,
    /// Number of lines or triangles around each actor.
    pub count: Amount,
    /// Whether the overlay is drawn over everything else: if the value is above 0.5.
    pub over: Amount,
    /// The overlay is made once for the scene, not around each actor.
    pub of_scene: bool,
    pub joints: Vec<JointLine>,
    pub textures: Vec<TextureLine>,
}

/// `off: NAME = VALUE`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OffCondition {
    pub name: String,
    /// Index of the parameter's number.
    pub index: usize,
    pub value: f32,
}

/// A number in the header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Amount {
    Number(f32),
    /// Index of a parameter number.
    Parameter(usize),
    /// Index of a flag: 1 minus its value.
    Not(usize),
}

impl Default for Amount {
    fn default() -> Amount {
        Amount::Number(0.0)
    }
}

impl Amount {
    pub(crate) fn of(self, parameters: &[f32]) -> f32 {
        let parameter = |index: usize| parameters.get(index).copied().unwrap_or(0.0);
        match self {
            Amount::Number(number) => number,
            Amount::Parameter(index) => parameter(index),
            Amount::Not(index) => 1.0 - parameter(index),
        }
    }
}

impl Header {
    /// The signature of the effect's function.
    pub(crate) fn signature(&self) -> &'static Signature {
        if self.pass_lines.is_empty() { signature(self.hook) } else { &NAMED_PASS }
    }

    /// Names of the functions that the renderers call, `effect` last.
    pub(crate) fn functions(&self) -> impl Iterator<Item = &str> {
        self.pass_lines.iter().map(|line| line.name.as_str()).chain(["effect"])
    }

    /// The surface inputs that the effect reads; `text` are those that its function names.
    pub(crate) fn inputs(&self, text: SurfaceInputs, parameters: &[f32]) -> SurfaceInputs {
        let mut inputs = SurfaceInputs {
            normals: text.normals || self.inputs.normals,
            uvs: text.uvs || self.inputs.uvs,
            joints: text.joints || self.inputs.joints,
            shadow: text.shadow || self.inputs.shadow,
            see_through: self.see_through,
        };
        if let Some((index, choices)) = &self.chosen_input {
            for (number, name) in choices.iter().enumerate() {
                if let Some(input) =
                    input_mut(&mut inputs, name).filter(|_| parameters.get(*index) != Some(&(number as f32)))
                {
                    *input = false;
                }
            }
        }
        inputs
    }
}

fn input_mut<'a>(inputs: &'a mut SurfaceInputs, name: &str) -> Option<&'a mut bool> {
    match name {
        "normals" => Some(&mut inputs.normals),
        "uvs" => Some(&mut inputs.uvs),
        "joints" => Some(&mut inputs.joints),
        "shadow" => Some(&mut inputs.shadow),
        _ => None,
    }
}

/// An image that the functions read, as a line of the header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TextureLine {
    pub name: String,
    /// Path relative to the effect's own file.
    pub file: String,
    /// The image has colors that are encoded as sRGB, rather than data.
    pub srgb: bool,
    /// Line, from 1.
    pub line: usize,
}

/// A joint that an overlay requests by name, as a line of the header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct JointLine {
    pub name: String,
    /// Names of the joint; the first one that an actor has is used.
    pub of: Vec<String>,
    /// Line, from 1.
    pub line: usize,
}

/// The fields of the header comment: line (from 1), name and value.
fn comment_fields(text: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    comment_lines(text).filter_map(|(i, line)| {
        let (name, value) = line.trim().trim_start_matches('/').trim().split_once(':')?;
        Some((i + 1, name.trim(), value.trim()))
    })
}

/// Files that the header names, even if the header has mistakes.
pub fn texture_files(text: &str) -> Vec<String> {
    let lines = comment_lines(without_byte_order_mark(text)).filter_map(|(_, line)| {
        let line = line.trim().trim_start_matches('/').trim();
        let value = |rest: &str| Some(rest.split_once('=')?.1.split_once(':')?.0.trim().to_string());
        match line.strip_prefix("texture ") {
            Some(rest) => Some(parse_image(&value(rest)?).0.to_string()),
            None => Some(
                parse_image(call_argument(&value(line.strip_prefix("param ")?)?, "texture")?).0.to_string(),
            ),
        }
    });
    let lines = lines.filter(|file| !file.is_empty());
    lines.take(MAX_TEXTURES).collect()
}

/// Whether a text is meant as an effect: its header has a line `// effect: NAME`, valid or not.
pub fn declares_effect(text: &str) -> bool {
    comment_fields(without_byte_order_mark(text)).any(|(_, name, _)| name == "effect")
}

/// The effect's name, even if the header has other mistakes. `None`: no name can refer to the effect.
pub fn effect_name(text: &str) -> Option<String> {
    // The last `effect` line counts, as in the manifest.
    let named = comment_fields(without_byte_order_mark(text)).filter(|(_, name, _)| *name == "effect").last();
    named.and_then(|(_, _, value)| Some(parse_identifier(value).ok()?.to_string()))
}

/// A text without the byte order mark that some editors put before it.
pub(crate) fn without_byte_order_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// Reads the settings of a header comment.
pub(crate) fn read(text: &str, manifest: &Manifest) -> Result<Header, HeaderError> {
    let joints = parse_joint_lines(text, manifest)?;
    let textures = parse_texture_lines(text, manifest)?;
    let names: Vec<&str> = textures.iter().map(|texture| texture.name.as_str()).collect();
    let pass_lines = passes::parse_pass_lines(text, manifest, &names)?;
    let mut header = Header { passes: 1, joints, textures, pass_lines, ..Header::default() };
    let mut hook_line = 1;
    for (line, _, value) in comment_fields(text).filter(|(_, name, _)| *name == "hook") {
        (hook_line, header.hook) =
            (line, parse_hook(value).map_err(|mistake| HeaderError { line, mistake })?);
    }
    let mut given = Vec::new();
    for (line, name, value) in comment_fields(text) {
        let of = header.set(name, value, manifest).map_err(|mistake| HeaderError { line, mistake })?;
        if let Some(of) = of.filter(|of| *of != header.hook) {
            let mistake = HeaderMistake::OtherHook { name: name.into(), hook: hook_word(of) };
            return Err(HeaderError { line, mistake });
        }
        if matches!(name, "passes" | "halve") && !header.pass_lines.is_empty() {
            return Err(HeaderError { line, mistake: HeaderMistake::WithPasses(name.into()) });
        }
        given.push(name);
    }
    if let Some(pass) = header.pass_lines.first().filter(|_| header.hook != Hook::Image) {
        let mistake = HeaderMistake::OtherHook { name: "pass".into(), hook: hook_word(Hook::Image) };
        return Err(HeaderError { line: pass.at.0, mistake });
    }
    if let Some(joint) = header.joints.first().filter(|_| header.hook != Hook::Overlay) {
        let mistake = HeaderMistake::OtherHook { name: "joint".into(), hook: hook_word(Hook::Overlay) };
        return Err(HeaderError { line: joint.line, mistake });
    }
    let mistake = match header.hook {
        Hook::Vertex if !given.contains(&"reach") => HeaderMistake::NoReach,
        Hook::Overlay if !given.contains(&"count") => HeaderMistake::NoCount,
        _ => return Ok(header),
    };
    Err(HeaderError { line: hook_line, mistake })
}

impl Header {
    /// Sets the field of a word, and returns the hook to which the word belongs. Unknown words are the author's own, and are ignored.
    fn set(&mut self, name: &str, value: &str, manifest: &Manifest) -> Result<Option<Hook>, HeaderMistake> {
        let allowed = |allowed: String| HeaderMistake::Allowed { name: name.into(), allowed };
        let flag = || value.parse::<bool>().map_err(|_| allowed("true or false".into()));
        let one_of = |no: &str, yes: &str| match value {
            _ if value == no => Ok(false),
            _ if value == yes => Ok(true),
            _ => Err(allowed(format!("{no} or {yes}"))),
        };
        let count = |most: u32| {
            let number = value.parse().ok().filter(|n| (1..=most).contains(n));
            number.ok_or_else(|| allowed(format!("a whole number from 1 to {most}")))
        };
        let of = match name {
            "see_through" => {
                self.see_through = flag()?;
                Hook::Surface
            }
            "background" => {
                self.background = parse_flag_amount(name, value, manifest)?;
                Hook::Surface
            }
            "inputs" => {
                self.read_inputs(value, manifest)?;
                Hook::Surface
            }
            "space" => {
                self.in_model_space = one_of("world", "model")?;
                Hook::Vertex
            }
            "reach" => {
                self.reach = parse_reach(value, manifest)?;
                Hook::Vertex
            }
            "passes" => {
                self.passes = count(MAX_PASSES)?;
                Hook::Image
            }
            "view" => {
                let replaces = one_of("before", "replaced")?;
                self.view = if replaces { ViewOrder::Replaces } else { ViewOrder::Before };
                // Both hooks for images are possible here.
                if self.hook == Hook::Pixel { Hook::Pixel } else { Hook::Image }
            }
            "halve" => {
                self.shrink = Some(parse_halving(value, manifest)?);
                Hook::Image
            }
            "history" if self.hook == Hook::Overlay => {
                self.history = count(MAX_OVERLAY_HISTORY)?;
                Hook::Overlay
            }
            "history" => {
                self.history = count(MAX_HISTORY)?;
                Hook::Image
            }
            "count" => {
                self.count = parse_element_count(value, manifest)?;
                Hook::Overlay
            }
            "over" => {
                self.over = parse_flag_amount(name, value, manifest)?;
                Hook::Overlay
            }
            "of" => {
                self.of_scene = one_of("actors", "scene")?;
                Hook::Overlay
            }
            "off" => {
                self.off = Some(parse_off_condition(value, manifest)?);
                return Ok(None);
            }
            _ => {
                return match misspelled_key(name) {
                    Some(meant) => Err(HeaderMistake::Misspelled { word: name.into(), meant: meant.into() }),
                    None => Ok(None),
                };
            }
        };
        Ok(Some(of))
    }

    /// `normals|uvs`, or the name of a text parameter whose choices are inputs.
    fn read_inputs(&mut self, value: &str, manifest: &Manifest) -> Result<(), HeaderMistake> {
        for name in value.split('|').map(str::trim) {
            let chosen = manifest.options.iter().enumerate().find(|(_, o)| o.name == name);
            if let Some((index, OptionKind::Text { one_of, .. })) = chosen.map(|(i, o)| (i, &o.kind)) {
                self.chosen_input = Some((manifest.first_number(index), one_of.clone()));
            } else {
                let input = input_mut(&mut self.inputs, name);
                *input.ok_or_else(|| {
                    refused("an input", "normals, uvs, joints or shadow", name, String::new())
                })? = true;
            }
        }
        Ok(())
    }
}

const HOOKS: [(&str, Hook); 8] = [
    ("pixel", Hook::Pixel),
    ("image", Hook::Image),
    ("surface", Hook::Surface),
    ("vertex", Hook::Vertex),
    ("lighting", Hook::Lighting),
    ("outline", Hook::Outline),
    ("overlay", Hook::Overlay),
    ("shutter", Hook::Shutter),
];

/// The error of a value that is not allowed. `near`: a suggestion.
fn refused(name: &str, allowed: impl Into<String>, value: &str, near: String) -> HeaderMistake {
    HeaderMistake::Value { name: name.into(), allowed: allowed.into(), value: value.into(), near }
}

/// The hook of a word in the header of an effect's file.
pub fn hook_named(word: &str) -> Option<Hook> {
    let named = match word {
        "picture" => "image",
        "shell" => "outline",
        other => other,
    };
    HOOKS.iter().find(|(word, _)| *word == named).map(|(_, hook)| *hook)
}

fn parse_hook(value: &str) -> Result<Hook, HeaderMistake> {
    hook_named(value).ok_or_else(|| {
        let words = HOOKS.map(|(word, _)| word);
        refused("hook", format!("one of {}", words.join(", ")), value, did_you_mean(value, words))
    })
}

/// All hooks.
pub fn hooks() -> impl Iterator<Item = Hook> {
    HOOKS.iter().map(|(_, hook)| *hook)
}

/// The word of a hook in the header of an effect's file.
pub fn hook_word(hook: Hook) -> &'static str {
    HOOKS.iter().find(|(_, of)| *of == hook).map_or("pixel", |(word, _)| word)
}

const KNOWN_KEYS: [&str; 17] = [
    "effect",
    "about",
    "version",
    "hook",
    "see_through",
    "background",
    "inputs",
    "space",
    "reach",
    "passes",
    "halve",
    "view",
    "history",
    "count",
    "over",
    "of",
    "off",
];

/// The known word of which `name` is a typing mistake. All other words are the author's own.
fn misspelled_key(name: &str) -> Option<&'static str> {
    if KNOWN_KEYS.contains(&name) || name.contains(char::is_whitespace) {
        return None;
    }
    closest(name, KNOWN_KEYS).filter(|word| word.len().abs_diff(name.len()) <= 2)
}

/// The parameter with this name, if it is one number, and the index of that number.
fn number_parameter<'a>(name: &str, manifest: &'a Manifest) -> Option<(&'a OptionKind, usize)> {
    let place = manifest.options.iter().position(|o| o.name == name)?;
    let kind = &manifest.options[place].kind;
    let is_number = matches!(kind, OptionKind::Number { .. } | OptionKind::Integer { .. });
    is_number.then(|| (kind, manifest.first_number(place)))
}

fn parse_reach(value: &str, manifest: &Manifest) -> Result<Amount, HeaderMistake> {
    if let Some((_, index)) = number_parameter(value, manifest) {
        return Ok(Amount::Parameter(index));
    }
    let metres = value.parse::<f32>().ok().filter(|m| (0.0..=1e6).contains(m));
    metres.map(Amount::Number).ok_or_else(|| {
        refused(
            "reach",
            "metres, 0 to 1000000, or the name of a parameter",
            value,
            similar_parameter(value, manifest),
        )
    })
}

fn parse_element_count(value: &str, manifest: &Manifest) -> Result<Amount, HeaderMistake> {
    let most = Overlay::MOST;
    if manifest.options.iter().any(|o| o.name == value) {
        let bounds = |kind: &OptionKind| match kind {
            OptionKind::Number { min, max, .. } => [*min, *max],
            OptionKind::Integer { min, max, .. } => [*min as f64, *max as f64],
            _ => [f64::NAN; 2],
        };
        return match number_parameter(value, manifest).map(|(kind, index)| (bounds(kind), index)) {
            Some(([min, max], index)) if min >= 0.0 && max <= most as f64 => Ok(Amount::Parameter(index)),
            _ => Err(HeaderMistake::CountRange { name: value.into(), most }),
        };
    }
    let number = value.parse::<u32>().ok().filter(|n| (1..=most as u32).contains(n));
    number.map(|n| Amount::Number(n as f32)).ok_or_else(|| {
        let allowed = format!("a whole number from 1 to {most}, or the name of a parameter");
        refused("count", allowed, value, similar_parameter(value, manifest))
    })
}

/// `true`, `false`, the name of a flag, or `not` and the name of a flag.
fn parse_flag_amount(name: &str, value: &str, manifest: &Manifest) -> Result<Amount, HeaderMistake> {
    if let Ok(flag) = value.parse::<bool>() {
        return Ok(Amount::Number(f32::from(u8::from(flag))));
    }
    let (flag, negated) = value.strip_prefix("not ").map_or((value, false), |flag| (flag.trim(), true));
    let is_flag = |kind: &OptionKind| matches!(kind, OptionKind::Bool { .. });
    let index = manifest.options.iter().position(|o| o.name == flag && is_flag(&o.kind));
    let number = index.map(|index| manifest.first_number(index));
    number.map(|index| if negated { Amount::Not(index) } else { Amount::Parameter(index) }).ok_or_else(|| {
        refused(
            name,
            "true, false, or the name of a parameter that is",
            value,
            similar_parameter(value, manifest),
        )
    })
}

/// `radius to 8`: passes before the last are halved until the parameter, a share of the image's height, is 8 pixels or less.
pub(crate) fn parse_halving(value: &str, manifest: &Manifest) -> Result<Scale, HeaderMistake> {
    let read = || {
        let (length, most) = value.split_once(" to ")?;
        let (_, index) = number_parameter(length.trim(), manifest)?;
        let most = most.trim().parse().ok().filter(|most| (1..=256).contains(most))?;
        Some(Scale::Halved(Amount::Parameter(index), most))
    };
    read().ok_or(HeaderMistake::ExpectedSyntax("halve: PARAMETER to PIXELS, 1 to 256"))
}

/// `strength = 0`: a number parameter, and the value with which the effect changes nothing.
fn parse_off_condition(value: &str, manifest: &Manifest) -> Result<OffCondition, HeaderMistake> {
    let (name, at) = value.split_once('=').map(|(name, at)| (name.trim(), at.trim())).unwrap_or((value, ""));
    let (_, index) = number_parameter(name, manifest)
        .ok_or_else(|| HeaderMistake::NoOff { name: name.into(), near: similar_parameter(name, manifest) })?;
    let at = at.parse().ok().filter(|at: &f32| at.is_finite());
    let value = at.ok_or(HeaderMistake::ExpectedSyntax("off: PARAMETER = NUMBER"))?;
    Ok(OffCondition { name: name.into(), index, value })
}

/// Suggestion of a parameter whose name is similar to the value.
fn similar_parameter(value: &str, manifest: &Manifest) -> String {
    did_you_mean(value, manifest.options.iter().map(|o| o.name.as_str()).filter(|name| *name != value))
}

/// Reads lines such as `// texture paper = paper.png as data: what it is printed on`.
fn parse_texture_lines(text: &str, manifest: &Manifest) -> Result<Vec<TextureLine>, HeaderError> {
    const TEXTURE_SYNTAX: HeaderMistake =
        HeaderMistake::ExpectedSyntax("texture NAME = FILE: ABOUT, or = FILE as data: ABOUT");
    let mut all: Vec<TextureLine> = Vec::new();
    for (i, line) in comment_lines(text) {
        let line = line.trim().trim_start_matches('/').trim();
        let at = |mistake: HeaderMistake| mistake.at(i);
        let syntax_error = || at(TEXTURE_SYNTAX);
        let most = HeaderMistake::TooMany { most: MAX_TEXTURES, what: "textures" };
        let of_parameter = |option: &&OptionSpec| {
            let rest = line.strip_prefix("param ").and_then(|rest| rest.split_once('='));
            rest.is_some_and(|(name, _)| name.trim() == option.name)
        };
        let option = manifest.options.iter().find(of_parameter);
        if let Some(OptionSpec { name, kind: OptionKind::Texture { default, srgb }, .. }) = option {
            if all.len() == MAX_TEXTURES {
                return Err(at(most));
            }
            all.push(TextureLine { name: name.clone(), file: default.clone(), srgb: *srgb, line: i + 1 });
            continue;
        }
        let Some(rest) = line.strip_prefix("texture ") else { continue };
        let (name, rest) = rest.split_once('=').ok_or_else(syntax_error)?;
        let name = parse_identifier(name.trim()).map_err(at)?;
        // The description is not used; it is for readers of the file.
        let (file, _) = rest.split_once(':').ok_or_else(syntax_error)?;
        let (file, srgb) = parse_image(file);
        if file.is_empty() {
            return Err(syntax_error());
        }
        if all.iter().any(|t| t.name == name) || manifest.options.iter().any(|o| o.name == name) {
            return Err(at(HeaderMistake::Twice(name.into())));
        }
        if all.len() == MAX_TEXTURES {
            return Err(at(most));
        }
        all.push(TextureLine { name: name.into(), file: file.into(), srgb, line: i + 1 });
    }
    Ok(all)
}

/// Reads lines such as `// joint hand = RightHand|hand.r: where it burns`.
fn parse_joint_lines(text: &str, manifest: &Manifest) -> Result<Vec<JointLine>, HeaderError> {
    const JOINT_SYNTAX: HeaderMistake =
        HeaderMistake::ExpectedSyntax("joint NAME = JOINT: ABOUT, or = JOINT|OTHER: ABOUT");
    let mut all: Vec<JointLine> = Vec::new();
    for (i, line) in comment_lines(text) {
        let Some(rest) = line.trim().trim_start_matches('/').trim().strip_prefix("joint ") else { continue };
        let at = |mistake: HeaderMistake| mistake.at(i);
        let (name, rest) = rest.split_once('=').ok_or_else(|| at(JOINT_SYNTAX))?;
        let name = parse_identifier(name.trim()).map_err(at)?;
        // Names of joints can have colons, too, so the separator has a blank.
        let (of, _) = rest.split_once(": ").ok_or_else(|| at(JOINT_SYNTAX))?;
        let of: Vec<String> =
            of.split('|').map(|joint| joint.trim().to_string()).filter(|joint| !joint.is_empty()).collect();
        if of.is_empty() {
            return Err(at(JOINT_SYNTAX));
        }
        if all.iter().any(|j| j.name == name) || manifest.options.iter().any(|o| o.name == name) {
            return Err(at(HeaderMistake::Twice(name.into())));
        }
        if all.len() == MAX_JOINTS {
            return Err(at(HeaderMistake::TooMany { most: MAX_JOINTS, what: "joints" }));
        }
        all.push(JointLine { name: name.into(), of, line: i + 1 });
    }
    Ok(all)
}

/// Lines of the header comment, numbered from 0.
pub(crate) fn comment_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().take_while(|(_, l)| l.trim().is_empty() || l.trim_start().starts_with("//"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::parse_manifest;

    fn header_of(text: &str) -> Result<Header, (usize, String)> {
        let made = read(
            text,
            &parse_manifest(&format!("// effect: a\n// param high = 0.5 in 0..2: y\n{text}")).unwrap(),
        );
        made.map_err(|e| (e.line, e.mistake.to_string()))
    }

    #[test]
    fn every_hook_has_a_name() {
        let hook = |text: &str| header_of(text).map(|h| (h.hook, h.see_through, h.background.of(&[0.0; 8])));
        assert_eq!(hook("// effect: a"), Ok((Hook::Pixel, false, 0.0)));
        assert_eq!(hook("// hook: surface\n// see_through: true"), Ok((Hook::Surface, true, 0.0)));
        assert_eq!(hook("// background: true\n// hook: surface"), Ok((Hook::Surface, false, 1.0)));
        assert_eq!(hook("// hook: lighting"), Ok((Hook::Lighting, false, 0.0)));
        let error = |text: &str| header_of(text).unwrap_err();
        let known = "hook is one of pixel, image, surface, vertex, lighting, outline, overlay, shutter, not ";
        let unknown = format!("{known}\"overlai\"; did you mean \"overlay\"?");
        assert_eq!(error("// effect: a\n// hook: overlai"), (2, unknown));
        assert_eq!(error("// see_through: true").1, "see_through is only for effects with hook: surface");
        assert_eq!(error("// background: true").1, "background is only for effects with hook: surface");
        assert_eq!(error("// hook: surface\n// see_through: much").0, 2);
        let slip = "unknown word \"histroy\"; did you mean \"history\"?";
        assert_eq!(error("// hook: image\n// histroy: 2"), (2, slip.into()));
        assert!(header_of("// see: another one\n// author: me\n// note of hooks: none").is_ok());
        let flag = "background is true, false, or the name of a parameter that is, not \"much\"";
        assert_eq!(error("// hook: surface\n// background: much").1, flag);
        for word in ["image", "picture"] {
            assert_eq!(header_of(&format!("// hook: {word}")).map(|h| h.hook), Ok(Hook::Image));
        }
    }

    #[test]
    fn vertex_effects_must_give_their_reach() {
        let reach =
            |text: &str| header_of(&format!("// hook: vertex\n{text}")).map(|h| (h.reach, h.in_model_space));
        assert_eq!(reach("// reach: 0.25\n// space: model"), Ok((Amount::Number(0.25), true)));
        assert_eq!(reach("// reach: high"), Ok((Amount::Parameter(0), false)));
        assert!(
            reach("")
                .unwrap_err()
                .1
                .starts_with("an effect that moves vertices must give its largest distance")
        );
        assert_eq!(reach("// reach: low").unwrap_err().0, 2);
        assert_eq!(reach("// reach: -1").unwrap_err().0, 2);
        assert_eq!(reach("// reach: 1\n// space: joint").unwrap_err(), (3, "space is world or model".into()));
    }

    #[test]
    fn overlays_must_give_their_count() {
        let overlay = |text: &str| {
            header_of(&format!(
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
        assert!(error("").1.starts_with("an overlay must give its number of lines or triangles"));
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
            |text: &str| header_of(&format!("// hook: overlay\n// count: 1\n{text}")).map(|h| h.joints);
        let of = ["mixamorig:RightHand", "hand.r"].map(String::from).to_vec();
        let hand = JointLine { name: "hand".into(), of, line: 3 };
        assert_eq!(joints("// joint hand = mixamorig:RightHand | hand.r: where: here"), Ok(vec![hand]));
        assert_eq!(joints("// joint high = Hand: x"), Err((3, "high is declared twice".into())));
        assert!(joints("// joint hand = : x").unwrap_err().1.starts_with("write // joint NAME"));
        assert_eq!(
            header_of("// joint hand = Hand: x").unwrap_err().1,
            "joint is only for effects with hook: overlay"
        );
        assert_eq!(header_of("// count: 3").unwrap_err().1, "count is only for effects with hook: overlay");
    }

    #[test]
    fn off_names_a_parameter_and_its_value() {
        let off = |text: &str| header_of(text).map(|h| h.off);
        assert_eq!(
            off("// off: high = 0"),
            Ok(Some(OffCondition { name: "high".into(), index: 0, value: 0.0 }))
        );
        assert_eq!(off("// hook: image"), Ok(None));
        let unknown =
            "write // off: PARAMETER = NUMBER; no parameter \"hihg\" is a number; did you mean \"high\"?";
        assert_eq!(off("// off: hihg = 0"), Err((1, unknown.into())));
        assert_eq!(off("// off: high"), Err((1, "write // off: PARAMETER = NUMBER".into())));
    }

    #[test]
    fn image_effects_have_passes_history_and_textures() {
        let made = header_of(
            "// hook: image\n// passes: 2\n// history: 3\n// texture paper = a b.png: rough: very\n\
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
        let error = |text: &str| header_of(text).unwrap_err();
        assert_eq!(error("// history: 1"), (1, "history is only for effects with hook: image".into()));
        assert_eq!(error("// hook: image\n// history: 17").1, "history is a whole number from 1 to 16");
        let chosen = "// effect: a\n// param map = texture(a.png): m\n// texture paper = b.png as data: p\n// param white = texture(data): w";
        let manifest = crate::parameters::parse_manifest(chosen).unwrap();
        let files: Vec<(&str, &str, bool)> =
            vec![("map", "a.png", true), ("paper", "b.png", false), ("white", "", false)];
        let made = parse_texture_lines(chosen, &manifest).unwrap();
        assert_eq!(made.iter().map(|t| (&*t.name, &*t.file, t.srgb)).collect::<Vec<_>>(), files);
        assert_eq!(super::texture_files(chosen), ["a.png", "b.png"]);
        assert_eq!(error("// texture high = x.png: y"), (1, "high is declared twice".into()));
        assert!(error("// texture paper").1.starts_with("write // texture NAME"));
        let many: String = (0..5).map(|i| format!("// texture t{i} = x.png: y\n")).collect();
        assert_eq!(error(&many), (5, "an effect has at most 4 textures".into()));
    }
}
