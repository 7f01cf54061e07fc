//! Faces to indexed primitives: one a group and material.

use crate::parse::{Model, NONE, Shape};
use choreo_import::polygon::{Cut, Triangulator};
use choreo_import::text::count;
use choreo_import::{Notes, smooth};
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
pub fn build(model: &Model, settings: &Settings, notes: &Notes) -> Vec<(u32, Primitive)> {
    let key = |index: usize| -> Key {
        let e = &model.elements[index];
        let normals =
            e.shape == Shape::Face && model.corners(index).iter().all(|v| model.normal(*v).is_some());
        (e.group, e.shape, e.material, normals)
    };
    let mut order: Vec<(Key, u32)> = (0..model.elements.len()).map(|i| (key(i), i as u32)).collect();
    // Stable: elements keep the file's order within a primitive. Faces come before lines and points.
    order.sort_by_key(|(key, _)| *key);
    let mut builder = Builder {
        model,
        settings,
        own: vec![NONE; model.vertex_count()],
        triangulator: Triangulator::default(),
        scratch: (Vec::new(), Vec::new()),
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
    out
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

struct Builder<'a> {
    model: &'a Model,
    settings: &'a Settings,
    /// By vertex of the file, that of the primitive; emptied after each primitive.
    own: Vec<u32>,
    triangulator: Triangulator,
    scratch: (Vec<DVec3>, Vec<[u32; 3]>),
    crossing: Counted,
    too_much: Counted,
}

impl Builder<'_> {
    fn primitive(&mut self, key: Key, run: &[(Key, u32)]) -> Primitive {
        let (_, shape, material, has_normals) = key;
        let mut corners: Vec<u32> = Vec::new();
        // By triangle, where normals are to be made.
        let mut smoothing = Vec::new();
        for (_, index) in run {
            let before = corners.len();
            self.list(*index as usize, shape, &mut corners);
            if shape == Shape::Face && !has_normals {
                let group = self.model.elements[*index as usize].smoothing;
                smoothing.resize(smoothing.len() + (corners.len() - before) / 3, group);
            }
        }
        let mut out = Primitive {
            topology: match shape {
                Shape::Face => Topology::Triangles,
                Shape::Line => Topology::Lines,
                Shape::Point => Topology::Points,
            },
            material: Some(material),
            indices: Vec::with_capacity(corners.len()),
            ..Primitive::default()
        };
        let colored = self.model.has_colors && corners.iter().any(|v| self.model.color(*v) != Vec3::ONE);
        let textured = corners.iter().any(|v| self.model.uv(*v).is_some());
        for vertex in &corners {
            let own = &mut self.own[*vertex as usize];
            if *own == NONE {
                *own = out.positions.len() as u32;
                add(&mut out, self.model, *vertex, self.settings, [has_normals, textured, colored]);
            }
            out.indices.push(*own);
        }
        for vertex in corners {
            self.own[vertex as usize] = NONE;
        }
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

    /// An element's corners as a list of triangles, segments or points.
    fn list(&mut self, index: usize, shape: Shape, out: &mut Vec<u32>) {
        let corners = self.model.corners(index);
        match shape {
            Shape::Point => out.extend(corners),
            Shape::Line => out.extend(corners.windows(2).flatten()),
            Shape::Face if corners.len() == 3 => out.extend(corners),
            Shape::Face => {
                let (points, triangles) = &mut self.scratch;
                points.clear();
                triangles.clear();
                points.extend(corners.iter().map(|v| self.model.position(*v)));
                let line = self.model.elements[index].line;
                match self.triangulator.cut(points, triangles) {
                    Cut::Whole => {}
                    Cut::Crossing => self.crossing.add(line),
                    Cut::TooMuch => self.too_much.add(line),
                }
                out.extend(triangles.iter().flatten().map(|i| corners[*i as usize]));
            }
        }
    }
}

/// Adds one of the file's vertices to a primitive, with the parts that the primitive has.
fn add(
    out: &mut Primitive,
    model: &Model,
    vertex: u32,
    settings: &Settings,
    [normals, uvs, colors]: [bool; 3],
) {
    out.positions.push((turned(model.position(vertex), settings.up_z) * settings.scale).as_vec3());
    if normals {
        let normal = model.normal(vertex).unwrap_or_default().as_dvec3();
        out.normals.push(turned(normal, settings.up_z).normalize_or_zero().as_vec3());
    }
    if uvs {
        // OBJ counts v from the bottom.
        let uv = model.uv(vertex).unwrap_or_default();
        out.uvs[0].push(Vec2::new(uv.x, 1.0 - uv.y));
    }
    if colors {
        let [r, g, b] = model.color(vertex).to_array().map(|c| crate::mtl::linear(c, settings.srgb));
        out.colors.push(Vec4::new(r, g, b, 1.0));
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
