//! Environment reflection of Blinn–Phong materials: color, map and environment map.

use crate::call::{ApiError, Options, rgb};
use crate::value::ImageRef;
use choreo_asset::{Material, Reflection, Shading};
use glam::Vec3;

/// The panorama that the material reflects in place of the sky, if any.
///
/// # Errors
/// Returns an error if it is not twice as wide as high.
pub(crate) fn environment_map(o: &Options) -> Result<Option<ImageRef>, ApiError> {
    let Some(given) = o.image("environment_map")? else { return Ok(None) };
    let (width, height) = (given.image.width, given.image.height);
    if width == 2 * height {
        return Ok(Some(given));
    }
    let text = format!(
        "{}: environment_map must be a panorama, twice as wide as high; this is {width} × {height}",
        o.function
    );
    Err(ApiError::new(text).focus("environment_map"))
}

/// Sets the reflectance of the environment. Call it after the shading model is set; the caller adds the textures.
pub(super) fn set_reflection(o: &Options, material: &mut Material) -> Result<(), ApiError> {
    const WORDS: [&str; 3] = ["reflection", "reflection_map", "environment_map"];
    let Some(word) = WORDS.into_iter().find(|word| o.get(word).is_some()) else { return Ok(()) };
    let fail = |text: String| Err(ApiError::new(format!("{}: {text}", o.function)).focus(word));
    if !matches!(material.shading, Shading::BlinnPhong | Shading::Phong) {
        return fail(format!(
            "{word} needs shininess, the Blinn–Phong exponent; a surface with roughness reflects without it"
        ));
    }
    let reflectance = match o.get("reflection") {
        None => None,
        Some(v) if v.is_int() || v.is_float() => {
            o.number_in("reflection", 0.0, 1.0)?.map(|amount| Vec3::splat(amount as f32))
        }
        Some(_) => o.color("reflection")?.map(rgb),
    };
    if reflectance.is_none() && word == "environment_map" {
        return fail(
            "environment_map is what a surface reflects; reflection, its amount, is not given".into(),
        );
    }
    // The default factor is 1, because a map contains the amount.
    let color = reflectance.unwrap_or(Vec3::ONE);
    material.reflection = Some(Box::new(Reflection { color, texture: None, environment: None }));
    Ok(())
}
