//! Image sequences as textures. Each image has its own material and texture in the scene resources, without pixels: a renderer
//! loads the images that a frame shows, and drops those that no recent frame has shown.

use crate::error::RenderError;
use crate::scene_resources::material::{MaterialResource, MaterialTexture};
use crate::scene_resources::{PrimitiveEntry, SceneResources, TextureResource};
use choreo_asset::{Image, ImageSource, ImageStream, Shading, TextureSlot};
use choreo_motion::Time;
use std::sync::Arc;

/// The image sequence of a streamed texture, and the index of the image in it.
pub(crate) type Streamed = (Arc<dyn ImageSource>, usize);

impl TextureResource {
    /// The texture with its pixels, which are loaded now if it is streamed.
    pub fn with_loaded_pixels(&self) -> Result<TextureResource, RenderError> {
        let Some((pictures, index)) = &self.streamed else { return Ok(self.clone()) };
        let image = pictures.image(*index).map_err(|e| RenderError::Usage(e.to_string()))?;
        let size = |i: &Image| (i.width, i.height);
        if size(&image) != size(&self.image) || image.rgba.len() as u64 != self.bytes() {
            return Err(RenderError::Usage(format!(
                "image {index} of a sequence has another size than the first"
            )));
        }
        Ok(TextureResource { image, streamed: None, ..self.clone() })
    }

    /// Size of the pixels in bytes, without mipmaps.
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.image.width) * u64::from(self.image.height)
    }
}

impl MaterialResource {
    /// Image streams that can change a pixel, with the texture of the first image.
    fn streams(&self) -> impl Iterator<Item = (&ImageStream, MaterialTexture)> {
        // Toon shading uses the other slots for other textures.
        let toon = self.material.shading == Shading::Toon;
        let read = move |s: &&ImageStream| {
            !toon || matches!(s.slot, TextureSlot::BaseColor | TextureSlot::Normal | TextureSlot::Emissive)
        };
        let streams = self.material.sequence.iter().flat_map(|s| &s.streams).filter(read);
        streams.filter_map(|s| Some((s, self.texture(s.slot)?)))
    }

    /// The material with each of the images after the first. `texture_of` gives the texture of a stream's image.
    pub(crate) fn with_later_images(
        &self,
        mut texture_of: impl FnMut(&ImageStream, usize, MaterialTexture) -> u32,
    ) -> Vec<MaterialResource> {
        let Some(sequence) = self.material.sequence.as_ref().filter(|_| self.streams().next().is_some())
        else {
            return Vec::new();
        };
        let one = |i| {
            let mut made = self.clone();
            for (stream, first) in self.streams() {
                let texture = texture_of(stream, i, first);
                made.textures[stream.slot as usize] = Some(MaterialTexture { texture, ..first });
            }
            made
        };
        (1..sequence.count()).map(one).collect()
    }
}

impl SceneResources {
    /// The entry with the material of the image that its sequence shows at `time`.
    pub(crate) fn with_sequence_image_at(&self, entry: &PrimitiveEntry, time: Time) -> PrimitiveEntry {
        let material = &self.materials[entry.material as usize];
        let shown = material.material.sequence.as_ref().filter(|_| material.streams().next().is_some());
        PrimitiveEntry { material: entry.material + shown.map_or(0, |s| s.index(time) as u32), ..*entry }
    }

    /// (slot, texture) of a material's streamed textures.
    pub(crate) fn streamed(&self, material: u32) -> impl Iterator<Item = (usize, u32)> {
        let textures = self.materials.get(material as usize).map(|m| m.textures);
        let textures = textures.into_iter().flatten().enumerate();
        textures
            .filter_map(|(slot, t)| Some((slot, t?.texture)))
            .filter(|(_, texture)| self.textures[*texture as usize].streamed.is_some())
    }
}
