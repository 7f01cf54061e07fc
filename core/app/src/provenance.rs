//! How a picture or video was made: written into PNG and MP4 files, and read back by `choreo info`.

use crate::scene::Scene;
use choreo_render::DeviceInfo;
use choreo_stage::Settings;

/// As (keyword, text). Nothing here depends on which frames are made, when or where: the halves of a video equal the whole.
pub fn of(scene: &Scene, settings: &Settings, samples: u32, device: &DeviceInfo) -> Vec<(String, String)> {
    let hash = scene.stage.content_hash();
    let hex: String = hash[..16].iter().map(|b| format!("{b:02x}")).collect();
    let [w, h] = settings.size;
    let mut arguments = format!("--size {w}x{h} --fps {} --samples {samples}", fps(settings));
    for argument in &scene.arguments {
        arguments.push(' ');
        arguments.push_str(argument);
    }
    let entry = |k: &str, v: String| (k.to_string(), v);
    vec![
        entry("Software", format!("choreo {}", env!("CARGO_PKG_VERSION"))),
        entry("choreo:source", scene.name.clone()),
        entry("choreo:stage", hex),
        entry("choreo:arguments", arguments),
        entry("choreo:device", format!("{} ({})", device.name, device.driver)),
    ]
}

fn fps(settings: &Settings) -> String {
    match settings.fps.den {
        1 => settings.fps.num.to_string(),
        den => format!("{}/{den}", settings.fps.num),
    }
}

/// A picture or video, as far as its head tells.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Media {
    pub format: &'static str,
    pub width: u32,
    pub height: u32,
    pub provenance: Vec<(String, String)>,
}

/// `None` where the bytes are neither PNG nor MP4. Nothing is trusted: what does not fit is left out.
pub fn read(bytes: &[u8]) -> Option<Media> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Some(read_png(bytes.get(8..)?));
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
    let mut media = Media { format: "PNG picture", ..Media::default() };
    // length, type, data, checksum
    while let (Some(length), Some(kind)) = (be32(rest, 0), rest.get(4..8)) {
        let Some(data) = rest.get(8..8usize.saturating_add(length as usize)) else { break };
        match kind {
            b"IHDR" => {
                media.width = be32(data, 0).unwrap_or(0);
                media.height = be32(data, 4).unwrap_or(0);
            }
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

fn read_mp4(bytes: &[u8]) -> Media {
    let mut media = Media { format: "MP4 video", ..Media::default() };
    let Some(moov) = inner(bytes, b"moov") else { return media };
    let tkhd = inner(moov, b"trak").and_then(|t| inner(t, b"tkhd"));
    if let Some(tkhd) = tkhd
        && tkhd.len() >= 8
    {
        // The last two fields, as 16.16.
        media.width = be32(tkhd, tkhd.len() - 8).unwrap_or(0) >> 16;
        media.height = be32(tkhd, tkhd.len() - 4).unwrap_or(0) >> 16;
    }
    let ilst = inner(moov, b"udta").and_then(|u| inner(u, b"meta")).and_then(|m| inner(m.get(4..)?, b"ilst"));
    let data =
        ilst.and_then(|l| inner(l, b"\xa9cmt")).and_then(|c| inner(c, b"data")).and_then(|d| d.get(8..));
    for line in data.map(String::from_utf8_lossy).unwrap_or_default().lines() {
        if let Some((key, text)) = line.split_once(": ") {
            media.provenance.push((key.to_string(), text.to_string()));
        }
    }
    media
}

/// The content of the first box of a kind.
fn inner<'a>(mut rest: &'a [u8], kind: &[u8; 4]) -> Option<&'a [u8]> {
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
    fn cut_or_lying_files_give_what_is_there() {
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
    }
}
