//! Images from files: single images and image sequences of numbered files.

use super::image_sequence::more_open;
use super::material::of_picture;
use crate::call::{ApiError, Call, Options};
use crate::limits::raise_hint;
use crate::value::{ImageRef, ImageSequenceRef, undecodable};
use choreo_asset::{AlphaMode, Image, ImageSource, ImageSourceError, Sampler};
use choreo_importer_kit::Problem;
use choreo_importer_kit::images::{Encoded, Formats};
use std::sync::Arc;

/// Count of numbers after a missing one that are looked up, to distinguish a gap from the end of the sequence.
const GAP: u64 = 20;

/// The image or sequence of `image("brick.png", …)` or `image("smoke_###.png", …)`.
pub(crate) fn from_file(c: &Call, o: &Options) -> Result<ImageRef, ApiError> {
    let name = c.text(0)?;
    let (first, last) = (whole_number(o, "first")?, whole_number(o, "last")?);
    let sampler = super::raw_image::sampler(o)?;
    let Some((before, digits, after)) = pattern(&name)? else {
        if let Some(word) = ["first", "last"].into_iter().find(|w| o.get(w).is_some()) {
            let text = format!("image: {word} is for numbered files, whose name has # for each digit");
            return Err(ApiError::new(text).focus(word));
        }
        return alone(c, &name, sampler);
    };
    let numbered = |n: u64| format!("{before}{n:0digits$}{after}");
    let there = |n: u64| c.shared.find_file(&numbered(n)).is_ok();
    let begin = match first {
        Some(first) => first,
        None => (0..=1).find(|n| there(*n)).ok_or_else(|| {
            let text = format!("image: neither {} nor {} exists", numbered(0), numbered(1));
            ApiError::new(text).focus(&name).hint("give first, the number of the first file")
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
                let text = format!("image: {missing} is missing, but {beyond} exists");
                return Err(ApiError::new(text)
                    .focus(&name)
                    .hint(format!("last: {end} ends the sequence before it")));
            }
            end
        }
    };
    if end - begin >= most {
        let text = format!("image: {} numbered files", end - begin + 1);
        return Err(ApiError::new(text).hint(raise_hint("files", most)));
    }
    let (mut files, mut alpha) = (Vec::new(), AlphaMode::Opaque);
    let mut image: Option<Arc<Image>> = None;
    for n in begin..=end {
        let name = numbered(n);
        let bytes = c.shared.read_file(&name)?;
        // Each image is decoded once, to report errors here and to find the alpha mode.
        let one = decoded(&name, &bytes).map_err(|p| undecodable("image", &name, p))?;
        let first = image.get_or_insert_with(|| one.clone());
        if (one.width, one.height) != (first.width, first.height) {
            let text = format!(
                "image: all images of a sequence must have one size; {} is {} × {}, {name} {} × {}",
                numbered(begin),
                first.width,
                first.height,
                one.width,
                one.height
            );
            return Err(ApiError::new(text).focus(c.text(0)?));
        }
        alpha = more_open(alpha, of_picture(&one));
        files.push((name, bytes));
    }
    let Some(image) = image else { return Err(ApiError::new("image: no files")) };
    super::raw_image::count(c, texels(&image))?;
    let hashes = files.iter().map(|(_, bytes)| *blake3::hash(bytes).as_bytes()).collect();
    let files = ImageSequenceRef { pictures: Arc::new(NumberedFiles { files }), hashes, alpha };
    Ok(ImageRef { image, file: None, sampler, dead: false, files: Some(files) })
}

/// Encoded files of an image sequence, with their names.
#[derive(Debug)]
struct NumberedFiles {
    files: Vec<(String, Vec<u8>)>,
}

impl ImageSource for NumberedFiles {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        let (name, bytes) = self.files.get(index).ok_or(ImageSourceError::Missing(index))?;
        decoded(name, bytes)
            .map_err(|problem| ImageSourceError::Undecodable { file: name.clone(), what: problem.what })
    }
}

/// Splits a name with one run of `#`: the text before it, the number of `#`, and the text after it. `None` without `#`.
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

fn whole_number(o: &Options, word: &str) -> Result<Option<u64>, ApiError> {
    let Some(value) = o.get(word) else { return Ok(None) };
    let number = value.as_int().ok().and_then(|n| u64::try_from(n).ok()).filter(|n| *n <= 999_999_999);
    number.map(Some).ok_or_else(|| crate::call::wrong(&value, &o.label(word), "a whole number from 0"))
}

/// The image of one file. Its pixels are decoded later if the loader needs none and the header shows that the image is opaque.
fn alone(c: &Call, name: &str, sampler: Sampler) -> Result<ImageRef, ApiError> {
    let needs = c.shared.loader.needs();
    let bytes = c.shared.read_file(name)?;
    let fail = |problem| undecodable("image", name, problem);
    let encoded = Encoded::examine(name.into(), name.into(), bytes, Formats::All).map_err(fail)?;
    super::raw_image::count(c, encoded.pixels())?;
    let (image, file) = match needs.pixels || !encoded.is_opaque() {
        true => (encoded.decode_for(needs).map_err(fail)?, None),
        false => (Arc::new(encoded.without_pixels()), Some(Arc::new(encoded))),
    };
    Ok(ImageRef { image, file, sampler, dead: false, files: None })
}

/// The decoded image of a file. Errors begin with `what`.
pub(crate) fn decoded_image(c: &Call, what: &str, name: &str) -> Result<Arc<Image>, ApiError> {
    let bytes = c.shared.read_file(name)?;
    let encoded = Encoded::examine(name.into(), name.into(), bytes, Formats::All);
    let image = encoded.and_then(|encoded| encoded.decode_for(c.shared.loader.needs()));
    let image = image.map_err(|p| undecodable(what, name, p))?;
    super::raw_image::count(c, texels(&image))?;
    Ok(image)
}

fn decoded(name: &str, bytes: &[u8]) -> Result<Arc<Image>, Problem> {
    Encoded::examine(name.into(), name.into(), bytes, Formats::All)?.decode()
}

fn texels(image: &Image) -> u64 {
    u64::from(image.width) * u64::from(image.height)
}
