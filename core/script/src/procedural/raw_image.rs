//! Images made from numbers: `image(width, height, pixels)`.

use crate::call::{ApiError, Call, Options, color, describe, int_or_float, one_of};
use crate::limits::raise_hint;
use crate::value::ImageRef;
use choreo_asset::{Sampler, Wrap};
use rhai::{Array, Blob, Dynamic};
use std::sync::Arc;

/// Maximum width and height in pixels, the same as for importers.
const MAX_SIDE: f64 = 16384.0;

/// The image of an `image(width, height, pixels)`, `image(options)` or `image(file, options)` call.
pub(crate) fn image(c: &Call) -> Result<ImageRef, ApiError> {
    let mut known = vec!["name", "filter", "wrap"];
    let has_size_arguments = c.len() >= 3;
    let is_file = !has_size_arguments && c.value(0).is_string();
    let o = match has_size_arguments {
        true => c.options(3, &known)?,
        false if is_file => {
            known.extend(["first", "last"]);
            return super::files::image_from_files(c, &c.options(1, &known)?);
        }
        false => {
            known.extend(["width", "height", "pixels"]);
            c.options(0, &known)?
        }
    };
    let side = |i: usize, name: &str| {
        let value = if has_size_arguments { Some(c.value(i)) } else { o.get(name) };
        let value = value.ok_or_else(|| ApiError::new(format!("image: {name} is missing")))?;
        let label = format!("image: {name}");
        let whole = value.as_int().ok().filter(|n| (1..=MAX_SIDE as i64).contains(n));
        whole.map(|n| n as u32).ok_or_else(|| {
            crate::call::wrong(&value, &label, &format!("a whole number from 1 to {MAX_SIDE}"))
        })
    };
    let (width, height) = (side(0, "width")?, side(1, "height")?);
    let texels = u64::from(width) * u64::from(height);
    count_texels(c, texels)?;
    let pixels = match has_size_arguments {
        true => pixel_bytes(&c.value(2), texels)?,
        false => pixel_bytes(o.map.get("pixels").unwrap_or(&Dynamic::UNIT), texels)?,
    };
    let name = o.text("name")?.unwrap_or_else(|| "image".into());
    let image = choreo_plugin::build::image(&name, width, height, &pixels).map_err(|e| {
        ApiError::new(format!("image: {}", e.0.split_once(": ").map_or(e.0.as_str(), |(_, e)| e)))
    })?;
    Ok(ImageRef { image: Arc::new(image), file: None, sampler: sampler(&o)?, dead: false, sequence: None })
}

/// Adds to the total number of pixels of the script's images.
///
/// # Errors
/// Returns an error if the total exceeds the limit.
pub(super) fn count_texels(c: &Call, texels: u64) -> Result<(), ApiError> {
    let mut stage_draft = c.stage_draft();
    stage_draft.procedural_totals.texels = stage_draft.procedural_totals.texels.saturating_add(texels);
    if stage_draft.procedural_totals.texels > c.context.limits.texels {
        let total = stage_draft.procedural_totals.texels;
        let error = ApiError::new(format!("image: all images of the script together have {total} pixels"));
        return Err(ApiError { fatal: true, ..error.hint(raise_hint("texels", c.context.limits.texels)) });
    }
    Ok(())
}

/// The sampler of the options `wrap` and `filter`.
pub(super) fn sampler(o: &Options) -> Result<Sampler, ApiError> {
    let pair = o.get("wrap").and_then(|v| v.read_lock::<Array>().map(|a| a.to_vec()));
    let [wrap_u, wrap_v] = match pair.as_deref() {
        Some([across, down]) => [wrap(across)?, wrap(down)?],
        Some(_) => {
            let text = "image: wrap must be one word, or an array of two words: across and down";
            return Err(ApiError::new(text).focus("wrap"));
        }
        None => [o.get("wrap").map_or(Ok(Wrap::Repeat), |v| wrap(&v))?; 2],
    };
    // The option `filter` is for magnification only; minified images are always averaged.
    let mag_linear = o.one_of("filter", &["linear", "nearest"])? != Some("nearest");
    Ok(Sampler { wrap_u, wrap_v, mag_linear, ..Sampler::default() })
}

fn wrap(v: &Dynamic) -> Result<Wrap, ApiError> {
    Ok(match one_of(v, "image: wrap", &["repeat", "clamp", "mirror"])? {
        "clamp" => Wrap::ClampToEdge,
        "mirror" => Wrap::MirroredRepeat,
        _ => Wrap::Repeat,
    })
}

/// Bytes of `count` pixels, from a blob, from numbers from 0 to 255, or from one color per pixel.
fn pixel_bytes(pixels: &Dynamic, count: u64) -> Result<Vec<u8>, ApiError> {
    if let Some(blob) = pixels.read_lock::<Blob>() {
        return Ok(blob.to_vec());
    }
    let Some(array) = pixels.read_lock::<Array>() else {
        return Err(crate::call::wrong(pixels, "image: pixels", "an array or a blob"));
    };
    let has_colors = array.iter().any(|v| v.is_string() || v.is_array());
    if !has_colors {
        let byte = |(at, v): (usize, &Dynamic)| match int_or_float(v) {
            Some(n) if (0.0..=255.0).contains(&n) => Ok(libm::round(n) as u8),
            _ => Err(ApiError::new(format!(
                "image: pixels[{at}] must be a number from 0 to 255, or a color, got {}",
                describe(v)
            ))),
        };
        return array.iter().enumerate().map(byte).collect();
    }
    if array.len() as u64 != count {
        return Err(ApiError::new(format!("image: {count} pixels need as many colors, got {}", array.len())));
    }
    let mut rgba = Vec::with_capacity(4 * array.len());
    for (at, v) in array.iter().enumerate() {
        let c = color(v, &format!("image: pixels[{at}]"))?;
        let alpha = libm::roundf(c.w.clamp(0.0, 1.0) * 255.0) as u8;
        rgba.extend([srgb_byte(c.x), srgb_byte(c.y), srgb_byte(c.z), alpha]);
    }
    Ok(rgba)
}

/// Converts a linear value to sRGB, rounded to a byte: the inverse of [`crate::color::linear_from_srgb`].
pub(crate) fn srgb_byte(linear: f32) -> u8 {
    libm::round(choreo_asset::srgb_from_linear(linear.into()).clamp(0.0, 1.0) * 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_byte_inverts_linear_from_srgb() {
        for byte in 0..=255u8 {
            assert_eq!(srgb_byte(crate::color::linear_from_srgb(f64::from(byte) / 255.0)), byte);
        }
    }
}
