//! GLB and JSON containers: splits the bytes and checks the outer structure (glTF 2.0 §4, GLB).

use crate::locate::element_at;
use crate::pointers::Pointers;
use crate::problem::{Problem, Result};
use crate::repair;
use gltf::json::Root;

pub(crate) const GLB_MAGIC: &[u8] = b"glTF";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
const CHUNK_JSON: u32 = 0x4E4F_534A;
const CHUNK_BIN: u32 = 0x004E_4942;

/// Limits of the JSON. A few bytes of it can become hundreds in memory: `{}` is a whole node.
pub(crate) const MAX_JSON_OBJECTS: usize = 2 << 20;
pub(crate) const MAX_JSON_VALUES: usize = 32 << 20;

pub(crate) struct Container<'a> {
    pub json: &'a [u8],
    /// Byte offset of the JSON in the file, for messages.
    pub json_offset: usize,
    pub bin: Option<&'a [u8]>,
    pub warnings: Vec<(String, String)>,
}

/// The JSON chunk of a GLB, or the part of it that exists; empty where the first chunk is not JSON.
pub(crate) fn json_chunk(glb: &[u8]) -> &[u8] {
    let word =
        |at: usize| glb.get(at..at + 4).and_then(|b| b.first_chunk::<4>()).map(|b| u32::from_le_bytes(*b));
    match (word(HEADER_BYTES), word(HEADER_BYTES + 4)) {
        (Some(length), Some(CHUNK_JSON)) => {
            let rest = &glb[HEADER_BYTES + CHUNK_HEADER_BYTES..];
            rest.get(..length as usize).unwrap_or(rest)
        }
        _ => &[],
    }
}

/// The JSON without a byte order mark, which some editors and exporters put before it.
pub(crate) fn without_byte_order_mark(json: &[u8]) -> &[u8] {
    json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json)
}

pub(crate) fn split(bytes: &[u8]) -> Result<Container<'_>> {
    if !bytes.starts_with(GLB_MAGIC) {
        let json = without_byte_order_mark(bytes);
        let json_offset = bytes.len() - json.len();
        return Ok(Container { json, json_offset, bin: None, warnings: Vec::new() });
    }
    let word = |at: usize| -> Result<u32> {
        bytes
            .get(at..at + 4)
            .and_then(|b| b.first_chunk::<4>())
            .map(|b| u32::from_le_bytes(*b))
            .ok_or_else(|| truncated(format!("byte {at}"), bytes.len(), at + 4))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(Problem::new("byte 4", format!("GLB version {version} is not supported, only 2"))
            .hint(repair::CONVERT_1));
    }
    let mut warnings = Vec::new();
    let total = word(8)? as usize;
    if total > bytes.len() {
        return Err(truncated("byte 8".into(), bytes.len(), total));
    }
    if total < bytes.len() {
        let extra = bytes.len() - total;
        warnings
            .push((format!("byte {total}"), format!("{extra} bytes after the end of the GLB are ignored")));
    }
    let (mut json, mut bin) = (None, None);
    let mut at = HEADER_BYTES;
    while at + CHUNK_HEADER_BYTES <= total {
        let length = word(at)? as usize;
        let kind = word(at + 4)?;
        let start = at + CHUNK_HEADER_BYTES;
        let Some(chunk) = bytes[..total].get(start..start.saturating_add(length)) else {
            return Err(Problem::new(
                format!("byte {at}"),
                format!("a chunk says it has {length} bytes, but only {} are left", total - start),
            )
            .hint("the file is damaged or was cut off; fetch or export it again"));
        };
        match kind {
            CHUNK_JSON if json.is_none() => {
                let text = without_byte_order_mark(chunk);
                json = Some((text, start + chunk.len() - text.len()));
            }
            CHUNK_BIN if bin.is_none() => bin = Some(chunk),
            _ => warnings
                .push((format!("byte {at}"), format!("chunk of unknown type {kind:#010x} is ignored"))),
        }
        // Chunks should be padded to 4 bytes, but many writers forget it, so only the length counts.
        at = start + length;
    }
    match json {
        Some((json, json_offset)) => Ok(Container { json, json_offset, bin, warnings }),
        None => Err(Problem::new(format!("byte {HEADER_BYTES}"), "the GLB has no JSON chunk")),
    }
}

