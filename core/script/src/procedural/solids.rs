//! Meshes of `shape(kind, …)`: vertices, normals and texture coordinates from closed forms.

use choreo_asset::{Primitive, Topology};
use glam::{Vec2, Vec3};

/// Number of segments around the axis.
const SEGMENTS: u32 = 48;
/// Number of rows of quads along a half circle.
const ROWS: u32 = 24;

/// Names of the shapes.
pub(super) const KINDS: &[&str] = &["plane", "quad", "box", "sphere", "cylinder", "cone", "capsule", "torus"];

/// The mesh of a shape, which stands on the ground (y = 0). `size`: metres along x, y and z.
pub(super) fn shape_mesh(kind: &str, size: Vec3) -> Primitive {
    match kind {
        "plane" => plane(size),
        "quad" => quad(size),
        "box" => cuboid(size),
        "sphere" => sphere(size),
        "cylinder" => cylinder(size),
        "cone" => cone(size),
        "capsule" => capsule(size),
        _ => torus(size),
    }
}

/// Size of a shape along x, y and z for `size: 1`. Another number for `size` multiplies it.
pub(super) fn proportions(kind: &str) -> Vec3 {
    match kind {
        "capsule" => Vec3::new(0.5, 1.0, 0.5),
        "torus" => Vec3::new(1.0, 0.25, 1.0),
        _ => Vec3::ONE,
    }
}

/// Reason why a shape cannot have a size; `None` if it can.
pub(super) fn invalid_size(kind: &str, size: Vec3) -> Option<&'static str> {
    let width = size.x.max(size.z);
    match kind {
        "capsule" if size.y < width => Some("a capsule must be at least as high as it is wide"),
        "torus" if size.y > 0.5 * size.x.min(size.z) => Some(
            "a torus must be at most half as high as it is wide: its height is the thickness of its ring",
        ),
        _ => None,
    }
}

/// A triangle mesh from vertices (position, normal, texture coordinates) and indices.
fn triangle_mesh(vertices: Vec<(Vec3, Vec3, Vec2)>, indices: Vec<u32>) -> Primitive {
    Primitive {
        topology: Topology::Triangles,
        indices,
        positions: vertices.iter().map(|v| v.0).collect(),
        normals: vertices.iter().map(|v| v.1).collect(),
        uvs: [vertices.iter().map(|v| v.2).collect(), Vec::new()],
        ..Primitive::default()
    }
}

/// A rectangle in the xz plane around the origin, facing up.
fn plane(size: Vec3) -> Primitive {
    let vertex =
        |u: f32, v: f32| (Vec3::new((u - 0.5) * size.x, 0.0, (v - 0.5) * size.z), Vec3::Y, Vec2::new(u, v));
    triangle_mesh(
        vec![vertex(0.0, 0.0), vertex(0.0, 1.0), vertex(1.0, 1.0), vertex(1.0, 0.0)],
        vec![0, 1, 2, 0, 2, 3],
    )
}

/// An upright rectangle on the ground, facing +z, for images.
fn quad(size: Vec3) -> Primitive {
    let vertex =
        |u: f32, v: f32| (Vec3::new((u - 0.5) * size.x, (1.0 - v) * size.y, 0.0), Vec3::Z, Vec2::new(u, v));
    triangle_mesh(
        vec![vertex(0.0, 0.0), vertex(0.0, 1.0), vertex(1.0, 1.0), vertex(1.0, 0.0)],
        vec![0, 1, 2, 0, 2, 3],
    )
}

/// A box on the ground: y from 0 up.
fn cuboid(size: Vec3) -> Primitive {
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    let middle = Vec3::Y * size.y * 0.5;
    for normal in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let up = if normal.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let right = up.cross(normal);
        let first = vertices.len() as u32;
        for (u, v) in [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)] {
            let at = normal + right * (2.0 * u - 1.0) + up * (1.0 - 2.0 * v);
            vertices.push((at * size * 0.5 + middle, normal, Vec2::new(u, v)));
        }
        indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    }
    triangle_mesh(vertices, indices)
}

/// A ring of a solid of revolution: radius and height for size 1, normal as (outward, up) of any length before scaling, and
/// texture coordinate v. A ring without v is part of a flat cap, which gets a planar projection.
struct Ring {
    radius: f32,
    y: f32,
    normal: Vec2,
    v: Option<f32>,
}

/// A ring that is not part of a flat cap.
fn ring(radius: f32, y: f32, normal: Vec2, v: f32) -> Ring {
    Ring { radius, y, normal, v: Some(v) }
}

/// The two rings of a flat cap: from the center to the rim if it faces up, else from the rim to the center.
fn cap_rings(radius: f32, y: f32, up: bool) -> [Ring; 2] {
    let normal = if up { Vec2::Y } else { Vec2::NEG_Y };
    let ring = |radius| Ring { radius, y, normal, v: None };
    if up { [ring(0.0), ring(radius)] } else { [ring(radius), ring(0.0)] }
}

