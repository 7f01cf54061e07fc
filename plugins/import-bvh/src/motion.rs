//! The MOTION section: frames become curves.

use crate::Convention;
use crate::hierarchy::{Channel, Joint, MotionText};
use choreo_importer_kit::text::{Lines, count as counted, integer, next_word, number, shown, words};
use choreo_importer_kit::{Notes, Problem, Progress, Result};
use choreo_motion::{Clip, Curve, FrameRate, Interpolation, Path, Time};
use glam::{DQuat, DVec3};
use std::sync::Arc;

/// Frame limit: 46 hours at 60 Hz.
pub(crate) const MAX_FRAMES: i64 = 10_000_000;
/// Limit of key times, the same in all importers: about 115 days, seconds.
pub(crate) const MAX_SECS: f64 = 1e7;

/// Reads the clip; `None` where the file has no frames.
pub(crate) fn read(
    rest: MotionText<'_>,
    joints: &[Joint],
    convention: &Convention,
    name: &str,
    progress: &Progress<'_>,
    notes: &Notes,
) -> Result<Option<Clip>> {
    let total = rest.bytes.len();
    let Some(mut lines) = rest.lines() else {
        notes.warn(format!("line {}", rest.line), "the file has no MOTION; it is a skeleton without a clip");
        return Ok(None);
    };
    let (frames_line, count) = header(&mut lines, "Frames", rest.line)?;
    let declared = integer(count).filter(|n| *n >= 0).ok_or_else(|| {
        Problem::new(format!("line {frames_line}"), format!("\"{}\" is not a number of frames", shown(count)))
    })?;
    if declared > MAX_FRAMES {
        let what = format!("{declared} frames; the limit is {MAX_FRAMES}");
        return Err(Problem::new(format!("line {frames_line}"), what));
    }
    let (time_line, secs) = header(&mut lines, "Frame Time", frames_line)?;
    let step = Step::read(secs, time_line, notes)?;
    if step.at(declared).as_secs() > MAX_SECS {
        let what = format!("{declared} frames of {} s; the limit is {MAX_SECS} s", shown(secs));
        return Err(Problem::new(format!("line {time_line}"), what));
    }

    let mut tracks = Tracks::new(joints, convention);
    let tell = |left: usize| progress.reach(total - left.min(total));
    let read = frames(&mut lines, &mut tracks, declared, frames_line, (&tell, notes))?;
    if read == 0 {
        notes.warn(format!("line {frames_line}"), "there are no frames, so there is no clip");
        return Ok(None);
    }
    let times: Arc<[Time]> = (0..read).map(|frame| step.at(frame)).collect();
    let clip = Clip::new(name.to_string(), joints.len(), tracks.into_curves(&times));
    clip.map(Some).map_err(|e| Problem::new("MOTION", e.to_string()))
}

/// Reads `key: value`, in any letter case and with any spaces.
fn header<'a>(lines: &mut Lines<'a>, key: &str, last_line: usize) -> Result<(usize, &'a [u8])> {
    let cut = || {
        Problem::new(format!("line {last_line}"), format!("the file ends where \"{key}: …\" should be"))
            .hint("the file was cut off; export or copy it again")
    };
    let (line, text) = lines.find(|(_, l)| !l.trim_ascii().is_empty()).ok_or_else(cut)?;
    let (name, value) = match text.iter().position(|b| *b == b':') {
        Some(colon) => (&text[..colon], text[colon + 1..].trim_ascii()),
        None => (text, &b""[..]),
    };
    match words(name).eq_by_case(key) {
        true => Ok((line, value)),
        false => Err(Problem::new(
            format!("line {line}"),
            format!("\"{}\" stands where \"{key}: …\" should be", shown(text.trim_ascii())),
        )),
    }
}

trait EqByCase {
    fn eq_by_case(self, key: &str) -> bool;
}

