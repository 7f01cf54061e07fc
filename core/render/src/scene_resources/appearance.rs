//! Compares the appearance of a model with that of a simplified version: small images from all sides, at several pixel sizes.
//!
//! After P. Lindstrom, G. Turk, "Image-Driven Simplification", ACM TOG 2000: a bound of the geometric error does not detect a
//! head that pokes through its helmet, or a stripe that has got the color of the trousers.

use crate::scene_resources::simplify::{Model, ModelPrimitive};
use glam::{Mat3, Vec2, Vec3, Vec4};
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

/// Pixels along each side of the finest images, a power of two.
const IMAGE_SIDE: usize = 256;
/// Number of pixel sizes, each twice the one before.
const PIXEL_SIZES: usize = 7;
/// Limits of visible differences, as shares of 1: mean difference of coverage and mean difference of color over the pixels that
/// show the model, and largest difference of the mean color of two by two pixels.
const MAX_COVERAGE_DIFFERENCE: f32 = 0.06;
const MAX_COLOR_DIFFERENCE: f32 = 0.03;
const MAX_LOCAL_DIFFERENCE: f32 = 0.25;
/// Depth in pixels by which a visible vertex may lie behind the center of its pixel: in one of the views its surface is less than
/// 35° from facing the viewer.
const VISIBLE_DEPTH: f32 = 0.6;
/// Directions from which the model is seen: the faces and corners of a cube.
const DIRECTIONS: [Vec3; 14] = [
    Vec3::X,
    Vec3::Y,
    Vec3::Z,
    Vec3::NEG_X,
    Vec3::NEG_Y,
    Vec3::NEG_Z,
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(1.0, 1.0, -1.0),
    Vec3::new(1.0, -1.0, 1.0),
    Vec3::new(1.0, -1.0, -1.0),
    Vec3::new(-1.0, 1.0, 1.0),
    Vec3::new(-1.0, 1.0, -1.0),
    Vec3::new(-1.0, -1.0, 1.0),
    Vec3::new(-1.0, -1.0, -1.0),
];

/// Simplified triangles of a part.
pub(super) struct Shape {
    pub indices: Vec<u32>,
    /// One for each vertex of the part, in model space.
    pub positions: Vec<Vec3>,
}

/// Triangles of a part to draw.
#[derive(Clone, Copy)]
struct PartTriangles<'a> {
    part: &'a ModelPrimitive,
    indices: &'a [u32],
    positions: &'a [Vec3],
}

/// Images of a model from all directions.
pub(super) struct Appearance {
    views: Vec<View>,
    /// Width of a pixel of the finest images in metres.
    pixel: f32,
}

struct View {
    /// x right, y up in pixels, z towards the viewer.
    pixels_from_model: (Mat3, Vec3),
    /// Color times coverage, and coverage, at each pixel size, the finest first.
    images: Vec<Vec<Vec4>>,
    /// Whether each vertex of each part can be seen.
    visible: Vec<Vec<bool>>,
}

impl Appearance {
    pub(super) fn new(model: &Model) -> Appearance {
        let pixel = model.size / IMAGE_SIDE as f32;
        let drawn: Vec<PartTriangles> = model
            .parts
            .iter()
            .map(|part| PartTriangles {
                part,
                indices: &part.primitive().indices,
                positions: &part.positions,
            })
            .collect();
        let view = |direction: &Vec3| {
            let pixels_from_model = orthographic_view(*direction, model, pixel);
            let (finest, nearest) = draw_triangles(&drawn, pixels_from_model);
            let visible =
                drawn.iter().map(|d| visible_points(d.positions, pixels_from_model, &nearest)).collect();
            View { pixels_from_model, images: pyramid(finest), visible }
        };
        Appearance { views: DIRECTIONS.par_iter().map(view).collect(), pixel }
    }

    /// Whether each vertex of each part is hidden from all sides.
    pub(super) fn hidden(&self) -> Vec<Vec<bool>> {
        let part = |part: usize| {
            let visible = |v: usize| self.views.iter().any(|view| view.visible[part][v]);
            (0..self.views[0].visible[part].len()).map(|v| !visible(v)).collect()
        };
        (0..self.views[0].visible.len()).map(part).collect()
    }

