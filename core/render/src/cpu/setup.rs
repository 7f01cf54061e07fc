//! Primitive assembly: clip-space triangles, lines and points → screen triangles ready to be rasterized.

use super::vertex::Vertex;
use crate::plan::{Features, PipelineKey, TopologyKey};
use glam::{DVec3, DVec4, Vec4};
use rayon::prelude::*;

/// Subpixel steps per pixel: Vulkan's `subPixelPrecisionBits` = 8, as on lavapipe and common GPUs.
pub(crate) const SUBPIXEL: i32 = 256;

/// A screen triangle. Coverage uses positions snapped to subpixels; interpolation uses the exact positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// Fixed point, y down. The vertices are reordered where needed, so that the signed area is positive.
    pub x: [i32; 3],
    pub y: [i32; 3],
    /// Pixel that `edges` and `depth` are relative to.
    pub origin: [i32; 2],
    /// e_i(x, y) = e[0]·x + e[1]·y + e[2] at a pixel corner; e_i / Σe are the perspective-correct weights.
    pub edges: [[f32; 3]; 3],
    /// Depth, linear in screen space.
    pub depth: [f32; 3],
    pub vertices: [u32; 3],
    pub front: bool,
}

impl Triangle {
    /// Bounds of the pixels whose samples the triangle may cover: [x0, x1) × [y0, y1), not clamped to the image.
    pub(super) fn pixel_bounds(&self) -> [i32; 4] {
        let low = |v: [i32; 3]| v[0].min(v[1]).min(v[2]).div_euclid(SUBPIXEL);
        let high = |v: [i32; 3]| v[0].max(v[1]).max(v[2]).div_euclid(SUBPIXEL) + 1;
        [low(self.x), low(self.y), high(self.x), high(self.y)]
    }
}

pub(crate) struct PrimitiveAssembly<'a> {
    pub vertices: &'a [Vertex],
    pub indices: &'a [u32],
    pub pipeline: PipelineKey,
    pub size: [u32; 2],
}

/// Half the side of the guard band, in pixels from the center of the image: 2¹⁵, so that an edge's step fits 24 bits.
const GUARD_PIXELS: f64 = 32768.0;

