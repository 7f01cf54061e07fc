//! `<geometry>`: sources and face lists become indexed primitives.

use crate::source::{Floats, Input, floats, inputs};
use crate::xml::{Node, NodeId};
use crate::xml::{Xml, child, children, label_of, name_of};
use choreo_asset::{Primitive, Topology};
use choreo_importer_kit::color::linear_channel;
use choreo_importer_kit::polygon::{Cut, Triangulator};
use choreo_importer_kit::text;
use choreo_importer_kit::weld::Welder;
use choreo_importer_kit::{Problem, Result, normals};
use glam::{Vec2, Vec3, Vec4};
use std::collections::HashMap;
use std::rc::Rc;

/// One face list (`<triangles>`, `<polylist>` …) as a primitive, without skin, and with normals only where the file has them.
#[derive(Clone)]
pub(crate) struct Submesh {
    pub primitive: Primitive,
    /// Index of each vertex's position in the source.
    pub origin: Vec<u32>,
    pub symbol: String,
    /// `set` of each uv list.
    pub uv_sets: Vec<usize>,
}

pub(crate) struct Geometry {
    pub name: String,
    pub parts: Vec<Submesh>,
    /// Positions of the source, in metres.
    pub positions: Rc<Vec<Vec3>>,
}

pub(crate) fn read(xml: &Xml<'_>, geometry: Node<'_>, metres: f64, srgb: bool) -> Result<Geometry> {
    let name = label_of(geometry).unwrap_or("mesh").to_string();
    let mut out = Geometry { name, parts: Vec::new(), positions: Rc::default() };
    let Some(mesh) = child(geometry, "mesh") else {
        let kind = geometry.first_element_child().map_or("nothing", name_of);
        xml.warn(geometry, format!("is {kind}, not a mesh; it is left out"));
        return Ok(out);
    };
    let (mut sources, mut places) = (HashMap::new(), None);
    let (mut welder, mut triangulator) = (Welder::default(), Triangulator::default());
    for element in mesh.children() {
        let shape = match name_of(element) {
            "triangles" => FaceList::Triangles,
            "polylist" => FaceList::Polylist,
            "polygons" => FaceList::Polygons,
            "tristrips" => FaceList::Strips,
            "trifans" => FaceList::Fans,
            "lines" => FaceList::Lines,
            "linestrips" => FaceList::LineStrips,
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
            welder: &mut welder,
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
enum FaceList {
    Triangles,
    Polylist,
    Polygons,
    Strips,
    Fans,
    Lines,
    LineStrips,
}

struct Reader<'x, 'a> {
    xml: &'x Xml<'a>,
    element: Node<'a>,
    shape: FaceList,
    metres: f64,
    srgb: bool,
    /// Sources read so far: elements of a mesh share them.
    sources: &'x mut HashMap<NodeId, Rc<Floats>>,
    /// Positions in metres of the latest source.
    places: &'x mut Option<(NodeId, Rc<Vec<Vec3>>)>,
    welder: &'x mut Welder,
    triangulator: &'x mut Triangulator,
}

/// A source, and the offset of its index in the index tuple of a face vertex.
#[derive(Clone)]
struct Stream {
    floats: Rc<Floats>,
    offset: usize,
}

struct Streams {
    positions: Stream,
    normals: Option<Stream>,
    colors: Option<Stream>,
    /// Texture coordinate sets, two at most, with the `set` of each.
    uvs: Vec<Stream>,
    uv_sets: Vec<usize>,
}

impl<'a> Reader<'_, 'a> {
    fn stream(&mut self, input: Option<&Input<'a>>, stride: usize) -> Result<Option<Stream>> {
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

    fn read(&mut self) -> Result<Option<(Submesh, Rc<Vec<Vec3>>)>> {
        let inputs = inputs(self.xml, self.element)?;
        let Some(streams) = self.streams(&inputs)? else {
            self.xml.warn(self.element, "has no positions; it is left out");
            return Ok(None);
        };
        let width = inputs.iter().map(|i| i.offset + 1).max().unwrap_or(1);
        let (indices, runs) = self.indices(width)?;
        let face_vertices = self.face_vertices(&indices, width, &runs, &streams.positions)?;
        self.xml.charge(self.element, face_vertices.len(), 72)?;
        let positions = inputs.iter().find(|i| i.semantic == "POSITION").map(|i| i.source.id());
        let positions = self.in_metres(positions, &streams.positions.floats)?;
        let tuples = face_vertices.iter().map(|at| &indices[*at as usize * width..][..width]);
        let (mut primitive, origin) = self.primitive(&streams, tuples, &positions)?;
        if primitive.indices.is_empty() {
            return Ok(None);
        }
        primitive.normals.iter_mut().for_each(|n| *n = n.as_dvec3().normalize_or_zero().as_vec3());
        normals::replace_zero(&mut primitive);
        let symbol = self.element.attribute("material").unwrap_or_default().to_string();
        Ok(Some((Submesh { primitive, origin, symbol, uv_sets: streams.uv_sets }, positions)))
    }

    /// The streams of the inputs; `None` without positions.
    fn streams(&mut self, inputs: &[Input<'a>]) -> Result<Option<Streams>> {
        let find = |semantic: &str| inputs.iter().find(|i| i.semantic == semantic);
        let Some(positions) = self.stream(find("POSITION"), 3)? else { return Ok(None) };
        let normals = self.stream(find("NORMAL"), 3)?;
        let colors = self.stream(find("COLOR"), 4)?;
        let mut texcoords: Vec<&Input<'_>> = inputs.iter().filter(|i| i.semantic == "TEXCOORD").collect();
        texcoords.sort_by_key(|i| i.set);
        if texcoords.len() > 2 {
            let what = format!("has {} sets of texture coordinates; two are used", texcoords.len());
            self.xml.warn(self.element, what);
            texcoords.truncate(2);
        }
        let uv_sets = texcoords.iter().map(|i| i.set).collect();
        let mut uvs = Vec::new();
        for input in texcoords {
            uvs.extend(self.stream(Some(input), 2)?);
        }
        Ok(Some(Streams { positions, normals, colors, uvs, uv_sets }))
    }

    /// Welds face vertices, each given as a tuple of indices, into a primitive. Returns the position index of each vertex too.
    fn primitive<'t>(
        &mut self,
        streams: &Streams,
        tuples: impl ExactSizeIterator<Item = &'t [i32]>,
        positions: &[Vec3],
    ) -> Result<(Primitive, Vec<u32>)> {
        let Streams { normals, colors, uvs, .. } = streams;
        let lines = matches!(self.shape, FaceList::Lines | FaceList::LineStrips);
        let count = tuples.len();
        let mut out = Primitive {
            topology: if lines { Topology::Lines } else { Topology::Triangles },
            indices: Vec::with_capacity(count),
            // Capacity for all face vertices. Unused capacity costs nothing, but growing lists are copied into fresh memory.
            positions: Vec::with_capacity(count),
            normals: Vec::with_capacity(if normals.is_some() { count } else { 0 }),
            uvs: [0, 1].map(|set| Vec::with_capacity(if set < uvs.len() { count } else { 0 })),
            ..Primitive::default()
        };
        let mut origin = Vec::with_capacity(count);
        self.welder.start(positions.len());
        for tuple in tuples {
            let point = self.index(tuple, &streams.positions)?;
            let normal = match normals {
                Some(s) => Vec3::from(s.floats.get(self.index(tuple, s)?)),
                None => Vec3::ZERO,
            };
            let color = match colors {
                Some(s) => Some(self.color(s, s.floats.get(self.index(tuple, s)?))),
                None => None,
            };
            let mut uv = [Vec2::ZERO; 2];
            for (uv, stream) in uv.iter_mut().zip(uvs) {
                let [u, v] = stream.floats.get(self.index(tuple, stream)?);
                // COLLADA has v pointing up; here it points down.
                *uv = Vec2::new(u, 1.0 - v);
            }
            // Compares the values, not the indices, because many files have a separate texture coordinate for every face vertex.
            let (vertex, new) = self.welder.vertex(point as u32, |vertex| {
                let at = vertex as usize;
                (normals.is_none() || out.normals[at] == normal)
                    && uv.iter().zip(&out.uvs).take(uvs.len()).all(|(uv, list)| list[at] == *uv)
                    && color.is_none_or(|c| out.colors[at] == c)
            });
            out.indices.push(vertex);
            if new {
                origin.push(point as u32);
                out.positions.push(positions[point]);
                out.normals.extend(normals.is_some().then_some(normal));
                out.colors.extend(color);
                out.uvs.iter_mut().zip(uv).take(uvs.len()).for_each(|(list, uv)| list.push(uv));
            }
        }
        origin.shrink_to_fit();
        out.positions.shrink_to_fit();
        out.normals.shrink_to_fit();
        out.uvs.iter_mut().for_each(Vec::shrink_to_fit);
        Ok((out, origin))
    }

    fn problem(&self, what: impl Into<String>) -> Problem {
        self.xml.problem(self.element, what)
    }

    /// The positions of a source, converted to metres.
    fn in_metres(&mut self, source: Option<NodeId>, floats: &Floats) -> Result<Rc<Vec<Vec3>>> {
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

    /// The index in a tuple for a stream. Fails where the stream's source is shorter.
    #[inline]
    fn index(&self, tuple: &[i32], stream: &Stream) -> Result<usize> {
        let (index, count) = (tuple[stream.offset] as u32 as usize, stream.floats.count);
        match index < count {
            true => Ok(index),
            false => Err(self.problem(format!("refers to element {index} of a source that has {count}"))),
        }
    }

    fn color(&self, stream: &Stream, [r, g, b, a]: [f32; 4]) -> Vec4 {
        let alpha = if stream.floats.stride > 3 { a.clamp(0.0, 1.0) } else { 1.0 };
        let [r, g, b] = [r, g, b].map(|c| linear_channel(c.clamp(0.0, 1.0), self.srgb));
        Vec4::new(r, g, b, alpha)
    }

    /// All indices of the `<p>` elements, and the number of vertices of each polygon, strip or line; empty where all have the
    /// same.
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
                    "has {} indices, which is no multiple of the {width} that a vertex needs",
                    read.len()
                );
                return Err(self.xml.problem(p, what));
            }
            runs.push((read.len() / width) as u32);
            // There is usually one list, which is taken without copying.
            if indices.is_empty() { indices = read } else { indices.extend(read) }
        }
        if holes > 0 {
            self.xml.warn(
                self.element,
                format!("{} with holes, which are filled", text::count(holes, "polygon")),
            );
        }
        if self.shape == FaceList::Polylist {
            runs.clear();
            for vcount in children(self.element, "vcount") {
                let counts = self.xml.integers(vcount)?;
                runs.extend(counts.iter().map(|c| (*c).max(0) as u32));
            }
            let wanted: u64 = runs.iter().map(|r| u64::from(*r)).sum();
            let there = (indices.len() / width) as u64;
            if wanted != there {
                return Err(self.problem(format!("vcount asks for {wanted} vertices, but p has {there}")));
            }
        }
        Ok((indices, runs))
    }

    /// Numbers of the face vertices as a list of triangles or lines.
    fn face_vertices(
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
                        text::count((n % of) as usize, "vertex")
                    ),
                );
            }
            (0..n - n % of).collect()
        };
        let mut out = Vec::new();
        let mut start = 0;
        let (mut short, mut crossing, mut fans) = (0, 0, 0);
        match self.shape {
            FaceList::Triangles => return Ok(whole(total, 3)),
            FaceList::Lines => return Ok(whole(total, 2)),
            _ => {}
        }
        for run in runs {
            let (first, count) = (start, *run);
            start += count;
            let least = if self.shape == FaceList::LineStrips { 2 } else { 3 };
            if count < least {
                short += 1;
                continue;
            }
            match self.shape {
                FaceList::LineStrips => out.extend((1..count).flat_map(|i| [first + i - 1, first + i])),
                FaceList::Fans => out.extend((2..count).flat_map(|i| [first, first + i - 1, first + i])),
                FaceList::Strips => out.extend((2..count).flat_map(|i| {
                    let odd = i % 2;
                    [first + i - 2 + odd, first + i - 1 - odd, first + i]
                })),
                _ if count == 3 => out.extend([first, first + 1, first + 2]),
                _ => {
                    let tuple = |i: u32| &indices[(first + i) as usize * width..][..width];
                    for i in 0..count {
                        self.index(tuple(i), positions)?;
                    }
                    let place = |i: usize| {
                        let index = tuple(i as u32)[positions.offset] as usize;
                        Vec3::from(positions.floats.get(index)).as_dvec3()
                    };
                    let add = |triangle: [u32; 3]| out.extend(triangle.map(|i| first + i));
                    match self.triangulator.triangulate(count as usize, place, add) {
                        Cut::Whole => {}
                        Cut::Crossing => crossing += 1,
                        Cut::OverBudget => fans += 1,
                    }
                }
            }
        }
        for (number, what) in [
            (short, "with too few vertices left out"),
            (crossing, "crossing itself or without area; the triangles are a guess"),
            (fans, "with too many vertices to triangulate properly, cut into triangle fans"),
        ] {
            if number > 0 {
                self.xml.warn(self.element, format!("{} {what}", text::count(number, "polygon")));
            }
        }
        Ok(out)
    }
}
