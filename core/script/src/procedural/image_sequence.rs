//! Image sequences (texture animation) in any texture slot of a material, and sequences combined from two.

use super::maps;
use super::material::alpha_mode_of;
use crate::call::{ApiError, Options};
use crate::value::{ImageRef, ImageSequenceRef};
use choreo_asset::{
    AlphaMode, Image, ImageSequence, ImageSource, ImageSourceError, ImageStream, TextureSlot,
};
use std::sync::Arc;

/// Images of an image sequence that is given as an array, in memory.
#[derive(Debug)]
struct ImagesInMemory(Vec<Arc<Image>>);

impl ImageSource for ImagesInMemory {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        self.0.get(index).cloned().ok_or(ImageSourceError::Missing(index))
    }
}

/// Operation that combines two images into one.
#[derive(Clone, Copy, Debug)]
pub(super) enum ImageOperation {
    /// The first image, with alpha multiplied by the brightness of the second.
    MultiplyAlpha,
    /// The first image (a normal map), with the brightness of the second (a height map) as alpha.
    HeightsAsAlpha,
    /// `HeightsAsAlpha` with a normal map that is computed from the height map. The number is the depth of the heights in widths
    /// of the texture. The first image is not read.
    NormalsFromHeights(f32),
}

impl ImageOperation {
    fn apply(self, a: &Image, b: &Image) -> Image {
        match self {
            ImageOperation::MultiplyAlpha => maps::with_opacity(a, b),
            ImageOperation::HeightsAsAlpha => maps::with_heights(a, b),
            ImageOperation::NormalsFromHeights(depth) => {
                maps::with_heights(&maps::normals_from_heights(b, depth), b)
            }
        }
    }
}

/// Image sequence whose images are combined from two inputs on demand. An input without a sequence is the same image in every
/// frame.
#[derive(Debug)]
struct CombinedImages {
    inputs: [(Arc<Image>, Option<ImageSequenceRef>); 2],
    operation: ImageOperation,
}

impl ImageSource for CombinedImages {
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError> {
        let input = |(image, sequence): &(Arc<Image>, Option<ImageSequenceRef>)| match sequence {
            Some(sequence) => sequence.images.image(index),
            None => Ok(image.clone()),
        };
        Ok(Arc::new(self.operation.apply(&*input(&self.inputs[0])?, &*input(&self.inputs[1])?)))
    }
}

/// The alpha mode that is sufficient for two images: blend if one of them needs it, opaque only if both are opaque.
pub(crate) fn combined_alpha_mode(a: AlphaMode, b: AlphaMode) -> AlphaMode {
    match (a, b) {
        (AlphaMode::Blend, _) | (_, AlphaMode::Blend) => AlphaMode::Blend,
        (AlphaMode::Opaque, mode) => mode,
        (mode, _) => mode,
    }
}

