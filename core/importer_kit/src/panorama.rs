//! Panoramas of light: Radiance RGBE images (`.hdr`) and OpenEXR images (`.exr`).

use crate::problem::{Problem, Result};
use choreo_asset::{Panorama, PanoramaError};
use exr::image::RgbChannels;
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers, Vec2};
use image::{ImageFormat, ImageReader};
use std::io::Cursor;

/// Largest number of pixels of an equirectangular panorama: 8192 × 4096.
pub(crate) const MAX_PANORAMA_PIXELS: u64 = 32 << 20;

/// Reads a panorama from the bytes of a Radiance or OpenEXR file.
///
/// # Errors
/// Another format, a damaged file, more than `MAX_PANORAMA_PIXELS`, other proportions than 2:1, and texels that are not finite.
pub fn panorama(name: &str, bytes: &[u8]) -> Result<Panorama> {
    let fail = |what: String| Problem::new(name.to_string(), what);
    let image = match bytes {
        [b'#', b'?', ..] => radiance(bytes),
        [0x76, 0x2f, 0x31, 0x01, ..] => open_exr(bytes),
        _ => {
            return Err(fail("is neither a Radiance nor an OpenEXR image".into())
                .hint("panoramas are .hdr files (RGBE) or .exr files"));
        }
    };
    let (width, height, rgb) = image.map_err(|(what, hint)| match hint {
        Some(hint) => fail(what).hint(hint),
        None => fail(what),
    })?;
    Panorama::new(name, width, height, rgb).map_err(|e| {
        fail(match e {
            PanoramaError::Size => "its size differs from its header".into(),
            PanoramaError::Texel { x, y } => {
                format!("its pixel {x}, {y} is negative or not finite")
            }
        })
    })
}

/// Width, height and RGB texels of an image; or the problem, and a hint.
type PanoramaResult = std::result::Result<(u32, u32, Vec<f32>), (String, Option<&'static str>)>;

/// Checks a size before anything is decoded.
fn check_size(width: u64, height: u64) -> std::result::Result<(), (String, Option<&'static str>)> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 || pixels > MAX_PANORAMA_PIXELS {
        let most = MAX_PANORAMA_PIXELS >> 20;
        let what = format!("has {width} x {height} pixels; the limit is {most} megapixels");
        return Err((what, Some("make the panorama smaller: 4096 x 2048 is plenty")));
    }
    if width != 2 * height {
        let what = format!("has {width} x {height} pixels; a panorama is twice as wide as high");
        return Err((what, Some("use an equirectangular (latitude-longitude) panorama")));
    }
    Ok(())
}

fn radiance(bytes: &[u8]) -> PanoramaResult {
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Hdr);
        let mut limits = image::Limits::default();
        // Enough for three 32-bit floats per pixel and the decoder's own rows.
        limits.max_alloc = Some(MAX_PANORAMA_PIXELS * 16);
        reader.limits(limits);
        reader
    };
    let size = reader().into_dimensions();
    let (width, height) = size.map_err(|e| (format!("has a damaged header: {e}"), None))?;
    check_size(width.into(), height.into())?;
    let decoded = reader().decode().map_err(|e| (format!("cannot be decoded: {e}"), None))?;
    Ok((width, height, decoded.into_rgb32f().into_raw()))
}

