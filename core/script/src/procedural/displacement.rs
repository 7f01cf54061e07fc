//! Displacement of vertices by an image, subdivision, and texture projection.

use super::maps::brightness;
use choreo_asset::{Image, Primitive};
use glam::{Vec2, Vec3, Vec4};
use std::collections::BTreeMap;

/// Names of the texture projections.
pub(super) const PROJECTIONS: &[&str] = &["plane", "box", "sphere", "cylinder", "cone", "triplanar"];

/// Sets texture coordinates by a projection around the center of the shape. `how`: one of [`PROJECTIONS`]. Afterwards no two
/// triangles share a vertex.
pub(super) fn project_texture(p: &mut Primitive, how: &str) {
    let [low, high] = bounds(p);
    let (middle, size) = ((low + high) * 0.5, (high - low).max(Vec3::splat(1e-6)));
    let old = std::mem::take(&mut p.indices);
    let unshare =
        |list: &mut Vec<Vec3>| *list = old.iter().filter_map(|i| list.get(*i as usize).copied()).collect();
    unshare(&mut p.positions);
    unshare(&mut p.normals);
    if !p.colors.is_empty() {
        p.colors = old.iter().map(|i| p.colors[*i as usize]).collect();
    }
    let second_uvs = match p.uvs[1].is_empty() {
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
                "box" => box_uv(q / size.max_element(), face),
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
    p.uvs = [uvs, second_uvs];
}

/// Axis-aligned bounding box of the positions: minimum and maximum.
pub(super) fn bounds(p: &Primitive) -> [Vec3; 2] {
    let low = p.positions.iter().fold(Vec3::INFINITY, |a, b| a.min(*b));
    [low, p.positions.iter().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b))]
}

/// Tangents for triplanar projection: perpendicular to the vertex normal and to the axis that is most nearly perpendicular to
/// the normals of the triangle.
fn triplanar_tangents(p: &Primitive) -> Vec<Vec4> {
    let triangle_tangents = |n: &[Vec3; 3]| {
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
    p.normals.as_chunks::<3>().0.iter().flat_map(triangle_tangents).collect()
}

/// Texture coordinates of the box projection, on the side of the box to which a face points. Seen from outside, u points right
/// and v down. `face`: normal of the face, of any length.
fn box_uv(q: Vec3, face: Vec3) -> Vec2 {
    let extent = face.abs();
    let (u, v) = if extent.y >= extent.x && extent.y >= extent.z {
        (q.x, if face.y > 0.0 { q.z } else { -q.z })
    } else if extent.x >= extent.z {
        (if face.x > 0.0 { -q.z } else { q.z }, -q.y)
    } else {
        (if face.z > 0.0 { q.x } else { -q.x }, -q.y)
    };
    Vec2::new(u, v) + 0.5
}

/// Corrects u of a triangle of a projection around the y axis. In a triangle that crosses the seam, u continues above 1. A vertex
/// on the axis gets the mean u of the other vertices.
fn fix_seam(triangle: &mut [Vec2; 3], vertices: [Vec3; 3], size: Vec3) {
    let on_axis = vertices.map(|q| q.x.abs() + q.z.abs() < 1e-5 * size.max_element());
    let with_axis = |is_on_axis: bool| (0..3).filter(move |i| on_axis[*i] == is_on_axis);
    let largest = with_axis(false).map(|i| triangle[i].x).fold(f32::NEG_INFINITY, f32::max);
    for i in with_axis(false) {
        if largest - triangle[i].x > 0.5 {
            triangle[i].x += 1.0;
        }
    }
    let count = with_axis(false).count();
    if count > 0 {
        let mean = with_axis(false).map(|i| triangle[i].x).sum::<f32>() / count as f32;
        with_axis(true).for_each(|i| triangle[i].x = mean);
    }
}

/// Subdivides each triangle into four at the midpoints of its edges.
pub(crate) fn subdivide(p: &mut Primitive) {
    let mut midpoints: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut indices = Vec::with_capacity(p.indices.len() * 4);
    let old = std::mem::take(&mut p.indices);
    for [a, b, c] in old.as_chunks::<3>().0 {
        let mut midpoint = |a: u32, b: u32| {
            *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
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
        let (ab, bc, ca) = (midpoint(*a, *b), midpoint(*b, *c), midpoint(*c, *a));
        indices.extend([*a, ab, ca, ab, *b, bc, ca, bc, *c, ab, bc, ca]);
    }
    p.indices = indices;
}

/// Displaces vertices along their normals by the brightness of an image. `height`: metres at white; `tiles`: repetitions of the
/// image per unit of texture coordinates. Recomputes the normals; vertices that had the same position and normal keep a common
/// normal.
pub(super) fn displace(p: &mut Primitive, image: &Image, height: f32, tiles: f32) {
    let key = |v: Vec3| v.to_array().map(|c| (c + 0.0).to_bits());
    let groups: Vec<_> = p.positions.iter().zip(&p.normals).map(|(a, n)| (key(*a), key(*n))).collect();
    // Vertices with the same position and normal move by their mean brightness, so that no gap opens at a seam of the texture
    // coordinates.
    let mut heights: BTreeMap<_, (f32, f32)> = BTreeMap::new();
    for (group, uv) in groups.iter().zip(&p.uvs[0]) {
        let (sum, count) = heights.entry(*group).or_default();
        *sum += sample_brightness(image, *uv * tiles);
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
fn sample_brightness(image: &Image, uv: Vec2) -> f32 {
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
    use super::super::solids::shape_mesh;
    use super::*;

    #[test]
    fn sphere_projection_gives_longitude_and_latitude() {
        let mut sphere = shape_mesh("sphere", Vec3::ONE);
        project_texture(&mut sphere, "sphere");
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
            // No triangle spans the whole image because of the seam.
            let us = uvs.map(|uv| uv.x);
            assert!(us.iter().all(|u| (u - us[0]).abs() < 0.5), "{us:?}");
        }
    }

    #[test]
    fn displacement_by_white_enlarges_a_sphere_and_by_black_keeps_it() {
        let white = Image { name: String::new(), width: 1, height: 1, rgba: vec![255; 4], file: None };
        let mut sphere = shape_mesh("sphere", Vec3::ONE);
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
