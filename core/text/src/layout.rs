//! Text layout: line breaking, alignment and kerning.

use crate::coverage::{Coverage, OutlineFlattener};
use crate::fallback::fallbacks;
use crate::font::{Font, kerning};
use ttf_parser::{Face, GlyphId};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Font size: height of the em square, pixels.
    pub size: f32,
    /// Width in pixels at which lines are broken between words; `None` breaks only at `\n`.
    pub width: Option<f32>,
    pub align: Align,
    /// Distance between baselines, as a multiple of `size`.
    pub line_height: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Align {
    Left,
    #[default]
    Center,
    Right,
}

/// Placed glyphs in a box whose top left is the origin; lengths in pixels, y down.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TextLayout {
    pub size: [f32; 2],
    /// Glyphs with the positions of their origins on the baseline.
    glyphs: Vec<(Glyph, [f32; 2])>,
    size_of_em: f32,
    /// Fonts for characters that the text's own font lacks.
    fallbacks: Vec<Font>,
    pub lines: usize,
    /// Left and right end of the longest line, within the box.
    pub longest_line_ends: [f32; 2],
}

/// Index of the fallback font (`None`: the text's own font) and glyph ID.
type Glyph = (Option<u8>, u16);

/// The fonts of a text, parsed.
struct Faces<'f> {
    own: Face<'f>,
    /// Index of the fallback for a character that the own font lacks.
    index_of: Vec<(char, u8)>,
    fallbacks: Vec<Face<'f>>,
}

impl<'f> Faces<'f> {
    fn glyph(&self, c: char) -> Glyph {
        if let Some(glyph) = self.own.glyph_index(c) {
            return (None, glyph.0);
        }
        let index = self.index_of.iter().find(|(known, _)| *known == c).map(|(_, index)| *index);
        let of_fallback =
            index.and_then(|i| Some((Some(i), self.fallbacks[usize::from(i)].glyph_index(c)?.0)));
        // Glyph 0 (.notdef) stands for characters that a font lacks.
        of_fallback.unwrap_or((None, 0))
    }

    fn face_of(&self, font: Option<u8>) -> &Face<'f> {
        font.map_or(&self.own, |index| &self.fallbacks[usize::from(index)])
    }

    fn advance(&self, (font, glyph): Glyph, size: f32) -> f32 {
        let face = self.face_of(font);
        f32::from(face.glyph_hor_advance(GlyphId(glyph)).unwrap_or(0)) * scale(face, size)
    }

    /// Kerning in pixels; zero between glyphs of different fonts.
    fn kerning(&self, left: Glyph, right: Glyph, size: f32) -> f32 {
        if left.0 != right.0 {
            return 0.0;
        }
        let face = self.face_of(left.0);
        kerning(face, GlyphId(left.1), GlyphId(right.1)) * scale(face, size)
    }
}

/// Pixels per font unit.
fn scale(face: &Face, size: f32) -> f32 {
    size / f32::from(face.units_per_em().max(1))
}

/// Fallback fonts for the characters of a text that `font` lacks, each once, and the index of the fallback for each character.
fn fallbacks_of(font: &Font, text: &str) -> (Vec<Font>, Vec<(char, u8)>) {
    let (mut fonts, mut index_of) = (Vec::new(), Vec::new());
    let missing = font.missing(text);
    if missing.is_empty() {
        return (fonts, index_of);
    }
    for (c, found) in missing.iter().zip(fallbacks(&missing)) {
        let Some(fallback) = found else { continue };
        let known = fonts.iter().position(|font| *font == fallback.font);
        let index = known.unwrap_or_else(|| {
            fonts.push(fallback.font);
            fonts.len() - 1
        });
        index_of.extend(u8::try_from(index).ok().map(|index| (*c, index)));
    }
    (fonts, index_of)
}

/// A run of glyphs without a line break opportunity; widths in pixels.
struct Word {
    glyphs: Vec<(Glyph, f32)>,
    width: f32,
    /// Width of the space after the word.
    space: f32,
}

