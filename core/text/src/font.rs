//! A font file, parsed and checked once.

use std::fmt;
use std::sync::{Arc, OnceLock};
use ttf_parser::gpos::{PairAdjustment, PositioningSubtable};
use ttf_parser::{Face, GlyphId};

#[derive(Clone)]
pub struct Font {
    pub name: String,
    bytes: Arc<[u8]>,
    hash: [u8; 32],
}

/// Why a file is not a font, in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FontError(pub String);

impl fmt::Display for FontError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl fmt::Debug for Font {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Font({:?}, {} bytes)", self.name, self.bytes.len())
    }
}

impl PartialEq for Font {
    fn eq(&self, other: &Font) -> bool {
        self.hash == other.hash
    }
}

impl Font {
    /// Reads a TrueType (`.ttf`) or OpenType (`.otf`) file, or the first font of a collection.
    pub fn new(name: &str, bytes: impl Into<Arc<[u8]>>) -> Result<Font, FontError> {
        let bytes = bytes.into();
        let face = Face::parse(&bytes, 0).map_err(|e| FontError(format!("is not a font: {e}")))?;
        if face.tables().glyf.is_none() && face.tables().cff.is_none() {
            return Err(FontError(
                "has no outlines (bitmap and variable CFF2 fonts are not supported)".into(),
            ));
        }
        let hash = *blake3::hash(&bytes).as_bytes();
        Ok(Font { name: name.into(), bytes, hash })
    }

    /// The built-in font, Ubuntu Light.
    pub fn built_in() -> Font {
        static BUILT_IN: OnceLock<Font> = OnceLock::new();
        let parse = || {
            Font::new("Ubuntu Light", epaint_default_fonts::UBUNTU_LIGHT).expect("the built-in font is valid")
        };
        BUILT_IN.get_or_init(parse).clone()
    }

    pub fn hash(&self) -> [u8; 32] {
        self.hash
    }

    pub(crate) fn face(&self) -> Face<'_> {
        Face::parse(&self.bytes, 0).expect("the font was parsed when it was created")
    }

    /// Characters of a text that the font has no glyph for, each once, in order.
    pub fn missing(&self, text: &str) -> Vec<char> {
        let face = self.face();
        let mut out = Vec::new();
        for c in text.chars().filter(|c| !c.is_whitespace() && !c.is_control()) {
            if face.glyph_index(c).is_none() && !out.contains(&c) {
                out.push(c);
            }
        }
        out
    }
}

/// Kerning of two glyphs in font units, from the `kern` table if the font has one, else from GPOS pairs.
pub(crate) fn kerning(face: &Face, left: GlyphId, right: GlyphId) -> f32 {
    if let Some(kern) = face.tables().kern {
        let tables = kern.subtables.into_iter().filter(|t| t.horizontal && !t.variable);
        return tables.filter_map(|t| t.glyphs_kerning(left, right)).map(f32::from).sum();
    }
    let Some(gpos) = face.tables().gpos else { return 0.0 };
    let tag = ttf_parser::Tag::from_bytes(b"kern");
    let lookups = gpos.features.into_iter().filter(|f| f.tag == tag).flat_map(|f| f.lookup_indices);
    let mut seen: Vec<u16> = Vec::new();
    let mut sum = 0.0;
    for index in lookups {
        if seen.contains(&index) {
            continue;
        }
        seen.push(index);
        let Some(lookup) = gpos.lookups.get(index) else { continue };
        let pairs = lookup.subtables.into_iter::<PositioningSubtable>().filter_map(|s| match s {
            PositioningSubtable::Pair(pair) => Some(pair),
            _ => None,
        });
        // The first table that knows the left glyph decides.
        let advance = pairs.into_iter().find_map(|pair| {
            pair.coverage().get(left)?;
            match pair {
                PairAdjustment::Format1 { coverage, sets } => {
                    let set = sets.get(coverage.get(left)?)?;
                    set.get(right).map(|(first, _)| first.x_advance)
                }
                PairAdjustment::Format2 { classes, matrix, .. } => {
                    let class = (classes.0.get(left), classes.1.get(right));
                    matrix.get(class).map(|(first, _)| first.x_advance)
                }
            }
        });
        sum += advance.map_or(0.0, f32::from);
    }
    sum
}
