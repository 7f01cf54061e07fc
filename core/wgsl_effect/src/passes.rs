//! Passes that write textures of their own, which later passes read by name: their lines in the header comment, the textures that each pass
//! reads, and the functions that are supplied for them.
//!
//! ```text
//! // pass bright = 1/2: the light that spills over
//! // pass spread = halve radius to 8: that light, blurred
//! ```

use crate::environment::HostFunction;
use crate::header::{Amount, comment_lines, parse_halving};
use crate::header_error::{HeaderError, HeaderMistake};
use crate::parameters::parse_identifier;
use crate::scene_inputs;
use crate::signature::signature;
use crate::tokens::{Tokens, line_and_column};
use choreo_plugin::{Hook, ImagePass, Manifest};
use std::collections::BTreeMap;

/// Largest number of passes of one effect, the last one included.
pub(crate) const MAX_PASSES: u32 = 16;
/// Largest N of the scale 1/N of a texture.
const MAX_SCALE_DIVISOR: u32 = 64;

/// Scale of a pass's image against the whole image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Scale {
    /// `1/N`.
    Fraction(u32),
    /// Halved until the length, a share of the image's height, is at most this number of pixels.
    Halved(Amount, u32),
}

impl Scale {
    /// Downscale factor, per axis.
    pub(crate) fn factor(self, size: [u32; 2], parameters: &[f32]) -> u32 {
        match self {
            Scale::Fraction(parts) => parts,
            Scale::Halved(length, most) => {
                let mut factor = 1;
                while length.of(parameters) * size[1] as f32 > (most * factor) as f32 && factor < size[1] {
                    factor *= 2;
                }
                factor
            }
        }
    }
}

/// A pass before the last one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PassLine {
    /// The name of its function and of its texture.
    pub name: String,
    pub scale: Scale,
    /// Line and column of the name, from 1.
    pub at: (usize, usize),
}

/// Names of the functions that read the texture `name`.
fn functions_of(name: &str) -> [String; 3] {
    ["at", "uv", "size"].map(|what| format!("{name}_{what}"))
}

/// Parses the `// pass` lines of a header comment. `taken`: names of the effect's textures.
pub(crate) fn parse_pass_lines(
    text: &str,
    manifest: &Manifest,
    taken: &[&str],
) -> Result<Vec<PassLine>, HeaderError> {
    const PASS_SYNTAX: HeaderMistake = HeaderMistake::ExpectedSyntax(
        "pass NAME = 1/2: ABOUT, with 1 or 1/2 to 1/64, or = halve PARAMETER to PIXELS: ABOUT",
    );
    let mut all: Vec<PassLine> = Vec::new();
    for (i, line) in comment_lines(text) {
        let Some(rest) = line.trim().trim_start_matches('/').trim().strip_prefix("pass ") else { continue };
        let at = |mistake: HeaderMistake| mistake.at(i);
        let (name, rest) = rest.split_once('=').ok_or_else(|| at(PASS_SYNTAX))?;
        let name = parse_identifier(name.trim()).map_err(at)?;
        let (scale, _) = rest.split_once(':').ok_or_else(|| at(PASS_SYNTAX))?;
        let scale = parse_scale(scale.trim(), manifest).ok_or_else(|| at(PASS_SYNTAX))?;
        let is_taken = |name: &str| taken.contains(&name) || manifest.options.iter().any(|o| o.name == name);
        if is_taken(name) || all.iter().any(|pass| pass.name == name) {
            return Err(at(HeaderMistake::Twice(name.into())));
        }
        let functions = functions_of(name);
        let own = [name].into_iter().chain(functions.iter().map(String::as_str));
        if let Some(function) =
            own.into_iter().find(|function| is_taken(function) || is_supplied_function(function))
        {
            return Err(at(HeaderMistake::PassName { name: name.into(), function: function.into() }));
        }
        if all.len() + 1 == MAX_PASSES as usize {
            return Err(at(HeaderMistake::TooMany {
                most: MAX_PASSES as usize - 1,
                what: "passes with textures",
            }));
        }
        // The name follows "pass " in the line.
        let column = line.find("pass ").and_then(|start| Some(start + 5 + line[start + 5..].find(name)?));
        let column = column.map_or(1, |byte| line[..byte].chars().count() + 1);
        all.push(PassLine { name: name.into(), scale, at: (i + 1, column) });
    }
    Ok(all)
}

