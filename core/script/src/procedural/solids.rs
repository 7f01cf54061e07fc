//! The shapes of `shape(kind, …)`: vertices, normals and uvs from closed forms.

use choreo_asset::{Primitive, Topology};
use glam::{Vec2, Vec3};

/// Segments around an axis, and rings along a half circle.
const AROUND: u32 = 48;
const ROWS: u32 = 24;

/// Names of the shapes.
pub const KINDS: &[&str] = &["plane", "quad", "box", "sphere", "cylinder", "cone", "capsule", "torus"];

/// The mesh of a shape, which stands on the ground (y = 0). `size`: metres along x, y and z.
pub fn solid(kind: &str, size: Vec3) -> Primitive {
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

/// Size of a shape along x, y and z for `size: 1`; any other number multiplies it.
pub fn proportions(kind: &str) -> Vec3 {
    match kind {
        "capsule" => Vec3::new(0.5, 1.0, 0.5),
        "torus" => Vec3::new(1.0, 0.25, 1.0),
        _ => Vec3::ONE,
    }
}

/// Why a shape cannot have a size; `None` if it can.
pub fn refuse(kind: &str, size: Vec3) -> Option<&'static str> {
    let width = size.x.max(size.z);
    match kind {
        "capsule" if size.y < width => Some("a capsule must be at least as high as it is wide"),
        "torus" if size.y > 0.5 * size.x.min(size.z) => Some(
            "a torus must be at most half as high as it is wide: its height is the thickness of its ring",
        ),
        _ => None,
    }
}

fn primitive(vertices: Vec<(Vec3, Vec3, Vec2)>, indices: Vec<u32>) -> Primitive {
    Primitive {
        topology: Topology::Triangles,
        indices,
        positions: vertices.iter().map(|v| v.0).collect(),
        normals: vertices.iter().map(|v| v.1).collect(),
        uvs: [vertices.iter().map(|v| v.2).collect(), Vec::new()],
        ..Primitive::default()
    }
}

/// A plane in x and z around the origin, facing up.
fn plane(size: Vec3) -> Primitive {
    let vertex =
        |u: f32, v: f32| (Vec3::new((u - 0.5) * size.x, 0.0, (v - 0.5) * size.z), Vec3::Y, Vec2::new(u, v));
    primitive(
        vec![vertex(0.0, 0.0), vertex(0.0, 1.0), vertex(1.0, 1.0), vertex(1.0, 0.0)],
        vec![0, 1, 2, 0, 2, 3],
    )
}

