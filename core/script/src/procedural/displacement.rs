//! Displacement of vertices by an image, subdivision, and texture projection.

use super::maps::brightness;
use choreo_asset::{Image, Primitive};
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// Names of the texture projections.
pub const PROJECTIONS: &[&str] = &["plane", "box", "sphere", "cylinder", "cone", "triplanar"];

/// Sets texture coordinates by a projection around the center of the shape. Every triangle gets its own vertices.
pub fn project(p: &mut Primitive, how: &str) {
    let [low, high] = bounds(p);
    let (middle, size) = ((low + high) * 0.5, (high - low).max(Vec3::splat(1e-6)));
    let old = std::mem::take(&mut p.indices);
    let pick =
        |list: &mut Vec<Vec3>| *list = old.iter().filter_map(|i| list.get(*i as usize).copied()).collect();
    pick(&mut p.positions);
    pick(&mut p.normals);
    if !p.colors.is_empty() {
        p.colors = old.iter().map(|i| p.colors[*i as usize]).collect();
    }
    let second = match p.uvs[1].is_empty() {
        true => Vec::new(),
        false => old.iter().map(|i| p.uvs[1][*i as usize]).collect(),
    };
    p.indices = (0..old.len() as u32).collect();
    if how == "triplanar" {
        p.uvs = [Vec::new(), Vec::new()];
        p.tangents = triplanar_tangents(p);
        return;
    }
    let apex = Vec3::new(middle.x, high.y, middle.z);
    let slant = p.positions.iter().map(|q| q.distance(apex)).fold(1e-6, f32::max);
    let mut uvs = Vec::with_capacity(p.positions.len());
    for vertices in p.positions.as_chunks::<3>().0 {
        let face = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]);
        let mut triangle = vertices.map(|at| {
            let q = at - middle;
            match how {
                "plane" => Vec2::new((at.x - low.x) / size.x, (at.z - low.z) / size.z),
                "box" => of_box(q / size.max_element(), face),
                _ => {
                    let u = libm::atan2f(q.x, q.z) / std::f32::consts::TAU + 0.5;
                    let v = match how {
                        "sphere" => {
                            libm::acosf((q.y / q.length().max(1e-12)).clamp(-1.0, 1.0)) / std::f32::consts::PI
                        }
                        "cylinder" => (high.y - at.y) / size.y,
                        _ => at.distance(apex) / slant,
                    };
                    Vec2::new(u, v)
                }
            }
        });
        if !matches!(how, "plane" | "box") {
            fix_seam(&mut triangle, vertices.map(|at| at - middle), size);
        }
        uvs.extend(triangle);
    }
    p.uvs = [uvs, second];
}

/// Minimum and maximum of the positions (axis-aligned bounding box).
pub fn bounds(p: &Primitive) -> [Vec3; 2] {
    let low = p.positions.iter().fold(Vec3::INFINITY, |a, b| a.min(*b));
    [low, p.positions.iter().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b))]
}

/// Tangents for triplanar projection: perpendicular to each vertex normal, from one axis per triangle.
fn triplanar_tangents(p: &Primitive) -> Vec<Vec4> {
    let of_triangle = |n: &[Vec3; 3]| {
        let sum = n[0] + n[1] + n[2];
        let least = sum.abs().min_element();
        let axis = if sum.x.abs() == least {
            Vec3::X
        } else if sum.y.abs() == least {
            Vec3::Y
        } else {
            Vec3::Z
        };
        n.map(|n| axis.cross(n).normalize_or(n.any_orthonormal_vector()).extend(1.0))
    };
    p.normals.as_chunks::<3>().0.iter().flat_map(of_triangle).collect()
}

/// Box projection: texture coordinates on the side of the box that a face points to; seen from there u points right and v down.
fn of_box(q: Vec3, face: Vec3) -> Vec2 {
    let away = face.abs();
    let (u, v) = if away.y >= away.x && away.y >= away.z {
        (q.x, if face.y > 0.0 { q.z } else { -q.z })
    } else if away.x >= away.z {
        (if face.x > 0.0 { -q.z } else { q.z }, -q.y)
    } else {
        (if face.z > 0.0 { q.x } else { -q.x }, -q.y)
    };
    Vec2::new(u, v) + 0.5
}

/// Corrects u of a triangle around the axis: across the seam it continues beyond 1, and a vertex on the axis gets the mean of the
/// others.
fn fix_seam(triangle: &mut [Vec2; 3], vertices: [Vec3; 3], size: Vec3) {
    let on_axis = vertices.map(|q| q.x.abs() + q.z.abs() < 1e-5 * size.max_element());
    let others = |on: bool| (0..3).filter(move |i| on_axis[*i] == on);
    let most = others(false).map(|i| triangle[i].x).fold(f32::NEG_INFINITY, f32::max);
    for i in others(false) {
        if most - triangle[i].x > 0.5 {
            triangle[i].x += 1.0;
        }
    }
    let count = others(false).count();
    if count > 0 {
        let mean = others(false).map(|i| triangle[i].x).sum::<f32>() / count as f32;
        others(true).for_each(|i| triangle[i].x = mean);
    }
}

