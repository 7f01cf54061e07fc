//! Blend shapes. Each shape of a channel becomes a morph target, in-between shapes too. The weights of the targets follow the
//! channel's weight piecewise linearly, as FBX defines it, also below 0.

use crate::convert::vec3;
use crate::file::File;
use crate::geometry::Geometry;
use choreo_importer_kit::Result;
use glam::Vec3;
use ufbx::{BlendChannel, BlendShape, Mesh};

/// A morph target: offsets of every point of the mesh.
pub(crate) struct Target {
    pub positions: Vec<Vec3>,
    /// Empty where the file has no normals for the shape.
    pub normals: Vec<Vec3>,
}

impl Target {
    /// Applies the geometric transform that the mesh's points have.
    pub(crate) fn apply_geometry(&mut self, geometry: &Geometry) {
        self.positions.iter_mut().for_each(|p| *p = geometry.offset(*p));
        self.normals.iter_mut().for_each(|n| *n = geometry.normal_offset(*n));
    }
}

/// All blend channels of a mesh, in the order of its morph targets.
pub(crate) fn channels(mesh: &Mesh) -> impl Iterator<Item = &BlendChannel> {
    mesh.blend_deformers.as_ref().iter().flat_map(|d| d.channels.as_ref().iter()).map(|c| c.as_ref())
}

pub(crate) fn count(mesh: &Mesh) -> usize {
    channels(mesh).map(|c| c.keyframes.len()).sum()
}

pub(crate) fn names(mesh: &Mesh) -> Vec<String> {
    let mut out = Vec::new();
    for channel in channels(mesh) {
        let full = channel.keyframes.as_ref().iter().map(|k| k.target_weight).fold(f64::MIN, f64::max);
        for key in &channel.keyframes {
            let own = match channel.element.name.as_ref() {
                "" => key.shape.element.name.as_ref(),
                name => name,
            };
            out.push(match key.target_weight == full {
                true => own.to_string(),
                false => format!("{own} ({} %)", (key.target_weight * 100.0).round()),
            });
        }
    }
    out
}

/// Morph weights where no clip drives them.
pub(crate) fn rest_weights(mesh: &Mesh) -> Vec<f32> {
    let mut out = Vec::with_capacity(count(mesh));
    channels(mesh).for_each(|channel| append_shape_weights(channel, channel.weight, &mut out));
    out
}

/// Appends the weights of a channel's shapes at a weight of the channel. Each is piecewise linear: 1 at the shape's own weight,
/// falling to 0 at its neighbors' and at 0, which is the mesh without shapes. Past the outermost shape, the last two shapes are
/// extrapolated. On a side of 0 without shapes, the first shape of the other side is extrapolated through 0: a negative weight of
/// a channel with positive shapes moves the vertices the other way, as in ufbx (`ufbxi_update_blend_channel`) and in Maya.
pub(crate) fn append_shape_weights(channel: &BlendChannel, weight: f64, out: &mut Vec<f32>) {
    let places = || channel.keyframes.as_ref().iter().map(|k| k.target_weight);
    for (index, place) in places().enumerate() {
        if place == 0.0 {
            // A shape at weight 0 has no effect.
            out.push(0.0);
            continue;
        }
        // Distance from zero on the shape's side.
        let outward = |p: f64| p * place.signum();
        let inner = places().map(outward).filter(|p| *p > 0.0 && *p < place.abs()).fold(0.0, f64::max);
        let outer = places().map(outward).filter(|p| *p > place.abs()).fold(f64::INFINITY, f64::min);
        let double = places().take(index).any(|p| p == place);
        let through_zero = inner == 0.0 && places().map(outward).all(|p| p >= 0.0);
        let at = outward(weight);
        let up = (at - inner) / (place.abs() - inner);
        let value = match at {
            _ if double || at <= inner && !through_zero => 0.0,
            _ if at <= place.abs() || outer.is_infinite() => up,
            // Past the outermost shape, the last two are extrapolated.
            _ if at > outer && places().map(outward).any(|p| p > outer) => 0.0,
            _ => (outer - at) / (outer - place.abs()),
        };
        out.push(if value.is_finite() { value as f32 } else { 0.0 });
    }
}

/// Weights of the channel at which the weights of its shapes bend: those of the shapes, and 0 where shapes lie on both sides.
pub(crate) fn bend_weights(channel: &BlendChannel) -> Vec<f64> {
    let mut out: Vec<f64> = channel.keyframes.as_ref().iter().map(|k| k.target_weight).collect();
    out.retain(|p| p.is_finite());
    if out.iter().any(|p| *p < 0.0) && out.iter().any(|p| *p > 0.0) {
        out.push(0.0);
    }
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

pub(crate) fn targets(file: &File<'_>, mesh: &Mesh, place: &dyn Fn() -> String) -> Result<Vec<Target>> {
    let mut out = Vec::new();
    for key in channels(mesh).flat_map(|c| c.keyframes.as_ref()) {
        out.push(target(file, mesh, &key.shape, place)?);
    }
    Ok(out)
}

fn target(file: &File<'_>, mesh: &Mesh, shape: &BlendShape, place: &dyn Fn() -> String) -> Result<Target> {
    let points = mesh.num_vertices;
    let with_normals = !shape.normal_offsets.is_empty();
    file.charge(points, if with_normals { 24 } else { 12 }, place)?;
    let mut out = Target {
        positions: vec![Vec3::ZERO; points],
        normals: if with_normals { vec![Vec3::ZERO; points] } else { Vec::new() },
    };
    for (i, point) in shape.offset_vertices.as_ref().iter().enumerate() {
        let Some(position) = out.positions.get_mut(*point as usize) else { continue };
        // Only Blender writes a weight for each offset.
        let weight = shape.offset_weights.as_ref().get(i).copied().unwrap_or(1.0) as f32;
        let finite = |v: Vec3| if v.is_finite() { v } else { Vec3::ZERO };
        if let Some(offset) = shape.position_offsets.as_ref().get(i) {
            *position += finite(vec3(offset) * weight);
        }
        if let (Some(normal), Some(offset)) =
            (out.normals.get_mut(*point as usize), shape.normal_offsets.as_ref().get(i))
        {
            *normal += finite(vec3(offset) * weight);
        }
    }
    Ok(out)
}
