//! Numbered images: finding the existing ones, claiming a range of frames, and writing each image to its own file.

use crate::drawing::pipeline::{FrameImage, Pixels};
use crate::failure::{Failure, output_failure, write_failure};
use crate::output::provenance;
use crate::output::target::{Target, export_failure};
use choreo_files::{Folder, PartFile, WriteError};
use choreo_motion::Time;
use choreo_plugin::{Exporter, VideoInfo};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Writes the image of one frame to its own file. `part`: the temporary file, if it was created before. An image that shows
/// several frames is encoded once: further frames copy the encoded file, with their own provenance.
pub(crate) fn write_image(
    target: &Target,
    part: Option<PartFile>,
    exporter: &dyn Exporter,
    info: &VideoInfo,
    (number, time): (i64, Time),
    image: &FrameImage,
) -> Result<(), Failure> {
    let place: PathBuf = target.frame_path(number);
    let info = VideoInfo { provenance: provenance::with_time(&info.provenance, time), ..info.clone() };
    let part = part.map_or_else(|| PartFile::create(&place), Ok);
    let mut file = image.file.lock().unwrap_or_else(PoisonError::into_inner);
    let shown = place.display().to_string();
    if let Some(copy) = file.as_ref() {
        let part = part.map_err(|e| write_failure(&shown, e))?;
        let out = part.writer().map_err(|e| output_failure(&shown, &e))?;
        let written = exporter.with_provenance(&info, copy, Box::new(out));
        return match written.map_err(|e| export_failure(&shown, e))? {
            true => part.commit().map_err(|e| write_failure(&shown, e)),
            false => write_image_to(&place, Ok(part), exporter, &info, &image.pixels),
        };
    }
    let copy = Arc::new(Mutex::new(Some(Vec::new())));
    let tee = |out| -> Box<dyn Write + Send> { Box::new(TeeWriter { out, copy: copy.clone() }) };
    write_image_with_writer(&place, part, exporter, &info, &image.pixels, tee)?;
    *file = copy.lock().unwrap_or_else(PoisonError::into_inner).take();
    Ok(())
}

/// Largest encoded file in bytes that is kept for later frames with the same pixels.
const MAX_KEPT_FILE_BYTES: usize = 32 << 20;

/// A writer that also copies the bytes, for later frames with the same pixels. The copy is `None` once it exceeds [`MAX_KEPT_FILE_BYTES`].
struct TeeWriter {
    out: Box<dyn Write + Send>,
    copy: Arc<Mutex<Option<Vec<u8>>>>,
}

impl Write for TeeWriter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.out.write(bytes)?;
        let mut copy = self.copy.lock().unwrap_or_else(PoisonError::into_inner);
        *copy = copy.take().filter(|copy| copy.len() + written <= MAX_KEPT_FILE_BYTES).map(|mut copy| {
            copy.extend_from_slice(&bytes[..written]);
            copy
        });
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// Writes one image to the file that was opened for it.
pub(crate) fn write_image_to(
    place: &Path,
    part: Result<PartFile, WriteError>,
    exporter: &dyn Exporter,
    info: &VideoInfo,
    pixels: &Pixels,
) -> Result<(), Failure> {
    write_image_with_writer(place, part, exporter, info, pixels, |out| out)
}

fn write_image_with_writer(
    place: &Path,
    part: Result<PartFile, WriteError>,
    exporter: &dyn Exporter,
    info: &VideoInfo,
    pixels: &Pixels,
    wrap_writer: impl FnOnce(Box<dyn Write + Send>) -> Box<dyn Write + Send>,
) -> Result<(), Failure> {
    let shown = place.display().to_string();
    let (failed, not_written) = (|e| export_failure(&shown, e), |e| write_failure(&shown, e));
    let part = part.map_err(not_written)?;
    let out = part.writer().map_err(|e| output_failure(&shown, &e))?;
    let mut sink = exporter.begin(info, wrap_writer(Box::new(out))).map_err(failed)?;
    pixels.write(&mut *sink, false).map_err(failed)?;
    sink.finish().map_err(failed)?;
    part.commit().map_err(not_written)
}

/// Frames that no complete file holds yet. A complete image with another provenance is an error, because it would be replaced.
pub(crate) fn missing_frames(
    target: &Target,
    info: &VideoInfo,
    frames: &[(i64, Time)],
) -> Result<Vec<(i64, Time)>, Failure> {
    let mut missing = Vec::new();
    for &(number, time) in frames {
        let place = target.frame_path(number);
        let found = choreo_files::read(&place, u64::MAX)
            .ok()
            .and_then(|bytes| crate::output::media::read_complete_image(&bytes));
        match found {
            Some(found) => {
                let wanted = provenance::with_time(&info.provenance, time);
                provenance::check_same_settings(&target.display_name(), &place, &found.provenance, &wanted)?;
            }
            // The file does not exist or is truncated.
            _ => missing.push((number, time)),
        }
    }
    Ok(missing)
}

/// The exclusive right to make a range of numbered images. A locked file beside them prevents two renders from making the same frames,
/// while two halves of a video can be made at the same time.
pub(crate) struct FrameRangeClaim(#[expect(dead_code, reason = "dropping it releases the claim")] PartFile);

impl FrameRangeClaim {
    /// Claims a range of frames. Gives `None` for targets other than numbered images.
    pub(crate) fn take(target: &Target, first: i64, last: i64) -> Result<Option<FrameRangeClaim>, Failure> {
        let Target::Numbered { folder, .. } = target else { return Ok(None) };
        let shown = target.display_name();
        let (failed, not_written) = (|e| output_failure(&shown, &e), |e| write_failure(&shown, e));
        let stem = format!("{}.", Path::new(&shown).file_name().unwrap_or_default().to_string_lossy());
        let open = Arc::new(Folder::open(folder).map_err(failed)?);
        let claim = |name: PathBuf| PartFile::claim(open.clone(), name).map_err(not_written);
        let own = claim(PathBuf::from(format!("{stem}{first}-{last}.part")))?;
        let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for entry in std::fs::read_dir(here).map_err(failed)?.flatten() {
            let name = entry.file_name();
            let range = name.to_str().and_then(|n| n.strip_prefix(&stem)?.strip_suffix(".part"));
            let Some((a, b)) = range.and_then(|r| r.split_once('-')) else { continue };
            let (Ok(a), Ok(b)) = (a.parse::<i64>(), b.parse::<i64>()) else { continue };
            if (a, b) == (first, last) || a > last || b < first {
                continue;
            }
            // If the claim of another range is free, its render was killed: its file is removed.
            drop(claim(PathBuf::from(name))?);
        }
        Ok(Some(FrameRangeClaim(own)))
    }
}
