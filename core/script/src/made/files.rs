//! Pictures for surfaces from files: one, or numbered ones that follow each other.

use super::picture::ImageRef;
use crate::api::flat::read_file;
use crate::call::{ApiError, Call, Options};
use crate::limits::raise_hint;
use choreo_import::Problem;
use choreo_import::pictures::{Encoded, Formats};
use choreo_stage::Image;
use std::sync::Arc;

/// How far beyond a missing number is looked for others, to tell a gap from the end.
const GAP: u64 = 20;

/// `image("brick.png", …)` or `image("smoke_###.png", …)`.
pub fn from_file(c: &Call, o: &Options) -> Result<ImageRef, ApiError> {
    let name = c.text(0)?;
    let (first, last) = (whole(o, "first")?, whole(o, "last")?);
    let sampler = super::picture::sampler(o)?;
    let Some((before, digits, after)) = pattern(&name)? else {
        if let Some(word) = ["first", "last"].into_iter().find(|w| o.get(w).is_some()) {
            let text = format!("image: {word} is of numbered files, whose name has # for each digit");
            return Err(ApiError::new(text).focus(word));
        }
        return Ok(ImageRef { image: one(c, &name)?, sampler, dead: false, then: Vec::new() });
    };
    let numbered = |n: u64| format!("{before}{n:0digits$}{after}");
    let there = |n: u64| found(c, &numbered(n));
    let begin = match first {
        Some(first) => first,
        None => (0..=1).find(|n| there(*n)).ok_or_else(|| {
            let text = format!("image: neither {} nor {} is there", numbered(0), numbered(1));
            ApiError::new(text).focus(&name).hint("first: says with which number the files begin")
        })?,
    };
    let most = c.shared.limits.files;
    let end = match last {
        Some(last) if last < begin => {
            return Err(ApiError::new(format!("image: last is {last}, before first, {begin}")).focus("last"));
        }
        Some(last) => last,
        None => {
            let end = (begin..begin.saturating_add(most)).take_while(|n| there(*n)).last().unwrap_or(begin);
            if let Some(beyond) = (end + 2..=end + GAP).find(|n| there(*n)) {
                let (missing, beyond) = (numbered(end + 1), numbered(beyond));
                let text = format!("image: {missing} is missing, though {beyond} is there");
                return Err(ApiError::new(text).focus(&name).hint(format!("last: {end} ends before it")));
            }
            end
        }
    };
    if end - begin >= most {
        let text = format!("image: {} numbered files", end - begin + 1);
        return Err(ApiError::new(text).hint(raise_hint("files", most)));
    }
    let image = one(c, &numbered(begin))?;
    let then = (begin + 1..=end).map(|n| one(c, &numbered(n))).collect::<Result<Vec<_>, _>>()?;
    Ok(ImageRef { image, sampler, dead: false, then })
}

/// A name with one run of `#`, as what stands before it, how many there are, and what stands after.
fn pattern(name: &str) -> Result<Option<(&str, usize, &str)>, ApiError> {
    let Some(at) = name.find('#') else { return Ok(None) };
    let digits = name[at..].bytes().take_while(|b| *b == b'#').count();
    let (before, after) = (&name[..at], &name[at + digits..]);
    if after.contains('#') || digits > 9 {
        let text = format!("image: \"{name}\" must have one run of up to nine #, the digits of a number");
        return Err(ApiError::new(text).focus(name));
    }
    Ok(Some((before, digits, after)))
}

fn whole(o: &Options, word: &str) -> Result<Option<u64>, ApiError> {
    let Some(value) = o.get(word) else { return Ok(None) };
    let number = value.as_int().ok().and_then(|n| u64::try_from(n).ok()).filter(|n| *n <= 999_999_999);
    number.map(Some).ok_or_else(|| crate::call::wrong(&value, &o.label(word), "a whole number from 0"))
}

fn found(c: &Call, name: &str) -> bool {
    let loader = &c.shared.loader;
    let start = c.shared.test().scene.as_ref().map(|scene| scene.folder.clone());
    loader.find_in(loader.folders(), start.as_deref(), name).is_ok()
}

fn one(c: &Call, name: &str) -> Result<Arc<Image>, ApiError> {
    let bytes = read_file(c, name)?;
    let problem = |p: Problem| {
        let error = ApiError::new(format!("image: \"{name}\": {}", p.what)).focus(name);
        match p.hint {
            Some(hint) => error.hint(hint),
            None => error,
        }
    };
    let encoded = Encoded::examine(name.into(), name.into(), bytes, Formats::All).map_err(problem)?;
    let image = encoded.decode().map_err(problem)?;
    super::picture::count(c, u64::from(image.width) * u64::from(image.height))?;
    Ok(image)
}
