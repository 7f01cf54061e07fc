//! `shape("plane", …)`: simple meshes made here, for floors, boxes and stand-ins.

use crate::call::{ApiError, Call, Options, numbers, one_of, rgb, wrong};
use choreo_motion::{Skeleton, Transform};
use choreo_stage::{
    Asset, Image, Material, Mesh, MeshInstance, Primitive, Sampler, Shading, TextureRef, Topology,
};
use glam::{Affine2, DVec3, Vec2, Vec3, Vec4};
use std::sync::Arc;

const KINDS: &[&str] = &["plane", "box", "sphere", "cylinder"];
const OPTIONS: &[&str] = &[
    "size",
    "color",
    "checker",
    "tiles",
    "roughness",
    "metallic",
    "emissive",
    "unlit",
    "double_sided",
    "shininess",
    "specular",
];

/// The asset of a `shape(kind, options?)` call; equal calls share one.
pub fn shape(c: &Call) -> Result<Arc<Asset>, ApiError> {
    let kind = one_of(&c.value(0), "shape: kind", KINDS)?;
    let o = c.options(1, OPTIONS)?;
    let key = format!("{kind} {:?}", o.map);
    if let Some(asset) = c.build().shapes.get(&key) {
        return Ok(asset.clone());
    }
    crate::build::room(c.build().shapes.len(), "shapes", &c.shared.limits)?;
    let size = read_size(&o, kind)?.as_vec3();
    let mut mesh = match kind {
        "plane" => plane(size),
        "box" => cuboid(size),
        "sphere" => sphere(size),
        _ => cylinder(size),
    };
    mesh.material = Some(0);
    let (material, images) = material(&o)?;
    let name = format!("shape {kind}");
    let skeleton = Skeleton::new(vec![kind.to_string()], vec![None], vec![Transform::IDENTITY])
        .map_err(|e| ApiError::new(e.to_string()))?;
    let asset = Arc::new(Asset {
        name,
        skeleton: Arc::new(skeleton),
        meshes: vec![Arc::new(Mesh { name: kind.to_string(), primitives: vec![mesh], ..Mesh::default() })],
        instances: vec![MeshInstance { joint: 0, mesh: 0, skin: None, weights: Vec::new() }],
        materials: vec![material],
        images,
        ..Asset::default()
    });
    c.build().shapes.insert(key, asset.clone());
    Ok(asset)
}

/// Metres along x, y, z; a plane lies in x and z.
fn read_size(o: &Options, kind: &str) -> Result<DVec3, ApiError> {
    let Some(value) = o.get("size") else {
        return Ok(if kind == "plane" { DVec3::splat(10.0) } else { DVec3::ONE });
    };
    let size = match (kind, numbers(&value).as_deref()) {
        ("plane", Some([x, z])) => DVec3::new(*x, 1.0, *z),
        (_, Some([x, y, z])) if kind != "plane" => DVec3::new(*x, *y, *z),
        (_, Some(_)) => {
            return Err(wrong(&value, "shape: size", "a number, [x, y, z], or [x, z] for a plane"));
        }
        (_, None) => DVec3::splat(crate::call::number(&value, "shape: size")?),
    };
    if size.to_array().iter().any(|v| !(1e-4..=1e6).contains(v)) {
        return Err(ApiError::new(format!(
            "shape: size must be from 0.0001 to 1000000 m, got {:e}, {:e}, {:e}",
            size.x, size.y, size.z
        )));
    }
    Ok(size)
}

fn material(o: &Options) -> Result<(Material, Vec<Arc<Image>>), ApiError> {
    let base = o.color("color")?.unwrap_or(Vec4::new(0.6, 0.6, 0.6, 1.0));
    let mut material = Material {
        name: "shape".into(),
        base_color: base,
        metallic: o.number_in("metallic", 0.0, 1.0)?.unwrap_or(0.0) as f32,
        roughness: o.number_in("roughness", 0.0, 1.0)?.unwrap_or(0.9) as f32,
        emissive: o.color("emissive")?.map_or(Vec3::ZERO, rgb),
        double_sided: o.flag("double_sided")?.unwrap_or(false),
        ..Material::default()
    };
    if base.w < 1.0 {
        material.alpha_mode = choreo_stage::AlphaMode::Blend;
    }
    let specular = o.color("specular")?;
    if let Some(shininess) = o.number_in("shininess", 1.0, 10000.0)? {
        material.shading = Shading::BlinnPhong;
        material.shininess = shininess as f32;
        material.specular_color = specular.map_or(Vec3::splat(0.04), rgb);
        if let Some(other) = ["roughness", "metallic", "unlit"].into_iter().find(|name| o.get(name).is_some())
        {
            return Err(ApiError::new(format!(
                "shape: shininess asks for Blinn–Phong, which has no {other}"
            ))
            .focus(other));
        }
    } else if specular.is_some() {
        return Err(
            ApiError::new("shape: specular needs shininess, the Blinn–Phong exponent").focus("specular")
        );
    }
    if o.flag("unlit")? == Some(true) {
        material.shading = Shading::Unlit;
    }
    let tiles = o.number_in("tiles", 1.0, 4096.0)?;
    let Some(second) = o.color("checker")? else {
        return match tiles {
            Some(_) => Err(ApiError::new("shape: tiles needs checker, the second color").focus("tiles")),
            None => Ok((material, Vec::new())),
        };
    };
    // Two by two texels, repeated: the color white times the base color would lose precision, so both are in the image.
    let bytes = |c: Vec4| [0, 1, 2].map(|i| srgb_byte(c[i]));
    let (a, b) = (bytes(base), bytes(second));
    let texel = |c: [u8; 3]| [c[0], c[1], c[2], 255];
    let rgba = [a, b, b, a].into_iter().flat_map(texel).collect();
    material.base_color = Vec4::new(1.0, 1.0, 1.0, base.w);
    material.base_color_texture = Some(TextureRef {
        image: 0,
        sampler: Sampler { mag_linear: false, ..Sampler::default() },
        uv_set: 0,
        uv_transform: Affine2::from_scale(Vec2::splat(tiles.unwrap_or(10.0) as f32 / 2.0)),
    });
    Ok((material, vec![Arc::new(Image { name: "checker".into(), width: 2, height: 2, rgba })]))
}

