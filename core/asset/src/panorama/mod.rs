//! Environment maps: radiance from every direction.

mod studio;

use crate::hash::ContentHash;
use glam::Vec3;
use std::fmt;
use std::sync::Arc;

/// Radiance from every direction, linear, as an equirectangular image: rows from straight up to straight down. The middle column
/// is the view along −Z; columns to the right of it lie to the right of that view.
#[derive(Clone, PartialEq)]
pub struct Panorama {
    /// Name for messages.
    pub name: String,
    /// Radiance file (`.hdr`) from which the panorama was read, if an export may write it unchanged.
    pub file: Option<Arc<Vec<u8>>>,
    width: u32,
    height: u32,
    /// Red, green, blue; rows from the top.
    rgb: Vec<f32>,
    hash: ContentHash,
}

/// Error of a panorama's texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
pub enum PanoramaError {
    /// The width or height is 0, or the number of values is not 3 · width · height.
    Size,
    /// The texel in column `x` of row `y` is negative or not finite.
    Texel { x: u32, y: u32 },
}

impl fmt::Debug for Panorama {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Panorama({:?}, {}×{})", self.name, self.width, self.height)
    }
}

impl Panorama {
    /// Largest value of a texel: the largest 16-bit float, the format in which GPUs store it.
    pub const BRIGHTEST: f32 = 65504.0;

    /// Makes a panorama from linear RGB texels, rows from the top. Values above [`Panorama::BRIGHTEST`] are clamped.
    pub fn new(name: &str, width: u32, height: u32, mut rgb: Vec<f32>) -> Result<Panorama, PanoramaError> {
        if width == 0 || height == 0 || rgb.len() as u64 != 3 * u64::from(width) * u64::from(height) {
            return Err(PanoramaError::Size);
        }
        if let Some(bad) = rgb.iter().position(|v| !v.is_finite() || *v < 0.0) {
            let texel = (bad / 3) as u32;
            return Err(PanoramaError::Texel { x: texel % width, y: texel / width });
        }
        rgb.iter_mut().for_each(|v| *v = v.min(Panorama::BRIGHTEST));
        let mut hasher = blake3::Hasher::new();
        hasher.update(&width.to_le_bytes());
        hasher.update(&height.to_le_bytes());
        hasher.update(bytemuck::cast_slice(&rgb));
        let hash = hasher.finalize().into();
        Ok(Panorama { name: name.into(), file: None, width, height, rgb, hash })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Hash of size and texels.
    pub fn hash(&self) -> ContentHash {
        self.hash
    }

    /// The texel in column `x` of row `y`: columns wrap around, rows are clamped at the poles.
    pub fn texel(&self, x: i64, y: i64) -> Vec3 {
        let x = x.rem_euclid(i64::from(self.width)) as usize;
        let y = y.clamp(0, i64::from(self.height) - 1) as usize;
        let at = 3 * (y * self.width as usize + x);
        Vec3::new(self.rgb[at], self.rgb[at + 1], self.rgb[at + 2])
    }
}
