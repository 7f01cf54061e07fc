//! Parser of OBJ files. `tobj` reads vertices and faces; this module checks the lines first, and reads what `tobj` ignores.
//!
//! Each checked line is passed on in a form from which `tobj` loses nothing; README.md lists what it would lose otherwise.

use choreo_importer_kit::text::{self, Lines, integer, next_word, number, shown};
use choreo_importer_kit::{Budget, Notes, Problem, Progress, Result, WithPlace};
use glam::{DVec3, Vec2, Vec3};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::Write;

/// Limits of groups, which become nodes, and materials, which are tested for every primitive: they bound the memory of empty
/// ones.
const MAX_GROUPS: usize = 65_536;
const MAX_MATERIALS: usize = 65_536;
/// Material index of elements before any `usemtl`.
pub(crate) const NO_INDEX: u32 = u32::MAX;
/// First entry of each list in the text for `tobj`: face vertices without texture coordinate or normal refer to it.
const DEFAULT_ENTRIES: &[u8] = b"v 0 0 0 1 1 1\nvt nan nan\nvn nan nan nan";
/// Names of the lists that a face vertex refers to.
const LIST_NAMES: [&str; 3] = ["vertex", "texture coordinate", "normal"];
/// Memory of a face vertex, bytes: in `tobj`'s faces and vertex table, then in the primitives.
const FACE_VERTEX_BYTES: usize = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Shape {
    Face,
    Line,
    Point,
}

/// A face, line or set of points. Its face vertices begin at `start` and end where those of the next element begin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    pub start: u32,
    pub shape: Shape,
    pub group: u32,
    /// Index into `materials`; `NO_INDEX` before the first `usemtl`.
    pub material: u32,
    /// Smoothing group; 0 = flat.
    pub smoothing: u32,
    pub line: u32,
}

#[derive(Debug, Default)]
pub(crate) struct Model {
    /// One common index for position, texture coordinate, normal and color of each face vertex.
    mesh: tobj::Mesh,
    /// Number of vertices in the file, used or not.
    pub positions: usize,
    /// Whether any vertex has a color.
    pub has_colors: bool,
    pub elements: Vec<Element>,
    pub groups: Vec<String>,
    /// Material names in the order of their first use, with the line of it.
    pub materials: Vec<(String, usize)>,
    /// Arguments of `mtllib`, with their lines.
    pub libraries: Vec<(String, usize)>,
    /// Whether the file has any `s` line.
    pub has_smoothing: bool,
    /// The first comment of the file.
    pub comment: String,
}

impl Model {
    /// Number of vertices with distinct positions, texture coordinates or normals.
    pub(crate) fn vertex_count(&self) -> usize {
        self.mesh.positions.len() / 3
    }

    /// Vertices of an element.
    pub(crate) fn face_vertices(&self, element: usize) -> &[u32] {
        let start = self.elements[element].start as usize;
        let end = self.elements.get(element + 1).map_or(self.mesh.indices.len(), |e| e.start as usize);
        &self.mesh.indices[start..end]
    }

    pub(crate) fn position(&self, vertex: u32) -> DVec3 {
        DVec3::from_slice(&self.mesh.positions[3 * vertex as usize..])
    }

    pub(crate) fn uv(&self, vertex: u32) -> Option<Vec2> {
        let uv = &self.mesh.texcoords[2 * vertex as usize..];
        (!uv[0].is_nan()).then(|| Vec2::new(uv[0] as f32, uv[1] as f32))
    }

    pub(crate) fn normal(&self, vertex: u32) -> Option<Vec3> {
        let normal = DVec3::from_slice(&self.mesh.normals[3 * vertex as usize..]);
        (!normal.is_nan()).then(|| normal.as_vec3())
    }

    /// The color as stored; white where the file has no colors.
    pub(crate) fn color(&self, vertex: u32) -> Vec3 {
        match self.has_colors {
            true => DVec3::from_slice(&self.mesh.vertex_color[3 * vertex as usize..]).as_vec3(),
            false => Vec3::ONE,
        }
    }
}

