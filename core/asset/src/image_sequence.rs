//! Image sequences on a surface, decoded only when they are shown.

use crate::hash::ContentHash;
use crate::texture::Image;
use choreo_motion::Time;
use std::fmt::Debug;
use std::sync::Arc;

/// Source of the images of a sequence.
pub trait ImageSource: Debug + Send + Sync {
    /// The image at an index. All images have the same size.
    fn image(&self, index: usize) -> Result<Arc<Image>, ImageSourceError>;
}

/// The reason why an image of a sequence is not available.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
pub enum ImageSourceError {
    /// There is no image of this number.
    Missing(usize),
    /// The `file` cannot be decoded, because of `what`.
    Undecodable { file: String, what: String },
}

choreo_motion::error_texts! { ImageSourceError:
    Self::Missing(index) => "there is no image {index}";
    Self::Undecodable { file, what } => "\"{file}\": {what}";
}

/// Image sequences that replace textures of a material, all at the same rate. The material's own images are the first ones.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageSequence {
    /// Streams, one per texture slot, each with the same number of images.
    pub streams: Vec<ImageStream>,
    /// Frames per second.
    pub fps: f32,
    /// Whether the last image stays; otherwise the sequence repeats.
    pub once: bool,
}

/// The images of one texture.
#[derive(Clone, Debug)]
pub struct ImageStream {
    /// Texture slot of the material that shows the images.
    pub slot: TextureSlot,
    /// The images, decoded when they are shown.
    pub pictures: Arc<dyn ImageSource>,
    /// Content hashes, one per image: equal hashes are equal images.
    pub hashes: Vec<ContentHash>,
}

/// Texture slots of a material, named as in glTF. Their numbers are the slots of [`choreo_motion::MaterialProperty`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureSlot {
    /// Base color and alpha.
    BaseColor,
    /// Roughness in green, metallic in blue.
    MetallicRoughness,
    /// Normal map.
    Normal,
    /// Occlusion in red.
    Occlusion,
    /// Emitted light.
    Emissive,
    /// The reflection map of Blinn–Phong and Phong materials.
    Specular,
    /// Color of the specular reflection.
    SpecularColor,
}

impl PartialEq for ImageStream {
    fn eq(&self, other: &ImageStream) -> bool {
        (self.slot, &self.hashes) == (other.slot, &other.hashes)
    }
}

impl ImageSequence {
    /// Number of images that all streams have.
    pub fn count(&self) -> usize {
        self.streams.iter().map(|s| s.hashes.len()).min().unwrap_or(0)
    }

    /// Index of the image that is shown at a time.
    pub fn index(&self, time: Time) -> usize {
        frame_index(time, self.fps, self.count().max(1), self.once)
    }
}

/// Index of the frame, of `count`, that is shown at a time.
pub(crate) fn frame_index(time: Time, fps: f32, count: usize, once: bool) -> usize {
    let count = count as f64;
    let frame = libm::floor(time.0 as f64 * f64::from(fps) / Time::TICKS_PER_SECOND as f64);
    match once {
        true => frame.clamp(0.0, count - 1.0) as usize,
        false => (frame - count * libm::floor(frame / count)) as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_repeat_or_stop_at_the_last_one() {
        let at = |seconds: f64, once| frame_index(Time::from_secs(seconds), 10.0, 3, once);
        let seen = |once| [-0.05, 0.0, 0.1, 0.25, 0.3, 1.0].map(|t| at(t, once));
        assert_eq!(seen(false), [2, 0, 1, 2, 0, 1]);
        assert_eq!(seen(true), [0, 0, 1, 2, 2, 2]);
    }
}