fn is_supplied_function(function: &str) -> bool {
    let own = signature(Hook::Image);
    let supplied = own.functions.iter().chain(own.with_history).map(|(name, ..)| *name);
    let others = HELPERS.iter().map(|(name, _)| *name).chain(["effect", "curve_at"]);
    scene_inputs::names(Hook::Image).chain(supplied).chain(others).any(|name| name == function)
}

/// Reads a scale: `1`, `1/4` or `halve radius to 8`.
fn parse_scale(text: &str, manifest: &Manifest) -> Option<Scale> {
    if let Some(halved) = text.strip_prefix("halve ") {
        return parse_halving(halved, manifest).ok();
    }
    let parts = if text == "1" { 1 } else { text.strip_prefix("1/")?.trim().parse().ok()? };
    (1..=MAX_SCALE_DIVISOR).contains(&parts).then_some(Scale::Fraction(parts))
}

/// Functions that texts with such passes may call in addition to those of all effects on images.
const HELPERS: [(&str, &str); 2] = [
    (
        "uv_at",
        "fn uv_at(at: vec2<i32>) -> vec2<f32> {
    return (vec2<f32>(at) + 0.5) * f32(shrink_factor()) / vec2<f32>(original_size());
}",
    ),
    (
        "picture_uv",
        "fn picture_uv(uv: vec2<f32>) -> vec4<f32> {
    let place = clamp(uv * vec2<f32>(picture_size()) - 0.5, vec2<f32>(-1.0), vec2<f32>(picture_size()));
    let c = vec2<i32>(floor(place));
    let f = place - floor(place);
    let above = mix(picture(c), picture(c + vec2<i32>(1, 0)), f.x);
    return mix(above, mix(picture(c + vec2<i32>(0, 1)), picture(c + vec2<i32>(1, 1)), f.x), f.y);
}",
    ),
];

/// Names of the helpers.
pub(crate) fn helpers() -> impl Iterator<Item = &'static str> {
    HELPERS.iter().map(|(name, _)| *name)
}

/// WGSL of the helpers that a text calls and does not declare itself.
pub(crate) fn helpers_called(author: &str) -> String {
    let functions = parse_functions(author);
    let is_called = |name: &str| functions.iter().any(|f| f.calls.iter().any(|(called, _)| *called == name));
    let is_declared = |name: &str| functions.iter().any(|f| f.name == name);
    let own = HELPERS.iter().filter(|(name, _)| is_called(name) && !is_declared(name));
    own.map(|(_, wgsl)| format!("{wgsl}\n")).collect()
}

/// The functions that read textures of passes: name, a declaration that stands for it, and the code that runs on the CPU.
pub(crate) fn supplied_functions(
    lines: &[PassLine],
) -> impl Iterator<Item = (String, String, HostFunction)> + '_ {
    lines.iter().enumerate().flat_map(|(i, line)| {
        let [at, uv, size] = functions_of(&line.name);
        let of_at = format!("fn {at}(at: vec2<i32>) -> vec4<f32> {{ return vec4(f32(at.x)); }}\n");
        let of_uv = format!("fn {uv}(uv: vec2<f32>) -> vec4<f32> {{ return uv.xyxy; }}\n");
        let of_size = format!("fn {size}() -> vec2<i32> {{ return vec2(1); }}\n");
        [
            (at, of_at, HostFunction::PassTexture(i)),
            (uv, of_uv, HostFunction::PassBetween(i)),
            (size, of_size, HostFunction::PassSize(i)),
        ]
    })
}

/// A function of a text: its name, and the functions that it calls, with the byte of each call.
struct Function<'a> {
    name: &'a str,
    calls: Vec<(&'a str, usize)>,
}

fn parse_functions(text: &str) -> Vec<Function<'_>> {
    let mut all: Vec<Function> = Vec::new();
    let mut before = [(0, ""); 2];
    for (at, token) in Tokens::of(text) {
        let [(_, first), (start, name)] = before;
        if token == "(" && first == "fn" {
            all.push(Function { name, calls: Vec::new() });
        } else if let (true, Some(function)) = (token == "(", all.last_mut()) {
            function.calls.push((name, start));
        }
        before = [before[1], (at, token)];
    }
    all
}