impl<'a, I: Iterator<Item = &'a [u8]>> EqByCase for I {
    fn eq_by_case(self, key: &str) -> bool {
        let (mine, wanted): (Vec<_>, Vec<_>) = (self.collect(), words(key.as_bytes()).collect());
        mine.len() == wanted.len() && mine.iter().zip(&wanted).all(|(a, b)| a.eq_ignore_ascii_case(b))
    }
}

/// Spacing of the frames.
enum Step {
    Rate(FrameRate),
    Secs(f64),
}

impl Step {
    /// Reads the frame time. A rounded frame time ("0.0333333") becomes the whole number of frames a second it stands for, so
    /// that keys stay on video frames in clips of any length. The accepted difference is half of the last digit in the file.
    fn read(text: &[u8], line: usize, notes: &Notes) -> Result<Step> {
        let place = || format!("line {line}");
        let secs = number(text).filter(|s| *s >= 0.0).ok_or_else(|| {
            Problem::new(place(), format!("\"{}\" is not a frame time in seconds", shown(text)))
        })?;
        if secs == 0.0 {
            notes.warn(place(), "the frame time is 0; 30 frames a second are used");
            return Ok(Step::Rate(FrameRate { num: 30, den: 1 }));
        }
        if secs < 1e-6 {
            return Err(Problem::new(
                place(),
                format!("a frame time of {secs} s; at least 0.000001 is allowed"),
            ));
        }
        let digits =
            text.iter().skip_while(|b| **b != b'.').skip(1).take_while(|b| b.is_ascii_digit()).count();
        let plain = text.iter().all(|b| b.is_ascii_digit() || *b == b'.');
        let fps = (1.0 / secs).round();
        let half_digit = 0.5001 / [1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10][digits.clamp(3, 10) - 3];
        if plain && digits >= 3 && (1.0..=1000.0).contains(&fps) && (1.0 / fps - secs).abs() <= half_digit {
            return Ok(Step::Rate(FrameRate { num: fps as u32, den: 1 }));
        }
        Ok(Step::Secs(secs))
    }

    fn at(&self, frame: i64) -> Time {
        match self {
            Step::Rate(rate) => rate.time_of(frame),
            Step::Secs(secs) => Time::from_secs(frame as f64 * secs),
        }
    }
}

/// Reads up to `declared` frames, one on each line. Returns the number of frames read.
fn frames(
    lines: &mut Lines<'_>,
    tracks: &mut Tracks<'_>,
    declared: i64,
    frames_line: usize,
    (tell, notes): (&dyn Fn(usize) -> Result<()>, &Notes),
) -> Result<i64> {
    let width = tracks.width;
    let mut values = vec![0.0; width];
    let (mut read, mut surplus, mut longer) = (0, 0, 0);
    let full = |(_, l): &(usize, &[u8])| !l.trim_ascii().is_empty();
    while let Some((line, text)) = lines.find(full) {
        tell(lines.left())?;
        if read == declared {
            surplus += 1;
            continue;
        }
        let mut rest = text;
        let mut given = 0;
        while given < width {
            let Some(word) = next_word(&mut rest) else { break };
            values[given] = number(word).ok_or_else(|| {
                let what = format!("number {} of the frame is \"{}\"", given + 1, shown(word));
                Problem::new(format!("line {line}"), what)
                    .hint("a frame holds finite numbers, with a point for the decimals")
            })?;
            given += 1;
        }
        if given < width {
            let what = format!("the frame has {given} numbers; the joints have {width} channels");
            if lines.clone().find(full).is_none() && read > 0 {
                notes.warn(format!("line {line}"), format!("{what}; this last frame is left out"));
                break;
            }
            return Err(Problem::new(format!("line {line}"), what)
                .hint("every frame is one line with a number for every channel"));
        }
        if next_word(&mut rest).is_some() {
            longer += 1;
            if longer == 1 {
                let what = format!(
                    "the frame has more numbers than the joints' {width} channels; the surplus is left out"
                );
                notes.warn(format!("line {line}"), what);
            }
        }
        tracks.push(&values);
        read += 1;
    }
    if longer > 1 {
        notes.warn(
            "MOTION",
            format!("{} with more numbers than the joints have channels", counted(longer, "frame")),
        );
    }
    if surplus > 0 {
        notes.warn("MOTION", format!("{surplus} more lines than frames were announced; they are left out"));
    }
    if read < declared {
        let what = format!("{declared} frames are announced, but only {read} are there; those are used");
        notes.warn(format!("line {frames_line}"), what);
    }
    Ok(read)
}

