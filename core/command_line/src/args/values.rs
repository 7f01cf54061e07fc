//! Parsers for values of the command line: frame ranges, sizes, rates, times.

use crate::failure::Failure;
use choreo_motion::{FrameRate, Time};
use choreo_script::Limits;
use std::ops::Range;

/// Largest number of frames in one run, 92 hours at 30 frames per second; a larger number is a typing error.
pub(crate) const MAX_FRAMES: i64 = 10_000_000;

fn usage_error<T>(text: String) -> Result<T, Failure> {
    Err(Failure::Usage(text))
}

/// Fails if the command would refuse the value of this option. Options that take any text always pass.
pub(crate) fn check_option_value(option: &str, text: &str) -> Result<(), Failure> {
    match option {
        "size" => parse_size(text).map(drop),
        "fps" => parse_fps(text).map(drop),
        "samples" => parse_samples(text).map(drop),
        "jobs" => parse_jobs(text).map(drop),
        "timeout" => parse_timeout(text).map(drop),
        _ => Ok(()),
    }
}

/// Parses frame numbers within the `total` of the scene; the result is sorted, each number once. Forms: `0..120`, `0..=119`, `30..`,
/// `..60`, `7`, every 24th frame of a range as `0..240:24`, and lists of these, `0,5,9..20`.
pub(crate) fn parse_frames(text: &str, total: i64) -> Result<Vec<i64>, Failure> {
    let mut frames = Vec::new();
    for part in text.split(',') {
        let (range, step) = parse_frame_range(text, part, total)?;
        frames.extend(range.step_by(step));
    }
    frames.sort_unstable();
    frames.dedup();
    Ok(frames)
}

/// Parses `part`, one item of the list `text`: a frame or a range, and the step between its frames.
fn parse_frame_range(text: &str, part: &str, total: i64) -> Result<(Range<i64>, usize), Failure> {
    let number = |part: &str| -> Result<i64, Failure> {
        match part.trim().parse::<i64>() {
            Ok(n) if (0..=MAX_FRAMES).contains(&n) => Ok(n),
            _ => usage_error(format!(
                "--frames {text}: \"{part}\" is not a frame number from 0 to {MAX_FRAMES}; \
                 write 0..120, 0..=119, 30.., 7, 0..240:24 or 0,5,9..20"
            )),
        }
    };
    let part = part.trim();
    let (part, step) = match part.split_once(':') {
        None => (part, 1),
        Some((range, step)) => match number(step)? {
            0 => return usage_error(format!("--frames {text}: the step after : must be at least 1")),
            step if range.contains("..") || range.contains('-') => (range, step),
            _ => {
                return usage_error(format!(
                    "--frames {text}: a step is written after a range, as 0..240:24"
                ));
            }
        },
    };
    let range = match part.split_once("..") {
        // Open Job Description writes ranges in the form 0-119.
        None => match part.split_once('-').filter(|(from, _)| !from.is_empty()) {
            Some((from, last)) => number(from)?..number(last)? + 1,
            None => number(part)?..number(part)? + 1,
        },
        Some((from, to)) => {
            let from = if from.is_empty() { 0 } else { number(from)? };
            let to = match to.strip_prefix('=') {
                Some(last) => number(last)? + 1,
                None if to.is_empty() => total.max(from),
                None => number(to)?,
            };
            from..to
        }
    };
    if range.is_empty() && range.start < total {
        return usage_error(format!("--frames {text}: no frame is in that range; the end is not included"));
    }
    if range.start >= total || range.end > total {
        return usage_error(format!("--frames {text}: the scene has {total} frames, 0..{total}"));
    }
    Ok((range, step as usize))
}

/// `--size`: width and height in pixels.
pub(crate) fn parse_size(text: &str) -> Result<[u32; 2], Failure> {
    let parsed = text.split_once(['x', 'X', '×']).and_then(|(w, h)| {
        Some([w.trim().parse::<u32>().ok()?, h.trim().parse::<u32>().ok()?])
            .filter(|s| s.iter().all(|n| (1..=16384).contains(n)))
    });
    parsed.map_or_else(
        || {
            usage_error(format!(
                "--size {text}: write WIDTHxHEIGHT, each from 1 to 16384 pixels, as 1280x720"
            ))
        },
        Ok,
    )
}

/// `--fps`: frames per second, as a decimal number or a fraction.
pub(crate) fn parse_fps(text: &str) -> Result<FrameRate, Failure> {
    let rate = match text.split_once('/') {
        Some((num, den)) => match (num.parse::<u32>(), den.parse::<u32>()) {
            (Ok(num), Ok(den))
                if den > 0 && (0.001..=1000.0).contains(&(f64::from(num) / f64::from(den))) =>
            {
                Some(FrameRate { num, den })
            }
            _ => None,
        },
        None => text.parse().ok().and_then(|fps| FrameRate::from_fps(fps).ok()),
    };
    rate.map_or_else(
        || {
            usage_error(format!(
                "--fps {text}: write frames per second from 0.001 to 1000 with up to 6 decimal places, as 30, 29.97 or 30000/1001"
            ))
        },
        Ok,
    )
}

/// `--samples`: samples per pixel.
pub(crate) fn parse_samples(text: &str) -> Result<u32, Failure> {
    match text {
        "1" => Ok(1),
        "4" => Ok(4),
        _ => usage_error(format!("--samples {text}: 1 (fast) or 4 (smooth edges)")),
    }
}

