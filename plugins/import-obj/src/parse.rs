//! The lines of an OBJ file to flat lists.

use choreo_import::text::{self, Lines, integer, next_word, number, shown};
use choreo_import::{Notes, Problem, Progress, Result};
use glam::{DVec3, Vec2, Vec3};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

/// Groups are nodes, materials are looked at for every primitive: bounds the memory of empty ones.
const MAX_GROUPS: usize = 65_536;
const MAX_MATERIALS: usize = 65_536;
/// Stands for a uv or normal that a corner does not have.
pub const NONE: u32 = u32::MAX;

/// One corner of a face, line or point: indices into the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    pub position: u32,
    pub uv: u32,
    pub normal: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shape {
    Face,
    Line,
    Point,
}

/// A face, line or set of points: its corners begin at `start` and end where the next one's begin.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    pub start: u32,
    pub shape: Shape,
    pub group: u32,
    /// Index into `materials`; `NONE` before the first `usemtl`.
    pub material: u32,
    /// Smoothing group; 0 = flat.
    pub smoothing: u32,
    pub line: u32,
}

#[derive(Debug, Default)]
pub struct Model {
    pub positions: Vec<DVec3>,
    /// As written, one a position, or none at all.
    pub colors: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub corners: Vec<Corner>,
    pub elements: Vec<Element>,
    pub groups: Vec<String>,
    /// Names in the order of their first use, with the line of it.
    pub materials: Vec<(String, usize)>,
    /// What follows `mtllib`, with its line.
    pub libraries: Vec<(String, usize)>,
    /// Any `s` line.
    pub has_smoothing: bool,
    /// The first comment.
    pub comment: String,
}

impl Model {
    pub fn corners(&self, element: usize) -> &[Corner] {
        let start = self.elements[element].start as usize;
        let end = self.elements.get(element + 1).map_or(self.corners.len(), |e| e.start as usize);
        &self.corners[start..end]
    }
}

/// Without `geometry` only names are read.
pub fn read(bytes: &[u8], geometry: bool, progress: &Progress<'_>, notes: &Notes) -> Result<Model> {
    let mut parser = Parser {
        notes,
        model: Model::default(),
        geometry,
        object: String::new(),
        pending: Some(String::new()),
        group: NONE,
        material: NONE,
        smoothing: 0,
        group_of: HashMap::new(),
        material_of: HashMap::new(),
        unknown: BTreeMap::new(),
        short: None,
        short_count: 0,
    };
    let mut lines = Lines::new(bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes));
    while let Some((line, text)) = lines.next() {
        // What is read becomes meshes after that, in about half of the time again.
        progress.reach((bytes.len() - lines.left()) / 3 * 2)?;
        let mut text = Cow::Borrowed(text);
        // A backslash at the end continues the line.
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
    parser.finish()
}

struct Parser<'a> {
    notes: &'a Notes,
    model: Model,
    geometry: bool,
    object: String,
    /// The group that the next element begins: names without faces make no nodes.
    pending: Option<String>,
    group: u32,
    material: u32,
    smoothing: u32,
    /// (object, group) → index. Only looked up.
    group_of: HashMap<(String, String), u32>,
    material_of: HashMap<String, u32>,
    /// Keywords that are left out: first line, count.
    unknown: BTreeMap<String, (usize, usize)>,
    short: Option<usize>,
    short_count: usize,
}

