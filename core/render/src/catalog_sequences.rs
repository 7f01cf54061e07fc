//! Pictures that follow each other: each has a material and a texture of its own in the catalogue, without pixels, so that a
//! renderer makes those that a frame shows and forgets those that none has shown for a while.

use crate::RenderError;
use crate::catalog::{Catalog, CatalogMaterial, CatalogTexture, CatalogTextureRef, PrimitiveEntry};
use choreo_motion::Time;
use choreo_stage::{Image, Sequence};
use std::sync::Arc;

/// Of a texture that is made when it is seen: of which pictures which one.
pub type Streamed = (Arc<Sequence>, usize);

impl CatalogTexture {
    /// With its pixels, which are made now where it is streamed.
    pub fn whole(&self) -> Result<CatalogTexture, RenderError> {
        let Some((sequence, index)) = &self.streamed else { return Ok(self.clone()) };
        let image = sequence.pictures.picture(*index).map_err(RenderError::Usage)?;
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
    /// As it is with each of the pictures after the first, whose textures `of` numbers.
    pub(crate) fn following(&self, mut of: impl FnMut(&Arc<Sequence>, usize) -> u32) -> Vec<CatalogMaterial> {
        let (Some(sequence), Some(first)) = (&self.material.sequence, self.base_color) else {
            return Vec::new();
        };
        let one = |i| CatalogMaterial {
            base_color: Some(CatalogTextureRef { texture: of(sequence, i), ..first }),
            ..self.clone()
        };
        (1..sequence.hashes.len()).map(one).collect()
    }
}

impl Catalog {
    /// The entry with the material that it has at a time.
    pub fn showing(&self, entry: &PrimitiveEntry, time: Time) -> PrimitiveEntry {
        let material = &self.materials[entry.material as usize];
        let shown = material.material.sequence.as_ref().filter(|_| material.base_color.is_some());
        PrimitiveEntry { material: entry.material + shown.map_or(0, |s| s.index(time) as u32), ..*entry }
    }

    /// Textures of a material that are made when they are seen.
    pub fn streamed(&self, material: u32) -> Option<u32> {
        let texture = self.materials.get(material as usize)?.base_color?.texture;
        self.textures[texture as usize].streamed.is_some().then_some(texture)
    }
}
