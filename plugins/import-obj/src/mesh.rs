//! Faces to indexed primitives: one a group and material.

use crate::parse::{Corner, Model, NONE, Shape};
use choreo_import::polygon::{Cut, Triangulator};
use choreo_import::text::count;
use choreo_import::{Budget, Notes, Problem, Result, smooth};
use choreo_stage::asset::{Primitive, Topology};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// How positions become metres, and what is done where normals are missing.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub scale: f64,
    pub up_z: bool,
    /// Where faces have neither normals nor smoothing groups.
    pub smooth_rad: f64,
    /// Colours are as shown, not linear.
    pub srgb: bool,
}

/// What makes a primitive: kind, group, material, and whether its corners have normals.
type Key = (u32, Shape, u32, bool);

/// Primitives with the group each belongs to, by group, and within it in the order of the file's materials.
pub fn build(
    model: &Model,
    settings: &Settings,
    budget: &Budget,
    notes: &Notes,
) -> Result<Vec<(u32, Primitive)>> {
    let over = |what: String| Problem::new("f", what);
    budget.charge(model.corners.len() as u64, 3 * (size_of::<Corner>() + 72)).map_err(over)?;
    let key = |index: usize| -> Key {
        let e = &model.elements[index];
        let normals = e.shape == Shape::Face && model.corners(index).iter().all(|c| c.normal != NONE);
        (e.group, e.shape, e.material, normals)
    };
    let mut order: Vec<(Key, u32)> = (0..model.elements.len()).map(|i| (key(i), i as u32)).collect();
    // Stable: elements keep the file's order within a primitive. Faces come before lines and points.
    order.sort_by_key(|(key, _)| *key);
    let mut builder = Builder {
        model,
        settings,
        chains: vec![NONE; model.positions.len()],
        entries: Vec::new(),
        triangulator: Triangulator::default(),
        crossing: Counted::default(),
        too_much: Counted::default(),
    };
    let mut out = Vec::new();
    let mut missing = 0;
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        let key = run[0].0;
        let primitive = builder.primitive(key, run);
        missing += if key.1 == Shape::Face && !key.3 { run.len() } else { 0 };
        if !primitive.indices.is_empty() {
            out.push((key.0, primitive));
        }
    }
    if missing > 0 {
        let how = match model.has_smoothing {
            true => "they are made from the smoothing groups".to_string(),
            false => {
                format!("edges of up to {:.0}° are smooth (option smooth)", settings.smooth_rad.to_degrees())
            }
        };
        notes.warn("f", format!("{} without normals; {how}", count(missing, "face")));
    }
    let Builder { crossing, too_much, .. } = builder;
    if crossing.count > 0 {
        let what = format!(
            "{} crossing itself or without area; the triangles are a guess",
            count(crossing.count, "face")
        );
        notes.warn(format!("line {}", crossing.line), what);
    }
    if too_much.count > 0 {
        let what = format!(
            "{} with too many corners to be cut properly, made into fans",
            count(too_much.count, "face")
        );
        notes.warn(format!("line {}", too_much.line), what);
    }
    Ok(out)
}

#[derive(Default)]
struct Counted {
    count: usize,
    line: u32,
}

impl Counted {
    fn add(&mut self, line: u32) {
        if self.count == 0 {
            self.line = line;
        }
        self.count += 1;
    }
}

/// Vertices found so far at a position, as a chain.
struct Entry {
    uv: u32,
    normal: u32,
    vertex: u32,
    next: u32,
}

/// Longer chains are not searched: the corner gets a vertex of its own, and the time stays proportional to the file.
const MAX_CHAIN: usize = 64;

struct Builder<'a> {
    model: &'a Model,
    settings: &'a Settings,
    /// By position, the first of its entries; emptied after each primitive.
    chains: Vec<u32>,
    entries: Vec<Entry>,
    triangulator: Triangulator,
    crossing: Counted,
    too_much: Counted,
}

/// What the vertices of a primitive have beside their places.
#[derive(Clone, Copy)]
struct Attributes {
    normals: bool,
    uvs: bool,
    colors: bool,
}

