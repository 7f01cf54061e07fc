//! Pictures that follow each other: each has a material and a texture of its own in the catalogue, without pixels, so that a
//! renderer makes those that a frame shows and forgets those that none has shown for a while.

use crate::RenderError;
use crate::scene_resources::{Catalog, CatalogMaterial, CatalogTexture, CatalogTextureRef, PrimitiveEntry};
use choreo_asset::{Image, Pictures, Shading, Stream, TextureSlot};
use choreo_motion::Time;
use std::sync::Arc;

/// Of a texture that is made when it is seen: of which pictures which one.
pub type Streamed = (Arc<dyn Pictures>, usize);

impl CatalogTexture {
    /// With its pixels, which are made now where it is streamed.
    pub fn whole(&self) -> Result<CatalogTexture, RenderError> {
        let Some((pictures, index)) = &self.streamed else { return Ok(self.clone()) };
        let image = pictures.picture(*index).map_err(RenderError::Usage)?;
        let size = |i: &Image| (i.width, i.height);
        if size(&image) != size(&self.image) || image.rgba.len() as u64 != self.bytes() {
            return Err(RenderError::Usage(format!(
                "picture {index} of a sequence has not the size of the first"
            )));
        }
        Ok(CatalogTexture { image, streamed: None, ..self.clone() })
    }

    /// Of its pixels, without mipmaps.
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.image.width) * u64::from(self.image.height)
    }
}

impl CatalogMaterial {
    fn slot(&mut self, slot: TextureSlot) -> &mut Option<CatalogTextureRef> {
        match slot {
            TextureSlot::BaseColor => &mut self.base_color,
            TextureSlot::MetallicRoughness => &mut self.metallic_roughness,
            TextureSlot::Normal => &mut self.normal,
            TextureSlot::Occlusion => &mut self.occlusion,
            TextureSlot::Emissive => &mut self.emissive,
            TextureSlot::Specular => &mut self.specular,
            TextureSlot::SpecularColor => &mut self.specular_color,
        }
    }

    /// Those of its streams that change a pixel, with the texture that stands for the first picture.
    fn streams(&self) -> impl Iterator<Item = (&Stream, CatalogTextureRef)> {
        // Toon shading has other things in the other slots.
        let toon = self.material.shading == Shading::Toon;
        let read = move |s: &&Stream| {
            !toon || matches!(s.slot, TextureSlot::BaseColor | TextureSlot::Normal | TextureSlot::Emissive)
        };
        let streams = self.material.sequence.iter().flat_map(|s| &s.streams).filter(read);
        streams.filter_map(|s| Some((s, self.texture_refs()[s.slot as usize]?)))
    }

    /// As it is with each of the pictures after the first, whose textures `of` numbers.
    pub(crate) fn following(
        &self,
        mut of: impl FnMut(&Stream, usize, CatalogTextureRef) -> u32,
    ) -> Vec<CatalogMaterial> {
        let Some(sequence) = self.material.sequence.as_ref().filter(|_| self.streams().next().is_some())
        else {
            return Vec::new();
        };
        let one = |i| {
            let mut made = self.clone();
            for (stream, first) in self.streams() {
                *made.slot(stream.slot) = Some(CatalogTextureRef { texture: of(stream, i, first), ..first });
            }
            made
        };
        (1..sequence.count()).map(one).collect()
    }
}

impl Catalog {
    /// The entry with the material that it has at a time.
    pub fn showing(&self, entry: &PrimitiveEntry, time: Time) -> PrimitiveEntry {
        let material = &self.materials[entry.material as usize];
        let shown = material.material.sequence.as_ref().filter(|_| material.streams().next().is_some());
        PrimitiveEntry { material: entry.material + shown.map_or(0, |s| s.index(time) as u32), ..*entry }
    }

    /// Textures of a material that are made when they are seen: place among its textures, texture.
    pub fn streamed(&self, material: u32) -> impl Iterator<Item = (usize, u32)> {
        let refs = self.materials.get(material as usize).map(|m| m.texture_refs());
        let refs = refs.into_iter().flatten().enumerate();
        refs.filter_map(|(slot, t)| Some((slot, t?.texture)))
            .filter(|(_, texture)| self.textures[*texture as usize].streamed.is_some())
    }
}
