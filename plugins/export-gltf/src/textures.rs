//! Textures: images as PNG, each content once, and samplers (glTF 2.0, §3.8).

use crate::buffer::Buffer;
use crate::container::percent_encoded;
use crate::document::Index;
use choreo_exporter_kit::{UvParts, png_of};
use choreo_plugin::asset::{Asset, ContentHash, Image, Sampler, TextureRef, Wrap};
use choreo_plugin::glam::Affine2;
use choreo_plugin::{ExportError, SceneFiles};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

#[derive(Default)]
pub struct Textures {
    pub images: Vec<Value>,
    pub samplers: Vec<Value>,
    pub textures: Vec<Value>,
    /// Whether some texture has a transform.
    pub transformed: bool,
    /// Textures get a transform even if it changes nothing, because an animation names it.
    pub animated: bool,
    known: BTreeMap<ContentHash, Index>,
    /// Images by the address of what holds them, so that each is hashed once.
    hashed: BTreeMap<usize, Index>,
    /// (image, sampler) of each texture.
    pairs: Vec<(Index, Index)>,
    kinds: Vec<Sampler>,
    /// Images that lie beside the JSON, with the endings of their names.
    beside: Vec<(String, Vec<u8>)>,
    /// The stem of names beside the JSON; `None`: images are in the buffer.
    stem: Option<String>,
}

impl Textures {
    /// `stem`: of the files beside the JSON; without it all is in the buffer.
    pub fn new(stem: Option<&str>) -> Textures {
        Textures { stem: stem.map(str::to_string), ..Textures::default() }
    }

    /// A textureInfo; `None` where the asset has no such image.
    pub fn info(
        &mut self,
        buffer: &mut Buffer<'_>,
        asset: &Asset,
        texture: &TextureRef,
    ) -> Result<Option<Map<String, Value>>, ExportError> {
        let Some(image) = asset.images.get(texture.image as usize) else { return Ok(None) };
        if image.width == 0 || image.height == 0 {
            return Ok(None);
        }
        let image = self.image(buffer, image)?;
        let sampler = self.sampler(texture.sampler);
        let pair = (image, sampler);
        let index = self.pairs.iter().position(|known| *known == pair).unwrap_or_else(|| {
            self.pairs.push(pair);
            self.textures.push(json!({ "sampler": sampler, "source": image }));
            self.pairs.len() - 1
        });
        let mut info = Map::new();
        info.insert("index".into(), index.into());
        if texture.uv_set > 0 {
            info.insert("texCoord".into(), texture.uv_set.into());
        }
        if texture.uv_transform != Affine2::IDENTITY || self.animated {
            self.transformed = true;
            let transform = uv_json(&UvParts::of(&texture.uv_transform));
            info.insert("extensions".into(), json!({ "KHR_texture_transform": transform }));
        }
        Ok(Some(info))
    }

    fn image(
        &mut self,
        buffer: &mut Buffer<'_>,
        image: &std::sync::Arc<Image>,
    ) -> Result<Index, ExportError> {
        let address = std::sync::Arc::as_ptr(image) as usize;
        if let Some(index) = self.hashed.get(&address) {
            return Ok(*index);
        }
        let hash = image.content_hash();
        let index = match self.known.get(&hash) {
            Some(index) => *index,
            None => {
                let png = png_of(image)?;
                let index = self.images.len() as Index;
                self.images.push(match &self.stem {
                    None => json!({
                        "name": image.name, "mimeType": "image/png", "bufferView": buffer.bytes(png),
                    }),
                    Some(stem) => {
                        let ending = format!("_{index}.png");
                        let uri = percent_encoded(&format!("{stem}{ending}"));
                        self.beside.push((ending, png));
                        json!({ "name": image.name, "uri": uri })
                    }
                });
                self.known.insert(hash, index);
                index
            }
        };
        self.hashed.insert(address, index);
        Ok(index)
    }

    fn sampler(&mut self, sampler: Sampler) -> Index {
        let known = self.kinds.iter().position(|known| *known == sampler);
        known.unwrap_or_else(|| {
            self.kinds.push(sampler);
            self.samplers.push(sampler_json(sampler));
            self.kinds.len() - 1
        }) as Index
    }

    /// Writes the images that lie beside the JSON.
    pub fn write_beside(&self, files: &mut dyn SceneFiles) -> Result<(), ExportError> {
        for (ending, png) in &self.beside {
            let out = files.beside(ending)?;
            out.write_all(png)?;
            out.flush()?;
        }
        Ok(())
    }
}

fn sampler_json(s: Sampler) -> Value {
    let wrap = |wrap: Wrap| match wrap {
        Wrap::Repeat => 10497,
        Wrap::MirroredRepeat => 33648,
        Wrap::ClampToEdge => 33071,
    };
    let min = match (s.min_linear, s.mip_linear) {
        (false, None) => 9728,
        (true, None) => 9729,
        (false, Some(false)) => 9984,
        (true, Some(false)) => 9985,
        (false, Some(true)) => 9986,
        (true, Some(true)) => 9987,
    };
    let mag = if s.mag_linear { 9729 } else { 9728 };
    json!({ "magFilter": mag, "minFilter": min, "wrapS": wrap(s.wrap_u), "wrapT": wrap(s.wrap_v) })
}

/// A transform as KHR_texture_transform has it.
fn uv_json(uv: &UvParts) -> Value {
    json!({ "offset": uv.offset.to_array(), "rotation": uv.rotation, "scale": uv.scale.to_array() })
}