/// The inverse of [`crate::color::linear`], to the nearest byte.
fn srgb_byte(linear: f32) -> u8 {
    let v = f64::from(linear);
    let s = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 };
    libm::round(s.clamp(0.0, 1.0) * 255.0) as u8
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

/// In x and z around the origin, seen from above.
fn plane(size: Vec3) -> Primitive {
    let corner =
        |u: f32, v: f32| (Vec3::new((u - 0.5) * size.x, 0.0, (v - 0.5) * size.z), Vec3::Y, Vec2::new(u, v));
    primitive(
        vec![corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0)],
        vec![0, 1, 2, 0, 2, 3],
    )
}

/// Standing on the ground: y from 0 up.
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

/// A ring of `around + 1` vertices (the seam twice) at each of `heights`, and quads between neighbours.
fn lathe(around: u32, rings: &[(f32, f32, Vec2)], size: Vec3) -> Primitive {
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    for (row, (radius, y, slope)) in rings.iter().enumerate() {
        for step in 0..=around {
            let angle = f64::from(step) / f64::from(around) * std::f64::consts::TAU;
            let side = Vec3::new(libm::sin(angle) as f32, 0.0, libm::cos(angle) as f32);
            let at = (side * *radius + Vec3::Y * *y) * size;
            // Normals of a stretched shape are stretched the other way.
            let normal = ((side * slope.x + Vec3::Y * slope.y) / size).normalize_or(Vec3::Y);
            let uv = Vec2::new(step as f32 / around as f32, row as f32 / (rings.len() - 1).max(1) as f32);
            vertices.push((at, normal, uv));
        }
    }
    let stride = around + 1;
    for row in 0..rings.len() as u32 - 1 {
        for step in 0..around {
            let a = row * stride + step;
            let (b, c, d) = (a + stride, a + stride + 1, a + 1);
            indices.extend([a, b, c, a, c, d]);
        }
    }
    primitive(vertices, indices)
}

/// Standing on the ground.
fn sphere(size: Vec3) -> Primitive {
    const ROWS: u32 = 24;
    let rings: Vec<(f32, f32, Vec2)> = (0..=ROWS)
        .map(|row| {
            let angle = f64::from(row) / f64::from(ROWS) * std::f64::consts::PI;
            let slope = Vec2::new(libm::sin(angle) as f32, libm::cos(angle) as f32);
            (0.5 * slope.x, 0.5 + 0.5 * slope.y, slope)
        })
        .collect();
    lathe(48, &rings, size)
}

/// Standing on the ground.
fn cylinder(size: Vec3) -> Primitive {
    let (up, out, down) = (Vec2::Y, Vec2::X, Vec2::NEG_Y);
    let rings = [
        (0.0, 1.0, up),
        (0.5, 1.0, up),
        (0.5, 1.0, out),
        (0.5, 0.0, out),
        (0.5, 0.0, down),
        (0.0, 0.0, down),
    ];
    lathe(48, &rings, size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every triangle is counter-clockwise seen along its vertices' normals, and normals are unit.
    fn check(p: &Primitive) {
        for t in p.indices.chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| p.positions[t[i] as usize]);
            let face = (b - a).cross(c - a);
            if face.length() > 1e-9 {
                assert!(face.dot(p.normals[t[0] as usize]) > 0.0, "{a} {b} {c}");
            }
        }
        assert!(p.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn faces_point_outwards() {
        let size = Vec3::new(1.0, 2.0, 3.0);
        for p in [plane(size), cuboid(size), sphere(size), cylinder(size)] {
            check(&p);
        }
    }

    #[test]
    fn solids_stand_on_the_ground_in_their_size() {
        let size = Vec3::new(1.0, 2.0, 3.0);
        for p in [cuboid(size), sphere(size), cylinder(size)] {
            let low = p.positions.iter().copied().reduce(Vec3::min).unwrap();
            let high = p.positions.iter().copied().reduce(Vec3::max).unwrap();
            assert!((high - low).abs_diff_eq(size, 1e-5) && low.y.abs() < 1e-6, "{low} {high}");
        }
    }

    #[test]
    fn srgb_bytes_come_back() {
        for byte in 0..=255u8 {
            assert_eq!(srgb_byte(crate::color::linear(f64::from(byte) / 255.0)), byte);
        }
    }
}