fn truncated(place: String, have: usize, need: usize) -> Problem {
    Problem::new(place, format!("the GLB should have {need} bytes or more, but the file ends after {have}"))
        .hint("the file was cut off; fetch or export it again")
}

/// Parses the JSON into its typed form. Valid JSON that the typed form refuses is repaired and parsed again.
pub(crate) fn parse(container: &Container<'_>) -> Result<(Root, Pointers)> {
    let count = |letter: u8| container.json.iter().filter(|b| **b == letter).count();
    for (letters, limit, what) in
        [(&b"{"[..], MAX_JSON_OBJECTS, "objects"), (b",[", MAX_JSON_VALUES, "values")]
    {
        let found: usize = letters.iter().map(|l| count(*l)).sum();
        if found > limit {
            let what = format!("the JSON has about {found} {what}; the limit is {limit}");
            return Err(Problem::new(format!("byte {}", container.json_offset), what)
                .hint("split the file, or leave out what the scene does not need"));
        }
    }
    let error = match parse_root(container.json) {
        Ok(root) => return Ok((root, Pointers::new())),
        Err(e) => e,
    };
    if error.is_data()
        && let Ok(mut value) = serde_json::from_slice::<serde_json::Value>(container.json)
    {
        repair::refuse_version_1(&value)?;
        if let Some(pointers) = repair::repair(&mut value) {
            // Parsing text again makes the typed form report where an error lies.
            let text = value.to_string();
            let root = parse_root(text.as_bytes());
            return root.map(|root| (root, pointers)).map_err(|e| json_problem(text.as_bytes(), None, &e));
        }
    }
    Err(json_problem(container.json, Some(container.json_offset), &error))
}

/// Calls the parser that is compiled in the crate `gltf`: instantiating it here would cost half of this crate's build time.
fn parse_root(json: &[u8]) -> serde_json::Result<Root> {
    match gltf::Gltf::from_slice_without_validation(json) {
        Ok(gltf) => Ok(gltf.document.into_json()),
        Err(gltf::Error::Deserialize(e)) => Err(e),
        // The JSON begins with the GLB magic.
        Err(e) => Err(serde::de::Error::custom(e)),
    }
}

/// `start`: offset of the JSON in the file; `None` where a repair has changed the text.
fn json_problem(json: &[u8], start: Option<usize>, error: &serde_json::Error) -> Problem {
    let offset = byte_offset(json, error.line(), error.column());
    let element = element_at(json, offset);
    let byte = start.map(|start| format!("byte {}", start + offset));
    let place = match (element.is_empty(), byte) {
        (true, byte) => byte.unwrap_or_else(|| "JSON".into()),
        (false, Some(byte)) => format!("{element} ({byte})"),
        (false, None) => element,
    };
    // serde_json's text ends in " at line L column C", which the place states better.
    let full = error.to_string();
    let what = full.rsplit_once(" at line ").map_or(full.as_str(), |(w, _)| w);
    let problem = Problem::new(place, format!("not valid glTF JSON: {what}"));
    if error.is_eof() { problem.hint("the file was cut off; fetch or export it again") } else { problem }
}

