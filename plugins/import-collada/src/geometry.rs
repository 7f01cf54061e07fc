//! `<geometry>`: sources and faces to indexed primitives.

use crate::source::{Floats, Input, floats, inputs};
use crate::tree::{Node, NodeId};
use crate::xml::{Xml, child, children, name_of};
use choreo_asset::{Primitive, Topology};
use choreo_importer_kit::corners::Joined;
use choreo_importer_kit::polygon::{Cut, Triangulator};
use choreo_importer_kit::text;
use choreo_importer_kit::{Problem, Result};
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::rc::Rc;

/// One `<triangles>`, `<polylist>` …, without skin, normals as in the file (or none).
#[derive(Clone)]
pub struct Part {
    pub primitive: Primitive,
    /// Index in the source of each vertex's position.
    pub origin: Vec<u32>,
    pub symbol: String,
    /// The `set` of each uv list.
    pub uv_sets: Vec<usize>,
}

pub struct Geometry {
    pub name: String,
    pub parts: Vec<Part>,
    /// Positions of the source, in metres.
    pub positions: Rc<Vec<Vec3>>,
}

pub fn read<'a, 'i>(xml: &Xml<'a, 'i>, geometry: Node<'a, 'i>, metres: f64, srgb: bool) -> Result<Geometry> {
    let name = geometry.attribute("name").or(geometry.attribute("id")).unwrap_or("mesh").to_string();
    let mut out = Geometry { name, parts: Vec::new(), positions: Rc::default() };
    let Some(mesh) = child(geometry, "mesh") else {
        let kind = geometry.children().next().map_or("nothing", name_of);
        xml.warn(geometry, format!("is {kind}, not a mesh; it is left out"));
        return Ok(out);
    };
    let (mut sources, mut places) = (HashMap::new(), None);
    let (mut joined, mut triangulator) = (Joined::default(), Triangulator::default());
    for element in mesh.children() {
        let shape = match name_of(element) {
            "triangles" => Shape::Triangles,
            "polylist" => Shape::Polylist,
            "polygons" => Shape::Polygons,
            "tristrips" => Shape::Strips,
            "trifans" => Shape::Fans,
            "lines" => Shape::Lines,
            "linestrips" => Shape::LineStrips,
            _ => continue,
        };
        let mut reader = Reader {
            xml,
            element,
            shape,
            metres,
            srgb,
            sources: &mut sources,
            places: &mut places,
            joined: &mut joined,
            triangulator: &mut triangulator,
        };
        if let Some((part, positions)) = reader.read()? {
            if out.positions.is_empty() {
                out.positions = positions;
            }
            out.parts.push(part);
        }
    }
    Ok(out)
}

#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Triangles,
    Polylist,
    Polygons,
    Strips,
    Fans,
    Lines,
    LineStrips,
}

struct Reader<'x, 'a, 'i> {
    xml: &'x Xml<'a, 'i>,
    element: Node<'a, 'i>,
    shape: Shape,
    metres: f64,
    srgb: bool,
    /// Sources that several elements of the mesh share are read once.
    sources: &'x mut HashMap<NodeId, Rc<Floats>>,
    /// Positions in metres of the latest source.
    places: &'x mut Option<(NodeId, Rc<Vec<Vec3>>)>,
    joined: &'x mut Joined,
    triangulator: &'x mut Triangulator,
}

/// A source and where its index stands among a corner's.
#[derive(Clone)]
struct Stream {
    floats: Rc<Floats>,
    offset: usize,
}