/// The textures that the function of a pass reads, directly or through other functions: number, and byte of the first call.
fn reads_of(entry: &str, text: &str, lines: &[PassLine]) -> BTreeMap<u32, usize> {
    let functions = parse_functions(text);
    let (mut reached, mut reads) = (vec![entry], BTreeMap::new());
    let mut next = 0;
    while let Some(name) = reached.get(next).copied() {
        next += 1;
        for (called, byte) in functions.iter().filter(|f| f.name == name).flat_map(|f| &f.calls) {
            if functions.iter().any(|f| f.name == *called) && !reached.contains(called) {
                reached.push(called);
            }
            let read =
                (0..).zip(lines).find(|(_, line)| functions_of(&line.name).iter().any(|f| f == called));
            if let Some((number, line)) = read {
                // A pass may ask for the size of its own texture.
                let own_size = line.name == entry && called.ends_with("_size");
                if !own_size {
                    reads.entry(number).or_insert(*byte);
                }
            }
        }
    }
    reads
}

/// All passes, the last one included, with the earlier textures that they read; empty if the header declares no passes.
pub(crate) fn passes(text: &str, lines: &[PassLine]) -> Vec<ImagePass> {
    if lines.is_empty() {
        return Vec::new();
    }
    let names = lines.iter().map(|line| line.name.as_str()).chain(["effect"]);
    let pass = |(number, name): (u32, &str)| {
        let reads: Vec<u32> = reads_of(name, text, lines).into_keys().filter(|read| *read < number).collect();
        ImagePass::new(name, &reads)
    };
    (0..).zip(names).map(pass).collect()
}

/// The first mistake in how passes read each other's textures, with its line and column.
pub(crate) fn find_mistake(text: &str, lines: &[PassLine]) -> Option<((usize, usize), String)> {
    if lines.is_empty() {
        return None;
    }
    let functions = parse_functions(text);
    let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).chain(["effect"]).collect();
    let reads: Vec<BTreeMap<u32, usize>> = names.iter().map(|name| reads_of(name, text, lines)).collect();
    for (line, name) in lines.iter().zip(&names) {
        if !functions.iter().any(|f| f.name == *name) {
            let form = crate::signature::NAMED_PASS.text.replacen("effect", name, 1);
            return Some((line.at, format!("the pass {name} has no function; write {form}")));
        }
    }
    for (number, (name, read)) in names.iter().zip(&reads).enumerate() {
        let Some((later, byte)) = read.iter().find(|(read, _)| **read as usize >= number) else { continue };
        let later = *later as usize;
        let what = match later == number {
            true => format!("the pass {name} reads its own texture; a pass reads those declared above it"),
            false if reads_indirectly(&reads, later, number) => {
                format!(
                    "the passes {name} and {} read each other; a pass reads those declared above it",
                    names[later]
                )
            }
            false => {
                format!("the pass {} runs after {name}; move its line above that of {name}", names[later])
            }
        };
        return Some((line_and_column(text, *byte), what));
    }
    let most = ImagePass::MOST_READ;
    if let Some((read, name)) = reads.iter().zip(&names).find(|(read, _)| read.len() > most) {
        let byte = read.values().nth(most).copied().unwrap_or(0);
        return Some((
            line_and_column(text, byte),
            format!("{name} reads {} textures of passes, at most {most}", read.len()),
        ));
    }
    let is_read = |number: u32| reads.iter().any(|read| read.contains_key(&number));
    let (_, line) = (0..).zip(lines).find(|(number, _)| !is_read(*number))?;
    let [at, uv, _] = functions_of(&line.name);
    let what = format!(
        "nothing reads the texture of the pass {}; call {at} or {uv}, or leave out this line",
        line.name
    );
    Some((line.at, what))
}

/// Whether a pass reads the texture of another pass, directly or through other passes.
fn reads_indirectly(reads: &[BTreeMap<u32, usize>], from: usize, to: usize) -> bool {
    let mut reached = vec![from];
    let mut next = 0;
    while let Some(pass) = reached.get(next).copied() {
        next += 1;
        for read in reads[pass].keys().map(|read| *read as usize) {
            if !reached.contains(&read) {
                reached.push(read);
            }
        }
    }
    reached.contains(&to)
}