fn byte_offset(json: &[u8], line: usize, column: usize) -> usize {
    let mut start = 0;
    for _ in 1..line {
        match json[start..].iter().position(|b| *b == b'\n') {
            Some(n) => start += n + 1,
            None => break,
        }
    }
    (start + column.saturating_sub(1)).min(json.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(json: &str, bin: &[u8]) -> Vec<u8> {
        let mut out = GLB_MAGIC.to_vec();
        let total = 12 + 8 + json.len() + 8 + bin.len();
        for word in [2, total as u32, json.len() as u32, CHUNK_JSON] {
            out.extend(word.to_le_bytes());
        }
        out.extend(json.as_bytes());
        out.extend((bin.len() as u32).to_le_bytes());
        out.extend(CHUNK_BIN.to_le_bytes());
        out.extend(bin);
        out
    }

    #[test]
    fn a_glb_is_split_into_json_and_binary_chunks() {
        let bytes = glb("{} ", &[1, 2, 3]);
        let c = split(&bytes).unwrap();
        assert_eq!((c.json, c.bin, c.json_offset), (&b"{} "[..], Some(&[1u8, 2, 3][..]), 20));
        assert!(c.warnings.is_empty());
    }

    #[test]
    fn wrong_chunk_lengths_are_errors() {
        let good = glb("{} ", &[1, 2, 3]);
        let patched = |at: usize, v: u32| {
            let mut b = good.clone();
            b[at..at + 4].copy_from_slice(&v.to_le_bytes());
            b
        };
        let text = |b: Vec<u8>| split(&b).err().map(|p| format!("{}: {}", p.place, p.what)).unwrap();
        assert_eq!(
            text(patched(8, 1000)),
            "byte 8: the GLB should have 1000 bytes or more, but the file ends after 34"
        );
        assert_eq!(
            text(patched(12, u32::MAX)),
            "byte 12: a chunk says it has 4294967295 bytes, but only 14 are left"
        );
        assert_eq!(text(patched(4, 1)), "byte 4: GLB version 1 is not supported, only 2");
        assert_eq!(
            text(good[..10].to_vec()),
            "byte 8: the GLB should have 12 bytes or more, but the file ends after 10"
        );
        let mut longer = good.clone();
        longer.extend([0; 7]);
        assert_eq!(split(&longer).unwrap().warnings.len(), 1);
    }

    #[test]
    fn json_errors_name_the_element() {
        let json =
            br#"{"asset":{"version":"2.0"},"accessors":[{"count":1,"componentType":5126,"type":"VEC3"},
            {"count":-5,"componentType":5126,"type":"VEC3"}]}"#;
        let p = parse(&split(json).unwrap()).unwrap_err();
        assert!(p.place.starts_with("accessors[1].count (byte "), "{p:?}");
        assert_eq!(p.what, "not valid glTF JSON: invalid value: integer `-5`, expected u64");
    }

    /// The same errors in a file that also needs a repair: messages still name the element.
    #[test]
    fn json_errors_after_a_repair_name_the_element() {
        let json =
            br#"{"asset":{"version":"2.0"},"scenes":[{}],"accessors":[{"count":1.0,"componentType":5126,"type":"VEC3"},
            {"count":1.5,"componentType":5126,"type":"VEC3"}]}"#;
        let p = parse(&split(json).unwrap()).unwrap_err();
        assert_eq!(p.place, "accessors[1].count");
        assert_eq!(p.what, "not valid glTF JSON: invalid type: floating point `1.5`, expected u64");
    }

    #[test]
    fn gltf_version_1_is_an_error_with_a_hint() {
        let json =
            br#"{"asset":{"version":"1.0"},"accessors":{"a_1":{"count":1}},"scenes":{"s":{"nodes":["n"]}}}"#;
        let p = parse(&split(json).unwrap()).unwrap_err();
        assert_eq!(
            (p.place.as_str(), p.what.as_str()),
            ("asset.version", "glTF 1.0 is not supported, only 2.0")
        );
        assert_eq!(p.hint.as_deref(), Some(repair::CONVERT_1));
    }

    #[test]
    fn a_byte_order_mark_before_the_json_is_skipped() {
        let json = "\u{feff}{\"asset\":{\"version\":-5}}";
        let glb = |json: &[u8]| {
            let mut glb = GLB_MAGIC.to_vec();
            for word in [2, 20 + json.len() as u32, json.len() as u32, CHUNK_JSON] {
                glb.extend(word.to_le_bytes());
            }
            glb.extend(json);
            glb
        };
        for (bytes, at) in [(json.as_bytes().to_vec(), 3), (glb(json.as_bytes()), 23)] {
            let container = split(&bytes).unwrap();
            assert!(container.json.starts_with(b"{"));
            assert_eq!(container.json_offset, at);
        }
    }

    #[test]
    fn pointer_channels_are_read() {
        let json = br#"{"asset":{"version":"2.0"},"animations":[{"samplers":[{"input":0,"output":1}],"channels":[
            {"sampler":0,"target":{"node":0,"path":"scale"}},
            {"sampler":0,"target":{"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/x"}}}}]}],
            "meshes":[{"primitives":[],"extras":{"targetNames":["a"]}}]}"#;
        let (root, pointers) = parse(&split(json).unwrap()).unwrap();
        assert_eq!(root.animations[0].channels.len(), 2);
        assert_eq!(pointers.get(&(0, 1)).map(String::as_str), Some("/x"));
        assert!(root.meshes[0].extras.is_some());
    }
}