/// Reads the file. Without `geometry`, only the names.
pub(crate) fn read(
    bytes: &[u8],
    geometry: bool,
    progress: &Progress<'_>,
    budget: &Budget,
    notes: &Notes,
) -> Result<Model> {
    let mut parser = Parser {
        notes,
        model: Model::default(),
        text: DEFAULT_ENTRIES.to_vec(),
        counts: [0; 3],
        face_vertices: 0,
        ahead: Vec::new(),
        geometry,
        object: String::new(),
        pending: Some(String::new()),
        group: NO_INDEX,
        material: NO_INDEX,
        smoothing: 0,
        group_of: HashMap::new(),
        material_of: HashMap::new(),
        unknown: BTreeMap::new(),
        short: Vec::new(),
    };
    let mut lines = Lines::new(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes));
    while let Some((line, text)) = lines.next() {
        // Two thirds of the progress: turning the data into meshes takes about half as long again.
        progress.reach((bytes.len() - lines.left()) / 3 * 2)?;
        let mut text = Cow::Borrowed(text);
        // A backslash at the end of a line continues it.
        while text.trim_ascii_end().ends_with(b"\\") {
            let length = text.trim_ascii_end().len() - 1;
            let owned = text.to_mut();
            owned.truncate(length);
            owned.push(b' ');
            match lines.next() {
                Some((_, more)) => owned.extend(more),
                None => break,
            }
        }
        parser.line(line, &text)?;
    }
    parser.finish(budget)
}

struct Parser<'a> {
    notes: &'a Notes,
    model: Model,
    /// Normalized text for `tobj`.
    text: Vec<u8>,
    /// Number of positions, texture coordinates and normals so far.
    counts: [usize; 3],
    face_vertices: usize,
    /// References to entries that are not read yet (line, list, index): faces may stand before their vertices.
    ahead: Vec<(usize, usize, u32)>,
    geometry: bool,
    object: String,
    /// The group that begins with the next element, because names without faces make no nodes.
    pending: Option<String>,
    group: u32,
    material: u32,
    smoothing: u32,
    /// (object, group) → index. Only used for lookups, so its random order does not matter.
    group_of: HashMap<(String, String), u32>,
    material_of: HashMap<String, u32>,
    /// Ignored keywords: first line, count.
    unknown: BTreeMap<String, (usize, usize)>,
    /// Lines of elements with too few face vertices.
    short: Vec<usize>,
}

