//! Sample formats of the color target: 8 bits in sRGB, or floats where full-screen passes follow.

use crate::dither::dither_to_bytes;
use crate::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};
use glam::Vec4;

/// Format of a sample of the color target. Colors are passed and returned as linear RGBA.
pub(super) trait Target: Copy + PartialEq + Send + Sync {
    /// Whether backgrounds are dithered in this format.
    const DITHERED: bool;

    fn encode(linear: Vec4) -> Self;
    fn decode(self) -> Vec4;

    /// Source-over blending with straight alpha. The alpha becomes the coverage.
    fn blend_over(self, source: Vec4) -> Self {
        let source = Self::clamp_fragment(source);
        let (below, a) = (self.decode(), source.w);
        let rgb = source.truncate() * a + below.truncate() * (1.0 - a);
        Self::encode(rgb.extend(a + below.w * (1.0 - a)))
    }

    /// Multiplies the color by the color of a glass; the alpha does not change.
    fn filter_through_glass(self, source: Vec4) -> Self {
        let (source, below) = (Self::clamp_fragment(source), self.decode());
        Self::encode((below.truncate() * source.truncate()).extend(below.w))
    }

    /// Adds the light that a glass reflects or emits. The alpha becomes the coverage.
    fn add_glass_light(self, source: Vec4) -> Self {
        let (source, below) = (Self::clamp_fragment(source), self.decode());
        let rgb = below.truncate() + source.truncate();
        Self::encode(rgb.extend(source.w + below.w * (1.0 - source.w)))
    }

    /// The sample as sRGB bytes of the final image.
    fn srgb_bytes(self) -> [u8; 4];

    /// Mean of the samples in linear light.
    #[inline]
    fn resolve(samples: &[Self]) -> Self {
        let first = samples[0];
        if samples.iter().all(|s| *s == first) {
            return first;
        }
        let sum = samples.iter().fold(Vec4::ZERO, |sum, s| sum + s.decode());
        Self::encode(sum * (1.0 / samples.len() as f32))
    }

    /// Fragment colors are clamped before they are blended into fixed-point targets (Vulkan 1.3, "Blending").
    fn clamp_fragment(source: Vec4) -> Vec4;
}

/// Format of a pixel of the output image.
pub(crate) trait OutputPixel: Copy + Send + Sync {
    fn from_sample<T: Target>(sample: T) -> Self;

    /// Creates a pixel of the output image from a color of a float target.
    fn from_color(color: Vec4, at: [usize; 2]) -> Self;
}

/// Bytes, as files store them.
impl OutputPixel for [u8; 4] {
    fn from_sample<T: Target>(sample: T) -> [u8; 4] {
        sample.srgb_bytes()
    }

    #[inline]
    fn from_color(color: Vec4, [x, y]: [usize; 2]) -> [u8; 4] {
        dither_to_bytes(color, x, y)
    }
}

/// Linear colors, for later passes.
impl OutputPixel for Vec4 {
    fn from_sample<T: Target>(sample: T) -> Vec4 {
        sample.decode()
    }

    fn from_color(color: Vec4, _: [usize; 2]) -> Vec4 {
        color
    }
}

/// Pixel like VK_FORMAT_R8G8B8A8_SRGB: color encoded, alpha linear.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Srgb8(pub [u8; 4]);

impl Target for Srgb8 {
    const DITHERED: bool = true;

    #[inline]
    fn encode(c: Vec4) -> Srgb8 {
        let alpha = if c.w > 0.0 { c.w.min(1.0) } else { 0.0 };
        Srgb8([linear_to_srgb8(c.x), linear_to_srgb8(c.y), linear_to_srgb8(c.z), (alpha * 255.0 + 0.5) as u8])
    }

    #[inline]
    fn decode(self) -> Vec4 {
        let table = srgb_to_linear_table();
        let [r, g, b, a] = self.0.map(usize::from);
        Vec4::new(table[r], table[g], table[b], a as f32 * (1.0 / 255.0))
    }

    #[inline]
    fn clamp_fragment(source: Vec4) -> Vec4 {
        source.clamp(Vec4::ZERO, Vec4::ONE)
    }

    #[inline]
    fn srgb_bytes(self) -> [u8; 4] {
        self.0
    }
}

/// Pixel like VK_FORMAT_R16G16B16A16_SFLOAT, without its rounding (relative 2⁻¹¹, below one 8-bit step).
#[derive(Clone, Copy, PartialEq)]
pub(super) struct LinearFloat(pub Vec4);

impl Target for LinearFloat {
    const DITHERED: bool = false;

    #[inline]
    fn encode(c: Vec4) -> LinearFloat {
        // Limits are those of 16-bit floats; NaN becomes 0.
        let limit = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(-65504.0, 65504.0) };
        LinearFloat(Vec4::new(limit(c.x), limit(c.y), limit(c.z), limit(c.w)))
    }
    #[inline]
    fn decode(self) -> Vec4 {
        self.0
    }
    #[inline]
    fn clamp_fragment(source: Vec4) -> Vec4 {
        source
    }

    #[inline]
    fn srgb_bytes(self) -> [u8; 4] {
        Srgb8::encode(self.0).0
    }
}