/// Solid of revolution of rings in order from the top along the outside down. Each ring has `SEGMENTS + 1` vertices, of which the
/// first and last lie on the seam at -z. Texture coordinate u increases counter-clockwise seen from above.
fn solid_of_revolution(rings: &[Ring], size: Vec3) -> Primitive {
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    for ring in rings {
        for step in 0..=SEGMENTS {
            let angle = f64::from(step) / f64::from(SEGMENTS) * std::f64::consts::TAU;
            let side = Vec3::new(-libm::sin(angle) as f32, 0.0, -libm::cos(angle) as f32);
            let at = (side * ring.radius + Vec3::Y * ring.y) * size;
            // Normals are scaled by the inverse of the size.
            let normal = ((side * ring.normal.x + Vec3::Y * ring.normal.y) / size).normalize_or(Vec3::Y);
            let uv = match ring.v {
                Some(v) => Vec2::new(step as f32 / SEGMENTS as f32, v),
                None => {
                    let flip = if ring.normal.y < 0.0 { -1.0 } else { 1.0 };
                    Vec2::new(0.5 + side.x * ring.radius, 0.5 + flip * side.z * ring.radius)
                }
            };
            vertices.push((at, normal, uv));
        }
    }
    let stride = SEGMENTS + 1;
    for row in 0..rings.len() as u32 - 1 {
        // Two rings at one place form a hard edge and have no quads between them.
        let (above, below) = (&rings[row as usize], &rings[row as usize + 1]);
        if (above.radius, above.y) == (below.radius, below.y) {
            continue;
        }
        for step in 0..SEGMENTS {
            let a = row * stride + step;
            let (b, c, d) = (a + stride, a + stride + 1, a + 1);
            // If a ring is a point, one of the two triangles of a quad has no area and is left out.
            if rings[row as usize + 1].radius > 0.0 {
                indices.extend([a, b, c]);
            }
            if rings[row as usize].radius > 0.0 {
                indices.extend([a, c, d]);
            }
        }
    }
    triangle_mesh(vertices, indices)
}

/// Sine and cosine of a fraction of 180°.
fn sin_cos_of_half_turn(fraction: f64) -> Vec2 {
    let angle = fraction * std::f64::consts::PI;
    Vec2::new(libm::sin(angle) as f32, libm::cos(angle) as f32)
}

/// An ellipsoid on the ground.
fn sphere(size: Vec3) -> Primitive {
    let row = |row: u32| {
        let v = f64::from(row) / f64::from(ROWS);
        let normal = sin_cos_of_half_turn(v);
        // The poles are exact points, although the sine of 180° is not exactly 0.
        let radius = if row == 0 || row == ROWS { 0.0 } else { 0.5 * normal.x };
        ring(radius, 0.5 + 0.5 * normal.y, normal, v as f32)
    };
    solid_of_revolution(&(0..=ROWS).map(row).collect::<Vec<_>>(), size)
}

/// A cylinder on the ground.
fn cylinder(size: Vec3) -> Primitive {
    let mut rings = Vec::from(cap_rings(0.5, 1.0, true));
    rings.extend([ring(0.5, 1.0, Vec2::X, 0.0), ring(0.5, 0.0, Vec2::X, 1.0)]);
    rings.extend(cap_rings(0.5, 0.0, false));
    solid_of_revolution(&rings, size)
}

/// A cone on the ground, tip up.
fn cone(size: Vec3) -> Primitive {
    let side = Vec2::new(1.0, 0.5);
    let mut rings = vec![ring(0.0, 1.0, side, 0.0), ring(0.5, 0.0, side, 1.0)];
    rings.extend(cap_rings(0.5, 0.0, false));
    solid_of_revolution(&rings, size)
}

/// A capsule on the ground: a cylinder between two half ellipsoids, each half as high as the larger of the x and z sizes.
fn capsule(size: Vec3) -> Primitive {
    // Height of a half sphere as a fraction of the whole height.
    let cap = 0.5 * size.x.max(size.z) / size.y;
    let half = ROWS / 2;
    // Texture coordinate v is proportional to the length along the outside from the top, so that an image is stretched evenly.
    let cap_length = std::f32::consts::FRAC_PI_2 * cap;
    let outline_length = 2.0 * cap_length + (1.0 - 2.0 * cap);
    let row = |row: u32| {
        let (angle, is_lower) = if row <= half { (row, false) } else { (row - 1, true) };
        let slope = sin_cos_of_half_turn(f64::from(angle) / f64::from(ROWS));
        let y = if is_lower { cap + cap * slope.y } else { 1.0 - cap + cap * slope.y };
        let radius = if angle == 0 || angle == ROWS { 0.0 } else { 0.5 * slope.x };
        let cylinder_length = if is_lower { 1.0 - 2.0 * cap } else { 0.0 };
        let v = (2.0 * cap_length * angle as f32 / ROWS as f32 + cylinder_length) / outline_length;
        // Normal of an ellipse with the half axes 0.5 and `cap`.
        ring(radius, y, Vec2::new(slope.x / 0.5, slope.y / cap), v)
    };
    solid_of_revolution(&(0..=ROWS + 1).map(row).collect::<Vec<_>>(), size)
}