impl PrimitiveAssembly<'_> {
    /// Triangles in index order.
    pub(super) fn run(&self) -> Vec<Triangle> {
        let vertices_per_primitive = match self.pipeline.topology {
            TopologyKey::Triangles => 3,
            TopologyKey::Lines => 2,
            TopologyKey::Points => 1,
        };
        let complete = self.indices.len() - self.indices.len() % vertices_per_primitive;
        let chunks: Vec<Vec<Triangle>> = self.indices[..complete]
            .par_chunks(vertices_per_primitive * 2048)
            .map(|chunk| self.assemble(chunk))
            .collect();
        chunks.concat()
    }

    fn assemble(&self, indices: &[u32]) -> Vec<Triangle> {
        let mut out = Vec::new();
        let clip = |i: u32| self.vertices[i as usize].clip;
        match self.pipeline.topology {
            TopologyKey::Triangles => {
                for i in indices.chunks_exact(3) {
                    let ids = [i[0], i[1], i[2]];
                    self.clip_triangle(ids.map(clip), ids, false, &mut out);
                }
            }
            TopologyKey::Lines => {
                for i in indices.chunks_exact(2) {
                    self.assemble_line(i[0], i[1], &mut out);
                }
            }
            TopologyKey::Points => {
                for &i in indices {
                    self.assemble_point(i, &mut out);
                }
            }
        }
        out
    }

    /// A line one pixel wide is a rectangle around it (Vulkan 1.3, "Basic Line Segment Rasterization").
    fn assemble_line(&self, a: u32, b: u32, out: &mut Vec<Triangle>) {
        let [ca, cb] = [a, b].map(|i| self.vertices[i as usize].clip);
        let [w, h] = self.size.map(|s| s as f32);
        // Direction on screen of a segment that may pass behind the camera: d(xy/w) is proportional to this.
        let x = (cb.x * ca.w - ca.x * cb.w) * w;
        let y = (cb.y * ca.w - ca.y * cb.w) * h;
        let length = (x * x + y * y).sqrt();
        if length.is_nan() || length <= 0.0 {
            return;
        }
        // The offset is half a pixel sideways; clip space spans two units over the image. It is linear in w, so it is also
        // correct behind the camera.
        let side =
            |c: Vec4, s: f32| c + Vec4::new(-y / length / w * c.w * s, x / length / h * c.w * s, 0.0, 0.0);
        let (a0, a1, b0, b1) = (side(ca, 1.0), side(ca, -1.0), side(cb, 1.0), side(cb, -1.0));
        self.clip_triangle([a0, a1, b0], [a, a, b], true, out);
        self.clip_triangle([b0, a1, b1], [b, a, b], true, out);
    }

    /// A point is a pixel-sized square (gl_PointSize 1).
    fn assemble_point(&self, i: u32, out: &mut Vec<Triangle>) {
        let c = self.vertices[i as usize].clip;
        let [w, h] = self.size.map(|s| s as f32);
        let corner = |x: f32, y: f32| c + Vec4::new(x / w * c.w, y / h * c.w, 0.0, 0.0);
        let [p, q, r, s] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)];
        self.clip_triangle([p, q, r], [i; 3], true, out);
        self.clip_triangle([r, q, s], [i; 3], true, out);
    }

    fn clip_triangle(&self, clip: [Vec4; 3], ids: [u32; 3], both_faces: bool, out: &mut Vec<Triangle>) {
        if !clip.iter().all(|c| c.is_finite()) {
            return;
        }
        let all_vertices = |f: fn(&Vec4) -> bool| clip.iter().all(f);
        if all_vertices(|c| c.x > c.w)
            || all_vertices(|c| c.x < -c.w)
            || all_vertices(|c| c.y > c.w)
            || all_vertices(|c| c.y < -c.w)
            || all_vertices(|c| c.z > c.w)
            || all_vertices(|c| c.z < 0.0)
        {
            return;
        }
        let both_faces = both_faces || self.pipeline.double_sided;
        let [w, h] = self.size.map(|s| f64::from(s) * 0.5);
        let guard = [GUARD_PIXELS / w, GUARD_PIXELS / h].map(|g| g as f32);
        let inside = clip.iter().all(|c| {
            c.w > 0.0
                && c.z <= c.w
                && c.z >= 0.0
                && c.x.abs() <= guard[0] * c.w
                && c.y.abs() <= guard[1] * c.w
        });
        let exact = clip.map(|c| c.as_dvec4());
        let snap = |c: DVec4| {
            let x = (c.x / c.w + 1.0) * w * f64::from(SUBPIXEL);
            let y = (c.y / c.w + 1.0) * h * f64::from(SUBPIXEL);
            (x.round() as i32, y.round() as i32)
        };
        if inside {
            self.push_screen_triangle(&exact, exact.map(snap), ids, both_faces, out);
            return;
        }
        let polygon = clip_polygon(exact.to_vec(), guard.map(f64::from));
        if polygon.iter().any(|c| c.w <= 0.0) {
            return;
        }
        let points: Vec<(i32, i32)> = polygon.into_iter().map(snap).collect();
        for i in 2..points.len() {
            self.push_screen_triangle(&exact, [points[0], points[i - 1], points[i]], ids, both_faces, out);
        }
    }

    /// Adds a screen triangle that interpolates the attributes of the whole, unclipped triangle: homogeneous rasterization
    /// (Olano & Greer, "Triangle Scan Conversion using 2D Homogeneous Coordinates", 1997) needs no clipped attributes.
    fn push_screen_triangle(
        &self,
        clip: &[DVec4; 3],
        p: [(i32, i32); 3],
        ids: [u32; 3],
        both_faces: bool,
        out: &mut Vec<Triangle>,
    ) {
        let area = (i64::from(p[1].0) - i64::from(p[0].0)) * (i64::from(p[2].1) - i64::from(p[0].1))
            - (i64::from(p[1].1) - i64::from(p[0].1)) * (i64::from(p[2].0) - i64::from(p[0].0));
        if area == 0 {
            return;
        }
        // Counter-clockwise with y up is a negative area with y down.
        let front = (area < 0) != self.pipeline.mirrored;
        // An inverted-hull outline shows its back faces.
        let is_visible_face = front != self.pipeline.features.has(Features::OUTLINE);
        if !is_visible_face && !both_faces {
            return;
        }
        let (mut x, mut y) = (p.map(|p| p.0), p.map(|p| p.1));
        if area < 0 {
            x.swap(1, 2);
            y.swap(1, 2);
        }
        let mut t =
            Triangle { x, y, origin: [0; 2], edges: [[0.0; 3]; 3], depth: [0.0; 3], vertices: ids, front };
        let [x0, y0, x1, y1] = t.pixel_bounds();
        let [width, height] = self.size.map(|s| s as i32);
        if x1 <= 0 || y1 <= 0 || x0 >= width || y0 >= height {
            return;
        }
        t.origin = [x0.clamp(0, width - 1), y0.clamp(0, height - 1)];
        // Homogeneous screen coordinates relative to the origin pixel: (x·w, y·w, w).
        let [w, h] = self.size.map(|s| f64::from(s) * 0.5);
        let q = clip.map(|c| {
            DVec3::new(
                (c.x + c.w) * w - f64::from(t.origin[0]) * c.w,
                (c.y + c.w) * h - f64::from(t.origin[1]) * c.w,
                c.w,
            )
        });
        let e = [q[1].cross(q[2]), q[2].cross(q[0]), q[0].cross(q[1])];
        let determinant = q[0].dot(e[0]);
        // This scale makes Σ eᵢ·wᵢ = 1 everywhere, so that depth = Σ eᵢ·zᵢ.
        let e = e.map(|e| e / determinant);
        let depth = e[0] * clip[0].z + e[1] * clip[1].z + e[2] * clip[2].z;
        if !(e.iter().all(|e| e.is_finite()) && depth.is_finite()) {
            return;
        }
        t.edges = e.map(|e| e.as_vec3().to_array());
        t.depth = depth.as_vec3().to_array();
        out.push(t);
    }
}

