//! Materials of procedural assets: the options that `shape`, `mesh`, `lines` and `points` share.

use super::image_sequence::{ImageOperation, combine_images, image_or_sequence, texture_animation};
use super::maps;
use super::raw_image::srgb_byte;
use crate::call::{ApiError, Options, rgb};
use crate::value::{ImageRef, ImageSequenceRef};
use choreo_asset::{
    AlphaMode, FrameStrip, Image, Material, MaterialLayers, Reflection, Sampler, Shading, TextureRef,
    TextureSlot, UvMotion,
};
use glam::{Affine2, Vec2, Vec3, Vec4};
use std::sync::Arc;

/// All option names of [`material`].
pub(crate) const OPTIONS: [&str; 46] = [
    "color",
    "image",
    "normal_map",
    "checker",
    "tiles",
    "alpha",
    "roughness",
    "metallic",
    "emissive",
    "unlit",
    "double_sided",
    "shininess",
    "specular",
    "clearcoat",
    "clearcoat_roughness",
    "sheen",
    "sheen_roughness",
    "transmission",
    "thickness",
    "ior",
    "dispersion",
    "attenuation",
    "attenuation_distance",
    "iridescence",
    "film",
    "anisotropy",
    "brushed",
    "translucent",
    "translucent_color",
    "name",
    "specular_map",
    "phong",
    "opacity_map",
    "height_map",
    "depth",
    "displacement_map",
    "displacement",
    "frames",
    "fps",
    "scroll",
    "spin",
    "once",
    "reflection",
    "reflection_map",
    "environment_map",
    "emissive_strength",
];

/// The images in the options of a material.
struct MaterialMaps {
    image: Option<ImageRef>,
    /// Columns, rows and frame count of the sprite sheet, if an array of images was packed into one.
    sheet: Option<[u32; 3]>,
    normal_map: Option<ImageRef>,
    /// Depth of parallax mapping, 0 without a height map.
    parallax_depth: f32,
    specular_map: Option<ImageRef>,
    reflection_map: Option<ImageRef>,
    environment_map: Option<ImageRef>,
}

impl MaterialMaps {
    /// Reads and combines the images of the options.
    fn read(o: &Options) -> Result<MaterialMaps, ApiError> {
        let other_maps = ["normal_map", "opacity_map", "height_map", "specular_map", "reflection_map"];
        let has_other_maps = other_maps.into_iter().any(|name| o.get(name).is_some());
        let mut sheet = None;
        let mut image = match o.get("image").is_some_and(|v| v.is_array()) && !has_other_maps {
            // The images are packed into one sprite sheet, which is possible only without other maps.
            true => {
                let all = maps::images(o, "image")?;
                let (image, [columns, rows]) = maps::sprite_sheet(o, &all)?;
                sheet = Some([columns, rows, all.len() as u32]);
                Some(image)
            }
            false => image_or_sequence(o, "image")?,
        };
        if let Some(map) = image_or_sequence(o, "opacity_map")? {
            let base = image.unwrap_or_else(|| maps::white_image(&map));
            let operation = ImageOperation::MultiplyAlpha;
            image = Some(combine_images(o, ["image", "opacity_map"], &base, &map, operation)?);
        }
        let depth = o.number_in("depth", 0.0, 1.0)?;
        let mut normal_map = image_or_sequence(o, "normal_map")?;
        let height_map = image_or_sequence(o, "height_map")?;
        if depth.is_some() && height_map.is_none() {
            let text = format!("{}: depth needs height_map, which is not given", o.function);
            return Err(ApiError::new(text).focus("depth"));
        }
        let parallax_depth = height_map.as_ref().map_or(0.0, |_| depth.unwrap_or(0.05) as f32);
        if let Some(heights) = height_map {
            normal_map = Some(match normal_map {
                Some(normals) => {
                    let operation = ImageOperation::HeightsAsAlpha;
                    combine_images(o, ["normal_map", "height_map"], &normals, &heights, operation)?
                }
                None => {
                    let unread = ImageRef { sequence: None, ..heights.clone() };
                    let operation = ImageOperation::NormalsFromHeights(parallax_depth);
                    combine_images(o, ["height_map"; 2], &unread, &heights, operation)?
                }
            });
        }
        let specular_map = image_or_sequence(o, "specular_map")?;
        let reflection_map = image_or_sequence(o, "reflection_map")?;
        let environment_map = super::reflection::environment_map(o)?;
        Ok(MaterialMaps {
            image,
            sheet,
            normal_map,
            parallax_depth,
            specular_map,
            reflection_map,
            environment_map,
        })
    }

