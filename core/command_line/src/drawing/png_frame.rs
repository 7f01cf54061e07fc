//! Frames as PNG images in memory and in segments.

use choreo_plugin::{ExportError, Frame};
use std::io::Cursor;

/// Encodes a frame losslessly.
pub(crate) fn encode_png(frame: &Frame, compression: png::Compression) -> Result<Vec<u8>, ExportError> {
    let failed = |error: png::EncodingError| match error {
        png::EncodingError::IoError(error) => ExportError::Io(error),
        other => ExportError::Format(format!("the image of a frame: {other}")),
    };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, frame.width, frame.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(compression);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&frame.rgba).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

/// Decodes a frame; `None` if the image is damaged, is not 8-bit RGBA, or `accepts` refuses its width and height.
pub(crate) fn decode_png(png: &[u8], accepts: impl FnOnce([u32; 2]) -> bool) -> Option<Frame> {
    let mut reader = png::Decoder::new(Cursor::new(png)).read_info().ok()?;
    let info = reader.info();
    let (width, height) = (info.width, info.height);
    let kind = (info.color_type, info.bit_depth);
    if kind != (png::ColorType::Rgba, png::BitDepth::Eight) || !accepts([width, height]) {
        return None;
    }
    let mut rgba = vec![0; reader.output_buffer_size()?];
    reader.next_frame(&mut rgba).ok()?;
    Some(Frame { width, height, rgba })
}