/// Reads the first layer with channels R, G and B. Negative values, which filters leave at bright edges, count as 0.
fn open_exr(bytes: &[u8]) -> PanoramaResult {
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false);
    let metadata = metadata.map_err(|e| (format!("has a damaged header: {e}"), None))?;
    for header in &metadata.headers {
        check_size(header.layer_size.x() as u64, header.layer_size.y() as u64)?;
    }
    let pixels = |size: Vec2<usize>, _: &RgbChannels| (size, vec![0.0f32; 3 * size.area()]);
    let set = |(size, rgb): &mut (Vec2<usize>, Vec<f32>), at: Vec2<usize>, (r, g, b): (f32, f32, f32)| {
        let texel = 3 * (at.y() * size.x() + at.x());
        // A NaN stays one, and is an error.
        let light = |v: f32| if v < 0.0 { 0.0 } else { v };
        rgb[texel..texel + 3].copy_from_slice(&[light(r), light(g), light(b)]);
    };
    let layers = exr::prelude::read().no_deep_data().largest_resolution_level().rgb_channels(pixels, set);
    let image = layers.first_valid_layer().all_attributes().non_parallel();
    let image = image.from_buffered(Cursor::new(bytes));
    let (size, rgb) =
        image.map_err(|e| (format!("cannot be decoded: {e}"), None))?.layer_data.channel_data.pixels;
    Ok((size.x() as u32, size.y() as u32, rgb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::{Encoding, Image, SpecificChannels};
    use exr::prelude::WritableImage;

    /// Flat (not run-length) RGBE: exponent 128 + 1 with mantissa 128 is 1.
    fn flat(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes =
            format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
        bytes.extend(texels.iter().flatten());
        bytes
    }

    #[test]
    fn rgbe_is_read() {
        let read = panorama("a.hdr", &flat(2, 1, &[[128, 64, 0, 129], [255, 128, 128, 136]])).unwrap();
        assert_eq!(read.size(), [2, 1]);
        let [a, b] = [read.texel(0, 0), read.texel(1, 0)];
        assert!((a - glam::Vec3::new(1.0, 0.5, 0.0)).abs().max_element() < 0.01, "{a}");
        assert!((b - glam::Vec3::new(255.0, 128.0, 128.0)).abs().max_element() < 1.0, "{b}");
    }

    fn exr_file(size: (usize, usize), texel: impl Fn(usize, usize) -> (f32, f32, f32) + Sync) -> Vec<u8> {
        let channels = SpecificChannels::rgb(|Vec2(x, y)| texel(x, y));
        let image = Image::from_encoded_channels(size, Encoding::SMALL_LOSSLESS, channels);
        let mut bytes = Vec::new();
        image.write().non_parallel().to_buffered(Cursor::new(&mut bytes)).unwrap();
        bytes
    }

    #[test]
    fn open_exr_is_read_texel_by_texel() {
        let texel = |x: usize, y: usize| (x as f32 * 100.0, y as f32 + 0.25, -1e-3);
        let read = panorama("a.exr", &exr_file((8, 4), texel)).unwrap();
        assert_eq!(read.size(), [8, 4]);
        for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
            let expected = glam::Vec3::new(x as f32 * 100.0, y as f32 + 0.25, 0.0);
            assert_eq!(read.texel(x, y), expected, "{x}, {y}");
        }
        let error = |bytes: &[u8]| panorama("a.exr", bytes).unwrap_err().what;
        assert!(error(&exr_file((4, 4), texel)).contains("twice as wide as high"));
        let bad = exr_file((2, 1), |x, _| (if x == 1 { f32::NAN } else { 1.0 }, 0.0, 0.0));
        assert!(error(&bad).contains("its pixel 1, 0 is negative or not finite"));
        let good = exr_file((8, 4), texel);
        for end in 0..good.len() {
            assert!(panorama("a.exr", &good[..end]).is_err(), "{end} bytes of {}", good.len());
        }
    }

    #[test]
    fn invalid_panoramas_are_reported() {
        let error = |bytes: &[u8]| panorama("a.hdr", bytes).unwrap_err().what;
        assert!(error(b"\x89PNG").contains("is neither a Radiance nor an OpenEXR image"));
        assert!(error(&flat(3, 1, &[[0; 4]; 3])).contains("twice as wide as high"));
        assert!(error(&flat(2, 1, &[[0; 4]])).contains("cannot be decoded"));
        assert!(error(&flat(200_000, 100_000, &[])).contains("limit is 32 megapixels"));
        // Every truncation of a valid file.
        let good = flat(4, 2, &[[7, 8, 9, 130]; 8]);
        for end in 0..good.len() {
            assert!(panorama("a.hdr", &good[..end]).is_err(), "{end} bytes of {}", good.len());
        }
    }
}
