//! Meshes of distance fields. A grid of rays is cast onto a field that is star-shaped about a capsule's axis; the rays are those
//! that leave the capsule at right angles.
//!
//! Compared with marching cubes or surface nets, the triangles are spread evenly along a limb (a third of the number for the same
//! outline), the mesh is watertight by construction, and no voxel grid is needed.

use crate::field::gradient;
use glam::{Vec2, Vec3};

/// A capsule and its ray grid: rings of rays between two poles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub from: Vec3,
    pub to: Vec3,
    /// Rings over each round end, and along the straight part (`side_rings`).
    pub cap_rings: usize,
    pub side_rings: usize,
    pub sectors: usize,
    /// Largest length of a ray, metres.
    pub reach: f32,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Surface {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    pub indices: Vec<u32>,
}

/// Distance along a ray at which it finally leaves the field, searched from the outside in.
fn ray_distance(field: &dyn Fn(Vec3) -> f32, origin: Vec3, direction: Vec3, reach: f32) -> f32 {
    // Blended fields overestimate distances slightly; shorter steps do not skip thin rims.
    const STEP_SAFETY: f32 = 0.8;
    let mut outside = reach;
    for _ in 0..64 {
        let d = field(origin + direction * outside);
        if d < 2e-5 {
            break;
        }
        outside -= d * STEP_SAFETY;
        if outside <= 0.0 {
            return 0.0;
        }
    }
    outside
}

pub(crate) fn cast(field: &dyn Fn(Vec3) -> f32, grid: &Grid) -> Surface {
    let axis = (grid.to - grid.from).try_normalize().unwrap_or(Vec3::Y);
    let (u, v) = axis.any_orthonormal_pair();
    // (origin, latitude) of each ring.
    let mut rings: Vec<(Vec3, f32)> = Vec::new();
    let quarter = core::f32::consts::FRAC_PI_2;
    for i in 1..=grid.cap_rings {
        rings.push((grid.from, -quarter * (1.0 - i as f32 / (grid.cap_rings + 1) as f32)));
    }
    for i in 0..grid.side_rings {
        let t = if grid.side_rings == 1 { 0.5 } else { i as f32 / (grid.side_rings - 1) as f32 };
        rings.push((grid.from.lerp(grid.to, t), 0.0));
    }
    for i in (1..=grid.cap_rings).rev() {
        rings.push((grid.to, quarter * (1.0 - i as f32 / (grid.cap_rings + 1) as f32)));
    }
    let mut out = Surface::default();
    let mut ray = |origin: Vec3, direction: Vec3| {
        let p = origin + direction * ray_distance(field, origin, direction, grid.reach);
        out.positions.push(p);
        out.normals.push(gradient(field, p));
    };
    ray(grid.from, -axis);
    for &(origin, latitude) in &rings {
        let (sin_lat, cos_lat) = (libm::sinf(latitude), libm::cosf(latitude));
        for s in 0..grid.sectors {
            let angle = core::f32::consts::TAU * s as f32 / grid.sectors as f32;
            let round = u * libm::cosf(angle) + v * libm::sinf(angle);
            ray(origin, round * cos_lat + axis * sin_lat);
        }
    }
    ray(grid.to, axis);

    let n = grid.sectors as u32;
    let at = |ring: usize, s: u32| 1 + ring as u32 * n + s % n;
    let last = out.positions.len() as u32 - 1;
    for s in 0..n {
        out.indices.extend([0, at(0, s + 1), at(0, s)]);
        for ring in 0..rings.len() - 1 {
            let (a, b) = (at(ring, s), at(ring, s + 1));
            let (c, d) = (at(ring + 1, s), at(ring + 1, s + 1));
            out.indices.extend([a, b, c, b, d, c]);
        }
        out.indices.extend([last, at(rings.len() - 1, s), at(rings.len() - 1, s + 1)]);
    }
    out
}

/// A flat pane pressed onto a field from the front (+Z): an outline, and a height above the field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    /// A point in front of the field.
    pub center: Vec3,
    /// Half width and half height of the superellipse |x/a|ᵖ + |y/b|ᵖ = 1.
    pub half: Vec2,
    pub power: f32,
    pub rise: f32,
    pub sectors: usize,
}

/// The pane with its rounded rim, closed by a ring below the field's surface.
pub(crate) fn lens_surface(field: &dyn Fn(Vec3) -> f32, lens: &Lens) -> Surface {
    /// (share of the outline, share of the rise): the rim bends down over the outermost tenth.
    const RINGS: [(f32, f32); 7] =
        [(0.35, 1.0), (0.65, 1.0), (0.86, 1.0), (0.94, 0.92), (0.985, 0.62), (1.0, 0.0), (1.0, -1.5)];
    let mut out = Surface::default();
    let mut put = |x: f32, y: f32, rise: f32, tilt: f32| {
        let origin = Vec3::new(lens.center.x + x, lens.center.y + y, 0.0);
        let p = origin + Vec3::Z * ray_distance(field, origin, Vec3::Z, lens.center.z);
        let normal = gradient(field, p);
        let outwards = Vec3::new(x / (lens.half.x * lens.half.x), y / (lens.half.y * lens.half.y), 0.0);
        out.positions.push(p + normal * rise);
        out.normals.push((normal + outwards.normalize_or_zero() * tilt).normalize());
    };
    put(0.0, 0.0, lens.rise, 0.0);
    for (share, rise) in RINGS {
        for s in 0..lens.sectors {
            let angle = core::f32::consts::TAU * s as f32 / lens.sectors as f32;
            let (c, s) = (libm::cosf(angle), libm::sinf(angle));
            let round = |v: f32| libm::copysignf(libm::powf(v.abs(), 2.0 / lens.power), v);
            let tilt = 1.2 * (1.0 - rise.max(0.0));
            put(share * lens.half.x * round(c), share * lens.half.y * round(s), lens.rise * rise, tilt);
        }
    }
    put(0.0, 0.0, -4.0 * lens.rise, 0.0);
    let n = lens.sectors as u32;
    let last = out.positions.len() as u32 - 1;
    // The hidden back side gets normals that face back.
    for normal in out.normals.iter_mut().rev().take(1 + lens.sectors) {
        normal.z = -normal.z.abs();
    }
    let at = |ring: usize, s: u32| 1 + ring as u32 * n + s % n;
    for s in 0..n {
        out.indices.extend([0, at(0, s), at(0, s + 1)]);
        for ring in 0..RINGS.len() - 1 {
            let (a, b) = (at(ring, s), at(ring, s + 1));
            let (c, d) = (at(ring + 1, s), at(ring + 1, s + 1));
            out.indices.extend([a, c, b, b, c, d]);
        }
        out.indices.extend([last, at(RINGS.len() - 1, s + 1), at(RINGS.len() - 1, s)]);
    }
    out
}

/// The surface mirrored in x = 0.
pub(crate) fn mirrored(surface: &Surface) -> Surface {
    let flip = |v: &Vec3| Vec3::new(-v.x, v.y, v.z);
    Surface {
        positions: surface.positions.iter().map(flip).collect(),
        normals: surface.normals.iter().map(flip).collect(),
        indices: surface.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect(),
    }
}
