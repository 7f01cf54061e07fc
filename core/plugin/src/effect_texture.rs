//! Images that effects read.

use choreo_asset::linear_from_srgb_f32;
use glam::{IVec2, UVec2, Vec2, Vec4};

/// A tiling image without mipmaps, for grain, paper, ramps and noise. Linear RGBA in 16-bit floats (IEEE 754 binary16), which both
/// renderers read.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectTexture {
    /// Name of the function that reads it in WGSL: `NAME(uv: vec2<f32>) -> vec4<f32>`, bilinear.
    pub name: String,
    /// The file that the image was read from, if any.
    pub file: Option<std::path::PathBuf>,
    /// Width and height in texels.
    pub size: [u32; 2],
    /// Texels as the bits of 16-bit floats, row by row from the top.
    pub halves: Vec<[u16; 4]>,
    texels: Vec<Vec4>,
}

impl EffectTexture {
    /// Largest width and height in texels.
    pub const MOST: u32 = 2048;

    /// Makes a texture from 8-bit RGBA, row by row from the top. `srgb`: red, green and blue are sRGB-encoded. `None` if `size` is zero or
    /// too large, or `rgba` does not have the length for it.
    pub fn new(name: &str, size: [u32; 2], rgba: &[u8], srgb: bool) -> Option<EffectTexture> {
        let fits = size.iter().all(|s| (1..=Self::MOST).contains(s));
        if !fits || rgba.len() != size[0] as usize * size[1] as usize * 4 {
            return None;
        }
        let plain: Vec<f32> = (0..=255u8).map(|v| f32::from(v) / 255.0).collect();
        let decoded: Vec<f32> =
            plain.iter().map(|v| if srgb { linear_from_srgb_f32(*v) } else { *v }).collect();
        let halves: Vec<[u16; 4]> = rgba
            .as_chunks::<4>()
            .0
            .iter()
            .map(|p| {
                let color = |i: usize| half_from_f32(decoded[usize::from(p[i])]);
                [color(0), color(1), color(2), half_from_f32(plain[usize::from(p[3])])]
            })
            .collect();
        let texels = halves.iter().map(|h| Vec4::from_array(h.map(f32_from_half))).collect();
        Some(EffectTexture { name: name.into(), file: None, size, halves, texels })
    }

    /// Sets the file that the texture was read from.
    pub fn of_file(self, file: Option<std::path::PathBuf>) -> EffectTexture {
        EffectTexture { file, ..self }
    }

    /// Bilinear sample at `uv`, which is 0 to 1 from the top left and repeats beyond; the shaders' `effect_texture` does the same.
    ///
    /// ```
    /// use choreo_plugin::EffectTexture;
    /// use choreo_plugin::glam::Vec2;
    /// let ramp = EffectTexture::new("ramp", [2, 1], &[0, 0, 0, 255, 255, 255, 255, 255], false).unwrap();
    /// assert_eq!([0.25, 0.5, 1.25].map(|u| ramp.sample(Vec2::new(u, 0.5)).x), [0.0, 0.5, 0.0]);
    /// ```
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        let size = UVec2::from_array(self.size).as_ivec2();
        let at = (uv - uv.floor()) * size.as_vec2() - 0.5;
        let corner = at.floor();
        let f = at - corner;
        let texel = |x: i32, y: i32| {
            let at = (corner.as_ivec2() + IVec2::new(x, y) + size) % size;
            // A coordinate that is not finite reads the first texel.
            let at = at.max(IVec2::ZERO);
            self.texels[at.y as usize * self.size[0] as usize + at.x as usize]
        };
        let mix = |a: Vec4, b: Vec4, t: f32| a * (1.0 - t) + b * t;
        mix(mix(texel(0, 0), texel(1, 0), f.x), mix(texel(0, 1), texel(1, 1), f.x), f.y)
    }
}

/// The nearest 16-bit float of a number from 0 to 1.
fn half_from_f32(v: f32) -> u16 {
    if v < 6.103_515_6e-5 {
        // Subnormal: a count of 2⁻²⁴.
        return libm::roundf(v * 16_777_216.0) as u16;
    }
    // The exponent changes from 8 bits with bias 127 to 5 bits with bias 15; the fraction from 23 bits to 10, rounded to nearest.
    ((v.to_bits() - (112 << 23) + (1 << 12)) >> 13) as u16
}

/// Value of a 16-bit float that is finite and not negative.
fn f32_from_half(bits: u16) -> f32 {
    match bits >> 10 {
        0 => f32::from(bits) * (1.0 / 16_777_216.0),
        _ => f32::from_bits((u32::from(bits) + (112 << 10)) << 13),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_hold_bytes_within_their_rounding() {
        for v in 0..=255u8 {
            let (plain, near) = (f32::from(v) / 255.0, f32_from_half(half_from_f32(f32::from(v) / 255.0)));
            assert!((plain - near).abs() <= plain / 2048.0 + 1e-7, "{v}: {near}");
            let decoded = linear_from_srgb_f32(plain);
            assert!(
                (decoded - f32_from_half(half_from_f32(decoded))).abs() <= decoded / 2048.0 + 6e-8,
                "{v}"
            );
        }
        assert_eq!(
            (half_from_f32(0.0), half_from_f32(1.0), f32_from_half(0x3c00), f32_from_half(0x3800)),
            (0, 0x3c00, 1.0, 0.5)
        );
    }

    #[test]
    fn a_texture_is_bilinear_and_repeats() {
        let bytes = [0, 0, 0, 255, 255, 255, 255, 255];
        let t = EffectTexture::new("t", [2, 1], &bytes, false).unwrap();
        let red = |u: f32| t.sample(Vec2::new(u, 0.5)).x;
        assert_eq!(
            [red(0.25), red(0.5), red(0.75), red(1.0), red(-3.25), red(7.5)],
            [0.0, 0.5, 1.0, 0.5, 1.0, 0.5]
        );
        assert!(
            t.sample(Vec2::new(f32::NAN, f32::INFINITY)).w.is_nan() || t.sample(Vec2::splat(1e30)).w >= 0.0
        );
        let gray = EffectTexture::new("t", [1, 1], &[188, 188, 188, 128], true).unwrap().sample(Vec2::ZERO);
        assert!((gray.x - 0.5).abs() < 0.01 && (gray.w - 0.502).abs() < 0.001, "{gray}");
        assert_eq!(EffectTexture::new("t", [0, 1], &[], true), None);
        assert_eq!(EffectTexture::new("t", [2049, 1], &[0; 8196], true), None);
        assert_eq!(EffectTexture::new("t", [1, 1], &[0; 3], true), None);
    }
}
