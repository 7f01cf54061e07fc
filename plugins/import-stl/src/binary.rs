//! Binary STL: a header of 80 bytes, a count, and 50 bytes for each triangle.

use crate::Solid;
use choreo_importer_kit::text::count as counted;
use choreo_importer_kit::{Notes, Problem, Progress, Result};
use glam::Vec3;

const HEADER: usize = 80;
const TRIANGLE: usize = 50;

/// The number of triangles in the header; `None` where the file is too short to have one.
pub(crate) fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(HEADER..HEADER + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
}

pub(crate) fn size(triangles: u32) -> u64 {
    (HEADER + 4) as u64 + TRIANGLE as u64 * u64::from(triangles)
}

pub(crate) fn read(bytes: &[u8], progress: &Progress<'_>, notes: &Notes) -> Result<Solid> {
    let Some(count) = announced(bytes) else {
        let what = format!("the file has {} bytes; a binary STL has at least {}", bytes.len(), HEADER + 4);
        return Err(Problem::new("byte 0", what)
            .hint("this is neither a binary STL nor an ASCII one, which begins with \"solid\""));
    };
    let wanted = size(count);
    if wanted > bytes.len() as u64 {
        let room = (bytes.len() - HEADER - 4) / TRIANGLE;
        let what = format!("{count} triangles are announced, but the file has room for {room}");
        return Err(Problem::new(format!("byte {HEADER}"), what)
            .hint("the file was cut off, or is no STL; export or copy it again"));
    }
    if wanted < bytes.len() as u64 {
        let what = format!(
            "{} bytes follow the {count} announced triangles; they are left out",
            bytes.len() as u64 - wanted
        );
        notes.warn(format!("byte {wanted}"), what);
    }
    let body = &bytes[HEADER + 4..wanted as usize];
    let mut solid = Solid { name: name(&bytes[..HEADER]), ..Solid::default() };
    solid.positions.reserve_exact(count as usize * 3);
    solid.normals.reserve_exact(count as usize);
    for (index, triangle) in body.chunks_exact(TRIANGLE).enumerate() {
        progress.reach(HEADER + 4 + index * TRIANGLE)?;
        let vector = |at: usize| {
            // Chunks of 50 bytes make these indices safe.
            let float = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|b| triangle[at + i * 4 + b]));
            Vec3::new(float(0), float(1), float(2))
        };
        let vertices = [vector(12), vector(24), vector(36)];
        if let Some(vertex) = vertices.iter().position(|c| !c.is_finite()) {
            let at = HEADER + 4 + index * TRIANGLE + 12 + vertex * 12;
            let what = format!(
                "vertex {vertex} of triangle {index} is {}; only finite numbers are allowed",
                vertices[vertex]
            );
            return Err(Problem::new(format!("byte {at}"), what));
        }
        solid.positions.extend(vertices);
        let normal = vector(0);
        solid.normals.push(if normal.is_finite() { normal } else { Vec3::ZERO });
    }
    colors(&bytes[..HEADER], body, &mut solid, notes);
    Ok(solid)
}

/// The header up to its first zero byte, where that is a line of text.
fn name(header: &[u8]) -> String {
    let text = &header[..header.iter().position(|b| *b == 0).unwrap_or(header.len())];
    match std::str::from_utf8(text) {
        Ok(text) if text.chars().all(|c| !c.is_control()) => text.trim().to_string(),
        _ => String::new(),
    }
}

/// Two conventions store five bits a channel in the attribute bytes. Materialise Magics, marked by `COLOR=` in the header, has
/// red lowest, and bit 15 selects the header's color. VisCAM and SolidView have blue lowest, and bit 15 marks a valid color.
fn colors(header: &[u8], body: &[u8], solid: &mut Solid, notes: &Notes) {
    let attributes = || body.chunks_exact(TRIANGLE).map(|t| u16::from_le_bytes([t[48], t[49]]));
    let channel = |word: u16, shift: u16| ((u32::from(word >> shift) & 31) * 255 / 31) as u8;
    let key = b"COLOR=";
    if let Some(at) = header.windows(key.len()).position(|w| w == key)
        && let Some([r, g, b, _]) = header.get(at + key.len()..at + key.len() + 4)
    {
        let of_header = [*r, *g, *b];
        solid.colors = attributes()
            .map(|w| if w >> 15 == 1 { of_header } else { [channel(w, 0), channel(w, 5), channel(w, 10)] })
            .collect();
        notes.warn(
            "byte 0",
            "the header has COLOR=, so the facets' colors are read as Materialise Magics writes them",
        );
        return;
    }
    let colored = attributes().filter(|w| w >> 15 == 1).count();
    if colored > 0 {
        let white = [255; 3];
        solid.colors = attributes()
            .map(|w| if w >> 15 == 1 { [channel(w, 10), channel(w, 5), channel(w, 0)] } else { white })
            .collect();
        let what = format!(
            "{} with a color in the attribute bytes, read as VisCAM and SolidView write it",
            counted(colored, "facet")
        );
        notes.warn("byte 80", what);
    } else if attributes().any(|w| w != 0) {
        notes.warn("byte 80", "the facets' attribute bytes are in no known color format; they are left out");
    }
}
