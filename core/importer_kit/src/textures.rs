//! Images that a file names by path, as OBJ and COLLADA do: found through [`Files`], read once,
//! and decoded on other threads while the rest is imported.
//!
//! A missing or broken image is no reason to refuse a model: it is a warning.

use crate::Result;
use crate::budget::{Budget, Notes};
use crate::images::{Encoded, Formats, decode_beside, replace_failed_with_white};
use crate::search;
use crate::text::percent_decoded;
use choreo_asset::{Image, Material, TextureRef};
use choreo_plugin::{Files, ImportScope};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The bytes of an image file.
pub struct Bytes(pub Arc<Vec<u8>>);

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
    /// Index of the image at a path as the file gives it: with either slash, percent-encoded, or as a `file:` URI. Absolute paths and
    /// missing files are searched for as [`search::places`] describes. `None`, with a warning, if no image is found.
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
            Err(problem) => {
                notes.warn(place, format!("{}; the texture is left out", problem.what));
                None
            }
        };
        self.known.insert(written.to_string(), index);
        index
    }

    fn read(&mut self, written: &str, place: &str, files: &dyn Files, budget: &Budget) -> Result<u32> {
        let (path, name) = plain_path(written);
        if name.is_empty() {
            return Err("the texture has no file name".into());
        }
        let bytes =
            search::read_first(files, &search::places(&[&path])).map_err(|e| search::missing(&path, &e))?;
        // Comparing and keeping the bytes is charged to the same budget as decoding.
        budget.charge(bytes.len() as u64, 1)?;
        let same = self.entries.iter().position(|e| e.bytes.as_ref() == bytes.as_slice());
        if let Some(same) = same {
            return Ok(same as u32);
        }
        let encoded = Encoded::examine(place.to_string(), name, Bytes(bytes), Formats::All)?;
        budget.charge(encoded.pixels(), 4)?;
        self.entries.push(encoded);
        Ok(self.entries.len() as u32 - 1)
    }

    /// Decodes the images while `rest` runs. An image that cannot be decoded becomes one white pixel, with a warning. An error if `files`
    /// cancelled the import.
    pub fn decode_beside<R>(
        self,
        notes: &Notes,
        needs: ImportScope,
        files: &dyn Files,
        rest: impl FnOnce() -> R,
    ) -> Result<(Vec<Arc<Image>>, R)> {
        let (decoded, rest) = decode_beside(&self.entries, needs, files, rest);
        Ok((replace_failed_with_white(decoded, &self.entries, notes)?, rest))
    }
}

/// A path without URI scheme and percent encoding, with forward slashes; and its file name.
fn plain_path(written: &str) -> (String, String) {
    let uri = written.trim().strip_prefix("file://").or_else(|| written.trim().strip_prefix("file:"));
    let written = uri.unwrap_or(written.trim());
    let path = String::from_utf8(percent_decoded(written)).unwrap_or_else(|_| written.to_string());
    let path = path.replace('\\', "/");
    let path = match uri {
        // All of these (`/C:/art`, `/art`, `host/art`) are absolute, never relative to the file.
        Some(_) => format!("/{}", path.trim_start_matches('/')),
        None => path,
    };
    let name = search::file_name(&path).to_string();
    (path, name)
}

/// A bump map of a material. Only the decoded image shows whether it is a normal map.
pub struct BumpMap {
    /// Index of the material.
    pub material: usize,
    pub texture: TextureRef,
    pub strength: f32,
}

/// Uses bump maps that hold directions as normal maps, and leaves out the others; warns about both.
pub fn use_normal_maps(
    materials: &mut [Material],
    images: &[Arc<Image>],
    bumps: Vec<BumpMap>,
    notes: &Notes,
) {
    for bump in bumps {
        let image = &images[bump.texture.image as usize];
        let Some(material) = materials.get_mut(bump.material) else { continue };
        let is_normal_map = is_normal_map(image);
        let what = match is_normal_map {
            true => "looks like a normal map and is used as one",
            false => "holds heights, which are not supported",
        };
        notes.warn(
            format!("material \"{}\"", material.name),
            format!("the bump map \"{}\" {what}", image.name),
        );
        if is_normal_map {
            material.normal_scale = bump.strength;
            material.normal_texture = Some(bump.texture);
        }
    }
}

/// Whether an image holds directions (mean near 128, 128, 255) and not heights: many files give a normal map where their
/// format has only a bump map.
fn is_normal_map(image: &Image) -> bool {
    let mut sums = [0u64; 3];
    let mut count = 0;
    // Some thousands of pixels are enough.
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
    fn paths_of_other_systems_are_converted() {
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
    fn normal_maps_are_recognized_by_their_mean_color() {
        let image = |rgba: [u8; 4]| Image { width: 2, height: 1, rgba: rgba.repeat(2), ..Image::default() };
        assert!(is_normal_map(&image([128, 128, 255, 255])));
        assert!(!is_normal_map(&image([128, 128, 128, 255])));
        assert!(!is_normal_map(&Image::default()));
    }
}
