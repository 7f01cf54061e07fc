//! HIERARCHY: joints with offsets and channels.

use crate::Convention;
use choreo_importer_kit::text::{Lines, integer, number, shown};
use choreo_importer_kit::{Notes, Problem, Result};
use choreo_motion::Transform;
use glam::{DVec3, Quat};

/// Joint limit, far above any motion capture; bounds the memory of joints and their bones.
pub(crate) const MAX_JOINTS: usize = 16_384;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Channel {
    /// Position along x, y or z: 0, 1, 2.
    Position(usize),
    /// Rotation around x, y or z, degrees.
    Rotation(usize),
}

#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub name: String,
    pub parent: Option<u32>,
    /// Offset in the file's units.
    pub offset: DVec3,
    /// Channels in the order of the numbers in a frame.
    pub channels: Vec<Channel>,
}

impl Joint {
    pub(crate) fn rest(&self, convention: &Convention) -> Transform {
        let offset = self.offset * convention.scale;
        let (translation, rotation) = match self.parent {
            Some(_) => (offset, Quat::IDENTITY),
            None => (convention.turn * offset, convention.turn.as_quat()),
        };
        Transform { translation: translation.as_vec3(), rotation, ..Transform::IDENTITY }
    }
}

/// The file after the hierarchy: its bytes from MOTION on, and the number of their first line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionText<'a> {
    pub bytes: &'a [u8],
    pub line: usize,
}

/// Splits the text into words and braces, regardless of lines.
struct Tokens<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Tokens<'a> {
    fn skip_space(&mut self) {
        while let Some(b) = self.bytes.get(self.at).filter(|b| b.is_ascii_whitespace() || **b == 0x0b) {
            let ends = *b == b'\n' || (*b == b'\r' && self.bytes.get(self.at + 1) != Some(&b'\n'));
            self.line += usize::from(ends);
            self.at += 1;
        }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let rest = self.bytes.get(self.at..)?;
        let length = match rest.first()? {
            b'{' | b'}' => 1,
            _ => rest
                .iter()
                .position(|b| b.is_ascii_whitespace() || matches!(b, b'{' | b'}'))
                .unwrap_or(rest.len()),
        };
        self.at += length;
        Some(&rest[..length])
    }

    /// The rest of the line up to a brace, because names may contain spaces.
    fn name(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|b| matches!(b, b'\n' | b'\r' | b'{' | b'}')).unwrap_or(rest.len());
        self.at += length;
        rest[..length].trim_ascii()
    }

    fn problem(&self, what: impl Into<String>) -> Problem {
        Problem::new(format!("line {}", self.line), what)
    }

    /// The next word, or an error at the end of the file that names the expected word.
    fn expect_word(&mut self, wanted: &str) -> Result<&'a [u8]> {
        self.next().ok_or_else(|| {
            self.problem(format!("the file ends where {wanted} should be"))
                .hint("the file was cut off; export or copy it again")
        })
    }

    fn expect_number(&mut self, wanted: &str) -> Result<f64> {
        let word = self.expect_word(wanted)?;
        number(word).ok_or_else(|| self.problem(format!("\"{}\" is not a number; {wanted}", shown(word))))
    }
}

