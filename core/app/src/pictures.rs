//! Numbered pictures: which are there already, who else is making them, and each to its own file.

use crate::failure::{Failure, output_error};
use crate::output::{Target, export_failure};
use crate::part::{self, Part};
use crate::provenance;
use choreo_motion::Time;
use choreo_plugin::{Exporter, Frame, VideoInfo};
use std::fs::File;
use std::path::{Path, PathBuf};

/// One picture to its own file.
pub fn write(
    target: &Target,
    exporter: &dyn Exporter,
    info: &VideoInfo,
    (number, time): (i64, Time),
    frame: &Frame,
) -> Result<(), Failure> {
    let place: PathBuf = target.file(number);
    let shown = place.display().to_string();
    let failed = |e| export_failure(&shown, e);
    let part = Part::create(&place)?;
    let info = VideoInfo { provenance: provenance::at(&info.provenance, time), ..info.clone() };
    let mut sink = exporter.begin(&info, part.writer()?).map_err(failed)?;
    sink.frame(frame).map_err(failed)?;
    sink.finish().map_err(failed)?;
    part.commit()
}

/// The frames that no file holds yet. A picture that is whole and was made otherwise, or by others, is an error: it would be
/// replaced.
pub fn missing(
    target: &Target,
    info: &VideoInfo,
    frames: &[(i64, Time)],
) -> Result<Vec<(i64, Time)>, Failure> {
    let mut missing = Vec::new();
    for &(number, time) in frames {
        let place = target.file(number);
        let found = std::fs::read(&place).ok().and_then(|bytes| choreo_media::whole_png(&bytes));
        match found {
            Some(found) => {
                let wanted = provenance::at(&info.provenance, time);
                provenance::same(&target.shown(), &place, &found.provenance, &wanted)?;
            }
            // None there, or one cut short.
            _ => missing.push((number, time)),
        }
    }
    Ok(missing)
}

/// The right to make a range of numbered pictures: a locked file beside them, so that two renders of the same frames do not
/// mix while the halves of a video can be made side by side.
pub struct Claim {
    path: PathBuf,
    _lock: File,
}

impl Claim {
    /// `None` for everything but numbered pictures.
    pub fn take(target: &Target, first: i64, last: i64) -> Result<Option<Claim>, Failure> {
        let Target::Numbered { folder, .. } = target else { return Ok(None) };
        let shown = target.shown();
        let failed = |e: std::io::Error| output_error(&shown, &e);
        let stem = format!("{}.", Path::new(&shown).file_name().unwrap_or_default().to_string_lossy());
        let path = folder.join(format!("{stem}{first}-{last}.part"));
        let mut parts = part::parts();
        let lock = part::lock(&path).map_err(failed)?.ok_or_else(|| part::busy(&shown))?;
        parts.insert(path.clone());
        drop(parts);
        let claim = Claim { path, _lock: lock };
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for entry in std::fs::read_dir(here).map_err(failed)?.flatten() {
            let name = entry.file_name();
            let range = name.to_str().and_then(|n| n.strip_prefix(&stem)?.strip_suffix(".part"));
            let Some((a, b)) = range.and_then(|r| r.split_once('-')) else { continue };
            let (Ok(a), Ok(b)) = (a.parse::<i64>(), b.parse::<i64>()) else { continue };
            if (a, b) == (first, last) || a > last || b < first {
                continue;
            }
            match part::lock(&here.join(&name)).map_err(failed)? {
                None => return Err(part::busy(&shown)),
                // Of a render that was killed.
                Some(_) => drop(std::fs::remove_file(here.join(&name))),
            }
        }
        Ok(Some(claim))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut parts = part::parts();
        let _ = std::fs::remove_file(&self.path);
        parts.remove(&self.path);
    }
}
