//! Textures: finds their images, and combines channels of several images into one.

use crate::alpha::{self, Alpha};
use crate::file::{File, place_of};
use crate::local;
use crate::materials::MaterialDraft;
use choreo_asset::{Image, Sampler, TextureRef, Wrap};
use choreo_importer_kit::images::{Encoded, Formats};
use choreo_importer_kit::search;
use choreo_importer_kit::textures::Bytes;
use choreo_importer_kit::{Problem, Result, WithPlace};
use glam::{Affine2, DAffine2, DAffine3, DMat2, DVec2, DVec3};
use std::collections::BTreeMap;
use std::sync::Arc;
use ufbx::{Texture, TextureType, WrapMode};

/// Image indices from here on refer to combined images.
const FIRST_COMBINED_INDEX: u32 = 1 << 30;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Channel {
    Red,
    Green,
    Blue,
    /// Mean of red, green and blue.
    Gray,
    /// Alpha where the image has any, else the mean of the colors.
    AlphaOrGray,
}

/// One channel of a combined image.
#[derive(Clone, Copy)]
pub(crate) struct ChannelSource<'a> {
    pub texture: &'a Texture,
    pub channel: Channel,
    pub invert: bool,
}

/// Sources of the four channels: image, channel, whether to invert; white for `None`.
type Recipe = [Option<(u32, Channel, bool)>; 4];

/// The images that materials request; equal ones are stored once.
#[derive(Default)]
pub(crate) struct ImageTable {
    /// Image index by texture; `None` where it has no image.
    image_of_texture: BTreeMap<u32, Option<u32>>,
    encoded: Vec<Encoded<Bytes>>,
    recipes: Vec<Recipe>,
}

impl ImageTable {
    pub(crate) fn encoded(&self) -> &[Encoded<Bytes>] {
        &self.encoded
    }

    pub(crate) fn texture_ref(
        &mut self,
        file: &File<'_>,
        texture: &Texture,
        uv_set: u8,
    ) -> Result<Option<TextureRef>> {
        let image = self.image_index(file, texture)?;
        Ok(image.map(|image| make_texture_ref(file, texture, image, uv_set)))
    }