/// Sutherland–Hodgman in f64 against near (z ≤ w), far (z ≥ 0) and the guard band. Intersections are computed from the
/// inside to the outside vertex, so that neighbors sharing an edge get the same point.
fn clip_polygon(mut polygon: Vec<DVec4>, guard: [f64; 2]) -> Vec<DVec4> {
    let planes = [
        DVec4::new(0.0, 0.0, -1.0, 1.0),
        DVec4::new(0.0, 0.0, 1.0, 0.0),
        DVec4::new(-1.0, 0.0, 0.0, guard[0]),
        DVec4::new(1.0, 0.0, 0.0, guard[0]),
        DVec4::new(0.0, -1.0, 0.0, guard[1]),
        DVec4::new(0.0, 1.0, 0.0, guard[1]),
    ];
    for plane in planes {
        let distance: Vec<f64> = polygon.iter().map(|p| p.dot(plane)).collect();
        let mut inside = Vec::with_capacity(polygon.len() + 1);
        for i in 0..polygon.len() {
            let j = (i + 1) % polygon.len();
            let (di, dj) = (distance[i], distance[j]);
            if di >= 0.0 {
                inside.push(polygon[i]);
            }
            if (di >= 0.0) != (dj >= 0.0) {
                let (from, to, df, dt) = if di >= 0.0 { (i, j, di, dj) } else { (j, i, dj, di) };
                inside.push(polygon[from] + (polygon[to] - polygon[from]) * (df / (df - dt)));
            }
        }
        polygon = inside;
        if polygon.len() < 3 {
            return Vec::new();
        }
    }
    polygon
}