impl Parser<'_> {
    fn line(&mut self, line: usize, text: &[u8]) -> Result<()> {
        let mut rest = text;
        let Some(keyword) = next_word(&mut rest) else { return Ok(()) };
        match keyword {
            b"v" if self.geometry => self.position(rest).at(|| place(line))?,
            b"vt" if self.geometry => self.numbers(1, [1, 2], rest).at(|| place(line))?,
            b"vn" if self.geometry => self.numbers(2, [3, 3], rest).at(|| place(line))?,
            b"f" | b"fo" if self.geometry => self.element(line, rest, Shape::Face)?,
            b"l" if self.geometry => self.element(line, rest, Shape::Line)?,
            b"p" if self.geometry => self.element(line, rest, Shape::Point)?,
            b"f" | b"fo" | b"l" | b"p" => self.enter(line)?,
            b"v" | b"vt" | b"vn" => {}
            b"o" => {
                self.object = text_of(rest);
                self.pending = Some(String::new());
            }
            b"g" => self.pending = Some(text_of(rest)),
            b"s" => {
                let word = next_word(&mut rest).unwrap_or(b"off");
                self.smoothing = match integer(word).and_then(|n| u32::try_from(n).ok()) {
                    Some(group) => group,
                    None => u32::from(word == b"on"),
                };
                self.model.has_smoothing = true;
            }
            b"usemtl" => self.material = self.use_material(line, text_of(rest))?,
            b"mtllib" => self.model.libraries.push((text_of(rest), line)),
            _ if keyword.starts_with(b"#") => {
                if self.model.comment.is_empty() {
                    self.model.comment = text_of(text).trim_start_matches(['#', ' ', '\t']).to_string();
                }
            }
            _ => self.unknown.entry(shown(keyword)).or_insert((line, 0)).1 += 1,
        }
        Ok(())
    }

    /// Reads a line of one of the lists: up to `most` numbers, of which the first `least` are required.
    fn numbers(&mut self, list: usize, [least, most]: [usize; 2], mut rest: &[u8]) -> Result<()> {
        self.text.extend(["\nv", "\nvt", "\nvn"][list].as_bytes());
        for index in 0..most {
            let word = next_word(&mut rest).or((index >= least).then_some(b"0"));
            self.number(word.ok_or_else(|| format!("has {index} numbers, but needs {least}"))?)?;
        }
        self.counts[list] += 1;
        Ok(())
    }

    fn number(&mut self, word: &[u8]) -> Result<f64> {
        self.text.push(b' ');
        self.text.extend(word);
        finite(word)
    }

    /// Reads `x y z`, optionally followed by `w`, `r g b`, or both.
    fn position(&mut self, rest: &[u8]) -> Result<()> {
        self.numbers(0, [3, 3], rest)?;
        let more: Vec<&[u8]> = text::words(rest).skip(3).take(4).collect();
        let values = more.iter().map(|word| finite(word)).collect::<Result<Vec<f64>>>()?;
        let color = match more[..] {
            // Seven numbers are x y z w r g b or x y z r g b a: w and a are 1 in all known files.
            [_, r, g, b] if values[0] == 1.0 && values[3] != 1.0 => [r, g, b],
            [r, g, b] | [r, g, b, _] => [r, g, b],
            _ => [&b"1"[..]; 3],
        };
        self.model.has_colors |= more.len() >= 3;
        color.iter().try_for_each(|word| self.number(word).map(drop))
    }

    fn element(&mut self, line: usize, mut rest: &[u8], shape: Shape) -> Result<()> {
        let before = (self.text.len(), self.ahead.len());
        self.text.extend(b"\nf");
        let mut count = 0;
        while let Some(word) = next_word(&mut rest).filter(|w| !w.starts_with(b"#")) {
            let face_vertex = face_vertex(word, self.counts).at(|| place(line))?;
            for (list, index) in face_vertex.into_iter().enumerate() {
                let ahead = index.filter(|i| *i as usize >= self.counts[list]);
                self.ahead.extend(ahead.map(|index| (line, list, index)));
            }
            // tobj counts from 1, and entry 1 is the missing one.
            let [v, vt, vn] = face_vertex.map(|index| index.map_or(1, |i| u64::from(i) + 2));
            // Writing to memory does not fail.
            let _ = write!(self.text, " {v}/{vt}/{vn}");
            count += 1;
        }
        let least = [3, 2, 1][shape as usize];
        if count < least {
            self.text.truncate(before.0);
            self.ahead.truncate(before.1);
            self.short.push(line);
            return Ok(());
        }
        let start = self.face_vertices as u32;
        self.face_vertices += count;
        if self.face_vertices > NO_INDEX as usize {
            return Err(Problem::new(
                place(line),
                format!("more than {NO_INDEX} vertices of faces, which is the limit"),
            ));
        }
        self.enter(line)?;
        self.model.elements.push(Element {
            start,
            shape,
            group: self.group,
            material: self.material,
            smoothing: self.smoothing,
            line: line as u32,
        });
        Ok(())
    }

    fn enter(&mut self, line: usize) -> Result<()> {
        let Some(group) = self.pending.take() else { return Ok(()) };
        let next = self.model.groups.len() as u32;
        let key = (self.object.clone(), group);
        if let Some(known) = self.group_of.get(&key) {
            self.group = *known;
            return Ok(());
        }
        if self.model.groups.len() == MAX_GROUPS {
            return Err(Problem::new(
                place(line),
                format!("more than {MAX_GROUPS} groups, which is the limit"),
            ));
        }
        self.model.groups.push(if key.1.is_empty() { key.0.clone() } else { key.1.clone() });
        self.group_of.insert(key, next);
        self.group = next;
        Ok(())
    }

    fn use_material(&mut self, line: usize, name: String) -> Result<u32> {
        let next = self.model.materials.len() as u32;
        if let Some(known) = self.material_of.get(&name) {
            return Ok(*known);
        }
        if self.model.materials.len() == MAX_MATERIALS {
            return Err(Problem::new(
                place(line),
                format!("more than {MAX_MATERIALS} materials, which is the limit"),
            ));
        }
        self.model.materials.push((name.clone(), line));
        self.material_of.insert(name, next);
        Ok(next)
    }

    fn finish(self, budget: &Budget) -> Result<Model> {
        let mut model = Model { positions: self.counts[0], ..self.model };
        if let Some(line) = self.short.first() {
            let what = format!(
                "{} with fewer than three vertices (or lines with fewer than two) left out",
                text::count(self.short.len(), "face")
            );
            self.notes.warn(format!("line {line}"), what);
        }
        for (keyword, (line, count)) in self.unknown {
            let what = match keyword.as_str() {
                "vp" | "cstype" | "deg" | "bmat" | "step" | "curv" | "curv2" | "surf" | "parm" | "trim"
                | "hole" | "scrv" | "sp" | "end" | "con" => "free-form curves and surfaces are not supported",
                _ => "is not known",
            };
            let times = if count > 1 {
                format!("; {count} such lines are left out")
            } else {
                "; it is left out".into()
            };
            self.notes.warn(format!("line {line}"), format!("\"{keyword}\": {what}{times}"));
        }
        for (line, list, index) in self.ahead {
            if index as usize >= self.counts[list] {
                let (name, count) = (LIST_NAMES[list], self.counts[list]);
                let what = format!("refers to {name} {}, but the file has {count}", u64::from(index) + 1);
                return Err(Problem::new(place(line), what));
            }
        }
        if self.geometry {
            budget.charge(self.face_vertices as u64, FACE_VERTEX_BYTES).at(|| "f".into())?;
            let options = tobj::LoadOptions { single_index: true, ..Default::default() };
            let read = tobj::load_obj_buf(&mut &*self.text, &options, |_| Ok(Default::default()));
            // The checks above refuse, with the line, everything that `tobj` would refuse.
            let (mut models, _) = read.map_err(|e| Problem::new("f", e.to_string()))?;
            model.mesh = models.pop().map(|all| all.mesh).unwrap_or_default();
        }
        Ok(model)
    }
}

