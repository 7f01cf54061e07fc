//! Images of assets as files.

use choreo_plugin::ExportError;
use choreo_plugin::asset::Image;

/// The image as PNG: RGB where nothing is transparent, else RGBA.
pub fn png_of(image: &Image) -> Result<Vec<u8>, ExportError> {
    let failed = |e: png::EncodingError| ExportError::Format(format!("image \"{}\": {e}", image.name));
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, image.width, image.height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_deflate_compression(png::DeflateCompression::Level(1));
    encoder.set_filter(png::Filter::Paeth);
    let pixels = image.rgba.as_chunks::<4>().0;
    let opaque = pixels.iter().all(|p| p[3] == 255);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    let mut writer = encoder.write_header().map_err(failed)?;
    match opaque {
        true => {
            let rgb: Vec<u8> = pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            writer.write_image_data(&rgb).map_err(failed)?;
        }
        false => writer.write_image_data(&image.rgba).map_err(failed)?,
    }
    writer.finish().map_err(failed)?;
    Ok(out)
}
