//! Pictures that a file names by path, as OBJ and COLLADA do: found through [`Files`], read once, decoded beside the rest.
//!
//! A missing or broken picture is no reason to refuse a model: it is a warning.

use crate::Result;
use crate::budget::{Budget, Notes};
use crate::pictures::{Encoded, Formats, decode_beside, or_white};
use crate::search;
use choreo_asset::Image;
use choreo_plugin::{Files, Needs};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The bytes of a picture file.
pub struct Bytes(Arc<Vec<u8>>);

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

#[derive(Default)]
pub struct Textures {
    /// Texture of each path as written; `None` where there is no such image.
    known: BTreeMap<String, Option<u32>>,
    entries: Vec<Encoded<Bytes>>,
}

impl Textures {
    /// Index of the picture at the path that the file gives: with either slash, percent-encoded, as a `file:` URI; absolute
    /// ones and those that are not there are looked for as [`search::places`] says.
    pub fn find(
        &mut self,
        written: &str,
        place: &str,
        files: &dyn Files,
        budget: &Budget,
        notes: &Notes,
    ) -> Option<u32> {
        if let Some(known) = self.known.get(written) {
            return *known;
        }
        let found = self.read(written, place, files, budget);
        let index = match found {
            Ok(index) => Some(index),
            Err(what) => {
                notes.warn(place, format!("{what}; the texture is left out"));
                None
            }
        };
        self.known.insert(written.to_string(), index);
        index
    }

    fn read(
        &mut self,
        written: &str,
        place: &str,
        files: &dyn Files,
        budget: &Budget,
    ) -> std::result::Result<u32, String> {
        let (path, name) = plain_path(written);
        if name.is_empty() {
            return Err("the texture has no file name".to_string());
        }
        let bytes =
            search::read_first(files, &search::places(&[&path])).map_err(|e| search::missing(&path, &e))?;
        // Comparing and keeping cost as decoding does: they come out of the same budget.
        budget.charge(bytes.len() as u64, 1)?;
        let same = self.entries.iter().position(|e| e.bytes.as_ref() == bytes.as_slice());
        if let Some(same) = same {
            return Ok(same as u32);
        }
        let encoded =
            Encoded::examine(place.to_string(), name, Bytes(bytes), Formats::All).map_err(|p| p.what)?;
        budget.charge(encoded.pixels(), 4)?;
        self.entries.push(encoded);
        Ok(self.entries.len() as u32 - 1)
    }

    /// Decodes while `rest` runs. What cannot be decoded is one white pixel, with a warning. An error where `files` called it off.
    pub fn decode_beside<R>(
        self,
        notes: &Notes,
        needs: Needs,
        files: &dyn Files,
        rest: impl FnOnce() -> R,
    ) -> Result<(Vec<Arc<Image>>, R)> {
        let (decoded, rest) = decode_beside(&self.entries, needs, files, rest);
        Ok((or_white(decoded, &self.entries, notes)?, rest))
    }
}

/// The path as a path, and the file name in it.
fn plain_path(written: &str) -> (String, String) {
    let uri = written.trim().strip_prefix("file://").or_else(|| written.trim().strip_prefix("file:"));
    let path = percent_decoded(uri.unwrap_or(written.trim())).replace('\\', "/");
    let path = match uri {
        // `/C:/art`, `/art`, `host/art`: never beside the file.
        Some(_) => format!("/{}", path.trim_start_matches('/')),
        None => path,
    };
    let name = search::file_name(&path).to_string();
    (path, name)
}

/// `%20` and the like; what is no valid encoding stays as it is.
fn percent_decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    let hex = |b: Option<&u8>| b.and_then(|b| char::from(*b).to_digit(16));
    while at < bytes.len() {
        match (bytes[at], hex(bytes.get(at + 1)), hex(bytes.get(at + 2))) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                out.push(byte);
                at += 1;
            }
        }
    }
    String::from_utf8(out).unwrap_or_else(|_| text.to_string())
}

/// Whether a picture holds directions (mean near 128, 128, 255) and not heights: many files give a normal map where their
/// format has only a bump map.
pub fn is_normal_map(image: &Image) -> bool {
    let mut sums = [0u64; 3];
    let mut count = 0;
    // Some thousands of pixels say enough.
    let step = (image.rgba.len() / 4 / 4096).max(1);
    for pixel in image.rgba.chunks_exact(4).step_by(step) {
        for (sum, value) in sums.iter_mut().zip(pixel) {
            *sum += u64::from(*value);
        }
        count += 1;
    }
    let [r, g, b] = sums.map(|s| s / u64::max(count, 1));
    (100..=156).contains(&r) && (100..=156).contains(&g) && b > 190
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_of_other_systems() {
        let first = |p: &str| search::places(&[&plain_path(p).0])[0].clone();
        assert_eq!(first(r".\wal67ar_small.jpg"), "wal67ar_small.jpg");
        assert_eq!(first("../materials/a%20b.png"), "../materials/a b.png");
        assert_eq!(first("file:///C:/art/skin.png"), "skin.png");
        assert_eq!(first(r"C:\art\skin.png"), "skin.png");
        assert_eq!(first("/etc/passwd"), "passwd");
        assert_eq!(first("100%.png"), "100%.png");
        assert_eq!(plain_path("art/skin.png"), ("art/skin.png".into(), "skin.png".into()));
    }

    #[test]
    fn normal_maps_are_blue() {
        let image = |rgba: [u8; 4]| Image { width: 2, height: 1, rgba: rgba.repeat(2), ..Image::default() };
        assert!(is_normal_map(&image([128, 128, 255, 255])));
        assert!(!is_normal_map(&image([128, 128, 128, 255])));
        assert!(!is_normal_map(&Image::default()));
    }
}
