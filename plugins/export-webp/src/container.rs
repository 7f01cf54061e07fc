//! The container of WebP (RFC 9649), which consists of RIFF chunks.

use std::io::{Error, ErrorKind, Read};

/// A chunk, padded to an even length.
pub(crate) fn chunk(kind: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(content.len() + 9);
    bytes.extend(kind);
    bytes.extend((content.len() as u32).to_le_bytes());
    bytes.extend(content);
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    bytes
}

/// The lower three bytes of a number, little endian.
fn u24_le(number: usize) -> [u8; 3] {
    let [a, b, c, ..] = number.to_le_bytes();
    [a, b, c]
}

/// The chunk of an animation frame, which replaces its rectangle of the canvas.
pub(crate) fn frame_chunk(at: [usize; 2], size: [usize; 2], milliseconds: u32, image: &[u8]) -> Vec<u8> {
    let mut content = Vec::with_capacity(image.len() + 24);
    let numbers = [at[0] / 2, at[1] / 2, size[0] - 1, size[1] - 1, milliseconds as usize];
    content.extend(numbers.into_iter().flat_map(u24_le));
    // Flags: no blending, no disposal.
    content.push(2);
    content.extend(chunk(b"VP8L", image));
    chunk(b"ANMF", &content)
}

/// Contents of a file's header.
pub(crate) struct Header {
    pub size: [u32; 2],
    /// Number of plays; 0: forever.
    pub plays: u16,
    /// Whether an XMP chunk follows the frames.
    pub has_about: bool,
    /// Bytes that follow the header.
    pub body: u64,
}

/// All chunks before the frames; `None` where the file would be too long.
pub(crate) fn head(header: &Header) -> Option<Vec<u8>> {
    let Header { size: [width, height], plays, has_about, body } = *header;
    // Flags: alpha and animation, and metadata.
    let mut extended = vec![0x12 | u8::from(has_about) << 2, 0, 0, 0];
    extended.extend([width - 1, height - 1].into_iter().flat_map(|side| u24_le(side as usize)));
    // A transparent background color, and the number of plays.
    let mut animation = vec![0; 4];
    animation.extend(plays.to_le_bytes());
    let chunks = [chunk(b"VP8X", &extended), chunk(b"ANIM", &animation)].concat();
    let length = u32::try_from(4 + chunks.len() as u64 + body).ok()?;
    Some([&b"RIFF"[..], &length.to_le_bytes(), b"WEBP", &chunks].concat())
}

/// The lossless image in a still WebP.
pub(crate) fn image_of(still: &[u8]) -> Option<&[u8]> {
    let mut rest = still.get(12..)?;
    loop {
        let length = u32::from_le_bytes(rest.get(4..8)?.try_into().ok()?) as usize;
        if rest.starts_with(b"VP8L") {
            return rest.get(8..8 + length);
        }
        rest = rest.get(8 + length.next_multiple_of(2)..)?;
    }
}

/// A still WebP that contains a lossless image.
pub(crate) fn still_webp(image: &[u8]) -> Vec<u8> {
    let image = chunk(b"VP8L", image);
    chunk(b"RIFF", &[b"WEBP", &image[..]].concat())
}

/// A frame that was read back from an unfinished file.
pub(crate) struct FrameChunk {
    pub at: [usize; 2],
    pub size: [usize; 2],
    pub image: Vec<u8>,
    /// Length of the chunk, bytes.
    pub bytes: u64,
}

/// Reads the next frame; `None` where the chunk is no frame.
pub(crate) fn read_frame(from: &mut dyn Read) -> Result<Option<FrameChunk>, Error> {
    let mut start = [0; 8];
    from.read_exact(&mut start)?;
    let [kind @ .., a, b, c, d] = start;
    let length = u32::from_le_bytes([a, b, c, d]) as usize;
    let mut content = Vec::new();
    from.take(length.next_multiple_of(2) as u64).read_to_end(&mut content)?;
    if content.len() < length {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    if kind != *b"ANMF" || length < 24 {
        return Ok(None);
    }
    let number = |i: usize| {
        usize::from(content[3 * i])
            | usize::from(content[3 * i + 1]) << 8
            | usize::from(content[3 * i + 2]) << 16
    };
    let (at, size) = ([2 * number(0), 2 * number(1)], [number(2) + 1, number(3) + 1]);
    let image_length = u32::from_le_bytes([content[20], content[21], content[22], content[23]]) as usize;
    let image = content.get(24..24 + image_length).map(<[u8]>::to_vec);
    Ok(image.map(|image| FrameChunk { at, size, image, bytes: 8 + content.len() as u64 }))
}

/// XMP (ISO 16684-1) whose description holds the provenance, one entry on a line.
pub(crate) fn xmp(provenance: &[(String, String)]) -> String {
    let lines: Vec<String> = provenance.iter().map(|(key, text)| format!("{key}: {text}")).collect();
    let text = lines.join("\n").replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    format!(
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\
         <rdf:Description rdf:about=\"\" xmlns:dc=\"http://purl.org/dc/elements/1.1/\"><dc:description><rdf:Alt>\
         <rdf:li xml:lang=\"x-default\">{text}</rdf:li></rdf:Alt></dc:description></rdf:Description></rdf:RDF></x:xmpmeta>"
    )
}
