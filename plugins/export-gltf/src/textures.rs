//! Textures: images, equal ones stored once, and samplers (glTF 2.0, §3.8; EXT_texture_webp).

use crate::buffer::Buffer;
use crate::container::percent_encoded;
use crate::document::Index;
use choreo_exporter_kit::{ImageFiles, UvParts};
use choreo_plugin::asset::{Asset, ImageFileFormat, Sampler, TextureRef, Wrap};
use choreo_plugin::glam::Affine2;
use choreo_plugin::{ExportError, SceneFiles};
use serde_json::{Map, Value, json};

/// Image formats that glTF allows.
const FORMATS: &[ImageFileFormat] = &[ImageFileFormat::Png, ImageFileFormat::Jpeg, ImageFileFormat::WebP];

pub(crate) struct Textures {
    images: ImageFiles,
    pub samplers: Vec<Value>,
    pub textures: Vec<Value>,
    /// Whether some texture has a transform.
    pub transformed: bool,
    /// Whether some image is WebP.
    pub webp: bool,
    /// Whether the current material is animated: its textures then get a transform even at the default, because animations refer
    /// to it.
    pub animated: bool,
    /// (image, sampler) of each texture.
    pairs: Vec<(usize, Index)>,
    kinds: Vec<Sampler>,
}

impl Default for Textures {
    fn default() -> Textures {
        Textures {
            images: ImageFiles::new(FORMATS),
            samplers: Vec::new(),
            textures: Vec::new(),
            transformed: false,
            webp: false,
            animated: false,
            pairs: Vec::new(),
            kinds: Vec::new(),
        }
    }
}

impl Textures {
    /// A textureInfo; `None` where the asset lacks the image.
    pub(crate) fn info(&mut self, asset: &Asset, texture: &TextureRef) -> Option<Map<String, Value>> {
        let image = asset.images.get(texture.image as usize).filter(|i| i.width > 0 && i.height > 0)?;
        let image = self.images.number(image);
        let sampler = self.sampler(texture.sampler);
        let pair = (image, sampler);
        let index = self.pairs.iter().position(|known| *known == pair).unwrap_or_else(|| {
            self.pairs.push(pair);
            self.textures.push(match self.images.format(image) {
                ImageFileFormat::WebP => {
                    self.webp = true;
                    json!({ "sampler": sampler, "extensions": { "EXT_texture_webp": { "source": image } } })
                }
                _ => json!({ "sampler": sampler, "source": image }),
            });
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
        Some(info)
    }

    fn sampler(&mut self, sampler: Sampler) -> Index {
        let known = self.kinds.iter().position(|known| *known == sampler);
        known.unwrap_or_else(|| {
            self.kinds.push(sampler);
            self.samplers.push(sampler_json(sampler));
            self.kinds.len() - 1
        }) as Index
    }

    /// Adds the images to the buffer. Returns their JSON.
    ///
    /// # Errors
    /// An image cannot be encoded as PNG.
    pub(crate) fn images_in_buffer(&self, buffer: &mut Buffer<'_>) -> Result<Vec<Value>, ExportError> {
        let json = |(number, file): (usize, choreo_plugin::asset::ImageFile)| {
            let media_type = file.format.media_type();
            let view = buffer.bytes(file.bytes);
            json!({ "name": self.images.name(number), "mimeType": media_type, "bufferView": view })
        };
        Ok(self.images.files()?.into_iter().enumerate().map(json).collect())
    }

    /// Writes the images as separate files whose names begin with `stem`. Returns their JSON.
    ///
    /// # Errors
    /// An image cannot be encoded as PNG, or a file cannot be written.
    pub(crate) fn beside(&self, stem: &str, files: &mut dyn SceneFiles) -> Result<Vec<Value>, ExportError> {
        let mut out = Vec::new();
        for (number, file) in self.images.files()?.into_iter().enumerate() {
            let ending = self.images.ending(number);
            let beside = files.beside(&ending)?;
            beside.write_all(&file.bytes)?;
            beside.flush()?;
            let uri = percent_encoded(&format!("{stem}{ending}"));
            out.push(json!({ "name": self.images.name(number), "uri": uri }));
        }
        Ok(out)
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

/// A texture transform as KHR_texture_transform.
fn uv_json(uv: &UvParts) -> Value {
    json!({ "offset": uv.offset.to_array(), "rotation": uv.rotation, "scale": uv.scale.to_array() })
}