/// A torus that lies on the ground. Its tube is as thick as it is high.
fn torus(size: Vec3) -> Primitive {
    // Radius of the tube for a torus of width 1.
    let tube_radius = 0.5 * size.y / size.x.min(size.z);
    let row = |row: u32| {
        let fraction = f64::from(row) / f64::from(ROWS);
        // Rings are in order from the inside over the top to the outside and back below.
        let slope = sin_cos_of_half_turn(2.0 * fraction);
        let outward = -slope.y;
        let normal = Vec2::new(outward / tube_radius, slope.x / 0.5);
        ring(0.5 - tube_radius + tube_radius * outward, 0.5 + 0.5 * slope.x, normal, fraction as f32)
    };
    solid_of_revolution(&(0..=ROWS).map(row).collect::<Vec<_>>(), size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The meshes of all shapes that can have a size.
    fn shapes_of_size(size: Vec3) -> impl Iterator<Item = (&'static str, Primitive)> {
        KINDS
            .iter()
            .filter(move |kind| invalid_size(kind, size).is_none())
            .map(move |kind| (*kind, shape_mesh(kind, size)))
    }

    /// Each shape accepts at least one of these sizes.
    const SIZES: [Vec3; 2] = [Vec3::new(2.0, 1.0, 3.0), Vec3::new(1.0, 3.0, 2.0)];

    #[test]
    fn every_shape_accepts_a_test_size() {
        for kind in KINDS {
            assert!(SIZES.iter().any(|size| invalid_size(kind, *size).is_none()), "{kind}");
        }
    }

    /// Every triangle is counter-clockwise seen from the side to which its normals point, and has an area; normals have length 1.
    #[test]
    fn faces_point_outwards() {
        for (kind, p) in SIZES.into_iter().flat_map(shapes_of_size) {
            for t in p.indices.chunks(3) {
                let [a, b, c] = [0, 1, 2].map(|i| p.positions[t[i] as usize]);
                let face = (b - a).cross(c - a);
                assert!(face.length() > 1e-9, "{kind}: {a} {b} {c}");
                let normal: Vec3 = t.iter().map(|i| p.normals[*i as usize]).sum();
                assert!(face.dot(normal) > 0.0, "{kind}: {a} {b} {c}");
            }
            assert!(p.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5), "{kind}");
            assert!(
                p.uvs[0].iter().all(|uv| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()),
                "{kind}"
            );
        }
    }

    #[test]
    fn shapes_have_their_size_and_stand_on_the_ground() {
        for (size, (kind, p)) in
            SIZES.into_iter().flat_map(|size| shapes_of_size(size).map(move |p| (size, p)))
        {
            let low = p.positions.iter().copied().reduce(Vec3::min).unwrap();
            let high = p.positions.iter().copied().reduce(Vec3::max).unwrap();
            let flat = match kind {
                "plane" => Vec3::new(1.0, 0.0, 1.0),
                "quad" => Vec3::new(1.0, 1.0, 0.0),
                _ => Vec3::ONE,
            };
            assert!(
                (high - low).abs_diff_eq(size * flat, 1e-5) && low.y.abs() < 1e-6,
                "{kind}: {low} {high}"
            );
        }
    }

    /// The volume of a watertight mesh, by the divergence theorem, is compared with the closed form. Flat facets make it smaller
    /// by a few thousandths.
    #[test]
    fn volumes_agree_with_closed_forms() {
        use std::f64::consts::PI;
        let closed_form = |kind: &str| match kind {
            "box" => 1.0 * 2.0 * 1.0,
            "sphere" => PI / 6.0 * 2.0,
            "cylinder" => PI * 0.25 * 2.0,
            "cone" => PI * 0.25 * 2.0 / 3.0,
            "capsule" => PI / 6.0 + PI * 0.25,
            _ => 0.0,
        };
        let volume = |p: &Primitive| -> f64 {
            let vertex = |i: u32| p.positions[i as usize].as_dvec3();
            p.indices.chunks(3).map(|t| vertex(t[0]).dot(vertex(t[1]).cross(vertex(t[2]))) / 6.0).sum()
        };
        for kind in ["box", "sphere", "cylinder", "cone", "capsule"] {
            let got = volume(&shape_mesh(kind, Vec3::new(1.0, 2.0, 1.0)));
            let expected = closed_form(kind);
            assert!((got / expected - 1.0).abs() < 0.012, "{kind}: {got} for {expected}");
        }
        // Pappus: 2 π R · π r², with R = 0.4 and r = 0.1.
        let torus = volume(&shape_mesh("torus", Vec3::new(1.0, 0.2, 1.0)));
        assert!((torus / (2.0 * PI * 0.4 * PI * 0.01) - 1.0).abs() < 0.02, "{torus}");
    }
}
