//! `--preview 1/N`: a film of every Nth frame at half the size, which machines render first. It has the length of the film and 1/N of its
//! frame rate, so that its frame k is frame N·k of the film.

use super::chunks::FilmCost;
use crate::commands::render::Job;
use crate::failure::Failure;

/// Name of the folder of the preview's segments, and of the folder of its film.
pub(super) const PREVIEW_FOLDER: &str = "preview";

/// Parses N from 1/N.
pub(super) fn parse_every(text: &str) -> Result<u32, Failure> {
    let every = text.strip_prefix("1/").and_then(|every| every.parse().ok());
    every
        .filter(|every| (2..=1000).contains(every))
        .ok_or_else(|| Failure::Usage(format!("--preview {text}: write 1/N, every Nth frame, as 1/8")))
}

/// Options of the preview's render: those of the film, with another size and rate.
pub(super) fn preview_options(options: &[String], job: &Job, every: u32) -> Vec<String> {
    let other = |option: &&String| !option.starts_with("--size=") && !option.starts_with("--fps=");
    let mut words: Vec<String> = options.iter().filter(other).cloned().collect();
    let [width, height] = job.settings.size.map(|side| (side / 2).max(1));
    let fps = job.settings.fps;
    words.push(format!("--size={width}x{height}"));
    words.push(format!("--fps={}/{}", fps.num, u64::from(fps.den) * u64::from(every)));
    words
}

/// Cost of the preview, derived from that of the film: a quarter of the pixels.
pub(super) fn preview_cost(cost: &FilmCost, every: u32) -> FilmCost {
    let frames =
        cost.frames.iter().map(|(frame, seconds)| (frame / u64::from(every), seconds / 4.0)).collect();
    FilmCost { start_secs: cost.start_secs, frames }
}
