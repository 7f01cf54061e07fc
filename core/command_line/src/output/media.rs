//! Metadata of an image or video, for `choreo info` and for `--resume`.

/// Keyword of a hash of the whole provenance, for formats without room for all of it.
pub(crate) const ID_KEYWORD: &str = "choreo:id";

/// Metadata that the header of an image or video contains.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Media {
    pub format: &'static str,
    pub width: u32,
    pub height: u32,
    pub provenance: Vec<(String, String)>,
}

/// Reads the metadata. `None` if the bytes are no PNG, OpenEXR, WebP, MP4, GIF or y4m. Headers are not trusted: values that do not fit are
/// left out.
pub fn read(bytes: &[u8]) -> Option<Media> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Some(read_png(bytes.get(8..)?));
    }
    if bytes.starts_with(EXR_MAGIC) {
        return Some(read_exr(bytes).0);
    }
    if bytes.starts_with(b"GIF87a") || bytes.starts_with(b"GIF89a") {
        return Some(read_gif(bytes));
    }
    if bytes.starts_with(b"RIFF") && bytes.get(8..12)? == b"WEBP" {
        return Some(read_webp(bytes));
    }
    if bytes.starts_with(b"YUV4MPEG2 ") {
        return Some(read_y4m(bytes));
    }
    if bytes.get(4..8)? == b"ftyp" {
        return Some(read_mp4(bytes));
    }
    None
}