impl Parser<'_> {
    fn line(&mut self, line: usize, text: &[u8]) -> Result<()> {
        let mut rest = text;
        let Some(keyword) = next_word(&mut rest) else { return Ok(()) };
        match keyword {
            b"v" if self.geometry => self.position(rest).map_err(|what| at(line, what))?,
            b"vt" if self.geometry => {
                let [u, v] = floats(&mut rest, 1).map_err(|what| at(line, what))?;
                self.model.uvs.push(Vec2::new(u as f32, v as f32));
            }
            b"vn" if self.geometry => {
                let [x, y, z] = floats(&mut rest, 3).map_err(|what| at(line, what))?;
                self.model.normals.push(DVec3::new(x, y, z).as_vec3());
            }
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

    /// `x y z`, with `w` or with `r g b` behind it (or both).
    fn position(&mut self, mut rest: &[u8]) -> std::result::Result<(), String> {
        let [x, y, z] = floats(&mut rest, 3)?;
        let position = DVec3::new(x, y, z);
        let mut more = [0.0; 4];
        let mut count = 0;
        while let (Some(word), true) = (next_word(&mut rest), count < 4) {
            more[count] = finite(word)?;
            count += 1;
        }
        let color = match count {
            3 => Some(Vec3::new(more[0] as f32, more[1] as f32, more[2] as f32)),
            // Written as x y z w r g b or x y z r g b a: w and a are 1 in all files that are known.
            4 if more[0] == 1.0 && more[3] != 1.0 => {
                Some(Vec3::new(more[1] as f32, more[2] as f32, more[3] as f32))
            }
            4 => Some(Vec3::new(more[0] as f32, more[1] as f32, more[2] as f32)),
            _ => None,
        };
        let model = &mut self.model;
        if color.is_some() && model.colors.is_empty() {
            model.colors.resize(model.positions.len(), Vec3::ONE);
        }
        if color.is_some() || !model.colors.is_empty() {
            model.colors.push(color.unwrap_or(Vec3::ONE));
        }
        model.positions.push(position);
        Ok(())
    }

    fn element(&mut self, line: usize, mut rest: &[u8], shape: Shape) -> Result<()> {
        let start = self.model.corners.len();
        let counts = [self.model.positions.len(), self.model.uvs.len(), self.model.normals.len()];
        while let Some(word) = next_word(&mut rest) {
            if word.starts_with(b"#") {
                break;
            }
            let corner = corner(word, counts).map_err(|what| at(line, what))?;
            self.model.corners.push(corner);
        }
        let count = self.model.corners.len() - start;
        let least = match shape {
            Shape::Face => 3,
            Shape::Line => 2,
            Shape::Point => 1,
        };
        if count < least {
            self.model.corners.truncate(start);
            self.short_count += 1;
            self.short.get_or_insert(line);
            return Ok(());
        }
        if self.model.corners.len() > NONE as usize {
            return Err(at(line, format!("more than {NONE} corners, which is the limit")));
        }
        self.enter(line)?;
        self.model.elements.push(Element {
            start: start as u32,
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
            return Err(at(line, format!("more than {MAX_GROUPS} groups, which is the limit")));
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
            return Err(at(line, format!("more than {MAX_MATERIALS} materials, which is the limit")));
        }
        self.model.materials.push((name.clone(), line));
        self.material_of.insert(name, next);
        Ok(next)
    }

    fn finish(self) -> Result<Model> {
        let model = self.model;
        if let Some(line) = self.short {
            let what = format!(
                "{} with fewer than three corners (or lines with fewer than two) left out",
                text::count(self.short_count, "face")
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
        // Faces may stand before their vertices, so this is only known now.
        let counts = [model.positions.len(), model.uvs.len(), model.normals.len()];
        for index in 0..model.elements.len() {
            for corner in model.corners(index) {
                let parts = [
                    (corner.position, "vertex", 0),
                    (corner.uv, "texture coordinate", 1),
                    (corner.normal, "normal", 2),
                ];
                for (value, name, list) in parts {
                    if value != NONE && value as usize >= counts[list] {
                        let what = format!(
                            "refers to {name} {}, but the file has {}",
                            u64::from(value) + 1,
                            counts[list]
                        );
                        return Err(at(model.elements[index].line as usize, what));
                    }
                }
            }
        }
        Ok(model)
    }
}

fn at(line: usize, what: impl Into<String>) -> Problem {
    Problem::new(format!("line {line}"), what)
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes.trim_ascii()).into_owned()
}

fn finite(word: &[u8]) -> std::result::Result<f64, String> {
    let value = number(word).filter(|v| v.abs() <= f64::from(f32::MAX));
    value.ok_or_else(|| format!("\"{}\" is not a finite number", shown(word)))
}

/// `N` numbers, of which the first `least` must be there.
fn floats<const N: usize>(rest: &mut &[u8], least: usize) -> std::result::Result<[f64; N], String> {
    let mut values = [0.0; N];
    for (index, value) in values.iter_mut().enumerate() {
        match next_word(rest) {
            Some(word) => *value = finite(word)?,
            None if index >= least => break,
            None => return Err(format!("has {index} numbers, but needs {least}")),
        }
    }
    Ok(values)
}

/// `1`, `1/2`, `1//3`, `1/2/3`; negative numbers count back from the last one read so far.
fn corner(word: &[u8], counts: [usize; 3]) -> std::result::Result<Corner, String> {
    let mut out = [NONE; 3];
    let mut parts = word.split(|b| *b == b'/');
    for (slot, (count, name)) in
        out.iter_mut().zip(counts.into_iter().zip(["vertex", "texture coordinate", "normal"]))
    {
        let Some(part) = parts.next() else { break };
        if part.is_empty() && name != "vertex" {
            continue;
        }
        let index = integer(part).ok_or_else(|| {
            format!("\"{}\" is not a corner: it should be v, v/t, v//n or v/t/n", shown(word))
        })?;
        *slot = match index {
            0 => return Err(format!("refers to {name} 0; they are counted from 1")),
            1.. => u32::try_from(index - 1)
                .ok()
                .filter(|i| *i != NONE)
                .ok_or_else(|| format!("refers to {name} {index}, which is beyond the limit"))?,
            _ => {
                let back = index.unsigned_abs();
                if back > count as u64 {
                    return Err(format!(
                        "refers to {name} {index}, counted back, but there are {count} so far"
                    ));
                }
                (count as u64 - back) as u32
            }
        };
    }
    if parts.next().is_some() {
        return Err(format!("\"{}\" is not a corner: it should be v, v/t, v//n or v/t/n", shown(word)));
    }
    Ok(Corner { position: out[0], uv: out[1], normal: out[2] })
}