    /// The smallest pixel size in metres from which other shapes of the parts look like the model; `None` if none does.
    pub(crate) fn smallest_pixel(&self, model: &Model, shapes: &[Shape]) -> Option<f32> {
        let drawn: Vec<PartTriangles> = model
            .parts
            .iter()
            .zip(shapes)
            .map(|(part, shape)| PartTriangles { part, indices: &shape.indices, positions: &shape.positions })
            .collect();
        let compared = |view: &View| {
            let images = pyramid(draw_triangles(&drawn, view.pixels_from_model).0);
            let compare = |size: usize| Difference::of(&view.images[size], &images[size]);
            (0..PIXEL_SIZES).map(compare).collect::<Vec<_>>()
        };
        let by_view: Vec<Vec<Difference>> = self.views.par_iter().map(compared).collect();
        // Difference as a share of the allowed one, for each pixel size.
        let excess: Vec<f32> = (0..PIXEL_SIZES)
            .map(|size| {
                let all = || by_view.iter().map(|view| &view[size]);
                let pixels: f32 = all().map(|d| d.covered_pixels).sum::<f32>().max(1.0);
                let shape = all().map(|d| d.coverage).sum::<f32>() / pixels;
                let color = all().map(|d| d.color).sum::<f32>() / pixels;
                let worst = all().map(|d| d.max_mean_color).fold(0.0, f32::max);
                (shape / MAX_COVERAGE_DIFFERENCE)
                    .max(color / MAX_COLOR_DIFFERENCE)
                    .max(worst / MAX_LOCAL_DIFFERENCE)
            })
            .collect();
        let first = excess.iter().rposition(|e| *e > 1.0).map_or(0, |last| last + 1);
        let wide = |size: f32| self.pixel * libm::exp2f(size);
        match first {
            0 => Some(wide(0.0)),
            PIXEL_SIZES => None,
            _ => {
                // Interpolated between the two pixel sizes.
                let [above, below] = [excess[first - 1], excess[first].max(1e-6)].map(libm::log2f);
                Some(wide((first - 1) as f32 + above / (above - below)))
            }
        }
    }
}

/// Differences between two images of one size.
struct Difference {
    /// Number of pixels that either image covers.
    covered_pixels: f32,
    /// Sum of the differences of coverage.
    coverage: f32,
    /// Sum of the differences of color where both images are covered.
    color: f32,
    /// Largest difference of the mean color of two by two pixels where both images are covered.
    max_mean_color: f32,
}

impl Difference {
    fn of(a: &[Vec4], b: &[Vec4]) -> Difference {
        let of_color = |a: &Vec4, b: &Vec4| match a.w > 0.0 && b.w > 0.0 {
            true => a.w.min(b.w) * (a.truncate() / a.w - b.truncate() / b.w).abs().max_element(),
            false => 0.0,
        };
        let covered = || a.iter().zip(b).filter(|(a, b)| a.w > 0.0 || b.w > 0.0);
        let [halves_a, halves_b] = [a, b].map(half_size);
        Difference {
            covered_pixels: covered().count() as f32,
            coverage: covered().map(|(a, b)| (a.w - b.w).abs()).sum(),
            color: covered().map(|(a, b)| of_color(a, b)).sum(),
            max_mean_color: halves_a.iter().zip(&halves_b).map(|(a, b)| of_color(a, b)).fold(0.0, f32::max),
        }
    }
}

/// Orthographic view of the whole model: rotation with scale, and offset, from model space to pixels.
fn orthographic_view(direction: Vec3, model: &Model, pixel: f32) -> (Mat3, Vec3) {
    let back = direction.normalize();
    let up = if back.y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
    let right = up.cross(back).normalize();
    let up = back.cross(right);
    let rotation = Mat3::from_cols(right, up, back).transpose() * (1.0 / pixel);
    let all = choreo_asset::Aabb::of(model.parts.iter().flat_map(|part| part.positions.iter().copied()));
    let half = IMAGE_SIDE as f32 * 0.5;
    (rotation, Vec3::new(half, half, 0.0) - rotation * all.center())
}

/// Whether each point lies on the nearest surface of its pixel.
fn visible_points(points: &[Vec3], (rotation, offset): (Mat3, Vec3), nearest: &[f32]) -> Vec<bool> {
    let visible = |point: &Vec3| {
        let here = rotation * *point + offset;
        let [x, y] = [here.x, here.y].map(|c| (c as usize).min(IMAGE_SIDE - 1));
        here.z >= nearest[y * IMAGE_SIDE + x] - VISIBLE_DEPTH
    };
    points.iter().map(visible).collect()
}