fn be32(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

fn read_png(mut rest: &[u8]) -> Media {
    let mut media = Media { format: "PNG image", ..Media::default() };
    // length, type, data, checksum
    while let (Some(length), Some(kind)) = (be32(rest, 0), rest.get(4..8)) {
        let Some(data) = rest.get(8..8usize.saturating_add(length as usize)) else { break };
        match kind {
            b"IHDR" => {
                media.width = be32(data, 0).unwrap_or(0);
                media.height = be32(data, 4).unwrap_or(0);
            }
            b"acTL" => media.format = "APNG video",
            b"tEXt" | b"iTXt" => {
                let mut parts = data.splitn(2, |b| *b == 0);
                if let (Some(key), Some(text)) = (parts.next(), parts.next()) {
                    // iTXt: two bytes of compression, language and translated keyword, each ended by zero.
                    let text = match kind {
                        b"iTXt" => text.get(2..).and_then(|t| t.splitn(3, |b| *b == 0).nth(2)),
                        _ => Some(text),
                    };
                    let string = |b: &[u8]| String::from_utf8_lossy(b).into_owned();
                    media.provenance.extend(text.map(|t| (string(key), string(t))));
                }
            }
            _ => {}
        }
        rest = rest.get(12 + length as usize..).unwrap_or(&[]);
    }
    media
}

/// Reads the metadata of a PNG or OpenEXR image; `None` if bytes are missing or a checksum is wrong.
pub fn read_complete_image(bytes: &[u8]) -> Option<Media> {
    match bytes.starts_with(EXR_MAGIC) {
        true => read_complete_exr(bytes),
        false => read_complete_png(bytes),
    }
}

fn read_complete_png(bytes: &[u8]) -> Option<Media> {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n")?;
    loop {
        let length = be32(rest, 0)? as usize;
        let chunk = rest.get(4..8usize.checked_add(length)?)?;
        if be32(rest, 8 + length)? != crc32fast::hash(chunk) {
            return None;
        }
        rest = &rest[12 + length..];
        if chunk.starts_with(b"IEND") {
            return rest.is_empty().then(|| read_png(&bytes[8..]));
        }
    }
}

/// Splits the lines `key: text` that the comments of MP4 and GIF contain.
fn parse_comment_lines(text: &[u8]) -> Vec<(String, String)> {
    let text = String::from_utf8_lossy(text);
    let lines = text.lines().filter_map(|line| line.split_once(": "));
    lines.map(|(key, text)| (key.to_string(), text.to_string())).collect()
}

/// GIF89a specification, §18 to §24: the comment comes before the first image.
fn read_gif(bytes: &[u8]) -> Media {
    let mut media = Media { format: "GIF video", ..Media::default() };
    let le16 = |at: usize| bytes.get(at..at + 2).map_or(0, |b| u32::from(b[0]) | u32::from(b[1]) << 8);
    (media.width, media.height) = (le16(6), le16(8));
    let table = match bytes.get(10) {
        Some(flags) if flags & 0x80 != 0 => 3 << ((flags & 7) + 1),
        _ => 0,
    };
    let mut rest = bytes.get(13 + table..).unwrap_or(&[]);
    while let [0x21, label, blocks @ ..] = rest {
        let mut text = Vec::new();
        rest = blocks;
        while let Some((&length, more)) = rest.split_first() {
            let Some((block, more)) = more.split_at_checked(length.into()) else { return media };
            text.extend_from_slice(block);
            rest = more;
            if length == 0 {
                break;
            }
        }
        if *label == 0xfe {
            media.provenance.extend(parse_comment_lines(&text));
        }
    }
    media
}

fn read_y4m(bytes: &[u8]) -> Media {
    let mut media = Media { format: "y4m video", ..Media::default() };
    let line = bytes.split(|b| *b == b'\n').next().unwrap_or_default();
    // A longer line is no header.
    let line = String::from_utf8_lossy(&line[..line.len().min(4096)]).into_owned();
    for word in line.split(' ').skip(1) {
        if let Some(id) = word.strip_prefix("XCHOREO=") {
            media.provenance.push((ID_KEYWORD.to_string(), id.to_string()));
        } else if let Some(width) = word.strip_prefix('W') {
            media.width = width.parse().unwrap_or(0);
        } else if let Some(height) = word.strip_prefix('H') {
            media.height = height.parse().unwrap_or(0);
        }
    }
    media
}

fn read_mp4(bytes: &[u8]) -> Media {
    let mut media = Media { format: "MP4 video", ..Media::default() };
    let Some(moov) = first_box(bytes, b"moov") else { return media };
    let tkhd = first_box(moov, b"trak").and_then(|t| first_box(t, b"tkhd"));
    if let Some(tkhd) = tkhd
        && tkhd.len() >= 8
    {
        // Width and height are the last two fields, in 16.16 fixed point.
        media.width = be32(tkhd, tkhd.len() - 8).unwrap_or(0) >> 16;
        media.height = be32(tkhd, tkhd.len() - 4).unwrap_or(0) >> 16;
    }
    let ilst = first_box(moov, b"udta")
        .and_then(|u| first_box(u, b"meta"))
        .and_then(|m| first_box(m.get(4..)?, b"ilst"));
    let data = ilst
        .and_then(|l| first_box(l, b"\xa9cmt"))
        .and_then(|c| first_box(c, b"data"))
        .and_then(|d| d.get(8..));
    media.provenance = parse_comment_lines(data.unwrap_or_default());
    media
}

/// RFC 9649: the size is in the chunk VP8X, the provenance in the description of the chunk XMP.
fn read_webp(bytes: &[u8]) -> Media {
    let mut media = Media { format: "WebP video", ..Media::default() };
    let mut rest = bytes.get(12..).unwrap_or(&[]);
    while let (Some(kind), Some(length)) = (rest.get(..4), le32(rest, 4)) {
        let Some(content) = rest.get(8..8usize.saturating_add(length as usize)) else { break };
        if kind == b"VP8X" {
            let side = |at: usize| le32(content, at).map_or(0, |side| (side & 0xff_ffff) + 1);
            // The height is the upper three bytes of these four.
            (media.width, media.height) = (side(4), le32(content, 6).map_or(0, |side| (side >> 8) + 1));
        }
        if kind == b"XMP " {
            let text = String::from_utf8_lossy(content);
            let lines = text.split_once("x-default\">").and_then(|(_, text)| text.split_once("</rdf:li>"));
            let lines = lines.map_or("", |(lines, _)| lines);
            let lines = lines.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
            media.provenance = parse_comment_lines(lines.as_bytes());
        }
        rest = rest.get(8 + (length as usize).next_multiple_of(2)..).unwrap_or(&[]);
    }
    media
}

/// Magic number of OpenEXR files.
const EXR_MAGIC: &[u8] = b"\x76\x2f\x31\x01";

fn le32(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

/// Offset of the chunk table of an OpenEXR file, where the header ends, and number of rows in each chunk.
struct ExrBody {
    offset: usize,
    rows_per_chunk: u32,
}

/// Reads the attributes of the header. The body is `None` if the header has no end.
fn read_exr(bytes: &[u8]) -> (Media, Option<ExrBody>) {
    let mut media = Media { format: "OpenEXR image", ..Media::default() };
    let (mut at, mut rows) = (8, 1);
    loop {
        let text = |at: usize| {
            let rest = bytes.get(at..)?;
            let (text, _) = rest.split_at(rest.iter().position(|b| *b == 0)?);
            Some((String::from_utf8_lossy(text).into_owned(), at + text.len() + 1))
        };
        let Some((name, kind_at)) = text(at) else { return (media, None) };
        if name.is_empty() {
            return (media, Some(ExrBody { offset: kind_at, rows_per_chunk: rows }));
        }
        let Some((kind, length_at)) = text(kind_at) else { return (media, None) };
        let value = le32(bytes, length_at).and_then(|length| {
            let first = length_at + 4;
            Some((bytes.get(first..first.checked_add(length as usize)?)?, first + length as usize))
        });
        let Some((value, end)) = value else { return (media, None) };
        match (&*name, &*kind) {
            ("dataWindow", "box2i") => {
                let side =
                    |low, high| Some(le32(value, high)?.wrapping_sub(le32(value, low)?).wrapping_add(1));
                media.width = side(0, 8).unwrap_or(0);
                media.height = side(4, 12).unwrap_or(0);
            }
            // ZIP has 16 rows in a chunk; no compression and ZIPS have one.
            ("compression", "compression") if value == [3] => rows = 16,
            (name, "string") if name == "Software" || name.starts_with("choreo:") => {
                media.provenance.push((name.to_string(), String::from_utf8_lossy(value).into_owned()));
            }
            _ => {}
        }
        at = end;
    }
}

/// Checks an OpenEXR image. The format has no checksums, so the chunks must follow each other without a gap up to the end.
fn read_complete_exr(bytes: &[u8]) -> Option<Media> {
    let (media, body) = read_exr(bytes);
    let ExrBody { offset: table, rows_per_chunk } = body?;
    let chunks = media.height.div_ceil(rows_per_chunk) as usize;
    let mut next = table.checked_add(chunks.checked_mul(8)?)?;
    for chunk in 0..chunks {
        let offset = table + 8 * chunk;
        let offset = u64::from_le_bytes(bytes.get(offset..offset + 8)?.try_into().ok()?);
        if offset != next as u64 {
            return None;
        }
        // A chunk: number of its first row, length, pixels.
        next = next.checked_add(8)?.checked_add(le32(bytes, next + 4)? as usize)?;
    }
    (chunks > 0 && next == bytes.len()).then_some(media)
}

/// The content of the first box of a kind.
fn first_box<'a>(mut rest: &'a [u8], kind: &[u8; 4]) -> Option<&'a [u8]> {
    loop {
        let size = be32(rest, 0)? as usize;
        let content = rest.get(8..size)?;
        if rest.get(4..8)? == kind {
            return Some(content);
        }
        rest = rest.get(size.max(8)..)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readable_fields_of_truncated_or_corrupt_files_are_returned() {
        let png =
            b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x05\0\0\0\x07\x08\x02\0\0\0crc!\xff\xff\xff\xfftEXtab";
        let media = read(png).unwrap();
        assert_eq!((media.width, media.height, media.provenance.len()), (5, 7, 0));
        for cut in 0..png.len() {
            let _ = read(&png[..cut]);
        }
        let mp4 = b"\0\0\0\x10ftypisom\0\0\0\0\0\0\0\0moov\xff\xff\xff\xfftrak";
        assert_eq!(read(mp4).unwrap().width, 0);
        assert_eq!(read(b"glTF"), None);
        let gif = b"GIF89a\x05\0\x07\0\x80\0\0abcdef\x21\xff\x02xy\x01z\0\x21\xfe\x03a: \x01b\0,";
        let media = read(gif).unwrap();
        assert_eq!((media.width, media.height), (5, 7));
        assert_eq!(media.provenance, [("a".to_string(), "b".to_string())]);
        let y4m = b"YUV4MPEG2 W5 H7 F30:1 XCHOREO=12ab\nFRAME\n";
        let media = read(y4m).unwrap();
        assert_eq!((media.width, media.height, media.provenance[0].1.as_str()), (5, 7, "12ab"));
        for whole in [&gif[..], &y4m[..], &mp4[..]] {
            for at in 0..whole.len() {
                let _ = read(&whole[..at]);
                for byte in [0, 0x21, 0x7f, 0xff] {
                    let mut bent = whole.to_vec();
                    bent[at] = byte;
                    let _ = read(&bent);
                }
            }
        }
    }
}
