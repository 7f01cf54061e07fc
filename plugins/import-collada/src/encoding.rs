//! Decodes an XML file: UTF-8, UTF-16 recognized by its byte order mark or first bytes, and Latin-1 where the file declares it.

use choreo_importer_kit::{Problem, Result};
use std::borrow::Cow;

pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>> {
    match bytes {
        [0xEF, 0xBB, 0xBF, rest @ ..] => utf8(rest, 3),
        [0xFF, 0xFE, rest @ ..] => utf16(rest, u16::from_le_bytes).map(Cow::Owned),
        [0xFE, 0xFF, rest @ ..] => utf16(rest, u16::from_be_bytes).map(Cow::Owned),
        [b'<', 0, ..] => utf16(bytes, u16::from_le_bytes).map(Cow::Owned),
        [0, b'<', ..] => utf16(bytes, u16::from_be_bytes).map(Cow::Owned),
        _ => utf8(bytes, 0),
    }
}

fn utf8(bytes: &[u8], mark: usize) -> Result<Cow<'_, str>> {
    std::str::from_utf8(bytes).map(Cow::Borrowed).or_else(|e| {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
        let declaration = head.split("?>").next().unwrap_or_default();
        // Latin-1 equals the first 256 code points of Unicode. Windows-1252 differs only in a few signs, never in digits.
        if ["iso-8859-1", "latin1", "windows-1252"].iter().any(|n| declaration.contains(n)) {
            return Ok(Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()));
        }
        let at = e.valid_up_to();
        Err(Problem::new(format!("byte {}", mark + at), format!("0x{:02x} is not UTF-8", bytes[at]))
            .hint("save the file as UTF-8; the file may be damaged"))
    })
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units).collect::<std::result::Result<String, _>>().map_err(|e| {
        let what = format!("the UTF-16 text has the unpaired surrogate {:04x}", e.unpaired_surrogate());
        Problem::new("byte 0", what).hint("save the file as UTF-8; the file may be damaged")
    })
}