/// Places the glyphs of a text: line breaking, alignment and kerning.
pub fn lay_out_text(font: &Font, text: &str, style: &Style) -> TextLayout {
    let (fallbacks, index_of) = fallbacks_of(font, text);
    let faces = Faces { own: font.face(), index_of, fallbacks: fallbacks.iter().map(Font::face).collect() };
    let mut lines: Vec<(Vec<Word>, f32)> = Vec::new();
    for paragraph in text.split('\n') {
        let words: Vec<Word> = paragraph.split(' ').map(|w| shape_word(&faces, w, style.size)).collect();
        let (mut line, mut width) = (Vec::new(), 0.0f32);
        for word in words {
            let gap = line.last().map_or(0.0, |before: &Word| before.space);
            // A word wider than the box stands on a line of its own.
            if style.width.is_some_and(|most| !line.is_empty() && width + gap + word.width > most) {
                lines.push((std::mem::take(&mut line), width));
                width = word.width;
            } else {
                width += gap + word.width;
            }
            line.push(word);
        }
        lines.push((line, width));
    }
    let widest = lines.iter().map(|(_, width)| *width).fold(0.0, f32::max);
    let box_width = style.width.unwrap_or(widest).max(widest);
    let (face, scale) = (&faces.own, scale(&faces.own, style.size));
    let (up, down) = (f32::from(face.ascender()) * scale, f32::from(face.descender()) * scale);
    let step = style.size * style.line_height;
    let mut layout = TextLayout { size_of_em: style.size, lines: lines.len(), ..TextLayout::default() };
    let line_start = |width: f32| match style.align {
        Align::Left => 0.0,
        Align::Center => (box_width - width) * 0.5,
        Align::Right => box_width - width,
    };
    layout.longest_line_ends = [line_start(widest), line_start(widest) + widest];
    for (row, (words, width)) in lines.iter().enumerate() {
        let mut x = line_start(*width);
        let y = up + step * row as f32;
        for word in words {
            layout.glyphs.extend(word.glyphs.iter().map(|(glyph, at)| (*glyph, [x + at, y])));
            x += word.width + word.space;
        }
    }
    drop(faces);
    layout.fallbacks = fallbacks;
    layout.size = [box_width, up - down + step * (lines.len() - 1) as f32];
    layout
}

fn shape_word(faces: &Faces, text: &str, size: f32) -> Word {
    let mut glyphs = Vec::new();
    let (mut x, mut before) = (0.0, None);
    for c in text.chars().filter(|c| !c.is_control()) {
        let glyph = faces.glyph(c);
        if let Some(before) = before {
            x += faces.kerning(before, glyph, size);
        }
        glyphs.push((glyph, x));
        x += faces.advance(glyph, size);
        before = Some(glyph);
    }
    let space = faces.own.glyph_index(' ').map_or(0.0, |glyph| faces.advance((None, glyph.0), size));
    Word { glyphs, width: x, space }
}

impl TextLayout {
    /// Coverage of all glyphs in an image of size `image_size`, scaled by `factor`, with the box's top left at `at` (pixels).
    pub fn coverage(&self, font: &Font, at: [f32; 2], factor: f32, image_size: [u32; 2]) -> Coverage {
        let mut coverage = self.empty_coverage(at, factor, 0.0, image_size);
        self.add_edges(font, at, factor, &mut |a, b| coverage.add_edge(a, b));
        coverage
    }

    /// Coverage of all glyphs, dilated by `distance` pixels; otherwise like [`TextLayout::coverage`].
    pub fn outline_coverage(
        &self,
        font: &Font,
        at: [f32; 2],
        factor: f32,
        distance: f32,
        image_size: [u32; 2],
    ) -> Coverage {
        let mut coverage = self.empty_coverage(at, factor, distance.ceil() + 1.0, image_size);
        let mut edges = Vec::new();
        self.add_edges(font, at, factor, &mut |a, b| {
            coverage.add_edge(a, b);
            edges.push([a, b]);
        });
        coverage.dilated(&edges, distance)
    }

    /// Zero coverage with room for all glyphs and a margin in pixels.
    fn empty_coverage(&self, at: [f32; 2], factor: f32, margin: f32, image_size: [u32; 2]) -> Coverage {
        let size = self.size.map(|s| s * factor);
        // Accents and slanted letters reach over the box.
        let over = (size[1].max(1.0) * 0.25).ceil() + margin;
        Coverage::new(
            [at[0] - over, at[1] - over],
            [at[0] + size[0] + over, at[1] + size[1] + over],
            image_size,
        )
    }

    fn add_edges(&self, font: &Font, at: [f32; 2], factor: f32, add: &mut dyn FnMut([f32; 2], [f32; 2])) {
        let faces: Vec<Face> = std::iter::once(font).chain(&self.fallbacks).map(Font::face).collect();
        for ((font, glyph), [x, y]) in &self.glyphs {
            let face = &faces[font.map_or(0, |index| usize::from(index) + 1)];
            let origin = [at[0] + x * factor, at[1] + y * factor];
            let mut outline = OutlineFlattener::new(add, origin, scale(face, self.size_of_em) * factor);
            face.outline_glyph(GlyphId(*glyph), &mut outline);
        }
    }
}
