//! Thick lines and points: each is a polygon in the image plane, expanded by the vertex shader. Multisampling smooths its edges
//! like those of any triangle, and no device needs to support wide lines.

use crate::affine::Affine3x4;
use choreo_asset::{LineStyle, Material, Primitive, Topology};
use glam::{Mat4, Vec2, Vec3, Vec4, Vec4Swizzles};

/// Largest line width in pixels: the largest image side.
const MAX_WIDTH_PIXELS: f32 = 16384.0;

/// Width and shape of a material's lines and points; `None` for triangles.
pub(crate) fn line_style(topology: Topology, material: &Material) -> Option<LineStyle> {
    material.line_style.filter(|_| topology != Topology::Triangles)
}

/// Line width as in [`crate::plan::Instance::width`]: pixels, or negative metres. `of_actor` replaces the width of the line
/// style, and `pixel_scale` is the number of image pixels per pixel of the style.
pub(crate) fn relative_width(
    line_style: LineStyle,
    of_actor: Option<f32>,
    relative_from_mesh: &Affine3x4,
    pixel_scale: f32,
) -> f32 {
    let width = of_actor.unwrap_or(line_style.width);
    let width = if width.is_finite() { width.max(0.0) } else { 0.0 };
    match line_style.metres {
        true => {
            // The root mean square of the lengths of the three axes.
            let [x, y, z] = relative_from_mesh.0.map(|row| row.truncate());
            -width * ((x.dot(x) + y.dot(y) + z.dot(z)) / 3.0).sqrt()
        }
        false => (width * pixel_scale).min(MAX_WIDTH_PIXELS),
    }
}

/// Vertices that replace a primitive's own, and their triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ThickMesh {
    /// Index of the primitive's vertex at the same end of the line, one index per vertex.
    pub source_vertices: Vec<u32>,
    /// Index of the primitive's vertex at the other end of the line, one index per vertex; the same vertex for points.
    pub other_ends: Vec<u32>,
    /// Offsets in half widths: x along the line, away from the other end, y across it. z: 0 at the first end, 1 at the second.
    pub offsets: Vec<Vec3>,
    pub indices: Vec<u32>,
}

/// Number of segments of a half disc. A polygon of 32 sides differs from a circle by half a percent of its radius, one of 8 sides
/// by 8 %; if there are many elements, each is small.
fn half_disc_segments(elements: usize) -> usize {
    match elements {
        ..=1_000 => 16,
        1_001..=20_000 => 8,
        _ => 4,
    }
}

/// Points of half a circle from +y over −x to −y.
fn half_circle(segments: usize) -> impl Iterator<Item = Vec2> {
    (0..=segments).map(move |i| {
        let angle = (i as f64 / segments as f64) * std::f64::consts::PI;
        Vec2::new(-libm::sin(angle) as f32, libm::cos(angle) as f32)
    })
}

pub(crate) fn thick_mesh(primitive: &Primitive, round: bool) -> ThickMesh {
    match primitive.topology {
        Topology::Triangles => ThickMesh::default(),
        Topology::Lines => line_polygons(&primitive.indices, round),
        Topology::Points => point_polygons(&primitive.indices, round),
    }
}

/// Each line as a rectangle with round (half discs) or flat ends.
fn line_polygons(indices: &[u32], round: bool) -> ThickMesh {
    let steps = if round { half_disc_segments(indices.len() / 2) } else { 1 };
    let end: Vec<Vec2> = if round { half_circle(steps).collect() } else { vec![Vec2::Y, Vec2::NEG_Y] };
    let count = end.len() as u32;
    let mut out = ThickMesh::default();
    for line in indices.chunks_exact(2) {
        let first = out.source_vertices.len() as u32;
        for (at, own, other) in [(0.0, line[0], line[1]), (1.0, line[1], line[0])] {
            for c in &end {
                out.source_vertices.push(own);
                out.other_ends.push(other);
                let along = if at == 0.0 { c.x } else { -c.x };
                out.offsets.push(Vec3::new(along, c.y, at));
            }
        }
        let (second, last) = (first + count, count - 1);
        out.indices.extend([first, first + last, second, second, first + last, second + last]);
        for base in [first, second] {
            out.indices.extend((1..last).flat_map(|i| [base, base + i, base + i + 1]));
        }
    }
    out
}

/// Each point as a square, or as a polygon with a disc's area.
fn point_polygons(indices: &[u32], round: bool) -> ThickMesh {
    let corners: Vec<Vec2> = match round {
        false => vec![Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0)],
        true => {
            let half = half_disc_segments(indices.len());
            let angle = std::f64::consts::PI / half as f64;
            let grown = libm::sqrt(angle / libm::sin(angle)) as f32;
            let left: Vec<Vec2> = half_circle(half).take(half).map(|c| c * grown).collect();
            left.iter().copied().chain(left.iter().map(|c| -*c)).collect()
        }
    };
    let mut out = ThickMesh::default();
    for &point in indices {
        let first = out.source_vertices.len() as u32;
        for c in &corners {
            out.source_vertices.push(point);
            out.other_ends.push(point);
            out.offsets.push(c.extend(0.0));
        }
        let last = corners.len() as u32 - 1;
        out.indices.extend((1..last).flat_map(|i| [first, first + i, first + i + 1]));
    }
    out
}

/// Moves the vertices of thick lines and points to their positions in an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThickLineExpander {
    clip_from_relative: Mat4,
    /// Image size in pixels.
    size: Vec2,
}

impl ThickLineExpander {
    pub(crate) fn new(clip_from_relative: &Mat4, size: [u32; 2]) -> ThickLineExpander {
        let size = Vec2::new(size[0] as f32, size[1] as f32);
        ThickLineExpander { clip_from_relative: *clip_from_relative, size }
    }

