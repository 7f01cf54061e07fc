//! Images, and how materials sample them.

use glam::Affine2;
use std::sync::Arc;

/// 8 bits a channel, RGBA, rows from the top. Whether the color channels are sRGB depends on the use.
#[derive(Clone, Default, PartialEq)]
pub struct Image {
    /// Name in the file.
    pub name: String,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Four bytes per pixel, row by row from the top; empty where pixels were not asked for.
    pub rgba: Vec<u8>,
    /// The file that the pixels were decoded from, where an importer was asked to keep it; `None` for pixels that were made or changed.
    pub file: Option<ImageFile>,
}

/// An image as a file of a common format.
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

/// The texture beyond its border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The texture again.
    #[default]
    Repeat,
    /// The texture again, every other time mirrored.
    MirroredRepeat,
    /// The pixels of the border.
    ClampToEdge,
}

/// How a texture is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// The texture beyond its left and right border.
    pub wrap_u: Wrap,
    /// The texture beyond its upper and lower border.
    pub wrap_v: Wrap,
    /// Pixels of an enlarged texture are mixed (linear), or the nearest counts.
    pub mag_linear: bool,
    /// Pixels of a texture that is made smaller are mixed (linear), or the nearest counts.
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

/// A texture of a material: an image and how it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into `Asset::images`.
    pub image: u32,
    /// How it is read.
    pub sampler: Sampler,
    /// Index of the primitive's uv set: 0 or 1.
    pub uv_set: u8,
    /// texture-from-mesh uv (KHR_texture_transform); identity = none.
    pub uv_transform: Affine2,
}
