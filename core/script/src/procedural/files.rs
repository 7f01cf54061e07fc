//! Images from files: single images and image sequences of numbered files.

use super::image_sequence::combined_alpha_mode;
use super::material::alpha_mode_of;
use crate::call::{ApiError, Call, Options};
use crate::limits::raise_hint;
use crate::totals::texels;
use crate::value::{ImageRef, ImageSequenceRef, decoding_error};
use choreo_asset::{AlphaMode, Image, ImageSource, ImageSourceError, Sampler};
use choreo_importer_kit::Problem;
use choreo_importer_kit::images::{Encoded, Formats};
use std::sync::Arc;

/// Number of files that are looked up after a missing one, to distinguish a gap from the end of the sequence.
const MAX_MISSING_FILES: u64 = 20;

/// The image of a call `image("brick.png", …)`, or the image sequence of `image("smoke_###.png", …)`.
pub(crate) fn image_from_files(c: &Call, o: &Options) -> Result<ImageRef, ApiError> {
    let name = c.text(0)?;
    let (first, last) = (whole_number(o, "first")?, whole_number(o, "last")?);
    let sampler = super::raw_image::sampler(o)?;
    let Some((before, digits, after)) = split_pattern(&name)? else {
        if let Some(word) = ["first", "last"].into_iter().find(|w| o.get(w).is_some()) {
            let text = format!("image: {word} is for numbered files, whose name has # for each digit");
            return Err(ApiError::new(text).focus(word));
        }
        return single_image(c, &name, sampler);
    };
    let file_name = |n: u64| format!("{before}{n:0digits$}{after}");
    let exists = |n: u64| c.context.find_file(&file_name(n)).is_ok();
    let begin = match first {
        Some(first) => first,
        None => (0..=1).find(|n| exists(*n)).ok_or_else(|| {
            let text = format!("image: neither {} nor {} exists", file_name(0), file_name(1));
            ApiError::new(text).focus(&name).hint("give first, the number of the first file")
        })?,
    };
    let limit = c.context.limits.files;
    let end = match last {
        Some(last) if last < begin => {
            return Err(ApiError::new(format!("image: last is {last}, before first, {begin}")).focus("last"));
        }
        Some(last) => last,
        None => {
            let end = (begin..begin.saturating_add(limit)).take_while(|n| exists(*n)).last().unwrap_or(begin);
            if let Some(beyond) = (end + 2..=end + MAX_MISSING_FILES).find(|n| exists(*n)) {
                let (missing, beyond) = (file_name(end + 1), file_name(beyond));
                let text = format!("image: {missing} is missing, but {beyond} exists");
                return Err(ApiError::new(text)
                    .focus(&name)
                    .hint(format!("last: {end} ends the sequence before it")));
            }
            end
        }
    };
    if end - begin >= limit {
        let text = format!("image: too many numbered files, {}", end - begin + 1);
        return Err(ApiError::new(text).hint(raise_hint("files", limit)));
    }
    let (mut files, mut alpha) = (Vec::new(), AlphaMode::Opaque);
    let mut first_image: Option<Arc<Image>> = None;
    for n in begin..=end {
        let name = file_name(n);
        let bytes = c.context.read_file(&name)?;
        // Each image is decoded once, to report errors here and to find the alpha mode.
        let image = decode_file(&name, &bytes).map_err(|p| decoding_error("image", &name, p))?;
        let first = first_image.get_or_insert_with(|| image.clone());
        if (image.width, image.height) != (first.width, first.height) {
            let text = format!(
                "image: all images of a sequence must have one size; {} is {} × {}, {name} {} × {}",
                file_name(begin),
                first.width,
                first.height,
                image.width,
                image.height
            );
            return Err(ApiError::new(text).focus(c.text(0)?));
        }
        alpha = combined_alpha_mode(alpha, alpha_mode_of(&image));
        files.push((name, bytes));
    }
    let Some(image) = first_image else { return Err(ApiError::new("image: no files")) };
    super::raw_image::count_texels(c, texels(&image))?;
    let hashes = files.iter().map(|(_, bytes)| *blake3::hash(bytes).as_bytes()).collect();
    let sequence = ImageSequenceRef { images: Arc::new(NumberedFiles { files }), hashes, alpha };
    Ok(ImageRef { image, file: None, sampler, dead: false, sequence: Some(sequence) })
}

/// Encoded files of an image sequence, with their names.
#[derive(Debug)]
struct NumberedFiles {
    files: Vec<(String, Vec<u8>)>,
}

impl ImageSource for NumberedFiles {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        let (name, bytes) = self.files.get(index).ok_or(ImageSourceError::Missing(index))?;
        decode_file(name, bytes)
            .map_err(|problem| ImageSourceError::Undecodable { file: name.clone(), what: problem.what })
    }
}

/// Splits the name of numbered files at its run of `#`: the text before it, the number of `#`, and the text after it. `None`
/// without `#`.
fn split_pattern(name: &str) -> Result<Option<(&str, usize, &str)>, ApiError> {
    let Some(at) = name.find('#') else { return Ok(None) };
    let digits = name[at..].bytes().take_while(|b| *b == b'#').count();
    let (before, after) = (&name[..at], &name[at + digits..]);
    if after.contains('#') || digits > 9 {
        let text = format!("image: \"{name}\" must have one run of up to nine #, the digits of a number");
        return Err(ApiError::new(text).focus(name));
    }
    Ok(Some((before, digits, after)))
}

fn whole_number(o: &Options, word: &str) -> Result<Option<u64>, ApiError> {
    let Some(value) = o.get(word) else { return Ok(None) };
    let number = value.as_int().ok().and_then(|n| u64::try_from(n).ok()).filter(|n| *n <= 999_999_999);
    number.map(Some).ok_or_else(|| crate::call::wrong(&value, &o.label(word), "a whole number from 0"))
}

/// The image of one file. Its pixels are decoded on demand if the loader does not request pixels and the header states that the
/// image is opaque.
fn single_image(c: &Call, name: &str, sampler: Sampler) -> Result<ImageRef, ApiError> {
    let requested_parts = c.context.loader.requested_parts();
    let bytes = c.context.read_file(name)?;
    let fail = |problem| decoding_error("image", name, problem);
    let encoded = Encoded::examine(name.into(), name.into(), bytes, Formats::All).map_err(fail)?;
    super::raw_image::count_texels(c, encoded.pixels())?;
    let (image, file) = match requested_parts.pixels || !encoded.is_opaque() {
        true => (encoded.decode_for(requested_parts).map_err(fail)?, None),
        false => (Arc::new(encoded.without_pixels()), Some(Arc::new(encoded))),
    };
    Ok(ImageRef { image, file, sampler, dead: false, sequence: None })
}

/// The decoded image of a file. `what`: the function or option that needs it, for errors.
pub(crate) fn decoded_image(c: &Call, what: &str, name: &str) -> Result<Arc<Image>, ApiError> {
    let bytes = c.context.read_file(name)?;
    let encoded = Encoded::examine(name.into(), name.into(), bytes, Formats::All);
    let image = encoded.and_then(|encoded| encoded.decode_for(c.context.loader.requested_parts()));
    let image = image.map_err(|p| decoding_error(what, name, p))?;
    super::raw_image::count_texels(c, texels(&image))?;
    Ok(image)
}

fn decode_file(name: &str, bytes: &[u8]) -> Result<Arc<Image>, Problem> {
    Encoded::examine(name.into(), name.into(), bytes, Formats::All)?.decode()
}