    /// The texture slot, option and image sequence, if any, of each map.
    fn sequences(&self, o: &Options) -> [(TextureSlot, &'static str, Option<ImageSequenceRef>); 4] {
        let MaterialMaps { image, normal_map, specular_map, reflection_map, .. } = self;
        let sequence_of = |map: &Option<ImageRef>| map.as_ref().and_then(|i| i.sequence.clone());
        let normal_name = if o.get("normal_map").is_some() { "normal_map" } else { "height_map" };
        let image_name = if o.get("image").is_some() { "image" } else { "opacity_map" };
        [
            (TextureSlot::BaseColor, image_name, sequence_of(image)),
            (TextureSlot::Normal, normal_name, sequence_of(normal_map)),
            (TextureSlot::SpecularColor, "specular_map", sequence_of(specular_map)),
            (TextureSlot::Specular, "reflection_map", sequence_of(reflection_map)),
        ]
    }

    /// Sets the textures of the material. Returns the images, to which the textures refer by index.
    fn set_textures(self, o: &Options, material: &mut Material) -> Result<Vec<Arc<Image>>, ApiError> {
        let tiles = o.number_in("tiles", 1.0, 4096.0)?;
        let checker_color = o.color("checker")?;
        let MaterialMaps {
            image,
            normal_map,
            parallax_depth,
            specular_map,
            reflection_map,
            environment_map,
            ..
        } = self;
        let base = material.base_color;
        let mut images = Vec::new();
        let mut texture = |image: Arc<Image>, sampler: Sampler, scale: f64| {
            images.push(image);
            let uv_transform = Affine2::from_scale(Vec2::splat(scale as f32));
            TextureRef { image: images.len() as u32 - 1, sampler, uv_set: 0, uv_transform }
        };
        let fail = |text: &str, word: &str| Err(ApiError::new(format!("{}: {text}", o.function)).focus(word));
        let scale = tiles.unwrap_or(1.0);
        match (image, checker_color) {
            (Some(_), Some(_)) => {
                return fail("checker makes an image of its own; give only image or checker", "checker");
            }
            (Some(given), None) => {
                let sequence = given.sequence.as_ref();
                material.alpha_mode = sequence.map_or_else(|| alpha_mode_of(&given.image), |s| s.alpha);
                material.base_color_texture = Some(texture(given.image, given.sampler, scale));
            }
            (None, Some(second)) => {
                let sampler = Sampler { mag_linear: false, ..Sampler::default() };
                material.base_color = Vec4::new(1.0, 1.0, 1.0, base.w);
                material.base_color_texture =
                    Some(texture(checkerboard(base, second), sampler, tiles.unwrap_or(10.0) / 2.0));
            }
            (None, None)
                if tiles.is_some()
                    && normal_map.is_none()
                    && specular_map.is_none()
                    && reflection_map.is_none() =>
            {
                return fail("tiles needs checker, the second color, or image", "tiles");
            }
            (None, None) => {}
        }
        if let Some(given) = normal_map {
            if material.shading == Shading::Unlit {
                let word = if parallax_depth > 0.0 { "height_map" } else { "normal_map" };
                return fail(&format!("{word} changes the lighting; an unlit surface has none"), word);
            }
            material.normal_texture = Some(texture(given.image, given.sampler, scale));
            material.relief = parallax_depth;
        }
        if let Some(given) = specular_map {
            if material.shading == Shading::Unlit {
                return fail("specular_map changes highlights; an unlit surface has none", "specular_map");
            }
            material.specular_color_texture = Some(texture(given.image, given.sampler, scale));
        }
        if let Some(reflection) = &mut material.reflection {
            reflection.texture = reflection_map.map(|given| texture(given.image, given.sampler, scale));
            reflection.environment =
                environment_map.map(|given| texture(given.image, Reflection::panorama_sampler(), 1.0));
        }
        Ok(images)
    }
}

/// The material of the options, and the images, to which its textures refer by index.
pub(super) fn material(o: &Options, name: &str) -> Result<(Material, Vec<Arc<Image>>), ApiError> {
    let maps = MaterialMaps::read(o)?;
    let sequences = maps.sequences(o);
    let sheet = maps.sheet;
    // The default color with an image is white, so that the image keeps its colors.
    let default_color = if maps.image.is_some() { Vec4::ONE } else { Vec4::new(0.6, 0.6, 0.6, 1.0) };
    let base = o.color("color")?.unwrap_or(default_color);
    let mut material = Material {
        name: name.into(),
        base_color: base,
        metallic: o.number_in("metallic", 0.0, 1.0)?.unwrap_or(0.0) as f32,
        roughness: o.number_in("roughness", 0.0, 1.0)?.unwrap_or(0.9) as f32,
        emissive: emitted_color(o)?,
        double_sided: o.flag("double_sided")?.unwrap_or(false),
        ..Material::default()
    };
    set_shading(o, &mut material)?;
    super::reflection::set_reflection(o, &mut material)?;
    set_material_layers(o, &mut material)?;
    let images = maps.set_textures(o, &mut material)?;
    set_texture_animation(o, &mut material, sheet, &sequences)?;
    if base.w < 1.0 {
        material.alpha_mode = AlphaMode::Blend;
    }
    match o.one_of("alpha", &["opaque", "mask", "blend"])? {
        Some("opaque") => material.alpha_mode = AlphaMode::Opaque,
        Some("mask") => material.alpha_mode = AlphaMode::Mask(0.5),
        Some(_) => material.alpha_mode = AlphaMode::Blend,
        None => {}
    }
    Ok((material, images))
}

/// Emitted color, linear, multiplied by its strength.
fn emitted_color(o: &Options) -> Result<Vec3, ApiError> {
    let color = o.color("emissive")?.map(rgb);
    let strength = o.number_in("emissive_strength", 0.0, 1e6)?;
    if color.is_none() && strength.is_some() {
        let error = ApiError::new(format!("{}: emissive_strength needs emissive, a color", o.function));
        return Err(error.focus("emissive_strength"));
    }
    Ok(color.unwrap_or(Vec3::ZERO) * strength.unwrap_or(1.0) as f32)
}

/// An option of two numbers.
fn number_pair(o: &Options, name: &str) -> Result<Option<[f64; 2]>, ApiError> {
    let Some(value) = o.get(name) else { return Ok(None) };
    let numbers = crate::call::numbers(&value).filter(|n| n.iter().all(|v| v.is_finite()));
    let found = numbers.and_then(|n| <[f64; 2]>::try_from(n).ok());
    found.map(Some).ok_or_else(|| crate::call::wrong(&value, &o.label(name), "two numbers"))
}

/// Columns, rows and frame count of the sprite sheet that the option `frames` states. `packed`: the sheet into which an array of images
/// was packed, which excludes this option, as an image sequence does.
fn sprite_sheet(
    o: &Options,
    packed: Option<[u32; 3]>,
    has_sequence: bool,
) -> Result<Option<[u32; 3]>, ApiError> {
    let fail = |text: &str| Err(ApiError::new(format!("{}: {text}", o.function)).focus("frames"));
    let Some([columns, rows]) = number_pair(o, "frames")? else { return Ok(packed) };
    if packed.is_some() {
        return fail("frames are the cells of one image; an array of images has one frame per image");
    }
    if has_sequence {
        return fail("frames are the cells of one image; an image sequence has one frame per image");
    }
    let is_count = |v: f64| (1.0..=256.0).contains(&v) && libm::floor(v) == v;
    if !is_count(columns) || !is_count(rows) {
        return fail("frames must be [columns, rows], whole numbers from 1 to 256");
    }
    let maps = ["image", "normal_map", "opacity_map", "height_map", "specular_map", "reflection_map"];
    if !maps.into_iter().any(|name| o.get(name).is_some()) {
        return fail("frames are the cells of image or of a map, but neither is given");
    }
    Ok(Some([columns as u32, rows as u32, columns as u32 * rows as u32]))
}

/// Sets moving textures and texture animation. `sheet`: columns, rows and frame count of the sprite sheet into which an array of
/// images was packed; `sequences`: the texture slot, option and image sequence of each map.
fn set_texture_animation(
    o: &Options,
    material: &mut Material,
    sheet: Option<[u32; 3]>,
    sequences: &[(TextureSlot, &str, Option<ImageSequenceRef>)],
) -> Result<(), ApiError> {
    let fail = |text: &str, word: &str| Err(ApiError::new(format!("{}: {text}", o.function)).focus(word));
    let has_sequence = sequences.iter().any(|(.., sequence)| sequence.is_some());
    let fps = o.number_in("fps", 0.0, 1000.0)?;
    let once = o.flag("once")?;
    let sheet = sprite_sheet(o, sheet, has_sequence)?;
    let (scroll, spin) = (number_pair(o, "scroll")?, o.number_in("spin", -36_000.0, 36_000.0)?);
    let maps = [&material.base_color_texture, &material.normal_texture, &material.specular_color_texture];
    let has_reflection_map = material.reflection.as_ref().is_some_and(|r| r.texture.is_some());
    let has_texture = has_reflection_map || maps.into_iter().any(Option::is_some);
    if let Some(word) = ["scroll", "spin"].into_iter().find(|w| o.get(w).is_some()) {
        if !has_texture {
            return fail(&format!("{word} moves image, checker or a map, but none of them is given"), word);
        }
        if sheet.is_some() {
            return fail(
                &format!(
                    "{word} cannot be used with frames: it would move the image out of the visible frame"
                ),
                word,
            );
        }
        let [u, v] = scroll.unwrap_or_default();
        material.uv_motion = Some(UvMotion {
            // The texture coordinates move opposite to the image.
            scroll: Vec2::new(-u as f32, -v as f32),
            rotation: spin.unwrap_or(0.0).to_radians() as f32,
        });
    }
    if has_sequence {
        material.sequence = texture_animation(o, sequences, fps, once)?;
        return Ok(());
    }
    match sheet {
        Some([columns, rows, count]) => {
            if o.get("tiles").is_some() {
                return fail("tiles repeats an image, frames show a part of one; leave one out", "tiles");
            }
            material.flipbook = Some(FrameStrip {
                columns,
                rows,
                count,
                fps: fps.unwrap_or(12.0) as f32,
                once: once.unwrap_or(false),
            });
            Ok(())
        }
        None if once.is_some() => fail("once needs frames, or several images as image or a map", "once"),
        None if fps.is_some() => fail("fps needs frames, or several images as image or a map", "fps"),
        None => Ok(()),
    }
}

/// Sets the shading model and the highlights of Blinn–Phong.
fn set_shading(o: &Options, material: &mut Material) -> Result<(), ApiError> {
    let specular = o.color("specular")?;
    if let Some(shininess) = o.number_in("shininess", 1.0, 10000.0)? {
        let phong = o.flag("phong")?.unwrap_or(false);
        material.shading = if phong { Shading::Phong } else { Shading::BlinnPhong };
        material.shininess = shininess as f32;
        // The default factor with a map is 1, because the map contains the amount.
        let default = if o.get("specular_map").is_some() { 1.0 } else { 0.04 };
        material.specular_color = specular.map_or(Vec3::splat(default), rgb);
        if let Some(other) = ["roughness", "metallic", "unlit"].into_iter().find(|name| o.get(name).is_some())
        {
            return Err(ApiError::new(format!(
                "{}: shininess selects Blinn–Phong shading, which has no {other}",
                o.function
            ))
            .focus(other));
        }
    } else if o.get("phong").is_some() {
        let text = format!("{}: phong needs shininess, its exponent", o.function);
        return Err(ApiError::new(text).focus("phong"));
    } else if specular.is_some() {
        return Err(ApiError::new(format!(
            "{}: specular needs shininess, the Blinn–Phong exponent",
            o.function
        ))
        .focus("specular"));
    }
    if o.flag("unlit")? == Some(true) {
        material.shading = Shading::Unlit;
    }
    Ok(())
}

/// Sets the material layers of the glTF extensions (clearcoat, sheen, transmission and others).
fn set_material_layers(o: &Options, material: &mut Material) -> Result<(), ApiError> {
    // From `clearcoat` to `translucent_color`.
    let mut layers =
        OPTIONS.iter().skip_while(|name| **name != "clearcoat").take_while(|name| **name != "name");
    let Some(first) = layers.find(|name| o.get(name).is_some()) else { return Ok(()) };
    if material.shading != Shading::MetallicRoughness {
        let text =
            format!("{}: {first} is for surfaces with roughness, not with unlit or shininess", o.function);
        return Err(ApiError::new(text).focus(*first));
    }
    for (option, required) in [
        ("clearcoat_roughness", "clearcoat"),
        ("sheen_roughness", "sheen"),
        ("thickness", "transmission"),
        ("dispersion", "thickness"),
        ("attenuation", "thickness"),
        ("attenuation_distance", "attenuation"),
        ("film", "iridescence"),
        ("brushed", "anisotropy"),
        ("translucent_color", "translucent"),
    ] {
        if o.get(option).is_some() && o.get(required).is_none() {
            let text = format!("{}: {option} needs {required}, which is not given", o.function);
            return Err(ApiError::new(text).focus(option));
        }
    }
    let fraction = |name: &str, default: f32| -> Result<f32, ApiError> {
        Ok(o.number_in(name, 0.0, 1.0)?.map_or(default, |v| v as f32))
    };
    let ior = o.number_in("ior", 1.0, 10.0)?.unwrap_or(1.5);
    // The reflectance at normal incidence is ((n − 1) / (n + 1))², and 0.04 at 1.5.
    let amplitude = (ior - 1.0) / (ior + 1.0);
    material.specular_color *= (amplitude * amplitude / 0.04) as f32;
    let film = o.number_in("film", 0.0, 100_000.0)?.unwrap_or(400.0) as f32;
    let layers = MaterialLayers {
        clearcoat: fraction("clearcoat", 0.0)?,
        clearcoat_roughness: fraction("clearcoat_roughness", 0.0)?,
        sheen_color: o.color("sheen")?.map_or(Vec3::ZERO, rgb),
        sheen_roughness: fraction("sheen_roughness", 0.3)?,
        transmission: fraction("transmission", 0.0)?,
        thickness: o.number_in("thickness", 0.0, 1e6)?.unwrap_or(0.0) as f32,
        ior: ior as f32,
        dispersion: o.number_in("dispersion", 0.0, 100.0)?.unwrap_or(0.0) as f32,
        attenuation_color: o.color("attenuation")?.map_or(Vec3::ONE, rgb),
        attenuation_distance: match o.get("attenuation") {
            Some(_) => o.number_in("attenuation_distance", 1e-6, 1e6)?.unwrap_or(1.0) as f32,
            None => f32::INFINITY,
        },
        iridescence: fraction("iridescence", 0.0)?,
        iridescence_thickness: [film, film],
        anisotropy: fraction("anisotropy", 0.0)?,
        anisotropy_rotation: o.number_in("brushed", -3600.0, 3600.0)?.unwrap_or(0.0).to_radians() as f32,
        diffuse_transmission: fraction("translucent", 0.0)?,
        diffuse_transmission_color: o.color("translucent_color")?.map_or(rgb(material.base_color), rgb),
        ..MaterialLayers::default()
    };
    material.layers = Some(Box::new(layers));
    Ok(())
}

/// Checkerboard of two by two texels, which repeats. Both colors are in the image: a factor of the base color would lose
/// precision.
fn checkerboard(base: Vec4, second: Vec4) -> Arc<Image> {
    let texel = |c: Vec4| [srgb_byte(c.x), srgb_byte(c.y), srgb_byte(c.z), 255];
    let (a, b) = (texel(base), texel(second));
    Arc::new(Image { name: "checker".into(), width: 2, height: 2, rgba: [a, b, b, a].concat(), file: None })
}

/// The alpha mode that an image needs: opaque, masked if alpha is only 0 or 255, else blended.
pub(crate) fn alpha_mode_of(image: &Image) -> AlphaMode {
    let alphas = || image.rgba.iter().skip(3).step_by(4);
    if alphas().all(|a| *a == 255) {
        AlphaMode::Opaque
    } else if alphas().all(|a| matches!(a, 0 | 255)) {
        AlphaMode::Mask(0.5)
    } else {
        AlphaMode::Blend
    }
}

impl Options {
    /// The image of an option, if it is given.
    ///
    /// # Errors
    /// Returns an error if the value is no image or an image sequence.
    pub(crate) fn image(&self, name: &str) -> Result<Option<ImageRef>, ApiError> {
        let Some(value) = self.get(name) else { return Ok(None) };
        let given = value.clone().try_cast::<ImageRef>();
        if given.as_ref().is_some_and(|i| i.sequence.is_some()) {
            let text = format!("{}: {name} must be one image, not a sequence", self.function);
            return Err(ApiError::new(text).focus(name));
        }
        given
            .map(Some)
            .ok_or_else(|| crate::call::wrong(&value, &self.label(name), "an Image, from image(…)"))
    }
}

#[cfg(test)]
mod tests {
    use super::OPTIONS;
    use std::path::Path;

    /// Appends the code of all lessons in a folder to `out`.
    fn append_lessons(folder: &Path, out: &mut String) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                append_lessons(&path, out);
            } else if path.extension().is_some_and(|e| e == "rhai") {
                let text = std::fs::read_to_string(&path).unwrap();
                text.lines().for_each(|line| *out += line.split("//").next().unwrap_or_default());
            }
        }
    }

    #[test]
    fn every_material_option_occurs_in_a_lesson() {
        let mut text = String::new();
        append_lessons(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts"), &mut text);
        let occurs = |name: &str| text.contains(&format!(" {name}: "));
        let missing: Vec<_> = OPTIONS.into_iter().filter(|name| !occurs(name)).collect();
        assert!(missing.is_empty(), "no lesson has {missing:?}");
        // An option that no lesson contains is detected.
        assert!(!occurs("specular_mop"));
    }
}