/// The channels of one joint, and its keys so far.
struct Track<'a> {
    joint: u32,
    root: bool,
    channels: &'a [Channel],
    offset: DVec3,
    translations: Option<Vec<f32>>,
    rotations: Option<Vec<f32>>,
}

struct Tracks<'a> {
    tracks: Vec<Track<'a>>,
    width: usize,
    convention: Convention,
}

impl<'a> Tracks<'a> {
    fn new(joints: &'a [Joint], convention: &Convention) -> Tracks<'a> {
        let tracks = joints.iter().enumerate().filter(|(_, j)| !j.channels.is_empty()).map(|(index, j)| {
            let has = |wanted: fn(&Channel) -> bool| j.channels.iter().any(wanted).then(Vec::new);
            Track {
                joint: index as u32,
                root: j.parent.is_none(),
                channels: &j.channels,
                offset: j.offset,
                translations: has(|c| matches!(c, Channel::Position(_))),
                rotations: has(|c| matches!(c, Channel::Rotation(_))),
            }
        });
        let width = joints.iter().map(|j| j.channels.len()).sum();
        Tracks { tracks: tracks.collect(), width, convention: *convention }
    }

    fn push(&mut self, values: &[f64]) {
        let mut values = values;
        for track in &mut self.tracks {
            let (mine, rest) = values.split_at(track.channels.len());
            values = rest;
            track.push(mine, &self.convention);
        }
    }

    fn into_curves(self, times: &Arc<[Time]>) -> Vec<Curve> {
        let mut curves = Vec::with_capacity(self.tracks.len() * 2);
        for track in self.tracks {
            let keys = [(Path::Translation, track.translations), (Path::Rotation, track.rotations)];
            for (path, values) in keys {
                let Some(values) = values else { continue };
                let times = times.clone();
                curves.push(Curve {
                    joint: track.joint,
                    path,
                    interpolation: Interpolation::Linear,
                    times,
                    values: values.into(),
                });
            }
        }
        curves
    }
}

impl Track<'_> {
    /// Adds a key from the numbers of a frame. Rotations multiply in channel order: `Zrotation Xrotation Yrotation` is the matrix
    /// Z · X · Y. Position channels replace the offset, as the exporting programs mean it.
    fn push(&mut self, values: &[f64], convention: &Convention) {
        let mut position = self.offset;
        let mut rotation = DQuat::IDENTITY;
        for (channel, value) in self.channels.iter().zip(values) {
            match channel {
                Channel::Position(axis) => position[*axis] = *value,
                Channel::Rotation(axis) => rotation *= axis_rotation(*axis, *value),
            }
        }
        if self.root {
            position = convention.turn * position;
            rotation = convention.turn * rotation;
        }
        if let Some(keys) = &mut self.translations {
            keys.extend((position * convention.scale).as_vec3().to_array());
        }
        if let Some(keys) = &mut self.rotations {
            keys.extend(rotation.normalize().as_quat().to_array());
        }
    }
}

fn axis_rotation(axis: usize, degrees: f64) -> DQuat {
    let half = degrees * (std::f64::consts::PI / 360.0);
    let (sin, cos) = libm::sincos(half);
    let mut xyz = [0.0; 3];
    xyz[axis] = sin;
    DQuat::from_xyzw(xyz[0], xyz[1], xyz[2], cos)
}
