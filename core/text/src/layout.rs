//! Layout: words to lines.

use crate::coverage::{Coverage, Outline};
use crate::font::{Font, kerning};
use ttf_parser::{Face, GlyphId};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Size of the font's em.
    pub size: f32,
    /// Width at which lines are broken between words.
    pub width: Option<f32>,
    pub align: Align,
    /// Distance between baselines, in font sizes.
    pub line_height: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Align {
    Left,
    #[default]
    Center,
    Right,
}

/// Placed glyphs in a box whose top left is the origin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laid {
    pub size: [f32; 2],
    /// Glyph, and the position of its origin on the baseline.
    glyphs: Vec<(u16, [f32; 2])>,
    scale: f32,
    pub lines: usize,
}

/// A run of glyphs without a line break opportunity; widths in pixels.
struct Word {
    glyphs: Vec<(u16, f32)>,
    width: f32,
    /// Width of the space after it.
    space: f32,
}

pub fn lay_out(font: &Font, text: &str, style: &Style) -> Laid {
    let face = font.face();
    let scale = style.size / f32::from(face.units_per_em().max(1));
    let mut lines: Vec<(Vec<Word>, f32)> = Vec::new();
    for paragraph in text.split('\n') {
        let words: Vec<Word> = paragraph.split(' ').map(|w| word(&face, w, scale)).collect();
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
    let (up, down) = (f32::from(face.ascender()) * scale, f32::from(face.descender()) * scale);
    let step = style.size * style.line_height;
    let mut laid = Laid { scale, lines: lines.len(), ..Laid::default() };
    for (row, (words, width)) in lines.iter().enumerate() {
        let mut x = match style.align {
            Align::Left => 0.0,
            Align::Center => (box_width - width) * 0.5,
            Align::Right => box_width - width,
        };
        let y = up + step * row as f32;
        for word in words {
            laid.glyphs.extend(word.glyphs.iter().map(|(glyph, at)| (*glyph, [x + at, y])));
            x += word.width + word.space;
        }
    }
    laid.size = [box_width, up - down + step * (lines.len() - 1) as f32];
    laid
}

fn word(face: &Face, text: &str, scale: f32) -> Word {
    let advance = |g: GlyphId| f32::from(face.glyph_hor_advance(g).unwrap_or(0)) * scale;
    let mut glyphs = Vec::new();
    let (mut x, mut before) = (0.0, None);
    for c in text.chars().filter(|c| !c.is_control()) {
        // Glyph 0 is the font's sign for what it lacks.
        let glyph = face.glyph_index(c).unwrap_or(GlyphId(0));
        if let Some(before) = before {
            x += kerning(face, before, glyph) * scale;
        }
        glyphs.push((glyph.0, x));
        x += advance(glyph);
        before = Some(glyph);
    }
    let space = face.glyph_index(' ').map_or(0.0, advance);
    Word { glyphs, width: x, space }
}

impl Laid {
    /// Coverage of all glyphs in an image of a size, with the box's top left at a position, scaled by a factor.
    pub fn coverage(&self, font: &Font, at: [f32; 2], factor: f32, picture: [u32; 2]) -> Coverage {
        let face = font.face();
        let scale = self.scale * factor;
        let size = self.size.map(|s| s * factor);
        // Accents and slanted letters reach over the box.
        let over = (size[1].max(1.0) * 0.25).ceil();
        let mut coverage = Coverage::new(
            [at[0] - over, at[1] - over],
            [at[0] + size[0] + over, at[1] + size[1] + over],
            picture,
        );
        for (glyph, [x, y]) in &self.glyphs {
            let origin = [at[0] + x * factor, at[1] + y * factor];
            let mut outline = Outline::new(&mut coverage, origin, scale);
            face.outline_glyph(GlyphId(*glyph), &mut outline);
        }
        coverage
    }
}
