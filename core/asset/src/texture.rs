//! Images, and how materials sample them.

use glam::Affine2;
use std::sync::Arc;

/// An RGBA image with 8 bits per channel, rows from the top. Whether the color channels are sRGB depends on the use.
#[derive(Clone, Default, PartialEq)]
pub struct Image {
    /// Name in the file.
    pub name: String,
    /// Size in pixels.
    pub width: u32,
    /// Size in pixels.
    pub height: u32,
    /// Four bytes per pixel, row by row from the top; empty if the import did not request pixels.
    pub rgba: Vec<u8>,
    /// File from which the pixels were decoded, if the importer was asked to keep it; `None` for generated or changed pixels.
    pub file: Option<ImageFile>,
}

/// An encoded image file of a common format.
#[derive(Clone, PartialEq, Eq)]
pub struct ImageFile {
    /// The format that the bytes have.
    pub format: ImageFileFormat,
    /// The whole file.
    pub bytes: Arc<Vec<u8>>,
}

/// Formats of image files that other programs read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageFileFormat {
    /// Portable Network Graphics.
    Png,
    /// JPEG File Interchange Format.
    Jpeg,
    /// WebP, with or without loss.
    WebP,
}

impl ImageFileFormat {
    /// Extension of file names, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            ImageFileFormat::Png => "png",
            ImageFileFormat::Jpeg => "jpg",
            ImageFileFormat::WebP => "webp",
        }
    }

    /// Media type (RFC 6838).
    pub fn media_type(self) -> &'static str {
        match self {
            ImageFileFormat::Png => "image/png",
            ImageFileFormat::Jpeg => "image/jpeg",
            ImageFileFormat::WebP => "image/webp",
        }
    }
}

impl std::fmt::Debug for ImageFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ImageFile({:?}, {} bytes)", self.format, self.bytes.len())
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({:?}, {}x{})", self.name, self.width, self.height)
    }
}

/// Addressing mode: the texture beyond its border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// The texture repeats, every other time mirrored.
    MirroredRepeat,
    /// The pixels of the border continue.
    ClampToEdge,
}

/// Wrapping and filtering of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Addressing mode beyond the left and right border.
    pub wrap_u: Wrap,
    /// Addressing mode beyond the upper and lower border.
    pub wrap_v: Wrap,
    /// Whether a magnified texture is filtered linearly; otherwise the nearest pixel counts.
    pub mag_linear: bool,
    /// Whether a minified texture is filtered linearly; otherwise the nearest pixel counts.
    pub min_linear: bool,
    /// None: no mipmaps; Some(false): nearest level; Some(true): blend two levels.
    pub mip_linear: Option<bool>,
}

impl Default for Sampler {
    fn default() -> Self {
        Sampler {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            mag_linear: true,
            min_linear: true,
            mip_linear: Some(true),
        }
    }
}

/// A texture of a material: an image, its sampler and its texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into `Asset::images`.
    pub image: u32,
    /// Wrapping and filtering.
    pub sampler: Sampler,
    /// Index of the primitive's uv set: 0 or 1.
    pub uv_set: u8,
    /// texture-from-mesh uv (KHR_texture_transform); identity = none.
    pub uv_transform: Affine2,
}
