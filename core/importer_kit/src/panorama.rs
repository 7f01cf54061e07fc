//! Panoramas of light: Radiance RGBE images (`.hdr`).

use crate::problem::{Problem, Result};
use choreo_asset::{Panorama, PanoramaError};
use image::{ImageFormat, ImageReader};
use std::io::Cursor;

/// Pixels of an equirectangular panorama at most: 8192 × 4096.
pub const MAX_PANORAMA_PIXELS: u64 = 32 << 20;

/// Reads a panorama from the bytes of a Radiance file.
pub fn panorama(name: &str, bytes: &[u8]) -> Result<Panorama> {
    let fail = |what: String| Problem::new(name.to_string(), what);
    let reader = || {
        let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Hdr);
        let mut limits = image::Limits::default();
        // Decoded as three 32-bit floats a pixel, and the decoder's own rows.
        limits.max_alloc = Some(MAX_PANORAMA_PIXELS * 16);
        reader.limits(limits);
        reader
    };
    if !bytes.starts_with(b"#?") {
        return Err(fail("is not a Radiance image".into()).hint("panoramas are .hdr files (RGBE)"));
    }
    let size = reader().into_dimensions();
    let (width, height) = size.map_err(|e| fail(format!("has a damaged header: {e}")))?;
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > MAX_PANORAMA_PIXELS {
        let most = MAX_PANORAMA_PIXELS >> 20;
        return Err(fail(format!("has {width} x {height} pixels; the limit is {most} megapixels"))
            .hint("make the panorama smaller: 4096 x 2048 is plenty"));
    }
    if width != 2 * height {
        return Err(fail(format!("has {width} x {height} pixels; a panorama is twice as wide as high"))
            .hint("use an equirectangular (latitude-longitude) panorama"));
    }
    let decoded = reader().decode().map_err(|e| fail(format!("cannot be decoded: {e}")))?;
    let rgb = decoded.into_rgb32f();
    Panorama::new(name, width, height, rgb.into_raw()).map_err(|e| {
        fail(match e {
            PanoramaError::Size => "its size differs from its header".into(),
            PanoramaError::Texel { x, y } => {
                format!("its pixel {x}, {y} is negative or not finite")
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn what_is_wrong_is_said() {
        let error = |bytes: &[u8]| panorama("a.hdr", bytes).unwrap_err().what;
        assert!(error(b"\x89PNG").contains("is not a Radiance image"));
        assert!(error(&flat(3, 1, &[[0; 4]; 3])).contains("twice as wide as high"));
        assert!(error(&flat(2, 1, &[[0; 4]])).contains("cannot be decoded"));
        assert!(error(&flat(200_000, 100_000, &[])).contains("limit is 32 megapixels"));
        // Every beginning of a good file.
        let good = flat(4, 2, &[[7, 8, 9, 130]; 8]);
        for end in 0..good.len() {
            assert!(panorama("a.hdr", &good[..end]).is_err(), "{end} bytes of {}", good.len());
        }
    }
}