/// `--at`: seconds.
pub(crate) fn parse_at(text: &str) -> Result<Time, Failure> {
    match text.parse::<f64>() {
        // 100 hours on either side of zero.
        Ok(secs) if secs.abs() <= 360_000.0 => Ok(Time::from_secs(secs)),
        _ => usage_error(format!("--at {text}: write seconds from -360000 to 360000, as 1.5")),
    }
}

/// `--length`: seconds, above 0.
pub(crate) fn parse_length(text: &str) -> Result<Time, Failure> {
    match text.parse::<f64>() {
        Ok(secs) if secs > 0.0 && secs <= 360_000.0 => Ok(Time::from_secs(secs)),
        _ => usage_error(format!("--length {text}: write seconds above 0, to 360000, as 4 or 2.5")),
    }
}

/// `--timeout`: seconds, above 0.
pub(crate) fn parse_timeout(text: &str) -> Result<f64, Failure> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0 && s.is_finite());
    seconds.ok_or_else(|| Failure::Usage(format!("--timeout {text}: write seconds above 0, as 60 or 0.5")))
}

/// `--jobs`: number of threads.
pub(crate) fn parse_jobs(text: &str) -> Result<usize, Failure> {
    match text.parse::<usize>() {
        Ok(n) if (1..=1024).contains(&n) => Ok(n),
        _ => usage_error(format!("--jobs {text}: a number of threads from 1 to 1024")),
    }
}

/// Default limits of scripts, changed by each `--limit NAME=NUMBER`.
pub(crate) fn parse_limits(given: &[String]) -> Result<Limits, Failure> {
    let mut limits = Limits::default();
    for limit in given {
        limits.set(limit).map_err(|e| Failure::Usage(format!("--limit {limit}: {e}")))?;
    }
    Ok(limits)
}

/// Splits NAME=VALUE. `flag`: name of the option, for messages.
pub(crate) fn split_name_value<'a>(flag: &str, text: &'a str) -> Result<(&'a str, &'a str), Failure> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim(), value)),
        _ => usage_error(format!("{flag} {text}: write NAME=VALUE")),
    }
}

/// The name in NAME=VALUE; the whole text if it has no `=`.
pub(crate) fn name_of(text: &str) -> &str {
    text.split('=').next().unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_ranges_are_parsed_in_every_form() {
        for (text, expected) in [
            ("0..120", 0..120),
            ("0..=119", 0..120),
            ("0-119", 0..120),
            ("30..", 30..120),
            ("..60", 0..60),
            ("7", 7..8),
            ("..", 0..120),
        ] {
            assert_eq!(parse_frames(text, 120).unwrap(), expected.collect::<Vec<_>>(), "{text}");
        }
        for (text, expected) in [
            ("0..100:24", &[0, 24, 48, 72, 96][..]),
            ("..=96:48", &[0, 48, 96]),
            ("0-96:48,7-8", &[0, 7, 8, 48, 96]),
            ("100..:10", &[100, 110]),
            ("0, 5,9..12", &[0, 5, 9, 10, 11]),
            ("11,3..6:2,3", &[3, 5, 11]),
        ] {
            assert_eq!(parse_frames(text, 120).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn messages_about_bad_frame_ranges_show_valid_forms() {
        for (text, expected) in [
            (
                "a..b",
                "--frames a..b: \"a\" is not a frame number from 0 to 10000000; write 0..120, 0..=119, 30.., 7, \
                 0..240:24 or 0,5,9..20",
            ),
            ("5..5", "--frames 5..5: no frame is in that range; the end is not included"),
            ("9..3", "--frames 9..3: no frame is in that range; the end is not included"),
            ("0..121", "--frames 0..121: the scene has 120 frames, 0..120"),
            ("120", "--frames 120: the scene has 120 frames, 0..120"),
            ("0..9:0", "--frames 0..9:0: the step after : must be at least 1"),
            ("7:2", "--frames 7:2: a step is written after a range, as 0..240:24"),
            ("1,120", "--frames 1,120: the scene has 120 frames, 0..120"),
            (
                "-1",
                "--frames -1: \"-1\" is not a frame number from 0 to 10000000; write 0..120, 0..=119, 30.., 7, \
                 0..240:24 or 0,5,9..20",
            ),
        ] {
            let Err(Failure::Usage(message)) = parse_frames(text, 120) else { panic!("{text} was accepted") };
            assert_eq!(message, expected);
        }
        assert!(parse_frames("99999999999999999999", 120).is_err());
    }

    #[test]
    fn sizes_rates_and_times_are_parsed_and_checked() {
        assert_eq!(parse_size("1280x720").unwrap(), [1280, 720]);
        for bad in ["1280", "0x5", "x", "99999x1", "1280x720x3", "-4x4"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_length("2.5").unwrap(), Time::from_secs(2.5));
        for bad in ["0", "-1", "nan", "inf", "1e6", "4s"] {
            assert!(parse_length(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_fps("29.97").unwrap(), FrameRate { num: 30000, den: 1001 });
        assert_eq!(parse_fps("24000/1001").unwrap(), FrameRate { num: 24000, den: 1001 });
        for bad in ["0", "nan", "1/0", "inf", "-30", "4000000000/1"] {
            assert!(parse_fps(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_at("1.5").unwrap(), Time::from_secs(1.5));
        assert!(parse_at("nan").is_err() && parse_at("inf").is_err() && parse_at("1e9").is_err());
    }
}