impl<'a, 'i> Reader<'_, 'a, 'i> {
    fn stream(&mut self, input: Option<&Input<'a, 'i>>, stride: usize) -> Result<Option<Stream>> {
        let Some(input) = input else { return Ok(None) };
        let floats = match self.sources.get(&input.source.id()) {
            Some(known) => known.clone(),
            None => {
                let read = Rc::new(floats(self.xml, input.source, stride)?);
                self.sources.insert(input.source.id(), read.clone());
                read
            }
        };
        Ok(Some(Stream { floats, offset: input.offset }))
    }

    fn read(&mut self) -> Result<Option<(Part, Rc<Vec<Vec3>>)>> {
        let inputs = inputs(self.xml, self.element)?;
        let find = |semantic: &str| inputs.iter().find(|i| i.semantic == semantic);
        let position = find("POSITION");
        let Some(positions) = self.stream(position, 3)? else {
            self.xml.warn(self.element, "has no positions; it is left out");
            return Ok(None);
        };
        let normals = self.stream(find("NORMAL"), 3)?;
        let colors = self.stream(find("COLOR"), 4)?;
        let mut texcoords: Vec<&Input<'_, '_>> = inputs.iter().filter(|i| i.semantic == "TEXCOORD").collect();
        texcoords.sort_by_key(|i| i.set);
        if texcoords.len() > 2 {
            self.xml.warn(
                self.element,
                format!("has {} sets of texture coordinates; two are used", texcoords.len()),
            );
            texcoords.truncate(2);
        }
        let uv_sets = texcoords.iter().map(|i| i.set).collect();
        let mut uvs = Vec::new();
        for input in texcoords {
            uvs.extend(self.stream(Some(input), 2)?);
        }
        let width = inputs.iter().map(|i| i.offset + 1).max().unwrap_or(1);
        let (indices, runs) = self.indices(width)?;
        let corners = self.corners(&indices, width, &runs, &positions)?;
        self.xml.charge(self.element, corners.len(), 72)?;

        let all = self.places_of(position.map(|p| p.source.id()), &positions.floats)?;
        let lines = matches!(self.shape, Shape::Lines | Shape::LineStrips);
        let mut primitive = Primitive {
            topology: if lines { Topology::Lines } else { Topology::Triangles },
            indices: Vec::with_capacity(corners.len()),
            ..Primitive::default()
        };
        let mut origin = Vec::with_capacity(corners.len());
        // Room for as many vertices as there are corners, which costs nothing where it is not written to: lists that grow are
        // copied, into memory that is touched for the first time.
        primitive.positions.reserve_exact(corners.len());
        if normals.is_some() {
            primitive.normals.reserve_exact(corners.len());
        }
        primitive.uvs.iter_mut().take(uvs.len()).for_each(|list| list.reserve_exact(corners.len()));
        self.joined.start(all.len());
        for corner in &corners {
            let indices = &indices[*corner as usize * width..][..width];
            let point = self.index(indices, &positions)?;
            let normal = match &normals {
                Some(s) => Vec3::from(s.floats.get(self.index(indices, s)?)),
                None => Vec3::ZERO,
            };
            let color = colors.as_ref().map(|s| self.index(indices, s).map(|i| (s, s.floats.get::<4>(i))));
            let color = color.transpose()?;
            let mut uv = [Vec2::ZERO; 2];
            for (uv, stream) in uv.iter_mut().zip(&uvs) {
                let [u, v] = stream.floats.get(self.index(indices, stream)?);
                // COLLADA counts v from the bottom.
                *uv = Vec2::new(u, 1.0 - v);
            }
            let color = color.map(|(stream, values)| self.color(stream, values));
            // By what the sources say, not by index: many files have a texture coordinate for every corner.
            let (vertex, new) = self.joined.vertex(point as u32, |vertex| {
                let at = vertex as usize;
                let there = &primitive;
                (normals.is_none() || there.normals[at] == normal)
                    && uv.iter().zip(&there.uvs).take(uvs.len()).all(|(uv, list)| list[at] == *uv)
                    && color.is_none_or(|c| there.colors[at] == c)
            });
            primitive.indices.push(vertex);
            if !new {
                continue;
            }
            origin.push(point as u32);
            primitive.positions.push(all[point]);
            if normals.is_some() {
                primitive.normals.push(normal);
            }
            primitive.colors.extend(color);
            primitive.uvs.iter_mut().zip(uv).take(uvs.len()).for_each(|(list, uv)| list.push(uv));
        }
        if primitive.indices.is_empty() {
            return Ok(None);
        }
        origin.shrink_to_fit();
        primitive.positions.shrink_to_fit();
        primitive.normals.shrink_to_fit();
        primitive.uvs.iter_mut().for_each(Vec::shrink_to_fit);
        repair_normals(&mut primitive);
        let symbol = self.element.attribute("material").unwrap_or_default().to_string();
        Ok(Some((Part { primitive, origin, symbol, uv_sets }, all)))
    }

    fn problem(&self, what: impl Into<String>) -> Problem {
        self.xml.problem(self.element, what)
    }

    /// Positions of a source in metres.
    fn places_of(&mut self, source: Option<NodeId>, floats: &Floats) -> Result<Rc<Vec<Vec3>>> {
        if let (Some(source), Some((known, places))) = (source, &*self.places)
            && source == *known
        {
            return Ok(places.clone());
        }
        let metres = self.metres;
        let place = |i: usize| (Vec3::from(floats.get(i)).as_dvec3() * metres).as_vec3();
        let all: Rc<Vec<Vec3>> = Rc::new((0..floats.count).map(place).collect());
        if all.iter().any(|p| !p.is_finite()) {
            return Err(self.problem("its positions in metres are not finite"));
        }
        *self.places = source.map(|s| (s, all.clone()));
        Ok(all)
    }

    /// A corner's index into a stream, which has as many elements.
    #[inline]
    fn index(&self, corner: &[i32], stream: &Stream) -> Result<usize> {
        let (index, count) = (corner[stream.offset] as u32 as usize, stream.floats.count);
        match index < count {
            true => Ok(index),
            false => Err(self.problem(format!("refers to element {index} of a source that has {count}"))),
        }
    }

    fn color(&self, stream: &Stream, [r, g, b, a]: [f32; 4]) -> Vec4 {
        let alpha = if stream.floats.stride > 3 { a.clamp(0.0, 1.0) } else { 1.0 };
        let [r, g, b] = [r, g, b].map(|c| crate::materials::linear(c.clamp(0.0, 1.0), self.srgb));
        Vec4::new(r, g, b, alpha)
    }

    /// All indices of the `<p>`s, and how many corners each polygon, strip or line has; empty where all have the same.
    fn indices(&self, width: usize) -> Result<(Vec<i32>, Vec<u32>)> {
        let mut indices = Vec::new();
        let mut runs = Vec::new();
        let mut holes = 0;
        for child in self.element.children() {
            let p = match name_of(child) {
                "p" => child,
                "ph" => {
                    holes += 1;
                    match children(child, "p").next() {
                        Some(p) => p,
                        None => continue,
                    }
                }
                _ => continue,
            };
            let read = self.xml.integers(p)?;
            if let Some(at) = read.iter().position(|i| *i < 0) {
                return Err(self.xml.problem(p, format!("value {at} is {}; an index starts at 0", read[at])));
            }
            let rest = read.len() % width;
            if rest != 0 {
                let what = format!(
                    "has {} indices, which is no multiple of the {width} that a corner needs",
                    read.len()
                );
                return Err(self.xml.problem(p, what));
            }
            runs.push((read.len() / width) as u32);
            // The usual case has one list.
            if indices.is_empty() { indices = read } else { indices.extend(read) }
        }
        if holes > 0 {
            self.xml.warn(
                self.element,
                format!("{} with holes, which are filled", text::count(holes, "polygon")),
            );
        }
        if self.shape == Shape::Polylist {
            runs.clear();
            for vcount in children(self.element, "vcount") {
                let counts = self.xml.integers(vcount)?;
                runs.extend(counts.iter().map(|c| (*c).max(0) as u32));
            }
            let wanted: u64 = runs.iter().map(|r| u64::from(*r)).sum();
            let there = (indices.len() / width) as u64;
            if wanted != there {
                return Err(self.problem(format!("vcount asks for {wanted} corners, but p has {there}")));
            }
        }
        Ok((indices, runs))
    }

    /// Corner numbers of a triangle or line list.
    fn corners(
        &mut self,
        indices: &[i32],
        width: usize,
        runs: &[u32],
        positions: &Stream,
    ) -> Result<Vec<u32>> {
        let total = (indices.len() / width) as u32;
        let whole = |n: u32, of: u32| -> Vec<u32> {
            if !n.is_multiple_of(of) {
                self.xml.warn(
                    self.element,
                    format!(
                        "{} at the end, too few for a line or triangle",
                        text::count((n % of) as usize, "corner")
                    ),
                );
            }
            (0..n - n % of).collect()
        };
        let mut out = Vec::new();
        let mut start = 0;
        let (mut short, mut crossing, mut fans) = (0, 0, 0);
        match self.shape {
            Shape::Triangles => return Ok(whole(total, 3)),
            Shape::Lines => return Ok(whole(total, 2)),
            _ => {}
        }
        for run in runs {
            let (first, count) = (start, *run);
            start += count;
            let least = if self.shape == Shape::LineStrips { 2 } else { 3 };
            if count < least {
                short += 1;
                continue;
            }
            match self.shape {
                Shape::LineStrips => out.extend((1..count).flat_map(|i| [first + i - 1, first + i])),
                Shape::Fans => out.extend((2..count).flat_map(|i| [first, first + i - 1, first + i])),
                Shape::Strips => out.extend((2..count).flat_map(|i| {
                    let odd = i % 2;
                    [first + i - 2 + odd, first + i - 1 - odd, first + i]
                })),
                _ if count == 3 => out.extend([first, first + 1, first + 2]),
                _ => {
                    let corner = |i: u32| &indices[(first + i) as usize * width..][..width];
                    for i in 0..count {
                        self.index(corner(i), positions)?;
                    }
                    let place = |i: usize| {
                        let index = corner(i as u32)[positions.offset] as usize;
                        Vec3::from(positions.floats.get(index)).as_dvec3()
                    };
                    let add = |triangle: [u32; 3]| out.extend(triangle.map(|i| first + i));
                    match self.triangulator.cut(count as usize, place, add) {
                        Cut::Whole => {}
                        Cut::Crossing => crossing += 1,
                        Cut::TooMuch => fans += 1,
                    }
                }
            }
        }
        for (number, what) in [
            (short, "with too few corners left out"),
            (crossing, "crossing itself or without area; the triangles are a guess"),
            (fans, "with too many corners to be cut properly, made into fans"),
        ] {
            if number > 0 {
                self.xml.warn(self.element, format!("{} {what}", text::count(number, "polygon")));
            }
        }
        Ok(out)
    }
}

/// Normals of the file at unit length; those of length zero become that of a triangle that uses them.
fn repair_normals(p: &mut Primitive) {
    let mut zero = false;
    for n in &mut p.normals {
        *n = n.as_dvec3().normalize_or_zero().as_vec3();
        zero |= *n == Vec3::ZERO;
    }
    if !zero {
        return;
    }
    if p.topology != Topology::Triangles {
        p.normals.clear();
        return;
    }
    for triangle in p.indices.chunks_exact(3) {
        let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|i| p.positions[i as usize].as_dvec3());
        let face = (b - a).cross(c - a).normalize_or_zero().as_vec3().normalize_or(Vec3::Y);
        for i in triangle {
            let normal = &mut p.normals[*i as usize];
            if *normal == Vec3::ZERO {
                *normal = face;
            }
        }
    }
    for n in p.normals.iter_mut().filter(|n| **n == Vec3::ZERO) {
        *n = Vec3::Y;
    }
}
