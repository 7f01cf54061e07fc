//! Image sequences (texture animation) in any texture slot of a material, and sequences combined from two.

use super::maps;
use super::material::of_picture;
use crate::call::{ApiError, Options};
use crate::value::{ImageRef, ImageSequenceRef};
use choreo_asset::{
    AlphaMode, Image, ImageSequence, ImageSource, ImageSourceError, ImageStream, TextureSlot,
};
use std::sync::Arc;

/// Image sequence of an array of images, held in memory.
#[derive(Debug)]
struct Held(Vec<Arc<Image>>);

impl ImageSource for Held {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        self.0.get(index).cloned().ok_or(ImageSourceError::Missing(index))
    }
}

/// How two images are combined into one.
#[derive(Clone, Copy, Debug)]
pub enum Rule {
    /// The first image, with alpha multiplied by the brightness of the second.
    Opacity,
    /// The first image (a normal map), with the brightness of the second (a height map) as alpha.
    Heights,
    /// `Heights` with a normal map computed from the height map; the number is its depth in widths of the texture. The first
    /// image is not read.
    HeightsAlone(f32),
}

impl Rule {
    fn make(self, a: &Image, b: &Image) -> Image {
        match self {
            Rule::Opacity => maps::with_opacity(a, b),
            Rule::Heights => maps::with_heights(a, b),
            Rule::HeightsAlone(depth) => maps::with_heights(&maps::normals_of(b, depth), b),
        }
    }
}

/// Image sequence combined from two parts on demand. A part without a sequence is the same image in every frame.
#[derive(Debug)]
struct Joined {
    parts: [(Arc<Image>, Option<ImageSequenceRef>); 2],
    rule: Rule,
}

impl ImageSource for Joined {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        let part = |(one, many): &(Arc<Image>, Option<ImageSequenceRef>)| match many {
            Some(many) => many.pictures.image(index),
            None => Ok(one.clone()),
        };
        Ok(Arc::new(self.rule.make(&*part(&self.parts[0])?, &*part(&self.parts[1])?)))
    }
}

/// The alpha mode that covers two images: opaque only if both are.
pub(crate) fn more_open(a: AlphaMode, b: AlphaMode) -> AlphaMode {
    match (a, b) {
        (AlphaMode::Blend, _) | (_, AlphaMode::Blend) => AlphaMode::Blend,
        (AlphaMode::Opaque, mode) => mode,
        (mode, _) => mode,
    }
}

/// Combines two images or image sequences of one size. `names`: the options that gave them, for errors.
pub fn join(
    o: &Options,
    names: [&str; 2],
    a: &ImageRef,
    b: &ImageRef,
    rule: Rule,
) -> Result<ImageRef, ApiError> {
    maps::same_size(o, names[1], b, names[0], a)?;
    let parts = [(a.decoded()?, a.files.clone()), (b.decoded()?, b.files.clone())];
    let image = Arc::new(rule.make(&parts[0].0, &parts[1].0));
    let made = ImageRef { image, file: None, files: None, ..a.clone() };
    let counts = [a, b].map(|i| i.files.as_ref().map(|f| f.hashes.len()));
    let count = match counts {
        [None, None] => return Ok(made),
        [Some(a), Some(b)] if a != b => return Err(unequal(o, [names[0], names[1]], [a, b])),
        [a, b] => a.or(b).unwrap_or(1),
    };
    let hash_of = |part: &(Arc<Image>, Option<ImageSequenceRef>), i: usize| match &part.1 {
        Some(many) => many.hashes[i],
        None => part.0.content_hash(),
    };
    let single = [&parts[0], &parts[1]].map(|p| if p.1.is_none() { Some(hash_of(p, 0)) } else { None });
    let hash = |i: usize| {
        let mut h = blake3::Hasher::new();
        h.update(format!("{rule:?}").as_bytes());
        for (part, single) in parts.iter().zip(&single) {
            h.update(&single.unwrap_or_else(|| hash_of(part, i)));
        }
        *h.finalize().as_bytes()
    };
    let hashes = (0..count).map(hash).collect();
    let joined = Joined { parts: parts.clone(), rule };
    let mut alpha = AlphaMode::Opaque;
    if matches!(rule, Rule::Opacity) {
        // Each image is combined once to find the alpha mode of the sequence.
        for i in 0..count {
            let one = joined.image(i).map_err(|e| ApiError::new(format!("{}: {e}", o.function)))?;
            alpha = more_open(alpha, of_picture(&one));
        }
    }
    Ok(ImageRef { files: Some(ImageSequenceRef { pictures: Arc::new(joined), hashes, alpha }), ..made })
}

/// The image or image sequence (numbered files or an array) of an option.
pub fn image_or_sequence(o: &Options, name: &str) -> Result<Option<ImageRef>, ApiError> {
    let mut all = maps::pictures(o, name)?;
    if o.get(name).is_some_and(|v| v.is_array()) {
        return sequence_of_images(o, name, &all).map(Some);
    }
    Ok(all.pop())
}

/// The image sequence of an array of images.
pub fn sequence_of_images(o: &Options, name: &str, all: &[ImageRef]) -> Result<ImageRef, ApiError> {
    let first = maps::of_one_size(o, name, all)?;
    let pictures = all.iter().map(ImageRef::decoded).collect::<Result<Vec<Arc<Image>>, ApiError>>()?;
    let hashes = pictures.iter().map(|i| i.content_hash()).collect();
    let alpha = pictures.iter().map(|i| of_picture(i)).fold(AlphaMode::Opaque, more_open);
    let files = ImageSequenceRef { pictures: Arc::new(Held(pictures)), hashes, alpha };
    Ok(ImageRef { files: Some(files), ..first.clone() })
}

/// The texture animation of a material. `given`: each slot with the option that gave it and its image sequence.
pub fn sequence(
    o: &Options,
    given: &[(TextureSlot, &str, Option<ImageSequenceRef>)],
    fps: Option<f64>,
    once: Option<bool>,
) -> Result<Option<Arc<ImageSequence>>, ApiError> {
    let mut all = given.iter().filter_map(|(slot, name, f)| Some((*slot, *name, f.as_ref()?)));
    let Some((slot, name, first)) = all.next() else { return Ok(None) };
    let stream = |slot: TextureSlot, f: &ImageSequenceRef| ImageStream {
        slot,
        pictures: f.pictures.clone(),
        hashes: f.hashes.clone(),
    };
    let mut streams = vec![stream(slot, first)];
    for (slot, other, f) in all {
        if f.hashes.len() != first.hashes.len() {
            return Err(unequal(o, [name, other], [first.hashes.len(), f.hashes.len()]));
        }
        streams.push(stream(slot, f));
    }
    let (fps, once) = (fps.unwrap_or(12.0) as f32, once.unwrap_or(false));
    Ok(Some(Arc::new(ImageSequence { streams, fps, once })))
}

fn unequal(o: &Options, names: [&str; 2], counts: [usize; 2]) -> ApiError {
    let text = format!(
        "{}: {} has {} images, {} {}; sequences on one surface must have the same length",
        o.function, names[0], counts[0], names[1], counts[1]
    );
    ApiError::new(text).focus(names[1])
}
