//! ASCII STL: `solid`, `facet normal`, `outer loop`, `vertex`, in any letter case and with any spaces.

use crate::Solid;
use choreo_importer_kit::text::{Lines, next_number, next_word, shown};
use choreo_importer_kit::{Notes, Problem, Progress, Result, WithPlace};
use glam::Vec3;

/// Every solid becomes a node; the limit bounds the memory of empty ones.
const MAX_SOLIDS: usize = 65_536;

/// Reads the file. Without `geometry`, only the solids and their names.
pub(crate) fn read(
    bytes: &[u8],
    geometry: bool,
    progress: &Progress<'_>,
    notes: &Notes,
) -> Result<Vec<Solid>> {
    let mut reader = Reader { notes, solids: Vec::new(), in_solid: false, facet: None, vertices: Vec::new() };
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let mut last = 1;
    let mut lines = Lines::new(text);
    while let Some((line, text)) = lines.next() {
        last = line;
        progress.reach(bytes.len() - lines.left())?;
        let mut rest = text;
        let Some(word) = next_word(&mut rest) else { continue };
        let keyword = Keyword::of(word);
        if geometry || matches!(keyword, Some(Keyword::Solid | Keyword::EndSolid)) {
            reader.line(line, (keyword, word), rest)?;
        }
    }
    let cut = "the file was cut off; export or copy it again";
    if let Some(facet) = &reader.facet {
        let what = format!("the file ends within the facet of line {}", facet.line);
        return Err(Problem::new(format!("line {last}"), what).hint(cut));
    }
    if reader.solids.is_empty() {
        return Err(Problem::new("line 1", "there is no solid").hint(cut));
    }
    if reader.in_solid {
        notes.warn(format!("line {last}"), "the last solid has no endsolid; the file may be cut off");
    }
    Ok(reader.solids)
}

#[derive(Clone, Copy)]
enum Keyword {
    Solid,
    EndSolid,
    Facet,
    EndFacet,
    /// `outer`, `endloop`.
    Loop,
    Vertex,
}

impl Keyword {
    #[inline]
    fn of(word: &[u8]) -> Option<Keyword> {
        // Most frequent keywords first.
        let known = [
            (&b"vertex"[..], Keyword::Vertex),
            (b"facet", Keyword::Facet),
            (b"outer", Keyword::Loop),
            (b"endloop", Keyword::Loop),
            (b"endfacet", Keyword::EndFacet),
            (b"solid", Keyword::Solid),
            (b"endsolid", Keyword::EndSolid),
        ];
        known.iter().find(|(name, _)| word.eq_ignore_ascii_case(name)).map(|(_, keyword)| *keyword)
    }
}

struct Facet {
    line: usize,
    normal: Vec3,
}

struct Reader<'a> {
    notes: &'a Notes,
    solids: Vec<Solid>,
    in_solid: bool,
    facet: Option<Facet>,
    /// Vertices of the open facet.
    vertices: Vec<Vec3>,
}

impl Reader<'_> {
    #[inline]
    fn line(
        &mut self,
        line: usize,
        (keyword, word): (Option<Keyword>, &[u8]),
        mut rest: &[u8],
    ) -> Result<()> {
        let place = || format!("line {line}");
        let problem = |what: String| Problem::new(place(), what);
        match keyword {
            Some(Keyword::Vertex) => {
                let vertex = vector(&mut rest).at(place)?;
                if self.facet.is_none() {
                    return Err(problem("a vertex outside of a facet".into()));
                }
                self.vertices.push(vertex);
            }
            Some(Keyword::Facet) => {
                if let Some(open) = &self.facet {
                    return Err(problem(format!("a facet within the facet of line {}", open.line)));
                }
                if !self.in_solid {
                    return Err(problem("a facet outside of a solid".into()));
                }
                let _normal = next_word(&mut rest);
                // Some programs write "nan" for triangles without area; the normal is not needed, because the vertices give it.
                let normal = vector(&mut rest).unwrap_or(Vec3::ZERO);
                self.facet = Some(Facet { line, normal });
                self.vertices.clear();
            }
            Some(Keyword::EndFacet) => {
                let Some(facet) = self.facet.take() else {
                    return Err(problem("endfacet without a facet".into()));
                };
                self.end_facet(facet).at(place)?;
            }
            Some(Keyword::Solid) => {
                if self.in_solid {
                    self.notes.warn(format!("line {line}"), "a solid begins before the last one has ended");
                }
                if self.solids.len() == MAX_SOLIDS {
                    return Err(problem(format!("more than {MAX_SOLIDS} solids, which is the limit")));
                }
                let name = String::from_utf8_lossy(rest.trim_ascii()).into_owned();
                self.solids.push(Solid { name, ..Solid::default() });
                self.in_solid = true;
            }
            Some(Keyword::EndSolid) => self.in_solid = false,
            Some(Keyword::Loop) => {}
            None => {
                let what = format!("\"{}\" is not an STL keyword", shown(&word.to_ascii_lowercase()));
                return Err(problem(what)
                    .hint("lines begin with solid, facet, outer, vertex, endloop, endfacet or endsolid"));
            }
        }
        Ok(())
    }

    fn end_facet(&mut self, facet: Facet) -> Result<()> {
        let vertices = self.vertices.as_slice();
        if vertices.len() < 3 {
            let what = format!("the facet of line {} has {} vertices, not 3", facet.line, vertices.len());
            return Err(what.into());
        }
        if vertices.len() > 3 {
            let text =
                format!("the facet has {} vertices; it is cut into triangles from its first", vertices.len());
            self.notes.warn(format!("line {}", facet.line), text);
        }
        // A facet only opens within a solid, so there is one.
        let Some(solid) = self.solids.last_mut() else { return Err("a facet outside of a solid".into()) };
        for pair in vertices[1..].windows(2) {
            solid.positions.extend([vertices[0], pair[0], pair[1]]);
            solid.normals.push(facet.normal);
        }
        Ok(())
    }
}

#[inline]
fn vector(rest: &mut &[u8]) -> Result<Vec3> {
    let mut values = [0.0f32; 3];
    for value in &mut values {
        let from = *rest;
        let read = next_number(rest).ok_or("there should be three numbers")?;
        *value = read.ok().map(|v| v as f32).filter(|v| v.is_finite()).ok_or_else(|| {
            let word = &from[..from.len() - rest.len()];
            format!("\"{}\" is not a finite number", shown(word.trim_ascii()))
        })?;
    }
    Ok(Vec3::from(values))
}