impl Builder<'_> {
    fn primitive(&mut self, key: Key, run: &[(Key, u32)]) -> Primitive {
        let (_, shape, material, has_normals) = key;
        let model = self.model;
        let used = || run.iter().flat_map(|(_, index)| model.corners(*index as usize));
        let attributes = Attributes {
            normals: has_normals,
            uvs: used().any(|c| c.uv != NONE),
            colors: !model.colors.is_empty()
                && used().any(|c| model.colors[c.position as usize] != Vec3::ONE),
        };
        let mut out = Primitive {
            topology: match shape {
                Shape::Face => Topology::Triangles,
                Shape::Line => Topology::Lines,
                Shape::Point => Topology::Points,
            },
            material: Some(material),
            ..Primitive::default()
        };
        let indices = |(_, index): &(Key, u32)| match (shape, model.corners(*index as usize).len()) {
            (Shape::Face, n) => n.saturating_sub(2) * 3,
            (Shape::Line, n) => n.saturating_sub(1) * 2,
            (Shape::Point, n) => n,
        };
        out.indices.reserve_exact(run.iter().map(indices).sum());
        // By triangle, where normals are to be made.
        let mut smoothing = Vec::new();
        for (_, index) in run {
            self.list(*index as usize, shape, &mut out, attributes);
            if shape == Shape::Face && !has_normals && model.has_smoothing {
                smoothing.resize(out.indices.len() / 3, model.elements[*index as usize].smoothing);
            }
        }
        for corner in used() {
            self.chains[corner.position as usize] = NONE;
        }
        self.entries.clear();
        if shape == Shape::Face && !has_normals {
            match self.model.has_smoothing {
                true => smooth::normals(&mut out, 0.0, Some(&smoothing)),
                false => smooth::normals(&mut out, self.settings.smooth_rad, None),
            }
        } else if has_normals {
            repair_normals(&mut out);
        }
        out
    }

    /// Adds an element as triangles, segments or points: corner by corner, as a list of all would be as large as the mesh.
    fn list(&mut self, index: usize, shape: Shape, out: &mut Primitive, attributes: Attributes) {
        let model = self.model;
        let corners = model.corners(index);
        match shape {
            Shape::Point => corners.iter().for_each(|c| self.corner(out, *c, attributes)),
            Shape::Line => {
                corners.windows(2).flatten().for_each(|c| self.corner(out, *c, attributes));
            }
            Shape::Face => {
                let mut triangulator = std::mem::take(&mut self.triangulator);
                let place = |i: usize| model.positions[corners[i].position as usize];
                let how = triangulator.cut(corners.len(), place, |triangle| {
                    triangle.iter().for_each(|i| self.corner(out, corners[*i as usize], attributes));
                });
                self.triangulator = triangulator;
                let line = model.elements[index].line;
                match how {
                    Cut::Whole => {}
                    Cut::Crossing => self.crossing.add(line),
                    Cut::TooMuch => self.too_much.add(line),
                }
            }
        }
    }

    fn corner(&mut self, out: &mut Primitive, corner: Corner, attributes: Attributes) {
        let corner = Corner { normal: if attributes.normals { corner.normal } else { NONE }, ..corner };
        let vertex = self.vertex(out, corner, attributes);
        out.indices.push(vertex);
    }

    /// The vertex of a corner: an equal one of this primitive, or a new one.
    fn vertex(&mut self, out: &mut Primitive, corner: Corner, attributes: Attributes) -> u32 {
        let position = corner.position as usize;
        let mut at = self.chains[position];
        let mut length = 0;
        while at != NONE && length < MAX_CHAIN {
            let entry = &self.entries[at as usize];
            if (entry.uv, entry.normal) == (corner.uv, corner.normal) {
                return entry.vertex;
            }
            at = entry.next;
            length += 1;
        }
        let vertex = out.positions.len() as u32;
        let next = std::mem::replace(&mut self.chains[position], self.entries.len() as u32);
        self.entries.push(Entry { uv: corner.uv, normal: corner.normal, vertex, next });
        let settings = self.settings;
        out.positions
            .push((turned(self.model.positions[position], settings.up_z) * settings.scale).as_vec3());
        if corner.normal != NONE {
            let normal = self.model.normals[corner.normal as usize].as_dvec3();
            out.normals.push(turned(normal, settings.up_z).normalize_or_zero().as_vec3());
        }
        if attributes.uvs {
            // OBJ counts v from the bottom.
            let uv = if corner.uv == NONE { Vec2::ZERO } else { self.model.uvs[corner.uv as usize] };
            out.uvs[0].push(Vec2::new(uv.x, 1.0 - uv.y));
        }
        if attributes.colors {
            let [r, g, b] =
                self.model.colors[position].to_array().map(|c| crate::mtl::linear(c, settings.srgb));
            out.colors.push(Vec4::new(r, g, b, 1.0));
        }
        vertex
    }
}

/// x stays, z goes up, y goes away from the viewer.
fn turned(v: DVec3, up_z: bool) -> DVec3 {
    if up_z { DVec3::new(v.x, v.z, -v.y) } else { v }
}

/// Normals of length zero become those of a triangle that uses them.
fn repair_normals(p: &mut Primitive) {
    if p.normals.iter().all(|n| *n != Vec3::ZERO) {
        return;
    }
    for triangle in p.indices.chunks_exact(3) {
        let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|i| p.positions[i as usize].as_dvec3());
        let face = (b - a).cross(c - a).normalize_or(DVec3::Y).as_vec3().normalize_or(Vec3::Y);
        for i in triangle {
            let normal = &mut p.normals[*i as usize];
            if *normal == Vec3::ZERO {
                *normal = face;
            }
        }
    }
}