    /// Clip-space position of a vertex, from both ends of its line. CPU reference of `spread` in thick_lines.wgsl.
    ///
    /// The offset is scaled by w, so that it is the same on screen anywhere on the line. The near plane then clips it like any
    /// triangle, and ends behind the camera need no screen position.
    pub(crate) fn expand_vertex(&self, own: Vec4, other: Vec4, offset: Vec3, width: f32) -> Vec4 {
        let (a, b) = if offset.z > 0.5 { (other, own) } else { (own, other) };
        // The direction from the first end to the second in the image: d(xy/w) is proportional to this.
        let way = (b.xy() * a.w - a.xy() * b.w) * self.size;
        let most = way.x.abs().max(way.y.abs());
        let along = if most > 0.0 {
            let way = way / most;
            way / way.dot(way).sqrt()
        } else {
            Vec2::X
        };
        // Half the width in pixels, times w.
        let least = 0.5 * own.w;
        let radius = if width < 0.0 {
            let rows = self.clip_from_relative.transpose();
            (0.25 * -width * self.size.y * rows.y_axis.xyz().length()).max(least)
        } else {
            least * width.max(1.0)
        };
        let off = along * offset.x + Vec2::new(-along.y, along.x) * offset.y;
        let step = off * (2.0 * radius) / self.size;
        own + Vec4::new(step.x, step.y, 0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3Swizzles;

    fn area(w: &ThickMesh, at: impl Fn(usize) -> Vec2) -> f64 {
        let corners = |t: &[u32]| [at(t[0] as usize), at(t[1] as usize), at(t[2] as usize)];
        let areas = w.indices.chunks_exact(3).map(corners);
        areas.map(|[a, b, c]| 0.5 * f64::from((b - a).perp_dot(c - a).abs())).sum()
    }

    #[test]
    fn thick_meshes_have_the_area_of_discs_and_rectangles() {
        for (count, error) in [(1, 1e-5), (1001, 1e-5), (20_001, 1e-5)] {
            let disc = point_polygons(&vec![0; count], true);
            let one = area(&disc, |i| disc.offsets[i].xy()) / count as f64;
            assert!((one - std::f64::consts::PI).abs() < error * 3.0, "{count}: {one}");
        }
        let square = point_polygons(&[7], false);
        assert_eq!(
            (area(&square, |i| square.offsets[i].xy()), &square.source_vertices[..]),
            (4.0, &[7, 7, 7, 7][..])
        );
        // The ends are ten half widths apart.
        let ends = |w: &ThickMesh, i: usize| w.offsets[i].xy() + Vec2::X * 10.0 * w.offsets[i].z;
        let flat = line_polygons(&[0, 1], false);
        assert_eq!(area(&flat, |i| ends(&flat, i)), 20.0);
        let round = line_polygons(&[0, 1], true);
        let exact = 20.0 + std::f64::consts::PI;
        let got = area(&round, |i| ends(&round, i));
        assert!(got < exact && exact - got < 0.03, "{got} {exact}");
        // A missing end would be noticed.
        assert!((area(&flat, |i| ends(&flat, i)) - exact).abs() > 1.0);
    }

    #[test]
    fn widths_in_pixels_are_the_same_at_any_distance() {
        let clip = glam::camera::rh::proj::directx::perspective_infinite_reverse(1.0, 1.0, 0.1);
        let expander = ThickLineExpander::new(&clip, [200, 200]);
        let pixels = |depth: f32, width: f32| {
            let [a, b] = [-1.0, 1.0].map(|x| clip * Vec4::new(x, 0.3, -depth, 1.0));
            let [up, down] = [1.0, -1.0].map(|y| expander.expand_vertex(a, b, Vec3::new(0.0, y, 0.0), width));
            ((up.y / up.w - down.y / down.w) * 100.0).abs()
        };
        for depth in [0.5, 5.0, 500.0] {
            assert!((pixels(depth, 6.0) - 6.0).abs() < 1e-3, "{depth}: {}", pixels(depth, 6.0));
            let exact = 0.2 * 100.0 / (depth * libm::tanf(0.5));
            assert!((pixels(depth, -0.2) - exact.max(1.0)).abs() < 1e-3 * exact, "{depth}");
        }
    }

    #[test]
    fn lines_behind_the_camera_and_of_zero_length_stay_finite() {
        let clip = glam::camera::rh::proj::directx::perspective_infinite_reverse(1.0, 1.0, 0.1);
        let expander = ThickLineExpander::new(&clip, [200, 100]);
        let at = |x: f32, z: f32| clip * Vec4::new(x, -0.5, z, 1.0);
        let (front, behind) = (at(0.2, -3.0), at(0.2, 4.0));
        // The line goes down from its front end to the camera, and both edges keep their distance.
        let edges = [1.0, -1.0].map(|y| {
            let near = expander.expand_vertex(front, behind, Vec3::new(0.0, y, 0.0), 8.0);
            let far = expander.expand_vertex(behind, front, Vec3::new(0.0, y, 1.0), 8.0);
            // Point of the edge that is a metre in front of the camera.
            near + (far - near) * ((near.w - 1.0) / (near.w - far.w))
        });
        let [a, b] = edges.map(|e| e.xy() / e.w * Vec2::new(100.0, 50.0));
        assert!((a.distance(b) - 8.0).abs() < 1e-3, "{a} {b}");
        let dot = expander.expand_vertex(front, front, Vec3::new(-1.0, 0.0, 0.0), 8.0);
        assert!(dot.is_finite() && dot.x < front.x);
    }
}