/// The image, and the depth of the nearest surface at each pixel, greater towards the viewer.
fn draw_triangles(drawn: &[PartTriangles], (rotation, offset): (Mat3, Vec3)) -> (Vec<Vec4>, Vec<f32>) {
    let mut nearest = vec![f32::NEG_INFINITY; IMAGE_SIDE * IMAGE_SIDE];
    let mut ids = vec![(u32::MAX, 0); IMAGE_SIDE * IMAGE_SIDE];
    let mut points: Vec<Vec<Vec3>> = Vec::new();
    for (part, d) in (0..).zip(drawn) {
        let here: Vec<Vec3> = d.positions.iter().map(|p| rotation * *p + offset).collect();
        for (index, triangle) in (0..).zip(d.indices.chunks_exact(3)) {
            let vertices = [triangle[0], triangle[1], triangle[2]].map(|v| here[v as usize]);
            each_pixel(vertices, |at, weights| {
                let depth = weights.dot(Vec3::from_array(vertices.map(|c| c.z)));
                let cut = d.part.surface_color.cutoff > 0.0
                    && color_at(d, triangle, weights).w < d.part.surface_color.cutoff;
                if depth > nearest[at] && !cut {
                    (nearest[at], ids[at]) = (depth, (part, index));
                }
            });
        }
        points.push(here);
    }
    let mut image = vec![Vec4::ZERO; IMAGE_SIDE * IMAGE_SIDE];
    for (at, (part, index)) in ids.iter().enumerate().filter(|(_, id)| id.0 != u32::MAX) {
        let d = &drawn[*part as usize];
        let triangle = &d.indices[3 * *index as usize..][..3];
        let vertices = [triangle[0], triangle[1], triangle[2]].map(|v| points[*part as usize][v as usize]);
        let center = Vec2::new((at % IMAGE_SIDE) as f32 + 0.5, (at / IMAGE_SIDE) as f32 + 0.5);
        let Some(weights) = weights_at(vertices, center) else { continue };
        let light = rotation.transpose() * Vec3::new(0.3, 0.5, 0.8);
        let normal = |v: &u32| d.part.normals.get(*v as usize).copied().unwrap_or_default();
        let normals = [normal(&triangle[0]), normal(&triangle[1]), normal(&triangle[2])];
        let normal = normals[0] * weights.x + normals[1] * weights.y + normals[2] * weights.z;
        // Light from over the viewer's shoulder; both sides of a surface are lit.
        let lit = 0.3 + 0.7 * normal.normalize_or_zero().dot(light.normalize()).abs();
        image[at] = (color_at(d, triangle, weights).truncate() * lit).extend(1.0);
    }
    (image, nearest)
}

/// Color at a point of a triangle.
fn color_at(d: &PartTriangles, triangle: &[u32], weights: Vec3) -> Vec4 {
    let uvs = d.part.uvs();
    let uv = |v: u32| uvs.get(v as usize).copied().unwrap_or_default();
    let uv = uv(triangle[0]) * weights.x + uv(triangle[1]) * weights.y + uv(triangle[2]) * weights.z;
    let colors = &d.part.primitive().colors;
    let vertex = |v: u32| colors.get(v as usize).copied().unwrap_or(Vec4::ONE);
    let own =
        vertex(triangle[0]) * weights.x + vertex(triangle[1]) * weights.y + vertex(triangle[2]) * weights.z;
    d.part.surface_color.at(uv) * own
}

/// Barycentric coordinates of a point in the image; `None` if the triangle has no area there.
fn weights_at([a, b, c]: [Vec3; 3], at: Vec2) -> Option<Vec3> {
    let [a, b, c] = [a, b, c].map(Vec3::truncate);
    let area = (b - a).perp_dot(c - a);
    let weights = Vec3::new((b - at).perp_dot(c - at), (c - at).perp_dot(a - at), (a - at).perp_dot(b - at));
    (area != 0.0).then(|| weights / area)
}

/// Calls `each` for every pixel whose center lies in a triangle, with its barycentric coordinates.
fn each_pixel(vertices: [Vec3; 3], mut each: impl FnMut(usize, Vec3)) {
    let low = vertices[0].min(vertices[1]).min(vertices[2]) - 0.5;
    let high = vertices[0].max(vertices[1]).max(vertices[2]) - 0.5;
    // Casts to unsigned integers clamp at the left and top edges.
    let first = |v: f32| v.ceil() as usize;
    let end = |v: f32| ((v.floor() + 1.0) as usize).min(IMAGE_SIDE);
    for y in first(low.y)..end(high.y) {
        for x in first(low.x)..end(high.x) {
            let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            match weights_at(vertices, center) {
                Some(weights) if weights.min_element() >= 0.0 => each(y * IMAGE_SIDE + x, weights),
                _ => {}
            }
        }
    }
}

/// An image and its halves, one for each pixel size.
fn pyramid(finest: Vec<Vec4>) -> Vec<Vec<Vec4>> {
    let mut images = vec![finest];
    while images.len() < PIXEL_SIZES {
        images.push(half_size(&images[images.len() - 1]));
    }
    images
}

/// Means of two by two pixels.
fn half_size(image: &[Vec4]) -> Vec<Vec4> {
    let side = image.len().isqrt();
    let pixel = |i: usize| {
        let at = 2 * (i / (side / 2)) * side + 2 * (i % (side / 2));
        (image[at] + image[at + 1] + image[at + side] + image[at + side + 1]) * 0.25
    };
    (0..side / 2 * (side / 2)).map(pixel).collect()
}
