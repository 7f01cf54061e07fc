//! Prim transforms: evaluates the ops of xformOpOrder at a time.

use crate::layer::{Attribute, Prim};
use choreo_importer_kit::decompose::decompose;
use choreo_motion::Transform;
use glam::{DMat4, DQuat, DVec3};

/// The numbers of an attribute at a time code: linear between samples, slerp for quaternions.
pub(crate) fn numbers_at(attribute: &Attribute, code: f64) -> Vec<f64> {
    let samples = &attribute.samples;
    let whole = |value: &crate::layer::Value| value.numbers().to_vec();
    let Some(first) = samples.first() else { return attribute.value.as_ref().map(whole).unwrap_or_default() };
    let next = samples.partition_point(|(time, _)| *time <= code);
    if next == 0 {
        return whole(&first.1);
    }
    let Some((later, b)) = samples.get(next) else { return whole(&samples[next - 1].1) };
    let (earlier, a) = &samples[next - 1];
    let (a, b) = (a.numbers(), b.numbers());
    let t = (code - earlier) / (later - earlier);
    if a.len() != b.len() {
        return a.to_vec();
    }
    if attribute.kind.starts_with("quat") {
        let turn = |(a, b): (&[f64], &[f64])| quaternion(a).slerp(quaternion(b), t).to_array();
        return a.chunks_exact(4).zip(b.chunks_exact(4)).flat_map(turn).collect();
    }
    a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect()
}

pub(crate) fn quaternion(numbers: &[f64]) -> DQuat {
    let q = DQuat::from_slice(numbers);
    if q.length_squared() > 1e-12 { q.normalize() } else { DQuat::IDENTITY }
}

/// A matrix in USD's convention: stored row by row, with row vectors multiplied from the left.
pub(crate) fn matrix(numbers: &[f64]) -> DMat4 {
    numbers.first_chunk::<16>().map_or(DMat4::IDENTITY, DMat4::from_cols_array)
}

/// Parent-from-prim matrix at a time code.
pub(crate) fn local_matrix(prim: &Prim, code: f64) -> DMat4 {
    let mut out = DMat4::IDENTITY;
    for full in prim.texts("xformOpOrder") {
        let (name, inverted) = match full.strip_prefix("!invert!") {
            Some(name) => (name, true),
            None => (full.as_str(), false),
        };
        let Some(attribute) = prim.attributes.get(name) else { continue };
        let operation = op_matrix(name, &numbers_at(attribute, code));
        out *= if inverted { operation.inverse() } else { operation };
    }
    if out.is_finite() { out } else { DMat4::IDENTITY }
}

fn op_matrix(name: &str, numbers: &[f64]) -> DMat4 {
    let kind = name.split(':').nth(1).unwrap_or_default();
    let vector = || numbers.first_chunk::<3>().map(|v| DVec3::from_array(*v));
    let angle = numbers.first().copied().unwrap_or(0.0).to_radians();
    match kind {
        "translate" => DMat4::from_translation(vector().unwrap_or(DVec3::ZERO)),
        "scale" => DMat4::from_scale(vector().unwrap_or(DVec3::ONE)),
        "orient" if numbers.len() == 4 => DMat4::from_quat(quaternion(numbers)),
        "transform" => matrix(numbers),
        "rotateX" => DMat4::from_rotation_x(angle),
        "rotateY" => DMat4::from_rotation_y(angle),
        "rotateZ" => DMat4::from_rotation_z(angle),
        _ => match (kind.strip_prefix("rotate"), vector()) {
            // Euler angles: the axis of the first letter is applied first.
            (Some(order), Some(v)) if order.len() == 3 => {
                order.chars().fold(DMat4::IDENTITY, |m, axis| match axis {
                    'X' => DMat4::from_rotation_x(v.x.to_radians()) * m,
                    'Y' => DMat4::from_rotation_y(v.y.to_radians()) * m,
                    _ => DMat4::from_rotation_z(v.z.to_radians()) * m,
                })
            }
            _ => DMat4::IDENTITY,
        },
    }
}

/// The largest rotation between two keys, degrees, because interpolated Euler angles do not follow the shortest arc.
const MAX_ROTATION_STEP: f64 = 1.0;

/// Increasing times of all samples of the transform ops, with added times between samples of angles.
pub(crate) fn sample_times(prim: &Prim) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::new();
    for name in prim.texts("xformOpOrder") {
        let name = name.strip_prefix("!invert!").unwrap_or(name);
        if let Some(attribute) = prim.attributes.get(name) {
            out.extend(attribute.samples.iter().map(|(time, _)| *time));
            for pair in attribute.samples.windows(2).filter(|_| name.starts_with("xformOp:rotate")) {
                let [(from, a), (to, b)] = pair else { continue };
                let turn =
                    a.numbers().iter().zip(b.numbers()).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
                let parts = (turn / MAX_ROTATION_STEP).ceil().clamp(1.0, 360.0) as u32;
                out.extend((1..parts).map(|part| from + (to - from) * f64::from(part) / f64::from(parts)));
            }
        }
    }
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

/// Translation, rotation and scale of a matrix; the identity where they are not finite.
pub(crate) fn to_transform(m: &DMat4) -> Transform {
    let parts = decompose(m);
    let out = Transform {
        translation: parts.translation.as_vec3(),
        rotation: parts.rotation.as_quat().normalize(),
        scale: parts.scale.as_vec3(),
    };
    if out.is_finite() { out } else { Transform::IDENTITY }
}