fn place(line: usize) -> String {
    format!("line {line}")
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.trim_ascii()).into_owned()
}

fn finite(word: &[u8]) -> Result<f64> {
    let value = number(word).filter(|v| v.abs() <= f64::from(f32::MAX));
    value.ok_or_else(|| format!("\"{}\" is not a finite number", shown(word)).into())
}

/// Parses `1`, `1/2`, `1//3` or `1/2/3`. Negative numbers count back from the latest entry.
fn face_vertex(word: &[u8], counts: [usize; 3]) -> Result<[Option<u32>; 3]> {
    let odd = || format!("\"{}\" is not a vertex of a face: it should be v, v/t, v//n or v/t/n", shown(word));
    let mut out = [None; 3];
    let mut parts = word.split(|b| *b == b'/');
    for (slot, (count, name)) in out.iter_mut().zip(counts.into_iter().zip(LIST_NAMES)) {
        let Some(part) = parts.next() else { break };
        if part.is_empty() && name != LIST_NAMES[0] {
            continue;
        }
        let index = integer(part).ok_or_else(odd)?;
        *slot = Some(match index {
            0 => return Err(format!("refers to {name} 0; they are counted from 1").into()),
            1.. => u32::try_from(index - 1)
                .ok()
                .filter(|i| *i != NO_INDEX)
                .ok_or_else(|| format!("refers to {name} {index}, which is beyond the limit"))?,
            _ => {
                let back = index.unsigned_abs();
                if back > count as u64 {
                    let what = format!(
                        "refers to {name} {index}, counted from the end, but the number so far is {count}"
                    );
                    return Err(what.into());
                }
                (count as u64 - back) as u32
            }
        });
    }
    if parts.next().is_some() {
        return Err(odd().into());
    }
    Ok(out)
}
