//! The files: a GLB, or JSON with a separate buffer (glTF 2.0, §4.4).

use crate::buffer::Buffer;
use crate::document::Document;
use choreo_plugin::{ExportError, SceneFiles};
use serde_json::json;
use std::io::{BufWriter, Write};

/// Writes a single GLB file.
pub(crate) fn write_glb(
    mut document: Document,
    mut buffer: Buffer<'_>,
    files: &mut dyn SceneFiles,
) -> Result<(), ExportError> {
    let binary = buffer.length();
    if binary > 0 {
        document.buffers = vec![json!({ "byteLength": binary })];
    }
    let mut text = json_of(document, &mut buffer)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = if binary > 0 { 8 + binary } else { 0 };
    let total = u32::try_from(12 + 8 + text.len() as u64 + chunk).map_err(|_| {
        ExportError::Format("a .glb holds at most 4 GiB, and this scene has more; write a .gltf".into())
    })?;
    let mut out = BufWriter::with_capacity(1 << 16, files.main());
    let word = |out: &mut dyn Write, word: u32| out.write_all(&word.to_le_bytes());
    out.write_all(b"glTF")?;
    word(&mut out, 2)?;
    word(&mut out, total)?;
    word(&mut out, text.len() as u32)?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    drop(text);
    if binary > 0 {
        word(&mut out, binary as u32)?;
        out.write_all(b"BIN\0")?;
        buffer.write(&mut out)?;
    }
    Ok(out.flush()?)
}

/// Writes the JSON and a separate buffer file.
pub(crate) fn write_gltf(
    mut document: Document,
    mut buffer: Buffer<'_>,
    stem: &str,
    files: &mut dyn SceneFiles,
) -> Result<(), ExportError> {
    if buffer.length() > 0 {
        let uri = percent_encoded(&format!("{stem}.bin"));
        document.buffers = vec![json!({ "byteLength": buffer.length(), "uri": uri })];
        let mut out = BufWriter::with_capacity(1 << 16, files.beside(".bin")?);
        buffer.write(&mut out)?;
        out.flush()?;
    }
    let text = json_of(document, &mut buffer)?;
    Ok(files.main().write_all(&text)?)
}

fn json_of(mut document: Document, buffer: &mut Buffer<'_>) -> Result<Vec<u8>, ExportError> {
    document.accessors = std::mem::take(&mut buffer.accessors);
    document.buffer_views = std::mem::take(&mut buffer.views);
    serde_json::to_vec(&document).map_err(|e| ExportError::Format(format!("glTF: {e}")))
}

/// A file name as a percent-encoded relative reference (RFC 3986, §2).
pub(crate) fn percent_encoded(name: &str) -> String {
    let mut out = String::new();
    for byte in name.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => out.push(byte as char),
            other => out.push_str(&format!("%{other:02X}")),
        }
    }
    out
}
