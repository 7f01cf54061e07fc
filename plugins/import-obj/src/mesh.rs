//! Faces become indexed primitives, one for each group and material.

use crate::parse::{Model, NO_INDEX, Shape};
use choreo_asset::{Primitive, Topology};
use choreo_importer_kit::color::linear_channel;
use choreo_importer_kit::polygon::{Cut, Triangulator};
use choreo_importer_kit::text::count;
use choreo_importer_kit::{Notes, normals, smooth};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// How positions become metres, how missing normals are made, and how colors are read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    pub scale: f64,
    pub up_z: bool,
    /// Largest angle of a smooth edge, for faces with neither normals nor smoothing groups.
    pub smooth_rad: f64,
    /// Vertex colors are sRGB, not linear.
    pub srgb: bool,
}

/// Key of a primitive: group, shape, material, and whether its face vertices have normals.
type Key = (u32, Shape, u32, bool);

/// Primitives, each with its group: sorted by group, shape, and material in the file's order.
pub(crate) fn build(model: &Model, settings: &Settings, notes: &Notes) -> Vec<(u32, Primitive)> {
    let key = |index: usize| -> Key {
        let e = &model.elements[index];
        let normals =
            e.shape == Shape::Face && model.face_vertices(index).iter().all(|v| model.normal(*v).is_some());
        (e.group, e.shape, e.material, normals)
    };
    let mut order: Vec<(Key, u32)> = (0..model.elements.len()).map(|i| (key(i), i as u32)).collect();
    // The sort is stable, so elements keep the file's order within a primitive. Faces come before lines and points.
    order.sort_by_key(|(key, _)| *key);
    let mut builder = Builder {
        model,
        settings,
        index_in_primitive: vec![NO_INDEX; model.vertex_count()],
        triangulator: Triangulator::default(),
        crossing: LineTally::default(),
        too_much: LineTally::default(),
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
            "{} with too many vertices to triangulate properly, cut into triangle fans",
            count(too_much.count, "face")
        );
        notes.warn(format!("line {}", too_much.line), what);
    }
    out
}

#[derive(Default)]
struct LineTally {
    count: usize,
    line: u32,
}

impl LineTally {
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
    /// The primitive's vertex for each vertex of the file; cleared after each primitive.
    index_in_primitive: Vec<u32>,
    triangulator: Triangulator,
    crossing: LineTally,
    too_much: LineTally,
}

/// The attributes of a primitive's vertices besides their positions.
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
        let used = || run.iter().flat_map(|(_, index)| model.face_vertices(*index as usize));
        let attributes = Attributes {
            normals: has_normals,
            uvs: used().any(|v| model.uv(*v).is_some()),
            colors: model.has_colors && used().any(|v| model.color(*v) != Vec3::ONE),
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
        let indices = |(_, index): &(Key, u32)| match (shape, model.face_vertices(*index as usize).len()) {
            (Shape::Face, n) => n.saturating_sub(2) * 3,
            (Shape::Line, n) => n.saturating_sub(1) * 2,
            (Shape::Point, n) => n,
        };
        out.indices.reserve_exact(run.iter().map(indices).sum());
        // Smoothing group of each triangle, where normals are computed.
        let mut smoothing = Vec::new();
        for (_, index) in run {
            self.list(*index as usize, shape, &mut out, attributes);
            if shape == Shape::Face && !has_normals && model.has_smoothing {
                smoothing.resize(out.indices.len() / 3, model.elements[*index as usize].smoothing);
            }
        }
        for vertex in used() {
            self.index_in_primitive[*vertex as usize] = NO_INDEX;
        }
        if shape == Shape::Face && !has_normals {
            match self.model.has_smoothing {
                true => smooth::normals(&mut out, 0.0, Some(&smoothing)),
                false => smooth::normals(&mut out, self.settings.smooth_rad, None),
            }
        } else if has_normals {
            normals::replace_zero(&mut out);
        }
        out
    }

    /// Adds an element as triangles, segments or points, one vertex at a time: a list of them all would be as large as the mesh.
    fn list(&mut self, index: usize, shape: Shape, out: &mut Primitive, attributes: Attributes) {
        let model = self.model;
        let face_vertices = model.face_vertices(index);
        match shape {
            Shape::Point => face_vertices.iter().for_each(|c| self.face_vertex(out, *c, attributes)),
            Shape::Line => {
                face_vertices.windows(2).flatten().for_each(|c| self.face_vertex(out, *c, attributes));
            }
            Shape::Face => {
                let mut triangulator = std::mem::take(&mut self.triangulator);
                let place = |i: usize| model.position(face_vertices[i]);
                let how = triangulator.triangulate(face_vertices.len(), place, |triangle| {
                    triangle
                        .iter()
                        .for_each(|i| self.face_vertex(out, face_vertices[*i as usize], attributes));
                });
                self.triangulator = triangulator;
                let line = model.elements[index].line;
                match how {
                    Cut::Whole => {}
                    Cut::Crossing => self.crossing.add(line),
                    Cut::OverBudget => self.too_much.add(line),
                }
            }
        }
    }

    /// Adds the index of a vertex of the file, and the vertex itself where the primitive does not have it yet.
    fn face_vertex(&mut self, out: &mut Primitive, vertex: u32, attributes: Attributes) {
        let own = &mut self.index_in_primitive[vertex as usize];
        if *own == NO_INDEX {
            *own = out.positions.len() as u32;
            add(out, self.model, vertex, self.settings, attributes);
        }
        out.indices.push(*own);
    }
}

/// Adds a vertex of the file to a primitive, with the primitive's attributes.
fn add(out: &mut Primitive, model: &Model, vertex: u32, settings: &Settings, attributes: Attributes) {
    out.positions.push((to_y_up(model.position(vertex), settings.up_z) * settings.scale).as_vec3());
    if attributes.normals {
        let normal = model.normal(vertex).unwrap_or_default().as_dvec3();
        out.normals.push(to_y_up(normal, settings.up_z).normalize_or_zero().as_vec3());
    }
    if attributes.uvs {
        // OBJ has v pointing up; here it points down.
        let uv = model.uv(vertex).unwrap_or_default();
        out.uvs[0].push(Vec2::new(uv.x, 1.0 - uv.y));
    }
    if attributes.colors {
        let [r, g, b] = model.color(vertex).to_array().map(|c| linear_channel(c, settings.srgb));
        out.colors.push(Vec4::new(r, g, b, 1.0));
    }
}

/// +Z up to +Y up: x stays, z becomes y, y becomes −z.
fn to_y_up(v: DVec3, up_z: bool) -> DVec3 {
    if up_z { DVec3::new(v.x, v.z, -v.y) } else { v }
}
