//! KTX2 images in the formats of Basis Universal, as glTF has them (KHR_texture_basisu): ETC1S, and UASTC plain or in zstd. The first
//! level is unpacked to 8-bit RGBA.

use basisu::{DecodeFlags, TargetFormat, Transcoder};

const MAGIC: &[u8] = b"\xABKTX 20\xBB\r\n\x1A\n";
/// Color models of the data format descriptor.
const ETC1S: u8 = 163;
const UASTC: u8 = 166;
/// Supercompression scheme.
const ZSTANDARD: u32 = 2;
/// Limit of the number of mip levels, above that of the largest texture.
const MAX_LEVELS: u32 = 16;

/// Error of a file that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Ktx2Error {
    #[error("is cut off")]
    Cut,
    #[error("has Vulkan format {0}; KTX2 must be ETC1S or UASTC")]
    Format(u32),
    #[error(
        "has a depth of {depth}, {layers} layers, {faces} faces and {levels} levels; it should be one 2D image"
    )]
    Shape { depth: u32, layers: u32, faces: u32, levels: u32 },
    #[error("has color model {0}; KTX2 must be ETC1S (163) or UASTC (166)")]
    ColorModel(u8),
    #[error("says it unpacks to {unpacked} bytes, but its size needs {needed}")]
    Length { unpacked: u64, needed: u64 },
    #[error("its data are damaged")]
    Damaged,
}

pub(crate) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Checks the header and returns width and height. The file must hold one 2D image in a supported format (KTX 2.0 §3).
pub(crate) fn size(bytes: &[u8]) -> Result<[u32; 2], Ktx2Error> {
    let word = |at: usize| bytes.get(at..)?.first_chunk::<4>().map(|b| u32::from_le_bytes(*b));
    let long = |at: usize| bytes.get(at..)?.first_chunk::<8>().map(|b| u64::from_le_bytes(*b));
    let mut header = [0; 9];
    for (field, at) in header.iter_mut().zip((12..).step_by(4)) {
        *field = word(at).ok_or(Ktx2Error::Cut)?;
    }
    let [format, _, width, height, depth, layers, faces, levels, scheme] = header;
    if format != 0 {
        return Err(Ktx2Error::Format(format));
    }
    if depth > 0 || layers > 1 || faces != 1 || !(1..=MAX_LEVELS).contains(&levels) {
        return Err(Ktx2Error::Shape { depth, layers, faces, levels });
    }
    let descriptor = word(48).ok_or(Ktx2Error::Cut)? as usize;
    let model = *bytes.get(descriptor.saturating_add(12)).ok_or(Ktx2Error::Cut)?;
    if model != ETC1S && model != UASTC {
        return Err(Ktx2Error::ColorModel(model));
    }
    // Ranges of the codebooks and of the first level, which the transcoder does not check.
    let ranges = [(long(64), long(72)), (long(80), long(88))];
    let fits = |range: &(Option<u64>, Option<u64>)| {
        let (Some(start), Some(length)) = *range else { return false };
        start.checked_add(length).is_some_and(|end| end <= bytes.len() as u64)
    };
    if !ranges.iter().all(fits) {
        return Err(Ktx2Error::Cut);
    }
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4));
    let unpacked = long(96).ok_or(Ktx2Error::Cut)?;
    if scheme == ZSTANDARD && unpacked != 16 * blocks {
        return Err(Ktx2Error::Length { unpacked, needed: 16 * blocks });
    }
    Ok([width, height])
}

/// Decodes the first level to 8-bit RGBA. [`size`] must have accepted the file.
pub(crate) fn decode(bytes: &[u8]) -> Result<Vec<u8>, Ktx2Error> {
    let pixels = Transcoder::new(bytes)
        .and_then(|texture| texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE));
    pixels.map_err(|_| Ktx2Error::Damaged)
}