/// Subdivides each triangle into four at the midpoints of its edges.
pub(crate) fn subdivide(p: &mut Primitive) {
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut indices = Vec::with_capacity(p.indices.len() * 4);
    let old = std::mem::take(&mut p.indices);
    for [a, b, c] in old.as_chunks::<3>().0 {
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let (i, j) = (a as usize, b as usize);
                let new = p.positions.len() as u32;
                p.positions.push((p.positions[i] + p.positions[j]) * 0.5);
                if !p.normals.is_empty() {
                    let n = p.normals[i] + p.normals[j];
                    p.normals.push(n.normalize_or(p.normals[i]));
                }
                if !p.colors.is_empty() {
                    p.colors.push((p.colors[i] + p.colors[j]) * 0.5);
                }
                for uvs in p.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
                    uvs.push((uvs[i] + uvs[j]) * 0.5);
                }
                new
            })
        };
        let (ab, bc, ca) = (middle(*a, *b), middle(*b, *c), middle(*c, *a));
        indices.extend([*a, ab, ca, ab, *b, bc, ca, bc, *c, ab, bc, ca]);
    }
    p.indices = indices;
}

/// Moves vertices along their normals by the brightness of an image, `height` metres where it is white; `tiles`: repeats of the
/// image. Recomputes the normals; vertices that had the same position and normal share a normal again.
pub fn displace(p: &mut Primitive, image: &Image, height: f32, tiles: f32) {
    let key = |v: Vec3| v.to_array().map(|c| (c + 0.0).to_bits());
    let groups: Vec<_> = p.positions.iter().zip(&p.normals).map(|(a, n)| (key(*a), key(*n))).collect();
    // Vertices with the same position and normal move by their mean brightness, so that the surface does not tear at a seam of
    // the texture coordinates.
    let mut heights: BTreeMap<_, (f32, f32)> = BTreeMap::new();
    for (group, uv) in groups.iter().zip(&p.uvs[0]) {
        let (sum, count) = heights.entry(*group).or_default();
        *sum += sample(image, *uv * tiles);
        *count += 1.0;
    }
    let mean = |group| heights.get(group).map_or(0.0, |(sum, count)| sum / count);
    let moved = p.positions.iter().zip(&p.normals).zip(&groups);
    p.positions = moved.map(|((at, n), group)| *at + *n * (height * mean(group))).collect();
    let mut sums: BTreeMap<_, Vec3> = BTreeMap::new();
    for vertices in p.indices.as_chunks::<3>().0 {
        let [a, b, c] = vertices.map(|i| p.positions[i as usize]);
        let face = (b - a).cross(c - a);
        for i in vertices {
            *sums.entry(groups[*i as usize]).or_insert(Vec3::ZERO) += face;
        }
    }
    for (normal, group) in p.normals.iter_mut().zip(&groups) {
        *normal = sums.get(group).map_or(*normal, |sum| sum.normalize_or(*normal));
    }
}

/// Brightness of an image at a texture coordinate, 0 to 1: bilinear, repeated.
fn sample(image: &Image, uv: Vec2) -> f32 {
    let (width, height) = (image.width as usize, image.height as usize);
    let texels = image.rgba.as_chunks::<4>().0;
    let at = (uv - uv.floor()) * Vec2::new(width as f32, height as f32) - 0.5;
    let texel = at.floor();
    let f = at - texel;
    let texel = |x: f32, y: f32| {
        let wrap = |v: f32, n: usize| (v as i64).rem_euclid(n as i64) as usize;
        let (x, y) = (wrap(texel.x + x, width), wrap(texel.y + y, height));
        f32::from(brightness(&texels[y * width + x])) / 255.0
    };
    let row = |y: f32| texel(0.0, y) * (1.0 - f.x) + texel(1.0, y) * f.x;
    row(0.0) * (1.0 - f.y) + row(1.0) * f.y
}

#[cfg(test)]
mod tests {
    use super::super::solids::solid;
    use super::*;

    #[test]
    fn a_projected_sphere_has_the_map_of_the_globe() {
        let mut sphere = solid("sphere", Vec3::ONE);
        project(&mut sphere, "sphere");
        assert_eq!(sphere.positions.len(), sphere.indices.len());
        let middle = Vec3::new(0.0, 0.5, 0.0);
        for (vertices, uvs) in
            sphere.positions.as_chunks::<3>().0.iter().zip(sphere.uvs[0].as_chunks::<3>().0)
        {
            for (at, uv) in vertices.iter().zip(uvs) {
                let q = (*at - middle) * 2.0;
                let (lat, lon) = (std::f32::consts::PI * uv.y, std::f32::consts::TAU * (uv.x - 0.5));
                let ring = libm::sinf(lat);
                let expected = Vec3::new(ring * libm::sinf(lon), libm::cosf(lat), ring * libm::cosf(lon));
                assert!(q.distance(expected) < 1e-3, "{at} {uv}");
            }
            // No triangle spans the whole image backwards.
            let us = uvs.map(|uv| uv.x);
            assert!(us.iter().all(|u| (u - us[0]).abs() < 0.5), "{us:?}");
        }
    }

    #[test]
    fn what_is_raised_evenly_is_a_larger_sphere() {
        let white = Image { name: String::new(), width: 1, height: 1, rgba: vec![255; 4], file: None };
        let mut sphere = solid("sphere", Vec3::ONE);
        let before = sphere.clone();
        subdivide(&mut sphere);
        assert_eq!(sphere.indices.len(), before.indices.len() * 4);
        displace(&mut sphere, &white, 0.25, 1.0);
        let middle = Vec3::new(0.0, 0.5, 0.0);
        for (at, n) in sphere.positions.iter().zip(&sphere.normals) {
            let q = *at - middle;
            assert!((q.length() - 0.75).abs() < 4e-3, "{at}");
            // Triangles at the poles have vertices at one point, and the edges between these have no midpoint of their own.
            assert!(q.normalize().dot(*n) > 0.99, "{at} {n}");
        }
        let black = Image { rgba: vec![0, 0, 0, 255], ..white };
        let mut same = before.clone();
        displace(&mut same, &black, 0.25, 1.0);
        assert_eq!(same.positions, before.positions);
    }
}