/// An upright rectangle on the ground, facing +z, for images.
fn quad(size: Vec3) -> Primitive {
    let vertex =
        |u: f32, v: f32| (Vec3::new((u - 0.5) * size.x, (1.0 - v) * size.y, 0.0), Vec3::Z, Vec2::new(u, v));
    primitive(
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
    primitive(vertices, indices)
}

/// A ring of a solid of revolution: radius and height for size 1, normal as (outward, up) of any length before the shape is
/// scaled, and texture coordinate v. Without v the ring is part of a flat cap, which gets a planar projection from its side.
struct Ring {
    radius: f32,
    y: f32,
    normal: Vec2,
    v: Option<f32>,
}

fn ring(radius: f32, y: f32, normal: Vec2, v: f32) -> Ring {
    Ring { radius, y, normal, v: Some(v) }
}

/// The two rings of a flat cap: from the center to the rim if it faces up, else from the rim to the center.
fn end(radius: f32, y: f32, up: bool) -> [Ring; 2] {
    let normal = if up { Vec2::Y } else { Vec2::NEG_Y };
    let ring = |radius| Ring { radius, y, normal, v: None };
    if up { [ring(0.0), ring(radius)] } else { [ring(radius), ring(0.0)] }
}

/// Solid of revolution: `AROUND + 1` vertices per ring (the seam twice), and quads between neighboring rings, which go from the
/// top along the outside down. Texture coordinate u runs counter-clockwise seen from above; the seam is at -z.
fn lathe(rings: &[Ring], size: Vec3) -> Primitive {
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    for ring in rings {
        for step in 0..=AROUND {
            let angle = f64::from(step) / f64::from(AROUND) * std::f64::consts::TAU;
            let side = Vec3::new(-libm::sin(angle) as f32, 0.0, -libm::cos(angle) as f32);
            let at = (side * ring.radius + Vec3::Y * ring.y) * size;
            // Normals are scaled by the inverse of the size.
            let normal = ((side * ring.normal.x + Vec3::Y * ring.normal.y) / size).normalize_or(Vec3::Y);
            let uv = match ring.v {
                Some(v) => Vec2::new(step as f32 / AROUND as f32, v),
                None => {
                    let flip = if ring.normal.y < 0.0 { -1.0 } else { 1.0 };
                    Vec2::new(0.5 + side.x * ring.radius, 0.5 + flip * side.z * ring.radius)
                }
            };
            vertices.push((at, normal, uv));
        }
    }
    let stride = AROUND + 1;
    for row in 0..rings.len() as u32 - 1 {
        // Two rings at one place form a hard edge and have no quads between them.
        let (above, below) = (&rings[row as usize], &rings[row as usize + 1]);
        if (above.radius, above.y) == (below.radius, below.y) {
            continue;
        }
        for step in 0..AROUND {
            let a = row * stride + step;
            let (b, c, d) = (a + stride, a + stride + 1, a + 1);
            // If a ring is a point, one of the two triangles has no area and is left out.
            if rings[row as usize + 1].radius > 0.0 {
                indices.extend([a, b, c]);
            }
            if rings[row as usize].radius > 0.0 {
                indices.extend([a, c, d]);
            }
        }
    }
    primitive(vertices, indices)
}

/// Sine and cosine of `part` times 180°.
fn half_turn(part: f64) -> Vec2 {
    let angle = part * std::f64::consts::PI;
    Vec2::new(libm::sin(angle) as f32, libm::cos(angle) as f32)
}

/// An ellipsoid on the ground.
fn sphere(size: Vec3) -> Primitive {
    let row = |row: u32| {
        let v = f64::from(row) / f64::from(ROWS);
        let normal = half_turn(v);
        // The poles are exact points, although the sine of 180° is not exactly 0.
        let radius = if row == 0 || row == ROWS { 0.0 } else { 0.5 * normal.x };
        ring(radius, 0.5 + 0.5 * normal.y, normal, v as f32)
    };
    lathe(&(0..=ROWS).map(row).collect::<Vec<_>>(), size)
}

/// A cylinder on the ground.
fn cylinder(size: Vec3) -> Primitive {
    let mut rings = Vec::from(end(0.5, 1.0, true));
    rings.extend([ring(0.5, 1.0, Vec2::X, 0.0), ring(0.5, 0.0, Vec2::X, 1.0)]);
    rings.extend(end(0.5, 0.0, false));
    lathe(&rings, size)
}

/// A cone on the ground, tip up.
fn cone(size: Vec3) -> Primitive {
    let side = Vec2::new(1.0, 0.5);
    let mut rings = vec![ring(0.0, 1.0, side, 0.0), ring(0.5, 0.0, side, 1.0)];
    rings.extend(end(0.5, 0.0, false));
    lathe(&rings, size)
}

/// A capsule on the ground: a cylinder between two half ellipsoids, each half as high as the larger of the x and z sizes.
fn capsule(size: Vec3) -> Primitive {
    // Height of a half sphere as a fraction of the whole height.
    let cap = 0.5 * size.x.max(size.z) / size.y;
    let half = ROWS / 2;
    // Texture coordinate v is proportional to the length along the outside from the top, so that an image is stretched evenly.
    let arc = std::f32::consts::FRAC_PI_2 * cap;
    let whole = 2.0 * arc + (1.0 - 2.0 * cap);
    let row = |row: u32| {
        let (angle, below) = if row <= half { (row, false) } else { (row - 1, true) };
        let slope = half_turn(f64::from(angle) / f64::from(ROWS));
        let y = if below { cap + cap * slope.y } else { 1.0 - cap + cap * slope.y };
        let radius = if angle == 0 || angle == ROWS { 0.0 } else { 0.5 * slope.x };
        let straight = if below { 1.0 - 2.0 * cap } else { 0.0 };
        let v = (2.0 * arc * angle as f32 / ROWS as f32 + straight) / whole;
        // Normal of an ellipse with the half axes 0.5 and `cap`.
        ring(radius, y, Vec2::new(slope.x / 0.5, slope.y / cap), v)
    };
    lathe(&(0..=ROWS + 1).map(row).collect::<Vec<_>>(), size)
}

/// A torus that lies on the ground. Its tube is as thick as it is high.
fn torus(size: Vec3) -> Primitive {
    // Radius of the tube for a torus of width 1.
    let thick = 0.5 * size.y / size.x.min(size.z);
    let row = |row: u32| {
        let part = f64::from(row) / f64::from(ROWS);
        // Rings go from the inside over the top to the outside and back below.
        let slope = half_turn(2.0 * part);
        let out = -slope.y;
        let normal = Vec2::new(out / thick, slope.x / 0.5);
        ring(0.5 - thick + thick * out, 0.5 + 0.5 * slope.x, normal, part as f32)
    };
    lathe(&(0..=ROWS).map(row).collect::<Vec<_>>(), size)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(size: Vec3) -> impl Iterator<Item = (&'static str, Primitive)> {
        KINDS
            .iter()
            .filter(move |kind| refuse(kind, size).is_none())
            .map(move |kind| (*kind, solid(kind, size)))
    }

    /// Each shape accepts at least one of these sizes.
    const SIZES: [Vec3; 2] = [Vec3::new(2.0, 1.0, 3.0), Vec3::new(1.0, 3.0, 2.0)];

    #[test]
    fn every_kind_is_looked_at() {
        for kind in KINDS {
            assert!(SIZES.iter().any(|size| refuse(kind, *size).is_none()), "{kind}");
        }
    }

    /// Every triangle is counter-clockwise seen along its vertices' normals, has an area, and normals are unit.
    #[test]
    fn faces_point_outwards() {
        for (kind, p) in SIZES.into_iter().flat_map(all) {
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
    fn solids_stand_on_the_ground_in_their_size() {
        for (size, (kind, p)) in SIZES.into_iter().flat_map(|size| all(size).map(move |p| (size, p))) {
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

    /// The divergence theorem gives the volume of a closed surface, which is compared with the closed form. Flat facets lose a
    /// few parts in a thousand.
    #[test]
    fn volumes_are_those_of_the_formulas() {
        use std::f64::consts::PI;
        let truth = |kind: &str| match kind {
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
            let got = volume(&solid(kind, Vec3::new(1.0, 2.0, 1.0)));
            assert!((got / truth(kind) - 1.0).abs() < 0.012, "{kind}: {got} for {}", truth(kind));
        }
        // Pappus: 2 π R · π r², with R = 0.4 and r = 0.1.
        let torus = volume(&solid("torus", Vec3::new(1.0, 0.2, 1.0)));
        assert!((torus / (2.0 * PI * 0.4 * PI * 0.01) - 1.0).abs() < 0.02, "{torus}");
    }
}