/// Combines two images or image sequences of one size. `names`: the options that contain them, for errors.
pub(super) fn combine_images(
    o: &Options,
    names: [&str; 2],
    a: &ImageRef,
    b: &ImageRef,
    operation: ImageOperation,
) -> Result<ImageRef, ApiError> {
    maps::check_same_size(o, names[1], b, names[0], a)?;
    let inputs = [(a.decoded()?, a.sequence.clone()), (b.decoded()?, b.sequence.clone())];
    let image = Arc::new(operation.apply(&inputs[0].0, &inputs[1].0));
    let made = ImageRef { image, file: None, sequence: None, ..a.clone() };
    let counts = [a, b].map(|i| i.sequence.as_ref().map(|f| f.hashes.len()));
    let count = match counts {
        [None, None] => return Ok(made),
        [Some(a), Some(b)] if a != b => return Err(length_error(o, [names[0], names[1]], [a, b])),
        [a, b] => a.or(b).unwrap_or(1),
    };
    let hash_of = |input: &(Arc<Image>, Option<ImageSequenceRef>), i: usize| match &input.1 {
        Some(sequence) => sequence.hashes[i],
        None => input.0.content_hash(),
    };
    let single_hashes =
        [&inputs[0], &inputs[1]].map(|p| if p.1.is_none() { Some(hash_of(p, 0)) } else { None });
    let hash = |i: usize| {
        let mut h = blake3::Hasher::new();
        h.update(format!("{operation:?}").as_bytes());
        for (input, single) in inputs.iter().zip(&single_hashes) {
            h.update(&single.unwrap_or_else(|| hash_of(input, i)));
        }
        *h.finalize().as_bytes()
    };
    let hashes = (0..count).map(hash).collect();
    let combined = CombinedImages { inputs: inputs.clone(), operation };
    let mut alpha = AlphaMode::Opaque;
    if matches!(operation, ImageOperation::MultiplyAlpha) {
        // Each image is combined once to find the alpha mode of the sequence.
        for i in 0..count {
            let image = combined.image(i).map_err(|e| ApiError::new(format!("{}: {e}", o.function)))?;
            alpha = combined_alpha_mode(alpha, alpha_mode_of(&image));
        }
    }
    Ok(ImageRef { sequence: Some(ImageSequenceRef { images: Arc::new(combined), hashes, alpha }), ..made })
}

/// The image or image sequence (numbered files or an array) of an option.
pub(super) fn image_or_sequence(o: &Options, name: &str) -> Result<Option<ImageRef>, ApiError> {
    let mut all = maps::images(o, name)?;
    if o.get(name).is_some_and(|v| v.is_array()) {
        return sequence_of_images(o, name, &all).map(Some);
    }
    Ok(all.pop())
}

/// The image sequence of an array of images.
pub(super) fn sequence_of_images(o: &Options, name: &str, all: &[ImageRef]) -> Result<ImageRef, ApiError> {
    let first = maps::first_of_equal_size(o, name, all)?;
    let images = all.iter().map(ImageRef::decoded).collect::<Result<Vec<Arc<Image>>, ApiError>>()?;
    let hashes = images.iter().map(|i| i.content_hash()).collect();
    let alpha = images.iter().map(|i| alpha_mode_of(i)).fold(AlphaMode::Opaque, combined_alpha_mode);
    let sequence = ImageSequenceRef { images: Arc::new(ImagesInMemory(images)), hashes, alpha };
    Ok(ImageRef { sequence: Some(sequence), ..first.clone() })
}

/// The texture animation of a material, if it has image sequences. `given`: each texture slot with the name of its option and its
/// image sequence; `once`: play once instead of repeating.
pub(super) fn texture_animation(
    o: &Options,
    given: &[(TextureSlot, &str, Option<ImageSequenceRef>)],
    fps: Option<f64>,
    once: Option<bool>,
) -> Result<Option<Arc<ImageSequence>>, ApiError> {
    let mut all = given.iter().filter_map(|(slot, name, f)| Some((*slot, *name, f.as_ref()?)));
    let Some((slot, name, first)) = all.next() else { return Ok(None) };
    let stream = |slot: TextureSlot, f: &ImageSequenceRef| ImageStream {
        slot,
        pictures: f.images.clone(),
        hashes: f.hashes.clone(),
    };
    let mut streams = vec![stream(slot, first)];
    for (slot, other, f) in all {
        if f.hashes.len() != first.hashes.len() {
            return Err(length_error(o, [name, other], [first.hashes.len(), f.hashes.len()]));
        }
        streams.push(stream(slot, f));
    }
    let (fps, once) = (fps.unwrap_or(12.0) as f32, once.unwrap_or(false));
    Ok(Some(Arc::new(ImageSequence { streams, fps, once })))
}

/// The error that the image sequences of two options have different lengths.
fn length_error(o: &Options, names: [&str; 2], counts: [usize; 2]) -> ApiError {
    let text = format!(
        "{}: {} has {} images, {} has {}; sequences on one surface must have the same length",
        o.function, names[0], counts[0], names[1], counts[1]
    );
    ApiError::new(text).focus(names[1])
}