    /// A texture whose red, green, blue and alpha come from the sources; `None` where none of them has an image.
    pub(crate) fn combined_texture_ref(
        &mut self,
        file: &File<'_>,
        sources: [Option<ChannelSource<'_>>; 4],
        uv_set: u8,
    ) -> Result<Option<TextureRef>> {
        let mut recipe: Recipe = [None; 4];
        let mut first_texture = None;
        for (slot, source) in recipe.iter_mut().zip(&sources) {
            let Some(source) = source else { continue };
            if let Some(image) = self.image_index(file, source.texture)? {
                *slot = Some((image, source.channel, source.invert));
                first_texture.get_or_insert(source.texture);
            }
        }
        let Some(first_texture) = first_texture else { return Ok(None) };
        let index = match self.recipes.iter().position(|r| *r == recipe) {
            Some(known) => known,
            None => {
                let size =
                    recipe.iter().flatten().map(|r| self.encoded[r.0 as usize].pixels()).max().unwrap_or(0);
                file.image_budget.charge(size, 4).at(|| place_of(&first_texture.element))?;
                self.recipes.push(recipe);
                self.recipes.len() - 1
            }
        };
        Ok(Some(make_texture_ref(file, first_texture, FIRST_COMBINED_INDEX + index as u32, uv_set)))
    }

    /// Index of a texture's image; `None`, with a warning, where it cannot be found or read.
    pub(crate) fn image_index(&mut self, file: &File<'_>, texture: &Texture) -> Result<Option<u32>> {
        if !file.needs.textures {
            return Ok(None);
        }
        if let Some(known) = self.image_of_texture.get(&texture.element.typed_id) {
            return Ok(*known);
        }
        let place = place_of(&texture.element);
        let of_file = texture.file_textures.as_ref();
        if texture.type_ != TextureType::File || of_file.len() > 1 {
            let what = match of_file.len() {
                0 => "is procedural, not an image, and is left out".to_string(),
                n => format!("is composed of {n} images; the first is used"),
            };
            file.notes.warn(place.clone(), what);
        }
        let found = match of_file
            .first()
            .map(|t| t.as_ref())
            .or((texture.type_ == TextureType::File).then_some(texture))
        {
            Some(image) => self.load(file, image, &place)?,
            None => None,
        };
        self.image_of_texture.insert(texture.element.typed_id, found);
        Ok(found)
    }

    fn load(&mut self, file: &File<'_>, texture: &Texture, place: &str) -> Result<Option<u32>> {
        let Some((name, bytes)) = fetch(file, texture, place)? else { return Ok(None) };
        for (index, known) in self.encoded.iter().enumerate() {
            if known.bytes.0.len() == bytes.len() && known.bytes.0 == bytes {
                return Ok(Some(index as u32));
            }
        }
        let encoded = match Encoded::examine(place.to_string(), name, Bytes(bytes), Formats::All) {
            Ok(encoded) => encoded,
            Err(problem) => {
                file.notes.warn(problem.place, format!("{}; the texture is left out", problem.what));
                return Ok(None);
            }
        };
        let too_much = |p: Problem| Problem::new(place, format!("\"{}\" {}", encoded.name, p.what));
        file.image_budget.charge(encoded.pixels(), 4).map_err(too_much)?;
        self.encoded.push(encoded);
        Ok(Some(self.encoded.len() as u32 - 1))
    }

    /// The images of the asset. Keeps those that materials use, and updates the materials' references.
    pub(crate) fn finish(
        &self,
        file: &File<'_>,
        decoded: Vec<Result<Arc<Image>>>,
        materials: &mut [MaterialDraft],
    ) -> Result<Vec<Arc<Image>>> {
        let decoded: Vec<Option<Arc<Image>>> = decoded
            .into_iter()
            .map(|image| {
                image
                    .map_err(|p| file.notes.warn(p.place, format!("{}; the texture is left out", p.what)))
                    .ok()
            })
            .collect();
        let combined: Vec<Option<Arc<Image>>> = self.recipes.iter().map(|r| combine(r, &decoded)).collect();
        let mut out = Vec::new();
        let mut index_of: BTreeMap<u32, Option<u32>> = BTreeMap::new();
        for read in materials {
            let m = &mut read.material;
            for slot in [
                &mut m.base_color_texture,
                &mut m.metallic_roughness_texture,
                &mut m.normal_texture,
                &mut m.occlusion_texture,
                &mut m.emissive_texture,
                &mut m.specular_texture,
                &mut m.specular_color_texture,
            ] {
                let Some(reference) = slot else { continue };
                let index = *index_of.entry(reference.image).or_insert_with(|| {
                    let image = match reference.image.checked_sub(FIRST_COMBINED_INDEX) {
                        Some(recipe) => combined.get(recipe as usize),
                        None => decoded.get(reference.image as usize),
                    };
                    image.cloned().flatten().map(|image| {
                        out.push(image);
                        out.len() as u32 - 1
                    })
                });
                match index {
                    Some(index) => reference.image = index,
                    None => *slot = None,
                }
            }
            if read.alpha == Alpha::OfTexture
                && let Some(base) = &m.base_color_texture
            {
                m.alpha_mode = alpha::alpha_mode(&out[base.image as usize]);
            }
        }
        Ok(out)
    }
}

/// Combines images at the size of the largest; the others are sampled at the nearest texel.
fn combine(recipe: &Recipe, decoded: &[Option<Arc<Image>>]) -> Option<Arc<Image>> {
    let image = |r: &Option<(u32, Channel, bool)>| r.and_then(|r| decoded.get(r.0 as usize)?.as_ref());
    let largest = recipe.iter().filter_map(image).max_by_key(|i| u64::from(i.width) * u64::from(i.height))?;
    let (width, height) = (largest.width, largest.height);
    // Images have a size but no pixels where only their headers were requested.
    let filled = recipe.iter().filter_map(image).all(|i| !i.rgba.is_empty());
    let mut rgba = vec![255; if filled { width as usize * height as usize * 4 } else { 0 }];
    for (to, source) in recipe.iter().enumerate().filter(|_| filled) {
        let (Some((_, channel, invert)), Some(from)) = (source, image(source)) else { continue };
        let has_alpha = from.rgba.chunks_exact(4).any(|p| p[3] != 255);
        let value = |p: &[u8]| {
            let mean = ((u32::from(p[0]) + u32::from(p[1]) + u32::from(p[2]) + 1) / 3) as u8;
            match channel {
                Channel::Red => p[0],
                Channel::Green => p[1],
                Channel::Blue => p[2],
                Channel::Gray => mean,
                Channel::AlphaOrGray if has_alpha => p[3],
                Channel::AlphaOrGray => mean,
            }
        };
        // An alpha channel holds opacity, so it is not inverted; a gray image in a transparency slot holds transparency.
        let invert = *invert && !(*channel == Channel::AlphaOrGray && has_alpha);
        for y in 0..height as usize {
            let from_y = y * from.height as usize / height as usize;
            for x in 0..width as usize {
                let from_x = x * from.width as usize / width as usize;
                let at = (from_y * from.width as usize + from_x) * 4;
                let v = value(&from.rgba[at..at + 4]);
                rgba[(y * width as usize + x) * 4 + to] = if invert { 255 - v } else { v };
            }
        }
    }
    let names: Vec<&str> = recipe.iter().filter_map(image).map(|i| i.name.as_str()).collect();
    let mut unique: Vec<&str> = Vec::new();
    names.into_iter().for_each(|n| {
        if !unique.contains(&n) {
            unique.push(n)
        }
    });
    Some(Arc::new(Image { name: unique.join(" + "), width, height, rgba, file: None }))
}

/// Texture from texture coordinates: the inverse of T · Rp · R · Rp⁻¹ · Sp · S · Sp⁻¹, of which two axes matter. Computed with
/// libm from the file's angles.
fn texture_from_uv(texture: &Texture) -> DAffine2 {
    let props = &texture.element.props;
    let at = |name: &str, default: DVec3| {
        let found = props.find_prop(name);
        found.map_or(default, |p| DVec3::new(p.value_vec4.x, p.value_vec4.y, p.value_vec4.z))
    };
    let (rotation_pivot, scaling_pivot) =
        (at("TextureRotationPivot", DVec3::ZERO), at("TextureScalingPivot", DVec3::ZERO));
    let translation = DAffine3::from_translation;
    let rotation = DAffine3::from_quat(local::euler(at("Rotation", DVec3::ZERO)));
    let scale = DAffine3::from_scale(at("Scaling", DVec3::ONE));
    let whole = translation(at("Translation", DVec3::ZERO) + rotation_pivot)
        * rotation
        * translation(scaling_pivot - rotation_pivot)
        * scale
        * translation(-scaling_pivot);
    let swapped = props.find_prop("UVSwap").is_some_and(|p| p.value_int != 0);
    let (x, y) = (whole.matrix3.x_axis, whole.matrix3.y_axis);
    let flat = DAffine2::from_mat2_translation(
        DMat2::from_cols(x.truncate(), y.truncate()),
        whole.translation.truncate(),
    );
    // ufbx gives swapped axes no such inverse, nor is there one for a texture rotated out of its plane, so ufbx's own matrix is
    // used.
    if swapped || x.z != 0.0 || y.z != 0.0 || flat.matrix2.determinant() == 0.0 {
        let m = &texture.uv_to_texture;
        return DAffine2::from_mat2_translation(
            DMat2::from_cols(DVec2::new(m.m00, m.m10), DVec2::new(m.m01, m.m11)),
            DVec2::new(m.m03, m.m13),
        );
    }
    flat.inverse()
}

/// A texture reference. v points up in FBX and down here, so the transform is flipped before and after.
fn make_texture_ref(file: &File<'_>, texture: &Texture, image: u32, uv_set: u8) -> TextureRef {
    let wrap = |mode| if mode == WrapMode::Clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
    let mut uv_transform = match texture.has_uv_transform {
        true => {
            let m = texture_from_uv(texture);
            let (x, y, t) = (m.x_axis, m.y_axis, m.translation);
            let turned_over = DAffine2::from_mat2_translation(
                DMat2::from_cols(DVec2::new(x.x, -x.y), DVec2::new(-y.x, y.y)),
                DVec2::new(y.x + t.x, 1.0 - y.y - t.y),
            );
            turned_over.as_affine2()
        }
        false => Affine2::IDENTITY,
    };
    if !uv_transform.is_finite() {
        file.notes.warn(place_of(&texture.element), "its placement is not finite and is left out");
        uv_transform = Affine2::IDENTITY;
    }
    let sampler =
        Sampler { wrap_u: wrap(texture.wrap_u), wrap_v: wrap(texture.wrap_v), ..Sampler::default() };
    TextureRef { image, sampler, uv_set, uv_transform }
}

/// The bytes of a texture: embedded, else from a file at the places of [`search::places`].
fn fetch(file: &File<'_>, texture: &Texture, place: &str) -> Result<Option<(String, Arc<Vec<u8>>)>> {
    let paths =
        [texture.relative_filename.as_ref(), texture.absolute_filename.as_ref(), texture.filename.as_ref()];
    let named = paths.into_iter().find(|p| !p.is_empty()).unwrap_or("");
    let name = match search::file_name(named) {
        "" => texture.element.name.to_string(),
        name => name.to_string(),
    };
    let content: &[u8] = &texture.content;
    if !content.is_empty() {
        file.charge(content.len(), 1, || place.to_string())?;
        return Ok(Some((name, Arc::new(content.to_vec()))));
    }
    let by_name = [name.as_str()];
    let tried = search::places(if named.is_empty() { &by_name } else { &paths });
    let why = match search::read_first(file.files, &tried) {
        Ok(bytes) => return Ok(Some((name, bytes))),
        Err(why) => why,
    };
    file.notes.warn(
        place,
        match tried.as_slice() {
            [] => "names no file and holds no image; it is left out".to_string(),
            _ => search::missing(named, &why),
        },
    );
    Ok(None)
}