pub(crate) fn read<'a>(bytes: &'a [u8], notes: &Notes) -> Result<(Vec<Joint>, MotionText<'a>)> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut tokens = Tokens { bytes: text, at: 0, line: 1 };
    let first = tokens.expect_word("HIERARCHY")?;
    if !first.eq_ignore_ascii_case(b"HIERARCHY") {
        return Err(tokens
            .problem(format!("starts with \"{}\", not with HIERARCHY", shown(first)))
            .hint("this is not a BVH file"));
    }
    let mut joints: Vec<Joint> = Vec::new();
    // Open joints and end sites, by index.
    let mut open: Vec<usize> = Vec::new();
    loop {
        if open.is_empty() {
            tokens.skip_space();
            let rest = MotionText { bytes: &text[tokens.at..], line: tokens.line };
            match tokens.next() {
                None => return finish(joints, rest, &tokens),
                Some(w) if w.eq_ignore_ascii_case(b"MOTION") => return finish(joints, rest, &tokens),
                Some(w) if w.eq_ignore_ascii_case(b"ROOT") => {
                    begin(&mut tokens, &mut joints, &mut open, SectionKind::Joint)?;
                }
                Some(w) => {
                    return Err(
                        tokens.problem(format!("\"{}\" stands where ROOT or MOTION should be", shown(w)))
                    );
                }
            }
            continue;
        }
        let joint = open[open.len() - 1];
        let word = tokens.expect_word("OFFSET, CHANNELS, JOINT, End Site or }")?;
        if word == b"}" {
            open.pop();
        } else if word.eq_ignore_ascii_case(b"OFFSET") {
            let mut offset = [0.0; 3];
            for value in &mut offset {
                *value = tokens.expect_number("OFFSET must have three numbers")?;
            }
            joints[joint].offset = DVec3::from(offset);
        } else if word.eq_ignore_ascii_case(b"CHANNELS") {
            channels(&mut tokens, &mut joints[joint])?;
        } else if word.eq_ignore_ascii_case(b"JOINT") {
            begin(&mut tokens, &mut joints, &mut open, SectionKind::Joint)?;
        } else if word.eq_ignore_ascii_case(b"End") {
            begin(&mut tokens, &mut joints, &mut open, SectionKind::EndSite)?;
        } else {
            let what =
                format!("\"{}\" stands where OFFSET, CHANNELS, JOINT, End Site or }} should be", shown(word));
            return Err(tokens.problem(what));
        }
        if joints.len() == MAX_JOINTS {
            return Err(tokens.problem(format!("more than {MAX_JOINTS} joints, which is the limit")));
        }
        if joints[joint].name.is_empty() {
            let line = format!("line {}", tokens.line);
            joints[joint].name = format!("joint {joint}");
            notes.warn(line, format!("a joint has no name; it is called \"joint {joint}\""));
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum SectionKind {
    Joint,
    EndSite,
}

fn begin(
    tokens: &mut Tokens<'_>,
    joints: &mut Vec<Joint>,
    open: &mut Vec<usize>,
    kind: SectionKind,
) -> Result<()> {
    let parent = open.last().copied();
    let name = match (kind, parent) {
        (SectionKind::EndSite, Some(parent)) => {
            tokens.name();
            format!("{}_end", joints[parent].name)
        }
        _ => String::from_utf8_lossy(tokens.name()).into_owned(),
    };
    let brace = tokens.expect_word("{")?;
    if brace != b"{" {
        return Err(tokens.problem(format!("\"{}\" stands where {{ should be", shown(brace))));
    }
    open.push(joints.len());
    joints.push(Joint { name, parent: parent.map(|p| p as u32), offset: DVec3::ZERO, channels: Vec::new() });
    Ok(())
}

fn channels(tokens: &mut Tokens<'_>, joint: &mut Joint) -> Result<()> {
    let word = tokens.expect_word("the number of channels")?;
    let count = integer(word)
        .filter(|n| (0..=6).contains(n))
        .ok_or_else(|| tokens.problem(format!("\"{}\" channels; a joint has 0 to 6", shown(word))))?;
    if !joint.channels.is_empty() {
        return Err(tokens.problem(format!("joint \"{}\" has CHANNELS twice", joint.name)));
    }
    for _ in 0..count {
        let word = tokens.expect_word("a channel's name")?;
        let lower = word.to_ascii_lowercase();
        let axis = lower.first().map_or(3, |b| usize::from(b.wrapping_sub(b'x')));
        let channel = match &lower[1.min(lower.len())..] {
            b"position" if axis < 3 => Channel::Position(axis),
            b"rotation" if axis < 3 => Channel::Rotation(axis),
            _ => {
                let what = format!("unknown channel \"{}\"", shown(word));
                return Err(tokens
                    .problem(what)
                    .hint("channels are Xposition, Yposition, Zposition, Xrotation, Yrotation, Zrotation"));
            }
        };
        joint.channels.push(channel);
    }
    Ok(())
}

fn finish<'a>(
    joints: Vec<Joint>,
    rest: MotionText<'a>,
    tokens: &Tokens<'_>,
) -> Result<(Vec<Joint>, MotionText<'a>)> {
    match joints.is_empty() {
        true => {
            Err(tokens.problem("HIERARCHY has no ROOT").hint("the file was cut off; export or copy it again"))
        }
        false => Ok((joints, rest)),
    }
}

impl<'a> MotionText<'a> {
    /// The lines after MOTION.
    pub(crate) fn lines(&self) -> Option<Lines<'a>> {
        let mut lines = Lines::from(self.bytes, self.line);
        lines.next().map(|_| lines)
    }
}
